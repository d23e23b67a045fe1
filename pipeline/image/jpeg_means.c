/* ITU-T T.81, sequential Huffman code (annex F.2). Only code lengths and the first value of each block are decoded. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/jpeg_means.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/image/image_internal.h"

#define LOOK_BITS 13
#define PEEK_BITS 57
#define LOOKS     4
_Static_assert(LOOKS *LOOK_BITS <= PEEK_BITS && (LOOKS - 1) * LOOK_BITS + 16 <= PEEK_BITS, "bits suffice");
#define MEAN_BITS        11 /* table lookup that covers most means */
#define LOOKS_AFTER_MEAN 3  /* with the bits that a mean of the table leaves */
_Static_assert(MEAN_BITS + LOOKS_AFTER_MEAN * LOOK_BITS <= PEEK_BITS, "bits suffice");
_Static_assert(MEAN_BITS + (LOOKS_AFTER_MEAN - 1) * LOOK_BITS + 16 <= PEEK_BITS, "bits suffice");
#define BROKEN SIZE_MAX
/* Zeros after the data: a block that runs past the end is noticed at its own end, 64 symbols later. */
#define SPARE 512

/* Entry for the next LOOK_BITS bits; 0: no whole symbol. */
#define STEP_BITS(e)  ((unsigned)(e)&15u)          /* length of the whole symbols with their extra bits */
#define STEP_COEFS(e) (((unsigned)(e) >> 4) & 63u) /* coefficients that they encode */
#define STEP_END      0x400u                       /* the last symbol is the end of the block */

struct table {
    uint8_t bits[17], value[256];   /* as in the frame */
    uint16_t first[1 << LOOK_BITS]; /* length << 8 | symbol of the first symbol; 0: longer than LOOK_BITS */
    uint16_t step[1 << LOOK_BITS];
    uint32_t mean[1 << MEAN_BITS]; /* difference << 8 | length with its bits; 0: longer than MEAN_BITS */
    int32_t last_code[17];         /* last code of each length; -1: none */
    int32_t offset[17];            /* value[code + offset] */
    bool made;
};

struct sst_jpeg_means {
    struct jpeg_compress_struct standard; /* tables of annex K: video frames omit them */
    struct jpeg_error_mgr errors;
    struct table dc[NUM_HUFF_TBLS], ac[NUM_HUFF_TBLS];
    struct sst_mem_kept part, cut; /* cut: the frame that sst_jpeg_cut() made */
};

int sst_jpeg_means_create(struct sst_jpeg_means **out)
{
    struct sst_jpeg_means *m = calloc(1, sizeof(*m));

    if (!m)
        return -ENOMEM;
    m->standard.err = jpeg_std_error(&m->errors);
    jpeg_create_compress(&m->standard);
    m->standard.input_components = 3;
    m->standard.in_color_space = JCS_RGB;
    jpeg_set_defaults(&m->standard);
    *out = m;
    return 0;
}

void sst_jpeg_means_destroy(struct sst_jpeg_means *m)
{
    if (!m)
        return;
    jpeg_destroy_compress(&m->standard);
    sst_mem_kept_fini(&m->part);
    sst_mem_kept_fini(&m->cut);
    free(m);
}

/* --- tables ------------------------------------------------------------------------------------------------------- */

/* Combine as many whole symbols as fit, up to the end of the block. */
static uint16_t make_step(const struct table *t, unsigned prefix)
{
    unsigned used = 0, coefs = 0;

    for (;;) {
        const unsigned entry = t->first[(prefix << used) & ((1u << LOOK_BITS) - 1)], length = entry >> 8;
        const unsigned run = (entry >> 4) & 15, size = entry & 15, adds = size || run == 15 ? run + 1 : 0;

        /* Bits beyond LOOK_BITS are 0 here: a symbol that depends on them is left for the next lookup. */
        if (!length || used + length + size > LOOK_BITS || coefs + adds > 63)
            return (uint16_t)(coefs << 4 | used);
        used += length + size;
        coefs += adds;
        if (!adds)
            return (uint16_t)(STEP_END | coefs << 4 | used);
    }
}

/* A difference of `size` bits (F.2.2.1). */
static inline int extend(int bits, int size)
{
    return bits < 1 << (size - 1) ? bits - (1 << size) + 1 : bits;
}

static uint32_t make_mean(const struct table *t, unsigned prefix)
{
    const unsigned entry = t->first[prefix << (LOOK_BITS - MEAN_BITS)], length = entry >> 8, size = entry & 255;
    int bits;

    if (!length || size > 15 || length + size > MEAN_BITS)
        return 0;
    bits = (int)(prefix & ((1u << (MEAN_BITS - length)) - 1));
    return (uint32_t)(uint16_t)(size ? extend(bits >> (MEAN_BITS - length - size), (int)size) : 0) << 8 |
           (length + size);
}

/* Codes of annex C. @return false: the code is invalid */
static bool make_table(struct table *t, const JHUFF_TBL *from)
{
    int32_t code = 0;
    int n = 0;

    if (t->made && !memcmp(t->bits, from->bits, sizeof(t->bits)) && !memcmp(t->value, from->huffval, sizeof(t->value)))
        return true;
    *t = (struct table){ 0 };
    for (int length = 1; length <= 16; length++, code <<= 1) {
        t->offset[length] = n - code;
        t->last_code[length] = -1;
        for (int i = 0; i < from->bits[length]; i++, n++, code++) {
            const int32_t low = length <= LOOK_BITS ? code << (LOOK_BITS - length) : 0;

            if (n >= 256 || code >= 1 << length)
                return false;
            for (int32_t k = 0; length <= LOOK_BITS && k < 1 << (LOOK_BITS - length); k++)
                t->first[low + k] = (uint16_t)(length << 8 | from->huffval[n]);
            t->last_code[length] = code;
        }
    }
    for (unsigned prefix = 0; prefix < 1u << LOOK_BITS; prefix++)
        t->step[prefix] = make_step(t, prefix);
    for (unsigned prefix = 0; prefix < 1u << MEAN_BITS; prefix++)
        t->mean[prefix] = make_mean(t, prefix);
    memcpy(t->bits, from->bits, sizeof(t->bits));
    memcpy(t->value, from->huffval, sizeof(t->value));
    t->made = true;
    return true;
}

/* --- bits --------------------------------------------------------------------------------------------------------- */

/* The data between two markers, without the stuffed bytes, followed by zeros. */
struct reader {
    const uint8_t *bytes;
    size_t at, end; /* bits */
};

/* Bits from `at` on, from the highest; at least PEEK_BITS. */
static inline uint64_t peek(const uint8_t *bytes, size_t at)
{
    uint64_t next;

    memcpy(&next, bytes + (at >> 3), sizeof(next));
    return __builtin_bswap64(next) << (at & 7);
}

/*
 * Copy the bytes up to the next marker, behind the parts before.
 * @param r      in: the part before; empty: none. out: the next one
 * @param from   in: the first byte; out: the marker, or the end
 * @param limit  bytes of all parts that are needed: soon after them it may end
 */
static int next_part(struct sst_jpeg_means *m, const uint8_t **from, const uint8_t *end, size_t limit, struct reader *r)
{
    const uint8_t *at = *from;
    const size_t first = r->end / 8;
    uint8_t *part = r->bytes ? m->part.data : sst_mem_keep(&m->part, (size_t)(end - at) + SPARE, 1);
    size_t n = first;

    if (!part)
        return -ENOMEM;
    while (at < end && n < limit) {
        const uint8_t *stop = memchr(at, 0xFF, (size_t)(end - at));
        const size_t plain = (size_t)((stop ? stop : end) - at);

        memcpy(part + n, at, plain);
        n += plain;
        at += plain;
        if (end - at < 2 || at[1])
            break;
        part[n++] = 0xFF;
        at += 2;
    }
    memset(part + n, 0, SPARE);
    *from = at;
    *r = (struct reader){ .bytes = part, .at = 8 * first, .end = 8 * n };
    return 0;
}

/* @return the first symbol of the bits, and its length; or -1 */
static inline int symbol(uint64_t bits, const struct table *t, unsigned *length)
{
    const unsigned entry = t->first[bits >> (64 - LOOK_BITS)];

    *length = entry >> 8;
    if (entry)
        return entry & 255;
    for (*length = LOOK_BITS + 1; *length <= 16; ++*length) {
        const int32_t code = (int32_t)(bits >> (64 - *length));

        if (code <= t->last_code[*length] && code + t->offset[*length] >= 0)
            return t->value[(code + t->offset[*length]) & 255];
    }
    return -1;
}

/* --- blocks ------------------------------------------------------------------------------------------------------- */

/* Skip the coefficients after the mean, from bit `at`. @param bits  the frame's bits from `at` on, for `looks` lookups
 * @return the bit after them, or BROKEN */
static inline size_t step_over(const uint8_t *bytes, size_t at, uint64_t bits, int looks, const struct table *t)
{
    unsigned k = 1, length;

    for (; k < 64; bits = peek(bytes, at), looks = LOOKS) {
        int rs, i;

        /* Bits hold `looks` times LOOK_BITS, and once less with the code of a symbol, of at most 16 bits. */
        for (i = 0; i < looks; i++) {
            const unsigned step = t->step[bits >> (64 - LOOK_BITS)], used = STEP_BITS(step);

            if (!used || k + STEP_COEFS(step) >= 64 + !(step & STEP_END))
                break;
            at += used;
            bits <<= used;
            k += STEP_COEFS(step);
            if (step & STEP_END)
                return at;
        }
        if (i == looks || k == 64)
            continue;
        rs = symbol(bits, t, &length);
        if (rs < 0)
            return BROKEN;
        at += length + ((unsigned)rs & 15);
        if (!(rs & 15) && rs >> 4 != 15)
            return at;
        k += ((unsigned)rs >> 4) + 1;
    }
    return k == 64 ? at : BROKEN;
}

struct component {
    const struct table *dc, *ac;
    int across, down;  /* blocks in an MCU */
    int width, height; /* in blocks */
    int quant, pred;
    int16_t *out;
};

/* Read the difference of a block's mean to the previous one, skip the coefficients.
 * @param mean_end  out: the bit after the mean @return the bit after the block, or BROKEN */
static inline size_t read_block(const uint8_t *bytes, size_t at, const struct component *c, int *diff, size_t *mean_end)
{
    const uint64_t bits = peek(bytes, at);
    const uint32_t known = c->dc->mean[bits >> (64 - MEAN_BITS)];
    unsigned length;
    int size;

    if (known) {
        *diff = (int16_t)(known >> 8);
        *mean_end = at + (known & 255);
        return step_over(bytes, *mean_end, bits << (known & 255), LOOKS_AFTER_MEAN, c->ac);
    }
    size = symbol(bits, c->dc, &length);
    if (size < 0 || size > 15)
        return BROKEN;
    *diff = size ? extend((int)(bits << length >> (64 - size)), size) : 0;
    *mean_end = at + length + (unsigned)size;
    return step_over(bytes, *mean_end, peek(bytes, *mean_end), LOOKS, c->ac);
}

static bool read_mcu(struct reader *r, struct component *c, int mcu_x, int mcu_y)
{
    for (int y = mcu_y * c->down; y < (mcu_y + 1) * c->down; y++) {
        for (int x = mcu_x * c->across; x < (mcu_x + 1) * c->across; x++) {
            int diff = 0;
            size_t mean_end;
            const size_t at = read_block(r->bytes, r->at, c, &diff, &mean_end);

            if (at > r->end)
                return false;
            r->at = at;
            c->pred = (int16_t)(c->pred + diff);
            if (x < c->width && y < c->height)
                c->out[(size_t)y * (size_t)c->width + (size_t)x] =
                    (int16_t)sst_clamp_int(1024 + c->pred * c->quant, 0, 2047);
        }
    }
    return true;
}

/* Skip a restart marker, which must follow: less than a byte of the preceding data is left. */
static int restart(struct sst_jpeg_means *m, struct reader *r, const uint8_t **from, const uint8_t *end)
{
    if (r->end - r->at >= 8)
        return -EBADMSG;
    while (end - *from >= 2 && (*from)[0] == 0xFF && (*from)[1] == 0xFF)
        ++*from;
    if (end - *from < 2 || (*from)[0] != 0xFF || ((*from)[1] & 0xF8) != 0xD0)
        return -EBADMSG;
    *from += 2;
    return next_part(m, from, end, SIZE_MAX, r);
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

static int set_component(struct sst_jpeg_means *m, const struct jpeg_decompress_struct *h, int i, struct component *c)
{
    const jpeg_component_info *info = h->cur_comp_info[i];
    const bool single = h->num_components == 1;
    const int d = info->dc_tbl_no, a = info->ac_tbl_no;
    const JHUFF_TBL *dc, *ac;

    if (info != &h->comp_info[i])
        return -ENOTSUP;
    if (d < 0 || d >= NUM_HUFF_TBLS || a < 0 || a >= NUM_HUFF_TBLS || info->quant_tbl_no < 0 ||
        info->quant_tbl_no >= NUM_QUANT_TBLS || !h->quant_tbl_ptrs[info->quant_tbl_no])
        return -EBADMSG;
    dc = h->dc_huff_tbl_ptrs[d] ? h->dc_huff_tbl_ptrs[d] : m->standard.dc_huff_tbl_ptrs[d];
    ac = h->ac_huff_tbl_ptrs[a] ? h->ac_huff_tbl_ptrs[a] : m->standard.ac_huff_tbl_ptrs[a];
    if (!dc || !ac || !make_table(&m->dc[d], dc) || !make_table(&m->ac[a], ac))
        return -EBADMSG;
    c->dc = &m->dc[d];
    c->ac = &m->ac[a];
    c->across = single ? 1 : info->h_samp_factor;
    c->down = single ? 1 : info->v_samp_factor;
    c->width = (int)info->width_in_blocks;
    c->height = (int)info->height_in_blocks;
    c->quant = h->quant_tbl_ptrs[info->quant_tbl_no]->quantval[0];
    return 0;
}

struct scan {
    struct sst_jpeg_index *index; /* NULL: none */
    struct component c[3];
    int components, mcus_x, mcus_y;
    unsigned interval; /* MCUs between restarts; 0: none */
};

/* The state after MCU n - 1, before a restart. */
static void note_end(const struct scan *s, int n, size_t at)
{
    struct sst_jpeg_mcu *to = &s->index->mcu[n];

    to->end = to->at = (uint32_t)at;
    for (int i = 0; i < s->components; i++)
        to->last[i] = (int16_t)s->c[i].pred;
}

/* Prepare an index. @return it, or NULL: this frame cannot be indexed */
static struct sst_jpeg_index *start_index(struct sst_jpeg_index *index, const struct scan *s,
                                          const struct jpeg_decompress_struct *h, int width, int height)
{
    if (!index)
        return NULL;
    index->valid = false;
    index->mcus_x = s->mcus_x;
    index->mcus_y = s->mcus_y;
    index->mcu_width = width;
    index->mcu_height = height;
    index->tall = s->components == 3 && h->max_v_samp_factor > 1;
    index->interval = s->interval;
    return (size_t)s->mcus_x * (size_t)s->mcus_y + 1 > index->room || h->src->bytes_in_buffer >= UINT32_MAX / 8 ? NULL
                                                                                                                : index;
}

static int read_scan(struct sst_jpeg_means *m, struct scan *s, const uint8_t *from, const uint8_t *end)
{
    unsigned left = s->interval;
    struct reader r = { 0 };
    int err = next_part(m, &from, end, SIZE_MAX, &r);

    for (int n = 0; !err && n < s->mcus_x * s->mcus_y; n++, left--) {
        if (s->index)
            note_end(s, n, r.at);
        if (s->interval && !left) {
            left = s->interval;
            for (int i = 0; i < s->components; i++)
                s->c[i].pred = 0;
            err = restart(m, &r, &from, end);
        }
        if (s->index)
            s->index->mcu[n].at = (uint32_t)r.at;
        for (int i = 0; !err && i < s->components; i++) {
            if (!read_mcu(&r, &s->c[i], n % s->mcus_x, n / s->mcus_x))
                err = -EBADMSG;
        }
    }
    if (s->index && !err) {
        note_end(s, s->mcus_x * s->mcus_y, r.at);
        s->index->valid = true;
    }
    return err;
}

int sst_jpeg_means_read(struct sst_jpeg_means *m, const struct jpeg_decompress_struct *h, int16_t *const out[3],
                        struct sst_jpeg_index *index)
{
    const uint8_t *from = h->src->next_input_byte;
    struct scan s = { .components = h->num_components, .interval = h->restart_interval };
    int width = 8, height = 8, err;

    if ((s.components != 1 && s.components != 3) || h->comps_in_scan != s.components || h->progressive_mode ||
        h->arith_code || h->data_precision != 8)
        return -ENOTSUP;
    for (int i = 0; i < s.components; i++) {
        err = set_component(m, h, i, &s.c[i]);
        if (err)
            return err;
        s.c[i].out = out[i];
    }
    if (s.components == 3) {
        width *= h->max_h_samp_factor;
        height *= h->max_v_samp_factor;
    }
    s.mcus_x = ((int)h->image_width + width - 1) / width;
    s.mcus_y = ((int)h->image_height + height - 1) / height;
    s.index = start_index(index, &s, h, width, height);
    return read_scan(m, &s, from, from + h->src->bytes_in_buffer);
}

/* --- frames cut to a part ----------------------------------------------------------------------------------------- */

struct writer {
    uint8_t *to;
    uint64_t bits;
    int count; /* bits that are not written yet, less than 8 */
};

/* At most 32 bits. */
static inline void put(struct writer *w, uint32_t value, int n)
{
    w->bits = w->bits << n | value;
    w->count += n;
    for (; w->count >= 8; w->count -= 8) {
        const uint8_t byte = (uint8_t)(w->bits >> (w->count - 8));

        *w->to++ = byte;
        if (byte == 0xFF)
            *w->to++ = 0;
    }
}

static void copy_bits(struct writer *w, const uint8_t *bytes, size_t at, size_t end)
{
    for (; end - at >= 32; at += 32)
        put(w, (uint32_t)(peek(bytes, at) >> 32), 32);
    if (end > at)
        put(w, (uint32_t)(peek(bytes, at) >> (64 - (end - at))), (int)(end - at));
}

/* Write the difference of a mean. @return false: the code has no word for it */
static bool put_mean(struct writer *w, const struct table *t, int diff)
{
    const int size = diff ? 32 - __builtin_clz((unsigned)abs(diff)) : 0;
    int n = 0;

    for (int length = 1; length <= 16; length++) {
        for (int i = 0; i < t->bits[length]; i++, n++) {
            if (t->value[n] != size)
                continue;
            put(w, (uint32_t)(n - t->offset[length]), length);
            if (size)
                put(w, (uint32_t)(diff < 0 ? diff + (1 << size) - 1 : diff), size);
            return true;
        }
    }
    return false;
}

/* Does an MCU follow a restart? Its means do not depend on earlier ones. */
static bool restarts(const struct sst_jpeg_index *index, int n)
{
    return !n || (index->interval && (unsigned)n % index->interval == 0);
}

/* An MCU with means that follow another MCU's than before. */
static int put_first(struct writer *w, const struct reader *r, const struct scan *s, int n, const int16_t last[3])
{
    const struct sst_jpeg_mcu *mcu = &s->index->mcu[n];
    const bool fresh = restarts(s->index, n);
    size_t at = mcu->at;

    if (at > r->end)
        return -EBADMSG;
    for (int i = 0; i < s->components; i++) {
        const struct component *c = &s->c[i];

        for (int block = 0; block < c->across * c->down; block++) {
            int diff = 0;
            size_t rest;
            const size_t end = read_block(r->bytes, at, c, &diff, &rest);

            if (end == BROKEN || end > r->end)
                return -EBADMSG;
            if (!block && !put_mean(w, c->dc, (int16_t)((fresh ? 0 : mcu->last[i]) + diff) - last[i]))
                return -ENOTSUP;
            copy_bits(w, r->bytes, block ? at : rest, end);
            at = end;
        }
    }
    return 0;
}

/* Copy the frame's header up to its scan, without comments and application segments: small pictures in them, also
 * JFIF's, show the whole. Marks of colours stay. @return bytes; 0: it is damaged */
static size_t copy_header(uint8_t *to, const uint8_t *header, size_t bytes)
{
    static const uint8_t plain[2] = { 0 };
    struct jpeg_segment s = { 0 };
    size_t n = 2;

    memcpy(to, header, n);
    while (jpeg_next_segment(&s, header, bytes)) {
        const bool jfif = s.mark == 0xE0 && s.bytes >= 14 && !memcmp(s.data, "JFIF", 5);
        const bool adobe = s.mark == 0xEE && s.bytes >= 12 && !memcmp(s.data, "Adobe", 5);
        const size_t kept = jfif ? 14 : adobe ? 12 : s.bytes;

        if (((s.mark & 0xF0) == 0xE0 || s.mark == 0xFE) && !jfif && !adobe)
            continue;
        to[n++] = 0xFF;
        to[n++] = s.mark;
        to[n++] = (uint8_t)((kept + 2) >> 8);
        to[n++] = (uint8_t)(kept + 2);
        memcpy(to + n, s.data, kept);
        n += kept;
        if (jfif)
            memcpy(to + n - sizeof(plain), plain, sizeof(plain)); /* width and height of its small picture */
    }
    return s.mark == JPEG_MARK_SOS ? n : 0;
}

/* Write the size of the part into the copy of the frame's header, and that there are no restarts. @return false: the
 * header has no size */
static bool set_size(uint8_t *header, size_t bytes, int width, int height)
{
    struct jpeg_segment s = { 0 };
    bool found = false;

    while (jpeg_next_segment(&s, header, bytes)) {
        uint8_t *to = header + s.at + 4;

        if ((s.mark == 0xC0 || s.mark == 0xC1) && s.bytes >= 5) {
            to[1] = (uint8_t)(height >> 8);
            to[2] = (uint8_t)height;
            to[3] = (uint8_t)(width >> 8);
            to[4] = (uint8_t)width;
            found = true;
        }
        if (s.mark == 0xDD && s.bytes >= 2)
            to[0] = to[1] = 0;
    }
    return found;
}

/* MCUs of a part of a row. @param last  in, out: the means before */
static int put_row(struct writer *w, const struct reader *r, const struct scan *s, const int part[2],
                   const int16_t **last)
{
    const struct sst_jpeg_mcu *mcu = s->index->mcu;
    const int end = part[1];

    for (int n = part[0], stop; n < end; n = stop) {
        const int err = put_first(w, r, s, n, *last);

        for (stop = n + 1; stop < end && !restarts(s->index, stop); stop++)
            ;
        if (err)
            return err;
        if (stop > n + 1 && (mcu[stop].end > r->end || mcu[stop].end < mcu[n + 1].at))
            return -EBADMSG;
        if (stop > n + 1)
            copy_bits(w, r->bytes, mcu[n + 1].at, mcu[stop].end);
        *last = mcu[stop].last;
    }
    return 0;
}

static int put_part(struct writer *w, const struct reader *r, const struct scan *s, const struct sst_jpeg_part *part)
{
    static const int16_t zero[3] = { 0 };
    const int16_t *last = zero;
    int err = 0;

    for (int y = part->y0; y < part->y1 && !err; y++) {
        const int row = y * s->index->mcus_x;

        err = put_row(w, r, s, (const int[2]){ row + part->x0, row + part->x1 }, &last);
    }
    if (err)
        return err;
    put(w, 0x7F, 7);
    *w->to++ = 0xFF;
    *w->to++ = 0xD9; /* end of the picture */
    return 0;
}

/* All parts of the data, up to a marker that is none of a restart, or as far as they are needed. */
static int read_parts(struct sst_jpeg_means *m, const uint8_t *from, const uint8_t *end, size_t limit, struct reader *r)
{
    int err = 0;

    while (!err) {
        err = next_part(m, &from, end, limit, r);
        while (end - from >= 2 && from[0] == 0xFF && from[1] == 0xFF)
            from++;
        if (end - from < 2 || from[0] != 0xFF || (from[1] & 0xF8) != 0xD0)
            break;
        from += 2;
    }
    return err;
}

int sst_jpeg_cut(struct sst_jpeg_means *m, const struct sst_jpeg_frame *frame, const struct sst_jpeg_part *part,
                 const uint8_t **out, size_t *bytes)
{
    const struct jpeg_decompress_struct *h = frame->header;
    struct sst_jpeg_index *index = frame->index;
    const uint8_t *from = h->src->next_input_byte;
    const size_t header = (size_t)(from - frame->data), data = h->src->bytes_in_buffer;
    size_t kept;
    const size_t last = index->mcu[(part->y1 - 1) * index->mcus_x + part->x1].end;
    struct scan s = { .components = h->num_components, .index = index };
    struct writer w = { 0 };
    struct reader r = { 0 };
    /* Every byte may need another one after it; words of means are up to 27 bits. */
    const size_t most = header + 2 * data + 24 * (size_t)index->mcus_y * (size_t)index->mcus_x + 64;
    uint8_t *cut = sst_mem_keep(&m->cut, most, 1);
    int err = h->comps_in_scan != s.components ? -ENOTSUP : cut ? 0 : -ENOMEM;

    for (int i = 0; !err && i < s.components; i++)
        err = set_component(m, h, i, &s.c[i]);
    err = err ? err : read_parts(m, from, from + data, last / 8 + 1, &r);
    if (err)
        return err;
    kept = copy_header(cut, frame->data, header);
    if (!kept)
        return -EBADMSG;
    if (!set_size(cut, kept,
                  sst_min_int(part->x1 * index->mcu_width, (int)h->image_width) - part->x0 * index->mcu_width,
                  sst_min_int(part->y1 * index->mcu_height, (int)h->image_height) - part->y0 * index->mcu_height))
        return -ENOTSUP;
    w.to = cut + kept;
    err = put_part(&w, &r, &s, part);
    *out = cut;
    *bytes = (size_t)(w.to - cut);
    return err;
}
