/*
 * The board in C against records of the Rust crate: status, watch, stripping, counts, changes of the image.
 *
 *   check_board FILE     0 if every frame and every actuator code is as the records say
 *
 * A table of the loops (512 octets), then records, little-endian:
 *   B   a board that begins: strips (1), longest (2), least swing (4), watches (1), shows (4), still (4),
 *       command (4), heats (1), origin, trial, length and image as below, after a reset (1), seconds since power-on (4), ticks of a frame (2)
 *   U   another image between two ticks: origin (1), trial (1), length (2), image (none for the factory defaults of the last)
 *   R   the same as U, after an upset of the image
 *   M   ticks that were missed (4)
 *   T   ticks (4), seed (4), steps of a tick (2), a double step in every so many ticks (2), codes (4 times 4), present (1), amplitude of
 *       the pickoff (4), light (4), status (2); then what must be: hash of frames and actuators (4), inputs that stand still (1)
 */
#include <stddef.h>
#include <stdio.h>

#include "records.h"
#include "sagnac_board.h"
#include "sagnac_hash.h"
#include "sagnac_quadrature.h"

static sagnac_board board;
static sagnac_board_setup setup;
static sagnac_loaded loaded;
static sagnac_path_length path;
static sagnac_intensity light;
static sagnac_quadrature counter;
static sagnac_actuators actuators;
static uint32_t quarter;
static sagnac_octet octets[SAGNAC_MAX_IMAGE];

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
    if (sagnac_image_load(&loaded.image, sagnac_octet_at, octets, length) != SAGNAC_IMAGE_OK) {
        return 0;
    }
    loaded.image_sum = sagnac_image_sum(&loaded.image);
    return 1;
}

static int new_board(FILE *file)
{
    setup.path = &path;
    setup.light = &light;
    setup.strips = word(file, 1);
    setup.longest = word(file, 2);
    setup.least_swing = word(file, 4);
    setup.watches = word(file, 1);
    setup.watch_spec.shows = word(file, 4);
    setup.watch_spec.still = word(file, 4);
    setup.watch_spec.command_shows = word(file, 4);
    setup.heats = word(file, 1);
    if (!read_loaded(file)) {
        return 0;
    }
    {
        const sagnac_cause cause = (word(file, 1) != 0U) ? SAGNAC_RESET : SAGNAC_POWER_ON;
        const uint32_t since_power_on_s = word(file, 4);
        setup.frame_ticks = word(file, 2);
        sagnac_board_start(&board, &loaded, &setup, cause, since_power_on_s);
    }
    sagnac_quadrature_start(&counter);
    (void)sagnac_quadrature_update(&counter, SAGNAC_X4, 0U, 0U);
    quarter = 0U;
    return 1;
}

static void flip(void *object, size_t bit)
{
    unsigned char *bytes = (unsigned char *)object;
    bytes[bit / 8U] = (unsigned char)(bytes[bit / 8U] ^ (1U << (bit % 8U)));
}

/* Neither stripping nor a watch. */
static sagnac_board_setup plain_setup(void)
{
    sagnac_board_setup plain = setup;
    plain.strips = SAGNAC_NO;
    plain.watches = SAGNAC_NO;
    return plain;
}

/* Every bit of an image, turned over, changes its sum if its place is used, and only then. */
static unsigned long image_upsets(void)
{
    const size_t inputs = offsetof(sagnac_image, inputs) + (size_t)loaded.image.input_count * sizeof(sagnac_input);
    const size_t terms = offsetof(sagnac_image, terms) + (size_t)loaded.image.term_count * sizeof(sagnac_term);
    const uint32_t sum = sagnac_image_sum(&loaded.image);
    unsigned long wrong = 0;
    size_t bit;
    for (bit = 0; bit < 8U * sizeof(sagnac_image); bit++) {
        const size_t at = bit / 8U;
        const int used = at < offsetof(sagnac_image, terms) ? at < inputs : at < terms;
        sagnac_image upset = loaded.image;
        flip(&upset, bit);
        if ((sagnac_image_sum(&upset) != sum) != used) {
            printf("image, bit %lu\n", (unsigned long)bit);
            wrong++;
        }
    }
    wrong += sagnac_board_is_intact(&board, &setup) == 0U;
    flip(&board.image.terms[0].mantissa, 7U);
    wrong += sagnac_board_is_intact(&board, &setup) != 0U;
    sagnac_board_mend(&board, &loaded, &setup);
    wrong += sagnac_board_is_intact(&board, &setup) == 0U || sagnac_image_sum(&board.image) != sum;
    return wrong;
}

/* Bits that the board saw over so many ticks. */
static uint32_t run_quietly(sagnac_board *own, uint32_t count)
{
    sagnac_sample sample = {{0, 0, 0, 0}, 15U, 0, 0, 0U};
    uint32_t status = own->frame.status;
    while (count-- > 0U) {
        sagnac_frame frame;
        int i;
        /* A ramp, so that each slow update slews. */
        for (i = 0; i < 4; i++) {
            sample.codes[i] = 50 * (i + 1) * (int32_t)(own->frame.tick & 0xFFFFU);
        }
        if (sagnac_board_tick(own, 3, 0U, &sample, &actuators, &frame) != 0U) {
            status |= frame.payload[14] | ((uint32_t)frame.payload[15] << 8);
        }
    }
    return status | own->frame.status;
}

/* An octet of the state behind the last field of an input, which no one reads. */
static int is_padding(size_t at)
{
    const size_t inputs = offsetof(sagnac_compensator_state, inputs);
    const size_t used = offsetof(sagnac_input_state, open_q24) + sizeof(uint32_t);
    return at >= inputs && at < inputs + sizeof board.state.inputs && (at - inputs) % sizeof(sagnac_input_state) >= used;
}

/* Every bit of a state, turned over in and after a slew, is reported at the next slow update, but for the part of a count. */
static unsigned long state_upsets(void)
{
    static sagnac_board steady, upset;
    const uint32_t moments[2] = {205U, 333U};
    unsigned long wrong = 0;
    size_t bit;
    int moment;
    for (moment = 0; moment < 2; moment++) {
        sagnac_loaded quick = loaded;
        quick.image.period_ticks = 200U;
        quick.image.slew_ticks = 20U;
        quick.image.output_limit = 2147483647U;
        const sagnac_board_setup plain = plain_setup();
        sagnac_board_start(&steady, &quick, &plain, SAGNAC_POWER_ON, 0U);
        (void)run_quietly(&steady, moments[moment]);
        for (bit = 0; bit < 8U * sizeof(sagnac_compensator_state); bit++) {
            const size_t at = bit / 8U;
            sagnac_compensator_state *state = &upset.state;
            int fraction;
            if (is_padding(at)) {
                continue;
            }
            upset = steady;
            flip(state, bit);
            fraction = (uint64_t)state->accumulator < UINT64_C(4294967296) && at < sizeof state->accumulator;
            if (at >= offsetof(sagnac_compensator_state, overflow) && at < offsetof(sagnac_compensator_state, warm)) {
                /* The status itself says it. */
                wrong += (run_quietly(&upset, 201U) & SAGNAC_OVERFLOW) == 0U;
            } else if (((run_quietly(&upset, 201U) & SAGNAC_UPSET) != 0U) == fraction) {
                printf("state, bit %lu at moment %d\n", (unsigned long)bit, moment);
                wrong++;
            }
        }
        wrong += (run_quietly(&steady, 1000U) & SAGNAC_UPSET) != 0U;
        /* An image whose period turned over does not hold up a pause. */
        steady.image.period_ticks = 0U;
        (void)run_quietly(&steady, 1U);
        sagnac_board_make_up(&steady, 1000U);
    }
    return wrong;
}

/* Every bit of the board's own fields, turned over: the comparison finds it, also after what flash holds was used again, and mending ends it. */
static unsigned long own_upsets(void)
{
    static const struct {
        size_t at;
        size_t size;
    } fields[] = {
#define OWN(field) {offsetof(sagnac_board, field), sizeof board.field}
        OWN(setup.path),   OWN(setup.light),      OWN(setup.strips),        OWN(setup.longest),
        OWN(setup.watches), OWN(setup.heats),     OWN(setup.watch_spec),    OWN(setup.least_swing),
        OWN(setup.frame_ticks), OWN(trial), OWN(stripper.longest), OWN(stripper.least_swing), OWN(image_sum),
#undef OWN
    };
    unsigned long wrong = 0;
    size_t field, bit;
    for (field = 0; field < sizeof fields / sizeof fields[0]; field++) {
        for (bit = 0; bit < 8U * fields[field].size; bit++) {
            static sagnac_board upset;
            upset = board;
            flip(&upset, 8U * fields[field].at + bit);
            /* The trial is a yes or a no: only that is used. */
            if (upset.trial != board.trial && (upset.trial != 0U) == (board.trial != 0U)) {
                continue;
            }
            wrong += sagnac_board_is_intact(&upset, &setup) != 0U;
            sagnac_board_use(&upset, &loaded);
            wrong += sagnac_board_is_intact(&upset, &setup) != 0U;
            sagnac_board_mend(&upset, &loaded, &setup);
            wrong += sagnac_board_is_intact(&upset, &setup) == 0U || upset.trial != loaded.trial;
        }
    }
    for (bit = 0; bit < 2U; bit++) {
        static sagnac_board upset;
        upset = board;
        upset.origin = board.origin == SAGNAC_NEWEST ? (bit == 0 ? SAGNAC_ONLY_SURVIVOR : SAGNAC_FACTORY_DEFAULTS) : SAGNAC_NEWEST;
        wrong += sagnac_board_is_intact(&upset, &setup) != 0U;
        sagnac_board_mend(&upset, &loaded, &setup);
        wrong += sagnac_board_is_intact(&upset, &setup) == 0U || upset.origin != loaded.origin;
    }
    if (wrong != 0) {
        printf("own fields: %lu wrong\n", wrong);
    }
    return wrong;
}

/* An image with an output limit holds counts back: what is beyond its bound is an upset, unless it is an overflow. */
static unsigned long limited_upsets(void)
{
    static sagnac_board limited;
    sagnac_board_setup plain;
    sagnac_loaded slow = loaded;
    unsigned long wrong = 0;
    slow.image.output_limit = 1U;
    plain = plain_setup();
    sagnac_board_start(&limited, &slow, &plain, SAGNAC_POWER_ON, 0U);
    wrong += (run_quietly(&limited, 250U) & (SAGNAC_UPSET | SAGNAC_LIMITED)) != SAGNAC_LIMITED;
    limited.state.accumulator = INT64_C(1) << 62;
    limited.state.overflow = 1U;
    wrong += (run_quietly(&limited, 150U) & SAGNAC_UPSET) != 0U;
    limited.state.overflow = 0U;
    limited.state.updates = UINT32_MAX;
    wrong += (run_quietly(&limited, 50U) & SAGNAC_UPSET) == 0U;
    return wrong;
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
    int kind, upsets = 0;
    if (file == NULL) {
        return 2;
    }
    length = (uint32_t)fread(table, 1, sizeof table, file);
    if (sagnac_path_length_load(&path, sagnac_octet_at, table, length) == 0U ||
        sagnac_intensity_load(&light, sagnac_octet_at, table, length) == 0U) {
        return 2;
    }
    while ((kind = fgetc(file)) != EOF) {
        if (kind == 'B' || kind == 'U' || kind == 'R') {
            if (kind == 'B' ? !new_board(file) : !read_loaded(file)) {
                return 2;
            }
            if (kind == 'U') {
                sagnac_board_use(&board, &loaded);
            } else if (kind == 'R') {
                sagnac_board_mend(&board, &loaded, &setup);
            } else if (upsets++ == 0) {
                const sagnac_board fresh = board;
                wrong += image_upsets() + own_upsets() + state_upsets() + limited_upsets();
                board = fresh;
            }
        } else if (kind == 'M') {
            sagnac_board_make_up(&board, word(file, 4));
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
