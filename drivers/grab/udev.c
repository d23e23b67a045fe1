/* Discovery and hotplug of video nodes, by libudev. */
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

/* Number of "video12" or "/dev/video12", -1 for other names. */
static int node_number(const char *name)
{
    const char *digits = strstr(name, "video");
    char *end;
    long n;

    if (!digits || digits[5] < '0' || digits[5] > '9')
        return -1;
    n = strtol(digits + 5, &end, 10);
    return *end || n > 65535 ? -1 : (int)n;
}

/* Outside of USB the bus_info of a device is its port, and querying it does not access hardware that may hang. */
static void identify_off_usb(struct grab_node *node)
{
    const int fd = grab_probe_node(node);

    if (fd >= 0)
        close(fd);
}

struct node_list {
    struct grab_node *node;
    int count;
};

static int list_init(struct node_list *list)
{
    list->count = 0;
    list->node = calloc(SST_GRAB_NODES_MAX, sizeof(*list->node));
    if (!list->node)
        sst_log_error("no memory for a list of cameras");
    return list->node ? 0 : -ENOMEM;
}

static void list_sort(struct node_list *list)
{
    for (int i = 0; i < list->count; i++) {
        if (!*list->node[i].device.port)
            identify_off_usb(&list->node[i]);
    }
    qsort(list->node, (size_t)list->count, sizeof(*list->node), grab_node_order);
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

    if (!path || node_number(udev_device_get_sysname(d)) < 0)
        return false;
    *node = (struct grab_node){ .number = node_number(udev_device_get_sysname(d)), .capture = -1 };
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

static int scan_udev(struct udev *udev, struct node_list *list)
{
    struct udev_enumerate *e = udev_enumerate_new(udev);
    struct udev_list_entry *entry;
    int err = e ? udev_enumerate_add_match_subsystem(e, "video4linux") : -ENOMEM;

    err = err < 0 ? err : udev_enumerate_scan_devices(e);
    if (err < 0) {
        sst_log_error("cannot list cameras: udev: %s; is /sys mounted?", strerror(-err));
        udev_enumerate_unref(e);
        return err;
    }
    udev_list_entry_foreach(entry, udev_enumerate_get_list_entry(e))
    {
        struct udev_device *d = udev_device_new_from_syspath(udev, udev_list_entry_get_name(entry));

        if (d && list->count < SST_GRAB_NODES_MAX && node_from_udev(&list->node[list->count], d))
            list->count++;
        udev_device_unref(d);
    }
    udev_enumerate_unref(e);
    return 0;
}

int grab_scan(struct grab_node **nodes, int *count)
{
    struct udev *udev = udev_new();
    struct node_list list = { 0 };
    int err = udev ? list_init(&list) : -ENOMEM;

    if (!err)
        err = scan_udev(udev, &list);
    udev_unref(udev);
    if (err) {
        free(list.node);
        return err;
    }
    list_sort(&list);
    *nodes = list.node;
    *count = list.count;
    return 0;
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
        identify_off_usb(node);
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
