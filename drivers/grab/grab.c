/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/grab/grab_internal.h"
#include "drivers/grab/parts_internal.h"

/* Cameras that have not responded by then are started when they do. */
#define OPEN_WAIT_NS  (8000 * SST_MS)
#define CLOSE_WAIT_NS (1500 * SST_MS)
/* Additional time from STREAMON to the first frame, on top of the usual patience. */
#define WAKE_UP_NS (1500 * SST_MS)
#define LATE_NS    (20 * SST_MS) /* a wake-up this late means that the process was stopped */
#define EVENTS_MAX 128

/* epoll data besides the indices of cameras. */
enum {
    TAG_TIMER = SST_CAMERAS_MAX,
    TAG_WAKE,
    TAG_JOBS,
    TAG_PLUG,
};

void sst_grab_config_defaults(struct sst_grab_config *cfg)
{
    *cfg = (struct sst_grab_config){
        .fourcc = V4L2_PIX_FMT_MJPEG,
        .width = 640,
        .height = 480,
        .buffers = 4,
        .stall_ms = 1000,
    };
}

/* --- open --------------------------------------------------------------------------------------------------------- */

/* @return name of the bad setting of a split, or NULL */
static const char *split_fault(const struct sst_grab_config *cfg)
{
    const int rows = sst_max_int(cfg->split.rows, 1), cols = sst_max_int(cfg->split.cols, 1);

    if (rows > SST_GRAB_PARTS_MAX || cols > SST_GRAB_PARTS_MAX || rows * cols > SST_GRAB_PARTS_MAX)
        return "split";
    if (rows * cols > 1 && !raw_pixel_bytes(cfg->fourcc) && (cfg->fourcc != V4L2_PIX_FMT_MJPEG || !cfg->cutter))
        return "format of split pictures";
    return cols * cfg->width > 65535 || rows * cfg->height > 65535 ? "size of split pictures" : NULL;
}

static int check_config(const struct sst_grab_config *cfg)
{
    const char *bad = cfg->cameras < 1 || cfg->cameras > SST_CAMERAS_MAX           ? "cameras"
                      : cfg->width < 1 || cfg->height < 1                          ? "size"
                      : cfg->width > 65535 || cfg->height > 65535                  ? "size"
                      : cfg->buffers < 2 || cfg->buffers > SST_STREAM_BUFFERS_MAX  ? "buffers"
                      : cfg->controls < 0 || cfg->controls > SST_GRAB_CONTROLS_MAX ? "controls"
                      : !(cfg->rate_hz >= 0 && cfg->rate_hz <= 100000)             ? "rate"
                      : cfg->stall_ms < 0 || cfg->stall_ms > 3600000               ? "stall time"
                                                                                   : split_fault(cfg);

    if (bad) {
        sst_log_error("cannot start the cameras: the %s is out of range; see the configuration", bad);
        return -EINVAL;
    }
    for (int i = 0; i < cfg->cameras; i++) {
        const struct sst_grab_binding *a = &cfg->bindings[i];

        if (!*a->serial && !*a->port) {
            sst_log_error("camera %d has no binding; set its serial or port, as listed by `sst cameras`", i);
            return -EINVAL;
        }
        for (int k = 0; k < i; k++) {
            const struct sst_grab_binding *b = &cfg->bindings[k];

            if (*a->serial ? strcmp(a->serial, b->serial) != 0 : *b->serial || strcmp(a->port, b->port) != 0)
                continue;
            if (a->node && b->node && a->node != b->node)
                continue;
            sst_log_error("cameras %d and %d are both bound to %s %s; each device is one camera, or each of its video "
                          "nodes by cameras: bind: node", k, i,
                          *a->serial ? "serial" : "port", *a->serial ? a->serial : a->port);
            return -EINVAL;
        }
    }
    return 0;
}

static int watch_fd(struct sst_grab *g, int fd, int tag)
{
    struct epoll_event e = { .events = EPOLLIN, .data = { .u64 = (uint64_t)tag } };

    return epoll_ctl(g->epoll_fd, EPOLL_CTL_ADD, fd, &e) ? -errno : 0;
}

static int open_descriptors(struct sst_grab *g)
{
    int err;

    g->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    g->timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    g->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (g->epoll_fd < 0 || g->timer_fd < 0 || g->wake_fd < 0)
        err = -errno;
    else
        err = jobs_create(&g->jobs);
    err = err ? err : watch_fd(g, g->timer_fd, TAG_TIMER);
    err = err ? err : watch_fd(g, g->wake_fd, TAG_WAKE);
    err = err ? err : watch_fd(g, jobs_fd(g->jobs), TAG_JOBS);
    if (err)
        sst_log_error("cannot poll the cameras: %s; raise the limit of open files (ulimit -n)", strerror(-err));
    return err;
}

static struct sst_grab *create(const struct sst_grab_config *cfg, const struct sst_grab_events *events)
{
    struct sst_grab *g = calloc(1, sizeof(*g));

    if (!g)
        return NULL;
    g->epoll_fd = g->timer_fd = g->wake_fd = -1;
    g->cfg = *cfg;
    g->cfg.bindings = NULL;
    g->cfg.stall_ms = cfg->stall_ms ? cfg->stall_ms : 1000;
    g->cfg.split = (struct sst_grab_split){ sst_max_int(cfg->split.rows, 1), sst_max_int(cfg->split.cols, 1) };
    g->cfg.width = cfg->width * g->cfg.split.cols;
    g->cfg.height = cfg->height * g->cfg.split.rows;
    g->part_width = cfg->width;
    g->part_height = cfg->height;
    g->parts = g->cfg.split.rows * g->cfg.split.cols;
    g->cameras = cfg->cameras;
    g->events = *events;
    g->nodes = calloc(SST_GRAB_NODES_MAX, sizeof(*g->nodes));
    g->camera = calloc((size_t)cfg->cameras, sizeof(*g->camera));
    g->place = calloc((size_t)cfg->cameras, sizeof(*g->place));
    return g;
}

static bool any_job(const struct sst_grab *g)
{
    for (int i = 0; i < g->cfg.cameras; i++) {
        if (g->camera[i].job)
            return true;
    }
    return false;
}

static void wait_for_jobs(struct sst_grab *g)
{
    const int64_t end_ns = sst_clock_now_ns() + OPEN_WAIT_NS;

    while (any_job(g) && sst_clock_now_ns() < end_ns && !sst_grab_poll(g, 100))
        ;
}

static void report_absent(struct sst_grab *g)
{
    for (int i = 0; i < g->cfg.cameras; i++) {
        if (g->camera[i].number < 0 && !*g->camera[i].why)
            camera_set_state(g, &g->camera[i], SST_GRAB_ABSENT, "is not connected; it starts when it is plugged in");
    }
}

int sst_grab_open(struct sst_grab **out, const struct sst_grab_config *cfg, const struct sst_grab_events *events)
{
    struct sst_grab *g;
    int err = check_config(cfg);

    if (err)
        return err;
    g = create(cfg, events);
    if (!g || !g->nodes || !g->camera || !g->place) {
        sst_log_error("no memory for %d cameras", cfg->cameras);
        err = -ENOMEM;
        goto fail;
    }
    err = parts_assign(g, cfg);
    for (int i = 0; i < g->cfg.cameras; i++)
        ladder_init(&g->camera[i].ladder, g->cfg.stall_ms * SST_MS + WAKE_UP_NS, false, cfg->port_power);
    err = err ? err : open_descriptors(g);
    err = err ? err : grab_monitor_open(&g->watch);
    if (!err && g->watch)
        err = watch_fd(g, grab_monitor_fd(g->watch), TAG_PLUG);
    err = err ? err : hotplug_scan(g);
    err = err ? err : hotplug_assign(g);
    if (err)
        goto fail;
    wait_for_jobs(g);
    report_absent(g);
    *out = g;
    return 0;

fail:
    sst_grab_close(g);
    return err;
}

int sst_grab_start(struct sst_grab *g)
{
    int streaming = 0;

    g->started = true;
    for (int i = 0; i < g->cfg.cameras; i++)
        recovery_start(g, &g->camera[i]);
    wait_for_jobs(g);
    for (int i = 0; i < g->cameras; i++)
        streaming += sst_grab_camera_state(g, i) == SST_GRAB_STREAMING;
    return streaming;
}

/* --- poll --------------------------------------------------------------------------------------------------------- */

/* Apply the time of a trigger to cameras without a frame since. */
static void apply_trigger(struct sst_grab *g)
{
    const int64_t fired_ns = atomic_exchange(&g->fired_ns, 0);

    for (int i = 0; fired_ns && i < g->cfg.cameras; i++) {
        struct grab_camera *cam = &g->camera[i];

        if (cam->running && !cam->owed_ns && cam->heard_ns < fired_ns)
            cam->owed_ns = fired_ns;
    }
}

static void serve_one(struct sst_grab *g, const struct epoll_event *e)
{
    const int tag = (int)e->data.u64;
    uint64_t count;

    if (tag == TAG_JOBS) {
        jobs_collect(g->jobs, g);
    } else if (tag == TAG_PLUG) {
        hotplug_events(g);
    } else if (tag == TAG_TIMER || tag == TAG_WAKE) {
        (void)!read(tag == TAG_TIMER ? g->timer_fd : g->wake_fd, &count, sizeof(count));
    } else if (g->camera[tag].armed) {
        /* Otherwise an earlier event of this round has closed it. */
        receive_ready(g, &g->camera[tag], !(e->events & EPOLLIN));
    }
}

/* If a due time is handled late, this process was stopped, perhaps with the whole machine: then no camera is judged
 * before it had time to send a frame. Only once in a row: repeated delays do not postpone the judgement forever. */
static bool postpones(struct sst_grab *g, int64_t now_ns)
{
    if (now_ns < g->judge_ns)
        return true;
    if (!g->timer_ns || g->timer_ns == g->judge_ns || now_ns - g->timer_ns < LATE_NS)
        return false;
    g->judge_ns = now_ns + g->cfg.stall_ms * SST_MS / 2;
    return true;
}

static void serve_time(struct sst_grab *g)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (postpones(g, now_ns))
        return;
    for (int i = 0; i < g->cfg.cameras; i++) {
        struct grab_camera *cam = &g->camera[i];
        const int64_t silent_ns = receive_due(g, cam);

        if (silent_ns && now_ns >= silent_ns)
            receive_silence(g, cam, now_ns);
        recovery_time(g, cam, now_ns);
    }
    hotplug_time(g, now_ns);
}

static void set_timer(struct sst_grab *g, int64_t now_ns)
{
    struct itimerspec t = { 0 };
    int64_t due_ns = hotplug_due(g);

    for (int i = 0; i < g->cfg.cameras; i++) {
        const int64_t due[2] = { recovery_due(g, &g->camera[i]), receive_due(g, &g->camera[i]) };

        for (int k = 0; k < 2; k++) {
            if (due[k] && (!due_ns || due[k] < due_ns))
                due_ns = due[k];
        }
    }
    if (due_ns && due_ns < g->judge_ns)
        due_ns = g->judge_ns;
    /* Most frames postpone it: an extra wake-up is cheaper than setting the timer for each frame. */
    if (!due_ns)
        g->timer_ns = 0;
    if (!due_ns || (g->timer_ns > now_ns && g->timer_ns <= due_ns))
        return;
    g->timer_ns = due_ns;
    t.it_value.tv_sec = due_ns / 1000000000;
    t.it_value.tv_nsec = due_ns % 1000000000;
    (void)timerfd_settime(g->timer_fd, TFD_TIMER_ABSTIME, &t, NULL);
}

int sst_grab_poll(struct sst_grab *g, int timeout_ms)
{
    struct epoll_event events[EVENTS_MAX];
    const int n = epoll_wait(g->epoll_fd, events, EVENTS_MAX, timeout_ms);
    const int err = n < 0 && errno != EINTR ? -errno : 0; /* a resume after suspend interrupts it, without a signal */

    apply_trigger(g);
    for (int i = 0; i < n; i++)
        serve_one(g, &events[i]);
    serve_time(g);
    set_timer(g, sst_clock_now_ns());
    return err;
}

int sst_grab_fd(const struct sst_grab *g)
{
    return g->epoll_fd;
}

void sst_grab_expect(struct sst_grab *g, int64_t t_ns)
{
    const uint64_t one = 1;

    atomic_store(&g->fired_ns, t_ns);
    (void)!write(g->wake_fd, &one, sizeof(one));
}

void sst_grab_release(struct sst_grab *g SST_UNUSED, struct sst_frame *frame)
{
    stream_release(frame);
}

/* --- close -------------------------------------------------------------------------------------------------------- */

static void close_fd(int fd)
{
    if (fd >= 0)
        close(fd);
}

void sst_grab_close(struct sst_grab *g)
{
    const int64_t end_ns = sst_clock_now_ns() + CLOSE_WAIT_NS;

    if (!g)
        return;
    g->closing = true;
    for (int i = 0; g->jobs && g->camera && i < g->cfg.cameras; i++) {
        g->camera[i].job = NULL;
        recovery_drop(g, &g->camera[i]);
    }
    while (g->jobs && jobs_running(g->jobs) && sst_clock_now_ns() < end_ns) {
        jobs_wait(g->jobs, 50);
        jobs_collect(g->jobs, g);
    }
    if (g->jobs && jobs_running(g->jobs))
        sst_log_warning("%d cameras hang in the kernel while they are closed; they are abandoned",
                        jobs_running(g->jobs));
    jobs_destroy(g->jobs);
    grab_monitor_close(g->watch);
    close_fd(g->epoll_fd);
    close_fd(g->timer_fd);
    close_fd(g->wake_fd);
    for (int i = 0; g->camera && g->cfg.cutter && i < g->cfg.cameras; i++)
        g->cfg.cutter->destroy(g->camera[i].cutter);
    free(g->nodes);
    free(g->camera);
    free(g->place);
    free(g);
}
