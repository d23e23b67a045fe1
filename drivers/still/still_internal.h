/* drivers/still/still_internal.h - private declarations of this folder; code outside of it includes the public
 * header. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_STILL_STILL_INTERNAL_H
#define SST_DRIVERS_STILL_STILL_INTERNAL_H

#include <stdatomic.h>

#include "drivers/still/still.h"

/* --- lib: the calls of libgphoto2 (lib_gphoto.c), loaded at the first of them (lib.c)
 * ------------------------------------
 */

struct still_lib; /* opaque */

#define STILL_CHOICES 128

/** A setting as the camera reports it. */
struct still_setting {
    char value[SST_STILL_TEXT_MAX];
    int choices;
    char choice[STILL_CHOICES][SST_STILL_TEXT_MAX]; /* none: any value */
};

/** A file on the camera. */
struct still_path {
    char folder[256], name[SST_STILL_TEXT_MAX];
};

enum still_event {
    STILL_NOTHING = 0,
    STILL_FILE = 1,
    STILL_COMPLETE = 2,
    STILL_OTHER = 3, /* more may follow at once */
};

/*
 * All return 0 (or as stated) or: -ENODEV (gone), -EBUSY, -ETIMEDOUT, -EPERM (refused), -EACCES, -ENOMEDIUM (card full
 * or missing), -ENOMEM, -EIO. -ENOPKG (no libgphoto2). Nothing is logged;
 * still_lib_said() is the library's message about the last failure.
 */
SST_MUST_CHECK int still_lib_open(struct still_lib **out, int bus, int address, int response_ms);
void still_lib_close(struct still_lib *lib); /* NULL is fine */
const char *still_lib_said(const struct still_lib *lib);

/** -ENOENT: it has no setting of this name. */
SST_MUST_CHECK int still_lib_read(struct still_lib *lib, const char *name, struct still_setting *out);
SST_MUST_CHECK int still_lib_write(struct still_lib *lib, const char *name, const char *value);
SST_MUST_CHECK int still_lib_storage(struct still_lib *lib, struct sst_still_state *state);
SST_MUST_CHECK int still_lib_release(struct still_lib *lib);
/** @return enum still_event; the path of a file */
SST_MUST_CHECK int still_lib_event(struct still_lib *lib, int timeout_ms, struct still_path *path);
/** All files on the camera. @param list  out, to free with free() */
SST_MUST_CHECK int still_lib_list(struct still_lib *lib, struct still_path **list, int *count);
SST_MUST_CHECK int still_lib_size(struct still_lib *lib, const struct still_path *path, size_t *bytes);
/** @param data  out, to free with free() */
SST_MUST_CHECK int still_lib_download(struct still_lib *lib, const struct still_path *path, uint8_t **data,
                                      size_t *bytes);
SST_MUST_CHECK int still_lib_delete(struct still_lib *lib, const struct still_path *path);

/* --- the camera --------------------------------------------------------------------------------------------------- */

#define STILL_SETTINGS 5
#define STILL_SEEN     64 /* downloads that are recognised when they come again */

struct sst_still {
    /* fixed after open */
    struct sst_still_config cfg; /* texts: below */
    char wanted[STILL_SETTINGS][SST_STILL_TEXT_MAX];
    char serial[SST_STILL_TEXT_MAX], port[SST_STILL_TEXT_MAX];
    /* the camera */
    struct still_lib *lib;                    /* NULL: lost */
    int bus, address;                         /* where it is open */
    bool low;                                 /* warned of its battery */
    const char *setting_name[STILL_SETTINGS]; /* by which the camera has it; NULL: not looked up */
    char settings[256];
    struct sst_still_state state;
    struct sst_still_counters count;
    struct still_path path[SST_STILL_FILES_MAX]; /* of the last exposure */
    int paths;
    /* files of other exposures (announced.c) */
    int64_t unsure_ns;        /* until then files of an earlier release may be announced */
    struct still_path *known; /* [known_count]: on the card when it was opened, or passed over */
    int known_count, known_room;
    struct still_path done[SST_STILL_FILES_MAX]; /* deleted after the last exposure; their names may come again */
    int done_count;
    struct {
        size_t bytes; /* 0: none */
        uint64_t hash;
    } seen[STILL_SEEN];
    int seen_next;
};

/* still.c */
bool still_cancelled(const struct sst_still *s);
void still_sleep_ms(int ms);

/* announced.c */
/** After opening: files on the card belong to no exposure of this session. @return 0 or -errno, logged */
SST_MUST_CHECK int still_card_read(struct sst_still *s);
/** A file that stays on the card belongs to no later exposure. @return 0 or -ENOMEM, logged */
SST_MUST_CHECK int still_know(struct sst_still *s, const struct still_path *path);
/** Announcements until then, and until the camera announces nothing for timeout_ms, are no part of the next
 *  exposure. @return 0 or -errno, logged */
SST_MUST_CHECK int still_drain(struct sst_still *s, int timeout_ms, int64_t until_ns);
/** Wait until the camera has announced as many files as an exposure has: s->path. @return 0 or -errno, logged */
SST_MUST_CHECK int still_wait_files(struct sst_still *s, int wanted, int64_t release_ns);
/** Were these bytes downloaded before? */
bool still_seen(const struct sst_still *s, const uint8_t *data, size_t bytes);
void still_see(struct sst_still *s, const uint8_t *data, size_t bytes);

/* settings.c */
/** Set the wanted settings and read them back. @return 0, -EINVAL, -EPERM or an error of the library; logged */
SST_MUST_CHECK int still_settings_apply(struct sst_still *s);
/** Battery, and the serial number. */
SST_MUST_CHECK int still_settings_status(struct sst_still *s);
/** The focus mode: for SST_STILL_FOCUS_LOCKED's one exposure, and manual. Logged. */
SST_MUST_CHECK int still_settings_focus(struct sst_still *s, bool automatic);
/** Index of the choice that a text stands for: the same words, or the same number ("1/125" and "0.0080s"), else -1. */
int still_choice_find(const struct still_setting *setting, const char *text);

/* lost.c */
/** The library failed: log the failure, count it, and close the camera if it is gone or hangs. @return err */
int still_failed(struct sst_still *s, int err, const char *what);
/** Open again if the camera was lost. @return 0 or -errno, logged */
SST_MUST_CHECK int still_reopen(struct sst_still *s);
/** Find the camera and open it. @return 0 or -errno, logged */
SST_MUST_CHECK int still_find(struct sst_still *s);

#endif
