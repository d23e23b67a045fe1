/* Connections of nodes on the head: admission and incoming messages. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* accept4() */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "capture/link/link_internal.h"

#define CONNECTIONS (2 * LINK_NODES + 64)
#define ACCEPTS     8                   /* connections accepted at a time, before the connected ones are read */
#define HELLO_NS    INT64_C(5000000000) /* from the connection to the node's name */
#define GREET_NS    INT64_C(250000000)  /* ... to the first message, when others want its place */
#define SILENCE_NS  INT64_C(2000000000)
#define HOLD_MS     20                 /* sets that are incomplete, or without a decided name, are polled again */
#define WAIT_NS     INT64_C(600000000) /* for a set to become complete, at least, where sets: wait_ms does not say it */

struct link_connection {
    struct link_stream stream; /* fd -1: unused */
    int source;                /* -1: it has not said which node it is */
    struct sockaddr_storage from;
    char address[64];
    int64_t began_ns, until_ns;
    bool refused; /* closed once the reason has been sent */
    /* of its node */
    struct link_inbox *inbox;
    struct link_inbox_counters counted; /* of it, in the report */
    uint64_t received_datagram_bytes;   /* not yet reported */
    int cameras;
    struct {
        struct sst_mem_kept kept; /* bytes that it sent last, for pictures that are unchanged; of the set `seq` */
        size_t bytes;
        uint32_t stride;
        uint64_t seq;
    } last[SST_CAMERAS_MAX];
};

/* --- ends --------------------------------------------------------------------------------------------------------- */

static void end(struct sst_link_head *h, struct link_connection *c, const char *why)
{
    const int source = c->source;

    link_stream_close(&c->stream);
    link_inbox_destroy(c->inbox);
    for (int i = 0; i < c->cameras; i++)
        sst_mem_kept_fini(&c->last[i].kept);
    if (source >= 0) {
        struct head_source *s = &h->source[source];
        char text[256];

        snprintf(text, sizeof(text), "node %s is not connected: %.180s", s->peer.name, why);
        pthread_mutex_lock(&h->lock);
        s->peer.connected = false;
        snprintf(s->peer.reason, sizeof(s->peer.reason), "%.250s", why);
        head_forget_locked(h, source);
        for (int i = 0; i < s->cameras; i++)
            head_camera_locked(h, source, i, (struct head_camera){ SST_GRAB_ABSENT, text, NULL });
        sst_numbering_leave(h->numbering, source);
        pthread_mutex_unlock(&h->lock);
        if (h->event)
            h->event(h->arg, s->peer.name, false, why);
    } else if (*why && !c->refused &&
               sst_log_limit_due(&h->strangers, (const struct sockaddr *)&c->from, c->address, sst_clock_now_ns())) {
        sst_log_warning("hosts: the connection of %s ended before it was accepted: %s", c->address, why);
    }
    *c = (struct link_connection){ .stream.fd = -1, .source = -1 };
}

/* --- HELLO -------------------------------------------------------------------------------------------------------- */

/* @return the node's source; -1: not in the list */
static int find_node(const struct sst_link_head *h, const char *name)
{
    for (int i = 0; i < h->array.hosts.nodes; i++)
        if (!strcmp(h->array.hosts.node[i], name))
            return i;
    return -1;
}

/* Who has a view now, and is connected? */
static const char *holder_locked(const struct sst_link_head *h, int view, int source)
{
    const int other = h->slot[view].source;

    if (other < 0 || other == source || !h->source[other].peer.connected)
        return NULL;
    return other == LINK_OWN ? "the head itself" : h->source[other].peer.name;
}

/* Bind the node's cameras to views. @return 0, or -EINVAL with why; then nothing has changed */
static int bind_cameras_locked(struct sst_link_head *h, int source, const json_t *cameras, char why[256])
{
    struct head_source *s = &h->source[source];
    const int n = (int)json_array_size(cameras);
    int view[SST_CAMERAS_MAX];

    if (n < 1 || n > h->array.bound) {
        snprintf(why, 256, "it has %d cameras, the array has %d views", n, h->array.bound);
        return -EINVAL;
    }
    for (int i = 0; i < n; i++) {
        const json_t *c = json_array_get(cameras, (size_t)i);
        const json_int_t row = json_integer_value(json_array_get(c, 0)), col = json_integer_value(json_array_get(c, 1));
        const char *holder;

        if (row < 0 || row >= h->array.rows || col < 0 || col >= h->array.cols) {
            snprintf(why, 256, "its camera at row %lld, col %lld is outside the grid of %dx%d; see cameras: bind",
                     (long long)row, (long long)col, h->array.rows, h->array.cols);
            return -EINVAL;
        }
        view[i] = (int)row * h->array.cols + (int)col;
        holder = holder_locked(h, view[i], source);
        if (holder) {
            snprintf(why, 256, "row %lld, col %lld has a camera of %.60s already; see cameras: bind of both",
                     (long long)row, (long long)col, holder);
            return -EINVAL;
        }
    }
    for (int i = 0; i < h->array.bound; i++)
        if (h->slot[i].source == source)
            h->slot[i].source = -1;
    s->cameras = n;
    for (int i = 0; i < n; i++) {
        s->slot[i] = view[i];
        h->slot[view[i]].source = source;
    }
    return 0;
}

static void copy_text(char *out, size_t size, const json_t *text)
{
    const char *from = json_string_value(text);

    snprintf(out, size, "%s", from ? from : "");
}

static void show_cameras_locked(struct sst_link_head *h, int source, const json_t *cameras)
{
    for (int i = 0; i < h->source[source].cameras; i++) {
        const json_t *c = json_array_get(cameras, (size_t)i);
        struct sst_grab_device device = { 0 };

        copy_text(device.serial, sizeof(device.serial), json_array_get(c, 2));
        copy_text(device.port, sizeof(device.port), json_array_get(c, 3));
        copy_text(device.name, sizeof(device.name), json_array_get(c, 4));
        head_camera_locked(h, source, i, (struct head_camera){ SST_GRAB_ABSENT, "", &device });
    }
}

/* Settings that both hosts must share. */
static int compare(const struct sst_link_head *h, const json_t *hello, char why[256])
{
    const struct sst_array_config *a = &h->array;
    const char *format = json_string_value(json_object_get(hello, "format"));
    const json_int_t version = json_integer_value(json_object_get(hello, "version"));
    const json_int_t width = json_integer_value(json_object_get(hello, "width"));
    const json_int_t height = json_integer_value(json_object_get(hello, "height"));
    const double rate_hz = json_number_value(json_object_get(hello, "rate_hz"));

    if (version != LINK_VERSION)
        snprintf(why, 256, "it speaks version %lld of the hosts' protocol, the head %d: install the same version",
                 (long long)version, LINK_VERSION);
    else if (width != a->width || height != a->height || !format || sst_array_format(format) != a->fourcc)
        snprintf(why, 256, "its pictures are %lldx%lld %.10s, the head's configuration has %dx%d %s", (long long)width,
                 (long long)height, format ? format : "?", a->width, a->height, sst_array_format_name(a->fourcc));
    else if (rate_hz < 0.999 * a->trigger_hz || rate_hz > 1.001 * a->trigger_hz)
        snprintf(why, 256, "its trigger: rate_hz is %g, the head's %g", rate_hz, a->trigger_hz);
    return why[0] ? -EINVAL : 0;
}

static uint64_t run_of(const json_t *hello)
{
    const char *run = json_string_value(json_object_get(hello, "run"));

    return run ? strtoull(run, NULL, 16) : 0;
}

static uint64_t counting_of(const json_t *hello)
{
    const uint64_t opening = (uint64_t)json_integer_value(json_object_get(hello, "opening"));

    return run_of(hello) ^ (opening << 48 | opening);
}

/* A node that was cut off, or killed, comes back before its old connection has ended. */
static void end_older(struct sst_link_head *h, int source)
{
    for (int i = 0; i < CONNECTIONS; i++)
        if (h->connection[i].stream.fd >= 0 && h->connection[i].source == source)
            end(h, &h->connection[i], "it connected again");
}

static int open_inbox(struct sst_link_head *h, struct link_connection *c, const json_t *hello, uint64_t *session)
{
    const int64_t wait_ns = (int64_t)h->array.wait_ms * 1000000;
    const int64_t least_ns = 3 * h->period_ns > WAIT_NS ? 3 * h->period_ns : WAIT_NS;
    const json_int_t seq = json_integer_value(json_object_get(hello, "seq"));

    if (seq < 0)
        return -EBADMSG;
    if (getrandom(session, sizeof(*session), 0) != sizeof(*session))
        return -errno;
    return link_inbox_create(&c->inbox, *session, (uint64_t)seq + 1,
                             link_message_most(h->array.bound, h->array.width, h->array.height),
                             wait_ns ? wait_ns : least_ns);
}

static int join_locked(struct sst_link_head *h, struct link_connection *c, int source, const json_t *hello,
                       char why[256])
{
    const uint64_t id = run_of(hello);
    struct sst_link_peer *p = &h->source[source].peer;
    int err = bind_cameras_locked(h, source, json_object_get(hello, "cameras"), why);

    if (err)
        return err;
    if (p->run != id)
        p->seq = p->missed_bits = 0;
    p->run = id;
    p->connected = true;
    p->reason[0] = 0;
    p->connections++;
    memcpy(p->address, c->address, sizeof(p->address));
    c->source = source;
    c->cameras = h->source[source].cameras;
    c->stream.most = link_message_most(h->array.bound, h->array.width, h->array.height);
    show_cameras_locked(h, source, json_object_get(hello, "cameras"));
    sst_numbering_join(h->numbering, source, counting_of(hello));
    return 0;
}

static int refuse(struct sst_link_head *h, struct link_connection *c, const char *why)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (sst_log_limit_due(&h->refusals, (const struct sockaddr *)&c->from, c->address, now_ns))
        sst_log_warning("hosts: node %s at %s is refused: %s", c->stream.peer, c->address, why);
    c->refused = true;
    c->until_ns = now_ns + HELLO_NS / 5;
    return link_stream_add_json(
        &c->stream, MESSAGE_WELCOME,
        json_pack("{s:s, s:i, s:i, s:s}", "refused", why, "seq", 0, "missed", 0, "session", ""));
}

static int welcome(struct sst_link_head *h, struct link_connection *c, const uint8_t *data, size_t bytes)
{
    json_t *hello = json_loadb((const char *)data, bytes, 0, NULL);
    const int source = find_node(h, c->stream.peer);
    char why[256] = "", text[24] = "";
    uint64_t seq = 0, missed = 0, session = 0;
    int err = hello ? compare(h, hello, why) : -EBADMSG;

    if (!err && source < 0) {
        snprintf(why, sizeof(why), "\"%s\" is not among the head's hosts: nodes", c->stream.peer);
        err = -EACCES;
    }
    if (!err) {
        end_older(h, source);
        pthread_mutex_lock(&h->lock);
        err = join_locked(h, c, source, hello, why);
        seq = h->source[source].peer.seq;
        missed = h->source[source].peer.missed_bits;
        if (err)
            snprintf(h->source[source].peer.reason, sizeof(h->source[source].peer.reason), "refused: %.240s", why);
        pthread_mutex_unlock(&h->lock);
    }
    if (err) {
        json_decref(hello);
        return err == -EBADMSG ? err : refuse(h, c, why);
    }
    err = open_inbox(h, c, hello, &session);
    json_decref(hello);
    if (err)
        return err;
    if (h->event)
        h->event(h->arg, h->source[source].peer.name, true, "");
    if (h->dtls)
        snprintf(text, sizeof(text), "%016llx", (unsigned long long)session);
    return link_stream_add_json(&c->stream, MESSAGE_WELCOME,
                                json_pack("{s:s, s:I, s:I, s:s}", "refused", "", "seq", (json_int_t)seq, "missed",
                                          (json_int_t)missed, "session", text));
}

/* --- STATE and SET ------------------------------------------------------------------------------------------------ */

static int confirm(struct link_connection *c, uint64_t seq, enum wire_outcome outcome, uint32_t datagrams)
{
    uint8_t *ack = link_stream_add(&c->stream, MESSAGE_ACK, WIRE_ACK_BYTES);

    if (!ack)
        return -ENOMEM;
    wire_put_u64(ack, seq);
    wire_put_u64(ack + 8, (uint64_t)datagrams << 32 | (uint64_t)outcome);
    return 0;
}

static int take_state(struct sst_link_head *h, struct link_connection *c, const uint8_t *data, size_t bytes)
{
    json_t *state = json_loadb((const char *)data, bytes, 0, NULL);
    const json_t *cameras = json_object_get(state, "cameras");

    if (!json_is_object(state) || json_array_size(cameras) != (size_t)c->cameras) {
        json_decref(state);
        return -EBADMSG;
    }
    pthread_mutex_lock(&h->lock);
    for (int i = 0; i < c->cameras; i++) {
        const json_t *one = json_array_get(cameras, (size_t)i);
        const char *why = json_string_value(json_array_get(one, 1));
        const int value = (int)json_integer_value(json_array_get(one, 0));

        head_camera_locked(
            h, c->source, i,
            (struct head_camera){ (enum sst_grab_state)sst_clamp_int(value, SST_GRAB_ABSENT, SST_GRAB_READY),
                                  why ? why : "", NULL });
    }
    json_decref(h->source[c->source].peer.reported);
    h->source[c->source].peer.reported = state;
    pthread_mutex_unlock(&h->lock);
    /* Also while the trigger rests: the head is there. */
    return confirm(c, h->source[c->source].peer.seq,
                   h->source[c->source].peer.missed_bits & 1 ? WIRE_MISSED : WIRE_RECEIVED, 0);
}

static int keep_last(struct link_connection *c, int cam, const uint8_t *data, const struct wire_frame *f, uint64_t seq)
{
    uint8_t *to = sst_mem_keep(&c->last[cam].kept, f->bytes, 1);

    if (!to)
        return -ENOMEM;
    memcpy(to, data, f->bytes);
    c->last[cam].bytes = f->bytes;
    c->last[cam].stride = f->stride;
    c->last[cam].seq = seq;
    return 0;
}

/* Content of a set. */
struct contents {
    int frames, unchanged, missed; /* missed: unchanged from a picture that did not arrive */
    size_t bytes;                  /* with unchanged ones */
};

/* Remember the bytes of this set. An unchanged picture with bytes in a missed set is missing. */
static int study(struct link_connection *c, uint64_t seq, struct wire_frame *frame, const uint8_t *data,
                 struct contents *out)
{
    int err = 0;

    *out = (struct contents){ 0 };
    for (int i = 0; !err && i < c->cameras; i++) {
        out->frames += frame[i].kind != WIRE_MISSING;
        out->unchanged += frame[i].kind == WIRE_UNCHANGED;
        if (frame[i].kind == WIRE_FRAME) {
            err = keep_last(c, i, data, &frame[i], seq);
            data += frame[i].bytes;
        } else if (frame[i].kind == WIRE_UNCHANGED && (!c->last[i].bytes || c->last[i].seq != frame[i].since)) {
            frame[i].kind = WIRE_MISSING;
            out->missed++;
        }
        out->bytes += frame[i].kind != WIRE_MISSING ? c->last[i].bytes : 0;
    }
    return err;
}

static void fill(const struct sst_link_head *h, struct link_connection *c, struct head_set *set,
                 const struct wire_set *from, const struct wire_frame *frame)
{
    uint8_t *at = set->data;

    set->edge = (struct sst_numbering_edge){ from->count, from->t_ns, from->wall_ns };
    set->stamped = from->edge;
    for (int i = 0; i < c->cameras; i++) {
        set->frame[i] = (struct sst_frame){ 0 };
        if (frame[i].kind == WIRE_MISSING)
            continue;
        set->frame[i] = (struct sst_frame){ .fourcc = h->array.fourcc,
                                            .width = h->array.width,
                                            .height = h->array.height,
                                            .stride = c->last[i].stride,
                                            .data = memcpy(at, c->last[i].kept.data, c->last[i].bytes),
                                            .bytes = c->last[i].bytes,
                                            .sequence = frame[i].sequence,
                                            .lost_before = frame[i].lost_before,
                                            .faults = frame[i].faults & ~(unsigned)SST_FRAME_BAD,
                                            .t_ns = frame[i].from_set_ns };
        at += c->last[i].bytes;
    }
}

/* A set that is complete. */
static int take_set(struct sst_link_head *h, struct link_connection *c, const struct link_inbox_set *in)
{
    struct sst_link_peer *p = &h->source[c->source].peer;
    struct wire_frame frame[SST_CAMERAS_MAX];
    struct contents contents;
    struct head_set *set;
    struct wire_set from = { .cameras = c->cameras };
    int err = wire_get_set(in->data, in->bytes, link_frame_most(h->array.width, h->array.height), &from, frame);

    if (!err && from.seq != in->seq)
        err = -EBADMSG;
    err = err ? err : study(c, in->seq, frame, from.data, &contents);
    if (err)
        return err;
    set = head_set_acquire(h, c->source, contents.frames, contents.missed, contents.bytes);
    pthread_mutex_lock(&h->lock);
    p->unchanged += (uint64_t)contents.unchanged;
    pthread_mutex_unlock(&h->lock);
    if (set) {
        fill(h, c, set, &from, frame);
        head_set_pass(h, set);
    }
    return 0;
}

/* Sets that are decided, in their order. */
static int take_sets(struct sst_link_head *h, struct link_connection *c, int64_t now_ns)
{
    struct link_inbox_set in;
    int err = 0;

    while (!err && link_inbox_next(c->inbox, now_ns, &in)) {
        struct sst_link_peer *p = &h->source[c->source].peer;
        const uint64_t ahead = in.seq - p->seq;

        if (in.data)
            err = take_set(h, c, &in);
        if (err)
            return err;
        pthread_mutex_lock(&h->lock);
        p->missed_bits = (ahead < 64 ? p->missed_bits << ahead : 0) | !in.data;
        p->missed_sets += !in.data;
        p->seq = in.seq;
        pthread_mutex_unlock(&h->lock);
        err = confirm(c, in.seq, in.data ? WIRE_RECEIVED : WIRE_MISSED, in.datagrams);
    }
    return err;
}

/* Ask for missing pieces. */
static int want(struct link_connection *c, int64_t now_ns)
{
    uint16_t index[SST_PIECES_DATA_MAX];
    uint64_t seq;
    int n;

    while (link_inbox_ask(c->inbox, now_ns, &seq, index, &n)) {
        uint8_t *at = link_stream_add(&c->stream, MESSAGE_WANT, 8 + 2 * (size_t)n);

        if (!at)
            return -ENOMEM;
        wire_put_u64(at, seq);
        for (int i = 0; i < n; i++) {
            at[8 + 2 * i] = (uint8_t)index[i];
            at[9 + 2 * i] = (uint8_t)(index[i] >> 8);
        }
    }
    return 0;
}

/* Arrivals, and time, decide sets. */
static int settle(struct sst_link_head *h, struct link_connection *c, int64_t now_ns)
{
    struct sst_link_peer *p = &h->source[c->source].peer;
    struct link_inbox_counters count;
    int err = take_sets(h, c, now_ns);

    err = err ? err : want(c, now_ns);
    link_inbox_count(c->inbox, &count);
    pthread_mutex_lock(&h->lock);
    p->datagrams += count.datagrams - c->counted.datagrams;
    p->spare += count.spare - c->counted.spare;
    p->refused += count.refused - c->counted.refused;
    p->asked += count.asked - c->counted.asked;
    p->repaired += count.repaired - c->counted.repaired;
    pthread_mutex_unlock(&h->lock);
    c->counted = count;
    return err;
}

static struct link_connection *find_connection(struct sst_link_head *h, const char *name)
{
    for (int i = 0; i < CONNECTIONS; i++)
        if (h->connection[i].stream.fd >= 0 && h->connection[i].inbox && !strcmp(h->connection[i].stream.peer, name))
            return &h->connection[i];
    return NULL;
}

bool head_knows(void *head, const char *name)
{
    return find_connection(head, name) != NULL;
}

void head_datagram(void *head, const char *name, const uint8_t *data, size_t bytes)
{
    struct link_connection *c = find_connection(head, name);

    if (!c)
        return;
    if (link_inbox_datagram(c->inbox, data, bytes, sst_clock_now_ns())) {
        /* counted; it still is the host of its certificate */
    }
    c->received_datagram_bytes += bytes;
    c->until_ns = sst_clock_now_ns() + SILENCE_NS;
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

static int take(struct sst_link_head *h, struct link_connection *c, enum message_type type, const uint8_t *data,
                size_t bytes)
{
    if (c->refused) /* until the reason has been sent */
        return 0;
    if (type == MESSAGE_HELLO && c->source < 0) {
        c->until_ns = sst_clock_now_ns() + SILENCE_NS;
        return welcome(h, c, data, bytes);
    }
    if (c->source < 0 || (type == MESSAGE_STATE && bytes > MESSAGE_TEXT_MAX))
        return -EBADMSG;
    c->until_ns = sst_clock_now_ns() + SILENCE_NS;
    if (type == MESSAGE_STATE)
        return take_state(h, c, data, bytes);
    if (type == MESSAGE_SET)
        return link_inbox_whole(c->inbox, data, bytes, sst_clock_now_ns());
    if (type == MESSAGE_OFFER)
        return link_inbox_offer(c->inbox, data, bytes, sst_clock_now_ns());
    if (type == MESSAGE_REPAIR)
        return link_inbox_repair(c->inbox, data, bytes, sst_clock_now_ns());
    return -EBADMSG;
}

static void name_error(int err, char why[256])
{
    if (err == -EBADMSG)
        snprintf(why, 256, "what it sent cannot be read; do both hosts have the same version?");
    else if (err && !why[0])
        snprintf(why, 256, "%s", strerror(-err));
}

/* All input of a connection. Bytes inside GnuTLS are not seen by poll(): hence until nothing more comes. */
static int serve_one(struct sst_link_head *h, struct link_connection *c, char why[256])
{
    bool any = true;
    int err = 0;

    while (any && !err) {
        const uint64_t before = c->stream.received_bytes;
        enum message_type type;
        const uint8_t *data;
        size_t bytes;
        int r;

        any = false;
        err = link_stream_work(&c->stream, why);
        while (!err && c->stream.ready && (r = link_stream_next(&c->stream, &type, &data, &bytes)) != 0) {
            any = true;
            err = r < 0 ? r : take(h, c, type, data, bytes);
            if (!err && c->inbox) /* whole sets have no room to wait in */
                err = take_sets(h, c, sst_clock_now_ns());
        }
        if (c->source >= 0) {
            pthread_mutex_lock(&h->lock);
            h->source[c->source].peer.received_bytes += c->stream.received_bytes - before;
            pthread_mutex_unlock(&h->lock);
        }
    }
    name_error(err, why);
    return err;
}

/* Connections of one address without a node in excess of LINK_NODES, the most that an array has behind one address. */
static int count_spare(const struct sst_link_head *h, const struct link_connection *of)
{
    int n = 0;

    for (int i = 0; i < CONNECTIONS; i++) {
        const struct link_connection *c = &h->connection[i];

        n += c->stream.fd >= 0 && c->source < 0 && link_same_network(&c->from, &of->from);
    }
    return sst_max_int(n - LINK_NODES, 0);
}

/* Order of eviction of connections without a node: silent ones, then the ones of the address with most connections,
 * then the oldest; connections with a certificate last. @return a is evicted before b */
static bool goes_first(const struct sst_link_head *h, const struct link_connection *a, const struct link_connection *b,
                       int64_t now_ns)
{
    const bool silent_a = !link_stream_greeted(&a->stream) && now_ns - a->began_ns > GREET_NS;
    const bool silent_b = !link_stream_greeted(&b->stream) && now_ns - b->began_ns > GREET_NS;
    int spare_a, spare_b;

    if (a->stream.ready != b->stream.ready)
        return b->stream.ready;
    if (silent_a != silent_b)
        return silent_a;
    spare_a = count_spare(h, a);
    spare_b = count_spare(h, b);
    return spare_a != spare_b ? spare_a > spare_b : a->began_ns < b->began_ns;
}

/* @return NULL: all are nodes */
static struct link_connection *make_room(struct sst_link_head *h, int64_t now_ns)
{
    struct link_connection *first = NULL;

    for (int i = 0; i < CONNECTIONS; i++) {
        struct link_connection *c = &h->connection[i];

        if (c->stream.fd < 0)
            return c;
        if (c->source < 0 && (!first || goes_first(h, c, first, now_ns)))
            first = c;
    }
    if (first)
        end(h, first, "another one needed its place");
    return first;
}

/* @return false: there is none */
static bool accept_one(struct sst_link_head *h, int64_t now_ns)
{
    struct sockaddr_storage from = { 0 };
    socklen_t size = sizeof(from);
    const int fd = accept4(h->listen_fd, (struct sockaddr *)&from, &size, SOCK_CLOEXEC | SOCK_NONBLOCK);
    struct link_connection *c;

    if (fd < 0)
        return false;
    c = make_room(h, now_ns);
    if (!c) {
        close(fd);
        return true;
    }
    link_socket_prepare(fd);
    c->from = from;
    link_address_text(&from, c->address);
    c->began_ns = now_ns;
    c->until_ns = now_ns + HELLO_NS;
    if (link_stream_open(&c->stream, fd, h->credentials, true, MESSAGE_TEXT_MAX))
        end(h, c, "no memory");
    return true;
}

static int gather(const struct sst_link_head *h, struct pollfd *fds)
{
    fds[0] = (struct pollfd){ .fd = h->wake_fd, .events = POLLIN };
    fds[1] = (struct pollfd){ .fd = h->listen_fd, .events = POLLIN };
    fds[2] = (struct pollfd){ .fd = h->dtls ? link_dtls_server_fd(h->dtls) : -1, .events = POLLIN };
    for (int i = 0; i < CONNECTIONS; i++) {
        const struct link_stream *s = &h->connection[i].stream;

        fds[3 + i] = (struct pollfd){ .fd = s->fd, .events = s->fd >= 0 ? link_stream_events(s) : (short)0 };
    }
    return 3 + CONNECTIONS;
}

/* @return 0, or the error that ends the connection, with why */
static int check(struct sst_link_head *h, struct link_connection *c, int64_t now_ns, char why[256])
{
    int err = c->inbox ? settle(h, c, now_ns) : 0;

    if (!err && now_ns >= c->until_ns) {
        snprintf(why, 256, "%s", c->source < 0 ? "it does not say which node it is" : "it has fallen silent");
        return -ETIMEDOUT;
    }
    if (err)
        name_error(err, why);
    if (!err && c->received_datagram_bytes) {
        pthread_mutex_lock(&h->lock);
        h->source[c->source].peer.received_bytes += c->received_datagram_bytes;
        pthread_mutex_unlock(&h->lock);
        c->received_datagram_bytes = 0;
    }
    return err;
}

/* Input over TLS first, as states of cameras precede their pictures, then datagrams, then decisions by both.
 * @return true: something waits for time to pass */
static bool serve_all(struct sst_link_head *h, const struct pollfd *fds)
{
    char why[256] = "";
    bool waits;

    for (int i = 0; i < CONNECTIONS; i++) {
        struct link_connection *c = &h->connection[i];

        if (c->stream.fd >= 0 && fds[3 + i].fd == c->stream.fd && fds[3 + i].revents && serve_one(h, c, why))
            end(h, c, why);
        why[0] = 0;
    }
    waits = h->dtls && link_dtls_server_work(h->dtls);
    for (int i = 0; i < CONNECTIONS; i++) {
        struct link_connection *c = &h->connection[i];

        if (c->stream.fd >= 0 && check(h, c, sst_clock_now_ns(), why))
            end(h, c, why);
        why[0] = 0;
        waits |= c->inbox && link_inbox_waits(c->inbox);
    }
    for (int i = 0; fds[1].revents && i < ACCEPTS && accept_one(h, sst_clock_now_ns()); i++)
        ;
    if (h->dtls) {
        pthread_mutex_lock(&h->lock);
        h->overflows = link_dtls_server_overflows(h->dtls);
        pthread_mutex_unlock(&h->lock);
    }
    return waits;
}

void *head_serve(void *arg)
{
    struct sst_link_head *h = arg;
    struct pollfd fds[3 + CONNECTIONS];
    bool stop = false, waits = false;

    sst_thread_name("sst-link");
    h->strangers.what = "hosts: connections that ended before they were accepted";
    h->refusals.what = "hosts: connections of nodes that are refused";
    h->connection = calloc(CONNECTIONS, sizeof(*h->connection));
    if (!h->connection) {
        sst_log_error("hosts: no memory for connections of nodes");
        return NULL;
    }
    for (int i = 0; i < CONNECTIONS; i++)
        h->connection[i].stream.fd = h->connection[i].source = -1;
    while (!stop) {
        const int n = gather(h, fds);

        if (poll(fds, (nfds_t)n, waits ? HOLD_MS : 200) >= 0 || errno == EINTR)
            waits = serve_all(h, fds);
        waits |= head_settle(h, sst_clock_now_ns());
        sst_log_limit_work(&h->strangers, sst_clock_now_ns());
        sst_log_limit_work(&h->refusals, sst_clock_now_ns());
        pthread_mutex_lock(&h->lock);
        stop = h->stop;
        pthread_mutex_unlock(&h->lock);
    }
    h->event = NULL; /* connections end by the head's own doing from now on */
    for (int i = 0; i < CONNECTIONS; i++)
        if (h->connection[i].stream.fd >= 0)
            end(h, &h->connection[i], "the head ends");
    sst_log_limit_work(&h->strangers, INT64_MAX);
    sst_log_limit_work(&h->refusals, INT64_MAX);
    free(h->connection);
    return NULL;
}
