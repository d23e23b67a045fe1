/* TIFF through libtiff, from and to memory; the library is loaded when the first file needs it. */
#include "pipeline/image/tiff.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

bool tiff_is(const uint8_t *data, size_t size)
{
    return size >= 4 && (!memcmp(data, "II*\0", 4) || !memcmp(data, "MM\0*", 4) || !memcmp(data, "II+\0", 4) ||
                         !memcmp(data, "MM\0+", 4));
}

#if WITH_TIFF
#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <tiffio.h>

#define FUNCTIONS(X)                                                                                                   \
    X(TIFFOpenOptionsAlloc)                                                                                            \
    X(TIFFOpenOptionsFree)                                                                                             \
    X(TIFFOpenOptionsSetErrorHandlerExtR)                                                                              \
    X(TIFFOpenOptionsSetMaxSingleMemAlloc)                                                                             \
    X(TIFFOpenOptionsSetWarningHandlerExtR)                                                                            \
    X(TIFFClientOpenExt)                                                                                               \
    X(TIFFClose)                                                                                                       \
    X(TIFFFieldDataType)                                                                                               \
    X(TIFFFindField)                                                                                                   \
    X(TIFFGetField)                                                                                                    \
    X(TIFFGetFieldDefaulted)                                                                                           \
    X(TIFFSetField)                                                                                                    \
    X(TIFFIsTiled)                                                                                                     \
    X(TIFFComputeStrip)                                                                                                \
    X(TIFFComputeTile)                                                                                                 \
    X(TIFFGetStrileByteCount)                                                                                          \
    X(TIFFGetStrileOffset)                                                                                             \
    X(TIFFReadEncodedStrip)                                                                                            \
    X(TIFFReadEncodedTile)                                                                                             \
    X(TIFFWriteEncodedStrip)

static struct {
#define X(name) __typeof__(&(name)) name;
    FUNCTIONS(X)
#undef X
} lib; /* fixed after load() */
static bool loaded;
static pthread_once_t once = PTHREAD_ONCE_INIT;

#define TAG_PIXEL_SCALE    33550 /* of GeoTIFF, doubles */
#define TAG_TIEPOINT       33922
#define TAG_TRANSFORMATION 34264
#define TAG_GEO_KEYS       34735 /* shorts */
#define TAG_GDAL_METADATA  42112 /* texts */
#define TAG_GDAL_NODATA    42113

#define KEY_MODEL       1024 /* and values */
#define MODEL_PROJECTED 1
#define KEY_RASTER      1025
#define RASTER_POINTS   2
#define KEY_UNIT        3076
#define UNIT_METRE      9001

#define MORE_MEMORY (16u << 20) /* bytes: largest allocation of the library beside the file's size */
#define STRIP_BYTES 262144      /* of files that are written */

static void load(void)
{
    void *library = dlopen(SST_TIFF_LIBRARY, RTLD_NOW | RTLD_LOCAL);

    if (!library) {
        sst_log_warning("cannot load %s: %s; install the package that has it", SST_TIFF_LIBRARY, dlerror());
        return;
    }
    loaded = true;
#define X(name)                                                                                                        \
    *(void **)&lib.name = dlsym(library, #name);                                                                       \
    loaded = loaded && lib.name;
    FUNCTIONS(X)
#undef X
}

/* The first page, as its tags describe it. */
struct layout {
    int width, height;
    int bits, format; /* of a sample; SAMPLEFORMAT_ */
    int photometric;  /* PHOTOMETRIC_ */
    int channels;     /* that are read */
};

/* An open file in memory. */
struct file {
    const char *name;
    const uint8_t *in; /* reading */
    uint8_t *out;      /* writing */
    size_t size, capacity, pos;
    TIFF *tif;
    char message[256]; /* the library's first error */

    struct layout layout;
    int samples;   /* of a pixel */
    bool separate; /* a plane for each */
    bool tiled;
    uint32_t chunk_width, chunk_height; /* px of a tile or strip */
    uint16_t compression;
    const uint16_t *palette[3];
};

/* --- the library's view of memory --------------------------------------------------------------------------------- */

static int on_error(TIFF *tif SST_UNUSED, void *user, const char *module SST_UNUSED, const char *format, va_list args)
{
    struct file *f = user;

    if (!f->message[0])
        vsnprintf(f->message, sizeof(f->message), format, args);
    return 1;
}

/* Unknown tags, mostly. */
static int on_warning(TIFF *tif SST_UNUSED, void *user, const char *module SST_UNUSED, const char *format, va_list args)
{
    const struct file *f = user;
    char text[256];

    vsnprintf(text, sizeof(text), format, args);
    sst_log_debug("%s: %s", f->name, text);
    return 1;
}

static tmsize_t read_bytes(thandle_t handle, void *to, tmsize_t n)
{
    struct file *f = handle;
    const size_t left = f->pos < f->size ? f->size - f->pos : 0, bytes = (size_t)n < left ? (size_t)n : left;

    if (n <= 0 || !bytes)
        return 0;
    memcpy(to, (f->in ? f->in : f->out) + f->pos, bytes);
    f->pos += bytes;
    return (tmsize_t)bytes;
}

static tmsize_t write_bytes(thandle_t handle, void *from, tmsize_t n)
{
    struct file *f = handle;
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
    struct file *f = handle;

    f->pos = offset + (whence == SEEK_CUR ? f->pos : whence == SEEK_END ? f->size : 0);
    return f->pos;
}

static int close_nothing(thandle_t handle SST_UNUSED)
{
    return 0;
}

static toff_t size_of(thandle_t handle)
{
    return ((struct file *)handle)->size;
}

static int map(thandle_t handle, void **base, toff_t *size)
{
    struct file *f = handle;

    if (!f->in)
        return 0;
    *base = (void *)(uintptr_t)f->in; /* it is only read */
    *size = f->size;
    return 1;
}

static void unmap(thandle_t handle SST_UNUSED, void *base SST_UNUSED, toff_t size SST_UNUSED)
{
}

static int open_file(struct file *f, const char *mode)
{
    TIFFOpenOptions *options;

    pthread_once(&once, load);
    if (!loaded) {
        sst_log_error("%s: TIFF files need libtiff, which cannot be loaded; install the package libtiff6", f->name);
        return -EBADMSG;
    }
    options = lib.TIFFOpenOptionsAlloc();
    if (!options)
        return sst_image_size_error(-ENOMEM, f->name, 0, 0);
    lib.TIFFOpenOptionsSetErrorHandlerExtR(options, on_error, f);
    lib.TIFFOpenOptionsSetWarningHandlerExtR(options, on_warning, f);
    if (f->in)
        lib.TIFFOpenOptionsSetMaxSingleMemAlloc(options, (tmsize_t)(f->size + MORE_MEMORY));
    f->tif = lib.TIFFClientOpenExt(f->name, mode, f, read_bytes, write_bytes, seek, close_nothing, size_of, map, unmap,
                                   options);
    lib.TIFFOpenOptionsFree(options);
    return f->tif ? 0 : -EBADMSG;
}

static void close_file(struct file *f)
{
    if (f->tif)
        lib.TIFFClose(f->tif);
}

/* --- the first page ----------------------------------------------------------------------------------------------- */

static int damaged(const struct file *f)
{
    sst_log_error("%s is a damaged or truncated TIFF (%s); write it again", f->name,
                  f->message[0] ? f->message : "it ends too early");
    return -EBADMSG;
}

static int refuse(const struct file *f, const char *what, const char *remedy)
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

static int refuse_compression(const struct file *f)
{
    static const struct {
        uint16_t compression;
        const char *name;
    } names[] = {
        { COMPRESSION_JPEG, "JPEG" },         { COMPRESSION_OJPEG, "old JPEG" }, { COMPRESSION_CCITTFAX3, "fax" },
        { COMPRESSION_CCITTFAX4, "fax" },     { COMPRESSION_CCITTRLE, "fax" },   { COMPRESSION_LZMA, "LZMA" },
        { COMPRESSION_ZSTD, "Zstandard" },    { COMPRESSION_WEBP, "WebP" },      { COMPRESSION_LERC, "LERC" },
        { COMPRESSION_JP2000, "JPEG 2000" },  { COMPRESSION_JBIG, "JBIG" },      { COMPRESSION_SGILOG, "SGI log" },
    };
    char what[64];

    snprintf(what, sizeof(what), "of the compression %u", f->compression);
    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        if (names[i].compression == f->compression)
            snprintf(what, sizeof(what), "compressed by %s", names[i].name);
    }
    return refuse(f, what, "write it with deflate, LZW, PackBits or none, as by tiffcp -c zip IN OUT");
}

static int get_u16(const struct file *f, uint32_t tag)
{
    uint16_t v = 0;

    return lib.TIFFGetFieldDefaulted(f->tif, tag, &v) ? v : -1;
}

static uint32_t get_u32(const struct file *f, uint32_t tag, uint32_t otherwise)
{
    uint32_t v = 0;

    return lib.TIFFGetFieldDefaulted(f->tif, tag, &v) ? v : otherwise;
}

static int read_layout(struct file *f)
{
    struct layout *l = &f->layout;
    const uint32_t width = get_u32(f, TIFFTAG_IMAGEWIDTH, 0), height = get_u32(f, TIFFTAG_IMAGELENGTH, 0);
    void *dng;

    if (!width || !height || width > SST_IMAGE_MAX_SIDE || height > SST_IMAGE_MAX_SIDE ||
        (size_t)width * height > SST_IMAGE_MAX_PIXELS)
        return sst_image_size_error(-EINVAL, f->name, width, height);
    if (get_u32(f, TIFFTAG_SUBFILETYPE, 0) & FILETYPE_REDUCEDIMAGE || lib.TIFFGetField(f->tif, TIFFTAG_DNGVERSION, &dng))
        return refuse(f, "that begins with a preview, as raw files of cameras do",
                      "give it the ending of its camera's raw files, or develop it to a picture");
    if (get_u32(f, TIFFTAG_IMAGEDEPTH, 1) != 1 || get_u32(f, TIFFTAG_TILEDEPTH, 1) != 1)
        return refuse(f, "of a volume", "export a picture");
    l->width = (int)width;
    l->height = (int)height;
    l->bits = get_u16(f, TIFFTAG_BITSPERSAMPLE);
    l->format = get_u16(f, TIFFTAG_SAMPLEFORMAT);
    l->photometric = get_u16(f, TIFFTAG_PHOTOMETRIC);
    f->samples = get_u16(f, TIFFTAG_SAMPLESPERPIXEL);
    f->separate = get_u16(f, TIFFTAG_PLANARCONFIG) == PLANARCONFIG_SEPARATE;
    f->compression = (uint16_t)get_u16(f, TIFFTAG_COMPRESSION);
    f->tiled = lib.TIFFIsTiled(f->tif);
    f->chunk_width = f->tiled ? get_u32(f, TIFFTAG_TILEWIDTH, 0) : width;
    f->chunk_height = f->tiled ? get_u32(f, TIFFTAG_TILELENGTH, 0) : get_u32(f, TIFFTAG_ROWSPERSTRIP, height);
    if (!f->tiled && f->chunk_height > height)
        f->chunk_height = height;
    if (f->samples < 1 || !f->chunk_width || !f->chunk_height || f->chunk_width > SST_IMAGE_MAX_SIDE ||
        f->chunk_height > SST_IMAGE_MAX_SIDE)
        return damaged(f);
    return expansion(f->compression) ? 0 : refuse_compression(f);
}

/* --- pixels ------------------------------------------------------------------------------------------------------- */

/* Decoded samples of a row within a strip or tile, in the processor's byte order. */
struct row {
    int x, y, width;  /* of the picture */
    int first, count; /* channels */
    size_t step;      /* samples from a pixel to the next one */
    const uint8_t *samples;
};
typedef void row_fn(void *arg, const struct row *row);

/* A tile or strip. */
struct chunk {
    uint32_t index;
    int plane; /* where planes are separate */
    int x, y;  /* of its first pixel */
    int width, height; /* inside the picture */
    size_t bytes, row_bytes; /* when decoded */
};

/* Go to the next one. @param c  in: index 0 and bytes 0 for the first one, else as it was left */
static bool next_chunk(struct chunk *c, const struct file *f)
{
    const struct layout *l = &f->layout;
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
    c->index = f->tiled ? lib.TIFFComputeTile(f->tif, (uint32_t)c->x, (uint32_t)c->y, 0, (uint16_t)c->plane)
                        : lib.TIFFComputeStrip(f->tif, (uint32_t)c->y, (uint16_t)c->plane);
    c->width = sst_min_int(step_x, l->width - c->x);
    c->height = sst_min_int(step_y, l->height - c->y);
    c->row_bytes = (size_t)step_x * (size_t)(f->separate ? 1 : f->samples) * (size_t)l->bits / 8;
    c->bytes = c->row_bytes * (size_t)(f->tiled ? step_y : c->height);
    return true;
}

/* Every one lies in the file and may hold its pixels: only then is memory allocated for them. @param most  out: bytes of
 * the largest one when decoded */
static int check_chunks(size_t *most, const struct file *f)
{
    struct chunk c = { 0 };

    *most = 0;
    while (next_chunk(&c, f)) {
        const uint64_t at = lib.TIFFGetStrileOffset(f->tif, c.index), n = lib.TIFFGetStrileByteCount(f->tif, c.index);

        if (!at || !n || at > f->size || n > f->size - at || c.bytes / expansion(f->compression) > n) {
            sst_log_error("%s is a truncated TIFF: row %d, column %d is not in the file; write it again", f->name, c.y,
                          c.x);
            return -EBADMSG;
        }
        *most = c.bytes > *most ? c.bytes : *most;
    }
    return 0;
}

static int read_chunks(struct file *f, row_fn *put, void *arg)
{
    const size_t step = f->separate ? 1 : (size_t)f->samples;
    struct chunk c = { 0 };
    size_t most;
    uint8_t *data;
    int err = check_chunks(&most, f);

    if (err)
        return err;
    data = malloc(most);
    if (!data)
        return sst_image_size_error(-ENOMEM, f->name, f->layout.width, f->layout.height);
    while (!err && next_chunk(&c, f)) {
        const tmsize_t n = (tmsize_t)c.bytes;
        const tmsize_t got = f->tiled ? lib.TIFFReadEncodedTile(f->tif, c.index, data, n)
                                      : lib.TIFFReadEncodedStrip(f->tif, c.index, data, n);

        if (got != n || f->message[0])
            err = damaged(f);
        for (int y = 0; !err && y < c.height; y++)
            put(arg, &(struct row){ .x = c.x,
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

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* Channels and bits, if it is a picture of a kind that is read. */
static int check_picture(struct file *f)
{
    struct layout *l = &f->layout;
    char what[64];

    snprintf(what, sizeof(what), "of %d bits a sample", l->bits);
    if (l->format == SAMPLEFORMAT_IEEEFP)
        return refuse(f, "of floating-point numbers", "write it with 16-bit levels");
    if (l->bits != 8 && l->bits != 16)
        return refuse(f, what, "write it with 8 or 16");
    if (l->format == SAMPLEFORMAT_INT)
        return refuse(f, "of signed numbers", "write it with unsigned levels");
    if (l->format != SAMPLEFORMAT_UINT && l->format != SAMPLEFORMAT_VOID)
        return refuse(f, "of complex numbers", "write it with 8 or 16 bits a sample");
    snprintf(what, sizeof(what), "of %d channels, neither grey nor RGB", f->samples);
    switch (l->photometric) {
    case PHOTOMETRIC_MINISBLACK:
    case PHOTOMETRIC_MINISWHITE:
        l->channels = 1;
        return f->samples <= 2 ? 0 : refuse(f, what, "export the channels that are meant");
    case PHOTOMETRIC_RGB:
        l->channels = 3;
        return f->samples == 3 || f->samples == 4 ? 0 : refuse(f, what, "export the channels that are meant");
    case PHOTOMETRIC_PALETTE:
        l->channels = 1;
        if (f->samples <= 2 && lib.TIFFGetField(f->tif, TIFFTAG_COLORMAP, &f->palette[0], &f->palette[1], &f->palette[2]))
            return 0;
        return damaged(f);
    default:
        return refuse(f, "of colours that are neither grey nor RGB", "convert it to grey or RGB");
    }
}

/* A picture that is decoded. */
struct decoded {
    struct sst_deep *deep;
    const struct file *file;
};

static void put_row(void *arg, const struct row *row)
{
    const struct decoded *d = arg;
    const struct file *f = d->file;
    const bool wide = f->layout.bits == 16;
    const int flip = f->layout.photometric == PHOTOMETRIC_MINISWHITE ? d->deep->white : 0; /* v ^ flip is white - v */

    for (int c = 0; c < row->count; c++) {
        uint16_t *to = sst_map_u16_row(&d->deep->plane[row->first + c], row->y) + row->x;
        const uint8_t *u8 = row->samples + c;
        const uint16_t *u16 = (const uint16_t *)(const void *)row->samples + c;

        for (int x = 0; x < row->width; x++)
            to[x] = (uint16_t)((wide ? u16[(size_t)x * row->step] : u8[(size_t)x * row->step]) ^ flip);
    }
}

/* A palette has levels of 16 bits; those that older programs wrote have 8 (libtiff's tiff2rgba guesses likewise). */
static void apply_palette(struct sst_deep *deep, const struct file *f)
{
    const int n = 1 << f->layout.bits;
    bool wide = false;

    for (int i = 0; i < 3 * n; i++)
        wide |= f->palette[i / n][i % n] > 255;
    for (int c = 2; c >= 0; c--) { /* indices are in the first plane */
        for (int y = 0; y < deep->height; y++) {
            const uint16_t *from = sst_map_u16_row(&deep->plane[0], y);
            uint16_t *to = sst_map_u16_row(&deep->plane[c], y);

            for (int x = 0; x < deep->width; x++)
                to[x] = (uint16_t)(f->palette[c][from[x]] >> (wide ? 8 : 0));
        }
    }
}

static int decode(struct sst_deep *out, struct file *f)
{
    struct sst_deep made = { 0 };
    const bool coloured = f->layout.photometric == PHOTOMETRIC_PALETTE;
    int err = sst_deep_init(&made, f->layout.width, f->layout.height, coloured ? 3 : f->layout.channels,
                            f->layout.bits == 16 && !coloured ? 65535 : 255);

    err = err ? sst_image_size_error(err, f->name, f->layout.width, f->layout.height)
              : read_chunks(f, put_row, &(struct decoded){ &made, f });
    if (err) {
        sst_deep_fini(&made);
        return err;
    }
    if (coloured)
        apply_palette(&made, f);
    *out = made;
    return 0;
}

/* Work on an open file. */
typedef int work_fn(void *arg, struct file *f);

static int read_file(const uint8_t *data, size_t size, const char *name, work_fn *work, void *arg)
{
    struct file f = { .name = name, .in = data, .size = size };
    int err = open_file(&f, "r");

    if (f.tif)
        err = read_layout(&f);
    else if (loaded && err == -EBADMSG)
        err = damaged(&f);
    err = err ? err : work(arg, &f);
    close_file(&f);
    return err;
}

static int decode_work(void *arg, struct file *f)
{
    const int err = check_picture(f);

    return err ? err : decode(arg, f);
}

int tiff_decode(struct sst_deep *out, const uint8_t *data, size_t size, const char *name)
{
    return read_file(data, size, name, decode_work, out);
}

static int size_work(void *arg, struct file *f)
{
    struct layout *out = arg;
    const int err = check_picture(f);

    *out = f->layout;
    if (out->photometric == PHOTOMETRIC_PALETTE) {
        out->channels = 3;
        out->bits = 8;
    }
    return err;
}

int tiff_size(int *width, int *height, int *channels, int *bits, const uint8_t *data, size_t size, const char *name)
{
    struct layout layout = { 0 };
    const int err = read_file(data, size, name, size_work, &layout);

    if (err)
        return err;
    *width = layout.width;
    *height = layout.height;
    *channels = layout.channels;
    *bits = layout.bits;
    return 0;
}

/* --- grids -------------------------------------------------------------------------------------------------------- */

/* Numbers or a text of a tag that the library does not know. @return how many; 0: there are none of this type */
static uint32_t get_unknown(const void **values, const struct file *f, uint32_t tag, TIFFDataType type)
{
    const TIFFField *field = lib.TIFFFindField(f->tif, tag, TIFF_ANY);
    uint32_t n = 0;

    if (!field || lib.TIFFFieldDataType(field) != type || !lib.TIFFGetField(f->tif, tag, &n, values))
        return 0;
    return n;
}

static bool has_text(const char *text, uint32_t n, const char *word)
{
    return memchr(text, '\0', n) && strstr(text, word);
}

/* Keys of GeoTIFF that change what the place means: of areas or points, in degrees, in feet. */
static int read_keys(bool *points, const struct file *f)
{
    const void *values;
    const uint32_t n = get_unknown(&values, f, TAG_GEO_KEYS, TIFF_SHORT);
    const uint16_t *key = values;

    *points = false;
    for (uint32_t i = 4; i + 4 <= n; i += 4) {
        if (key[i] == KEY_RASTER)
            *points = key[i + 3] == RASTER_POINTS;
        if (key[i] == KEY_MODEL && key[i + 3] != MODEL_PROJECTED)
            return refuse(f, "whose places are no metres on a map, but degrees",
                          "write it in a projection, as gdalwarp -t_srs EPSG:25832 IN OUT does");
        if (key[i] == KEY_UNIT && key[i + 3] != UNIT_METRE)
            return refuse(f, "whose places are in another unit than metres", "write it in metres, as gdalwarp does");
    }
    return 0;
}

/* Place by a scale and one tie point. */
static int read_place(struct tiff_geo *geo, const struct file *f)
{
    const void *values;
    const double *scale = NULL, *tie = NULL;
    bool points;
    int err = read_keys(&points, f);

    if (err)
        return err;
    if (get_unknown(&values, f, TAG_TRANSFORMATION, TIFF_DOUBLE))
        return refuse(f, "placed by a transformation, which may turn it", "write it north up, as gdalwarp IN OUT does");
    if (get_unknown(&values, f, TAG_PIXEL_SCALE, TIFF_DOUBLE) >= 2)
        scale = values;
    if (get_unknown(&values, f, TAG_TIEPOINT, TIFF_DOUBLE) >= 6)
        tie = values;
    if (!scale || !tie)
        return 0;
    geo->placed = true;
    geo->dx = scale[0];
    geo->dy = -scale[1];
    geo->x = tie[3] + ((points ? 0 : 0.5) - tie[0]) * geo->dx;
    geo->y = tie[4] + ((points ? 0 : 0.5) - tie[1]) * geo->dy;
    return 0;
}

static void read_gdal(struct tiff_geo *geo, const struct file *f)
{
    const void *text;
    uint32_t n = get_unknown(&text, f, TAG_GDAL_NODATA, TIFF_ASCII);
    char number[64], *end;

    if (n) {
        snprintf(number, sizeof(number), "%.*s", (int)(n < 63 ? n : 63), (const char *)text);
        geo->nodata = strtod(number, &end);
        geo->has_nodata = end != number;
    }
    n = get_unknown(&text, f, TAG_GDAL_METADATA, TIFF_ASCII);
    if (n && (has_text(text, n, "role=\"scale\"") || has_text(text, n, "role=\"offset\"")))
        sst_log_warning("%s: scale and offset of its metadata are not applied: its numbers are read as metres", f->name);
}

/* A grid that is decoded. */
struct grid {
    struct sst_map_f32 *map;
    struct tiff_geo *geo;
    struct layout layout;
};

static void put_numbers(void *arg, const struct row *row)
{
    const struct grid *g = arg;
    float *to = sst_map_f32_row(g->map, row->y) + row->x;

    for (int x = 0; x < row->width; x++) {
        const uint8_t *from = row->samples + (size_t)x * row->step * (size_t)g->layout.bits / 8;

        if (g->layout.format == SAMPLEFORMAT_IEEEFP)
            memcpy(&to[x], from, sizeof(to[x]));
        else if (g->layout.format == SAMPLEFORMAT_INT)
            to[x] = *(const int16_t *)(const void *)from;
        else
            to[x] = *(const uint16_t *)(const void *)from;
        if (!isfinite(to[x]) || (g->geo->has_nodata && to[x] == (float)g->geo->nodata))
            to[x] = NAN;
    }
}

static int grid_work(void *arg, struct file *f)
{
    struct grid *g = arg;
    struct layout *l = &f->layout;
    char what[64];
    int err;

    snprintf(what, sizeof(what), "of %d channels of %d bits", f->samples, l->bits);
    if (f->samples != 1 || l->bits != (l->format == SAMPLEFORMAT_IEEEFP ? 32 : 16))
        return refuse(f, what, "heights are one channel of 16 bits or of 32-bit floating-point numbers");
    l->channels = 1;
    g->layout = *l;
    err = read_place(g->geo, f);
    if (err)
        return err;
    read_gdal(g->geo, f);
    err = sst_map_f32_init(g->map, l->width, l->height);
    return err ? sst_image_size_error(err, f->name, l->width, l->height) : read_chunks(f, put_numbers, g);
}

int tiff_decode_grid(struct sst_map_f32 *grid, struct tiff_geo *geo, const uint8_t *data, size_t size, const char *name)
{
    struct sst_map_f32 map = { 0 };
    struct tiff_geo place = { 0 };
    const int err = read_file(data, size, name, grid_work, &(struct grid){ .map = &map, .geo = &place });

    if (err) {
        sst_map_f32_fini(&map);
        return err;
    }
    *grid = map;
    *geo = place;
    return 0;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

static int write_strips(struct file *f, const struct sst_deep *deep)
{
    const size_t row_bytes = (size_t)deep->width * (size_t)deep->channels * 2;
    const int rows = sst_clamp_int((int)(STRIP_BYTES / row_bytes), 1, deep->height);
    uint16_t *packed = malloc(row_bytes * (size_t)rows);
    bool good = packed && lib.TIFFSetField(f->tif, TIFFTAG_IMAGEWIDTH, deep->width) &&
                lib.TIFFSetField(f->tif, TIFFTAG_IMAGELENGTH, deep->height) &&
                lib.TIFFSetField(f->tif, TIFFTAG_BITSPERSAMPLE, 16) &&
                lib.TIFFSetField(f->tif, TIFFTAG_SAMPLESPERPIXEL, deep->channels) &&
                lib.TIFFSetField(f->tif, TIFFTAG_PHOTOMETRIC,
                                 deep->channels == 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK) &&
                lib.TIFFSetField(f->tif, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) &&
                lib.TIFFSetField(f->tif, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE) &&
                lib.TIFFSetField(f->tif, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL) &&
                lib.TIFFSetField(f->tif, TIFFTAG_ROWSPERSTRIP, rows);

    for (int y = 0; good && y < deep->height; y += rows) {
        const int n = sst_min_int(rows, deep->height - y);
        uint16_t *to = packed;

        for (int row = y; row < y + n; row++)
            for (int x = 0; x < deep->width; x++)
                for (int c = 0; c < deep->channels; c++)
                    *to++ = sst_map_u16_row(&deep->plane[c], row)[x];
        good = lib.TIFFWriteEncodedStrip(f->tif, (uint32_t)(y / rows), packed, (tmsize_t)(row_bytes * (size_t)n)) >= 0;
    }
    free(packed);
    return good ? 0 : -ENOMEM;
}

int tiff_write(const struct sst_deep *deep, const char *path)
{
    struct file f = { .name = path };
    int err = open_file(&f, "w");

    if (!f.tif)
        return err;
    err = write_strips(&f, deep);
    close_file(&f);
    /* Encoding to memory only fails for lack of memory. */
    if (err || f.message[0])
        err = sst_image_size_error(-ENOMEM, path, deep->width, deep->height);
    err = err ? err : sst_file_write(path, f.out, f.size);
    free(f.out);
    return err;
}
#else
static int refuse(const char *name)
{
    sst_log_error("%s: this build has no TIFF; install libtiff-dev and build again, or convert it to PNG", name);
    return -EBADMSG;
}

int tiff_decode(struct sst_deep *out SST_UNUSED, const uint8_t *data SST_UNUSED, size_t size SST_UNUSED, const char *name)
{
    return refuse(name);
}

int tiff_size(int *width SST_UNUSED, int *height SST_UNUSED, int *channels SST_UNUSED, int *bits SST_UNUSED,
              const uint8_t *data SST_UNUSED, size_t size SST_UNUSED, const char *name)
{
    return refuse(name);
}

int tiff_decode_grid(struct sst_map_f32 *grid SST_UNUSED, struct tiff_geo *geo SST_UNUSED, const uint8_t *data SST_UNUSED,
                     size_t size SST_UNUSED, const char *name)
{
    return refuse(name);
}

int tiff_write(const struct sst_deep *deep SST_UNUSED, const char *path)
{
    return refuse(path);
}
#endif
