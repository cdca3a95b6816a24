/*
 * Intensity control: the light of a ring laser gyro held by its discharge current (or its pump).
 *
 *   light -> mean of n ticks -> error -> kp + ki*sum (limits) -> slew limit -> current
 *
 *   IGNITING -light-> RUNNING -dark for long-> RESTING -> IGNITING ...  -after all tries-> FAILED
 *
 * Once a tick: the photodiode's code in, the current's code out. Bit for bit the Rust crate sagnac-loops. Bytes of a
 * table: docs/reference/loop-table.md. Signs: more current code is more light.
 */
#ifndef SAGNAC_INTENSITY_H
#define SAGNAC_INTENSITY_H

#include <stdint.h>

#include "sagnac_integer.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Status bits. */
#define SAGNAC_LIGHT_LOW 1U
#define SAGNAC_LIGHT_END_OF_RANGE 2U
#define SAGNAC_LIGHT_IGNITING 4U
#define SAGNAC_LIGHT_FAILED 8U
#define SAGNAC_LIGHT_SETTLING 16U

typedef enum {
    SAGNAC_PHASE_IGNITING = 0,
    SAGNAC_PHASE_RESTING = 1,
    SAGNAC_PHASE_RUNNING = 2,
    SAGNAC_PHASE_FAILED = 3
} sagnac_intensity_phase;

/* The loop, as its table has it. */
typedef struct {
    uint32_t ticks;
    uint32_t error_shift;
    uint32_t tries;
    sagnac_gain kp;
    sagnac_gain ki;
    int64_t set_point;
    int64_t dark_sum;
    int64_t low_sum;
    int32_t least;
    int32_t most;
    int32_t slew;
    int32_t ignition;
    int32_t settled_error;
    uint32_t ignition_updates;
    uint32_t rest_updates;
    uint32_t dark_updates;
    uint32_t end_updates;
} sagnac_intensity;

/* What it remembers. Read it freely. */
typedef struct {
    int64_t sum;
    uint32_t ticks;
    sagnac_intensity_phase phase;
    uint32_t left;   /* igniting, resting: updates to go */
    uint32_t tries;  /* igniting, resting: tries to go */
    uint32_t dark;   /* running: updates without light in a row */
    uint32_t at_end; /* running: updates at an end of the range in a row */
    int64_t integral_q32;
    int32_t current;
    uint32_t status;
} sagnac_intensity_state;

typedef struct {
    int32_t current;
    uint32_t status;
} sagnac_intensity_output;

/* Reads the loop from a table of the loops (512 bytes). 1, or 0 if it cannot be used. */
uint32_t sagnac_intensity_load(sagnac_intensity *loop, sagnac_read_octet read, const void *context, uint32_t length);

/* A loop about to ignite. */
void sagnac_intensity_start(const sagnac_intensity *loop, sagnac_intensity_state *state);

/* One tick. With `hold` not 0 the current stays and no dark time is counted (SAGNAC_PATH_HOLD_LIGHT). */
void sagnac_intensity_tick(const sagnac_intensity *loop, sagnac_intensity_state *state, int32_t photodiode,
                           uint32_t hold, sagnac_intensity_output *output);

#ifdef __cplusplus
}
#endif

#endif
