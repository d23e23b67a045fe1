/* Open files of the programs: socket pairs, their names, their closing. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "simulators/devices/server/server_internal.h"

#define SLOT_BITS 14 /* SST_SIM_HANDLES_MAX */

struct sim_open_file *sim_file_find(struct sim_server *s, uint32_t id)
{
    const uint32_t slot = id & (SST_SIM_HANDLES_MAX - 1);
    struct sim_open_file *f = slot < (uint32_t)s->file_slots ? s->files[slot] : NULL;

    return f && f->handle.id == id ? f : NULL;
}

static void hung_up(struct sim_server *s SST_UNUSED, struct sim_source *source, uint32_t events SST_UNUSED)
{
    struct sim_open_file *f = (struct sim_open_file *)source;

    if (!f->dead)
        sim_handle_drop(&f->handle);
}

static int free_slot(struct sim_server *s)
{
    struct sim_open_file **files;
    int slot = 0, slots;

    while (slot < s->file_slots && s->files[slot])
        slot++;
    if (slot < s->file_slots)
        return slot;
    slots = s->file_slots ? 2 * s->file_slots : 64;
    if (slots > SST_SIM_HANDLES_MAX)
        return -ENFILE;
    files = realloc(s->files, (size_t)slots * sizeof(*files));
    if (!files)
        return -ENOMEM;
    memset(files + s->file_slots, 0, (size_t)(slots - s->file_slots) * sizeof(*files));
    s->files = files;
    s->file_slots = slots;
    return slot;
}

static int make_pair(const struct sim_ops *ops, uint32_t id, int pair[2])
{
    struct sockaddr_un name = { .sun_family = AF_UNIX };
    const int n = snprintf(name.sun_path + 1, sizeof(name.sun_path) - 1, SST_SIM_NAME "%c/%u", ops->letter, id);
    int err = 0;

    if (socketpair(AF_UNIX, (ops->packets ? SOCK_SEQPACKET : SOCK_STREAM) | SOCK_CLOEXEC, 0, pair) < 0)
        return -errno;
    /* An unread byte turns the close of our end into an error at the other end: POLLERR besides POLLHUP. */
    if (bind(pair[1], (const struct sockaddr *)&name, (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + n)) <
            0 ||
        write(pair[1], "", 1) != 1)
        err = -errno;
    if (err) {
        close(pair[0]);
        close(pair[1]);
    }
    return err;
}

int sim_handle_create(struct sim_server *s, const struct sim_ops *ops, void *device, struct sim_handle **handle,
                      int *client_fd)
{
    const int slot = free_slot(s);
    struct sim_open_file *f;
    int pair[2], err;
    uint32_t id;

    if (slot < 0)
        return slot;
    f = calloc(1, sizeof(*f));
    if (!f)
        return -ENOMEM;
    /* The name of a dropped file stays in use as long as the program holds it. */
    do {
        id = (uint32_t)slot | ++s->generation << SLOT_BITS;
        err = make_pair(ops, id, pair);
    } while (err == -EADDRINUSE);
    if (err) {
        free(f);
        return err;
    }
    f->source.ready = hung_up;
    f->handle = (struct sim_handle){ .server = s, .ops = ops, .device = device, .id = id, .fd = pair[0] };
    err = sim_source_add(s->hangups, pair[0], EPOLLRDHUP, &f->source);
    if (err) {
        close(pair[0]);
        close(pair[1]);
        free(f);
        return err;
    }
    s->files[slot] = f;
    *handle = &f->handle;
    *client_fd = pair[1];
    return 0;
}

uint64_t sim_file_device(const struct sim_open_file *f)
{
    return f->node ? (uint64_t)f->node->dev_major << 32 | f->node->dev_minor : 0;
}

static struct sim_open_file *file_of(struct sim_handle *h)
{
    return (struct sim_open_file *)((char *)h - offsetof(struct sim_open_file, handle));
}

void sim_handle_drop(struct sim_handle *h)
{
    struct sim_server *s = h->server;
    struct sim_open_file *f = file_of(h);

    s->files[h->id & (SST_SIM_HANDLES_MAX - 1)] = NULL;
    f->dead = true;
    sim_requests_fail(s, h, -ENODEV);
    if (h->ops->close)
        h->ops->close(h);
    close(h->fd);
    f->next_dead = s->dead_files;
    s->dead_files = f;
}

void sim_files_free_dead(struct sim_server *s)
{
    while (s->dead_files) {
        struct sim_open_file *f = s->dead_files;

        s->dead_files = f->next_dead;
        free(f);
    }
}

void sim_files_drop(struct sim_server *s, const struct sim_node *node)
{
    for (int i = 0; i < s->file_slots; i++)
        if (s->files[i] && (!node || s->files[i]->node == node))
            sim_handle_drop(&s->files[i]->handle);
}

bool sim_handle_settle(struct sim_handle *h)
{
    struct pollfd p = { .fd = h->fd, .events = POLLRDHUP };

    if (poll(&p, 1, 0) != 1)
        return false;
    sim_handle_drop(h);
    return true;
}

/* A program that closes a file and opens it again must find it closed. */
static void settle_node(struct sim_server *s, const struct sim_node *node)
{
    for (int i = 0; i < s->file_slots; i++)
        if (s->files[i] && s->files[i]->node == node)
            (void)sim_handle_settle(&s->files[i]->handle);
}

int sim_file_open(struct sim_server *s, struct sim_request *r)
{
    struct sim_node *node;
    struct sim_handle *h;
    int err, fd;

    r->data[sst_min_int((int)r->bytes, SST_SIM_PAYLOAD_MAX - 1)] = 0;
    node = sim_node_find(s, (const char *)r->data);
    if (!node)
        return -ENXIO;
    settle_node(s, node);
    err = sim_handle_create(s, node->ops, node->device, &h, &fd);
    if (err)
        return err;
    file_of(h)->node = node;
    h->open_flags = (int)r->call.cmd;
    if ((h->open_flags & O_NONBLOCK) && fcntl(fd, F_SETFL, O_NONBLOCK) < 0)
        err = -errno;
    r->out_fd = fd;
    r->out_fd_close = true;
    r->handle = h;
    if (!err && node->ops->open)
        err = node->ops->open(h, r);
    if (err < 0) {
        r->handle = NULL;
        r->out_fd = -1;
        close(fd);
        /* was never open: the device gets no close() */
        h->ops = &(const struct sim_ops){ .letter = node->ops->letter };
        sim_handle_drop(h);
    }
    return err;
}

int sim_handle_readable(struct sim_handle *h, const void *data, size_t bytes)
{
    const ssize_t n = send(h->fd, data, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);

    return n < 0 ? -errno : n == (ssize_t)bytes ? 0 : -EAGAIN;
}

void sim_handle_urgent(struct sim_handle *h)
{
    /* Only one at a time: a second one would turn the first into normal data. */
    if (!h->urgent && send(h->fd, "", 1, MSG_OOB | MSG_DONTWAIT | MSG_NOSIGNAL) == 1)
        h->urgent = true;
}
