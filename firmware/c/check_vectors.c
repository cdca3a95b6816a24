/*
 * The exported C against the reference vectors (docs/reference/vectors.md).
 *
 *   check_vectors FILE...     a line per file; 0 if all of them pass
 *
 * The same program runs on this machine and, through semihosting, on an emulated Cortex-M4F. It may use the whole C
 * library; what it checks uses none of it.
 */
#include <inttypes.h>
#include <stdio.h>

#include "sagnac_compensator.h"
#include "sagnac_intensity.h"
#include "sagnac_path_length.h"
#include "sagnac_quadrature.h"
#include "sagnac_strip.h"
#include "sagnac_watch.h"

#define MAGIC UINT32_C(0x5a67ac01)
#define INPUTS 8
#define OUTPUTS 7
#define MAX_TABLE 772U

typedef struct {
    FILE *file;
    uint32_t bytes[MAX_TABLE];
    uint32_t length;
} vectors;

typedef union {
    struct {
        sagnac_image image;
        sagnac_compensator_state state;
    } compensator;
    struct {
        sagnac_path_length loop;
        sagnac_path_length_state state;
        int32_t actuator;
        int32_t modulation;
        int64_t at_q32;
    } path;
    struct {
        sagnac_intensity loop;
        sagnac_intensity_state state;
        int32_t current;
        int64_t light_q16;
    } light;
    struct {
        sagnac_quadrature counter;
        sagnac_counting counting;
        uint32_t quarter;
    } fringes;
    struct {
        sagnac_stripper stripper;
        uint32_t phase;
    } strip;
    struct {
        sagnac_watch_spec spec;
        sagnac_watch watch;
        int32_t values[4];
        uint32_t command;
    } watch;
} machine;

/* The next word; 1, or 0 at the end or at something that is no word. */
static int next_word(vectors *from, uint32_t *word)
{
    int c = fgetc(from->file);
    int digits = 0;
    *word = 0U;
    while (c == ' ' || c == '\n' || c == '\t' || c == '\r' || c == '/') {
        if (c == '/') {
            while (c != '\n' && c != EOF) {
                c = fgetc(from->file);
            }
        }
        c = fgetc(from->file);
    }
    while ((c >= '0' && c <= '9') || (c >= 'a' && c <= 'f')) {
        *word = (*word << 4) | (uint32_t)(c <= '9' ? c - '0' : c - 'a' + 10);
        digits++;
        c = fgetc(from->file);
    }
    return digits > 0 && digits <= 8 && (c == ' ' || c == '\n' || c == EOF);
}

static uint32_t octet(const void *context, uint32_t index)
{
    const vectors *from = context;
    return index < from->length ? from->bytes[index] : 0U;
}

static uint32_t low(int64_t value)
{
    return (uint32_t)((uint64_t)value & UINT64_C(0xffffffff));
}

static uint32_t high(int64_t value)
{
    return (uint32_t)((uint64_t)value >> 32);
}

static int32_t as_signed(uint32_t word)
{
    return word <= UINT32_C(0x7fffffff) ? (int32_t)word : -(int32_t)(UINT32_MAX - word) - 1;
}

static uint32_t noise_word(uint32_t *seed)
{
    *seed = *seed * UINT32_C(1664525) + UINT32_C(1013904223);
    return *seed;
}

static int32_t noise(uint32_t *seed, uint32_t bits)
{
    const uint32_t word = noise_word(seed);
    return bits == 0U ? 0 : (int32_t)(word >> (32U - bits)) - (int32_t)(UINT32_C(1) << (bits - 1U));
}

static void take(uint32_t *hash, uint32_t word)
{
    *hash = (*hash ^ word) * UINT32_C(16777619);
}

static void with_state(const sagnac_compensator_state *state, uint32_t *out)
{
    out[3] = low(state->accumulator);
    out[4] = high(state->accumulator);
    out[5] = low(state->increment);
    out[6] = high(state->increment);
}

static void compensator_run(machine *m, const uint32_t *in, uint32_t *out)
{
    sagnac_compensator_state *state = &m->compensator.state;
    uint32_t seed = in[1], hash = UINT32_C(2166136261), sum = 0U, last = 0U, tick;
    for (tick = 0U; tick < in[0]; tick++) {
        const int32_t raw = as_signed(in[2]) + noise(&seed, in[3]);
        sagnac_output given;
        const sagnac_misuse misuse = sagnac_compensator_tick(&m->compensator.image, state, raw, &given);
        if (misuse != SAGNAC_OK) {
            last = (uint32_t)misuse << 16;
            break;
        }
        last = given.status;
        sum += (uint32_t)given.counts;
        take(&hash, (uint32_t)given.counts);
        take(&hash, last);
    }
    with_state(state, out);
    /* A run has no third word of its own: sum, hash, then the state, then the last status. */
    out[2] = out[3];
    out[3] = out[4];
    out[4] = out[5];
    out[5] = out[6];
    out[0] = sum;
    out[1] = hash;
    out[6] = last;
}

/* Every update of the vectors once more in slices: begun, as many made as the record's word says, applied. */
static int same_in_slices(const sagnac_image *image, sagnac_compensator_state *sliced,
                          const sagnac_compensator_state *whole, const int32_t *codes, const uint32_t *in)
{
    const uint32_t made = (in[1] ^ in[2]) % (image->input_count + image->term_count + 2U);
    sagnac_slow_update update;
    uint32_t i;
    int same;
    sagnac_compensator_begin_update(image, sliced, codes, in[0], &update);
    for (i = 0U; i < made; i++) {
        (void)sagnac_compensator_advance_update(image, &update);
    }
    (void)sagnac_compensator_apply_update(image, sliced, &update);
    same = sliced->k_q32 == whole->k_q32 && sliced->increment == whole->increment && sliced->target == whole->target &&
           sliced->slope == whole->slope && sliced->slow_status == whole->slow_status &&
           sliced->ticks_to_update == whole->ticks_to_update && sliced->updates == whole->updates;
    for (i = 0U; i < SAGNAC_MAX_INPUTS; i++) {
        same = same && sliced->inputs[i].lag_q46 == whole->inputs[i].lag_q46 &&
               sliced->inputs[i].remainder == whole->inputs[i].remainder &&
               sliced->inputs[i].last_q24 == whole->inputs[i].last_q24 &&
               sliced->inputs[i].held_updates == whole->inputs[i].held_updates &&
               sliced->inputs[i].settled_updates == whole->inputs[i].settled_updates;
    }
    return same;
}

static int compensator_step(machine *m, uint32_t operation, const uint32_t *in, uint32_t *out)
{
    const sagnac_image *image = &m->compensator.image;
    sagnac_compensator_state *state = &m->compensator.state;
    sagnac_output given = {0, 0U};
    sagnac_compensator_state sliced;
    int32_t codes[4];
    int i;
    switch (operation) {
    case 0:
        sagnac_compensator_start(state);
        return 1;
    case 1:
        for (i = 0; i < 4; i++) {
            codes[i] = as_signed(in[1 + i]);
        }
        sliced = *state;
        out[0] = (uint32_t)sagnac_compensator_update(image, state, codes, in[0]);
        if (!same_in_slices(image, &sliced, state, codes, in)) {
            out[0] = UINT32_MAX;
        }
        out[1] = out[0] == 0U ? sagnac_compensator_status(state) : 0U;
        out[2] = low(state->k_q32);
        out[3] = high(state->k_q32);
        out[4] = low(state->target);
        out[5] = high(state->target);
        return 1;
    case 2:
        compensator_run(m, in, out);
        return 1;
    case 3:
        out[0] = (uint32_t)sagnac_compensator_advance(image, state, as_signed(in[0]), in[1], &given);
        out[1] = (uint32_t)given.counts;
        out[2] = given.status;
        with_state(state, out);
        return 1;
    case 4:
        out[0] = (uint32_t)sagnac_compensator_skip(state, in[0]);
        out[1] = state->ticks_to_update;
        with_state(state, out);
        return 1;
    case 5:
        sagnac_compensator_migrate_state(image, state);
        out[2] = sagnac_compensator_status(state);
        with_state(state, out);
        return 1;
    case 6:
        sagnac_compensator_clear_overflow(state);
        out[2] = sagnac_compensator_status(state);
        with_state(state, out);
        return 1;
    default:
        return 0;
    }
}

/* What the vectors' plant shows: docs/reference/vectors.md. */
static int32_t plant(const machine *m, int64_t place_q32, const uint32_t *in)
{
    const int64_t wavelength = m->path.loop.wavelength;
    const int64_t x = sagnac_floor_shift(m->path.at_q32, 32U) + m->path.modulation;
    int64_t d = (x - sagnac_floor_shift(place_q32, 32U)) % wavelength;
    int64_t light = (in[7] & 512U) != 0U ? (int64_t)in[5] : 0;
    if (d < 0) {
        d += wavelength;
    }
    if (d > wavelength / 2) {
        d -= wavelength;
    }
    light -= (int64_t)((uint64_t)(d * d) * in[6] >> 32);
    return light > 0 ? (int32_t)light : 0;
}

static void path_run(machine *m, const uint32_t *in, uint32_t *out)
{
    sagnac_path_length_state *state = &m->path.state;
    int64_t place_q32 = sagnac_q32(as_signed(in[3])) + (int64_t)in[2];
    uint32_t seed = in[1], given = UINT32_C(2166136261), said = given, tick;
    int closed = in[0] > 0U;
    for (tick = 0U; tick < in[0]; tick++) {
        sagnac_path_length_output output;
        int32_t code;
        place_q32 += (int64_t)as_signed(in[4]) * 65536;
        m->path.at_q32 += sagnac_floor_shift(sagnac_q32(m->path.actuator) - m->path.at_q32, in[7] >> 16);
        code = plant(m, place_q32, in) + noise(&seed, in[7] & 255U);
        sagnac_path_length_tick(&m->path.loop, state, code, &output);
        m->path.actuator = output.actuator;
        m->path.modulation = output.modulation;
        take(&given, (uint32_t)output.actuator);
        take(&given, (uint32_t)output.modulation);
        if (state->index == 0U) {
            take(&given, (uint32_t)state->second_harmonic);
        }
        take(&said, output.status);
        take(&said, (uint32_t)state->phase);
        closed = closed && (state->phase == SAGNAC_PATH_CLOSING || state->phase == SAGNAC_PATH_LOCKED);
    }
    out[0] = given;
    out[1] = (in[7] & 256U) != 0U && !closed ? ~said : said;
    out[2] = (uint32_t)state->phase | state->status << 8 | (uint32_t)state->modes << 16;
    out[3] = (uint32_t)state->error;
    out[4] = (uint32_t)state->held;
    out[5] = low(state->integral_q32);
    out[6] = high(state->integral_q32);
}

static int path_step(machine *m, uint32_t operation, const uint32_t *in, uint32_t *out)
{
    if (operation == 0U) {
        sagnac_path_length_start(&m->path.loop, &m->path.state);
        m->path.actuator = m->path.state.held;
        m->path.modulation = 0;
        m->path.at_q32 = sagnac_q32(m->path.actuator);
    } else if (operation == 1U) {
        path_run(m, in, out);
    }
    return operation <= 1U;
}

static int light_step(machine *m, uint32_t operation, const uint32_t *in, uint32_t *out)
{
    uint32_t seed = in[1], hash = UINT32_C(2166136261), status = 0U, tick;
    if (operation == 0U) {
        sagnac_intensity_start(&m->light.loop, &m->light.state);
        m->light.current = 0;
        m->light.light_q16 = 0;
        return 1;
    }
    for (tick = 0U; tick < in[0]; tick++) {
        const int64_t gain = (in[4] & 512U) != 0U ? (int64_t)in[2] : 0;
        sagnac_intensity_output output;
        int32_t code;
        m->light.light_q16 += sagnac_floor_shift((int64_t)m->light.current * gain - m->light.light_q16, in[3]);
        code = (int32_t)sagnac_floor_shift(m->light.light_q16, 16U) + noise(&seed, in[4] & 255U);
        sagnac_intensity_tick(&m->light.loop, &m->light.state, code, in[4] & 256U, &output);
        m->light.current = output.current;
        status = output.status;
        take(&hash, (uint32_t)output.current);
        take(&hash, status);
    }
    out[0] = hash;
    out[1] = (uint32_t)m->light.state.phase | status << 8;
    out[2] = (uint32_t)m->light.current;
    out[3] = low(m->light.state.integral_q32);
    out[4] = high(m->light.state.integral_q32);
    out[5] = low(m->light.light_q16);
    out[6] = high(m->light.light_q16);
    return operation == 1U;
}

static int fringes_step(machine *m, uint32_t operation, const uint32_t *in, uint32_t *out)
{
    uint32_t seed = in[1], hash = UINT32_C(2166136261), sum = 0U, pair;
    if (operation == 0U) {
        sagnac_quadrature_start(&m->fringes.counter);
        m->fringes.counting = in[0] == 1U ? SAGNAC_X1 : in[0] == 2U ? SAGNAC_X2 : SAGNAC_X4;
        m->fringes.quarter = 0U;
        return 1;
    }
    for (pair = 0U; pair < in[0]; pair++) {
        const uint32_t word = noise_word(&seed);
        const uint32_t step = word < in[2] ? 1U : word < in[3] ? 3U : word < in[4] ? 2U : 0U;
        const uint32_t quarter = (m->fringes.quarter + step) & 3U;
        const int32_t count = sagnac_quadrature_update(&m->fringes.counter, m->fringes.counting, quarter == 1U || quarter == 2U,
                                                       quarter == 2U || quarter == 3U);
        m->fringes.quarter = quarter;
        sum += (uint32_t)count;
        take(&hash, (uint32_t)count);
    }
    out[0] = sum;
    out[1] = m->fringes.counter.lost;
    out[2] = hash;
    out[3] = m->fringes.quarter;
    return operation == 1U;
}

static int32_t pickoff_of(machine *m, const uint32_t *in, uint32_t *seed)
{
    int64_t p, y;
    m->strip.phase += in[5];
    p = as_signed(m->strip.phase);
    y = sagnac_floor_shift(p * ((INT64_C(1) << 31) - (p < 0 ? -p : p)), 31U);
    y = sagnac_floor_shift((int64_t)in[4] * y, 29U) + as_signed(in[7]);
    return (int32_t)sagnac_held(y + noise(seed, in[6]), INT32_MIN, INT32_MAX);
}

static int strip_step(machine *m, uint32_t operation, const uint32_t *in, uint32_t *out)
{
    sagnac_stripper *stripper = &m->strip.stripper;
    uint32_t seed = in[1], hash = UINT32_C(2166136261), periods = 0U, tick;
    int64_t sum = 0;
    if (operation == 0U) {
        sagnac_stripper_start(stripper, in[0], in[1]);
        m->strip.phase = 0U;
        return 1;
    }
    for (tick = 0U; tick < in[0]; tick++) {
        const int32_t counts = as_signed(in[2] + (uint32_t)noise(&seed, in[3]));
        const int32_t pickoff = pickoff_of(m, in, &seed);
        sagnac_stripped stripped;
        if (sagnac_stripper_update(stripper, counts, pickoff, &stripped) != 0U) {
            take(&hash, low(stripped.counts));
            take(&hash, high(stripped.counts));
            take(&hash, stripped.ticks);
            take(&hash, stripped.without_zero);
            sum += stripped.counts;
            periods++;
        }
        take(&hash, sagnac_stripper_has_dither(stripper));
    }
    out[0] = hash;
    out[1] = low(sum);
    out[2] = high(sum);
    out[3] = low(stripper->sum);
    out[4] = high(stripper->sum);
    out[5] = sagnac_stripper_has_dither(stripper);
    out[6] = periods;
    return operation == 1U;
}

/* Each thermometer but those that stand still moves by drift and noise. */
static void move_values(machine *m, const uint32_t *in, uint32_t *seed)
{
    uint32_t i;
    for (i = 0U; i < 4U; i++) {
        const uint32_t moved = in[2] + (uint32_t)noise(seed, in[3]);
        if ((in[6] >> i & 1U) == 0U) {
            m->watch.values[i] = as_signed((uint32_t)m->watch.values[i] + moved);
        }
    }
}

static void watch_run(machine *m, const uint32_t *in, uint32_t *out)
{
    uint32_t seed = in[1], i;
    out[0] = UINT32_C(2166136261);
    for (i = 0U; i < 4U; i++) {
        if ((in[6] >> (12U + i) & 1U) != 0U) {
            m->watch.values[i] = as_signed(in[5]);
        }
    }
    for (i = 0U; i < in[0]; i++) {
        const uint32_t present = ~(in[6] >> 8) & (~(in[6] >> 4) | noise_word(&seed) >> 28) & 15U;
        m->watch.command += in[4];
        move_values(m, in, &seed);
        out[3] = sagnac_watch_update(&m->watch.spec, &m->watch.watch, m->watch.values, present, in[6] >> 16 & 1U,
                                     as_signed(m->watch.command));
        out[1] += out[3] != 0U;
        out[2] |= out[3];
        take(&out[0], out[3]);
    }
    out[4] = (uint32_t)m->watch.values[0];
    out[5] = m->watch.command;
}

static void vote_run(const uint32_t *in, uint32_t *out)
{
    uint32_t seed = in[1], turn, i;
    out[0] = UINT32_C(2166136261);
    for (turn = 0U; turn < in[0]; turn++) {
        const uint32_t present = ~(in[6] >> 8) & (~in[6] | noise_word(&seed) >> 24) & 255U;
        int32_t codes[8];
        sagnac_vote vote;
        for (i = 0U; i < 8U; i++) {
            const uint32_t drawn = in[4] + (uint32_t)noise(&seed, in[3]);
            codes[i] = as_signed((in[6] >> (16U + i) & 1U) != 0U ? in[5] : drawn);
        }
        sagnac_vote_of(codes, 8U, present, in[2], &vote);
        out[1] += vote.outvoted != 0U;
        out[2] |= vote.outvoted;
        out[3] = vote.has_code | vote.outvoted << 8 | vote.voters << 16;
        out[4] = (uint32_t)vote.code;
        take(&out[0], out[3]);
        take(&out[0], out[4]);
    }
}

static void watch_start(machine *m, uint32_t shows, uint32_t still, uint32_t command_shows)
{
    const sagnac_watch_spec spec = {shows, still, command_shows};
    uint32_t i;
    m->watch.spec = spec;
    m->watch.command = 0U;
    for (i = 0U; i < 4U; i++) {
        m->watch.values[i] = 0;
    }
    sagnac_watch_start(&m->watch.watch);
}

static int watch_step(machine *m, uint32_t operation, const uint32_t *in, uint32_t *out)
{
    if (operation == 0U) {
        watch_start(m, in[0], in[1], in[2]);
    } else if (operation == 1U) {
        watch_run(m, in, out);
    } else {
        vote_run(in, out);
    }
    return operation <= 2U;
}

/* 1 ready, 0 refused, -1 an unknown module. */
static int start(machine *m, uint32_t module, const vectors *from)
{
    int ready = -1;
    if (module == 1U) {
        ready = sagnac_image_load(&m->compensator.image, octet, from, from->length) == SAGNAC_IMAGE_OK;
        sagnac_compensator_start(&m->compensator.state);
    } else if (module == 2U) {
        ready = sagnac_path_length_load(&m->path.loop, octet, from, from->length) != 0U;
    } else if (module == 3U) {
        ready = sagnac_intensity_load(&m->light.loop, octet, from, from->length) != 0U;
    } else if (module == 4U || module == 5U) {
        sagnac_quadrature_start(&m->fringes.counter);
        ready = 1;
    } else if (module == 7U) {
        watch_start(m, UINT32_MAX, UINT32_MAX, 0U);
        ready = 1;
    }
    return ready;
}

static int step(machine *m, uint32_t module, uint32_t operation, const uint32_t *in, uint32_t *out)
{
    if (module == 1U) {
        return compensator_step(m, operation, in, out);
    }
    if (module == 4U || module == 5U) {
        return module == 4U ? fringes_step(m, operation, in, out) : strip_step(m, operation, in, out);
    }
    if (module == 7U) {
        return watch_step(m, operation, in, out);
    }
    return module == 2U ? path_step(m, operation, in, out) : light_step(m, operation, in, out);
}

static int records(const char *name, vectors *from, uint32_t module, uint32_t count)
{
    static machine m;
    uint32_t record, word;
    int ready = start(&m, module, from);
    if (ready <= 0) {
        printf("%s: FAILED: %s\n", name, ready < 0 ? "an unknown module" : "the table is refused");
        return 0;
    }
    for (record = 0U; record < count; record++) {
        uint32_t operation, in[INPUTS], out[OUTPUTS] = {0U}, expected;
        int i, whole = next_word(from, &operation);
        for (i = 0; i < INPUTS; i++) {
            whole = next_word(from, &in[i]) && whole;
        }
        if (!whole || !step(&m, module, operation, in, out)) {
            printf("%s: FAILED: record %" PRIu32 " cannot be read\n", name, record);
            return 0;
        }
        for (i = 0; i < OUTPUTS; i++) {
            if (!next_word(from, &expected) || expected != out[i]) {
                printf("%s: FAILED: record %" PRIu32 ", output %d: %08" PRIx32 ", the vectors say %08" PRIx32 "\n", name,
                       record, i, out[i], expected);
                return 0;
            }
        }
    }
    if (next_word(from, &word)) {
        printf("%s: FAILED: words behind the last record\n", name);
        return 0;
    }
    printf("%s: %" PRIu32 " records equal\n", name, count);
    return count > 0U;
}

static int check(const char *name)
{
    static vectors from;
    uint32_t magic, module, count, i, word = 0U;
    int whole, passed = 0;
    from.file = fopen(name, "r");
    if (from.file == NULL) {
        printf("%s: FAILED: cannot be opened\n", name);
        return 0;
    }
    whole = next_word(&from, &magic) && next_word(&from, &module) && next_word(&from, &from.length) &&
            next_word(&from, &count) && magic == MAGIC && from.length <= MAX_TABLE;
    for (i = 0U; whole && i < from.length; i++) {
        if (i % 4U == 0U) {
            whole = next_word(&from, &word);
        }
        from.bytes[i] = (word >> (8U * (i % 4U))) & 255U;
    }
    if (whole) {
        passed = records(name, &from, module, count);
    } else {
        printf("%s: FAILED: not a vector file\n", name);
    }
    fclose(from.file);
    return passed;
}

int main(int argc, char **argv)
{
    int failed = 0, i;
    for (i = 1; i < argc; i++) {
        failed += check(argv[i]) == 0;
    }
    return failed == 0 && argc > 1 ? 0 : 1;
}
