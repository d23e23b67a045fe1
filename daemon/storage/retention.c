/* Retention thread: creates and locks the folder, measures usage, removes entries beyond the limits, repairs torn
 * recordings. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/recording/trim.h"
#include "daemon/storage/storage_internal.h"

#define PASS_MS     500
#define RESCAN_NS   60000000000
#define MARGIN_S    2  /* of sets that may arrive between two passes */
#define PARTS       10 /* of the room: at most one part is removed at once */
#define PART_MIN    ((int64_t)1 << 20)
#define PROBE_BYTES ((size_t)256 << 10)

/* Retention thread only. */
struct retention {
    struct sst_storage *s;
    int lock_fd;  /* -1: the folder is not locked yet */
    dev_t dev[2]; /* of dir and its recordings/, as they were when it was locked */
    ino_t ino[2];
    bool scanned;
    int64_t scan_ns; /* of the last scan */
    struct sst_clock_watch clock;
    bool steady; /* is the wall clock, so that ages count */
    bool stuck; /* the active recording cannot be trimmed */
    char said[SST_LOG_MAX];
};

/* --- the folder --------------------------------------------------------------------------------------------------- */

static void set_folder_error(struct retention *r, int err, const char *text)
{
    struct sst_storage *s = r->s;

    pthread_mutex_lock(&s->lock);
    s->blocked = true;
    if (s->folder_err != err)
        snprintf(s->folder_text, sizeof(s->folder_text), "%s", text);
    s->folder_err = err;
    s->checked_ns = sst_clock_now_ns();
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
}

static void report_folder(struct retention *r, int err, const char *path)
{
    const char *remedy = err == -EROFS    ? "mount it writable"
                         : err == -EACCES ? "give it and all in it to the user of the service (chown -R)"
                         : err == -ENOSPC ? "free space there"
                         : err == -ENOENT ? "mount its disk, or name another storage.dir"
                                          : "check the disk";
    char text[SST_STORE_TEXT];

    snprintf(text, sizeof(text), "cannot write to %.300s: %s; %s; recording then resumes by itself", path,
             strerror(-err), remedy);
    set_folder_error(r, err, text);
}

/* Another service in the same folder would remove and repair the files that this one writes. */
static int lock_folder(struct retention *r)
{
    char path[SST_PATH_MAX], text[SST_STORE_TEXT], pid[32] = "";
    int fd, err = sst_path_join(path, r->s->dir, ".lock");
    ssize_t n;

    fd = err ? -1 : open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (fd < 0) {
        err = err ? err : -errno;
        report_folder(r, err, r->s->dir);
        return err;
    }
    if (flock(fd, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK) {
        n = pread(fd, pid, sizeof(pid) - 1, 0);
        close(fd);
        snprintf(text, sizeof(text),
                 "%.300s is in use by another sstd (process %d); stop it or set another storage.dir", r->s->dir,
                 n > 0 ? atoi(pid) : 0);
        set_folder_error(r, -EBUSY, text);
        return -EBUSY;
    } /* on a file system without locks nothing is locked */
    n = snprintf(pid, sizeof(pid), "%d\n", (int)getpid());
    if (ftruncate(fd, 0) || pwrite(fd, pid, (size_t)n, 0) != n)
        sst_log_debug("cannot write the process id into %s", path);
    r->lock_fd = fd;
    return 0;
}

static int make_folders(struct retention *r)
{
    struct sst_storage *s = r->s;
    int err = mkdir(s->dir, 0777) && errno != EEXIST ? -errno : 0;

    for (int i = 0; !err && i < SST_STORE_KINDS; i++)
        err = mkdir(s->folder[i], 0777) && errno != EEXIST ? -errno : 0;
    if (err)
        report_folder(r, err, s->dir);
    return err;
}

/* Do the paths still lead to the folders that were locked? */
static bool is_same_folder(struct retention *r)
{
    const char *const path[] = { r->s->dir, r->s->folder[SST_STORE_RECORDING] };
    struct stat st;

    for (int i = 0; i < 2; i++) {
        if (stat(path[i], &st) || st.st_dev != r->dev[i] || st.st_ino != r->ino[i])
            return false;
    }
    return true;
}

static void remember_folder(struct retention *r)
{
    const char *const path[] = { r->s->dir, r->s->folder[SST_STORE_RECORDING] };
    struct stat st = { 0 };

    for (int i = 0; i < 2; i++) {
        (void)stat(path[i], &st); /* a failure shows again in the next pass */
        r->dev[i] = st.st_dev;
        r->ino[i] = st.st_ino;
    }
}

/* The folder was removed, or another file system is mounted over it: the catalog no longer describes it. */
static void drop_folder(struct retention *r)
{
    struct sst_storage *s = r->s;
    const int64_t until_ns = sst_clock_now_ns() + 2000000000;
    char text[SST_STORE_TEXT];

    snprintf(text, sizeof(text), "%.300s was removed, or another file system was mounted there", s->dir);
    set_folder_error(r, -EIO, text);
    pthread_mutex_lock(&s->lock);
    s->ready = false;
    s->active_lost = s->active_name[0] != 0;
    /* Wait until nothing is written there and sst-state has reported it; then the folder may be created again. */
    while ((s->active_name[0] || s->trouble != SST_TROUBLE_FOLDER || strcmp(s->reason, text)) && !s->stop &&
           sst_clock_now_ns() < until_ns)
        store_wait_locked(s, 100);
    if (!s->active_name[0])
        catalog_fini(&s->catalog);
    pthread_mutex_unlock(&s->lock);
    close(r->lock_fd);
    r->lock_fd = -1;
    r->scanned = false;
}

/* The active recording alone may have been removed. */
static void check_active(struct retention *r)
{
    struct sst_storage *s = r->s;
    char name[SST_STORE_NAME], path[SST_PATH_MAX];

    pthread_mutex_lock(&s->lock);
    memcpy(name, s->active_name, sizeof(name));
    pthread_mutex_unlock(&s->lock);
    if (!name[0] || sst_path_join(path, s->folder[SST_STORE_RECORDING], name) || !access(path, F_OK))
        return;
    pthread_mutex_lock(&s->lock);
    s->active_lost |= !strcmp(s->active_name, name);
    pthread_mutex_unlock(&s->lock);
}

/* --- scanning ------------------------------------------------------------------------------------------------ */

/* Both catalogs have the same order: the search continues behind the last hit. With ten thousand entries the lock would
 * be held too long otherwise. */
static bool find_next(const struct catalog *c, const char *name, int *next)
{
    for (int k = 0; k < c->count; k++) {
        const int i = (*next + k) % c->count;

        if (!strcmp(c->entry[i].name, name)) {
            *next = i + 1;
            return true;
        }
    }
    return false;
}

/* Entries of this order or a higher one may appear in the folder while it is scanned. */
static uint64_t unsettled_order(struct sst_storage *s)
{
    uint64_t order;

    pthread_mutex_lock(&s->lock);
    order = s->catalog.order + 1;
    for (int i = 0; i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];

        if (e->stage == SST_STORE_ACTIVE && e->order < order)
            order = e->order;
    }
    pthread_mutex_unlock(&s->lock);
    return order;
}

/* Add new entries and drop the ones with removed folders. */
static void merge_locked(struct sst_storage *s, const struct catalog *found, bool first, uint64_t unsettled)
{
    bool empty;
    int next = 0;

    for (int i = 0; i < s->catalog.count;) {
        const struct store_entry *e = &s->catalog.entry[i];

        if (e->order >= unsettled || find_next(found, e->name, &next))
            i++;
        else
            catalog_remove(&s->catalog, e->name);
    }
    empty = !s->catalog.count;
    next = 0;
    for (int i = 0; i < found->count; i++) {
        struct store_entry e = found->entry[i];
        const struct store_entry *known =
            !empty && find_next(&s->catalog, e.name, &next) ? &s->catalog.entry[next - 1] : NULL;

        if (known && known->stage == SST_STORE_KEPT)
            catalog_update(&s->catalog, &e); /* repaired again */
        if (known)
            continue;
        if (!first && e.stage == SST_STORE_TORN)
            e.stage = SST_STORE_KEPT; /* not killed: it may have ended between two scans */
        if (catalog_add(&s->catalog, &e))
            break;
    }
}

static int scan(struct retention *r)
{
    struct sst_storage *s = r->s;
    struct catalog found = { 0 };
    const uint64_t unsettled = unsettled_order(s);
    const bool first = !r->scanned;
    int err = 0;

    for (int i = 0; !err && i < SST_STORE_KINDS; i++)
        err = store_scan(s->folder[i], (enum store_kind)i, first, &found);
    if (!err) {
        pthread_mutex_lock(&s->lock);
        merge_locked(s, &found, first, unsettled);
        s->ready = true;
        pthread_mutex_unlock(&s->lock);
        r->scanned = true;
        r->scan_ns = sst_clock_now_ns();
    } else {
        report_folder(r, err, s->dir);
    }
    catalog_fini(&found);
    return err;
}

/* Bytes and segments of the active recording as they are on disk; its thread adds the bytes written meanwhile. */
static void measure_active(struct retention *r)
{
    struct sst_storage *s = r->s;
    char name[SST_STORE_NAME], path[SST_PATH_MAX];
    struct store_entry *e;
    int64_t before = 0, bytes;
    int segments;

    pthread_mutex_lock(&s->lock);
    memcpy(name, s->active_name, sizeof(name));
    e = name[0] ? catalog_find(&s->catalog, name) : NULL;
    before = e ? e->bytes : 0;
    pthread_mutex_unlock(&s->lock);
    if (!e || sst_path_join(path, s->folder[SST_STORE_RECORDING], name))
        return;
    bytes = store_bytes(path);
    segments = r->stuck ? 0 : sst_recording_segments(path);
    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, name);
    if (e && e->stage == SST_STORE_ACTIVE) {
        /* Bytes written meanwhile are estimated, never too low; without any the measured value replaces it. */
        if (e->bytes == before || bytes > e->bytes)
            e->bytes = bytes;
        e->segments = segments;
    }
    pthread_mutex_unlock(&s->lock);
}

/* --- limits ------------------------------------------------------------------------------------------------------- */

static int64_t margin_of(const struct store_settings *set, int64_t limit_bytes, int64_t set_bytes)
{
    const double rate = set->array.recorder.rate_hz > 0 ? set->array.recorder.rate_hz : 1;
    const double want = fmax((double)limit_bytes / 20, MARGIN_S * rate * (double)set_bytes);

    return (int64_t)fmin(want, (double)limit_bytes / 4);
}

static int64_t set_bytes(struct sst_ring *ring)
{
    struct sst_ring_counters c;

    sst_ring_counters(ring, &c);
    return c.sets > 0 ? (int64_t)(c.bytes / (uint64_t)c.sets) : 0;
}

static int measure(struct retention *r, struct store_room *room, struct store_limits *limits)
{
    struct sst_storage *s = r->s;
    const int64_t one = set_bytes(s->ring);
    struct statvfs v;
    int64_t quota_margin, free_margin;

    if (statvfs(s->folder[SST_STORE_RECORDING], &v))
        return -errno;
    measure_active(r);
    pthread_mutex_lock(&s->lock);
    *limits = s->settings.limits;
    quota_margin = margin_of(&s->settings, limits->quota_bytes, one);
    free_margin = margin_of(&s->settings, limits->min_free_bytes, one);
    limits->margin_bytes =
        limits->quota_bytes && (!free_margin || quota_margin < free_margin) ? quota_margin : free_margin;
    s->settings.limits.margin_bytes = limits->margin_bytes;
    *room = (struct store_room){ .used_bytes = store_used_locked(s),
                                 .free_bytes = (int64_t)fmin((double)v.f_bavail * (double)v.f_frsize, 9e18),
                                 .waiting_bytes = s->waiting_bytes,
                                 .wall_ns = sst_clock_wall_ns(),
                                 .clock_steady = r->steady };
    s->used_bytes = room->used_bytes;
    s->free_bytes = room->free_bytes;
    s->manual_bytes = store_manual_bytes(limits, room);
    s->part_bytes = store_room_bytes(limits, room) / PARTS;
    s->part_bytes = s->part_bytes < PART_MIN ? PART_MIN : s->part_bytes;
    pthread_mutex_unlock(&s->lock);
    return 0;
}

static void set_limit(struct retention *r, enum store_trouble limit, const struct store_limits *l,
                      const struct store_room *room)
{
    struct sst_storage *s = r->s;
    /* After a removal both values may be within their limits again: the free space is the cause while it is low. */
    const bool room_lacks = l->min_free_bytes && room->free_bytes / 2 < l->min_free_bytes;
    const bool quota = l->quota_bytes && (!room_lacks || room->used_bytes > l->quota_bytes - 2 * l->margin_bytes);
    const double gb = 1e-9;

    pthread_mutex_lock(&s->lock);
    if (limit != s->limit && limit == SST_TROUBLE_LIMIT && quota)
        snprintf(s->limit_text, sizeof(s->limit_text),
                 "%.300s uses %.3g GB of quota_gb %.3g and nothing is left to remove; raise quota_gb", s->dir,
                 (double)room->used_bytes * gb, (double)l->quota_bytes * gb);
    else if (limit != s->limit && limit == SST_TROUBLE_LIMIT)
        snprintf(s->limit_text, sizeof(s->limit_text),
                 "%.3g GB are free in %.300s, less than min_free_gb %.3g, and nothing is left to remove; free space "
                 "there",
                 (double)room->free_bytes * gb, s->dir, (double)l->min_free_bytes * gb);
    else if (limit != s->limit && limit == SST_TROUBLE_LIMIT_LOW)
        snprintf(s->limit_text, sizeof(s->limit_text), "the oldest recordings are being removed to stay within %s %.3g",
                 quota ? "quota_gb" : "min_free_gb", (double)(quota ? l->quota_bytes : l->min_free_bytes) * gb);
    if (limit != s->limit)
        s->limit_quota = limit != SST_TROUBLE_NONE && quota;
    s->limit = limit;
    s->blocked = limit == SST_TROUBLE_LIMIT;
    s->folder_err = 0;
    s->checked_ns = sst_clock_now_ns();
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
}

/* Far enough from the limits that the next set does not exceed them at once. */
static bool has_slack(const struct store_limits *l, const struct store_room *room, double part)
{
    return !(l->quota_bytes && (double)room->used_bytes > (double)l->quota_bytes * (1 - part)) &&
           !(l->min_free_bytes && (double)room->free_bytes < (double)l->min_free_bytes * (1 + part));
}

/* Small recordings are removed as a whole; large ones, and the active one, lose their oldest segment. */
static int make_room(struct retention *r, const struct store_entry *e, bool too_much)
{
    const bool active = e->stage == SST_STORE_ACTIVE;
    int err = -ENODATA;

    if (active ||
        (too_much && e->kind == SST_STORE_RECORDING && e->bytes > r->s->part_bytes)) /* written by this thread alone */
        err = store_trim(r->s, e);
    if (err && active) {
        r->stuck = true;
        return 0;
    }
    return err ? store_remove(r->s, e) : 0;
}

static int apply_limits(struct retention *r)
{
    struct sst_storage *s = r->s;
    enum store_trouble limit = s->limit; /* written by this thread alone */
    enum store_verdict verdict;
    struct store_limits limits;
    struct store_room room;
    int err;

    r->stuck = false;
    while (!(err = measure(r, &room, &limits))) {
        struct store_entry e = { .name = "" };
        int victim;
        bool stop;

        pthread_mutex_lock(&s->lock);
        stop = s->stop;
        verdict = store_judge(&s->catalog, &limits, &room, &victim);
        if (verdict == SST_STORE_TOO_OLD || verdict == SST_STORE_TOO_MUCH)
            e = s->catalog.entry[victim];
        pthread_mutex_unlock(&s->lock);
        if (!e.name[0] || stop)
            break;
        if (verdict == SST_STORE_TOO_MUCH && limit == SST_TROUBLE_NONE)
            limit = SST_TROUBLE_LIMIT_LOW;
        err = make_room(r, &e, verdict == SST_STORE_TOO_MUCH);
        if (err)
            break;
    }
    if (err)
        return err;
    if (verdict == SST_STORE_NO_ROOM)
        limit = SST_TROUBLE_LIMIT;
    else if (limit == SST_TROUBLE_LIMIT && has_slack(&limits, &room, 0.04))
        limit = SST_TROUBLE_LIMIT_LOW;
    if (limit == SST_TROUBLE_LIMIT_LOW && has_slack(&limits, &room, 0.25))
        limit = SST_TROUBLE_NONE;
    set_limit(r, limit, &limits, &room);
    return 0;
}

/* --- repairs, probing --------------------------------------------------------------------------------------------- */

/* One in a pass: reading an hour of sets takes seconds. @return false: there was none */
static bool repair_one(struct retention *r)
{
    struct sst_storage *s = r->s;
    struct store_entry e = { 0 };
    char path[SST_PATH_MAX];
    int err;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < s->catalog.count && !e.name[0]; i++) {
        if (s->catalog.entry[i].stage == SST_STORE_TORN)
            e = s->catalog.entry[i];
    }
    pthread_mutex_unlock(&s->lock);
    if (!e.name[0] || sst_path_join(path, s->folder[SST_STORE_RECORDING], e.name))
        return false;
    r->said[0] = 0;
    err = store_repair(path, &e);
    if (err == -ENODATA) {
        if (!store_remove(s, &e))
            sst_log_info("%s held no set and was removed", path);
        return true;
    }
    if (err) {
        sst_log_warning("%s was not finished and cannot be repaired: %s", path, r->said[0] ? r->said : strerror(-err));
        e.stage =
            err == -EBADMSG || err == -EEXIST ? SST_STORE_DONE : SST_STORE_KEPT; /* unusable, or tried again later */
        e.bytes = store_bytes(path);
    }
    pthread_mutex_lock(&s->lock);
    catalog_update(&s->catalog, &e);
    pthread_mutex_unlock(&s->lock);
    return true;
}

static int write_probe(const struct sst_storage *s)
{
    char path[SST_PATH_MAX], *zeros = calloc(1, PROBE_BYTES);
    int err = zeros ? sst_path_join(path, s->dir, ".probe") : -ENOMEM;
    const int fd = err ? -1 : open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);

    if (!err && (fd < 0 || write(fd, zeros, PROBE_BYTES) != (ssize_t)PROBE_BYTES || fsync(fd)))
        err = -EIO;
    if (fd >= 0) {
        close(fd);
        (void)unlink(path);
    }
    free(zeros);
    return err;
}

/* After a failed write, tests whether the disk accepts writes again while nothing is to be recorded. */
static void probe(struct retention *r)
{
    struct sst_storage *s = r->s;
    int failing;

    pthread_mutex_lock(&s->lock);
    failing = s->active_name[0] || s->wanted ? 0 : s->write_err;
    pthread_mutex_unlock(&s->lock);
    if (!failing || write_probe(s))
        return;
    pthread_mutex_lock(&s->lock);
    if (s->write_err == failing)
        s->write_err = 0;
    pthread_mutex_unlock(&s->lock);
}

/* --- a pass ------------------------------------------------------------------------------------------ */

/* @return ms until the next pass */
static int pass(struct retention *r)
{
    struct sst_storage *s = r->s;
    int err = 0;

    if (r->lock_fd >= 0 && !is_same_folder(r)) {
        drop_folder(r);
        return PASS_MS; /* reported before it is created again */
    }
    if (r->lock_fd < 0) {
        err = make_folders(r);
        err = err ? err : lock_folder(r);
        if (!err)
            remember_folder(r);
    }
    if (!err && faccessat(AT_FDCWD, s->folder[SST_STORE_RECORDING], W_OK, AT_EACCESS)) {
        err = -errno;
        report_folder(r, err, s->folder[SST_STORE_RECORDING]);
    }
    if (!err && (!r->scanned || sst_clock_now_ns() - r->scan_ns > RESCAN_NS))
        err = scan(r);
    if (err)
        return PASS_MS;
    check_active(r);
    store_remove_deleted(s);
    r->steady = sst_clock_is_steady(&r->clock);
    err = apply_limits(r);
    if (err) {
        report_folder(r, err, s->dir);
        return PASS_MS;
    }
    probe(r);
    store_busy(s, &s->retention_busy_ns, false); /* a repair may take long */
    return repair_one(r) ? 1 : PASS_MS;
}

void *retention_run(void *storage)
{
    struct sst_storage *s = storage;
    struct retention r = { .s = s, .lock_fd = -1 };
    bool stop = false;
    int ms;

    sst_log_hold_errors(r.said);
    while (!stop) {
        store_busy(s, &s->retention_busy_ns, true);
        ms = pass(&r);
        store_busy(s, &s->retention_busy_ns, false);
        pthread_mutex_lock(&s->lock);
        if (!s->stop)
            store_wait_locked(s, ms);
        stop = s->stop;
        pthread_mutex_unlock(&s->lock);
    }
    /* The folder stays locked until nothing is written any more. */
    pthread_mutex_lock(&s->lock);
    while (s->threads > 1 && s->active_name[0])
        (void)store_wait_answer_locked(s, sst_clock_now_ns() + 100000000);
    pthread_mutex_unlock(&s->lock);
    if (r.lock_fd >= 0)
        close(r.lock_fd);
    sst_log_hold_errors(NULL);
    store_thread_ends(s);
    return NULL;
}
