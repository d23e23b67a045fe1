/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/file_tiff.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

#define MORE_MEMORY (16u << 20) /* bytes: largest allocation of the library beside the file's size */

struct tiff_library tiff_lib;
static bool loaded;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void load(void)
{
    void *library = dlopen(SST_TIFF_LIBRARY, RTLD_NOW | RTLD_LOCAL);

    if (!library) {
        sst_log_warning("cannot load %s: %s; install the package that has it", SST_TIFF_LIBRARY, dlerror());
        return;
    }
    loaded = true;
#define X(name)                                                                                                        \
    *(void **)&tiff_lib.name = dlsym(library, #name);                                                                  \
    loaded = loaded && tiff_lib.name;
    TIFF_FUNCTIONS(X)
#undef X
}

/* --- the library's view of memory --------------------------------------------------------------------------------- */

static int on_error(TIFF *tif SST_UNUSED, void *user, const char *module SST_UNUSED, const char *format, va_list args)
{
    struct tiff_file *f = user;

    if (!f->message[0])
        vsnprintf(f->message, sizeof(f->message), format, args);
    return 1;
}

/* Unknown tags, mostly. Of tags that it cannot read it only warns, and then reads indices as levels of grey. */
static int on_warning(TIFF *tif SST_UNUSED, void *user, const char *module SST_UNUSED, const char *format, va_list args)
{
    struct tiff_file *f = user;
    char text[sizeof(f->message)];

    vsnprintf(text, sizeof(text), format, args);
    sst_log_debug("%s: %s", f->name, text);
    if (!f->message[0] && (strstr(text, "IO error") || strstr(text, "\"ColorMap\"")))
        memcpy(f->message, text, sizeof(text));
    return 1;
}

static tmsize_t read_bytes(thandle_t handle, void *to, tmsize_t n)
{
    struct tiff_file *f = handle;
    const size_t left = f->pos < f->size ? f->size - f->pos : 0, bytes = (size_t)n < left ? (size_t)n : left;

    if (n <= 0 || !bytes)
        return 0;
    memcpy(to, (f->in ? f->in : f->out) + f->pos, bytes);
    f->pos += bytes;
    return (tmsize_t)bytes;
}

static tmsize_t write_bytes(thandle_t handle, void *from, tmsize_t n)
{
    struct tiff_file *f = handle;
    const size_t end = f->pos + (size_t)n;

    if (f->in || n < 0)
        return -1;
    if (end > f->capacity) {
        const size_t capacity = end + end / 2 + 4096;
        uint8_t *out = realloc(f->out, capacity);

        if (!out)
            return -1;
        memset(out + f->capacity, 0, capacity - f->capacity);
        f->out = out;
        f->capacity = capacity;
    }
    memcpy(f->out + f->pos, from, (size_t)n);
    f->pos = end;
    f->size = f->size < end ? end : f->size;
    return n;
}

static toff_t seek(thandle_t handle, toff_t offset, int whence)
{
    struct tiff_file *f = handle;

    f->pos = offset + (whence == SEEK_CUR ? f->pos : whence == SEEK_END ? f->size : 0);
    return f->pos;
}

static int close_nothing(thandle_t handle SST_UNUSED)
{
    return 0;
}

static toff_t size_of(thandle_t handle)
{
    return ((struct tiff_file *)handle)->size;
}

static int map(thandle_t handle, void **base, toff_t *size)
{
    struct tiff_file *f = handle;

    if (!f->in)
        return 0;
    *base = (void *)(uintptr_t)f->in; /* it is only read */
    *size = f->size;
    return 1;
}

static void unmap(thandle_t handle SST_UNUSED, void *base SST_UNUSED, toff_t size SST_UNUSED)
{
}

int tiff_open(struct tiff_file *f, const char *mode)
{
    TIFFOpenOptions *options;

    pthread_once(&once, load);
    if (!loaded) {
        sst_log_error("%s: TIFF files need libtiff, which cannot be loaded; install the package libtiff6", f->name);
        return -EBADMSG;
    }
    options = tiff_lib.TIFFOpenOptionsAlloc();
    if (!options)
        return sst_image_size_error(-ENOMEM, f->name, 0, 0);
    tiff_lib.TIFFOpenOptionsSetErrorHandlerExtR(options, on_error, f);
    tiff_lib.TIFFOpenOptionsSetWarningHandlerExtR(options, on_warning, f);
    if (f->in)
        tiff_lib.TIFFOpenOptionsSetMaxSingleMemAlloc(options, (tmsize_t)(f->size + MORE_MEMORY));
    f->tif = tiff_lib.TIFFClientOpenExt(f->name, mode, f, read_bytes, write_bytes, seek, close_nothing, size_of, map,
                                        unmap, options);
    tiff_lib.TIFFOpenOptionsFree(options);
    return f->tif ? 0 : -EBADMSG;
}

void tiff_close(struct tiff_file *f)
{
    if (f->tif)
        tiff_lib.TIFFClose(f->tif);
}

/* --- the first page ----------------------------------------------------------------------------------------------- */

int tiff_damaged(const struct tiff_file *f)
{
    sst_log_error("%s is a damaged or truncated TIFF (%s); write it again", f->name,
                  f->message[0] ? f->message : "it ends too early");
    return -EBADMSG;
}

int tiff_refuse(const struct tiff_file *f, const char *what, const char *remedy)
{
    sst_log_error("%s is a TIFF %s; %s", f->name, what, remedy);
    return -EBADMSG;
}

/* Factor by which this compression expands at most; 0: it is not read. */
static size_t expansion(uint16_t compression)
{
    switch (compression) {
    case COMPRESSION_NONE:
        return 1;
    case COMPRESSION_PACKBITS:
        return 64; /* 2 bytes to 128 */
    case COMPRESSION_LZW:
        return 2731; /* 12 bits to a string of 4096 */
    case COMPRESSION_ADOBE_DEFLATE:
    case COMPRESSION_DEFLATE:
        return PNG_PLAIN_MOST_RATIO;
    default:
        return 0;
    }
}

static int refuse_compression(const struct tiff_file *f)
{
    static const struct {
        uint16_t compression;
        const char *name;
    } names[] = {
        { COMPRESSION_JPEG, "JPEG" },        { COMPRESSION_OJPEG, "old JPEG" }, { COMPRESSION_CCITTFAX3, "fax" },
        { COMPRESSION_CCITTFAX4, "fax" },    { COMPRESSION_CCITTRLE, "fax" },   { COMPRESSION_LZMA, "LZMA" },
        { COMPRESSION_ZSTD, "Zstandard" },   { COMPRESSION_WEBP, "WebP" },      { COMPRESSION_LERC, "LERC" },
        { COMPRESSION_JP2000, "JPEG 2000" }, { COMPRESSION_JBIG, "JBIG" },      { COMPRESSION_SGILOG, "SGI log" },
    };
    char what[64];

    snprintf(what, sizeof(what), "of the compression %u", f->compression);
    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        if (names[i].compression == f->compression)
            snprintf(what, sizeof(what), "compressed by %s", names[i].name);
    }
    return tiff_refuse(f, what, "write it with deflate, LZW, PackBits or none, as by tiffcp -c zip IN OUT");
}

static int get_u16(const struct tiff_file *f, uint32_t tag)
{
    uint16_t v = 0;

    return tiff_lib.TIFFGetFieldDefaulted(f->tif, tag, &v) ? v : -1;
}

static uint32_t get_u32(const struct tiff_file *f, uint32_t tag, uint32_t otherwise)
{
    uint32_t v = 0;

    return tiff_lib.TIFFGetFieldDefaulted(f->tif, tag, &v) ? v : otherwise;
}

static int read_layout(struct tiff_file *f)
{
    struct tiff_layout *l = &f->layout;
    const uint32_t width = get_u32(f, TIFFTAG_IMAGEWIDTH, 0), height = get_u32(f, TIFFTAG_IMAGELENGTH, 0);
    void *dng;

    if (!width || !height || width > SST_IMAGE_MAX_SIDE || height > SST_IMAGE_MAX_SIDE ||
        (size_t)width * height > SST_IMAGE_MAX_PIXELS)
        return sst_image_size_error(-EINVAL, f->name, width, height);
    if (get_u32(f, TIFFTAG_SUBFILETYPE, 0) & FILETYPE_REDUCEDIMAGE ||
        tiff_lib.TIFFGetField(f->tif, TIFFTAG_DNGVERSION, &dng))
        return tiff_refuse(f, "that begins with a preview, as raw files of cameras do",
                           "give it the ending of its camera's raw files, or develop it to a picture");
    if (get_u32(f, TIFFTAG_IMAGEDEPTH, 1) != 1 || get_u32(f, TIFFTAG_TILEDEPTH, 1) != 1)
        return tiff_refuse(f, "of a volume", "export a picture");
    l->width = (int)width;
    l->height = (int)height;
    l->bits = get_u16(f, TIFFTAG_BITSPERSAMPLE);
    l->format = get_u16(f, TIFFTAG_SAMPLEFORMAT);
    l->photometric = get_u16(f, TIFFTAG_PHOTOMETRIC);
    f->samples = get_u16(f, TIFFTAG_SAMPLESPERPIXEL);
    f->separate = get_u16(f, TIFFTAG_PLANARCONFIG) == PLANARCONFIG_SEPARATE;
    f->compression = (uint16_t)get_u16(f, TIFFTAG_COMPRESSION);
    f->tiled = tiff_lib.TIFFIsTiled(f->tif);
    f->chunk_width = f->tiled ? get_u32(f, TIFFTAG_TILEWIDTH, 0) : width;
    f->chunk_height = f->tiled ? get_u32(f, TIFFTAG_TILELENGTH, 0) : get_u32(f, TIFFTAG_ROWSPERSTRIP, height);
    if (!f->tiled && f->chunk_height > height)
        f->chunk_height = height;
    if (f->samples < 1 || !f->chunk_width || !f->chunk_height || f->chunk_width > SST_IMAGE_MAX_SIDE ||
        f->chunk_height > SST_IMAGE_MAX_SIDE)
        return tiff_damaged(f);
    return expansion(f->compression) ? 0 : refuse_compression(f);
}

/* --- pixels ------------------------------------------------------------------------------------------------------- */

/* A tile or strip. */
struct chunk {
    uint32_t index;
    int plane;               /* where planes are separate */
    int x, y;                /* of its first pixel */
    int width, height;       /* inside the picture */
    size_t bytes, row_bytes; /* when decoded */
};

/* Go to the next one. @param c  in: index 0 and bytes 0 for the first one, else as it was left */
static bool next_chunk(struct chunk *c, const struct tiff_file *f)
{
    const struct tiff_layout *l = &f->layout;
    const int step_x = (int)f->chunk_width, step_y = (int)f->chunk_height, planes = f->separate ? l->channels : 1;

    if (c->bytes)
        c->x += step_x;
    if (c->x >= l->width) {
        c->x = 0;
        c->y += step_y;
    }
    if (c->y >= l->height) {
        c->y = 0;
        c->plane++;
    }
    if (c->plane >= planes)
        return false;
    c->index = f->tiled ? tiff_lib.TIFFComputeTile(f->tif, (uint32_t)c->x, (uint32_t)c->y, 0, (uint16_t)c->plane)
                        : tiff_lib.TIFFComputeStrip(f->tif, (uint32_t)c->y, (uint16_t)c->plane);
    c->width = sst_min_int(step_x, l->width - c->x);
    c->height = sst_min_int(step_y, l->height - c->y);
    c->row_bytes = (size_t)step_x * (size_t)(f->separate ? 1 : f->samples) * (size_t)l->bits / 8;
    c->bytes = c->row_bytes * (size_t)(f->tiled ? step_y : c->height);
    return true;
}

int tiff_check_rows(struct tiff_file *f)
{
    struct chunk c = { 0 };
    uint64_t all = 0;

    while (next_chunk(&c, f)) {
        const uint64_t at = tiff_lib.TIFFGetStrileOffset(f->tif, c.index),
                       n = tiff_lib.TIFFGetStrileByteCount(f->tif, c.index);

        if (!at || !n || at > f->size || n > f->size - at || c.bytes / expansion(f->compression) > n) {
            sst_log_error("%s is a truncated TIFF: row %d, column %d is not in the file; write it again", f->name, c.y,
                          c.x);
            return -EBADMSG;
        }
        all += n;
        f->chunk_bytes = c.bytes > f->chunk_bytes ? c.bytes : f->chunk_bytes;
    }
    return all <= f->size ? 0 : tiff_refuse(f, "whose parts are in one place of the file", "write it again");
}

int tiff_read_rows(struct tiff_file *f, tiff_row_fn *put, void *arg)
{
    const size_t step = f->separate ? 1 : (size_t)f->samples;
    uint8_t *data = malloc(f->chunk_bytes);
    struct chunk c = { 0 };
    int err = 0;

    if (!data)
        return sst_image_size_error(-ENOMEM, f->name, f->layout.width, f->layout.height);
    while (!err && next_chunk(&c, f)) {
        const tmsize_t n = (tmsize_t)c.bytes;
        const tmsize_t got = f->tiled ? tiff_lib.TIFFReadEncodedTile(f->tif, c.index, data, n)
                                      : tiff_lib.TIFFReadEncodedStrip(f->tif, c.index, data, n);

        if (got != n || f->message[0])
            err = tiff_damaged(f);
        for (int y = 0; !err && y < c.height; y++)
            put(arg, &(struct tiff_row){ .x = c.x,
                                         .y = c.y + y,
                                         .width = c.width,
                                         .first = c.plane,
                                         .count = f->separate ? 1 : f->layout.channels,
                                         .step = step,
                                         .samples = data + (size_t)y * c.row_bytes });
    }
    free(data);
    return err;
}

int tiff_read_file(const uint8_t *data, size_t size, const char *name, tiff_work_fn *work, void *arg)
{
    struct tiff_file f = { .name = name, .in = data, .size = size };
    int err = tiff_open(&f, "r");

    if (loaded && err != -ENOMEM && (!f.tif || f.message[0]))
        err = tiff_damaged(&f);
    err = err ? err : read_layout(&f);
    err = err ? err : work(arg, &f);
    tiff_close(&f);
    return err;
}
