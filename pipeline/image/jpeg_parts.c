/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/jpeg_parts.h"

#include <errno.h>
#include <inttypes.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

#define LEVELS                                                                                                         \
    4.0           /* by which the means or the slopes of two blocks differ, in addition to half a step of their table */
#define LOW     3 /* coefficients in each direction that are compared: the others are noise and texture */
#define COMMENT "sst-parts " /* of the JPEG: time of the base, and a bit for each group of blocks */
#define HEAD    (sizeof(COMMENT) - 1 + 21)

/* One JPEG's coefficients. */
struct blocks {
    struct sst_jpeg_bytes jpeg;
    struct jpeg_decompress_struct d;
    jvirt_barray_ptr *coefs;
    bool open;
};

struct work {
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf escape;
    int width, height; /* that both must have */
    struct blocks base, other;
    struct jpeg_compress_struct c;
    bool writes;
    unsigned char *made; /* by libjpeg */
    unsigned long bytes;
    uint8_t *mask; /* a comment: HEAD, then a byte for eight groups */
    size_t mask_bytes;
};

static void on_error(j_common_ptr c)
{
    longjmp(((struct work *)(void *)c->err)->escape, 1);
}

/* A scan for each component at most: more would only cost time. */
static void on_progress(j_common_ptr c)
{
    const j_decompress_ptr d = (j_decompress_ptr)c;

    if (d->input_scan_number > d->num_components)
        on_error(c);
}

static void on_message(j_common_ptr c, int level)
{
    (void)c;
    (void)level;
}

static void end(struct work *w)
{
    if (w->base.open)
        jpeg_destroy_decompress(&w->base.d);
    if (w->other.open)
        jpeg_destroy_decompress(&w->other.d);
    if (w->writes)
        jpeg_destroy_compress(&w->c);
    free(w->made);
    free(w->mask);
    free(w);
}

static struct work *begin(const struct sst_jpeg_pair *pair)
{
    struct work *w = calloc(1, sizeof(*w));

    if (!w)
        return NULL;
    jpeg_std_error(&w->errors);
    w->errors.error_exit = on_error;
    w->errors.emit_message = on_message;
    w->progress.progress_monitor = on_progress;
    w->base.jpeg = pair->base;
    w->other.jpeg = pair->other;
    w->width = pair->width;
    w->height = pair->height;
    return w;
}

static void read_header(struct work *w, struct blocks *b)
{
    b->d.err = &w->errors;
    jpeg_create_decompress(&b->d);
    b->open = true;
    jpeg_mem_src(&b->d, b->jpeg.data, b->jpeg.bytes);
    jpeg_save_markers(&b->d, JPEG_COM, 0xFFFF);
    (void)jpeg_read_header(&b->d, TRUE);
    b->d.progress = &w->progress;
}

/* Whether a header has the picture's size, so that coefficients may take memory, about 6 bytes a pixel. */
static bool is_plain(const struct work *w, const struct blocks *b)
{
    return (int)b->d.image_width == w->width && (int)b->d.image_height == w->height && !b->d.progressive_mode &&
           !b->d.arith_code && sst_jpeg_may_hold((size_t)w->width * (size_t)w->height, b->jpeg.bytes);
}

static bool are_alike(const struct blocks *a, const struct blocks *b)
{
    bool alike = a->d.num_components == b->d.num_components;

    for (int i = 0; alike && i < a->d.num_components; i++) {
        const jpeg_component_info *p = &a->d.comp_info[i], *q = &b->d.comp_info[i];

        alike = p->h_samp_factor == q->h_samp_factor && p->v_samp_factor == q->v_samp_factor && p->quant_table &&
                q->quant_table &&
                !memcmp(p->quant_table->quantval, q->quant_table->quantval, sizeof(p->quant_table->quantval));
    }
    return alike;
}

/* Groups of blocks that lie together in all components (MCUs). */
static int groups_x(const struct blocks *b)
{
    const int side = b->d.max_h_samp_factor * DCTSIZE;

    return ((int)b->d.image_width + side - 1) / side;
}

static int groups_y(const struct blocks *b)
{
    const int side = b->d.max_v_samp_factor * DCTSIZE;

    return ((int)b->d.image_height + side - 1) / side;
}

static int bits(const struct blocks *b)
{
    return groups_x(b) * groups_y(b);
}

static JBLOCKARRAY row_of(struct blocks *b, int component, JDIMENSION y, bool writes)
{
    return b->d.mem->access_virt_barray((j_common_ptr)&b->d, b->coefs[component], y, 1, writes);
}

/* Read the headers of both, and their coefficients if the pictures are alike. @return false: they are not; may escape
 */
static bool read_both(struct work *w)
{
    read_header(w, &w->base);
    read_header(w, &w->other);
    if (!is_plain(w, &w->base) || !is_plain(w, &w->other))
        return false;
    w->base.coefs = jpeg_read_coefficients(&w->base.d);
    w->other.coefs = jpeg_read_coefficients(&w->other.d);
    return are_alike(&w->base, &w->other); /* its tables are a component's only now */
}

typedef void group_fn(struct work *w, int group, JCOEF *base, JCOEF *other, const UINT16 *step);

/* Call fn with each block of both, its group and its table. */
static void for_blocks(struct work *w, group_fn *fn, bool writes)
{
    for (int i = 0; i < w->other.d.num_components; i++) {
        const jpeg_component_info *info = &w->other.d.comp_info[i];

        for (JDIMENSION y = 0; y < info->height_in_blocks; y++) {
            JBLOCKARRAY base = row_of(&w->base, i, y, false), other = row_of(&w->other, i, y, writes);

            for (JDIMENSION x = 0; x < info->width_in_blocks; x++)
                fn(w, (int)y / info->v_samp_factor * groups_x(&w->other) + (int)x / info->h_samp_factor, base[0][x],
                   other[0][x], info->quant_table->quantval);
        }
    }
}

static bool has(const struct work *w, int group)
{
    return w->mask[HEAD + (size_t)group / 8] >> group % 8 & 1;
}

static void mark(struct work *w, int group)
{
    w->mask[HEAD + (size_t)group / 8] |= (uint8_t)(1u << group % 8);
}

static void compare(struct work *w, int group, JCOEF *base, JCOEF *other, const UINT16 *step)
{
    for (int v = 0; v < LOW; v++)
        for (int u = 0; u + v < LOW; u++) {
            const int k = v * DCTSIZE + u, apart = abs(other[k] - base[k]) * step[k];

            if (apart > LEVELS * DCTSIZE + step[k] / 2.0)
                mark(w, group);
        }
}

static void empty(struct work *w, int group, JCOEF *base SST_UNUSED, JCOEF *other, const UINT16 *step SST_UNUSED)
{
    if (!has(w, group))
        memset(other, 0, sizeof(JBLOCK));
}

static void fill(struct work *w, int group, JCOEF *base, JCOEF *other, const UINT16 *step SST_UNUSED)
{
    if (!has(w, group))
        memcpy(other, base, sizeof(JBLOCK));
}

/* Neighbours of a changed group belong to it: shadows and edges differ by less. @return number of groups */
static int widen(struct work *w)
{
    const int nx = groups_x(&w->other), ny = groups_y(&w->other);
    uint8_t *was = malloc(w->mask_bytes);
    int n = 0;

    if (!was)
        return -ENOMEM;
    memcpy(was, w->mask, w->mask_bytes);
    for (int i = 0; i < nx * ny; i++) {
        if (!(was[HEAD + (size_t)i / 8] >> i % 8 & 1))
            continue;
        for (int y = sst_max_int(i / nx - 1, 0); y <= sst_min_int(i / nx + 1, ny - 1); y++)
            for (int x = sst_max_int(i % nx - 1, 0); x <= sst_min_int(i % nx + 1, nx - 1); x++)
                mark(w, y * nx + x);
    }
    free(was);
    for (int i = 0; i < nx * ny; i++)
        n += has(w, i);
    return n;
}

/* The coefficients of `other` as a JPEG, with the mask or without. */
static void write_blocks(struct work *w, bool masked)
{
    w->c.err = &w->errors;
    jpeg_create_compress(&w->c);
    w->writes = true;
    jpeg_mem_dest(&w->c, &w->made, &w->bytes);
    jpeg_copy_critical_parameters(&w->other.d, &w->c);
    w->c.optimize_coding = TRUE;
    jpeg_write_coefficients(&w->c, w->other.coefs);
    if (masked)
        jpeg_write_marker(&w->c, JPEG_COM, w->mask, (unsigned)w->mask_bytes);
    jpeg_finish_compress(&w->c);
}

static void give(struct work *w, uint8_t **out, size_t *bytes)
{
    *out = w->made;
    *bytes = w->bytes;
    w->made = NULL;
}

int sst_jpeg_parts_cut(const struct sst_jpeg_pair *pair, int64_t base_ns, uint8_t **out, size_t *bytes, double *share)
{
    struct work *w = begin(pair);
    char head[HEAD + 1];
    int n = 0, err = 0;

    if (!w)
        return -ENOMEM;
    if (setjmp(w->escape)) {
        end(w);
        return -EINVAL;
    }
    if (!read_both(w) || bits(&w->other) / 8 + 1 + (int)HEAD > 0xFFFF - 2)
        err = -EINVAL;
    if (!err) {
        w->mask_bytes = HEAD + (size_t)bits(&w->other) / 8 + 1;
        w->mask = calloc(1, w->mask_bytes);
        err = w->mask ? 0 : -ENOMEM;
    }
    if (!err) {
        snprintf(head, sizeof(head), COMMENT "%020" PRId64 " ", base_ns);
        memcpy(w->mask, head, HEAD);
        for_blocks(w, compare, false);
        n = widen(w);
        err = n < 0 ? n : 0;
    }
    if (!err) {
        for_blocks(w, empty, true);
        write_blocks(w, true);
        give(w, out, bytes);
        if (share)
            *share = (double)n / bits(&w->other);
    }
    end(w);
    return err;
}

/* Its comment with the mask: segments of a JPEG before its picture. @return bytes of it; 0: there is none */
static size_t find_mask(struct sst_jpeg_bytes j, const uint8_t **mask)
{
    struct jpeg_segment s = { 0 };

    while (jpeg_next_segment(&s, j.data, j.bytes)) {
        if (s.mark == JPEG_COM && s.bytes > HEAD && !memcmp(s.data, COMMENT, sizeof(COMMENT) - 1)) {
            *mask = s.data;
            return s.bytes;
        }
    }
    return 0;
}

bool sst_jpeg_parts_base(struct sst_jpeg_bytes jpeg, int64_t *base_ns)
{
    const uint8_t *mask;
    char digits[21] = "";
    char *stop;

    if (!find_mask(jpeg, &mask))
        return false;
    memcpy(digits, mask + sizeof(COMMENT) - 1, 20);
    *base_ns = strtoll(digits, &stop, 10);
    return stop == digits + 20;
}

int sst_jpeg_parts_join(const struct sst_jpeg_pair *pair, uint8_t **out, size_t *bytes)
{
    struct work *w = begin(pair);
    const uint8_t *mask = NULL;
    const size_t n = find_mask(pair->other, &mask);
    int err = 0;

    if (!w)
        return -ENOMEM;
    if (setjmp(w->escape)) {
        end(w);
        return -EINVAL;
    }
    if (!n || !read_both(w) || n != HEAD + (size_t)bits(&w->other) / 8 + 1)
        err = -EINVAL;
    if (!err) {
        w->mask = malloc(n);
        err = w->mask ? 0 : -ENOMEM;
    }
    if (!err) {
        memcpy(w->mask, mask, n);
        for_blocks(w, fill, true);
        write_blocks(w, false);
        give(w, out, bytes);
    }
    end(w);
    return err;
}
