/* How far the correction may be off now: see sagnac_error_bound.h. */
#include "sagnac_error_bound.h"

#include "sagnac_integer.h"

/* 0.1 deg/h, and a part of the rate effects. */
#define LEAST_MILLI_DPH 100U
#define PART 20
/* log2 e in Q16, rounded down. */
#define LOG2_E_Q16 94548U
#define ONE_Q16 ((int64_t)65536)
/* Farther than any span: 2^33. */
#define MOST_REACH ((int64_t)8589934592)
/* Without a bound whatever else holds. */
#define OPEN_ENDED                                                                                                                   \
    (SAGNAC_UNCORRECTED | SAGNAC_OUT_OF_SPAN | SAGNAC_RATE_OUT_OF_SPAN | SAGNAC_OVERFLOW | SAGNAC_NO_DITHER | SAGNAC_COUNTS_LOST |     \
     SAGNAC_STUCK | SAGNAC_OUTVOTED)

/* The largest effects of an input on the increment, Q40 counts per tick; slope per half span, jump of its steps. */
typedef struct {
    int64_t curve;
    int64_t rate;
    int64_t slope;
    int64_t jump;
} bound_effects;

static int64_t least(int64_t one, int64_t other)
{
    return (one < other) ? one : other;
}

/* one * other, both 0 or more, held to the largest number. */
static int64_t times(int64_t one, int64_t other)
{
    return ((other > 0) && (one > (INT64_MAX / other))) ? INT64_MAX : (one * other);
}

/* An effect times a part in Q16 that is at most 2, rounded up. */
static int64_t scaled(int64_t effect, int64_t part_q16)
{
    return times(sagnac_floor_shift(effect, 16U) + 1, part_q16);
}

/* Of T_n the steepest slope is n^2, of a harmonic pi times its turns. A step has none. */
static int64_t bound_slope(const sagnac_term *term)
{
    const uint32_t turns = term->turns_q18 >> 16U;
    int64_t slope;
    switch (term->shape) {
    case SAGNAC_ZONE:
        slope = 1;
        break;
    case SAGNAC_STEP:
        slope = 0;
        break;
    case SAGNAC_COSINE:
    case SAGNAC_SINE:
        slope = (int64_t)turns + 1;
        break;
    case SAGNAC_CHEBYSHEV:
    default:
        slope = (int64_t)term->order * (int64_t)term->order;
        break;
    }
    return slope;
}

static bound_effects effects_of(const sagnac_image *image, uint32_t input)
{
    bound_effects effects = {0, 0, 0, 0};
    uint32_t i;
    for (i = 0U; i < image->term_count; i++) {
        const sagnac_term *term = &image->terms[i];
        if ((term->input == input) && (term->kind == SAGNAC_BIAS)) {
            const int64_t full = (int64_t)sagnac_size32(term->mantissa) * sagnac_power(31U);
            const int64_t size = sagnac_floor_shift(full, term->shift) + 1;
            /* The image bounds the sum of sizes: 2^54, and no slope is above 257. */
            effects.slope += size * bound_slope(term);
            if (term->shape == SAGNAC_STEP) {
                effects.jump += size;
            }
            if (term->times_rate != 0U) {
                effects.rate += size;
            } else if ((term->shape == SAGNAC_CHEBYSHEV) && (term->order == 0U)) {
                /* A constant follows no input. */
            } else {
                effects.curve += size;
            }
        }
    }
    return effects;
}

static int64_t whole_of(const bound_effects *effects)
{
    return (int64_t)2 * (effects->curve + effects->rate);
}

/* Some slow updates in time constants, Q16, rounded down. */
static uint64_t in_taus_q16(const sagnac_input *spec, uint32_t updates)
{
    const uint32_t shift = (spec->alpha_shift > 16U) ? (spec->alpha_shift - 16U) : 0U;
    return ((uint64_t)updates * (uint64_t)spec->alpha_mantissa) >> shift;
}

/* The border of the rate that is farther from zero, at least 1. */
static int64_t far_border(const sagnac_input *spec)
{
    const int64_t low = -(int64_t)spec->rate_lo;
    const int64_t high = (int64_t)spec->rate_hi;
    const int64_t far = (low > high) ? low : high;
    return (far > 1) ? far : 1;
}

/* The most that the rate, in parts of its border, can change while the input moves this far in so many updates, Q16. */
static int64_t rate_change_q16(const sagnac_input *spec, int64_t reach_q24, uint32_t updates)
{
    const uint64_t taus_q16 = in_taus_q16(spec, updates);
    const int64_t most = (int64_t)2 * ONE_Q16;
    const int64_t turned_q16 = ((taus_q16 < (uint64_t)most) ? (int64_t)taus_q16 : most) + 1;
    const int64_t part = sagnac_floor_shift(least(reach_q24, MOST_REACH), 2U) + 1;
    const uint32_t mantissa = spec->alpha_mantissa >> 4U;
    const int64_t product = part * ((int64_t)mantissa + 1);
    /* Six places are left out above, and sixteen are for Q16. */
    const uint32_t places = (spec->alpha_shift > spec->rate_shift) ? (spec->alpha_shift - spec->rate_shift) : 0U;
    const int64_t moved =
        (places >= 22U) ? sagnac_floor_shift(product, places - 22U) : times(product, sagnac_power(22U - places));
    const int64_t moved_q16 = least((moved / far_border(spec)) + 1, most);
    const int64_t change_q16 = moved_q16 + sagnac_floor_shift(moved_q16 * turned_q16, 16U) + turned_q16;
    return (spec->alpha_mantissa != 0U) ? least(change_q16, most) : 0;
}

/* At least effect * exp(-n * alpha), up to 32 time constants: whole halves, and between them the chord of 2^-f, at most 6 % above it. */
static int64_t decayed(int64_t effect, const sagnac_input *spec, uint32_t updates)
{
    const uint64_t longest = (uint64_t)1U << 21U;
    const uint64_t taus_q16 = in_taus_q16(spec, updates);
    const uint64_t halves_q16 = (((taus_q16 < longest) ? taus_q16 : longest) * (uint64_t)LOG2_E_Q16) >> 16U;
    const uint64_t halves = halves_q16 >> 16U;
    const uint64_t rest = halves_q16 & 0xFFFFU;
    const int64_t rest_q16 = (int64_t)rest;
    const int64_t chord = scaled(effect, ONE_Q16 - (rest_q16 / 2));
    return sagnac_floor_shift(chord, (uint32_t)halves) + 1;
}

/* The effect of an input that moves this far in so many updates: on the terms, over their steps, and behind the lag. */
static int64_t effect_of_way(const bound_effects *effects, const sagnac_input *spec, int64_t reach_q24, uint32_t updates)
{
    const int64_t half_q24 = ((int64_t)spec->span_hi_q24 - (int64_t)spec->span_lo_q24) / 2;
    const int64_t part_q16 = (least(reach_q24, MOST_REACH) * ONE_Q16) / ((half_q24 > 1) ? half_q24 : 1);
    const int64_t on_terms = scaled(effects->slope, least(part_q16, (int64_t)2 * ONE_Q16) + 1);
    const int64_t behind_lag = scaled(effects->rate, rate_change_q16(spec, reach_q24, updates));
    return least(on_terms, whole_of(effects)) + effects->jump + behind_lag;
}

/* How far the codes behind an input may have moved in some updates, 2^-24 degC: SAGNAC_NO without a limit of slope. */
static uint32_t parents_reach(const sagnac_image *image, uint32_t input, uint32_t updates, int64_t *reach_q24)
{
    const sagnac_input *spec = &image->inputs[input];
    const uint32_t first = ((spec->source == SAGNAC_DIFFERENCE) || (spec->source == SAGNAC_REPEAT)) ? spec->of : input;
    uint32_t has = (image->inputs[first].step_growth > 0U) ? SAGNAC_YES : SAGNAC_NO;
    *reach_q24 = (int64_t)sagnac_input_reach(&image->inputs[first], updates);
    if (spec->source == SAGNAC_DIFFERENCE) {
        if (image->inputs[spec->less].step_growth == 0U) {
            has = SAGNAC_NO;
        }
        *reach_q24 += (int64_t)sagnac_input_reach(&image->inputs[spec->less], updates);
    }
    return has;
}

/* A first value or a step may be wrong, or a jump is weighed: it or the value before. */
static uint32_t is_open(const sagnac_image *image, const sagnac_compensator_state *state, uint32_t input)
{
    const sagnac_input_state *memory = &state->inputs[input];
    return ((memory->steady_updates > 0U) || (sagnac_input_is_open(&image->inputs[input], memory) != 0U)) ? SAGNAC_YES : SAGNAC_NO;
}

/* A code behind an input may be wrong. */
static uint32_t parents_are_open(const sagnac_image *image, const sagnac_compensator_state *state, uint32_t input)
{
    const sagnac_input *spec = &image->inputs[input];
    const uint32_t first = ((spec->source == SAGNAC_DIFFERENCE) || (spec->source == SAGNAC_REPEAT)) ? spec->of : input;
    uint32_t open = is_open(image, state, first);
    if ((open == 0U) && (spec->source == SAGNAC_DIFFERENCE)) {
        open = is_open(image, state, spec->less);
    }
    return open;
}

/* An input that moves on while the correction stays. */
static int64_t while_held(const bound_effects *effects, const sagnac_image *image, uint32_t input, uint32_t updates)
{
    const sagnac_input *spec = &image->inputs[input];
    int64_t reach_q24 = 0;
    int64_t effect = 0;
    if (spec->source == SAGNAC_WARM_UP) {
        effect = scaled(effects->rate, rate_change_q16(spec, 0, updates));
    } else {
        (void)parents_reach(image, input, updates, &reach_q24);
        effect = effect_of_way(effects, spec, reach_q24, updates);
    }
    return effect;
}

static int64_t of_fault(const bound_effects *effects, const sagnac_image *image, const sagnac_compensator_state *state,
                        uint32_t input, uint32_t held_updates)
{
    const sagnac_input *spec = &image->inputs[input];
    const sagnac_input_state *memory = &state->inputs[input];
    int64_t off = 0;
    int64_t reach_q24;
    uint32_t may_be_wrong = parents_are_open(image, state, input);
    if ((spec->source != SAGNAC_WARM_UP) && (parents_reach(image, input, 0U, &reach_q24) == 0U)) {
        may_be_wrong = SAGNAC_YES;
    }
    if (may_be_wrong != 0U) {
        off = whole_of(effects);
    } else {
        if ((spec->alpha_mantissa != 0U) && (memory->settled_updates <= spec->settling_updates)) {
            off = decayed((int64_t)2 * effects->rate, spec, memory->settled_updates);
        }
        if (held_updates > 0U) {
            const uint32_t updates = (held_updates > memory->held_updates) ? held_updates : memory->held_updates;
            off += while_held(effects, image, input, updates);
        }
    }
    return off;
}

/* A number in 31 bits, rounded up; its binary places. */
static uint64_t in_31_bits(uint64_t number, uint32_t *places)
{
    uint64_t rest = number;
    *places = 0U;
    while (rest >= (uint64_t)0x80000000U) {
        rest = rest >> 1U;
        (*places)++;
    }
    if (*places > 0U) {
        rest++;
    }
    return rest;
}

static uint64_t divided_up(uint64_t number, uint64_t by)
{
    return (number / by) + (((number % by) > 0U) ? 1U : 0U);
}

/* Q40 counts per tick in 0.001 deg/h, rounded up: times the scale factor in 1e-15 arcsec, over a thousand ticks in ns. */
static uint32_t milli_dph(const sagnac_image *image, int64_t effect_q40)
{
    uint32_t of_effect;
    uint32_t of_angle;
    const uint64_t effect = in_31_bits((uint64_t)effect_q40, &of_effect);
    const uint64_t angle = in_31_bits(image->scale_factor_femto_arcsec, &of_angle);
    const uint64_t tick = (image->tick_ns > 1U) ? (uint64_t)image->tick_ns : 1U;
    const uint64_t whole = divided_up(divided_up(effect * angle, tick), 1000U);
    const uint32_t places = of_effect + of_angle;
    const uint64_t most = (uint64_t)UINT32_MAX;
    uint64_t milli = most;
    if (places < 40U) {
        const uint32_t right = 40U - places;
        milli = whole >> right;
        milli++;
    } else {
        const uint32_t left = places - 40U;
        /* 31 + 33 - 40 places at most. */
        if (whole <= (most >> left)) {
            milli = whole << left;
        }
    }
    return (milli < (uint64_t)UINT32_MAX) ? (uint32_t)milli : SAGNAC_UNBOUNDED;
}

void sagnac_error_bound_start(sagnac_error_bound *bound)
{
    bound->held_updates = 0U;
    bound->milli_dph = SAGNAC_UNBOUNDED;
    bound->made_milli_dph = SAGNAC_UNBOUNDED;
    bound->is_whole = SAGNAC_YES;
    bound->next = 0U;
    bound->rates = 0;
    bound->faults = 0;
}

uint32_t sagnac_status_is_open_ended(uint32_t status)
{
    return ((status & OPEN_ENDED) != 0U) ? SAGNAC_YES : SAGNAC_NO;
}

/* The sum of two numbers, at most SAGNAC_UNBOUNDED. */
static uint32_t sum_of(uint32_t one, uint32_t other)
{
    return (one > (UINT32_MAX - other)) ? SAGNAC_UNBOUNDED : (one + other);
}

/* The last slice. A hold keeps a correction that may have been made of a wrong value, whatever the inputs show now. */
static void bound_end(sagnac_error_bound *bound, uint32_t base_milli_dph, uint32_t faults_milli_dph)
{
    const uint32_t now = sum_of(base_milli_dph, faults_milli_dph);
    bound->milli_dph = now;
    if (bound->held_updates == 0U) {
        bound->made_milli_dph = now;
    } else {
        const uint32_t made = sum_of(bound->made_milli_dph, faults_milli_dph);
        bound->milli_dph = (made > now) ? made : now;
    }
    bound->is_whole = SAGNAC_YES;
}

void sagnac_error_bound_begin(sagnac_error_bound *bound, const sagnac_compensator_state *state)
{
    const uint32_t status = sagnac_compensator_status(state);
    if ((status & SAGNAC_HELD) == 0U) {
        bound->held_updates = 0U;
    } else if (bound->held_updates < UINT32_MAX) {
        bound->held_updates++;
    } else {
        /* It stays at its largest value. */
    }
    bound->is_whole = SAGNAC_NO;
    bound->next = 0U;
    bound->rates = 0;
    bound->faults = 0;
    if (sagnac_status_is_open_ended(status) != 0U) {
        bound_end(bound, SAGNAC_UNBOUNDED, 0U);
    }
}

void sagnac_error_bound_advance(sagnac_error_bound *bound, const sagnac_image *image, const sagnac_compensator_state *state)
{
    if (bound->is_whole != 0U) {
        /* No slice is missing. */
    } else if (bound->next < image->input_count) {
        const bound_effects effects = effects_of(image, bound->next);
        /* The largest step that passes, with the way of the true value meanwhile. */
        int64_t step_q24;
        bound->rates += effects.rate;
        if (parents_reach(image, bound->next, 1U, &step_q24) == 0U) {
            step_q24 = 0;
        }
        bound->faults += least(effect_of_way(&effects, &image->inputs[bound->next], step_q24, 0U) +
                                   of_fault(&effects, image, state, bound->next, bound->held_updates),
                               whole_of(&effects));
        bound->next++;
    } else {
        const uint32_t base = milli_dph(image, (bound->rates / PART) + 1);
        bound_end(bound, (base > LEAST_MILLI_DPH) ? base : LEAST_MILLI_DPH, (bound->faults > 0) ? milli_dph(image, bound->faults) : 0U);
    }
}

/* SAG-CORE-031 */
void sagnac_error_bound_update(sagnac_error_bound *bound, const sagnac_image *image, const sagnac_compensator_state *state)
{
    sagnac_error_bound_begin(bound, state);
    while (bound->is_whole == 0U) {
        sagnac_error_bound_advance(bound, image, state);
    }
}
