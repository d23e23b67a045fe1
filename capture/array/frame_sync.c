/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/array/frame_sync.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/stats.h"

#define TICKS              128 /* triggers that are remembered, to distinguish late frames from stray ones */
#define PENDING_PER_CAMERA 2   /* frames that may arrive before their trigger is reported */
#define STAMP_AHEAD_NS     1000000

struct tick {
    uint64_t index;
    int64_t t_ns;
    bool edge, closed;
    struct sst_frameset *set;            /* while open; NULL then: dropped, no set was free */
    uint64_t seen[SST_CAMERAS_MAX / 64]; /* cameras with a good frame */
};

struct camera {
    bool streaming;
    bool heard;         /* last_ns and latency_ns are valid */
    int64_t last_ns;    /* newest time stamp */
    int64_t latency_ns; /* usual time from stamp to arrival */
    bool doubtful;      /* its stamps ran backwards and are not confirmed to be right again */
    int64_t tick;       /* FREE, INDEX: of its last frame */
};

struct sst_framesync {
    /* fixed after create */
    struct sst_framesync_config cfg;
    struct sst_framesync_events events;
    struct sst_frameset *pool;
    /* assembling thread */
    struct tick tick[TICKS]; /* ring in the order of time */
    int first, count;
    struct camera camera[SST_CAMERAS_MAX];
    struct sst_frame **pending;
    int pending_count;
    double period_ns; /* FREE: measured from the cameras */
    /* under lock */
    pthread_mutex_t lock;
    bool busy[64];    /* sets of the pool that are open or with the receiver */
    bool counted[64]; /* cameras with frames that are already counted in a bucket */
    struct sst_framesync_counters counters;
};

const char *const sst_bucket_keys[SST_BUCKETS] = {
    "set", "late", "duplicate", "stray", "corrupt", "flagged", "dropped"
};

const char *sst_bucket_name(enum sst_bucket bucket)
{
    static const char *const names[] = { "in a set", "late", "duplicate", "stray", "corrupt", "flagged", "dropped" };

    return names[bucket];
}

static void count_locked(struct sst_framesync *s, int cam, enum sst_bucket bucket)
{
    s->counters.bucket[bucket]++;
    s->counters.camera[cam][bucket]++;
}

static void end_frame(struct sst_framesync *s, struct sst_frame *frame, enum sst_bucket bucket)
{
    pthread_mutex_lock(&s->lock);
    count_locked(s, frame->cam, bucket);
    pthread_mutex_unlock(&s->lock);
    s->events.release(s->events.arg, frame, bucket);
}

static struct tick *tick_at(struct sst_framesync *s, int i)
{
    return &s->tick[(s->first + i) % TICKS];
}

static bool has_seen(const struct tick *b, int cam)
{
    return b->seen[cam / 64] >> cam % 64 & 1;
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

static struct sst_frameset *acquire_set(struct sst_framesync *s)
{
    struct sst_frameset *set = NULL;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < s->cfg.pool && !set; i++)
        if (!s->busy[i]) {
            s->busy[i] = true;
            set = &s->pool[i];
        }
    if (!set)
        s->counters.dropped++;
    pthread_mutex_unlock(&s->lock);
    if (set)
        memset(set, 0, sizeof(*set));
    return set;
}

void sst_framesync_withhold(struct sst_framesync *s, struct sst_frameset *set, int cam)
{
    struct sst_frame *frame = set->frame[cam];

    pthread_mutex_lock(&s->lock);
    count_locked(s, cam, SST_BUCKET_CORRUPT);
    set->frame[cam] = NULL;
    set->present--;
    pthread_mutex_unlock(&s->lock);
    s->events.release(s->events.arg, frame, SST_BUCKET_DROPPED); /* by policy: on this thread no health is noted */
}

void sst_framesync_recycle(struct sst_framesync *s, struct sst_frameset *set, bool dropped)
{
    const enum sst_bucket bucket = dropped ? SST_BUCKET_DROPPED : SST_BUCKET_SET;

    pthread_mutex_lock(&s->lock);
    for (int cam = 0; cam < set->cameras; cam++)
        if (set->frame[cam])
            count_locked(s, cam, bucket);
    s->counted[set - s->pool] = true;
    pthread_mutex_unlock(&s->lock);
    for (int cam = 0; cam < set->cameras; cam++)
        if (set->frame[cam])
            s->events.release(s->events.arg, set->frame[cam], bucket);
    pthread_mutex_lock(&s->lock);
    s->busy[set - s->pool] = s->counted[set - s->pool] = false;
    pthread_mutex_unlock(&s->lock);
}

static void measure_skew(const struct sst_framesync *s, struct sst_frameset *set)
{
    int64_t t[SST_CAMERAS_MAX], far = -1, median;
    int n = 0;

    set->skew = (struct sst_skew){ .worst_cam = -1 };
    for (int cam = 0; cam < set->cameras; cam++)
        if (set->frame[cam])
            t[n++] = set->frame[cam]->t_ns - s->cfg.delay_ns[cam];
    if (n < 2)
        return;
    sst_stats_sort_int64(t, n);
    median = t[(n - 1) / 2];
    set->skew.spread_ns = t[n - 1] - t[0];
    for (int cam = 0; cam < set->cameras; cam++)
        if (set->frame[cam]) {
            const int64_t at = set->frame[cam]->t_ns - s->cfg.delay_ns[cam];

            if (llabs(at - median) > far) {
                far = llabs(at - median);
                set->skew.worst_cam = cam;
                set->skew.from_edge_ns = set->edge ? at - set->t_ns : 0;
            }
        }
}

static void close_tick(struct sst_framesync *s, struct tick *b)
{
    struct sst_frameset *set = b->set;

    b->closed = true;
    b->set = NULL;
    if (!set)
        return;
    set->index = b->index;
    set->t_ns = b->t_ns;
    set->edge = b->edge;
    set->cameras = s->cfg.cameras;
    if (s->cfg.match == SST_FRAMESYNC_FREE) {
        set->t_ns = INT64_MAX;
        for (int cam = 0; cam < set->cameras; cam++)
            if (set->frame[cam] && set->frame[cam]->t_ns < set->t_ns)
                set->t_ns = set->frame[cam]->t_ns;
        if (!set->present)
            set->t_ns = b->t_ns;
    }
    set->wall_ns = set->t_ns - sst_clock_now_ns() + sst_clock_wall_ns();
    measure_skew(s, set);
    pthread_mutex_lock(&s->lock);
    s->counters.sets++;
    s->counters.complete += set->present == set->cameras;
    s->counters.empty += set->present == 0;
    pthread_mutex_unlock(&s->lock);
    s->events.set(s->events.arg, set);
}

/**
 * Check the time stamps of a good frame. The clock of a camera may jump: after a jump by whole periods its frames would
 * go into sets of other triggers unnoticed, and without triggers a stamp from the future would make the frames of all
 * cameras late until then. A stamp must not be later than the arrival; and after stamps ran backwards,
 * the latency from stamp to arrival must be the usual one. Otherwise latency is not checked: frames may be late for
 * other reasons.
 */
static bool stamp_holds(const struct sst_framesync *s, struct camera *c, const struct sst_frame *frame)
{
    const int64_t latency_ns = frame->arrival_ns - frame->t_ns;

    if (latency_ns < -STAMP_AHEAD_NS)
        return false;
    if (!c->heard)
        c->latency_ns = latency_ns;
    if (c->doubtful && llabs(latency_ns - c->latency_ns) > s->cfg.window_ns)
        return false;
    c->doubtful = false;
    c->latency_ns += (latency_ns - c->latency_ns) / 8;
    return true;
}

/* Window around a tick in which the exposure of camera cam must start. */
static int64_t window_of(const struct sst_framesync *s)
{
    return s->cfg.match == SST_FRAMESYNC_FREE ? (int64_t)(0.75 * s->period_ns) : s->cfg.window_ns;
}

/* Time of the trigger for which a stamp of camera cam lies in the middle of the window. */
static int64_t due_of(const struct sst_framesync *s, int cam, int64_t t_ns)
{
    return t_ns - s->cfg.delay_ns[cam] - (s->cfg.commanded[cam] ? s->cfg.window_ns / 8 * 7 : 0);
}

/* True if no further frame of this camera can belong to the tick. */
static bool is_past(const struct sst_framesync *s, const struct tick *b, int cam)
{
    const struct camera *c = &s->camera[cam];

    if (s->cfg.match != SST_FRAMESYNC_NEAREST && has_seen(b, cam))
        return true;
    if (!c->streaming)
        return true;
    if (!c->heard)
        return false;
    if (s->cfg.match == SST_FRAMESYNC_INDEX)
        return c->tick >= (int64_t)b->index;
    return s->cfg.match == SST_FRAMESYNC_FREE ? c->tick > (int64_t)b->index
                                              : due_of(s, cam, c->last_ns) > b->t_ns + window_of(s);
}

static bool is_done(const struct sst_framesync *s, const struct tick *b)
{
    for (int cam = 0; cam < s->cfg.cameras; cam++)
        if (!is_past(s, b, cam))
            return false;
    return true;
}

/* Without a streaming camera a tick would be complete at once, before a frame in flight: it waits for its time-out. */
static bool is_due(const struct sst_framesync *s, const struct tick *b, int64_t now_ns)
{
    bool any = false;

    if (now_ns - b->t_ns >= s->cfg.wait_ns)
        return true;
    for (int cam = 0; cam < s->cfg.cameras && !any; cam++)
        any = s->camera[cam].streaming;
    return any && is_done(s, b);
}

static struct tick *add_tick(struct sst_framesync *s, uint64_t index, int64_t t_ns, bool edge)
{
    struct tick *b;

    if (s->count == TICKS) { /* far more triggers than sets can be open */
        if (!s->tick[s->first].closed)
            close_tick(s, &s->tick[s->first]);
        s->first = (s->first + 1) % TICKS;
        s->count--;
    }
    b = tick_at(s, s->count++);
    *b = (struct tick){ .index = index, .t_ns = t_ns, .edge = edge, .set = acquire_set(s) };
    return b;
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

static void assign(struct sst_framesync *s, struct tick *b, struct sst_frame *frame)
{
    const int cam = frame->cam;
    struct sst_frame *old;

    if (b->closed) {
        end_frame(s, frame, has_seen(b, cam) ? SST_BUCKET_DUPLICATE : SST_BUCKET_LATE);
        return;
    }
    if (!b->set) {
        end_frame(s, frame, has_seen(b, cam) ? SST_BUCKET_DUPLICATE : SST_BUCKET_DROPPED);
        b->seen[cam / 64] |= 1ull << cam % 64;
        return;
    }
    old = b->set->frame[cam];
    if (old && s->cfg.match == SST_FRAMESYNC_NEAREST) {
        const int64_t due = b->t_ns + s->cfg.delay_ns[cam];
        const bool nearer = llabs(frame->t_ns - due) < llabs(old->t_ns - due);

        end_frame(s, nearer ? old : frame, SST_BUCKET_STRAY);
        if (nearer)
            b->set->frame[cam] = frame;
        return;
    }
    if (old) {
        end_frame(s, frame, SST_BUCKET_DUPLICATE);
        return;
    }
    b->seen[cam / 64] |= 1ull << cam % 64;
    b->set->frame[cam] = frame;
    b->set->present++;
}

/* The trigger nearest to a time, or NULL; searched from the newest. */
static struct tick *nearest_tick(struct sst_framesync *s, int64_t t_ns)
{
    struct tick *best = NULL;

    for (int i = s->count - 1; i >= 0; i--) {
        struct tick *b = tick_at(s, i);

        if (best && llabs(b->t_ns - t_ns) >= llabs(best->t_ns - t_ns))
            break;
        best = b;
    }
    return best;
}

/* @return false: newer than every trigger, its own may not be reported yet */
static bool assign_by_trigger(struct sst_framesync *s, struct sst_frame *frame)
{
    const int64_t t = due_of(s, frame->cam, frame->t_ns);
    struct tick *b = nearest_tick(s, t);

    if (b && llabs(b->t_ns - t) <= s->cfg.window_ns)
        assign(s, b, frame);
    else if (!b || (b == tick_at(s, s->count - 1) && t > b->t_ns))
        return false;
    else
        end_frame(s, frame, SST_BUCKET_STRAY);
    return true;
}

static void hold(struct sst_framesync *s, struct sst_frame *frame)
{
    if (s->pending_count == PENDING_PER_CAMERA * s->cfg.cameras) {
        end_frame(s, s->pending[0], SST_BUCKET_STRAY);
        memmove(s->pending, s->pending + 1, (size_t)--s->pending_count * sizeof(s->pending[0]));
    }
    s->pending[s->pending_count++] = frame;
}

static struct tick *tick_of(struct sst_framesync *s, int64_t index)
{
    for (int i = s->count - 1; i >= 0; i--)
        if ((int64_t)tick_at(s, i)->index == index)
            return tick_at(s, i);
    return NULL;
}

/*
 * FREE: number the frame by the time since the camera's last one, so that a camera near the border between two ticks
 * does not jump between them; a camera that slipped by three quarters of a period is assigned to the nearest tick.
 */
static void assign_by_tick(struct sst_framesync *s, struct sst_frame *frame)
{
    struct camera *c = &s->camera[frame->cam];
    struct tick *last = s->count ? tick_at(s, s->count - 1) : NULL;
    int64_t k = 0;

    if (last) {
        const double ahead = (double)(frame->t_ns - last->t_ns) / s->period_ns;

        k = (int64_t)last->index + (int64_t)floor(ahead + 0.5);
        if (c->heard) {
            const double steps = floor((double)(frame->t_ns - c->last_ns) / s->period_ns + 0.5);
            const int64_t counted = c->tick + (int64_t)steps;

            if (fabs((double)(counted - (int64_t)last->index) - ahead) <= 0.75)
                k = counted;
            else {
                pthread_mutex_lock(&s->lock);
                s->counters.relocked++;
                pthread_mutex_unlock(&s->lock);
            }
            if (steps >= 1) /* small steps: converges over all cameras, and no single camera decides */
                s->period_ns += 0.002 * ((double)(frame->t_ns - c->last_ns) / steps - s->period_ns);
        }
        if (k < 0)
            k = 0;
    }
    c->heard = true;
    c->last_ns = frame->t_ns;
    c->tick = k;
    if (!last || k > (int64_t)last->index) {
        const int64_t t =
            last ? last->t_ns + (int64_t)((double)(k - (int64_t)last->index) * s->period_ns) : frame->t_ns;

        assign(s, add_tick(s, (uint64_t)k, t, false), frame);
        return;
    }
    last = tick_of(s, k);
    if (last)
        assign(s, last, frame);
    else /* a tick that no frame opened in time */
        end_frame(s, frame, SST_BUCKET_LATE);
}

void sst_framesync_place(struct sst_framesync *s, int cam, uint64_t index, struct sst_frame *frame)
{
    struct camera *c = &s->camera[cam];
    struct tick *b;

    assert(s->cfg.match == SST_FRAMESYNC_INDEX && cam >= 0 && cam < s->cfg.cameras);
    if (!c->heard || c->tick < (int64_t)index)
        c->tick = (int64_t)index;
    c->heard = true;
    if (!frame)
        return;
    b = tick_of(s, (int64_t)index);
    if (frame->faults & SST_FRAME_BAD)
        end_frame(s, frame, frame->faults & SST_FRAME_FLAGGED ? SST_BUCKET_FLAGGED : SST_BUCKET_CORRUPT);
    else if (b)
        assign(s, b, frame);
    else /* of a trigger that is forgotten, or was never reported */
        end_frame(s, frame, s->count && index < tick_at(s, 0)->index ? SST_BUCKET_LATE : SST_BUCKET_STRAY);
}

void sst_framesync_frame(struct sst_framesync *s, struct sst_frame *frame)
{
    struct camera *c = &s->camera[frame->cam];

    assert(frame->cam >= 0 && frame->cam < s->cfg.cameras);
    if (frame->faults & SST_FRAME_BACKWARDS && s->cfg.match != SST_FRAMESYNC_FREE) /* no triggers to mistake */
        c->doubtful = true;
    if (frame->faults & SST_FRAME_BAD) {
        end_frame(s, frame, frame->faults & SST_FRAME_FLAGGED ? SST_BUCKET_FLAGGED : SST_BUCKET_CORRUPT);
        return;
    }
    if (!stamp_holds(s, c, frame)) {
        end_frame(s, frame, SST_BUCKET_CORRUPT);
        return;
    }
    if (s->cfg.match == SST_FRAMESYNC_FREE) {
        assign_by_tick(s, frame);
        return;
    }
    c->heard = true;
    c->last_ns = frame->t_ns;
    if (!assign_by_trigger(s, frame))
        hold(s, frame);
}

void sst_framesync_trigger(struct sst_framesync *s, uint64_t index, int64_t t_ns, bool edge)
{
    int kept = 0;

    add_tick(s, index, t_ns, edge);
    for (int i = 0; i < s->pending_count; i++)
        if (!assign_by_trigger(s, s->pending[i]))
            s->pending[kept++] = s->pending[i];
    s->pending_count = kept;
}

void sst_framesync_camera(struct sst_framesync *s, int cam, bool streaming)
{
    s->camera[cam].streaming = streaming;
    if (!streaming)
        s->camera[cam].heard = false;
}

int64_t sst_framesync_tick(struct sst_framesync *s, int64_t now_ns)
{
    int64_t next = INT64_MAX;
    int kept = 0;

    for (int i = 0; i < s->count; i++) {
        struct tick *b = tick_at(s, i);

        if (b->closed)
            continue;
        if (!is_due(s, b, now_ns)) { /* later ones wait too: sets are passed on in order */
            next = b->t_ns + s->cfg.wait_ns;
            break;
        }
        close_tick(s, b);
    }
    for (int i = 0; i < s->pending_count; i++) {
        if (now_ns - s->pending[i]->arrival_ns >= s->cfg.wait_ns) {
            end_frame(s, s->pending[i], SST_BUCKET_STRAY);
            continue;
        }
        if (s->pending[i]->arrival_ns + s->cfg.wait_ns < next)
            next = s->pending[i]->arrival_ns + s->cfg.wait_ns;
        s->pending[kept++] = s->pending[i];
    }
    s->pending_count = kept;
    return next;
}

void sst_framesync_flush(struct sst_framesync *s)
{
    for (int i = 0; i < s->count; i++)
        if (!tick_at(s, i)->closed)
            close_tick(s, tick_at(s, i));
    for (int i = 0; i < s->pending_count; i++)
        end_frame(s, s->pending[i], SST_BUCKET_STRAY);
    s->pending_count = 0;
}

void sst_framesync_counters(const struct sst_framesync *sets, struct sst_framesync_counters *out)
{
    struct sst_framesync *s = (struct sst_framesync *)sets;

    pthread_mutex_lock(&s->lock);
    *out = s->counters;
    out->waiting = (uint64_t)s->pending_count;
    for (int i = 0; i < s->cfg.pool; i++)
        for (int cam = 0; s->busy[i] && !s->counted[i] && cam < s->cfg.cameras; cam++) /* also of open ones */
            out->waiting += s->pool[i].frame[cam] != NULL;
    pthread_mutex_unlock(&s->lock);
}

int sst_framesync_create(struct sst_framesync **out, const struct sst_framesync_config *cfg,
                         const struct sst_framesync_events *events)
{
    struct sst_framesync *s;

    if (cfg->cameras < 1 || cfg->cameras > SST_CAMERAS_MAX || cfg->pool < 2 || cfg->pool > 64 || cfg->period_ns < 0 ||
        (cfg->match == SST_FRAMESYNC_FREE && cfg->period_ns == 0))
        return -EINVAL;
    s = calloc(1, sizeof(*s));
    if (!s)
        return -ENOMEM;
    pthread_mutex_init(&s->lock, NULL);
    s->cfg = *cfg;
    s->events = *events;
    s->period_ns = (double)cfg->period_ns;
    if (!s->cfg.window_ns)
        s->cfg.window_ns = cfg->period_ns * 2 / 5 > 1000000 ? cfg->period_ns * 2 / 5 : 1000000;
    if (!s->cfg.wait_ns)
        s->cfg.wait_ns = cfg->period_ns * 5 / 2 > 250000000 ? cfg->period_ns * 5 / 2 : 250000000;
    s->pool = calloc((size_t)cfg->pool, sizeof(*s->pool));
    s->pending = calloc((size_t)cfg->cameras * PENDING_PER_CAMERA, sizeof(*s->pending));
    if (!s->pool || !s->pending) {
        sst_framesync_destroy(s);
        return -ENOMEM;
    }
    *out = s;
    return 0;
}

void sst_framesync_destroy(struct sst_framesync *s)
{
    if (!s)
        return;
    pthread_mutex_destroy(&s->lock);
    free(s->pool);
    free(s->pending);
    free(s);
}
