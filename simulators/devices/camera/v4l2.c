/* A camera's device file: open, close, dispatch of ioctls. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "simulators/devices/camera/camera_internal.h"

#define KERNEL_VERSION_SHOWN (6u << 16 | 1u << 8)

static int cam_open(struct sim_handle *h, struct sim_request *r)
{
    struct sim_cam *cam = h->device;
    struct sim_open *o = calloc(1, sizeof(*o));
    const double slow_ms = sim_cam_fault(cam, SST_SIM_FAULT_SLOW_OPEN_MS);

    if (!o)
        return -ENOMEM;
    o->cam = cam;
    o->handle = h;
    o->priority = V4L2_PRIORITY_DEFAULT;
    o->next = cam->opens;
    cam->opens = o;
    h->state = o;
    return slow_ms > 0 ? sim_answer_at(h->server, r, 0, sst_clock_now_ns() + (int64_t)(slow_ms * 1e6)) : 0;
}

static void cam_close(struct sim_handle *h)
{
    struct sim_open *o = h->state;
    struct sim_cam *cam = h->device;

    SST_LIST_REMOVE(cam->opens, o);
    if (cam->queue.owner == o)
        sim_cam_queue_free(cam);
    /* It may have released its buffers before. */
    if (!cam->queue.owner)
        sim_array_rung(cam->array, cam->index, SST_SIM_REOPEN);
    free(o);
}

static int query_capabilities(const struct sim_cam *cam, struct v4l2_capability *c)
{
    struct sim_identity identity;

    sim_identity(cam->array->cfg.usb, cam->index, &identity);
    *c = (struct v4l2_capability){ .version = KERNEL_VERSION_SHOWN,
                                   .device_caps = V4L2_CAP_STREAMING | V4L2_CAP_EXT_PIX_FORMAT };
    c->device_caps |=
        sim_cam_type(cam) == V4L2_BUF_TYPE_VIDEO_CAPTURE ? V4L2_CAP_VIDEO_CAPTURE : V4L2_CAP_VIDEO_CAPTURE_MPLANE;
    c->capabilities = c->device_caps | V4L2_CAP_DEVICE_CAPS;
    (void)snprintf((char *)c->driver, sizeof(c->driver), "%s",
                   sim_cam_fault(cam, SST_SIM_FAULT_LIBCAMERA) > 0 ? "libcamera" : "uvcvideo");
    (void)snprintf((char *)c->card, sizeof(c->card), "%s", identity.card);
    (void)snprintf((char *)c->bus_info, sizeof(c->bus_info), "%.31s", identity.bus_info);
    return 0;
}

static int enum_input(struct v4l2_input *i)
{
    if (i->index)
        return -EINVAL;
    *i = (struct v4l2_input){ .name = "Camera 1", .type = V4L2_INPUT_TYPE_CAMERA };
    return 0;
}

/* --- priority ----------------------------------------------------------------------------------------------------- */

static uint32_t highest_priority(const struct sim_cam *cam)
{
    uint32_t highest = V4L2_PRIORITY_UNSET;

    for (const struct sim_open *o = cam->opens; o; o = o->next)
        if (o->priority > highest)
            highest = o->priority;
    return highest;
}

static int set_priority(struct sim_open *o, uint32_t priority)
{
    if (priority != V4L2_PRIORITY_BACKGROUND && priority != V4L2_PRIORITY_INTERACTIVE &&
        priority != V4L2_PRIORITY_RECORD)
        return -EINVAL;
    o->priority = priority;
    return 0;
}

/* Ioctls that are denied to a file of lower priority than another. */
static bool needs_priority(uint32_t request)
{
    switch (request) {
    case VIDIOC_S_FMT:
    case VIDIOC_REQBUFS:
    case VIDIOC_CREATE_BUFS:
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
    case VIDIOC_S_PARM:
    case VIDIOC_S_INPUT:
    case VIDIOC_S_CTRL:
    case VIDIOC_S_EXT_CTRLS:
    case VIDIOC_S_PRIORITY:
        return true;
    default:
        return false;
    }
}

/* --- ioctls ------------------------------------------------------------------------------------------------------- */

static int common_ioctl(struct sim_open *o, struct sim_request *r)
{
    uint32_t number;

    memcpy(&number, r->data, sizeof(number));
    switch (r->call.cmd) {
    case VIDIOC_QUERYCAP:
        return query_capabilities(o->cam, (struct v4l2_capability *)r->data);
    case VIDIOC_ENUMINPUT:
        return enum_input((struct v4l2_input *)r->data);
    case VIDIOC_G_INPUT:
        memset(r->data, 0, sizeof(number));
        return 0;
    case VIDIOC_S_INPUT:
        return number ? -EINVAL : 0;
    case VIDIOC_G_PRIORITY:
        number = highest_priority(o->cam);
        memcpy(r->data, &number, sizeof(number));
        return 0;
    case VIDIOC_S_PRIORITY:
        return set_priority(o, number);
    case VIDIOC_LOG_STATUS:
        sst_log_info("camera %d: %llu frames, %llu lost, %s", o->cam->index,
                     (unsigned long long)o->cam->counters.frames, (unsigned long long)o->cam->counters.lost,
                     o->cam->queue.streaming ? "streaming" : "idle");
        return 0;
    case VIDIOC_SUBSCRIBE_EVENT:
        return sim_cam_subscribe(o, (struct v4l2_event_subscription *)r->data);
    case VIDIOC_UNSUBSCRIBE_EVENT:
        return sim_cam_unsubscribe(o, (struct v4l2_event_subscription *)r->data, r);
    default:
        return -ENOTTY;
    }
}

static int cam_ioctl(struct sim_handle *h, struct sim_request *r)
{
    struct sim_open *o = h->state;
    struct sim_cam *cam = h->device;
    const uint32_t bytes = _IOC_DIR(r->call.cmd) == _IOC_NONE ? 0 : _IOC_SIZE(r->call.cmd);
    int result;

    if (r->bytes < bytes)
        return -EFAULT;
    if (!(_IOC_DIR(r->call.cmd) & _IOC_WRITE))
        memset(r->data, 0, bytes);
    if (needs_priority(r->call.cmd) && o->priority < highest_priority(cam))
        return -EBUSY;
    if (r->call.cmd == VIDIOC_DQEVENT)
        return sim_cam_dequeue_event(o, r);
    result = common_ioctl(o, r);
    if (result == -ENOTTY)
        result = sim_cam_formats_ioctl(cam, r);
    if (result == -ENOTTY)
        result = sim_cam_controls_ioctl(cam, o, r);
    if (result == -ENOTTY)
        result = sim_cam_queue_ioctl(cam, o, r);
    /* The argument is returned if the request reads it; if areas follow it, the controls have set the size of all. */
    if (!(_IOC_DIR(r->call.cmd) & _IOC_READ))
        r->out_bytes = 0;
    else if (result == 0 && !r->out_bytes)
        r->out_bytes = bytes;
    return result;
}

static int cam_map(struct sim_handle *h, struct sim_request *r)
{
    return sim_cam_queue_map(h->device, r);
}

static void cam_cancel(struct sim_handle *h, struct sim_request *r)
{
    struct sim_open *o = h->state;
    struct sim_cam *cam = h->device;

    if (cam->queue.waiter == r)
        cam->queue.waiter = NULL;
    if (o && o->event_waiter == r)
        o->event_waiter = NULL;
}

static void cam_ready(struct sim_handle *h)
{
    struct sim_open *o = h->state;

    if (o->events)
        sim_handle_urgent(h);
}

const struct sim_ops sim_cam_ops = {
    .letter = 'v',
    .open = cam_open,
    .close = cam_close,
    .ioctl = cam_ioctl,
    .map = cam_map,
    .cancel = cam_cancel,
    .ready = cam_ready,
};
