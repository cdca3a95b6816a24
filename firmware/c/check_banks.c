/*
 * The banks in C against records of the Rust crate: every store, roll back, confirmation and start, with the power cut where the record
 * says, on a flash that tears words and leaves erases half done exactly as that of the Rust tests.
 *
 *   check_banks FILE     0 if every result, every octet of the flash and every load is as the records say
 *
 * Records, little-endian:
 *   F   program size (2), erase size (2), seed (8)                          an erased flash
 *   G   serial (32), axis (1), tick (4), scale factor (8), quantum (8), largest increment (8), scale (8), work (4)
 *   D   worn (1), first and last unreadable octet (2, 2)
 *   O   operation (1), flags (1), steps before the power goes (4), seed of the tear (8), length (2), image;
 *       then what must be: result (1), steps (4), hash of the flash (4), origin (1), trial (1), sequence (4), and for each bank
 *       content (1), store (4)
 * Operations: 0 store, 1 on trial, 2 roll back, 3 confirm, 4 start after `image[0]` watchdog resets, 6 a bit of the range that `image` names flips, 7 octets appear at
 * the place that it names first. Flags: 1 on the flash that was kept last, 2 keep the flash afterwards.
 */
#include <stdio.h>
#include <string.h>

#include "sagnac_banks.h"

#define ROOM 4096U
#define BANK 2048U
#define NEVER UINT32_C(0xffffffff)

typedef struct {
    unsigned char bytes[ROOM];
    unsigned char programmed[ROOM / 8U];
    uint64_t dice;
} flash_state;

static flash_state now, kept;
static uint32_t unit_size, sector_size, steps, steps_left, worn, unreadable_from, unreadable_to;
static sagnac_flash flash;
static sagnac_banks banks;
static sagnac_gyro gyro;
static sagnac_loaded loaded;
static sagnac_octet image[SAGNAC_MAX_IMAGE];

/* splitmix64 (Steele, Lea and Flood 2014). */
static uint64_t throw_dice(void)
{
    uint64_t z;
    now.dice += UINT64_C(0x9e3779b97f4a7c15);
    z = now.dice;
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* One step: 1 while there is power, 0 in the step in which it goes, -1 without power. */
static int step(void)
{
    steps++;
    if (steps_left == NEVER) {
        return 1;
    }
    if (steps_left == 0U) {
        return -1;
    }
    steps_left--;
    return steps_left > 0U;
}

static uint32_t was_programmed(uint32_t unit)
{
    return ((uint32_t)now.programmed[unit / 8U] >> (unit % 8U)) & 1U;
}

static void set_programmed(uint32_t unit, uint32_t to)
{
    const uint32_t bit = UINT32_C(1) << (unit % 8U);
    const uint32_t old = now.programmed[unit / 8U];
    now.programmed[unit / 8U] = (unsigned char)(to != 0U ? (old | bit) : (old & ~bit & 255U));
}

static uint32_t flash_read(void *context, uint32_t offset, sagnac_octet *octets, uint32_t count)
{
    (void)context;
    if ((offset < unreadable_to && unreadable_from < offset + count) || offset > ROOM || count > ROOM - offset) {
        return SAGNAC_NO;
    }
    memcpy(octets, now.bytes + offset, count);
    return SAGNAC_YES;
}

static uint32_t program_unit(uint32_t unit, const sagnac_octet *with)
{
    const int whole = step();
    uint32_t i;
    if (whole < 0 || was_programmed(unit) != 0U) {
        return SAGNAC_NO;
    }
    set_programmed(unit, 1U);
    for (i = 0U; i < unit_size; i++) {
        const uint32_t mine = whole != 0 ? 0U : (uint32_t)(throw_dice() & 255U);
        const uint32_t torn = whole != 0 ? 0U : (mine & (uint32_t)(throw_dice() & 255U));
        now.bytes[unit * unit_size + i] &= (unsigned char)(with[i] | torn);
    }
    if (worn != 0U) {
        now.bytes[unit * unit_size] |= 1U;
    }
    return whole != 0 ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t flash_program(void *context, uint32_t offset, const sagnac_octet *octets, uint32_t count)
{
    uint32_t at, done = SAGNAC_YES;
    (void)context;
    if (offset % unit_size != 0U || count % unit_size != 0U || offset > ROOM || count > ROOM - offset) {
        return SAGNAC_NO;
    }
    for (at = 0U; at < count && done != 0U; at += unit_size) {
        done = program_unit((offset + at) / unit_size, octets + at);
    }
    return done;
}

static uint32_t erase_sector(uint32_t sector)
{
    const uint32_t per_sector = sector_size / unit_size;
    const int whole = step();
    uint32_t how, unit, i;
    if (whole < 0) {
        return SAGNAC_NO;
    }
    how = (uint32_t)(throw_dice() % 4U);
    for (unit = sector * per_sector; unit < (sector + 1U) * per_sector; unit++) {
        const uint32_t fate = whole != 0 || how == 0U ? 0U : (uint32_t)(throw_dice() % (how == 1U ? 2U : 3U));
        for (i = unit * unit_size; i < (unit + 1U) * unit_size; i++) {
            if (fate == 0U) {
                now.bytes[i] = 0xffU;
            } else if (fate == 2U) {
                now.bytes[i] |= (unsigned char)(throw_dice() & 255U);
            }
        }
        if (fate == 0U) {
            set_programmed(unit, 0U);
        }
    }
    return whole != 0 ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t flash_erase(void *context, uint32_t from, uint32_t to)
{
    uint32_t sector, done = SAGNAC_YES;
    (void)context;
    for (sector = from / sector_size; sector < to / sector_size && done != 0U; sector++) {
        done = erase_sector(sector);
    }
    return done;
}

static uint64_t number(FILE *file, int octets)
{
    uint64_t value = 0U;
    int i;
    for (i = 0; i < octets; i++) {
        value |= (uint64_t)(fgetc(file) & 255) << (8 * i);
    }
    return value;
}

static uint32_t word(FILE *file, int octets)
{
    return (uint32_t)number(file, octets);
}

static int64_t as_signed(uint64_t value)
{
    return value <= (uint64_t)INT64_MAX ? (int64_t)value : -(int64_t)(UINT64_MAX - value) - 1;
}

static int new_flash(FILE *file)
{
    unit_size = word(file, 2);
    sector_size = word(file, 2);
    memset(&now, 0, sizeof now);
    memset(now.bytes, 0xff, sizeof now.bytes);
    now.dice = number(file, 8);
    kept = now;
    steps_left = NEVER;
    worn = unreadable_from = unreadable_to = 0U;
    flash.context = NULL;
    flash.capacity = 2U * ROOM;
    flash.read_size = 1U;
    flash.program_size = unit_size;
    flash.erase_size = sector_size;
    flash.read = flash_read;
    flash.program = flash_program;
    flash.erase = flash_erase;
    return sagnac_banks_open(&banks, &flash, 0U, BANK) != 0U;
}

static void new_gyro(FILE *file)
{
    int i;
    for (i = 0; i < 8; i++) {
        gyro.serial[i] = word(file, 4);
    }
    gyro.axis = word(file, 1);
    gyro.tick_ns = word(file, 4);
    gyro.scale_factor_femto_arcsec = number(file, 8);
    gyro.quantum_nano_counts = number(file, 8);
    gyro.largest_increment = as_signed(number(file, 8));
    gyro.largest_scale = as_signed(number(file, 8));
    gyro.largest_work = word(file, 4);
}

static uint32_t act(uint32_t operation, uint32_t length)
{
    switch (operation) {
    case 0:
    case 1:
        return (uint32_t)sagnac_banks_store(&banks, &gyro, image, length, operation);
    case 2:
        return (uint32_t)sagnac_banks_roll_back(&banks, &gyro);
    case 3:
        return (uint32_t)sagnac_banks_confirm(&banks, &gyro);
    case 4:
        sagnac_banks_start(&banks, &gyro, (uint32_t)image[0], &loaded);
        return 0U;
    case 6: {
        const uint32_t from = sagnac_read_u16(sagnac_octet_at, image, 0U), to = sagnac_read_u16(sagnac_octet_at, image, 2U);
        const uint32_t at = from + (uint32_t)(throw_dice() % (to - from));
        now.bytes[at] ^= (unsigned char)(UINT32_C(1) << (throw_dice() % 8U));
        return 0U;
    }
    case 7:
        memcpy(now.bytes + sagnac_read_u16(sagnac_octet_at, image, 0U), image + 2, length - 2U);
        return 0U;
    default:
        return 0U;
    }
}

/* What differs; 0 for nothing. */
static int operate(FILE *file)
{
    const uint32_t operation = word(file, 1), flags = word(file, 1), cut = word(file, 4);
    const uint64_t tear = number(file, 8);
    const uint32_t length = word(file, 2);
    uint32_t hash = UINT32_C(2166136261), result, i;
    int differs;
    if (length > SAGNAC_MAX_IMAGE) {
        return 1;
    }
    for (i = 0U; i < length; i++) {
        image[i] = (sagnac_octet)word(file, 1);
    }
    if ((flags & 1U) != 0U) {
        now = kept;
    }
    if (tear != 0U) {
        now.dice = tear;
    }
    steps = 0U;
    steps_left = cut;
    (void)sagnac_banks_open(&banks, &flash, 0U, BANK);
    result = act(operation, length);
    steps_left = NEVER;
    /* A start sets images aside until the next one; a cut ends that too. */
    if (operation != 4U || cut != NEVER) {
        (void)sagnac_banks_open(&banks, &flash, 0U, BANK);
        sagnac_banks_load(&banks, &gyro, &loaded);
    }
    for (i = 0U; i < ROOM; i++) {
        hash = (hash ^ now.bytes[i]) * UINT32_C(16777619);
    }
    differs = result != word(file, 1);
    differs |= (steps != word(file, 4)) << 1;
    differs |= (hash != word(file, 4)) << 2;
    differs |= ((uint32_t)loaded.origin != word(file, 1)) << 3;
    differs |= (loaded.trial != word(file, 1)) << 4;
    differs |= (loaded.image.sequence != word(file, 4)) << 5;
    for (i = 0U; i < 2U; i++) {
        differs |= ((uint32_t)loaded.banks[i].content != word(file, 1)) << 6;
        differs |= (loaded.banks[i].stored != word(file, 4)) << 7;
    }
    if ((flags & 2U) != 0U) {
        kept = now;
    }
    return differs;
}

int main(int argc, char **argv)
{
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    unsigned long operations = 0, wrong = 0;
    int kind;
    if (file == NULL) {
        return 2;
    }
    while ((kind = fgetc(file)) != EOF) {
        if (kind == 'F') {
            if (!new_flash(file)) {
                return 2;
            }
        } else if (kind == 'G') {
            new_gyro(file);
        } else if (kind == 'D') {
            worn = word(file, 1);
            unreadable_from = word(file, 2);
            unreadable_to = word(file, 2);
        } else if (kind == 'O') {
            const int differs = operate(file);
            operations++;
            if (differs != 0) {
                printf("operation %lu: differs in %d\n", operations, differs);
                wrong++;
            }
        } else {
            return 2;
        }
    }
    printf("banks: %lu operations, %lu differ\n", operations, wrong);
    return wrong == 0 && operations > 0 ? 0 : 1;
}
