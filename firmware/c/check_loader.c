/*
 * The loaders against the verdicts of the Rust decoders.
 *
 *   check_loader FILE     0 if every image and table is accepted or refused as the file says
 *
 * The file: records of kind (0 image, 1 table of the loops), verdict (1 accepted), length (two bytes, little-endian), bytes.
 */
#include <stdio.h>

#include "sagnac_compensator.h"
#include "sagnac_intensity.h"
#include "sagnac_path_length.h"

#define MOST 772U

static unsigned char bytes[MOST];

static uint32_t octet(const void *context, uint32_t index)
{
    (void)context;
    return index < MOST ? bytes[index] : 0U;
}

static int accepted(int kind, uint32_t length)
{
    static sagnac_image image;
    static sagnac_path_length path;
    static sagnac_intensity light;
    if (kind == 0) {
        return sagnac_image_load(&image, octet, bytes, length) == SAGNAC_IMAGE_OK;
    }
    return sagnac_path_length_load(&path, octet, bytes, length) != 0U &&
           sagnac_intensity_load(&light, octet, bytes, length) != 0U;
}

int main(int argc, char **argv)
{
    unsigned char head[4];
    long records = 0, good = 0, wrong = 0;
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL) {
        return 2;
    }
    while (fread(head, 1, 4, file) == 4) {
        const uint32_t length = (uint32_t)head[2] | ((uint32_t)head[3] << 8);
        int found;
        if (length > MOST || fread(bytes, 1, length, file) != length) {
            return 2;
        }
        found = accepted(head[0], length);
        good += found;
        if (found != head[1]) {
            printf("record %ld, kind %d: %s here, %s there\n", records, head[0], found ? "accepted" : "refused",
                   head[1] != 0 ? "accepted" : "refused");
            wrong++;
        }
        records++;
    }
    fclose(file);
    printf("%ld images and tables, %ld of them accepted, %ld verdicts differ\n", records, good, wrong);
    return wrong == 0 && good > 0 && good < records ? 0 : 1;
}
