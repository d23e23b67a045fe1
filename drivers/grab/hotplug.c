/* Nodes that appear and disappear, and their assignment to cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/grab/grab_internal.h"

/* While a camera is missing, nodes are scanned periodically, since events do get lost; without libudev there are none. */
#define RESCAN_NS                (5000 * SST_MS)
#define RESCAN_WITHOUT_EVENTS_NS (1000 * SST_MS)

static struct grab_camera *camera_of(struct sst_grab *g, int number)
{
    for (int i = 0; i < g->cfg.cameras; i++) {
        if (g->camera[i].number == number)
            return &g->camera[i];
    }
    return NULL;
}

static int node_index(const struct sst_grab *g, int number)
{
    for (int i = 0; i < g->node_count; i++) {
        if (g->nodes[i].number == number)
            return i;
    }
    return -1;
}

static void remove_node(struct sst_grab *g, int number)
{
    const int i = node_index(g, number);

    if (i >= 0)
        memmove(&g->nodes[i], &g->nodes[i + 1], (size_t)(--g->node_count - i) * sizeof(*g->nodes));
}

static void add_node(struct sst_grab *g, const struct grab_node *node)
{
    remove_node(g, node->number);
    if (g->node_count == SST_GRAB_NODES_MAX)
        return;
    g->nodes[g->node_count++] = *node;
    qsort(g->nodes, (size_t)g->node_count, sizeof(*g->nodes), grab_node_order);
}

void hotplug_reject(struct sst_grab *g, int number, bool gone)
{
    const int i = node_index(g, number);

    if (gone)
        remove_node(g, number);
    else if (i >= 0)
        g->nodes[i].capture = 0;
}

/* Log a mismatch of a camera's identity, once. */
static void log_mismatch(struct grab_camera *cam, const char *why, bool fault)
{
    if (!strcmp(cam->odd, why))
        return;
    memcpy(cam->odd, why, sizeof(cam->odd));
    if (*why && fault)
        sst_log_error("%s: %s", cam->name, why);
    else if (*why)
        sst_log_warning("%s: %s", cam->name, why);
}

const struct grab_node *hotplug_sibling(struct sst_grab *g, const struct grab_camera *cam, bool *more)
{
    const int at = node_index(g, cam->number);
    const struct grab_node *next = NULL;

    *more = false;
    if (at < 0 || cam->binding.node)
        return NULL;
    g->nodes[at].unfit = true;
    for (int i = 0; i < g->node_count; i++) {
        const struct grab_node *node = &g->nodes[i];

        if (i == at || !node->capture || strcmp(node->device.port, g->nodes[at].device.port) != 0 ||
            camera_of(g, node->number))
            continue;
        *more = true;
        if (!node->unfit && !next)
            next = node;
    }
    for (int i = 0; i < g->node_count && !next; i++) /* all were tried: from the first again next time */
        if (!strcmp(g->nodes[i].device.port, g->nodes[at].device.port))
            g->nodes[i].unfit = false;
    return next;
}

int hotplug_assign(struct sst_grab *g)
{
    int worst = 0;

    for (int i = 0; i < g->cfg.cameras; i++) {
        struct grab_camera *cam = &g->camera[i];
        char why[SST_WHY_MAX];
        int at;

        /* Also for streaming cameras: a second device with their serial is reported when it is plugged in. */
        at = grab_match(&cam->binding, g->nodes, g->node_count, why);
        log_mismatch(cam, why, at == -ENOTUNIQ);
        if (at == -ENOTUNIQ)
            worst = at;
        if (cam->number >= 0)
            continue;
        if (at >= 0 && camera_of(g, g->nodes[at].number)) /* another binding names the same device by port */
            continue;
        if (at >= 0)
            recovery_found(g, cam, &g->nodes[at]);
    }
    return worst;
}

void hotplug_events(struct sst_grab *g)
{
    struct grab_node node;
    bool added = false;
    int what;

    while ((what = grab_monitor_next(g->watch, &node)) > 0) {
        struct grab_camera *cam = camera_of(g, node.number);

        g->changes++;
        added |= what == 1;
        /* The number of an added node was free: its earlier device is gone, even if its event was lost. */
        if (cam)
            recovery_lost(g, cam);
        if (what == 1)
            add_node(g, &node);
        else
            remove_node(g, node.number);
    }
    if (what == -ENOBUFS) {
        sst_log_warning("hotplug events of cameras were lost; scanning again");
        g->scan_ns = sst_clock_now_ns();
    }
    if (added)
        (void)hotplug_assign(g);
}

/* --- scanning ----------------------------------------------------------------------------------------------------- */

static void apply_scan(struct sst_grab *g, const struct grab_node *nodes, int count)
{
    for (int i = 0; i < g->cfg.cameras; i++) {
        struct grab_camera *cam = &g->camera[i];
        bool there = false;

        for (int k = 0; k < count; k++)
            there |= nodes[k].number == cam->number && !strcmp(nodes[k].device.port, cam->device.port);
        if (cam->number >= 0 && !there)
            recovery_lost(g, cam);
    }
    memcpy(g->nodes, nodes, (size_t)count * sizeof(*nodes));
    g->node_count = count;
}

int hotplug_scan(struct sst_grab *g)
{
    struct grab_node *nodes;
    int count, err = grab_scan(&nodes, &count);

    if (err)
        return err;
    apply_scan(g, nodes, count);
    free(nodes);
    return 0;
}

struct scan_job {
    struct grab_job job;
    struct grab_node *nodes;
    int count, err;
    unsigned changes; /* at its start */
};

static void scan_run(struct grab_job *job)
{
    struct scan_job *s = (struct scan_job *)job;

    s->err = grab_scan(&s->nodes, &s->count);
}

static void scan_discard(struct grab_job *job)
{
    free(((struct scan_job *)job)->nodes);
    free(job);
}

static void scan_ended(struct grab_job *job, void *owner)
{
    struct scan_job *s = (struct scan_job *)job;
    struct sst_grab *g = owner;

    g->scanning = false;
    /* Events that arrived meanwhile are more recent. */
    if (!s->err && !g->closing && s->changes == g->changes) {
        apply_scan(g, s->nodes, s->count);
        (void)hotplug_assign(g);
    }
    scan_discard(job);
}

static bool any_missing(const struct sst_grab *g)
{
    for (int i = 0; i < g->cfg.cameras; i++) {
        if (g->camera[i].number < 0)
            return true;
    }
    return false;
}

int64_t hotplug_due(const struct sst_grab *g)
{
    return g->scanning || !any_missing(g) ? 0 : g->scan_ns;
}

void hotplug_time(struct sst_grab *g, int64_t now_ns)
{
    struct scan_job *s;

    if (g->scanning || now_ns < g->scan_ns)
        return;
    g->scan_ns = now_ns + (g->watch ? RESCAN_NS : RESCAN_WITHOUT_EVENTS_NS);
    if (!any_missing(g))
        return;
    s = calloc(1, sizeof(*s));
    if (!s)
        return;
    *s = (struct scan_job){ .job = { .run = scan_run, .ended = scan_ended, .discard = scan_discard },
                            .changes = g->changes };
    g->scanning = !jobs_start(g->jobs, &s->job);
    if (!g->scanning)
        free(s);
}
