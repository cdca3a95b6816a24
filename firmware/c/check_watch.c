/*
 * The watch and the vote in C against records of the Rust crate: 24 little-endian words each.
 *
 *   check_watch FILE
 *
 *   0 to 2   shows, still, command_shows; a record of a new spec begins again      3        present
 *   4 to 7   values                                                                8, 9     has_command, command
 *   10       named                                                                 11       1 for a new spec
 *   12       agree      13 present      14 to 21 codes      22   has_code | outvoted << 8 | voters << 16      23   code
 */
#include <stdio.h>

#include "sagnac_watch.h"

#define WORDS 24

static int read_record(FILE *file, uint32_t *words)
{
    unsigned char bytes[4 * WORDS];
    int i;
    if (fread(bytes, 1, sizeof bytes, file) != sizeof bytes) {
        return 0;
    }
    for (i = 0; i < WORDS; i++) {
        const unsigned char *at = bytes + 4 * i;
        words[i] = (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
    }
    return 1;
}

static int32_t as_signed(uint32_t word)
{
    return word <= UINT32_C(0x7fffffff) ? (int32_t)word : -(int32_t)(UINT32_MAX - word) - 1;
}

int main(int argc, char **argv)
{
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    uint32_t words[WORDS];
    static sagnac_watch watch;
    unsigned records = 0U, wrong = 0U;
    if (file == NULL) {
        return 2;
    }
    sagnac_watch_start(&watch);
    while (read_record(file, words)) {
        const sagnac_watch_spec spec = {words[0], words[1], words[2]};
        int32_t values[4], codes[8];
        sagnac_vote vote;
        int i;
        for (i = 0; i < 4; i++) {
            values[i] = as_signed(words[4 + i]);
        }
        for (i = 0; i < 8; i++) {
            codes[i] = as_signed(words[14 + i]);
        }
        if (words[11] != 0U) {
            sagnac_watch_start(&watch);
        }
        wrong += sagnac_watch_update(&spec, &watch, values, words[3], words[8], as_signed(words[9])) != words[10];
        sagnac_vote_of(codes, 8U, words[13], words[12], &vote);
        wrong += (vote.has_code | vote.outvoted << 8 | vote.voters << 16) != words[22];
        wrong += vote.code != as_signed(words[23]);
        records++;
    }
    fclose(file);
    printf("watch and vote: %u records, %u differ\n", records, wrong);
    return wrong == 0U && records > 0U ? 0 : 1;
}
