/* Discovery and hotplug of video nodes, by libudev. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <errno.h>
#include <libudev.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"

static void copy(char out[SST_GRAB_NAME_MAX], const char *text)
{
    snprintf(out, SST_GRAB_NAME_MAX, "%s", text ? text : "");
}

struct grab_monitor {
    struct udev *udev;
    struct udev_monitor *monitor;
};

/* Without udevd (an initramfs, a container): the serial of the USB device, and no information about capture. */
static bool node_from_udev(struct grab_node *node, struct udev_device *d)
{
    const char *path = udev_device_get_devnode(d);
    const char *caps = udev_device_get_property_value(d, "ID_V4L_CAPABILITIES");
    const char *serial = udev_device_get_property_value(d, "ID_SERIAL_SHORT");
    struct udev_device *usb = udev_device_get_parent_with_subsystem_devtype(d, "usb", "usb_device");

    if (!path || grab_node_number(udev_device_get_sysname(d)) < 0)
        return false;
    *node = (struct grab_node){ .number = grab_node_number(udev_device_get_sysname(d)), .capture = -1 };
    if (!serial && usb)
        serial = udev_device_get_sysattr_value(usb, "serial");
    copy(node->device.node, path);
    copy(node->device.name, udev_device_get_sysattr_value(d, "name"));
    copy(node->device.serial, serial);
    copy(node->device.port, usb ? udev_device_get_sysname(usb) : "");
    if (caps && strstr(caps, ":capture:"))
        node->capture = 1;
    else if (caps && usb) /* else it is opened: old versions of udev do not name multi-planar capture */
        node->capture = 0;
    return true;
}

int grab_list(struct grab_node *nodes)
{
    struct udev *udev = udev_new();
    struct udev_enumerate *e = udev ? udev_enumerate_new(udev) : NULL;
    struct udev_list_entry *entry;
    int count = 0, err = e ? udev_enumerate_add_match_subsystem(e, "video4linux") : -ENOMEM;

    err = err < 0 ? err : udev_enumerate_scan_devices(e);
    if (err < 0) {
        sst_log_error("cannot list cameras: udev: %s; is /sys mounted?", strerror(-err));
        goto done;
    }
    udev_list_entry_foreach(entry, udev_enumerate_get_list_entry(e))
    {
        struct udev_device *d = udev_device_new_from_syspath(udev, udev_list_entry_get_name(entry));

        if (d && count < SST_GRAB_NODES_MAX && node_from_udev(&nodes[count], d))
            count++;
        udev_device_unref(d);
    }

done:
    udev_enumerate_unref(e);
    udev_unref(udev);
    return err < 0 ? err : count;
}

int grab_monitor_open(struct grab_monitor **out)
{
    struct grab_monitor *w = calloc(1, sizeof(*w));
    int err = -ENOMEM;

    if (!w || !(w->udev = udev_new()))
        goto fail;
    /* Events after udev's rules, so that permissions and serials are set; events of the kernel if no udevd runs. */
    w->monitor = udev_monitor_new_from_netlink(w->udev, access("/run/udev/control", F_OK) ? "kernel" : "udev");
    if (!w->monitor)
        goto fail;
    /* 36 cameras on a hub that loses power give 72 or more events at once. */
    (void)udev_monitor_set_receive_buffer_size(w->monitor, 4 << 20);
    err = udev_monitor_filter_add_match_subsystem_devtype(w->monitor, "video4linux", NULL);
    err = err < 0 ? err : udev_monitor_enable_receiving(w->monitor);
    if (err < 0)
        goto fail;
    *out = w;
    return 0;

fail:
    sst_log_error("cannot monitor hotplug of cameras: udev: %s; a sandbox must allow netlink sockets", strerror(-err));
    grab_monitor_close(w);
    return err;
}

int grab_monitor_fd(const struct grab_monitor *watch)
{
    return udev_monitor_get_fd(watch->monitor);
}

int grab_monitor_next(struct grab_monitor *watch, struct grab_node *node)
{
    struct udev_device *d;
    int what = 0;

    /* Other events (change, bind) are skipped. */
    while (!what) {
        const char *action;

        errno = 0;
        d = udev_monitor_receive_device(watch->monitor);
        if (!d)
            return errno == ENOBUFS ? -ENOBUFS : 0;
        action = udev_device_get_action(d);
        if (action && node_from_udev(node, d))
            what = !strcmp(action, "add") ? 1 : !strcmp(action, "remove") ? 2 : 0;
        udev_device_unref(d);
    }
    if (what == 1 && !*node->device.port)
        grab_identify_off_usb(node);
    return what;
}

void grab_monitor_close(struct grab_monitor *watch)
{
    if (!watch)
        return;
    udev_monitor_unref(watch->monitor);
    udev_unref(watch->udev);
    free(watch);
}
