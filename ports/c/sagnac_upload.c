/* A new image over the serial line: see sagnac_upload.h. */
#include "sagnac_upload.h"

#include "sagnac_integer.h"

#define PIECE_HEAD 2U
#define PIECE_MOST 60U
#define COMMIT_PAYLOAD 3U
#define ANSWER_PAYLOAD 64U
#define REPLY_PAYLOAD 7U

uint32_t sagnac_image_code(sagnac_origin origin, uint32_t trial)
{
    uint32_t code = 0U;
    if (origin == SAGNAC_ONLY_SURVIVOR) {
        code = 1U;
    }
    if (origin == SAGNAC_FACTORY_DEFAULTS) {
        code = 2U;
    }
    if (trial != 0U) {
        code |= 4U;
    }
    return code;
}

void sagnac_reply(uint32_t to, sagnac_reply_code code, const sagnac_loaded *loaded, sagnac_frame *frame)
{
    frame->kind = SAGNAC_KIND_REPLY;
    frame->axis = sagnac_axis_code(loaded->image.axis);
    frame->length = REPLY_PAYLOAD;
    frame->payload[0] = (sagnac_octet)(to & 0xFFU);
    frame->payload[1] = (sagnac_octet)code;
    sagnac_write_u32(frame->payload, 2U, loaded->image.sequence);
    frame->payload[6] = (sagnac_octet)sagnac_image_code(loaded->origin, loaded->trial);
}

void sagnac_upload_start(sagnac_upload *upload, const sagnac_trust *trust)
{
    uint32_t i;
    upload->trust = trust;
    upload->service = SAGNAC_SERVICE_CLOSED;
    upload->service_change = 0U;
    upload->service_seconds_left = 0U;
    for (i = 0U; i < SAGNAC_CHALLENGE; i++) {
        upload->challenge[i] = 0U;
    }
    for (i = 0U; i < SAGNAC_MAX_SIGNED; i++) {
        upload->octets[i] = 0U;
    }
}

void sagnac_upload_power_on(sagnac_upload *upload)
{
    upload->service = SAGNAC_SERVICE_CLOSED;
}

void sagnac_upload_second(sagnac_upload *upload)
{
    if (upload->service_seconds_left > 0U) {
        upload->service_seconds_left--;
    }
    if (upload->service_seconds_left == 0U) {
        upload->service = SAGNAC_SERVICE_CLOSED;
    }
}

static sagnac_reply_code upload_answer(sagnac_upload *upload, const sagnac_octet *signature, const sagnac_gyro *gyro)
{
    sagnac_reply_code code = SAGNAC_REPLY_LOCKED;
    if ((upload->trust->has_key != 0U) && (upload->service == SAGNAC_SERVICE_ASKED)) {
        if (sagnac_trust_answer(upload->trust, gyro, upload->service_change, upload->challenge, signature, upload->message) != 0U) {
            upload->service = SAGNAC_SERVICE_OPEN;
            code = SAGNAC_REPLY_DONE;
        } else {
            /* One try a challenge. */
            upload->service = SAGNAC_SERVICE_CLOSED;
            code = SAGNAC_REPLY_BAD_SIGNATURE;
        }
    }
    return code;
}

static sagnac_reply_code upload_keep(sagnac_upload *upload, const sagnac_frame *frame)
{
    const uint32_t offset = sagnac_read_u16(sagnac_octet_at, frame->payload, 0U);
    const uint32_t count = frame->length - PIECE_HEAD;
    sagnac_reply_code code = SAGNAC_REPLY_BAD_PIECE;
    if ((offset + count) <= SAGNAC_MAX_SIGNED) {
        uint32_t i;
        for (i = 0U; i < count; i++) {
            upload->octets[offset + i] = frame->payload[PIECE_HEAD + i];
        }
        code = SAGNAC_REPLY_DONE;
    }
    return code;
}

static sagnac_reply_code upload_of_store(sagnac_store_result result)
{
    sagnac_reply_code code = SAGNAC_REPLY_FLASH;
    switch (result) {
    case SAGNAC_STORE_DONE:
        code = SAGNAC_REPLY_DONE;
        break;
    case SAGNAC_STORE_NO_IMAGE:
        code = SAGNAC_REPLY_NOT_AN_IMAGE;
        break;
    case SAGNAC_STORE_MISMATCH:
        code = SAGNAC_REPLY_MISMATCH;
        break;
    case SAGNAC_STORE_NOT_NEWER:
        code = SAGNAC_REPLY_NOT_NEWER;
        break;
    case SAGNAC_STORE_NO_OLDER_IMAGE:
        code = SAGNAC_REPLY_NO_OLDER_IMAGE;
        break;
    case SAGNAC_STORE_NOT_ON_TRIAL:
        code = SAGNAC_REPLY_NOT_ON_TRIAL;
        break;
    case SAGNAC_STORE_ON_TRIAL:
        code = SAGNAC_REPLY_ON_TRIAL;
        break;
    case SAGNAC_STORE_NO_FREE_NOTE:
    case SAGNAC_STORE_READ_BACK:
    case SAGNAC_STORE_FLASH:
    default:
        code = SAGNAC_REPLY_FLASH;
        break;
    }
    return code;
}

static sagnac_reply_code upload_of_trust(sagnac_trust_error error)
{
    sagnac_reply_code code = SAGNAC_REPLY_BAD_SIGNATURE;
    if (error == SAGNAC_UNSIGNED) {
        code = SAGNAC_REPLY_UNSIGNED;
    }
    if (error == SAGNAC_OTHER_MODEL) {
        code = SAGNAC_REPLY_MISMATCH;
    }
    if (error == SAGNAC_OLD_COUNTER) {
        code = SAGNAC_REPLY_NOT_NEWER;
    }
    return code;
}

static sagnac_reply_code upload_commit(sagnac_upload *upload, const sagnac_frame *frame, sagnac_banks *banks,
                                       const sagnac_gyro *gyro)
{
    const uint32_t length = sagnac_read_u16(sagnac_octet_at, frame->payload, 0U);
    const sagnac_trust *trust = upload->trust;
    sagnac_reply_code code = SAGNAC_REPLY_BAD_PIECE;
    if (length <= SAGNAC_MAX_SIGNED) {
        sagnac_trusted trusted;
        const sagnac_trust_error error = sagnac_trust_check(trust, upload->octets, length, upload->message, &trusted);
        if (error != SAGNAC_TRUSTED) {
            code = upload_of_trust(error);
        } else {
            sagnac_store_result stored = sagnac_banks_check(banks, gyro, upload->octets, trusted.image_length);
            if (stored == SAGNAC_STORE_DONE) {
                if ((trusted.has_counter != 0U) && (trusted.counter > trust->lowest_counter(trust->context))) {
                    trust->raise_lowest_counter(trust->context, trusted.counter);
                }
                stored = sagnac_banks_store(banks, gyro, upload->octets, trusted.image_length, (uint32_t)frame->payload[2]);
            }
            code = upload_of_store(stored);
        }
    }
    return code;
}

/* A kind that is handled here, with a payload that it has. */
static uint32_t upload_knows(const sagnac_frame *frame)
{
    uint32_t knows = SAGNAC_NO;
    switch (frame->kind) {
    case SAGNAC_KIND_PIECE:
        knows = ((frame->length >= PIECE_HEAD) && (frame->length <= (PIECE_HEAD + PIECE_MOST))) ? SAGNAC_YES : SAGNAC_NO;
        break;
    case SAGNAC_KIND_COMMIT:
        knows = ((frame->length == COMMIT_PAYLOAD) && (frame->payload[2] <= 1U)) ? SAGNAC_YES : SAGNAC_NO;
        break;
    case SAGNAC_KIND_ANSWER:
        knows = (frame->length == ANSWER_PAYLOAD) ? SAGNAC_YES : SAGNAC_NO;
        break;
    case SAGNAC_KIND_ROLL_BACK:
    case SAGNAC_KIND_CONFIRM:
        knows = (frame->length == 0U) ? SAGNAC_YES : SAGNAC_NO;
        break;
    case SAGNAC_KIND_SERVICE:
        knows = ((frame->length == 1U) && (frame->payload[0] >= SAGNAC_KIND_COMMIT) && (frame->payload[0] <= SAGNAC_KIND_CONFIRM))
                    ? SAGNAC_YES
                    : SAGNAC_NO;
        break;
    default:
        knows = SAGNAC_NO;
        break;
    }
    return knows;
}

/* Without a key the line is open to every frame; with one, to the pieces and the frame of the change that was answered for. */
static uint32_t upload_is_open(const sagnac_upload *upload, uint32_t kind)
{
    uint32_t is_open = SAGNAC_YES;
    if (upload->trust->has_key != 0U) {
        const uint32_t change = (kind == SAGNAC_KIND_PIECE) ? SAGNAC_KIND_COMMIT : kind;
        is_open = ((upload->service == SAGNAC_SERVICE_OPEN) && (change == upload->service_change)) ? SAGNAC_YES : SAGNAC_NO;
    }
    return is_open;
}

/* A change, once the line is open to it. */
static sagnac_reply_code upload_change(sagnac_upload *upload, const sagnac_frame *frame, sagnac_banks *banks,
                                       const sagnac_gyro *gyro)
{
    sagnac_reply_code code;
    if (frame->kind == SAGNAC_KIND_COMMIT) {
        code = upload_commit(upload, frame, banks, gyro);
    } else if (frame->kind == SAGNAC_KIND_CONFIRM) {
        code = upload_of_store(sagnac_banks_confirm(banks, gyro));
    } else {
        code = upload_of_store(sagnac_banks_roll_back(banks, gyro));
    }
    if (code == SAGNAC_REPLY_DONE) {
        upload->service = SAGNAC_SERVICE_CLOSED;
    }
    return code;
}

static void upload_challenge(sagnac_upload *upload, uint32_t change, uint32_t letter, sagnac_frame *answer)
{
    uint32_t i;
    upload->service_change = change;
    upload->service_seconds_left = SAGNAC_SERVICE_S;
    upload->trust->challenge(upload->trust->context, upload->challenge);
    upload->service = SAGNAC_SERVICE_ASKED;
    answer->kind = SAGNAC_KIND_CHALLENGE;
    answer->axis = sagnac_axis_code(letter);
    answer->length = SAGNAC_CHALLENGE;
    for (i = 0U; i < SAGNAC_CHALLENGE; i++) {
        answer->payload[i] = upload->challenge[i];
    }
}

void sagnac_upload_handle(sagnac_upload *upload, const sagnac_frame *frame, sagnac_banks *banks, const sagnac_gyro *gyro,
                          sagnac_loaded *loaded, sagnac_handled *handled)
{
    handled->handled = (sagnac_frame_is_for(frame, gyro->axis) != 0U) ? upload_knows(frame) : SAGNAC_NO;
    handled->changed = SAGNAC_NO;
    if (handled->handled == 0U) {
        /* A frame for somebody else. */
    } else if ((frame->kind == SAGNAC_KIND_SERVICE) && (upload->trust->has_key != 0U)) {
        upload_challenge(upload, (uint32_t)frame->payload[0], gyro->axis, &handled->answer);
    } else {
        sagnac_reply_code code = SAGNAC_REPLY_DONE;
        if (frame->kind == SAGNAC_KIND_ANSWER) {
            code = upload_answer(upload, frame->payload, gyro);
        } else if (frame->kind == SAGNAC_KIND_SERVICE) {
            /* Without a key the line is open. */
        } else if (upload_is_open(upload, frame->kind) == 0U) {
            code = SAGNAC_REPLY_LOCKED;
        } else if (frame->kind == SAGNAC_KIND_PIECE) {
            code = upload_keep(upload, frame);
        } else {
            code = upload_change(upload, frame, banks, gyro);
            /* Whatever the code: a failed step may still have changed the active image. */
            handled->changed = SAGNAC_YES;
            sagnac_banks_load(banks, gyro, loaded);
        }
        sagnac_reply(frame->kind, code, loaded, &handled->answer);
    }
}
