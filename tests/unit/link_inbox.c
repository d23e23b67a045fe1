/* capture/link/inbox: what came of a node, by datagram and over TLS, becomes sets in their order; what does not come is
 * asked for once, and missed when its time is over; datagrams of anybody do no harm. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "capture/link/link_internal.h"
#include "tests/test.h"

#if WITH_ISAL

#define SESSION  UINT64_C(0xfeed)
#define DEADLINE INT64_C(600000000)
#define MS       INT64_C(1000000)
#define MOST     (1 << 20)

static struct sst_pieces_coder *coder;
static struct link_inbox *in;
static uint64_t state = 1;

static unsigned next_random(unsigned below)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (unsigned)(state >> 33) % below;
}

static int set_up(void **unused SST_UNUSED)
{
    int err = sst_pieces_coder_create(&coder);

    return err ? err : link_inbox_create(&in, SESSION, 1, MOST, DEADLINE);
}

static int tear_down(void **unused SST_UNUSED)
{
    link_inbox_destroy(in);
    sst_pieces_coder_destroy(coder);
    return 0;
}

/* --- a set, as a node has it -------------------------------------------------------------------------------------- */

struct message {
    uint64_t seq;
    struct sst_pieces_shape shape;
    uint8_t *pieces;
};

static struct message make(uint64_t seq, size_t bytes)
{
    struct message m = { .seq = seq };

    assert_int_equal(sst_pieces_shape(&m.shape, bytes, sst_pieces_parity(bytes, 10)), 0);
    m.pieces = calloc((size_t)m.shape.all, m.shape.piece);
    assert_non_null(m.pieces);
    for (size_t i = 8; i < bytes; i++)
        m.pieces[i] = (uint8_t)next_random(256);
    wire_put_u64(m.pieces, seq);
    sst_pieces_encode(coder, &m.shape, m.pieces);
    return m;
}

static int send_as(const struct message *m, int index, uint64_t session, int64_t now_ns)
{
    const size_t bytes = SST_PIECE_HEAD + m->shape.piece;
    uint8_t *datagram = malloc(bytes);
    int err;

    assert_non_null(datagram);
    sst_piece_put(
        datagram,
        &(struct sst_piece){
            .session = session, .seq = m->seq, .bytes = m->shape.bytes, .index = index, .parity = m->shape.parity });
    memcpy(datagram + SST_PIECE_HEAD, m->pieces + (size_t)index * m->shape.piece, m->shape.piece);
    err = link_inbox_datagram(in, datagram, bytes, now_ns);
    free(datagram);
    return err;
}

static void send_pieces(const struct message *m, int from, int to, int64_t now_ns)
{
    for (int i = from; i < to; i++)
        assert_int_equal(send_as(m, i, SESSION, now_ns), 0);
}

static void offer(const struct message *m, int64_t now_ns)
{
    uint8_t bytes[WIRE_OFFER_BYTES];

    wire_put_u64(bytes, m->seq);
    wire_put_u64(bytes + 8, (uint64_t)m->shape.parity << 32 | m->shape.bytes);
    assert_int_equal(link_inbox_offer(in, bytes, sizeof(bytes), now_ns), 0);
}

static int repair(const struct message *m, const uint16_t *index, int n, int64_t now_ns)
{
    const size_t each = WIRE_INDEX_BYTES + m->shape.piece, bytes = WIRE_OFFER_BYTES + (size_t)n * each;
    uint8_t *message = malloc(bytes);
    int err;

    assert_non_null(message);
    wire_put_u64(message, m->seq);
    wire_put_u64(message + 8, (uint64_t)m->shape.parity << 32 | m->shape.bytes);
    for (int i = 0; i < n; i++) {
        const size_t k = index ? index[i] : (size_t)i;

        wire_put_u64(message + WIRE_OFFER_BYTES + (size_t)i * each, k);
        memcpy(message + WIRE_OFFER_BYTES + (size_t)i * each + WIRE_INDEX_BYTES, m->pieces + k * m->shape.piece,
               m->shape.piece);
    }
    err = link_inbox_repair(in, message, bytes, now_ns);
    free(message);
    return err;
}

/* The next decided set is this one; missed: without its bytes. */
static void expect(const struct message *m, bool missed, int64_t now_ns)
{
    struct link_inbox_set set;

    assert_true(link_inbox_next(in, now_ns, &set));
    assert_true(set.seq == m->seq);
    assert_true(missed == !set.data);
    if (!missed) {
        assert_true(set.bytes == m->shape.bytes);
        assert_memory_equal(set.data, m->pieces, set.bytes);
    }
}

static void expect_none(int64_t now_ns)
{
    struct link_inbox_set set;

    assert_false(link_inbox_next(in, now_ns, &set));
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static void sets_come_in_their_order(void **unused SST_UNUSED)
{
    struct message one = make(1, 143000), two = make(2, 700), three = make(3, 200000);

    expect_none(0);
    assert_false(link_inbox_waits(in));
    send_pieces(&two, 0, 1, 0);
    send_pieces(&three, 5, three.shape.all, 0);
    expect_none(1);
    assert_true(link_inbox_waits(in));
    send_pieces(&one, 9, one.shape.all, 0);
    expect(&one, false, 2);
    expect(&two, false, 2);
    expect(&three, false, 2);
    expect_none(3);
    /* Later pieces of them are spare, and answered to nobody. */
    send_pieces(&one, 0, 9, 4);
    assert_int_equal(repair(&two, NULL, 1, 4), 0);
    expect_none(5);
    free(one.pieces);
    free(two.pieces);
    free(three.pieces);
}

static void what_is_lacking_is_asked_for_once(void **unused SST_UNUSED)
{
    struct message one = make(1, 143000), two = make(2, 143000);
    uint16_t index[SST_PIECES_DATA_MAX];
    struct link_inbox_counters count;
    uint64_t seq;
    int n;

    send_pieces(&one, 20, one.shape.all, 0); /* five more are lost than parity has */
    send_pieces(&two, 0, two.shape.data, 10 * MS);
    offer(&one, 20 * MS);
    assert_false(link_inbox_ask(in, 69 * MS, &seq, index, &n));
    assert_true(link_inbox_ask(in, 70 * MS, &seq, index, &n));
    assert_true(seq == 1);
    assert_int_equal(n, 20 - one.shape.parity);
    assert_false(link_inbox_ask(in, 500 * MS, &seq, index, &n));
    expect_none(80 * MS);
    assert_int_equal(repair(&one, index, n, 100 * MS), 0);
    expect(&one, false, 100 * MS);
    expect(&two, false, 100 * MS);
    link_inbox_count(in, &count);
    assert_int_equal(count.asked, 1);
    assert_int_equal(count.repaired, n);
    assert_int_equal(count.refused, 0);
    free(one.pieces);
    free(two.pieces);
}

/* A set of which no datagram arrives is known by its offer, or by the set behind it, and comes over TLS. */
static void a_set_without_a_datagram_is_repaired(void **unused SST_UNUSED)
{
    struct message one = make(1, 5000), two = make(2, 5000);
    uint16_t index[SST_PIECES_DATA_MAX];
    uint64_t seq;
    int n;

    send_pieces(&two, 0, two.shape.data, 0);
    assert_false(link_inbox_ask(in, 199 * MS, &seq, index, &n)); /* it may still be on its way over TLS */
    assert_true(link_inbox_ask(in, 200 * MS, &seq, index, &n));
    assert_true(seq == 1);
    assert_int_equal(n, 0);
    offer(&one, 202 * MS);
    assert_int_equal(repair(&one, NULL, one.shape.data, 210 * MS), 0);
    expect(&one, false, 210 * MS);
    expect(&two, false, 210 * MS);
    free(one.pieces);
    free(two.pieces);
}

static void what_does_not_come_in_time_is_missed(void **unused SST_UNUSED)
{
    struct message one = make(1, 143000), two = make(2, 700), three = make(3, 5000), four = make(4, 80);
    const uint8_t gone[WIRE_OFFER_BYTES] = { 3 };

    send_pieces(&one, 0, 3, 0);
    send_pieces(&two, 0, 1, 300 * MS);
    offer(&three, 300 * MS);
    assert_int_equal(link_inbox_whole(in, four.pieces, four.shape.bytes, 310 * MS), 0);
    expect_none(599 * MS);
    expect(&one, true, 600 * MS);
    expect(&two, false, 600 * MS);
    expect_none(700 * MS);
    assert_int_equal(link_inbox_repair(in, gone, sizeof(gone), 700 * MS), 0); /* the node no longer has it */
    expect(&three, true, 700 * MS);
    expect(&four, false, 700 * MS);
    assert_int_equal(link_inbox_whole(in, one.pieces, one.shape.bytes, 710 * MS), 0); /* too late */
    expect_none(720 * MS);
    free(one.pieces);
    free(two.pieces);
    free(three.pieces);
    free(four.pieces);
}

/* Of another connection, too far ahead, of another shape, twice: refused or spare; the set equals the one that the node
 * sent. */
static void pieces_that_do_not_fit_are_refused(void **unused SST_UNUSED)
{
    struct message one = make(1, 20000), other = make(1, 20001), far = make(1 + LINK_INBOX_SETS, 700),
                   large = make(2, MOST + 1);
    struct link_inbox_counters count;

    assert_int_equal(send_as(&one, 0, SESSION + 1, 0), -EBADMSG);
    assert_int_equal(send_as(&far, 0, SESSION, 0), -EBADMSG);
    assert_int_equal(send_as(&large, 0, SESSION, 0), -EBADMSG);
    send_pieces(&one, 0, 5, 0);
    send_pieces(&one, 0, 5, 0); /* replayed */
    assert_int_equal(send_as(&other, 6, SESSION, 0), -EBADMSG);
    send_pieces(&one, 5, one.shape.data, 0);
    expect(&one, false, 1);
    send_pieces(&one, 0, one.shape.data, 1); /* replayed when it is over */
    link_inbox_count(in, &count);
    assert_int_equal(count.refused, 4);
    assert_int_equal(count.spare, 5 + one.shape.data);
    free(one.pieces);
    free(other.pieces);
    free(far.pieces);
    free(large.pieces);
}

/* Messages and datagrams with random contents, beside a node's own: no set gets other bytes, none is lost. */
static void hostile_messages_do_no_harm(void **unused SST_UNUSED)
{
    int64_t now_ns = 0;
    int refused = 0;

    for (uint64_t seq = 1; seq <= 300; seq++) {
        struct message m = make(seq, 200 + next_random(30000));

        for (int i = 0; i < m.shape.all; i++, now_ns += 1000) {
            const size_t bytes = next_random(SST_PIECE_HEAD + SST_PIECE_BYTES + 20);
            uint8_t *noise = malloc(bytes ? bytes : 1); /* the sanitizer sees reads behind its end */
            struct sst_piece piece = { next_random(8) ? SESSION : 0, seq + LINK_INBOX_SETS + next_random(100),
                                       next_random(100000),          (int)next_random(100),
                                       (int)next_random(50),         NULL };

            assert_non_null(noise);
            for (size_t k = 0; k < bytes; k++)
                noise[k] = (uint8_t)next_random(256);
            if (bytes >= SST_PIECE_HEAD && next_random(2))
                sst_piece_put(noise, &piece);
            refused += link_inbox_datagram(in, noise, bytes, now_ns) == -EBADMSG;
            if (next_random(2) && bytes >= 8)
                wire_put_u64(noise, seq + LINK_INBOX_SETS + next_random(9)); /* too far ahead */
            refused += link_inbox_offer(in, noise, bytes, now_ns) == -EBADMSG;
            refused += link_inbox_repair(in, noise, bytes, now_ns) == -EBADMSG;
            free(noise);
            if (i % 9)
                (void)send_as(&m, i, SESSION, now_ns);
        }
        (void)repair(&m, NULL, m.shape.data, now_ns);
        expect(&m, false, now_ns);
        free(m.pieces);
    }
    assert_true(refused > 1000);
}

/* A set with frames or times that no node has. @return as wire_get_set() */
static int read_set(const struct wire_set *set, const struct wire_frame *frame, size_t bytes)
{
    const size_t size = WIRE_SET_BYTES + WIRE_FRAME_BYTES + bytes;
    uint8_t *message = calloc(size, 1);
    struct wire_frame got;
    struct wire_set out = { .cameras = 1 };
    int err;

    assert_non_null(message);
    wire_put_set(message, set);
    wire_put_frame(message + WIRE_SET_BYTES, frame);
    err = wire_get_set(message, size, link_frame_most(32, 16), &out, &got);
    free(message);
    return err;
}

static void sets_that_no_node_has_are_refused(void **unused SST_UNUSED)
{
    const struct wire_set set = {
        .seq = 1, .count = 5, .t_ns = 7, .wall_ns = INT64_C(1800000000000000000), .cameras = 1
    };
    const size_t most = link_frame_most(32, 16);
    const struct wire_frame frame = { .kind = WIRE_FRAME, .bytes = (uint32_t)most, .stride = 32, .from_set_ns = -5 };
    const int64_t times[] = { WIRE_AWAY_MAX_NS + 1, -WIRE_AWAY_MAX_NS - 1, INT64_MAX, INT64_MIN };
    struct wire_frame f = frame;
    struct wire_set s = set;

    assert_int_equal(read_set(&set, &frame, most), 0);
    f.bytes++; /* a message has room for as many as there are cameras of the array, a frame has not */
    assert_int_equal(read_set(&set, &f, most + 1), -EBADMSG);
    f = frame;
    f.stride = 0x80000000u;
    assert_int_equal(read_set(&set, &f, most), -EBADMSG);
    for (size_t i = 0; i < ARRAY_LEN(times); i++) {
        f = frame;
        f.from_set_ns = times[i];
        assert_int_equal(read_set(&set, &f, most), -EBADMSG);
    }
    s.t_ns = INT64_MAX / 2;
    assert_int_equal(read_set(&s, &frame, most), -EBADMSG);
    s = set;
    s.wall_ns = INT64_MAX;
    assert_int_equal(read_set(&s, &frame, most), -EBADMSG);
    s = set;
    s.count = INT64_MAX / 2;
    assert_int_equal(read_set(&s, &frame, most), -EBADMSG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sets_that_no_node_has_are_refused),
        cmocka_unit_test_setup_teardown(sets_come_in_their_order, set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_is_lacking_is_asked_for_once, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_set_without_a_datagram_is_repaired, set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_does_not_come_in_time_is_missed, set_up, tear_down),
        cmocka_unit_test_setup_teardown(pieces_that_do_not_fit_are_refused, set_up, tear_down),
        cmocka_unit_test_setup_teardown(hostile_messages_do_no_harm, set_up, tear_down),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}

#else

int main(void)
{
    puts("built without ISA-L: no datagrams");
    return 77;
}

#endif
