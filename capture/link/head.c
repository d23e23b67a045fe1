/* Head as a source of frames: opening, and the calls of capture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/link/link_internal.h"

#define GAP_MOST                                                                                                       \
    64 /* triggers that no source reported in time are made up, so that late sets find their place */

/* --- source for capture ------------------------------------------------------------------------------------------- */

static int head_start(void *object, const struct sst_source_events *events)
{
    struct sst_link_head *h = object;

    h->events = *events;
    return 0;
}

static int head_fd(const void *object)
{
    return ((const struct sst_link_head *)object)->ready_fd;
}

static void report_states(struct sst_link_head *h)
{
    for (int i = 0; i < h->array.bound; i++) {
        struct head_slot *slot = &h->slot[i];
        char why[256];
        bool changed;

        pthread_mutex_lock(&h->lock);
        changed = slot->changed;
        slot->changed = false;
        slot->shown = slot->state;
        slot->shown_device = slot->device;
        memcpy(why, slot->why, sizeof(why));
        pthread_mutex_unlock(&h->lock);
        if (changed)
            h->events.state(h->events.arg, i, slot->shown, why);
    }
}

/* Report the trigger of a set, and earlier triggers that are not yet reported. */
static void report_trigger(struct sst_link_head *h, const struct head_set *set)
{
    const uint64_t index = set->place.index;
    uint64_t from = index;

    if (h->any && index <= h->last_index)
        return;
    if (h->any && index - h->last_index <= GAP_MOST)
        from = h->last_index + 1;
    for (uint64_t i = from; i < index; i++)
        h->events.trigger(h->events.arg, i, set->place.t_ns - (int64_t)(index - i) * h->period_ns, false);
    h->events.trigger(h->events.arg, index, set->place.t_ns, set->stamped);
    h->any = true;
    h->last_index = index;
}

static void head_release(void *object, struct sst_frame *frame)
{
    struct sst_link_head *h = object;
    struct head_set *set = frame->pool;

    pthread_mutex_lock(&h->lock);
    set->refs--;
    pthread_mutex_unlock(&h->lock);
}

static void report_set(struct sst_link_head *h, struct head_set *set)
{
    const int64_t now_ns = sst_clock_now_ns();

    report_trigger(h, set);
    for (int i = 0; i < set->cameras; i++) {
        struct sst_frame *f = &set->frame[i];
        struct head_slot *slot = &h->slot[set->slot[i]];

        if (f->data) {
            f->cam = set->slot[i];
            f->t_ns += set->place.t_ns;
            f->arrival_ns = now_ns;
            f->pool = set;
            slot->count.frames++;
            slot->count.lost += f->lost_before;
        }
        h->events.frame(h->events.arg, set->slot[i], set->place.index, f->data ? f : NULL);
    }
    pthread_mutex_lock(&h->lock);
    set->refs--;
    pthread_mutex_unlock(&h->lock);
}

static int head_poll(void *object)
{
    struct sst_link_head *h = object;
    eventfd_t woken;

    (void)eventfd_read(h->ready_fd, &woken);
    report_states(h);
    for (;;) {
        struct head_set *set = NULL;

        pthread_mutex_lock(&h->lock);
        if (h->ready_count) {
            set = h->ready[h->ready_first];
            h->ready_first = (h->ready_first + 1) % LINK_READY;
            h->ready_count--;
            h->source[set->source].peer.waiting -= (uint64_t)set->frames;
            h->source[set->source].peer.passed += (uint64_t)set->frames;
            set->refs = set->frames + 1;
        }
        pthread_mutex_unlock(&h->lock);
        if (!set)
            return 0;
        report_set(h, set);
    }
}

static enum sst_grab_state head_state(const void *object, int cam)
{
    return ((const struct sst_link_head *)object)->slot[cam].shown;
}

static const struct sst_grab_device *head_device(const void *object, int cam)
{
    return &((const struct sst_link_head *)object)->slot[cam].shown_device;
}

static void head_counters(const void *object, int cam, struct sst_grab_counters *out)
{
    *out = ((const struct sst_link_head *)object)->slot[cam].count;
}

static const struct sst_source_ops head_ops = {
    .start = head_start,
    .fd = head_fd,
    .poll = head_poll,
    .release = head_release,
    .state = head_state,
    .device = head_device,
    .counters = head_counters,
};

struct sst_source sst_link_head_source(struct sst_link_head *h)
{
    return (struct sst_source){ &head_ops, h };
}

/* --- for the status ----------------------------------------------------------------------------------------------- */

int sst_link_head_peers(struct sst_link_head *h, struct sst_link_peer *out)
{
    int n = 0;

    pthread_mutex_lock(&h->lock);
    for (int i = 0; i < LINK_NODES; i++) {
        struct sst_link_peer *p = &out[n];
        uint64_t known;

        if (!h->source[i].used)
            continue;
        n++;
        *p = h->source[i].peer;
        known = p->passed + p->missed + p->dropped + p->unnamed + p->waiting;
        p->unexplained = known > p->frames ? known - p->frames : p->frames - known;
        p->cameras = h->source[i].cameras;
        p->reported = json_deep_copy(p->reported);
        sst_numbering_state(h->numbering, i, &p->numbering);
    }
    pthread_mutex_unlock(&h->lock);
    return n;
}

uint64_t sst_link_head_overflows(struct sst_link_head *h)
{
    uint64_t n;

    pthread_mutex_lock(&h->lock);
    n = h->overflows;
    pthread_mutex_unlock(&h->lock);
    return n;
}

int sst_link_head_owner(struct sst_link_head *h, int view)
{
    int owner, index = 0;

    pthread_mutex_lock(&h->lock);
    owner = view >= 0 && view < h->array.bound ? h->slot[view].source : -1;
    for (int i = 0; i < owner; i++)
        index += h->source[i].used;
    pthread_mutex_unlock(&h->lock);
    return owner < 0 ? -1 : index;
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

static int listen_for_nodes(struct sst_link_head *h)
{
    const char *address = h->array.hosts.address;
    const int port = h->array.hosts.port, on = 1;
    struct sockaddr_storage at;
    unsigned bytes;
    int err = link_address(address, port, &at, &bytes);

    if (err)
        return err;
    h->listen_fd = socket(at.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (h->listen_fd < 0 || setsockopt(h->listen_fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) < 0 ||
        bind(h->listen_fd, (const struct sockaddr *)&at, bytes) < 0 || listen(h->listen_fd, SOMAXCONN) < 0) {
        err = -errno;
        sst_log_error("hosts: cannot listen on %s port %d: %s; choose another hosts: port, or end what uses it",
                      address, port, strerror(-err));
    }
    return err;
}

/* Without UDP port its nodes send over TLS: no reason not to start. */
static void listen_for_datagrams(struct sst_link_head *h)
{
    const struct link_dtls_events events = { .arg = h, .known = head_knows, .datagram = head_datagram };
    int err;

    if (!h->array.hosts.datagrams || !sst_pieces_built())
        return;
    err = link_dtls_listen(&h->dtls, h->array.hosts.address, h->array.hosts.port, h->credentials, &events);
    if (err)
        sst_log_warning("hosts: cannot receive datagrams on UDP port %d: %s; pictures come over TLS",
                        h->array.hosts.port, strerror(-err));
}

/* All views are cameras of the array, whoever has them. */
static void lay_out(struct sst_array_config *a)
{
    a->bound = a->rows * a->cols;
    memset(a->camera, 0, sizeof(a->camera));
    for (int i = 0; i < a->bound; i++) {
        a->camera[i].row = i / a->cols;
        a->camera[i].col = i % a->cols;
    }
    a->lines = 0; /* planned delays are subtracted where they are planned */
}

static int prepare(struct sst_link_head *h)
{
    int err = sst_numbering_create(&h->numbering, h->period_ns);

    h->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    h->ready_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (!err && (h->wake_fd < 0 || h->ready_fd < 0))
        err = -errno;
    for (int i = 0; i < SST_CAMERAS_MAX; i++) {
        h->slot[i].source = -1;
        snprintf(h->slot[i].why, sizeof(h->slot[i].why), "no host has announced it");
        h->slot[i].changed = true;
    }
    for (int i = 0; i < h->array.hosts.nodes; i++) {
        h->source[i].used = true;
        memcpy(h->source[i].peer.name, h->array.hosts.node[i], sizeof(h->array.hosts.node[i]));
        snprintf(h->source[i].peer.reason, 64, "it has not connected yet");
    }
    return err;
}

int sst_link_head_open(struct sst_link_head **out, const struct sst_link_head_config *cfg,
                       struct sst_array_config *layout)
{
    struct sst_link_head *h = calloc(1, sizeof(*h));
    int err;

    if (!h)
        return -ENOMEM;
    h->listen_fd = h->wake_fd = h->ready_fd = -1;
    h->array = *cfg->array;
    h->arg = cfg->arg;
    h->event = cfg->event;
    h->period_ns = (int64_t)(1e9 / cfg->array->trigger_hz);
    lay_out(&h->array);
    pthread_mutex_init(&h->lock, NULL);
    err = prepare(h);
    err = err ? err : link_credentials_create(&h->credentials, &h->array);
    err = err ? err : listen_for_nodes(h);
    if (!err)
        listen_for_datagrams(h);
    if (!err) {
        err = -pthread_create(&h->thread, NULL, head_serve, h);
        h->threaded = !err;
    }
    if (!err && cfg->array->bound)
        err = link_local_open(&h->own, h, cfg->array);
    if (err) {
        sst_link_head_close(h);
        return err;
    }
    *layout = h->array;
    *out = h;
    return 0;
}

void sst_link_head_stop(struct sst_link_head *h)
{
    pthread_mutex_lock(&h->lock);
    h->stop = true;
    pthread_mutex_unlock(&h->lock);
    if (h->threaded)
        (void)eventfd_write(h->wake_fd, 1); /* full: it is already readable */
}

void sst_link_head_close(struct sst_link_head *h)
{
    if (!h)
        return;
    link_local_close(h->own);
    sst_link_head_stop(h);
    if (h->threaded)
        pthread_join(h->thread, NULL);
    head_sets_free(h);
    sst_numbering_destroy(h->numbering);
    link_dtls_server_close(h->dtls);
    link_credentials_destroy(h->credentials);
    if (h->listen_fd >= 0)
        close(h->listen_fd);
    if (h->wake_fd >= 0)
        close(h->wake_fd);
    if (h->ready_fd >= 0)
        close(h->ready_fd);
    pthread_mutex_destroy(&h->lock);
    free(h);
}
