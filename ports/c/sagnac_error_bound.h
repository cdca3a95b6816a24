/*
 * How far the correction may be off now: a number next to the status.
 *
 *   bound    max(0.1 deg/h, 0.05 * sum R) + the effect of a step          status 0; R the effect of an input's rate at its border far; a
 *                                                                        step is the reach after one update: behind the lag, on the terms
 *                                                                        with their steepest slope, and over their steps
 *   settling + 2 * R * exp(-n * alpha)                                   n slow updates after the lag began
 *   open     + 2 * (C + R)                                               C the effect of the input itself: its value may be wrong;
 *                                                                        also while a jump is weighed, and always where the image has no
 *                                                                        limit of slope for the input
 *   held     + the steepest slope of the terms times the limit of slope and the hold, the steps, and the change of the rate
 *
 * An input makes 2 * (C + R) at most. While a correction is held its own number counts, and these parts are added.
 *
 * Bit for bit the Rust crate sagnac-core. It bounds a fault, not the calibration: add the calibration's own uncertainty. There is no bound
 * where an input is outside its span or without a value since power-on, and none against a reading that is wrong and
 * moves by no more than a largest step at a time. Scale terms count for nothing: their effect follows the input rate.
 *
 * Use, once after each slow update:
 *   sagnac_error_bound_update(&bound, &image, &state);       then bound.milli_dph
 */
#ifndef SAGNAC_ERROR_BOUND_H
#define SAGNAC_ERROR_BOUND_H

#include <stdint.h>

#include "sagnac_compensator.h"

#ifdef __cplusplus
extern "C" {
#endif

/* No bound. */
#define SAGNAC_UNBOUNDED 0xFFFFFFFFU

/* The bound after each slow update. */
typedef struct {
    uint32_t held_updates; /* slow updates in a row that kept the last correction */
    uint32_t milli_dph;    /* 0.001 deg/h, rounded up */
    uint32_t made_milli_dph; /* that of the last update with a correction of its own, which a hold keeps */
    uint32_t is_whole;     /* no slice is missing */
    uint32_t next;         /* the next slice: an input, or the sum behind the last one */
    int64_t rates;         /* of the slices so far, Q40 counts per tick */
    int64_t faults;
} sagnac_error_bound;

/* Before the first slow update: no bound. */
void sagnac_error_bound_start(sagnac_error_bound *bound);

/* The bound of the slow update that came last. */
void sagnac_error_bound_update(sagnac_error_bound *bound, const sagnac_image *image, const sagnac_compensator_state *state);

/* The same in slices: begin it after a slow update, and make a slice in each tick behind it, at most input_count + 1. */
void sagnac_error_bound_begin(sagnac_error_bound *bound, const sagnac_compensator_state *state);
void sagnac_error_bound_advance(sagnac_error_bound *bound, const sagnac_image *image, const sagnac_compensator_state *state);

/* SAGNAC_YES for a status that leaves no bound, the bits of a board included. */
uint32_t sagnac_status_is_open_ended(uint32_t status);

#ifdef __cplusplus
}
#endif

#endif
