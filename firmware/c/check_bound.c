/*
 * The bound of the error in C against records of the Rust crate, after each of 40 slow updates of an image.
 *
 *   check_bound FILE     0 if every bound is as the records say
 *
 * An image is its length (2), its octets, and 40 times: inputs with a sample (1), codes (4 times 4), the bound (4), little-endian.
 */
#include <stdio.h>

#include "records.h"
#include "sagnac_error_bound.h"

#define UPDATES 40

int main(int argc, char **argv)
{
    static sagnac_octet octets[SAGNAC_MAX_IMAGE];
    static sagnac_image image;
    static sagnac_compensator_state state;
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    unsigned long records = 0, wrong = 0;
    int low, i;
    if (file == NULL) {
        return 2;
    }
    while ((low = fgetc(file)) != EOF) {
        const uint32_t length = (uint32_t)low | (word(file, 1) << 8);
        sagnac_error_bound bound;
        int update;
        for (i = 0; i < (int)length && i < (int)SAGNAC_MAX_IMAGE; i++) {
            octets[i] = (sagnac_octet)word(file, 1);
        }
        if (sagnac_image_load(&image, sagnac_octet_at, octets, length) != SAGNAC_IMAGE_OK) {
            return 2;
        }
        sagnac_compensator_start(&state);
        sagnac_error_bound_start(&bound);
        for (update = 0; update < UPDATES; update++) {
            const uint32_t present = word(file, 1);
            int32_t codes[4];
            sagnac_output output;
            for (i = 0; i < 4; i++) {
                codes[i] = as_signed(word(file, 4));
            }
            (void)sagnac_compensator_update(&image, &state, codes, present);
            sagnac_error_bound_update(&bound, &image, &state);
            (void)sagnac_compensator_advance(&image, &state, 0, state.ticks_to_update, &output);
            wrong += bound.milli_dph != word(file, 4);
            records++;
        }
    }
    fclose(file);
    printf("bound of the error: %lu records, %lu differ\n", records, wrong);
    return wrong == 0 && records > 0 ? 0 : 1;
}
