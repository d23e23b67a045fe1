/* The list of devices, each of which is opened. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"

/* A node that does not respond within this time is listed with ETIMEDOUT. */
#define PROBE_MS 2000
#define SLICE_MS 100

/* Open a node to see whether it captures pictures. @return descriptor or -errno, also in its `error` */
static int probe_node(struct grab_node *node)
{
    const int fd = node_open(&node->device);

    node->device.error = fd < 0 ? -fd : 0;
    node->capture = fd >= 0 ? 1 : fd == -ENOTTY ? 0 : node->capture;
    return fd;
}

int grab_node_number(const char *name)
{
    char *end;
    long n;

    if (strncmp(name, "video", 5) != 0 || name[5] < '0' || name[5] > '9')
        return -1;
    n = strtol(name + 5, &end, 10);
    return *end || n > 65535 ? -1 : (int)n;
}

void grab_identify_off_usb(struct grab_node *node)
{
    const int fd = *node->device.port ? -1 : probe_node(node);

    if (fd >= 0)
        close(fd);
}

int grab_scan(struct grab_node **nodes, int *count)
{
    struct grab_node *list = calloc(SST_GRAB_NODES_MAX, sizeof(*list));
    int n;

    if (!list) {
        sst_log_error("no memory for a list of cameras");
        return -ENOMEM;
    }
    n = grab_list(list);
    if (n < 0) {
        free(list);
        return n;
    }
    for (int i = 0; i < n; i++)
        grab_identify_off_usb(&list[i]);
    qsort(list, (size_t)n, sizeof(*list), grab_node_order);
    *nodes = list;
    *count = n;
    return 0;
}

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
