/*
 * What no vector reaches: calls that are refused, counters at their ends, flash that fails at every access, light without a peak.
 *
 *   check_edges LOOPS     0 if every expectation holds; each is what the header of the function says
 */
#include <stdio.h>
#include <string.h>

#include "sagnac_board.h"
#include "sagnac_quadrature.h"
#include "sagnac_upload.h"

#define FLASH 4096U
#define BANK 2048U

static unsigned long expectations, failures;

static void expect_at(int line, int holds)
{
    expectations++;
    if (!holds) {
        printf("line %d does not hold\n", line);
        failures++;
    }
}

#define EXPECT(holds) expect_at(__LINE__, (holds) ? 1 : 0)

static sagnac_path_length path;
static sagnac_intensity light;
static sagnac_image image;
static sagnac_compensator_state state;
static sagnac_gyro gyro;
static sagnac_banks banks;
static sagnac_loaded loaded;
static sagnac_flash flash;
static unsigned char memory[FLASH];
static uint32_t access_count, fails_at, wrong_at;

/* A flash whose access number `fails_at` fails, or whose read number `wrong_at` is wrong in a bit. */
static uint32_t flash_read(void *context, uint32_t offset, sagnac_octet *octets, uint32_t count)
{
    (void)context;
    access_count++;
    memcpy(octets, memory + offset, count);
    if (access_count == wrong_at) {
        octets[count / 2U] ^= 1U;
    }
    return access_count != fails_at ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t flash_program(void *context, uint32_t offset, const sagnac_octet *octets, uint32_t count)
{
    uint32_t i;
    (void)context;
    access_count++;
    for (i = 0U; i < count && access_count != fails_at; i++) {
        memory[offset + i] &= (unsigned char)octets[i];
    }
    return access_count != fails_at ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t flash_erase(void *context, uint32_t from, uint32_t to)
{
    (void)context;
    access_count++;
    if (access_count != fails_at) {
        memset(memory + from, access_count == wrong_at ? 0xfe : 0xff, to - from);
    }
    return access_count != fails_at ? SAGNAC_YES : SAGNAC_NO;
}

static void open_flash(void)
{
    flash.capacity = FLASH;
    flash.read_size = 1U;
    flash.program_size = 8U;
    flash.erase_size = BANK;
    flash.read = flash_read;
    flash.program = flash_program;
    flash.erase = flash_erase;
}

/* An image with one thermometer and one bias term, and its gyro. */
static void plain_image(uint32_t sequence)
{
    memset(&image, 0, sizeof image);
    sagnac_image_empty(&image);
    image.sequence = sequence;
    image.input_count = 1U;
    image.term_count = 1U;
    image.inputs[0].gain_mantissa = 1073741824;
    image.inputs[0].gain_shift = 30U;
    image.inputs[0].valid_lo_q24 = -1000000000;
    image.inputs[0].valid_hi_q24 = 1000000000;
    image.inputs[0].span_lo_q24 = -1073741824;
    image.inputs[0].span_hi_q24 = 1073741824;
    image.inputs[0].x_mantissa = 2147483648U;
    image.inputs[0].x_shift = 14U;
    image.inputs[0].stale_after_updates = 10U;
    image.terms[0].kind = SAGNAC_BIAS;
    image.terms[0].order = 1U;
    image.terms[0].mantissa = 1 << 20;
    image.terms[0].shift = 20U;
    memcpy(gyro.serial, image.serial, sizeof gyro.serial);
    gyro.axis = image.axis;
    gyro.tick_ns = image.tick_ns;
    gyro.scale_factor_femto_arcsec = image.scale_factor_femto_arcsec;
    gyro.quantum_nano_counts = image.quantum_nano_counts;
    gyro.largest_increment = sagnac_image_reach(&image, SAGNAC_BIAS);
    gyro.largest_scale = sagnac_image_reach(&image, SAGNAC_SCALE);
    gyro.largest_work = sagnac_image_work(&image);
}

/* The octets of plain_image: docs/reference/image-format.md. */
static uint32_t encode(sagnac_octet *octets)
{
    const sagnac_input *t = &image.inputs[0];
    uint32_t i;
    memset(octets, 0, SAGNAC_MAX_IMAGE);
    sagnac_write_u32(octets, 0U, 0x4E474153U);
    sagnac_write_u32(octets, 4U, 0x4D494341U);
    sagnac_write_u16(octets, 8U, 1U);
    sagnac_write_u32(octets, 12U, 128U + 64U + 12U + 4U);
    for (i = 0U; i < 8U; i++) {
        sagnac_write_u32(octets, 16U + 4U * i, image.serial[i]);
    }
    octets[48] = (sagnac_octet)image.axis;
    octets[49] = 1U;
    octets[50] = 1U;
    sagnac_write_u32(octets, 52U, image.tick_ns);
    sagnac_write_u32(octets, 56U, image.period_ticks);
    sagnac_write_u32(octets, 60U, image.slew_ticks);
    sagnac_write_u32(octets, 64U, (uint32_t)image.scale_factor_femto_arcsec);
    sagnac_write_u32(octets, 68U, (uint32_t)(image.scale_factor_femto_arcsec >> 32));
    sagnac_write_u32(octets, 72U, (uint32_t)image.quantum_nano_counts);
    sagnac_write_u32(octets, 84U, image.sequence);
    sagnac_write_u32(octets, 88U, image.output_limit);
    sagnac_write_u32(octets, 132U, (uint32_t)t->gain_mantissa);
    octets[136] = (sagnac_octet)t->gain_shift;
    octets[137] = (sagnac_octet)t->x_shift;
    sagnac_write_u32(octets, 144U, (uint32_t)t->valid_lo_q24);
    sagnac_write_u32(octets, 148U, (uint32_t)t->valid_hi_q24);
    sagnac_write_u32(octets, 152U, (uint32_t)t->span_lo_q24);
    sagnac_write_u32(octets, 156U, (uint32_t)t->span_hi_q24);
    sagnac_write_u32(octets, 160U, t->x_mantissa);
    sagnac_write_u32(octets, 180U, t->stale_after_updates);
    octets[192] = 1U;
    octets[194] = 1U;
    sagnac_write_u32(octets, 196U, (uint32_t)image.terms[0].mantissa);
    octets[200] = (sagnac_octet)image.terms[0].shift;
    sagnac_write_u32(octets, 204U, sagnac_crc32(sagnac_octet_at, octets, 0U, 204U));
    return 208U;
}

static uint32_t watched_at;
static uint32_t beyond;

static uint32_t bounded(const void *context, uint32_t index)
{
    beyond += index >= watched_at ? 1U : 0U;
    return sagnac_octet_at(context, index % SAGNAC_MAX_IMAGE);
}

static void loader(void)
{
    static sagnac_octet octets[SAGNAC_MAX_IMAGE];
    sagnac_image again;
    uint32_t length;
    plain_image(1U);
    EXPECT(sagnac_image_check(&image) == SAGNAC_IMAGE_OK);
    length = encode(octets);
    EXPECT(sagnac_image_load(&again, sagnac_octet_at, octets, length) == SAGNAC_IMAGE_OK);
    /* No octet at or beyond the given length is read, however long the caller says the image is. */
    for (watched_at = 0U; watched_at <= length; watched_at++) {
        (void)sagnac_image_load(&again, bounded, octets, watched_at);
    }
    EXPECT(beyond == 0U);
    watched_at = SAGNAC_MAX_IMAGE;
    sagnac_write_u32(octets, 12U, UINT32_MAX);
    EXPECT(sagnac_image_load(&again, bounded, octets, UINT32_MAX) == SAGNAC_IMAGE_LENGTH);
    EXPECT(beyond == 0U);
    image.axis = 0U;
    EXPECT(sagnac_image_check(&image) == SAGNAC_IMAGE_HEAD);
}

/* Fields that only a build which makes its own image can get wrong: octets cannot say them. */
static void checks_of_a_made_image(void)
{
    sagnac_image sound;
    plain_image(1U);
    sound = image;
#define WRONG(change, why) (image = sound, (void)(change), EXPECT(sagnac_image_check(&image) == (why)))
    WRONG(image.scale_factor_femto_arcsec = 0U, SAGNAC_IMAGE_HEAD);
    WRONG(image.quantum_nano_counts = 0U, SAGNAC_IMAGE_HEAD);
    WRONG(image.inputs[0].source = (sagnac_source)9, SAGNAC_IMAGE_INPUT);
    WRONG(image.terms[0].kind = (sagnac_kind)9, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].shape = (sagnac_shape)9, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].turns_q18 = 1U, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].knot_q15 = 1, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].order = SAGNAC_MAX_ORDER + 1U, SAGNAC_IMAGE_TERM);
    WRONG((image.terms[0].mantissa = INT32_MAX, image.terms[0].shift = 8U), SAGNAC_IMAGE_OK);
    WRONG((image.terms[0].mantissa = INT32_MAX, image.terms[0].shift = 8U, image.terms[1] = image.terms[0], image.term_count = 2U),
          SAGNAC_IMAGE_SUM);
    WRONG((image.terms[0].mantissa = INT32_MAX, image.terms[0].shift = 8U, image.terms[0].kind = SAGNAC_SCALE), SAGNAC_IMAGE_SUM);
    sound.terms[0].order = 0U;
    sound.terms[0].shape = SAGNAC_SINE;
    sound.terms[0].turns_q18 = SAGNAC_MAX_TURNS_Q18;
    WRONG(0, SAGNAC_IMAGE_OK);
    WRONG(image.terms[0].turns_q18++, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].turns_q18 = 0U, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].order = 1U, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].knot_q15 = 1, SAGNAC_IMAGE_TERM);
    sound.terms[0].turns_q18 = 0U;
    sound.terms[0].shape = SAGNAC_STEP;
    sound.terms[0].knot_q15 = -32768;
    WRONG(0, SAGNAC_IMAGE_OK);
    WRONG(image.terms[0].shape = (sagnac_shape)9, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].knot_q15 = -32769, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].knot_q15 = 32768, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].turns_q18 = 1U, SAGNAC_IMAGE_TERM);
    WRONG(image.terms[0].order = 1U, SAGNAC_IMAGE_TERM);
    /* A second input of each source: what it may use. */
    sound.input_count = 2U;
    sound.inputs[1] = sound.inputs[0];
    sound.inputs[1].gain_mantissa = 1;
    sound.inputs[1].gain_shift = 0U;
    sound.inputs[1].source = SAGNAC_REPEAT;
    WRONG(0, SAGNAC_IMAGE_OK);
    WRONG(image.inputs[1].source = (sagnac_source)9, SAGNAC_IMAGE_INPUT);
    WRONG(image.inputs[1].of = 1U, SAGNAC_IMAGE_INPUT);
    WRONG(image.inputs[1].largest_step_q8 = 1U, SAGNAC_IMAGE_INPUT);
    sound.input_count = 3U;
    sound.inputs[2] = sound.inputs[1];
    WRONG(0, SAGNAC_IMAGE_OK);
    WRONG(image.inputs[2].of = 1U, SAGNAC_IMAGE_INPUT);
    sound.inputs[2].source = SAGNAC_DIFFERENCE;
    WRONG(image.inputs[2].less = 1U, SAGNAC_IMAGE_INPUT);
    WRONG((image.inputs[2].of = 1U, image.inputs[2].less = 0U), SAGNAC_IMAGE_INPUT);
    sound.input_count = 2U;
    sound.inputs[1].source = SAGNAC_WARM_UP;
    sound.inputs[1].alpha_mantissa = 2147483648U;
    sound.inputs[1].alpha_shift = 40U;
    sound.inputs[1].rate_shift = 20U;
    sound.inputs[1].rate_lo = -1073741824;
    sound.inputs[1].rate_hi = 1073741824;
    sound.inputs[1].y_mantissa = 2147483648U;
    sound.inputs[1].y_shift = 30U;
    WRONG(0, SAGNAC_IMAGE_OK);
    WRONG(image.inputs[1].less = 1U, SAGNAC_IMAGE_INPUT);
    WRONG(image.inputs[1].valid_lo_q24 = 1, SAGNAC_IMAGE_INPUT);
    WRONG(image.inputs[1].valid_hi_q24 = -1, SAGNAC_IMAGE_INPUT);
    WRONG((image.inputs[1].alpha_mantissa = 0U, image.inputs[1].alpha_shift = 0U, image.inputs[1].rate_shift = 0U,
           image.inputs[1].rate_lo = 0, image.inputs[1].rate_hi = 0, image.inputs[1].y_mantissa = 0U, image.inputs[1].y_shift = 0U),
          SAGNAC_IMAGE_INPUT);
    sound.input_count = 3U;
    sound.inputs[2] = sound.inputs[0];
    sound.inputs[2].source = SAGNAC_REPEAT;
    sound.inputs[2].gain_mantissa = 1;
    sound.inputs[2].gain_shift = 0U;
    WRONG(0, SAGNAC_IMAGE_OK);
    WRONG(image.inputs[2].of = 1U, SAGNAC_IMAGE_INPUT);
}

static void identity(void)
{
    sagnac_gyro other;
    sagnac_image made;
    plain_image(UINT32_MAX);
    EXPECT(sagnac_gyro_accept(&gyro, &image) == SAGNAC_MATCHES);
#define REFUSED(field, change, why) (other = gyro, other.field = (change), EXPECT(sagnac_gyro_accept(&other, &image) == (why)))
    REFUSED(serial[7], 1U, SAGNAC_OTHER_SERIAL);
    REFUSED(axis, 121U, SAGNAC_OTHER_AXIS);
    REFUSED(tick_ns, 1U, SAGNAC_OTHER_TICK);
    REFUSED(scale_factor_femto_arcsec, 1U, SAGNAC_OTHER_SCALE_FACTOR);
    REFUSED(quantum_nano_counts, 1U, SAGNAC_OTHER_QUANTUM);
    REFUSED(largest_increment, gyro.largest_increment - 1, SAGNAC_BIAS_TOO_LARGE);
    REFUSED(largest_work, gyro.largest_work - 1U, SAGNAC_WORK_TOO_LARGE);
    image.terms[0].kind = SAGNAC_SCALE;
    EXPECT(sagnac_gyro_accept(&gyro, &image) == SAGNAC_SCALE_TOO_LARGE);
    other = gyro;
    other.tick_ns = 0U;
    other.scale_factor_femto_arcsec = 0U;
    other.quantum_nano_counts = 0U;
    sagnac_factory_defaults(&other, &made);
    EXPECT(made.tick_ns == 1U && made.scale_factor_femto_arcsec == 1U && made.quantum_nano_counts == 1U);
    EXPECT(sagnac_image_check(&made) == SAGNAC_IMAGE_OK);
    other.axis = 0U;
    sagnac_factory_defaults(&other, &made);
    EXPECT(made.axis == 120U && sagnac_image_check(&made) == SAGNAC_IMAGE_OK);
}

static void work(void)
{
    static const sagnac_shape shapes[5] = {SAGNAC_CHEBYSHEV, SAGNAC_ZONE, SAGNAC_STEP, SAGNAC_COSINE, SAGNAC_SINE};
    uint32_t i;
    plain_image(1U);
    EXPECT(sagnac_image_work(&image) == 572U + 15U + 77U);
    image.input_count = 4U;
    for (i = 0U; i < 4U; i++) {
        image.inputs[i].alpha_mantissa = 1U;
    }
    image.term_count = 5U;
    for (i = 0U; i < 5U; i++) {
        image.terms[i].shape = shapes[i];
    }
    EXPECT(sagnac_image_work(&image) == 572U + 15U + 3U * 472U + 4U * 157U + 5U * 77U + 6U + 2U * 112U);
    image.term_count = 0U;
    image.input_count = 0U;
    EXPECT(sagnac_image_work(&image) == 572U);
}

static void compensator(void)
{
    static const int32_t codes[4] = {0, 0, 0, 0};
    sagnac_slow_update update;
    sagnac_output output;
    plain_image(1U);
    sagnac_compensator_start(&state);
    EXPECT(sagnac_compensator_tick(&image, &state, 0, &output) == SAGNAC_UPDATE_DUE);
    sagnac_compensator_begin_update(&image, &state, codes, 1U, &update);
    /* Another update comes in between; its number goes round. */
    state.updates = UINT32_MAX;
    EXPECT(sagnac_compensator_apply_update(&image, &state, &update) == SAGNAC_OUTDATED);
    EXPECT(sagnac_compensator_update(&image, &state, codes, 1U) == SAGNAC_OK && state.updates == 0U);
    EXPECT(sagnac_compensator_update(&image, &state, codes, 1U) == SAGNAC_UPDATE_NOT_DUE);
    EXPECT(sagnac_compensator_apply_update(&image, &state, &update) == SAGNAC_UPDATE_NOT_DUE);
    EXPECT(sagnac_compensator_tick(&image, &state, -SAGNAC_MAX_RAW - 1, &output) == SAGNAC_RAW_OUT_OF_RANGE);
    EXPECT(sagnac_compensator_tick(&image, &state, SAGNAC_MAX_RAW + 1, &output) == SAGNAC_RAW_OUT_OF_RANGE);
    EXPECT(sagnac_compensator_tick(&image, &state, -SAGNAC_MAX_RAW, &output) == SAGNAC_OK && output.counts == -SAGNAC_MAX_RAW);
    state.updates = UINT32_MAX;
    sagnac_compensator_migrate_state(&image, &state);
    EXPECT(state.updates == 0U && state.ticks_to_update == 0U);
    /* Held back at the limit of one count, in either direction, until it has no meaning; then cleared. */
    image.output_limit = 1U;
    image.slew_ticks = 0U;
    EXPECT(sagnac_compensator_update(&image, &state, codes, 1U) == SAGNAC_OK);
    EXPECT(sagnac_compensator_tick(&image, &state, -SAGNAC_MAX_RAW, &output) == SAGNAC_OK);
    EXPECT(output.counts == -1 && (output.status & SAGNAC_OVERFLOW) == 0U);
    EXPECT(sagnac_compensator_tick(&image, &state, -SAGNAC_MAX_RAW, &output) == SAGNAC_OK);
    EXPECT((output.status & SAGNAC_OVERFLOW) != 0U);
    sagnac_compensator_clear_overflow(&state);
    EXPECT((sagnac_compensator_status(&state) & SAGNAC_OVERFLOW) == 0U);
}

static void counting(void)
{
    sagnac_quadrature counter;
    sagnac_stripper stripper;
    sagnac_quadrature_start(&counter);
    (void)sagnac_quadrature_update(&counter, SAGNAC_X4, 0U, 0U);
    counter.lost = UINT32_MAX;
    EXPECT(sagnac_quadrature_update(&counter, SAGNAC_X4, 1U, 1U) == 0 && counter.lost == UINT32_MAX);
    sagnac_stripper_start(&stripper, 65536U, 0U);
    EXPECT(stripper.longest == 65535U);
}

static void frames(void)
{
    sagnac_frame_reader reader;
    sagnac_frame frame, found;
    sagnac_octet octets[SAGNAC_MAX_FRAME];
    uint32_t length, i;
    static const uint32_t begun[6] = {83U, 71U, 0x20U, 60U, 1U, 2U};
    frame.kind = SAGNAC_KIND_ROLL_BACK;
    frame.axis = 0U;
    frame.length = 0U;
    length = sagnac_frame_octets(&frame, octets);
    EXPECT(length == 8U);
    EXPECT(sagnac_axis_code('x') == 1U && sagnac_axis_code('Y') == 2U && sagnac_axis_code('z') == 3U);
    EXPECT(sagnac_axis_code('w') == 0U && sagnac_axis_code('{') == 0U && sagnac_axis_code(24U) == 0U);
    /* A head that promises 60 octets, then silence, then a whole frame. */
    sagnac_frame_start(&reader);
    for (i = 0U; i < 6U; i++) {
        EXPECT(sagnac_frame_push(&reader, begun[i], &found) == SAGNAC_NO);
    }
    for (i = 0U; i < length; i++) {
        EXPECT(sagnac_frame_push(&reader, octets[i], &found) == SAGNAC_NO);
    }
    EXPECT(sagnac_frame_quiet(&reader, &found) == SAGNAC_YES && found.kind == SAGNAC_KIND_ROLL_BACK);
    EXPECT(sagnac_frame_quiet(&reader, &found) == SAGNAC_NO && reader.length == 0U && reader.skipped == 6U);
    EXPECT(sagnac_frame_push(&reader, 83U, &found) == SAGNAC_NO && sagnac_frame_quiet(&reader, &found) == SAGNAC_NO);
    reader.skipped = UINT32_MAX;
    EXPECT(sagnac_frame_push(&reader, 1U, &found) == SAGNAC_NO && reader.skipped == UINT32_MAX);
    frame.length = 200U;
    memset(frame.payload, 7, sizeof frame.payload);
    EXPECT(sagnac_frame_octets(&frame, octets) == SAGNAC_MAX_FRAME && octets[3] == SAGNAC_MAX_PAYLOAD);
}

static void banks_that_do_not_fit(void)
{
#define REFUSES(field, change) (open_flash(), flash.field = (change), EXPECT(sagnac_banks_open(&banks, &flash, 0U, BANK) == SAGNAC_NO))
    REFUSES(read_size, 0U);
    REFUSES(program_size, 0U);
    REFUSES(erase_size, 0U);
    REFUSES(read_size, 64U);
    REFUSES(program_size, 3U);
    REFUSES(erase_size, 4096U);
    REFUSES(capacity, 4095U);
    open_flash();
    EXPECT(sagnac_banks_open(&banks, &flash, 1024U, BANK) == SAGNAC_NO);
    EXPECT(sagnac_banks_open(&banks, &flash, 8192U, BANK) == SAGNAC_NO);
    flash.erase_size = 256U;
    EXPECT(sagnac_banks_open(&banks, &flash, 0U, 1024U) == SAGNAC_NO);
    EXPECT(sagnac_banks_open(&banks, &flash, 256U, 1280U) == SAGNAC_YES);
    open_flash();
    EXPECT(sagnac_banks_open(&banks, &flash, 0U, BANK) == SAGNAC_YES);
}

static sagnac_store_result store(uint32_t sequence, uint32_t trial)
{
    static sagnac_octet octets[SAGNAC_MAX_IMAGE];
    plain_image(sequence);
    return sagnac_banks_store(&banks, &gyro, octets, encode(octets), trial);
}

static uint32_t active(void)
{
    fails_at = wrong_at = 0U;
    sagnac_banks_load(&banks, &gyro, &loaded);
    return loaded.image.sequence;
}

/* Every access of every call fails once, or reads a wrong bit once: what is active afterwards is the image before or the one after. */
static void flash_that_fails(void)
{
    static unsigned char two_stored[FLASH], two_confirmed[FLASH];
    uint32_t at, kind, operation, results = 0U;
    banks_that_do_not_fit();
    memset(memory, 0xff, sizeof memory);
    EXPECT(store(1U, 0U) == SAGNAC_STORE_DONE && store(2U, 0U) == SAGNAC_STORE_DONE && active() == 2U && loaded.trial == 0U);
    memcpy(two_confirmed, memory, sizeof memory);
    memset(memory, 0xff, sizeof memory);
    EXPECT(store(1U, 0U) == SAGNAC_STORE_DONE && store(2U, 1U) == SAGNAC_STORE_DONE && active() == 2U && loaded.trial != 0U);
    memcpy(two_stored, memory, sizeof memory);
    for (operation = 0U; operation < 4U; operation++) {
        for (kind = 0U; kind < 2U; kind++) {
            for (at = 1U; at < 160U; at++) {
                sagnac_store_result result = SAGNAC_STORE_DONE;
                uint32_t now;
                memcpy(memory, operation == 0U ? two_confirmed : two_stored, sizeof memory);
                access_count = 0U;
                fails_at = kind == 0U ? at : 0U;
                wrong_at = kind == 1U ? at : 0U;
                if (operation == 0U) {
                    result = store(3U, 0U);
                } else if (operation == 1U) {
                    result = sagnac_banks_roll_back(&banks, &gyro);
                } else if (operation == 2U) {
                    result = sagnac_banks_confirm(&banks, &gyro);
                } else {
                    sagnac_banks_start(&banks, &gyro, 0U, &loaded);
                }
                now = active();
                results |= UINT32_C(1) << (uint32_t)result;
                if (operation == 0U) {
                    EXPECT(now == 3U || (now == 2U && result != SAGNAC_STORE_DONE) || (now == 1U && result != SAGNAC_STORE_DONE));
                } else {
                    EXPECT(now == 1U || now == 2U);
                }
            }
        }
    }
    EXPECT((results & (1U << SAGNAC_STORE_FLASH)) != 0U && (results & (1U << SAGNAC_STORE_READ_BACK)) != 0U);
    EXPECT((results & (1U << SAGNAC_STORE_NO_OLDER_IMAGE)) != 0U);
    /* A bank copied over the other is a survivor; so is one next to damage. */
    memcpy(memory, two_stored, sizeof memory);
    memcpy(memory + BANK, memory, BANK);
    EXPECT(active() == 1U && loaded.origin == SAGNAC_ONLY_SURVIVOR);
    /* Four zero octets are no note. */
    memcpy(memory, two_stored, sizeof memory);
    memset(memory + 36, 0, 4);
    EXPECT(active() == 2U && loaded.origin == SAGNAC_NEWEST);
    EXPECT(sagnac_banks_roll_back(&banks, &gyro) == SAGNAC_STORE_DONE && active() == 1U);
}

static uint32_t unanswered(void *context, uint32_t offset, sagnac_octet *octets, uint32_t count)
{
    (void)context;
    (void)offset;
    (void)octets;
    (void)count;
    return SAGNAC_NO;
}

/* A part of the flash that cannot be read. */
static uint32_t dark_from, dark_to;

static uint32_t in_part(void *context, uint32_t offset, sagnac_octet *octets, uint32_t count)
{
    return offset < dark_to && dark_from < offset + count ? SAGNAC_NO : flash_read(context, offset, octets, count);
}

/* What a store of this image would answer with a part of the flash unread. */
static sagnac_store_result checked(uint32_t sequence, uint32_t from, uint32_t to)
{
    static sagnac_octet octets[SAGNAC_MAX_IMAGE];
    sagnac_store_result result;
    plain_image(sequence);
    dark_from = from;
    dark_to = to;
    flash.read = in_part;
    result = sagnac_banks_check(&banks, &gyro, octets, encode(octets));
    flash.read = flash_read;
    return result;
}

static uint32_t started(uint32_t watchdog_resets)
{
    sagnac_banks_start(&banks, &gyro, watchdog_resets, &loaded);
    return loaded.image.sequence;
}

/* A trial over a trial, a flash without an answer, an image with which the watchdog resets the board, numbers that go round. */
static void images_that_must_stay(void)
{
    static unsigned char kept[FLASH];
    memset(memory, 0xff, sizeof memory);
    EXPECT(store(1U, 0U) == SAGNAC_STORE_DONE && store(2U, 1U) == SAGNAC_STORE_DONE);
    EXPECT(store(3U, 1U) == SAGNAC_STORE_ON_TRIAL && store(3U, 0U) == SAGNAC_STORE_ON_TRIAL && active() == 2U);
    EXPECT(sagnac_banks_confirm(&banks, &gyro) == SAGNAC_STORE_DONE);
    memcpy(kept, memory, sizeof memory);
    flash.read = unanswered;
    EXPECT(store(3U, 0U) == SAGNAC_STORE_FLASH);
    flash.read = flash_read;
    EXPECT(memcmp(kept, memory, sizeof memory) == 0);
    /* From a commit word on, over one bank and over both: something can be read, but not all of it. */
    EXPECT(checked(3U, 0U, 32U) == SAGNAC_STORE_DONE && checked(3U, 0U, BANK) == SAGNAC_STORE_DONE);
    EXPECT(checked(3U, BANK, 2U * BANK) == SAGNAC_STORE_DONE && checked(3U, 0U, 2U * BANK) == SAGNAC_STORE_FLASH);
    EXPECT(checked(3U, 192U, BANK + 32U) == SAGNAC_STORE_DONE && checked(3U, 32U, BANK + 160U) == SAGNAC_STORE_DONE);
    /* The confirmation of another store. */
    memset(memory, 0xff, sizeof memory);
    EXPECT(store(1U, 0U) == SAGNAC_STORE_DONE && store(2U, 1U) == SAGNAC_STORE_DONE);
    {
        static const unsigned char seven[8] = {7U, 0U, 0U, 0U, 0xf8U, 0xffU, 0xffU, 0xffU};
        uint32_t pair;
        for (pair = 0U; pair < 4U; pair++) {
            memcpy(memory + BANK + 1120U + 8U * pair, seven, sizeof seven);
        }
    }
    EXPECT(active() == 2U && loaded.trial != 0U);
    memcpy(memory, kept, sizeof memory);
    EXPECT(started(3U) == 2U && started(4U) == 1U && loaded.origin == SAGNAC_ONLY_SURVIVOR && started(7U) == 1U);
    EXPECT(loaded.banks[1].content == SAGNAC_BANK_SET_ASIDE && loaded.banks[1].stored == 2U);
    EXPECT(started(8U) == 0U && loaded.origin == SAGNAC_FACTORY_DEFAULTS && started(UINT32_MAX) == 0U);
    EXPECT(memcmp(kept, memory, sizeof memory) == 0 && started(0U) == 2U);
    /* The bad image is replaced, also while both are set aside; or withdrawn. */
    EXPECT(started(4U) == 1U && store(3U, 0U) == SAGNAC_STORE_DONE && active() == 3U && loaded.origin == SAGNAC_NEWEST);
    memcpy(memory, kept, sizeof memory);
    EXPECT(started(8U) == 0U && store(3U, 0U) == SAGNAC_STORE_DONE && active() == 3U && loaded.banks[0].stored == 3U);
    memcpy(memory, kept, sizeof memory);
    EXPECT(started(4U) == 1U && sagnac_banks_roll_back(&banks, &gyro) == SAGNAC_STORE_DONE && started(0U) == 1U);
    memset(memory, 0xff, sizeof memory);
    EXPECT(store(0U, 0U) == SAGNAC_STORE_NOT_NEWER && store(UINT32_MAX, 0U) == SAGNAC_STORE_DONE);
    EXPECT(store(UINT32_MAX - 1U, 0U) == SAGNAC_STORE_NOT_NEWER && store(1U, 0U) == SAGNAC_STORE_DONE && active() == 1U);
    EXPECT(started(4U) == UINT32_MAX);
    /* After a trial that used all its starts the image before it is not set aside, too. */
    memset(memory, 0xff, sizeof memory);
    EXPECT(store(1U, 0U) == SAGNAC_STORE_DONE && store(2U, 1U) == SAGNAC_STORE_DONE);
    EXPECT(started(0U) == 2U && started(1U) == 2U && started(2U) == 2U && started(3U) == 2U && started(4U) == 1U);
}

/* The right key, model and counter over 773 octets: not the signature of any image. Without a key the same block is ignored. */
static void signed_too_long(sagnac_trust *trust)
{
    static sagnac_octet octets[SAGNAC_MAX_SIGNED + 1U];
    static sagnac_octet message[SAGNAC_MAX_MESSAGE];
    static const sagnac_octet magic[8] = {83U, 65U, 71U, 78U, 65U, 67U, 83U, 71U};
    sagnac_octet digest[SAGNAC_DIGEST];
    sagnac_trusted trusted;
    sagnac_hash hash;
    uint32_t length;
    sagnac_hash_start(&hash);
    sagnac_hash_add(&hash, trust->public_key, 32U);
    sagnac_hash_end(&hash, digest);
    for (length = SAGNAC_MAX_IMAGE; length <= SAGNAC_MAX_IMAGE + 1U; length++) {
        memset(octets, 0, sizeof octets);
        memcpy(octets + length, magic, 8);
        octets[length + 8U] = 1U;
        memcpy(octets + length + 16U, digest, 16);
        EXPECT(sagnac_trust_check(trust, octets, length + 112U, message, &trusted) == SAGNAC_NOT_THE_SIGNATURE);
        EXPECT(trusted.image_length == length && trusted.has_counter == SAGNAC_YES);
        octets[length + 10U] = 1U;
        EXPECT(sagnac_trust_check(trust, octets, length + 112U, message, &trusted) == SAGNAC_SIGNATURE_BLOCK);
        octets[length + 10U] = 0U;
        trust->has_key = SAGNAC_NO;
        EXPECT(sagnac_trust_check(trust, octets, length + 112U, message, &trusted) == SAGNAC_TRUSTED);
        EXPECT(trusted.image_length == length && trusted.has_counter == SAGNAC_NO);
        trust->has_key = SAGNAC_YES;
    }
}

static uint32_t always(void *context, const sagnac_octet *key, const sagnac_octet *message, uint32_t length,
                       const sagnac_octet *signature)
{
    (void)context;
    (void)key;
    (void)signature;
    /* The change is a part of it. */
    return length == 66U && message[49] == SAGNAC_KIND_ROLL_BACK ? SAGNAC_YES : SAGNAC_NO;
}

static uint32_t answer_to(sagnac_upload *upload, uint32_t kind, uint32_t length, uint32_t octet)
{
    sagnac_frame frame;
    sagnac_handled handled;
    memset(frame.payload, 0, sizeof frame.payload);
    frame.kind = kind;
    frame.axis = 0U;
    frame.length = length;
    frame.payload[0] = (sagnac_octet)octet;
    sagnac_upload_handle(upload, &frame, &banks, &gyro, &loaded, &handled);
    EXPECT(handled.handled == SAGNAC_YES);
    return handled.answer.kind == SAGNAC_KIND_CHALLENGE ? SAGNAC_KIND_CHALLENGE : handled.answer.payload[1];
}

/* Open for the change that was answered for, and for so long. */
static void service_mode(sagnac_upload *upload, sagnac_trust *trust)
{
    uint32_t waited, second;
    trust->has_key = SAGNAC_YES;
    trust->verify = always;
    for (waited = SAGNAC_SERVICE_S - 1U; waited <= SAGNAC_SERVICE_S + 1U; waited++) {
        const uint32_t ends = waited >= SAGNAC_SERVICE_S;
        EXPECT(answer_to(upload, SAGNAC_KIND_SERVICE, 1U, SAGNAC_KIND_ROLL_BACK) == SAGNAC_KIND_CHALLENGE);
        EXPECT(answer_to(upload, SAGNAC_KIND_ANSWER, 64U, 0U) == SAGNAC_REPLY_DONE);
        EXPECT(answer_to(upload, SAGNAC_KIND_CONFIRM, 0U, 0U) == SAGNAC_REPLY_LOCKED);
        EXPECT(answer_to(upload, SAGNAC_KIND_PIECE, 3U, 0U) == SAGNAC_REPLY_LOCKED);
        for (second = 0U; second < waited; second++) {
            sagnac_upload_second(upload);
        }
        EXPECT((answer_to(upload, SAGNAC_KIND_ROLL_BACK, 0U, 0U) == SAGNAC_REPLY_LOCKED) == (ends != 0U));
    }
    EXPECT(answer_to(upload, SAGNAC_KIND_SERVICE, 1U, SAGNAC_KIND_CONFIRM) == SAGNAC_KIND_CHALLENGE);
    EXPECT(answer_to(upload, SAGNAC_KIND_ANSWER, 64U, 0U) == SAGNAC_REPLY_BAD_SIGNATURE);
    sagnac_trust_nobody(trust);
    EXPECT(answer_to(upload, SAGNAC_KIND_SERVICE, 1U, SAGNAC_KIND_CONFIRM) == SAGNAC_REPLY_DONE);
}

static void trust_and_upload(void)
{
    static sagnac_upload upload;
    static sagnac_octet message[SAGNAC_MAX_MESSAGE];
    sagnac_trust trust;
    sagnac_trusted trusted;
    sagnac_octet none[1] = {0U};
    sagnac_octet challenge[SAGNAC_CHALLENGE];
    sagnac_frame frame;
    sagnac_handled handled;
    sagnac_trust_nobody(&trust);
    EXPECT(trust.lowest_counter(trust.context) == 0U);
    trust.raise_lowest_counter(trust.context, 7U);
    EXPECT(trust.verify(trust.context, none, none, 0U, none) == SAGNAC_NO);
    memset(challenge, 1, sizeof challenge);
    trust.challenge(trust.context, challenge);
    EXPECT(challenge[0] == 0U && challenge[SAGNAC_CHALLENGE - 1U] == 0U);
    EXPECT(sagnac_trust_check(&trust, none, 0U, message, &trusted) == SAGNAC_TRUSTED && trusted.image_length == 0U);
    sagnac_upload_start(&upload, &trust);
    memset(&frame, 0, sizeof frame);
#define NOT_HANDLED(of, octets) \
    (frame.kind = (of), frame.length = (octets), sagnac_upload_handle(&upload, &frame, &banks, &gyro, &loaded, &handled), \
     EXPECT(handled.handled == SAGNAC_NO))
    NOT_HANDLED(SAGNAC_KIND_OUTPUT, 0U);
    NOT_HANDLED(SAGNAC_KIND_PIECE, 1U);
    NOT_HANDLED(SAGNAC_KIND_PIECE, 63U);
    NOT_HANDLED(SAGNAC_KIND_COMMIT, 2U);
    NOT_HANDLED(SAGNAC_KIND_ANSWER, 63U);
    NOT_HANDLED(SAGNAC_KIND_CONFIRM, 1U);
    NOT_HANDLED(SAGNAC_KIND_SERVICE, 0U);
    NOT_HANDLED(SAGNAC_KIND_SERVICE, 1U);
    frame.payload[0] = SAGNAC_KIND_SERVICE;
    NOT_HANDLED(SAGNAC_KIND_SERVICE, 1U);
    frame.payload[0] = 0U;
    frame.payload[2] = 2U;
    NOT_HANDLED(SAGNAC_KIND_COMMIT, 3U);
    sagnac_write_u16(frame.payload, 0U, SAGNAC_MAX_SIGNED);
    frame.kind = SAGNAC_KIND_PIECE;
    frame.length = 3U;
    sagnac_upload_handle(&upload, &frame, &banks, &gyro, &loaded, &handled);
    EXPECT(handled.handled == SAGNAC_YES && handled.answer.payload[1] == SAGNAC_REPLY_BAD_PIECE && handled.changed == SAGNAC_NO);
    frame.kind = SAGNAC_KIND_COMMIT;
    frame.payload[2] = 0U;
    sagnac_write_u16(frame.payload, 0U, SAGNAC_MAX_SIGNED + 1U);
    sagnac_upload_handle(&upload, &frame, &banks, &gyro, &loaded, &handled);
    EXPECT(handled.answer.payload[1] == SAGNAC_REPLY_BAD_PIECE && handled.changed == SAGNAC_YES);
    service_mode(&upload, &trust);
    /* A signature over more octets than any image has. */
    trust.has_key = SAGNAC_YES;
    memcpy(upload.octets + SAGNAC_MAX_SIGNED - 111U, "AGNACSG", 7);
    upload.octets[SAGNAC_MAX_SIGNED - 112U] = 83U;
    upload.octets[SAGNAC_MAX_SIGNED - 104U] = 1U;
    EXPECT(sagnac_trust_check(&trust, upload.octets, SAGNAC_MAX_SIGNED, message, &trusted) == SAGNAC_OTHER_KEY);
    signed_too_long(&trust);
}

/* A hold of more updates than a number holds. */
static void bound_of_a_long_hold(void)
{
    sagnac_error_bound bound;
    plain_image(1U);
    sagnac_error_bound_start(&bound);
    bound.held_updates = UINT32_MAX;
    sagnac_compensator_start(&state);
    state.slow_status = SAGNAC_HELD;
    sagnac_error_bound_update(&bound, &image, &state);
    EXPECT(bound.held_updates == UINT32_MAX && bound.milli_dph >= 100U);
    state.slow_status = 0U;
    sagnac_error_bound_update(&bound, &image, &state);
    EXPECT(bound.held_updates == 0U);
    sagnac_error_bound_advance(&bound, &image, &state);
    EXPECT(bound.is_whole == SAGNAC_YES);
}

static void board_counts(void)
{
    static sagnac_board board;
    static sagnac_board_setup setup;
    sagnac_sample sample;
    sagnac_actuators actuators;
    sagnac_frame frame;
    uint32_t tick;
    plain_image(1U);
    memset(&sample, 0, sizeof sample);
    memset(&loaded, 0, sizeof loaded);
    loaded.image = image;
    setup.path = &path;
    setup.light = &light;
    setup.frame_ticks = SAGNAC_FRAME_TICKS;
    sagnac_board_start(&board, &loaded, &setup, SAGNAC_POWER_ON, 0U);
    /* A counter that gives more than a call accepts: the excess is lost, and said. */
    for (tick = 0U; tick < SAGNAC_FRAME_TICKS - 1U; tick++) {
        EXPECT(sagnac_board_tick(&board, tick == 0U ? INT32_MAX : 0, 0U, &sample, &actuators, &frame) == SAGNAC_NO);
    }
    EXPECT(sagnac_board_tick(&board, 0, 0U, &sample, &actuators, &frame) == SAGNAC_YES);
    EXPECT((sagnac_read_u16(sagnac_octet_at, frame.payload, 14U) & SAGNAC_OVERFLOW) != 0U);
    EXPECT(sagnac_read_u32(sagnac_octet_at, frame.payload, 10U) == (uint32_t)SAGNAC_MAX_RAW);
    /* As many as a call accepts, in every tick: 32 bits do not hold their sum. */
    for (tick = 0U; tick < SAGNAC_FRAME_TICKS; tick++) {
        (void)sagnac_board_tick(&board, SAGNAC_MAX_RAW, 0U, &sample, &actuators, &frame);
    }
    EXPECT((sagnac_read_u16(sagnac_octet_at, frame.payload, 14U) & SAGNAC_OVERFLOW) != 0U);
}

/* Light that does not answer to the path: never LOCKED, always reported. With or without a search, and a start at half a wavelength. */
static void no_peak(uint32_t periods)
{
    sagnac_path_length loop = path;
    sagnac_path_length_state now;
    sagnac_path_length_output output;
    uint32_t tick, locked = 0U, missed = 0U, asides = 0U;
    loop.sweep_periods = periods;
    sagnac_path_length_start(&loop, &now);
    for (tick = 0U; tick < 3000000U && (missed == 0U || (periods == 0U && asides < 3U)); tick++) {
        const uint32_t aside = now.aside;
        sagnac_path_length_tick(&loop, &now, 4000000, &output);
        locked += now.phase == SAGNAC_PATH_LOCKED ? 1U : 0U;
        missed |= now.status & SAGNAC_PATH_NO_PEAK;
        asides += now.aside != aside ? 1U : 0U;
    }
    EXPECT(locked == 0U && missed != 0U);
    /* Half a wavelength aside, back, and aside again. */
    EXPECT(periods != 0U || asides == 3U);
}

/* With the lamp off: a harmonic as large as half a peak's at the least light is crosstalk, of either sign; less is noise. */
static void crosstalk(void)
{
    const int64_t peak = (path.dark_sum * (int64_t)path.least_curvature_q8) / 256;
    const uint32_t periods = 16U * path.lock_periods;
    EXPECT(sagnac_path_length_is_heard(&path, peak * (int64_t)periods, periods) == SAGNAC_YES);
    EXPECT(sagnac_path_length_is_heard(&path, -peak * (int64_t)periods, periods) == SAGNAC_YES);
    EXPECT(sagnac_path_length_is_heard(&path, (peak / 3) * (int64_t)periods, periods) == SAGNAC_NO);
    EXPECT(sagnac_path_length_is_heard(&path, 0, 0U) == SAGNAC_NO && sagnac_path_length_is_heard(&path, INT64_MIN, 0U) == SAGNAC_YES);
    {
        sagnac_path_length large = path;
        large.dark_sum = INT64_C(1) << 45;
        large.least_curvature_q8 = 65535U;
        EXPECT(sagnac_path_length_is_heard(&large, INT64_MAX / 2, UINT32_MAX) == SAGNAC_NO);
    }
}

static void loops(void)
{
    sagnac_path_length loop = path;
    sagnac_path_length_state now;
    sagnac_path_length_output output;
    sagnac_intensity lamp = light;
    sagnac_intensity_state lit;
    sagnac_intensity_output current;
    uint32_t tick;
    no_peak(path.sweep_periods);
    no_peak(0U);
    /* A locked loop at the end of its range goes by whole wavelengths; their number stays at its ends. */
    for (tick = 0U; tick < 4U; tick++) {
        uint32_t i;
        sagnac_path_length_start(&loop, &now);
        now.phase = SAGNAC_PATH_LOCKED;
        now.best = 0;
        now.modes = tick < 2U ? (tick == 0U ? INT32_MIN : INT32_MAX) : 0;
        now.integral_q32 = sagnac_q32(tick % 2U == 0U ? loop.reset_high : loop.reset_low);
        now.second_harmonic = 1;
        for (i = 0U; i < loop.ticks; i++) {
            sagnac_path_length_tick(&loop, &now, 4000000, &output);
        }
        EXPECT(now.phase == SAGNAC_PATH_MODE_RESET && (tick > 1U || now.modes == (tick == 0U ? INT32_MIN : INT32_MAX)));
    }
    /* Less than half a wavelength from the middle it still goes by one. */
    loop.wavelength = loop.high - loop.low;
    loop.reset_high = 1;
    loop.reset_low = -1;
    sagnac_path_length_start(&loop, &now);
    now.phase = SAGNAC_PATH_LOCKED;
    now.integral_q32 = sagnac_q32(2);
    for (tick = 0U; tick < loop.ticks; tick++) {
        sagnac_path_length_tick(&loop, &now, 4000000, &output);
    }
    EXPECT(now.phase == SAGNAC_PATH_MODE_RESET && (now.modes == 1 || now.modes == -1));
    /* A locked loop whose light no longer answers is lost within a loss time. */
    loop = path;
    sagnac_path_length_start(&loop, &now);
    now.phase = SAGNAC_PATH_LOCKED;
    for (tick = 0U; tick < loop.ticks * loop.lost_periods; tick++) {
        sagnac_path_length_tick(&loop, &now, 4000000, &output);
    }
    EXPECT(now.phase == SAGNAC_PATH_DARK && (now.status & SAGNAC_PATH_WAS_LOST) != 0U && (now.status & SAGNAC_PATH_NO_PEAK) != 0U);
    /* Closing for longer than it may is given up; a delayed detector uses the reference of then. */
    loop.delay = 3U;
    sagnac_path_length_start(&loop, &now);
    now.phase = SAGNAC_PATH_CLOSING;
    now.since = loop.give_up_periods;
    for (tick = 0U; tick < loop.ticks; tick++) {
        sagnac_path_length_tick(&loop, &now, 4000000, &output);
    }
    EXPECT(now.phase == SAGNAC_PATH_DARK && (now.status & SAGNAC_PATH_WAS_LOST) == 0U);
    /* A step of the search that no range holds is held too. */
    loop.sweep_step_q32 = INT64_C(1) << 62;
    loop.sweep_periods = 1000U;
    sagnac_path_length_start(&loop, &now);
    EXPECT(now.integral_q32 >= sagnac_q32(loop.low) && now.integral_q32 <= sagnac_q32(loop.high));
    /* A lamp that never lights fails after its tries; then it stays dark. */
    lamp.ignition_updates = lamp.rest_updates = 2U;
    lamp.tries = 2U;
    sagnac_intensity_start(&lamp, &lit);
    for (tick = 0U; tick < 100U * lamp.ticks; tick++) {
        sagnac_intensity_tick(&lamp, &lit, 0, 0U, &current);
    }
    EXPECT(lit.phase == SAGNAC_PHASE_FAILED && current.current == 0 && (current.status & SAGNAC_LIGHT_FAILED) != 0U);
    /* At the end of its range for longer than can be counted; a lamp with the most tries that goes dark. */
    sagnac_intensity_start(&lamp, &lit);
    lit.phase = SAGNAC_PHASE_RUNNING;
    lit.at_end = UINT32_MAX;
    lit.current = lamp.least;
    for (tick = 0U; tick < lamp.ticks; tick++) {
        sagnac_intensity_tick(&lamp, &lit, 8000000, 0U, &current);
    }
    EXPECT(lit.at_end == UINT32_MAX && (current.status & SAGNAC_LIGHT_END_OF_RANGE) != 0U);
    lamp.tries = 255U;
    lamp.dark_updates = 0U;
    for (tick = 0U; tick < 2U * lamp.ticks; tick++) {
        sagnac_intensity_tick(&lamp, &lit, 0, 0U, &current);
    }
    EXPECT(lit.phase == SAGNAC_PHASE_RESTING && lit.tries == 255U);
    lit.tries = 0U;
    lit.left = 0U;
    for (tick = 0U; tick < lamp.ticks; tick++) {
        sagnac_intensity_tick(&lamp, &lit, 0, 0U, &current);
    }
    EXPECT(lit.phase == SAGNAC_PHASE_IGNITING && lit.tries == 0U);
}

static void thermometers(void)
{
    static const int32_t codes[9] = {5, 5, 5, 5, 5, 5, 5, 5, 1000};
    static const sagnac_watch_spec no_heater = {100U, 10U, 0U};
    static const int32_t values[4] = {0, 0, 0, 0};
    sagnac_watch watch;
    sagnac_vote vote;
    sagnac_vote_of(codes, 9U, 511U, 1U, &vote);
    EXPECT(vote.voters == 8U && vote.code == 5 && vote.outvoted == 0U);
    sagnac_watch_start(&watch);
    EXPECT(sagnac_watch_update(&no_heater, &watch, values, 15U, 1U, 0) == 0U);
    EXPECT(sagnac_watch_update(&no_heater, &watch, values, 15U, 1U, INT32_MAX) == 0U);
}

int main(int argc, char **argv)
{
    static sagnac_octet table[512];
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    const uint32_t length = file == NULL ? 0U : (uint32_t)fread(table, 1, sizeof table, file);
    if (sagnac_path_length_load(&path, sagnac_octet_at, table, length) == 0U ||
        sagnac_intensity_load(&light, sagnac_octet_at, table, length) == 0U) {
        return 2;
    }
    EXPECT(sagnac_path_length_load(&path, sagnac_octet_at, table, length - 1U) == 0U);
    EXPECT(sagnac_intensity_load(&light, sagnac_octet_at, table, length - 1U) == 0U);
    table[100] ^= 1U;
    EXPECT(sagnac_is_loop_table(sagnac_octet_at, table, length) == SAGNAC_NO);
    table[100] ^= 1U;
    EXPECT(sagnac_is_loop_table(sagnac_octet_at, table, length) == SAGNAC_YES);
    table[8] = 3U;
    EXPECT(sagnac_is_loop_table(sagnac_octet_at, table, length) == SAGNAC_NO);
    loader();
    checks_of_a_made_image();
    identity();
    work();
    compensator();
    counting();
    frames();
    flash_that_fails();
    images_that_must_stay();
    trust_and_upload();
    bound_of_a_long_hold();
    board_counts();
    loops();
    crosstalk();
    thermometers();
    printf("edges: %lu expectations, %lu do not hold\n", expectations, failures);
    return failures == 0 ? 0 : 1;
}
