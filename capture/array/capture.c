/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/array/capture.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/array/array_internal.h"
#include "capture/array/masks.h"
#include "drivers/trigger/trigger.h"

#define EDGES         64   /* from the trigger's thread, not yet processed */
#define START_WAIT_MS 3000 /* for cameras that need recovery at the start */
#define LAST_WAIT_NS  2000000000
#define STOP_WAIT_NS  300000000   /* on stop: slow or missing frames are not waited for */
#define CHIP_WAIT_NS  30000000000 /* for a vanished trigger chip to return */
#define CHIP_RETRY_NS 200000000
#define SOURCE_POOL   60 /* of a source without cameras of this host: sets */
#define SOURCE_WAIT_NS 600000000 /* ... and how long they wait */

struct sst_capture {
    /* fixed after open */
    struct sst_array_config *array;
    struct sst_capture_events events;
    bool owned;               /* the source is the cameras of this host */
    struct sst_source source; /* ops NULL until it is open */
    struct cameras *cameras;  /* the source; NULL: another one */
    struct sst_trigger *trigger;
    struct sst_framesync *sets;
    struct sst_masks *masks; /* NULL: none; used by the writer */
    struct sst_masks_set *masked;
    int wake_fd; /* eventfd: edges, stop */
    atomic_bool stop;
    /* capture thread */
    uint64_t wanted;
    bool skewed, starting;
    bool came[SST_CAMERAS_MAX];                  /* cameras that have delivered a frame */
    int refused_cam;                             /* the first one that was refused or lost ... */
    char refusal[384];                           /* ... and why, of callers that read the last error alone */
    char name[SST_CAMERAS_MAX][SST_HEALTH_NAME]; /* of cameras, for the log */
    struct health health;
    int64_t idle_ns; /* since when the train has failed; 0: it runs */
    struct sst_capture_report report;
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct sst_trigger_edge edge[EDGES];
    int edge_first, edge_count;
    struct sst_frameset *queue[64]; /* closed sets on their way to the writer; the pool is no larger */
    int queue_first, queue_count;
    bool writer_ends, writer_runs;
    uint64_t refused, withheld, spoilt; /* sets; frames without their masks; sets that were complete with them */
    pthread_t writer;
};

static void wake(struct sst_capture *c)
{
    (void)eventfd_write(c->wake_fd, 1); /* full: it is already readable */
}

/* --- writer thread ------------------------------------------------------------------------------------------------ */

/* The set as others may see it. Frames that cannot be masked are returned to their cameras. */
static const struct sst_frameset *mask_set(struct sst_capture *c, struct sst_frameset *set)
{
    if (!c->masks)
        return set;
    sst_masks_apply(c->masks, set, c->masked);
    if (c->masked->withheld) {
        pthread_mutex_lock(&c->lock);
        c->withheld += (uint64_t)c->masked->withheld;
        c->spoilt += set->present == set->cameras;
        pthread_mutex_unlock(&c->lock);
    }
    for (int i = 0; i < c->masked->withheld; i++)
        sst_framesync_withhold(c->sets, set, c->masked->cam[i]);
    return &c->masked->set;
}

static void *write_sets(void *arg)
{
    struct sst_capture *c = arg;

    pthread_mutex_lock(&c->lock);
    for (;;) {
        struct sst_frameset *set;
        int err;

        while (!c->queue_count && !c->writer_ends)
            pthread_cond_wait(&c->changed, &c->lock);
        if (!c->queue_count)
            break;
        set = c->queue[c->queue_first];
        c->queue_first = (c->queue_first + 1) % (int)ARRAY_LEN(c->queue);
        c->queue_count--;
        pthread_mutex_unlock(&c->lock);
        err = c->events.set(c->events.arg, mask_set(c, set));
        sst_framesync_recycle(c->sets, set, err != 0);
        pthread_mutex_lock(&c->lock);
        c->refused += err != 0;
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

/* --- events, on the capture thread -------------------------------------------------------------------------------- */

static void watch_skew(struct sst_capture *c, const struct sst_frameset *set)
{
    const int64_t limit_ns = (int64_t)c->array->skew_limit_us * 1000;
    const bool over = set->skew.spread_ns > limit_ns;

    if (set->present < 2)
        return;
    if (!c->report.skew_ns.count || set->skew.spread_ns > c->report.skew_ns.max)
        c->report.worst_cam = set->skew.worst_cam;
    sst_histogram_add(&c->report.skew_ns, set->skew.spread_ns);
    if (set->edge)
        sst_histogram_add(&c->report.from_edge_ns, llabs(set->skew.from_edge_ns));
    c->report.skewed += over;
    if (c->events.quiet || over == c->skewed || !sst_array_triggered(c->array))
        return; /* without a common trigger there is no limit on skew */
    c->skewed = over;
    if (over)
        sst_log_warning("set %llu: a skew of %.0f us exceeds the limit of %d us, the worst camera is at row %d, col "
                        "%d: check its trigger wiring and its exposure settings",
                        (unsigned long long)set->index, (double)set->skew.spread_ns / 1e3, c->array->skew_limit_us,
                        c->array->camera[set->skew.worst_cam].row, c->array->camera[set->skew.worst_cam].col);
    else
        sst_log_warning("set %llu: the skew is within %d us again", (unsigned long long)set->index,
                        c->array->skew_limit_us);
}

static void on_set(void *arg, struct sst_frameset *set)
{
    struct sst_capture *c = arg;

    /* In free run sets exist before all cameras have started, and until the stop. */
    if (c->starting || (c->wanted && c->report.handed == c->wanted)) {
        sst_framesync_recycle(c->sets, set, true);
        return;
    }
    for (int cam = 0; cam < set->cameras; cam++)
        if (set->frame[cam])
            health_set(&c->health, cam);
    c->report.handed++;
    c->report.complete += set->present == set->cameras;
    c->report.empty += set->present == 0;
    watch_skew(c, set);
    pthread_mutex_lock(&c->lock);
    c->queue[(c->queue_first + c->queue_count++) % (int)ARRAY_LEN(c->queue)] = set;
    pthread_cond_signal(&c->changed);
    pthread_mutex_unlock(&c->lock);
}

static void on_release(void *arg, struct sst_frame *frame, enum sst_bucket bucket)
{
    struct sst_capture *c = arg;

    if (bucket != SST_BUCKET_SET && bucket != SST_BUCKET_DROPPED && !c->starting &&
        (c->array->source != SST_CONFIG_SOFTWARE || sst_array_triggered(c->array)))
        health_bucket(&c->health, frame, bucket); /* timer ticks leave most frames stray */
    c->source.ops->release(c->source.object, frame);
}

static void on_frame(void *arg, struct sst_frame *frame)
{
    struct sst_capture *c = arg;

    c->came[frame->cam] = true;
    if (!c->starting)
        health_frame(&c->health, frame);
    sst_framesync_frame(c->sets, frame);
}

static void on_trigger(void *arg, uint64_t index, int64_t t_ns, bool edge)
{
    struct sst_capture *c = arg;

    c->report.edges++;
    c->report.edges_stamped += edge;
    sst_framesync_trigger(c->sets, index, t_ns, edge);
}

static void on_placed(void *arg, int cam, uint64_t index, struct sst_frame *frame)
{
    struct sst_capture *c = arg;

    if (frame)
        health_frame(&c->health, frame);
    sst_framesync_place(c->sets, cam, index, frame);
}

static void on_state(void *arg, int cam, enum sst_grab_state state, const char *why)
{
    struct sst_capture *c = arg;

    if (c->sets)
        sst_framesync_camera(c->sets, cam, state == SST_GRAB_STREAMING);
    if (why && why[0] && state != SST_GRAB_STREAMING && state != SST_GRAB_READY && cam <= c->refused_cam) {
        c->refused_cam = cam; /* always the same camera */
        snprintf(c->refusal, sizeof(c->refusal), "; the first is camera %s: %s", c->name[cam], why);
    }
    if (c->events.camera)
        c->events.camera(c->events.arg, cam, state, why);
}

static int64_t edge_ns(const struct sst_trigger_edge *edge)
{
    return edge->kernel_ns ? edge->kernel_ns : edge->before_ns + (edge->after_ns - edge->before_ns) / 2;
}

/* Thread: the trigger's. */
static void on_edge(void *arg, const struct sst_trigger_edge *edge)
{
    struct sst_capture *c = arg;
    bool full;

    /* At once, and before the set is known: these cameras are exposed by it. */
    if (c->cameras)
        cameras_fire(c->cameras, edge_ns(edge));
    pthread_mutex_lock(&c->lock);
    full = c->edge_count == EDGES;
    if (!full)
        c->edge[(c->edge_first + c->edge_count++) % EDGES] = *edge;
    pthread_mutex_unlock(&c->lock);
    wake(c);
    if (full)
        sst_log_error("trigger: edge %llu is lost, %d are queued: the capture thread does not keep up",
                      (unsigned long long)edge->index, EDGES);
}

static void process_edges(struct sst_capture *c)
{
    struct sst_trigger_edge edge;
    uint64_t n;
    bool any;

    if (read(c->wake_fd, &n, sizeof(n)) < 0) {
        /* no events: woken for another reason */
    }
    for (;;) {
        int64_t t_ns;

        pthread_mutex_lock(&c->lock);
        any = c->edge_count > 0;
        if (any) {
            edge = c->edge[c->edge_first];
            c->edge_first = (c->edge_first + 1) % EDGES;
            c->edge_count--;
        }
        pthread_mutex_unlock(&c->lock);
        if (!any)
            return;
        t_ns = edge_ns(&edge);
        c->report.edges++;
        c->report.edges_stamped += edge.kernel_ns != 0;
        sst_framesync_trigger(c->sets, edge.index, t_ns, edge.kernel_ns != 0);
        cameras_expect(c->cameras, t_ns);
    }
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

/* Without `bind`: all cameras in the order of their ports fill the grid row by row, one of each device. */
static int bind_all(struct sst_array_config *a, bool again)
{
    const struct sst_grab_split split = sst_capture_split(a);
    struct sst_grab_device *devices;
    int all, n, err = sst_grab_list(&devices, &all);

    if (err)
        return err;
    n = sst_grab_select(devices, all, a->fourcc);
    err = sst_grab_list_parts(&devices, &n, &all, split);
    if (err) {
        free(devices);
        return err;
    }
    for (int i = n; i < all && !again; i++)
        sst_log_warning("%s (port %s) is no camera of the array: %s; cameras: bind can choose it by port and node: %d",
                        devices[i].node, devices[i].port, devices[i].left_out, devices[i].nth);
    if (n > a->rows * a->cols && !again)
        sst_log_warning("%d cameras are connected, the array has %d positions: the first by port are used; choose them "
                        "in cameras: bind",
                        n, a->rows * a->cols);
    else if (n && n < a->rows * a->cols && !again)
        sst_log_warning("%d cameras are connected, the array has %d positions: they fill the first ones by port; "
                        "assign them in cameras: bind (sst identify --write proposes it)",
                        n, a->rows * a->cols);
    a->bound = sst_min_int(n, a->rows * a->cols);
    for (int i = 0; i < a->bound; i++) {
        struct sst_config_camera *cam = &a->camera[i];
        char port[SST_GRAB_NAME_MAX];

        *cam = (struct sst_config_camera){ 0 };
        sst_array_place(a, i, &cam->row, &cam->col);
        cam->line = a->lines == a->rows && split.rows * split.cols == 1 ? cam->row : 0;
        memcpy(cam->port, devices[i].port, sizeof(cam->port)); /* serials may be equal or absent, ports never are */
        if (!sst_grab_part_of(port, cam->port) || split.rows * split.cols == 1)
            memcpy(port, cam->port, sizeof(port));
        for (int k = n; k < all; k++) /* the node that was selected on its device */
            if (!strcmp(devices[k].port, port))
                cam->node = devices[i].nth;
    }
    free(devices);
    if (!n)
        sst_log_error("no camera is connected: plug one in, or see `sst doctor`");
    return n ? 0 : -ENODEV;
}

static void name_cameras(struct sst_capture *c)
{
    for (int i = 0; i < c->array->bound; i++) {
        const struct sst_config_camera *cam = &c->array->camera[i];

        snprintf(c->name[i], sizeof(c->name[i]), "row %d, col %d (%s)", cam->row, cam->col,
                 cam->serial[0] ? cam->serial : cam->port);
    }
}

static int open_sets(struct sst_capture *c)
{
    const struct sst_array_config *a = c->array;
    const double hz = sst_array_sets_hz(a);
    struct sst_framesync_config cfg = {
        .cameras = a->bound,
        .match = !c->owned                          ? SST_FRAMESYNC_INDEX
                 : sst_array_triggered(a)           ? SST_FRAMESYNC_EDGE
                 : a->source == SST_CONFIG_SOFTWARE ? SST_FRAMESYNC_NEAREST
                                                    : SST_FRAMESYNC_FREE,
        .period_ns = (int64_t)(1e9 / hz),
        .window_ns = (int64_t)a->window_us * 1000,
        .wait_ns = (int64_t)a->wait_ms * 1000000,
        /* So that sets run out before the driver's buffers; another source's do not run out, and wait longer. */
        .pool = c->owned ? sst_clamp_int(a->buffers - 2, 2, 30) : SOURCE_POOL,
    };
    const struct sst_framesync_events events = { .arg = c, .set = on_set, .release = on_release };

    if (cfg.match == SST_FRAMESYNC_INDEX && !cfg.wait_ns) /* a host's frames come when its own sets are closed */
        cfg.wait_ns = 3 * cfg.period_ns > SOURCE_WAIT_NS ? 3 * cfg.period_ns : SOURCE_WAIT_NS;
    if (cfg.match == SST_FRAMESYNC_NEAREST && !cfg.window_ns)
        cfg.window_ns = (int64_t)(0.6e9 / a->rate_hz); /* half a period of the cameras, and some jitter */
    for (int i = 0; i < a->bound; i++) {
        const bool scheduled = a->genicam.trigger == SST_CONFIG_ACTION && a->genicam.action_delay_us;

        if (a->camera[i].kind == SST_CONFIG_GENICAM && a->genicam.trigger != SST_CONFIG_WIRE) {
            cfg.commanded[i] = cfg.match == SST_FRAMESYNC_EDGE && a->genicam.trigger != SST_CONFIG_NONE && !scheduled;
            cfg.delay_ns[i] = scheduled ? (int64_t)a->genicam.action_delay_us * 1000 : 0;
        } else if (a->lines) {
            cfg.delay_ns[i] = (int64_t)a->delay_us[a->camera[i].line] * 1000;
        }
    }
    return sst_framesync_create(&c->sets, &cfg, &events);
}

static int open_cameras(struct sst_capture *c)
{
    const struct sst_grab_events events = { .arg = c, .frame = on_frame, .state = on_state };
    int err;

    if (!c->owned)
        return 0;
    err = cameras_open(&c->cameras, c->array, &events);
    if (!err)
        c->source = (struct sst_source){ &cameras_source_ops, c->cameras };
    return err;
}

struct sst_grab_split sst_capture_split(const struct sst_array_config *a)
{
    int split[2];

    (void)sst_array_split(a, split);
    return (struct sst_grab_split){ split[0], split[1] };
}

void sst_capture_grab_config(struct sst_grab_config *cfg, const struct sst_array_config *a)
{
    sst_grab_config_defaults(cfg);
    cfg->fourcc = a->fourcc;
    cfg->width = a->width;
    cfg->height = a->height;
    cfg->split = sst_capture_split(a);
    cfg->cutter = &array_jpeg_cutter;
    cfg->rate_hz = a->rate_hz;
    cfg->buffers = a->buffers;
    cfg->stall_ms = a->stall_ms;
    cfg->port_power = a->port_power;
    cfg->check_frozen = a->check_frozen;
    cfg->triggered = sst_array_triggered(a);
    cfg->controls = a->controls;
    for (int i = 0; i < a->controls; i++) {
        memcpy(cfg->control[i].name, a->control[i].name, sizeof(cfg->control[i].name));
        cfg->control[i].value = a->control[i].value;
    }
}

void sst_capture_trigger_config(struct sst_trigger_config *cfg, const struct sst_array_config *a)
{
    sst_trigger_config_defaults(cfg);
    cfg->source = a->source == SST_CONFIG_GPIO       ? SST_TRIGGER_GPIO
                  : a->source == SST_CONFIG_EXTERNAL ? SST_TRIGGER_EXTERNAL
                                                     : SST_TRIGGER_SOFTWARE;
    memcpy(cfg->chip, a->chip, sizeof(cfg->chip));
    cfg->lines = a->lines;
    for (int i = 0; i < a->lines; i++) {
        memcpy(cfg->line[i], a->line[i], sizeof(cfg->line[i]));
        cfg->delay_us[i] = a->delay_us[i];
    }
    memcpy(cfg->loopback, a->loopback, sizeof(cfg->loopback));
    cfg->active_low = a->active_low;
    cfg->pulse_us = a->pulse_us;
}

static int open_trigger(struct sst_capture *c)
{
    const struct sst_array_config *a = c->array;
    struct sst_trigger_config cfg;

    if (!c->owned || a->source == SST_CONFIG_FREE_RUN)
        return 0;
    sst_capture_trigger_config(&cfg, a);
    cfg.quiet = c->events.quiet;
    return sst_trigger_open(&c->trigger, &cfg, on_edge, c);
}

/* Without its masks an array is not captured. */
static int open_masks(struct sst_capture *c)
{
    const int err = sst_masks_create(&c->masks, c->array);

    if (err || !c->masks)
        return err;
    c->masked = malloc(sizeof(*c->masked));
    return c->masked ? 0 : -ENOMEM;
}

int sst_capture_open_source(struct sst_capture **out, struct sst_array_config *array, const struct sst_source *source,
                            const struct sst_capture_events *events)
{
    struct sst_capture *c = calloc(1, sizeof(*c));
    int err;

    if (!c)
        return -ENOMEM;
    c->array = array;
    c->events = *events;
    c->owned = !source->ops;
    c->source = *source;
    c->report.worst_cam = -1;
    c->refused_cam = SST_CAMERAS_MAX;
    pthread_mutex_init(&c->lock, NULL);
    pthread_cond_init(&c->changed, NULL);
    c->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    err = c->wake_fd < 0 ? -errno : 0;
    if (!err && c->owned && !array->bound)
        err = bind_all(array, events->again);
    name_cameras(c);
    err = err ? err : open_masks(c);
    err = err ? err : open_sets(c);
    err = err ? err : open_trigger(c);
    err = err ? err : open_cameras(c);
    if (!err) {
        err = -pthread_create(&c->writer, NULL, write_sets, c);
        c->writer_runs = !err;
    }
    if (err)
        sst_capture_close(c);
    else
        *out = c;
    return err;
}

int sst_capture_open(struct sst_capture **out, struct sst_array_config *array, const struct sst_capture_events *events)
{
    if (array->role == SST_CONFIG_HEAD) /* its own cameras alone, not its nodes' */
        array->role = SST_CONFIG_SINGLE;
    return sst_capture_open_source(out, array, &(struct sst_source){ 0 }, events);
}

/* --- running ------------------------------------------------------------------------------------------------------ */

/* Number of cameras that stream, and that have delivered a frame if they run on their own. */
static int ready_cameras(const struct sst_capture *c)
{
    int n = 0;

    for (int i = 0; i < c->array->bound; i++)
        n += c->source.ops->state(c->source.object, i) == SST_GRAB_STREAMING &&
             (sst_array_triggered(c->array) || c->came[i]);
    return n;
}

/* Start the cameras and wait a little for late ones; frames are dropped meanwhile. */
static int start_cameras(struct sst_capture *c)
{
    const struct sst_source_events events = { .arg = c, .trigger = on_trigger, .frame = on_placed, .state = on_state };

    const int64_t until_ns = sst_clock_now_ns() + (int64_t)START_WAIT_MS * 1000000;
    int err = c->owned ? cameras_start(c->cameras) : c->source.ops->start(c->source.object, &events);

    if (!c->owned) /* its cameras may come at any time */
        return err;

    c->starting = true;
    while (err >= 0 && ready_cameras(c) < c->array->bound && sst_clock_now_ns() < until_ns && !c->stop) {
        struct pollfd fd = { .fd = c->source.ops->fd(c->source.object), .events = POLLIN };

        (void)poll(&fd, 1, 50);
        err = c->source.ops->poll(c->source.object);
        sst_framesync_tick(c->sets, sst_clock_now_ns());
    }
    if (c->array->source == SST_CONFIG_FREE_RUN)
        sst_framesync_flush(c->sets);
    c->starting = false;
    if (err < 0)
        return err;
    if (ready_cameras(c) || c->stop)
        return 0;
    sst_log_error(
        "none of the %d cameras streams%s; `sst cameras` lists all, `sst doctor` checks permissions and bandwidth",
        c->array->bound, sst_log_holds_errors() ? c->refusal : ""); /* else it has been shown */
    return -ENODEV;
}

/* One round: wait for frames, edges or the next deadline. */
static int serve(struct sst_capture *c, int64_t until_ns)
{
    struct pollfd fds[2] = { { .fd = c->source.ops->fd(c->source.object), .events = POLLIN }, { .fd = c->wake_fd, .events = POLLIN } };
    const int64_t now_ns = sst_clock_now_ns(), due_ns = sst_framesync_tick(c->sets, now_ns);
    int64_t wait_ns = (due_ns < until_ns ? due_ns : until_ns) - now_ns;

    if (c->trigger && sst_trigger_idle(c->trigger) && wait_ns > CHIP_RETRY_NS)
        wait_ns = CHIP_RETRY_NS;
    if (poll(fds, 2, wait_ns <= 0 ? 0 : (int)sst_clamp_double((double)wait_ns / 1e6 + 1, 1, 1000)) < 0 &&
        errno != EINTR)
        return -errno;
    process_edges(c);
    return c->source.ops->poll(c->source.object);
}

/* Restart the train when a failed chip is back. @return its error if it does not return */
static int renew_trigger(struct sst_capture *c, int64_t now_ns)
{
    const uint64_t left = c->wanted ? c->wanted - c->report.edges : 0;
    const int err = sst_trigger_start(c->trigger, c->array->trigger_hz, left);

    if (!err) {
        c->idle_ns = 0;
        return 0;
    }
    if (!c->idle_ns)
        c->idle_ns = now_ns;
    return now_ns - c->idle_ns < CHIP_WAIT_NS ? 0 : err;
}

/* All requested pulses have been fired. */
static bool all_fired(struct sst_capture *c)
{
    if (!c->trigger || !sst_trigger_idle(c->trigger))
        return false;
    process_edges(c);
    return c->wanted && c->report.edges >= c->wanted;
}

/* All triggered frames are in sets that were passed on. */
static bool all_in(const struct sst_capture *c)
{
    struct sst_framesync_counters n;

    sst_framesync_counters(c->sets, &n);
    return n.sets + n.dropped >= c->report.edges;
}

static void end_writer(struct sst_capture *c)
{
    if (!c->writer_runs)
        return;
    pthread_mutex_lock(&c->lock);
    c->writer_ends = true;
    pthread_cond_signal(&c->changed);
    pthread_mutex_unlock(&c->lock);
    pthread_join(c->writer, NULL);
    c->writer_runs = false;
}

/* Stop exposing. @return until when to wait for frames that were exposed */
static int64_t begin_end(struct sst_capture *c, int64_t now_ns)
{
    const int64_t wait_ns = (int64_t)c->array->wait_ms * 1000000 + LAST_WAIT_NS;

    if (!c->trigger)
        return now_ns;
    if (sst_trigger_stop(c->trigger)) {
        /* logged by the trigger; its train was about to be restarted */
    }
    process_edges(c);
    return now_ns + (c->stop && wait_ns > STOP_WAIT_NS ? STOP_WAIT_NS : wait_ns);
}

int sst_capture_run(struct sst_capture *c, uint64_t sets)
{
    int64_t reported_ns = sst_clock_now_ns(), end_ns = INT64_MAX;
    int err = start_cameras(c), trigger_err = 0;

    if (err)
        return err;
    c->wanted = sets;
    if (c->trigger)
        err = sst_trigger_start(c->trigger, c->array->trigger_hz, sets);
    while (!err) {
        const int64_t now_ns = sst_clock_now_ns(), next_ns = reported_ns + 1000000000;

        if (end_ns == INT64_MAX) {
            if (c->stop || trigger_err || all_fired(c) || (sets && c->report.handed == sets))
                end_ns = begin_end(c, now_ns);
            else if (c->trigger && sst_trigger_idle(c->trigger))
                trigger_err = renew_trigger(c, now_ns);
        }
        if (end_ns != INT64_MAX && (now_ns >= end_ns || (c->trigger && all_in(c))))
            break;
        err = serve(c, next_ns < end_ns ? next_ns : end_ns);
        if (sst_clock_now_ns() >= next_ns) {
            reported_ns = sst_clock_now_ns();
            health_log(&c->health, c->array->bound, c->name);
            if (c->events.progress)
                c->events.progress(c->events.arg, c->report.handed);
        }
    }
    sst_framesync_flush(c->sets);
    end_writer(c);
    health_log(&c->health, c->array->bound, c->name);
    if (c->events.progress)
        c->events.progress(c->events.arg, c->report.handed);
    return err ? err : trigger_err;
}

void sst_capture_stop(struct sst_capture *c)
{
    c->stop = true;
    wake(c);
}

/* --- report ------------------------------------------------------------------------------------------------------- */

void sst_capture_report(const struct sst_capture *capture, struct sst_capture_report *out)
{
    struct sst_capture *c = (struct sst_capture *)capture;
    uint64_t known;

    *out = c->report;
    sst_framesync_counters(c->sets, &out->sets);
    out->grab = (struct sst_grab_counters){ 0 };
    for (int cam = 0; cam < c->array->bound; cam++) {
        struct sst_grab_counters n;

        c->source.ops->counters(c->source.object, cam, &n);
        out->grab.frames += n.frames;
        out->grab.bad += n.bad;
        out->grab.lost += n.lost;
        out->grab.io_errors += n.io_errors;
        for (size_t i = 0; i < ARRAY_LEN(n.fault); i++)
            out->grab.fault[i] += n.fault[i];
        out->grab.packets_missing += n.packets_missing;
        out->grab.packets_resent += n.packets_resent;
        out->grab.lost_devices += n.lost_devices;
        out->grab.found_devices += n.found_devices;
        for (int i = 0; i < SST_GRAB_RUNGS; i++)
            out->grab.rung[i] += n.rung[i];
    }
    known = out->sets.waiting;
    for (int i = 0; i < SST_BUCKETS; i++)
        known += out->sets.bucket[i];
    out->trigger_away = c->idle_ns != 0;
    out->unexplained = known > out->grab.frames ? known - out->grab.frames : out->grab.frames - known;
    out->ticks_skipped = c->trigger ? sst_trigger_skipped(c->trigger) : 0;
    pthread_mutex_lock(&c->lock);
    out->refused = c->refused;
    out->withheld = c->withheld;
    out->complete -= c->spoilt < out->complete ? c->spoilt : out->complete;
    pthread_mutex_unlock(&c->lock);
    out->masked = 0;
    for (int cam = 0; cam < c->array->bound; cam++)
        out->masked += sst_masks_share(c->masks, cam) > 0;
}

double sst_capture_masked(const struct sst_capture *c, int cam)
{
    return sst_masks_share(c->masks, cam);
}

void sst_capture_camera(const struct sst_capture *c, int cam, struct sst_grab_counters *grab,
                        const struct sst_grab_device **device)
{
    c->source.ops->counters(c->source.object, cam, grab);
    *device = c->source.ops->device(c->source.object, cam);
}

bool sst_capture_ptp(const struct sst_capture *c, int cam, struct sst_genicam_ptp *out)
{
    return c->cameras && cameras_ptp(c->cameras, cam, out);
}

void sst_capture_close(struct sst_capture *c)
{
    if (!c)
        return;
    sst_trigger_close(c->trigger);
    if (c->sets)
        sst_framesync_flush(c->sets);
    end_writer(c);
    cameras_close(c->cameras);
    sst_framesync_destroy(c->sets);
    sst_masks_destroy(c->masks);
    free(c->masked);
    if (c->wake_fd >= 0)
        close(c->wake_fd);
    pthread_cond_destroy(&c->changed);
    pthread_mutex_destroy(&c->lock);
    free(c);
}
