/*
 * Fringes that two photodiodes see a quarter fringe apart, counted from their comparators' levels.
 *
 *   A B   00 -> 10 -> 11 -> 01 -> 00     one fringe forward: A leads B by a quarter when the phase grows
 *
 * Bit for bit the Rust crate sagnac-loops. Only for a processor without a counter in encoder mode: about 40 instructions a step. A
 * double step has no known direction: it adds no count and is reported as lost.
 */
#ifndef SAGNAC_QUADRATURE_H
#define SAGNAC_QUADRATURE_H

#include <stdint.h>

#include "sagnac_integer.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Counts per fringe: each step, each change of A, or each rise of A with B low. */
typedef enum { SAGNAC_X1 = 1, SAGNAC_X2 = 2, SAGNAC_X4 = 4 } sagnac_counting;

/* Memory of a counter. */
typedef struct {
    uint32_t has_quarter;
    uint32_t quarter;
    uint32_t lost; /* double steps: the fringes were faster than the samples */
} sagnac_quadrature;

/* Before the first pair of levels. */
void sagnac_quadrature_start(sagnac_quadrature *counter);

/* A pair of levels, 0 or 1 each; the counts that it adds: -1, 0 or 1 (0 for the first pair and for a lost step). */
int32_t sagnac_quadrature_update(sagnac_quadrature *counter, sagnac_counting counting, uint32_t a, uint32_t b);

#ifdef __cplusplus
}
#endif

#endif
