/* SHA-256: see sagnac_hash.h. */
#include "sagnac_hash.h"

#define ROUNDS 64U
#define BLOCK 64U

static uint32_t hash_turn(uint32_t word, uint32_t by)
{
    return (word >> by) | (word << (32U - by));
}

/* The word of round `i`; the schedule needs the last sixteen only. */
static uint32_t hash_word(uint32_t schedule[16], uint32_t i)
{
    if (i >= 16U) {
        const uint32_t early = schedule[(i + 1U) % 16U];
        const uint32_t late = schedule[(i + 14U) % 16U];
        const uint32_t small0 = hash_turn(early, 7U) ^ hash_turn(early, 18U) ^ (early >> 3);
        const uint32_t small1 = hash_turn(late, 17U) ^ hash_turn(late, 19U) ^ (late >> 10);
        schedule[i % 16U] += small0 + schedule[(i + 9U) % 16U] + small1;
    }
    return schedule[i % 16U];
}

static void hash_block(sagnac_hash *hash)
{
    static const uint32_t constants[ROUNDS] = {
        0x428A2F98U, 0x71374491U, 0xB5C0FBCFU, 0xE9B5DBA5U, 0x3956C25BU, 0x59F111F1U, 0x923F82A4U, 0xAB1C5ED5U,
        0xD807AA98U, 0x12835B01U, 0x243185BEU, 0x550C7DC3U, 0x72BE5D74U, 0x80DEB1FEU, 0x9BDC06A7U, 0xC19BF174U,
        0xE49B69C1U, 0xEFBE4786U, 0x0FC19DC6U, 0x240CA1CCU, 0x2DE92C6FU, 0x4A7484AAU, 0x5CB0A9DCU, 0x76F988DAU,
        0x983E5152U, 0xA831C66DU, 0xB00327C8U, 0xBF597FC7U, 0xC6E00BF3U, 0xD5A79147U, 0x06CA6351U, 0x14292967U,
        0x27B70A85U, 0x2E1B2138U, 0x4D2C6DFCU, 0x53380D13U, 0x650A7354U, 0x766A0ABBU, 0x81C2C92EU, 0x92722C85U,
        0xA2BFE8A1U, 0xA81A664BU, 0xC24B8B70U, 0xC76C51A3U, 0xD192E819U, 0xD6990624U, 0xF40E3585U, 0x106AA070U,
        0x19A4C116U, 0x1E376C08U, 0x2748774CU, 0x34B0BCB5U, 0x391C0CB3U, 0x4ED8AA4AU, 0x5B9CCA4FU, 0x682E6FF3U,
        0x748F82EEU, 0x78A5636FU, 0x84C87814U, 0x8CC70208U, 0x90BEFFFAU, 0xA4506CEBU, 0xBEF9A3F7U, 0xC67178F2U};
    uint32_t v[8];
    uint32_t i;
    uint32_t j;
    for (i = 0U; i < 8U; i++) {
        v[i] = hash->state[i];
    }
    for (i = 0U; i < ROUNDS; i++) {
        const uint32_t sum1 = hash_turn(v[4], 6U) ^ hash_turn(v[4], 11U) ^ hash_turn(v[4], 25U);
        const uint32_t choice = (v[4] & v[5]) ^ ((v[4] ^ 0xFFFFFFFFU) & v[6]);
        const uint32_t first = v[7] + sum1 + choice + constants[i] + hash_word(hash->block, i);
        const uint32_t sum0 = hash_turn(v[0], 2U) ^ hash_turn(v[0], 13U) ^ hash_turn(v[0], 22U);
        const uint32_t majority = (v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]);
        for (j = 7U; j > 0U; j--) {
            v[j] = v[j - 1U];
        }
        v[4] += first;
        v[0] = first + sum0 + majority;
    }
    for (i = 0U; i < 8U; i++) {
        hash->state[i] += v[i];
    }
    for (i = 0U; i < 16U; i++) {
        hash->block[i] = 0U;
    }
}

static void hash_octet(sagnac_hash *hash, uint32_t octet)
{
    const uint32_t at = hash->length % BLOCK;
    hash->block[at / 4U] |= octet << (24U - (8U * (at % 4U)));
    hash->length++;
    if ((hash->length % BLOCK) == 0U) {
        hash_block(hash);
    }
}

void sagnac_hash_start(sagnac_hash *hash)
{
    static const uint32_t first[8] = {0x6A09E667U, 0xBB67AE85U, 0x3C6EF372U, 0xA54FF53AU,
                                      0x510E527FU, 0x9B05688CU, 0x1F83D9ABU, 0x5BE0CD19U};
    uint32_t i;
    for (i = 0U; i < 8U; i++) {
        hash->state[i] = first[i];
    }
    for (i = 0U; i < 16U; i++) {
        hash->block[i] = 0U;
    }
    hash->length = 0U;
}

void sagnac_hash_add(sagnac_hash *hash, const sagnac_octet *octets, uint32_t count)
{
    uint32_t i;
    for (i = 0U; i < count; i++) {
        hash_octet(hash, (uint32_t)octets[i] & 0xFFU);
    }
}

void sagnac_hash_end(sagnac_hash *hash, sagnac_octet digest[SAGNAC_DIGEST])
{
    const uint32_t bits = hash->length * 8U;
    uint32_t i;
    hash_octet(hash, 0x80U);
    while ((hash->length % BLOCK) != 56U) {
        hash_octet(hash, 0U);
    }
    /* The upper half of the length is zero. */
    for (i = 0U; i < 4U; i++) {
        hash_octet(hash, 0U);
    }
    for (i = 0U; i < 4U; i++) {
        hash_octet(hash, (bits >> (24U - (8U * i))) & 0xFFU);
    }
    for (i = 0U; i < SAGNAC_DIGEST; i++) {
        digest[i] = (sagnac_octet)((hash->state[i / 4U] >> (24U - (8U * (i % 4U)))) & 0xFFU);
    }
}
