/* Fringes counted from levels: see sagnac_quadrature.h. */
#include "sagnac_quadrature.h"

static uint32_t quarter_of(uint32_t a, uint32_t b)
{
    uint32_t quarter = 0U;
    if (a != 0U) {
        quarter = 1U;
    }
    if (b != 0U) {
        quarter = 3U - quarter;
    }
    return quarter;
}

/* 1 if the forward step onto this quarter counts, else 0. */
static int32_t quarter_counts(sagnac_counting counting, uint32_t onto)
{
    int32_t counts = 1;
    if ((counting == SAGNAC_X2) && ((onto % 2U) == 0U)) {
        counts = 0;
    }
    if ((counting == SAGNAC_X1) && (onto != 1U)) {
        counts = 0;
    }
    return counts;
}

void sagnac_quadrature_start(sagnac_quadrature *counter)
{
    counter->has_quarter = SAGNAC_NO;
    counter->quarter = 0U;
    counter->lost = 0U;
}

int32_t sagnac_quadrature_update(sagnac_quadrature *counter, sagnac_counting counting, uint32_t a, uint32_t b)
{
    const uint32_t quarter = quarter_of(a, b);
    const uint32_t before = counter->quarter;
    const uint32_t step = (counter->has_quarter != 0U) ? (((quarter + 4U) - before) % 4U) : 0U;
    int32_t counts = 0;
    counter->has_quarter = SAGNAC_YES;
    counter->quarter = quarter;
    if (step == 1U) {
        counts = quarter_counts(counting, quarter);
    } else if (step == 3U) {
        counts = -quarter_counts(counting, before);
    } else if ((step == 2U) && (counter->lost < UINT32_MAX)) {
        counter->lost++;
    } else {
        /* No step, or more lost ones than can be counted. */
    }
    return counts;
}
