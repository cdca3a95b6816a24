/*
 * One tick of a gyro's board, in a fixed order.
 *
 *   slow update: a slice -> counts -> stripping -> correction -> path-length loop -> intensity loop -> output frame
 *
 * Bit for bit the Rust crate sagnac-board. The status of a frame also has what the board alone knows: a dither that is missing, steps of
 * unknown direction, counts beyond what a call takes, a thermometer that stands still, where the image comes from, ticks that were missed,
 * and memory that turned over.
 *
 * A slow update is made in slices, one in each of the ticks before it is due (more where the temperature period has fewer ticks), with the
 * codes of the first of them. No tick has a whole one, but for those without ticks before them: at power-on, after another image, after an
 * upset, and among ticks that are made up.
 *
 * Use:
 *   static const sagnac_board_setup setup = {...};           (in flash, as are the loops that it names)
 *   sagnac_banks_start(&banks, &gyro, watchdog_resets, &loaded);
 *   sagnac_board_start(&board, &loaded, &setup, SAGNAC_POWER_ON, 0);
 *   in the 100 us interrupt, with the counts of the processor's encoder timer:
 *     sagnac_board_make_up(&board, missed);                    (where a clock of its own shows ticks without an interrupt)
 *     if (sagnac_board_tick(&board, counts, lost_steps, &sample, &actuators, &frame) != 0U) { send frame; }
 *   in the main loop: sagnac_frame_push, sagnac_upload_handle; then, between two ticks, sagnac_board_use; once a second
 *   sagnac_upload_second and sagnac_board_is_intact, and if it is not, sagnac_banks_load and sagnac_board_mend.
 */
#ifndef SAGNAC_BOARD_H
#define SAGNAC_BOARD_H

#include <stdint.h>

#include "sagnac_banks.h"
#include "sagnac_compensator.h"
#include "sagnac_error_bound.h"
#include "sagnac_frame.h"
#include "sagnac_intensity.h"
#include "sagnac_path_length.h"
#include "sagnac_strip.h"
#include "sagnac_upset.h"
#include "sagnac_watch.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Usual ticks of an output frame: 10 ms at 100 us. */
#define SAGNAC_FRAME_TICKS 100U
/* Longest pause that is made up, ticks: 105 s at 100 us. */
#define SAGNAC_LONGEST_PAUSE_TICKS 1048576U

/* Inputs of a tick besides the counts. */
typedef struct {
    int32_t codes[SAGNAC_MAX_INPUTS]; /* of the image's inputs; used at a slow update */
    uint32_t present;                 /* bit i: codes[i] is a new sample */
    int32_t pickoff;                  /* dither angle at the end of the tick, in any unit */
    int32_t light;                    /* code of the photodiode */
    uint32_t status;                  /* bits that the caller adds, for example SAGNAC_OUTVOTED */
} sagnac_sample;

/* Outputs of a tick to the converters, codes. */
typedef struct {
    int32_t actuator;   /* path-length actuator with its modulation */
    int32_t modulation; /* the modulation alone */
    int32_t current;    /* discharge current */
} sagnac_actuators;

/* The frame in the making. */
typedef struct {
    uint32_t number;
    uint32_t tick;
    uint32_t counts;
    uint32_t raw;
    uint32_t status;
    uint32_t path_status;
    uint32_t light_status;
    int32_t actuator;
    int32_t current;
    uint32_t has_temperature;
    int32_t temperature;
    uint32_t ticks;
    uint32_t error_milli_dph;
} sagnac_output_frame;

/* What a board is built with. Keep it in flash: sagnac_board_is_intact compares the board with it. */
typedef struct {
    const sagnac_path_length *path;
    const sagnac_intensity *light;
    uint32_t strips; /* the gyro is dithered: sagnac_stripper_start says what the next two are */
    uint32_t longest;
    uint32_t least_swing;
    uint32_t watches; /* the image's thermometers are watched (sagnac_watch.h), in 2^-24 degC */
    sagnac_watch_spec watch_spec;
    uint32_t heats; /* the path-length actuator is a heater */
    uint32_t frame_ticks; /* of an output frame, 1 to 65,535; usually SAGNAC_FRAME_TICKS */
} sagnac_board_setup;

/* The board of one axis; keep it in static memory. Read it freely; change it only through the functions. */
typedef struct {
    sagnac_image image;
    sagnac_octet digest[SAGNAC_DIGEST];
    sagnac_compensator_state state;
    sagnac_slow_update pending; /* the slices so far */
    uint32_t is_pending;
    sagnac_board_setup setup;
    sagnac_path_length_state path_state;
    sagnac_intensity_state light_state;
    sagnac_stripper stripper;
    sagnac_origin origin;
    uint32_t trial;
    sagnac_watch watch;
    uint32_t still; /* bit i: the image's input i stands still */
    uint32_t lost_steps;
    sagnac_error_bound error; /* in slices, in the ticks behind a slow update */
    int64_t angle_rest;       /* 1e-15 arcsec below the unit of the last frame's angle */
    uint32_t image_sum; /* what sagnac_image_sum, exclusive or sagnac_image_code, must still be */
    uint32_t state_sum; /* what sagnac_state_sum must still be at the next slow update */
    uint32_t update_at; /* number of the tick before which that is due */
    sagnac_output_frame frame;
} sagnac_board;

/* How the processor came to begin: with the power, or by a watchdog, a command or a dip of the supply, in which the gyro stayed warm. */
typedef enum {
    SAGNAC_POWER_ON = 0,
    SAGNAC_RESET = 1
} sagnac_cause;

/* No clock ran through the reset. */
#define SAGNAC_UNKNOWN_TIME 0xFFFFFFFFU

/* A board that begins. After a reset a warm-up goes on where it is
 * `since_power_on_s` after power-on; with SAGNAC_UNKNOWN_TIME it is over, and SETTLING stands for three of its time constants. At power-on
 * the number is not read. */
void sagnac_board_start(sagnac_board *board, const sagnac_loaded *loaded, const sagnac_board_setup *setup, sagnac_cause cause,
                        uint32_t since_power_on_s);

/* What flash holds now, between two ticks: goes on with its image if that is another one. */
void sagnac_board_use(sagnac_board *board, const sagnac_loaded *loaded);

/* SAGNAC_NO if a bit of the image, its origin or the setup turned over in memory since they were given. Ask once a second, between two ticks.
 * The tick compares the state by itself. The loops' constants stay in the caller's flash and need no comparison. */
uint32_t sagnac_board_is_intact(const sagnac_board *board, const sagnac_board_setup *setup);

/* Goes on with what flash holds (sagnac_banks_load) after SAGNAC_NO above, with SAGNAC_UPSET in the frame. */
void sagnac_board_mend(sagnac_board *board, const sagnac_loaded *loaded, const sagnac_board_setup *setup);

/* Ticks that passed without a call, before the one that has all their counts. Their correction is output, with SAGNAC_MISSED_TICKS; slow
 * updates among them have no sample; loops and stripping stand still. After more than SAGNAC_LONGEST_PAUSE_TICKS the correction begins again. */
void sagnac_board_make_up(sagnac_board *board, uint32_t missed_ticks);

/* One tick. `lost_steps` is the counter's total of steps of unknown direction, 0 for hardware that has none. SAGNAC_YES with a frame to
 * send in every frame_ticks-th tick. */
uint32_t sagnac_board_tick(sagnac_board *board, int32_t counts, uint32_t lost_steps, const sagnac_sample *sample,
                           sagnac_actuators *actuators, sagnac_frame *frame);

#ifdef __cplusplus
}
#endif

#endif
