/*
 * Memory that turned over by itself: checksums of a state and an image, and what a state can be.
 *
 *   sum <- rotate(sum xor word, 5) * 0x9E3779B1           over words of 32 bits
 *
 * Each step is a bijection of the sum, so every change within one word is found; a change of several words escapes once in 2^32. What only a
 * slow update changes has the sum. What changes every tick has bounds. Not found: an upset of the remainder below one count; in an image with
 * an output limit, one of what is held back; one of the increment while it slews, which the end of the slew shows.
 *
 * sagnac_board calls all of this. Use alone:
 *   after a slow update:       sum = sagnac_state_sum(&state)
 *   before the next:           if (sum != sagnac_state_sum(&state)) { sagnac_state_restart(&state); report it; }
 *   once a second, anywhere:   compare sagnac_image_sum(&image) with that of the image as it was loaded
 */
#ifndef SAGNAC_UPSET_H
#define SAGNAC_UPSET_H

#include <stdint.h>

#include "sagnac_compensator.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The sum of what only a slow update changes. */
uint32_t sagnac_state_sum(const sagnac_compensator_state *state);

/* The sum of an image: its head, and the inputs and terms that it has. */
uint32_t sagnac_image_sum(const sagnac_image *image);

/* SAGNAC_NO if what changes each tick is beyond what this image can make of it. */
uint32_t sagnac_state_is_plausible(const sagnac_image *image, const sagnac_compensator_state *state);

/* Goes on after an upset: as after sagnac_compensator_start_warm, with the part of a count that was not output yet. A slow update is due at
 * once. What an output limit held back is lost. */
void sagnac_state_restart(sagnac_compensator_state *state);

#ifdef __cplusplus
}
#endif

#endif
