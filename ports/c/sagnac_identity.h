/*
 * The identity of a gyro, and the check that an image is made for it.
 *
 * Bit for bit the verdicts of the Rust crate sagnac-core. What a board knows about its gyro without an image comes from a fuse or its
 * configuration, never from the image itself.
 */
#ifndef SAGNAC_IDENTITY_H
#define SAGNAC_IDENTITY_H

#include <stdint.h>

#include "sagnac_compensator.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A gyro. */
typedef struct {
    uint32_t serial[8]; /* UTF-8, padded with zero octets, as little-endian words */
    uint32_t axis;
    uint32_t tick_ns;
    uint64_t scale_factor_femto_arcsec;
    uint64_t quantum_nano_counts;
    int64_t largest_increment; /* |increment| that an image may reach, 2^-32 counts per tick: d*tick/S0*2^32 of the largest drift */
    int64_t largest_scale;     /* |k - 1| that an image may reach, 2^-32 */
    uint32_t largest_work;     /* instructions of a slow update that the board has time for, in the measure of the Rust code */
} sagnac_gyro;

/* Why an intact image is refused for a gyro: the first property that differs. */
typedef enum {
    SAGNAC_MATCHES = 0,
    SAGNAC_OTHER_SERIAL = 1,
    SAGNAC_OTHER_AXIS = 2,
    SAGNAC_OTHER_TICK = 3,
    SAGNAC_OTHER_SCALE_FACTOR = 4,
    SAGNAC_OTHER_QUANTUM = 5,
    SAGNAC_BIAS_TOO_LARGE = 6,
    SAGNAC_SCALE_TOO_LARGE = 7,
    SAGNAC_WORK_TOO_LARGE = 8
} sagnac_mismatch;

sagnac_mismatch sagnac_gyro_accept(const sagnac_gyro *gyro, const sagnac_image *image);

/* Instructions of an image's slow update on a Cortex-M4F, of the Rust code. The C code takes about 2.4 times as many. */
uint32_t sagnac_image_work(const sagnac_image *image);

/* The image to run while no bank holds a valid one: counts pass through. */
void sagnac_factory_defaults(const sagnac_gyro *gyro, sagnac_image *image);

#ifdef __cplusplus
}
#endif

#endif
