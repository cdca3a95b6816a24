/* Integers that every machine computes alike: see sagnac_integer.h. */
#include "sagnac_integer.h"

/* 2^32. */
#define ONE_Q32 ((int64_t)4294967296)
/* Length of a table of the loops, and of what its checksum covers. */
#define TABLE_LENGTH 512U
#define TABLE_BODY 508U
/* Largest size of a gain's mantissa. */
#define MAX_MANTISSA 1073741823U
/* Products of a gain are held to this, 2^-32 codes. */
#define MOST_Q32 ((int64_t)2305843009213693952)

int64_t sagnac_power(uint32_t shift)
{
    const uint64_t power = (uint64_t)1 << shift;
    return (int64_t)power;
}

int64_t sagnac_floor_shift(int64_t value, uint32_t shift)
{
    int64_t result;
    if (value >= 0) {
        const uint64_t shifted = (uint64_t)value >> shift;
        result = (int64_t)shifted;
    } else {
        /* -(value + 1) is not negative, and floor turns into truncation. */
        const int64_t turned = -(value + 1);
        const uint64_t shifted = (uint64_t)turned >> shift;
        result = -(int64_t)shifted - 1;
    }
    return result;
}

/* SAG-CORE-001 */
int64_t sagnac_round_shift(int64_t value, uint32_t shift)
{
    int64_t result = value;
    if (shift > 0U) {
        result = sagnac_floor_shift(value + sagnac_power(shift - 1U), shift);
    }
    return result;
}

int64_t sagnac_held(int64_t value, int64_t low, int64_t high)
{
    int64_t result = value;
    if (result < low) {
        result = low;
    }
    if (result > high) {
        result = high;
    }
    return result;
}

int32_t sagnac_held32(int32_t value, int32_t low, int32_t high)
{
    int32_t result = value;
    if (result < low) {
        result = low;
    }
    if (result > high) {
        result = high;
    }
    return result;
}

uint32_t sagnac_size32(int32_t value)
{
    uint32_t result;
    if (value >= 0) {
        result = (uint32_t)value;
    } else {
        result = (uint32_t)(-(value + 1)) + 1U;
    }
    return result;
}

int64_t sagnac_q32(int32_t code)
{
    return (int64_t)code * ONE_Q32;
}

int32_t sagnac_codes(int64_t q32)
{
    return (int32_t)sagnac_round_shift(q32, 32U);
}

int64_t sagnac_gain_times(sagnac_gain gain, int32_t error)
{
    const int64_t product = (int64_t)gain.mantissa * (int64_t)error;
    int64_t result;
    if (gain.shift > 32U) {
        result = sagnac_round_shift(product, gain.shift - 32U);
    } else {
        const uint32_t left = 32U - gain.shift;
        const int64_t most = sagnac_floor_shift(MOST_Q32, left);
        result = sagnac_held(product, -most, most) * sagnac_power(left);
    }
    return result;
}

uint32_t sagnac_gain_is_sound(sagnac_gain gain)
{
    const uint32_t fits = (sagnac_size32(gain.mantissa) <= MAX_MANTISSA) ? SAGNAC_YES : SAGNAC_NO;
    return (gain.shift <= 62U) ? fits : SAGNAC_NO;
}

uint32_t sagnac_read_u16(sagnac_read_octet read, const void *context, uint32_t at)
{
    return (read(context, at) & 0xFFU) | ((read(context, at + 1U) & 0xFFU) << 8);
}

uint32_t sagnac_read_u32(sagnac_read_octet read, const void *context, uint32_t at)
{
    return sagnac_read_u16(read, context, at) | (sagnac_read_u16(read, context, at + 2U) << 16);
}

uint64_t sagnac_read_u64(sagnac_read_octet read, const void *context, uint32_t at)
{
    const uint64_t low = sagnac_read_u32(read, context, at);
    const uint64_t high = sagnac_read_u32(read, context, at + 4U);
    return low | (high << 32);
}

int32_t sagnac_read_i16(sagnac_read_octet read, const void *context, uint32_t at)
{
    const int32_t value = (int32_t)sagnac_read_u16(read, context, at);
    return (value >= (int32_t)32768) ? (value - (int32_t)65536) : value;
}

int32_t sagnac_read_i32(sagnac_read_octet read, const void *context, uint32_t at)
{
    const int64_t value = (int64_t)sagnac_read_u32(read, context, at);
    return (int32_t)((value >= ((int64_t)2147483648)) ? (value - ONE_Q32) : value);
}

int64_t sagnac_read_i64(sagnac_read_octet read, const void *context, uint32_t at)
{
    const uint64_t value = sagnac_read_u64(read, context, at);
    int64_t result;
    if (value <= (uint64_t)INT64_MAX) {
        result = (int64_t)value;
    } else {
        const uint64_t turned = UINT64_MAX - value;
        result = -(int64_t)turned - 1;
    }
    return result;
}

uint32_t sagnac_octet_at(const void *context, uint32_t index)
{
    const sagnac_octet *octets = context;
    return (uint32_t)octets[index] & 0xFFU;
}

void sagnac_write_u16(sagnac_octet *octets, uint32_t at, uint32_t value)
{
    octets[at] = (sagnac_octet)(value & 0xFFU);
    octets[at + 1U] = (sagnac_octet)((value >> 8) & 0xFFU);
}

void sagnac_write_u32(sagnac_octet *octets, uint32_t at, uint32_t value)
{
    sagnac_write_u16(octets, at, value & 0xFFFFU);
    sagnac_write_u16(octets, at + 2U, value >> 16);
}

uint32_t sagnac_are_equal(const sagnac_octet *some, const sagnac_octet *others, uint32_t count)
{
    uint32_t equal = SAGNAC_YES;
    uint32_t index;
    for (index = 0U; index < count; index++) {
        if (some[index] != others[index]) {
            equal = SAGNAC_NO;
        }
    }
    return equal;
}

uint32_t sagnac_crc32(sagnac_read_octet read, const void *context, uint32_t from, uint32_t length)
{
    uint32_t crc = 0xFFFFFFFFU;
    uint32_t index;
    for (index = 0U; index < length; index++) {
        uint32_t bit;
        crc ^= read(context, from + index) & 0xFFU;
        for (bit = 0U; bit < 8U; bit++) {
            if ((crc & 1U) != 0U) {
                crc = (crc >> 1) ^ 0xEDB88320U;
            } else {
                crc >>= 1;
            }
        }
    }
    return crc ^ 0xFFFFFFFFU;
}

uint32_t sagnac_are_zero(sagnac_read_octet read, const void *context, uint32_t from, uint32_t length)
{
    uint32_t all = 1U;
    uint32_t index;
    for (index = 0U; index < length; index++) {
        if ((read(context, from + index) & 0xFFU) != 0U) {
            all = 0U;
        }
    }
    return all;
}

uint32_t sagnac_is_loop_table(sagnac_read_octet read, const void *context, uint32_t length)
{
    uint32_t is_table = SAGNAC_NO;
    if ((length == TABLE_LENGTH) && (sagnac_read_u32(read, context, 0U) == 0x4E474153U) &&
        (sagnac_read_u32(read, context, 4U) == 0x544C4341U) && (sagnac_read_u16(read, context, 8U) == 2U) &&
        (sagnac_crc32(read, context, 0U, TABLE_BODY) == sagnac_read_u32(read, context, TABLE_BODY))) {
        is_table = sagnac_are_zero(read, context, 10U, 2U) & sagnac_are_zero(read, context, 20U, 4U);
        /* Its own length, and a tick. */
        if ((sagnac_read_u32(read, context, 12U) != TABLE_LENGTH) || (sagnac_read_u32(read, context, 16U) == 0U)) {
            is_table = SAGNAC_NO;
        }
    }
    return is_table;
}
