/* TIFF files that libtiff writes: every layout that is read gives the levels that were written. */
#include <errno.h>
#include <stdio.h>

#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/deep.h"
#include "simulators/scene/noise.h"
#include "tests/codec_pictures.h"

#if WITH_TIFF
#include <tiffio.h>

#define WIDTH  37
#define HEIGHT 29

/* A file to make. Zeros: grey, 8 bits, one strip, not compressed, chunky, without alpha, in the processor's order. */
struct kind {
    const char *mode; /* of TIFFOpen(), or NULL: "w" */
    uint16_t bits, channels, extra, compression, planar, photometric, predictor, format;
    uint32_t rows, tile; /* of a strip; side of a tile, or 0 */
};

/* Level of a channel; the extra ones are alpha. */
static uint16_t level(const struct kind *k, int x, int y, int c)
{
    const unsigned v = (unsigned)(x * 331 + y * 1733 + c * 9001 + x * y * 17);

    return (uint16_t)(k->bits == 16 ? v : v >> 3 & 255);
}

static void put(uint8_t *to, const struct kind *k, int x, int y, int c)
{
    const uint16_t v = level(k, x, y, c);

    if (k->bits == 16)
        memcpy(to, &v, 2);
    else
        *to = (uint8_t)v;
}

/* Write the pixels of a tile or strip of `width` columns from a place, edges repeated. @return bytes */
static size_t fill(uint8_t *to, const struct kind *k, int x0, int y0, int width, int height, int plane)
{
    const int all = k->channels + k->extra, first = plane < 0 ? 0 : plane, end = plane < 0 ? all : plane + 1;
    uint8_t *at = to;

    for (int y = y0; y < y0 + height; y++) {
        for (int x = x0; x < x0 + width; x++) {
            for (int c = first; c < end; c++, at += k->bits / 8)
                put(at, k, sst_min_int(x, WIDTH - 1), sst_min_int(y, HEIGHT - 1), c);
        }
    }
    return (size_t)(at - to);
}

static void set_tags(TIFF *tif, const struct kind *k)
{
    static const uint16_t alpha[] = { EXTRASAMPLE_UNASSALPHA };

    TIFFSetField(tif, TIFFTAG_IMAGEWIDTH, WIDTH);
    TIFFSetField(tif, TIFFTAG_IMAGELENGTH, HEIGHT);
    TIFFSetField(tif, TIFFTAG_BITSPERSAMPLE, k->bits);
    TIFFSetField(tif, TIFFTAG_SAMPLESPERPIXEL, k->channels + k->extra);
    if (k->extra)
        TIFFSetField(tif, TIFFTAG_EXTRASAMPLES, 1, alpha);
    TIFFSetField(tif, TIFFTAG_PHOTOMETRIC, k->photometric);
    TIFFSetField(tif, TIFFTAG_PLANARCONFIG, k->planar ? k->planar : PLANARCONFIG_CONTIG);
    TIFFSetField(tif, TIFFTAG_COMPRESSION, k->compression ? k->compression : COMPRESSION_NONE);
    if (k->predictor)
        TIFFSetField(tif, TIFFTAG_PREDICTOR, k->predictor);
    if (k->format)
        TIFFSetField(tif, TIFFTAG_SAMPLEFORMAT, k->format);
    if (k->tile) {
        TIFFSetField(tif, TIFFTAG_TILEWIDTH, k->tile);
        TIFFSetField(tif, TIFFTAG_TILELENGTH, k->tile);
    } else {
        TIFFSetField(tif, TIFFTAG_ROWSPERSTRIP, k->rows ? k->rows : HEIGHT);
    }
}

static const char *make(const struct kind *k)
{
    const char *path = test_path("made.tif");
    TIFF *tif = TIFFOpen(path, k->mode ? k->mode : "w");
    const int planes = k->planar == PLANARCONFIG_SEPARATE ? k->channels + k->extra : 1;
    const int step_x = k->tile ? (int)k->tile : WIDTH, step_y = k->tile   ? (int)k->tile
                                                                : k->rows ? (int)k->rows
                                                                          : HEIGHT;
    static uint8_t data[65536];

    assert_non_null(tif);
    set_tags(tif, k);
    if (k->photometric == PHOTOMETRIC_PALETTE) {
        static uint16_t map[3][65536];

        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 1 << k->bits; i++)
                map[c][i] = (uint16_t)((i * (c + 3) & 255) * 257);
        TIFFSetField(tif, TIFFTAG_COLORMAP, map[0], map[1], map[2]);
    }
    for (int plane = 0; plane < planes; plane++) {
        for (int y = 0; y < HEIGHT; y += step_y) {
            for (int x = 0; x < WIDTH; x += step_x) {
                const int rows = k->tile ? step_y : sst_min_int(step_y, HEIGHT - y);
                const size_t n = fill(data, k, x, y, step_x, rows, planes > 1 ? plane : -1);

                if (k->tile)
                    assert_true(TIFFWriteEncodedTile(tif,
                                                     TIFFComputeTile(tif, (uint32_t)x, (uint32_t)y, 0, (uint16_t)plane),
                                                     data, (tmsize_t)n) >= 0);
                else
                    assert_true(TIFFWriteEncodedStrip(tif, TIFFComputeStrip(tif, (uint32_t)y, (uint16_t)plane), data,
                                                      (tmsize_t)n) >= 0);
            }
        }
    }
    TIFFClose(tif);
    return path;
}

static uint16_t wanted(const struct kind *k, int x, int y, int c)
{
    if (k->photometric == PHOTOMETRIC_PALETTE)
        return (uint16_t)(level(k, x, y, 0) * (c + 3) & 255);
    if (k->photometric == PHOTOMETRIC_MINISWHITE)
        return (uint16_t)((k->bits == 16 ? 65535 : 255) - level(k, x, y, c));
    return level(k, x, y, c);
}

static void check(const struct kind *k)
{
    const char *path = make(k);
    const bool palette = k->photometric == PHOTOMETRIC_PALETTE;
    int width, height, channels, bits;
    struct sst_deep deep;

    assert_int_equal(sst_deep_read(&deep, path), 0);
    assert_int_equal(deep.width, WIDTH);
    assert_int_equal(deep.height, HEIGHT);
    assert_int_equal(deep.channels, palette ? 3 : k->channels);
    assert_int_equal(deep.white, k->bits == 16 && !palette ? 65535 : 255);
    for (int c = 0; c < deep.channels; c++) {
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++)
                assert_int_equal(sst_map_u16_row(&deep.plane[c], y)[x], wanted(k, x, y, c));
        }
    }
    assert_int_equal(sst_deep_read_size(path, &width, &height, &channels, &bits), 0);
    assert_int_equal(width, WIDTH);
    assert_int_equal(height, HEIGHT);
    assert_int_equal(channels, deep.channels);
    assert_int_equal(bits, deep.white == 255 ? 8 : 16);
    sst_deep_fini(&deep);
}

/* Every one of both byte orders and sizes of offsets, of strips and tiles, of all compressions. */
static void all_layouts_are_read(void **state SST_UNUSED)
{
    static const char *const modes[] = { "wl", "wb", "w8" };
    static const uint16_t compressions[] = { COMPRESSION_NONE, COMPRESSION_PACKBITS, COMPRESSION_LZW,
                                             COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE };
    static const uint16_t colours[] = { PHOTOMETRIC_MINISBLACK, PHOTOMETRIC_MINISWHITE, PHOTOMETRIC_RGB };

    for (int i = 0; i < 3 * 5 * 3 * 2 * 2 * 2 * 2; i++) {
        struct kind k = { .mode = modes[i % 3],
                          .compression = compressions[i / 3 % 5],
                          .photometric = colours[i / 15 % 3] };

        k.channels = k.photometric == PHOTOMETRIC_RGB ? 3 : 1;
        k.bits = i / 45 % 2 ? 8 : 16;
        k.tile = i / 90 % 2 ? 16 : 0;
        k.rows = 7;
        k.extra = i / 180 % 2 ? 1 : 0;
        k.planar = i / 360 % 2 ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG;
        k.predictor = k.compression == COMPRESSION_LZW || k.compression == COMPRESSION_DEFLATE ? 2 : 0;
        check(&k);
    }
}

static void palettes_become_colours(void **state SST_UNUSED)
{
    check(&(struct kind){ .bits = 8, .channels = 1, .photometric = PHOTOMETRIC_PALETTE, .rows = 5 });
    check(&(struct kind){ .bits = 8, .channels = 1, .extra = 1, .photometric = PHOTOMETRIC_PALETTE, .tile = 32 });
}

static void refused(const char *path, const char *words)
{
    char text[SST_LOG_MAX] = "", *before = sst_log_hold_errors(text);
    struct sst_deep deep;
    struct sst_image img;
    int a, b, c, d;

    assert_int_equal(sst_deep_read(&deep, path), -EBADMSG);
    assert_contains(text, words);
    assert_int_equal(sst_deep_read_size(path, &a, &b, &c, &d), -EBADMSG);
    assert_int_equal(sst_image_read(&img, path), -EBADMSG);
    sst_log_hold_errors(before);
}

static void other_kinds_are_named(void **state SST_UNUSED)
{
    refused(make(&(struct kind){ .bits = 16, .channels = 1, .photometric = 1, .format = SAMPLEFORMAT_INT }), "signed");
    refused(make(&(struct kind){ .bits = 8, .channels = 5, .photometric = 1 }), "5 channels");
    refused(make(&(struct kind){ .bits = 8, .channels = 4, .photometric = PHOTOMETRIC_SEPARATED }),
            "neither grey nor RGB");
    refused(make(&(struct kind){ .bits = 8, .channels = 1, .photometric = 1, .compression = COMPRESSION_LZMA }),
            "LZMA");
    refused(
        make(&(struct kind){ .bits = 8, .channels = 1, .photometric = 1, .compression = COMPRESSION_JPEG, .rows = 16 }),
        "compressed by JPEG; write it with deflate");
}

int main(void)
{
    static const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_layouts_are_read),
        cmocka_unit_test(palettes_become_colours),
        cmocka_unit_test(other_kinds_are_named),
    };

    TIFFSetWarningHandler(NULL); /* deflate by its older number is made on purpose */
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
#else
int main(void)
{
    puts("libtiff is absent");
    return 77;
}
#endif
