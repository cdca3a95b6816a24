/* Path-length control: see sagnac_path_length.h. */
#include "sagnac_path_length.h"

#define MAX_CODE ((int32_t)8388608)
#define MAX_ERROR ((int32_t)1073741824)
#define MAX_STEP ((int64_t)72057594037927936)
#define MAX_TIME 1000000000U
#define MAX_EVIDENCE 131072U
#define MOST_CURVATURE_Q8 1073741824U
#define MAX_DARK_SUM ((int64_t)536870912)
#define PATH_AT 24U

static int64_t middle_q32(const sagnac_path_length *loop)
{
    const int64_t both = sagnac_q32(loop->low) + sagnac_q32(loop->high);
    return both / 2;
}

static int64_t in_range(const sagnac_path_length *loop, int64_t value)
{
    return sagnac_held(value, sagnac_q32(loop->low), sagnac_q32(loop->high));
}

/* Two searches long, so that ignition has time between them. */
static void path_wait_dark(const sagnac_path_length *loop, sagnac_path_length_state *state)
{
    state->phase = SAGNAC_PATH_DARK;
    state->left = loop->sweep_periods * 2U;
}

static void path_settle(const sagnac_path_length *loop, sagnac_path_length_state *state)
{
    state->phase = SAGNAC_PATH_SETTLING;
    state->left = loop->settle_periods;
}

/* Through a wavelength about the middle, or straight on where no search is configured. */
static void path_begin(const sagnac_path_length *loop, sagnac_path_length_state *state)
{
    state->integral_q32 = middle_q32(loop);
    state->best = 0;
    if (loop->sweep_periods == 0U) {
        const uint32_t missed = ((state->status & SAGNAC_PATH_NO_PEAK) != 0U) ? SAGNAC_YES : SAGNAC_NO;
        state->aside = ((missed != 0U) && (state->aside == 0U)) ? SAGNAC_YES : SAGNAC_NO;
        if (state->aside != 0U) {
            state->integral_q32 += sagnac_q32(loop->wavelength) / 2;
        }
        path_settle(loop, state);
    } else {
        /* Held to 2^62 before it is halved: a product beyond is beyond the range anyway. */
        const int64_t most = (int64_t)4611686018427387904;
        int64_t half = most;
        if (loop->sweep_step_q32 <= (most / (int64_t)loop->sweep_periods)) {
            half = (loop->sweep_step_q32 * (int64_t)loop->sweep_periods) / 2;
        }
        state->phase = SAGNAC_PATH_SWEEPING;
        state->left = loop->sweep_periods;
        state->at_q32 = state->integral_q32;
        state->integral_q32 = in_range(loop, state->integral_q32 - half);
    }
}

static void path_sweep(const sagnac_path_length *loop, sagnac_path_length_state *state, int64_t sum)
{
    if (sum > state->best) {
        state->best = sum;
        state->at_q32 = state->integral_q32;
    }
    if (state->left > 0U) {
        state->integral_q32 += loop->sweep_step_q32;
        state->left--;
    } else if (state->best < loop->dark_sum) {
        path_wait_dark(loop, state);
    } else {
        state->integral_q32 = state->at_q32;
        path_settle(loop, state);
    }
}

/* A check of the second harmonic begins. */
static void path_check_again(sagnac_path_length_state *state)
{
    state->seen_second = 0;
    state->seen_plain = 0;
    state->checked = 0U;
}

/* A period of the check: its harmonic counts with most_curvature_q8 of the light at most, so that a spike is no evidence. */
static void path_see(const sagnac_path_length *loop, sagnac_path_length_state *state, int64_t sum)
{
    const int64_t light = (sum > 0) ? sum : 0;
    const int64_t most = sagnac_floor_shift(light * (int64_t)loop->most_curvature_q8, 8U);
    state->seen_second += sagnac_held(state->second_harmonic, -most, most);
    state->seen_plain += sum;
}

/* The light curves as on a peak. Never for a light that does not answer: its second harmonic is zero. */
static uint32_t path_shows_peak(const sagnac_path_length_state *state, uint32_t least_q8)
{
    /* Sums of MAX_EVIDENCE periods: 2^46 of light, 2^16 of curvature. */
    const int64_t part = sagnac_floor_shift(state->seen_plain * (int64_t)least_q8, 8U);
    const int64_t least = (part < 1) ? 1 : part;
    return (state->seen_second >= least) ? SAGNAC_YES : SAGNAC_NO;
}

/* No peak was found here: reported, and begun again. */
static void path_without_peak(const sagnac_path_length *loop, sagnac_path_length_state *state)
{
    state->status |= SAGNAC_PATH_NO_PEAK;
    path_wait_dark(loop, state);
}

/* After the settling time: closed if the light repeats what the search found. */
static void path_close(const sagnac_path_length *loop, sagnac_path_length_state *state, int64_t sum)
{
    const uint32_t repeated = ((sum * 2) >= state->best) ? SAGNAC_YES : SAGNAC_NO;
    state->best = 0;
    path_check_again(state);
    if (repeated != 0U) {
        state->phase = SAGNAC_PATH_CLOSING;
        state->count = 0U;
        state->since = 0U;
    } else {
        path_without_peak(loop, state);
    }
}

static void path_closing(const sagnac_path_length *loop, sagnac_path_length_state *state, int32_t error, int64_t sum,
                         uint32_t dark)
{
    if (state->since >= loop->give_up_periods) {
        path_wait_dark(loop, state);
    } else {
        const uint32_t small = (sagnac_size32(error) < sagnac_size32(loop->lock_error)) ? SAGNAC_YES : SAGNAC_NO;
        state->count = ((small != 0U) && (dark == 0U)) ? (state->count + 1U) : 0U;
        if (state->count <= 1U) {
            path_check_again(state);
        }
        path_see(loop, state, sum);
        if (state->count < loop->lock_periods) {
            state->since++;
        } else if (path_shows_peak(state, loop->least_curvature_q8) != 0U) {
            state->phase = SAGNAC_PATH_LOCKED;
            state->count = 0U;
            path_check_again(state);
        } else {
            path_without_peak(loop, state);
        }
    }
}

/* Near the end of the range: goes by the whole wavelengths that bring it nearest to the middle. */
static void stay_or_reset(const sagnac_path_length *loop, sagnac_path_length_state *state)
{
    const int32_t at = sagnac_codes(state->integral_q32);
    if ((at <= loop->reset_low) || (at >= loop->reset_high)) {
        const int32_t away = at - sagnac_codes(middle_q32(loop));
        const int32_t size = (away < 0) ? -away : away;
        int32_t waves = (size + (loop->wavelength / 2)) / loop->wavelength;
        if (waves < 1) {
            waves = 1;
        }
        if (away > 0) {
            waves = -waves;
        }
        state->at_q32 = in_range(loop, sagnac_q32(at) + (sagnac_q32(loop->wavelength) * (int64_t)waves));
        if ((waves < 0) && (state->modes < (INT32_MIN - waves))) {
            state->modes = INT32_MIN;
        } else if ((waves > 0) && (state->modes > (INT32_MAX - waves))) {
            state->modes = INT32_MAX;
        } else {
            state->modes += waves;
        }
        state->phase = SAGNAC_PATH_MODE_RESET;
    }
}

/* The second harmonic of a locked loop, a loss time after the other. */
static void path_stay(const sagnac_path_length *loop, sagnac_path_length_state *state, int64_t sum)
{
    uint32_t peak = SAGNAC_YES;
    path_see(loop, state, sum);
    state->checked++;
    if (state->checked >= loop->lost_periods) {
        peak = path_shows_peak(state, loop->least_curvature_q8 / 2U);
        path_check_again(state);
    }
    if (peak != 0U) {
        stay_or_reset(loop, state);
    } else {
        path_without_peak(loop, state);
        state->status |= SAGNAC_PATH_WAS_LOST;
    }
}

static void path_locked(const sagnac_path_length *loop, sagnac_path_length_state *state, int32_t error, int64_t sum,
                        uint32_t dark)
{
    const uint32_t large = (sagnac_size32(error) > sagnac_size32(loop->lost_error)) ? SAGNAC_YES : SAGNAC_NO;
    state->count = ((large != 0U) || (dark != 0U)) ? (state->count + 1U) : 0U;
    if (state->count >= loop->lost_periods) {
        path_wait_dark(loop, state);
        state->status |= SAGNAC_PATH_WAS_LOST;
    } else {
        path_stay(loop, state, sum);
    }
}

static void path_mode_reset(const sagnac_path_length *loop, sagnac_path_length_state *state)
{
    const int64_t way = state->at_q32 - state->integral_q32;
    state->integral_q32 += sagnac_held(way, -loop->reset_step_q32, loop->reset_step_q32);
    if (way == 0) {
        path_settle(loop, state);
    }
}

static void path_next_phase(const sagnac_path_length *loop, sagnac_path_length_state *state, int32_t error, int64_t sum,
                       uint32_t dark)
{
    switch (state->phase) {
    case SAGNAC_PATH_DARK:
        if (state->left > 0U) {
            state->left--;
        } else if ((loop->sweep_periods != 0U) || (dark == 0U)) {
            path_begin(loop, state);
        } else {
            /* Without a search there is only the light itself to wait for. */
        }
        break;
    case SAGNAC_PATH_SWEEPING:
        path_sweep(loop, state, sum);
        break;
    case SAGNAC_PATH_SETTLING:
        if (state->left > 0U) {
            state->left--;
        } else {
            path_close(loop, state, sum);
        }
        break;
    case SAGNAC_PATH_CLOSING:
        path_closing(loop, state, error, sum, dark);
        break;
    case SAGNAC_PATH_LOCKED:
        path_locked(loop, state, error, sum, dark);
        break;
    case SAGNAC_PATH_MODE_RESET:
    default:
        path_mode_reset(loop, state);
        break;
    }
}

/* kp and the integrator, which stops at the limits. */
static void path_control(const sagnac_path_length *loop, sagnac_path_length_state *state, int32_t error)
{
    const int64_t integral = in_range(loop, state->integral_q32 + sagnac_gain_times(loop->ki, error));
    const int64_t output = in_range(loop, integral + sagnac_gain_times(loop->kp, error));
    state->integral_q32 = integral;
    state->held = sagnac_codes(output);
}

static uint32_t path_status_of(const sagnac_path_length *loop, const sagnac_path_length_state *state, uint32_t dark)
{
    uint32_t status;
    if (state->phase == SAGNAC_PATH_LOCKED) {
        status = 0U;
    } else if ((state->phase == SAGNAC_PATH_SWEEPING) ||
               ((state->phase == SAGNAC_PATH_SETTLING) && (state->best > 0))) {
        status = SAGNAC_PATH_INVALID | SAGNAC_PATH_ACQUIRING | SAGNAC_PATH_HOLD_LIGHT;
    } else if (state->phase == SAGNAC_PATH_MODE_RESET) {
        status = SAGNAC_PATH_INVALID | SAGNAC_PATH_RESETTING | SAGNAC_PATH_HOLD_LIGHT;
    } else {
        status = SAGNAC_PATH_INVALID | SAGNAC_PATH_ACQUIRING;
    }
    if (dark != 0U) {
        status |= SAGNAC_PATH_LOW_SIGNAL | SAGNAC_PATH_INVALID;
    }
    if ((state->held <= loop->low) || (state->held >= loop->high)) {
        status |= SAGNAC_PATH_AT_LIMIT;
    }
    if (state->phase != SAGNAC_PATH_LOCKED) {
        status |= state->status & SAGNAC_PATH_NO_PEAK;
    }
    return status | (state->status & SAGNAC_PATH_WAS_LOST);
}

/* A period's sums are complete. */
static void path_period(const sagnac_path_length *loop, sagnac_path_length_state *state, int64_t in_phase, int64_t plain)
{
    /* state->second_harmonic is that of the same period. */
    const int64_t shifted = sagnac_floor_shift(in_phase, loop->error_shift);
    const int32_t error = (int32_t)sagnac_held(shifted, -(int64_t)MAX_ERROR, (int64_t)MAX_ERROR);
    const uint32_t dark = (plain < loop->dark_sum) ? SAGNAC_YES : SAGNAC_NO;
    state->error = error;
    path_next_phase(loop, state, error, plain, dark);
    if ((state->phase == SAGNAC_PATH_CLOSING) || (state->phase == SAGNAC_PATH_LOCKED)) {
        path_control(loop, state, error);
    } else {
        state->integral_q32 = in_range(loop, state->integral_q32);
        state->held = sagnac_codes(state->integral_q32);
    }
    state->status = path_status_of(loop, state, dark);
}

uint32_t sagnac_path_length_is_heard(const sagnac_path_length *loop, int64_t second_sum, uint32_t periods)
{
    /* Half of a peak's harmonic at the least light; dark_sum is below 2^46, the product with 2^16 and with 2^17 periods is held. */
    const int64_t one = sagnac_floor_shift(loop->dark_sum * (int64_t)loop->least_curvature_q8, 9U);
    const int64_t most = (periods > 0U) ? (INT64_MAX / (int64_t)periods) : INT64_MAX;
    const int64_t least = ((one > most) ? INT64_MAX : (one * (int64_t)periods));
    const int64_t heard = (second_sum < 0) ? -sagnac_held(second_sum, -INT64_MAX, 0) : second_sum;
    return (heard >= ((least < 1) ? 1 : least)) ? SAGNAC_YES : SAGNAC_NO;
}

void sagnac_path_length_start(const sagnac_path_length *loop, sagnac_path_length_state *state)
{
    state->in_phase = 0;
    state->second = 0;
    state->plain = 0;
    state->index = 0U;
    state->second_harmonic = 0;
    state->aside = 0U;
    path_check_again(state);
    state->phase = SAGNAC_PATH_DARK;
    state->left = 0U;
    state->count = 0U;
    state->since = 0U;
    state->best = 0;
    state->at_q32 = 0;
    state->integral_q32 = middle_q32(loop);
    state->held = sagnac_codes(state->integral_q32);
    state->error = 0;
    state->modes = 0;
    state->status = SAGNAC_PATH_INVALID | SAGNAC_PATH_ACQUIRING | SAGNAC_PATH_HOLD_LIGHT;
    path_begin(loop, state);
}

void sagnac_path_length_tick(const sagnac_path_length *loop, sagnac_path_length_state *state, int32_t detector,
                             sagnac_path_length_output *output)
{
    const int64_t code = (int64_t)sagnac_held32(detector, -MAX_CODE, MAX_CODE);
    const uint32_t delayed = state->index + loop->ticks - loop->delay;
    const uint32_t at = (delayed >= loop->ticks) ? (delayed - loop->ticks) : delayed;
    int64_t swing;
    state->in_phase += code * (int64_t)loop->sine_q15[at];
    state->second += code * (int64_t)loop->second_q15[at];
    state->plain += code;
    state->index++;
    if (state->index >= loop->ticks) {
        const int64_t in_phase = state->in_phase;
        const int64_t plain = state->plain;
        state->second_harmonic = state->second;
        state->in_phase = 0;
        state->second = 0;
        state->plain = 0;
        state->index = 0U;
        path_period(loop, state, in_phase, plain);
    }
    swing = (int64_t)loop->modulation * (int64_t)loop->sine_q15[state->index];
    output->actuator = state->held;
    output->modulation = (int32_t)sagnac_round_shift(swing, 15U);
    output->status = state->status;
}

static uint32_t path_is_code(int32_t value)
{
    return ((value >= -MAX_CODE) && (value <= MAX_CODE)) ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t reference_is_sound(const sagnac_path_length *loop)
{
    uint32_t sound = 0U;
    if ((loop->ticks >= 4U) && (loop->ticks <= SAGNAC_MAX_TICKS_PER_PERIOD) && ((loop->ticks % 2U) == 0U) &&
        (loop->delay < loop->ticks)) {
        const uint32_t half = loop->ticks / 2U;
        int32_t sum = 0;
        uint32_t i;
        sound = 1U;
        for (i = 0U; i < half; i++) {
            sum += loop->second_q15[i];
            if ((loop->sine_q15[i] != -loop->sine_q15[i + half]) || (loop->second_q15[i] != loop->second_q15[i + half])) {
                sound = 0U;
            }
        }
        for (i = loop->ticks; i < SAGNAC_MAX_TICKS_PER_PERIOD; i++) {
            if ((loop->sine_q15[i] != 0) || (loop->second_q15[i] != 0)) {
                sound = 0U;
            }
        }
        if (sum != 0) {
            sound = 0U;
        }
    }
    return sound;
}

static uint32_t path_is_sound(const sagnac_path_length *loop)
{
    uint32_t sound = reference_is_sound(loop) & sagnac_gain_is_sound(loop->kp) & sagnac_gain_is_sound(loop->ki);
    sound &= path_is_code(loop->low) & path_is_code(loop->high);
    if ((loop->modulation < 0) || (loop->modulation > MAX_CODE) || (loop->error_shift > 40U) ||
        (loop->low >= loop->high) || (loop->wavelength < 1) || (loop->wavelength > (2 * MAX_CODE))) {
        sound = 0U;
    }
    /* Only a range that is sound has room for a code on either side. */
    if (sound != 0U) {
        if ((loop->reset_low < (loop->low - 1)) || (loop->reset_low > loop->high) ||
            (loop->reset_high > (loop->high + 1)) || (loop->reset_high < loop->reset_low)) {
            sound = 0U;
        }
    }
    if ((loop->sweep_step_q32 < 0) || (loop->sweep_step_q32 > MAX_STEP) || (loop->reset_step_q32 < 1) ||
        (loop->reset_step_q32 > MAX_STEP) || (loop->dark_sum < 0) || (loop->dark_sum > MAX_DARK_SUM)) {
        sound = 0U;
    }
    if ((loop->sweep_periods > MAX_TIME) || (loop->settle_periods > MAX_TIME) || (loop->lock_periods < 1U) ||
        (loop->lock_periods > MAX_EVIDENCE) || (loop->lost_periods < 1U) || (loop->lost_periods > MAX_EVIDENCE) ||
        (loop->give_up_periods > MAX_TIME) || (loop->least_curvature_q8 < 2U) ||
        (loop->most_curvature_q8 < loop->least_curvature_q8) || (loop->most_curvature_q8 > MOST_CURVATURE_Q8)) {
        sound = 0U;
    }
    if ((loop->lock_error < 1) || (loop->lock_error > MAX_ERROR) || (loop->lost_error < 1) ||
        (loop->lost_error > MAX_ERROR)) {
        sound = 0U;
    }
    return sound;
}

static void path_load_fields(sagnac_path_length *loop, sagnac_read_octet read, const void *context)
{
    const uint32_t second_at = PATH_AT + (2U * SAGNAC_MAX_TICKS_PER_PERIOD);
    const uint32_t at = second_at + (2U * SAGNAC_MAX_TICKS_PER_PERIOD);
    uint32_t i;
    for (i = 0U; i < SAGNAC_MAX_TICKS_PER_PERIOD; i++) {
        loop->sine_q15[i] = sagnac_read_i16(read, context, PATH_AT + (2U * i));
        loop->second_q15[i] = sagnac_read_i16(read, context, second_at + (2U * i));
    }
    loop->ticks = read(context, at) & 0xFFU;
    loop->delay = read(context, at + 1U) & 0xFFU;
    loop->error_shift = read(context, at + 2U) & 0xFFU;
    loop->kp.mantissa = sagnac_read_i32(read, context, at + 4U);
    loop->kp.shift = read(context, at + 8U) & 0xFFU;
    loop->ki.mantissa = sagnac_read_i32(read, context, at + 12U);
    loop->ki.shift = read(context, at + 16U) & 0xFFU;
    loop->modulation = sagnac_read_i32(read, context, at + 20U);
    loop->low = sagnac_read_i32(read, context, at + 24U);
    loop->high = sagnac_read_i32(read, context, at + 28U);
    loop->reset_low = sagnac_read_i32(read, context, at + 32U);
    loop->reset_high = sagnac_read_i32(read, context, at + 36U);
    loop->wavelength = sagnac_read_i32(read, context, at + 40U);
    loop->lock_error = sagnac_read_i32(read, context, at + 44U);
    loop->lost_error = sagnac_read_i32(read, context, at + 48U);
    loop->sweep_step_q32 = sagnac_read_i64(read, context, at + 52U);
    loop->reset_step_q32 = sagnac_read_i64(read, context, at + 60U);
    loop->dark_sum = sagnac_read_i64(read, context, at + 68U);
    loop->sweep_periods = sagnac_read_u32(read, context, at + 76U);
    loop->settle_periods = sagnac_read_u32(read, context, at + 80U);
    loop->lock_periods = sagnac_read_u32(read, context, at + 84U);
    loop->lost_periods = sagnac_read_u32(read, context, at + 88U);
    loop->give_up_periods = sagnac_read_u32(read, context, at + 92U);
    loop->least_curvature_q8 = sagnac_read_u16(read, context, at + 96U);
    loop->most_curvature_q8 = sagnac_read_u32(read, context, at + 100U);
}

uint32_t sagnac_path_length_load(sagnac_path_length *loop, sagnac_read_octet read, const void *context,
                                 uint32_t length)
{
    uint32_t loaded = 0U;
    if (sagnac_is_loop_table(read, context, length) != 0U) {
        path_load_fields(loop, read, context);
        loaded = path_is_sound(loop) & sagnac_are_zero(read, context, PATH_AT + 259U, 1U) &
                 sagnac_are_zero(read, context, PATH_AT + 265U, 3U) &
                 sagnac_are_zero(read, context, PATH_AT + 273U, 3U) &
                 sagnac_are_zero(read, context, PATH_AT + 354U, 2U) &
                 sagnac_are_zero(read, context, PATH_AT + 360U, 32U);
    }
    return loaded;
}
