/* simulators/devices/usb_attributes.c - writable attributes in /sys: authorized, disable, bind, unbind. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "simulators/devices/devices_internal.h"
#include "simulators/devices/usb_internal.h"

/* --- a device's --------------------------------------------------------------------------------------------------- */

static int write_attribute(struct usb_attribute *a, const char *text)
{
    char *end;
    const long value = strtol(text, &end, 10);

    if (end == text || value < 0 || value > 1)
        return -EINVAL;
    if (a->port > 0)
        return sst_sim_usb_disable(a->front->usb, a->device, a->port, value == 1);
    return sst_sim_usb_authorize(a->front->usb, a->device, value == 1);
}

/* --- a driver's --------------------------------------------------------------------------------------------------- */

/** text: the name of an interface, "1-2:1.0" */
static int write_driver_file(struct usb_driver_file *f, const char *text)
{
    struct sst_sim_usb *usb = f->front->usb;

    for (int i = 0; i < sst_sim_usb_count(usb); i++) {
        const struct sst_sim_usb_device *d = sst_sim_usb_device(usb, i);

        if (strcmp(sst_sim_usb_driver(d), f->driver) != 0)
            continue;
        for (int k = 0; k < d->interfaces; k++) {
            char name[96];

            usb_interface_name(d, k, name, sizeof(name));
            if (strncmp(text, name, strlen(name)) == 0 && strchr("\n", text[strlen(name)]))
                return sst_sim_usb_bind(usb, i, k, f->bind);
        }
    }
    return -ENODEV;
}

/* --- both --------------------------------------------------------------------------------------------------------- */

static int write_text(struct sim_handle *h, const uint8_t *data, size_t bytes)
{
    char text[128];
    int err;

    if (bytes >= sizeof(text))
        return -EINVAL;
    memcpy(text, data, bytes);
    text[bytes] = '\0';
    err = h->ops == &usb_driver_ops ? write_driver_file(h->device, text) : write_attribute(h->device, text);
    return err ? err : (int)bytes;
}

/** Data written by libc's streams bypasses the preload library and is still in the socket. */
static int read_late(struct sim_handle *h)
{
    uint8_t data[256];
    const ssize_t n = recv(h->fd, data, sizeof(data), MSG_DONTWAIT);
    const bool first = n > 0 && data[0] == '\0'; /* the socket's own byte, see make_pair() */

    return n > (first ? 1 : 0) ? write_text(h, data + first, (size_t)n - first) : 0;
}

static int attribute_write(struct sim_handle *h, struct sim_request *r)
{
    return r->bytes > 0 ? write_text(h, r->data, r->bytes) : read_late(h);
}

static void attribute_close(struct sim_handle *h)
{
    (void)!read_late(h);
}

const struct sim_ops usb_attribute_ops = { .letter = 's', .close = attribute_close, .write = attribute_write };
const struct sim_ops usb_driver_ops = { .letter = 's', .close = attribute_close, .write = attribute_write };
