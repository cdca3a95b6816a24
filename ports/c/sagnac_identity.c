/* The identity of a gyro: see sagnac_identity.h. */
#include "sagnac_identity.h"

/* Instructions of a slow update: docs/explanation/on-target.md. */
#define WORK_BASE 572U
#define WORK_SERIES 15U
#define WORK_INPUT 472U
#define WORK_LAG 157U
#define WORK_TERM 77U
#define WORK_ZONE 6U
#define WORK_HARMONIC 112U

uint32_t sagnac_image_work(const sagnac_image *image)
{
    uint32_t work = WORK_BASE;
    uint32_t i;
    if (image->input_count > 1U) {
        work += WORK_INPUT * (image->input_count - 1U);
    }
    if (image->term_count > 0U) {
        work += WORK_SERIES;
    }
    for (i = 0U; i < image->input_count; i++) {
        if (image->inputs[i].alpha_mantissa != 0U) {
            work += WORK_LAG;
        }
    }
    for (i = 0U; i < image->term_count; i++) {
        const sagnac_shape shape = image->terms[i].shape;
        work += WORK_TERM;
        if (shape == SAGNAC_ZONE) {
            work += WORK_ZONE;
        }
        if ((shape == SAGNAC_COSINE) || (shape == SAGNAC_SINE)) {
            work += WORK_HARMONIC;
        }
    }
    return work;
}

static uint32_t identity_same_serial(const sagnac_gyro *gyro, const sagnac_image *image)
{
    uint32_t same = SAGNAC_YES;
    uint32_t i;
    for (i = 0U; i < 8U; i++) {
        if (gyro->serial[i] != image->serial[i]) {
            same = SAGNAC_NO;
        }
    }
    return same;
}

/* SAG-CORE-023 */
sagnac_mismatch sagnac_gyro_accept(const sagnac_gyro *gyro, const sagnac_image *image)
{
    sagnac_mismatch mismatch = SAGNAC_MATCHES;
    if (identity_same_serial(gyro, image) == 0U) {
        mismatch = SAGNAC_OTHER_SERIAL;
    } else if (image->axis != gyro->axis) {
        mismatch = SAGNAC_OTHER_AXIS;
    } else if (image->tick_ns != gyro->tick_ns) {
        mismatch = SAGNAC_OTHER_TICK;
    } else if (image->scale_factor_femto_arcsec != gyro->scale_factor_femto_arcsec) {
        mismatch = SAGNAC_OTHER_SCALE_FACTOR;
    } else if (image->quantum_nano_counts != gyro->quantum_nano_counts) {
        mismatch = SAGNAC_OTHER_QUANTUM;
    } else if (sagnac_image_reach(image, SAGNAC_BIAS) > gyro->largest_increment) {
        mismatch = SAGNAC_BIAS_TOO_LARGE;
    } else if (sagnac_image_reach(image, SAGNAC_SCALE) > gyro->largest_scale) {
        mismatch = SAGNAC_SCALE_TOO_LARGE;
    } else if (sagnac_image_work(image) > gyro->largest_work) {
        mismatch = SAGNAC_WORK_TOO_LARGE;
    } else {
        mismatch = SAGNAC_MATCHES;
    }
    return mismatch;
}

void sagnac_factory_defaults(const sagnac_gyro *gyro, sagnac_image *image)
{
    uint32_t i;
    sagnac_image_empty(image);
    for (i = 0U; i < 8U; i++) {
        image->serial[i] = gyro->serial[i];
    }
    image->axis = gyro->axis;
    image->tick_ns = (gyro->tick_ns > 0U) ? gyro->tick_ns : 1U;
    image->scale_factor_femto_arcsec = (gyro->scale_factor_femto_arcsec > 0U) ? gyro->scale_factor_femto_arcsec : 1U;
    image->quantum_nano_counts = (gyro->quantum_nano_counts > 0U) ? gyro->quantum_nano_counts : 1U;
    /* A serial number or axis that no image can hold. */
    if (sagnac_image_check(image) != SAGNAC_IMAGE_OK) {
        sagnac_image_empty(image);
    }
}
