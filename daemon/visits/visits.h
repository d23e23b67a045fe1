/* daemon/visits/visits.h - visits on disk: a line of JSON and two pictures of each, in a folder for each day. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_VISITS_VISITS_H
#define SST_DAEMON_VISITS_VISITS_H

#include <jansson.h>
#include <stdbool.h>

#include "base/base.h"

struct sst_visits; /* opaque; any thread */

enum sst_visit_picture {
    SST_VISIT_CAMERA = 0, /* of the reference camera */
    SST_VISIT_SEEN = 1,   /* see-through, focused on the visitor */
};

/**
 * Writing is done by a thread of its own. A file that cannot be written is logged once until one is written again.
 *
 * @param dir   folder, created with the first visit; "": nothing is kept
 * @param days  older ones are removed; 0: nothing is kept
 * @return 0, -ENOMEM, -EAGAIN
 */
SST_MUST_CHECK int sst_visits_open(struct sst_visits **out, const char *dir, int days);
void sst_visits_configure(struct sst_visits *v, int days);
/** Whether ages count, by sst_clock_is_steady(); at first they do not. */
void sst_visits_clock(struct sst_visits *v, bool steady);

/**
 * Keep all visits within a share of the disk: beyond it the oldest that are not marked by sst_visits_keep() are
 * removed. If the marked ones alone exceed it, that is logged with their number once, and others are not stored.
 *
 * @param room_bytes  of which a tenth is theirs; 0: the disk
 * @param changed     called with the bytes that they take, from the thread that writes, until sst_visits_close(); NULL:
 * not
 */
void sst_visits_limit(struct sst_visits *v, int64_t room_bytes, void (*changed)(void *arg, int64_t bytes), void *arg);

/** Store a visit: the data of its event. Returns at once; while the disk hangs the oldest that wait are dropped.
 *  @param data  borrowed; its `visit` is the name, which begins with the day */
void sst_visits_put(struct sst_visits *v, const json_t *data);

/** Store a picture, in place of the one before. @param jpeg  owned from then on, to free with free() */
void sst_visits_put_picture(struct sst_visits *v, const char *visit, enum sst_visit_picture kind, uint8_t *jpeg,
                            size_t bytes);

/** Which visits to list; times as in the data, "2026-11-21T18:05:00.123Z" or shorter. NULL: any. */
struct sst_visits_query {
    const char *from, *to, *label, *zone;
    const char *before, *after; /* visits that came before or after a time, or a visit */
    const char *user;           /* of `reviewed`; NULL: any */
    int reviewed;               /* 1: reviewed by that user; -1: not; 0: any */
    int limit;                  /* at most: the newest; with `after` alone the oldest */
};

/** The data of visits that were there between the two times, newest first, with `pictures`: ["camera", "seen"], as far
 *  as there are any, `keep`, `reviewed` and `reviewed_by`. @return an array, or NULL: out of memory */
json_t *sst_visits_list(struct sst_visits *v, const struct sst_visits_query *query);

/**
 * Days on which visits came, the newest first: [{day, visits, reviewed}], counted as sst_visits_list() filters them by
 * label and zone.
 *
 * @param query       from, to: first and last day, "2026-11-21" of the time zone; NULL: any
 * @param offset_min  of the time zone, east of Greenwich positive
 * @return an array, or NULL: out of memory
 */
json_t *sst_visits_days(struct sst_visits *v, const struct sst_visits_query *query, int offset_min);

enum sst_visits_change {
    SST_VISITS_KEEP = 0,       /* for good, */
    SST_VISITS_RELEASE = 1,    /* ... or no longer than others */
    SST_VISITS_REVIEWED = 2,   /* a user has seen to it, */
    SST_VISITS_UNREVIEWED = 3, /* ... or not */
    SST_VISITS_DELETE = 4,     /* line and pictures for good */
};

/**
 * Change visits. A day's file is written once for all of its visits.
 *
 * @param names   array of names
 * @param user    of SST_VISITS_REVIEWED and SST_VISITS_UNREVIEWED, at most SST_VISITS_USER characters
 * @param failed  out, object of unchanged visits, {name: 0 - error}: -ENOENT (none of that name),
 * -EINPROGRESS (it has not gone yet and is not deleted), -EUSERS (reviewed by too many already), or the error of the
 * write
 * @return 0, -EBUSY (the disk hangs: nothing is changed), -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_visits_change(struct sst_visits *v, const json_t *names, enum sst_visits_change what,
                                     const char *user, json_t *failed);

#define SST_VISITS_USER 63

/** @param data  out, to free with free() @return 0, -ENOENT, -EINVAL (not a name), -EIO, -ENOMEM */
SST_MUST_CHECK int sst_visits_read_picture(struct sst_visits *v, const char *visit, enum sst_visit_picture kind,
                                           uint8_t **data, size_t *size);

/** Write waiting visits, for `wait_ms` at most, and free. NULL is fine. */
void sst_visits_close(struct sst_visits *v, int wait_ms);

#endif
