/* Calls of the service to its storage: they read and change memory and wake threads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "daemon/storage/storage.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "daemon/storage/storage_internal.h"

#define GB          1e9
#define MOVED_SHARE 0.005 /* of the picture: reduced recordings keep a set */

/* --- settings ----------------------------------------------------------------------------------------------------- */

static int64_t bytes_of(double gb)
{
    return gb > 0 ? (int64_t)fmin(gb * GB, 9e18) : 0;
}

static int64_t ns_of(double s)
{
    return s > 0 ? (int64_t)fmin(s * 1e9, 9e18) : 0;
}

static struct store_array describe_array(const struct sst_array_config *a, unsigned opening)
{
    struct store_array out = { .opening = opening };

    sst_recorder_config_defaults(&out.recorder);
    out.recorder.rows = a->rows;
    out.recorder.cols = a->cols;
    out.recorder.cameras = a->bound;
    out.recorder.fourcc = a->fourcc;
    out.recorder.width = a->width;
    out.recorder.height = a->height;
    out.recorder.rate_hz = sst_array_sets_hz(a);
    out.recorder.spacing_mm = a->spacing_mm;
    return out;
}

static void copy_settings(struct store_settings *to, const struct sst_config *c)
{
    *to = (struct store_settings){
        .mode = c->storage.mode,
        .view = c->storage.record_view && c->live.enabled,
        .reduced = c->storage.reduced,
        .reduced_every = c->storage.reduced_every,
        .limits = { .quota_bytes = bytes_of(c->storage.quota_gb),
                    .min_free_bytes = bytes_of(c->storage.min_free_gb),
                    .max_age_ns = { ns_of(c->storage.max_age_days * 86400),
                                    ns_of(c->storage.reduced_max_age_days * 86400),
                                    ns_of(c->storage.by_hand_max_age_days * 86400) },
                    .manual_bytes = bytes_of(c->storage.by_hand_gb),
                    .reduced_bytes = bytes_of(c->storage.reduced_gb) },
        .segment_s = c->storage.segment_s,
        .sync_s = c->storage.sync_s,
        .preroll_ns = ns_of(c->storage.preroll_s),
        .postroll_ns = ns_of(c->storage.postroll_s),
        .array = describe_array(&c->array, 0),
        .plane_mm = c->live.plane_mm,
    };
    snprintf(to->calibration, sizeof(to->calibration), "%s", c->live.calibration);
    snprintf(to->poses, sizeof(to->poses), "%s", c->live.poses);
}

void sst_storage_cameras(struct sst_storage *s, const struct sst_array_config *array,
                         const struct sst_recorder_track *tracks)
{
    pthread_mutex_lock(&s->lock);
    s->settings.array = describe_array(array, s->settings.array.opening + 1);
    memcpy(s->tracks, tracks, (size_t)array->bound * sizeof(*tracks));
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
}

int sst_storage_configure(struct sst_storage *s, const struct sst_config *config)
{
    struct event_triggers *fresh = malloc(sizeof(*fresh));
    struct store_array before;

    if (!fresh)
        return -ENOMEM;
    event_triggers_init(fresh, config);
    pthread_mutex_lock(&s->lock);
    before = s->settings.array;
    copy_settings(&s->settings, config);
    if (before.opening) /* it stays as it was opened until it is opened again */
        s->settings.array = before;
    /* The state of triggers that are configured again is kept. */
    for (int i = 0; i < fresh->count; i++) {
        struct event_trigger *to = &fresh->list[i];

        for (int k = 0; k < s->event_triggers.count; k++) {
            const struct event_trigger *from = &s->event_triggers.list[k];

            if (!strcmp(to->zone, from->zone) && !strcmp(to->label, from->label) && to->visit == from->visit &&
                (from->active || from->reported) && !to->active && !to->reported)
                event_trigger_continue(to, from);
        }
    }
    s->event_triggers = *fresh;
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
    free(fresh);
    return 0;
}

/* --- event triggers ----------------------------------------------------------------------------------------------- */

/* "motion in door", "Pedestrian in door", "motion". */
static void trigger_text(char out[SST_STORE_WHY], const struct event_trigger *w)
{
    snprintf(out, SST_STORE_WHY, "%s%.63s%s%.31s", w->visit ? w->label[0] ? "visit of " : "visit" : "",
             w->label[0] ? w->label
             : w->visit  ? ""
                         : "motion",
             w->zone[0] ? " in " : "", w->zone);
}

static double value_of(const struct event_trigger *w, const struct sst_seen *seen)
{
    const int zones = sst_clamp_int(seen->zones, 0, SST_ZONES_MAX);

    if (w->label[0] || w->visit)
        return w->trigger >= 0 ? seen->label[w->trigger] : 0;
    if (w->index < 0)
        return seen->changed[zones];
    return w->index < zones ? seen->changed[w->index] : 0;
}

/* Request the recording of a trigger that is active. */
static void want_locked(struct sst_storage *s, const struct event_trigger *w)
{
    struct store_want *e = &s->event;

    if (!e->armed) {
        *e = (struct store_want){ .armed = true, .begin_ns = w->begin_ns - s->settings.preroll_ns };
        trigger_text(e->why, w);
        memcpy(e->zone, w->zone, sizeof(e->zone));
        memcpy(e->label, w->label, sizeof(e->label));
    }
    e->end_ns = INT64_MAX; /* until no trigger is active any more */
}

/* Set the end when no trigger that is recorded is active any more. */
static void end_event_locked(struct sst_storage *s)
{
    int64_t last_ns = INT64_MIN;

    for (int i = 0; i < s->event_triggers.count; i++) {
        const struct event_trigger *w = &s->event_triggers.list[i];

        if (w->trigger >= 0 && w->active)
            return;
        if (w->trigger >= 0 && w->last_ns > last_ns)
            last_ns = w->last_ns;
    }
    if (s->event.armed && s->event.end_ns == INT64_MAX)
        s->event.end_ns = last_ns + s->settings.postroll_ns;
}

struct change {
    struct event_trigger watch;
    double value;
    int64_t since_ns; /* of its reported beginning */
};

static void report(struct sst_storage *s, const struct change *t)
{
    const struct event_trigger *w = &t->watch;
    const double share = t->value >= 0 && t->value <= 1 ? t->value : 0;
    char text[SST_STORE_WHY];
    json_t *data = json_pack("{s:s, s:b, s:f}", "zone", w->zone, "active", w->reported, "share", share);

    if (data && w->label[0])
        json_object_set_new(data, "label", json_string(w->label));
    if (data && !w->reported) {
        json_object_set_new(data, "peak", json_real(w->peak >= 0 && w->peak <= 1 ? w->peak : 0));
        json_object_set_new(data, "times", json_integer(w->times));
        json_object_set_new(data, "seconds", json_real(round((double)(w->last_ns - t->since_ns) * 1e-8) / 10));
    }
    trigger_text(text, w);
    sst_events_emit(s->events, SST_EVENT_INFO, w->label[0] ? "label" : "motion", data, "%s %s", text,
                    w->reported ? "began" : "ended");
}

void sst_storage_seen(struct sst_storage *s, const struct sst_seen *seen)
{
    struct change change[EVENT_TRIGGERS_MAX];
    int n = 0;

    pthread_mutex_lock(&s->lock);
    s->seen_ns = sst_clock_now_ns();
    if (seen->changed[sst_clamp_int(seen->zones, 0, SST_ZONES_MAX)] >= MOVED_SHARE)
        s->moved_ns = seen->t_ns;
    for (int i = 0; i < s->event_triggers.count; i++) {
        struct event_trigger *w = &s->event_triggers.list[i];
        const double value = value_of(w, seen);
        const int64_t since_ns = w->reported_ns;

        (void)event_trigger_update(w, value, seen->t_ns);
        if (event_trigger_report(w, value, seen->t_ns) && !w->visit)
            change[n++] = (struct change){ *w, value, since_ns };
        if (w->active && w->trigger >= 0)
            want_locked(s, w);
    }
    end_event_locked(s);
    if (n)
        pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i < n; i++)
        report(s, &change[i]);
}

/* --- on demand ---------------------------------------------------------------------------------------------------- */

int sst_storage_record(struct sst_storage *s, double seconds, char *name)
{
    const int64_t now_ns = sst_clock_now_ns(), until_ns = now_ns + SST_STORE_ANSWER_MS * INT64_C(1000000);
    const int64_t end_ns = seconds > 0 ? now_ns + ns_of(fmin(seconds, 1e9)) : INT64_MAX;
    struct sst_ring_counters ring;
    bool prolonged;
    uint64_t mine;
    int err;

    sst_ring_counters(s->ring, &ring);
    pthread_mutex_lock(&s->lock);
    err = s->stop || !ring.sets ? -ENODATA : s->ready || s->blocked ? store_refusal_locked(s) : 0;
    err = err ? err : s->no_muxer ? -ENOTSUP : 0;
    if (err)
        goto out;
    prolonged = s->demand.armed;
    if (!prolonged)
        s->demand = (struct store_want){ .armed = true,
                                         .begin_ns = now_ns - s->settings.preroll_ns,
                                         .why = SST_STORE_ON_DEMAND };
    if (!prolonged || end_ns > s->demand.end_ns)
        s->demand.end_ns = end_ns;
    mine = ++s->asked;
    pthread_cond_broadcast(&s->wake);
    while (s->answer < mine && !s->stop && store_wait_answer_locked(s, until_ns))
        ;
    if (s->answer >= mine)
        err = s->answer_err;
    else
        err = s->record_busy_ns ? -EIO : -ENODATA; /* the disk hangs; no set has arrived */
    if (!err)
        snprintf(name, SST_STORE_NAME, "%s", s->active_name);
    else if (!prolonged)
        s->demand.armed = false; /* after an error nothing is recorded later */
out:
    pthread_mutex_unlock(&s->lock);
    return err;
}

int sst_storage_stop(struct sst_storage *s)
{
    int err = -ENOENT;

    pthread_mutex_lock(&s->lock);
    if (s->demand.armed) {
        s->demand.end_ns = sst_clock_now_ns();
        pthread_cond_broadcast(&s->wake);
        err = 0;
    }
    pthread_mutex_unlock(&s->lock);
    return err;
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

static void destroy(struct sst_storage *s)
{
    video_files_fini(s);
    view_history_fini(&s->history);
    sst_slot_unref(s->slot);
    catalog_fini(&s->catalog);
    pthread_cond_destroy(&s->answered);
    pthread_cond_destroy(&s->wake);
    pthread_mutex_destroy(&s->lock);
    free(s->tracks);
    free(s);
}

static int set_paths(struct sst_storage *s, const char *dir)
{
    static const char *const names[SST_STORE_KINDS] = { "recordings", "snapshots", "exports" };
    int err = sst_path_join(s->dir, dir, NULL);

    for (int i = 0; !err && i < SST_STORE_KINDS; i++)
        err = sst_path_join(s->folder[i], dir, names[i]);
    return err ? -EINVAL : 0;
}

int sst_storage_open(struct sst_storage **out, const struct sst_storage_config *cfg)
{
    static void *(*const run[])(void *) = { store_record_run, retention_run, store_jobs_run,
                                            store_video_run,  status_run,    store_view_run };
    static const char *const names[] = { "sst-record", "sst-retention", "sst-export",
                                         "sst-video",  "sst-state",     "sst-view" };
    const int cameras = cfg->config->array.bound;
    struct sst_storage *s;
    int err;

    if (!cfg->config->storage.dir[0] || cameras < 0 || cameras > SST_CAMERAS_MAX)
        return -EINVAL;
    s = calloc(1, sizeof(*s));
    if (!s)
        return -ENOMEM;
    pthread_mutex_init(&s->lock, NULL);
    sst_cond_init(&s->wake);
    sst_cond_init(&s->answered);
    s->ring = cfg->ring;
    s->events = cfg->events;
    s->blocked = true; /* until the folder has been scanned */
    s->tracks = calloc(SST_CAMERAS_MAX, sizeof(*s->tracks));
    err = s->tracks ? set_paths(s, cfg->config->storage.dir) : -ENOMEM;
    if (!err) {
        memcpy(s->tracks, cfg->tracks, (size_t)cameras * sizeof(*s->tracks));
        err = sst_storage_configure(s, cfg->config);
        s->settings.array.opening = cameras > 0;
    }
    for (int i = 0; !err && i < (int)ARRAY_LEN(run); i++) {
        pthread_mutex_lock(&s->lock);
        s->threads++;
        pthread_mutex_unlock(&s->lock);
        err = -pthread_create(&s->thread[i], NULL, run[i], s);
        if (!err) {
            pthread_setname_np(s->thread[i], names[i]);
            continue;
        }
        sst_log_error("cannot start the storage threads: %s", strerror(-err));
        store_thread_ends(s);
        for (; i < (int)ARRAY_LEN(run); i++)
            s->thread[i] = 0;
    }
    if (err) {
        if (!sst_storage_close(s, 10000))
            sst_log_warning("storage threads are still running");
        return err == -EINVAL ? err : -ENOMEM;
    }
    *out = s;
    return 0;
}

void sst_storage_shut(struct sst_storage *s, int timeout_ms)
{
    if (!s)
        return;
    pthread_mutex_lock(&s->lock);
    if (!s->stop)
        s->stop_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 500000;
    s->stop = true;
    pthread_cond_broadcast(&s->wake);
    pthread_cond_broadcast(&s->answered);
    pthread_mutex_unlock(&s->lock);
}

bool sst_storage_finish(struct sst_storage *s, int timeout_ms)
{
    const int64_t until_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 1000000;
    bool ended;

    if (!s)
        return true;
    sst_storage_shut(s, timeout_ms);
    pthread_mutex_lock(&s->lock);
    while (s->threads && store_wait_answer_locked(s, until_ns))
        ;
    ended = !s->threads;
    pthread_mutex_unlock(&s->lock);
    if (!ended)
        sst_log_error("the disk of %s does not answer; what was written last may be cut off at the next start", s->dir);
    return ended;
}

bool sst_storage_close(struct sst_storage *s, int timeout_ms)
{
    if (!sst_storage_finish(s, timeout_ms))
        return false;
    if (!s)
        return true;
    for (size_t i = 0; i < ARRAY_LEN(s->thread); i++) {
        if (s->thread[i])
            pthread_join(s->thread[i], NULL);
    }
    destroy(s);
    return true;
}
