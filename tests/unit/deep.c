/* Levels of 8 and 16 bits: files, and the stretch that shows them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>

#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/deep.h"
#include "tests/codec_pictures.h"
#include "tests/deep_read.h"

#define WIDTH  33
#define HEIGHT 21

static uint16_t level(int x, int y, int c)
{
    return (uint16_t)(x * 1999 + y * 311 + c * 21001 + x * y);
}

static struct sst_deep make(int channels, int white)
{
    struct sst_deep deep;

    assert_int_equal(sst_deep_init(&deep, WIDTH, HEIGHT, channels, white), 0);
    for (int c = 0; c < channels; c++)
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            sst_map_u16_row(&deep.plane[c], i / WIDTH)[i % WIDTH] =
                (uint16_t)(level(i % WIDTH, i / WIDTH, c) >> (white == 255 ? 8 : 0));
    return deep;
}

static void assert_same(const struct sst_deep *a, const struct sst_deep *b, int factor)
{
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    assert_int_equal(a->channels, b->channels);
    for (int c = 0; c < a->channels; c++)
        for (int y = 0; y < a->height; y++)
            for (int x = 0; x < a->width; x++)
                assert_int_equal(sst_map_u16_row(&a->plane[c], y)[x] * factor, sst_map_u16_row(&b->plane[c], y)[x]);
}

static void assert_size(const char *path, int channels, int bits)
{
    struct sst_deep_size kind;

    assert_int_equal(deep_read(NULL, &kind, path), 0);
    assert_int_equal(kind.width, WIDTH);
    assert_int_equal(kind.height, HEIGHT);
    assert_int_equal(kind.channels, channels);
    assert_int_equal(kind.bits, bits);
}

static void wrong_kinds_are_refused(void **state SST_UNUSED)
{
    struct sst_deep deep = { 0 };

    assert_int_equal(sst_deep_init(&deep, 4, 4, 2, 255), -EINVAL);
    assert_int_equal(sst_deep_init(&deep, 4, 4, 1, 4095), -EINVAL);
    assert_int_equal(sst_deep_init(&deep, 0, 4, 1, 255), -EINVAL);
    sst_deep_fini(&deep);
    deep = make(1, 65535);
    assert_int_equal(sst_deep_write(&deep, test_path("a.jpg")), -EINVAL);
    assert_int_equal(sst_deep_write(&deep, test_path("png")), -EINVAL);
    sst_deep_fini(&deep);
}

static void png_keeps_levels(void **state SST_UNUSED)
{
    for (int i = 0; i < 4; i++) {
        const int channels = i % 2 ? 3 : 1, white = i / 2 ? 255 : 65535;
        struct sst_deep deep = make(channels, white), got;

        assert_int_equal(sst_deep_write(&deep, test_path("a.PNG")), 0);
        assert_int_equal(deep_read(&got, NULL, test_path("a.PNG")), 0);
        assert_int_equal(got.white, 65535);
        assert_same(&deep, &got, white == 255 ? 257 : 1);
        assert_size(test_path("a.PNG"), channels, 16);
        sst_deep_fini(&deep);
        sst_deep_fini(&got);
    }
}

/* 8 bits: grey and palettes of maps, RGB of PNG, grey and colours of JPEG. */
static void eight_bits_stay(void **state SST_UNUSED)
{
    struct sst_image img = make_image(WIDTH, HEIGHT), decoded;
    uint8_t palette[256][3], *data;
    struct sst_map_u8 map;
    struct sst_deep got;
    size_t size;

    for (int i = 0; i < 256; i++)
        for (int c = 0; c < 3; c++)
            palette[i][c] = (uint8_t)(i * (c + 3));
    assert_int_equal(sst_map_u8_init(&map, WIDTH, HEIGHT), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sst_map_u8_row(&map, i / WIDTH)[i % WIDTH] = (uint8_t)i;
    for (int indexed = 0; indexed < 2; indexed++) {
        assert_int_equal(sst_map_u8_write_png(&map, test_path("m.png"), indexed ? palette : NULL), 0);
        assert_int_equal(deep_read(&got, NULL, test_path("m.png")), 0);
        assert_int_equal(got.white, 255);
        assert_int_equal(got.channels, indexed ? 3 : 1);
        for (int c = 0; c < got.channels; c++)
            for (int i = 0; i < WIDTH * HEIGHT; i++)
                assert_int_equal(sst_map_u16_row(&got.plane[c], i / WIDTH)[i % WIDTH],
                                 (uint8_t)(indexed ? i * (c + 3) : i));
        assert_size(test_path("m.png"), got.channels, 8);
        sst_deep_fini(&got);
    }
    sst_map_u8_fini(&map);
    assert_int_equal(sst_image_write_png(&img, test_path("c.png")), 0);
    assert_size(test_path("c.png"), 3, 8);
    for (int grey = 0; grey < 2; grey++) {
        assert_int_equal(sst_image_encode_jpeg_as(&img, 90, grey ? SST_JPEG_GREY : SST_JPEG_420, &data, &size), 0);
        put_file("c.jpg", data, size);
        assert_int_equal(sst_image_decode(&decoded, data, size, "c.jpg"), 0);
        assert_int_equal(deep_read(&got, NULL, test_path("c.jpg")), 0);
        assert_int_equal(got.white, 255);
        assert_int_equal(got.channels, grey ? 1 : 3);
        for (int c = 0; c < got.channels; c++)
            for (int i = 0; i < WIDTH * HEIGHT; i++)
                assert_int_equal(sst_map_u16_row(&got.plane[c], i / WIDTH)[i % WIDTH],
                                 sst_image_row(&decoded, c, i / WIDTH)[i % WIDTH]);
        assert_size(test_path("c.jpg"), got.channels, 8);
        sst_deep_fini(&got);
        sst_image_fini(&decoded);
        free(data);
    }
    sst_image_fini(&img);
}

/* A JPEG with segments of a camera before its own. */
static void put_jpeg(const char *name, const char *const *segment, const size_t *bytes, const uint8_t *mark, int count)
{
    struct sst_image img = make_image(WIDTH, HEIGHT);
    uint8_t file[16384] = { 0xFF, 0xD8 }, *data;
    size_t size, at = 2;

    assert_int_equal(sst_image_encode_jpeg(&img, 90, &data, &size), 0);
    for (int i = 0; i < count; i++) {
        file[at] = 0xFF;
        file[at + 1] = mark[i];
        file[at + 2] = 0;
        file[at + 3] = (uint8_t)(bytes[i] + 2);
        memcpy(file + at + 4, segment[i], bytes[i]);
        at += 4 + bytes[i];
    }
    assert_true(at + size < sizeof(file));
    memcpy(file + at, data + 2, size - 2);
    put_file(name, file, at + size - 2);
    free(data);
    sst_image_fini(&img);
}

static void check_camera(const char *const *segment, const size_t *bytes, const uint8_t *mark, int count,
                         const char *words)
{
    const char *path = test_path("camera.jpg");
    char text[SST_LOG_MAX] = "", *before;
    struct sst_deep_size kind;
    struct sst_deep deep;

    put_jpeg("camera.jpg", segment, bytes, mark, count);
    before = sst_log_hold_errors(text);
    assert_int_equal(deep_read(&deep, NULL, path), words ? -EBADMSG : 0);
    if (words)
        assert_contains(text, words);
    else
        sst_deep_fini(&deep);
    assert_int_equal(deep_read(NULL, &kind, path), words ? -EBADMSG : 0);
    sst_log_hold_errors(before);
}

static void radiometric_jpegs_are_refused(void **state SST_UNUSED)
{
    static const char exif[] = "Exif\0\0MM\0*\0\0\0\10\0\1\1\17\0\2\0\0\0\4DJI\0\0\0\0";
    static const char *const flir[] = { "FLIR\0\1\0\0" }, *const dji[] = { exif, "\1\2\3\4\5\6" };
    static const char *const kodak[] = { exif, "Meta\0\0" };

    check_camera(flir, (const size_t[]){ 8 }, (const uint8_t[]){ 0xE1 }, 1, "exiftool -b -RawThermalImage");
    check_camera(dji, (const size_t[]){ sizeof(exif), 6 }, (const uint8_t[]){ 0xE1, 0xE3 }, 2, "dji_irp -a extract");
    /* A picture of DJI's colour cameras, and another maker's segment. */
    check_camera(dji, (const size_t[]){ sizeof(exif) }, (const uint8_t[]){ 0xE1 }, 1, NULL);
    check_camera(kodak, (const size_t[]){ sizeof(exif), 6 }, (const uint8_t[]){ 0xE1, 0xE3 }, 2, NULL);
    check_camera(dji + 1, (const size_t[]){ 6 }, (const uint8_t[]){ 0xE3 }, 1, NULL);
}

/* --- the stretch -------------------------------------------------------------------------------------------------- */

static struct sst_deep two_levels(int white, uint16_t first, uint16_t second, int firsts)
{
    struct sst_deep deep;

    assert_int_equal(sst_deep_init(&deep, 40, 25, 1, white), 0);
    for (int i = 0; i < 1000; i++)
        sst_map_u16_row(&deep.plane[0], i / 40)[i % 40] = i < firsts ? first : second;
    return deep;
}

static void check_stretch(struct sst_deep deep, int black, int white)
{
    const struct sst_samples s = sst_deep_stretch(&deep);

    assert_int_equal(s.black, black);
    assert_int_equal(s.white, white);
    sst_deep_fini(&deep);
}

static void a_stretch_leaves_outliers_out(void **state SST_UNUSED)
{
    check_stretch(two_levels(65535, 5000, 6000, 500), 5000, 6000);
    check_stretch(two_levels(65535, 0, 65535, 500), 0, 65535);
    check_stretch(two_levels(65535, 65535, 5800, 5), 5799, 5801);  /* 0.5 %, which may be above */
    check_stretch(two_levels(65535, 65535, 5800, 6), 5800, 65535); /* more */
    check_stretch(two_levels(65535, 0, 5800, 5), 5799, 5801);
    check_stretch(two_levels(65535, 0, 5800, 6), 0, 5800);
    check_stretch(two_levels(65535, 5800, 5801, 500), 5799, 5801);
    /* Constant ones stay within the type. */
    check_stretch(two_levels(65535, 0, 0, 0), 0, 2);
    check_stretch(two_levels(65535, 1, 1, 0), 0, 2);
    check_stretch(two_levels(65535, 65535, 65535, 0), 65533, 65535);
    check_stretch(two_levels(255, 255, 255, 0), 253, 255);
    check_stretch(two_levels(255, 0, 0, 0), 0, 2);
}

static void check_levels(const struct sst_deep *deep, struct sst_samples stretch, uint8_t first, uint8_t last)
{
    struct sst_image img;

    assert_int_equal(sst_deep_to_image(&img, deep, stretch), 0);
    for (int c = 0; c < 3; c++) {
        assert_int_equal(sst_image_row(&img, c, 0)[0], first);
        assert_int_equal(sst_image_row(&img, c, 24)[39], last);
    }
    sst_image_fini(&img);
}

static void levels_are_stretched(void **state SST_UNUSED)
{
    struct sst_deep deep = two_levels(65535, 5000, 6000, 500);

    check_levels(&deep, sst_deep_stretch(&deep), 0, 255);
    check_levels(&deep, (struct sst_samples){ 0, 0 }, (5000 * 255 + 32767) / 65535, (6000 * 255 + 32767) / 65535);
    check_levels(&deep, (struct sst_samples){ 5500, 5600 }, 0, 255);
    check_levels(&deep, (struct sst_samples){ 4000, 6000 }, 128, 255);
    sst_deep_fini(&deep);
    deep = two_levels(255, 0, 200, 500);
    check_levels(&deep, (struct sst_samples){ 0, 0 }, 0, 200);
    check_levels(&deep, (struct sst_samples){ 0, 400 }, 0, 128);
    sst_deep_fini(&deep);
    deep = two_levels(65535, 65535, 65535, 0);
    check_levels(&deep, sst_deep_stretch(&deep), 255, 255);
    sst_deep_fini(&deep);
    deep = two_levels(65535, 5800, 5800, 0);
    check_levels(&deep, sst_deep_stretch(&deep), 128, 128);
    sst_deep_fini(&deep);
}

/* The same as the readers of 8-bit pictures make of 16 bits. */
static void eight_bit_readers_agree(void **state SST_UNUSED)
{
    struct sst_deep deep = make(3, 65535);
    struct sst_image a, b;

    assert_int_equal(sst_deep_write(&deep, test_path("a.png")), 0);
    assert_int_equal(sst_image_read(&a, test_path("a.png")), 0);
    assert_int_equal(sst_deep_to_image(&b, &deep, (struct sst_samples){ 0, 0 }), 0);
    assert_same_image(&a, &b, 0);
    sst_image_fini(&a);
    sst_image_fini(&b);
    sst_deep_fini(&deep);
}

int main(void)
{
    static const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_kinds_are_refused),
        cmocka_unit_test(png_keeps_levels),
        cmocka_unit_test(eight_bits_stay),
        cmocka_unit_test(radiometric_jpegs_are_refused),
        cmocka_unit_test(a_stretch_leaves_outliers_out),
        cmocka_unit_test(levels_are_stretched),
        cmocka_unit_test(eight_bit_readers_agree),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
