/* One tick of a gyro's board: see sagnac_board.h. */
#include "sagnac_board.h"

#include "sagnac_integer.h"
#include "sagnac_upload.h"

#define OUTPUT_PAYLOAD 51U
/* 1e-15 arcsec of the unit of a frame's angle. */
#define NANO_FEMTO ((int64_t)1000000)

/* What the source of an image adds to the status of every tick. */
static uint32_t board_origin_status(sagnac_origin origin)
{
    uint32_t status = 0U;
    if (origin == SAGNAC_FACTORY_DEFAULTS) {
        status = SAGNAC_UNCORRECTED;
    }
    if (origin == SAGNAC_ONLY_SURVIVOR) {
        status = SAGNAC_SURVIVOR;
    }
    return status;
}

static void board_take_image(sagnac_board *board, const sagnac_loaded *loaded)
{
    uint32_t i;
    board->image = loaded->image;
    board->image_sum = loaded->image_sum ^ sagnac_image_code(board->origin, board->trial);
    for (i = 0U; i < SAGNAC_DIGEST; i++) {
        board->digest[i] = loaded->digest[i];
    }
}

/* Sums and bits of the next frame; number, tick and the last codes go on. */
static void board_begin_frame(sagnac_board *board)
{
    sagnac_output_frame *frame = &board->frame;
    frame->error_milli_dph = board->error.milli_dph;
    frame->counts = 0U;
    frame->raw = 0U;
    frame->status = 0U;
    frame->path_status = 0U;
    frame->light_status = 0U;
    frame->ticks = 0U;
}

/* What the state must still be at the next slow update, and when that is. */
static void board_seal(sagnac_board *board)
{
    board->state_sum = sagnac_state_sum(&board->state);
    board->update_at = (board->frame.tick + board->state.ticks_to_update) & 0xFFFFFFFFU;
}

static void board_begin_again(sagnac_board *board)
{
    sagnac_state_restart(&board->state);
    board->is_pending = SAGNAC_NO;
    board_seal(board);
}

/* Every tick the bounds and the time of the slow update, and the sum when it is due. */
static void board_check_state(sagnac_board *board)
{
    const uint32_t due = (board->state.ticks_to_update == 0U) ? SAGNAC_YES : SAGNAC_NO;
    const uint32_t is_time = (board->frame.tick == board->update_at) ? SAGNAC_YES : SAGNAC_NO;
    uint32_t holds = sagnac_state_is_plausible(&board->image, &board->state);
    if (due != is_time) {
        holds = SAGNAC_NO;
    }
    if ((due != 0U) && (sagnac_state_sum(&board->state) != board->state_sum)) {
        holds = SAGNAC_NO;
    }
    if (holds == 0U) {
        board_begin_again(board);
        board->frame.status |= SAGNAC_UPSET;
    }
}

/* Slow updates in so many seconds; all that fit, if there are more. */
static uint32_t updates_in(const sagnac_image *image, uint32_t seconds)
{
    const uint64_t period_ns = (uint64_t)image->tick_ns * (uint64_t)image->period_ticks;
    const uint64_t updates = ((uint64_t)seconds * (uint64_t)1000000000U) / period_ns;
    return (updates < (uint64_t)UINT32_MAX) ? (uint32_t)updates : UINT32_MAX;
}

/* A setup from its beginning. */
static void board_set_up(sagnac_board *board, const sagnac_board_setup *setup)
{
    board->setup = *setup;
    sagnac_stripper_start(&board->stripper, setup->longest, setup->least_swing);
    board->still = 0U;
    sagnac_watch_start(&board->watch);
}

void sagnac_board_start(sagnac_board *board, const sagnac_loaded *loaded, const sagnac_board_setup *setup, sagnac_cause cause,
                        uint32_t since_power_on_s)
{
    board->is_pending = SAGNAC_NO;
    board_set_up(board, setup);
    sagnac_path_length_start(setup->path, &board->path_state);
    sagnac_intensity_start(setup->light, &board->light_state);
    board->origin = loaded->origin;
    board->trial = loaded->trial;
    board_take_image(board, loaded);
    if (cause == SAGNAC_POWER_ON) {
        sagnac_compensator_start(&board->state);
    } else if (since_power_on_s == SAGNAC_UNKNOWN_TIME) {
        sagnac_compensator_start_warm(&board->state);
    } else {
        sagnac_compensator_start_after(&board->image, &board->state, updates_in(&board->image, since_power_on_s));
    }
    board->lost_steps = 0U;
    sagnac_error_bound_start(&board->error);
    board->angle_rest = 0;
    board->frame.number = 0U;
    board->frame.tick = 0U;
    board->frame.actuator = 0;
    board->frame.current = 0;
    board->frame.has_temperature = SAGNAC_NO;
    board->frame.temperature = 0;
    board_begin_frame(board);
    board_seal(board);
}

/* Goes on with another image. */
static void board_change_image(sagnac_board *board, const sagnac_loaded *loaded)
{
    board_take_image(board, loaded);
    sagnac_compensator_migrate_state(&board->image, &board->state);
    board->is_pending = SAGNAC_NO;
    board_seal(board);
    /* Its inputs may be other thermometers. */
    board->still = 0U;
    sagnac_watch_start(&board->watch);
}

void sagnac_board_use(sagnac_board *board, const sagnac_loaded *loaded)
{
    if (sagnac_are_equal(board->digest, loaded->digest, SAGNAC_DIGEST) == 0U) {
        board_change_image(board, loaded);
    }
    /* A bit of the old code that turned over stays in the sum. */
    board->image_sum ^= sagnac_image_code(board->origin, board->trial) ^ sagnac_image_code(loaded->origin, loaded->trial);
    board->origin = loaded->origin;
    board->trial = loaded->trial;
}

/* The board's copy is the setup in flash. */
static uint32_t board_has(const sagnac_board *board, const sagnac_board_setup *setup)
{
    const sagnac_board_setup *own = &board->setup;
    uint32_t has = SAGNAC_YES;
    if ((own->path != setup->path) || (own->light != setup->light) || (own->strips != setup->strips) ||
        (own->longest != setup->longest) || (own->least_swing != setup->least_swing)) {
        has = SAGNAC_NO;
    }
    if ((own->watches != setup->watches) || (own->heats != setup->heats) || (own->frame_ticks != setup->frame_ticks) ||
        (own->watch_spec.shows != setup->watch_spec.shows) ||
        (own->watch_spec.still != setup->watch_spec.still) ||
        (own->watch_spec.command_shows != setup->watch_spec.command_shows)) {
        has = SAGNAC_NO;
    }
    return has;
}

/* The stripper's own copies of its two numbers. */
static uint32_t board_strips_as(const sagnac_board *board, const sagnac_board_setup *setup)
{
    sagnac_stripper fresh;
    sagnac_stripper_start(&fresh, setup->longest, setup->least_swing);
    return ((board->stripper.longest == fresh.longest) && (board->stripper.least_swing == fresh.least_swing)) ? SAGNAC_YES
                                                                                                           : SAGNAC_NO;
}

uint32_t sagnac_board_is_intact(const sagnac_board *board, const sagnac_board_setup *setup)
{
    const uint32_t sum = sagnac_image_sum(&board->image) ^ sagnac_image_code(board->origin, board->trial);
    uint32_t is_intact = SAGNAC_NO;
    if ((sum == board->image_sum) && (board_has(board, setup) != 0U) && (board_strips_as(board, setup) != 0U)) {
        is_intact = SAGNAC_YES;
    }
    return is_intact;
}

void sagnac_board_mend(sagnac_board *board, const sagnac_loaded *loaded, const sagnac_board_setup *setup)
{
    if (sagnac_image_sum(&board->image) != sagnac_image_sum(&loaded->image)) {
        board_change_image(board, loaded);
    }
    board->origin = loaded->origin;
    board->trial = loaded->trial;
    board->image_sum = sagnac_image_sum(&board->image) ^ sagnac_image_code(board->origin, board->trial);
    if ((board_has(board, setup) == 0U) || (board_strips_as(board, setup) == 0U)) {
        board_set_up(board, setup);
    }
    board->frame.status |= SAGNAC_UPSET;
}

/* The image's thermometers, 2^-24 degC: inputs with a code of their own in degC. */
static uint32_t board_temperatures(const sagnac_board *board, const int32_t codes[SAGNAC_MAX_INPUTS], uint32_t present,
                                   int32_t values[SAGNAC_MAX_WATCHED])
{
    uint32_t are_present = 0U;
    uint32_t i;
    for (i = 0U; i < SAGNAC_MAX_WATCHED; i++) {
        values[i] = 0;
        if ((i < board->image.input_count) && (((present >> i) & 1U) != 0U)) {
            const sagnac_input *input = &board->image.inputs[i];
            if ((input->source == SAGNAC_CODE) && (input->unit_exponent == 0) &&
                (sagnac_input_value(input, codes[i], &values[i]) != 0U)) {
                are_present |= (uint32_t)1U << i;
            }
        }
    }
    return are_present;
}

/* The slices of this tick, of the update that is due next. */
static void board_make_slices(sagnac_board *board, const sagnac_sample *sample)
{
    const uint32_t slices = board->image.input_count + board->image.term_count;
    const uint32_t period = board->image.period_ticks;
    const uint32_t left = board->state.ticks_to_update;
    uint32_t of_tick = 1U;
    if ((period < slices) && (period > 0U)) {
        of_tick += slices / period;
    }
    if ((board->is_pending == 0U) && (left > 0U) && (left <= slices)) {
        if (sagnac_state_sum(&board->state) == board->state_sum) {
            sagnac_compensator_begin_update(&board->image, &board->state, sample->codes, sample->present, &board->pending);
            board->is_pending = SAGNAC_YES;
        } else {
            board_begin_again(board);
            board->frame.status |= SAGNAC_UPSET;
        }
    }
    if (board->is_pending != 0U) {
        uint32_t i;
        for (i = 0U; i < of_tick; i++) {
            (void)sagnac_compensator_advance_update(&board->image, &board->pending);
        }
    }
}

static void board_show_error(sagnac_board *board)
{
    if (board->error.milli_dph > board->frame.error_milli_dph) {
        board->frame.error_milli_dph = board->error.milli_dph;
    }
}

/* So many slices of the bound of the last slow update. */
static void board_bound_error(sagnac_board *board, uint32_t slices)
{
    if (board->error.is_whole == 0U) {
        uint32_t i;
        for (i = 0U; i < slices; i++) {
            sagnac_error_bound_advance(&board->error, &board->image, &board->state);
        }
        board_show_error(board);
    }
}

/* Puts the update in force that is due now: the one in slices, or a whole one with these codes. */
static void board_slow_update(sagnac_board *board, const sagnac_sample *sample)
{
    const int32_t *codes = sample->codes;
    uint32_t present = sample->present;
    /* Where there were fewer ticks than slices. */
    board_bound_error(board, SAGNAC_MAX_INPUTS + 1U);
    if (board->is_pending != 0U) {
        codes = board->pending.codes;
        present = board->pending.present;
        board->is_pending = SAGNAC_NO;
        (void)sagnac_compensator_apply_update(&board->image, &board->state, &board->pending);
    } else {
        /* It is due. */
        (void)sagnac_compensator_update(&board->image, &board->state, codes, present);
    }
    board_seal(board);
    sagnac_error_bound_begin(&board->error, &board->state);
    board_show_error(board);
    board->frame.has_temperature = present & 1U;
    board->frame.temperature = (board->frame.has_temperature != 0U) ? codes[0] : 0;
    if (board->setup.watches != 0U) {
        int32_t values[SAGNAC_MAX_WATCHED];
        const uint32_t are_present = board_temperatures(board, codes, present, values);
        board->still = sagnac_watch_update(&board->setup.watch_spec, &board->watch, values, are_present, board->setup.heats,
                                           board->path_state.held);
    }
}

/* The angle of the frame's counts, 1e-9 arcsec; what is less than that goes to the next frame. */
static int64_t board_angle(sagnac_board *board)
{
    const uint64_t nano = board->image.scale_factor_femto_arcsec / (uint64_t)NANO_FEMTO;
    const uint64_t femto = board->image.scale_factor_femto_arcsec % (uint64_t)NANO_FEMTO;
    const int64_t whole = (int64_t)nano;
    const int64_t part = (int64_t)femto;
    /* Thousands of turns in a frame: beyond them the angle stays at its largest value. */
    const int64_t most = (INT64_MAX / 2) / (whole + 1);
    const int64_t counts = sagnac_held((int64_t)(int32_t)board->frame.counts, -most, most);
    const int64_t rest = (counts * part) + board->angle_rest;
    int64_t units = rest / NANO_FEMTO;
    board->angle_rest = rest - (units * NANO_FEMTO);
    if (board->angle_rest < 0) {
        board->angle_rest += NANO_FEMTO;
        units--;
    }
    return (counts * whole) + units;
}

/* The counts of this tick for the correction: without stripping all of them, with it those of a period that ends. */
static int64_t board_counted(sagnac_board *board, int32_t counts, uint32_t lost_steps, int32_t pickoff)
{
    int64_t counted = (int64_t)counts;
    if (lost_steps != board->lost_steps) {
        board->lost_steps = lost_steps;
        board->frame.status |= SAGNAC_COUNTS_LOST;
    }
    if (board->setup.strips != 0U) {
        sagnac_stripped stripped;
        counted = 0;
        if (sagnac_stripper_update(&board->stripper, counts, pickoff, &stripped) != 0U) {
            counted = stripped.counts;
        }
        if (sagnac_stripper_has_dither(&board->stripper) == 0U) {
            board->frame.status |= SAGNAC_NO_DITHER;
        }
    }
    return counted;
}

/* The sum of a frame, with OVERFLOW where 32 bits do not hold it. */
static uint32_t board_summed(sagnac_board *board, uint32_t sum, int32_t counts)
{
    const int64_t wide = (int64_t)(int32_t)sum + (int64_t)counts;
    if (wide != (int64_t)(int32_t)sagnac_held(wide, -(int64_t)2147483648, (int64_t)2147483647)) {
        board->frame.status |= SAGNAC_OVERFLOW;
    }
    return sum + (uint32_t)counts;
}

static void board_correct(sagnac_board *board, int64_t counted, uint32_t status)
{
    const int64_t most = (int64_t)SAGNAC_MAX_RAW;
    const int32_t raw = (int32_t)sagnac_held(counted, -most, most);
    sagnac_output output;
    if ((int64_t)raw != counted) {
        /* More counts than one call accepts: the excess is lost, and the status reports it. */
        board->frame.status |= SAGNAC_OVERFLOW;
    }
    if (sagnac_compensator_tick(&board->image, &board->state, raw, &output) == SAGNAC_OK) {
        board->frame.counts = board_summed(board, board->frame.counts, output.counts);
        board->frame.status |= output.status | board_origin_status(board->origin) | status;
    }
    if (board->still != 0U) {
        board->frame.status |= SAGNAC_STUCK;
    }
    board->frame.raw = board_summed(board, board->frame.raw, raw);
}

static void board_loops(sagnac_board *board, int32_t light, sagnac_actuators *actuators)
{
    sagnac_path_length_output path;
    sagnac_intensity_output lit;
    sagnac_path_length_tick(board->setup.path, &board->path_state, light, &path);
    sagnac_intensity_tick(board->setup.light, &board->light_state, light, path.status & SAGNAC_PATH_HOLD_LIGHT, &lit);
    board->frame.path_status |= path.status;
    board->frame.light_status |= lit.status;
    board->frame.actuator = path.actuator;
    board->frame.current = lit.current;
    actuators->actuator = path.actuator + path.modulation;
    actuators->modulation = path.modulation;
    actuators->current = lit.current;
}

static uint32_t board_frame_ticks(const sagnac_board *board)
{
    uint32_t ticks = board->setup.frame_ticks;
    if (ticks == 0U) {
        ticks = 1U;
    }
    return (ticks < 65535U) ? ticks : 65535U;
}

/* The payload of docs/reference/serial-line.md. */
static void board_compose(sagnac_board *board, sagnac_frame *frame)
{
    const sagnac_output_frame *from = &board->frame;
    const uint64_t angle = (uint64_t)board_angle(board);
    const uint32_t open_ended = sagnac_status_is_open_ended(from->status);
    sagnac_octet *payload = frame->payload;
    frame->axis = sagnac_axis_code(board->image.axis);
    frame->kind = SAGNAC_KIND_OUTPUT;
    frame->length = OUTPUT_PAYLOAD;
    sagnac_write_u16(payload, 0U, from->number);
    sagnac_write_u32(payload, 2U, from->tick);
    sagnac_write_u32(payload, 6U, from->counts);
    sagnac_write_u32(payload, 10U, from->raw);
    sagnac_write_u16(payload, 14U, from->status);
    payload[16] = (sagnac_octet)(from->path_status & 0xFFU);
    payload[17] = (sagnac_octet)(from->light_status & 0xFFU);
    sagnac_write_u32(payload, 18U, (uint32_t)from->actuator);
    sagnac_write_u32(payload, 22U, (uint32_t)from->current);
    sagnac_write_u32(payload, 26U, (uint32_t)from->temperature);
    sagnac_write_u16(payload, 30U, board->lost_steps);
    payload[32] = (sagnac_octet)(from->has_temperature | (sagnac_image_code(board->origin, board->trial) << 1));
    sagnac_write_u32(payload, 33U, (uint32_t)(angle & 0xFFFFFFFFU));
    sagnac_write_u32(payload, 37U, (uint32_t)(angle >> 32U));
    sagnac_write_u32(payload, 41U, (open_ended != 0U) ? SAGNAC_UNBOUNDED : from->error_milli_dph);
    sagnac_write_u16(payload, 45U, board_frame_ticks(board));
    sagnac_write_u32(payload, 47U, board->image.tick_ns);
}

void sagnac_board_make_up(sagnac_board *board, uint32_t missed_ticks)
{
    sagnac_sample none;
    uint32_t i;
    for (i = 0U; i < SAGNAC_MAX_INPUTS; i++) {
        none.codes[i] = 0;
    }
    none.present = 0U;
    none.pickoff = 0;
    none.light = 0;
    none.status = 0U;
    if (missed_ticks > 0U) {
        board_check_state(board);
        board->frame.status |= SAGNAC_MISSED_TICKS;
    }
    if (missed_ticks > SAGNAC_LONGEST_PAUSE_TICKS) {
        board->frame.tick = (board->frame.tick + missed_ticks) & 0xFFFFFFFFU;
        board_begin_again(board);
    } else {
        uint32_t rest = missed_ticks;
        while (rest > 0U) {
            sagnac_output output = {0, 0U};
            uint32_t ticks;
            if (board->state.ticks_to_update == 0U) {
                board_slow_update(board, &none);
            }
            ticks = (rest < board->state.ticks_to_update) ? rest : board->state.ticks_to_update;
            /* No misuse is possible: no counts, and no tick past a slow update. */
            (void)sagnac_compensator_advance(&board->image, &board->state, 0, ticks, &output);
            board->frame.counts = board_summed(board, board->frame.counts, output.counts);
            board->frame.status |= output.status;
            board->frame.tick = (board->frame.tick + ticks) & 0xFFFFFFFFU;
            /* No ticks to the update after one: the image turned over. */
            rest -= (ticks == 0U) ? rest : ticks;
        }
    }
}

uint32_t sagnac_board_tick(sagnac_board *board, int32_t counts, uint32_t lost_steps, const sagnac_sample *sample,
                           sagnac_actuators *actuators, sagnac_frame *frame)
{
    uint32_t ends = SAGNAC_NO;
    board_check_state(board);
    board_make_slices(board, sample);
    board_bound_error(board, 1U);
    if (board->state.ticks_to_update == 0U) {
        board_slow_update(board, sample);
    }
    board_correct(board, board_counted(board, counts, lost_steps, sample->pickoff), sample->status);
    board_loops(board, sample->light, actuators);
    board->frame.tick = (board->frame.tick + 1U) & 0xFFFFFFFFU;
    board->frame.ticks++;
    if (board->frame.ticks >= board_frame_ticks(board)) {
        board_compose(board, frame);
        board->frame.number = (board->frame.number + 1U) & 0xFFFFU;
        board_begin_frame(board);
        ends = SAGNAC_YES;
    }
    return ends;
}
