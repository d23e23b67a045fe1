/* The strip: its bits by hand, every field and its limits, and that a wrong bit anywhere is refused. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "tests/strip_read.h"
#include "tests/test.h"

#define WIDTH  640
#define HEIGHT 24 /* 240 bits in rows of 80 cells */

static uint8_t luma[HEIGHT][WIDTH];

static const struct sst_sim_exposure example = {
    .cam = 5,
    .trigger = 0x0102030405,
    .t_ns = 0x112233445566,
    .exposure_us = 1000,
    .gain = 1.5,
    .pose_um = { 1, -1, 256 },
};

static void expect_same(const struct sst_sim_exposure *a, const struct sst_sim_exposure *b)
{
    assert_int_equal(a->cam, b->cam);
    assert_int_equal(a->trigger, b->trigger);
    assert_int_equal(a->t_ns, b->t_ns);
    assert_int_equal(a->exposure_us, b->exposure_us);
    assert_true(a->gain == b->gain);
    for (int i = 0; i < 3; i++)
        assert_int_equal(a->pose_um[i], b->pose_um[i]);
}

static void bits_are_as_the_header_says(void **state SST_UNUSED)
{
    /* Exposure 1000 = 0x003E8 and gain 1.5 * 64 = 0x060 share a byte; the checksum is zlib's of the 26 bytes before. */
    static const uint8_t want[SST_STRIP_BYTES] = { 0x05, 0x01, 0x02, 0x03, 0x04, 0x05, 0x00, 0x11, 0x22, 0x33,
                                                   0x44, 0x55, 0x66, 0x00, 0x3E, 0x80, 0x60, 0x00, 0x00, 0x01,
                                                   0xFF, 0xFF, 0xFF, 0x00, 0x01, 0x00, 0x68, 0x71, 0xC7, 0x6A };
    uint8_t bits[SST_STRIP_BYTES];

    strip_pack(&example, bits);
    assert_memory_equal(bits, want, sizeof(want));
    strip_draw(&luma[0][0], WIDTH, WIDTH, &example);
    /* Camera 5 is 00000101: cells 5 and 7 of the first row are white. */
    for (int cell = 0; cell < 8; cell++) {
        assert_int_equal(luma[0][8 * cell], cell == 5 || cell == 7 ? 240 : 16);
        assert_int_equal(luma[7][8 * cell + 7], cell == 5 || cell == 7 ? 240 : 16);
    }
    /* Row 1 begins with bit 80, the high bit of byte 10 (0x44 = 01000100). */
    for (int cell = 0; cell < 8; cell++)
        assert_int_equal(luma[8][8 * cell], cell == 1 || cell == 5 ? 240 : 16);
}

static void height_follows_from_the_width(void **state SST_UNUSED)
{
    assert_int_equal(strip_height(640), 24);  /* 3 rows of 80 cells */
    assert_int_equal(strip_height(320), 48);  /* 6 of 40 */
    assert_int_equal(strip_height(1280), 16); /* 1.5 of 160 */
    assert_int_equal(strip_height(1920), 8);  /* 1 of 240 */
    assert_int_equal(strip_height(160), 96);
}

static void every_field_comes_back(void **state SST_UNUSED)
{
    static const struct sst_sim_exposure cases[] = {
        { 0 },
        { .cam = 255,
          .trigger = 0xFFFFFFFFFF,
          .t_ns = 0xFFFFFFFFFFFFFF,
          .exposure_us = 0xFFFFF,
          .gain = 4095 / 64.0,
          .pose_um = { 8388607, -8388608, 0 } },
        { .cam = 1, .gain = 1 },
        { .trigger = 1, .gain = 1 },
        { .t_ns = 1, .gain = 1 },
        { .exposure_us = 1, .gain = 1 },
        { .gain = 1 / 64.0 },
        { .pose_um = { 1, 0, 0 } },
        { .pose_um = { 0, 1, 0 } },
        { .pose_um = { 0, 0, -1 } },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_sim_exposure got = example;

        strip_draw(&luma[0][0], WIDTH, WIDTH, &cases[i]);
        assert_int_equal(strip_read(&luma[0][0], WIDTH, WIDTH, HEIGHT, &got), 0);
        expect_same(&got, &cases[i]);
    }
}

static void what_does_not_fit_is_clamped(void **state SST_UNUSED)
{
    const struct sst_sim_exposure big = { .cam = 300,
                                          .trigger = UINT64_MAX,
                                          .t_ns = -5,
                                          .exposure_us = 2000000,
                                          .gain = 100,
                                          .pose_um = { 9000000, -9000000, 0 } };
    const struct sst_sim_exposure want = { .cam = 255,
                                           .trigger = 0xFFFFFFFFFF,
                                           .t_ns = 0,
                                           .exposure_us = 0xFFFFF,
                                           .gain = 4095 / 64.0,
                                           .pose_um = { 8388607, -8388608, 0 } };
    struct sst_sim_exposure got;

    strip_draw(&luma[0][0], WIDTH, WIDTH, &big);
    assert_int_equal(strip_read(&luma[0][0], WIDTH, WIDTH, HEIGHT, &got), 0);
    expect_same(&got, &want);
}

static void a_wrong_bit_is_refused(void **state SST_UNUSED)
{
    for (int i = 0; i < SST_STRIP_BITS; i++) {
        uint8_t(*cell)[WIDTH] = &luma[i / 80 * 8];
        struct sst_sim_exposure got = { .cam = 77 };

        strip_draw(&luma[0][0], WIDTH, WIDTH, &example);
        for (int y = 0; y < 8; y++) {
            for (int x = i % 80 * 8; x < i % 80 * 8 + 8; x++)
                cell[y][x] = (uint8_t)(256 - cell[y][x]);
        }
        assert_int_equal(strip_read(&luma[0][0], WIDTH, WIDTH, HEIGHT, &got), -EBADMSG);
        assert_int_equal(got.cam, 77);
    }
}

static void what_is_no_strip_is_refused(void **state SST_UNUSED)
{
    struct sst_sim_exposure got = { .cam = 77 };

    strip_draw(&luma[0][0], WIDTH, WIDTH, &example);
    assert_int_equal(strip_read(&luma[0][0], WIDTH, WIDTH, HEIGHT - 1, &got), -EBADMSG);
    assert_int_equal(strip_read(&luma[0][0], WIDTH, 7, HEIGHT, &got), -EBADMSG);
    for (int y = 0; y < 8; y++) /* neither black nor white */
        memset(&luma[y][16], 128, 8);
    assert_int_equal(strip_read(&luma[0][0], WIDTH, WIDTH, HEIGHT, &got), -EBADMSG);
    memset(luma, 0, sizeof(luma));
    assert_int_equal(strip_read(&luma[0][0], WIDTH, WIDTH, HEIGHT, &got), -EBADMSG);
    memset(luma, 255, sizeof(luma));
    assert_int_equal(strip_read(&luma[0][0], WIDTH, WIDTH, HEIGHT, &got), -EBADMSG);
    assert_int_equal(got.cam, 77);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bits_are_as_the_header_says), cmocka_unit_test(height_follows_from_the_width),
        cmocka_unit_test(every_field_comes_back),      cmocka_unit_test(what_does_not_fit_is_clamped),
        cmocka_unit_test(a_wrong_bit_is_refused),      cmocka_unit_test(what_is_no_strip_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
