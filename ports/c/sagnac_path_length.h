/*
 * Path-length control: the cavity of a ring laser gyro held on the peak of its gain.
 *
 *                +--------------------- modulation ---------------------+
 *   light -> synchronous detector -> error -> kp + ki*sum (limits) -> (+) -+-> actuator
 *
 * Once a tick: the detector's code in, the actuator's code out. Bit for bit the Rust crate sagnac-loops. Bytes of a
 * table: docs/reference/loop-table.md. Signs: more code is a longer path. Counts of the gyro are good while status has no
 * SAGNAC_PATH_INVALID.
 *
 *   SWEEPING -light-> SETTLING -> CLOSING -small error, a peak-> LOCKED -near the end-> RESETTING -> SETTLING ...
 *     ^  +--none--> DARK <-- too long, or no peak --+        +-- error large, dark, or no peak --+
 *     +--------------+ ^-------------------------------------------------------------------------+
 *
 * A peak is shown by the second harmonic that it makes of the modulation, over the lock time, and by light that repeats
 * the search's. A stuck photodiode, a start on the trough and a mirror that answers in counterphase have none of it: such
 * a loop never reads LOCKED, it reports SAGNAC_PATH_NO_PEAK.
 */
#ifndef SAGNAC_PATH_LENGTH_H
#define SAGNAC_PATH_LENGTH_H

#include <stdint.h>

#include "sagnac_integer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SAGNAC_MAX_TICKS_PER_PERIOD 64U

/* Status bits. */
#define SAGNAC_PATH_INVALID 1U
#define SAGNAC_PATH_ACQUIRING 2U
#define SAGNAC_PATH_RESETTING 4U
#define SAGNAC_PATH_LOW_SIGNAL 8U
#define SAGNAC_PATH_AT_LIMIT 16U
#define SAGNAC_PATH_WAS_LOST 32U
/* The intensity loop is to hold its current. */
#define SAGNAC_PATH_HOLD_LIGHT 64U
/* The last attempt found no peak; until the loop locks. */
#define SAGNAC_PATH_NO_PEAK 128U

typedef enum {
    SAGNAC_PATH_DARK = 0,
    SAGNAC_PATH_SWEEPING = 1,
    SAGNAC_PATH_SETTLING = 2,
    SAGNAC_PATH_CLOSING = 3,
    SAGNAC_PATH_LOCKED = 4,
    SAGNAC_PATH_MODE_RESET = 5
} sagnac_path_phase;

/* The loop, as its table has it. */
typedef struct {
    int32_t sine_q15[SAGNAC_MAX_TICKS_PER_PERIOD];
    int32_t second_q15[SAGNAC_MAX_TICKS_PER_PERIOD];
    uint32_t ticks;
    uint32_t delay;
    uint32_t error_shift;
    sagnac_gain kp;
    sagnac_gain ki;
    int32_t modulation;
    int32_t low;
    int32_t high;
    int32_t reset_low;
    int32_t reset_high;
    int32_t wavelength;
    int32_t lock_error;
    int32_t lost_error;
    int64_t sweep_step_q32;
    int64_t reset_step_q32;
    int64_t dark_sum;
    uint32_t sweep_periods;
    uint32_t settle_periods;
    uint32_t lock_periods;
    uint32_t lost_periods;
    uint32_t give_up_periods;
    uint32_t least_curvature_q8; /* second harmonic of a peak, 2^-23 of the light */
    uint32_t most_curvature_q8;  /* the most that a period counts with */
} sagnac_path_length;

/* What it remembers. Read it freely. */
typedef struct {
    int64_t in_phase;
    int64_t second;
    int64_t plain;
    uint32_t index;
    sagnac_path_phase phase;
    uint32_t left;      /* periods to go: dark, sweeping, settling */
    uint32_t count;     /* closing: good periods in a row; locked: bad ones */
    uint32_t since;     /* closing: periods since it was closed */
    uint32_t checked;   /* locked: periods of the present check */
    uint32_t aside;     /* without a search: the last start was half a wavelength from the middle */
    int64_t seen_second; /* closing, locked: sums of the present check */
    int64_t seen_plain;
    int64_t second_harmonic; /* of the last period, 2^-15 codes: positive at a peak */
    int64_t best;       /* sweeping, settling: brightest sum of the search; 0 without one */
    int64_t at_q32;     /* sweeping: where; resetting: where to */
    int64_t integral_q32;
    int32_t held;
    int32_t error;
    int32_t modes;
    uint32_t status;
} sagnac_path_length_state;

typedef struct {
    int32_t actuator;
    int32_t modulation;
    uint32_t status;
} sagnac_path_length_output;

/* Reads the loop from a table of the loops (512 bytes). 1, or 0 if it cannot be used. */
uint32_t sagnac_path_length_load(sagnac_path_length *loop, sagnac_read_octet read, const void *context,
                                 uint32_t length);

/* With the lamp off: SAGNAC_YES if the modulation reaches the photodiode's code by itself, and could pass for a peak. `second_sum`: the
 * sum of state->second_harmonic after each of so many `periods`, at least 16 times loop->lock_periods, in which the ticks drove the modulation. */
uint32_t sagnac_path_length_is_heard(const sagnac_path_length *loop, int64_t second_sum, uint32_t periods);

/* A loop that has not seen light. */
void sagnac_path_length_start(const sagnac_path_length *loop, sagnac_path_length_state *state);

/* One tick. */
void sagnac_path_length_tick(const sagnac_path_length *loop, sagnac_path_length_state *state, int32_t detector,
                             sagnac_path_length_output *output);

#ifdef __cplusplus
}
#endif

#endif
