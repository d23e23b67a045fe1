/* simulators/devices/uevent.c - device events: the kernel's, and udev's with its data about each device. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"

#define GROUP_KERNEL 1 /* netlink groups, bits */
#define GROUP_UDEV   2
#define QUEUE_MAX    4096
#define RETRY_NS     2000000

struct message {
    struct message *next;
    size_t bytes;
    uint8_t data[];
};

/** A program's netlink socket. */
struct sim_listener {
    struct sim_listener *next;
    struct sim_handle *handle;
    unsigned groups;
    struct message *first, **last; /* messages that did not fit into its socket yet */
    int queued;
};

/** Header of udev's messages. */
struct udev_header {
    char prefix[8];
    uint32_t magic, header_bytes, offset, bytes, filter[4]; /* the filter fields are only used by the kernel */
};

/* --- sending ------------------------------------------------------------------------------------------------------ */

/** Send queued messages in order while they fit. @return false: some are left */
static bool drain(struct sim_listener *l)
{
    while (l->first) {
        struct message *m = l->first;

        if (sim_handle_readable(l->handle, m->data, m->bytes) == -EAGAIN)
            return false;
        l->first = m->next;
        if (!l->first)
            l->last = &l->first;
        l->queued--;
        free(m);
    }
    return true;
}

static void retry(void *arg)
{
    struct sim_sysfs *fs = arg;
    bool left = false;

    for (struct sim_listener *l = fs->listeners; l; l = l->next)
        left = !drain(l) || left;
    if (left && sim_timer_set(fs->server, &fs->retry, sst_clock_now_ns() + RETRY_NS) < 0)
        sst_log_warning("device events are delayed: out of memory");
}

/** A program that does not read loses the newest messages, as with a full netlink socket. */
static void queue(struct sim_listener *l, const void *data, size_t bytes)
{
    struct message *m = l->queued < QUEUE_MAX ? malloc(sizeof(*m) + bytes) : NULL;

    if (!m)
        return;
    m->next = NULL;
    m->bytes = bytes;
    memcpy(m->data, data, bytes);
    *l->last = m;
    l->last = &m->next;
    l->queued++;
}

static void send_group(struct sim_sysfs *fs, unsigned group, const void *data, size_t bytes)
{
    for (struct sim_listener *l = fs->listeners; l; l = l->next)
        if (l->groups & group)
            queue(l, data, bytes);
}

/* --- building ----------------------------------------------------------------------------------------------------- */

void sim_props_add(struct sim_props *props, const char *fmt, ...)
{
    const size_t room = sizeof(props->text) - props->bytes;
    va_list args;
    int n;

    va_start(args, fmt);
    n = vsnprintf(props->text + props->bytes, room, fmt, args);
    va_end(args);
    if (n < 0 || (size_t)n + 1 >= room)
        return; /* dropped as a whole; cannot happen with valid properties */
    props->bytes += (size_t)n;
    props->text[props->bytes++] = '\n';
    props->text[props->bytes] = '\0';
}

/** Properties in message format: NUL after each. Lines with S: become one DEVLINKS. */
static size_t flatten(char *out, size_t size, size_t at, const struct sim_props *props)
{
    char links[1024] = "";

    for (const char *line = props->text; *line; line = strchr(line, '\n') + 1) {
        const int bytes = (int)(strchr(line, '\n') - line);

        if (strncmp(line, "S:", 2) == 0)
            sst_text_add(links, sizeof(links), "%s/dev/%.*s", links[0] ? " " : "", bytes - 2, line + 2);
        else if (at + (size_t)bytes + 1 < size)
            at += (size_t)snprintf(out + at, size - at, "%.*s", bytes, line) + 1;
    }
    if (links[0] && at + strlen(links) + 11 < size)
        at += (size_t)snprintf(out + at, size - at, "DEVLINKS=%s", links) + 1;
    return at;
}

/* Update udev's data about a device. udev NULL: remove it. */
static void udev_data(struct sim_sysfs *fs, const char *id, const struct sim_props *udev)
{
    struct sim_props data = { .bytes = 0 };

    if (!udev) {
        sim_sysfs_remove(fs, "/run/udev/data", id);
        return;
    }
    for (const char *line = udev->text; *line; line = strchr(line, '\n') + 1)
        sim_props_add(&data, "%s%.*s", strncmp(line, "S:", 2) == 0 ? "" : "E:", (int)(strchr(line, '\n') - line), line);
    sim_props_add(&data, "I:%lld", (long long)(sst_clock_now_ns() / 1000));
    sim_props_add(&data, "V:1");
    sim_sysfs_bytes(fs, "/run/udev/data", id, data.text, data.bytes);
}

void sim_uevent(struct sim_sysfs *fs, const char *action, const char *devpath, const struct sim_props *kernel,
                const char *id, const struct sim_props *udev)
{
    struct udev_header header = {
        .prefix = "libudev", .magic = htonl(0xfeedcafe), .header_bytes = sizeof(header), .offset = sizeof(header)
    };
    struct sim_props head = { .bytes = 0 };
    char text[sizeof(header) + 2 * sizeof(head.text)];
    size_t bytes;

    sim_props_add(&head, "ACTION=%s", action);
    sim_props_add(&head, "DEVPATH=%s", devpath);
    sim_props_add(&head, "SEQNUM=%llu", (unsigned long long)++fs->sequence);
    bytes = (size_t)snprintf(text, sizeof(text), "%s@%s", action, devpath) + 1;
    bytes = flatten(text, sizeof(text), bytes, &head);
    bytes = flatten(text, sizeof(text), bytes, kernel);
    send_group(fs, GROUP_KERNEL, text, bytes);

    if (udev && id && strcmp(action, "remove") != 0)
        udev_data(fs, id, udev);
    bytes = flatten(text, sizeof(text), sizeof(header), &head);
    bytes = flatten(text, sizeof(text), bytes, kernel);
    if (udev)
        bytes = flatten(text, sizeof(text), bytes, udev);
    header.bytes = (uint32_t)(bytes - sizeof(header));
    memcpy(text, &header, sizeof(header));
    send_group(fs, GROUP_UDEV, text, bytes);
    if (udev && id && strcmp(action, "remove") == 0)
        udev_data(fs, id, NULL);
    retry(fs);
}

/* --- listeners ---------------------------------------------------------------------------------------------------- */

static int listener_open(struct sim_handle *h, struct sim_request *r SST_UNUSED)
{
    struct sim_sysfs *fs = h->device;
    struct sim_listener *l = calloc(1, sizeof(*l));

    if (!l)
        return -ENOMEM;
    l->handle = h;
    l->last = &l->first;
    l->next = fs->listeners;
    fs->listeners = l;
    h->state = l;
    return 0;
}

/** bind(): the argument is the group mask. */
static int listener_bind(struct sim_handle *h, struct sim_request *r)
{
    struct sim_listener *l = h->state;

    l->groups = (unsigned)r->call.arg;
    return 0;
}

static void listener_close(struct sim_handle *h)
{
    struct sim_sysfs *fs = h->device;
    struct sim_listener *l = h->state;

    SST_LIST_REMOVE(fs->listeners, l);
    while (l->first) {
        struct message *m = l->first;

        l->first = m->next;
        free(m);
    }
    free(l);
}

int sim_events_open(struct sim_sysfs *fs)
{
    static const struct sim_ops ops = {
        .letter = 'n', .packets = true, .open = listener_open, .close = listener_close, .ioctl = listener_bind
    };

    fs->retry = (struct sim_timer){ .fire = retry, .arg = fs };
    return sim_node_add(fs->server, &fs->events, SST_SIM_UEVENTS, &(struct sim_device){ &ops, fs, 0, 0 });
}

void sim_events_close(struct sim_sysfs *fs)
{
    sim_node_remove(fs->server, fs->events);
    sim_timer_stop(fs->server, &fs->retry);
}
