/* Two flash banks: see sagnac_banks.h. */
#include "sagnac_banks.h"

#include "sagnac_integer.h"
#include "sagnac_upset.h"

/* Layout of a bank: docs/reference/image-format.md. */
#define COMMIT_AT 0U
#define NOTES_AT 32U
#define NOTES 4U
#define HEAD_AT 160U
#define IMAGE_AT 192U
#define STARTS_AT 992U
#define CONFIRM_AT 1120U
#define CONFIRMS 2U
#define BANK_VERSION 3U
/* Octets of a head before its own checksum, and of a commit word before its hash. */
#define HEAD_BODY 28U
#define COMMIT_BODY 16U
#define BLANK_OCTET 0xFFU

/* Store `number` came after store `other`: the numbers go round. */
static uint32_t bank_is_newer(uint32_t number, uint32_t other)
{
    const uint32_t after = (number - other) & 0xFFFFFFFFU;
    return ((after != 0U) && (after < 2147483648U)) ? SAGNAC_YES : SAGNAC_NO;
}

/* The number after this one, without 0 and without that of a blank note. */
static uint32_t bank_next_number(uint32_t number)
{
    return (number >= 4294967294U) ? 1U : (number + 1U);
}

static uint32_t bank_start_of(const sagnac_banks *banks, uint32_t bank)
{
    return (bank == 0U) ? banks->base : (banks->base + banks->length);
}

static uint32_t bank_read_unit(const sagnac_banks *banks, uint32_t offset, sagnac_octet unit[SAGNAC_REGION])
{
    return banks->flash->read(banks->flash->context, offset, unit, SAGNAC_REGION);
}

static uint32_t bank_is_blank(const sagnac_octet unit[SAGNAC_REGION])
{
    uint32_t blank = SAGNAC_YES;
    uint32_t i;
    for (i = 0U; i < SAGNAC_REGION; i++) {
        if (unit[i] != BLANK_OCTET) {
            blank = SAGNAC_NO;
        }
    }
    return blank;
}

/* Programs a unit and reads it back. */
static sagnac_store_result bank_program(const sagnac_banks *banks, uint32_t offset, const sagnac_octet unit[SAGNAC_REGION])
{
    sagnac_store_result result = SAGNAC_STORE_FLASH;
    if (banks->flash->program(banks->flash->context, offset, unit, SAGNAC_REGION) != 0U) {
        sagnac_octet back[SAGNAC_REGION];
        if (bank_read_unit(banks, offset, back) != 0U) {
            result = (sagnac_are_equal(unit, back, SAGNAC_REGION) != 0U) ? SAGNAC_STORE_DONE : SAGNAC_STORE_READ_BACK;
        }
    }
    return result;
}

/* A note: the number and its complement, four times, so that a torn one is never read as another number. */
static void bank_note_unit(uint32_t number, sagnac_octet unit[SAGNAC_REGION])
{
    uint32_t i;
    for (i = 0U; i < 4U; i++) {
        sagnac_write_u32(unit, 8U * i, number);
        sagnac_write_u32(unit, (8U * i) + 4U, number ^ 0xFFFFFFFFU);
    }
}

/* The newer of two numbers, of which the first may not be there yet. */
static void bank_keep_newer(uint32_t *has, uint32_t *number, uint32_t other)
{
    if ((*has == 0U) || (bank_is_newer(other, *number) != 0U)) {
        *has = SAGNAC_YES;
        *number = other;
    }
}

/* The number of a note, if one of its pairs is intact. A blank pair is no number. */
static uint32_t bank_note_number(const sagnac_octet unit[SAGNAC_REGION], uint32_t *number)
{
    uint32_t has = SAGNAC_NO;
    uint32_t i;
    for (i = 0U; i < 4U; i++) {
        const uint32_t one = sagnac_read_u32(sagnac_octet_at, unit, 8U * i);
        const uint32_t complement = sagnac_read_u32(sagnac_octet_at, unit, (8U * i) + 4U);
        if (((one ^ complement) == 0xFFFFFFFFU) && (one != 0xFFFFFFFFU)) {
            bank_keep_newer(&has, number, one);
        }
    }
    return has;
}

/* The newest number of the notes of a row that can be read. */
static uint32_t bank_newest_note(const sagnac_banks *banks, uint32_t first, uint32_t units, uint32_t *number)
{
    sagnac_octet unit[SAGNAC_REGION];
    uint32_t has = SAGNAC_NO;
    uint32_t i;
    for (i = 0U; i < units; i++) {
        uint32_t one = 0U;
        if ((bank_read_unit(banks, first + (SAGNAC_REGION * i), unit) != 0U) && (bank_note_number(unit, &one) != 0U)) {
            bank_keep_newer(&has, number, one);
        }
    }
    return has;
}

/* Programs a note into the first unit of a row that takes it. */
static sagnac_store_result bank_mark(const sagnac_banks *banks, uint32_t first, uint32_t units, uint32_t number)
{
    sagnac_octet unit[SAGNAC_REGION];
    sagnac_store_result result = SAGNAC_STORE_NO_FREE_NOTE;
    uint32_t i;
    for (i = 0U; (i < units) && (result != SAGNAC_STORE_DONE); i++) {
        const uint32_t offset = first + (SAGNAC_REGION * i);
        if ((bank_read_unit(banks, offset, unit) != 0U) && (bank_is_blank(unit) != 0U)) {
            bank_note_unit(number, unit);
            result = bank_program(banks, offset, unit);
        }
    }
    return result;
}

static void bank_head_unit(uint32_t stored, uint32_t length, uint32_t trial, sagnac_octet unit[SAGNAC_REGION])
{
    /* SAGNACBK */
    sagnac_write_u32(unit, 0U, 0x4E474153U);
    sagnac_write_u32(unit, 4U, 0x4B424341U);
    sagnac_write_u32(unit, 8U, BANK_VERSION);
    sagnac_write_u32(unit, 12U, stored);
    sagnac_write_u32(unit, 16U, length);
    sagnac_write_u32(unit, 20U, trial);
    sagnac_write_u32(unit, 24U, 0U);
    sagnac_write_u32(unit, HEAD_BODY, sagnac_crc32(sagnac_octet_at, unit, 0U, HEAD_BODY));
}

/* SAGNAC_YES if these are the octets of a head. */
static uint32_t bank_is_head(const sagnac_octet unit[SAGNAC_REGION])
{
    sagnac_octet same[SAGNAC_REGION];
    const uint32_t length = sagnac_read_u32(sagnac_octet_at, unit, 16U);
    const uint32_t trial = sagnac_read_u32(sagnac_octet_at, unit, 20U);
    bank_head_unit(sagnac_read_u32(sagnac_octet_at, unit, 12U), length, (trial == 1U) ? SAGNAC_YES : SAGNAC_NO, same);
    return (length <= SAGNAC_MAX_IMAGE) ? sagnac_are_equal(unit, same, SAGNAC_REGION) : SAGNAC_NO;
}

/* The commit word of a head with an image, and of no other pair. */
static void bank_commit_unit(const sagnac_octet head[SAGNAC_REGION], const sagnac_octet *octets, uint32_t length,
                             sagnac_octet unit[SAGNAC_REGION])
{
    sagnac_hash hash;
    sagnac_octet digest[SAGNAC_DIGEST];
    const uint32_t stored = sagnac_read_u32(sagnac_octet_at, head, 12U);
    uint32_t i;
    sagnac_hash_start(&hash);
    sagnac_hash_add(&hash, head, SAGNAC_REGION);
    sagnac_hash_add(&hash, octets, length);
    sagnac_hash_end(&hash, digest);
    /* COMMITTD */
    sagnac_write_u32(unit, 0U, 0x4D4D4F43U);
    sagnac_write_u32(unit, 4U, 0x44545449U);
    sagnac_write_u32(unit, 8U, stored);
    sagnac_write_u32(unit, 12U, stored ^ 0xFFFFFFFFU);
    for (i = COMMIT_BODY; i < SAGNAC_REGION; i++) {
        unit[i] = digest[i - COMMIT_BODY];
    }
}

/* Reads a committed bank into the room of `banks`: head, octets and the image that they are. */
static sagnac_bank_content bank_read(sagnac_banks *banks, uint32_t start, sagnac_octet head[SAGNAC_REGION],
                                     sagnac_image_error *error)
{
    sagnac_octet commit[SAGNAC_REGION];
    sagnac_octet wanted[SAGNAC_REGION];
    sagnac_bank_content content = SAGNAC_BANK_UNREADABLE;
    *error = SAGNAC_IMAGE_OK;
    if (bank_read_unit(banks, start + COMMIT_AT, commit) == 0U) {
        content = SAGNAC_BANK_UNREADABLE;
    } else if (bank_is_blank(commit) != 0U) {
        content = SAGNAC_BANK_UNCOMMITTED;
    } else if (bank_read_unit(banks, start + HEAD_AT, head) == 0U) {
        content = SAGNAC_BANK_UNREADABLE;
    } else if (bank_is_head(head) == 0U) {
        content = SAGNAC_BANK_DAMAGED;
    } else if (banks->flash->read(banks->flash->context, start + IMAGE_AT, banks->area, SAGNAC_IMAGE_AREA) == 0U) {
        content = SAGNAC_BANK_UNREADABLE;
    } else {
        const uint32_t length = sagnac_read_u32(sagnac_octet_at, head, 16U);
        bank_commit_unit(head, banks->area, length, wanted);
        if (sagnac_are_equal(commit, wanted, SAGNAC_REGION) == 0U) {
            content = SAGNAC_BANK_DAMAGED;
        } else {
            *error = sagnac_image_load(&banks->image, sagnac_octet_at, banks->area, length);
            content = (*error == SAGNAC_IMAGE_OK) ? SAGNAC_BANK_VALID : SAGNAC_BANK_NO_IMAGE;
        }
    }
    return content;
}

static void bank_inspect(sagnac_banks *banks, uint32_t bank, const sagnac_gyro *gyro, sagnac_bank *found)
{
    sagnac_octet head[SAGNAC_REGION];
    const uint32_t start = bank_start_of(banks, bank);
    found->note = 0U;
    found->has_note = bank_newest_note(banks, start + NOTES_AT, NOTES, &found->note);
    found->content = bank_read(banks, start, head, &found->error);
    found->mismatch = SAGNAC_MATCHES;
    found->stored = 0U;
    found->sequence = 0U;
    found->trial = SAGNAC_NO;
    if ((found->content == SAGNAC_BANK_VALID) || (found->content == SAGNAC_BANK_NO_IMAGE)) {
        found->stored = sagnac_read_u32(sagnac_octet_at, head, 12U);
    }
    if (found->content == SAGNAC_BANK_VALID) {
        found->mismatch = sagnac_gyro_accept(gyro, &banks->image);
        if (found->mismatch != SAGNAC_MATCHES) {
            found->content = SAGNAC_BANK_MISMATCH;
        } else {
            uint32_t number = 0U;
            const uint32_t has = bank_newest_note(banks, start + CONFIRM_AT, CONFIRMS, &number);
            found->sequence = banks->image.sequence;
            if (sagnac_read_u32(sagnac_octet_at, head, 20U) == 1U) {
                found->trial = ((has != 0U) && (number == found->stored)) ? SAGNAC_NO : SAGNAC_YES;
            }
        }
    }
}

static void bank_inspect_both(sagnac_banks *banks, const sagnac_gyro *gyro, sagnac_bank found[2])
{
    uint32_t i;
    bank_inspect(banks, 0U, gyro, &found[0]);
    bank_inspect(banks, 1U, gyro, &found[1]);
    for (i = 0U; i < 2U; i++) {
        const sagnac_bank *other = &found[1U - i];
        if (found[i].content == SAGNAC_BANK_VALID) {
            if ((other->has_note != 0U) && (bank_is_newer(found[i].stored, other->note) == 0U)) {
                found[i].content = SAGNAC_BANK_WITHDRAWN;
            } else if (((banks->aside >> i) & 1U) != 0U) {
                found[i].content = SAGNAC_BANK_SET_ASIDE;
            } else {
                /* It may run. */
            }
        }
    }
}

/* The valid bank of the later store; 2 for none. */
static uint32_t bank_active(const sagnac_bank found[2])
{
    uint32_t active = 2U;
    if (found[0].content == SAGNAC_BANK_VALID) {
        active = 0U;
        if ((found[1].content == SAGNAC_BANK_VALID) && (bank_is_newer(found[1].stored, found[0].stored) != 0U)) {
            active = 1U;
        }
    } else if (found[1].content == SAGNAC_BANK_VALID) {
        active = 1U;
    } else {
        active = 2U;
    }
    return active;
}

/* What the bank next to the active one says of it. */
static sagnac_origin bank_origin(const sagnac_bank *active, const sagnac_bank *other)
{
    sagnac_origin origin = SAGNAC_ONLY_SURVIVOR;
    if ((other->content == SAGNAC_BANK_UNCOMMITTED) || (other->content == SAGNAC_BANK_WITHDRAWN)) {
        origin = SAGNAC_NEWEST;
    }
    /* Two banks of one store are a copy by hand. */
    if ((other->content == SAGNAC_BANK_VALID) && (other->stored != active->stored)) {
        origin = SAGNAC_NEWEST;
    }
    return origin;
}

/* The image of a bank, read and checked once more, into the room of `banks`. */
static uint32_t bank_image_of(sagnac_banks *banks, uint32_t bank, const sagnac_gyro *gyro, uint32_t *length)
{
    sagnac_octet head[SAGNAC_REGION];
    sagnac_image_error error = SAGNAC_IMAGE_OK;
    uint32_t is_there = SAGNAC_NO;
    if (bank_read(banks, bank_start_of(banks, bank), head, &error) == SAGNAC_BANK_VALID) {
        *length = sagnac_read_u32(sagnac_octet_at, head, 16U);
        is_there = (sagnac_gyro_accept(gyro, &banks->image) == SAGNAC_MATCHES) ? SAGNAC_YES : SAGNAC_NO;
    }
    return is_there;
}

uint32_t sagnac_banks_open(sagnac_banks *banks, const sagnac_flash *flash, uint32_t base, uint32_t length)
{
    uint32_t fits = SAGNAC_YES;
    if ((flash->read_size == 0U) || (flash->program_size == 0U) || (flash->erase_size == 0U)) {
        fits = SAGNAC_NO;
    } else if (((SAGNAC_REGION % flash->read_size) != 0U) || ((SAGNAC_REGION % flash->program_size) != 0U) ||
               ((base % flash->erase_size) != 0U) || ((length % flash->erase_size) != 0U)) {
        fits = SAGNAC_NO;
    } else if ((length < SAGNAC_BANK_LENGTH) || (base > flash->capacity) || (length > ((flash->capacity - base) / 2U))) {
        fits = SAGNAC_NO;
    } else {
        banks->flash = flash;
        banks->base = base;
        banks->length = length;
        banks->aside = 0U;
    }
    return fits;
}

void sagnac_banks_load(sagnac_banks *banks, const sagnac_gyro *gyro, sagnac_loaded *loaded)
{
    uint32_t active;
    uint32_t length = 0U;
    uint32_t is_there = SAGNAC_NO;
    bank_inspect_both(banks, gyro, loaded->banks);
    active = bank_active(loaded->banks);
    loaded->trial = SAGNAC_NO;
    if (active < 2U) {
        loaded->trial = loaded->banks[active].trial;
        is_there = bank_image_of(banks, active, gyro, &length);
    }
    if (is_there != 0U) {
        sagnac_hash hash;
        loaded->image = banks->image;
        loaded->origin = bank_origin(&loaded->banks[active], &loaded->banks[1U - active]);
        sagnac_hash_start(&hash);
        sagnac_hash_add(&hash, banks->area, length);
        sagnac_hash_end(&hash, loaded->digest);
    } else {
        uint32_t i;
        sagnac_factory_defaults(gyro, &loaded->image);
        loaded->origin = SAGNAC_FACTORY_DEFAULTS;
        for (i = 0U; i < SAGNAC_DIGEST; i++) {
            loaded->digest[i] = 0U;
        }
    }
    loaded->image_sum = sagnac_image_sum(&loaded->image);
}

/* Programs a mark of the active image's store into a row of its bank, if it is on trial. */
/* SAG-CORE-022 */
static sagnac_store_result bank_mark_trial(sagnac_banks *banks, const sagnac_gyro *gyro, uint32_t row, uint32_t units)
{
    sagnac_store_result result = SAGNAC_STORE_NOT_ON_TRIAL;
    sagnac_bank found[2];
    uint32_t active;
    bank_inspect_both(banks, gyro, found);
    active = bank_active(found);
    if ((active < 2U) && (found[active].trial != 0U)) {
        result = bank_mark(banks, bank_start_of(banks, active) + row, units, found[active].stored);
    }
    return result;
}

/* Sets the active image aside, and with 2 or more the other one too. */
/* SAG-CORE-029 */
static void bank_set_aside(sagnac_banks *banks, const sagnac_gyro *gyro, uint32_t images)
{
    uint32_t i;
    for (i = 0U; (i < images) && (i < 2U); i++) {
        sagnac_bank found[2];
        uint32_t active;
        bank_inspect_both(banks, gyro, found);
        active = bank_active(found);
        if (active < 2U) {
            banks->aside |= (uint32_t)1U << active;
        }
    }
}

void sagnac_banks_start(sagnac_banks *banks, const sagnac_gyro *gyro, uint32_t watchdog_resets, sagnac_loaded *loaded)
{
    sagnac_store_result marked;
    sagnac_store_result rolled = SAGNAC_STORE_NOT_ON_TRIAL;
    banks->aside = 0U;
    marked = bank_mark_trial(banks, gyro, STARTS_AT, SAGNAC_TRIAL_STARTS);
    /* All starts are used, or the flash takes no more marks. */
    if ((marked != SAGNAC_STORE_DONE) && (marked != SAGNAC_STORE_NOT_ON_TRIAL)) {
        rolled = sagnac_banks_roll_back(banks, gyro);
    }
    if (rolled != SAGNAC_STORE_DONE) {
        bank_set_aside(banks, gyro, watchdog_resets / SAGNAC_TRIAL_STARTS);
    }
    sagnac_banks_load(banks, gyro, loaded);
}

sagnac_store_result sagnac_banks_confirm(sagnac_banks *banks, const sagnac_gyro *gyro)
{
    return bank_mark_trial(banks, gyro, CONFIRM_AT, CONFIRMS);
}

/* An image for this gyro that is not withdrawn. */
static uint32_t bank_may_run(const sagnac_bank *found)
{
    return ((found->content == SAGNAC_BANK_VALID) || (found->content == SAGNAC_BANK_SET_ASIDE)) ? SAGNAC_YES : SAGNAC_NO;
}

sagnac_store_result sagnac_banks_roll_back(sagnac_banks *banks, const sagnac_gyro *gyro)
{
    sagnac_store_result result = SAGNAC_STORE_NO_OLDER_IMAGE;
    sagnac_bank found[2];
    bank_inspect_both(banks, gyro, found);
    if ((bank_may_run(&found[0]) != 0U) && (bank_may_run(&found[1]) != 0U)) {
        const uint32_t newer = bank_is_newer(found[1].stored, found[0].stored);
        const uint32_t start = bank_start_of(banks, 1U - newer);
        uint32_t length = 0U;
        result = bank_mark(banks, start + NOTES_AT, NOTES, found[newer].stored);
        if ((result == SAGNAC_STORE_DONE) && (bank_image_of(banks, 1U - newer, gyro, &length) == 0U)) {
            result = SAGNAC_STORE_NO_OLDER_IMAGE;
        }
    }
    return result;
}

/* Erases a bank, beginning with the sector of its commit word, and checks that it is blank. */
static sagnac_store_result bank_erase(const sagnac_banks *banks, uint32_t start)
{
    sagnac_octet unit[SAGNAC_REGION];
    sagnac_store_result result = SAGNAC_STORE_DONE;
    uint32_t at;
    for (at = 0U; (at < banks->length) && (result == SAGNAC_STORE_DONE); at += banks->flash->erase_size) {
        const uint32_t from = start + at;
        if (banks->flash->erase(banks->flash->context, from, from + banks->flash->erase_size) == 0U) {
            result = SAGNAC_STORE_FLASH;
        }
    }
    for (at = 0U; (at < SAGNAC_BANK_LENGTH) && (result == SAGNAC_STORE_DONE); at += SAGNAC_REGION) {
        if (bank_read_unit(banks, start + at, unit) == 0U) {
            result = SAGNAC_STORE_FLASH;
        } else if (bank_is_blank(unit) == 0U) {
            result = SAGNAC_STORE_READ_BACK;
        } else {
            result = SAGNAC_STORE_DONE;
        }
    }
    return result;
}

/* Image, head, commit word, in this order. */
static sagnac_store_result bank_write(const sagnac_banks *banks, uint32_t bank, const sagnac_octet *octets, uint32_t length,
                                      const sagnac_octet head[SAGNAC_REGION])
{
    sagnac_octet unit[SAGNAC_REGION];
    const uint32_t start = bank_start_of(banks, bank);
    sagnac_store_result result = bank_erase(banks, start);
    uint32_t at;
    for (at = 0U; (at < length) && (result == SAGNAC_STORE_DONE); at += SAGNAC_REGION) {
        uint32_t i;
        for (i = 0U; i < SAGNAC_REGION; i++) {
            unit[i] = ((at + i) < length) ? octets[at + i] : (sagnac_octet)BLANK_OCTET;
        }
        result = bank_program(banks, start + IMAGE_AT + at, unit);
    }
    if (result == SAGNAC_STORE_DONE) {
        result = bank_program(banks, start + HEAD_AT, head);
    }
    if (result == SAGNAC_STORE_DONE) {
        bank_commit_unit(head, octets, length, unit);
        result = bank_program(banks, start + COMMIT_AT, unit);
    }
    return result;
}

/* Without an active image a store takes the bank of the lower rank: a withdrawn image first (its note is in the other bank), then what can
 * never be an image, then what may be one again. */
static uint32_t bank_rank(const sagnac_bank *found)
{
    uint32_t rank = 1U;
    switch (found->content) {
    case SAGNAC_BANK_WITHDRAWN:
        rank = 0U;
        break;
    case SAGNAC_BANK_UNREADABLE:
        rank = 2U;
        break;
    case SAGNAC_BANK_NO_IMAGE:
    case SAGNAC_BANK_MISMATCH:
    case SAGNAC_BANK_SET_ASIDE:
        rank = 3U;
        break;
    case SAGNAC_BANK_UNCOMMITTED:
    case SAGNAC_BANK_VALID:
    case SAGNAC_BANK_DAMAGED:
    default:
        rank = 1U;
        break;
    }
    return rank;
}

/* The bank for another image while none is active: of two that may be images again the older. */
static uint32_t bank_spare(const sagnac_bank found[2])
{
    const uint32_t first = bank_rank(&found[0]);
    const uint32_t second = bank_rank(&found[1]);
    uint32_t spare = (second < first) ? SAGNAC_YES : SAGNAC_NO;
    if ((first == second) && (found[0].stored != 0U) && (found[1].stored != 0U)) {
        spare = bank_is_newer(found[0].stored, found[1].stored);
    }
    return spare;
}

/* The newest number that the banks and their notes have; 0 for none. No store has the number 0. */
static uint32_t bank_newest_number(const sagnac_bank found[2])
{
    uint32_t has = SAGNAC_NO;
    uint32_t newest = 0U;
    uint32_t i;
    for (i = 0U; i < 2U; i++) {
        if (found[i].stored != 0U) {
            bank_keep_newer(&has, &newest, found[i].stored);
        }
        if (found[i].has_note != 0U) {
            bank_keep_newer(&has, &newest, found[i].note);
        }
    }
    return newest;
}

/* SAGNAC_YES while both banks are unreadable and the flash gives not even a head: it does not answer. */
static uint32_t bank_is_dark(const sagnac_banks *banks, const sagnac_bank found[2])
{
    sagnac_octet unit[SAGNAC_REGION];
    uint32_t is_dark = SAGNAC_NO;
    if ((found[0].content == SAGNAC_BANK_UNREADABLE) && (found[1].content == SAGNAC_BANK_UNREADABLE) &&
        (bank_read_unit(banks, bank_start_of(banks, 0U) + HEAD_AT, unit) == 0U) &&
        (bank_read_unit(banks, bank_start_of(banks, 1U) + HEAD_AT, unit) == 0U)) {
        is_dark = SAGNAC_YES;
    }
    return is_dark;
}

/* The active image is on trial over a confirmed one. */
static uint32_t bank_tries(const sagnac_bank found[2], uint32_t active)
{
    uint32_t tries = SAGNAC_NO;
    if (active < 2U) {
        const sagnac_bank *other = &found[1U - active];
        if ((found[active].trial != 0U) && (other->content == SAGNAC_BANK_VALID) && (other->trial == 0U)) {
            tries = SAGNAC_YES;
        }
    }
    return tries;
}

/* The bank for an image, and the number of its store. The image is in the room of `banks` then. */
/* SAG-CORE-030 */
static sagnac_store_result bank_place_for(sagnac_banks *banks, const sagnac_gyro *gyro, const sagnac_octet *octets, uint32_t length,
                                          uint32_t *bank, uint32_t *number)
{
    sagnac_store_result result = SAGNAC_STORE_DONE;
    if (sagnac_image_load(&banks->image, sagnac_octet_at, octets, length) != SAGNAC_IMAGE_OK) {
        result = SAGNAC_STORE_NO_IMAGE;
    } else if (sagnac_gyro_accept(gyro, &banks->image) != SAGNAC_MATCHES) {
        result = SAGNAC_STORE_MISMATCH;
    } else {
        const uint32_t offered = banks->image.sequence;
        sagnac_bank found[2];
        uint32_t active;
        bank_inspect_both(banks, gyro, found);
        active = bank_active(found);
        if (bank_is_dark(banks, found) != 0U) {
            result = SAGNAC_STORE_FLASH;
        } else if (bank_tries(found, active) != 0U) {
            result = SAGNAC_STORE_ON_TRIAL;
        } else if ((offered == 0U) || ((active < 2U) && (bank_is_newer(offered, found[active].sequence) == 0U))) {
            /* Replies report the factory defaults as 0, so no image has that number. */
            result = SAGNAC_STORE_NOT_NEWER;
        } else {
            *bank = bank_spare(found);
            if (active < 2U) {
                *bank = 1U - active;
            }
            *number = bank_next_number(bank_newest_number(found));
        }
    }
    return result;
}

sagnac_store_result sagnac_banks_check(sagnac_banks *banks, const sagnac_gyro *gyro, const sagnac_octet *octets, uint32_t length)
{
    uint32_t bank = 0U;
    uint32_t number = 0U;
    return bank_place_for(banks, gyro, octets, length, &bank, &number);
}

/* SAG-CORE-021 */
sagnac_store_result sagnac_banks_store(sagnac_banks *banks, const sagnac_gyro *gyro, const sagnac_octet *octets, uint32_t length,
                                       uint32_t trial)
{
    uint32_t bank = 0U;
    uint32_t number = 0U;
    sagnac_store_result result = bank_place_for(banks, gyro, octets, length, &bank, &number);
    if (result == SAGNAC_STORE_DONE) {
        sagnac_octet head[SAGNAC_REGION];
        bank_head_unit(number, length, (trial != 0U) ? SAGNAC_YES : SAGNAC_NO, head);
        /* Its bank is no longer aside: bit 1 stays for bank 0, bit 0 for bank 1. */
        banks->aside &= (uint32_t)2U >> bank;
        result = bank_write(banks, bank, octets, length, head);
    }
    return result;
}
