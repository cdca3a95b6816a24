/*
 * SHA-256 (FIPS 180-4), which binds a bank's head to its image and names a key.
 *
 * Octet by octet, so that a machine whose char has 16 bits computes it too. Its cost, about 20,000 instructions for the longest
 * image, is paid at a start and at a store, never in a tick.
 */
#ifndef SAGNAC_HASH_H
#define SAGNAC_HASH_H

#include <stdint.h>

#include "sagnac_integer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SAGNAC_DIGEST 32U

/* A hash in the making: at most 2^28 octets. */
typedef struct {
    uint32_t state[8];
    uint32_t block[16];
    uint32_t length;
} sagnac_hash;

void sagnac_hash_start(sagnac_hash *hash);

void sagnac_hash_add(sagnac_hash *hash, const sagnac_octet *octets, uint32_t count);

/* The digest of all that was added; start again before the next. */
void sagnac_hash_end(sagnac_hash *hash, sagnac_octet digest[SAGNAC_DIGEST]);

#ifdef __cplusplus
}
#endif

#endif
