/*
 * Frames of the serial line, and the messages that a gyro sends.
 *
 *   0     2      3      4                4 + n       + 4
 *   | SG  | kind | n    | payload        | CRC-32    |     n at most 64, little-endian; docs/reference/serial-line.md
 *
 * The upper two bits of the kind are the axis. The checksum covers kind, length and payload. Where the octets are no frame the reader skips one and looks for the next SG, so that
 * lost or added octets cost only the frames that they hit. Only the checksum detects a damaged frame: one in 2^32 passes by chance.
 */
#ifndef SAGNAC_FRAME_H
#define SAGNAC_FRAME_H

#include <stdint.h>

#include "sagnac_integer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SAGNAC_MAX_PAYLOAD 64U
#define SAGNAC_MAX_FRAME 72U

/* Made by `cargo xtask bless serial-line`; do not edit. */
/* Kinds of frames. From the gyro: */
#define SAGNAC_KIND_OUTPUT 0x01U
#define SAGNAC_KIND_REPLY 0x02U
#define SAGNAC_KIND_CHALLENGE 0x03U
/* To the gyro: */
#define SAGNAC_KIND_PIECE 0x20U
#define SAGNAC_KIND_COMMIT 0x21U
#define SAGNAC_KIND_ROLL_BACK 0x22U
#define SAGNAC_KIND_CONFIRM 0x23U
#define SAGNAC_KIND_SERVICE 0x24U
#define SAGNAC_KIND_ANSWER 0x25U
/* End of the kinds. */

typedef struct {
    uint32_t kind;
    uint32_t axis; /* that it comes from or goes to: 1, 2, 3 for x, y, z; 0 for another one, or for every gyro of the line */
    uint32_t length;
    sagnac_octet payload[SAGNAC_MAX_PAYLOAD];
} sagnac_frame;

/* Finds frames in a stream of octets. */
typedef struct {
    sagnac_octet held[SAGNAC_MAX_FRAME];
    uint32_t length;
    uint32_t skipped; /* octets that belonged to no frame; stays at its largest value */
} sagnac_frame_reader;

/* The axis of a frame from its letter. */
uint32_t sagnac_axis_code(uint32_t letter);

/* SAGNAC_YES for a frame that a gyro of this axis reads. */
uint32_t sagnac_frame_is_for(const sagnac_frame *frame, uint32_t letter);

/* The octets of a frame; how many. */
uint32_t sagnac_frame_octets(const sagnac_frame *frame, sagnac_octet octets[SAGNAC_MAX_FRAME]);

void sagnac_frame_start(sagnac_frame_reader *reader);

/* One octet; SAGNAC_YES if a frame ends with it. */
uint32_t sagnac_frame_push(sagnac_frame_reader *reader, uint32_t octet, sagnac_frame *frame);

/* After the line has been quiet for longer than a sender pauses within a frame: what is held belongs to no frame. Whole frames that a
 * damaged one held back come now, one a call; call it until SAGNAC_NO. */
uint32_t sagnac_frame_quiet(sagnac_frame_reader *reader, sagnac_frame *frame);

#ifdef __cplusplus
}
#endif

#endif
