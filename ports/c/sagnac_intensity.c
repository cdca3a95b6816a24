/* Intensity control: see sagnac_intensity.h. */
#include "sagnac_intensity.h"

#define MAX_CODE ((int32_t)8388608)
#define MAX_ERROR ((int32_t)1073741824)
#define MAX_TIME 1000000000U
#define MAX_TRIES 255U
#define LIGHT_AT 416U

static void light_ignite(const sagnac_intensity *loop, sagnac_intensity_state *state, uint32_t tries)
{
    state->phase = SAGNAC_PHASE_IGNITING;
    state->left = loop->ignition_updates;
    state->tries = tries;
}

static void light_rest(const sagnac_intensity *loop, sagnac_intensity_state *state, uint32_t tries)
{
    state->phase = SAGNAC_PHASE_RESTING;
    state->left = loop->rest_updates;
    state->tries = tries;
}

static void light_igniting(const sagnac_intensity *loop, sagnac_intensity_state *state, uint32_t dark, uint32_t hold)
{
    if (dark == 0U) {
        state->phase = SAGNAC_PHASE_RUNNING;
        state->dark = 0U;
        state->at_end = 0U;
    } else if (hold != 0U) {
        /* The path is on its way; it may be dark there. */
    } else if (state->left > 0U) {
        state->left--;
    } else if (state->tries == 0U) {
        state->phase = SAGNAC_PHASE_FAILED;
    } else {
        light_rest(loop, state, state->tries);
    }
}

static void light_running(const sagnac_intensity *loop, sagnac_intensity_state *state, uint32_t dark, uint32_t hold)
{
    if (hold != 0U) {
        /* Neither dark time nor time at the end is counted. */
    } else if ((dark != 0U) && (state->dark >= loop->dark_updates)) {
        light_rest(loop, state, (loop->tries < MAX_TRIES) ? (loop->tries + 1U) : loop->tries);
    } else {
        const uint32_t at_limit = ((state->current <= loop->least) || (state->current >= loop->most)) ? SAGNAC_YES : SAGNAC_NO;
        if (at_limit == 0U) {
            state->at_end = 0U;
        } else if (state->at_end < UINT32_MAX) {
            state->at_end++;
        } else {
            /* It has been there for as long as can be counted. */
        }
        state->dark = (dark != 0U) ? (state->dark + 1U) : 0U;
    }
}

static void light_next_phase(const sagnac_intensity *loop, sagnac_intensity_state *state, uint32_t dark, uint32_t hold)
{
    switch (state->phase) {
    case SAGNAC_PHASE_IGNITING:
        light_igniting(loop, state, dark, hold);
        break;
    case SAGNAC_PHASE_RESTING:
        if (state->left > 0U) {
            state->left--;
        } else {
            light_ignite(loop, state, (state->tries > 0U) ? (state->tries - 1U) : 0U);
        }
        break;
    case SAGNAC_PHASE_RUNNING:
        light_running(loop, state, dark, hold);
        break;
    case SAGNAC_PHASE_FAILED:
    default:
        /* For good. */
        break;
    }
}

static void light_control(const sagnac_intensity *loop, sagnac_intensity_state *state, int32_t error)
{
    const int64_t low = sagnac_q32(loop->least);
    const int64_t high = sagnac_q32(loop->most);
    const int64_t proportional = sagnac_gain_times(loop->kp, error);
    const int64_t integral = sagnac_held(state->integral_q32 + sagnac_gain_times(loop->ki, error), low, high);
    const int64_t wanted = sagnac_held(integral + proportional, low, high);
    const int64_t slew = sagnac_q32(loop->slew);
    const int64_t now = sagnac_q32(state->current);
    const int64_t given = sagnac_held(wanted, now - slew, now + slew);
    /* What the slew limit did not allow, the integrator does not keep. */
    state->integral_q32 = (given == wanted) ? integral : sagnac_held(given - proportional, low, high);
    state->current = sagnac_codes(given);
}

static uint32_t light_status_of(const sagnac_intensity *loop, const sagnac_intensity_state *state, int64_t sum,
                          int32_t error)
{
    uint32_t status = 0U;
    if ((state->phase == SAGNAC_PHASE_IGNITING) || (state->phase == SAGNAC_PHASE_RESTING)) {
        status = SAGNAC_LIGHT_IGNITING;
    } else if (state->phase == SAGNAC_PHASE_FAILED) {
        status = SAGNAC_LIGHT_FAILED;
    } else if (state->at_end >= loop->end_updates) {
        status = SAGNAC_LIGHT_END_OF_RANGE;
    } else {
        status = 0U;
    }
    if (sum < loop->low_sum) {
        status |= SAGNAC_LIGHT_LOW;
    }
    if (sagnac_size32(error) > sagnac_size32(loop->settled_error)) {
        status |= SAGNAC_LIGHT_SETTLING;
    }
    return status;
}

static void light_update(const sagnac_intensity *loop, sagnac_intensity_state *state, int64_t sum, uint32_t hold)
{
    const int64_t shifted = sagnac_floor_shift(loop->set_point - sum, loop->error_shift);
    const int32_t error = (int32_t)sagnac_held(shifted, -(int64_t)MAX_ERROR, (int64_t)MAX_ERROR);
    const uint32_t dark = (sum < loop->dark_sum) ? SAGNAC_YES : SAGNAC_NO;
    light_next_phase(loop, state, dark, hold);
    if (state->phase == SAGNAC_PHASE_RUNNING) {
        if (hold == 0U) {
            light_control(loop, state, error);
        }
    } else if (state->phase == SAGNAC_PHASE_IGNITING) {
        state->current = loop->ignition;
        state->integral_q32 = sagnac_q32(loop->ignition);
    } else {
        state->current = 0;
    }
    state->status = light_status_of(loop, state, sum, error);
}

void sagnac_intensity_start(const sagnac_intensity *loop, sagnac_intensity_state *state)
{
    state->sum = 0;
    state->ticks = 0U;
    state->dark = 0U;
    state->at_end = 0U;
    state->integral_q32 = sagnac_q32(loop->ignition);
    state->current = loop->ignition;
    state->status = SAGNAC_LIGHT_IGNITING | SAGNAC_LIGHT_LOW;
    light_ignite(loop, state, loop->tries);
}

void sagnac_intensity_tick(const sagnac_intensity *loop, sagnac_intensity_state *state, int32_t photodiode,
                           uint32_t hold, sagnac_intensity_output *output)
{
    state->sum += (int64_t)sagnac_held32(photodiode, -MAX_CODE, MAX_CODE);
    state->ticks++;
    if (state->ticks >= loop->ticks) {
        const int64_t sum = state->sum;
        state->sum = 0;
        state->ticks = 0U;
        light_update(loop, state, sum, hold);
    }
    output->current = state->current;
    output->status = state->status;
}

static uint32_t light_is_sum(const sagnac_intensity *loop, int64_t value)
{
    return ((value >= 0) && (value <= ((int64_t)MAX_CODE * (int64_t)loop->ticks))) ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t light_is_sound(const sagnac_intensity *loop)
{
    uint32_t sound = sagnac_gain_is_sound(loop->kp) & sagnac_gain_is_sound(loop->ki);
    sound &= light_is_sum(loop, loop->set_point) & light_is_sum(loop, loop->dark_sum) & light_is_sum(loop, loop->low_sum);
    if ((loop->ticks == 0U) || (loop->error_shift > 40U) || (loop->least < 0) || (loop->least > loop->most) ||
        (loop->most > MAX_CODE)) {
        sound = 0U;
    }
    if ((loop->slew < 1) || (loop->slew > MAX_CODE) || (loop->ignition < 0) || (loop->ignition > loop->most) ||
        (loop->settled_error < 1) || (loop->settled_error > MAX_ERROR)) {
        sound = 0U;
    }
    if ((loop->ignition_updates > MAX_TIME) || (loop->rest_updates > MAX_TIME) || (loop->dark_updates > MAX_TIME) ||
        (loop->end_updates > MAX_TIME)) {
        sound = 0U;
    }
    return sound;
}

static void light_load_fields(sagnac_intensity *loop, sagnac_read_octet read, const void *context)
{
    loop->ticks = sagnac_read_u16(read, context, LIGHT_AT);
    loop->error_shift = read(context, LIGHT_AT + 2U) & 0xFFU;
    loop->tries = read(context, LIGHT_AT + 3U) & 0xFFU;
    loop->kp.mantissa = sagnac_read_i32(read, context, LIGHT_AT + 4U);
    loop->kp.shift = read(context, LIGHT_AT + 8U) & 0xFFU;
    loop->ki.mantissa = sagnac_read_i32(read, context, LIGHT_AT + 12U);
    loop->ki.shift = read(context, LIGHT_AT + 16U) & 0xFFU;
    loop->set_point = sagnac_read_i64(read, context, LIGHT_AT + 20U);
    loop->dark_sum = sagnac_read_i64(read, context, LIGHT_AT + 28U);
    loop->low_sum = sagnac_read_i64(read, context, LIGHT_AT + 36U);
    loop->least = sagnac_read_i32(read, context, LIGHT_AT + 44U);
    loop->most = sagnac_read_i32(read, context, LIGHT_AT + 48U);
    loop->slew = sagnac_read_i32(read, context, LIGHT_AT + 52U);
    loop->ignition = sagnac_read_i32(read, context, LIGHT_AT + 56U);
    loop->settled_error = sagnac_read_i32(read, context, LIGHT_AT + 60U);
    loop->ignition_updates = sagnac_read_u32(read, context, LIGHT_AT + 64U);
    loop->rest_updates = sagnac_read_u32(read, context, LIGHT_AT + 68U);
    loop->dark_updates = sagnac_read_u32(read, context, LIGHT_AT + 72U);
    loop->end_updates = sagnac_read_u32(read, context, LIGHT_AT + 76U);
}

uint32_t sagnac_intensity_load(sagnac_intensity *loop, sagnac_read_octet read, const void *context, uint32_t length)
{
    uint32_t loaded = 0U;
    if (sagnac_is_loop_table(read, context, length) != 0U) {
        light_load_fields(loop, read, context);
        loaded = light_is_sound(loop) & sagnac_are_zero(read, context, LIGHT_AT + 9U, 3U) &
                 sagnac_are_zero(read, context, LIGHT_AT + 17U, 3U) &
                 sagnac_are_zero(read, context, LIGHT_AT + 80U, 12U);
    }
    return loaded;
}
