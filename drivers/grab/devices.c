/* Discovery and hotplug: by libudev, or without it by /dev/video* and sysfs. */
#include "drivers/grab/grab_internal.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#if WITH_UDEV
#include <libudev.h>
#else
#include <dirent.h>
#include <limits.h>
#endif

#include "base/clock.h"
#include "base/log.h"

/* A node that does not respond within this time is listed with ETIMEDOUT. */
#define PROBE_MS 2000
#define SLICE_MS 100

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

/* @return descriptor or -errno */
static int probe_node(struct grab_node *node)
{
    const int fd = node_open(&node->device);

    node->device.error = fd < 0 ? -fd : 0;
    node->capture = fd >= 0 ? 1 : fd == -ENOTTY ? 0 : node->capture;
    return fd;
}

/* Outside of USB the bus_info of a device is its port, and querying it does not access hardware that may hang. */
static void identify_off_usb(struct grab_node *node)
{
    const int fd = probe_node(node);

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

#if WITH_UDEV

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

#else

/* First line of a small file below a folder of sysfs; "" if it cannot be read. */
static void read_attribute(char out[SST_GRAB_NAME_MAX], const char *dir, const char *name)
{
    char path[PATH_MAX + 32];
    FILE *f;

    *out = 0;
    snprintf(path, sizeof(path), "%s/%s", dir, name);
    f = fopen(path, "re");
    if (!f)
        return;
    if (fgets(out, SST_GRAB_NAME_MAX, f))
        out[strcspn(out, "\n")] = 0;
    fclose(f);
}

/* ".../1-2/1-2.3/1-2.3:1.0" is the interface of a USB device; its folder's parent is the device. */
static void node_from_sysfs(struct grab_node *node, int number)
{
    char link[64], dir[PATH_MAX];
    char *slash;

    *node = (struct grab_node){ .number = number, .capture = -1 };
    snprintf(node->device.node, sizeof(node->device.node), "/dev/video%d", number);
    snprintf(link, sizeof(link), "/sys/class/video4linux/video%d", number);
    read_attribute(node->device.name, link, "name");
    snprintf(link, sizeof(link), "/sys/class/video4linux/video%d/device", number);
    if (!realpath(link, dir) || !(slash = strrchr(dir, '/')) || !strchr(slash, ':'))
        return;
    *slash = 0;
    slash = strrchr(dir, '/');
    copy(node->device.port, slash ? slash + 1 : "");
    read_attribute(node->device.serial, dir, "serial");
}

int grab_scan(struct grab_node **nodes, int *count)
{
    struct node_list list;
    struct dirent *entry;
    int err = list_init(&list);
    DIR *dev;

    if (err)
        return err;
    dev = opendir("/dev");
    if (!dev) {
        err = -errno;
        sst_log_error("cannot list cameras: /dev: %s", strerror(-err));
        free(list.node);
        return err;
    }
    while ((entry = readdir(dev)) && list.count < SST_GRAB_NODES_MAX) {
        if (!strncmp(entry->d_name, "video", 5) && node_number(entry->d_name) >= 0)
            node_from_sysfs(&list.node[list.count++], node_number(entry->d_name));
    }
    closedir(dev);
    list_sort(&list);
    *nodes = list.node;
    *count = list.count;
    return 0;
}

int grab_monitor_open(struct grab_monitor **out)
{
    *out = NULL;
    return 0;
}

int grab_monitor_fd(const struct grab_monitor *watch SST_UNUSED)
{
    return -1;
}

int grab_monitor_next(struct grab_monitor *watch SST_UNUSED, struct grab_node *node SST_UNUSED)
{
    return 0;
}

void grab_monitor_close(struct grab_monitor *watch SST_UNUSED)
{
}

#endif

/* --- list of devices ---------------------------------------------------------------------------------------------- */

struct probe {
    struct grab_job job;
    int index;
    struct grab_node node;
};

struct probe_result {
    struct grab_node *nodes;
    int running;
};

static void probe_run(struct grab_job *job)
{
    struct v4l2_requestbuffers none = { .memory = V4L2_MEMORY_MMAP };
    struct sst_grab_device *d = &((struct probe *)job)->node.device;
    const int fd = probe_node(&((struct probe *)job)->node);

    if (fd < 0)
        return;
    format_summary(fd, d);
    none.type = node_type(fd);
    d->busy = node_ioctl(fd, VIDIOC_REQBUFS, &none) == -EBUSY;
    close(fd);
}

static void probe_ended(struct grab_job *job, void *owner)
{
    struct probe *p = (struct probe *)job;
    struct probe_result *result = owner;

    result->nodes[p->index] = p->node;
    result->running--;
    free(p);
}

static void probe_discard(struct grab_job *job)
{
    free(job);
}

/* Query all nodes in parallel, each on its own thread: a hanging one delays the others by at most PROBE_MS. Time in
 * which this process itself was stopped, perhaps with the whole machine, counts little. */
static int probe_all(struct grab_node *nodes, int count)
{
    int64_t left_ns = PROBE_MS * INT64_C(1000000);
    struct probe_result result = { nodes, 0 };
    struct jobs *jobs;
    int err = jobs_create(&jobs);

    if (err)
        return err;
    for (int i = 0; !err && i < count; i++) {
        struct probe *p = calloc(1, sizeof(*p));

        err = p ? 0 : -ENOMEM;
        if (err)
            break;
        *p = (struct probe){ { .run = probe_run, .ended = probe_ended, .discard = probe_discard }, i, nodes[i] };
        nodes[i].device.error = ETIMEDOUT;
        err = jobs_start(jobs, &p->job);
        if (err)
            free(p);
        else
            result.running++;
    }
    while (!err && result.running && left_ns > 0) {
        const int64_t begin_ns = sst_clock_now_ns();
        int64_t took_ns;

        jobs_wait(jobs, SLICE_MS);
        jobs_collect(jobs, &result);
        took_ns = sst_clock_now_ns() - begin_ns;
        left_ns -= took_ns < SLICE_MS * INT64_C(1000000) ? took_ns : SLICE_MS * INT64_C(1000000);
    }
    jobs_destroy(jobs);
    return err;
}

/* Number the capture nodes of each port. */
static void number_nodes(struct sst_grab_device *list, int n)
{
    for (int i = 0; i < n; i++)
        list[i].nth = i && !strcmp(list[i].port, list[i - 1].port) ? list[i - 1].nth + 1 : 1;
}

int sst_grab_list_all(struct sst_grab_device **devices, int *count, int *all)
{
    struct grab_node *nodes = NULL;
    struct sst_grab_device *list;
    int found = 0, n = 0, err = grab_scan(&nodes, &found);

    if (err)
        return err;
    list = calloc((size_t)found + 1, sizeof(*list));
    err = list ? probe_all(nodes, found) : -ENOMEM;
    if (err) {
        sst_log_error("cannot list cameras: %s", strerror(-err));
        free(nodes);
        free(list);
        return err;
    }
    for (int i = 0; i < found; i++)
        if (nodes[i].capture)
            list[n++] = nodes[i].device;
    *count = n;
    for (int i = 0; i < found; i++)
        if (!nodes[i].capture) {
            list[n] = nodes[i].device;
            if (!*list[n].left_out) /* not opened */
                snprintf(list[n].left_out, sizeof(list[n].left_out), "it captures no pictures");
            n++;
        }
    *all = n;
    number_nodes(list, *count);
    free(nodes);
    *devices = list;
    return 0;
}

int sst_grab_list(struct sst_grab_device **devices, int *count)
{
    int all;

    return sst_grab_list_all(devices, count, &all);
}

/* True if the node offers the format, or could not be asked. */
static bool offers(const struct sst_grab_device *d, uint32_t fourcc)
{
    for (int i = 0; i < SST_GRAB_FOURCC_MAX && d->fourcc[i]; i++)
        if (format_fits(d->fourcc[i], fourcc))
            return true;
    return !d->fourcc[0];
}

int sst_grab_select(struct sst_grab_device *devices, int count, uint32_t fourcc)
{
    const struct sst_grab_device *last = NULL;
    char name[5];
    bool any = false;
    int kept = 0;

    fourcc_name(name, fourcc);
    for (int i = 0; i < count; i++)
        any = any || offers(&devices[i], fourcc);
    for (int i = 0; i < count; i++) {
        struct sst_grab_device d = devices[i];

        if (any && !offers(&d, fourcc))
            snprintf(d.left_out, sizeof(d.left_out), "it offers no %s", name);
        else if (last && !strcmp(last->port, d.port))
            snprintf(d.left_out, sizeof(d.left_out), "%.40s is of the same device", last->node);
        if (*d.left_out) {
            devices[i] = d;
            continue;
        }
        memmove(&devices[kept + 1], &devices[kept], (size_t)(i - kept) * sizeof(d));
        devices[kept] = d;
        last = &devices[kept++];
    }
    return kept;
}
