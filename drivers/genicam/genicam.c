/* All cameras of the array: their frames and states on the caller's thread. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/genicam/genicam.h"

#include <arpa/inet.h>
#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/genicam/genicam_internal.h"

#define OPEN_WAIT_NS INT64_C(8000000000)
#define OPEN_STEP_NS 20000000

void sst_genicam_config_defaults(struct sst_genicam_config *cfg)
{
    *cfg = (struct sst_genicam_config){
        .fourcc = V4L2_PIX_FMT_GREY,
        .width = 640,
        .height = 480,
        .rate_hz = 10,
        .buffers = 8,
        .stall_ms = 1000,
        .line = "Line0",
        .gain = NAN,
        .resend = true,
        .action = { .device_key = 1, .group_key = 1, .group_mask = 1, .address = "255.255.255.255" },
    };
}

static int check_config(const struct sst_genicam_config *cfg)
{
    const struct genicam_pixels *p = *cfg->pixel_format ? genicam_pixels_named(cfg->pixel_format) : NULL;
    struct in_addr to;

    if (!sst_genicam_has_format(cfg->fourcc)) {
        sst_log_error("GenICam cameras do not deliver this format: set cameras: format to GREY, Y16, RGB24, RGGB8, "
                      "GRBG8, GBRG8 or BGGR8");
        return -EINVAL;
    }
    if (*cfg->pixel_format && (!p || p->fourcc != cfg->fourcc)) {
        sst_log_error("genicam: pixel_format %s %s; leave it empty to choose by cameras: format", cfg->pixel_format,
                      p ? "gives another cameras: format" : "is none of Mono8, Mono10, Mono10p, Mono10Packed, Mono12, "
                                                            "Mono12p, Mono12Packed, Mono14, Mono16, BayerRG8, BayerGR8, "
                                                            "BayerGB8, BayerBG8, RGB8");
        return -EINVAL;
    }
    if (cfg->trigger == SST_GENICAM_ACTION && inet_pton(AF_INET, cfg->action.address, &to) != 1) {
        sst_log_error("genicam: action_address %s is no IPv4 address; give the broadcast address of the cameras' "
                      "network",
                      cfg->action.address);
        return -EINVAL;
    }
    return 0;
}

static int watch(struct sst_genicam *g, int fd)
{
    struct epoll_event e = { .events = EPOLLIN, .data = { .fd = fd } };

    return epoll_ctl(g->fd, EPOLL_CTL_ADD, fd, &e) ? -errno : 0;
}

static int open_descriptors(struct sst_genicam *g)
{
    int err;

    g->fd = epoll_create1(EPOLL_CLOEXEC);
    g->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    err = g->fd < 0 || g->wake_fd < 0 ? -errno : watch(g, g->wake_fd);
    if (err)
        sst_log_error("cannot poll the GenICam cameras: %s; raise the limit of open files (ulimit -n)",
                      strerror(-err));
    if (err || g->cfg.trigger != SST_GENICAM_ACTION)
        return err;
    g->action_fd = genicam_action_open();
    return g->action_fd < 0 ? g->action_fd : watch(g, g->action_fd);
}

static int check_part(void)
{
    struct sst_genicam_device *devices = NULL;
    int count, err = genicam_lib_list(&devices, &count);

    free(devices);
    if (err == -ENOTSUP)
        sst_log_error("GenICam cameras need libsst-aravis.so: install Debian's package sst-genicam, or libaravis-dev and "
                      "build again; else remove the cameras of kind genicam from cameras: bind");
    return err;
}

static void wait_for_all(struct sst_genicam *g)
{
    const int64_t end_ns = sst_clock_now_ns() + OPEN_WAIT_NS;
    bool tried = false;

    while (!tried && sst_clock_now_ns() < end_ns) {
        tried = true;
        for (int i = 0; i < g->cfg.cameras; i++) {
            pthread_mutex_lock(&g->camera[i].lock);
            tried = tried && g->camera[i].tried;
            pthread_mutex_unlock(&g->camera[i].lock);
        }
        if (!tried)
            sst_clock_sleep_until(sst_clock_now_ns() + OPEN_STEP_NS);
    }
    sst_genicam_poll(g);
}

int sst_genicam_open(struct sst_genicam **out, const struct sst_genicam_config *cfg,
                     const struct sst_grab_events *events)
{
    struct sst_genicam *g;
    int err = check_config(cfg);

    err = err ? err : check_part();
    if (err)
        return err;
    g = calloc(1, sizeof(*g));
    if (!g)
        return -ENOMEM;
    g->cfg = *cfg;
    g->cfg.bindings = NULL;
    g->events = *events;
    g->fd = g->wake_fd = g->action_fd = -1;
    pthread_mutex_init(&g->lock, NULL);
    g->camera = calloc((size_t)cfg->cameras, sizeof(*g->camera));
    err = g->camera ? open_descriptors(g) : -ENOMEM;
    for (int i = 0; !err && i < cfg->cameras; i++)
        err = genicam_camera_create(&g->camera[i], g, i, &cfg->bindings[i]);
    if (err) {
        sst_genicam_close(g);
        return err;
    }
    wait_for_all(g);
    *out = g;
    return 0;
}

void sst_genicam_start(struct sst_genicam *g)
{
    for (int i = 0; i < g->cfg.cameras; i++) {
        struct genicam_camera *cam = &g->camera[i];

        pthread_mutex_lock(&cam->lock);
        cam->start = true;
        pthread_cond_signal(&cam->wake);
        pthread_mutex_unlock(&cam->lock);
    }
}

/* Counted here, so that each counted frame has been passed on. */
static void count_locked(struct genicam_camera *cam, const struct sst_frame *f)
{
    struct sst_grab_counters *c = &cam->counters;

    c->frames++;
    c->bad += (f->faults & SST_FRAME_BAD) != 0;
    c->lost += f->lost_before;
    for (size_t i = 0; i < ARRAY_LEN(c->fault); i++)
        c->fault[i] += f->faults >> i & 1;
}

static void poll_camera(struct sst_genicam *g, struct genicam_camera *cam)
{
    char why[GENICAM_WHY_MAX];
    struct genicam_slot *slot;
    enum sst_grab_state state;
    bool changed;

    pthread_mutex_lock(&cam->lock);
    slot = cam->first;
    cam->first = cam->last = NULL;
    changed = cam->changed;
    cam->changed = false;
    state = cam->state;
    memcpy(why, cam->why, sizeof(why));
    if (changed)
        cam->shown = cam->device;
    pthread_mutex_unlock(&cam->lock);
    if (changed) {
        cam->seen = state;
        if (g->events.state)
            g->events.state(g->events.arg, cam->index, state, state == SST_GRAB_STREAMING ? "" : why);
    }
    while (slot) {
        struct genicam_slot *next = slot->next;

        pthread_mutex_lock(&cam->lock);
        count_locked(cam, &slot->frame);
        pthread_mutex_unlock(&cam->lock);
        g->events.frame(g->events.arg, &slot->frame);
        slot = next;
    }
}

void sst_genicam_poll(struct sst_genicam *g)
{
    eventfd_t n;

    (void)eventfd_read(g->wake_fd, &n);
    if (g->action_fd >= 0)
        genicam_action_receive(g);
    for (int i = 0; i < g->cfg.cameras; i++)
        poll_camera(g, &g->camera[i]);
}

int sst_genicam_fd(const struct sst_genicam *g)
{
    return g->fd;
}

void sst_genicam_fire(struct sst_genicam *g, int64_t t_ns)
{
    if (g->cfg.trigger == SST_GENICAM_ACTION)
        genicam_action_send(g, t_ns);
    for (int i = 0; i < g->cfg.cameras; i++)
        genicam_camera_fire(&g->camera[i], t_ns, g->cfg.trigger == SST_GENICAM_SOFTWARE);
}

void sst_genicam_release(struct sst_genicam *g SST_UNUSED, struct sst_frame *frame)
{
    genicam_lib_release(frame->pool);
}

enum sst_grab_state sst_genicam_camera_state(const struct sst_genicam *g, int cam)
{
    return g->camera[cam].seen;
}

const struct sst_grab_device *sst_genicam_camera_device(const struct sst_genicam *g, int cam)
{
    return &g->camera[cam].shown;
}

void sst_genicam_counters(const struct sst_genicam *g, int cam, struct sst_grab_counters *out)
{
    struct genicam_camera *c = &g->camera[cam];

    pthread_mutex_lock(&c->lock);
    *out = c->counters;
    pthread_mutex_unlock(&c->lock);
}

void sst_genicam_ptp(const struct sst_genicam *g, int cam, struct sst_genicam_ptp *out)
{
    struct genicam_camera *c = &g->camera[cam];

    pthread_mutex_lock(&c->lock);
    *out = c->ptp;
    pthread_mutex_unlock(&c->lock);
}

void sst_genicam_actions(const struct sst_genicam *g, struct sst_genicam_action_counters *out)
{
    struct sst_genicam *all = (struct sst_genicam *)g;

    pthread_mutex_lock(&all->lock);
    *out = g->actions;
    pthread_mutex_unlock(&all->lock);
}

void sst_genicam_close(struct sst_genicam *g)
{
    if (!g)
        return;
    for (int i = 0; g->camera && i < g->cfg.cameras; i++) /* all at once: each takes a time-out if it is silent */
        if (g->camera[i].threaded) {
            pthread_mutex_lock(&g->camera[i].lock);
            g->camera[i].quit = true;
            pthread_cond_signal(&g->camera[i].wake);
            pthread_mutex_unlock(&g->camera[i].lock);
        }
    for (int i = 0; g->camera && i < g->cfg.cameras; i++)
        genicam_camera_destroy(&g->camera[i]);
    if (g->action_fd >= 0)
        close(g->action_fd);
    if (g->wake_fd >= 0)
        close(g->wake_fd);
    if (g->fd >= 0)
        close(g->fd);
    pthread_mutex_destroy(&g->lock);
    free(g->camera);
    free(g);
}
