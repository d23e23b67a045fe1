/* The thread that records: it follows the ring set by set and writes those that somebody wants. */
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
#define RETRY_NS    1000000000 /* between attempts to begin a recording */
#define SILENT_NS   5000000000 /* of live pictures, or of sets: what they wanted ends */
#define POLL_MS     100
#define NAMES_MAX   999 /* recordings that begin in one second of the wall clock */
#define FRAME_BYTES 160 /* of a frame beside its own: line of the list, block in Matroska */
#define SET_BYTES   1024
#define SEGMENT_MAX ((int64_t)1 << 30)
#define LIST_BYTES  80 /* of them in the list, and as much again for 3 frames a set */

/* The recording at work; recorder thread only. */
struct take {
    struct sst_storage *s;
    struct sst_recorder *recorder; /* NULL: none */
    struct store_entry entry;
    char dir[SST_PATH_MAX], zone[32], label[64];
    uint32_t fourcc;
    int width, height;
    unsigned opening; /* of the array */
    bool continuous;
    int64_t first_ns, last_ns; /* set.t_ns of the first and last set; with sets */
    int64_t side_bytes;        /* of the list and the view, which are not removed in pieces; about */
    struct view_files view;
    bool view_lost;       /* it could not be written */
    uint64_t view_number; /* of the last picture that was written */
    int64_t begun_hour;
    uint64_t next;    /* number of the next set; 0: not known where to begin */
    uint64_t last;    /* of the sets that were there when everything was to stop; 0: it is not */
    int64_t retry_ns; /* no new recording before */
    char said[SST_LOG_MAX];
};

/* What is wanted, as it was under the lock. */
struct plan {
    bool stop, ready, blocked, lost, wanted, continuous, asked, checked;
    int64_t stop_ns, part_bytes;
    char why[SST_STORE_WHY], zone[32], label[64];
    struct store_settings settings;
};

/* --- what is wanted ----------------------------------------------------------------------------------------------- */

/* Wants end when sets behind their end have come; where none come, by the clock. */
static void expire_locked(struct sst_storage *s, int64_t now_ns)
{
    if (s->event.armed && s->event.end_ns == INT64_MAX && now_ns - s->seen_ns > SILENT_NS)
        s->event.end_ns = s->seen_ns + s->settings.postroll_ns;
    if (s->event.armed && s->event.end_ns < now_ns - SILENT_NS)
        s->event.armed = false;
    if (s->demand.armed && s->demand.end_ns < now_ns - SILENT_NS)
        s->demand.armed = false;
}

static void make_plan(struct sst_storage *s, struct plan *p)
{
    const struct store_want *w;

    pthread_mutex_lock(&s->lock);
    expire_locked(s, sst_clock_now_ns());
    s->waiting_bytes = 0; /* until the next one waits */
    *p = (struct plan){ .stop = s->stop,
                        .ready = s->ready,
                        .blocked = s->blocked || !s->ready,
                        .lost = s->take_lost,
                        .asked = s->asked > s->answer,
                        .checked = s->checked_ns != 0,
                        .stop_ns = s->stop_ns,
                        .part_bytes = s->part_bytes,
                        .settings = s->settings };
    p->continuous = s->settings.mode == SST_RECORD_CONTINUOUS;
    w = s->event.armed && s->settings.mode == SST_RECORD_EVENT ? &s->event : s->demand.armed ? &s->demand : NULL;
    p->wanted = s->wanted = s->settings.opening && (p->continuous || w);
    if (p->continuous) {
        snprintf(p->why, sizeof(p->why), "continuous");
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

static void tell(const struct take *t, const char *type, const char *reason)
{
    const bool start = !strcmp(type, "record-start");

    sst_events_emit(t->s->events, SST_EVENT_INFO, type,
                    json_pack("{s:s, s:s, s:s, s:s, s:I}", "recording", t->entry.name, "reason", reason, "zone",
                              t->zone, "label", t->label, "sets", (json_int_t)t->entry.sets),
                    start ? "recording %s begins: %s" : "recording %s ends: %s", t->entry.name, reason);
}

/* What failed is told by the state's thread, with what the part that failed has said. */
static void failed(struct take *t, int err)
{
    struct sst_storage *s = t->s;

    pthread_mutex_lock(&s->lock);
    if (s->write_err != err) {
        s->write_err = err;
        if (t->said[0])
            snprintf(s->write_text, sizeof(s->write_text), "%.500s", t->said);
        else
            snprintf(s->write_text, sizeof(s->write_text), "cannot record into %.300s: %s", s->folder[0],
                     strerror(-err));
    }
    pthread_mutex_unlock(&s->lock);
}

/* A folder of its own, whatever the wall clock does. */
static int make_folder(struct take *t, int64_t wall_ns, const char *why)
{
    struct sst_storage *s = t->s;
    int err = -EEXIST;

    for (int attempt = 1; err == -EEXIST && attempt <= NAMES_MAX; attempt++) {
        err = store_reserve(s, SST_STORE_RECORDING, wall_ns, attempt, why, &t->entry);
        if (err)
            continue;
        err = sst_path_join(t->dir, s->folder[SST_STORE_RECORDING], t->entry.name);
        if (!err && mkdir(t->dir, 0777)) {
            err = -errno;
            if (err != -EEXIST)
                sst_log_error("cannot create the folder %s: %s", t->dir, strerror(-err));
        }
        if (err) {
            pthread_mutex_lock(&s->lock);
            catalog_remove(&s->catalog, t->entry.name);
            pthread_mutex_unlock(&s->lock);
        }
    }
    return err;
}

static int open_recorder(struct take *t, const struct store_settings *set, const struct sst_set *like)
{
    struct sst_recorder_track *tracks = store_tracks(t->s);
    struct sst_recorder_config cfg;
    int err;

    if (!tracks)
        return -ENOMEM;
    t->opening = set->opening;
    t->fourcc = set->fourcc;
    t->width = set->width;
    t->height = set->height;
    for (int k = 0; k < like->cameras; k++) {
        const struct sst_frame *f = like->frame[k];

        if (!f)
            continue;
        t->fourcc = f->fourcc;
        t->width = f->width;
        t->height = f->height;
        break;
    }
    sst_recorder_config_defaults(&cfg);
    cfg.dir = t->dir;
    cfg.rows = set->rows;
    cfg.cols = set->cols;
    cfg.cameras = set->cameras;
    cfg.tracks = tracks;
    cfg.fourcc = t->fourcc;
    cfg.width = t->width;
    cfg.height = t->height;
    cfg.rate_hz = set->rate_hz;
    cfg.spacing_mm = set->spacing_mm;
    cfg.segment_s = set->segment_s;
    cfg.sync_s = set->sync_s;
    err = sst_recorder_open(&t->recorder, &cfg);
    free(tracks);
    return err;
}

static void forget(struct take *t)
{
    struct sst_storage *s = t->s;

    pthread_mutex_lock(&s->lock);
    catalog_remove(&s->catalog, t->entry.name);
    pthread_mutex_unlock(&s->lock);
}

static int begin(struct take *t, const struct plan *p, const struct sst_kept *k)
{
    struct sst_storage *s = t->s;
    int err;

    if (sst_clock_now_ns() < t->retry_ns)
        return -EAGAIN;
    t->said[0] = 0;
    store_busy(s, &s->record_busy_ns, true);
    err = make_folder(t, k->set.wall_ns, p->why);
    if (!err) {
        err = store_write(t->dir, &t->entry);
        if (!err)
            err = open_recorder(t, &p->settings, &k->set);
        if (err) {
            forget(t);
            sst_path_remove_tree(t->dir);
        }
    }
    store_busy(s, &s->record_busy_ns, false);
    if (err) {
        t->retry_ns = sst_clock_now_ns() + RETRY_NS;
        failed(t, err);
        return err;
    }
    t->continuous = p->continuous;
    t->view_lost = false;
    t->side_bytes = 0;
    memcpy(t->zone, p->zone, sizeof(t->zone));
    memcpy(t->label, p->label, sizeof(t->label));
    pthread_mutex_lock(&s->lock);
    memcpy(s->take, t->entry.name, sizeof(s->take));
    memcpy(s->take_why, t->entry.why, sizeof(s->take_why));
    s->take_sets = 0;
    s->take_lost = false;
    pthread_mutex_unlock(&s->lock);
    tell(t, "record-start", t->entry.why);
    return 0;
}

/* --- the see-through view ----------------------------------------------------------------------------------------- */

/* Without it the sets are as good: it ends here, told once. */
static void lose_view(struct take *t, int err)
{
    sst_log_warning("the see-through view of %s cannot be recorded (%s); its sets are", t->dir, strerror(-err));
    t->view_lost = true;
    (void)view_end(&t->view, 0, 0);
}

/* The next picture: of a new recording first what was seen at its beginning. */
static const struct sst_jpeg *next_picture(struct take *t)
{
    struct sst_storage *s = t->s;
    const struct sst_jpeg *jpeg;

    pthread_mutex_lock(&s->lock);
    jpeg = t->view.index ? NULL : view_shown_at(&s->shown, t->first_ns);
    if (!jpeg)
        jpeg = view_shown_next(&s->shown, t->view_number);
    pthread_mutex_unlock(&s->lock);
    return jpeg;
}

static int write_picture(struct take *t, const struct sst_jpeg *jpeg)
{
    const int64_t t_ns = jpeg->t_ns > t->first_ns ? jpeg->t_ns : t->first_ns;
    int err = t->view.index ? 0 : view_begin(&t->view, t->dir);

    return err ? err : view_write(&t->view, jpeg, t_ns);
}

/* What was shown since the last set. */
static void follow_view(struct take *t)
{
    struct sst_storage *s = t->s;
    const struct sst_jpeg *jpeg;
    struct store_entry *e;
    int err = 0;

    while (!t->view_lost && t->entry.sets && (jpeg = next_picture(t))) {
        store_busy(s, &s->record_busy_ns, true);
        err = write_picture(t, jpeg);
        store_busy(s, &s->record_busy_ns, false);
        t->view_number = jpeg->number;
        t->entry.picture |= !err;
        t->side_bytes += (int64_t)jpeg->bytes;
        pthread_mutex_lock(&s->lock);
        e = catalog_find(&s->catalog, t->entry.name);
        if (e) {
            e->picture = t->entry.picture;
            e->bytes += (int64_t)jpeg->bytes;
        }
        s->used_bytes += (int64_t)jpeg->bytes;
        pthread_mutex_unlock(&s->lock);
        sst_jpeg_unref(jpeg);
        if (err)
            lose_view(t, err);
    }
}

/* What was removed of it while it was written, or is just now. */
static void take_over_locked(struct take *t)
{
    const struct store_entry *e = catalog_find(&t->s->catalog, t->entry.name);

    if (e) {
        t->entry.from_ns = e->from_ns;
        t->entry.sets = e->sets;
        t->entry.gone = e->gone;
    }
}

/* Its folder stays as what it became. */
static void settle(struct take *t, bool lost)
{
    struct sst_storage *s = t->s;

    if (lost || !t->entry.sets) {
        if (!lost)
            sst_path_remove_tree(t->dir);
        forget(t);
        return;
    }
    pthread_mutex_lock(&s->lock);
    take_over_locked(t);
    pthread_mutex_unlock(&s->lock);
    t->entry.stage = SST_STORE_DONE;
    t->entry.made_ns = sst_clock_wall_ns();
    t->entry.bytes = store_bytes(t->dir);
    if (store_write(t->dir, &t->entry))
        sst_log_debug("%s: mended at the next start", t->dir);
    pthread_mutex_lock(&s->lock);
    take_over_locked(t);
    catalog_update(&s->catalog, &t->entry);
    s->used_bytes = store_used_locked(s);
    pthread_mutex_unlock(&s->lock);
}

static void finish(struct take *t, const char *reason, bool lost)
{
    struct sst_storage *s = t->s;
    int err;

    if (!t->recorder)
        return;
    t->said[0] = 0;
    if (!lost)
        follow_view(t);
    store_busy(s, &s->record_busy_ns, true);
    (void)view_end(&t->view, t->last_ns, t->entry.to_ns);
    err = sst_recorder_close(t->recorder);
    t->recorder = NULL;
    settle(t, lost);
    store_busy(s, &s->record_busy_ns, false);
    if (err && !lost)
        failed(t, err);
    pthread_mutex_lock(&s->lock);
    s->take[0] = 0;
    s->take_lost = false;
    pthread_cond_broadcast(&s->wake); /* sst-keep waits for it where the folder was lost */
    pthread_mutex_unlock(&s->lock);
    tell(t, "record-stop", reason);
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

/* Does the set belong into a new folder? */
static bool is_over(const struct take *t, const struct plan *p, const struct sst_set *set)
{
    const int64_t age_ns = set->t_ns - t->first_ns;

    if (p->settings.opening != t->opening)
        return true;
    for (int k = 0; k < set->cameras; k++) {
        const struct sst_frame *f = set->frame[k];

        if (f)
            return f->fourcc != t->fourcc || f->width != t->width || f->height != t->height ||
                   (t->entry.sets &&
                    (age_ns >= HOUR_NS || (p->part_bytes && t->side_bytes >= p->part_bytes) ||
                     (t->continuous && age_ns >= MINUTE_NS && set->wall_ns / HOUR_NS != t->begun_hour)));
    }
    return false;
}

static int64_t cost(const struct sst_kept *k)
{
    return (int64_t)k->bytes + FRAME_BYTES * (int64_t)k->set.present + SET_BYTES;
}

/* Would the set go beyond the quota? Then sst-keep makes room first. */
static bool must_wait(struct sst_storage *s, const struct sst_kept *k)
{
    const struct store_limits *l = &s->settings.limits;
    bool wait;

    pthread_mutex_lock(&s->lock);
    wait =
        l->quota_bytes && s->used_bytes + cost(k) > l->quota_bytes && s->used_bytes > l->quota_bytes - l->margin_bytes;
    s->waiting_bytes = wait ? cost(k) : 0;
    if (wait || (l->quota_bytes && s->used_bytes > l->quota_bytes - l->margin_bytes))
        pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
    return wait;
}

static void account(struct take *t, const struct sst_kept *k)
{
    struct sst_storage *s = t->s;
    const bool first = !t->entry.sets;
    struct store_entry *e;

    if (first) {
        t->first_ns = k->set.t_ns;
        t->entry.from_ns = k->set.wall_ns;
        t->begun_hour = k->set.wall_ns / HOUR_NS;
    }
    t->last_ns = k->set.t_ns;
    t->entry.sets++;
    t->entry.to_ns = k->set.wall_ns;
    t->side_bytes += LIST_BYTES * (k->set.present + 3);
    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, t->entry.name);
    if (e) {
        e->bytes += cost(k);
        e->sets++;
        e->from_ns = first ? t->entry.from_ns : e->from_ns;
        e->to_ns = t->entry.to_ns;
    }
    s->used_bytes += cost(k);
    s->take_sets = t->entry.sets;
    s->write_err = 0;
    pthread_mutex_unlock(&s->lock);
}

/* @return 0, -EAGAIN: the same set again; else it is not recorded */
static int write_set(struct take *t, const struct plan *p, const struct sst_kept *k)
{
    struct sst_storage *s = t->s;
    int err = 0;

    if (t->recorder && is_over(t, p, &k->set))
        finish(t, "continued in a new folder", false);
    if (!t->recorder)
        err = begin(t, p, k);
    if (err && err != -EAGAIN)
        answer(s, err);
    if (err || must_wait(s, k))
        return -EAGAIN;
    t->said[0] = 0;
    if (p->part_bytes) /* as pieces they can be removed one by one */
        sst_recorder_set_segment_bytes(t->recorder, p->part_bytes < SEGMENT_MAX ? p->part_bytes : SEGMENT_MAX);
    store_busy(s, &s->record_busy_ns, true);
    err = sst_recorder_write(t->recorder, &k->set);
    store_busy(s, &s->record_busy_ns, false);
    if (err) {
        failed(t, err); /* pictures wait until sets can be written again */
        return err;
    }
    account(t, k);
    follow_view(t);
    return 0;
}

/* The next set that is there, or NULL. Sets that the ring no longer holds are counted. */
static const struct sst_kept *next_set(struct take *t)
{
    const struct sst_kept *k = sst_ring_get(t->s->ring, t->next ? t->next : 1);

    if (k && k->number < t->next) {
        sst_ring_unref(t->s->ring, k);
        return NULL;
    }
    if (k && t->next && k->number > t->next && (t->recorder || t->continuous))
        count_dropped(t->s, k->number - t->next);
    return k;
}

/* While nothing may be written, sets pass by. */
static void pass_by(struct take *t, const struct plan *p)
{
    uint64_t dropped;
    const struct sst_kept *k = t->next ? sst_ring_newest(t->s->ring, t->next - 1, &dropped) : NULL;
    int err;

    if (k) {
        if (p->continuous)
            count_dropped(t->s, k->number + 1 - t->next);
        t->next = k->number + 1;
        sst_ring_unref(t->s->ring, k);
    }
    pthread_mutex_lock(&t->s->lock);
    err = store_refusal_locked(t->s);
    pthread_mutex_unlock(&t->s->lock);
    if (p->checked && err)
        answer(t->s, err);
}

/* Somebody waits for the name of what he asked for, and no set has come yet. */
static void begin_for_asker(struct take *t, const struct plan *p)
{
    const struct sst_kept *k = sst_ring_get(t->s->ring, 0);
    int err;

    if (!k)
        return;
    err = begin(t, p, k);
    sst_ring_unref(t->s->ring, k);
    if (err != -EAGAIN)
        answer(t->s, err);
}

static void idle(struct sst_storage *s, int ms)
{
    pthread_mutex_lock(&s->lock);
    if (!s->stop)
        store_wait_locked(s, ms);
    pthread_mutex_unlock(&s->lock);
}

/* One set. @return false: there is none now */
static bool follow(struct take *t, const struct plan *p)
{
    struct sst_storage *s = t->s;
    const struct sst_kept *k = next_set(t);
    int err = 0;

    if (!k)
        return false;
    if (k->set.cameras == p->settings.cameras && is_wanted(s, k)) { /* others are of another array */
        err = write_set(t, p, k);
        if (err != -EAGAIN)
            answer(s, err);
        if (err && err != -EAGAIN)
            count_dropped(s, 1);
    }
    t->next = err == -EAGAIN ? k->number : k->number + 1;
    sst_ring_unref(s->ring, k);
    if (err == -EAGAIN)
        idle(s, 20);
    return true;
}

static void wait_for_sets(struct take *t)
{
    /* A ring that was shut lets nobody wait. */
    if (!sst_ring_wait(t->s->ring, t->next ? t->next - 1 : 0, POLL_MS))
        idle(t->s, 10);
}

static uint64_t newest(struct sst_ring *ring)
{
    const struct sst_kept *k = sst_ring_get(ring, 0);
    const uint64_t number = k ? k->number : 0;

    if (k)
        sst_ring_unref(ring, k);
    return number;
}

/* @return false: it is over */
static bool step(struct take *t, struct plan *p)
{
    make_plan(t->s, p);
    if (p->stop && !t->last)
        t->last = newest(t->s->ring);
    if (p->stop && (!t->recorder || t->next > t->last || sst_clock_now_ns() > p->stop_ns))
        return false;
    if (t->recorder && (p->lost || p->blocked))
        finish(t, p->lost ? "its folder is gone" : "storage takes nothing more", p->lost);
    if (!p->wanted || (p->blocked && !p->checked)) {
        finish(t, "ended", false);
        t->next = p->wanted ? t->next : 0;
        idle(t->s, POLL_MS);
    } else if (p->blocked) {
        pass_by(t, p);
        idle(t->s, POLL_MS);
    } else if (!follow(t, p)) {
        if (p->stop)
            return false;
        if (p->asked && !t->recorder)
            begin_for_asker(t, p);
        else if (p->asked)
            answer(t->s, 0);
        wait_for_sets(t);
    }
    return true;
}

void *store_record_run(void *storage)
{
    struct take *t = calloc(1, sizeof(*t));
    struct plan *p = calloc(1, sizeof(*p));
    struct sst_storage *s = storage;

    if (t && p) {
        t->s = s;
        sst_log_hold_errors(t->said);
        while (step(t, p))
            ;
        finish(t, "the service stops", false);
        sst_log_hold_errors(NULL);
    } else {
        sst_log_error("no memory to record");
    }
    free(t);
    free(p);
    store_thread_ends(s);
    return NULL;
}
