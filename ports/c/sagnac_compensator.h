/*
 * The thermal correction of a ring laser gyro, once a tick.
 *
 *             every period (slow path)                            every tick (fast path)
 *   code -> T -> lag -> rate --+                                  raw counts
 *           +--> x ------------+-> terms  -> k, increment --(slew)--> acc += raw*k - increment -> whole counts
 *
 * Bit for bit the Rust crate sagnac-core; reference vectors prove it (docs/reference/vectors.md). Widths, rounding and ranges:
 * docs/explanation/arithmetic.md. Bytes of an image: docs/reference/image-format.md.
 *
 * Use:
 *   sagnac_image image;                           an image of flash, or a constant of sagnac_unit.c
 *   sagnac_compensator_state state;
 *   if (sagnac_image_load(&image, read, flash, length) == SAGNAC_IMAGE_OK) { sagnac_compensator_start(&state); }
 *   in the 100 us interrupt:
 *     if (state.ticks_to_update == 0U) { sagnac_compensator_update(&image, &state, codes, present); }
 *     if (sagnac_compensator_tick(&image, &state, raw, &output) == SAGNAC_OK) { use output.counts, output.status; }
 * The slow path may run in the interrupt, before it in a task that always ends in time, or in slices over some ticks.
 *
 * Signs: positive counts are positive rotation. Values of inputs are 2^-24 degC.
 * A call past a slow update, or with more than 2^29 counts, is refused and changes nothing.
 */
#ifndef SAGNAC_COMPENSATOR_H
#define SAGNAC_COMPENSATOR_H

#include <stdint.h>

#include "sagnac_integer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SAGNAC_MAX_INPUTS 4U
#define SAGNAC_MAX_TERMS 32U
#define SAGNAC_MAX_ORDER 8U
/* Most turns of a harmonic over the span, 2^-18: just below 64. */
#define SAGNAC_MAX_TURNS_Q18 16777215U
/* Longest image, octets. */
#define SAGNAC_MAX_IMAGE 772U
/* Largest |raw| of one call. */
#define SAGNAC_MAX_RAW ((int32_t)536870912)

/* Status bits of a value; 0: corrected, nothing to report. */
#define SAGNAC_OUT_OF_SPAN 1U
#define SAGNAC_RATE_OUT_OF_SPAN 2U
#define SAGNAC_HELD 4U
#define SAGNAC_STALE 8U
#define SAGNAC_SETTLING 16U
#define SAGNAC_UNCORRECTED 32U
#define SAGNAC_LIMITED 64U
#define SAGNAC_OVERFLOW 128U
/* Bits that a board adds (sagnac_board.h). */
#define SAGNAC_NO_DITHER 256U
#define SAGNAC_COUNTS_LOST 512U
#define SAGNAC_SURVIVOR 1024U
#define SAGNAC_STUCK 2048U
#define SAGNAC_OUTVOTED 4096U
#define SAGNAC_MISSED_TICKS 8192U
#define SAGNAC_UPSET 16384U

/* Result of a call. After anything but SAGNAC_OK nothing has changed. */
typedef enum {
    SAGNAC_OK = 0,
    SAGNAC_UPDATE_DUE = 1,
    SAGNAC_UPDATE_NOT_DUE = 2,
    SAGNAC_RAW_OUT_OF_RANGE = 3,
    /* A slow update in slices that was begun before another one. */
    SAGNAC_OUTDATED = 5
} sagnac_misuse;

/* Why an image is refused. */
typedef enum {
    SAGNAC_IMAGE_OK = 0,
    SAGNAC_IMAGE_LENGTH = 1,
    SAGNAC_IMAGE_NOT_AN_IMAGE = 2,
    SAGNAC_IMAGE_VERSION = 3,
    SAGNAC_IMAGE_CRC = 4,
    SAGNAC_IMAGE_RESERVED = 5,
    SAGNAC_IMAGE_HEAD = 6,
    SAGNAC_IMAGE_INPUT = 7,
    SAGNAC_IMAGE_TERM = 8,
    SAGNAC_IMAGE_SUM = 9
} sagnac_image_error;

/* What a term adds to. */
typedef enum { SAGNAC_BIAS = 1, SAGNAC_SCALE = 2 } sagnac_kind;

/* The function of x in a term: T_order(x), ((x - knot)/2)^2 above the knot, 1 from the knot on, or the
 * cosine or sine of 2 pi turns (x + 1)/2. */
typedef enum {
    SAGNAC_CHEBYSHEV = 0,
    SAGNAC_ZONE = 1,
    SAGNAC_STEP = 2,
    SAGNAC_COSINE = 3,
    SAGNAC_SINE = 4
} sagnac_shape;

/* Where the value of an input comes from: its own code; input `of` minus input `less`; input `of` once more, for a second lag; or the
 * time since power-on, a constant 0 behind a lag that begins at -1 degC. */
typedef enum {
    SAGNAC_CODE = 0,
    SAGNAC_DIFFERENCE = 1,
    SAGNAC_REPEAT = 2,
    SAGNAC_WARM_UP = 3
} sagnac_source;

/* An input. `of` and `less` come before it; 0 where its source has none. */
typedef struct {
    sagnac_source source;
    uint32_t of;
    uint32_t less;
    /* For an input that is not a temperature, degC means 2^unit_exponent of its own unit; 0 for degC. */
    int32_t unit_exponent;
    int32_t offset_q24;
    int32_t gain_mantissa;
    uint32_t gain_shift;
    int32_t valid_lo_q24;
    int32_t valid_hi_q24;
    int32_t span_lo_q24;
    int32_t span_hi_q24;
    uint32_t x_mantissa;
    uint32_t x_shift;
    uint32_t alpha_mantissa;
    uint32_t alpha_shift;
    uint32_t rate_shift;
    int32_t rate_lo;
    int32_t rate_hi;
    uint32_t y_mantissa;
    uint32_t y_shift;
    uint32_t stale_after_updates;
    uint32_t settling_updates;
    /* Largest step that is a value at once, 2^-8 degC; 0 for any. */
    uint32_t largest_step_q8;
    /* Each update without a value adds largest_step_q8 * 2^step_growth to it, 2^-24 degC; 0: nothing, and no step is held open. */
    uint32_t step_growth;
} sagnac_input;

typedef struct {
    sagnac_kind kind;
    uint32_t input;
    sagnac_shape shape;
    uint32_t order;
    int32_t knot_q15;
    uint32_t turns_q18;
    uint32_t times_rate;
    int32_t mantissa;
    uint32_t shift;
} sagnac_term;

/* An image. Fields of docs/reference/image-format.md; the serial number as eight little-endian words. */
typedef struct {
    uint32_t serial[8];
    uint32_t axis;
    uint32_t tick_ns;
    uint32_t period_ticks;
    uint32_t slew_ticks;
    uint64_t scale_factor_femto_arcsec;
    uint64_t quantum_nano_counts;
    uint32_t sequence;
    uint32_t output_limit;
    uint32_t input_count;
    uint32_t term_count;
    sagnac_input inputs[SAGNAC_MAX_INPUTS];
    sagnac_term terms[SAGNAC_MAX_TERMS];
} sagnac_image;

/* Memory of one input. */
typedef struct {
    int64_t lag_q46;
    int64_t remainder;
    int32_t last_q24;
    uint32_t has_last;
    int32_t step_q24;
    uint32_t steady_updates;
    uint32_t held_updates;
    uint32_t unread_updates; /* of the hold without a sample, before one was held back: its reach; at most 65,535 */
    uint32_t settled_updates;
    uint32_t values; /* since the first one, at most 7 */
    uint32_t open_q24; /* the sum of the steps since one is open, modulo 2^32; 0 without */
} sagnac_input_state;

/* Memory of one compensator. Read it freely; change it only through the functions. */
typedef struct {
    int64_t accumulator;
    int64_t k_q32;
    int64_t increment;
    int64_t target;
    int64_t slope;
    uint32_t steeper_ticks;
    uint32_t slewing_ticks;
    uint32_t ticks_to_update;
    uint32_t slow_status;
    uint32_t corrected_once;
    uint32_t overflow;
    uint32_t warm;
    uint32_t updates;
    sagnac_input_state inputs[SAGNAC_MAX_INPUTS];
} sagnac_compensator_state;

/* An input at one slow update, scaled for the terms. */
typedef struct {
    int64_t x_q47;
    int64_t y_q31;
    uint32_t x_clamped;
    uint32_t y_clamped;
} sagnac_scaled_input;

/* A slow update in the making. Change it only through the functions. */
typedef struct {
    sagnac_input_state inputs[SAGNAC_MAX_INPUTS];
    sagnac_scaled_input scaled[SAGNAC_MAX_INPUTS];
    int64_t basis[SAGNAC_MAX_INPUTS][SAGNAC_MAX_ORDER + 1U];
    int64_t bias;
    int64_t scale;
    int32_t codes[SAGNAC_MAX_INPUTS];
    uint32_t present;
    uint32_t warm;
    uint32_t before;
    uint32_t fresh;
    uint32_t stepped;
    uint32_t held;
    uint32_t status;
    uint32_t slices;
} sagnac_slow_update;

/* One corrected value. */
typedef struct {
    int32_t counts;
    uint32_t status;
} sagnac_output;

/* Reads an image of `length` bytes and checks every value; with anything but SAGNAC_IMAGE_OK do not use it. No byte at or
 * beyond `length`, and none at or beyond SAGNAC_MAX_IMAGE, is read. */
sagnac_image_error sagnac_image_load(sagnac_image *image, sagnac_read_octet read, const void *context, uint32_t length);

/* The checks alone, for an image that was not loaded. */
sagnac_image_error sagnac_image_check(const sagnac_image *image);

/* The largest value that the terms of one kind can reach together, 2^-32 counts per tick or 2^-32. */
int64_t sagnac_image_reach(const sagnac_image *image, sagnac_kind kind);

/* The largest |increment| that cannot overflow within a temperature period, 2^-32 counts per tick. */
int64_t sagnac_image_increment_bound(const sagnac_image *image);

/* The value of a code, 2^-24 degC: SAGNAC_YES, or SAGNAC_NO outside the valid range of the input. */
uint32_t sagnac_input_value(const sagnac_input *spec, int32_t code, int32_t *t_q24);

/* How far from an older value a value may lie after some updates without one, 2^-24 degC. */
uint32_t sagnac_input_reach(const sagnac_input *spec, uint32_t updates);

/* SAGNAC_YES while nothing shows that the first value was right, or a step is open. */
uint32_t sagnac_input_is_open(const sagnac_input *spec, const sagnac_input_state *memory);

/* An image without inputs and terms, which passes counts through. */
void sagnac_image_empty(sagnac_image *image);

/* Memory at power-on: a slow update is due. */
void sagnac_compensator_start(sagnac_compensator_state *state);

/* Memory after a reset that did not cut the power: as at power-on, but a warm-up is over. */
void sagnac_compensator_start_warm(sagnac_compensator_state *state);

/* Memory after a reset that did not cut the power, so many slow updates after power-on: as at power-on, but a warm-up goes on. It makes no more
 * than 2^20 updates of each warm-up. */
void sagnac_compensator_start_after(const sagnac_image *image, sagnac_compensator_state *state, uint32_t updates);

/* Makes the memory fit for another image of the same gyro, between two ticks: the remainder of a count is kept, the active correction
 * stays until the next slow update, which is due at once, and the inputs start again. A warm-up is over. */
void sagnac_compensator_migrate_state(const sagnac_image *image, sagnac_compensator_state *state);

/* A slow update. Bit i of `present` is set if input i has a new sample, codes[i]. A code is read only if its bit is set. A
 * difference, repeat or warm-up has neither bit nor code. */
sagnac_misuse sagnac_compensator_update(const sagnac_image *image, sagnac_compensator_state *state,
                                        const int32_t *codes, uint32_t present);

/* The same in slices, for an image whose slow update does not fit between two ticks. Begin some ticks before it is due, with the codes of
 * then; make a slice or more in each tick; apply it when ticks_to_update is 0, instead of sagnac_compensator_update. The bits are those
 * of an update with the same codes. A slice is one input with its series, or one term: at most input_count + term_count of them. */
void sagnac_compensator_begin_update(const sagnac_image *image, const sagnac_compensator_state *state,
                                     const int32_t *codes, uint32_t present, sagnac_slow_update *update);

/* One slice; 1 when none is missing any more. */
uint32_t sagnac_compensator_advance_update(const sagnac_image *image, sagnac_slow_update *update);

/* Puts it in force. Makes the slices that are still missing. SAGNAC_OUTDATED if another update, or another image, came in between. */
sagnac_misuse sagnac_compensator_apply_update(const sagnac_image *image, sagnac_compensator_state *state,
                                              sagnac_slow_update *update);

/* One tick. */
sagnac_misuse sagnac_compensator_tick(const sagnac_image *image, sagnac_compensator_state *state, int32_t raw,
                                      sagnac_output *output);

/* `ticks` ticks at once: the sum of their counts, and the state after them, while no output limit is reached. */
sagnac_misuse sagnac_compensator_advance(const sagnac_image *image, sagnac_compensator_state *state, int32_t raw,
                                         uint32_t ticks, sagnac_output *output);

/* Ticks without counts: clock and slew advance, the accumulator does not change. */
sagnac_misuse sagnac_compensator_skip(sagnac_compensator_state *state, uint32_t ticks);

/* Clears SAGNAC_OVERFLOW: counts are output again, from a remainder of zero. What was held back is lost. */
void sagnac_compensator_clear_overflow(sagnac_compensator_state *state);

/* The status that a tick would have now, without its own SAGNAC_LIMITED. */
uint32_t sagnac_compensator_status(const sagnac_compensator_state *state);

#ifdef __cplusplus
}
#endif

#endif
