/* Thermometers that disagree with each other: see sagnac_watch.h. */
#include "sagnac_watch.h"

#include "sagnac_integer.h"

/* |a - b|, which an unsigned 32-bit number always holds. */
static uint32_t distance_of(int32_t a, int32_t b)
{
    const int64_t difference = (int64_t)a - (int64_t)b;
    const int64_t size = (difference < 0) ? -difference : difference;
    return (uint32_t)size;
}

static void begin_at(sagnac_watched *place, int32_t value)
{
    uint32_t i;
    place->seen = 1U;
    place->low = value;
    place->high = value;
    for (i = 0U; i < SAGNAC_MAX_WATCHED; i++) {
        place->has_nearest[i] = 0U;
        place->nearest[i] = 0U;
    }
    place->has_command = 0U;
    place->command_low = 0;
    place->command_high = 0;
}

/* The place since it last moved: its extent, or begun again. */
static void follow(const sagnac_watch_spec *spec, sagnac_watched *place, int32_t value)
{
    if (place->seen == 0U) {
        begin_at(place, value);
    }
    if (value < place->low) {
        place->low = value;
    }
    if (value > place->high) {
        place->high = value;
    }
    if (distance_of(place->high, place->low) >= spec->still) {
        begin_at(place, value);
    }
}

/* Another thermometer has gone away from this one by `shows`. */
static uint32_t others_show(const sagnac_watch_spec *spec, sagnac_watched *place, uint32_t own, const int32_t *values,
                            uint32_t present)
{
    uint32_t shown = SAGNAC_NO;
    uint32_t i;
    for (i = 0U; i < SAGNAC_MAX_WATCHED; i++) {
        if ((i != own) && (((present >> i) & 1U) != 0U)) {
            const uint32_t distance = distance_of(values[i], values[own]);
            if ((place->has_nearest[i] == 0U) || (distance < place->nearest[i])) {
                place->has_nearest[i] = 1U;
                place->nearest[i] = distance;
            }
            if ((distance - place->nearest[i]) >= spec->shows) {
                shown = SAGNAC_YES;
            }
        }
    }
    return shown;
}

/* The command has moved by `command_shows` since this thermometer last moved. */
static uint32_t command_shows(const sagnac_watch_spec *spec, sagnac_watched *place, int32_t command)
{
    uint32_t shown = SAGNAC_NO;
    if ((place->has_command == 0U) || (command < place->command_low)) {
        place->command_low = command;
    }
    if ((place->has_command == 0U) || (command > place->command_high)) {
        place->command_high = command;
    }
    place->has_command = 1U;
    if ((spec->command_shows > 0U) && (distance_of(place->command_high, place->command_low) >= spec->command_shows)) {
        shown = SAGNAC_YES;
    }
    return shown;
}

void sagnac_watch_start(sagnac_watch *watch)
{
    uint32_t i;
    for (i = 0U; i < SAGNAC_MAX_WATCHED; i++) {
        begin_at(&watch->places[i], 0);
        watch->places[i].seen = 0U;
    }
}

/* SAG-CORE-024 */
uint32_t sagnac_watch_update(const sagnac_watch_spec *spec, sagnac_watch *watch, const int32_t *values, uint32_t present,
                             uint32_t has_command, int32_t command)
{
    uint32_t named = 0U;
    uint32_t i;
    for (i = 0U; i < SAGNAC_MAX_WATCHED; i++) {
        if (((present >> i) & 1U) != 0U) {
            sagnac_watched *place = &watch->places[i];
            uint32_t shown;
            follow(spec, place, values[i]);
            shown = others_show(spec, place, i, values, present);
            if (has_command != 0U) {
                shown |= command_shows(spec, place, command);
            }
            if (shown != 0U) {
                named |= (uint32_t)1U << i;
            }
        }
    }
    return named;
}

/* The present codes in rising order; how many. */
static uint32_t sorted_codes(const int32_t *codes, uint32_t count, uint32_t present, int32_t *sorted)
{
    uint32_t voters = 0U;
    uint32_t i;
    for (i = 0U; (i < count) && (i < SAGNAC_MAX_VOTERS); i++) {
        if (((present >> i) & 1U) != 0U) {
            uint32_t at = voters;
            while ((at > 0U) && (sorted[at - 1U] > codes[i])) {
                sorted[at] = sorted[at - 1U];
                at--;
            }
            sorted[at] = codes[i];
            voters++;
        }
    }
    return voters;
}

/* SAG-CORE-025 */
void sagnac_vote_of(const int32_t *codes, uint32_t count, uint32_t present, uint32_t agree, sagnac_vote *vote)
{
    int32_t sorted[SAGNAC_MAX_VOTERS] = {0, 0, 0, 0, 0, 0, 0, 0};
    const uint32_t voters = sorted_codes(codes, count, present, sorted);
    vote->has_code = 0U;
    vote->code = 0;
    vote->outvoted = 0U;
    vote->voters = voters;
    if (voters > 0U) {
        const uint32_t half = voters / 2U;
        const int64_t high = (int64_t)sorted[half];
        const int64_t low = ((voters % 2U) == 1U) ? high : (int64_t)sorted[half - 1U];
        const int32_t median = (int32_t)sagnac_floor_shift(low + high, 1U);
        const uint32_t apart = ((voters == 2U) && (distance_of(sorted[1], sorted[0]) > agree)) ? SAGNAC_YES : SAGNAC_NO;
        uint32_t i;
        for (i = 0U; (i < count) && (i < SAGNAC_MAX_VOTERS); i++) {
            const uint32_t far = ((voters > 2U) && (distance_of(codes[i], median) > agree)) ? SAGNAC_YES : SAGNAC_NO;
            if ((((present >> i) & 1U) != 0U) && ((apart | far) != 0U)) {
                vote->outvoted |= (uint32_t)1U << i;
            }
        }
        if (apart == 0U) {
            vote->has_code = 1U;
            vote->code = median;
        }
    }
}
