/* The cameras of this host as a source: V4L2 ones by drivers/grab, GenICam ones by drivers/genicam, with the indices of
 * the array. They report by events of their own: their frames have no index. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

#include "base/log.h"
#include "capture/array/array_internal.h"
#include "capture/array/capture.h"

/* Cameras of one kind, and their places in the array. */
struct part {
    struct cameras *all;
    int count;
    int place[SST_CAMERAS_MAX];
};

struct cameras {
    struct sst_grab_events events;
    struct sst_grab *grab;       /* NULL: no V4L2 camera */
    struct sst_genicam *genicam; /* NULL: no GenICam camera */
    struct part v4l2, other;
    int fd; /* epoll of both */
    enum sst_config_kind kind[SST_CAMERAS_MAX];
    int index[SST_CAMERAS_MAX]; /* of a camera of the array among the cameras of its kind */
};

/* --- events ------------------------------------------------------------------------------------------------------- */

static void on_frame(void *arg, struct sst_frame *frame)
{
    const struct part *p = arg;

    frame->cam = p->place[frame->cam];
    p->all->events.frame(p->all->events.arg, frame);
}

static void on_state(void *arg, int cam, enum sst_grab_state state, const char *why)
{
    const struct part *p = arg;

    p->all->events.state(p->all->events.arg, p->place[cam], state, why);
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static int open_grab(struct cameras *c, const struct sst_array_config *a)
{
    const struct sst_grab_events events = { &c->v4l2, on_frame, on_state };
    struct sst_grab_binding *bindings = calloc((size_t)c->v4l2.count, sizeof(*bindings));
    struct sst_grab_config cfg;
    int err;

    if (!bindings)
        return -ENOMEM;
    sst_capture_grab_config(&cfg, a);
    for (int i = 0; i < c->v4l2.count; i++) {
        const struct sst_config_camera *cam = &a->camera[c->v4l2.place[i]];

        memcpy(bindings[i].serial, cam->serial, sizeof(bindings[i].serial));
        memcpy(bindings[i].port, cam->port, sizeof(bindings[i].port));
        bindings[i].node = cam->node;
        snprintf(bindings[i].title, sizeof(bindings->title), "camera row %d, col %d", cam->row, cam->col);
    }
    cfg.cameras = c->v4l2.count;
    cfg.bindings = bindings;
    err = sst_grab_open(&c->grab, &cfg, &events);
    free(bindings);
    return err;
}

static enum sst_genicam_trigger trigger_of(const struct sst_array_config *a)
{
    if (!sst_array_triggered(a))
        return SST_GENICAM_FREE;
    switch (a->genicam.trigger) {
    case SST_CONFIG_WIRE:
        return SST_GENICAM_WIRE;
    case SST_CONFIG_COMMAND:
        return SST_GENICAM_SOFTWARE;
    case SST_CONFIG_ACTION:
        return SST_GENICAM_ACTION;
    default:
        return SST_GENICAM_FREE;
    }
}

void sst_capture_genicam_config(struct sst_genicam_config *cfg, const struct sst_array_config *a)
{
    sst_genicam_config_defaults(cfg);
    cfg->fourcc = a->fourcc;
    cfg->width = a->width;
    cfg->height = a->height;
    cfg->buffers = a->buffers;
    cfg->stall_ms = a->stall_ms;
    cfg->check_frozen = a->check_frozen;
    cfg->trigger = trigger_of(a);
    cfg->rate_hz = cfg->trigger == SST_GENICAM_FREE ? a->rate_hz : a->trigger_hz;
    memcpy(cfg->line, a->genicam.line, sizeof(cfg->line));
    memcpy(cfg->pixel_format, a->genicam.pixel_format, sizeof(cfg->pixel_format));
    cfg->exposure_us = a->genicam.exposure_us;
    cfg->gain = a->genicam.gain;
    cfg->packet_bytes = a->genicam.packet_bytes;
    cfg->packet_delay_ns = a->genicam.packet_delay_ns;
    cfg->resend = a->genicam.resend;
    cfg->ptp = a->genicam.ptp;
    cfg->action.device_key = (uint32_t)a->genicam.device_key;
    cfg->action.group_key = (uint32_t)a->genicam.group_key;
    cfg->action.group_mask = (uint32_t)a->genicam.group_mask;
    cfg->action.delay_us = a->genicam.action_delay_us;
    memcpy(cfg->action.address, a->genicam.action_address, sizeof(cfg->action.address));
}

static int open_genicam(struct cameras *c, const struct sst_array_config *a)
{
    const struct sst_grab_events events = { &c->other, on_frame, on_state };
    struct sst_genicam_binding *bindings = calloc((size_t)c->other.count, sizeof(*bindings));
    struct sst_genicam_config cfg;
    int err;

    if (!bindings)
        return -ENOMEM;
    sst_capture_genicam_config(&cfg, a);
    for (int i = 0; i < c->other.count; i++) {
        const struct sst_config_camera *cam = &a->camera[c->other.place[i]];

        memcpy(bindings[i].id, cam->serial, sizeof(bindings[i].id));
        memcpy(bindings[i].address, cam->port, sizeof(bindings[i].address));
    }
    cfg.cameras = c->other.count;
    cfg.bindings = bindings;
    err = sst_genicam_open(&c->genicam, &cfg, &events);
    free(bindings);
    return err;
}

static int watch(struct cameras *c, int fd)
{
    struct epoll_event e = { .events = EPOLLIN };

    return epoll_ctl(c->fd, EPOLL_CTL_ADD, fd, &e) ? -errno : 0;
}

int cameras_open(struct cameras **out, const struct sst_array_config *a, const struct sst_grab_events *events)
{
    struct cameras *c = calloc(1, sizeof(*c));
    int err;

    if (!c)
        return -ENOMEM;
    c->events = *events;
    c->v4l2.all = c->other.all = c;
    for (int i = 0; i < a->bound; i++) {
        struct part *p = a->camera[i].kind == SST_CONFIG_GENICAM ? &c->other : &c->v4l2;

        c->kind[i] = a->camera[i].kind;
        c->index[i] = p->count;
        p->place[p->count++] = i;
    }
    c->fd = epoll_create1(EPOLL_CLOEXEC);
    err = c->fd < 0 ? -errno : 0;
    err = err || !c->v4l2.count ? err : open_grab(c, a);
    err = err || !c->other.count ? err : open_genicam(c, a);
    err = err || !c->grab ? err : watch(c, sst_grab_fd(c->grab));
    err = err || !c->genicam ? err : watch(c, sst_genicam_fd(c->genicam));
    if (err)
        cameras_close(c);
    else
        *out = c;
    return err;
}

int cameras_start(struct cameras *c)
{
    const int err = c->grab ? sst_grab_start(c->grab) : 0;

    if (c->genicam)
        sst_genicam_start(c->genicam);
    return err < 0 ? err : 0;
}

void cameras_fire(struct cameras *c, int64_t t_ns)
{
    if (c->genicam)
        sst_genicam_fire(c->genicam, t_ns);
}

void cameras_expect(struct cameras *c, int64_t t_ns)
{
    if (c->grab)
        sst_grab_expect(c->grab, t_ns);
}

void cameras_close(struct cameras *c)
{
    if (!c)
        return;
    sst_grab_close(c->grab);
    sst_genicam_close(c->genicam);
    if (c->fd >= 0)
        close(c->fd);
    free(c);
}

/* --- the source --------------------------------------------------------------------------------------------------- */

static int source_fd(const void *object)
{
    return ((const struct cameras *)object)->fd;
}

static int source_poll(void *object)
{
    struct cameras *c = object;

    if (c->genicam)
        sst_genicam_poll(c->genicam);
    return c->grab ? sst_grab_poll(c->grab, 0) : 0;
}

static void source_release(void *object, struct sst_frame *frame)
{
    struct cameras *c = object;

    if (c->kind[frame->cam] == SST_CONFIG_GENICAM)
        sst_genicam_release(c->genicam, frame);
    else
        sst_grab_release(c->grab, frame);
}

static enum sst_grab_state source_state(const void *object, int cam)
{
    const struct cameras *c = object;

    return c->kind[cam] == SST_CONFIG_GENICAM ? sst_genicam_camera_state(c->genicam, c->index[cam])
                                              : sst_grab_camera_state(c->grab, c->index[cam]);
}

static const struct sst_grab_device *source_device(const void *object, int cam)
{
    const struct cameras *c = object;

    return c->kind[cam] == SST_CONFIG_GENICAM ? sst_genicam_camera_device(c->genicam, c->index[cam])
                                              : sst_grab_camera_device(c->grab, c->index[cam]);
}

static void source_counters(const void *object, int cam, struct sst_grab_counters *out)
{
    const struct cameras *c = object;

    if (c->kind[cam] == SST_CONFIG_GENICAM)
        sst_genicam_counters(c->genicam, c->index[cam], out);
    else
        sst_grab_counters(c->grab, c->index[cam], out);
}

const struct sst_source_ops cameras_source_ops = {
    .fd = source_fd,
    .poll = source_poll,
    .release = source_release,
    .state = source_state,
    .device = source_device,
    .counters = source_counters,
};

bool cameras_ptp(const struct cameras *c, int cam, struct sst_genicam_ptp *out)
{
    if (c->kind[cam] != SST_CONFIG_GENICAM)
        return false;
    sst_genicam_ptp(c->genicam, c->index[cam], out);
    return true;
}
