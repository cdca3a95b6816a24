/*
 * Instructions and stack of the correction in C, on an emulated Cortex-M4F.
 *
 *   measure IMAGE
 *
 * The emulator runs one instruction a nanosecond (-icount shift=0) and SysTick counts 25 MHz of that time: 40 instructions a count, so
 * everything is run many times. Instructions are not cycles.
 */
#include <stdio.h>

#include "sagnac_board.h"
#include "sagnac_unit.h"

#define PER_COUNT 40U
#define TIMES 2000U
#define MOST 772U
#define DEPTH 1024U
#define PAINT UINT32_C(0x5afe57ac)

#define SYSTICK_CONTROL (*(volatile uint32_t *)0xE000E010U)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xE000E014U)
#define SYSTICK_NOW (*(volatile uint32_t *)0xE000E018U)

static unsigned char bytes[MOST];
static sagnac_image image;
static sagnac_compensator_state start_state, state;
static sagnac_slow_update start_update, update;
static int32_t codes[4] = {335544320, 335544320, 335544320, 335544320};
static sagnac_output output;

static uint32_t octet(const void *context, uint32_t index)
{
    (void)context;
    return index < MOST ? bytes[index] : 0U;
}

static void nothing(void)
{
    state = start_state;
    update = start_update;
}

static void whole_update(void)
{
    nothing();
    (void)sagnac_compensator_update(&image, &state, codes, 15U);
}

static void slice(void)
{
    nothing();
    (void)sagnac_compensator_advance_update(&image, &update);
}

static void tick(void)
{
    nothing();
    (void)sagnac_compensator_tick(&image, &state, 37, &output);
}

static uint32_t counts_of(uint32_t times, void (*act)(void))
{
    uint32_t before, i;
    before = SYSTICK_NOW;
    for (i = 0U; i < times; i++) {
        act();
    }
    return (before - SYSTICK_NOW) & 0xFFFFFFU;
}

static uint32_t counts(void (*act)(void))
{
    return counts_of(TIMES, act);
}

/* Of one call, without the copies around it. */
static unsigned instructions(void (*act)(void))
{
    const uint32_t with = counts(act), without = counts(nothing);
    return (unsigned)(((with - without) * PER_COUNT + TIMES - 1U) / TIMES);
}

/* Bytes below the caller's stack that a call used. */
static unsigned stack_of(void (*act)(void))
{
    volatile uint32_t room[DEPTH];
    uint32_t i;
    for (i = 0U; i < DEPTH; i++) {
        room[i] = PAINT;
    }
    return (act == NULL) ? (unsigned)room[0] : 0U;
}

static unsigned stack_used(void (*act)(void))
{
    volatile uint32_t here = 0U;
    volatile uint32_t *below = &here - DEPTH + 64;
    uint32_t i = 0U;
    (void)stack_of(act);
    act();
    while (i < DEPTH - 64U && below[i] == PAINT) {
        i++;
    }
    return (unsigned)((DEPTH - 64U - i) * 4U);
}

static sagnac_loaded loaded;
static sagnac_board board;

/* Stripping, both loops and the frame, as the Rust program measures it. */
static void board_tick(void)
{
    const sagnac_sample sample = {{335544320, 335544320, 335544320, 335544320}, 15U, 0, 30000, 0U};
    sagnac_actuators actuators;
    sagnac_frame frame;
    (void)sagnac_board_tick(&board, 37, 0U, &sample, &actuators, &frame);
}

static void swap(void)
{
    sagnac_board_use(&board, &loaded);
}

/* Every tick around a slow update, and the change to another image between two ticks. */
static void measure_board(void)
{
    sagnac_board_setup setup = {&sagnac_unit_path_length, &sagnac_unit_intensity, SAGNAC_YES, 50U, 8388608U,
                                SAGNAC_NO, {0U, 0U, 0U}, SAGNAC_NO, SAGNAC_FRAME_TICKS};
    unsigned largest = 0U;
    uint32_t i;
    loaded.image = image;
    loaded.image_sum = sagnac_image_sum(&image);
    sagnac_board_start(&board, &loaded, &setup, SAGNAC_POWER_ON, 0U);
    for (i = 0U; i < 1000U; i++) {
        board_tick();
    }
    sagnac_board_make_up(&board, board.state.ticks_to_update + image.period_ticks - 100U);
    for (i = 0U; i < 200U; i++) {
        const unsigned now = (unsigned)(counts_of(1U, board_tick) * PER_COUNT);
        largest = now > largest ? now : largest;
    }
    printf("tick-largest %u\n", largest);
    loaded.digest[0] = 1U;
    printf("swap %u\n", (unsigned)(counts_of(1U, swap) * PER_COUNT));
    printf("no-swap %u\n", (unsigned)(counts_of(1U, swap) * PER_COUNT));
}

int main(int argc, char **argv)
{
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    unsigned largest = 0U;
    uint32_t length;
    if (file == NULL) {
        return 2;
    }
    length = (uint32_t)fread(bytes, 1, MOST, file);
    fclose(file);
    if (sagnac_image_load(&image, octet, NULL, length) != SAGNAC_IMAGE_OK) {
        return 3;
    }
    SYSTICK_RELOAD = 0xFFFFFFU;
    SYSTICK_NOW = 0U;
    SYSTICK_CONTROL = 5U;
    measure_board();
    sagnac_compensator_start(&start_state);
    printf("slow-update %u\n", instructions(whole_update));
    printf("stack-update %u\n", stack_used(whole_update));
    sagnac_compensator_begin_update(&image, &start_state, codes, 15U, &start_update);
    for (;;) {
        const unsigned now = instructions(slice);
        largest = now > largest ? now : largest;
        if (sagnac_compensator_advance_update(&image, &start_update) != 0U) {
            break;
        }
    }
    printf("slice %u\n", largest);
    (void)sagnac_compensator_update(&image, &start_state, codes, 15U);
    printf("tick-slewing %u\n", instructions(tick));
    image.output_limit = 5U;
    printf("tick-limited %u\n", instructions(tick));
    image.output_limit = 2147483647U;
    (void)sagnac_compensator_skip(&start_state, image.slew_ticks);
    printf("tick %u\n", instructions(tick));
    printf("stack-tick %u\n", stack_used(tick));
    return 0;
}
