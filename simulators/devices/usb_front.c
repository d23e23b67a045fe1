/* simulators/devices/usb_front.c - front end of the USB model, and its faults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"
#include "simulators/devices/usb_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"

/* --- events of the model ------------------------------------------------------------------------------------------ */

static void add_node(struct sim_usb_front *front, int device)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    char path[64];

    /* A failure is logged; the device is then visible in /sys, but cannot be opened. */
    snprintf(path, sizeof(path), "/dev/bus/usb/%03d/%03d", d->bus, d->address);
    (void)!sim_node_add(front->server, &front->shown[device].node, path,
                        &(struct sim_device){ &usb_file_ops, &front->shown[device], SST_SIM_USB_MAJOR,
                                              (unsigned)((d->bus - 1) * 128 + d->address - 1) });
}

static void remove_node(struct sim_usb_front *front, int device)
{
    sim_node_remove(front->server, front->shown[device].node);
    front->shown[device].node = NULL;
}

/** The video node belongs to the control interface. */
static void camera_bound(struct sim_usb_front *front, int device, int interface, bool bound)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);

    if (d->kind == SST_SIM_USB_CAMERA && interface == 0 && front->cfg.works)
        front->cfg.works(front->cfg.arg, d->camera, bound);
}

static void handle(struct sim_usb_front *front, int device, enum sst_sim_usb_event event, int interface)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);

    switch (event) {
    case SST_SIM_USB_ADDED:
        add_node(front, device);
        usb_sysfs_add(front, device);
        break;
    case SST_SIM_USB_REMOVED:
        remove_node(front, device);
        usb_sysfs_remove(front, device);
        break;
    case SST_SIM_USB_BOUND:
        camera_bound(front, device, interface, true);
        usb_sysfs_bound(front, device, interface);
        break;
    case SST_SIM_USB_UNBOUND:
        camera_bound(front, device, interface, false);
        usb_sysfs_bound(front, device, interface);
        break;
    case SST_SIM_USB_CHANGED:
        usb_sysfs_changed(front, device);
        break;
    case SST_SIM_USB_RESET:
        if (d->kind == SST_SIM_USB_STILL && front->pipes.released)
            front->pipes.released(front->pipes.arg);
        /* fall through */
    case SST_SIM_USB_REAUTHORISED:
    case SST_SIM_USB_POWERED:
        if (d->camera >= 0 && front->cfg.rung)
            front->cfg.rung(front->cfg.arg, d->camera, event);
        break;
    }
}

static void event(void *arg, int device, enum sst_sim_usb_event what, int interface)
{
    struct sim_usb_front *front = arg;
    const bool in_event = front->in_event;

    front->in_event = true;
    handle(front, device, what, interface);
    front->in_event = in_event;
}

/* --- callbacks of the array --------------------------------------------------------------------------------------- */

bool sim_usb_front_video(struct sim_usb_front *front, int cam, bool present, int node)
{
    const int device = sst_sim_usb_camera(front->usb, cam);
    struct usb_shown *shown = &front->shown[device];

    if (present && !front->in_event && !sst_sim_usb_device(front->usb, device)->plugged) {
        sst_sim_usb_plug(front->usb, device, true);
        if (!sst_sim_usb_works(front->usb, device))
            return false;
    }
    if (present && shown->video < 0) {
        shown->video = node;
        usb_sysfs_video(front, device, true, node);
    } else if (!present && shown->video >= 0) {
        usb_sysfs_video(front, device, false, shown->video);
        shown->video = -1;
    }
    if (!present && !front->in_event)
        sst_sim_usb_plug(front->usb, device, false);
    return true;
}

/* --- the still camera --------------------------------------------------------------------------------------------- */

void sim_usb_front_pipes(struct sim_usb_front *front, const struct sim_usb_pipes *pipes)
{
    front->pipes = *pipes;
}

void sim_usb_front_plug(struct sim_usb_front *front, bool plugged)
{
    sst_sim_usb_plug(front->usb, sst_sim_usb_still(front->usb), plugged);
}

const char *sim_usb_front_port(const struct sim_usb_front *front)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, sst_sim_usb_still(front->usb));

    return d->here ? d->path : "";
}

/* --- faults ------------------------------------------------------------------------------------------------------- */

static const struct sim_fault bus_faults[SST_SIM_USB_FAULTS] = {
    [SST_SIM_USB_RESET_FAILS] = { "reset_fails", 0, 1, "1: USB resets end with ETIMEDOUT" },
    [SST_SIM_USB_NO_PORT_POWER] = { "no_port_power", 0, 1, "1: hubs cannot switch the power of a port" },
};
static const struct sim_fault hub_faults[] = {
    { "unplug", 0, 1, "1: the hub and all below it are away, 0: they are back" },
};

const struct sim_fault_scope sim_usb_faults = { .name = "usb", .faults = bus_faults, .count = SST_SIM_USB_FAULTS };
const struct sim_fault_scope sim_hub_faults = {
    .name = "hub", .faults = hub_faults, .count = (int)ARRAY_LEN(hub_faults), .instances = 1
};

static int bus_changed(void *arg, int instance SST_UNUSED, int fault, double value)
{
    struct sim_usb_front *front = arg;

    sst_sim_usb_fault(front->usb, (enum sst_sim_usb_fault)fault, value != 0);
    return 0;
}

/** Hubs counted as physical boxes, in tree order. @return the n-th, or -1 */
static int hub_device(const struct sst_sim_usb *usb, int n)
{
    for (int i = 0; i < sst_sim_usb_count(usb); i++) {
        const struct sst_sim_usb_device *d = sst_sim_usb_device(usb, i);

        if (d->kind == SST_SIM_USB_HUB && d->speed_mbit == 480 && n-- == 0)
            return i;
    }
    return -1;
}

static int hub_changed(void *arg, int instance, int fault SST_UNUSED, double value)
{
    struct sim_usb_front *front = arg;

    sst_sim_usb_plug(front->usb, hub_device(front->usb, instance), value == 0);
    return 0;
}

static int add_faults(struct sim_usb_front *front)
{
    struct sim_fault_scope scope = sim_usb_faults;
    int err, hubs = 0;

    scope.changed = bus_changed;
    scope.arg = front;
    err = sim_faults_add(front->cfg.faults, &scope);
    while (hub_device(front->usb, hubs) >= 0)
        hubs++;
    if (err >= 0 && hubs > 0) {
        scope = sim_hub_faults;
        scope.instances = hubs;
        scope.changed = hub_changed;
        scope.arg = front;
        err = sim_faults_add(front->cfg.faults, &scope);
    }
    return sst_min_int(err, 0);
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

static void no_layout(const char *layout)
{
    char names[256] = "";
    const char *name, *help;

    for (int i = 0; sst_sim_usb_layout(i, &name, &help); i++)
        sst_text_add(names, sizeof(names), "%s%s", i ? ", " : "", name);
    sst_log_error("USB layout '%s' is unknown or has too few ports for the cameras; choose %s", layout, names);
}

static int show_all(struct sim_usb_front *front)
{
    usb_sysfs_drivers(front);
    front->in_event = true;
    for (int i = 0; i < sst_sim_usb_count(front->usb); i++) {
        add_node(front, i);
        usb_sysfs_add(front, i);
    }
    front->in_event = false;
    return front->cfg.sysfs->err;
}

int sim_usb_front_open(struct sim_usb_front **out, const struct sim_usb_front_config *cfg)
{
    struct sim_usb_front *front = calloc(1, sizeof(*front));
    struct sst_sim_usb_config model = {
        .layout = cfg->layout,
        .cameras = cfg->cameras,
        .still = cfg->still,
        .sizes = cfg->sizes,
        .size_count = cfg->size_count,
        .event = event,
    };
    int err = -ENOMEM;

    if (!front)
        return err;
    model.arg = front;
    front->cfg = *cfg;
    front->server = cfg->sysfs->server;
    err = sst_sim_usb_create(&front->usb, &model);
    if (err == -EINVAL)
        no_layout(cfg->layout ? cfg->layout : "(default)");
    if (!err) {
        front->shown = calloc((size_t)sst_sim_usb_count(front->usb), sizeof(*front->shown));
        err = front->shown ? 0 : -ENOMEM;
    }
    for (int i = 0; !err && i < sst_sim_usb_count(front->usb); i++) {
        front->shown[i].video = -1;
        front->shown[i].front = front;
        front->shown[i].device = i;
    }
    err = err ? err : show_all(front);
    err = err ? err : add_faults(front);
    if (err)
        sim_usb_front_close(front);
    else
        *out = front;
    return err;
}

void sim_usb_front_close(struct sim_usb_front *front)
{
    if (!front)
        return;
    for (int i = 0; front->shown && i < sst_sim_usb_count(front->usb); i++) {
        remove_node(front, i);
        for (int p = 0; p <= SST_SIM_USB_PORTS; p++)
            sim_node_remove(front->server, front->shown[i].attribute[p].node);
    }
    for (size_t i = 0; i < ARRAY_LEN(front->driver_file); i++)
        sim_node_remove(front->server, front->driver_file[i].node);
    sst_sim_usb_destroy(front->usb);
    free(front->shown);
    free(front);
}
