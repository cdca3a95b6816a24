/*
 * Dither stripping: the counts of whole dither periods, in which the dither adds nothing.
 *
 *   share of a tick before the pickoff's upward zero = p0/(p0 - p1)       p0 < 0 <= p1, pickoff at the two ends of the tick
 *
 * Bit for bit the Rust crate sagnac-loops. No count is lost: stripped and pending add up to what was counted. Without a zero in
 * `longest` ticks, or without the least swing in each half of them, there is no dither: lock-in.
 */
#ifndef SAGNAC_STRIP_H
#define SAGNAC_STRIP_H

#include <stdint.h>

#include "sagnac_integer.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A stripper with its memory. Read it freely; change it only through the functions. */
typedef struct {
    uint32_t longest;
    uint32_t least_swing;
    int64_t sum;
    uint32_t ticks;
    uint32_t has_last;
    int32_t last;
    uint32_t stretch;
    int32_t lowest;
    int32_t highest;
    uint32_t swings;
    uint32_t has_zeros;
} sagnac_stripper;

/* The counts of one dither period. */
typedef struct {
    int64_t counts;
    uint32_t ticks;
    uint32_t without_zero; /* no zero within the longest period: the dither is still in the counts */
} sagnac_stripped;

/* Periods of at most `longest` ticks, 1 to 65535 (twice the nominal period is a good choice); least change of the pickoff in half of
 * them, in its own unit (half the smallest amplitude of a working dither). */
void sagnac_stripper_start(sagnac_stripper *stripper, uint32_t longest, uint32_t least_swing);

/* The counts of a tick, and the pickoff at its end. SAGNAC_YES if a period ends in this tick. */
uint32_t sagnac_stripper_update(sagnac_stripper *stripper, int32_t counts, int32_t pickoff, sagnac_stripped *stripped);

/* SAGNAC_NO from at most `longest` ticks after the dither ended, until it is found again. */
uint32_t sagnac_stripper_has_dither(const sagnac_stripper *stripper);

#ifdef __cplusplus
}
#endif

#endif
