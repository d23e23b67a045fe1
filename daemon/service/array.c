/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/service/service_internal.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/kernel_clock.h"
#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"

#define RETRY_MIN_NS INT64_C(500000000)
#define RETRY_MAX_NS INT64_C(5000000000)
#define SMOOTH       0.1 /* share of a new set in a camera's skew */

struct service_array {
    /* fixed after open */
    struct sst_ring *ring;
    struct sst_events *events;
    struct sst_link_node *node; /* on a node; else NULL */
    char address[64];           /* of the head */
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    /* capturing thread */
    struct sst_array_config config; /* of this opening, with its findings */
    uint64_t told_skewed, told_sets;
    int64_t told_ns;
    bool skew_over, trigger_away;
    /* under lock */
    struct sst_array_config wanted;
    unsigned wanted_count;       /* of configurations */
    struct sst_capture *capture; /* while it runs */
    struct sst_link_head *head;  /* on a head, while it runs */
    bool stop, ended;
    struct array_state state;
    struct array_layout layout;
    struct array_camera camera[SST_CAMERAS_MAX];
    uint64_t sets_before, complete_before;                          /* of earlier openings */
    uint64_t frames[SST_CAMERAS_MAX], told_frames[SST_CAMERAS_MAX]; /* in sets */
};

const char *const array_state_names[] = { "absent", "streaming", "recovering", "refused", "ready" };

/* --- events of capture -------------------------------------------------------------------------------------------- */

/** Each camera's stamp against the median of its set. */
static void note_set_locked(struct service_array *a, const struct sst_frameset *set)
{
    int64_t stamp[SST_CAMERAS_MAX], median;
    int n = 0;

    for (int i = 0; i < set->cameras; i++)
        if (set->frame[i])
            stamp[n++] = set->frame[i]->t_ns;
    if (!n)
        return;
    sst_stats_sort_int64(stamp, n);
    median = stamp[n / 2];
    for (int i = 0; i < set->cameras; i++) {
        struct array_camera *c = &a->camera[i];

        if (set->frame[i]) {
            const double us = (double)(set->frame[i]->t_ns - median) / 1e3;

            c->skew_us = c->last_ns ? c->skew_us + SMOOTH * (us - c->skew_us) : us;
            c->last_ns = set->t_ns;
            a->frames[i]++;
        }
    }
    a->state.frame_ns = sst_clock_now_ns();
}

/** On the writer's thread of capture: copy the set, so that its frames go back at once. */
static int on_set(void *arg, const struct sst_frameset *set)
{
    struct service_array *a = arg;
    const int err = sst_ring_put(a->ring, set);

    pthread_mutex_lock(&a->lock);
    note_set_locked(a, set);
    a->state.ring_refused += err != 0;
    sst_histogram_add(&a->state.delay_ns, sst_clock_now_ns() - set->t_ns);
    pthread_mutex_unlock(&a->lock);
    if (a->node && !err)
        sst_link_node_set(a->node, set);
    return err;
}

static json_t *camera_position(const struct service_array *a, int cam)
{
    const struct sst_config_camera *at = &a->config.camera[cam];

    return json_pack("{s:i, s:i, s:s, s:s}", "row", at->row, "col", at->col, "serial", at->serial, "port", at->port);
}

static void on_camera(void *arg, int cam, enum sst_grab_state state, const char *why)
{
    struct service_array *a = arg;
    const struct sst_config_camera *at = &a->config.camera[cam];
    struct array_camera *c = &a->camera[cam];
    const bool delivers = state == SST_GRAB_STREAMING;
    enum sst_grab_state before;
    bool known;

    pthread_mutex_lock(&a->lock);
    before = c->state;
    known = c->last_ns != 0;
    c->state = state;
    snprintf(c->reason, sizeof(c->reason), "%s", why ? why : "");
    pthread_mutex_unlock(&a->lock);
    if (a->node)
        sst_link_node_camera(a->node, cam, state, why, NULL);
    if (delivers && before != SST_GRAB_STREAMING && known)
        sst_events_emit(a->events, SST_EVENT_INFO, "camera-found", camera_position(a, cam),
                        "camera of row %d, col %d (%s) delivers again", at->row, at->col,
                        at->serial[0] ? at->serial : at->port);
    if (before == SST_GRAB_STREAMING && !delivers && state != SST_GRAB_READY) {
        json_t *data = camera_position(a, cam);

        json_object_set_new(data, "reason", json_string(why ? why : ""));
        sst_events_emit(a->events, SST_EVENT_WARNING, "camera-lost", data, "camera of row %d, col %d (%s) is lost: %s",
                        at->row, at->col, at->serial[0] ? at->serial : at->port, why ? why : "unplugged");
    }
}

static void report_skew(struct service_array *a, const struct sst_capture_report *r, uint64_t sets)
{
    const bool over = r->skewed > a->told_skewed && 2 * (r->skewed - a->told_skewed) > sets;
    const struct sst_config_camera *at = &a->config.camera[sst_max_int(r->worst_cam, 0)];
    json_t *data;

    a->told_skewed = r->skewed;
    if (over == a->skew_over || !sst_array_triggered(&a->config) || !sets)
        return;
    a->skew_over = over;
    data = json_pack("{s:b, s:f, s:i, s:i}", "over", over, "spread_us", (double)r->skew_ns.max / 1e3, "row", at->row,
                     "col", at->col);
    if (over)
        sst_events_emit(a->events, SST_EVENT_WARNING, "skew", data,
                        "most sets exceed the limit of %d us between exposures; the farthest camera is r%dc%d",
                        a->config.skew_limit_us, at->row, at->col);
    else
        sst_events_emit(a->events, SST_EVENT_INFO, "skew", data, "exposures are within %d us again",
                        a->config.skew_limit_us);
}

static void report_trigger(struct service_array *a, bool away)
{
    if (away == a->trigger_away)
        return;
    a->trigger_away = away;
    if (away)
        sst_events_emit(a->events, SST_EVENT_ERROR, "trigger-lost", NULL,
                        "the trigger's GPIO chip \"%s\" is gone; searching for it, cameras wait",
                        a->config.chip[0] ? a->config.chip : a->config.line[0]);
    else
        sst_events_emit(a->events, SST_EVENT_INFO, "trigger-found", NULL, "the trigger fires again");
}

static void update_camera_locked(struct service_array *a, int i, const struct sst_capture_report *r, double s)
{
    struct array_camera *c = &a->camera[i];
    const struct sst_grab_device *device;

    sst_capture_camera(a->capture, i, &c->grab, &device);
    if (device->port[0]) {
        memcpy(c->serial, device->serial, sizeof(c->serial));
        memcpy(c->port, device->port, sizeof(c->port));
        memcpy(c->name, device->name, sizeof(c->name));
    }
    c->ptp = (struct sst_genicam_ptp){ 0 };
    (void)sst_capture_ptp(a->capture, i, &c->ptp);
    memcpy(c->bucket, r->sets.camera[i], sizeof(c->bucket));
    c->rate_hz = s > 0 ? (double)(a->frames[i] - a->told_frames[i]) / s : 0;
    a->told_frames[i] = a->frames[i];
}

/** Until sets come, errors are kept as the reason of the state; afterwards they are logged. */
static void log_errors(void)
{
    char *held = sst_log_hold_errors(NULL);

    if (held && held[0]) {
        sst_log_error("%s", held);
        held[0] = 0;
    }
}

/** Frames that ended since the last report: were they of any use? */
static void note_unused_locked(struct service_array *a, const struct sst_framesync_counters *n, int64_t now_ns)
{
    const uint64_t *before = a->state.report.sets.bucket, used = n->bucket[SST_BUCKET_SET] - before[SST_BUCKET_SET];
    uint64_t unused = 0, most = 0;

    for (int i = 0; i < SST_BUCKETS; i++) {
        const uint64_t more = n->bucket[i] - before[i];

        if (i == SST_BUCKET_SET || i == SST_BUCKET_DROPPED ||
            (i == SST_BUCKET_STRAY && a->config.source == SST_CONFIG_SOFTWARE))
            continue; /* marks in time leave most frames stray */
        unused += more;
        if (more > most) {
            most = more;
            a->state.unused_bucket = (enum sst_bucket)i;
        }
    }
    if (unused)
        a->state.unused_ns = now_ns;
    if (unused || used)
        a->state.unused_s = unused > 9 * used ? a->state.unused_s + 1 : 0;
}

/** Once a second, on the capturing thread. */
static void on_progress(void *arg, uint64_t sets)
{
    struct service_array *a = arg;
    const int64_t now_ns = sst_clock_now_ns();
    const double s = (double)(now_ns - a->told_ns) / 1e9;
    struct sst_capture_report r;

    if (!a->capture)
        return;
    if (sets)
        log_errors();
    sst_capture_report(a->capture, &r);
    if (a->node)
        sst_link_node_report(a->node, &r);
    report_skew(a, &r, sets - a->told_sets);
    report_trigger(a, r.trigger_away);
    pthread_mutex_lock(&a->lock);
    if (sets)
        a->state.reason[0] = 0;
    a->state.beat_ns = now_ns;
    note_unused_locked(a, &r.sets, now_ns);
    a->state.report = r;
    a->state.sets = a->sets_before + r.handed;
    a->state.complete = a->complete_before + r.complete;
    a->state.rate_hz = s > 0 ? (double)(sets - a->told_sets) / s : 0;
    for (int i = 0; i < a->config.bound; i++)
        update_camera_locked(a, i, &r, s);
    pthread_mutex_unlock(&a->lock);
    a->told_ns = now_ns;
    a->told_sets = sets;
}

/* --- the capturing thread ----------------------------------------------------------------------------------------- */

/** How far sets are apart, as they were asked for. */
static int64_t period_ns(const struct sst_array_config *a)
{
    return (int64_t)(1e9 / sst_array_sets_hz(a));
}

/** Until an opening succeeds, cameras are where the last one found them. */
static void clear_cameras_locked(struct service_array *a)
{
    memset(a->camera, 0, sizeof(a->camera));
    for (int i = 0; a->layout.generation && i < a->layout.config.bound; i++) {
        const struct sst_config_camera *at = &a->layout.config.camera[i];

        a->camera[i].row = at->row;
        a->camera[i].col = at->col;
        memcpy(a->camera[i].serial, at->serial, sizeof(a->camera[i].serial));
        memcpy(a->camera[i].port, at->port, sizeof(a->camera[i].port));
    }
}

/** Facts learned by opening: the place of each camera. */
static void begin_locked(struct service_array *a, struct sst_capture *capture)
{
    struct sst_ring_counters ring;

    sst_ring_counters(a->ring, &ring);
    a->capture = capture;
    a->layout.generation++;
    a->layout.first = ring.kept + 1;
    a->layout.config = a->config;
    a->state.beat_ns = sst_clock_now_ns();
    a->state.open = true;
    a->state.failed = false;
    a->state.report = (struct sst_capture_report){ 0 };
    memset(&a->state.delay_ns, 0, sizeof(a->state.delay_ns));
    a->state.unused_s = 0;
    a->state.cameras = a->config.bound;
    a->state.period_ns = period_ns(&a->config);
    a->sets_before = a->state.sets;
    a->complete_before = a->state.complete;
    memset(a->frames, 0, sizeof(a->frames));
    memset(a->told_frames, 0, sizeof(a->told_frames));
    for (int i = 0; i < a->config.bound; i++) {
        struct array_camera *c = &a->camera[i];
        const struct sst_grab_device *device;

        sst_capture_camera(capture, i, &c->grab, &device);
        c->row = a->config.camera[i].row;
        c->col = a->config.camera[i].col;
        memcpy(c->serial, device->port[0] ? device->serial : a->config.camera[i].serial, sizeof(c->serial));
        memcpy(c->port, device->port[0] ? device->port : a->config.camera[i].port, sizeof(c->port));
        memcpy(c->name, device->name, sizeof(c->name));
        c->masked = sst_capture_masked(capture, i);
    }
}

/* On a node: the head learns of the opening. */
static void announce(struct service_array *a, struct sst_capture *capture)
{
    sst_link_node_cameras(a->node, &a->config);
    for (int i = 0; i < a->config.bound; i++) {
        const struct sst_grab_device *device;
        struct sst_grab_counters grab;

        sst_capture_camera(capture, i, &grab, &device);
        sst_link_node_camera(a->node, i, a->camera[i].state, a->camera[i].reason, device);
    }
}

/* A host of the array, as seen from here: a node of this head, or this node's head. On the link's thread. */
static void on_host(void *arg, const char *name, bool connected, const char *why)
{
    struct service_array *a = arg;
    const char *what = a->node ? "head" : "node";
    json_t *data = json_pack("{s:s, s:s}", "host", name, "reason", why);

    if (connected)
        sst_events_emit(a->events, SST_EVENT_INFO, "host-found", data, "%s %s is connected", what, name);
    else
        sst_events_emit(a->events, SST_EVENT_WARNING, "host-lost", data, "%s %s is not connected: %s", what, name, why);
}

static void end_locked(struct service_array *a)
{
    a->capture = NULL;
    a->state.open = false;
    a->state.rate_hz = 0;
}

/**
 * @param count  of configurations, when this one was taken
 * @param again  it was tried before, and failed
 * @param why    out, the sentence of the error that ended it, or ""
 * @return 0, or that error
 */
static int capture_once(struct service_array *a, unsigned count, bool again, char why[SST_LOG_MAX])
{
    const struct sst_capture_events events = {
        .arg = a, .set = on_set, .progress = on_progress, .camera = on_camera, .quiet = true, .again = again
    };
    struct sst_source source = { 0 };
    struct sst_link_head *head = NULL;
    struct sst_capture *capture = NULL;
    int err = 0;

    why[0] = 0;
    sst_log_hold_errors(why); /* the reason of the state, until sets come */
    a->told_ns = sst_clock_now_ns();
    a->told_sets = a->told_skewed = 0;
    pthread_mutex_lock(&a->lock);
    clear_cameras_locked(a);
    pthread_mutex_unlock(&a->lock);
    if (a->config.role == SST_CONFIG_HEAD) {
        const struct sst_link_head_config hosts = { .array = &a->config, .arg = a, .event = on_host };

        err = sst_link_head_open(&head, &hosts, &a->config);
        source = err ? source : sst_link_head_source(head);
    }
    err = err ? err : sst_capture_open_source(&capture, &a->config, &source, &events);
    if (!err) {
        pthread_mutex_lock(&a->lock);
        begin_locked(a, capture);
        a->head = head;
        if (a->stop || a->wanted_count != count) /* asked for while there was nothing to stop */
            sst_capture_stop(capture);
        pthread_mutex_unlock(&a->lock);
        if (a->node)
            announce(a, capture);
        err = sst_capture_run(capture, 0);
        if (a->node)
            sst_link_node_cameras(a->node, NULL);
        pthread_mutex_lock(&a->lock);
        end_locked(a);
        a->head = NULL;
        pthread_mutex_unlock(&a->lock);
    }
    sst_capture_close(capture);
    sst_link_head_close(head);
    sst_log_hold_errors(NULL);
    if (err && !why[0])
        snprintf(why, SST_LOG_MAX, "capturing ended: %s", strerror(-err));
    return err;
}

static void wait_locked(struct service_array *a, int64_t ns, unsigned count)
{
    const int64_t end_ns = sst_clock_now_ns() + ns;

    while (!a->stop && a->wanted_count == count && sst_clock_now_ns() < end_ns) {
        const int64_t next_ns = sst_clock_now_ns() + 500000000;

        a->state.beat_ns = sst_clock_now_ns();
        (void)sst_cond_wait_until(&a->changed, &a->lock, next_ns < end_ns ? next_ns : end_ns);
    }
    a->state.beat_ns = sst_clock_now_ns();
}

static void *run(void *arg)
{
    struct service_array *a = arg;
    int64_t retry_ns = RETRY_MIN_NS;
    unsigned tried = 0;
    char last_logged[SST_LOG_MAX] = "", why[SST_LOG_MAX];

    sst_thread_name("sst-capture");
    pthread_mutex_lock(&a->lock);
    while (!a->stop) {
        const unsigned count = a->wanted_count;
        const uint64_t sets = a->state.sets;
        const bool again = a->state.failed && count == tried;
        int err;

        if (!sst_array_same_masks(&a->config, &a->wanted))
            sst_ring_forget(a->ring); /* sets without the masks, or with others */
        a->config = a->wanted;
        a->state.beat_ns = sst_clock_now_ns();
        pthread_mutex_unlock(&a->lock);
        err = capture_once(a, count, again, why);
        tried = count;
        if (why[0] && strcmp(why, last_logged)) /* once, not at each retry */
            sst_log_error("%s", why);
        memcpy(last_logged, why, sizeof(last_logged));
        pthread_mutex_lock(&a->lock);
        snprintf(a->state.reason, sizeof(a->state.reason), "%s", err ? why : "");
        a->state.failed = err != 0;
        retry_ns = a->state.sets > sets || a->wanted_count != count ? RETRY_MIN_NS
                   : 2 * retry_ns < RETRY_MAX_NS                    ? 2 * retry_ns
                                                                    : RETRY_MAX_NS;
        if (err)
            wait_locked(a, retry_ns, count);
    }
    a->ended = true;
    pthread_cond_broadcast(&a->changed);
    pthread_mutex_unlock(&a->lock);
    return NULL;
}

/* --- for the others ----------------------------------------------------------------------------------------------- */

int array_open(struct service_array **out, const struct sst_array_config *config, struct sst_ring *ring,
               struct sst_events *events)
{
    struct service_array *a = calloc(1, sizeof(*a));
    int err = 0;

    if (!a)
        return -ENOMEM;
    a->ring = ring;
    a->events = events;
    a->wanted = *config;
    a->state.beat_ns = sst_clock_now_ns();
    a->state.report.worst_cam = -1;
    pthread_mutex_init(&a->lock, NULL);
    sst_cond_init(&a->changed);
    if (config->role == SST_CONFIG_NODE)
        err = sst_link_node_open(&a->node, &(struct sst_link_node_config){ .array = config, .ring = ring, .arg = a, .event = on_host });
    if (config->role != SST_CONFIG_SINGLE)
        snprintf(a->address, sizeof(a->address), "%.50s:%d",
                 config->role == SST_CONFIG_NODE ? config->hosts.head : config->hosts.address, config->hosts.port);
    if (err) {
        array_close(a);
        return err;
    }
    err = -pthread_create(&a->thread, NULL, run, a);
    if (err) {
        array_close(a);
        return err;
    }
    *out = a;
    return 0;
}

void array_configure(struct service_array *a, const struct sst_array_config *config)
{
    pthread_mutex_lock(&a->lock);
    a->wanted = *config;
    a->wanted_count++;
    if (a->capture)
        sst_capture_stop(a->capture);
    pthread_cond_broadcast(&a->changed);
    pthread_mutex_unlock(&a->lock);
}

void array_state(struct service_array *a, struct array_state *out)
{
    pthread_mutex_lock(&a->lock);
    *out = a->state;
    out->present = 0;
    for (int i = 0; a->state.open && i < a->state.cameras; i++)
        out->present += a->camera[i].state == SST_GRAB_STREAMING;
    pthread_mutex_unlock(&a->lock);
}

int array_cameras(struct service_array *a, struct array_camera *out)
{
    int n;

    pthread_mutex_lock(&a->lock);
    n = a->layout.generation ? a->layout.config.bound : 0;
    memcpy(out, a->camera, sizeof(*out) * (size_t)n);
    pthread_mutex_unlock(&a->lock);
    return n;
}

struct array_source array_source(struct service_array *a)
{
    return (struct array_source){ &a->lock, &a->layout };
}

unsigned array_layout(struct array_source source, unsigned seen, struct array_layout *out)
{
    unsigned generation;

    pthread_mutex_lock(source.lock);
    generation = source.layout->generation;
    if (generation != seen)
        *out = *source.layout;
    pthread_mutex_unlock(source.lock);
    return generation;
}

void array_tracks(struct service_array *a, struct sst_recorder_track *out)
{
    pthread_mutex_lock(&a->lock);
    for (int i = 0; a->layout.generation && i < a->layout.config.bound; i++) {
        const struct array_camera *c = &a->camera[i];

        out[i] = (struct sst_recorder_track){ .row = c->row, .col = c->col };
        memcpy(out[i].serial, c->serial, sizeof(out[i].serial));
        memcpy(out[i].port, c->port, sizeof(out[i].port));
        memcpy(out[i].name, c->name, sizeof(out[i].name));
    }
    pthread_mutex_unlock(&a->lock);
}

bool array_hosts(struct service_array *a, struct hosts_now *out)
{
    struct sst_link_peer peer[SST_NUMBERING_SOURCES];
    struct sst_kernel_clock clock;

    sst_kernel_clock(&clock);
    out->synchronised = clock.synchronised;
    out->error_ms = clock.error_us / 1e3;
    out->address = a->address;
    pthread_mutex_lock(&a->lock);
    out->role = a->wanted.role;
    out->role_name = out->role == SST_CONFIG_NODE ? "node" : "head";
    out->period_ns = period_ns(&a->wanted);
    if (a->head) {
        out->peers = sst_link_head_peers(a->head, peer);
        for (int i = 0; i < out->peers; i++)
            out->peer[i] = (struct hosts_peer){ .link = peer[i],
                                                .clock_ms = (double)peer[i].numbering.clock_ns / 1e6,
                                                .edge_us = (double)peer[i].numbering.residual_ns / 1e3 };
        out->overflows = sst_link_head_overflows(a->head);
        for (int i = 0; i < a->layout.config.bound; i++) {
            const int owner = sst_link_head_owner(a->head, i);

            for (int k = 0; owner >= 0 && k < SST_BUCKETS; k++)
                out->peer[owner].bucket[k] += a->camera[i].bucket[k];
        }
    }
    pthread_mutex_unlock(&a->lock);
    if (a->node)
        sst_link_node_state(a->node, &out->node);
    return out->role != SST_CONFIG_SINGLE;
}

void array_hosts_forget(struct hosts_now *now)
{
    for (int i = 0; i < now->peers; i++)
        json_decref(now->peer[i].link.reported);
}

void array_stop(struct service_array *a)
{
    pthread_mutex_lock(&a->lock);
    a->stop = true;
    if (a->capture)
        sst_capture_stop(a->capture);
    if (a->head)
        sst_link_head_stop(a->head);
    pthread_cond_broadcast(&a->changed);
    pthread_mutex_unlock(&a->lock);
}

bool array_join(struct service_array *a, int64_t until_ns)
{
    bool ended;

    pthread_mutex_lock(&a->lock);
    while (!a->ended && sst_cond_wait_until(&a->changed, &a->lock, until_ns))
        ;
    ended = a->ended;
    pthread_mutex_unlock(&a->lock);
    if (ended)
        pthread_join(a->thread, NULL);
    if (a->node) /* also beside cameras that hang: the end of the process must find no thread in the TLS library */
        sst_link_node_stop(a->node);
    return ended;
}

void array_close(struct service_array *a)
{
    if (!a)
        return;
    sst_link_node_close(a->node);
    pthread_cond_destroy(&a->changed);
    pthread_mutex_destroy(&a->lock);
    free(a);
}
