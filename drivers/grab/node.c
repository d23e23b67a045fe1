/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

int node_ioctl(int fd, unsigned long request, void *arg)
{
    int r;

    do
        r = ioctl(fd, request, arg);
    while (r < 0 && errno == EINTR);
    return r < 0 ? -errno : 0;
}

/* Two re-plugged cameras may swap node numbers: "usb-0000:00:14.0-2.3" must end like the port "1-2.3". */
static bool same_port(const char *port, const char *bus_info)
{
    const char *a = strchr(port, '-'), *b = strrchr(bus_info, '-');

    return !grab_is_usb_port(port) || strncmp(bus_info, "usb-", 4) != 0 || !a || !b || !strcmp(a, b);
}

/* Why a node with these capabilities is no camera; "" if it may be one. */
static const char *unfit_for(uint32_t caps)
{
    if (caps & (V4L2_CAP_VIDEO_M2M | V4L2_CAP_VIDEO_M2M_MPLANE))
        return "memory to memory: an encoder, decoder or scaler";
    if (!(caps & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)))
        return caps & V4L2_CAP_META_CAPTURE ? "metadata of a camera" : "it captures no pictures";
    return caps & V4L2_CAP_STREAMING ? "" : "it cannot stream";
}

uint32_t node_type(int fd)
{
    struct v4l2_capability cap = { 0 };
    const int err = node_ioctl(fd, VIDIOC_QUERYCAP, &cap);
    const uint32_t caps = cap.capabilities & V4L2_CAP_DEVICE_CAPS ? cap.device_caps : cap.capabilities;

    return !err && !(caps & V4L2_CAP_VIDEO_CAPTURE) ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

int node_open(struct sst_grab_device *d)
{
    const int fd = open(d->node, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    struct v4l2_capability cap = { 0 };
    uint32_t caps;
    int err;

    if (fd < 0)
        return errno == ENOENT || errno == ENXIO ? -ENODEV : -errno;
    err = node_ioctl(fd, VIDIOC_QUERYCAP, &cap);
    caps = cap.capabilities & V4L2_CAP_DEVICE_CAPS ? cap.device_caps : cap.capabilities;
    if (!err)
        snprintf(d->left_out, sizeof(d->left_out), "%s", unfit_for(caps));
    if (!err && *d->left_out)
        err = -ENOTTY;
    if (!err && *d->port && !same_port(d->port, (const char *)cap.bus_info))
        err = -ENODEV;
    if (err) {
        close(fd);
        return err;
    }
    snprintf(d->name, sizeof(d->name), "%.*s", (int)sizeof(cap.card), (const char *)cap.card);
    snprintf(d->driver, sizeof(d->driver), "%.*s", (int)sizeof(cap.driver), (const char *)cap.driver);
    if (!*d->port)
        snprintf(d->port, sizeof(d->port), "%.*s", (int)sizeof(cap.bus_info), (const char *)cap.bus_info);
    return fd;
}
