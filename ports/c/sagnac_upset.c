/* Upsets of memory: see sagnac_upset.h. */
#include "sagnac_upset.h"

#include "sagnac_integer.h"

#define ALL_BITS 0xFFFFFFFFU
/* 2^32: one count of the accumulator. */
#define ONE_COUNT ((int64_t)4294967296)
#define NO_LIMIT 2147483647U
/* 2^61: more than this is held back by no limit. */
#define MOST_HELD_BACK ((int64_t)2305843009213693952)
/* 2^26, and one for the rounding. */
#define MOST_SCALE ((int64_t)67108865)
/* From one largest increment to the other: 2^47. */
#define MOST_SLOPE ((int64_t)140737488355328)

static uint32_t add_word(uint32_t sum, uint32_t word)
{
    const uint32_t mixed = (sum ^ word) & ALL_BITS;
    const uint32_t turned = ((mixed << 5) | (mixed >> 27)) & ALL_BITS;
    return (uint32_t)(((uint64_t)turned * (uint64_t)2654435761U) & ALL_BITS);
}

static uint32_t add_long(uint32_t sum, uint64_t value)
{
    return add_word(add_word(sum, (uint32_t)(value & ALL_BITS)), (uint32_t)(value >> 32));
}

/* SAG-CORE-027 */
uint32_t sagnac_state_sum(const sagnac_compensator_state *state)
{
    uint32_t sum = 0U;
    uint32_t i;
    sum = add_long(sum, (uint64_t)state->k_q32);
    sum = add_long(sum, (uint64_t)state->target);
    sum = add_long(sum, (uint64_t)state->slope);
    sum = add_word(sum, state->slow_status);
    sum = add_word(sum, state->corrected_once);
    sum = add_word(sum, state->warm);
    sum = add_word(sum, state->updates);
    for (i = 0U; i < SAGNAC_MAX_INPUTS; i++) {
        const sagnac_input_state *input = &state->inputs[i];
        sum = add_long(sum, (uint64_t)input->lag_q46);
        sum = add_long(sum, (uint64_t)input->remainder);
        sum = add_word(sum, (uint32_t)input->last_q24);
        sum = add_word(sum, input->has_last);
        sum = add_word(sum, (uint32_t)input->step_q24);
        sum = add_word(sum, input->steady_updates);
        sum = add_word(sum, input->held_updates);
        sum = add_word(sum, input->unread_updates);
        sum = add_word(sum, input->values);
        sum = add_word(sum, input->settled_updates);
        sum = add_word(sum, input->open_q24);
    }
    return sum;
}

static uint32_t add_input(uint32_t before, const sagnac_input *input)
{
    uint32_t sum = before;
    sum = add_word(sum, (uint32_t)input->source);
    sum = add_word(sum, input->of);
    sum = add_word(sum, input->less);
    sum = add_word(sum, (uint32_t)input->unit_exponent);
    sum = add_word(sum, (uint32_t)input->offset_q24);
    sum = add_word(sum, (uint32_t)input->gain_mantissa);
    sum = add_word(sum, input->gain_shift);
    sum = add_word(sum, (uint32_t)input->valid_lo_q24);
    sum = add_word(sum, (uint32_t)input->valid_hi_q24);
    sum = add_word(sum, (uint32_t)input->span_lo_q24);
    sum = add_word(sum, (uint32_t)input->span_hi_q24);
    sum = add_word(sum, input->x_mantissa);
    sum = add_word(sum, input->x_shift);
    sum = add_word(sum, input->alpha_mantissa);
    sum = add_word(sum, input->alpha_shift);
    sum = add_word(sum, input->rate_shift);
    sum = add_word(sum, (uint32_t)input->rate_lo);
    sum = add_word(sum, (uint32_t)input->rate_hi);
    sum = add_word(sum, input->y_mantissa);
    sum = add_word(sum, input->y_shift);
    sum = add_word(sum, input->stale_after_updates);
    sum = add_word(sum, input->settling_updates);
    sum = add_word(sum, input->largest_step_q8);
    return add_word(sum, input->step_growth);
}

static uint32_t add_term(uint32_t before, const sagnac_term *term)
{
    uint32_t sum = before;
    sum = add_word(sum, (uint32_t)term->kind);
    sum = add_word(sum, term->input);
    sum = add_word(sum, (uint32_t)term->shape);
    sum = add_word(sum, term->order);
    sum = add_word(sum, (uint32_t)term->knot_q15);
    sum = add_word(sum, term->turns_q18);
    sum = add_word(sum, term->times_rate);
    sum = add_word(sum, (uint32_t)term->mantissa);
    return add_word(sum, term->shift);
}

uint32_t sagnac_image_sum(const sagnac_image *image)
{
    uint32_t sum = 0U;
    uint32_t i;
    for (i = 0U; i < 8U; i++) {
        sum = add_word(sum, image->serial[i]);
    }
    sum = add_word(sum, image->axis);
    sum = add_word(sum, image->tick_ns);
    sum = add_word(sum, image->period_ticks);
    sum = add_word(sum, image->slew_ticks);
    sum = add_long(sum, image->scale_factor_femto_arcsec);
    sum = add_long(sum, image->quantum_nano_counts);
    sum = add_word(sum, image->sequence);
    sum = add_word(sum, image->output_limit);
    sum = add_word(sum, image->input_count);
    sum = add_word(sum, image->term_count);
    /* The counts themselves may have turned over. */
    for (i = 0U; (i < image->input_count) && (i < SAGNAC_MAX_INPUTS); i++) {
        sum = add_input(sum, &image->inputs[i]);
    }
    for (i = 0U; (i < image->term_count) && (i < SAGNAC_MAX_TERMS); i++) {
        sum = add_term(sum, &image->terms[i]);
    }
    return sum;
}

/* SAGNAC_YES for |value| <= most. */
static uint32_t is_within(int64_t value, int64_t most)
{
    return (sagnac_held(value, -most, most) == value) ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t accumulator_is_plausible(const sagnac_image *image, const sagnac_compensator_state *state)
{
    uint32_t answer = SAGNAC_YES;
    if (image->output_limit >= NO_LIMIT) {
        /* After a tick only the part of a count remains. */
        if ((state->accumulator < 0) || (state->accumulator >= ONE_COUNT)) {
            answer = SAGNAC_NO;
        }
    } else if (state->overflow == 0U) {
        answer = is_within(state->accumulator, MOST_HELD_BACK);
    } else {
        /* Held until it is cleared. */
    }
    return answer;
}

static uint32_t slew_is_plausible(const sagnac_image *image, const sagnac_compensator_state *state)
{
    uint32_t answer = is_within(state->slope, MOST_SLOPE);
    if (state->slewing_ticks == 0U) {
        if ((state->increment != state->target) || (state->steeper_ticks != 0U)) {
            answer = SAGNAC_NO;
        }
    } else if (is_within(state->increment, sagnac_image_increment_bound(image)) == 0U) {
        answer = SAGNAC_NO;
    } else if ((state->slewing_ticks > image->slew_ticks) || (state->steeper_ticks > state->slewing_ticks)) {
        answer = SAGNAC_NO;
    } else {
        /* It goes on. */
    }
    return answer;
}

uint32_t sagnac_state_is_plausible(const sagnac_image *image, const sagnac_compensator_state *state)
{
    uint32_t answer = accumulator_is_plausible(image, state);
    if (slew_is_plausible(image, state) == 0U) {
        answer = SAGNAC_NO;
    }
    if (sagnac_held(state->k_q32, ONE_COUNT - MOST_SCALE, ONE_COUNT + MOST_SCALE) != state->k_q32) {
        answer = SAGNAC_NO;
    }
    if (state->ticks_to_update > image->period_ticks) {
        answer = SAGNAC_NO;
    }
    return answer;
}

void sagnac_state_restart(sagnac_compensator_state *state)
{
    const uint64_t fraction = (uint64_t)state->accumulator & ALL_BITS;
    const uint32_t updates = state->updates;
    sagnac_compensator_start_warm(state);
    state->accumulator = (int64_t)fraction;
    state->updates = (updates == UINT32_MAX) ? 0U : (updates + 1U);
}
