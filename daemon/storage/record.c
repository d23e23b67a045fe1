/* Recording thread: follows the ring set by set and writes the wanted ones. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/storage/storage_internal.h"

#define HOUR_NS     3600000000000
#define MINUTE_NS   60000000000
#define CLOCK_NS    2000000000 /* a step of the wall clock that begins a new recording */
#define RETRY_NS    1000000000 /* between attempts to begin a recording */
#define SILENT_NS   5000000000 /* without live pictures or sets: recordings that wait for them end */
#define POLL_MS     100
#define NAMES_MAX   999 /* recordings that begin in one second of the wall clock */
#define FRAME_BYTES 160 /* overhead of a frame: line of the manifest, block in Matroska */
#define SET_BYTES   1024
#define SEGMENT_MAX ((int64_t)1 << 30)
#define LIST_BYTES  80 /* of a frame in the manifest; a set takes as much as 3 frames more */

/* The active recording; recording thread only. */
struct active {
    struct sst_storage *s;
    struct sst_recorder *recorder; /* NULL: none */
    struct store_entry entry;
    char dir[SST_PATH_MAX], zone[32], label[64];
    uint32_t fourcc;
    int width, height;
    unsigned opening; /* of the array */
    bool continuous;
    bool reduced;              /* of some sets */
    struct set_parts parts;    /* of a reduced one with `tiles` */
    int64_t first_ns, last_ns; /* set.t_ns of the first and last set; with sets */
    int64_t clock_ns;          /* wall time less set.t_ns of the last set */
    int64_t side_bytes;        /* about, of the manifest and the view, which are not removed in pieces */
    struct view_files view;
    bool view_lost;       /* writing it failed */
    uint64_t view_number; /* of the last picture that was written */
    int64_t begun_hour;
    uint64_t next;    /* number of the next set; 0: not known where to begin */
    uint64_t last;    /* number of the newest set when the service began to stop; 0: it has not */
    int64_t retry_ns; /* no new recording before */
    char said[SST_LOG_MAX];
};

/* Copy of the wishes, made under the lock. */
struct wanted {
    bool stop, ready, blocked, lost, wanted, continuous, reduced, asked, checked;
    int64_t stop_ns, part_bytes;
    char why[SST_STORE_WHY], zone[32], label[64];
    struct store_settings settings;
};

/* --- requests ----------------------------------------------------------------------------------------------- */

/* A request ends with the first set after its end; without sets, by the clock. */
static void expire_locked(struct sst_storage *s, int64_t now_ns)
{
    if (s->event.armed && s->event.end_ns == INT64_MAX && now_ns - s->seen_ns > SILENT_NS)
        s->event.end_ns = s->seen_ns + s->settings.postroll_ns;
    if (s->event.armed && s->event.end_ns < now_ns - SILENT_NS)
        s->event.armed = false;
    if (s->demand.armed && s->demand.end_ns < now_ns - SILENT_NS)
        s->demand.armed = false;
}

static void read_wanted(struct sst_storage *s, struct wanted *p)
{
    const struct store_want *w;

    pthread_mutex_lock(&s->lock);
    expire_locked(s, sst_clock_now_ns());
    s->waiting_bytes = 0; /* until the next one waits */
    *p = (struct wanted){ .stop = s->stop,
                          .ready = s->ready,
                          .blocked = s->blocked || !s->ready,
                          .lost = s->active_lost,
                          .asked = s->asked > s->answer,
                          .checked = s->checked_ns != 0,
                          .stop_ns = s->stop_ns,
                          .part_bytes = s->part_bytes,
                          .settings = s->settings };
    p->continuous = s->settings.mode == SST_RECORD_CONTINUOUS;
    w = s->event.armed && s->settings.mode == SST_RECORD_EVENT ? &s->event : s->demand.armed ? &s->demand : NULL;
    p->reduced = !p->continuous && !w && s->settings.reduced != SST_REDUCED_OFF;
    p->wanted = s->wanted = s->settings.array.opening && (p->continuous || p->reduced || w);
    if (p->continuous) {
        snprintf(p->why, sizeof(p->why), "continuous");
    } else if (p->reduced) {
        snprintf(p->why, sizeof(p->why), SST_STORE_REDUCED_WHY);
    } else if (w) {
        memcpy(p->why, w->why, sizeof(p->why));
        memcpy(p->zone, w->zone, sizeof(p->zone));
        memcpy(p->label, w->label, sizeof(p->label));
    }
    pthread_mutex_unlock(&s->lock);
}

static bool holds(struct store_want *w, int64_t t_ns)
{
    if (w->armed && t_ns > w->end_ns)
        w->armed = false;
    return w->armed && t_ns >= w->begin_ns;
}

static bool is_wanted(struct sst_storage *s, const struct sst_kept *k)
{
    bool event, demand, wanted;

    pthread_mutex_lock(&s->lock);
    event = holds(&s->event, k->set.t_ns) && s->settings.mode == SST_RECORD_EVENT;
    demand = holds(&s->demand, k->set.t_ns);
    wanted = event || demand || s->settings.mode == SST_RECORD_CONTINUOUS;
    pthread_mutex_unlock(&s->lock);
    return wanted;
}

/* Is a set of a reduced recording due? The first one is, and one a minute whatever happens. */
static bool is_due(const struct active *a, const struct wanted *p, const struct sst_kept *k)
{
    const double rate_hz = p->settings.array.recorder.rate_hz > 0 ? p->settings.array.recorder.rate_hz : 1;
    const int64_t since_ns = k->set.t_ns - a->last_ns;
    const int64_t every_ns = (int64_t)((p->settings.reduced_every - 0.5) / rate_hz * 1e9);
    int64_t moved_ns;

    if (!a->recorder || !a->entry.sets || since_ns >= MINUTE_NS)
        return true;
    if (p->settings.reduced == SST_REDUCED_VIEW || since_ns < every_ns)
        return false;
    pthread_mutex_lock(&a->s->lock);
    moved_ns = a->s->moved_ns;
    pthread_mutex_unlock(&a->s->lock);
    return p->settings.reduced == SST_REDUCED_SETS || moved_ns > a->last_ns;
}

static void answer(struct sst_storage *s, int err)
{
    pthread_mutex_lock(&s->lock);
    if (s->answer != s->asked) {
        s->answer = s->asked;
        s->answer_err = err;
        pthread_cond_broadcast(&s->answered);
    }
    pthread_mutex_unlock(&s->lock);
}

static void count_dropped(struct sst_storage *s, uint64_t n)
{
    pthread_mutex_lock(&s->lock);
    s->dropped += n;
    pthread_mutex_unlock(&s->lock);
}

/* --- begin and end of a recording --------------------------------------------------------------------------------- */

static void report(const struct active *a, const char *type, const char *reason)
{
    const bool start = !strcmp(type, "record-start"), plain = !strcmp(reason, "ended");

    sst_events_emit(a->s->events, SST_EVENT_INFO, type,
                    json_pack("{s:s, s:s, s:s, s:s, s:I}", "recording", a->entry.name, "reason", reason, "zone",
                              a->zone, "label", a->label, "sets", (json_int_t)a->entry.sets),
                    "recording %s %s%s%s", a->entry.name, start ? "begins" : "ends", plain ? "" : ": ",
                    plain ? "" : reason);
}

/* sst-state reports the failure, with the message of the part that failed. */
static void failed(struct active *a, int err)
{
    struct sst_storage *s = a->s;

    pthread_mutex_lock(&s->lock);
    if (err == -ENOTSUP) { /* the disk is in order, and light fields of recordings are still made */
        s->no_muxer = true;
    } else if (s->write_err != err) {
        s->write_err = err;
        if (a->said[0])
            snprintf(s->write_text, sizeof(s->write_text), "%.500s", a->said);
        else
            snprintf(s->write_text, sizeof(s->write_text), "cannot record into %.300s: %s", s->folder[0],
                     strerror(-err));
    }
    pthread_mutex_unlock(&s->lock);
}

static void forget(struct active *a)
{
    struct sst_storage *s = a->s;

    pthread_mutex_lock(&s->lock);
    catalog_remove(&s->catalog, a->entry.name);
    pthread_mutex_unlock(&s->lock);
}

/* Creates a new folder, also when the wall clock was set back. */
static int make_folder(struct active *a, int64_t wall_ns, const char *why)
{
    struct sst_storage *s = a->s;
    int err = -EEXIST;

    for (int attempt = 1; err == -EEXIST && attempt <= NAMES_MAX; attempt++) {
        a->entry = (struct store_entry){ .kind = SST_STORE_RECORDING, .from_ns = wall_ns };
        snprintf(a->entry.why, sizeof(a->entry.why), "%s", why);
        err = store_reserve(s, attempt, &a->entry);
        if (err)
            continue;
        err = sst_path_join(a->dir, s->folder[SST_STORE_RECORDING], a->entry.name);
        if (!err && mkdir(a->dir, 0777)) {
            err = -errno;
            if (err != -EEXIST)
                sst_log_error("cannot create the folder %s: %s", a->dir, strerror(-err));
        }
        if (err)
            forget(a);
    }
    return err;
}

void store_recorder_config(struct sst_recorder_config *out, const struct store_array *array,
                           const struct sst_frameset *set)
{
    *out = array->recorder;
    for (int k = 0; k < set->cameras; k++) {
        const struct sst_frame *f = set->frame[k];

        if (!f)
            continue;
        out->fourcc = f->fourcc;
        out->width = f->width;
        out->height = f->height;
        break;
    }
}

static int open_recorder(struct active *a, const struct store_settings *set, const struct sst_frameset *like)
{
    struct sst_recorder_track *tracks = store_tracks(a->s);
    struct sst_recorder_config cfg;
    int err;

    if (!tracks)
        return -ENOMEM;
    store_recorder_config(&cfg, &set->array, like);
    cfg.dir = a->dir;
    cfg.tracks = tracks;
    cfg.segment_s = set->segment_s;
    cfg.sync_s = set->sync_s;
    a->opening = set->array.opening;
    a->fourcc = cfg.fourcc;
    a->width = cfg.width;
    a->height = cfg.height;
    err = sst_recorder_open(&a->recorder, &cfg);
    free(tracks);
    return err;
}

static int begin(struct active *a, const struct wanted *p, const struct sst_kept *k)
{
    struct sst_storage *s = a->s;
    int err;

    if (sst_clock_now_ns() < a->retry_ns)
        return -EAGAIN;
    a->said[0] = 0;
    store_busy(s, &s->record_busy_ns, true);
    err = make_folder(a, k->set.wall_ns, p->why);
    if (!err) {
        err = store_write(a->dir, &a->entry);
        err = err ? err : open_recorder(a, &p->settings, &k->set);
        if (err) {
            forget(a);
            sst_path_remove_tree(a->dir);
        }
    }
    store_busy(s, &s->record_busy_ns, false);
    if (err) {
        a->retry_ns = err == -ENOTSUP ? INT64_MAX : sst_clock_now_ns() + RETRY_NS;
        failed(a, err);
        return err;
    }
    a->continuous = p->continuous || p->reduced;
    a->reduced = p->reduced;
    set_parts_forget(&a->parts);
    a->view_lost = false;
    a->side_bytes = 0;
    memcpy(a->zone, p->zone, sizeof(a->zone));
    memcpy(a->label, p->label, sizeof(a->label));
    pthread_mutex_lock(&s->lock);
    memcpy(s->active_name, a->entry.name, sizeof(s->active_name));
    memcpy(s->active_why, a->entry.why, sizeof(s->active_why));
    s->active_sets = 0;
    s->active_lost = false;
    pthread_mutex_unlock(&s->lock);
    report(a, "record-start", a->entry.why);
    return 0;
}

/* --- the see-through view ----------------------------------------------------------------------------------------- */

/* The view ends here, reported once; sets are still recorded. */
static void drop_view(struct active *a, int err)
{
    sst_log_warning("cannot record the see-through view of %s: %s; its sets are recorded", a->dir, strerror(-err));
    a->view_lost = true;
    (void)view_end(&a->view, 0, 0);
}

/* The next picture; a new recording begins with the one that was shown at its beginning. */
static const struct sst_jpeg *next_picture(struct active *a)
{
    struct sst_storage *s = a->s;
    const struct sst_jpeg *jpeg;

    pthread_mutex_lock(&s->lock);
    jpeg = a->view.index ? NULL : view_history_at(&s->history, a->first_ns);
    if (!jpeg)
        jpeg = view_history_next(&s->history, a->view_number);
    pthread_mutex_unlock(&s->lock);
    return jpeg;
}

/* A picture of before the recording was still shown at its beginning. */
static int64_t shown_from(const struct active *a, const struct sst_jpeg *jpeg)
{
    return jpeg->t_ns > a->first_ns ? jpeg->t_ns : a->first_ns;
}

static int64_t wall_of(const struct active *a, const struct sst_jpeg *jpeg)
{
    return jpeg->t_ns > a->first_ns ? jpeg->wall_ns : a->first_ns + a->clock_ns; /* the clock may have been set since */
}

static int write_picture(struct active *a, const struct sst_jpeg *jpeg)
{
    int err = a->view.index ? 0 : view_begin(&a->view, a->dir);

    return err ? err : view_write(&a->view, jpeg, shown_from(a, jpeg), wall_of(a, jpeg));
}

/* Write the pictures that were shown since the last set. */
static void follow_view(struct active *a)
{
    struct sst_storage *s = a->s;
    const struct sst_jpeg *jpeg;
    struct store_entry *e;
    int err = 0;

    while (!a->view_lost && a->entry.sets && (jpeg = next_picture(a))) {
        store_busy(s, &s->record_busy_ns, true);
        err = write_picture(a, jpeg);
        store_busy(s, &s->record_busy_ns, false);
        a->view_number = jpeg->number;
        if (!err && !a->entry.picture)
            a->entry.view_ns = wall_of(a, jpeg);
        a->entry.picture |= !err;
        a->side_bytes += (int64_t)jpeg->bytes;
        pthread_mutex_lock(&s->lock);
        e = catalog_find(&s->catalog, a->entry.name);
        if (e) {
            e->picture = a->entry.picture;
            e->view_ns = a->entry.view_ns;
            e->bytes += (int64_t)jpeg->bytes;
        }
        s->used_bytes += (int64_t)jpeg->bytes;
        pthread_mutex_unlock(&s->lock);
        sst_slot_jpeg_unref(jpeg);
        if (err)
            drop_view(a, err);
    }
}

/* Copy the removals by retention while it was written. */
static void copy_trimmed_locked(struct active *a)
{
    const struct store_entry *e = catalog_find(&a->s->catalog, a->entry.name);

    if (e) {
        a->entry.from_ns = e->from_ns;
        a->entry.sets = e->sets;
        a->entry.gone = e->gone;
    }
}

/* Write the final storage.json. */
static void settle(struct active *a, bool lost)
{
    struct sst_storage *s = a->s;

    if (lost || !a->entry.sets) {
        if (!lost)
            sst_path_remove_tree(a->dir);
        forget(a);
        return;
    }
    pthread_mutex_lock(&s->lock);
    copy_trimmed_locked(a);
    pthread_mutex_unlock(&s->lock);
    a->entry.stage = SST_STORE_DONE;
    a->entry.made_ns = sst_clock_wall_ns();
    a->entry.bytes = store_bytes(a->dir);
    if (store_write(a->dir, &a->entry))
        sst_log_debug("%s: repaired at the next start", a->dir);
    pthread_mutex_lock(&s->lock);
    copy_trimmed_locked(a);
    catalog_update(&s->catalog, &a->entry);
    s->used_bytes = store_used_locked(s);
    pthread_mutex_unlock(&s->lock);
}

static void finish(struct active *a, const char *reason, bool lost)
{
    struct sst_storage *s = a->s;
    int err;

    if (!a->recorder)
        return;
    a->said[0] = 0;
    if (!lost)
        follow_view(a);
    store_busy(s, &s->record_busy_ns, true);
    (void)view_end(&a->view, a->last_ns, a->entry.to_ns);
    err = sst_recorder_close(a->recorder);
    a->recorder = NULL;
    settle(a, lost);
    store_busy(s, &s->record_busy_ns, false);
    if (err && !lost)
        failed(a, err);
    pthread_mutex_lock(&s->lock);
    s->active_name[0] = 0;
    s->active_lost = false;
    pthread_cond_broadcast(&s->wake); /* sst-retention waits for it after the folder was lost */
    pthread_mutex_unlock(&s->lock);
    report(a, "record-stop", reason);
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

/* Does a new recording begin with this set? */
static bool is_over(const struct active *a, const struct wanted *p, const struct sst_frameset *set)
{
    const int64_t age_ns = set->t_ns - a->first_ns;

    if (p->settings.array.opening != a->opening)
        return true;
    for (int k = 0; k < set->cameras; k++) {
        const struct sst_frame *f = set->frame[k];

        if (f)
            return f->fourcc != a->fourcc || f->width != a->width || f->height != a->height ||
                   (a->entry.sets &&
                    (age_ns >= HOUR_NS || llabs(set->wall_ns - set->t_ns - a->clock_ns) > CLOCK_NS || (p->part_bytes && a->side_bytes >= p->part_bytes) ||
                     (a->continuous && age_ns >= MINUTE_NS && set->wall_ns / HOUR_NS != a->begun_hour)));
    }
    return false;
}

static int64_t cost(const struct sst_frameset *set)
{
    int64_t bytes = FRAME_BYTES * (int64_t)set->present + SET_BYTES;

    for (int i = 0; i < set->cameras; i++)
        bytes += set->frame[i] ? (int64_t)set->frame[i]->bytes : 0;
    return bytes;
}

/* Would the set exceed the quota? Then sst-retention makes room first. */
static bool must_wait(struct sst_storage *s, const struct sst_frameset *set)
{
    const struct store_limits *l = &s->settings.limits;
    bool wait;

    pthread_mutex_lock(&s->lock);
    wait = l->quota_bytes && s->used_bytes + cost(set) > l->quota_bytes &&
           s->used_bytes > l->quota_bytes - l->margin_bytes;
    s->waiting_bytes = wait ? cost(set) : 0;
    if (wait || (l->quota_bytes && s->used_bytes > l->quota_bytes - l->margin_bytes))
        pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
    return wait;
}

static void account(struct active *a, const struct sst_frameset *set)
{
    struct sst_storage *s = a->s;
    const bool first = !a->entry.sets;
    struct store_entry *e;

    if (first) {
        a->first_ns = set->t_ns;
        a->entry.from_ns = set->wall_ns;
        a->begun_hour = set->wall_ns / HOUR_NS;
    }
    a->last_ns = set->t_ns;
    a->clock_ns = set->wall_ns - set->t_ns;
    a->entry.sets++;
    a->entry.to_ns = set->wall_ns;
    a->side_bytes += LIST_BYTES * (set->present + 3);
    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, a->entry.name);
    if (e) {
        e->bytes += cost(set);
        e->sets++;
        e->from_ns = first ? a->entry.from_ns : e->from_ns;
        e->to_ns = a->entry.to_ns;
    }
    s->used_bytes += cost(set);
    s->active_sets = a->entry.sets;
    s->write_err = 0;
    pthread_mutex_unlock(&s->lock);
}

/* @return 0, -EAGAIN: try the same set again; other errors: it is not recorded */
static int write_set(struct active *a, const struct wanted *p, const struct sst_kept *k)
{
    struct sst_storage *s = a->s;
    const struct sst_frameset *set;
    bool tiles;
    int err = 0;

    if (a->recorder && is_over(a, p, &k->set))
        finish(a, "continued in a new folder", false);
    if (!a->recorder)
        err = begin(a, p, k);
    if (err && err != -EAGAIN)
        answer(s, err);
    if (err || must_wait(s, &k->set))
        return -EAGAIN;
    tiles = a->reduced && p->settings.reduced == SST_REDUCED_TILES;
    set = tiles ? set_parts_of(&a->parts, &k->set) : &k->set;
    a->said[0] = 0;
    if (p->part_bytes) /* so that segments can be removed one by one */
        sst_recorder_set_segment_bytes(a->recorder, p->part_bytes < SEGMENT_MAX ? p->part_bytes : SEGMENT_MAX);
    store_busy(s, &s->record_busy_ns, true);
    err = sst_recorder_write(a->recorder, set);
    store_busy(s, &s->record_busy_ns, false);
    if (err) {
        failed(a, err); /* pictures wait until sets can be written again */
        return err;
    }
    if (tiles)
        set_parts_written(&a->parts, set);
    account(a, set);
    follow_view(a);
    return 0;
}

/* The next set of the ring, or NULL. Sets that the ring no longer holds are counted. */
static const struct sst_kept *next_set(struct active *a)
{
    const struct sst_kept *k = sst_ring_get(a->s->ring, a->next ? a->next : 1);

    if (k && k->number < a->next) {
        sst_ring_unref(a->s->ring, k);
        return NULL;
    }
    if (k && a->next && k->number > a->next && !a->reduced && (a->recorder || a->continuous))
        count_dropped(a->s, k->number - a->next);
    return k;
}

/* While writing is blocked, sets are dropped. */
static void pass_by(struct active *a, const struct wanted *p)
{
    uint64_t dropped;
    const struct sst_kept *k = a->next ? sst_ring_newest(a->s->ring, a->next - 1, &dropped) : NULL;
    int err;

    if (k) {
        if (p->continuous)
            count_dropped(a->s, k->number + 1 - a->next);
        a->next = k->number + 1;
        sst_ring_unref(a->s->ring, k);
    }
    pthread_mutex_lock(&a->s->lock);
    err = store_refusal_locked(a->s);
    pthread_mutex_unlock(&a->s->lock);
    if (p->checked && err)
        answer(a->s, err);
}

/* A client waits for the name of its recording, and no set has arrived yet. */
static void begin_for_asker(struct active *a, const struct wanted *p)
{
    const struct sst_kept *k = sst_ring_get(a->s->ring, 0);
    int err;

    if (!k)
        return;
    err = begin(a, p, k);
    sst_ring_unref(a->s->ring, k);
    if (err != -EAGAIN)
        answer(a->s, err);
}

static void idle(struct sst_storage *s, int ms)
{
    pthread_mutex_lock(&s->lock);
    if (!s->stop)
        store_wait_locked(s, ms);
    pthread_mutex_unlock(&s->lock);
}

/* Handle one set. @return false: there is none now */
static bool follow(struct active *a, const struct wanted *p)
{
    struct sst_storage *s = a->s;
    const struct sst_kept *k = next_set(a);
    int err = 0;

    if (!k)
        return false;
    if (k->set.cameras == p->settings.array.recorder.cameras && /* others were captured with another array */
        (p->reduced ? is_due(a, p, k) : is_wanted(s, k))) {
        err = write_set(a, p, k);
        if (err != -EAGAIN && !p->reduced) /* recordings on demand want every set */
            answer(s, err);
        if (err && err != -EAGAIN)
            count_dropped(s, 1);
    }
    a->next = err == -EAGAIN ? k->number : k->number + 1;
    sst_ring_unref(s->ring, k);
    if (p->reduced && !err && a->recorder)
        follow_view(a); /* all of it, between the sets, too */
    if (err == -EAGAIN)
        idle(s, 20);
    return true;
}

static void wait_for_sets(struct active *a)
{
    /* A ring that was shut returns at once. */
    if (!sst_ring_wait(a->s->ring, a->next ? a->next - 1 : 0, POLL_MS))
        idle(a->s, 10);
}

static uint64_t newest(struct sst_ring *ring)
{
    const struct sst_kept *k = sst_ring_get(ring, 0);
    const uint64_t number = k ? k->number : 0;

    sst_ring_unref(ring, k);
    return number;
}

/* @return false: the thread ends */
static bool step(struct active *a, struct wanted *p)
{
    read_wanted(a->s, p);
    if (p->stop && !a->last)
        a->last = newest(a->s->ring);
    if (p->stop && (!a->recorder || a->next > a->last || sst_clock_now_ns() > p->stop_ns))
        return false;
    if (a->recorder && (p->lost || p->blocked))
        finish(a, p->lost ? "its folder is gone" : "storage is full or not writable", p->lost);
    if (a->recorder && a->reduced != p->reduced && p->wanted) {
        finish(a, a->reduced ? "all sets are recorded now" : "ended", false);
        a->next = p->reduced ? a->next : 0; /* with the pre-roll */
    }
    if (!p->wanted || (p->blocked && !p->checked)) {
        finish(a, "ended", false);
        a->next = p->wanted ? a->next : 0;
        idle(a->s, POLL_MS);
    } else if (p->blocked) {
        pass_by(a, p);
        idle(a->s, POLL_MS);
    } else if (!follow(a, p)) {
        if (p->stop)
            return false;
        if (p->asked && !a->recorder)
            begin_for_asker(a, p);
        else if (p->asked)
            answer(a->s, 0);
        wait_for_sets(a);
    }
    return true;
}

void *store_record_run(void *storage)
{
    struct active *a = calloc(1, sizeof(*a));
    struct wanted *p = calloc(1, sizeof(*p));
    struct sst_storage *s = storage;

    if (a && p) {
        a->s = s;
        sst_log_hold_errors(a->said);
        while (step(a, p))
            ;
        finish(a, "the service stops", false);
        sst_log_hold_errors(NULL);
    } else {
        sst_log_error("out of memory: nothing is recorded");
    }
    if (a)
        set_parts_forget(&a->parts);
    free(a);
    free(p);
    store_thread_ends(s);
    return NULL;
}
