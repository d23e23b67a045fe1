/* A set's way by datagrams: cut into pieces with parity, paced, repaired over TLS where too many were lost.
 *
 * A lost packet costs TCP, and all packets behind it, a round trip. Lost pieces cost nothing while parity lasts. Where
 * a firewall drops datagrams, sets go over TLS until another attempt succeeds. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/link/link_internal.h"

#define BURST     16                  /* datagrams at once, and a millisecond later the next, ... */
#define PART      4                   /* ... or more, so that a set takes at most this part of a period */
#define DRY_SETS  3                   /* of which nothing arrives: datagrams are given up */
#define PAUSE_NS  INT64_C(100000000)  /* until another attempt; doubled with each, */
#define DRY_NS    INT64_C(5000000000) /* ... and at least this where the connection stands and nothing arrives */
#define PAUSE_MAX INT64_C(60000000000)
#define FIRST_NS  INT64_C(1500000000) /* sets wait for the first connection: over TLS they would be late, too */

int node_datagrams_open(struct sst_link_node *n)
{
    n->by.sending = -1;
    if (!n->array.hosts.datagrams)
        snprintf(n->state.datagrams_reason, sizeof(n->state.datagrams_reason), "hosts: datagrams is false");
    else if (!sst_pieces_built())
        snprintf(n->state.datagrams_reason, sizeof(n->state.datagrams_reason), "built without ISA-L");
    else
        return sst_pieces_coder_create(&n->by.coder);
    return 0;
}

void node_datagrams_close(struct sst_link_node *n)
{
    link_dtls_close(n->by.dtls);
    n->by.dtls = NULL;
    sst_pieces_coder_destroy(n->by.coder);
    n->by.coder = NULL;
    for (int i = 0; i < NODE_FLIGHT_MAX; i++) {
        sst_mem_kept_fini(&n->by.pieces[i].kept);
        n->by.pieces[i] = (struct node_pieces){ 0 };
    }
}

static void note(struct sst_link_node *n, bool used, const char *why)
{
    bool changed;

    pthread_mutex_lock(&n->lock);
    changed = n->state.datagrams != used || strcmp(n->state.datagrams_reason, why) != 0;
    n->state.datagrams = used;
    snprintf(n->state.datagrams_reason, sizeof(n->state.datagrams_reason), "%s", why);
    pthread_mutex_unlock(&n->lock);
    if (changed && used)
        sst_log_info("hosts: pictures go to the head by datagrams");
    else if (changed && *why)
        sst_log_warning("hosts: pictures go to the head over TLS: %s", why);
}

void node_datagrams_begin(struct sst_link_node *n, uint64_t session)
{
    n->by.session = n->by.coder ? session : 0;
    n->by.retry_ns = 0;
    n->by.first_ns = sst_clock_now_ns() + FIRST_NS;
    n->by.pause_ns = PAUSE_NS;
    n->by.dry = 0;
    if (n->by.coder)
        note(n, false, session ? "" : "the head takes no datagrams: see its hosts: datagrams, and sst version there");
}

void node_datagrams_end(struct sst_link_node *n)
{
    link_dtls_close(n->by.dtls);
    n->by.dtls = NULL;
    n->by.session = 0;
    n->by.sending = -1; /* its flight is lost, or received */
    if (n->by.coder)
        note(n, false, "");
}

bool node_datagrams_ready(const struct sst_link_node *n)
{
    return link_dtls_ready(n->by.dtls);
}

bool node_datagrams_busy(const struct sst_link_node *n)
{
    return n->by.sending >= 0;
}

bool node_datagrams_soon(const struct sst_link_node *n)
{
    return n->by.session && !link_dtls_ready(n->by.dtls) && sst_clock_now_ns() < n->by.first_ns;
}

/* --- sending ------------------------------------------------------------------------------------------------------ */

static int offer(struct sst_link_node *n)
{
    const struct sst_pieces_shape *s = &n->by.pieces[n->by.sending].shape;
    uint8_t *at = link_stream_add(&n->stream, MESSAGE_OFFER, WIRE_OFFER_BYTES);

    n->by.sending = -1;
    if (!at)
        return -ENOMEM;
    wire_put_u64(at, n->by.seq);
    wire_put_u64(at + 8, (uint64_t)s->parity << 32 | s->bytes);
    return 0;
}

/* Over TLS from now on. The head asks for pieces that were not sent any more. */
static int give_up(struct sst_link_node *n, int64_t now_ns, const char *why)
{
    link_dtls_close(n->by.dtls);
    n->by.dtls = NULL;
    n->by.retry_ns = now_ns + n->by.pause_ns;
    n->by.pause_ns = n->by.pause_ns < PAUSE_MAX / 2 ? 2 * n->by.pause_ns : PAUSE_MAX;
    note(n, false, why);
    return n->by.sending >= 0 ? offer(n) : 0;
}

int node_datagrams_room(struct sst_link_node *n, size_t bytes)
{
    struct sst_pieces_shape shape;
    uint8_t *data;
    int place = 0;

    if (sst_pieces_shape(&shape, bytes, sst_pieces_parity(bytes, n->array.hosts.parity)))
        return -1;
    while (place < NODE_FLIGHT_MAX && n->by.pieces[place].used)
        place++;
    if (place == NODE_FLIGHT_MAX)
        return -1;
    data = sst_mem_keep(&n->by.pieces[place].kept, (size_t)shape.all, shape.piece);
    if (!data)
        return -1;
    n->by.pieces[place].data = data;
    n->by.pieces[place].shape = shape;
    return place;
}

void node_datagrams_send(struct sst_link_node *n, int place, uint64_t seq)
{
    struct node_pieces *p = &n->by.pieces[place];
    const size_t data_bytes = (size_t)p->shape.data * p->shape.piece;
    const int spread_ms = sst_max_int(1, (int)(1000 / n->sent.trigger_hz) / PART);

    memset(p->data + p->shape.bytes, 0, data_bytes - p->shape.bytes);
    sst_pieces_encode(n->by.coder, &p->shape, p->data);
    p->used = true;
    n->by.sending = place;
    n->by.seq = seq;
    n->by.next = 0;
    n->by.each_ms = sst_max_int(BURST, (p->shape.all + spread_ms - 1) / spread_ms);
    n->by.began_ns = sst_clock_now_ns();
}

static int send_piece(struct sst_link_node *n, const struct node_pieces *p)
{
    uint8_t datagram[SST_PIECE_HEAD + SST_PIECE_BYTES];
    const struct sst_piece piece = { .session = n->by.session,
                                     .seq = n->by.seq,
                                     .bytes = p->shape.bytes,
                                     .index = n->by.next,
                                     .parity = p->shape.parity };

    sst_piece_put(datagram, &piece);
    memcpy(datagram + SST_PIECE_HEAD, p->data + (size_t)n->by.next * p->shape.piece, p->shape.piece);
    return link_dtls_send(n->by.dtls, datagram, SST_PIECE_HEAD + p->shape.piece);
}

/* Pieces that are due. */
static int send_due(struct sst_link_node *n, int64_t now_ns)
{
    const struct node_pieces *p = &n->by.pieces[n->by.sending];
    const int64_t due = n->by.each_ms * (1 + (now_ns - n->by.began_ns) / 1000000);
    int sent = 0, err = 0;

    while (!err && n->by.next < p->shape.all && n->by.next < due) {
        err = send_piece(n, p);
        n->by.next += !err;
        sent += !err;
    }
    pthread_mutex_lock(&n->lock);
    n->state.sent_datagrams += (uint64_t)sent;
    n->state.sent_bytes += (uint64_t)sent * (SST_PIECE_HEAD + p->shape.piece);
    pthread_mutex_unlock(&n->lock);
    if (err && err != -EAGAIN) {
        char why[256];

        snprintf(why, sizeof(why), "UDP port %d of the head does not take datagrams", n->array.hosts.port);
        return give_up(n, now_ns, why);
    }
    return n->by.next == p->shape.all ? offer(n) : 0;
}

/* --- the connection ----------------------------------------------------------------------------------------------- */

static int connect_head(struct sst_link_node *n, int64_t now_ns)
{
    char why[256] = "", text[256];
    int err = 0;

    if (!n->by.dtls)
        err = link_dtls_open(&n->by.dtls, n->array.hosts.head, n->array.hosts.port, n->credentials);
    if (err)
        snprintf(why, sizeof(why), "%s", strerror(-err));
    else
        err = link_dtls_work(n->by.dtls, why);
    if (!err && link_dtls_ready(n->by.dtls) && strcmp(link_dtls_peer(n->by.dtls), n->array.hosts.head_name) != 0) {
        snprintf(why, sizeof(why), "its certificate is of another host");
        err = -EACCES;
    }
    if (err) {
        snprintf(text, sizeof(text), "UDP port %d of the head: %.200s", n->array.hosts.port, why);
        return give_up(n, now_ns, text);
    }
    if (link_dtls_ready(n->by.dtls))
        note(n, true, "");
    return 0;
}

int node_datagrams_work(struct sst_link_node *n, int64_t now_ns)
{
    int err = 0;

    if (!n->by.session || (!n->by.dtls && now_ns < n->by.retry_ns))
        return 0;
    err = connect_head(n, now_ns);
    if (!err && n->by.sending >= 0)
        err = send_due(n, now_ns);
    return err;
}

void node_datagrams_judge(struct sst_link_node *n, uint32_t arrived, int64_t now_ns)
{
    char why[256];

    n->by.dry = arrived ? 0 : n->by.dry + 1;
    if (arrived)
        n->by.pause_ns = PAUSE_NS;
    if (n->by.dry < DRY_SETS || !n->by.dtls)
        return;
    n->by.dry = 0;
    if (n->by.pause_ns < DRY_NS)
        n->by.pause_ns = DRY_NS;
    snprintf(why, sizeof(why), "datagrams do not arrive at UDP port %d of the head: does a firewall drop them?",
             n->array.hosts.port);
    if (give_up(n, now_ns, why))
        sst_log_warning("hosts: no memory for a message to the head"); /* it asks when the next one comes */
}

/* --- repair ------------------------------------------------------------------------------------------------------- */

/* @return the set's pieces; NULL with *gone: the node no longer has it, else it is on its way over TLS */
static const struct node_pieces *find(struct sst_link_node *n, uint64_t seq, bool *gone)
{
    const struct node_pieces *p = NULL;

    *gone = true;
    pthread_mutex_lock(&n->lock);
    for (int i = 0; i < n->flights; i++) {
        if (n->flight[i].seq != seq)
            continue;
        *gone = false;
        p = n->flight[i].pieces >= 0 ? &n->by.pieces[n->flight[i].pieces] : NULL;
    }
    pthread_mutex_unlock(&n->lock);
    return p;
}

int node_datagrams_repair(struct sst_link_node *n, const uint8_t *data, size_t bytes)
{
    const uint64_t seq = bytes >= 8 ? wire_get_u64(data) : 0;
    const struct node_pieces *p;
    size_t wanted, each;
    uint8_t *at;
    bool gone;

    if (bytes < 8 || bytes % 2)
        return -EBADMSG;
    p = find(n, seq, &gone);
    if (!p && !gone)
        return 0;
    wanted = !p ? 0 : bytes > 8 ? (bytes - 8) / 2 : (size_t)p->shape.data;
    if (p && wanted > (size_t)p->shape.data)
        return -EBADMSG;
    each = p ? WIRE_INDEX_BYTES + p->shape.piece : 0;
    at = link_stream_add(&n->stream, MESSAGE_REPAIR, WIRE_OFFER_BYTES + wanted * each);
    if (!at)
        return -ENOMEM;
    wire_put_u64(at, seq);
    wire_put_u64(at + 8, p ? (uint64_t)p->shape.parity << 32 | p->shape.bytes : 0);
    at += WIRE_OFFER_BYTES;
    for (size_t i = 0; i < wanted; i++, at += each) {
        const size_t index = bytes > 8 ? (size_t)data[8 + 2 * i] | (size_t)data[9 + 2 * i] << 8 : i;

        if (index >= (size_t)p->shape.data)
            return -EBADMSG;
        wire_put_u64(at, index);
        memcpy(at + WIRE_INDEX_BYTES, p->data + index * p->shape.piece, p->shape.piece);
    }
    pthread_mutex_lock(&n->lock);
    n->state.repaired += wanted;
    pthread_mutex_unlock(&n->lock);
    return 0;
}
