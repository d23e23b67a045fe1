/* Discovery of video nodes in a build without libudev, by /dev/video* and sysfs; there are no hotplug events. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"

/* First line of a small file in a folder of sysfs; "" if it cannot be read. */
static void read_attribute(char out[SST_GRAB_NAME_MAX], const char *dir, const char *name)
{
    char path[PATH_MAX + 32];

    snprintf(path, sizeof(path), "%s/%s", dir, name);
    (void)sst_file_line(out, SST_GRAB_NAME_MAX, path);
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
    snprintf(node->device.port, sizeof(node->device.port), "%.*s", SST_GRAB_NAME_MAX - 1, slash ? slash + 1 : "");
    read_attribute(node->device.serial, dir, "serial");
}

int grab_list(struct grab_node *nodes)
{
    DIR *dev = opendir("/dev");
    struct dirent *entry;
    int count = 0;

    if (!dev) {
        const int err = -errno;

        sst_log_error("cannot list cameras: /dev: %s", strerror(-err));
        return err;
    }
    while ((entry = readdir(dev)) && count < SST_GRAB_NODES_MAX) {
        if (grab_node_number(entry->d_name) >= 0)
            node_from_sysfs(&nodes[count++], grab_node_number(entry->d_name));
    }
    closedir(dev);
    return count;
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
