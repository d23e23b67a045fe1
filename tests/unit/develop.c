/* Raw files: nothing that LibRaw would choose by a picture's content may differ between the views of one camera. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/image/develop.h"
#include "tests/test.h"

#define SIDE  64
#define WHITE 4095
#define GREY  136 /* 1000 of 4095 under sRGB's curve */

struct dng {
    bool neutral;  /* the camera's white balance is in the file: white is white */
    bool real;     /* samples are floating-point numbers */
    int level;     /* of all samples */
    int patch[3];  /* red, green and blue of the upper left quarter */
    uint32_t wide; /* width in the file; 0: SIDE */
};

static void put(FILE *f, uint64_t v, int bytes)
{
    for (int i = 0; i < bytes; i++)
        putc((int)(v >> 8 * i & 255), f);
}

/* DNG 1.4: little-endian, one strip of samples in the pattern red, green, green, blue. */
static void make_dng(const struct dng *d, char **out, size_t *size)
{
    static const int matrix[9] = { 32405, -15371, -4985, -9693, 18760, 416, 556, -2040, 10572 };
    enum {
        FIRST = 8,
        MOST = 21,
        MATRIX = FIRST + 2 + 12 * MOST + 4,
        NEUTRAL = MATRIX + 72,
        MODEL = NEUTRAL + 24,
        STRIP = MODEL + 16
    };
    const uint32_t bytes = d->real ? 4 : 2, width = d->wide ? d->wide : SIDE;
    const uint32_t tags[MOST][4] = {
        { 254, 4, 1, 0 },
        { 256, 4, 1, width },
        { 257, 4, 1, SIDE },
        { 258, 3, 1, 8 * bytes },
        { 259, 3, 1, 1 },
        { 262, 3, 1, 32803 },
        { 271, 2, 4, 0x747373 },
        { 272, 2, 15, MODEL },
        { 273, 4, 1, STRIP },
        { 274, 3, 1, 1 },
        { 277, 3, 1, 1 },
        { 278, 4, 1, SIDE },
        { 279, 4, 1, SIDE * SIDE * bytes },
        { 339, 3, 1, d->real ? 3 : 1 },
        { 33421, 3, 2, 0x20002 },
        { 33422, 1, 4, 0x2010100 },
        { 50706, 1, 4, 0x401 },
        { 50717, 4, 1, WHITE },
        { 50721, 10, 9, MATRIX },
        { 50728, 5, 3, NEUTRAL },
        { 50778, 3, 1, 21 },
    };
    FILE *f = open_memstream(out, size);

    assert_non_null(f);
    put(f, 0x2a4949, 4);
    put(f, FIRST, 4);
    put(f, MOST - !d->neutral, 2);
    for (int i = 0; i < MOST; i++) {
        if (tags[i][0] == 50728 && !d->neutral)
            continue;
        put(f, tags[i][0], 2);
        put(f, tags[i][1], 2);
        put(f, tags[i][2], 4);
        put(f, tags[i][3], 4);
    }
    for (int i = d->neutral ? 0 : -3; i < 1; i++) /* no other directory; the room of the tag that is left out */
        put(f, 0, 4);
    for (int i = 0; i < 9; i++) {
        put(f, (uint32_t)matrix[i], 4);
        put(f, 10000, 4);
    }
    for (int i = 0; i < 6; i++)
        put(f, 1, 4);
    fwrite("SST test camera\0", 1, 16, f);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            const int colour = x % 2 + y % 2, v = x < SIDE / 2 && y < SIDE / 2 ? d->patch[colour] : d->level;
            const float real = (float)v;
            uint32_t bits;

            memcpy(&bits, &real, 4);
            put(f, d->real ? bits : (uint32_t)v, (int)bytes);
        }
    assert_int_equal(fclose(f), 0);
}

/* @param rgb  out: of a pixel far from the patch */
static int develop(const struct dng *d, uint8_t rgb[3])
{
    struct sst_image img = { 0 };
    char *data;
    size_t size;
    int err;

    make_dng(d, &data, &size);
    err = sst_image_develop(&img, (const uint8_t *)data, size, "t.dng");
    for (int c = 0; c < 3 && !err; c++)
        rgb[c] = sst_image_row(&img, c, SIDE - 12)[SIDE - 12];
    sst_image_fini(&img);
    free(data);
    return err;
}

/* LibRaw takes the brightest sample for white where it is above three quarters of the white level. */
static void the_brightest_sample_changes_nothing(void **state SST_UNUSED)
{
    static const int brightest[] = { 1000, 3071, 3072, 3500, 4094, 4095, 9000 };

    for (size_t i = 0; i < ARRAY_LEN(brightest); i++) {
        const int v = brightest[i];
        uint8_t rgb[3];

        assert_int_equal(develop(&(struct dng){ .neutral = true, .level = 1000, .patch = { v, v, v } }, rgb), 0);
        for (int c = 0; c < 3; c++) {
            if (rgb[c] != GREY)
                fail_msg("brightest sample %d: colour %d is %d, not %d", v, c, rgb[c], GREY);
        }
    }
}

/* LibRaw measures a balance in the picture where the file has none. */
static void a_file_without_balance_gets_a_fixed_one(void **state SST_UNUSED)
{
    static const int patch[][3] = { { 1000, 1000, 1000 }, { 3000, 1000, 500 }, { 400, 1500, 3000 } };
    uint8_t first[3], rgb[3];

    for (size_t i = 0; i < ARRAY_LEN(patch); i++) {
        assert_int_equal(develop(&(struct dng){ .level = 1000, .patch = { patch[i][0], patch[i][1], patch[i][2] } },
                                 i ? rgb : first),
                         0);
        if (i)
            assert_memory_equal(rgb, first, 3);
    }
}

/* LibRaw scales them by the brightest sample. */
static void floating_point_is_refused(void **state SST_UNUSED)
{
    char said[SST_LOG_MAX] = "", *before = sst_log_hold_errors(said);
    uint8_t rgb[3];
    const int err = develop(&(struct dng){ .neutral = true, .real = true, .level = 1000, .patch = { 9, 9, 9 } }, rgb);

    sst_log_hold_errors(before);
    assert_int_equal(err, -EBADMSG);
    assert_non_null(strstr(said, "t.dng"));
}

/* Before memory is taken for it. */
static void a_size_beyond_all_pictures_is_refused(void **state SST_UNUSED)
{
    char said[SST_LOG_MAX] = "", *before = sst_log_hold_errors(said);
    uint8_t rgb[3];
    const int err = develop(&(struct dng){ .neutral = true, .level = 1000, .patch = { 9, 9, 9 }, .wide = 60000 }, rgb);

    sst_log_hold_errors(before);
    assert_int_equal(err, -EBADMSG);
    assert_non_null(strstr(said, "60000"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_brightest_sample_changes_nothing),
        cmocka_unit_test(a_file_without_balance_gets_a_fixed_one),
        cmocka_unit_test(floating_point_is_refused),
        cmocka_unit_test(a_size_beyond_all_pictures_is_refused),
    };

    if (!sst_image_can_develop()) {
        puts("LibRaw is absent");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
