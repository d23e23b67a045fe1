/* simulators/devices/preload/usb.c - usbfs in the program: transfers and their buffers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <linux/usbdevice_fs.h>
#include <stdint.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "simulators/devices/preload/preload_internal.h"

/* A transfer goes to the simulator as struct sst_sim_usb_transfer and its data, and comes back the same way. */
static int exchange(const struct sim_id *id, unsigned long request, struct sst_sim_usb_transfer *t, void *data,
                    size_t bytes)
{
    struct sim_exchange x = {
        .call = { .op = SST_SIM_IOCTL, .cmd = (uint32_t)request, .handle = id->handle },
        .in = { { t, sizeof(*t) }, { data, bytes } },
        .out = { { t, sizeof(*t) }, { data, bytes } },
        .send_fd = -1,
    };

    return sim_exchange(&x);
}

/* A request whose number does not have the direction of its argument. */
static int ask(const struct sim_id *id, unsigned long request, void *arg, size_t in, size_t out)
{
    struct sim_exchange x = {
        .call = { .op = SST_SIM_IOCTL, .cmd = (uint32_t)request, .handle = id->handle },
        .in = { { arg, in } },
        .out = { { arg, out } },
        .send_fd = -1,
    };

    return sim_exchange(&x);
}

static int control(const struct sim_id *id, void *arg)
{
    struct usbdevfs_ctrltransfer c;
    struct sst_sim_usb_transfer t = { 0 };

    if (sim_peek(&c, arg, sizeof(c)))
        return -EFAULT;
    t.setup[0] = c.bRequestType;
    t.setup[1] = c.bRequest;
    memcpy(t.setup + 2, &c.wValue, 2);
    memcpy(t.setup + 4, &c.wIndex, 2);
    memcpy(t.setup + 6, &c.wLength, 2);
    return exchange(id, USBDEVFS_CONTROL, &t, c.data, c.wLength);
}

static int submit(const struct sim_id *id, void *arg)
{
    struct usbdevfs_urb urb;
    struct sst_sim_usb_transfer t = { .user = (uint64_t)(uintptr_t)arg };

    if (sim_peek(&urb, arg, sizeof(urb)))
        return -EFAULT;
    t.type = urb.type;
    t.endpoint = urb.endpoint;
    t.flags = (uint16_t)urb.flags;
    if (urb.type != USBDEVFS_URB_TYPE_CONTROL) {
        if (urb.buffer_length < 0 || urb.buffer_length > SST_SIM_USB_BULK_MAX)
            return -EINVAL;
        t.length = (uint32_t)urb.buffer_length;
        return exchange(id, USBDEVFS_SUBMITURB, &t, urb.buffer, urb.endpoint & 0x80 ? 0 : t.length);
    }
    if (urb.buffer_length < 8 || urb.buffer_length > SST_SIM_USB_TRANSFER_MAX + 8)
        return -EINVAL;
    if (sim_peek(t.setup, urb.buffer, sizeof(t.setup)))
        return -EFAULT;
    return exchange(id, USBDEVFS_SUBMITURB, &t, (char *)urb.buffer + 8, (size_t)urb.buffer_length - 8);
}

/* The simulator returns the completed transfer; its data are copied to the program's buffer. */
static int reap_one(const struct sim_id *id, unsigned long request, void *arg)
{
    struct sst_sim_usb_transfer t = { 0 };
    uint8_t data[SST_SIM_USB_BULK_MAX];
    struct sim_exchange x = {
        .call = { .op = SST_SIM_IOCTL, .cmd = (uint32_t)request, .handle = id->handle },
        .out = { { &t, sizeof(t) }, { data, sizeof(data) } },
        .send_fd = -1,
    };
    const int result = sim_exchange(&x);
    struct usbdevfs_urb *urb;

    if (result < 0)
        return result;
    urb = (struct usbdevfs_urb *)(uintptr_t)t.user;
    urb->status = t.status;
    urb->actual_length = t.actual;
    urb->error_count = 0;
    if (t.actual > 0 && t.type == USBDEVFS_URB_TYPE_CONTROL && (t.setup[0] & 0x80))
        memcpy((char *)urb->buffer + 8, data, (size_t)t.actual);
    else if (t.actual > 0 && t.type != USBDEVFS_URB_TYPE_CONTROL && (t.endpoint & 0x80))
        memcpy(urb->buffer, data, (size_t)t.actual);
    memcpy(arg, &urb, sizeof(urb));
    return 0;
}

/*
 * usbfs is writable for poll() when a transfer can be reaped. Here the socket is full otherwise, and the simulator
 * empties it when a transfer completes. If nothing is left, fill it again, then check once more for a transfer that
 * completed in between.
 */
static int reap(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    static const char filler[1024];
    const int saved = errno;
    int result = reap_one(id, request, arg);

    if (result == -EAGAIN) {
        while (send(fd, filler, sizeof(filler), MSG_DONTWAIT | MSG_NOSIGNAL) > 0)
            ;
        errno = saved;
        result = reap_one(id, request, arg);
    }
    return result;
}

/* USBDEVFS_IOCTL wraps a request to an interface: disconnect or connect its driver. */
static int interface_ioctl(int fd, const struct sim_id *id, void *arg)
{
    struct usbdevfs_ioctl c;

    if (sim_peek(&c, arg, sizeof(c)))
        return -EFAULT;
    c.data = NULL;
    return sim_ioctl_areas(fd, id, &(struct sim_ioctl){ USBDEVFS_IOCTL, &c, NULL, 0 }, NULL);
}

static int usb_ioctl(int fd, const struct sim_id *id, unsigned long request, void *arg)
{
    switch (request) {
    case USBDEVFS_CONTROL:
        return control(id, arg);
    case USBDEVFS_SUBMITURB:
        return submit(id, arg);
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY:
        return reap(fd, id, request, arg);
    case USBDEVFS_IOCTL:
        return interface_ioctl(fd, id, arg);
    case USBDEVFS_DISCARDURB: {
        /* The request number has no argument size, but the argument identifies the transfer. */
        struct sst_sim_usb_transfer t = { .user = (uint64_t)(uintptr_t)arg };

        return exchange(id, request, &t, NULL, 0);
    }
    case USBDEVFS_GETDRIVER: /* the request number means "write", but an answer is read */
        return ask(id, request, arg, sizeof(struct usbdevfs_getdriver), sizeof(struct usbdevfs_getdriver));
    case USBDEVFS_CONNECTINFO:
        return ask(id, request, arg, 0, sizeof(struct usbdevfs_connectinfo));
    default:
        return sim_ioctl_areas(fd, id, &(struct sim_ioctl){ request, arg, NULL, 0 }, NULL);
    }
}

const struct sim_class sim_class_usb = {
    .letter = 'u',
    .ioctl_type = 'U',
    .ioctl = usb_ioctl,
    .read_calls = true,
};
