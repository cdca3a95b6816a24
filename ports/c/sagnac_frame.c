/* Frames of the serial line: see sagnac_frame.h. */
#include "sagnac_frame.h"

#define FRAME_HEAD 4U
#define FRAME_CRC 4U
/* The upper two bits of the kind are the axis. */
#define MOST_KIND 63U
#define AXIS_SHIFT 6U
/* The letter x; y and z follow it. Bit 5 makes a letter small. */
#define LETTER_X 120U
#define SMALL 32U
/* SG */
#define SYNC_FIRST 83U
#define SYNC_SECOND 71U

/* What the held octets begin. */
typedef enum { FRAME_WHOLE = 0, FRAME_MORE_NEEDED = 1, FRAME_NOT_HERE = 2 } frame_start;

uint32_t sagnac_axis_code(uint32_t letter)
{
    const uint32_t small = letter | SMALL;
    return ((letter > SMALL) && (small >= LETTER_X) && (small <= (LETTER_X + 2U))) ? ((small - LETTER_X) + 1U) : 0U;
}

uint32_t sagnac_frame_is_for(const sagnac_frame *frame, uint32_t letter)
{
    return ((frame->axis == 0U) || (frame->axis == sagnac_axis_code(letter))) ? SAGNAC_YES : SAGNAC_NO;
}

uint32_t sagnac_frame_octets(const sagnac_frame *frame, sagnac_octet octets[SAGNAC_MAX_FRAME])
{
    uint32_t length = frame->length;
    uint32_t i;
    if (length > SAGNAC_MAX_PAYLOAD) {
        length = SAGNAC_MAX_PAYLOAD;
    }
    octets[0] = SYNC_FIRST;
    octets[1] = SYNC_SECOND;
    octets[2] = (sagnac_octet)((frame->kind & MOST_KIND) | ((frame->axis & 3U) << AXIS_SHIFT));
    octets[3] = (sagnac_octet)length;
    for (i = 0U; i < length; i++) {
        octets[FRAME_HEAD + i] = frame->payload[i];
    }
    sagnac_write_u32(octets, FRAME_HEAD + length, sagnac_crc32(sagnac_octet_at, octets, 2U, 2U + length));
    return FRAME_HEAD + length + FRAME_CRC;
}

void sagnac_frame_start(sagnac_frame_reader *reader)
{
    reader->length = 0U;
    reader->skipped = 0U;
}

static void frame_drop(sagnac_frame_reader *reader, uint32_t count)
{
    uint32_t i;
    for (i = count; i < reader->length; i++) {
        reader->held[i - count] = reader->held[i];
    }
    reader->length -= count;
}

static void frame_skip(sagnac_frame_reader *reader)
{
    frame_drop(reader, 1U);
    if (reader->skipped < UINT32_MAX) {
        reader->skipped++;
    }
}

static frame_start frame_parse(const sagnac_frame_reader *reader, sagnac_frame *frame)
{
    const sagnac_octet *held = reader->held;
    frame_start found = FRAME_MORE_NEEDED;
    if ((held[0] != SYNC_FIRST) || ((reader->length > 1U) && (held[1] != SYNC_SECOND))) {
        found = FRAME_NOT_HERE;
    } else if ((reader->length >= FRAME_HEAD) && (held[3] > SAGNAC_MAX_PAYLOAD)) {
        found = FRAME_NOT_HERE;
    } else if ((reader->length >= FRAME_HEAD) && (reader->length >= (FRAME_HEAD + (uint32_t)held[3] + FRAME_CRC))) {
        const uint32_t length = held[3];
        uint32_t i;
        frame->kind = (uint32_t)held[2] & MOST_KIND;
        frame->axis = (uint32_t)held[2] >> AXIS_SHIFT;
        frame->length = length;
        for (i = 0U; i < length; i++) {
            frame->payload[i] = held[FRAME_HEAD + i];
        }
        found = (sagnac_crc32(sagnac_octet_at, held, 2U, 2U + length) == sagnac_read_u32(sagnac_octet_at, held, FRAME_HEAD + length))
                    ? FRAME_WHOLE
                    : FRAME_NOT_HERE;
    } else {
        found = FRAME_MORE_NEEDED;
    }
    return found;
}

/* The next whole frame of the buffer. */
static uint32_t frame_next(sagnac_frame_reader *reader, sagnac_frame *frame)
{
    frame_start found = FRAME_NOT_HERE;
    while ((reader->length > 0U) && (found == FRAME_NOT_HERE)) {
        found = frame_parse(reader, frame);
        if (found == FRAME_NOT_HERE) {
            frame_skip(reader);
        }
    }
    if (found == FRAME_WHOLE) {
        frame_drop(reader, FRAME_HEAD + frame->length + FRAME_CRC);
    }
    return (found == FRAME_WHOLE) ? SAGNAC_YES : SAGNAC_NO;
}

uint32_t sagnac_frame_push(sagnac_frame_reader *reader, uint32_t octet, sagnac_frame *frame)
{
    if (reader->length < SAGNAC_MAX_FRAME) {
        reader->held[reader->length] = (sagnac_octet)(octet & 0xFFU);
        reader->length++;
    }
    return frame_next(reader, frame);
}

uint32_t sagnac_frame_quiet(sagnac_frame_reader *reader, sagnac_frame *frame)
{
    uint32_t found = frame_next(reader, frame);
    while ((found == 0U) && (reader->length > 0U)) {
        frame_skip(reader);
        found = frame_next(reader, frame);
    }
    return found;
}
