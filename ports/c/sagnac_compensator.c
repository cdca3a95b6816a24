/* The thermal correction of a ring laser gyro: see sagnac_compensator.h. */
#include "sagnac_compensator.h"

#define BASIS_LENGTH (SAGNAC_MAX_ORDER + 1U)
#define ONE_Q31 ((int64_t)2147483648)
#define ONE_Q32 ((int64_t)4294967296)
#define ONE_Q47 ((int64_t)140737488355328)
/* Low bits of x, multiplied separately from its upper Q30. */
#define X_LOW_BITS 17U
#define X_LOW ((int64_t)131072)
/* Low bits of a difference of values, multiplied separately. */
#define LAG_LOW_BITS 23U
#define LAG_LOW ((int64_t)8388608)
/* A quarter of a turn in 2^-56, and the coefficients of a quarter of the sine. */
#define QUARTER_Q56 ((int64_t)18014398509481984)
#define QUARTER_BITS 54U
#define SINE_LENGTH 6U
/* Bits below Q32 in which terms are summed. */
#define GUARD_BITS 8U
/* An accumulator beyond this after a call has no meaning: 2^61. */
#define ACCUMULATOR_BOUND ((int64_t)2305843009213693952)
/* Largest |increment|, and |sum of increments| of a period. */
#define MAX_INCREMENT ((int64_t)70368744177664)
#define MAX_INCREMENT_SUM ((int64_t)2305843009213693952)
#define MAX_SCALE ((int64_t)67108864)
/* Layout of an image. */
#define HEAD_LENGTH 128U
#define INPUT_LENGTH 64U
#define TERM_LENGTH 12U
#define CRC_LENGTH 4U
/* Where the lag of a warm-up begins: -1 degC. */
#define WARM_UP_START_Q46 (-(int64_t)70368744177664)
/* Updates for which a step must stay before it is a value; values from the first one on among which a step is not held open; updates for
 * which a reach grows; and 2^3 of the longest hold after which a filter goes on is tau. */
#define STEADY_UPDATES 3U
#define START_VALUES 6U
#define MOST_GROWTH 65535U
#define MOST_STEP_GROWTH 16U
/* Slow updates that a start after a reset makes of a warm-up at most: 2^20. */
#define MOST_UPDATES_MADE_UP 1048576U
#define HOLD_SHIFT 3U
/* The minor version of an image with a largest step that grows, the newest that is read; else of one with a largest step; else of one with a warm-up; else of one with an input that repeats another; else of one
 * with harmonics; else 0. */
#define MINOR_OF_GROWTH 5U
#define MINOR_OF_STEPS 4U
#define MINOR_OF_WARM_UPS 3U
#define MINOR_OF_REPEATS 2U
#define MINOR_OF_HARMONICS 1U

/* T_0(x) ... T_8(x) in Q31 for x in Q47, |x| <= 1. */
/* SAG-CORE-007 */
static void gyro_chebyshev(int64_t x_q47, int64_t basis[BASIS_LENGTH])
{
    const int64_t high = sagnac_floor_shift(x_q47, X_LOW_BITS);
    const int64_t low = x_q47 - (high * X_LOW);
    int64_t before = ONE_Q32;
    int64_t here = sagnac_round_shift(x_q47, 15U);
    uint32_t order;
    basis[0] = ONE_Q31;
    for (order = 1U; order < BASIS_LENGTH; order++) {
        const int64_t product = (high * here) + sagnac_floor_shift(low * here, X_LOW_BITS);
        const int64_t next = sagnac_round_shift(product, 29U) - before;
        basis[order] = sagnac_round_shift(here, 1U);
        before = here;
        here = next;
    }
}

/* ((x - knot)/2)^2 in Q31 above the knot, 0 below it. */
/* SAG-CORE-008 */
static int64_t gyro_zone(int64_t x_q47, int32_t knot_q15)
{
    const int64_t above = x_q47 - ((int64_t)knot_q15 * ONE_Q32);
    int64_t square = 0;
    if (above > 0) {
        const int64_t half = sagnac_round_shift(above, X_LOW_BITS);
        square = sagnac_round_shift(half * half, 31U);
    }
    return square;
}

static uint32_t is_harmonic(const sagnac_term *term)
{
    return ((term->shape == SAGNAC_COSINE) || (term->shape == SAGNAC_SINE)) ? SAGNAC_YES : SAGNAC_NO;
}

/* The sine of a term's turns at x, the cosine a quarter of a turn later: z + z*R(z^2) of a quarter, R in Q32. */
/* SAG-CORE-009 */
static int64_t gyro_harmonic(int64_t x_q47, const sagnac_term *term)
{
    static const int64_t rest_q32[SINE_LENGTH] = {2451551556, -2774394651, 342277046, -20107381, 688100, -14670};
    const int64_t later = (term->shape == SAGNAC_COSINE) ? QUARTER_Q56 : 0;
    const int64_t position = sagnac_round_shift(x_q47 + ONE_Q47, 10U);
    const int64_t turns = (position * (int64_t)term->turns_q18) + later;
    const int64_t quarters = sagnac_floor_shift(turns, QUARTER_BITS);
    const int64_t past = turns - (quarters * QUARTER_Q56);
    const int64_t z = sagnac_round_shift(((quarters % 2) == 0) ? past : (QUARTER_Q56 - past), 23U);
    const int64_t square = sagnac_round_shift(z * z, 31U);
    int64_t sum = 0;
    int64_t size;
    uint32_t i;
    for (i = SINE_LENGTH; i > 0U; i--) {
        sum = rest_q32[i - 1U] + sagnac_round_shift(sum * square, 31U);
    }
    size = sagnac_held(z + sagnac_round_shift(z * sum, 32U), 0, ONE_Q31);
    return ((quarters % 4) < 2) ? size : -size;
}

/* The value of a code, 2^-24 degC, not yet checked. */
/* SAG-CORE-002 */
static int64_t input_value(const sagnac_input *spec, int32_t code)
{
    const int64_t product = (int64_t)code * (int64_t)spec->gain_mantissa;
    return (int64_t)spec->offset_q24 + sagnac_round_shift(product, spec->gain_shift);
}

/* 1 and the value, or 0 outside the valid range. */
static uint32_t input_if_valid(const sagnac_input *spec, int64_t t, int32_t *t_q24)
{
    uint32_t valid = 0U;
    if ((t >= (int64_t)spec->valid_lo_q24) && (t <= (int64_t)spec->valid_hi_q24)) {
        *t_q24 = (int32_t)t;
        valid = 1U;
    }
    return valid;
}

uint32_t sagnac_input_value(const sagnac_input *spec, int32_t code, int32_t *t_q24)
{
    return input_if_valid(spec, input_value(spec, code), t_q24);
}

/* x of the value clamped to the span. */
/* SAG-CORE-006 */
static void scale_input(const sagnac_input *spec, int32_t t_q24, sagnac_scaled_input *out)
{
    const int32_t clamped = sagnac_held32(t_q24, spec->span_lo_q24, spec->span_hi_q24);
    const int64_t both = (int64_t)spec->span_lo_q24 + (int64_t)spec->span_hi_q24;
    const int64_t middle = sagnac_floor_shift(both, 1U);
    const int64_t product = ((int64_t)clamped - middle) * (int64_t)spec->x_mantissa;
    out->x_q47 = sagnac_held(sagnac_round_shift(product, spec->x_shift), -ONE_Q47, ONE_Q47);
    out->x_clamped = (clamped != t_q24) ? SAGNAC_YES : SAGNAC_NO;
}

/* One period of the lag; y is the scaled, clamped rate. */
/* SAG-CORE-005 */
static void step_lag(const sagnac_input *spec, sagnac_input_state *memory, int32_t t_q24, sagnac_scaled_input *out)
{
    out->y_q31 = 0;
    out->y_clamped = 0U;
    if (spec->alpha_mantissa != 0U) {
        const int64_t mantissa = (int64_t)spec->alpha_mantissa;
        const uint32_t shift = spec->alpha_shift - LAG_LOW_BITS;
        const int64_t difference = ((int64_t)t_q24 * (int64_t)4194304) - memory->lag_q46;
        const int64_t high = sagnac_floor_shift(difference, LAG_LOW_BITS);
        const int64_t low = difference - (high * LAG_LOW);
        const int64_t product = (high * mantissa) + sagnac_floor_shift(low * mantissa, LAG_LOW_BITS);
        const int64_t total = product + memory->remainder;
        const int64_t whole = sagnac_floor_shift(total, shift);
        const int64_t rate = sagnac_round_shift(product, (spec->alpha_shift - 1U) - spec->rate_shift);
        const int64_t clamped = sagnac_held(rate, (int64_t)spec->rate_lo, (int64_t)spec->rate_hi);
        const int64_t y = sagnac_round_shift(clamped * (int64_t)spec->y_mantissa, spec->y_shift);
        memory->remainder = total - (whole * sagnac_power(shift));
        memory->lag_q46 += whole;
        out->y_q31 = sagnac_held(y, -ONE_Q31, ONE_Q31);
        out->y_clamped = (clamped != rate) ? SAGNAC_YES : SAGNAC_NO;
    }
}

static uint32_t one_more(uint32_t count)
{
    return (count == UINT32_MAX) ? count : (count + 1U);
}

/* The distance of two values. */
static uint32_t distance(int32_t a, int32_t b)
{
    const int64_t apart = (int64_t)a - (int64_t)b;
    return (uint32_t)((apart < 0) ? -apart : apart);
}

/* How far from an older value a value may lie after some updates without one. */
uint32_t sagnac_input_reach(const sagnac_input *spec, uint32_t updates)
{
    const uint32_t most = (updates < MOST_GROWTH) ? updates : MOST_GROWTH;
    uint64_t grown = 0U;
    if (spec->step_growth > 0U) {
        grown = ((uint64_t)most * (uint64_t)spec->largest_step_q8) << spec->step_growth;
    }
    grown += (uint64_t)spec->largest_step_q8 * (uint64_t)65536U;
    return (grown < (uint64_t)UINT32_MAX) ? (uint32_t)grown : UINT32_MAX;
}

/* A step stays open until the input steps back by as much: both ends of a fault lie within a largest step of the true value. */
/* SAG-CORE-028 */
static void open_step(const sagnac_input *spec, sagnac_input_state *memory, int32_t t_q24)
{
    const uint32_t sum = (memory->open_q24 + (uint32_t)t_q24 - (uint32_t)memory->last_q24) & 0xFFFFFFFFU;
    const uint64_t rest = (sum > 0x7FFFFFFFU) ? ((uint64_t)0x100000000U - (uint64_t)sum) : (uint64_t)sum;
    if (spec->step_growth == 0U) {
        /* A step is not held open. */
    } else if ((memory->open_q24 == 0U) && (memory->values < START_VALUES)) {
        /* The first values after power-on are often wrong. */
    } else if ((memory->open_q24 != 0U) && (rest <= ((uint64_t)spec->largest_step_q8 * 131072U))) {
        memory->open_q24 = 0U;
    } else {
        memory->open_q24 = sum;
    }
}

/* 1 for a value at once, 2 for one too far from the last one that has stayed, 0 while it has not. */
/* SAG-CORE-003 */
static uint32_t accept_step(const sagnac_input *spec, sagnac_input_state *memory, int32_t t_q24)
{
    const uint32_t largest = spec->largest_step_q8 * 65536U;
    const uint32_t moved = distance(t_q24, memory->last_q24);
    uint32_t accepted = 0U;
    if ((largest == 0U) || (memory->has_last == 0U) || (moved <= sagnac_input_reach(spec, memory->unread_updates))) {
        memory->steady_updates = 0U;
        accepted = 1U;
    } else {
        const uint32_t stays =
            ((memory->steady_updates > 0U) && (distance(t_q24, memory->step_q24) <= largest)) ? SAGNAC_YES : SAGNAC_NO;
        memory->steady_updates = (stays != 0U) ? (memory->steady_updates + 1U) : 1U;
        memory->step_q24 = t_q24;
        if (memory->steady_updates >= STEADY_UPDATES) {
            memory->steady_updates = 0U;
            accepted = 2U;
            open_step(spec, memory, t_q24);
        }
    }
    return accepted;
}

/* The lag begins again with a step that has stayed, of the input or of what it is derived from, or after a hold of more than an eighth of
 * tau: 1/(8 alpha) updates. */
/* SAG-CORE-004 */
static void begin_again(const sagnac_input *spec, sagnac_input_state *memory, uint32_t stepped, int32_t t_q24)
{
    if (spec->alpha_mantissa != 0U) {
        uint32_t restarts = stepped;
        if (memory->held_updates > 0U) {
            const int64_t longest = sagnac_power(spec->alpha_shift - HOLD_SHIFT) / (int64_t)spec->alpha_mantissa;
            if ((int64_t)memory->held_updates > longest) {
                restarts = 1U;
            }
        }
        if (restarts != 0U) {
            memory->lag_q46 = (int64_t)t_q24 * (int64_t)4194304;
            memory->remainder = 0;
            memory->settled_updates = 0U;
        }
    }
}

/* One period of one input; 0 without a valid value at this update, 2 for a step of its own or, with `source_stepped`, of what it is derived
 * from. */
static uint32_t read_input(const sagnac_input *spec, sagnac_input_state *memory, uint32_t present, uint32_t source_stepped,
                                 int64_t value, sagnac_scaled_input *out)
{
    int32_t t_q24 = 0;
    uint32_t fresh = 0U;
    if (present != 0U) {
        fresh = input_if_valid(spec, value, &t_q24);
    }
    if (fresh != 0U) {
        fresh = accept_step(spec, memory, t_q24);
    } else if ((memory->steady_updates == 0U) && (memory->unread_updates < MOST_GROWTH)) {
        /* A reach does not grow over a sample that was held back: what comes behind it may be as wrong. */
        memory->unread_updates++;
    } else {
        /* It stays. */
    }
    if ((fresh != 0U) && (source_stepped != 0U)) {
        fresh = 2U;
    }
    if ((fresh != 0U) && (memory->has_last == 0U)) {
        memory->lag_q46 = (int64_t)t_q24 * (int64_t)4194304;
    } else if (fresh != 0U) {
        begin_again(spec, memory, (fresh == 2U) ? SAGNAC_YES : SAGNAC_NO, t_q24);
    } else {
        /* Missing. */
    }
    if ((fresh == 0U) && (memory->has_last != 0U)) {
        t_q24 = memory->last_q24;
    }
    if ((fresh != 0U) || (memory->has_last != 0U)) {
        sagnac_scaled_input now = {0, 0, 0U, 0U};
        memory->last_q24 = t_q24;
        memory->has_last = 1U;
        memory->settled_updates = one_more(memory->settled_updates);
        step_lag(spec, memory, t_q24, &now);
        if (fresh != 0U) {
            scale_input(spec, t_q24, &now);
            *out = now;
        }
    }
    if (fresh != 0U) {
        memory->held_updates = 0U;
        memory->unread_updates = 0U;
        memory->values = (memory->values > START_VALUES) ? memory->values : (memory->values + 1U);
    } else {
        memory->held_updates = one_more(memory->held_updates);
    }
    return fresh;
}

/* Power-on: the lag of a warm-up begins, once. */
static void begin_warm_up(const sagnac_input *spec, sagnac_input_state *memory)
{
    if ((spec->source == SAGNAC_WARM_UP) && (memory->has_last == 0U)) {
        memory->lag_q46 = WARM_UP_START_Q46;
        memory->has_last = 1U;
        memory->settled_updates = UINT32_MAX;
    }
}

/* The value of input i: 0 of a warm-up, else from its code, or from one or two inputs with a value at this update; 0 if there is none. */
static uint32_t find_value(const sagnac_image *image, const sagnac_slow_update *update, uint32_t i, int64_t *value)
{
    const sagnac_input *spec = &image->inputs[i];
    uint32_t found;
    *value = 0;
    if (spec->source == SAGNAC_DIFFERENCE) {
        found = (update->fresh >> spec->of) & (update->fresh >> spec->less) & 1U;
        if (found != 0U) {
            *value = (int64_t)update->inputs[spec->of].last_q24 - (int64_t)update->inputs[spec->less].last_q24;
        }
    } else if (spec->source == SAGNAC_REPEAT) {
        found = (update->fresh >> spec->of) & 1U;
        if (found != 0U) {
            *value = (int64_t)update->inputs[spec->of].last_q24;
        }
    } else if (spec->source == SAGNAC_WARM_UP) {
        found = 1U;
    } else {
        found = (update->present >> i) & 1U;
        if (found != 0U) {
            *value = input_value(spec, update->codes[i]);
        }
    }
    return found;
}

/* The lag still remembers its start. */
static uint32_t is_settling(const sagnac_input *spec, const sagnac_input_state *memory)
{
    return ((spec->settling_updates > 0U) && (memory->settled_updates <= spec->settling_updates)) ? SAGNAC_YES : SAGNAC_NO;
}

/* Nothing shows yet that the first value was right, or a step is open. */
uint32_t sagnac_input_is_open(const sagnac_input *spec, const sagnac_input_state *memory)
{
    uint32_t open = 0U;
    if (spec->step_growth > 0U) {
        open = ((memory->values <= START_VALUES) || (memory->open_q24 != 0U)) ? SAGNAC_YES : SAGNAC_NO;
    }
    return open;
}

/* An input that input i is derived from took a step. */
static uint32_t source_stepped(const sagnac_image *image, const sagnac_slow_update *update, uint32_t i)
{
    const sagnac_input *spec = &image->inputs[i];
    uint32_t stepped = 0U;
    if (spec->source == SAGNAC_DIFFERENCE) {
        stepped = ((update->stepped >> spec->of) | (update->stepped >> spec->less)) & 1U;
    } else if (spec->source == SAGNAC_REPEAT) {
        stepped = (update->stepped >> spec->of) & 1U;
    } else {
        /* It has no source. */
    }
    return stepped;
}

/* The slice of an input: its value, lag, status and series. */
/* SAG-CORE-010 */
static void input_slice(const sagnac_image *image, sagnac_slow_update *update, uint32_t i)
{
    const sagnac_input *spec = &image->inputs[i];
    sagnac_input_state *memory = &update->inputs[i];
    sagnac_scaled_input *scaled = &update->scaled[i];
    int64_t value;
    uint32_t taken;
    const uint32_t has_sample = find_value(image, update, i, &value);
    if (update->warm == 0U) {
        begin_warm_up(spec, memory);
    }
    taken = read_input(spec, memory, has_sample, source_stepped(image, update, i), value, scaled);
    if (taken != 0U) {
        update->fresh |= 1U << i;
        if (taken == 2U) {
            update->stepped |= 1U << i;
        }
    } else {
        update->held = 1U;
        update->status |= SAGNAC_HELD;
        if (memory->held_updates > spec->stale_after_updates) {
            update->status |= SAGNAC_STALE;
        }
    }
    if ((scaled->x_clamped != 0U) || (scaled->y_clamped != 0U)) {
        update->status |= SAGNAC_OUT_OF_SPAN;
    }
    if (scaled->y_clamped != 0U) {
        update->status |= SAGNAC_RATE_OUT_OF_SPAN;
    }
    if ((sagnac_input_is_open(spec, memory) != 0U) || (is_settling(spec, memory) != 0U)) {
        update->status |= SAGNAC_SETTLING;
    }
    gyro_chebyshev(scaled->x_q47, update->basis[i]);
}

/* The slice of a term. */
/* SAG-CORE-011 */
static void term_slice(const sagnac_term *term, sagnac_slow_update *update)
{
    const int64_t x_q47 = update->scaled[term->input].x_q47;
    int64_t factor;
    int64_t value;
    if (term->shape == SAGNAC_ZONE) {
        factor = gyro_zone(x_q47, term->knot_q15);
    } else if (term->shape == SAGNAC_STEP) {
        factor = (x_q47 >= ((int64_t)term->knot_q15 * ONE_Q32)) ? ONE_Q31 : 0;
    } else if (is_harmonic(term) != 0U) {
        factor = gyro_harmonic(x_q47, term);
    } else {
        factor = update->basis[term->input][term->order];
    }
    if (term->times_rate != 0U) {
        factor = sagnac_round_shift(factor * update->scaled[term->input].y_q31, 31U);
    }
    value = sagnac_round_shift((int64_t)term->mantissa * factor, term->shift);
    if (term->kind == SAGNAC_BIAS) {
        update->bias += value;
    } else {
        update->scale += value;
    }
}

/* Starts the slew to a new increment: `steeper` ticks by slope + 1, the others by slope. */
/* SAG-CORE-012 */
static void gyro_slew_to(sagnac_compensator_state *state, int64_t target, uint32_t ticks)
{
    state->target = target;
    if (ticks == 0U) {
        state->increment = target;
    } else {
        const int64_t delta = target - state->increment;
        int64_t slope = delta / (int64_t)ticks;
        int64_t steeper = delta % (int64_t)ticks;
        if (steeper < 0) {
            steeper += (int64_t)ticks;
            slope -= 1;
        }
        state->slope = slope;
        state->steeper_ticks = (uint32_t)steeper;
        state->slewing_ticks = ticks;
    }
}

/* Advances the slew by n ticks; returns the sum of its increments. */
static int64_t gyro_slew(sagnac_compensator_state *state, uint32_t n)
{
    int64_t sum;
    if (state->slewing_ticks == 0U) {
        sum = (int64_t)n * state->increment;
    } else {
        const uint32_t slewing = (n < state->slewing_ticks) ? n : state->slewing_ticks;
        const uint32_t steeper = (slewing < state->steeper_ticks) ? slewing : state->steeper_ticks;
        const int64_t m = (int64_t)slewing;
        const int64_t e = (int64_t)steeper;
        const uint32_t steady = n - slewing;
        sum = (m * state->increment) + (state->slope * ((m * (m + 1)) / 2)) + ((e * (e + 1)) / 2) + ((m - e) * e);
        state->increment += (m * state->slope) + e;
        state->slewing_ticks -= slewing;
        state->steeper_ticks -= steeper;
        sum += (int64_t)steady * state->increment;
    }
    return sum;
}

/* SAG-CORE-016 */
static sagnac_misuse run_clock(sagnac_compensator_state *state, uint32_t ticks, int64_t *increments)
{
    sagnac_misuse result = SAGNAC_OK;
    if (ticks > state->ticks_to_update) {
        result = SAGNAC_UPDATE_DUE;
    } else {
        state->ticks_to_update -= ticks;
        *increments = gyro_slew(state, ticks);
    }
    return result;
}

/* SAG-CORE-013, SAG-CORE-014 */
static void emit(const sagnac_image *image, sagnac_compensator_state *state, int32_t raw, int64_t increments,
                     sagnac_output *output)
{
    if (state->overflow != 0U) {
        output->counts = 0;
        output->status = sagnac_compensator_status(state);
    } else {
        const int64_t sum = state->accumulator + (((int64_t)raw * state->k_q32) - increments);
        const int64_t limit = (int64_t)image->output_limit;
        const int64_t whole = sagnac_floor_shift(sum, 32U);
        const int64_t counts = sagnac_held(whole, -limit, limit);
        uint32_t limited = 0U;
        state->accumulator = sum - (counts * ONE_Q32);
        if (counts != whole) {
            limited = SAGNAC_LIMITED;
            if ((state->accumulator > ACCUMULATOR_BOUND) || (state->accumulator < -ACCUMULATOR_BOUND)) {
                state->overflow = 1U;
            }
        }
        output->counts = (int32_t)counts;
        output->status = sagnac_compensator_status(state) | limited;
    }
}

int64_t sagnac_image_increment_bound(const sagnac_image *image)
{
    uint32_t bits = 0U;
    int64_t by_period;
    /* 32 bits: a period of 0, which no image has, in memory that turned over. */
    while ((bits < 32U) && (((image->period_ticks - 1U) >> bits) != 0U)) {
        bits++;
    }
    by_period = sagnac_floor_shift(MAX_INCREMENT_SUM, bits);
    return (by_period < MAX_INCREMENT) ? by_period : MAX_INCREMENT;
}

void sagnac_compensator_start(sagnac_compensator_state *state)
{
    uint32_t i;
    state->accumulator = 0;
    state->k_q32 = ONE_Q32;
    state->increment = 0;
    state->target = 0;
    state->slope = 0;
    state->steeper_ticks = 0U;
    state->slewing_ticks = 0U;
    state->ticks_to_update = 0U;
    state->slow_status = SAGNAC_UNCORRECTED;
    state->corrected_once = 0U;
    state->overflow = 0U;
    state->warm = 0U;
    state->updates = 0U;
    for (i = 0U; i < SAGNAC_MAX_INPUTS; i++) {
        state->inputs[i].lag_q46 = 0;
        state->inputs[i].remainder = 0;
        state->inputs[i].last_q24 = 0;
        state->inputs[i].has_last = 0U;
        state->inputs[i].step_q24 = 0;
        state->inputs[i].steady_updates = 0U;
        state->inputs[i].held_updates = 0U;
        state->inputs[i].unread_updates = 0U;
        state->inputs[i].values = 0U;
        state->inputs[i].settled_updates = 0U;
        state->inputs[i].open_q24 = 0U;
    }
}

void sagnac_compensator_start_warm(sagnac_compensator_state *state)
{
    sagnac_compensator_start(state);
    state->warm = 1U;
}

void sagnac_compensator_start_after(const sagnac_image *image, sagnac_compensator_state *state, uint32_t updates)
{
    uint32_t most = updates;
    uint32_t i;
    if (most > MOST_UPDATES_MADE_UP) {
        most = MOST_UPDATES_MADE_UP;
    }
    sagnac_compensator_start(state);
    for (i = 0U; i < image->input_count; i++) {
        if (image->inputs[i].source == SAGNAC_WARM_UP) {
            sagnac_scaled_input unused = {0, 0, 0U, 0U};
            uint32_t left = most;
            begin_warm_up(&image->inputs[i], &state->inputs[i]);
            while (left > 0U) {
                (void)read_input(&image->inputs[i], &state->inputs[i], 1U, 0U, 0, &unused);
                left--;
            }
        }
    }
}

/* SAG-CORE-015 */
void sagnac_compensator_clear_overflow(sagnac_compensator_state *state)
{
    if (state->overflow != 0U) {
        state->overflow = 0U;
        state->accumulator = 0;
    }
}

/* SAG-CORE-020 */
void sagnac_compensator_migrate_state(const sagnac_image *image, sagnac_compensator_state *state)
{
    const int64_t bound = sagnac_image_increment_bound(image);
    const sagnac_compensator_state old = *state;
    sagnac_compensator_start_warm(state);
    state->accumulator = old.accumulator;
    state->overflow = old.overflow;
    state->updates = (old.updates == UINT32_MAX) ? 0U : (old.updates + 1U);
    state->k_q32 = old.k_q32;
    state->increment = sagnac_held(old.increment, -bound, bound);
    state->target = state->increment;
}

void sagnac_compensator_begin_update(const sagnac_image *image, const sagnac_compensator_state *state,
                                     const int32_t *codes, uint32_t present, sagnac_slow_update *update)
{
    uint32_t i;
    for (i = 0U; i < SAGNAC_MAX_INPUTS; i++) {
        const uint32_t given = (i < image->input_count) ? ((present >> i) & 1U) : 0U;
        update->inputs[i] = state->inputs[i];
        update->scaled[i].x_q47 = 0;
        update->scaled[i].y_q31 = 0;
        update->scaled[i].x_clamped = 0U;
        update->scaled[i].y_clamped = 0U;
        update->codes[i] = 0;
        if (given != 0U) {
            update->codes[i] = codes[i];
        }
    }
    update->bias = 0;
    update->scale = 0;
    update->present = present;
    update->warm = state->warm;
    update->before = state->updates;
    update->fresh = 0U;
    update->stepped = 0U;
    update->held = 0U;
    update->status = 0U;
    update->slices = 0U;
}

/* SAG-CORE-026 */
uint32_t sagnac_compensator_advance_update(const sagnac_image *image, sagnac_slow_update *update)
{
    const uint32_t at = update->slices;
    uint32_t complete = 0U;
    if (at < image->input_count) {
        input_slice(image, update, at);
        update->slices++;
    } else if (((at - image->input_count) < image->term_count) && (update->held == 0U)) {
        term_slice(&image->terms[at - image->input_count], update);
        update->slices++;
    } else {
        complete = 1U;
    }
    return complete;
}

sagnac_misuse sagnac_compensator_apply_update(const sagnac_image *image, sagnac_compensator_state *state,
                                              sagnac_slow_update *update)
{
    sagnac_misuse result = SAGNAC_OK;
    if (state->ticks_to_update != 0U) {
        result = SAGNAC_UPDATE_NOT_DUE;
    } else if (update->before != state->updates) {
        result = SAGNAC_OUTDATED;
    } else {
        uint32_t complete = 0U;
        uint32_t i;
        while (complete == 0U) {
            complete = sagnac_compensator_advance_update(image, update);
        }
        for (i = 0U; i < SAGNAC_MAX_INPUTS; i++) {
            state->inputs[i] = update->inputs[i];
        }
        state->ticks_to_update = image->period_ticks;
        state->updates = (state->updates == UINT32_MAX) ? 0U : (state->updates + 1U);
        if (update->held == 0U) {
            state->k_q32 = ONE_Q32 + sagnac_round_shift(update->scale, GUARD_BITS);
            gyro_slew_to(state, sagnac_round_shift(update->bias, GUARD_BITS), image->slew_ticks);
            state->corrected_once = 1U;
        } else {
            /* A held correction keeps the span bits of the values it was computed from. */
            update->status |= state->slow_status & (SAGNAC_OUT_OF_SPAN | SAGNAC_RATE_OUT_OF_SPAN);
        }
        if (state->corrected_once == 0U) {
            update->status |= SAGNAC_UNCORRECTED;
        }
        state->slow_status = update->status;
    }
    return result;
}

sagnac_misuse sagnac_compensator_update(const sagnac_image *image, sagnac_compensator_state *state,
                                        const int32_t *codes, uint32_t present)
{
    sagnac_misuse result = SAGNAC_UPDATE_NOT_DUE;
    if (state->ticks_to_update == 0U) {
        sagnac_slow_update update;
        sagnac_compensator_begin_update(image, state, codes, present, &update);
        result = sagnac_compensator_apply_update(image, state, &update);
    }
    return result;
}

sagnac_misuse sagnac_compensator_tick(const sagnac_image *image, sagnac_compensator_state *state, int32_t raw,
                                      sagnac_output *output)
{
    return sagnac_compensator_advance(image, state, raw, 1U, output);
}

/* SAG-CORE-017 */
sagnac_misuse sagnac_compensator_advance(const sagnac_image *image, sagnac_compensator_state *state, int32_t raw,
                                         uint32_t ticks, sagnac_output *output)
{
    sagnac_misuse result = SAGNAC_RAW_OUT_OF_RANGE;
    if ((raw >= -SAGNAC_MAX_RAW) && (raw <= SAGNAC_MAX_RAW)) {
        int64_t increments = 0;
        result = run_clock(state, ticks, &increments);
        if (result == SAGNAC_OK) {
            emit(image, state, raw, increments, output);
        }
    }
    return result;
}

sagnac_misuse sagnac_compensator_skip(sagnac_compensator_state *state, uint32_t ticks)
{
    int64_t increments = 0;
    return run_clock(state, ticks, &increments);
}

uint32_t sagnac_compensator_status(const sagnac_compensator_state *state)
{
    return (state->overflow != 0U) ? (state->slow_status | SAGNAC_OVERFLOW) : state->slow_status;
}

/* border * mantissa * 2^-shift is 1 in Q31 to within 2^-28, and its product with a rounding fits 63 bits. */
static uint32_t reaches_one(int64_t border, uint32_t mantissa, uint32_t shift)
{
    uint32_t reaches = 0U;
    if ((shift <= 31U) && (mantissa != 0U) && (border > 0)) {
        /* border <= 2^31 and mantissa < 2^32. */
        const uint64_t product = (uint64_t)border * (uint64_t)mantissa;
        const uint64_t end = product >> shift;
        const int64_t most = INT64_MAX - ONE_Q31;
        if ((product <= (uint64_t)most) && (end >= 2147483640U) && (end <= 2147483656U)) {
            reaches = 1U;
        }
    }
    return reaches;
}

static uint32_t lag_is_sound(const sagnac_input *t)
{
    uint32_t sound;
    if (t->alpha_mantissa == 0U) {
        sound = ((t->alpha_shift | t->rate_shift | t->y_mantissa | t->y_shift) == 0U) ? SAGNAC_YES : SAGNAC_NO;
        if ((t->rate_lo != 0) || (t->rate_hi != 0)) {
            sound = 0U;
        }
    } else {
        const int64_t below = -(int64_t)t->rate_lo;
        const int64_t above = (int64_t)t->rate_hi;
        const int64_t far = (below > above) ? below : above;
        sound = 1U;
        if ((t->alpha_mantissa > 2147483648U) || (t->alpha_shift < 31U) || (t->alpha_shift > 62U)) {
            sound = 0U;
        }
        if ((t->rate_shift >= t->alpha_shift) || (t->rate_lo == INT32_MIN) || (below < 0) || (above < 0)) {
            sound = 0U;
        }
        if (reaches_one(far, t->y_mantissa, t->y_shift) == 0U) {
            sound = 0U;
        }
    }
    return sound;
}

static uint32_t input_is_sound(const sagnac_input *t)
{
    const int64_t span = (int64_t)t->span_hi_q24 - (int64_t)t->span_lo_q24;
    uint32_t sound = lag_is_sound(t);
    if ((t->gain_mantissa == 0) || (t->gain_shift > 62U) || (t->x_shift > 15U)) {
        sound = 0U;
    }
    if ((t->unit_exponent < -100) || (t->unit_exponent > 100)) {
        sound = 0U;
    }
    if ((t->valid_lo_q24 == INT32_MIN) || (t->valid_hi_q24 == INT32_MAX) ||
        (t->valid_lo_q24 >= t->valid_hi_q24)) {
        sound = 0U;
    }
    if ((span <= 0) || ((span % 2) != 0) || (reaches_one(span / 2, t->x_mantissa, t->x_shift + 16U) == 0U)) {
        sound = 0U;
    }
    if ((t->step_growth > MOST_STEP_GROWTH) || ((t->step_growth > 0U) && (t->largest_step_q8 == 0U))) {
        sound = 0U;
    }
    return sound;
}

/* A repeat uses one input before it that repeats no other, with the same unit, valid range and hold time. */
static uint32_t repeat_is_sound(const sagnac_image *image, uint32_t i)
{
    const sagnac_input *t = &image->inputs[i];
    uint32_t sound = 0U;
    if ((t->of < i) && (t->less == 0U)) {
        const sagnac_input *other = &image->inputs[t->of];
        if ((other->source != SAGNAC_REPEAT) && (other->source != SAGNAC_WARM_UP) && (other->unit_exponent == t->unit_exponent) &&
            (other->valid_lo_q24 == t->valid_lo_q24) && (other->valid_hi_q24 == t->valid_hi_q24) &&
            (other->stale_after_updates == t->stale_after_updates)) {
            sound = 1U;
        }
    }
    return sound;
}

/* A difference uses two inputs before it with codes of their own. */
static uint32_t difference_is_sound(const sagnac_image *image, uint32_t i)
{
    const sagnac_input *t = &image->inputs[i];
    uint32_t sound = 0U;
    if ((t->of < i) && (t->less < i) && (t->of != t->less)) {
        if ((image->inputs[t->of].source == SAGNAC_CODE) && (image->inputs[t->less].source == SAGNAC_CODE)) {
            sound = 1U;
        }
    }
    return sound;
}

/* An input without a code of its own has no conversion. */
static uint32_t source_is_sound(const sagnac_image *image, uint32_t i)
{
    const sagnac_input *t = &image->inputs[i];
    uint32_t sound = 0U;
    if (t->source == SAGNAC_CODE) {
        sound = ((t->of | t->less) == 0U) ? SAGNAC_YES : SAGNAC_NO;
    } else if ((t->offset_q24 != 0) || (t->gain_mantissa != 1) || (t->gain_shift != 0U) || (t->largest_step_q8 != 0U)) {
        sound = 0U;
    } else if (t->source == SAGNAC_DIFFERENCE) {
        sound = difference_is_sound(image, i);
    } else if (t->source == SAGNAC_REPEAT) {
        sound = repeat_is_sound(image, i);
    } else if (t->source == SAGNAC_WARM_UP) {
        /* Its value is 0. */
        sound = ((t->of | t->less) == 0U) ? SAGNAC_YES : SAGNAC_NO;
        if ((t->alpha_mantissa == 0U) || (t->valid_lo_q24 > 0) || (t->valid_hi_q24 < 0)) {
            sound = 0U;
        }
    } else {
        sound = 0U;
    }
    return sound;
}

/* A series has an order, a piece a knot, a harmonic its turns; none has what belongs to another. */
static uint32_t shape_is_sound(const sagnac_term *term)
{
    uint32_t sound;
    if (term->shape == SAGNAC_CHEBYSHEV) {
        sound = ((term->order <= SAGNAC_MAX_ORDER) && (term->knot_q15 == 0) && (term->turns_q18 == 0U)) ? SAGNAC_YES : SAGNAC_NO;
    } else if (is_harmonic(term) != 0U) {
        sound = ((term->turns_q18 > 0U) && (term->turns_q18 <= SAGNAC_MAX_TURNS_Q18)) ? SAGNAC_YES : SAGNAC_NO;
        if ((term->order != 0U) || (term->knot_q15 != 0)) {
            sound = 0U;
        }
    } else {
        sound = ((term->knot_q15 >= -32768) && (term->knot_q15 <= 32767)) ? SAGNAC_YES : SAGNAC_NO;
        if ((term->order != 0U) || (term->turns_q18 != 0U) || ((term->shape != SAGNAC_ZONE) && (term->shape != SAGNAC_STEP))) {
            sound = 0U;
        }
    }
    return sound;
}

static uint32_t term_is_sound(const sagnac_image *image, const sagnac_term *term)
{
    uint32_t sound = 0U;
    if ((term->input < image->input_count) && (shape_is_sound(term) != 0U) && (term->shift >= 8U) &&
        (term->shift <= 62U) && (term->mantissa != INT32_MIN) && (term->times_rate <= 1U)) {
        const uint32_t has_rate = (image->inputs[term->input].alpha_mantissa != 0U) ? SAGNAC_YES : SAGNAC_NO;
        sound = ((term->times_rate == 0U) || (has_rate != 0U)) ? SAGNAC_YES : SAGNAC_NO;
        if ((term->kind != SAGNAC_BIAS) && (term->kind != SAGNAC_SCALE)) {
            sound = 0U;
        }
    }
    return sound;
}

int64_t sagnac_image_reach(const sagnac_image *image, sagnac_kind kind)
{
    int64_t sum = 0;
    uint32_t i;
    for (i = 0U; i < image->term_count; i++) {
        const sagnac_term *term = &image->terms[i];
        if (term->kind == kind) {
            /* At most 2^54 each: 32 of them stay below 2^60. */
            const uint64_t size = (uint64_t)sagnac_size32(term->mantissa);
            const uint64_t bound = (size << 31) >> term->shift;
            sum += (int64_t)bound + 1;
        }
    }
    return sagnac_floor_shift(sum, GUARD_BITS);
}

/* The octets that follow the first one of a character of UTF-8, and the range of the first of them; SAGNAC_NO for an octet that begins
 * none. Table 3-7 of the Unicode Standard. */
static uint32_t text_begins(uint32_t octet, uint32_t *more, uint32_t *low, uint32_t *high)
{
    uint32_t begins = SAGNAC_YES;
    *low = 0x80U;
    *high = 0xBFU;
    if (octet < 0x80U) {
        *more = 0U;
    } else if ((octet >= 0xC2U) && (octet <= 0xDFU)) {
        *more = 1U;
    } else if ((octet >= 0xE0U) && (octet <= 0xEFU)) {
        *more = 2U;
        if (octet == 0xE0U) {
            *low = 0xA0U;
        }
        if (octet == 0xEDU) {
            *high = 0x9FU;
        }
    } else if ((octet >= 0xF0U) && (octet <= 0xF4U)) {
        *more = 3U;
        if (octet == 0xF0U) {
            *low = 0x90U;
        }
        if (octet == 0xF4U) {
            *high = 0x8FU;
        }
    } else {
        *more = 0U;
        begins = SAGNAC_NO;
    }
    return begins;
}

/* The serial number is UTF-8. */
static uint32_t serial_is_text(const sagnac_image *image)
{
    uint32_t sound = SAGNAC_YES;
    uint32_t more = 0U;
    uint32_t low = 0U;
    uint32_t high = 0U;
    uint32_t i;
    for (i = 0U; i < 32U; i++) {
        const uint32_t octet = (image->serial[i / 4U] >> (8U * (i % 4U))) & 0xFFU;
        if (more == 0U) {
            sound &= text_begins(octet, &more, &low, &high);
        } else {
            if ((octet < low) || (octet > high)) {
                sound = SAGNAC_NO;
            }
            low = 0x80U;
            high = 0xBFU;
            more--;
        }
    }
    return (more == 0U) ? sound : SAGNAC_NO;
}

/* The axis is a printable character; all numbers are in range. */
static uint32_t head_is_sound(const sagnac_image *image)
{
    uint32_t sound = serial_is_text(image);
    if ((image->axis < 33U) || (image->axis > 126U) || (image->tick_ns == 0U) || (image->period_ticks == 0U) ||
        (image->period_ticks > 16777216U) || (image->slew_ticks > image->period_ticks)) {
        sound = 0U;
    }
    if ((image->scale_factor_femto_arcsec == 0U) || (image->quantum_nano_counts == 0U) ||
        (image->output_limit == 0U) || (image->output_limit > 2147483647U)) {
        sound = 0U;
    }
    if ((image->input_count > SAGNAC_MAX_INPUTS) || (image->term_count > SAGNAC_MAX_TERMS)) {
        sound = 0U;
    }
    return sound;
}

/* SAG-CORE-019 */
sagnac_image_error sagnac_image_check(const sagnac_image *image)
{
    sagnac_image_error error = SAGNAC_IMAGE_OK;
    if (head_is_sound(image) == 0U) {
        error = SAGNAC_IMAGE_HEAD;
    } else {
        uint32_t i;
        for (i = 0U; (i < image->input_count) && (error == SAGNAC_IMAGE_OK); i++) {
            if ((input_is_sound(&image->inputs[i]) == 0U) || (source_is_sound(image, i) == 0U)) {
                error = SAGNAC_IMAGE_INPUT;
            }
        }
        for (i = 0U; (i < image->term_count) && (error == SAGNAC_IMAGE_OK); i++) {
            if (term_is_sound(image, &image->terms[i]) == 0U) {
                error = SAGNAC_IMAGE_TERM;
            }
        }
        if ((error == SAGNAC_IMAGE_OK) &&
            ((sagnac_image_reach(image, SAGNAC_BIAS) > sagnac_image_increment_bound(image)) || (sagnac_image_reach(image, SAGNAC_SCALE) > MAX_SCALE))) {
            error = SAGNAC_IMAGE_SUM;
        }
    }
    return error;
}

void sagnac_image_empty(sagnac_image *image)
{
    uint32_t i;
    for (i = 0U; i < 8U; i++) {
        image->serial[i] = 0U;
    }
    image->axis = 120U;
    image->tick_ns = 100000U;
    image->period_ticks = 10000U;
    image->slew_ticks = 100U;
    image->scale_factor_femto_arcsec = (uint64_t)1000000000000000;
    image->quantum_nano_counts = (uint64_t)1000000000;
    image->sequence = 0U;
    image->output_limit = 2147483647U;
    image->input_count = 0U;
    image->term_count = 0U;
}

static void load_head(sagnac_image *image, sagnac_read_octet read, const void *context)
{
    uint32_t i;
    for (i = 0U; i < 8U; i++) {
        image->serial[i] = sagnac_read_u32(read, context, 16U + (4U * i));
    }
    image->axis = read(context, 48U) & 0xFFU;
    image->input_count = read(context, 49U) & 0xFFU;
    image->term_count = read(context, 50U) & 0xFFU;
    image->tick_ns = sagnac_read_u32(read, context, 52U);
    image->period_ticks = sagnac_read_u32(read, context, 56U);
    image->slew_ticks = sagnac_read_u32(read, context, 60U);
    image->scale_factor_femto_arcsec = sagnac_read_u64(read, context, 64U);
    image->quantum_nano_counts = sagnac_read_u64(read, context, 72U);
    image->sequence = sagnac_read_u32(read, context, 84U);
    image->output_limit = sagnac_read_u32(read, context, 88U);
}

/* The minor version that added the source of an input, or its largest step. */
static uint32_t minor_of(const sagnac_input *t)
{
    uint32_t minor = 0U;
    if (t->source == SAGNAC_WARM_UP) {
        minor = MINOR_OF_WARM_UPS;
    }
    if (t->source == SAGNAC_REPEAT) {
        minor = MINOR_OF_REPEATS;
    }
    if (t->largest_step_q8 != 0U) {
        minor = MINOR_OF_STEPS;
    }
    if (t->step_growth != 0U) {
        minor = MINOR_OF_GROWTH;
    }
    return minor;
}

/* 0 if its source is unknown. */
static uint32_t load_input(sagnac_input *t, sagnac_read_octet read, const void *context, uint32_t at)
{
    const uint32_t source = read(context, at + 13U) & 0xFFU;
    const uint32_t octet = read(context, at + 60U) & 0xFFU;
    const int32_t exponent = (int32_t)octet;
    t->unit_exponent = (exponent < 128) ? exponent : (exponent - 256);
    t->offset_q24 = sagnac_read_i32(read, context, at);
    t->gain_mantissa = sagnac_read_i32(read, context, at + 4U);
    t->gain_shift = read(context, at + 8U) & 0xFFU;
    t->x_shift = read(context, at + 9U) & 0xFFU;
    t->alpha_shift = read(context, at + 10U) & 0xFFU;
    t->rate_shift = read(context, at + 11U) & 0xFFU;
    t->y_shift = read(context, at + 12U) & 0xFFU;
    if (source == 1U) {
        t->source = SAGNAC_DIFFERENCE;
    } else if (source == 2U) {
        t->source = SAGNAC_REPEAT;
    } else {
        t->source = (source == 3U) ? SAGNAC_WARM_UP : SAGNAC_CODE;
    }
    t->of = read(context, at + 14U) & 0xFFU;
    t->less = read(context, at + 15U) & 0xFFU;
    t->valid_lo_q24 = sagnac_read_i32(read, context, at + 16U);
    t->valid_hi_q24 = sagnac_read_i32(read, context, at + 20U);
    t->span_lo_q24 = sagnac_read_i32(read, context, at + 24U);
    t->span_hi_q24 = sagnac_read_i32(read, context, at + 28U);
    t->x_mantissa = sagnac_read_u32(read, context, at + 32U);
    t->alpha_mantissa = sagnac_read_u32(read, context, at + 36U);
    t->rate_lo = sagnac_read_i32(read, context, at + 40U);
    t->rate_hi = sagnac_read_i32(read, context, at + 44U);
    t->y_mantissa = sagnac_read_u32(read, context, at + 48U);
    t->stale_after_updates = sagnac_read_u32(read, context, at + 52U);
    t->settling_updates = sagnac_read_u32(read, context, at + 56U);
    t->largest_step_q8 = sagnac_read_u16(read, context, at + 61U);
    t->step_growth = read(context, at + 63U) & 0xFFU;
    return (source <= 3U) ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t load_term(sagnac_term *term, sagnac_read_octet read, const void *context, uint32_t at)
{
    const uint32_t kind = read(context, at) & 0xFFU;
    const uint32_t shape = read(context, at + 9U) & 0xFFU;
    const uint32_t order = read(context, at + 2U) & 0xFFU;
    const uint32_t low = sagnac_read_u16(read, context, at + 10U);
    const int32_t knot = (int32_t)low;
    term->kind = (kind == 1U) ? SAGNAC_BIAS : SAGNAC_SCALE;
    term->input = read(context, at + 1U) & 0xFFU;
    term->order = order;
    term->knot_q15 = (knot < 32768) ? knot : (knot - 65536);
    term->turns_q18 = 0U;
    term->times_rate = read(context, at + 3U) & 0xFFU;
    term->mantissa = sagnac_read_i32(read, context, at + 4U);
    term->shift = read(context, at + 8U) & 0xFFU;
    if (shape == 1U) {
        term->shape = SAGNAC_ZONE;
    } else if (shape == 2U) {
        term->shape = SAGNAC_STEP;
    } else if ((shape == 3U) || (shape == 4U)) {
        /* The low 16 bits of the turns use the bytes of a knot, the high 8 bits the byte of an order. */
        term->shape = (shape == 3U) ? SAGNAC_COSINE : SAGNAC_SINE;
        term->turns_q18 = low | (order << 16);
        term->order = 0U;
        term->knot_q15 = 0;
    } else {
        term->shape = SAGNAC_CHEBYSHEV;
    }
    return ((kind >= 1U) && (kind <= 2U) && (shape <= 4U)) ? SAGNAC_YES : SAGNAC_NO;
}

/* Checks length, magic, versions and checksum. */
/* SAG-CORE-018 */
static sagnac_image_error gyro_envelope(sagnac_read_octet read, const void *context, uint32_t length)
{
    static const uint32_t magic[2] = {0x4E474153U, 0x4D494341U};
    sagnac_image_error error = SAGNAC_IMAGE_OK;
    if ((length < (HEAD_LENGTH + CRC_LENGTH)) || (length > SAGNAC_MAX_IMAGE)) {
        error = SAGNAC_IMAGE_LENGTH;
    } else if ((sagnac_read_u32(read, context, 0U) != magic[0]) || (sagnac_read_u32(read, context, 4U) != magic[1])) {
        error = SAGNAC_IMAGE_NOT_AN_IMAGE;
    } else if ((sagnac_read_u16(read, context, 8U) != 1U) || (sagnac_read_u16(read, context, 10U) > MINOR_OF_GROWTH)) {
        error = SAGNAC_IMAGE_VERSION;
    } else if (sagnac_read_u32(read, context, 12U) != length) {
        error = SAGNAC_IMAGE_LENGTH;
    } else if (sagnac_crc32(read, context, 0U, length - CRC_LENGTH) !=
               sagnac_read_u32(read, context, length - CRC_LENGTH)) {
        error = SAGNAC_IMAGE_CRC;
    } else {
        error = SAGNAC_IMAGE_OK;
    }
    return error;
}

sagnac_image_error sagnac_image_load(sagnac_image *image, sagnac_read_octet read, const void *context, uint32_t length)
{
    sagnac_image_error error = gyro_envelope(read, context, length);
    uint32_t zeros = 1U;
    if (error == SAGNAC_IMAGE_OK) {
        load_head(image, read, context);
        zeros &= sagnac_are_zero(read, context, 51U, 1U) & sagnac_are_zero(read, context, 124U, 4U);
        error = (head_is_sound(image) != 0U) ? SAGNAC_IMAGE_OK : SAGNAC_IMAGE_HEAD;
    }
    if ((error == SAGNAC_IMAGE_OK) &&
        (length != (HEAD_LENGTH + (INPUT_LENGTH * image->input_count) +
                    (TERM_LENGTH * image->term_count) + CRC_LENGTH))) {
        error = SAGNAC_IMAGE_LENGTH;
    }
    if (error == SAGNAC_IMAGE_OK) {
        uint32_t kinds = 1U;
        uint32_t minor = 0U;
        uint32_t at = HEAD_LENGTH;
        uint32_t i;
        for (i = 0U; i < image->input_count; i++) {
            zeros &= load_input(&image->inputs[i], read, context, at);
            if (minor_of(&image->inputs[i]) > minor) {
                minor = minor_of(&image->inputs[i]);
            }
            at += INPUT_LENGTH;
        }
        for (i = 0U; i < image->term_count; i++) {
            kinds &= load_term(&image->terms[i], read, context, at);
            if ((is_harmonic(&image->terms[i]) != 0U) && (minor == 0U)) {
                minor = MINOR_OF_HARMONICS;
            }
            at += TERM_LENGTH;
        }
        if (zeros == 0U) {
            error = SAGNAC_IMAGE_RESERVED;
        } else if (kinds == 0U) {
            error = SAGNAC_IMAGE_TERM;
        } else if (sagnac_read_u16(read, context, 10U) != minor) {
            error = SAGNAC_IMAGE_VERSION;
        } else {
            error = sagnac_image_check(image);
        }
    }
    return error;
}
