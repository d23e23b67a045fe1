/* PNG files of the common kinds: 8-bit RGB, 8-bit grey or indexed, 16-bit grey, not interlaced.
 * They are inflated at once by libdeflate, in a third of zlib's time. Everything else, every fault included, is
 * libpng's. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/image_internal.h"

#include <libdeflate.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/image/image.h"

#define SIGNATURE   8  /* bytes */
#define AROUND      12 /* bytes of a chunk beside its data: length, type, CRC-32 */
#define HEADER_SIZE 13

enum { GREY = 0, RGB = 2, INDEXED = 3 }; /* colour types */

struct chunk {
    const uint8_t *type, *data;
    uint32_t size;
};

struct file {
    const uint8_t *data;
    size_t size, pos;
};

static uint32_t big_endian(const uint8_t *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

static bool is(const struct chunk *c, const char *type)
{
    return !memcmp(c->type, type, 4);
}

/* The next chunk; false where the file ends too early or is damaged. */
static bool next_chunk(struct file *f, struct chunk *c)
{
    const uint8_t *at = f->data + f->pos;

    if (f->size - f->pos < AROUND)
        return false;
    *c = (struct chunk){ at + 4, at + 8, big_endian(at) };
    if (c->size > f->size - f->pos - AROUND ||
        libdeflate_crc32(0, c->type, 4 + (size_t)c->size) != big_endian(c->data + c->size))
        return false;
    f->pos += AROUND + (size_t)c->size;
    return true;
}

static bool read_header(const struct chunk *c, struct png_plain *out)
{
    uint32_t width, height;
    int depth, type;

    if (!is(c, "IHDR") || c->size != HEADER_SIZE || c->data[10] || c->data[11] || c->data[12])
        return false;
    width = big_endian(c->data);
    height = big_endian(c->data + 4);
    depth = c->data[8];
    type = c->data[9];
    if (!width || !height || width > SST_IMAGE_MAX_SIDE || height > SST_IMAGE_MAX_SIDE ||
        (size_t)width * height > SST_IMAGE_MAX_PIXELS)
        return false;
    if (!(depth == 8 && (type == GREY || type == RGB || type == INDEXED)) && !(depth == 16 && type == GREY))
        return false;
    out->kind = type == RGB ? PNG_PLAIN_RGB : depth == 16 ? PNG_PLAIN_U16 : PNG_PLAIN_U8;
    out->indexed = type == INDEXED;
    out->width = (int)width;
    out->height = (int)height;
    out->step = type == RGB ? 3 : (size_t)depth / 8;
    return true;
}

/* Chunks up to the end: compressed data goes to `packed`, which is as large as the file. @return its size; 0: not
 * plain */
static size_t collect(struct file *f, bool indexed, uint8_t *packed)
{
    bool palette = !indexed, done = false;
    struct chunk c;
    size_t n = 0;

    while (next_chunk(f, &c)) {
        if (is(&c, "IEND"))
            return n;
        if (is(&c, "IDAT")) {
            if (!palette || done)
                return 0;
            memcpy(packed + n, c.data, c.size);
            n += c.size;
            continue;
        }
        done = n > 0;
        if (is(&c, "PLTE") && !done && c.size && c.size <= 768 && c.size % 3 == 0)
            palette = true;
        else if (!(c.type[0] & 0x20) || is(&c, "tRNS")) /* critical, or changes the samples */
            return 0;
    }
    return 0;
}

static uint8_t paeth(int left, int up, int corner)
{
    const int to_left = abs(up - corner), to_up = abs(left - corner), to_corner = abs(left + up - 2 * corner);

    return (uint8_t)(to_left <= to_up && to_left <= to_corner ? left : to_up <= to_corner ? up : corner);
}

/* Undo a row's filter. @param up  the row above; zeros for the first */
static bool unfilter(int filter, uint8_t *row, const uint8_t *up, size_t n, size_t step)
{
    switch (filter) {
    case 0:
        return true;
    case 1:
        for (size_t i = step; i < n; i++)
            row[i] = (uint8_t)(row[i] + row[i - step]);
        return true;
    case 2:
        for (size_t i = 0; i < n; i++)
            row[i] = (uint8_t)(row[i] + up[i]);
        return true;
    case 3:
        for (size_t i = 0; i < n; i++)
            row[i] = (uint8_t)(row[i] + ((i < step ? 0 : row[i - step]) + up[i]) / 2);
        return true;
    case 4:
        for (size_t i = 0; i < n; i++)
            row[i] = (uint8_t)(row[i] + (i < step ? up[i] : paeth(row[i - step], up[i], up[i - step])));
        return true;
    default:
        return false;
    }
}

static bool unfilter_all(const struct png_plain *out)
{
    const size_t n = out->step * (size_t)out->width;
    uint8_t *zeros = calloc(n, 1);
    const uint8_t *up = zeros;
    bool good = zeros != NULL;

    for (int y = 0; good && y < out->height; y++) {
        uint8_t *row = out->rows + (size_t)y * (n + 1);

        good = unfilter(row[0], row + 1, up, n, out->step);
        up = row + 1;
    }
    free(zeros);
    return good;
}

static bool inflate_all(const uint8_t *packed, size_t size, const struct png_plain *out)
{
    struct libdeflate_decompressor *d = libdeflate_alloc_decompressor();
    const size_t want = (size_t)out->height * (out->step * (size_t)out->width + 1);
    size_t used = 0;
    const bool good =
        d && libdeflate_zlib_decompress_ex(d, packed, size, out->rows, want, &used, NULL) == LIBDEFLATE_SUCCESS;

    libdeflate_free_decompressor(d);
    return good && used == size;
}

bool png_plain_read(struct png_plain *out, const uint8_t *data, size_t size, enum png_plain_kind kind)
{
    static const uint8_t signature[SIGNATURE] = { 0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n' };
    struct file f = { data, size, SIGNATURE };
    uint8_t *packed = NULL;
    struct chunk c;
    size_t row, n;
    bool good;

    *out = (struct png_plain){ 0 };
    if (size < SIGNATURE || memcmp(data, signature, SIGNATURE) || !next_chunk(&f, &c) || !read_header(&c, out) ||
        out->kind != kind)
        return false;
    row = out->step * (size_t)out->width + 1;
    if (row * (size_t)out->height / PNG_PLAIN_MOST_RATIO > size) /* claims more than it can hold */
        return false;
    packed = malloc(size);
    n = packed ? collect(&f, out->indexed, packed) : 0;
    out->rows = n ? sst_mem_alloc_raw((size_t)out->height, row) : NULL;
    good = out->rows && inflate_all(packed, n, out) && unfilter_all(out);
    free(packed);
    if (!good)
        png_plain_fini(out);
    return good;
}

void png_plain_fini(struct png_plain *p)
{
    sst_mem_free(p->rows);
    *p = (struct png_plain){ 0 };
}
