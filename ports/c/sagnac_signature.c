/* The signature of an image: see sagnac_signature.h. */
#include "sagnac_signature.h"

#include "sagnac_hash.h"
#include "sagnac_integer.h"

/* Fields of a block. */
#define VERSION_AT 8U
#define COUNTER_AT 12U
#define KEY_ID_AT 16U
#define MODEL_AT 32U
#define SIGNED_HEAD 48U
#define BLOCK_VERSION 1U
#define DOMAIN 16U

static uint32_t trust_no_counter(void *context)
{
    (void)context;
    return 0U;
}

static void trust_no_raise(void *context, uint32_t to)
{
    (void)context;
    (void)to;
}

static uint32_t trust_no_verify(void *context, const sagnac_octet *public_key, const sagnac_octet *message, uint32_t length,
                                const sagnac_octet *signature)
{
    (void)context;
    (void)public_key;
    (void)message;
    (void)length;
    (void)signature;
    return SAGNAC_NO;
}

static void trust_no_challenge(void *context, sagnac_octet *challenge)
{
    uint32_t i;
    (void)context;
    for (i = 0U; i < SAGNAC_CHALLENGE; i++) {
        challenge[i] = 0U;
    }
}

static void trust_copy(sagnac_octet *to, uint32_t at, const sagnac_octet *from, uint32_t count)
{
    uint32_t i;
    for (i = 0U; i < count; i++) {
        to[at + i] = from[i];
    }
}

/* The first half of the SHA-256 of the key names it. */
static uint32_t trust_is_key(const sagnac_trust *trust, const sagnac_octet *id)
{
    sagnac_hash hash;
    sagnac_octet digest[SAGNAC_DIGEST];
    sagnac_hash_start(&hash);
    sagnac_hash_add(&hash, trust->public_key, 32U);
    sagnac_hash_end(&hash, digest);
    return sagnac_are_equal(digest, id, 16U);
}

/* Domain, head of the block, image; SAGNAC_NO for more octets than any image has. */
static uint32_t trust_message(const sagnac_octet *octets, uint32_t image_length, sagnac_octet *message)
{
    static const sagnac_octet domain[DOMAIN] = {83U, 65U, 71U, 78U, 65U, 67U, 45U, 73U, 77U, 65U, 71U, 69U, 45U, 49U, 0U, 0U};
    uint32_t fits = SAGNAC_NO;
    if (image_length <= SAGNAC_MAX_IMAGE) {
        trust_copy(message, 0U, domain, DOMAIN);
        trust_copy(message, DOMAIN, &octets[image_length], SIGNED_HEAD);
        trust_copy(message, DOMAIN + SIGNED_HEAD, octets, image_length);
        fits = SAGNAC_YES;
    }
    return fits;
}

/* Everything that a key asks of a block; `block` is what follows the image. */
static sagnac_trust_error trust_check_block(const sagnac_trust *trust, const sagnac_octet *octets, uint32_t image_length,
                                            sagnac_octet *message)
{
    const sagnac_octet *block = &octets[image_length];
    sagnac_trust_error error = SAGNAC_TRUSTED;
    if (trust_is_key(trust, &block[KEY_ID_AT]) == 0U) {
        error = SAGNAC_OTHER_KEY;
    } else if (sagnac_are_equal(trust->model, &block[MODEL_AT], 16U) == 0U) {
        error = SAGNAC_OTHER_MODEL;
    } else if (sagnac_read_u32(sagnac_octet_at, block, COUNTER_AT) < trust->lowest_counter(trust->context)) {
        error = SAGNAC_OLD_COUNTER;
    } else if (trust_message(octets, image_length, message) == 0U) {
        error = SAGNAC_NOT_THE_SIGNATURE;
    } else if (trust->verify(trust->context, trust->public_key, message, DOMAIN + SIGNED_HEAD + image_length,
                             &block[SIGNED_HEAD]) == 0U) {
        error = SAGNAC_NOT_THE_SIGNATURE;
    } else {
        error = SAGNAC_TRUSTED;
    }
    return error;
}

void sagnac_trust_nobody(sagnac_trust *trust)
{
    uint32_t i;
    trust->context = (void *)0;
    trust->has_key = SAGNAC_NO;
    for (i = 0U; i < 32U; i++) {
        trust->public_key[i] = 0U;
    }
    for (i = 0U; i < 16U; i++) {
        trust->model[i] = 0U;
    }
    trust->lowest_counter = trust_no_counter;
    trust->raise_lowest_counter = trust_no_raise;
    trust->verify = trust_no_verify;
    trust->challenge = trust_no_challenge;
}

sagnac_trust_error sagnac_trust_check(const sagnac_trust *trust, const sagnac_octet *octets, uint32_t length,
                                      sagnac_octet *message, sagnac_trusted *trusted)
{
    /* SAGNACSG */
    static const sagnac_octet magic[8] = {83U, 65U, 71U, 78U, 65U, 67U, 83U, 71U};
    sagnac_trust_error error = SAGNAC_TRUSTED;
    uint32_t has_block = SAGNAC_NO;
    trusted->image_length = length;
    trusted->has_counter = SAGNAC_NO;
    trusted->counter = 0U;
    if (length >= SAGNAC_SIGNATURE_LENGTH) {
        has_block = sagnac_are_equal(magic, &octets[length - SAGNAC_SIGNATURE_LENGTH], 8U);
    }
    if (has_block != 0U) {
        const uint32_t at = length - SAGNAC_SIGNATURE_LENGTH;
        trusted->image_length = at;
        if ((sagnac_read_u16(sagnac_octet_at, &octets[at], VERSION_AT) != BLOCK_VERSION) ||
            (sagnac_read_u16(sagnac_octet_at, &octets[at], VERSION_AT + 2U) != 0U)) {
            error = SAGNAC_SIGNATURE_BLOCK;
        } else if (trust->has_key != 0U) {
            trusted->has_counter = SAGNAC_YES;
            trusted->counter = sagnac_read_u32(sagnac_octet_at, &octets[at], COUNTER_AT);
            error = trust_check_block(trust, octets, at, message);
        } else {
            /* A board without a key ignores the block. */
        }
    } else if (trust->has_key != 0U) {
        error = SAGNAC_UNSIGNED;
    } else {
        /* Neither a key nor a block. */
    }
    return error;
}

uint32_t sagnac_trust_answer(const sagnac_trust *trust, const sagnac_gyro *gyro, uint32_t change, const sagnac_octet *challenge,
                             const sagnac_octet *signature, sagnac_octet *message)
{
    /* SAGNAC-SERVICE-2 */
    static const sagnac_octet domain[DOMAIN] = {83U, 65U, 71U, 78U, 65U, 67U, 45U, 83U, 69U, 82U, 86U, 73U, 67U, 69U, 45U, 50U};
    uint32_t i;
    trust_copy(message, 0U, domain, DOMAIN);
    for (i = 0U; i < 8U; i++) {
        sagnac_write_u32(message, DOMAIN + (4U * i), gyro->serial[i]);
    }
    message[48] = (sagnac_octet)(gyro->axis & 0xFFU);
    message[49] = (sagnac_octet)(change & 0xFFU);
    trust_copy(message, 50U, challenge, SAGNAC_CHALLENGE);
    return trust->verify(trust->context, trust->public_key, message, 50U + SAGNAC_CHALLENGE, signature);
}
