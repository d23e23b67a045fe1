/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/usb/usb_internal.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/mem.h"

#define DESCRIPTORS_MAX 65536
#define VENDOR_INTEL    0x8086

/* @return bytes read, up to size, or -errno */
static int read_bytes(void *data, size_t size, const char *folder, const char *attribute)
{
    char path[SST_PATH_MAX];
    size_t used = 0;
    int fd, err = sst_path_join(path, folder, attribute);

    if (err)
        return err;
    fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return -errno;
    while (used < size) {
        const ssize_t n = read(fd, (char *)data + used, size - used);

        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            err = -errno;
        if (n <= 0)
            break;
        used += (size_t)n;
    }
    close(fd);
    return err ? err : (int)used;
}

/* First line of an attribute. @return its length, or -errno; not logged */
static int read_text(char *text, size_t size, const char *folder, const char *attribute)
{
    const int n = read_bytes(text, size - 1, folder, attribute);

    if (n < 0)
        return n;
    text[n] = 0;
    text[strcspn(text, "\n")] = 0;
    return (int)strlen(text);
}

int sysfs_int(const char *folder, const char *attribute, int base, int missing)
{
    char text[32], *end;
    long v;

    if (read_text(text, sizeof(text), folder, attribute) <= 0)
        return missing;
    v = strtol(text, &end, base);
    return end == text ? missing : (int)v;
}

/* --- port names --------------------------------------------------------------------------------------------------- */

/* The numbers of a port path, "1-2.13" or "usb1": the bus first; for a root hub only the bus. */
static int numbers(int out[16], const char *port)
{
    int n = 0;

    if (!strncmp(port, "usb", 3))
        port += 3;
    while (n < 16 && isdigit((unsigned char)*port)) {
        char *end;

        out[n++] = (int)strtol(port, &end, 10);
        port = *end == (n == 1 ? '-' : '.') ? end + 1 : end;
    }
    return *port ? 0 : n;
}

int usb_compare_ports(const char *a, const char *b)
{
    int x[16], y[16];
    const int m = numbers(x, a), n = numbers(y, b);

    if (!m || !n)
        return m != n ? n - m : strcmp(a, b); /* other names sort last */
    for (int i = 0; i < m && i < n; i++) {
        if (x[i] != y[i])
            return x[i] < y[i] ? -1 : 1;
    }
    return (m > n) - (m < n);
}

int usb_split_port(const char *port, char hub[SST_USB_TEXT_MAX], int *number)
{
    int part[16];
    const int n = numbers(part, port);
    const char *last = strrchr(port, '.');

    if (n < 2 || strlen(port) >= SST_USB_TEXT_MAX)
        return -EINVAL;
    if (last)
        snprintf(hub, SST_USB_TEXT_MAX, "%.*s", (int)(last - port), port);
    else
        snprintf(hub, SST_USB_TEXT_MAX, "usb%d", part[0]);
    *number = part[n - 1];
    return 0;
}

/* --- devices ------------------------------------------------------------------------------------------------------ */

/* The entry of a root hub is a link, ".../0000:00:14.0/usb1": its parent is the controller, with the vendor of a PCI
 * device. */
static void read_controller(struct sst_usb_device *d, const char *devices, const char *folder)
{
    char link[SST_PATH_MAX], real[SST_PATH_MAX], *slash;
    const ssize_t n = readlink(folder, link, sizeof(link) - 1);

    if (n < 0)
        return;
    link[n] = 0;
    slash = strrchr(link, '/');
    if (!slash)
        return;
    *slash = 0;
    snprintf(d->controller, sizeof(d->controller), "%.63s", sst_path_base(link));
    if (!sst_path_join(real, devices, link))
        d->port_buses = sysfs_int(real, "vendor", 16, 0) == VENDOR_INTEL && strstr(d->maker, "xhci");
}

static void read_descriptors(struct sst_usb_device *d, const char *folder)
{
    uint8_t *data = malloc(DESCRIPTORS_MAX);
    const int n = data ? read_bytes(data, DESCRIPTORS_MAX, folder, "descriptors") : -ENOMEM;

    if (n > 0)
        d->alts = usb_parse_alts(d->alt, data, (size_t)n, d->speed_mbit);
    d->still = n > 0 && usb_has_ptp(data, (size_t)n);
    free(data);
}

static int read_device(struct sst_usb_device *d, const char *devices, const char *name)
{
    char folder[SST_PATH_MAX];

    memset(d, 0, sizeof(*d));
    if (sst_path_join(folder, devices, name) || sysfs_int(folder, "busnum", 10, -1) < 0)
        return -ENODEV; /* disconnected meanwhile */
    snprintf(d->port, sizeof(d->port), "%.63s", name);
    d->bus = sysfs_int(folder, "busnum", 10, 0);
    d->address = sysfs_int(folder, "devnum", 10, 0);
    d->speed_mbit = sysfs_int(folder, "speed", 10, 0);
    d->hub = sysfs_int(folder, "bDeviceClass", 16, 0) == 9;
    d->hub_ports = sysfs_int(folder, "maxchild", 10, 0);
    d->single_tt = d->hub && sysfs_int(folder, "bDeviceProtocol", 16, 0) == 1;
    d->vendor = sysfs_int(folder, "idVendor", 16, 0);
    d->product = sysfs_int(folder, "idProduct", 16, 0);
    if (read_text(d->maker, sizeof(d->maker), folder, "manufacturer") < 0)
        d->maker[0] = 0;
    if (read_text(d->name, sizeof(d->name), folder, "product") < 0)
        d->name[0] = 0;
    if (read_text(d->serial, sizeof(d->serial), folder, "serial") < 0)
        d->serial[0] = 0;
    if (!strncmp(name, "usb", 3))
        read_controller(d, devices, folder);
    else
        read_descriptors(d, folder);
    return 0;
}

/* The capture node in the video4linux folder of an interface: index 0; the others carry metadata. */
static void read_node(struct sst_usb_device *d, const char *devices, const char *interface)
{
    char folder[SST_PATH_MAX], path[SST_PATH_MAX], node[SST_PATH_MAX];
    struct dirent *entry;
    DIR *dir;

    if (d->node[0] || sst_path_join(folder, devices, interface) || sst_path_join(path, folder, "video4linux"))
        return;
    dir = opendir(path);
    while (dir && (entry = readdir(dir))) {
        if (strncmp(entry->d_name, "video", 5) || sst_path_join(node, path, entry->d_name) ||
            sysfs_int(node, "index", 10, 0) != 0)
            continue;
        snprintf(d->node, sizeof(d->node), "/dev/%.50s", entry->d_name);
    }
    if (dir)
        closedir(dir);
}

static int find(const struct sst_usb_device *list, int n, const char *port)
{
    for (int i = 0; i < n; i++) {
        if (!strcmp(list[i].port, port))
            return i;
    }
    return -1;
}

static int by_port(const void *a, const void *b)
{
    return usb_compare_ports(((const struct sst_usb_device *)a)->port, ((const struct sst_usb_device *)b)->port);
}

static void link_parents(struct sst_usb_device *list, int n)
{
    for (int i = 0; i < n; i++) {
        struct sst_usb_device *d = &list[i];
        char hub[SST_USB_TEXT_MAX];
        int number;

        d->parent = usb_split_port(d->port, hub, &number) ? -1 : find(list, i, hub);
        if (d->parent < 0)
            continue;
        memcpy(d->controller, list[d->parent].controller, sizeof(d->controller));
        d->port_buses = list[d->parent].port_buses;
    }
}

/* Names with ':' are interfaces ("1-2:1.0"), which are only read for their nodes. */
static int read_all(struct sst_usb_device **list, DIR *dir, const char *devices, bool interfaces, int n)
{
    struct dirent *entry;
    int capacity = n;

    rewinddir(dir);
    while ((entry = readdir(dir))) {
        const char *colon = strchr(entry->d_name, ':');
        char port[SST_USB_TEXT_MAX];

        if (entry->d_name[0] == '.' || strlen(entry->d_name) >= SST_USB_TEXT_MAX || interfaces != (colon != NULL))
            continue;
        if (interfaces) {
            snprintf(port, sizeof(port), "%.*s", (int)(colon - entry->d_name), entry->d_name);
            const int i = find(*list, n, port);

            if (i >= 0)
                read_node(&(*list)[i], devices, entry->d_name);
            continue;
        }
        if (!sst_mem_grow(list, n, &capacity, sizeof(**list))) {
            sst_log_error("listing USB devices: out of memory");
            return -ENOMEM;
        }
        n += !read_device(&(*list)[n], devices, entry->d_name);
    }
    return n;
}

int usb_scan(struct sst_usb_device **out, int *count, const char *root)
{
    struct sst_usb_device *list = NULL;
    char devices[SST_PATH_MAX];
    DIR *dir;
    int n, err = sst_path_join(devices, root, "bus/usb/devices");

    if (err)
        return err;
    dir = opendir(devices);
    if (!dir && errno != ENOENT) {
        err = -errno;
        sst_log_error("%s: %s", devices, strerror(-err));
        return err;
    }
    n = dir ? read_all(&list, dir, devices, false, 0) : 0;
    if (n > 0) {
        qsort(list, (size_t)n, sizeof(*list), by_port);
        link_parents(list, n);
        n = read_all(&list, dir, devices, true, n);
    }
    if (dir)
        closedir(dir);
    if (n < 0) {
        free(list);
        return n;
    }
    *out = list;
    *count = n;
    return 0;
}

int sst_usb_list(struct sst_usb_device **devices, int *count)
{
    return usb_scan(devices, count, "/sys");
}
