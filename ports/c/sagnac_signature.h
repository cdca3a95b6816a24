/*
 * The signature of an image: what is signed, and what a board asks of it.
 *
 *   0        8          12         16          32        48              112
 *   | magic  | version  | counter  | key id    | model   | signature      |     after the last octet of the image
 *   signed: "SAGNAC-IMAGE-1" padded to 16 octets, octets 0 to 48 of the block, all octets of the image
 *
 * Octet for octet the Rust crate sagnac-core. The arithmetic of Ed25519 (RFC 8032) comes from a library of the board's, behind
 * sagnac_trust.verify; any that refuses keys and signatures which are not canonical will do. It is asked once, when an image arrives.
 */
#ifndef SAGNAC_SIGNATURE_H
#define SAGNAC_SIGNATURE_H

#include <stdint.h>

#include "sagnac_compensator.h"
#include "sagnac_identity.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SAGNAC_SIGNATURE_LENGTH 112U
/* Longest image with its signature, and the longest message that is signed. */
#define SAGNAC_MAX_SIGNED 884U
#define SAGNAC_MAX_MESSAGE 836U
#define SAGNAC_CHALLENGE 16U

/* What a board trusts. Fuses, one-time-programmable memory and a source of random numbers stand behind the functions. */
typedef struct {
    void *context;
    uint32_t has_key; /* SAGNAC_NO: this board takes unsigned images, and none of the rest is used */
    sagnac_octet public_key[32];
    sagnac_octet model[16]; /* type of the gyro, UTF-8, padded with zero octets */
    uint32_t (*lowest_counter)(void *context);
    /* Before an image with this counter is stored. A board that cannot keep one does nothing. */
    void (*raise_lowest_counter)(void *context, uint32_t to);
    /* SAGNAC_YES if the 64 octets of `signature` are the key's for this message. */
    uint32_t (*verify)(void *context, const sagnac_octet *public_key, const sagnac_octet *message, uint32_t length,
                       const sagnac_octet *signature);
    /* 16 new random octets. */
    void (*challenge)(void *context, sagnac_octet *challenge);
} sagnac_trust;

/* Why a signature is refused, the cheapest check first. */
typedef enum {
    SAGNAC_TRUSTED = 0,
    SAGNAC_SIGNATURE_BLOCK = 1, /* a block of an unknown version, or damaged */
    SAGNAC_UNSIGNED = 2,
    SAGNAC_OTHER_KEY = 3,
    SAGNAC_OTHER_MODEL = 4,
    SAGNAC_OLD_COUNTER = 5,
    SAGNAC_NOT_THE_SIGNATURE = 6
} sagnac_trust_error;

/* Octets that arrived as an image, split. */
typedef struct {
    uint32_t image_length;
    uint32_t has_counter; /* signed, on a board with a key */
    uint32_t counter;
} sagnac_trusted;

/* A board without a key. */
void sagnac_trust_nobody(sagnac_trust *trust);

/* Checks `length` octets, with or without a block. `message` is room for SAGNAC_MAX_MESSAGE octets. What is trusted still has to be
 * read as an image. */
sagnac_trust_error sagnac_trust_check(const sagnac_trust *trust, const sagnac_octet *octets, uint32_t length,
                                      sagnac_octet *message, sagnac_trusted *trusted);

/* SAGNAC_YES if this is the signature of a challenge for this gyro and this change (the kind of its frame). `message` as above. */
uint32_t sagnac_trust_answer(const sagnac_trust *trust, const sagnac_gyro *gyro, uint32_t change, const sagnac_octet *challenge,
                             const sagnac_octet *signature, sagnac_octet *message);

#ifdef __cplusplus
}
#endif

#endif
