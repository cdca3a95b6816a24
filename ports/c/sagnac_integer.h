/*
 * Integers that every machine computes alike.
 *
 * Needs C99, int32_t, uint32_t, int64_t and uint64_t; no 8-bit type, so that machines whose char has 16 or 32 bits can
 * run it. No right shift of a negative number, no signed overflow, no conversion out of range: nothing here is left to
 * the compiler. Products stay within 64 bits because of the ranges that the loaders check.
 */
#ifndef SAGNAC_INTEGER_H
#define SAGNAC_INTEGER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Answers of the functions that return uint32_t for yes or no. */
#define SAGNAC_YES ((uint32_t)1)
#define SAGNAC_NO ((uint32_t)0)

/* Eight bits of a file, a frame or a flash, 0 to 255, in the smallest type that holds them: 16 bits where char has 16. */
typedef uint_least8_t sagnac_octet;

/* Gives byte `index` of an image or table: 0 to 255. sagnac_octet_at reads an array of octets. */
typedef uint32_t (*sagnac_read_octet)(const void *context, uint32_t index);

/* Octet `index` of an array: the reader of an image in memory, whose context is the array. */
uint32_t sagnac_octet_at(const void *context, uint32_t index);

/* A gain of mantissa * 2^-shift. */
typedef struct {
    int32_t mantissa;
    uint32_t shift;
} sagnac_gain;

/* 2^shift, shift 0 to 62. */
int64_t sagnac_power(uint32_t shift);

/* floor(value / 2^shift), shift 0 to 62. */
int64_t sagnac_floor_shift(int64_t value, uint32_t shift);

/* floor(value / 2^shift + 1/2), shift 0 to 62. */
int64_t sagnac_round_shift(int64_t value, uint32_t shift);

/* The value, held between two limits. */
int64_t sagnac_held(int64_t value, int64_t low, int64_t high);

/* The same for 32 bits. */
int32_t sagnac_held32(int32_t value, int32_t low, int32_t high);

/* |value| of 32 bits; 2^31 for the smallest. */
uint32_t sagnac_size32(int32_t value);

/* Codes as 2^-32 codes. */
int64_t sagnac_q32(int32_t code);

/* 2^-32 codes as codes, halves upward. */
int32_t sagnac_codes(int64_t q32);

/* error times the gain in 2^-32 codes, held to +-2^61; |error| <= 2^30. */
int64_t sagnac_gain_times(sagnac_gain gain, int32_t error);

/* SAGNAC_YES if both fields of a gain are in range: mantissa below 2^30 in size, shift 0 to 62. */
uint32_t sagnac_gain_is_sound(sagnac_gain gain);

/* Little-endian fields of an image or table. */
uint32_t sagnac_read_u16(sagnac_read_octet read, const void *context, uint32_t at);
uint32_t sagnac_read_u32(sagnac_read_octet read, const void *context, uint32_t at);
uint64_t sagnac_read_u64(sagnac_read_octet read, const void *context, uint32_t at);
int32_t sagnac_read_i16(sagnac_read_octet read, const void *context, uint32_t at);
int32_t sagnac_read_i32(sagnac_read_octet read, const void *context, uint32_t at);
int64_t sagnac_read_i64(sagnac_read_octet read, const void *context, uint32_t at);

/* The same, written. */
void sagnac_write_u16(sagnac_octet *octets, uint32_t at, uint32_t value);
void sagnac_write_u32(sagnac_octet *octets, uint32_t at, uint32_t value);

/* SAGNAC_YES if `count` octets are equal. */
uint32_t sagnac_are_equal(const sagnac_octet *some, const sagnac_octet *others, uint32_t count);

/* CRC-32/ISO-HDLC over `length` bytes from `from` on. */
uint32_t sagnac_crc32(sagnac_read_octet read, const void *context, uint32_t from, uint32_t length);

/* 1 if all of these bytes are zero, else 0. */
uint32_t sagnac_are_zero(sagnac_read_octet read, const void *context, uint32_t from, uint32_t length);

/* 1 if these bytes are a table of the loops (docs/reference/loop-table.md) by length, magic, version, head and checksum, else 0. */
uint32_t sagnac_is_loop_table(sagnac_read_octet read, const void *context, uint32_t length);

#ifdef __cplusplus
}
#endif

#endif
