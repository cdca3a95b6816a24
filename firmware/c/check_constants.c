/*
 * The constants of sagnac_unit.c against the bytes that they were made from.
 *
 *   check_constants IMAGE LOOPS     0 if both are the same field by field
 */
#include <stdio.h>
#include <string.h>

#include "sagnac_unit.h"

/* Its own name, whatever the axis is called: -DIMAGE=sagnac_image_x. */
#ifndef IMAGE
#error "say which image: -DIMAGE=sagnac_image_x"
#endif

#define MOST 772U

typedef struct {
    unsigned char bytes[MOST];
} file_bytes;

static uint32_t octet(const void *context, uint32_t index)
{
    const file_bytes *from = context;
    return index < MOST ? from->bytes[index] : 0U;
}

static uint32_t read_file(const char *name, file_bytes *into)
{
    size_t length = 0;
    FILE *file = fopen(name, "rb");
    if (file != NULL) {
        length = fread(into->bytes, 1, MOST, file);
        fclose(file);
    }
    return (uint32_t)length;
}

int main(int argc, char **argv)
{
    static file_bytes bytes;
    static sagnac_image image;
    static sagnac_path_length path;
    static sagnac_intensity light;
    uint32_t length;
    int wrong = 0;
    if (argc != 3) {
        return 2;
    }
    length = read_file(argv[1], &bytes);
    /* Static memory begins as zeros, so that what neither sets is equal. */
    wrong += sagnac_image_load(&image, octet, &bytes, length) != SAGNAC_IMAGE_OK;
    wrong += memcmp(&image, &IMAGE, sizeof image) != 0;
    wrong += sagnac_image_check(&IMAGE) != SAGNAC_IMAGE_OK;
    length = read_file(argv[2], &bytes);
    wrong += sagnac_path_length_load(&path, octet, &bytes, length) == 0U;
    wrong += memcmp(&path, &sagnac_unit_path_length, sizeof path) != 0;
    wrong += sagnac_intensity_load(&light, octet, &bytes, length) == 0U;
    wrong += memcmp(&light, &sagnac_unit_intensity, sizeof light) != 0;
    printf("%d differences\n", wrong);
    return wrong == 0 ? 0 : 1;
}
