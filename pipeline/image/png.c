/* PNG through libpng, from and to memory. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

#define MESSAGE_BYTES 128

/* Everything that must survive a longjmp out of libpng lives here, not in locals. */
struct reader {
    const uint8_t *data;
    size_t size, pos;
    const char *name;
    png_structp png;
    png_infop info;
    int width, height;
    png_bytep *rows;
    uint8_t *packed; /* the rows, each of `row` bytes */
    size_t row;
    char message[MESSAGE_BYTES];
};

/* The error pointer is the buffer of the message. */
static void on_error(png_structp png, png_const_charp message)
{
    snprintf(png_get_error_ptr(png), MESSAGE_BYTES, "%s", message);
    longjmp(png_jmpbuf(png), 1);
}

/* Warnings are about chunks that do not touch the samples. */
static void ignore_warning(png_structp png SST_UNUSED, png_const_charp message SST_UNUSED)
{
}

static void read_bytes(png_structp png, png_bytep out, size_t n)
{
    struct reader *r = png_get_io_ptr(png);

    if (n > r->size - r->pos)
        png_error(png, "it ends too early");
    memcpy(out, r->data + r->pos, n);
    r->pos += n;
}

static void read_info(struct reader *r)
{
    png_set_read_fn(r->png, r, read_bytes);
    /* Sizes are checked below, with a clearer message than libpng's. */
    png_set_user_limits(r->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    png_set_crc_action(r->png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
    /* Only IHDR, PLTE, tRNS, IDAT and IEND matter; colour profiles and texts are skipped unparsed. */
    png_set_keep_unknown_chunks(r->png, PNG_HANDLE_CHUNK_NEVER, NULL, -1);
    png_set_check_for_invalid_index(r->png, -1);
    png_read_info(r->png, r->info);
}

static int check_size(struct reader *r)
{
    const png_uint_32 w = png_get_image_width(r->png, r->info), h = png_get_image_height(r->png, r->info);

    if (w > SST_IMAGE_MAX_SIDE || h > SST_IMAGE_MAX_SIDE || (size_t)w * h > SST_IMAGE_MAX_PIXELS)
        return sst_image_size_error(-EINVAL, r->name, w, h);
    if (png_get_rowbytes(r->png, r->info) * h / PNG_PLAIN_MOST_RATIO > r->size) {
        sst_log_error("%s is a truncated PNG image (%zu bytes for %ux%u pixels); write it again", r->name, r->size,
                      (unsigned)w, (unsigned)h);
        return -EBADMSG;
    }
    r->width = (int)w;
    r->height = (int)h;
    return 0;
}

/* Work on a file of which the beginning is read; may escape. */
typedef int work_fn(struct reader *r, void *arg);

/* libpng returns by longjmp: everything that must survive it is in *r, outside this stack frame. */
static int guarded(struct reader *r, work_fn *work, void *arg)
{
    int err;

    if (setjmp(png_jmpbuf(r->png))) {
        sst_log_error("%s is a damaged or truncated PNG image (%s); write it again", r->name, r->message);
        return -EBADMSG;
    }
    read_info(r);
    err = check_size(r);
    return err ? err : work(r, arg);
}

static int read_file(const uint8_t *data, size_t size, const char *name, work_fn *work, void *arg)
{
    struct reader r = { .data = data, .size = size, .name = name };
    int err;

    r.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, r.message, on_error, ignore_warning);
    r.info = r.png ? png_create_info_struct(r.png) : NULL;
    err = r.info ? guarded(&r, work, arg) : sst_image_size_error(-ENOMEM, name, 0, 0);
    png_destroy_read_struct(&r.png, &r.info, NULL);
    free(r.rows);
    sst_mem_free(r.packed);
    return err;
}

/* Grey, or red, green and blue, as palettes have. */
static int channels_of(const struct reader *r)
{
    return png_get_color_type(r->png, r->info) & PNG_COLOR_MASK_COLOR ? 3 : 1;
}

/* Read all rows as they are after the transforms that are set. */
static int read_rows(struct reader *r)
{
    const size_t height = (size_t)r->height;

    png_set_interlace_handling(r->png);
    png_read_update_info(r->png, r->info);
    r->row = png_get_rowbytes(r->png, r->info);
    r->rows = malloc(height * sizeof(*r->rows));
    r->packed = sst_mem_alloc_raw(height, r->row);
    if (!r->rows || !r->packed)
        return sst_image_size_error(-ENOMEM, r->name, r->width, r->height);
    for (size_t y = 0; y < height; y++)
        r->rows[y] = r->packed + y * r->row;
    png_read_image(r->png, r->rows);
    return 0;
}

static int check_format(const struct reader *r, enum png_plain_kind kind)
{
    const int depth = png_get_bit_depth(r->png, r->info), type = png_get_color_type(r->png, r->info);

    if (kind == PNG_PLAIN_U8 && (depth > 8 || (type != PNG_COLOR_TYPE_GRAY && type != PNG_COLOR_TYPE_PALETTE))) {
        sst_log_error("%s is not an 8-bit grey or indexed PNG; store the values themselves, not colours", r->name);
        return -EBADMSG;
    }
    if (kind == PNG_PLAIN_U16 && (depth != 16 || type != PNG_COLOR_TYPE_GRAY)) {
        sst_log_error("%s is not a 16-bit grey PNG", r->name);
        return -EBADMSG;
    }
    return 0;
}

/* Big-endian RGB of 16 bits to packed RGB in place. */
static void scale_row(uint8_t *row, int width, struct sst_samples samples)
{
    for (int i = 0; i < 3 * width; i++)
        row[i] = (uint8_t)sst_samples_scale(row[2 * i] << 8 | row[2 * i + 1], samples);
}

/* A picture that is decoded: a zeroed sst_image, sst_map_u8 or sst_map_u16 by its kind, freed by the caller on failure;
 * and the samples of 16 bits that become levels 0 and 255 of an image. */
struct decoded {
    enum png_plain_kind kind;
    struct sst_samples samples;
    void *out;
};

static int make_picture(const struct decoded *d, int width, int height)
{
    return d->kind == PNG_PLAIN_RGB  ? sst_image_init(d->out, width, height)
           : d->kind == PNG_PLAIN_U8 ? sst_map_u8_init(d->out, width, height)
                                     : sst_map_u16_init(d->out, width, height);
}

/* A row of samples as in the file. */
static void put_row(const struct decoded *d, int y, const uint8_t *row, int width)
{
    if (d->kind == PNG_PLAIN_RGB)
        sst_rgb_unpack_row(d->out, y, row);
    else if (d->kind == PNG_PLAIN_U8)
        memcpy(sst_map_u8_row(d->out, y), row, (size_t)width);
    for (int x = 0; d->kind == PNG_PLAIN_U16 && x < width; x++)
        sst_map_u16_row(d->out, y)[x] = (uint16_t)(row[2 * x] << 8 | row[2 * x + 1]);
}

static int decode_rows(struct reader *r, void *arg)
{
    const struct decoded *d = arg;
    const bool deep = d->kind == PNG_PLAIN_RGB && d->samples.white && png_get_bit_depth(r->png, r->info) == 16;
    int err = check_format(r, d->kind);

    if (err)
        return err;
    if (d->kind == PNG_PLAIN_RGB) {
        png_set_expand(r->png);
        if (!deep)
            png_set_scale_16(r->png);
        png_set_gray_to_rgb(r->png);
        png_set_strip_alpha(r->png);
    } else {
        png_set_packing(r->png);
    }
    err = make_picture(d, r->width, r->height);
    err = err ? sst_image_size_error(err, r->name, r->width, r->height) : read_rows(r);
    if (err)
        return err;
    png_read_end(r->png, NULL);
    for (int y = 0; y < r->height; y++) {
        if (deep)
            scale_row(r->rows[y], r->width, d->samples);
        put_row(d, y, r->rows[y], r->width);
    }
    return 0;
}

/* Decode the common kinds of files without libpng. @return false: libpng's turn */
static bool decode_plain(const uint8_t *data, size_t size, const struct decoded *d)
{
    struct png_plain p;
    bool good;

    if (!WITH_DEFLATE || !png_plain_read(&p, data, size, d->kind))
        return false;
    good = !make_picture(d, p.width, p.height);
    for (int y = 0; good && y < p.height; y++)
        put_row(d, y, p.rows + (size_t)y * (p.step * (size_t)p.width + 1) + 1, p.width);
    png_plain_fini(&p);
    return good;
}

static int decode(const uint8_t *data, size_t size, const char *name, struct decoded d)
{
    return decode_plain(data, size, &d) ? 0 : read_file(data, size, name, decode_rows, &d);
}

int sst_png_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                   struct sst_samples samples)
{
    struct sst_image made = { 0 };
    int err = decode(data, size, name, (struct decoded){ PNG_PLAIN_RGB, samples, &made });

    if (err)
        sst_image_fini(&made);
    else
        *img = made;
    return err;
}

/* A picture's levels as they are: a zeroed sst_deep, freed by the caller on failure. */
static int deep_rows(struct reader *r, void *arg)
{
    struct sst_deep *deep = arg;
    const int channels = channels_of(r), wide = png_get_bit_depth(r->png, r->info) == 16;
    int err = sst_deep_init(deep, r->width, r->height, channels, wide ? 65535 : 255);

    png_set_expand(r->png);
    png_set_strip_alpha(r->png);
    err = err ? sst_image_size_error(err, r->name, r->width, r->height) : read_rows(r);
    if (err)
        return err;
    png_read_end(r->png, NULL);
    for (int i = 0; i < channels * r->height; i++) {
        const int step = wide ? 2 * channels : channels;
        const uint8_t *row = r->rows[i / channels] + (wide ? 2 : 1) * (i % channels);
        uint16_t *to = sst_map_u16_row(&deep->plane[i % channels], i / channels);

        for (int x = 0; x < r->width; x++)
            to[x] = (uint16_t)(wide ? row[x * step] << 8 | row[x * step + 1] : row[x * step]);
    }
    return 0;
}

/* 8-bit RGB or grey without libpng. @return false: libpng's turn */
static bool deep_plain(struct sst_deep *deep, const uint8_t *data, size_t size)
{
    static const enum png_plain_kind kinds[2] = { PNG_PLAIN_RGB, PNG_PLAIN_U8 };
    struct png_plain p;
    bool good = false;

    for (int i = 0; WITH_DEFLATE && !good && i < 2; i++)
        good = png_plain_read(&p, data, size, kinds[i]);
    if (!WITH_DEFLATE || !good)
        return false;
    good = !p.indexed && !sst_deep_init(deep, p.width, p.height, (int)p.step, 255);
    for (int y = 0; good && y < p.height; y++) {
        const uint8_t *row = p.rows + (size_t)y * (p.step * (size_t)p.width + 1) + 1;

        for (size_t c = 0; c < p.step; c++) {
            uint16_t *to = sst_map_u16_row(&deep->plane[c], y);

            for (size_t x = 0; x < (size_t)p.width; x++)
                to[x] = row[x * p.step + c];
        }
    }
    png_plain_fini(&p);
    return good;
}

int sst_png_decode_deep(struct sst_deep *out, const uint8_t *data, size_t size, const char *name)
{
    struct sst_deep made = { 0 };
    int err;

    if (deep_plain(&made, data, size)) {
        *out = made;
        return 0;
    }

    if (decode_plain(data, size, &(struct decoded){ PNG_PLAIN_U16, { 0, 0 }, &made.plane[0] })) {
        *out = (struct sst_deep){ made.plane[0].width, made.plane[0].height, 1, 65535, { made.plane[0] } };
        return 0;
    }
    sst_deep_fini(&made);
    err = read_file(data, size, name, deep_rows, &made);
    if (err)
        sst_deep_fini(&made);
    else
        *out = made;
    return err;
}

static int note_size(struct reader *r, void *arg)
{
    struct sst_deep_size *out = arg;

    *out = (struct sst_deep_size){ r->width, r->height, channels_of(r),
                                   png_get_bit_depth(r->png, r->info) == 16 ? 16 : 8 };
    return 0;
}

int sst_png_size(struct sst_deep_size *out, const uint8_t *data, size_t size, const char *name)
{
    return read_file(data, size, name, note_size, out);
}

#define DEFINE_MAP_READ(kind, sample)                                                                                  \
    int sst_map_##kind##_read_png(struct sst_map_##kind *map, const char *path)                                        \
    {                                                                                                                  \
        struct sst_map_##kind made = { 0 };                                                                            \
        uint8_t *data;                                                                                                 \
        size_t size;                                                                                                   \
        int err = sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size);                                              \
                                                                                                                       \
        if (err)                                                                                                       \
            return err;                                                                                                \
        err = decode(data, size, path, (struct decoded){ sample, { 0, 0 }, &made });                                   \
        free(data);                                                                                                    \
        if (err)                                                                                                       \
            sst_map_##kind##_fini(&made);                                                                              \
        else                                                                                                           \
            *map = made;                                                                                               \
        return err;                                                                                                    \
    }

DEFINE_MAP_READ(u8, PNG_PLAIN_U8)
DEFINE_MAP_READ(u16, PNG_PLAIN_U16)

/* A PNG being written to memory. */
struct writer {
    FILE *stream; /* of memory */
    char *data;
    size_t size;
    uint8_t *packed; /* one row of RGB */
    png_structp png;
    png_infop info;
    char message[MESSAGE_BYTES];
};

/* The image to write: one of three types. */
struct picture {
    const struct sst_map_u16 *deep; /* [3] planes of 16-bit RGB */
    const struct sst_image *image;
    const struct png_map *map;
    int width, height;
    struct sst_samples samples; /* of 16 bits, for an image; white 0: 8 bits */
};

/* Packed RGB to samples of 16 bits, big-endian, in place. */
static void deepen_row(uint8_t *row, int width, struct sst_samples s)
{
    for (int i = 3 * width - 1; i >= 0; i--) {
        const int v = s.black + (row[i] * (s.white - s.black) + 127) / 255;

        row[2 * i] = (uint8_t)(v >> 8);
        row[2 * i + 1] = (uint8_t)v;
    }
}

/* Planes to packed samples, big-endian. */
static void pack_deep_row(uint8_t *row, const struct sst_map_u16 plane[3], int y)
{
    for (int i = 0; i < 3 * plane[0].width; i++) {
        const int v = sst_map_u16_row(&plane[i % 3], y)[i / 3];

        row[2 * i] = (uint8_t)(v >> 8);
        row[2 * i + 1] = (uint8_t)v;
    }
}

static void write_rows(struct writer *w, const struct picture *p)
{
    const struct png_map *map = p->map;
    const bool rgb = !map, wide = map ? map->u16 : p->deep || p->samples.white, indexed = map && map->palette;
    const int type = rgb ? PNG_COLOR_TYPE_RGB : indexed ? PNG_COLOR_TYPE_PALETTE : PNG_COLOR_TYPE_GRAY;

    png_init_io(w->png, w->stream);
    png_set_IHDR(w->png, w->info, (png_uint_32)p->width, (png_uint_32)p->height, wide ? 16 : 8, type,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (indexed)
        png_set_PLTE(w->png, w->info, (png_const_colorp)map->palette, 256); /* three bytes each */
    /* Speed before size: many of these files are written. Of a map, runs of bytes alone are smaller than short matches,
     * in two thirds of the time. Filters do not shrink a map of indices. */
    png_set_compression_level(w->png, 2);
    if (!rgb)
        png_set_compression_strategy(w->png, Z_RLE);
    png_set_filter(w->png, PNG_FILTER_TYPE_BASE, indexed ? PNG_FILTER_NONE : rgb ? PNG_FILTER_SUB : PNG_FILTER_UP);
    png_write_info(w->png, w->info);
    if (map && map->u16 && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__)
        png_set_swap(w->png);
    for (int y = 0; y < p->height; y++) {
        if (p->image)
            sst_rgb_pack_row(w->packed, p->image, y);
        else if (p->deep)
            pack_deep_row(w->packed, p->deep, y);
        if (p->samples.white)
            deepen_row(w->packed, p->width, p->samples);
        png_write_row(w->png, map ? (png_const_bytep)map->data + (size_t)y * map->stride : w->packed);
    }
    png_write_end(w->png, w->info);
}

static int encode(struct writer *w, const struct picture *p, const char *path)
{
    if (setjmp(png_jmpbuf(w->png))) {
        /* Encoding to memory only fails for lack of memory. */
        sst_log_error("cannot encode %s: %s", path, w->message);
        return -ENOMEM;
    }
    write_rows(w, p);
    return 0;
}

static int write_png(const struct picture *p, const char *path)
{
    struct writer w = { 0 };
    int err;

    w.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, w.message, on_error, ignore_warning);
    w.info = w.png ? png_create_info_struct(w.png) : NULL;
    w.packed = p->map ? NULL : malloc((size_t)p->width * 6);
    w.stream = open_memstream(&w.data, &w.size);
    if (!w.info || !w.stream || (!p->map && !w.packed))
        err = sst_image_size_error(-ENOMEM, path, p->width, p->height);
    else
        err = encode(&w, p, path);
    if (w.stream && fclose(w.stream) && !err)
        err = sst_image_size_error(-ENOMEM, path, p->width, p->height);
    err = err ? err : sst_file_write(path, w.data, w.size);
    png_destroy_write_struct(&w.png, &w.info);
    free(w.packed);
    free(w.data);
    return err;
}

int sst_image_write_png(const struct sst_image *img, const char *path)
{
    return png_write_map(&(struct png_map){ .image = img, .width = img->width, .height = img->height }, path);
}

int sst_image_write_samples(const struct sst_image *img, struct sst_samples samples, const char *path)
{
    if (!samples.white)
        samples.white = 65535;
    return write_png(&(struct picture){ .image = img, .width = img->width, .height = img->height, .samples = samples },
                     path);
}

int png_write_map(const struct png_map *map, const char *path)
{
    uint8_t *data;
    size_t size;
    int err;

    if (!WITH_ISAL || !png_pack_map(&data, &size, map))
        return write_png(
            &(struct picture){
                .image = map->image, .map = map->image ? NULL : map, .width = map->width, .height = map->height },
            path);
    err = sst_file_write(path, data, size);
    free(data);
    return err;
}

int sst_map_u8_write_png(const struct sst_map_u8 *map, const char *path, const uint8_t (*palette)[3])
{
    return png_write_map(&(struct png_map){ map->data, map->stride, map->width, map->height, false, palette, NULL },
                         path);
}

int sst_map_u16_write_png(const struct sst_map_u16 *map, const char *path)
{
    return png_write_map(&(struct png_map){ map->data, map->stride, map->width, map->height, true, NULL, NULL }, path);
}

int sst_image_write_deep(const struct sst_map_u16 plane[3], const char *path)
{
    return write_png(&(struct picture){ .deep = plane, .width = plane[0].width, .height = plane[0].height }, path);
}
