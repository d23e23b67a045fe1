/* capture/link/pieces: any pieces that suffice restore a message; parity is that of the plain formula; datagrams of
 * anybody are refused or harmless. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "capture/link/pieces.h"
#include "tests/test.h"

#if WITH_ISAL

static uint64_t state = 1;

static unsigned next_random(unsigned below)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (unsigned)(state >> 33) % below;
}

/* --- the plain formula -------------------------------------------------------------------------------------------- */

static uint8_t multiply(uint8_t a, uint8_t b)
{
    unsigned product = 0, x = a;

    for (; b; b >>= 1, x = x << 1 ^ (x & 0x80 ? 0x11d : 0))
        product ^= b & 1 ? x : 0;
    return (uint8_t)product;
}

static uint8_t invert(uint8_t a)
{
    for (unsigned b = 1; b < 256; b++)
        if (multiply(a, (uint8_t)b) == 1)
            return (uint8_t)b;
    return 0;
}

static uint8_t plain_parity(const struct sst_pieces_shape *s, const uint8_t *pieces, int block, int r, int byte)
{
    const int k = (s->data - block + s->blocks - 1) / s->blocks;
    uint8_t sum = 0;

    for (int j = 0; j < k; j++)
        sum ^=
            multiply(invert((uint8_t)((k + r) ^ j)), pieces[(size_t)(block + j * s->blocks) * s->piece + (size_t)byte]);
    return sum;
}

/* --- messages ----------------------------------------------------------------------------------------------------- */

static struct sst_pieces_coder *coder;

static int set_up(void **unused SST_UNUSED)
{
    return sst_pieces_coder_create(&coder);
}

static int tear_down(void **unused SST_UNUSED)
{
    sst_pieces_coder_destroy(coder);
    return 0;
}

static uint8_t *make(struct sst_pieces_shape *s, size_t bytes, int parity)
{
    uint8_t *pieces;

    assert_int_equal(sst_pieces_shape(s, bytes, parity), 0);
    pieces = calloc((size_t)s->all, SST_PIECE_BYTES);
    assert_non_null(pieces);
    for (size_t i = 0; i < bytes; i++)
        pieces[i] = (uint8_t)next_random(256);
    sst_pieces_encode(coder, s, pieces);
    return pieces;
}

static const size_t sizes[] = {
    1, 40, 1152, 1153, 2304, 143000, 147456, 147457, 1152 * 257 + 9, SST_PIECES_MESSAGE_MAX
};

static void parity_is_that_of_the_formula(void **unused SST_UNUSED)
{
    struct sst_pieces_shape s;
    uint8_t *pieces = make(&s, 1152 * 129 + 5, 7);

    assert_int_equal(s.data, 130);
    assert_int_equal(s.blocks, 2);
    for (int i = s.data; i < s.all; i++)
        for (int byte = 0; byte < (int)s.piece; byte += 50)
            assert_int_equal(pieces[(size_t)i * s.piece + (size_t)byte],
                             plain_parity(&s, pieces, (i - s.data) % 2, (i - s.data) / 2, byte));
    free(pieces);
}

/* As many pieces as parity has, of each block, are lost at random; the others come in any order, some twice. */
static void what_suffices_restores(void **unused SST_UNUSED)
{
    struct sst_pieces p = { 0 };

    for (size_t n = 0; n < ARRAY_LEN(sizes); n++) {
        struct sst_pieces_shape s;
        uint8_t *pieces = make(&s, sizes[n], sst_pieces_parity(sizes[n], 10));
        int *order = malloc(sizeof(*order) * (size_t)s.all), came = 0;

        assert_non_null(order);
        for (int i = 0; i < s.all; i++)
            order[i] = i;
        for (int i = s.all - 1; i > 0; i--) {
            const int o = (int)next_random((unsigned)i + 1), swap = order[i];

            order[i] = order[o];
            order[o] = swap;
        }
        assert_int_equal(sst_pieces_begin(&p, &s), 0);
        memset(p.buffer, 0xee, p.kept.bytes); /* earlier contents are not used */
        for (int i = 0; i < s.all && !sst_pieces_complete(&p); i++) {
            came += sst_pieces_add(&p, order[i], pieces + (size_t)order[i] * s.piece);
            assert_false(sst_pieces_add(&p, order[i], pieces));
        }
        assert_true(sst_pieces_complete(&p));
        assert_int_equal(came, s.data);
        sst_pieces_restore(&p, coder);
        assert_memory_equal(p.buffer, pieces, sizes[n]);
        free(order);
        free(pieces);
    }
    sst_pieces_fini(&p);
}

/* All parity is used: the first pieces of each block are lost. */
static void as_many_as_parity_may_be_lost(void **unused SST_UNUSED)
{
    for (int parity = 1; parity <= SST_PIECES_PARITY_MAX; parity += 37) {
        struct sst_pieces_shape s;
        struct sst_pieces p = { 0 };
        uint8_t *pieces = make(&s, 150 * SST_PIECE_BYTES, parity);
        uint16_t wanted[SST_PIECES_DATA_MAX];
        const int lost = sst_min_int(parity * s.blocks, s.data);

        assert_int_equal(sst_pieces_begin(&p, &s), 0);
        for (int i = lost; i < s.all - 1; i++)
            (void)sst_pieces_add(&p, i, pieces + (size_t)i * s.piece);
        if (lost == parity * s.blocks) { /* one too few */
            assert_false(sst_pieces_complete(&p));
            assert_int_equal(sst_pieces_wanted(&p, wanted), 1);
            assert_int_equal((s.all - 1 - s.data) % s.blocks, wanted[0] % s.blocks);
            assert_true(sst_pieces_add(&p, wanted[0], pieces + (size_t)wanted[0] * s.piece));
        }
        assert_true(sst_pieces_complete(&p));
        sst_pieces_restore(&p, coder);
        assert_memory_equal(p.buffer, pieces, s.bytes);
        sst_pieces_fini(&p);
        free(pieces);
    }
}

static void shapes_out_of_bounds_are_refused(void **unused SST_UNUSED)
{
    struct sst_pieces_shape s = { .all = 7 };

    assert_int_equal(sst_pieces_shape(&s, 0, 2), -EINVAL);
    assert_int_equal(sst_pieces_shape(&s, SST_PIECES_MESSAGE_MAX + 1, 2), -EINVAL);
    assert_int_equal(sst_pieces_shape(&s, 100, -1), -EINVAL);
    assert_int_equal(sst_pieces_shape(&s, 100, SST_PIECES_PARITY_MAX + 1), -EINVAL);
    assert_int_equal(s.all, 7);
    for (int percent = 0; percent <= 80; percent += 8)
        for (size_t n = 0; n < ARRAY_LEN(sizes); n++) {
            assert_int_equal(sst_pieces_shape(&s, sizes[n], sst_pieces_parity(sizes[n], percent)), 0);
            assert_true(s.blocks <= SST_PIECES_BLOCKS_MAX && s.data <= SST_PIECES_DATA_MAX && s.all <= UINT16_MAX);
            assert_true((s.data + s.blocks - 1) / s.blocks + s.parity <= 256);
        }
}

/* --- datagrams ---------------------------------------------------------------------------------------------------- */

static void a_piece_as_bytes_is_the_same_piece(void **unused SST_UNUSED)
{
    uint8_t bytes[SST_PIECE_HEAD + SST_PIECE_BYTES] = { 0 };
    const struct sst_piece piece = { 0x1122334455667788, 99, 143000, 120, 14, bytes + SST_PIECE_HEAD };
    struct sst_pieces_shape s;
    struct sst_piece got;

    sst_piece_put(bytes, &piece);
    assert_int_equal(sst_piece_get(bytes, SST_PIECE_HEAD + 1144, &got, &s), 0);
    assert_true(got.session == piece.session && got.seq == 99 && got.bytes == 143000 && got.index == 120);
    assert_true(got.parity == 14 && got.data == bytes + SST_PIECE_HEAD);
    assert_int_equal(s.data, 125);
    assert_int_equal(s.piece, 1144);
    assert_int_equal(sst_piece_get(bytes, SST_PIECE_HEAD + 1143, &got, &s), -EBADMSG);
    assert_int_equal(sst_piece_get(bytes, SST_PIECE_HEAD - 1, &got, &s), -EBADMSG);
    assert_int_equal(sst_piece_get(bytes, 0, &got, &s), -EBADMSG);
}

/* Random bytes, and true pieces of which some bytes were changed: accepted ones lie inside of their message. */
static void hostile_datagrams_are_refused_or_harmless(void **unused SST_UNUSED)
{
    struct sst_pieces p = { 0 };
    int refused = 0, accepted = 0;

    for (int n = 0; n < 20000; n++) {
        struct sst_piece piece = { 1, 2, 1 + next_random(500000), (int)next_random(500), (int)next_random(200), NULL };
        uint8_t head[SST_PIECE_HEAD], *bytes;
        struct sst_pieces_shape s;
        size_t size = SST_PIECE_HEAD;

        if (!sst_pieces_shape(&s, piece.bytes, piece.parity))
            size += s.piece;
        if (n % 10 == 0)
            size = next_random(SST_PIECE_HEAD + SST_PIECE_BYTES);
        sst_piece_put(head, &piece);
        for (unsigned i = next_random(4); i; i--)
            head[next_random(SST_PIECE_HEAD)] = (uint8_t)next_random(256);
        bytes = malloc(size ? size : 1); /* the sanitizer sees reads behind its end */
        assert_non_null(bytes);
        memset(bytes, 0xa5, size);
        memcpy(bytes, head, size < sizeof(head) ? size : sizeof(head));
        if (sst_piece_get(bytes, size, &piece, &s)) {
            refused++;
        } else {
            accepted++;
            assert_true(piece.index < s.all && s.bytes <= SST_PIECES_MESSAGE_MAX && s.piece <= SST_PIECE_BYTES);
            assert_int_equal(sst_pieces_begin(&p, &s), 0);
            (void)sst_pieces_add(&p, piece.index, piece.data);
        }
        free(bytes);
    }
    assert_true(refused > 1000 && accepted > 1000);
    sst_pieces_fini(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parity_is_that_of_the_formula),
        cmocka_unit_test(what_suffices_restores),
        cmocka_unit_test(as_many_as_parity_may_be_lost),
        cmocka_unit_test(shapes_out_of_bounds_are_refused),
        cmocka_unit_test(a_piece_as_bytes_is_the_same_piece),
        cmocka_unit_test(hostile_datagrams_are_refused_or_harmless),
    };

    return cmocka_run_group_tests(tests, set_up, tear_down);
}

#else

int main(void)
{
    puts("built without ISA-L: no datagrams");
    return 77;
}

#endif
