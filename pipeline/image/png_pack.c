/* PNG files of maps and pictures, packed by ISA-L in a quarter of the time that zlib needs for runs of bytes alone. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/image_internal.h"

#include <isa-l/crc.h>
#include <isa-l/igzip_lib.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"

#define HEADER_SIZE 13
#define SUB         1          /* filter: differences from the pixel before */
#define UP          2          /* differences from the row above */
#define MORE        (1u << 16) /* bytes: chunks, palette, and growth of samples that do not shrink */

#define WHOLE (1u << 18) /* bytes of samples below which all are counted */

enum { GREY = 0, RGB = 2, INDEXED = 3 }; /* colour types */

static uint8_t *put_big_endian(uint8_t *at, uint32_t v)
{
    const uint8_t bytes[4] = { (uint8_t)(v >> 24), (uint8_t)(v >> 16), (uint8_t)(v >> 8), (uint8_t)v };

    memcpy(at, bytes, sizeof(bytes));
    return at + sizeof(bytes);
}

/* Complete a chunk with its data, of n bytes, 8 bytes after `at`. @return its end */
static uint8_t *close_chunk(uint8_t *at, const char type[4], size_t n)
{
    put_big_endian(at, (uint32_t)n);
    memcpy(at + 4, type, 4);
    return put_big_endian(at + 8 + n, crc32_gzip_refl(0, at + 4, 4 + n));
}

static uint8_t *put_chunk(uint8_t *at, const char type[4], const void *data, size_t n)
{
    if (n)
        memcpy(at + 8, data, n);
    return close_chunk(at, type, n);
}

static uint8_t *put_header(uint8_t *at, const struct png_map *map)
{
    static const uint8_t signature[] = { 0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n' };
    uint8_t header[HEADER_SIZE] = { 0 };

    put_big_endian(header, (uint32_t)map->width);
    put_big_endian(header + 4, (uint32_t)map->height);
    header[8] = map->u16 ? 16 : 8;
    header[9] = map->image ? RGB : map->palette ? INDEXED : GREY;
    memcpy(at, signature, sizeof(signature));
    at = put_chunk(at + sizeof(signature), "IHDR", header, sizeof(header));
    return map->palette ? put_chunk(at, "PLTE", map->palette, 256 * 3) : at;
}

static const uint8_t *row_of(const struct png_map *map, int y)
{
    return (const uint8_t *)map->data + (size_t)y * map->stride;
}

/* Differences of 8 bits from the row above. */
static void filter_u8(uint8_t *restrict to, const uint8_t *restrict row, const uint8_t *restrict up, size_t n)
{
    for (size_t x = 0; x < n; x++)
        to[x] = (uint8_t)(row[x] - up[x]);
}

/* Codes of the two bytes of a number, the upper one first. */
static void filter_u16(uint8_t *restrict to, const uint16_t *restrict row, const uint16_t *restrict up, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const unsigned upper = (row[x] >> 8) - (up[x] >> 8), lower = (unsigned)row[x] - up[x];

        to[2 * x] = (uint8_t)upper;
        to[2 * x + 1] = (uint8_t)lower;
    }
}

/* Differences of each colour from the pixel before. */
static void filter_rgb(uint8_t *restrict to, const struct sst_image *image, int y)
{
    for (int c = 0; c < 3; c++) {
        const uint8_t *row = sst_image_row(image, c, y);

        to[c] = row[0];
        for (size_t x = 1; x < (size_t)image->width; x++)
            to[3 * x + (size_t)c] = (uint8_t)(row[x] - row[x - 1]);
    }
}

/* Bytes of a row's samples. */
static size_t row_bytes(const struct png_map *map)
{
    return (size_t)map->width * (map->image ? 3 : map->u16 ? 2 : 1);
}

/* Filtered samples: filters do not shrink a map of indices. @param zeros  [stride] above the first row */
static void filter_all(uint8_t *to, const struct png_map *map, const void *zeros)
{
    const size_t width = (size_t)map->width;
    const void *up = zeros;

    for (int y = 0; y < map->height; y++) {
        const void *row = map->image ? NULL : row_of(map, y);

        *to++ = map->image ? SUB : map->palette ? 0 : UP;
        if (map->image)
            filter_rgb(to, map->image, y);
        else if (map->palette)
            memcpy(to, row, width);
        else if (map->u16)
            filter_u16(to, row, up, width);
        else
            filter_u8(to, row, up, width);
        to += row_bytes(map);
        up = row;
    }
}

/* Working memory of the library. */
struct work {
    struct isal_huff_histogram histogram;
    struct isal_hufftables tables;
    struct isal_zstream stream;
};

/* Level 0 with tables of the samples' own: as small as level 1, whose first matches depend on where the stream lies in
 * memory (its code of 2.30 for x86 hashes the address of the stream in place of the samples after the first byte).
 * @param work  of zeros  @return bytes of `out`; 0: it is too small */
static size_t deflate_all(uint8_t *out, size_t capacity, uint8_t *samples, size_t n, struct work *work)
{
    struct isal_zstream *z = &work->stream;
    const size_t counted = n < WHOLE ? n : n / 4; /* from the middle: enough for the tables, in a quarter of the time */

    isal_update_histogram(samples + (n - counted) / 2, (int)counted, &work->histogram);
    if (isal_create_hufftables(&work->tables, &work->histogram))
        return 0;
    isal_deflate_stateless_init(z);
    z->hufftables = &work->tables;
    z->gzip_flag = IGZIP_ZLIB;
    z->flush = NO_FLUSH;
    z->end_of_stream = 1;
    z->next_in = samples;
    z->avail_in = (uint32_t)n;
    z->next_out = out;
    z->avail_out = (uint32_t)capacity;
    return isal_deflate_stateless(z) == COMP_OK && !z->avail_in ? z->total_out : 0;
}

bool png_pack_map(uint8_t **out, size_t *size, const struct png_map *map)
{
    const size_t n = (size_t)map->height * (row_bytes(map) + 1), capacity = n + n / 8 + MORE;
    struct work *work; /* and a row of zeros */
    uint8_t *samples, *file, *end;
    size_t packed = 0;

    if (capacity > INT32_MAX) /* a chunk is not longer */
        return false;
    samples = sst_mem_alloc_raw(n, 1);
    file = end = malloc(capacity + 2 * MORE);
    work = calloc(sizeof(*work) + map->stride, 1);
    if (samples && file && work) {
        filter_all(samples, map, work + 1);
        end = put_header(file, map);
        packed = deflate_all(end + 8, capacity, samples, n, work);
    }
    sst_mem_free(samples);
    free(work);
    if (!packed) {
        free(file);
        return false;
    }
    end = put_chunk(close_chunk(end, "IDAT", packed), "IEND", NULL, 0);
    *out = file;
    *size = (size_t)(end - file);
    return true;
}
