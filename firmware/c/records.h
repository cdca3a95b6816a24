/* Little-endian numbers of the records that the checking programs read. */
#ifndef RECORDS_H
#define RECORDS_H

#include <stdint.h>
#include <stdio.h>

static uint32_t word(FILE *file, int count)
{
    uint32_t value = 0U;
    int i;
    for (i = 0; i < count; i++) {
        value |= (uint32_t)(fgetc(file) & 255) << (8 * i);
    }
    return value;
}

static int32_t as_signed(uint32_t value)
{
    return value <= UINT32_C(0x7fffffff) ? (int32_t)value : -(int32_t)(UINT32_MAX - value) - 1;
}

#endif
