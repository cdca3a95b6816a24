/*
 * The board in C against records of the Rust crate: status, watch, stripping, counts, changes of the image.
 *
 *   check_board FILE     0 if every frame and every actuator code is as the records say
 *
 * A table of the loops (512 octets), then records, little-endian:
 *   B   a board at power-on: origin (1), trial (1), strips (1), longest (2), least swing (4), watches (1), shows (4), still (4),
 *       command (4), heats (1), length (2), image
 *   U   another image between two ticks: origin (1), trial (1), length (2), image (none for the factory defaults of the last)
 *   T   ticks (4), seed (4), steps of a tick (2), a double step in every so many ticks (2), codes (4 times 4), present (1), amplitude of
 *       the pickoff (4), light (4), status (2); then what must be: hash of frames and actuators (4), inputs that stand still (1)
 */
#include <stdio.h>

#include "sagnac_board.h"
#include "sagnac_hash.h"
#include "sagnac_quadrature.h"

static sagnac_board board;
static sagnac_loaded loaded;
static sagnac_path_length path;
static sagnac_intensity light;
static sagnac_quadrature counter;
static sagnac_actuators actuators;
static uint32_t quarter;
static sagnac_octet octets[SAGNAC_MAX_IMAGE];

static uint32_t word(FILE *file, int count)
{
    uint32_t value = 0U;
    int i;
    for (i = 0; i < count; i++) {
        value |= (uint32_t)(fgetc(file) & 255) << (8 * i);
    }
    return value;
}

static int32_t as_signed(uint32_t value)
{
    return value <= UINT32_C(0x7fffffff) ? (int32_t)value : -(int32_t)(UINT32_MAX - value) - 1;
}

static uint32_t noise(uint32_t *seed)
{
    *seed = *seed * UINT32_C(1664525) + UINT32_C(1013904223);
    return *seed;
}

static uint32_t mixed(uint32_t hash, uint32_t with)
{
    return (hash ^ with) * UINT32_C(16777619);
}

/* What a load would say; 0 if the image is refused. */
static int read_loaded(FILE *file)
{
    uint32_t length, i;
    sagnac_hash hash;
    loaded.origin = (sagnac_origin)word(file, 1);
    loaded.trial = word(file, 1);
    length = word(file, 2);
    if (length > SAGNAC_MAX_IMAGE) {
        return 0;
    }
    for (i = 0U; i < length; i++) {
        octets[i] = (sagnac_octet)word(file, 1);
    }
    sagnac_hash_start(&hash);
    sagnac_hash_add(&hash, octets, length);
    sagnac_hash_end(&hash, loaded.digest);
    return sagnac_image_load(&loaded.image, sagnac_octet_at, octets, length) == SAGNAC_IMAGE_OK;
}

static int new_board(FILE *file)
{
    const uint32_t strips = word(file, 1), longest = word(file, 2), least = word(file, 4), watches = word(file, 1);
    sagnac_watch_spec spec;
    uint32_t heats;
    spec.shows = word(file, 4);
    spec.still = word(file, 4);
    spec.command_shows = word(file, 4);
    heats = word(file, 1);
    if (!read_loaded(file)) {
        return 0;
    }
    sagnac_board_start(&board, &loaded, &path, &light);
    if (strips != 0U) {
        sagnac_board_strip(&board, longest, least);
    }
    if (watches != 0U) {
        sagnac_board_watch(&board, &spec, heats);
    }
    sagnac_quadrature_start(&counter);
    (void)sagnac_quadrature_update(&counter, SAGNAC_X4, 0U, 0U);
    quarter = 0U;
    return 1;
}

static int32_t step_to(uint32_t by)
{
    quarter = (quarter + by) & 3U;
    return sagnac_quadrature_update(&counter, SAGNAC_X4, quarter == 1U || quarter == 2U, quarter == 2U || quarter == 3U);
}

static uint32_t ticks(FILE *file)
{
    const uint32_t count = word(file, 4);
    uint32_t seed = word(file, 4), hash = UINT32_C(2166136261), amplitude, base, tick, i;
    const int32_t steps = as_signed(word(file, 2) << 16) / 65536;
    const uint32_t doubles = word(file, 2);
    sagnac_sample sample;
    for (i = 0U; i < 4U; i++) {
        sample.codes[i] = as_signed(word(file, 4));
    }
    sample.present = word(file, 1);
    amplitude = word(file, 4);
    base = word(file, 4);
    sample.status = word(file, 2);
    for (tick = 0U; tick < count; tick++) {
        sagnac_frame frame;
        int32_t counts = 0, left = steps;
        while (left != 0) {
            counts += step_to(left > 0 ? 1U : 3U);
            left += left > 0 ? -1 : 1;
        }
        if (doubles != 0U && tick % doubles == 0U) {
            counts += step_to(2U);
        }
        sample.pickoff = as_signed(tick % 25U < 12U ? amplitude : 0U - amplitude);
        sample.light = as_signed(base + (noise(&seed) >> 26));
        if (sagnac_board_tick(&board, counts, counter.lost, &sample, &actuators, &frame) != 0U) {
            sagnac_octet all[SAGNAC_MAX_FRAME];
            const uint32_t length = sagnac_frame_octets(&frame, all);
            for (i = 0U; i < length; i++) {
                hash = mixed(hash, all[i]);
            }
        }
        hash = mixed(mixed(mixed(hash, (uint32_t)actuators.actuator), (uint32_t)actuators.modulation), (uint32_t)actuators.current);
    }
    return hash;
}

int main(int argc, char **argv)
{
    static sagnac_octet table[512];
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    unsigned long records = 0, wrong = 0;
    uint32_t length;
    int kind;
    if (file == NULL) {
        return 2;
    }
    length = (uint32_t)fread(table, 1, sizeof table, file);
    if (sagnac_path_length_load(&path, sagnac_octet_at, table, length) == 0U ||
        sagnac_intensity_load(&light, sagnac_octet_at, table, length) == 0U) {
        return 2;
    }
    while ((kind = fgetc(file)) != EOF) {
        if (kind == 'B' || kind == 'U') {
            if (kind == 'B' ? !new_board(file) : !read_loaded(file)) {
                return 2;
            }
            if (kind == 'U') {
                sagnac_board_use(&board, &loaded);
            }
        } else if (kind == 'T') {
            const uint32_t hash = ticks(file), wanted = word(file, 4), still = word(file, 1);
            records++;
            if (hash != wanted || board.still != still) {
                printf("record %lu differs\n", records);
                wrong++;
            }
        } else {
            return 2;
        }
    }
    printf("board: %lu records, %lu differ\n", records, wrong);
    return wrong == 0 && records > 0 ? 0 : 1;
}
