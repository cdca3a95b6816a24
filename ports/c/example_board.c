/*
 * A board in C: each axis of the export with its counts, its flash banks and its share of one serial line. Copy it and replace the part
 * "The board".
 *
 *   SysTick, 100 us:  encoder timers, converters -> sagnac_board_tick of each axis -> frames that wait
 *   main loop:        octets heard -> the axis they are for -> its upload -> its banks;  frames -> the line;  once a second, the checks
 *
 * It runs as it is on an emulated MPS2 board (QEMU, mps2-an386, 25 MHz):
 *   arm-none-eabi-gcc -std=c99 -O2 -mcpu=cortex-m4 -mthumb -I. --specs=nosys.specs -nostartfiles -Wl,--entry=main \
 *     -Wl,--section-start=.vectors=0x0 example/board.c sagnac_*.c -o board.elf                     (without sagnac_unit_check.c)
 *   qemu-system-arm -M mps2-an386 -nographic -monitor none -serial stdio -icount shift=4 -kernel board.elf | sagnac line read
 *
 * That board has no encoder, no converter and no flash that a program can write: two of its timers count instead of fringes, the
 * thermometers stand in the middle of their span, light and pickoff are 0, and the banks are in memory. Three axes take most of its time:
 * ticks that it misses are made up, and the frames say so.
 */
#include <stdint.h>
#include <string.h>

#include "sagnac_board.h"
#include "sagnac_unit.h"
#include "sagnac_upload.h"

/* ------------------------------------------------------------------ The board: replace this part. */

#define CLOCK_HZ 25000000U
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SYSTICK_CONTROL REGISTER(0xE000E010U)
#define SYSTICK_RELOAD REGISTER(0xE000E014U)
#define SYSTICK_CURRENT REGISTER(0xE000E018U)
#define INTERRUPT_ENABLE REGISTER(0xE000E100U)
#define UART_DATA REGISTER(0x40004000U)
#define UART_STATE REGISTER(0x40004004U)
#define UART_CONTROL REGISTER(0x40004008U)
#define UART_INTERRUPT REGISTER(0x4000400CU)
#define UART_DIVIDER REGISTER(0x40004010U)
#define TIMER_CONTROL(n) REGISTER(0x40000000U + (0x1000U * (n)))
#define TIMER_VALUE(n) REGISTER(0x40000004U + (0x1000U * (n)))
#define TIMER_RELOAD(n) REGISTER(0x40000008U + (0x1000U * (n)))
#define TIMERS 2U
/* Of a tick. */
#define CLOCKS (CLOCK_HZ / 10000U)

/* Octets that have arrived. The longest upload has 1,045: all of it may arrive while flash is erased. A sender that waits for the reply to
 * each message needs no more room than one frame. */
#define HEARD 2048U
static volatile sagnac_octet heard[HEARD];
static volatile uint32_t heard_end;
static uint32_t heard_begin;

static void uart_interrupt(void)
{
    /* First: an octet that arrives in between raises it again. */
    UART_INTERRUPT = 2U;
    while ((UART_STATE & 2U) != 0U) {
        heard[heard_end % HEARD] = (sagnac_octet)(UART_DATA & 0xFFU);
        heard_end++;
    }
}

static void say_octet(uint32_t octet)
{
    while ((UART_STATE & 1U) != 0U) {
    }
    UART_DATA = octet;
}

/* Counts of an axis since the last call: the difference of a free-running counter, as an encoder timer has it. */
static int32_t fringes(uint32_t axis)
{
    static uint32_t before[SAGNAC_UNIT_AXES];
    static uint32_t has_before[SAGNAC_UNIT_AXES];
    /* These count down, 2,500 in a tick. */
    const uint32_t now = 0U - TIMER_VALUE(axis % TIMERS);
    const uint32_t counts = (has_before[axis] != 0U) ? ((now - before[axis]) / 100U) : 0U;
    /* The rest stays for the next tick: no count is lost. */
    before[axis] = (has_before[axis] != 0U) ? (before[axis] + (100U * counts)) : now;
    has_before[axis] = SAGNAC_YES;
    return (int32_t)counts;
}

/* Ticks since the last call: a counter that nothing stops knows it. One, more after a pause, and none for an interrupt that the pause held back. */
static uint32_t ticks_passed(void)
{
    static uint32_t at;
    static uint32_t has_begun;
    const uint32_t now = 0U - TIMER_VALUE(0U);
    const uint32_t passed = (has_begun != 0U) ? ((now - at) + (CLOCKS / 2U)) / CLOCKS : 1U;
    at = (has_begun != 0U) ? (at + (CLOCKS * passed)) : now;
    has_begun = SAGNAC_YES;
    return passed;
}

/* The code of an input of the image. */
static int32_t thermometer(const sagnac_input *input)
{
    const int64_t middle_q24 = ((int64_t)input->span_lo_q24 + (int64_t)input->span_hi_q24) / 2;
    return (int32_t)(((middle_q24 - (int64_t)input->offset_q24) * sagnac_power(input->gain_shift)) / (int64_t)input->gain_mantissa);
}

static void drive(uint32_t axis, const sagnac_actuators *actuators)
{
    (void)axis;
    (void)actuators;
}

static sagnac_octet memory[SAGNAC_UNIT_AXES][2][4096];

static uint32_t flash_read(void *context, uint32_t offset, sagnac_octet *octets, uint32_t count)
{
    memcpy(octets, (sagnac_octet *)context + offset, count);
    return SAGNAC_YES;
}

static uint32_t flash_program(void *context, uint32_t offset, const sagnac_octet *octets, uint32_t count)
{
    uint32_t i;
    for (i = 0U; i < count; i++) {
        ((sagnac_octet *)context)[offset + i] &= octets[i];
    }
    return SAGNAC_YES;
}

static uint32_t flash_erase(void *context, uint32_t from, uint32_t to)
{
    memset((sagnac_octet *)context + from, 0xFF, to - from);
    return SAGNAC_YES;
}

static void start_the_board(void)
{
    uint32_t timer;
    for (timer = 0U; timer < TIMERS; timer++) {
        TIMER_RELOAD(timer) = 0xFFFFFFFFU;
        TIMER_VALUE(timer) = 0xFFFFFFFFU;
        TIMER_CONTROL(timer) = 1U;
    }
    UART_DIVIDER = CLOCK_HZ / 921600U;
    UART_CONTROL = 11U;
    INTERRUPT_ENABLE = 1U;
    SYSTICK_RELOAD = CLOCKS - 1U;
    SYSTICK_CURRENT = 0U;
    SYSTICK_CONTROL = 7U;
}

/* ------------------------------------------------------------------ The program: the same on every board. */

#define WAITING 8U

typedef struct {
    sagnac_gyro gyro;
    sagnac_flash flash;
    sagnac_banks banks;
    sagnac_loaded loaded;
    sagnac_upload upload;
    sagnac_board board;
    sagnac_frame waiting[WAITING]; /* frames for the line */
    volatile uint32_t end;
    uint32_t begin;
} axis_of_unit;

static const sagnac_image *const images[SAGNAC_UNIT_AXES] = SAGNAC_UNIT_IMAGES;
static const sagnac_board_setup setup = {.path = &sagnac_unit_path_length, .light = &sagnac_unit_intensity, .frame_ticks = SAGNAC_FRAME_TICKS};
static axis_of_unit axes[SAGNAC_UNIT_AXES];
static sagnac_trust trust;
static volatile uint32_t seconds;

static void say(const sagnac_frame *frame)
{
    sagnac_octet octets[SAGNAC_MAX_FRAME];
    const uint32_t length = sagnac_frame_octets(frame, octets);
    uint32_t i;
    for (i = 0U; i < length; i++) {
        say_octet(octets[i]);
    }
}

static void tick_axis(uint32_t number, uint32_t missed)
{
    axis_of_unit *axis = &axes[number];
    sagnac_sample sample = {{0, 0, 0, 0}, 0U, 0, 0, 0U};
    sagnac_actuators actuators;
    sagnac_frame frame;
    uint32_t i;
    for (i = 0U; i < axis->board.image.input_count; i++) {
        if (axis->board.image.inputs[i].source == SAGNAC_CODE) {
            sample.codes[i] = thermometer(&axis->board.image.inputs[i]);
            sample.present |= (uint32_t)1U << i;
        }
    }
    sagnac_board_make_up(&axis->board, missed);
    if (sagnac_board_tick(&axis->board, fringes(number), 0U, &sample, &actuators, &frame) != 0U) {
        /* A frame that does not fit is missing on the line: its number shows it. */
        if ((axis->end - axis->begin) < WAITING) {
            axis->waiting[axis->end % WAITING] = frame;
            axis->end++;
        }
    }
    drive(number, &actuators);
}

static void tick_interrupt(void)
{
    static uint32_t ticks;
    const uint32_t passed = ticks_passed();
    uint32_t number;
    for (number = 0U; (passed > 0U) && (number < SAGNAC_UNIT_AXES); number++) {
        tick_axis(number, passed - 1U);
    }
    ticks += passed;
    if (ticks >= 10000U) {
        ticks -= 10000U;
        seconds++;
    }
}

/* Between two ticks. */
static void mask(void)
{
    __asm volatile("cpsid i" ::: "memory");
}

static void unmask(void)
{
    __asm volatile("cpsie i" ::: "memory");
}

static void start_axis(uint32_t number)
{
    axis_of_unit *axis = &axes[number];
    const sagnac_image *image = images[number];
    sagnac_frame reply;
    memset(memory[number], 0xFF, sizeof memory[number]);
    memcpy(axis->gyro.serial, image->serial, sizeof axis->gyro.serial);
    axis->gyro.axis = image->axis;
    axis->gyro.tick_ns = image->tick_ns;
    axis->gyro.scale_factor_femto_arcsec = image->scale_factor_femto_arcsec;
    axis->gyro.quantum_nano_counts = image->quantum_nano_counts;
    /* Four times the drift of this unit's image is more than another of the same gyro needs. */
    axis->gyro.largest_increment = 4 * sagnac_image_reach(image, SAGNAC_BIAS);
    axis->gyro.largest_scale = 4 * sagnac_image_reach(image, SAGNAC_SCALE);
    axis->gyro.largest_work = 4U * sagnac_image_work(image);
    axis->flash.context = memory[number];
    axis->flash.capacity = sizeof memory[number];
    axis->flash.read_size = 1U;
    axis->flash.program_size = 1U;
    axis->flash.erase_size = sizeof memory[number][0];
    axis->flash.read = flash_read;
    axis->flash.program = flash_program;
    axis->flash.erase = flash_erase;
    (void)sagnac_banks_open(&axis->banks, &axis->flash, 0U, sizeof memory[number][0]);
    sagnac_banks_start(&axis->banks, &axis->gyro, 0U, &axis->loaded);
    sagnac_upload_start(&axis->upload, &trust);
    sagnac_board_start(&axis->board, &axis->loaded, &setup, SAGNAC_POWER_ON, 0U);
    sagnac_reply(0U, SAGNAC_REPLY_DONE, &axis->loaded, &reply);
    say(&reply);
}

/* A frame for one axis, or for all of them. */
static void handle(const sagnac_frame *frame)
{
    uint32_t number;
    for (number = 0U; number < SAGNAC_UNIT_AXES; number++) {
        axis_of_unit *axis = &axes[number];
        sagnac_handled handled;
        sagnac_upload_handle(&axis->upload, frame, &axis->banks, &axis->gyro, &axis->loaded, &handled);
        if (handled.changed != 0U) {
            mask();
            sagnac_board_use(&axis->board, &axis->loaded);
            unmask();
        }
        if (handled.handled != 0U) {
            say(&handled.answer);
        }
    }
}

static void once_a_second(axis_of_unit *axis)
{
    uint32_t is_intact;
    sagnac_upload_second(&axis->upload);
    mask();
    is_intact = sagnac_board_is_intact(&axis->board, &setup);
    unmask();
    if (is_intact == 0U) {
        sagnac_banks_load(&axis->banks, &axis->gyro, &axis->loaded);
        mask();
        sagnac_board_mend(&axis->board, &axis->loaded, &setup);
        unmask();
    }
}

int main(void)
{
    sagnac_frame_reader reader;
    uint32_t second = 0U;
    uint32_t number;
    start_the_board();
    mask();
    sagnac_trust_nobody(&trust);
    sagnac_frame_start(&reader);
    for (number = 0U; number < SAGNAC_UNIT_AXES; number++) {
        start_axis(number);
    }
    unmask();
    for (;;) {
        sagnac_frame frame;
        while (heard_begin != heard_end) {
            const uint32_t octet = heard[heard_begin % HEARD];
            heard_begin++;
            if (sagnac_frame_push(&reader, octet, &frame) != 0U) {
                handle(&frame);
            }
        }
        for (number = 0U; number < SAGNAC_UNIT_AXES; number++) {
            axis_of_unit *axis = &axes[number];
            if (axis->begin != axis->end) {
                say(&axis->waiting[axis->begin % WAITING]);
                axis->begin++;
            }
            if (second != seconds) {
                once_a_second(axis);
            }
        }
        second = seconds;
        __asm volatile("wfi");
    }
}

/* Where the processor begins: the end of the first 4 MB is the stack, SysTick is exception 15, the line's receiver interrupt 0. */
static void stopped(void)
{
    for (;;) {
    }
}

static void begin(void)
{
    (void)main();
    stopped();
}

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t stack;
    void (*handlers[16])(void);
} vectors = {0x00400000U,
             {begin, stopped, stopped, stopped, stopped, stopped, stopped, stopped, stopped, stopped, stopped, stopped, stopped, stopped,
              tick_interrupt, uart_interrupt}};
