/*
 * A whole board in C on a rig: octets of the serial line in, octets out, to be compared with those of the Rust program.
 *
 *   check_line IMAGE LOOPS IN OUT [KEY]
 *
 * The gyro is that of the image, with four times its limits. The board begins with empty banks and with the rig at rest. KEY, with
 * -DWITH_KEY and libsodium: a file of the public key (32 octets) and the model (16); the lowest counter is 1, and the challenges are
 * 16 times 1, 2, 3 ... The rig replaces the gyro as crates/sagnac-board/src/rig.rs does; it is no part of the export.
 */
#include <stdio.h>
#include <string.h>

#include "sagnac_board.h"
#include "sagnac_quadrature.h"
#include "sagnac_upload.h"
#ifdef WITH_KEY
#include <sodium.h>
#endif

#define MOST 772U
#define FLASH 4096U
#define SECTOR 2048U
#define UNIT 8U
#define MOST_STEPS 4096
/* Longest dither period, ticks, and least swing of the rig's pickoff. */
#define LONGEST 50U
#define LEAST_SWING (UINT32_C(1) << 23)

typedef struct {
    uint32_t dither_counts, dither_step, curvature, lamp_gain;
    int32_t peak, peak_slope, wavelength;
    uint32_t lamp_lag, actuator_lag, noise_bits;
} settings;

typedef struct {
    settings s;
    uint32_t row_ticks, ticks_left, part, carried, phase, quarter, noise, present;
    int32_t whole, swing, codes[4];
    int64_t light_q16, at_q32;
} rig_state;

static unsigned char flash_octets[FLASH], programmed[FLASH / UNIT];
static sagnac_flash flash;
static sagnac_banks banks;
static sagnac_gyro gyro;
static sagnac_loaded loaded;
static sagnac_trust trust;
static sagnac_upload upload;
static sagnac_handled handled;
static sagnac_path_length path;
static sagnac_intensity light;
static sagnac_board board;
static sagnac_board_setup setup;
static sagnac_quadrature counter;
static sagnac_actuators actuators;
static rig_state rig;
static FILE *out;

static uint32_t flash_read(void *context, uint32_t offset, sagnac_octet *octets, uint32_t count)
{
    (void)context;
    if (offset > FLASH || count > FLASH - offset) {
        return SAGNAC_NO;
    }
    memcpy(octets, flash_octets + offset, count);
    return SAGNAC_YES;
}

static uint32_t flash_program(void *context, uint32_t offset, const sagnac_octet *octets, uint32_t count)
{
    uint32_t i;
    (void)context;
    if (offset % UNIT != 0U || count % UNIT != 0U || offset > FLASH || count > FLASH - offset) {
        return SAGNAC_NO;
    }
    for (i = 0U; i < count; i += UNIT) {
        if (programmed[(offset + i) / UNIT] != 0U) {
            return SAGNAC_NO;
        }
    }
    for (i = 0U; i < count; i++) {
        programmed[(offset + i) / UNIT] = 1U;
        flash_octets[offset + i] &= (unsigned char)octets[i];
    }
    return SAGNAC_YES;
}

static uint32_t flash_erase(void *context, uint32_t from, uint32_t to)
{
    (void)context;
    memset(flash_octets + from, 0xff, to - from);
    memset(programmed + from / UNIT, 0, (to - from) / UNIT);
    return SAGNAC_YES;
}

#ifdef WITH_KEY
static uint32_t lowest = 1U, challenges;

static uint32_t lowest_counter(void *context)
{
    (void)context;
    return lowest;
}

static void raise_counter(void *context, uint32_t to)
{
    (void)context;
    lowest = to;
}

static uint32_t verify(void *context, const sagnac_octet *key, const sagnac_octet *message, uint32_t length,
                       const sagnac_octet *signature)
{
    (void)context;
    return crypto_sign_verify_detached(signature, message, length, key) == 0 ? SAGNAC_YES : SAGNAC_NO;
}

static void challenge(void *context, sagnac_octet *octets)
{
    (void)context;
    challenges++;
    memset(octets, (int)(challenges & 255U), SAGNAC_CHALLENGE);
}

static int with_key(const char *name)
{
    FILE *file = fopen(name, "rb");
    trust.has_key = SAGNAC_YES;
    trust.lowest_counter = lowest_counter;
    trust.raise_lowest_counter = raise_counter;
    trust.verify = verify;
    trust.challenge = challenge;
    return file != NULL && sodium_init() >= 0 && fread(trust.public_key, 1, 32, file) == 32 && fread(trust.model, 1, 16, file) == 16;
}
#else
static int with_key(const char *name)
{
    (void)name;
    return 0;
}
#endif

static void send(const sagnac_frame *frame)
{
    sagnac_octet octets[SAGNAC_MAX_FRAME];
    const uint32_t count = sagnac_frame_octets(frame, octets);
    fwrite(octets, 1, count, out);
}

/* Floor of a quotient; the divisor is positive. */
static int64_t floor_of(int64_t value, int64_t by)
{
    const int64_t quotient = value / by;
    return value % by < 0 ? quotient - 1 : quotient;
}

static void start_row(const sagnac_frame *row)
{
    const int32_t counts = sagnac_read_i32(sagnac_octet_at, row->payload, 4U);
    uint32_t i;
    rig.row_ticks = sagnac_read_u32(sagnac_octet_at, row->payload, 0U);
    rig.ticks_left = rig.row_ticks;
    rig.carried = 0U;
    rig.whole = 0;
    rig.part = 0U;
    if (rig.row_ticks > 0U) {
        const int64_t whole = floor_of(counts, rig.row_ticks);
        rig.whole = (int32_t)whole;
        rig.part = (uint32_t)(counts - whole * (int64_t)rig.row_ticks);
    }
    rig.present = row->payload[8];
    for (i = 0U; i < 4U; i++) {
        rig.codes[i] = sagnac_read_i32(sagnac_octet_at, row->payload, 9U + 4U * i);
    }
}

static int64_t dither(int32_t *pickoff)
{
    int64_t p, y, swing, moved;
    *pickoff = 0;
    if (rig.s.dither_counts == 0U) {
        return 0;
    }
    rig.phase += rig.s.dither_step;
    p = rig.phase <= INT32_MAX ? (int64_t)rig.phase : (int64_t)rig.phase - (INT64_C(1) << 32);
    y = sagnac_floor_shift(p * ((INT64_C(1) << 31) - (p < 0 ? -p : p)), 31U);
    swing = sagnac_floor_shift((int64_t)rig.s.dither_counts * y, 29U);
    moved = swing - rig.swing;
    rig.swing = (int32_t)swing;
    *pickoff = (int32_t)sagnac_floor_shift(y, 4U);
    return moved;
}

static int32_t lamp(void)
{
    const int64_t wanted_lamp = (int64_t)actuators.current * (int64_t)rig.s.lamp_gain;
    const int64_t wanted = sagnac_q32(actuators.actuator - actuators.modulation);
    const int64_t wave = rig.s.wavelength > 1 ? rig.s.wavelength : 1;
    const uint32_t bits = rig.s.noise_bits < 20U ? rig.s.noise_bits : 20U;
    int64_t x, d, lost, shown, noise = 0;
    rig.light_q16 += sagnac_floor_shift(wanted_lamp - rig.light_q16, rig.s.lamp_lag < 31U ? rig.s.lamp_lag : 31U);
    rig.at_q32 += sagnac_floor_shift(wanted - rig.at_q32, rig.s.actuator_lag < 31U ? rig.s.actuator_lag : 31U);
    x = sagnac_floor_shift(rig.at_q32, 32U) + actuators.modulation - rig.s.peak -
        sagnac_floor_shift((int64_t)rig.codes[0] * (int64_t)rig.s.peak_slope, 40U);
    d = x - floor_of(x, wave) * wave;
    d = d > wave / 2 ? d - wave : d;
    lost = rig.s.curvature != 0U && d * d > INT64_MAX / (int64_t)rig.s.curvature ? INT64_MAX : d * d * (int64_t)rig.s.curvature;
    lost = sagnac_held(sagnac_floor_shift(lost, 32U), 0, 65536);
    shown = sagnac_held(sagnac_floor_shift(rig.light_q16, 16U), 0, 1 << 24);
    rig.noise = rig.noise * UINT32_C(1664525) + UINT32_C(1013904223);
    if (bits > 0U) {
        noise = (int64_t)(rig.noise >> (32U - bits)) - (INT64_C(1) << (bits - 1U));
    }
    return (int32_t)(sagnac_floor_shift(shown * (65536 - lost), 16U) + noise);
}

/* The counts of the steps from quarter to quarter. */
static int32_t counted(int64_t quarter_steps)
{
    int32_t counts = 0;
    int64_t left = quarter_steps;
    while (left != 0) {
        const uint32_t forward = left > 0 ? 1U : 3U;
        rig.quarter = (rig.quarter + forward) & 3U;
        counts += sagnac_quadrature_update(&counter, SAGNAC_X4, rig.quarter == 1U || rig.quarter == 2U,
                                           rig.quarter == 2U || rig.quarter == 3U);
        left += left > 0 ? -1 : 1;
    }
    return counts;
}

static void tick(void)
{
    const uint64_t carried = (uint64_t)rig.carried + rig.part;
    int64_t quarter_steps = rig.whole;
    sagnac_sample sample;
    sagnac_frame frame;
    int32_t counts;
    rig.ticks_left--;
    if (carried >= rig.row_ticks) {
        rig.carried = (uint32_t)(carried - rig.row_ticks);
        quarter_steps++;
    } else {
        rig.carried = (uint32_t)carried;
    }
    memset(&sample, 0, sizeof sample);
    quarter_steps = sagnac_held(quarter_steps + dither(&sample.pickoff), -MOST_STEPS, MOST_STEPS);
    sample.light = lamp();
    memcpy(sample.codes, rig.codes, sizeof sample.codes);
    sample.present = rig.present & 15U;
    counts = counted(quarter_steps);
    if (sagnac_board_tick(&board, counts, counter.lost, &sample, &actuators, &frame) != 0U) {
        send(&frame);
    }
}

static void power_on(const settings *with)
{
    sagnac_frame reply;
    memset(&rig, 0, sizeof rig);
    memset(&actuators, 0, sizeof actuators);
    rig.s = *with;
    rig.noise = 1U;
    sagnac_upload_power_on(&upload);
    memset(&setup, 0, sizeof setup);
    setup.path = &path;
    setup.light = &light;
    setup.strips = with->dither_counts > 0U ? SAGNAC_YES : SAGNAC_NO;
    setup.longest = LONGEST;
    setup.least_swing = LEAST_SWING;
    setup.frame_ticks = SAGNAC_FRAME_TICKS;
    sagnac_banks_start(&banks, &gyro, 0U, &loaded);
    sagnac_board_start(&board, &loaded, &setup, SAGNAC_POWER_ON, 0U);
    sagnac_quadrature_start(&counter);
    (void)sagnac_quadrature_update(&counter, SAGNAC_X4, 0U, 0U);
    sagnac_reply(0U, SAGNAC_REPLY_DONE, &loaded, &reply);
    send(&reply);
}

static void new_settings(const sagnac_frame *frame)
{
    const sagnac_octet *from = frame->payload;
    settings s;
    s.dither_counts = sagnac_read_u32(sagnac_octet_at, from, 0U);
    s.dither_step = sagnac_read_u32(sagnac_octet_at, from, 4U);
    s.curvature = sagnac_read_u32(sagnac_octet_at, from, 8U);
    s.lamp_gain = sagnac_read_u32(sagnac_octet_at, from, 12U);
    s.peak = sagnac_read_i32(sagnac_octet_at, from, 16U);
    s.peak_slope = sagnac_read_i32(sagnac_octet_at, from, 20U);
    s.wavelength = sagnac_read_i32(sagnac_octet_at, from, 24U);
    s.lamp_lag = from[28];
    s.actuator_lag = from[29];
    s.noise_bits = from[30];
    power_on(&s);
}

/* 0 at the end of the run. */
static int handle(const sagnac_frame *frame)
{
    const uint32_t is_for = sagnac_frame_is_for(frame, gyro.axis);
    if (is_for != 0U && frame->kind == 0x10U && frame->length == 31U) {
        new_settings(frame);
    } else if (is_for != 0U && frame->kind == 0x11U && frame->length == 25U) {
        start_row(frame);
        while (rig.ticks_left > 0U) {
            tick();
        }
    } else if (is_for != 0U && frame->kind == 0x30U && frame->length == 0U) {
        return 0;
    } else {
        sagnac_upload_handle(&upload, frame, &banks, &gyro, &loaded, &handled);
        if (handled.changed != 0U) {
            sagnac_board_use(&board, &loaded);
        }
        if (handled.handled != 0U) {
            send(&handled.answer);
        }
    }
    return 1;
}

static uint32_t read_file(const char *name, sagnac_octet *into)
{
    FILE *file = fopen(name, "rb");
    const uint32_t length = file == NULL ? 0U : (uint32_t)fread(into, 1, MOST, file);
    if (file != NULL) {
        fclose(file);
    }
    return length;
}

static int gyro_of(const char *name)
{
    static sagnac_octet octets[MOST];
    static sagnac_image image;
    if (sagnac_image_load(&image, sagnac_octet_at, octets, read_file(name, octets)) != SAGNAC_IMAGE_OK) {
        return 0;
    }
    memcpy(gyro.serial, image.serial, sizeof gyro.serial);
    gyro.axis = image.axis;
    gyro.tick_ns = image.tick_ns;
    gyro.scale_factor_femto_arcsec = image.scale_factor_femto_arcsec;
    gyro.quantum_nano_counts = image.quantum_nano_counts;
    gyro.largest_increment = 4 * sagnac_image_reach(&image, SAGNAC_BIAS);
    gyro.largest_scale = 4 * sagnac_image_reach(&image, SAGNAC_SCALE);
    gyro.largest_work = 4U * sagnac_image_work(&image);
    return 1;
}

static int loops_of(const char *name)
{
    static sagnac_octet octets[MOST];
    const uint32_t length = read_file(name, octets);
    return sagnac_path_length_load(&path, sagnac_octet_at, octets, length) != 0U &&
           sagnac_intensity_load(&light, sagnac_octet_at, octets, length) != 0U;
}

int main(int argc, char **argv)
{
    static const settings at_rest;
    sagnac_frame_reader reader;
    sagnac_frame frame;
    FILE *in = argc >= 5 ? fopen(argv[3], "rb") : NULL;
    int octet, goes_on = 1;
    sagnac_trust_nobody(&trust);
    out = argc >= 5 ? fopen(argv[4], "wb") : NULL;
    if (in == NULL || out == NULL || !gyro_of(argv[1]) || !loops_of(argv[2]) || (argc == 6 && !with_key(argv[5]))) {
        return 2;
    }
    memset(flash_octets, 0xff, sizeof flash_octets);
    flash.capacity = FLASH;
    flash.read_size = 1U;
    flash.program_size = UNIT;
    flash.erase_size = SECTOR;
    flash.read = flash_read;
    flash.program = flash_program;
    flash.erase = flash_erase;
    if (sagnac_banks_open(&banks, &flash, 0U, SECTOR) == 0U) {
        return 2;
    }
    sagnac_upload_start(&upload, &trust);
    sagnac_frame_start(&reader);
    power_on(&at_rest);
    while (goes_on && (octet = fgetc(in)) != EOF) {
        if (sagnac_frame_push(&reader, (uint32_t)octet, &frame) != 0U) {
            goes_on = handle(&frame);
        }
    }
    return fclose(out) == 0 ? 0 : 2;
}
