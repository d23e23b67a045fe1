/* Snapshots and exports: light fields, made one after another by the thread sst-export; calls wait for a while. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/recording/lightfields.h"
#include "daemon/storage/storage_internal.h"

#define NEAR_NS   10000000000 /* an export is of a set within this of the moment */
#define RECENT    5           /* sets among which a snapshot takes a complete one */
#define NAMES_MAX 99          /* snapshots of one second */

struct store_job {
    struct store_entry entry;
    const struct sst_kept *kept; /* of the ring; NULL: of a recording */
    char recording[SST_STORE_NAME];
    int64_t wall_ns;
    uint8_t *jpeg;
    size_t jpeg_bytes;
    struct store_settings settings;
    /* under the storage's lock */
    bool done, left; /* left: the call no longer waits */
    int err;
};

/* --- light fields ------------------------------------------------------------------------------------------------- */

static int read_calibration(struct sst_use_calibration *use, const struct store_settings *set)
{
    int err;

    sst_use_calibration_defaults(use);
    err = sst_use_calibration_read(use, set->calibration);
    if (!err && set->plane_mm >= 0)
        use->plan.plane_mm = set->plane_mm;
    return err;
}

static int read_poses(struct sst_posed *poses, const struct sst_recording *r, const char *path)
{
    const struct sst_recording_info *info = sst_recording_info(r);
    const struct sst_posed_array array = { info->rows, info->cols, info->width, info->height, 3 };

    return sst_posed_array_read(poses, path, &array);
}

/* A calibration that cannot be used must not lose the moment: it can be applied to the light field later. */
static int make_lightfield(const struct store_job *job, const struct sst_recording *r, int set, const char *source,
                           const char *out)
{
    struct sst_use_calibration *use = calloc(1, sizeof(*use));
    struct sst_lightfields_config cfg = { .out = out,
                                          .sets = &set,
                                          .count = 1,
                                          .allow_partial = true,
                                          .source = source,
                                          .picture = job->jpeg ? "picture.jpg" : NULL,
                                          .picture_data = job->jpeg,
                                          .picture_bytes = job->jpeg_bytes,
                                          .threads = 1 };
    char why[SST_LOG_MAX] = "", *before = sst_log_hold_errors(why);
    struct sst_posed poses = { 0 };
    int err = -ENODATA;

    if (job->settings.poses[0]) {
        err = read_poses(&poses, r, job->settings.poses);
        cfg.poses = &poses;
        err = err ? err : sst_recording_to_lightfields(r, &cfg);
        cfg.poses = NULL;
        sst_posed_fini(&poses);
    } else if (use && job->settings.calibration[0]) {
        err = read_calibration(use, &job->settings);
        cfg.calibration = use;
        if (!err) {
            err = sst_recording_to_lightfields(r, &cfg);
            sst_use_calibration_fini(use);
        }
        cfg.calibration = NULL;
    }
    sst_log_hold_errors(before);
    free(use);
    if (!err || err == -ENOSPC || err == -EROFS || err == -EIO) {
        if (err)
            sst_log_error("%s", why);
        return err;
    }
    if (why[0])
        sst_log_warning("%s; %s is stored without %s", why, job->entry.name,
                        job->settings.poses[0] ? "poses" : "a calibration");
    return sst_recording_to_lightfields(r, &cfg);
}

/* Light fields are made from recordings: a set of the ring is first written as a recording of one set. */
static int record_one(struct sst_storage *s, const struct store_job *job, const char *dir)
{
    const struct sst_frameset *set = &job->kept->set;
    struct sst_recorder_config cfg;
    struct sst_recorder *recorder;
    struct sst_recorder_track *tracks = store_tracks(s);
    int err, closed;

    if (!tracks)
        return -ENOMEM;
    store_recorder_config(&cfg, &job->settings.array, set);
    cfg.dir = dir;
    cfg.tracks = tracks;
    err = sst_recorder_open(&recorder, &cfg);
    free(tracks);
    if (err)
        return err;
    err = sst_recorder_write(recorder, set);
    closed = sst_recorder_close(recorder);
    return err ? err : closed;
}

static int64_t distance(int64_t a, int64_t b)
{
    return a > b ? a - b : b - a;
}

static int run_job(struct sst_storage *s, const struct store_job *job)
{
    char out[SST_PATH_MAX], raw[SST_PATH_MAX], source[SST_PATH_MAX];
    struct sst_recording *r = NULL;
    int set = 0, err = sst_path_join(out, s->folder[job->entry.kind], job->entry.name);

    if (!err && job->kept) {
        err = snprintf(raw, sizeof(raw), "%s.tmp-raw", out) < (int)sizeof(raw) ? 0 : -ENAMETOOLONG;
        err = err ? err : record_one(s, job, raw);
        snprintf(source, sizeof(source), "%s", "the running service");
    } else if (!err) {
        err = sst_path_join(raw, s->folder[SST_STORE_RECORDING], job->recording);
        snprintf(source, sizeof(source), "%s", raw);
    }
    err = err ? err : sst_recording_open(&r, raw);
    if (!err && !job->kept)
        err = sst_recording_near(r, job->wall_ns, NEAR_NS, &set);
    err = err ? err : make_lightfield(job, r, set, source, out);
    sst_recording_close(r);
    if (job->kept)
        sst_path_remove_tree(raw);
    return err;
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

static void free_job(struct sst_storage *s, struct store_job *job)
{
    sst_ring_unref(s->ring, job->kept);
    free(job->jpeg);
    free(job);
}

static void report(struct sst_storage *s, const struct store_job *job, int err, const char *said)
{
    const char *type = job->entry.kind == SST_STORE_SNAPSHOT ? "snapshot" : "export";

    if (err)
        sst_events_emit(s->events, SST_EVENT_ERROR, type, json_pack("{s:s}", "name", job->entry.name),
                        "cannot make %s: %.180s", job->entry.name, said[0] ? said : err == -ENOTSUP ? SST_STORE_NO_MUXER : strerror(-err));
    else
        sst_events_emit(s->events, SST_EVENT_INFO, type, json_pack("{s:s}", "name", job->entry.name), "%s is made",
                        job->entry.name);
}

/* Without storage.json it only counts as the oldest after the next start, so an error is ignored. */
static void settle(struct sst_storage *s, struct store_job *job)
{
    struct store_entry *e = &job->entry;
    char path[SST_PATH_MAX];

    e->stage = SST_STORE_DONE;
    e->made_ns = sst_clock_wall_ns();
    e->sets = 1;
    e->picture = job->jpeg != NULL;
    if (sst_path_join(path, s->folder[e->kind], e->name))
        return;
    e->bytes = store_bytes(path);
    if (store_write(path, e))
        sst_log_debug("%s: its order is lost", path);
}

/* The event is emitted when the result can be downloaded, listed and deleted; then the waiting call returns. */
static void end_job(struct sst_storage *s, struct store_job *job, int err, const char *said)
{
    bool left;

    if (!err)
        settle(s, job);
    pthread_mutex_lock(&s->lock);
    if (err)
        catalog_remove(&s->catalog, job->entry.name);
    else
        catalog_update(&s->catalog, &job->entry);
    pthread_cond_broadcast(&s->wake); /* the limits */
    pthread_mutex_unlock(&s->lock);
    report(s, job, err, said);
    pthread_mutex_lock(&s->lock);
    s->jobs--;
    memmove(&s->job[0], &s->job[1], (size_t)s->jobs * sizeof(s->job[0]));
    job->err = err;
    job->done = true;
    left = job->left;
    pthread_cond_broadcast(&s->answered);
    pthread_mutex_unlock(&s->lock);
    if (left)
        free_job(s, job);
}

void *store_jobs_run(void *storage)
{
    struct sst_storage *s = storage;
    char said[SST_LOG_MAX];

    sst_log_hold_errors(said);
    pthread_mutex_lock(&s->lock);
    while (!s->stop || s->jobs) {
        struct store_job *job = s->jobs ? s->job[0] : NULL;
        int err;

        if (!job) {
            store_wait_locked(s, 1000);
            continue;
        }
        err = s->stop ? -ECANCELED : 0;
        pthread_mutex_unlock(&s->lock);
        said[0] = 0;
        err = err ? err : run_job(s, job);
        end_job(s, job, err, said);
        pthread_mutex_lock(&s->lock);
    }
    pthread_mutex_unlock(&s->lock);
    sst_log_hold_errors(NULL);
    store_thread_ends(s);
    return NULL;
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

/* A job, unless nothing may be added; sst-retention removes the excess then. */
static int new_job(struct sst_storage *s, enum store_kind kind, struct store_job **out)
{
    int err;

    pthread_mutex_lock(&s->lock);
    err = s->stop ? -EBUSY : s->ready || s->blocked ? store_refusal_locked(s) : 0;
    if (!err && s->jobs == SST_STORE_JOBS)
        err = -EBUSY;
    pthread_mutex_unlock(&s->lock);
    if (err)
        return err;
    *out = calloc(1, sizeof(**out));
    if (!*out)
        return -ENOMEM;
    (*out)->entry.kind = kind;
    return 0;
}

/* Queue the job and wait for a limited time. The job is freed here or by the thread. */
static int submit(struct sst_storage *s, struct store_job *job, char *name)
{
    const int64_t until_ns = sst_clock_now_ns() + SST_STORE_ANSWER_MS * INT64_C(1000000);
    int err = -EEXIST;
    bool done;

    job->entry.from_ns = job->wall_ns;
    for (int attempt = 1; err == -EEXIST && attempt <= NAMES_MAX; attempt++)
        err = store_reserve(s, attempt, &job->entry);
    if (err) {
        free_job(s, job);
        return err == -EEXIST ? -EBUSY : err;
    }
    pthread_mutex_lock(&s->lock);
    if (catalog_find(&s->catalog, job->entry.name))
        catalog_find(&s->catalog, job->entry.name)->picture = job->jpeg != NULL;
    if (s->jobs == SST_STORE_JOBS || s->stop) {
        catalog_remove(&s->catalog, job->entry.name);
        pthread_mutex_unlock(&s->lock);
        free_job(s, job);
        return -EBUSY;
    }
    job->settings = s->settings;
    s->job[s->jobs++] = job;
    snprintf(name, SST_STORE_NAME, "%s", job->entry.name);
    pthread_cond_broadcast(&s->wake);
    while (!job->done && !s->stop && store_wait_answer_locked(s, until_ns))
        ;
    done = job->done;
    job->left = !done;
    err = done ? job->err : s->stop ? -EIO : 0;
    pthread_mutex_unlock(&s->lock);
    if (done)
        free_job(s, job);
    switch (-err) {
    case 0:
    case ENOSPC:
    case EROFS:
    case EBADMSG:
    case ENOENT:
    case ENOMEM:
    case ENOTSUP:
        return err;
    default:
        return -EIO;
    }
}

/* The newest set, or a complete one of the last few; NULL: none. */
static const struct sst_kept *newest_set(struct sst_ring *ring)
{
    const struct sst_kept *k = sst_ring_get(ring, 0);
    const uint64_t number = k ? k->number : 0;
    uint64_t dropped;

    sst_ring_unref(ring, k);
    return k ? sst_ring_newest(ring, number > RECENT ? number - RECENT : 0, &dropped) : NULL;
}

int sst_storage_snapshot(struct sst_storage *s, const uint8_t *jpeg, size_t bytes, char *name)
{
    struct store_job *job;
    int err = new_job(s, SST_STORE_SNAPSHOT, &job);

    if (err)
        return err;
    job->kept = newest_set(s->ring);
    if (!job->kept || !job->kept->set.present)
        err = -ENODATA;
    if (!err && jpeg && bytes) {
        job->jpeg = malloc(bytes);
        job->jpeg_bytes = bytes;
        if (job->jpeg)
            memcpy(job->jpeg, jpeg, bytes);
        else
            err = -ENOMEM;
    }
    if (err) {
        free_job(s, job);
        return err;
    }
    job->wall_ns = job->kept->set.wall_ns;
    return submit(s, job, name);
}

/* The set of the ring nearest to a moment, referenced; NULL: none is near. */
static const struct sst_kept *find_kept(struct sst_ring *ring, int64_t wall_ns)
{
    const struct sst_kept *best = NULL;
    uint64_t number = 1;

    for (;;) {
        const struct sst_kept *k = sst_ring_get(ring, number);

        if (k && k->number >= number) {
            number = k->number + 1;
            if (k->set.present && distance(k->set.wall_ns, wall_ns) <= NEAR_NS &&
                (!best || distance(k->set.wall_ns, wall_ns) < distance(best->set.wall_ns, wall_ns))) {
                const struct sst_kept *other = best;

                best = k;
                k = other;
            }
            sst_ring_unref(ring, k);
            continue;
        }
        sst_ring_unref(ring, k);
        return best;
    }
}

/* The recording of this name, or the nearest to the moment; a full one before a reduced one. @return its distance from
 * it; INT64_MAX: none */
static int64_t find_recording(struct sst_storage *s, const char *recording, int64_t wall_ns, char *name)
{
    int64_t best = INT64_MAX;
    bool full = false;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];
        const bool whole = store_class_of(e) != SST_STORE_REDUCED;
        int64_t away = INT64_MAX;

        if (e->kind != SST_STORE_RECORDING || (recording && strcmp(e->name, recording)))
            continue;
        if (recording || (wall_ns >= e->from_ns && wall_ns <= e->to_ns))
            away = 0;
        else if (e->from_ns)
            away = wall_ns < e->from_ns ? e->from_ns - wall_ns : distance(wall_ns, e->to_ns);
        if (away < best || (away == best && whole && !full)) {
            best = away;
            full = whole;
            memcpy(name, e->name, SST_STORE_NAME);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return best;
}

int sst_storage_export(struct sst_storage *s, const char *recording, int64_t wall_ns, char *name)
{
    struct store_job *job;
    int64_t away, away_ram = INT64_MAX;
    const int err = new_job(s, SST_STORE_EXPORT, &job);

    if (err)
        return err;
    job->wall_ns = wall_ns;
    away = find_recording(s, recording, wall_ns, job->recording);
    job->kept = recording ? NULL : find_kept(s->ring, wall_ns);
    if (job->kept)
        away_ram = distance(job->kept->set.wall_ns, wall_ns);
    /* Sets in memory need no reading; half a second covers sets at 1 Hz. */
    if (job->kept && away_ram > 500000000 && away < away_ram) {
        sst_ring_unref(s->ring, job->kept);
        job->kept = NULL;
    }
    if (!job->kept && away > NEAR_NS) {
        free_job(s, job);
        return -ENOENT;
    }
    return submit(s, job, name);
}

int sst_storage_hold(struct sst_storage *s, const char *recording, int64_t wall_ns, char *name, char *dir)
{
    struct store_entry *e = NULL;
    int err = find_recording(s, recording, wall_ns, name) > NEAR_NS ? -ENOENT : 0;

    err = err ? err : sst_path_join(dir, s->folder[SST_STORE_RECORDING], name);
    pthread_mutex_lock(&s->lock);
    if (!err)
        e = catalog_find(&s->catalog, name);
    if (!err && (!e || e->deleted_by_hand))
        err = -ENOENT;
    if (!err)
        e->readers++;
    pthread_mutex_unlock(&s->lock);
    return err;
}

void sst_storage_release(struct sst_storage *s, const char *name)
{
    struct store_entry *e;

    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, name);
    if (e && e->readers > 0)
        e->readers--;
    pthread_mutex_unlock(&s->lock);
}
