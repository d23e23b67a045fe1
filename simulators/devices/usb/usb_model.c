/* simulators/devices/usb/usb_model.c - plugging, authorisation, drivers, power and resets. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/usb/usb_model.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/devices/usb/usb_internal.h"

static void notify(struct sst_sim_usb *usb, int device, enum sst_sim_usb_event event, int interface)
{
    if (usb->event)
        usb->event(usb->arg, device, event, interface);
}

/* --- presence ----------------------------------------------------------------------------------------------------- */

/** A port has power unless it was switched off; if a twin feeds the same socket, both must be off. */
static bool powered(const struct sst_sim_usb *usb, int hub, int port)
{
    const struct sst_sim_usb_device *h = &usb->device[hub];

    return !h->off[port] || (h->twin >= 0 && !usb->device[h->twin].off[port]);
}

static bool should_be_here(const struct sst_sim_usb *usb, int device)
{
    const struct sst_sim_usb_device *d = &usb->device[device];

    if (d->kind == SST_SIM_USB_ROOT)
        return true;
    return d->plugged && usb->device[d->parent].here && (usb->device[d->parent].bound & 1) &&
           !usb->device[d->parent].disabled[d->port] && powered(usb, d->parent, d->port);
}

static void set_bound(struct sst_sim_usb *usb, int device, int interface, bool bound)
{
    struct sst_sim_usb_device *d = &usb->device[device];

    if ((d->bound >> interface & 1) == (unsigned)bound)
        return;
    d->bound ^= 1u << interface;
    if (!bound)
        d->alt = 0;
    notify(usb, device, bound ? SST_SIM_USB_BOUND : SST_SIM_USB_UNBOUND, interface);
}

static void set_all_bound(struct sst_sim_usb *usb, int device, bool bound)
{
    const bool driver = usb->device[device].kind != SST_SIM_USB_STILL;

    for (int i = 0; driver && i < usb->device[device].interfaces; i++)
        set_bound(usb, device, i, bound);
}

static void arrive(struct sst_sim_usb *usb, int device)
{
    struct sst_sim_usb_device *d = &usb->device[device];
    int *next = &usb->next_address[d->bus];

    /* Addresses increase with each plug-in and wrap after 127, as in the kernel. */
    do
        *next = *next % 127 + 1;
    while (sst_sim_usb_at(usb, d->bus, *next) >= 0);
    d->address = *next;
    d->here = true;
    d->authorized = true;
    memset(d->off, 0, sizeof(d->off));
    memset(d->disabled, 0, sizeof(d->disabled));
    notify(usb, device, SST_SIM_USB_ADDED, 0);
    set_all_bound(usb, device, true);
}

static void leave(struct sst_sim_usb *usb, int device)
{
    struct sst_sim_usb_device *d = &usb->device[device];

    set_all_bound(usb, device, false);
    d->here = false;
    notify(usb, device, SST_SIM_USB_REMOVED, 0);
    d->address = 0;
}

/** Update states by plugs, power and authorisation. Parents come first in the list: arrivals are reported in
 *  order, removals from the leaves up. */
static void refresh(struct sst_sim_usb *usb)
{
    bool changed = true;

    while (changed) {
        changed = false;
        for (int i = usb->count - 1; i >= 0; i--) {
            bool stays = true;

            for (int up = i; up >= 0 && stays; up = usb->device[up].parent)
                stays = should_be_here(usb, up);
            if (usb->device[i].here && !stays) {
                leave(usb, i);
                changed = true;
            }
        }
        for (int i = 0; i < usb->count; i++) {
            if (!usb->device[i].here && should_be_here(usb, i)) {
                arrive(usb, i);
                changed = true;
            }
        }
    }
}

/* --- operations on devices ---------------------------------------------------------------------------------------- */

void sst_sim_usb_plug(struct sst_sim_usb *usb, int device, bool plugged)
{
    struct sst_sim_usb_device *d = &usb->device[device];

    /* A hub is one box: both halves are affected. */
    if (d->kind == SST_SIM_USB_ROOT)
        return;
    d->plugged = plugged;
    if (d->twin >= 0)
        usb->device[d->twin].plugged = plugged;
    refresh(usb);
}

void sst_sim_usb_swap(struct sst_sim_usb *usb, int device, int body)
{
    struct sst_sim_usb_device *d = &usb->device[device];
    const bool plugged = d->plugged;

    sst_sim_usb_plug(usb, device, false);
    snprintf(d->serial, sizeof(d->serial), "SIM%04d", body);
    sst_sim_usb_plug(usb, device, plugged);
}

int sst_sim_usb_authorize(struct sst_sim_usb *usb, int device, bool authorized)
{
    struct sst_sim_usb_device *d = &usb->device[device];

    if (!d->here)
        return -ENODEV;
    if (d->kind == SST_SIM_USB_ROOT)
        return -EINVAL;
    if (d->authorized == authorized)
        return 0;
    d->authorized = authorized;
    if (authorized)
        notify(usb, device, SST_SIM_USB_REAUTHORISED, 0);
    set_all_bound(usb, device, authorized);
    notify(usb, device, SST_SIM_USB_CHANGED, 0);
    refresh(usb);
    return 0;
}

int sst_sim_usb_bind(struct sst_sim_usb *usb, int device, int interface, bool bound)
{
    struct sst_sim_usb_device *d = &usb->device[device];

    if (!d->here || !d->authorized || interface < 0 || interface >= d->interfaces || d->kind == SST_SIM_USB_STILL)
        return -ENODEV;
    if ((d->bound >> interface & 1) == (unsigned)bound)
        return bound ? -EBUSY : -ENODEV;
    set_bound(usb, device, interface, bound);
    refresh(usb);
    return 0;
}

static bool has_port(const struct sst_sim_usb *usb, int hub, int port)
{
    return port >= 1 && port <= usb->device[hub].ports;
}

/** A port has power again: a stuck camera there was power-cycled. */
static void notify_powered(struct sst_sim_usb *usb, int hub, int port)
{
    const int child = sst_sim_usb_child(usb, hub, port);

    if (child >= 0)
        notify(usb, child, SST_SIM_USB_POWERED, 0);
}

int sst_sim_usb_disable(struct sst_sim_usb *usb, int hub, int port, bool disabled)
{
    if (!usb->device[hub].here)
        return -ENODEV;
    if (!has_port(usb, hub, port))
        return -EINVAL;
    if (usb->device[hub].disabled[port] == disabled)
        return 0;
    usb->device[hub].disabled[port] = disabled;
    notify(usb, hub, SST_SIM_USB_CHANGED, 0);
    if (!disabled && !usb->fault[SST_SIM_USB_NO_PORT_POWER])
        notify_powered(usb, hub, port); /* the kernel switches off the power of a disabled port if it can */
    refresh(usb);
    return 0;
}

int sst_sim_usb_power(struct sst_sim_usb *usb, int hub, int port, bool on)
{
    struct sst_sim_usb_device *h = &usb->device[hub];
    bool before;

    if (!h->here)
        return -ENODEV;
    if (!has_port(usb, hub, port))
        return -EINVAL;
    if (usb->fault[SST_SIM_USB_NO_PORT_POWER])
        return -EPIPE;
    before = powered(usb, hub, port);
    h->off[port] = !on;
    notify(usb, hub, SST_SIM_USB_CHANGED, 0);
    if (!before && powered(usb, hub, port)) {
        notify_powered(usb, hub, port);
        if (h->twin >= 0)
            notify_powered(usb, h->twin, port);
    }
    refresh(usb);
    return 0;
}

int sst_sim_usb_reset(struct sst_sim_usb *usb, int device)
{
    struct sst_sim_usb_device *d = &usb->device[device];
    const unsigned bound = d->bound;

    if (!d->here)
        return -ENODEV;
    if (usb->fault[SST_SIM_USB_RESET_FAILS])
        return -ETIMEDOUT;
    notify(usb, device, SST_SIM_USB_RESET, 0);
    set_all_bound(usb, device, false);
    refresh(usb); /* devices behind a reset hub are enumerated again */
    for (int i = 0; i < d->interfaces; i++)
        set_bound(usb, device, i, bound >> i & 1);
    refresh(usb);
    return 0;
}

void sst_sim_usb_fault(struct sst_sim_usb *usb, enum sst_sim_usb_fault fault, bool on)
{
    usb->fault[fault] = on;
}

/* --- queries ------------------------------------------------------------------------------------------------------ */

int sst_sim_usb_count(const struct sst_sim_usb *usb)
{
    return usb->count;
}

const struct sst_sim_usb_device *sst_sim_usb_device(const struct sst_sim_usb *usb, int device)
{
    return &usb->device[device];
}

int sst_sim_usb_camera(const struct sst_sim_usb *usb, int camera)
{
    for (int i = 0; i < usb->count; i++)
        if (usb->device[i].camera == camera)
            return i;
    return -1;
}

int sst_sim_usb_still(const struct sst_sim_usb *usb)
{
    for (int i = 0; i < usb->count; i++)
        if (usb->device[i].kind == SST_SIM_USB_STILL)
            return i;
    return -1;
}

int sst_sim_usb_at(const struct sst_sim_usb *usb, int bus, int address)
{
    for (int i = 0; i < usb->count; i++)
        if (usb->device[i].here && usb->device[i].bus == bus && usb->device[i].address == address)
            return i;
    return -1;
}

int sst_sim_usb_child(const struct sst_sim_usb *usb, int hub, int port)
{
    for (int i = 0; i < usb->count; i++)
        if (usb->device[i].parent == hub && usb->device[i].port == port)
            return i;
    return -1;
}

bool sst_sim_usb_works(const struct sst_sim_usb *usb, int device)
{
    const struct sst_sim_usb_device *d = &usb->device[device];

    return d->kind == SST_SIM_USB_CAMERA && d->here && d->authorized && (d->bound & 1);
}

const char *sst_sim_usb_driver(const struct sst_sim_usb_device *device)
{
    if (device->kind == SST_SIM_USB_STILL)
        return "";
    return device->kind == SST_SIM_USB_CAMERA ? "uvcvideo" : "hub";
}

const char *sst_sim_usb_product(const struct sst_sim_usb_device *device)
{
    if (device->kind == SST_SIM_USB_CAMERA)
        return "SST Array Camera";
    if (device->kind == SST_SIM_USB_STILL)
        return "SST Still Camera";
    if (device->kind == SST_SIM_USB_ROOT)
        return "xHCI Host Controller";
    return device->speed_mbit >= 5000 ? "USB3.0 Hub" : "USB2.0 Hub";
}

const char *sst_sim_usb_maker(const struct sst_sim_usb_device *device)
{
    return device->kind == SST_SIM_USB_ROOT ? "Linux 6.1.0 xhci-hcd" : "sst";
}

/* --- create and destroy ------------------------------------------------------------------------------------------- */

int sst_sim_usb_create(struct sst_sim_usb **out, const struct sst_sim_usb_config *cfg)
{
    struct sst_sim_usb *usb = calloc(1, sizeof(*usb));
    int err;

    if (!usb)
        return -ENOMEM;
    usb->size_count = sst_min_int(cfg->size_count, USB_SIZES_MAX);
    if (usb->size_count > 0)
        memcpy(usb->sizes, cfg->sizes, (size_t)usb->size_count * sizeof(usb->sizes[0]));
    err = usb_layout_build(usb, cfg->layout, cfg->cameras, cfg->still);
    if (err) {
        sst_sim_usb_destroy(usb);
        return err;
    }
    refresh(usb);
    usb->arg = cfg->arg;
    usb->event = cfg->event;
    *out = usb;
    return 0;
}

void sst_sim_usb_destroy(struct sst_sim_usb *usb)
{
    if (!usb)
        return;
    free(usb->device);
    free(usb);
}
