/* simulators/devices/usb/usb_layout.c - layouts of controllers, hubs and cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "simulators/devices/usb/usb_internal.h"

#define HUB_PORTS 4

static const struct layout {
    const char *name, *help;
    bool own_controller; /* one per camera; else all share one through a tree of hubs */
    int speed_mbit;      /* of the cameras */
    bool single_tt, twins;
} layouts[] = {
    { "wide", "a controller for each camera: all stream together", true, 480, false, false },
    { "tight", "one controller and 4-port hubs: one greedy camera fills the high-speed bus", false, 480, false, true },
    { "single-tt", "full-speed cameras, hubs with one translator each: one camera a hub", false, 12, true, false },
    { "multi-tt", "full-speed cameras, hubs with a translator for each port", false, 12, false, false },
};

bool sst_sim_usb_layout(int i, const char **name, const char **help)
{
    if (i < 0 || i >= (int)ARRAY_LEN(layouts))
        return false;
    *name = layouts[i].name;
    *help = layouts[i].help;
    return true;
}

static struct sst_sim_usb_device *append(struct sst_sim_usb *usb)
{
    if (!sst_mem_grow(&usb->device, usb->count, &usb->room, sizeof(*usb->device)))
        return NULL;
    usb->device[usb->count] = (struct sst_sim_usb_device){ .parent = -1, .twin = -1, .camera = -1, .plugged = true };
    return &usb->device[usb->count++];
}

/** A root hub. @return its index or -ENOMEM */
static int add_root(struct sst_sim_usb *usb, const char *controller, int bus, int speed_mbit)
{
    struct sst_sim_usb_device *d = append(usb);

    if (!d)
        return -ENOMEM;
    d->kind = SST_SIM_USB_ROOT;
    d->bus = bus;
    d->speed_mbit = speed_mbit;
    d->ports = HUB_PORTS;
    d->interfaces = 1;
    snprintf(d->path, sizeof(d->path), "usb%d", bus);
    snprintf(d->controller, sizeof(d->controller), "%s", controller);
    snprintf(d->serial, sizeof(d->serial), "%s", controller);
    return usb->count - 1;
}

/** A hub or camera at a port. @return its index or -ENOMEM */
static int add_at(struct sst_sim_usb *usb, enum sst_sim_usb_kind kind, int parent, int port, int speed_mbit)
{
    struct sst_sim_usb_device *d = append(usb);
    struct sst_sim_usb_device up;

    if (!d)
        return -ENOMEM;
    up = usb->device[parent];
    d->kind = kind;
    d->parent = parent;
    d->port = port;
    d->bus = up.bus;
    d->speed_mbit = speed_mbit;
    d->ports = kind == SST_SIM_USB_HUB ? HUB_PORTS : 0;
    d->interfaces = kind == SST_SIM_USB_CAMERA ? 2 : 1;
    memcpy(d->controller, up.controller, sizeof(d->controller));
    if (up.kind == SST_SIM_USB_ROOT)
        snprintf(d->path, sizeof(d->path), "%d-%d", d->bus, port);
    else
        snprintf(d->path, sizeof(d->path), "%.48s.%d", up.path, port);
    return usb->count - 1;
}

static int add_camera(struct sst_sim_usb *usb, int parent, int port, int camera, int speed_mbit)
{
    const int d = add_at(usb, SST_SIM_USB_CAMERA, parent, port, speed_mbit);

    if (d < 0)
        return d;
    usb->device[d].camera = camera;
    snprintf(usb->device[d].serial, sizeof(usb->device[d].serial), "SIM%04d", camera);
    return 0;
}

/** A hub; with twins, its SuperSpeed half is at the same port of the parent's twin. @return index or -ENOMEM */
static int add_hub(struct sst_sim_usb *usb, const struct layout *layout, int parent, int port)
{
    const int hub = add_at(usb, SST_SIM_USB_HUB, parent, port, 480);

    if (hub < 0)
        return hub;
    usb->device[hub].single_tt = layout->single_tt;
    if (layout->twins) {
        const int twin = add_at(usb, SST_SIM_USB_HUB, usb->device[parent].twin, port, 5000);

        if (twin < 0)
            return twin;
        usb->device[hub].twin = twin;
        usb->device[twin].twin = hub;
    }
    return hub;
}

/** An xHCI controller has a high-speed bus and a SuperSpeed bus; their root hubs share the sockets. */
static int add_controller(struct sst_sim_usb *usb, const char *address, int index)
{
    const int hs = add_root(usb, address, 2 * index + 1, 480), ss = add_root(usb, address, 2 * index + 2, 5000);

    if (hs < 0 || ss < 0)
        return -ENOMEM;
    usb->device[hs].twin = ss;
    usb->device[ss].twin = hs;
    return hs;
}

static int build_wide(struct sst_sim_usb *usb, const struct layout *layout, int cameras)
{
    if (cameras > 127)
        return -EINVAL; /* more cards than a machine can have */
    for (int cam = 0; cam < cameras; cam++) {
        char address[SST_SIM_USB_TEXT];
        int root, err;

        /* Cards with four EHCI controllers, each behind a bridge of its own and with one socket. */
        snprintf(address, sizeof(address), "0000:%02x:00.0", 3 + cam);
        root = add_root(usb, address, cam + 1, 480);
        if (root < 0)
            return root;
        usb->device[root].ports = 1;
        err = add_camera(usb, root, 1, cam, layout->speed_mbit);
        if (err)
            return err;
    }
    return 0;
}

/** Two tiers with as few hubs as possible for the cameras, filled in order. */
static int build_tree(struct sst_sim_usb *usb, const struct layout *layout, int cameras)
{
    const int root = add_controller(usb, "0000:00:14.0", 0);
    int mid = -1, leaf = -1;

    if (root < 0)
        return root;
    for (int cam = 0, leaves = 0, mids = 0; cam < cameras; cam++) {
        int err;

        if (cam % HUB_PORTS == 0) {
            if (leaves % HUB_PORTS == 0) {
                if (++mids > SST_SIM_USB_PORTS)
                    return -EINVAL;
                mid = add_hub(usb, layout, root, mids);
            }
            leaf = mid < 0 ? mid : add_hub(usb, layout, mid, leaves++ % HUB_PORTS + 1);
        }
        err = leaf < 0 ? leaf : add_camera(usb, leaf, cam % HUB_PORTS + 1, cam, layout->speed_mbit);
        if (err)
            return err;
        usb->device[root].ports = sst_max_int(HUB_PORTS, mids);
    }
    usb->device[usb->device[root].twin].ports = usb->device[root].ports;
    return 0;
}

/** A still camera on a controller of its own: it is charged there, and takes no bandwidth from the others. */
static int add_still(struct sst_sim_usb *usb, const char *serial)
{
    int bus = 0, root, d;

    for (int i = 0; i < usb->count; i++)
        bus = sst_max_int(bus, usb->device[i].bus);
    root = add_root(usb, "0000:00:1d.0", bus + 1, 480);
    d = root < 0 ? root : add_at(usb, SST_SIM_USB_STILL, root, 1, 480);
    if (d < 0)
        return d;
    snprintf(usb->device[d].serial, sizeof(usb->device[d].serial), "%s", serial);
    return 0;
}

int usb_layout_build(struct sst_sim_usb *usb, const char *name, int cameras, const char *still)
{
    for (size_t i = 0; i < ARRAY_LEN(layouts); i++) {
        int err;

        if (name && strcmp(name, layouts[i].name) != 0)
            continue;
        if (cameras < 1 || cameras > 255)
            return -EINVAL;
        err = layouts[i].own_controller ? build_wide(usb, &layouts[i], cameras) : build_tree(usb, &layouts[i], cameras);
        return err || !still ? err : add_still(usb, still);
    }
    return -EINVAL;
}
