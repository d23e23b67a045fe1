/* Messages of one node on the head: pieces by datagram, repairs and whole messages over TLS become sets in their order.
 *
 * Order costs nothing while pieces suffice: a set's datagrams are there before the next edge. A set that waits for its
 * repair holds up later ones, which may name its pictures as unchanged. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "capture/link/link_internal.h"
#include "capture/link/pieces.h"

enum slot_state {
    SLOT_UNKNOWN = 0, /* nothing has come of it */
    SLOT_PIECES = 1,
    SLOT_WHOLE = 2,
    SLOT_GONE = 3, /* the node no longer has it */
};

struct slot {
    enum slot_state state;
    bool asked, offered;       /* offered: all of it has been sent */
    int64_t first_ns, last_ns; /* first known; last step forward */
    uint32_t datagrams;        /* of use */
    struct sst_pieces pieces;
    size_t bytes; /* when whole */
};

struct link_inbox {
    /* fixed after creation */
    struct sst_pieces_coder *coder; /* NULL: built without */
    uint64_t session;
    size_t most;
    int64_t deadline_ns;
    /* link thread */
    uint64_t next, known; /* number of the next set to decide; of the newest that is known, next - 1: none is */
    struct slot slot[LINK_INBOX_SETS];
    struct link_inbox_counters count;
};

int link_inbox_create(struct link_inbox **out, uint64_t session, uint64_t next, size_t most, int64_t deadline_ns)
{
    struct link_inbox *in = calloc(1, sizeof(*in));

    if (!in || (sst_pieces_built() && sst_pieces_coder_create(&in->coder))) {
        free(in);
        return -ENOMEM;
    }
    in->session = session;
    in->next = next;
    in->known = next - 1;
    in->most = most;
    in->deadline_ns = deadline_ns;
    *out = in;
    return 0;
}

void link_inbox_destroy(struct link_inbox *in)
{
    if (!in)
        return;
    for (int i = 0; i < LINK_INBOX_SETS; i++)
        sst_pieces_fini(&in->slot[i].pieces);
    sst_pieces_coder_destroy(in->coder);
    free(in);
}

static struct slot *slot_of(struct link_inbox *in, uint64_t seq)
{
    return &in->slot[seq % LINK_INBOX_SETS];
}

/* A set is known, and with it all before it. @return its slot; NULL: it is decided already, or too far ahead */
static struct slot *note(struct link_inbox *in, uint64_t seq, int64_t now_ns)
{
    if (seq < in->next || seq - in->next >= LINK_INBOX_SETS)
        return NULL;
    while (in->known < seq) {
        struct slot *s = slot_of(in, ++in->known);

        s->state = SLOT_UNKNOWN;
        s->asked = s->offered = false;
        s->first_ns = s->last_ns = now_ns;
        s->datagrams = 0;
    }
    return slot_of(in, seq);
}

static int shape_slot(struct link_inbox *in, struct slot *s, const struct sst_pieces_shape *shape)
{
    int err;

    if (s->state == SLOT_PIECES && (s->pieces.shape.bytes != shape->bytes || s->pieces.shape.parity != shape->parity))
        return -EBADMSG;
    if (s->state != SLOT_UNKNOWN)
        return 0;
    if (shape->bytes > in->most)
        return -EBADMSG;
    err = sst_pieces_begin(&s->pieces, shape);
    if (!err)
        s->state = SLOT_PIECES;
    return err;
}

/* @return true: it was new and of use */
static bool add_piece(struct link_inbox *in, struct slot *s, int index, const uint8_t *data, int64_t now_ns)
{
    if (s->state != SLOT_PIECES || !sst_pieces_add(&s->pieces, index, data))
        return false;
    s->last_ns = now_ns;
    if (sst_pieces_complete(&s->pieces)) {
        sst_pieces_restore(&s->pieces, in->coder);
        s->bytes = s->pieces.shape.bytes;
        s->state = SLOT_WHOLE;
    }
    return true;
}

/* --- input -------------------------------------------------------------------------------------------------------- */

int link_inbox_datagram(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns)
{
    struct sst_pieces_shape shape;
    struct sst_piece piece;
    struct slot *s;
    int err;

    in->count.datagrams++;
    if (!in->coder || sst_piece_get(data, bytes, &piece, &shape) || piece.session != in->session) {
        in->count.refused++;
        return -EBADMSG;
    }
    if (piece.seq < in->next) { /* enough had come */
        in->count.spare++;
        return 0;
    }
    s = note(in, piece.seq, now_ns);
    err = s ? shape_slot(in, s, &shape) : -EBADMSG;
    if (err) {
        in->count.refused++;
        return err;
    }
    if (add_piece(in, s, piece.index, piece.data, now_ns))
        s->datagrams++;
    else
        in->count.spare++;
    return 0;
}

int link_inbox_offer(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns)
{
    struct sst_pieces_shape shape;
    uint64_t seq;
    struct slot *s;

    if (bytes != WIRE_OFFER_BYTES || !in->coder ||
        sst_pieces_shape(&shape, (size_t)(uint32_t)wire_get_u64(data + 8), (int)(wire_get_u64(data + 8) >> 32)))
        return -EBADMSG;
    seq = wire_get_u64(data);
    if (seq < in->next)
        return 0;
    s = note(in, seq, now_ns);
    if (!s)
        return -EBADMSG;
    if (!s->offered) /* the last bytes sent may still come */
        s->last_ns = now_ns;
    s->offered = true;
    return shape_slot(in, s, &shape);
}

int link_inbox_repair(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns)
{
    struct slot *s;
    uint64_t seq;
    size_t each;
    int err;

    if (bytes < WIRE_OFFER_BYTES)
        return -EBADMSG;
    seq = wire_get_u64(data);
    if (seq < in->next) /* it was decided without */
        return 0;
    if (bytes == WIRE_OFFER_BYTES) {
        s = note(in, seq, now_ns);
        if (s && s->state < SLOT_WHOLE)
            s->state = SLOT_GONE;
        return s ? 0 : -EBADMSG;
    }
    err = link_inbox_offer(in, data, WIRE_OFFER_BYTES, now_ns);
    if (err)
        return err;
    s = slot_of(in, seq);
    if (s->state != SLOT_PIECES) /* a datagram has come late */
        return 0;
    each = WIRE_INDEX_BYTES + s->pieces.shape.piece;
    if ((bytes - WIRE_OFFER_BYTES) % each)
        return -EBADMSG;
    for (const uint8_t *at = data + WIRE_OFFER_BYTES; at < data + bytes; at += each) {
        const uint64_t index = wire_get_u64(at);

        if (index >= (uint64_t)s->pieces.shape.data)
            return -EBADMSG;
        in->count.repaired += add_piece(in, s, (int)index, at + WIRE_INDEX_BYTES, now_ns);
    }
    return 0;
}

int link_inbox_whole(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns)
{
    uint8_t *to;
    struct slot *s;

    if (bytes < WIRE_SET_BYTES || bytes > in->most)
        return -EBADMSG;
    if (wire_get_u64(data) < in->next) /* missed: one behind it came by datagrams, and this one was too slow */
        return 0;
    s = note(in, wire_get_u64(data), now_ns);
    if (!s || s->state != SLOT_UNKNOWN)
        return -EBADMSG;
    to = sst_mem_keep(&s->pieces.kept, bytes, 1);
    if (!to)
        return -ENOMEM;
    s->pieces.buffer = memcpy(to, data, bytes);
    s->bytes = bytes;
    s->state = SLOT_WHOLE;
    return 0;
}

/* --- decisions ---------------------------------------------------------------------------------------------------- */

bool link_inbox_next(struct link_inbox *in, int64_t now_ns, struct link_inbox_set *out)
{
    const struct slot *s = slot_of(in, in->next);

    if (in->known < in->next)
        return false;
    if (s->state != SLOT_WHOLE && s->state != SLOT_GONE && now_ns - s->first_ns < in->deadline_ns)
        return false;
    *out = (struct link_inbox_set){ .seq = in->next, .datagrams = s->datagrams };
    if (s->state == SLOT_WHOLE) {
        out->data = s->pieces.buffer;
        out->bytes = s->bytes;
    }
    in->next++;
    return true;
}

bool link_inbox_ask(struct link_inbox *in, int64_t now_ns, uint64_t *seq, uint16_t *index, int *n)
{
    for (uint64_t i = in->next; i <= in->known; i++) {
        struct slot *s = slot_of(in, i);

        if (s->state > SLOT_PIECES || s->asked || now_ns - s->last_ns < (s->offered ? LINK_QUIET_NS : LINK_SILENT_NS))
            continue;
        s->asked = true;
        in->count.asked++;
        *seq = i;
        *n = s->state == SLOT_PIECES ? sst_pieces_wanted(&s->pieces, index) : 0;
        return true;
    }
    return false;
}

bool link_inbox_waits(const struct link_inbox *in)
{
    return in->known >= in->next;
}

void link_inbox_count(const struct link_inbox *in, struct link_inbox_counters *out)
{
    *out = in->count;
}
