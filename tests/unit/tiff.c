/* TIFF files that libtiff writes: every layout that is read gives the levels that were written. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>

#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/deep.h"
#include "simulators/scene/noise.h"
#include "tests/codec_pictures.h"
#include "tests/deep_read.h"

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
    struct sst_deep_size kind;
    struct sst_deep deep;

    assert_int_equal(deep_read(&deep, NULL, path), 0);
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
    assert_int_equal(deep_read(NULL, &kind, path), 0);
    assert_int_equal(kind.width, WIDTH);
    assert_int_equal(kind.height, HEIGHT);
    assert_int_equal(kind.channels, deep.channels);
    assert_int_equal(kind.bits, deep.white == 255 ? 8 : 16);
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
    struct sst_deep_size kind;
    struct sst_image img;

    assert_int_equal(deep_read(&deep, NULL, path), -EBADMSG);
    assert_contains(text, words);
    assert_int_equal(deep_read(NULL, &kind, path), -EBADMSG);
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

/* A little-endian file with its directory before the pixels. */
struct drawn {
    uint32_t width, height, bits, samples, format, compression, photometric, offset, bytes, tile;
    uint16_t further; /* a tag of one long, 1 */
};

#define ENTRIES  12
#define PIXELS   (8 + 2 + ENTRIES * 12 + 4)
#define PIXELS_N 48 /* bytes */

static size_t draw(uint8_t *to, const struct drawn *d)
{
    const bool tiled = d->tile;
    const uint32_t entries[ENTRIES][2] = {
        { d->further ? d->further : 254, d->further != 0 },
        { 256, d->width },
        { 257, d->height },
        { 258, d->bits },
        { 259, d->compression ? d->compression : 1 },
        { 262, d->photometric ? d->photometric : 1 },
        { tiled ? 322 : 273, tiled       ? d->tile
                             : d->offset ? d->offset
                                         : PIXELS },
        { 277, d->samples ? d->samples : 1 },
        { tiled ? 323 : 278, tiled ? d->tile : d->height },
        { tiled ? 324 : 279, tiled      ? PIXELS
                             : d->bytes ? d->bytes
                                        : PIXELS_N },
        { tiled ? 325 : 284, tiled ? PIXELS_N : 1 },
        { 339, d->format ? d->format : 1 },
    };
    uint8_t *at = to;

    memcpy(at, "II*\0\10\0\0\0\14\0", 10);
    at += 10;
    for (int i = 0; i < ENTRIES; i++, at += 12) {
        const uint16_t tag = (uint16_t)entries[i][0], type = 4;
        const uint32_t count = 1;

        memcpy(at, &tag, 2);
        memcpy(at + 2, &type, 2);
        memcpy(at + 4, &count, 4);
        memcpy(at + 8, &entries[i][1], 4);
    }
    memset(at, 0, 4);
    for (int i = 0; i < PIXELS_N; i++)
        at[4 + i] = (uint8_t)(i * 5);
    return PIXELS + PIXELS_N;
}

static void wrong(const struct drawn *d, const char *words)
{
    uint8_t file[PIXELS + PIXELS_N];

    put_file("drawn.tif", file, draw(file, d));
    refused(test_path("drawn.tif"), words);
}

/* Its size is still read. */
static void truncated(const struct drawn *d)
{
    char text[SST_LOG_MAX] = "", *before = sst_log_hold_errors(text);
    uint8_t file[PIXELS + PIXELS_N];
    struct sst_deep deep;

    assert_int_equal(sst_deep_decode(&deep, file, draw(file, d), "drawn"), -EBADMSG);
    sst_log_hold_errors(before);
    assert_contains(text, "truncated");
}

static void wrong_tags_are_refused(void **state SST_UNUSED)
{
    struct drawn good = { .width = 6, .height = 4, .bits = 16 }, d;
    uint8_t file[PIXELS + PIXELS_N];
    struct sst_deep deep;

    put_file("drawn.tif", file, draw(file, &good));
    assert_int_equal(deep_read(&deep, NULL, test_path("drawn.tif")), 0);
    assert_int_equal(sst_map_u16_row(&deep.plane[0], 3)[5], (uint8_t)(46 * 5) | (uint8_t)(47 * 5) << 8);
    sst_deep_fini(&deep);
    wrong(&(struct drawn){ .width = 8, .height = 4, .bits = 12 }, "of 12 bits a sample");
    wrong(&(struct drawn){ .width = 6, .height = 2, .bits = 32, .format = 3 }, "floating-point");
    wrong(&(struct drawn){ .width = 6, .height = 2, .bits = 32 }, "of 32 bits");
    wrong(&(struct drawn){ .width = 0, .height = 4, .bits = 16 }, "drawn.tif");
    wrong(&(struct drawn){ .width = 6, .height = 0, .bits = 16 }, "drawn.tif");
    wrong(&(struct drawn){ .width = 40000, .height = 4, .bits = 16 }, "claims 40000x4 pixels");
    wrong(&(struct drawn){ .width = 32768, .height = 8193, .bits = 8 }, "claims 32768x8193 pixels");
    d = good;
    d.photometric = 32803; /* samples under a colour filter */
    wrong(&d, "neither grey nor RGB");
    d = good;
    d.compression = 50000;
    wrong(&d, "compressed by Zstandard");
    d.compression = 12345;
    wrong(&d, "drawn.tif");
    d = good;
    d.samples = 65535;
    wrong(&d, "neither grey nor RGB");
    d = good;
    d.further = 254; /* a reduced picture, as raw files begin */
    wrong(&d, "begins with a preview");
}

/* No memory is allocated for pixels that the file cannot have. */
static void missing_pixels_are_refused(void **state SST_UNUSED)
{
    static const uint32_t compressions[] = { 1, 32773, 5, 8, 32946 };
    struct drawn d = { .width = 30000, .height = 8000, .bits = 16 };

    for (size_t i = 0; i < ARRAY_LEN(compressions); i++) {
        for (d.tile = 0; d.tile <= 16384; d.tile += 16384) {
            d.compression = compressions[i];
            truncated(&d);
        }
    }
    d = (struct drawn){ .width = 6, .height = 4, .bits = 16, .offset = PIXELS + 1 };
    truncated(&d);
    d.offset = 0xFFFFFFF0;
    truncated(&d);
}

/* Wherever it is cut, and whichever byte is another one: an error, or a picture. */
static void damage_is_found(void **state SST_UNUSED)
{
    static const struct kind kinds[] = {
        { .bits = 16, .channels = 1, .photometric = 1, .compression = COMPRESSION_PACKBITS, .rows = 3 },
        { .bits = 16, .channels = 3, .photometric = 2, .compression = COMPRESSION_LZW, .predictor = 2, .tile = 16 },
        { .bits = 8,
          .channels = 3,
          .photometric = 2,
          .compression = COMPRESSION_ADOBE_DEFLATE,
          .planar = 2,
          .rows = 5 },
        { .bits = 8, .channels = 1, .photometric = PHOTOMETRIC_PALETTE, .mode = "w8b" },
    };
    char text[SST_LOG_MAX] = "", *before = sst_log_hold_errors(text);
    const struct drawn drawn = { .width = 6, .height = 4, .bits = 16 };
    uint8_t file[PIXELS + PIXELS_N];
    uint64_t state_of_random = 1;
    struct sst_deep deep;

    for (size_t n = draw(file, &drawn); n-- > 0;) {
        uint8_t *cut = malloc(n ? n : 1); /* bytes that are read beyond it are found */

        memcpy(cut, file, n);
        assert_int_equal(sst_deep_decode(&deep, cut, n, "cut"), -EBADMSG);
        free(cut);
    }
    for (size_t k = 0; k < ARRAY_LEN(kinds); k++) {
        uint8_t *data;
        size_t size;

        assert_int_equal(sst_file_read(make(&kinds[k]), 1 << 20, &data, &size), 0);
        for (size_t n = 0; n < size; n += 1 + n / 97) {
            uint8_t *cut = malloc(n ? n : 1);

            memcpy(cut, data, n);
            assert_int_equal(sst_deep_decode(&deep, cut, n, "cut"), -EBADMSG);
            free(cut);
        }
        for (int i = 0; i < 2000; i++) {
            const uint64_t random = sst_random_u64(&state_of_random);
            uint8_t *at = &data[random % size], was = *at;

            *at = (uint8_t)(random >> 32);
            if (!sst_deep_decode(&deep, data, size, "changed"))
                sst_deep_fini(&deep);
            *at = was;
        }
        free(data);
    }
    sst_log_hold_errors(before);
}

/* 16-bit files that are written have the levels, and other readers the right tags. */
static void written_files_are_read(void **state SST_UNUSED)
{
    static const struct kind kinds[] = { { .bits = 16, .channels = 1 }, { .bits = 16, .channels = 3 } };

    for (size_t k = 0; k < 2; k++) {
        const char *path = test_path("written.TIFF");
        struct sst_deep deep, got;
        uint16_t *row = malloc(700 * 3 * sizeof(*row)), predictor = 0;
        TIFF *tif;

        assert_int_equal(sst_deep_init(&deep, 700, 300, kinds[k].channels, 65535), 0);
        for (int c = 0; c < deep.channels; c++)
            for (int i = 0; i < 700 * 300; i++)
                sst_map_u16_row(&deep.plane[c], i / 700)[i % 700] = level(&kinds[k], i % 700, i / 700, c);
        assert_int_equal(sst_deep_write(&deep, path), 0);
        assert_int_equal(deep_read(&got, NULL, path), 0);
        tif = TIFFOpen(path, "r");
        assert_non_null(tif);
        assert_true(TIFFGetField(tif, TIFFTAG_PREDICTOR, &predictor) && predictor == 2);
        for (int y = 0; y < 300; y++) {
            assert_true(TIFFReadScanline(tif, row, (uint32_t)y, 0) > 0);
            for (int i = 0; i < 700 * deep.channels; i++) {
                const int x = i / deep.channels, c = i % deep.channels;

                assert_int_equal(row[i], level(&kinds[k], x, y, c));
                assert_int_equal(sst_map_u16_row(&got.plane[c], y)[x], row[i]);
            }
        }
        TIFFClose(tif);
        free(row);
        sst_deep_fini(&deep);
        sst_deep_fini(&got);
    }
}

/* The readers of 8-bit pictures read TIFF files as PNG files of the same levels. */
static void eight_bits_are_those_of_png(void **state SST_UNUSED)
{
    const struct kind kinds[] = { { .bits = 16, .channels = 1, .photometric = 1 },
                                  { .bits = 16, .channels = 3, .photometric = 2 } };
    struct sst_sample_counts *counts[2] = { calloc(1, sizeof(**counts)), calloc(1, sizeof(**counts)) };

    for (size_t k = 0; k < 2; k++) {
        const char *path[2] = { make(&kinds[k]), test_path("same.png") };
        const struct sst_samples samples[] = { { 0, 0 }, { 5000, 50000 } };
        uint8_t *data[2];
        size_t size[2];
        struct sst_deep deep;

        assert_int_equal(deep_read(&deep, NULL, path[0]), 0);
        assert_int_equal(sst_deep_write(&deep, path[1]), 0);
        for (int i = 0; i < 2; i++) {
            assert_int_equal(sst_file_read(path[i], 1 << 20, &data[i], &size[i]), 0);
            memset(counts[i], 0, sizeof(**counts));
            assert_int_equal(sst_image_count_samples(counts[i], data[i], size[i], "same"), 1);
        }
        assert_memory_equal(counts[0], counts[1], sizeof(**counts));
        for (int s = 0; s < 2; s++) {
            struct sst_image img[2];

            for (int i = 0; i < 2; i++)
                assert_int_equal(sst_image_decode_samples(&img[i], data[i], size[i], "same", samples[s]), 0);
            assert_same_image(&img[0], &img[1], 0);
            sst_image_fini(&img[0]);
            sst_image_fini(&img[1]);
        }
        for (int i = 0; i < 2; i++) {
            struct sst_map_u16 plane[3];

            assert_int_equal(sst_image_decode_deep(plane, data[i], size[i], "same"), 0);
            for (int c = 0; c < 3; c++) {
                assert_int_equal(sst_map_u16_row(&plane[c], 17)[5],
                                 level(&kinds[k], 5, 17, kinds[k].channels == 3 ? c : 0));
                sst_map_u16_fini(&plane[c]);
            }
            free(data[i]);
        }
        sst_deep_fini(&deep);
    }
    free(counts[0]);
    free(counts[1]);
}

/* The tag is applied where EXIF's is, also behind the pixels of a large file. */
static void orientations_are_read(void **state SST_UNUSED)
{
    struct sst_deep deep;
    TIFF *tif;

    assert_int_equal(sst_deep_init(&deep, 600, 600, 1, 65535), 0);
    for (int i = 0; i < 600 * 600; i++)
        sst_map_u16_row(&deep.plane[0], i / 600)[i % 600] = (uint16_t)sst_noise_hash(i, 1, 2, 3);
    assert_int_equal(sst_deep_write(&deep, test_path("turned.tif")), 0);
    assert_int_equal(sst_image_read_orientation(test_path("turned.tif")), 1);
    tif = TIFFOpen(test_path("turned.tif"), "r+");
    assert_non_null(tif);
    TIFFSetField(tif, TIFFTAG_ORIENTATION, 6);
    assert_true(TIFFRewriteDirectory(tif));
    TIFFClose(tif);
    assert_int_equal(sst_image_read_orientation(test_path("turned.tif")), 6);
    sst_deep_fini(&deep);
}

int main(void)
{
    static const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_layouts_are_read),       cmocka_unit_test(palettes_become_colours),
        cmocka_unit_test(other_kinds_are_named),      cmocka_unit_test(wrong_tags_are_refused),
        cmocka_unit_test(missing_pixels_are_refused), cmocka_unit_test(damage_is_found),
        cmocka_unit_test(written_files_are_read),     cmocka_unit_test(eight_bits_are_those_of_png),
        cmocka_unit_test(orientations_are_read),
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
