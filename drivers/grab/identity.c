/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* strverscmp */
#include "drivers/grab/grab_internal.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

int grab_node_order(const void *pa, const void *pb)
{
    const struct grab_node *a = pa, *b = pb;
    const int order = strverscmp(a->device.port, b->device.port);

    return order ? order : (a->number > b->number) - (a->number < b->number);
}

bool grab_is_usb_port(const char *port)
{
    return isdigit((unsigned char)*port) && strchr(port, '-') && !port[strspn(port, "0123456789-.")];
}

/* Which of the capture nodes of its port it is, from 1; nodes are in the order of ports. */
static int nth_of(const struct grab_node *nodes, int i)
{
    int nth = 1;

    for (int k = i - 1; k >= 0 && !strcmp(nodes[k].device.port, nodes[i].device.port); k--)
        nth += nodes[k].capture != 0;
    return nth;
}

/* A node; NULL, 0: any. */
struct wanted {
    const char *serial, *port;
    int nth;
};

static int find(const struct grab_node *nodes, int count, int from, struct wanted w)
{
    for (int i = from; i < count; i++) {
        if (nodes[i].capture && (!w.serial || !strcmp(nodes[i].device.serial, w.serial)) &&
            (!w.port || !strcmp(nodes[i].device.port, w.port)) && (!w.nth || nth_of(nodes, i) == w.nth))
            return i;
    }
    return -ENODEV;
}

static const char *serial_of(const struct grab_node *node)
{
    return *node->device.serial ? node->device.serial : "none";
}

int grab_match(const struct sst_grab_binding *b, const struct grab_node *nodes, int count, char *why)
{
    const int at_port = *b->port ? find(nodes, count, 0, (struct wanted){ NULL, b->port, b->node }) : -ENODEV;
    int first;

    *why = 0;
    if (!*b->serial)
        return at_port;
    first = find(nodes, count, 0, (struct wanted){ b->serial, NULL, b->node });
    for (int i = first; i >= 0; i = find(nodes, count, i + 1, (struct wanted){ b->serial, NULL, b->node })) {
        if (!strcmp(nodes[i].device.port, nodes[first].device.port))
            continue;
        snprintf(why, SST_WHY_MAX, "serial %s is claimed by two devices, at port %s and at port %s; bind both by port",
                 b->serial, nodes[first].device.port, nodes[i].device.port);
        return -ENOTUNIQ;
    }
    if (!*b->port)
        return first;
    if (first < 0 && at_port >= 0)
        snprintf(why, SST_WHY_MAX,
                 "serial %s is not connected, and port %s has serial %s instead; plug the cameras as they are bound, "
                 "or change the binding",
                 b->serial, b->port, serial_of(&nodes[at_port]));
    else if (first >= 0 && strcmp(nodes[first].device.port, b->port) != 0)
        snprintf(why, SST_WHY_MAX,
                 "serial %s is at port %s and not at its port %s, which has %s%s; cameras were swapped: plug them back "
                 "or change the binding",
                 b->serial, nodes[first].device.port, b->port, at_port >= 0 ? "serial " : "nothing",
                 at_port >= 0 ? serial_of(&nodes[at_port]) : "");
    return first;
}
