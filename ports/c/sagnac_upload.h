/*
 * A new image over the serial line: pieces, then a commit; a confirmation; or a roll back to the image before.
 *
 *   board without a key:   pieces -> commit -> an image, for this gyro, newer -> stored -> in use between two ticks
 *   board with a key:      service -> challenge -> answer -> pieces -> commit -> signature -> ... as above
 *
 * Octet for octet the Rust crate sagnac-board. Pieces may arrive in any order and more than once; a refused commit changes neither the
 * active image nor the received pieces. With a key, one answer opens the service mode for the change that it names: a commit, a
 * confirmation or a roll back. The mode closes when that is done, SAGNAC_SERVICE_S after the challenge, and at power-off. The counter of a
 * signed image is raised before its store: after a cut in between the same upload can be sent again.
 *
 * A store erases flash and a signature takes milliseconds: call it from the main loop, not from the tick. Pieces, challenges and answers
 * do not read the flash.
 */
#ifndef SAGNAC_UPLOAD_H
#define SAGNAC_UPLOAD_H

#include <stdint.h>

#include "sagnac_banks.h"
#include "sagnac_frame.h"
#include "sagnac_signature.h"

#ifdef __cplusplus
extern "C" {
#endif

/* From the challenge on the service mode lasts so long, s. */
#define SAGNAC_SERVICE_S 120U

/* Results in a reply. */
typedef enum {
    SAGNAC_REPLY_DONE = 0,
    SAGNAC_REPLY_NOT_AN_IMAGE = 1,
    SAGNAC_REPLY_MISMATCH = 2,
    SAGNAC_REPLY_NOT_NEWER = 3,
    SAGNAC_REPLY_NO_OLDER_IMAGE = 4,
    SAGNAC_REPLY_FLASH = 5,
    SAGNAC_REPLY_BAD_PIECE = 6,
    SAGNAC_REPLY_LOCKED = 7,
    SAGNAC_REPLY_UNSIGNED = 8,
    SAGNAC_REPLY_BAD_SIGNATURE = 9,
    SAGNAC_REPLY_NOT_ON_TRIAL = 10,
    SAGNAC_REPLY_ON_TRIAL = 11 /* an image is on trial over a confirmed one, which another upload would erase */
} sagnac_reply_code;

/* The service mode of a board with a key. */
typedef enum { SAGNAC_SERVICE_CLOSED = 0, SAGNAC_SERVICE_ASKED = 1, SAGNAC_SERVICE_OPEN = 2 } sagnac_service;

/* The image in pieces, and the state of the service mode; keep it in static memory. */
typedef struct {
    const sagnac_trust *trust;
    sagnac_service service;
    uint32_t service_change; /* the kind of the frame that it was asked for */
    uint32_t service_seconds_left;
    sagnac_octet challenge[SAGNAC_CHALLENGE];
    sagnac_octet octets[SAGNAC_MAX_SIGNED];
    sagnac_octet message[SAGNAC_MAX_MESSAGE];
} sagnac_upload;

/* What a frame asked for. */
typedef struct {
    uint32_t handled;    /* SAGNAC_NO: a frame of another kind or of a wrong length; nothing to send */
    sagnac_frame answer; /* to send: a reply or a challenge */
    uint32_t changed;    /* the active image may have changed: give `loaded` to the board between two ticks */
} sagnac_handled;

/* Empty, with the service mode closed. The trust stays the caller's. */
void sagnac_upload_start(sagnac_upload *upload, const sagnac_trust *trust);

/* Power-on: closes the service mode; what was received stays. */
void sagnac_upload_power_on(sagnac_upload *upload);

/* A second has passed: call it once a second. The service mode ends by itself. */
void sagnac_upload_second(sagnac_upload *upload);

/* Handles a frame about images. `loaded` is what sagnac_banks_start gave; after a frame with `changed` it is what flash holds then. */
void sagnac_upload_handle(sagnac_upload *upload, const sagnac_frame *frame, sagnac_banks *banks, const sagnac_gyro *gyro,
                          sagnac_loaded *loaded, sagnac_handled *handled);

/* The reply to a frame of this kind, 0 for the one at power-on. */
void sagnac_reply(uint32_t to, sagnac_reply_code code, const sagnac_loaded *loaded, sagnac_frame *frame);

/* 0 newest, 1 survivor, 2 factory defaults; 4 more on trial. */
uint32_t sagnac_image_code(sagnac_origin origin, uint32_t trial);

#ifdef __cplusplus
}
#endif

#endif
