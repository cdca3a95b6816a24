/* Dither stripping: see sagnac_strip.h. */
#include "sagnac_strip.h"

#define MOST_TICKS 65535U

static void strip_begin_stretch(sagnac_stripper *stripper)
{
    stripper->stretch = 0U;
    stripper->lowest = INT32_MAX;
    stripper->highest = INT32_MIN;
}

/* The swing of each half of `longest` ticks. */
static void strip_watch(sagnac_stripper *stripper, int32_t pickoff)
{
    if (pickoff < stripper->lowest) {
        stripper->lowest = pickoff;
    }
    if (pickoff > stripper->highest) {
        stripper->highest = pickoff;
    }
    stripper->stretch++;
    if (stripper->stretch >= ((stripper->longest + 1U) / 2U)) {
        const int64_t swing = (int64_t)stripper->highest - (int64_t)stripper->lowest;
        stripper->swings = (swing >= (int64_t)stripper->least_swing) ? SAGNAC_YES : SAGNAC_NO;
        strip_begin_stretch(stripper);
    }
}

/* part * share / whole, rounded down; 0 <= share < whole. */
static int64_t strip_share(int32_t part, int32_t share, int64_t whole)
{
    const int64_t product = (int64_t)part * (int64_t)share;
    int64_t result = product / whole;
    if ((product % whole) < 0) {
        result--;
    }
    return result;
}

void sagnac_stripper_start(sagnac_stripper *stripper, uint32_t longest, uint32_t least_swing)
{
    stripper->longest = longest;
    if (longest == 0U) {
        stripper->longest = 1U;
    }
    if (longest > MOST_TICKS) {
        stripper->longest = MOST_TICKS;
    }
    stripper->least_swing = least_swing;
    stripper->sum = 0;
    stripper->ticks = 0U;
    stripper->has_last = SAGNAC_NO;
    stripper->last = 0;
    stripper->swings = SAGNAC_YES;
    stripper->has_zeros = SAGNAC_YES;
    strip_begin_stretch(stripper);
}

uint32_t sagnac_stripper_update(sagnac_stripper *stripper, int32_t counts, int32_t pickoff, sagnac_stripped *stripped)
{
    const uint32_t zero = ((stripper->has_last != 0U) && (stripper->last < 0) && (pickoff >= 0)) ? SAGNAC_YES : SAGNAC_NO;
    const int32_t from = stripper->last;
    uint32_t ends = SAGNAC_NO;
    stripper->has_last = SAGNAC_YES;
    stripper->last = pickoff;
    strip_watch(stripper, pickoff);
    stripper->sum += (int64_t)counts;
    stripper->ticks++;
    if ((zero != 0U) || (stripper->ticks >= stripper->longest)) {
        const int64_t after = (zero != 0U) ? strip_share(counts, pickoff, (int64_t)pickoff - (int64_t)from) : 0;
        stripped->counts = stripper->sum - after;
        stripped->ticks = stripper->ticks;
        stripped->without_zero = (zero != 0U) ? SAGNAC_NO : SAGNAC_YES;
        stripper->has_zeros = zero;
        stripper->sum = after;
        stripper->ticks = 0U;
        ends = SAGNAC_YES;
    }
    return ends;
}

uint32_t sagnac_stripper_has_dither(const sagnac_stripper *stripper)
{
    return stripper->swings & stripper->has_zeros;
}
