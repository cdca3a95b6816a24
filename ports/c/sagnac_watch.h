/*
 * Thermometers that disagree with each other: one that stands still while others move, and the vote of several.
 *
 *   values -> watch: since a thermometer last moved by `still`, has another gone away from it by `shows`?   -> it stands still
 *   codes  -> vote:  the median of three or more; farther than `agree` from it                            -> outvoted
 *
 * Bit for bit the Rust crate sagnac-core (watch.rs), which states what to choose for `shows` and `still`. Values are in one unit, for
 * example 2^-24 degC; all counts and distances are unsigned.
 */
#ifndef SAGNAC_WATCH_H
#define SAGNAC_WATCH_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SAGNAC_MAX_WATCHED 4U
#define SAGNAC_MAX_VOTERS 8U

/* What the watch takes as evidence. command_shows 0: there is no heater. */
typedef struct {
    uint32_t shows;
    uint32_t still;
    uint32_t command_shows;
} sagnac_watch_spec;

/* One thermometer since it last moved. */
typedef struct {
    uint32_t seen;
    int32_t low;
    int32_t high;
    uint32_t has_nearest[SAGNAC_MAX_WATCHED];
    uint32_t nearest[SAGNAC_MAX_WATCHED];
    uint32_t has_command;
    int32_t command_low;
    int32_t command_high;
} sagnac_watched;

typedef struct {
    sagnac_watched places[SAGNAC_MAX_WATCHED];
} sagnac_watch;

/* The result of a vote: has_code 0 if there is no code to use. */
typedef struct {
    uint32_t has_code;
    int32_t code;
    uint32_t outvoted;
    uint32_t voters;
} sagnac_vote;

/* At power-on. */
void sagnac_watch_start(sagnac_watch *watch);

/* The newest values; bit i of `present` is set where there is a sample. `has_command` 0: no command. Bit i of the result: thermometer i
 * stands still. */
uint32_t sagnac_watch_update(const sagnac_watch_spec *spec, sagnac_watch *watch, const int32_t *values, uint32_t present,
                             uint32_t has_command, int32_t command);

/* The median of `count` codes of one place, at most 8. */
void sagnac_vote_of(const int32_t *codes, uint32_t count, uint32_t present, uint32_t agree, sagnac_vote *vote);

#ifdef __cplusplus
}
#endif

#endif
