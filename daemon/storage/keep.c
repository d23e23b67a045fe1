/* The thread that keeps the folder: makes and locks it, measures, removes what the limits do not allow, mends. */
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
#include "capture/recording/shorten.h"
#include "daemon/storage/storage_internal.h"

#define PASS_MS     500
#define RESCAN_NS   60000000000
#define STEADY_NS   600000000000 /* that the wall clock must have run without a step before ages count */
#define STEP_NS     2000000000
#define MARGIN_S    2  /* of sets that may come between two passes */
#define PARTS       10 /* of the room: what is removed at once is one of them at most */
#define PART_MIN    ((int64_t)1 << 20)
#define PROBE_BYTES ((size_t)256 << 10)

/* Keep thread only. */
struct keep {
    struct sst_storage *s;
    int lock_fd;  /* -1: the folder is not ours yet */
    dev_t dev[2]; /* of dir and its recordings/, as they were when it was locked */
    ino_t ino[2];
    bool scanned;
    int64_t scan_ns, clock_ns, steady_ns; /* last look; wall less monotonic; since when it is steady */
    bool steady;
    bool stuck; /* the recording at work cannot be shortened */
    char said[SST_LOG_MAX];
};

/* --- the folder --------------------------------------------------------------------------------------------------- */

static void folder_fails(struct keep *k, int err, const char *text)
{
    struct sst_storage *s = k->s;

    pthread_mutex_lock(&s->lock);
    s->blocked = true;
    if (s->folder_err != err)
        snprintf(s->folder_text, sizeof(s->folder_text), "%s", text);
    s->folder_err = err;
    s->checked_ns = sst_clock_now_ns();
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
}

static void folder_says(struct keep *k, int err, const char *path)
{
    const char *remedy = err == -EROFS    ? "mount it writable"
                         : err == -EACCES ? "give it and all in it to the user of the service (chown -R)"
                         : err == -ENOSPC ? "free space there"
                         : err == -ENOENT ? "mount its disk, or name another storage.dir"
                                          : "check the disk";
    char text[SST_STORE_TEXT];

    snprintf(text, sizeof(text), "cannot write into %.300s: %s; %s, recording then goes on by itself", path,
             strerror(-err), remedy);
    folder_fails(k, err, text);
}

/* Another service in the same folder would remove and mend what this one writes. */
static int lock_folder(struct keep *k)
{
    char path[SST_PATH_MAX], text[SST_STORE_TEXT], pid[32] = "";
    int fd, err = sst_path_join(path, k->s->dir, ".lock");
    ssize_t n;

    fd = err ? -1 : open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (fd < 0) {
        err = err ? err : -errno;
        folder_says(k, err, k->s->dir);
        return err;
    }
    if (flock(fd, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK) {
        n = pread(fd, pid, sizeof(pid) - 1, 0);
        close(fd);
        snprintf(text, sizeof(text),
                 "another sstd (process %d) keeps its recordings in %.300s; stop it or name another storage.dir",
                 n > 0 ? atoi(pid) : 0, k->s->dir);
        folder_fails(k, -EBUSY, text);
        return -EBUSY;
    } /* a file system without locks has none to lose */
    n = snprintf(pid, sizeof(pid), "%d\n", (int)getpid());
    if (ftruncate(fd, 0) || pwrite(fd, pid, (size_t)n, 0) != n)
        sst_log_debug("%s does not take the number of this process", path);
    k->lock_fd = fd;
    return 0;
}

static int make_folders(struct keep *k)
{
    struct sst_storage *s = k->s;
    int err = mkdir(s->dir, 0777) && errno != EEXIST ? -errno : 0;

    for (int i = 0; !err && i < SST_STORE_KINDS; i++)
        err = mkdir(s->folder[i], 0777) && errno != EEXIST ? -errno : 0;
    if (err)
        folder_says(k, err, s->dir);
    return err;
}

/* Is what we locked still what the names lead to? */
static bool is_same(struct keep *k)
{
    const char *const path[] = { k->s->dir, k->s->folder[SST_STORE_RECORDING] };
    struct stat st;

    for (int i = 0; i < 2; i++) {
        if (stat(path[i], &st) || st.st_dev != k->dev[i] || st.st_ino != k->ino[i])
            return false;
    }
    return true;
}

static void remember(struct keep *k)
{
    const char *const path[] = { k->s->dir, k->s->folder[SST_STORE_RECORDING] };
    struct stat st = { 0 };

    for (int i = 0; i < 2; i++) {
        (void)stat(path[i], &st); /* what fails now fails in the next pass */
        k->dev[i] = st.st_dev;
        k->ino[i] = st.st_ino;
    }
}

/* The folder was removed, or another file system lies over it: nothing in memory is about what is there now. */
static void lose_folder(struct keep *k)
{
    struct sst_storage *s = k->s;
    const int64_t until_ns = sst_clock_now_ns() + 2000000000;
    char text[SST_STORE_TEXT];

    snprintf(text, sizeof(text), "%.300s was removed, or another file system was mounted there", s->dir);
    folder_fails(k, -EIO, text);
    pthread_mutex_lock(&s->lock);
    s->ready = false;
    s->take_lost = s->take[0] != 0;
    /* Until nothing is written there, and sst-state has met it: made anew before that, it would not be told. */
    while ((s->take[0] || s->trouble != SST_TROUBLE_FOLDER || strcmp(s->reason, text)) && !s->stop &&
           sst_clock_now_ns() < until_ns)
        store_wait_locked(s, 100);
    if (!s->take[0])
        catalog_fini(&s->catalog);
    pthread_mutex_unlock(&s->lock);
    close(k->lock_fd);
    k->lock_fd = -1;
    k->scanned = false;
}

/* The recording at work may have been removed alone. */
static void check_take(struct keep *k)
{
    struct sst_storage *s = k->s;
    char name[SST_STORE_NAME], path[SST_PATH_MAX];

    pthread_mutex_lock(&s->lock);
    memcpy(name, s->take, sizeof(name));
    pthread_mutex_unlock(&s->lock);
    if (!name[0] || sst_path_join(path, s->folder[SST_STORE_RECORDING], name) || !access(path, F_OK))
        return;
    pthread_mutex_lock(&s->lock);
    s->take_lost |= !strcmp(s->take, name);
    pthread_mutex_unlock(&s->lock);
}

/* --- what is there ------------------------------------------------------------------------------------------------ */

/* Both catalogs are in the same order: what is looked for is mostly what follows what was found last. With ten thousand
 * entries everybody would wait for the lock otherwise. */
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

/* What has this order or a higher one may come into the folder while it is looked through. */
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

/* Take in what is new, and forget what somebody removed. */
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
            catalog_update(&s->catalog, &e); /* tried again */
        if (known)
            continue;
        if (!first && e.stage == SST_STORE_TORN)
            e.stage = SST_STORE_KEPT; /* not killed: perhaps it ended between our two looks */
        if (catalog_add(&s->catalog, &e))
            break;
    }
}

static int scan(struct keep *k)
{
    struct sst_storage *s = k->s;
    struct catalog found = { 0 };
    const uint64_t unsettled = unsettled_order(s);
    const bool first = !k->scanned;
    int err = 0;

    for (int i = 0; !err && i < SST_STORE_KINDS; i++)
        err = store_scan(s->folder[i], (enum store_kind)i, first, &found);
    if (!err) {
        pthread_mutex_lock(&s->lock);
        merge_locked(s, &found, first, unsettled);
        s->ready = true;
        pthread_mutex_unlock(&s->lock);
        k->scanned = true;
        k->scan_ns = sst_clock_now_ns();
    } else {
        folder_says(k, err, s->dir);
    }
    catalog_fini(&found);
    return err;
}

/* What the recording at work really takes, and in how many files; what is written meanwhile is added by its thread. */
static void measure_take(struct keep *k)
{
    struct sst_storage *s = k->s;
    char name[SST_STORE_NAME], path[SST_PATH_MAX];
    struct store_entry *e;
    int64_t before = 0, bytes;
    int segments;

    pthread_mutex_lock(&s->lock);
    memcpy(name, s->take, sizeof(name));
    e = name[0] ? catalog_find(&s->catalog, name) : NULL;
    before = e ? e->bytes : 0;
    pthread_mutex_unlock(&s->lock);
    if (!e || sst_path_join(path, s->folder[SST_STORE_RECORDING], name))
        return;
    bytes = store_bytes(path);
    segments = k->stuck ? 0 : sst_recording_segments(path);
    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, name);
    if (e && e->stage == SST_STORE_ACTIVE) {
        /* What was written meanwhile is estimated, and never too low; the estimates end where nothing was. */
        if (e->bytes == before || bytes > e->bytes)
            e->bytes = bytes;
        e->segments = segments;
    }
    pthread_mutex_unlock(&s->lock);
}

/* --- limits ------------------------------------------------------------------------------------------------------- */

static void follow_clock(struct keep *k)
{
    const int64_t now_ns = sst_clock_now_ns(), offset_ns = sst_clock_wall_ns() - now_ns;

    if (!k->steady_ns || llabs(offset_ns - k->clock_ns) > STEP_NS)
        k->steady_ns = now_ns;
    k->clock_ns = offset_ns;
    k->steady = now_ns - k->steady_ns > STEADY_NS;
}

static int64_t margin_of(const struct store_settings *set, int64_t limit_bytes, int64_t set_bytes)
{
    const double rate = set->rate_hz > 0 ? set->rate_hz : 1;
    const double want = fmax((double)limit_bytes / 20, MARGIN_S * rate * (double)set_bytes);

    return (int64_t)fmin(want, (double)limit_bytes / 4);
}

static int64_t set_bytes(struct sst_ring *ring)
{
    struct sst_ring_counters c;

    sst_ring_counters(ring, &c);
    return c.sets > 0 ? (int64_t)(c.bytes / (uint64_t)c.sets) : 0;
}

static int look(struct keep *k, struct store_room *room, struct store_limits *limits)
{
    struct sst_storage *s = k->s;
    const int64_t one = set_bytes(s->ring);
    struct statvfs v;
    int64_t quota_margin, free_margin;

    if (statvfs(s->folder[SST_STORE_RECORDING], &v))
        return -errno;
    measure_take(k);
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
                                 .clock_steady = k->steady };
    s->used_bytes = room->used_bytes;
    s->free_bytes = room->free_bytes;
    s->hand_bytes = store_hand_bytes(limits, room);
    s->part_bytes = store_room_bytes(limits, room) / PARTS;
    s->part_bytes = s->part_bytes < PART_MIN ? PART_MIN : s->part_bytes;
    pthread_mutex_unlock(&s->lock);
    return 0;
}

static void set_limit(struct keep *k, enum store_trouble limit, const struct store_limits *l,
                      const struct store_room *room)
{
    struct sst_storage *s = k->s;
    /* What was over is under again once something was removed: where there is room, it was not the room. */
    const bool room_lacks = l->min_free_bytes && room->free_bytes / 2 < l->min_free_bytes;
    const bool quota = l->quota_bytes && (!room_lacks || room->used_bytes > l->quota_bytes - 2 * l->margin_bytes);
    const double gb = 1e-9;

    pthread_mutex_lock(&s->lock);
    if (limit != s->limit && limit == SST_TROUBLE_LIMIT && quota)
        snprintf(s->limit_text, sizeof(s->limit_text),
                 "what is kept in %.300s takes %.3g GB of quota_gb %.3g and nothing is left to remove; raise it",
                 s->dir, (double)room->used_bytes * gb, (double)l->quota_bytes * gb);
    else if (limit != s->limit && limit == SST_TROUBLE_LIMIT)
        snprintf(s->limit_text, sizeof(s->limit_text),
                 "%.3g GB are free in %.300s, less than min_free_gb %.3g, and nothing is left to remove; free space "
                 "there",
                 (double)room->free_bytes * gb, s->dir, (double)l->min_free_bytes * gb);
    else if (limit != s->limit && limit == SST_TROUBLE_LIMIT_LOW)
        snprintf(s->limit_text, sizeof(s->limit_text), "the oldest is being removed to keep within %s %.3g",
                 quota ? "quota_gb" : "min_free_gb", (double)(quota ? l->quota_bytes : l->min_free_bytes) * gb);
    s->limit = limit;
    s->blocked = limit == SST_TROUBLE_LIMIT;
    s->folder_err = 0;
    s->checked_ns = sst_clock_now_ns();
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
}

/* Far enough from the limits that the next set does not bring the same again. */
static bool is_easy(const struct store_limits *l, const struct store_room *room, double part)
{
    return !(l->quota_bytes && (double)room->used_bytes > (double)l->quota_bytes * (1 - part)) &&
           !(l->min_free_bytes && (double)room->free_bytes < (double)l->min_free_bytes * (1 + part));
}

/* A small one goes as a whole; of a large one, and of the one at work, the oldest segment. */
static int make_room(struct keep *k, const struct store_entry *e, bool too_much)
{
    const bool active = e->stage == SST_STORE_ACTIVE;
    int err = -ENODATA;

    if (active || (too_much && e->kind == SST_STORE_RECORDING && e->bytes > k->s->part_bytes)) /* written here alone */
        err = store_shorten(k->s, e);
    if (err && active) {
        k->stuck = true;
        return 0;
    }
    return err ? store_remove(k->s, e) : 0;
}

static int keep_limits(struct keep *k)
{
    struct sst_storage *s = k->s;
    enum store_trouble limit = s->limit; /* written by this thread alone */
    enum store_verdict verdict;
    struct store_limits limits;
    struct store_room room;
    int err;

    k->stuck = false;
    while (!(err = look(k, &room, &limits))) {
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
        err = make_room(k, &e, verdict == SST_STORE_TOO_MUCH);
        if (err)
            break;
    }
    if (err)
        return err;
    if (verdict == SST_STORE_NO_ROOM)
        limit = SST_TROUBLE_LIMIT;
    else if (limit == SST_TROUBLE_LIMIT && is_easy(&limits, &room, 0.04))
        limit = SST_TROUBLE_LIMIT_LOW;
    if (limit == SST_TROUBLE_LIMIT_LOW && is_easy(&limits, &room, 0.25))
        limit = SST_TROUBLE_NONE;
    set_limit(k, limit, &limits, &room);
    return 0;
}

/* --- mending, probing --------------------------------------------------------------------------------------------- */

/* One in a pass: an hour of sets takes seconds to read. @return false: there was none */
static bool mend_one(struct keep *k)
{
    struct sst_storage *s = k->s;
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
    k->said[0] = 0;
    err = store_mend(path, &e);
    if (err == -ENODATA) {
        if (!store_remove(s, &e))
            sst_log_info("%s held no set and was removed", path);
        return true;
    }
    if (err) {
        sst_log_warning("%s was not finished and cannot be mended: %s", path, k->said[0] ? k->said : strerror(-err));
        e.stage = err == -EBADMSG || err == -EEXIST ? SST_STORE_DONE : SST_STORE_KEPT; /* no use, or another time */
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

/* After a failed write nothing more is tried where nothing is to be recorded: this does it instead. */
static void probe(struct keep *k)
{
    struct sst_storage *s = k->s;
    int failing;

    pthread_mutex_lock(&s->lock);
    failing = s->take[0] || s->wanted ? 0 : s->write_err;
    pthread_mutex_unlock(&s->lock);
    if (!failing || write_probe(s))
        return;
    pthread_mutex_lock(&s->lock);
    if (s->write_err == failing)
        s->write_err = 0;
    pthread_mutex_unlock(&s->lock);
}

/* --- a look now and then ------------------------------------------------------------------------------------------ */

/* @return ms until the next one */
static int pass(struct keep *k)
{
    struct sst_storage *s = k->s;
    int err = 0;

    if (k->lock_fd >= 0 && !is_same(k)) {
        lose_folder(k);
        return PASS_MS; /* told before anything is made anew */
    }
    if (k->lock_fd < 0) {
        err = make_folders(k);
        if (!err)
            err = lock_folder(k);
        if (!err)
            remember(k);
    }
    if (!err && faccessat(AT_FDCWD, s->folder[SST_STORE_RECORDING], W_OK, AT_EACCESS)) {
        err = -errno;
        folder_says(k, err, s->folder[SST_STORE_RECORDING]);
    }
    if (!err && (!k->scanned || sst_clock_now_ns() - k->scan_ns > RESCAN_NS))
        err = scan(k);
    if (err)
        return PASS_MS;
    check_take(k);
    store_remove_doomed(s);
    follow_clock(k);
    err = keep_limits(k);
    if (err) {
        folder_says(k, err, s->dir);
        return PASS_MS;
    }
    probe(k);
    store_plans_expire(s, sst_clock_now_ns());
    store_busy(s, &s->keep_busy_ns, false); /* mending takes its time */
    return mend_one(k) ? 1 : PASS_MS;
}

void *store_keep_run(void *storage)
{
    struct sst_storage *s = storage;
    struct keep k = { .s = s, .lock_fd = -1 };
    bool stop = false;
    int ms;

    sst_log_hold_errors(k.said);
    while (!stop) {
        store_busy(s, &s->keep_busy_ns, true);
        ms = pass(&k);
        store_busy(s, &s->keep_busy_ns, false);
        pthread_mutex_lock(&s->lock);
        if (!s->stop)
            store_wait_locked(s, ms);
        stop = s->stop;
        pthread_mutex_unlock(&s->lock);
    }
    /* The folder stays ours until nothing is written any more. */
    pthread_mutex_lock(&s->lock);
    while (s->threads > 1 && s->take[0])
        (void)store_wait_answer_locked(s, sst_clock_now_ns() + 100000000);
    pthread_mutex_unlock(&s->lock);
    if (k.lock_fd >= 0)
        close(k.lock_fd);
    sst_log_hold_errors(NULL);
    store_thread_ends(s);
    return NULL;
}
