/* Fuzz target: what a node sends of its sets, by datagram and over TLS, in messages; datagrams get the session's
 * number, so that they are read at all. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "capture/link/link_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define SESSION UINT64_C(0xfeed)
#define MOST    (1 << 20)
#define STEP_NS INT64_C(30000000)

enum { DATAGRAM = 0, OFFER = 1, REPAIR = 2, WHOLE = 3 };

struct seed {
    uint8_t data[16384];
    size_t size;
};

static void add(struct seed *s, int kind, const uint8_t *data, size_t bytes)
{
    s->size += input_put_message(s->data + s->size, kind, data, bytes);
}

static void add_offer(struct seed *s, uint64_t seq, const struct sst_pieces_shape *shape)
{
    uint8_t offer[WIRE_OFFER_BYTES];

    wire_put_u64(offer, seq);
    wire_put_u64(offer + 8, (uint64_t)shape->parity << 32 | shape->bytes);
    add(s, OFFER, offer, sizeof(offer));
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static uint8_t pieces[16 * SST_PIECE_BYTES], one[SST_PIECE_HEAD + SST_PIECE_BYTES];
    struct sst_pieces_coder *coder;
    struct sst_pieces_shape shape;

    if (!sst_pieces_built() || sst_pieces_shape(&shape, 2500, 2) || sst_pieces_coder_create(&coder))
        return 0;
    for (int lost = 0; lost < 4; lost++) { /* pieces of set 1 that do not come; set 2 comes whole */
        static struct seed s;
        uint8_t repair[WIRE_OFFER_BYTES + WIRE_INDEX_BYTES + SST_PIECE_BYTES];

        s.size = 0;
        for (size_t i = 0; i < 2500; i++)
            pieces[i] = (uint8_t)(i * 7);
        wire_put_u64(pieces, 1);
        sst_pieces_encode(coder, &shape, pieces);
        for (int i = lost; i < shape.all; i++) {
            sst_piece_put(one, &(struct sst_piece){ SESSION, 1, 2500, i, 2, NULL });
            memcpy(one + SST_PIECE_HEAD, pieces + (size_t)i * shape.piece, shape.piece);
            add(&s, DATAGRAM, one, SST_PIECE_HEAD + shape.piece);
        }
        add_offer(&s, 1, &shape);
        memcpy(repair, s.data + s.size - WIRE_OFFER_BYTES, WIRE_OFFER_BYTES);
        wire_put_u64(repair + WIRE_OFFER_BYTES, 0);
        memcpy(repair + WIRE_OFFER_BYTES + WIRE_INDEX_BYTES, pieces, shape.piece);
        add(&s, REPAIR, repair, WIRE_OFFER_BYTES + (lost < 3 ? WIRE_INDEX_BYTES + shape.piece : 0));
        wire_put_u64(pieces, 2);
        add(&s, WHOLE, pieces, 300);
        seed_write("link_inbox", lost, s.data, s.size);
    }
    sst_pieces_coder_destroy(coder);
    return 0;
}

static int deliver(struct link_inbox *in, const struct input_message *m, int64_t now_ns)
{
    switch (m->kind) {
    case DATAGRAM:
        if (m->bytes >= 8)
            wire_put_u64(m->data, SESSION);
        return link_inbox_datagram(in, m->data, m->bytes, now_ns);
    case OFFER:
        return link_inbox_offer(in, m->data, m->bytes, now_ns);
    case REPAIR:
        return link_inbox_repair(in, m->data, m->bytes, now_ns);
    default:
        return link_inbox_whole(in, m->data, m->bytes, now_ns);
    }
}

static void settle(struct link_inbox *in, int64_t now_ns)
{
    static uint16_t index[SST_PIECES_DATA_MAX];
    struct link_inbox_set set;
    uint64_t seq;
    int n, sum = 0;

    while (link_inbox_next(in, now_ns, &set))
        for (size_t i = 0; set.data && i < set.bytes; i++)
            sum += set.data[i];
    while (link_inbox_ask(in, now_ns, &seq, index, &n))
        if (n < 0 || n > SST_PIECES_DATA_MAX)
            abort();
    if (sum < 0)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct input_message message = { 0 };
    int64_t now_ns = 1;
    struct link_inbox *in;

    if (link_inbox_create(&in, SESSION, 1, MOST, 10 * STEP_NS))
        abort();
    while (input_next_message(&message, &data, &size)) {
        if (deliver(in, &message, now_ns)) {
            /* refused */
        }
        settle(in, now_ns);
        now_ns += STEP_NS;
    }
    settle(in, now_ns + 100 * STEP_NS);
    link_inbox_destroy(in);
    return 0;
}
