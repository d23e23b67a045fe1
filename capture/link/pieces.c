/* Messages cut into pieces, by ISA-L's erasure codes.
 *
 * ISA-L (Intel, BSD licence, in Debian for amd64 and arm64) has the one operation that is needed, the product of a
 * matrix over GF(2^8) and rows of bytes, for every level of SIMD, chosen at run time, and leaves matrix and bookkeeping
 * to the caller. zfec is as old and slower, Jerasure is no longer maintained, and codes for long messages (LDPC,
 * RaptorQ) have no library in Debian and gain nothing at some hundred pieces. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/link/pieces.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define PARITY_LEAST 2 /* also of a message of one piece */
#define HAVE_MAX     (SST_PIECES_DATA_MAX + SST_PIECES_BLOCKS_MAX * SST_PIECES_PARITY_MAX)

/* --- shape -------------------------------------------------------------------------------------------------------- */

bool sst_pieces_built(void)
{
    return WITH_ISAL;
}

static int data_pieces(size_t bytes)
{
    return (int)((bytes + SST_PIECE_BYTES - 1) / SST_PIECE_BYTES);
}

int sst_pieces_parity(size_t bytes, int percent)
{
    const int data = data_pieces(bytes < SST_PIECES_MESSAGE_MAX ? bytes : SST_PIECES_MESSAGE_MAX);
    const int blocks = (data + SST_PIECES_BLOCK_MAX - 1) / SST_PIECES_BLOCK_MAX;
    const int largest = blocks ? (data + blocks - 1) / blocks : 0;

    return PARITY_LEAST + (largest * percent + 50) / 100;
}

int sst_pieces_shape(struct sst_pieces_shape *out, size_t bytes, int parity)
{
    struct sst_pieces_shape s = { .bytes = (uint32_t)bytes, .parity = parity };

    if (!bytes || bytes > SST_PIECES_MESSAGE_MAX || parity < 0 || parity > SST_PIECES_PARITY_MAX)
        return -EINVAL;
    s.data = data_pieces(bytes);
    s.blocks = (s.data + SST_PIECES_BLOCK_MAX - 1) / SST_PIECES_BLOCK_MAX;
    s.all = s.data + s.blocks * parity;
    s.piece = (bytes + (size_t)s.data - 1) / (size_t)s.data;
    *out = s;
    return 0;
}

static int block_of(const struct sst_pieces_shape *s, int index)
{
    return (index < s->data ? index : index - s->data) % s->blocks;
}

/* Data pieces of a block. */
static int block_size(const struct sst_pieces_shape *s, int block)
{
    return (s->data - block + s->blocks - 1) / s->blocks;
}

/* --- datagrams ---------------------------------------------------------------------------------------------------- */

static void put(uint8_t *out, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        out[i] = (uint8_t)(value >> 8 * i);
}

static uint64_t get(const uint8_t *in, int bytes)
{
    uint64_t value = 0;

    for (int i = 0; i < bytes; i++)
        value |= (uint64_t)in[i] << 8 * i;
    return value;
}

void sst_piece_put(uint8_t out[SST_PIECE_HEAD], const struct sst_piece *piece)
{
    put(out, piece->session, 8);
    put(out + 8, piece->seq, 8);
    put(out + 16, piece->bytes, 4);
    put(out + 20, (uint64_t)piece->index, 2);
    put(out + 22, (uint64_t)piece->parity, 2);
}

int sst_piece_get(const uint8_t *in, size_t bytes, struct sst_piece *piece, struct sst_pieces_shape *shape)
{
    struct sst_pieces_shape s;
    struct sst_piece p;

    if (bytes < SST_PIECE_HEAD)
        return -EBADMSG;
    p = (struct sst_piece){ .session = get(in, 8),
                            .seq = get(in + 8, 8),
                            .bytes = (uint32_t)get(in + 16, 4),
                            .index = (int)get(in + 20, 2),
                            .parity = (int)get(in + 22, 2),
                            .data = in + SST_PIECE_HEAD };
    if (sst_pieces_shape(&s, p.bytes, p.parity) || p.index >= s.all || bytes != SST_PIECE_HEAD + s.piece)
        return -EBADMSG;
    *piece = p;
    *shape = s;
    return 0;
}

/* --- receiving ---------------------------------------------------------------------------------------------------- */

int sst_pieces_begin(struct sst_pieces *p, const struct sst_pieces_shape *shape)
{
    uint8_t *buffer = sst_mem_keep(&p->kept, (size_t)shape->all, shape->piece);

    if (!p->have)
        p->have = malloc(HAVE_MAX);
    if (!p->have || !buffer)
        return -ENOMEM;
    p->buffer = buffer;
    p->shape = *shape;
    p->blocks_whole = 0;
    memset(p->have, 0, (size_t)shape->all);
    memset(p->got, 0, sizeof(p->got));
    return 0;
}

bool sst_pieces_add(struct sst_pieces *p, int index, const uint8_t *data)
{
    const int block = block_of(&p->shape, index), need = block_size(&p->shape, block);

    assert(index >= 0 && index < p->shape.all);
    if (p->have[index] || p->got[block] >= need)
        return false;
    memcpy(p->buffer + (size_t)index * p->shape.piece, data, p->shape.piece);
    p->have[index] = 1;
    p->blocks_whole += ++p->got[block] == need;
    return true;
}

bool sst_pieces_complete(const struct sst_pieces *p)
{
    return p->shape.blocks > 0 && p->blocks_whole == p->shape.blocks;
}

int sst_pieces_wanted(const struct sst_pieces *p, uint16_t *index)
{
    int n = 0;

    for (int block = 0; block < p->shape.blocks; block++) {
        int need = block_size(&p->shape, block) - p->got[block];

        for (int i = block; need > 0 && i < p->shape.data; i += p->shape.blocks)
            if (!p->have[i]) {
                index[n++] = (uint16_t)i;
                need--;
            }
    }
    return n;
}

void sst_pieces_fini(struct sst_pieces *p)
{
    sst_mem_kept_fini(&p->kept);
    free(p->have);
    *p = (struct sst_pieces){ 0 };
}

/* --- coding ------------------------------------------------------------------------------------------------------- */

#if WITH_ISAL

#include <isa-l/erasure_code.h>

struct sst_pieces_coder {
    uint8_t row[SST_PIECES_PARITY_MAX * SST_PIECES_BLOCK_MAX];
    uint8_t inverse[SST_PIECES_PARITY_MAX * SST_PIECES_PARITY_MAX];
    uint8_t table[32 * SST_PIECES_PARITY_MAX * SST_PIECES_BLOCK_MAX];
    uint8_t sum[SST_PIECES_PARITY_MAX][SST_PIECE_BYTES];
    uint8_t zero[SST_PIECE_BYTES];
    uint8_t *in[SST_PIECES_BLOCK_MAX], *out[SST_PIECES_PARITY_MAX];
    int lost[SST_PIECES_PARITY_MAX], used[SST_PIECES_PARITY_MAX]; /* data pieces of a block; parity rows for them */
};

int sst_pieces_coder_create(struct sst_pieces_coder **out)
{
    struct sst_pieces_coder *c = calloc(1, sizeof(*c));

    if (!c)
        return -ENOMEM;
    *out = c;
    return 0;
}

void sst_pieces_coder_destroy(struct sst_pieces_coder *c)
{
    free(c);
}

static uint8_t coefficient(int k, int r, int j)
{
    return gf_inv((unsigned char)((k + r) ^ j));
}

/* c->out[i] = parity row rows[i] over c->in. @param rows  NULL: 0, 1, 2 ... */
static void compute_parity(struct sst_pieces_coder *c, size_t piece, int k, const int *rows, int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < k; j++)
            c->row[i * k + j] = coefficient(k, rows ? rows[i] : i, j);
    ec_init_tables(k, n, c->row, c->table);
    ec_encode_data((int)piece, k, n, c->table, c->in, c->out);
}

static uint8_t *data_piece(uint8_t *pieces, const struct sst_pieces_shape *s, int block, int j)
{
    return pieces + (size_t)(block + j * s->blocks) * s->piece;
}

static int parity_index(const struct sst_pieces_shape *s, int block, int r)
{
    return s->data + r * s->blocks + block;
}

void sst_pieces_encode(struct sst_pieces_coder *c, const struct sst_pieces_shape *s, uint8_t *pieces)
{
    for (int block = 0; s->parity && block < s->blocks; block++) {
        const int k = block_size(s, block);

        for (int j = 0; j < k; j++)
            c->in[j] = data_piece(pieces, s, block, j);
        for (int r = 0; r < s->parity; r++)
            c->out[r] = pieces + (size_t)parity_index(s, block, r) * s->piece;
        compute_parity(c, s->piece, k, NULL, s->parity);
    }
}

/* Which data pieces are lost, and as many parity rows that came. @return how many */
static int find_lost(struct sst_pieces_coder *c, const struct sst_pieces *p, int block, int k)
{
    const struct sst_pieces_shape *s = &p->shape;
    int lost = 0, used = 0;

    for (int j = 0; j < k; j++) {
        const int index = block + j * s->blocks;

        c->in[j] = p->have[index] ? p->buffer + (size_t)index * s->piece : c->zero;
        if (!p->have[index])
            c->lost[lost++] = j;
    }
    for (int r = 0; r < s->parity && used < lost; r++)
        if (p->have[parity_index(s, block, r)])
            c->used[used++] = r;
    assert(used == lost);
    return lost;
}

/* The parity of received pieces, added to the received parity, is the parity of the lost pieces alone: n equations for
 * n pieces. */
static void restore_block(struct sst_pieces_coder *c, struct sst_pieces *p, int block)
{
    const int k = block_size(&p->shape, block), n = find_lost(c, p, block, k);

    if (!n)
        return;
    for (int i = 0; i < n; i++)
        c->out[i] = c->sum[i];
    compute_parity(c, p->shape.piece, k, c->used, n);
    for (int i = 0; i < n; i++) {
        const uint8_t *came = p->buffer + (size_t)parity_index(&p->shape, block, c->used[i]) * p->shape.piece;

        for (size_t b = 0; b < p->shape.piece; b++)
            c->sum[i][b] ^= came[b];
        for (int e = 0; e < n; e++)
            c->row[i * n + e] = coefficient(k, c->used[i], c->lost[e]);
    }
    if (gf_invert_matrix(c->row, c->inverse, n))
        assert(!"a part of a Cauchy matrix has no inverse");
    ec_init_tables(n, n, c->inverse, c->table);
    for (int i = 0; i < n; i++) {
        c->in[i] = c->sum[i];
        c->out[i] = data_piece(p->buffer, &p->shape, block, c->lost[i]);
    }
    ec_encode_data((int)p->shape.piece, n, n, c->table, c->in, c->out);
}

void sst_pieces_restore(struct sst_pieces *p, struct sst_pieces_coder *c)
{
    assert(sst_pieces_complete(p));
    for (int block = 0; block < p->shape.blocks; block++)
        restore_block(c, p, block);
}

#else

int sst_pieces_coder_create(struct sst_pieces_coder **out SST_UNUSED)
{
    return -ENOSYS;
}

void sst_pieces_coder_destroy(struct sst_pieces_coder *c SST_UNUSED)
{
}

void sst_pieces_encode(struct sst_pieces_coder *c SST_UNUSED, const struct sst_pieces_shape *s SST_UNUSED,
                       uint8_t *pieces SST_UNUSED)
{
    assert(!"built without ISA-L"); /* there is no coder */
}

void sst_pieces_restore(struct sst_pieces *p SST_UNUSED, struct sst_pieces_coder *c SST_UNUSED)
{
    assert(!"built without ISA-L");
}

#endif
