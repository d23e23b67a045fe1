/* pipeline/image: PNG, maps, PFM and numpy files, levels of 16 bits, noise, and refusals; JPEG is in codec_jpeg.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include <zlib.h>

#include "base/file.h"
#include "pipeline/image/classes.h"
#include "pipeline/image/codec.h"
#include "tests/codec_pictures.h"
#include "tests/folder.h"
#include "tests/random.h"

static void png_gives_the_same_pixels(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 }, { 1, 9 }, { 9, 1 }, { 65, 33 } };

    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        struct sst_image a = make_image(sizes[i][0], sizes[i][1]), b;
        int width, height;

        assert_int_equal(sst_image_write_png(&a, test_path("a.png")), 0);
        assert_int_equal(sst_image_read(&b, test_path("a.png")), 0);
        assert_same_image(&a, &b, 0);
        assert_int_equal(sst_image_read_size(test_path("a.png"), &width, &height), 0);
        assert_int_equal(width, a.width);
        assert_int_equal(height, a.height);
        sst_image_fini(&a);
        sst_image_fini(&b);
    }
}

static void maps_give_the_same_values(void **state SST_UNUSED)
{
    struct sst_map_u8 a, b;
    struct sst_map_u16 c, d;
    struct sst_image picture;

    assert_int_equal(sst_map_u8_init(&a, 256, 3), 0);
    assert_int_equal(sst_map_u16_init(&c, 256, 3), 0);
    for (int y = 0; y < 3; y++) {
        for (int x = 0; x < 256; x++) {
            sst_map_u8_row(&a, y)[x] = (uint8_t)(x + y);
            sst_map_u16_row(&c, y)[x] = (uint16_t)(x * 257 - y);
        }
    }
    for (int indexed = 0; indexed < 2; indexed++) {
        assert_int_equal(sst_map_u8_write_png(&a, test_path("m.png"), indexed ? sst_classes_palette() : NULL), 0);
        assert_int_equal(sst_map_u8_read_png(&b, test_path("m.png")), 0);
        for (int y = 0; y < 3; y++)
            assert_memory_equal(sst_map_u8_row(&a, y), sst_map_u8_row(&b, y), 256);
        sst_map_u8_fini(&b);
    }
    /* Label 3 as a colour, through the palette. */
    assert_int_equal(sst_image_read(&picture, test_path("m.png")), 0);
    for (int ch = 0; ch < 3; ch++)
        assert_int_equal(sst_image_row(&picture, ch, 0)[3], sst_classes_palette()[3][ch]);
    assert_int_equal(sst_map_u16_write_png(&c, test_path("d.png")), 0);
    assert_int_equal(sst_map_u16_read_png(&d, test_path("d.png")), 0);
    for (int y = 0; y < 3; y++)
        assert_memory_equal(sst_map_u16_row(&c, y), sst_map_u16_row(&d, y), 512);
    /* 16 bits to 8: v * 255 / 65535, rounded. 257 * x becomes x. */
    sst_image_fini(&picture);
    assert_int_equal(sst_image_read(&picture, test_path("d.png")), 0);
    for (int x = 0; x < 256; x++)
        assert_int_equal(sst_image_row(&picture, 1, 0)[x], x);
    assert_int_equal(sst_map_u8_read_png(&b, test_path("d.png")), -EBADMSG);
    assert_int_equal(sst_map_u16_read_png(&d, test_path("m.png")), -EBADMSG);
    sst_image_fini(&picture);
    sst_map_u8_fini(&a);
    sst_map_u16_fini(&c);
    sst_map_u16_fini(&d);
}

/* Flat, of runs and of noise; read as a picture, a map goes through libpng. */
static void maps_of_all_sizes(void **state SST_UNUSED)
{
    uint64_t seed = 1;
    static const int sizes[][2] = { { 1, 1 }, { 1, 300 }, { 300, 1 }, { 63, 2 }, { 64, 65 }, { 1000, 750 } };

    for (size_t i = 0; i < 3 * ARRAY_LEN(sizes); i++) {
        const int width = sizes[i / 3][0], height = sizes[i / 3][1];
        struct sst_map_u8 a, b;
        struct sst_map_u16 c, d;
        struct sst_image picture;

        assert_int_equal(sst_map_u8_init(&a, width, height), 0);
        assert_int_equal(sst_map_u16_init(&c, width, height), 0);
        for (int y = 0; i % 3 && y < height; y++) {
            for (int x = 0; x < width; x++) {
                const unsigned v =
                    i % 3 == 1 ? (unsigned)(x / 50 + y / 30) * 1000 : (unsigned)(sst_random(&seed) * 65536);

                sst_map_u8_row(&a, y)[x] = (uint8_t)v;
                sst_map_u16_row(&c, y)[x] = (uint16_t)v;
            }
        }
        assert_int_equal(sst_map_u8_write_png(&a, test_path("m.png"), NULL), 0);
        assert_int_equal(sst_map_u16_write_png(&c, test_path("d.png")), 0);
        assert_int_equal(sst_map_u8_read_png(&b, test_path("m.png")), 0);
        assert_int_equal(sst_map_u16_read_png(&d, test_path("d.png")), 0);
        assert_int_equal(sst_image_read(&picture, test_path("m.png")), 0);
        for (int y = 0; y < height; y++) {
            assert_memory_equal(sst_map_u8_row(&a, y), sst_map_u8_row(&b, y), (size_t)width);
            assert_memory_equal(sst_map_u8_row(&a, y), sst_image_row(&picture, 1, y), (size_t)width);
            assert_memory_equal(sst_map_u16_row(&c, y), sst_map_u16_row(&d, y), (size_t)width * 2);
        }
        sst_image_fini(&picture);
        sst_map_u8_fini(&a);
        sst_map_u8_fini(&b);
        sst_map_u16_fini(&c);
        sst_map_u16_fini(&d);
    }
}

/* A grey PNG of 16 bits with `count` samples black, black + step ... in its first row. */
static void put_deep(const char *name, int black, int step, int count)
{
    struct sst_map_u16 map;

    assert_int_equal(sst_map_u16_init(&map, count, 2), 0);
    for (int x = 0; x < 2 * count; x++)
        sst_map_u16_row(&map, x % 2)[x / 2] = (uint16_t)(black + step * (x / 2));
    assert_int_equal(sst_map_u16_write_png(&map, test_path(name)), 0);
    sst_map_u16_fini(&map);
}

static void deep_pictures_keep_levels(void **state SST_UNUSED)
{
    static const struct {
        int black, step, count;
        struct sst_samples samples; /* chosen */
        int plain, scaled;          /* levels without and with them */
    } cases[] = {
        { 0, 1, 223, { 0, 222 }, 2, 223 },
        { 30000, 1, 223, { 30000, 30222 }, 2, 223 },
        { 65280, 1, 256, { 65280, 65535 }, 2, 256 },
        { 0, 257, 256, { 0, 0 }, 256, 256 },
        { 0, 64, 1000, { 0, 0 }, 250, 250 },
        { 1000, 4, 1000, { 1000, 4996 }, 16, 256 },
        { 65535, 0, 5, { 0, 0 }, 1, 1 },
        { 0, 0, 5, { 0, 0 }, 1, 1 },
        { 777, 0, 5, { 0, 0 }, 1, 1 },
    };
    struct sst_sample_counts *counts = malloc(sizeof(*counts));
    struct sst_samples samples;
    struct sst_image a;
    uint8_t *data;
    size_t size;

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        put_deep("deep.png", cases[i].black, cases[i].step, cases[i].count);
        assert_int_equal(sst_file_read(test_path("deep.png"), 1 << 20, &data, &size), 0);
        memset(counts, 0, sizeof(*counts));
        assert_int_equal(sst_image_count_samples(counts, data, size, "deep.png"), 1);
        samples = sst_samples_choose(counts);
        assert_int_equal(samples.black, cases[i].samples.black);
        assert_int_equal(samples.white, cases[i].samples.white);
        for (int scaled = 0; scaled < 2; scaled++) {
            bool seen[256] = { false };
            int before, after, left = 0, last = 0;

            sst_samples_levels(&before, &after, counts, scaled ? samples : (struct sst_samples){ 0, 0 });
            assert_int_equal(before, cases[i].step ? cases[i].count : 1);
            assert_int_equal(after, scaled ? cases[i].scaled : cases[i].plain);
            /* The result of reading has that many, in the same order. */
            assert_int_equal(
                sst_image_decode_samples(&a, data, size, "deep.png", scaled ? samples : (struct sst_samples){ 0, 0 }),
                0);
            for (int x = 0; x < a.width; x++) {
                assert_true(sst_image_row(&a, 1, 0)[x] >= last);
                last = sst_image_row(&a, 1, 0)[x];
                assert_int_equal(sst_image_row(&a, 0, 1)[x], last);
                seen[last] = true;
            }
            for (int v = 0; v < 256; v++)
                left += seen[v];
            assert_int_equal(left, after);
            sst_image_fini(&a);
        }
        free(data);
    }
    /* A defective pixel does not take the levels. */
    memset(counts, 0, sizeof(*counts));
    for (int v = 100; v < 1100; v++)
        counts->of[v] = 100;
    counts->of[65535] = 3;
    samples = sst_samples_choose(counts);
    assert_in_range(samples.white, 1098, 1099);
    a = make_image(20, 20);
    assert_int_equal(sst_image_write_png(&a, test_path("flat.png")), 0);
    assert_int_equal(sst_file_read(test_path("flat.png"), 1 << 20, &data, &size), 0);
    assert_int_equal(sst_image_count_samples(counts, data, size, "flat.png"), 0);
    sst_image_fini(&a);
    free(data);
    free(counts);
}

static void samples_of_16_bits_round_trip(void **state SST_UNUSED)
{
    static const struct sst_samples cases[] = { { 0, 0 }, { 30000, 30255 }, { 7, 4095 } };
    struct sst_image a = make_image(33, 20), b;
    uint8_t *data;
    size_t size;

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        assert_int_equal(sst_image_write_samples(&a, cases[i], test_path("s.png")), 0);
        assert_int_equal(sst_file_read(test_path("s.png"), 1 << 20, &data, &size), 0);
        assert_int_equal(data[24], 16); /* bit depth */
        assert_int_equal(sst_image_decode_samples(&b, data, size, "s.png", cases[i]), 0);
        for (int y = 0; y < a.height; y++) {
            for (int c = 0; c < 3; c++)
                assert_memory_equal(sst_image_row(&a, c, y), sst_image_row(&b, c, y), (size_t)a.width);
        }
        sst_image_fini(&b);
        free(data);
    }
    sst_image_fini(&a);
}

static void compared_pictures_are_scaled_alike(void **state SST_UNUSED)
{
    struct sst_image a = { 0 }, b = { 0 }, *both[] = { &a, &b };
    const char *paths[2];
    char first[SST_PATH_MAX], second[SST_PATH_MAX];

    put_deep("a.png", 2000, 1, 100);
    put_deep("b.png", 2100, 1, 100);
    snprintf(first, sizeof(first), "%s", test_path("a.png"));
    snprintf(second, sizeof(second), "%s", test_path("b.png"));
    paths[0] = first;
    paths[1] = second;
    assert_int_equal(sst_image_read_alike(both, paths, 2), 0);
    assert_int_equal(sst_image_row(&a, 0, 0)[0], 0);
    assert_int_equal(sst_image_row(&b, 0, 0)[99], 255);
    assert_int_equal(sst_image_row(&b, 0, 0)[0], 128);
    sst_image_fini(&a);
    sst_image_fini(&b);
    /* Beside one of 8 bits, as ever. */
    a = make_image(20, 20);
    assert_int_equal(sst_image_write_png(&a, second), 0);
    sst_image_fini(&a);
    assert_int_equal(sst_image_read_alike(both, paths, 2), 0);
    assert_int_equal(sst_image_row(&a, 0, 0)[0], 8);
    sst_image_fini(&a);
    sst_image_fini(&b);
    paths[1] = "/nowhere.png";
    a = b = (struct sst_image){ 0 };
    assert_int_equal(sst_image_read_alike(both, paths, 2), -ENOENT);
    assert_null(a.plane[0]);
}

static void noise_is_measured(void **state SST_UNUSED)
{
    static const double sigmas[] = { 0, 2, 5, 10, 20 };
    uint64_t random = 7;

    for (size_t i = 0; i < ARRAY_LEN(sigmas); i++) {
        struct sst_image img;
        double found;

        assert_int_equal(sst_image_init(&img, 331, 217), 0);
        for (int y = 0; y < img.height; y++) {
            for (int x = 0; x < img.width; x++) {
                const double v = 60 + 0.3 * x + 0.2 * y + sigmas[i] * test_normal(&random);

                sst_image_row(&img, 1, y)[x] = (uint8_t)sst_clamp_double(floor(v + 0.5), 0, 255);
            }
        }
        found = sst_image_noise(&img);
        if (found < 0.7 * sigmas[i] || found > sigmas[i] + 0.5)
            fail_msg("%.2f levels for %.0f", found, sigmas[i]);
        sst_image_fini(&img);
    }
    for (int side = 1; side < 40; side += 3) { /* nothing to measure: small, black */
        struct sst_image img;

        assert_int_equal(sst_image_init(&img, side, 40 - side), 0);
        assert_true(sst_image_noise(&img) == 0);
        sst_image_fini(&img);
    }
}

static void put_be32(uint8_t *out, uint32_t v)
{
    for (int i = 0; i < 4; i++)
        out[i] = (uint8_t)(v >> (24 - 8 * i));
}

/* A first chunk that is shorter than a header, and right otherwise. */
static void a_png_without_its_header_is_refused(void **state SST_UNUSED)
{
    static const uint8_t begin[] = { 0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n', 0, 0, 0, 0, 'I', 'H', 'D', 'R' };
    struct sst_image img;

    for (uint8_t n = 0; n < 13; n++) {
        const size_t size = sizeof(begin) + n + 4;
        uint8_t *file = calloc(size, 1); /* so large: bytes read beyond it show */

        assert_non_null(file);
        memcpy(file, begin, sizeof(begin));
        file[11] = n;
        put_be32(file + size - 4, (uint32_t)crc32(0, file + 12, 4u + n));
        assert_int_equal(sst_image_decode(&img, file, size, "short.png"), -EBADMSG);
        free(file);
    }
}

static size_t put_chunk(uint8_t *at, const char *type, const uint8_t *data, size_t n)
{
    put_be32(at, (uint32_t)n);
    memcpy(at + 4, type, 4);
    memcpy(at + 8, data, n);
    put_be32(at + 8 + n, (uint32_t)crc32(0, at + 4, (uInt)n + 4));
    return n + 12;
}

/* A file of samples that are filtered in every way. @param clear  with a transparent colour, which libpng has to read
 * @param split  the size of the first of two compressed chunks @return its size */
static size_t filtered_png(uint8_t out[4096], int width, int height, uint8_t depth, uint8_t type, bool clear,
                           size_t split)
{
    uint8_t header[13] = { [8] = depth, [9] = type }, raw[2000], packed[3000];
    const size_t row = (size_t)width * (type == 2 ? 3 : depth / 8u) + 1;
    uLongf n = sizeof(packed);
    size_t at = 8;

    memcpy(out, "\x89PNG\r\n\x1A\n", 8);
    put_be32(header, (uint32_t)width);
    put_be32(header + 4, (uint32_t)height);
    for (size_t i = 0; i < row * (size_t)height; i++)
        raw[i] = (uint8_t)(i % row ? i * i * 40503u >> 7 : i / row % 5);
    assert_int_equal(compress(packed, &n, raw, (uLong)(row * (size_t)height)), Z_OK);
    at += put_chunk(out + at, "IHDR", header, 13);
    if (clear)
        at += put_chunk(out + at, "tRNS", (const uint8_t[6]){ 0 }, type == 2 ? 6 : 2);
    at += put_chunk(out + at, "IDAT", packed, split);
    at += put_chunk(out + at, "IDAT", packed + split, n - split);
    return at + put_chunk(out + at, "IEND", packed, 0);
}

/* Files read without libpng give the samples that libpng reads. */
static void both_readers_of_png_agree(void **state SST_UNUSED)
{
    static const struct {
        uint8_t depth, type;
    } kinds[] = { { 8, 2 }, { 8, 0 }, { 16, 0 } };
    uint8_t file[4096];

    for (size_t i = 0; i < ARRAY_LEN(kinds); i++) {
        struct sst_image plain, full;
        size_t n = filtered_png(file, 31, 12, kinds[i].depth, kinds[i].type, false, 10);

        assert_int_equal(sst_image_decode(&plain, file, n, "plain.png"), 0);
        if (i == 0) { /* a damaged copy is refused, whichever reads it */
            struct sst_image bad;

            file[n / 2] ^= 1;
            assert_int_equal(sst_image_decode(&bad, file, n, "bad.png"), -EBADMSG);
            file[n / 2] ^= 1;
            assert_int_equal(sst_image_decode(&bad, file, n - 20, "bad.png"), -EBADMSG);
        }
        n = filtered_png(file, 31, 12, kinds[i].depth, kinds[i].type, true, 0);
        assert_int_equal(sst_image_decode(&full, file, n, "full.png"), 0);
        assert_same_image(&plain, &full, 0);
        sst_image_fini(&plain);
        sst_image_fini(&full);
    }
}

/* Maps are read by their values; here through files, of which the second one is libpng's. */
static void both_readers_of_maps_agree(void **state SST_UNUSED)
{
    struct sst_map_u8 a, b;
    struct sst_map_u16 c, d;
    uint8_t file[4096];

    for (int clear = 0; clear < 2; clear++) {
        size_t n = filtered_png(file, 31, 12, 8, 0, clear, 5);

        put_file("m8.png", file, n);
        assert_int_equal(sst_map_u8_read_png(clear ? &b : &a, test_path("m8.png")), 0);
        n = filtered_png(file, 31, 12, 16, 0, clear, 5);
        put_file("m16.png", file, n);
        assert_int_equal(sst_map_u16_read_png(clear ? &d : &c, test_path("m16.png")), 0);
    }
    for (int y = 0; y < 12; y++) {
        assert_memory_equal(sst_map_u8_row(&a, y), sst_map_u8_row(&b, y), 31);
        assert_memory_equal(sst_map_u16_row(&c, y), sst_map_u16_row(&d, y), 62);
    }
    sst_map_u8_fini(&a);
    sst_map_u8_fini(&b);
    sst_map_u16_fini(&c);
    sst_map_u16_fini(&d);
}

/* Sizes in a header are not trusted: rejected before memory is allocated. */
static void absurd_sizes_are_refused(void **state SST_UNUSED)
{
    static const int sizes[][2] = {
        { 0, 1 }, { 1, 0 }, { 100000, 1 }, { 1, 32769 }, { 32768, 32768 }, { 32000, 8000 }
    };
    struct sst_image a = make_image(40, 30), img;
    struct rusage before, after;
    uint8_t *png, *jpeg, *sof = NULL;
    size_t png_size, jpeg_size;

    assert_int_equal(sst_image_write_png(&a, test_path("s.png")), 0);
    assert_int_equal(sst_image_write_jpeg(&a, test_path("s.jpg"), 90), 0);
    assert_int_equal(sst_file_read(test_path("s.png"), 1 << 20, &png, &png_size), 0);
    assert_int_equal(sst_file_read(test_path("s.jpg"), 1 << 20, &jpeg, &jpeg_size), 0);
    for (size_t i = 0; !sof && i + 1 < jpeg_size; i++)
        sof = jpeg[i] == 0xFF && jpeg[i + 1] == 0xC0 ? jpeg + i : NULL;
    assert_non_null(sof);
    assert_int_equal(getrusage(RUSAGE_SELF, &before), 0);
    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        /* PNG: signature, length, "IHDR", width, height, 5 bytes, CRC of the last 17 */
        put_be32(png + 16, (uint32_t)sizes[i][0]);
        put_be32(png + 20, (uint32_t)sizes[i][1]);
        put_be32(png + 29, (uint32_t)crc32(0, png + 12, 17));
        assert_int_equal(sst_image_decode(&img, png, png_size, "absurd.png"), -EBADMSG);
        if (sizes[i][0] > 65535)
            continue;
        /* JPEG: FF C0, length, precision, height, width */
        sof[5] = (uint8_t)(sizes[i][1] >> 8);
        sof[6] = (uint8_t)sizes[i][1];
        sof[7] = (uint8_t)(sizes[i][0] >> 8);
        sof[8] = (uint8_t)sizes[i][0];
        assert_int_equal(sst_image_decode(&img, jpeg, jpeg_size, "absurd.jpg"), -EBADMSG);
    }
    assert_int_equal(getrusage(RUSAGE_SELF, &after), 0);
    assert_true(after.ru_maxrss - before.ru_maxrss < 64 << 10); /* KiB; the last size is 768 MB of pixels */
    sst_image_fini(&a);
    free(png);
    free(jpeg);
}

static void pfm_is_read_bottom_up_in_either_order(void **state SST_UNUSED)
{
    /* 1.0 is 3F 80 00 00, -2.5 is C0 20 00 00, inf is 7F 80 00 00, 0.5 is 3F 00 00 00 */
    static const char big[] = "Pf\n2 2\n1.0\n\x3F\x80\0\0\xC0\x20\0\0\x7F\x80\0\0\x3F\0\0\0";
    static const char little[] = "Pf\n2 2\n-1.0\n\0\0\x80\x3F\0\0\x20\xC0\0\0\x80\x7F\0\0\0\x3F";

    for (int i = 0; i < 2; i++) {
        struct sst_map_f32 m;

        put_file("x.pfm", i ? little : big, (i ? sizeof(little) : sizeof(big)) - 1);
        assert_int_equal(sst_map_f32_read_pfm(&m, test_path("x.pfm")), 0);
        assert_true(isinf(sst_map_f32_row(&m, 0)[0]));
        assert_true(sst_map_f32_row(&m, 0)[1] == 0.5f);
        assert_true(sst_map_f32_row(&m, 1)[0] == 1.0f);
        assert_true(sst_map_f32_row(&m, 1)[1] == -2.5f);
        assert_int_equal(sst_map_f32_write_pfm(&m, test_path("y.pfm")), 0);
        sst_map_f32_fini(&m);
        assert_int_equal(sst_map_f32_read_pfm(&m, test_path("y.pfm")), 0);
        assert_true(sst_map_f32_row(&m, 1)[1] == -2.5f);
        sst_map_f32_fini(&m);
    }
}

static void bad_pfm_files_are_refused(void **state SST_UNUSED)
{
    static const char *const bad[] = {
        "",
        "P",
        "Pf",
        "PF\n1 1\n-1\nxxxx",
        "Pf\n0 1\n-1\n",
        "Pf\n1 -1\n-1\nxxxx",
        "Pf\n100000 1\n-1\nxxxx",
        "Pf\n32768 32768\n-1\nxxxx",
        "Pf\n1 1\n0\nxxxx",
        "Pf\n1 1\nnan\nxxxx",
        "Pf\n1 1\n-1\nxxx",
        "Pf\n1 1\n-1\nxxxxx",
        "Pf\n1 1\n-1",
        "Pf\n99999999999999999999 1\n-1\nxxxx",
        "Pf1 1\n-1\nxxxx",
        "Pf\n1 1\n-1\n\xFF\xFF\xFF\x7F",
    };
    struct sst_map_f32 m = { .width = 77 };

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        put_file("bad.pfm", bad[i], strlen(bad[i]));
        assert_int_equal(sst_map_f32_read_pfm(&m, test_path("bad.pfm")), -EBADMSG);
        assert_int_equal(m.width, 77);
    }
    assert_int_equal(sst_map_f32_read_pfm(&m, test_path("none.pfm")), -ENOENT);
}

static void npy_header_is_exact(void **state SST_UNUSED)
{
    static const float data[6] = { 0, 1, 2, 3, 4, 5 };
    static const size_t dims[2] = { 2, 3 };
    static const char dict[] = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, ), }";
    uint8_t *file;
    size_t size;

    assert_int_equal(sst_npy_write_f32(data, dims, 2, test_path("a.npy")), 0);
    assert_int_equal(sst_file_read(test_path("a.npy"), 1 << 20, &file, &size), 0);
    assert_memory_equal(file, "\x93NUMPY\x01\x00", 8);
    assert_int_equal((10 + file[8] + 256 * file[9]) % 64, 0);
    assert_memory_equal(file + 10, dict, strlen(dict));
    assert_int_equal(file[10 + file[8] - 1], '\n');
    assert_memory_equal(file + 10 + file[8], data, sizeof(data));
    assert_int_equal(size, 10 + file[8] + sizeof(data));
    free(file);
    assert_int_equal(sst_npy_write_f32(data, dims, 0, test_path("a.npy")), -EINVAL);
}

static void failed_writes_leave_nothing(void **state SST_UNUSED)
{
    struct sst_image a = make_image(64, 64);
    struct rlimit old, small = { .rlim_cur = 16 };

    assert_int_equal(sst_image_write_png(&a, "/nonexistent-folder/a.png"), -EIO);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    small.rlim_max = old.rlim_max;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    assert_int_equal(sst_image_write_png(&a, test_path("full.png")), -EFBIG);
    assert_int_equal(sst_image_write_jpeg(&a, test_path("full.jpg"), 90), -EFBIG);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    assert_false(sst_path_exists(test_path("full.png")));
    assert_false(sst_path_exists(test_path("full.jpg")));
    sst_image_fini(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(png_gives_the_same_pixels),
        cmocka_unit_test(both_readers_of_png_agree),
        cmocka_unit_test(both_readers_of_maps_agree),
        cmocka_unit_test(maps_give_the_same_values),
        cmocka_unit_test(maps_of_all_sizes),
        cmocka_unit_test(deep_pictures_keep_levels),
        cmocka_unit_test(samples_of_16_bits_round_trip),
        cmocka_unit_test(noise_is_measured),
        cmocka_unit_test(compared_pictures_are_scaled_alike),
        cmocka_unit_test(a_png_without_its_header_is_refused),
        cmocka_unit_test(absurd_sizes_are_refused),
        cmocka_unit_test(pfm_is_read_bottom_up_in_either_order),
        cmocka_unit_test(bad_pfm_files_are_refused),
        cmocka_unit_test(npy_header_is_exact),
        cmocka_unit_test(failed_writes_leave_nothing),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
