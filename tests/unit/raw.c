/* pipeline/image/raw: uncompressed frames as pictures, with hand-worked values. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/raw.h"
#include "tests/test.h"

static char dir[] = "/tmp/sst-raw-XXXXXX";
static char path[SST_PATH_MAX];

static void assert_rgb(const struct sst_image *img, int x, int y, int r, int g, int b)
{
    const int want[3] = { r, g, b };

    for (int c = 0; c < 3; c++)
        assert_int_equal(sst_image_row(img, c, y)[x], want[c]);
}

static void yuyv_is_bt601(void **state)
{
    /* Black, white; the red of 75 % bars (65, 100, 212): R = 1.164383*49 + 1.596027*84 = 191.1, G = 57.05 + 10.97
     * - 68.29 = -0.3, B = 57.05 - 56.48 = 0.6. Then chroma between 128 and 212 at an odd column: 170. */
    static const uint8_t row[] = { 16, 128, 235, 128, 65, 100, 65, 212, 65, 100, 126, 212, 16, 128, 126, 128 };
    const struct sst_raw raw = { V4L2_PIX_FMT_YUYV, 8, 1, 0, row, sizeof(row) };
    struct sst_image img;

    (void)state;
    assert_int_equal(sst_raw_to_image(&img, &raw), 0);
    assert_rgb(&img, 0, 0, 0, 0, 0);
    /* Column 1 has the mean of (128, 128) and (100, 212): (114, 170): R = 255 + 67.03 -> 255, G = 255 + 5.48 - 34.14 =
     * 226.3, B = 255 - 28.24 = 226.8. */
    assert_rgb(&img, 1, 0, 255, 226, 227);
    assert_rgb(&img, 2, 0, 191, 0, 1);
    assert_rgb(&img, 3, 0, 191, 0, 1);
    /* The last column has no neighbour on its right: grey of 1.164383 * 110 = 128.1. */
    assert_rgb(&img, 7, 0, 128, 128, 128);
    sst_image_fini(&img);
}

static void fill_mosaic(uint8_t *data, size_t stride, int w, int h, uint32_t fourcc, const uint8_t rgb[3])
{
    static const struct {
        uint32_t fourcc;
        char order[5];
    } orders[] = { { V4L2_PIX_FMT_SRGGB8, "RGGB" },
                   { V4L2_PIX_FMT_SGRBG8, "GRBG" },
                   { V4L2_PIX_FMT_SGBRG8, "GBRG" },
                   { V4L2_PIX_FMT_SBGGR8, "BGGR" } };

    for (size_t i = 0; i < ARRAY_LEN(orders); i++) {
        for (int y = 0; orders[i].fourcc == fourcc && y < h; y++) {
            for (int x = 0; x < w; x++) {
                const char c = orders[i].order[y % 2 * 2 + x % 2];

                data[(size_t)y * stride + (size_t)x] = rgb[c == 'R' ? 0 : c == 'G' ? 1 : 2];
            }
        }
    }
}

/* A flat colour comes back exactly, in every order, size and stride, up to the edges. */
static void flat_bayer_is_exact(void **state)
{
    static const uint32_t formats[] = { V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SGRBG8, V4L2_PIX_FMT_SGBRG8,
                                        V4L2_PIX_FMT_SBGGR8 };
    static const uint8_t rgb[3] = { 200, 100, 30 };
    uint8_t data[20 * 12];

    (void)state;
    for (size_t f = 0; f < ARRAY_LEN(formats); f++) {
        for (int w = 2; w <= 9; w++) {
            for (int h = 2; h <= 7; h++) {
                const struct sst_raw raw = { formats[f], w, h, 20, data, sizeof(data) };
                struct sst_image img;

                memset(data, 255, sizeof(data));
                fill_mosaic(data, 20, w, h, formats[f], rgb);
                assert_int_equal(sst_raw_to_image(&img, &raw), 0);
                for (int y = 0; y < h; y++) {
                    for (int x = 0; x < w; x++)
                        assert_rgb(&img, x, y, 200, 100, 30);
                }
                sst_image_fini(&img);
            }
        }
    }
}

/* One bright red sample in black: the paper's filters, read off around it. RGGB, the sample at (4, 4) of value 80. */
static void bayer_filters_are_the_papers(void **state)
{
    uint8_t data[9 * 9] = { 0 };
    const struct sst_raw raw = { V4L2_PIX_FMT_SRGGB8, 9, 9, 0, data, sizeof(data) };
    struct sst_image img;

    (void)state;
    data[4 * 9 + 4] = 80;
    assert_int_equal(sst_raw_to_image(&img, &raw), 0);
    assert_rgb(&img, 4, 4, 80, 40, 60); /* G: 4/8, B at red: 6/8 */
    assert_rgb(&img, 5, 4, 40, 0, 0);   /* red beside green: 4/8 */
    assert_rgb(&img, 4, 5, 40, 0, 0);   /* red above green: 4/8 */
    assert_rgb(&img, 5, 5, 20, 0, 0);   /* red at blue: diagonal 2/8 */
    assert_rgb(&img, 6, 4, 0, 0, 0);    /* next red: -1/8 for green and -1.5/8 for blue are cut at 0 */
    sst_image_fini(&img);
}

static void samples_are_kept(void **state)
{
    static const uint8_t grey[] = { 1, 2, 3, 99, 4, 5, 255, 99 };
    static const uint8_t y16[] = { 0x34, 0x12, 0xFF, 0xFF, 0, 0, 1, 0 };
    const struct sst_raw a = { V4L2_PIX_FMT_GREY, 3, 2, 4, grey, sizeof(grey) };
    const struct sst_raw b = { V4L2_PIX_FMT_Y16, 1, 4, 0, y16, sizeof(y16) };
    struct sst_map_u8 map;
    struct sst_map_u16 map16;

    (void)state;
    assert_int_equal(sst_raw_write_png(&a, path), 0);
    assert_int_equal(sst_map_u8_read_png(&map, path), 0);
    assert_true(map.width == 3 && map.height == 2);
    assert_memory_equal(sst_map_u8_row(&map, 0), grey, 3);
    assert_memory_equal(sst_map_u8_row(&map, 1), grey + 4, 3);
    sst_map_u8_fini(&map);
    assert_int_equal(sst_raw_write_png(&b, path), 0);
    assert_int_equal(sst_map_u16_read_png(&map16, path), 0);
    assert_true(map16.width == 1 && map16.height == 4);
    assert_int_equal(sst_map_u16_row(&map16, 0)[0], 0x1234);
    assert_int_equal(sst_map_u16_row(&map16, 1)[0], 0xFFFF);
    assert_int_equal(sst_map_u16_row(&map16, 3)[0], 1);
    sst_map_u16_fini(&map16);
}

static void refuses(void **state)
{
    static const uint8_t data[64];
    struct sst_image img;
    char text[SST_LOG_MAX] = "";
    struct sst_raw raw = { V4L2_PIX_FMT_YUYV, 3, 1, 0, data, sizeof(data) };

    (void)state;
    assert_int_equal(sst_raw_to_image(&img, &raw), -EBADMSG); /* odd width */
    raw = (struct sst_raw){ V4L2_PIX_FMT_SRGGB8, 8, 8, 0, data, 63 };
    assert_int_equal(sst_raw_to_image(&img, &raw), -EBADMSG); /* a byte short */
    raw = (struct sst_raw){ V4L2_PIX_FMT_SRGGB8, 8, 8, 7, data, 64 };
    assert_int_equal(sst_raw_to_image(&img, &raw), -EBADMSG); /* rows overlap */
    raw = (struct sst_raw){ V4L2_PIX_FMT_SRGGB8, 8, 4, 20, data, 64 };
    assert_int_equal(sst_raw_to_image(&img, &raw), -EBADMSG); /* needs 3 * 20 + 8 */
    raw = (struct sst_raw){ V4L2_PIX_FMT_NV12, 4, 4, 0, data, 64 };
    assert_int_equal(sst_raw_to_image(&img, &raw), -EINVAL);
    sst_log_hold_errors(text);
    raw = (struct sst_raw){ V4L2_PIX_FMT_GREY, 64, 64, 0, data, 64 };
    assert_int_equal(sst_raw_write_png(&raw, path), -EBADMSG);
    sst_log_hold_errors(NULL);
    assert_non_null(strstr(text, "64 bytes"));
}

static int remove_all(void **state)
{
    (void)state;
    sst_path_remove_tree(dir);
    return 0;
}

static void rgb_is_as_it_is(void **state)
{
    static const uint8_t data[] = { 1, 2, 3, 4, 5, 6, 7, 8, 9, 250, 251, 252 };
    struct sst_raw raw = { V4L2_PIX_FMT_RGB24, 2, 2, 0, data, sizeof(data) };
    struct sst_image img;

    (void)state;
    assert_int_equal(sst_raw_to_image(&img, &raw), 0);
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 4; i++)
            assert_int_equal(sst_image_row(&img, c, i / 2)[i % 2], data[3 * i + c]);
    sst_image_fini(&img);
    raw.bytes--;
    assert_int_equal(sst_raw_to_image(&img, &raw), -EBADMSG);
}

/* A part has the bytes of the whole, and nothing beside it is touched. */
static void parts_are_those_of_the_whole(void **state)
{
    static const uint32_t formats[] = { V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Y16, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_SRGGB8,
                                        V4L2_PIX_FMT_SBGGR8, V4L2_PIX_FMT_RGB24 };
    uint8_t data[3 * 30 * 20];

    (void)state;
    for (size_t i = 0; i < sizeof(data); i++)
        data[i] = (uint8_t)(i * i / 7 + 13 * i);
    for (size_t f = 0; f < sizeof(formats) / sizeof(*formats); f++) {
        const struct sst_raw raw = { formats[f], 30, 20, 90, data, sizeof(data) };
        struct sst_image whole, part;

        assert_int_equal(sst_raw_to_image(&whole, &raw), 0);
        assert_int_equal(sst_image_init(&part, 30, 20), 0);
        assert_int_equal(sst_raw_part(&part, &raw, (struct sst_rect){ 7, 3, 22, 20 }), 0);
        for (int c = 0; c < 3; c++)
            for (int y = 0; y < 20; y++)
                for (int x = 0; x < 30; x++)
                    assert_int_equal(sst_image_row(&part, c, y)[x],
                                     x >= 7 && x < 22 && y >= 3 ? sst_image_row(&whole, c, y)[x] : 0);
        sst_image_fini(&part);
        assert_int_equal(sst_image_init(&part, 29, 20), 0);
        assert_int_equal(sst_raw_part(&part, &raw, (struct sst_rect){ 0, 0, 1, 1 }), -EBADMSG);
        sst_image_fini(&part);
        sst_image_fini(&whole);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(yuyv_is_bt601),
        cmocka_unit_test(rgb_is_as_it_is),
        cmocka_unit_test(flat_bayer_is_exact),
        cmocka_unit_test(bayer_filters_are_the_papers),
        cmocka_unit_test(samples_are_kept),
        cmocka_unit_test(refuses),
        cmocka_unit_test(parts_are_those_of_the_whole),
    };

    if (!mkdtemp(dir) || sst_path_join(path, dir, "out.png"))
        return 1;
    return cmocka_run_group_tests(tests, NULL, remove_all);
}
