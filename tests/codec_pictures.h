/* tests/codec_pictures.h - drawn pictures, and files of given bytes, for the tests of readers and writers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_CODEC_PICTURES_H
#define SST_TESTS_CODEC_PICTURES_H

#include "base/file.h"
#include "pipeline/image/image.h"
#include "tests/folder.h"
#include "tests/test.h"

static inline void put_file(const char *name, const void *data, size_t size)
{
    assert_int_equal(sst_file_write(test_path("%s", name), data, size), 0);
}

static inline struct sst_image make_image(int width, int height)
{
    struct sst_image img;

    assert_int_equal(sst_image_init(&img, width, height), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++)
                sst_image_row(&img, c, y)[x] = (uint8_t)(x * 7 + y * 13 + c * 50 + x * y / 3);
        }
    }
    return img;
}

static inline void assert_same_image(const struct sst_image *a, const struct sst_image *b, int tolerance)
{
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < a->height; y++) {
            for (int x = 0; x < a->width; x++)
                assert_in_range(sst_image_row(a, c, y)[x] - sst_image_row(b, c, y)[x] + tolerance, 0, 2 * tolerance);
        }
    }
}

#endif
