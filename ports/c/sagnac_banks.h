/*
 * Two flash banks: the active image and the one before it.
 *
 *   store:      erase the other bank -> image -> head -> commit word, each part read back
 *   load:       the last stored of the banks that are committed, intact, for this gyro and not withdrawn
 *   roll back:  one note in the older bank: the newer image is withdrawn
 *   trial:      start 1, 2, 3, 4: a mark each -> confirm, or start 5 rolls back by itself
 *   watchdog:   four resets in a row -> the active image is set aside; eight -> the other one too
 *
 * A store never erases the only confirmed image, and nothing while neither bank can be read.
 *
 * Step for step the Rust crate sagnac-core; the bytes are those of docs/reference/image-format.md, so that either language reads what
 * the other stored. Power may fail at any step: a load then finds the old image or the new one.
 *
 * Call it from the main loop, not from the tick: an erase takes milliseconds. It fails where both banks are damaged at once (then the
 * factory defaults run, and `origin` says so), and on a flash that reads differently each time.
 */
#ifndef SAGNAC_BANKS_H
#define SAGNAC_BANKS_H

#include <stdint.h>

#include "sagnac_compensator.h"
#include "sagnac_hash.h"
#include "sagnac_identity.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Octets that a bank uses; its size is at least this, and a multiple of the flash's erase size. */
#define SAGNAC_BANK_LENGTH 1184U
/* Every part of a bank begins at a multiple of this, and is programmed once between two erases. */
#define SAGNAC_REGION 32U
/* The image's area: whole regions. */
#define SAGNAC_IMAGE_AREA 800U
/* Starts that an image on trial has: at the next one it is withdrawn. */
#define SAGNAC_TRIAL_STARTS 4U

/* A NOR flash. Programming only clears bits. Each function: SAGNAC_YES when it is done. */
typedef struct {
    void *context;
    uint32_t capacity;
    uint32_t read_size;    /* these two divide SAGNAC_REGION */
    uint32_t program_size;
    uint32_t erase_size;
    uint32_t (*read)(void *context, uint32_t offset, sagnac_octet *octets, uint32_t count);
    uint32_t (*program)(void *context, uint32_t offset, const sagnac_octet *octets, uint32_t count);
    uint32_t (*erase)(void *context, uint32_t from, uint32_t to);
} sagnac_flash;

/* What a bank holds. */
typedef enum {
    SAGNAC_BANK_UNCOMMITTED = 0, /* erased, or a store that was cut before its commit word */
    SAGNAC_BANK_VALID = 1,
    SAGNAC_BANK_WITHDRAWN = 2,
    SAGNAC_BANK_DAMAGED = 3,
    SAGNAC_BANK_NO_IMAGE = 4, /* intact octets that are refused as an image */
    SAGNAC_BANK_MISMATCH = 5, /* an intact image for another gyro */
    SAGNAC_BANK_UNREADABLE = 6,
    SAGNAC_BANK_SET_ASIDE = 7 /* valid, and running when the watchdog reset the board again and again */
} sagnac_bank_content;

typedef struct {
    sagnac_bank_content content;
    uint32_t stored;            /* number of the store that wrote it; 0 where commit word, head and octets are not intact */
    uint32_t sequence;          /* valid: the image's own number */
    sagnac_image_error error;   /* no image: why */
    sagnac_mismatch mismatch;   /* mismatch: which */
    uint32_t has_note;          /* the other bank's images are withdrawn up to store `note` */
    uint32_t note;
    uint32_t trial;             /* valid: on trial and not confirmed */
} sagnac_bank;

/* Where the active image comes from. */
typedef enum {
    SAGNAC_NEWEST = 0,
    SAGNAC_ONLY_SURVIVOR = 1, /* the other bank is damaged, set aside, for another gyro, or a copy: it may be the older of the two */
    SAGNAC_FACTORY_DEFAULTS = 2
} sagnac_origin;

/* What flash holds for a gyro. */
typedef struct {
    sagnac_image image;
    uint32_t image_sum;                 /* sagnac_image_sum of the image, made here so that the tick does not wait for it */
    sagnac_octet digest[SAGNAC_DIGEST]; /* SHA-256 of the image's octets; zeros for the factory defaults */
    sagnac_origin origin;
    uint32_t trial;
    sagnac_bank banks[2];
} sagnac_loaded;

/* Result of a store, a confirmation or a roll back. After anything but SAGNAC_STORE_DONE a load tells what is active: for a store the
 * image from before; else either of the two. */
typedef enum {
    SAGNAC_STORE_DONE = 0,
    SAGNAC_STORE_NO_IMAGE = 1,       /* the octets are no image */
    SAGNAC_STORE_MISMATCH = 2,       /* for another gyro, or beyond its limits */
    SAGNAC_STORE_NOT_NEWER = 3,      /* its sequence number is not after that of the active image (RFC 1982), or 0 */
    SAGNAC_STORE_NO_OLDER_IMAGE = 4, /* nothing to go back to */
    SAGNAC_STORE_NO_FREE_NOTE = 5,   /* all places for a note are used by attempts that were cut */
    SAGNAC_STORE_NOT_ON_TRIAL = 6,
    SAGNAC_STORE_READ_BACK = 7,      /* worn out or write-protected */
    SAGNAC_STORE_FLASH = 8,          /* the flash reported an error */
    SAGNAC_STORE_ON_TRIAL = 9        /* the active image is on trial over a confirmed one, which a store would erase */
} sagnac_store_result;

/* Two banks, and the room to check an image in; keep it in static memory. */
typedef struct {
    const sagnac_flash *flash;
    uint32_t base;
    uint32_t length;
    uint32_t aside; /* bit i: bank i is set aside */
    sagnac_image image;
    sagnac_octet area[SAGNAC_IMAGE_AREA];
} sagnac_banks;

/* Banks at `base` and `base + length`; SAGNAC_NO if they do not fit the flash. */
uint32_t sagnac_banks_open(sagnac_banks *banks, const sagnac_flash *flash, uint32_t base, uint32_t length);

/* Power-on or reset: counts a start of an image on trial, and loads. `watchdog_resets`: resets by the watchdog in a row, from memory that a
 * reset leaves alone; begin again at 0 at power-on and when the board has run for a minute. 0 without such memory: then only an image on
 * trial goes by itself. */
void sagnac_banks_start(sagnac_banks *banks, const sagnac_gyro *gyro, uint32_t watchdog_resets, sagnac_loaded *loaded);

/* The active image. Only reads the flash. */
void sagnac_banks_load(sagnac_banks *banks, const sagnac_gyro *gyro, sagnac_loaded *loaded);

/* What a store of this image would answer before it touches the flash. */
sagnac_store_result sagnac_banks_check(sagnac_banks *banks, const sagnac_gyro *gyro, const sagnac_octet *octets, uint32_t length);

/* Stores an image of `length` octets in the bank that is not active. With `trial` not 0 it is on trial until it is confirmed. */
sagnac_store_result sagnac_banks_store(sagnac_banks *banks, const sagnac_gyro *gyro, const sagnac_octet *octets, uint32_t length,
                                       uint32_t trial);

/* The active image is no longer on trial. */
sagnac_store_result sagnac_banks_confirm(sagnac_banks *banks, const sagnac_gyro *gyro);

/* Withdraws the active image; the one before it is active again. */
sagnac_store_result sagnac_banks_roll_back(sagnac_banks *banks, const sagnac_gyro *gyro);

#ifdef __cplusplus
}
#endif

#endif
