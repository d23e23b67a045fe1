/* PNG of maps, compressed by runs of equal bytes alone: what maps consist of. */
#include <endian.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#if WITH_DEFLATE
#include <libdeflate.h>
#define checksum_adler libdeflate_adler32
#define checksum_crc   libdeflate_crc32
#else
#include <zlib.h>
#define checksum_adler adler32_z
#define checksum_crc   crc32_z
#endif

#include "base/stats.h"
#include "pipeline/image/image_internal.h"

#define TOKENS       131072 /* of a block at most */
#define TOKEN_BYTES  3      /* code of 15 bits at most, 5 more of the length, 1 of the distance */
#define HEADER_BYTES 1024   /* of a block: its codes, at most */
#define RUN          256    /* tokens from here on: a run of RUN_LEAST and so many more bytes */
#define RUN_LEAST    3
#define RUN_MOST     258
#define SYMBOLS      286 /* of RFC 1951: bytes, end of the block, lengths */
#define END          256
#define DISTANCES    2 /* as zlib does: a code of one word alone is incomplete */
#define CODE_MOST    15
#define LENGTH_CODES 19 /* symbols by which a block's header describes the code lengths */
#define LENGTH_MOST  7
#define REPEAT       16 /* the last one 3 to 6 times; then zeros 3 to 10, and 11 to 138 times */
#define ZEROS        17
#define MANY_ZEROS   18

_Static_assert(1 + 2 * SST_IMAGE_MAX_SIDE <= TOKENS, "a row fits");

struct encoder {
    uint8_t *data;
    size_t size, capacity;
    uint64_t bits; /* not yet in data; the lowest first */
    int held;
    int tokens;
    uint32_t adler;
    uint32_t count[RUN + RUN_MOST - RUN_LEAST + 1];
    uint16_t token[TOKENS];
};

/* Words of a Huffman code, the first bit lowest. */
struct code {
    uint8_t length[SYMBOLS];
    uint32_t word[SYMBOLS];
};

static bool reserve(struct encoder *e, size_t more)
{
    uint8_t *grown;

    if (e->size + more + sizeof(uint64_t) <= e->capacity)
        return true;
    grown = realloc(e->data, 2 * (e->size + more) + sizeof(uint64_t));
    if (!grown)
        return false;
    e->data = grown;
    e->capacity = 2 * (e->size + more) + sizeof(uint64_t);
    return true;
}

/* Append up to 32 bits; the bytes are reserved. */
static inline void put_bits(struct encoder *e, uint32_t bits, int n)
{
    e->bits |= (uint64_t)bits << e->held;
    e->held += n;
    for (; e->held >= 8; e->held -= 8, e->bits >>= 8)
        e->data[e->size++] = (uint8_t)e->bits;
}

static void put_big_endian(struct encoder *e, uint32_t v)
{
    for (int shift = 24; shift >= 0; shift -= 8)
        e->data[e->size++] = (uint8_t)(v >> shift);
}

/* --- codes -------------------------------------------------------------------------------------------------------- */

/* Depths of a Huffman tree's leaves. @param v  in: counts, ascending; out: depths, descending
 * Source: Moffat and Katajainen 1995, in place. */
static void tree_depths(int64_t *v, int n)
{
    int leaf = 0, root = 0, next, free_at, depth = 0, used = 0, at_depth = 1;

    for (next = 0; next < n - 1; next++) { /* v: weights of inner nodes, then their parents */
        int64_t sum = 0;

        for (int i = 0; i < 2; i++) {
            if (leaf >= n || (root < next && v[root] < v[leaf])) {
                sum += v[root];
                v[root++] = next;
            } else {
                sum += v[leaf++];
            }
        }
        v[next] = sum;
    }
    v[n - 2] = 0;
    for (next = n - 3; next >= 0; next--)
        v[next] = v[v[next]] + 1;
    root = n - 2;
    free_at = n - 1;
    while (at_depth > 0) { /* inner nodes of a depth leave the rest of its places to leaves */
        for (; root >= 0 && v[root] == depth; root--)
            used++;
        for (; at_depth > used; at_depth--)
            v[free_at--] = depth;
        at_depth = 2 * used;
        depth++;
        used = 0;
    }
}

/* Lengths of the words of `n` symbols, none above `most`; 0: not counted. At least two have a word. */
static void code_lengths(uint8_t *length, const uint32_t *count, int n, int most)
{
    int64_t order[SYMBOLS], depth[SYMBOLS];
    int at[CODE_MOST + 1] = { 0 }, used = 0, sum = 0;

    memset(length, 0, (size_t)n);
    for (int i = 0; i < n; i++) {
        if (count[i])
            order[used++] = (int64_t)count[i] << 16 | i;
    }
    for (int i = 0; used < 2 && i < n; i++) {
        if (!count[i])
            order[used++] = i;
    }
    sst_stats_sort_int64(order, used);
    for (int i = 0; i < used; i++)
        depth[i] = order[i] >> 16;
    tree_depths(depth, used);
    for (int i = 0; i < used; i++) {
        depth[i] = depth[i] < most ? depth[i] : most;
        at[depth[i]]++;
        sum += 1 << (most - depth[i]);
    }
    /* Words that were cut are too many: one of them goes beside the longest that is shorter, one bit further down. */
    for (int bits; sum > 1 << most; sum--) {
        for (bits = most - 1; !at[bits]; bits--)
            ;
        at[bits]--;
        at[bits + 1] += 2;
        at[most]--;
    }
    for (int i = 0, bits = most; i < used; i++, at[bits]--) {
        while (!at[bits])
            bits--;
        length[order[i] & 0xFFFF] = (uint8_t)bits;
    }
}

/* Canonical words of given lengths. */
static void set_words(struct code *c, int n)
{
    uint32_t next[CODE_MOST + 2] = { 0 }, word = 0;
    int at[CODE_MOST + 1] = { 0 };

    for (int i = 0; i < n; i++)
        at[c->length[i]]++;
    at[0] = 0;
    for (int l = 1; l <= CODE_MOST; l++) {
        word = (word + (uint32_t)at[l - 1]) << 1;
        next[l] = word;
    }
    for (int i = 0; i < n; i++) {
        const uint32_t forward = c->length[i] ? next[c->length[i]]++ : 0;

        c->word[i] = 0;
        for (int bit = 0; bit < c->length[i]; bit++)
            c->word[i] |= (forward >> bit & 1) << (c->length[i] - 1 - bit);
    }
}

static void code_init(struct code *c, const uint32_t *count, int n, int most)
{
    code_lengths(c->length, count, n, most);
    set_words(c, n);
}

/* --- blocks ------------------------------------------------------------------------------------------------------- */

/* A run of RUN_LEAST + more bytes: its symbol, and the bits after that. */
static int run_symbol(int more, uint32_t *extra, int *extra_bits)
{
    int log2 = 0;

    *extra = 0;
    *extra_bits = 0;
    if (more == RUN_MOST - RUN_LEAST)
        return SYMBOLS - 1;
    if (more < 8)
        return END + 1 + more;
    while (more >> (log2 + 1))
        log2++;
    *extra_bits = log2 - 2;
    *extra = (uint32_t)more & ((1u << *extra_bits) - 1);
    return END + 1 + 4 * (log2 - 1) + (more >> *extra_bits & 3);
}

/* Symbols that describe code lengths, with the bits after each. */
struct lengths {
    int count;
    uint8_t symbol[SYMBOLS + DISTANCES], extra[SYMBOLS + DISTANCES], bits[SYMBOLS + DISTANCES];
};

static void add_length(struct lengths *l, int symbol, int extra, int bits)
{
    l->symbol[l->count] = (uint8_t)symbol;
    l->extra[l->count] = (uint8_t)extra;
    l->bits[l->count++] = (uint8_t)bits;
}

static void describe(struct lengths *l, const uint8_t *length, int n)
{
    l->count = 0;
    for (int i = 0, same; i < n; i += same) {
        for (same = 1; i + same < n && length[i + same] == length[i] && same < 138; same++)
            ;
        if (!length[i] && same >= 11) {
            add_length(l, MANY_ZEROS, same - 11, 7);
        } else if (!length[i] && same >= 3) {
            add_length(l, ZEROS, same - 3, 3);
        } else if (i && length[i] == length[i - 1] && same >= 3) {
            same = same < 6 ? same : 6;
            add_length(l, REPEAT, same - 3, 2);
        } else {
            same = 1;
            add_length(l, length[i], 0, 0);
        }
    }
}

/* Header of a block: its codes. @param length  [SYMBOLS + DISTANCES] */
static void put_codes(struct encoder *e, const uint8_t *length, bool last)
{
    static const uint8_t order[LENGTH_CODES] = { 16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15 };
    uint32_t count[LENGTH_CODES] = { 0 };
    struct lengths l;
    struct code c;

    describe(&l, length, SYMBOLS + DISTANCES);
    for (int i = 0; i < l.count; i++)
        count[l.symbol[i]]++;
    code_init(&c, count, LENGTH_CODES, LENGTH_MOST);
    put_bits(e, last, 1);
    put_bits(e, 2, 2); /* with codes of its own */
    put_bits(e, SYMBOLS - 257, 5);
    put_bits(e, DISTANCES - 1, 5);
    put_bits(e, LENGTH_CODES - 4, 4);
    for (int i = 0; i < LENGTH_CODES; i++)
        put_bits(e, c.length[order[i]], 3);
    for (int i = 0; i < l.count; i++) {
        put_bits(e, c.word[l.symbol[i]], c.length[l.symbol[i]]);
        put_bits(e, l.extra[i], l.bits[i]);
    }
}

/* Bits of each token that the block has. */
static void token_words(uint32_t *word, uint8_t *bits, const struct encoder *e, const struct code *c)
{
    for (int t = 0; t < (int)ARRAY_LEN(e->count); t++) {
        uint32_t extra = 0;
        int extra_bits = 0;
        const int symbol = t < RUN ? t : run_symbol(t - RUN, &extra, &extra_bits);

        word[t] = c->word[symbol] | extra << c->length[symbol];
        bits[t] = (uint8_t)(c->length[symbol] + extra_bits + (t >= RUN)); /* the distance's word is 0 */
    }
}

static void put_tokens(struct encoder *e, const struct code *c)
{
    uint32_t word[ARRAY_LEN(e->count)];
    uint8_t bits[ARRAY_LEN(e->count)], *out = e->data + e->size;
    uint64_t pending = e->bits;
    unsigned held = (unsigned)e->held;

    token_words(word, bits, e, c);
    for (int i = 0; i < e->tokens; i++) {
        uint64_t little;

        pending |= (uint64_t)word[e->token[i]] << held;
        little = htole64(pending);
        held += bits[e->token[i]];
        memcpy(out, &little, sizeof(little)); /* the bytes that are not full yet are written again */
        out += held >> 3;
        pending >>= held & ~7u;
        held &= 7;
    }
    e->size = (size_t)(out - e->data);
    e->bits = pending;
    e->held = (int)held;
    put_bits(e, c->word[END], c->length[END]);
}

static bool put_block(struct encoder *e, bool last)
{
    uint32_t count[SYMBOLS] = { [END] = 1 }, extra;
    uint8_t length[SYMBOLS + DISTANCES];
    struct code c;
    int extra_bits;

    if (!reserve(e, (size_t)e->tokens * TOKEN_BYTES + HEADER_BYTES))
        return false;
    for (int t = 0; t < (int)ARRAY_LEN(e->count); t++)
        count[t < RUN ? t : run_symbol(t - RUN, &extra, &extra_bits)] += e->count[t];
    code_init(&c, count, SYMBOLS, CODE_MOST);
    memcpy(length, c.length, SYMBOLS);
    memset(length + SYMBOLS, 1, DISTANCES);
    put_codes(e, length, last);
    put_tokens(e, &c);
    memset(e->count, 0, sizeof(e->count));
    e->tokens = 0;
    return true;
}

/* How many of the bytes from p on equal the one before, up to `most`. */
static int run_at(const uint8_t *p, int most)
{
    const uint64_t same = p[-1] * UINT64_C(0x0101010101010101);
    int n = 0;

    for (uint64_t v; n + 8 <= most; n += 8) {
        memcpy(&v, p + n, sizeof(v));
        if (v != same)
            break;
    }
    while (n < most && p[n] == p[-1])
        n++;
    return n;
}

static inline void add_token(struct encoder *e, int token)
{
    e->token[e->tokens++] = (uint16_t)token;
    e->count[token]++;
}

/* Tokens of a row; p[n .. n + 2] may be read. There is room for n. */
static void add_row(struct encoder *e, const uint8_t *p, int n)
{
    add_token(e, p[0]);
    for (int x = 1, run; x < n; x += run) {
        uint32_t four;

        memcpy(&four, p + x - 1, sizeof(four));
        run = four == p[x] * 0x01010101u ? run_at(p + x, sst_min_int(n - x, RUN_MOST)) : 0;
        if (run >= RUN_LEAST) {
            add_token(e, RUN + run - RUN_LEAST);
        } else {
            run = 1;
            add_token(e, p[x]);
        }
    }
}

/* --- file --------------------------------------------------------------------------------------------------------- */

/* A row as the file has it: filter, then bytes. @param zeros  what is above the first row @return bytes */
static int filter_row(uint8_t *out, const struct png_runs_map *m, int y, const void *zeros)
{
    const int w = m->width;

    out[0] = m->palette ? 0 : 2;
    if (m->u8) {
        const uint8_t *row = sst_map_u8_row(m->u8, y);
        const uint8_t *above = y && !m->palette ? sst_map_u8_row(m->u8, y - 1) : zeros;

        for (int x = 0; x < w; x++)
            out[1 + x] = (uint8_t)(row[x] - above[x]);
        return 1 + w;
    }
    for (int x = 0; x < w; x++) {
        const uint16_t *row = sst_map_u16_row(m->u16, y), *above = y ? sst_map_u16_row(m->u16, y - 1) : zeros;

        out[1 + 2 * x] = (uint8_t)((row[x] >> 8) - (above[x] >> 8));
        out[2 + 2 * x] = (uint8_t)(row[x] - above[x]);
    }
    return 1 + 2 * w;
}

/* Start a chunk; its length is set at its end. @return where it starts */
static size_t open_chunk(struct encoder *e, const char *type)
{
    const size_t at = e->size;

    put_big_endian(e, 0);
    memcpy(e->data + e->size, type, 4);
    e->size += 4;
    return at;
}

static void close_chunk(struct encoder *e, size_t at)
{
    const size_t length = e->size - at - 8, end = e->size;

    e->size = at;
    put_big_endian(e, (uint32_t)length);
    e->size = end;
    put_big_endian(e, (uint32_t)checksum_crc(0, e->data + at + 4, length + 4));
}

static void put_start(struct encoder *e, const struct png_runs_map *m)
{
    static const uint8_t signature[8] = { 0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n' };
    size_t at;

    memcpy(e->data, signature, sizeof(signature));
    e->size = sizeof(signature);
    at = open_chunk(e, "IHDR");
    put_big_endian(e, (uint32_t)m->width);
    put_big_endian(e, (uint32_t)m->height);
    memcpy(e->data + e->size, (const uint8_t[]){ m->u16 ? 16 : 8, m->palette ? 3 : 0, 0, 0, 0 }, 5);
    e->size += 5;
    close_chunk(e, at);
    if (!m->palette)
        return;
    at = open_chunk(e, "PLTE");
    memcpy(e->data + e->size, m->palette, 768);
    e->size += 768;
    close_chunk(e, at);
}

static bool put_rows(struct encoder *e, const struct png_runs_map *m, uint8_t *row, const void *zeros)
{
    for (int y = 0; y < m->height; y++) {
        const int n = filter_row(row, m, y, zeros);

        e->adler = (uint32_t)checksum_adler(e->adler, row, (size_t)n);
        if (n > TOKENS - e->tokens && !put_block(e, false))
            return false;
        add_row(e, row, n);
    }
    return put_block(e, true);
}

int png_runs_encode(uint8_t **data, size_t *size, const struct png_runs_map *map)
{
    struct encoder *e = malloc(sizeof(*e));
    const size_t row_bytes = (size_t)map->width * 2 + 1 + sizeof(uint32_t);
    uint8_t *row = calloc(row_bytes, 1), *zeros = calloc(row_bytes, 1);
    bool ok = e && row && zeros;
    size_t at;

    if (e) {
        memset(e, 0, offsetof(struct encoder, token));
        e->adler = 1;
        ok = ok && reserve(e, (size_t)map->width * (size_t)map->height / 2 + HEADER_BYTES);
    }
    if (ok) {
        put_start(e, map);
        at = open_chunk(e, "IDAT");
        put_bits(e, 0x0178, 16); /* zlib's header: window of 32 KiB, fast */
        ok = put_rows(e, map, row, zeros) && reserve(e, 64);
    }
    if (ok) {
        put_bits(e, 0, (8 - e->held) & 7);
        put_big_endian(e, e->adler);
        close_chunk(e, at);
        close_chunk(e, open_chunk(e, "IEND"));
        *data = e->data;
        *size = e->size;
    } else if (e) {
        free(e->data);
    }
    free(row);
    free(zeros);
    free(e);
    return ok ? 0 : -ENOMEM;
}
