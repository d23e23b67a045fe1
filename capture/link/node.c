/* A node: one thread connects to the head and sends it the sets of this host.
 *
 * TLS carries the node's name, its state and the fate of sets; the sets themselves go by datagrams where both hosts can
 * (node_datagrams.c), else over TLS, too. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/kernel_clock.h"
#include "base/thread.h"
#include "capture/link/link_internal.h"
#include "pipeline/live/frames/unchanged.h"

#define RETRY_NS   INT64_C(150000000)
#define REFUSED_NS INT64_C(2000000000) /* ... after a refusal, which another attempt does not change */
#define CONNECT_NS INT64_C(600000000)
#define SILENCE_NS INT64_C(2000000000)
#define STATE_NS   INT64_C(500000000)
#define SMOOTH     0.1

const char *const sst_link_keys[SST_LINK_BUCKETS] = { "sent", "unchanged", "dropped", "away", "lost", "missed" };

static void wake(struct sst_link_node *n)
{
    (void)eventfd_write(n->wake_fd, 1); /* full: it is already readable */
}

/* --- messages ----------------------------------------------------------------------------------------------------- */

static json_t *hello_locked(const struct sst_link_node *n)
{
    const struct sst_array_config *a = &n->layout;
    const char *format = sst_array_format_name(a->fourcc);
    json_t *cameras = json_array();
    char run[24];

    for (int i = 0; i < a->bound; i++) {
        const struct sst_config_camera *c = &a->camera[i];
        const struct sst_grab_device *d = &n->camera[i].device;

        json_array_append_new(cameras, json_pack("[i, i, s, s, s]", c->row, c->col, d->port[0] ? d->serial : c->serial,
                                                 d->port[0] ? d->port : c->port, d->name));
    }
    snprintf(run, sizeof(run), "%016llx", (unsigned long long)n->run);
    return json_pack("{s:i, s:s, s:i, s:I, s:f, s:i, s:i, s:s, s:o}", "version", LINK_VERSION, "run", run, "opening",
                     (int)n->opening, "seq", (json_int_t)n->seq, "rate_hz", a->trigger_hz, "width", a->width, "height",
                     a->height, "format", format ? format : "", "cameras", cameras);
}

static uint64_t unexplained(const struct sst_link_node_state *state)
{
    uint64_t known = state->waiting;

    for (int i = 0; i < SST_LINK_BUCKETS; i++)
        known += state->bucket[i];
    return known > state->frames ? known - state->frames : state->frames - known;
}

static json_t *counts(const char *const *keys, const uint64_t *n, int size)
{
    json_t *o = json_object();

    for (int i = 0; i < size; i++)
        json_object_set_new(o, keys[i], json_integer((json_int_t)n[i]));
    return o;
}

static json_t *state_locked(const struct sst_link_node *n)
{
    const struct sst_framesync_counters *sets = &n->report.sets;
    struct sst_kernel_clock clock;
    json_t *cameras = json_array(), *captured = counts(sst_bucket_keys, sets->bucket, SST_BUCKETS);
    json_t *link = counts(sst_link_keys, n->state.bucket, SST_LINK_BUCKETS);

    for (int i = 0; i < n->sent.bound; i++)
        json_array_append_new(cameras, json_pack("[i, s]", (int)n->camera[i].state, n->camera[i].why));
    sst_kernel_clock(&clock);
    json_object_set_new(captured, "delivered", json_integer((json_int_t)n->report.grab.frames));
    json_object_set_new(captured, "waiting", json_integer((json_int_t)sets->waiting));
    json_object_set_new(captured, "unexplained", json_integer((json_int_t)n->report.unexplained));
    json_object_set_new(link, "waiting", json_integer((json_int_t)n->state.waiting));
    json_object_set_new(link, "unexplained", json_integer((json_int_t)unexplained(&n->state)));
    return json_pack("{s:o, s:o, s:o, s:{s:b, s:f}}", "cameras", cameras, "captured", captured, "link", link, "clock",
                     "synchronised", clock.synchronised, "error_ms", clock.error_us / 1e3);
}

/* --- the connection ----------------------------------------------------------------------------------------------- */

static void announce(struct sst_link_node *n, bool connected)
{
    bool report;

    pthread_mutex_lock(&n->lock);
    report = (connected != n->state.connected || !n->reported) && (connected || n->reason[0]);
    n->state.connected = connected;
    snprintf(n->state.reason, sizeof(n->state.reason), "%s", connected ? "" : n->reason);
    n->state.connections += connected;
    pthread_mutex_unlock(&n->lock);
    n->reported = n->reported || report;
    if (report && n->event)
        n->event(n->arg, n->array.hosts.head_name, connected, connected ? "" : n->reason);
}

static void count_bytes(struct sst_link_node *n)
{
    pthread_mutex_lock(&n->lock);
    n->state.sent_bytes += n->stream.sent_bytes - n->counted_bytes;
    pthread_mutex_unlock(&n->lock);
    n->counted_bytes = n->stream.sent_bytes;
}

static void disconnect(struct sst_link_node *n, int64_t pause_ns)
{
    count_bytes(n);
    n->counted_bytes = 0;
    link_stream_close(&n->stream);
    node_datagrams_end(n);
    n->phase = NODE_OFF;
    n->retry_ns = sst_clock_now_ns() + pause_ns;
    announce(n, false);
}

static int dial(struct sst_link_node *n)
{
    struct sockaddr_storage to;
    unsigned bytes;
    int fd, err = link_address(n->array.hosts.head, n->array.hosts.port, &to, &bytes);

    if (err)
        return err;
    fd = socket(to.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return -errno;
    link_socket_prepare(fd);
    if (connect(fd, (const struct sockaddr *)&to, bytes) < 0 && errno != EINPROGRESS) {
        err = -errno;
        close(fd);
        return err;
    }
    n->stream = (struct link_stream){ .fd = fd };
    n->phase = NODE_CONNECTING;
    n->until_ns = sst_clock_now_ns() + CONNECT_NS;
    return 0;
}

static int connected(struct sst_link_node *n)
{
    const int fd = n->stream.fd;
    int err = 0;
    socklen_t size = sizeof(err);

    if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &err, &size) < 0 || err) {
        snprintf(n->reason, sizeof(n->reason), "%s port %d: %s", n->array.hosts.head, n->array.hosts.port,
                 strerror(err));
        return -ECONNREFUSED;
    }
    n->phase = NODE_SHAKING;
    n->until_ns = sst_clock_now_ns() + SILENCE_NS;
    return link_stream_open(&n->stream, fd, n->credentials, false, MESSAGE_TEXT_MAX);
}

/* The head has shown its certificate: it must be the head's. */
static int greet(struct sst_link_node *n)
{
    json_t *hello;

    if (strcmp(n->stream.peer, n->array.hosts.head_name) != 0) {
        snprintf(n->reason, sizeof(n->reason), "its certificate is of \"%s\", not of \"%s\"; see hosts: head_name",
                 n->stream.peer, n->array.hosts.head_name);
        return -EACCES;
    }
    pthread_mutex_lock(&n->lock);
    n->opening_sent = n->opening;
    n->sent = n->layout;
    hello = hello_locked(n);
    pthread_mutex_unlock(&n->lock);
    node_renew_unchanged(n);
    n->phase = NODE_GREETING;
    return link_stream_add_json(&n->stream, MESSAGE_HELLO, hello);
}

static int welcomed(struct sst_link_node *n, const uint8_t *data, size_t bytes)
{
    json_t *o = json_loadb((const char *)data, bytes, 0, NULL);
    const char *refused = json_string_value(json_object_get(o, "refused"));
    const char *session = json_string_value(json_object_get(o, "session"));
    const json_t *seq = json_object_get(o, "seq"), *missed = json_object_get(o, "missed");
    int err = 0;

    if (!refused || !session || !json_is_integer(seq) || !json_is_integer(missed)) {
        snprintf(n->reason, sizeof(n->reason), "its answer cannot be read; do both hosts have the same version?");
        err = -EBADMSG;
    } else if (*refused) {
        snprintf(n->reason, sizeof(n->reason), "%.250s", refused);
        err = -EACCES;
    } else {
        pthread_mutex_lock(&n->lock);
        (void)node_confirm_locked(n, (uint64_t)json_integer_value(seq), (uint64_t)json_integer_value(missed),
                                  sst_clock_now_ns());
        node_lose_flights_locked(n);
        while (n->count > 1) /* sets that waited for the connection are old */
            node_drop_oldest_locked(n);
        n->changed = true;
        pthread_mutex_unlock(&n->lock);
        n->reason[0] = 0;
        n->phase = NODE_UP;
        node_datagrams_begin(n, strtoull(session, NULL, 16));
        announce(n, true);
    }
    json_decref(o);
    return err;
}

static void confirmed(struct sst_link_node *n, const uint8_t *ack)
{
    const uint64_t seq = wire_get_u64(ack), outcome = wire_get_u64(ack + 8);
    const int64_t now_ns = sst_clock_now_ns();
    bool datagrams = false;
    int64_t took_ns;

    pthread_mutex_lock(&n->lock);
    for (int i = 0; i < n->flights; i++)
        datagrams |= n->flight[i].seq == seq && n->flight[i].pieces >= 0;
    took_ns = node_confirm_locked(n, seq, (uint32_t)outcome == WIRE_MISSED, now_ns);
    if (took_ns)
        n->state.reply_ms += (n->state.reply_ms > 0 ? SMOOTH : 1) * ((double)took_ns / 1e6 - n->state.reply_ms);
    pthread_mutex_unlock(&n->lock);
    if (datagrams)
        node_datagrams_judge(n, (uint32_t)(outcome >> 32), now_ns);
}

static int receive(struct sst_link_node *n)
{
    enum message_type type;
    const uint8_t *data;
    size_t bytes;
    int r, err = 0;

    while (!err && (r = link_stream_next(&n->stream, &type, &data, &bytes)) != 0) {
        if (r < 0)
            return r;
        n->until_ns = sst_clock_now_ns() + SILENCE_NS;
        if (type == MESSAGE_WELCOME && n->phase == NODE_GREETING)
            err = welcomed(n, data, bytes);
        else if (type == MESSAGE_ACK && bytes == WIRE_ACK_BYTES && n->phase == NODE_UP)
            confirmed(n, data);
        else if (type == MESSAGE_WANT && n->phase == NODE_UP)
            err = node_datagrams_repair(n, data, bytes);
    }
    return err;
}

static int tell_state(struct sst_link_node *n, int64_t now_ns)
{
    json_t *state = NULL;

    pthread_mutex_lock(&n->lock);
    if (n->changed || now_ns - n->told_ns >= STATE_NS) {
        state = state_locked(n);
        n->changed = false;
    }
    pthread_mutex_unlock(&n->lock);
    if (!state)
        return 0;
    n->told_ns = now_ns;
    return link_stream_add_json(&n->stream, MESSAGE_STATE, state);
}

/* @return 0, or the error that ends the connection, with n->reason */
static int advance(struct sst_link_node *n, short ready)
{
    const int64_t now_ns = sst_clock_now_ns();
    int err = 0;

    if (n->phase == NODE_CONNECTING && ready)
        err = connected(n);
    if (!err && n->phase >= NODE_SHAKING)
        err = link_stream_work(&n->stream, n->reason);
    if (!err && n->phase == NODE_SHAKING && n->stream.ready)
        err = greet(n);
    if (!err && n->phase >= NODE_GREETING)
        err = receive(n);
    /* Sets wait for cameras that stream: a node's are not announced before its pictures can come. */
    if (!err && n->phase == NODE_UP && !node_datagrams_soon(n))
        err = tell_state(n, now_ns);
    if (!err && n->phase == NODE_UP) /* before a set overtakes the state of its cameras */
        err = link_stream_work(&n->stream, n->reason);
    if (!err && n->phase == NODE_UP)
        err = node_datagrams_work(n, now_ns);
    if (!err && n->phase == NODE_UP)
        err = node_send_sets(n);
    if (!err && n->phase >= NODE_SHAKING)
        err = link_stream_work(&n->stream, n->reason);
    if (!err && n->phase != NODE_OFF && now_ns >= n->until_ns) {
        snprintf(n->reason, sizeof(n->reason), "%s port %d does not answer", n->array.hosts.head, n->array.hosts.port);
        err = -ETIMEDOUT;
    }
    return err;
}

/* The connection may go on: the array is open, with the cameras that the head knows. */
static bool still_right(struct sst_link_node *n, bool *stop, bool *open)
{
    bool right;

    pthread_mutex_lock(&n->lock);
    *stop = n->stop;
    *open = n->open;
    right = n->open && (n->phase < NODE_GREETING || n->opening == n->opening_sent);
    pthread_mutex_unlock(&n->lock);
    return right;
}

static void work(struct sst_link_node *n, bool open)
{
    struct pollfd fds[3] = { { .fd = n->wake_fd, .events = POLLIN }, { .fd = -1 }, { .fd = -1 } };
    int timeout_ms = node_datagrams_busy(n) ? 1 : 50, err = 0;
    eventfd_t woken;

    if (n->phase == NODE_OFF && open && sst_clock_now_ns() >= n->retry_ns) {
        err = dial(n);
        if (err)
            snprintf(n->reason, sizeof(n->reason), "%s port %d: %s", n->array.hosts.head, n->array.hosts.port,
                     strerror(-err));
    }
    if (n->phase == NODE_CONNECTING)
        fds[1] = (struct pollfd){ .fd = n->stream.fd, .events = POLLOUT };
    else if (n->phase > NODE_CONNECTING)
        fds[1] = (struct pollfd){ .fd = n->stream.fd, .events = link_stream_events(&n->stream) };
    if (n->by.dtls)
        fds[2] = (struct pollfd){ .fd = link_dtls_fd(n->by.dtls), .events = POLLIN };
    if (!err && poll(fds, 3, timeout_ms) < 0 && errno != EINTR)
        err = -errno;
    (void)eventfd_read(n->wake_fd, &woken); /* woken by the socket, or by time */
    if (!err && n->phase != NODE_OFF)
        err = advance(n, fds[1].revents);
    count_bytes(n);
    if (err)
        disconnect(n, err == -EACCES || err == -EBADMSG ? REFUSED_NS : RETRY_NS);
}

static void *serve(void *arg)
{
    struct sst_link_node *n = arg;
    bool stop = false, open = false;

    sst_thread_name("sst-link");
    while (!stop) {
        if (!still_right(n, &stop, &open) && n->phase != NODE_OFF && !stop) {
            snprintf(n->reason, sizeof(n->reason), "the cameras are opened again");
            disconnect(n, 0);
        }
        if (!stop)
            work(n, open);
    }
    link_stream_close(&n->stream);
    node_datagrams_close(n);
    return NULL;
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

int sst_link_node_open(struct sst_link_node **out, const struct sst_link_node_config *cfg)
{
    struct sst_link_node *n = calloc(1, sizeof(*n));
    int err;

    if (!n)
        return -ENOMEM;
    n->array = *cfg->array;
    n->ring = cfg->ring;
    n->arg = cfg->arg;
    n->event = cfg->event;
    n->stream.fd = -1;
    pthread_mutex_init(&n->lock, NULL);
    n->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    err = n->wake_fd < 0 ? -errno : 0;
    if (!err && getrandom(&n->run, sizeof(n->run), 0) != sizeof(n->run))
        err = -errno;
    err = err ? err : link_credentials_create(&n->credentials, cfg->array);
    err = err ? err : node_datagrams_open(n);
    if (!err) {
        err = -pthread_create(&n->thread, NULL, serve, n);
        n->threaded = !err;
    }
    if (err)
        sst_link_node_close(n);
    else
        *out = n;
    return err;
}

void sst_link_node_cameras(struct sst_link_node *n, const struct sst_array_config *layout)
{
    pthread_mutex_lock(&n->lock);
    while (n->count) /* of another opening */
        node_drop_oldest_locked(n);
    n->open = layout && layout->bound > 0;
    if (layout) {
        n->layout = *layout;
        n->opening++;
        memset(n->camera, 0, sizeof(n->camera));
    }
    pthread_mutex_unlock(&n->lock);
    wake(n);
}

void sst_link_node_camera(struct sst_link_node *n, int cam, enum sst_grab_state state, const char *why,
                          const struct sst_grab_device *device)
{
    pthread_mutex_lock(&n->lock);
    n->camera[cam].state = state;
    snprintf(n->camera[cam].why, sizeof(n->camera[cam].why), "%.120s", why ? why : "");
    if (device)
        n->camera[cam].device = *device;
    n->changed = true;
    pthread_mutex_unlock(&n->lock);
    wake(n);
}

void sst_link_node_set(struct sst_link_node *n, const struct sst_frameset *set)
{
    struct sst_ring_counters ring;
    int frames = 0;

    sst_ring_counters(n->ring, &ring);
    for (int i = 0; i < set->cameras; i++)
        frames += set->frame[i] != NULL;
    pthread_mutex_lock(&n->lock);
    if (n->open) {
        n->state.frames += (uint64_t)frames;
        n->state.waiting += (uint64_t)frames;
        if (n->count == n->array.hosts.queue)
            node_drop_oldest_locked(n);
        n->queue[(n->first + n->count++) % NODE_QUEUE_MAX] = (struct node_queued){ ring.kept, n->opening, frames };
    }
    pthread_mutex_unlock(&n->lock);
    wake(n);
}

void sst_link_node_report(struct sst_link_node *n, const struct sst_capture_report *report)
{
    pthread_mutex_lock(&n->lock);
    n->report = *report;
    pthread_mutex_unlock(&n->lock);
}

void sst_link_node_state(struct sst_link_node *n, struct sst_link_node_state *out)
{
    pthread_mutex_lock(&n->lock);
    *out = n->state;
    pthread_mutex_unlock(&n->lock);
    out->unexplained = unexplained(out);
}

void sst_link_node_stop(struct sst_link_node *n)
{
    pthread_mutex_lock(&n->lock);
    n->stop = true;
    pthread_mutex_unlock(&n->lock);
    if (n->threaded) {
        wake(n);
        pthread_join(n->thread, NULL);
    }
    n->threaded = false;
}

void sst_link_node_close(struct sst_link_node *n)
{
    if (!n)
        return;
    sst_link_node_stop(n);
    node_datagrams_close(n);
    sst_unchanged_destroy(n->unchanged);
    link_credentials_destroy(n->credentials);
    if (n->wake_fd >= 0)
        close(n->wake_fd);
    pthread_mutex_destroy(&n->lock);
    free(n);
}
