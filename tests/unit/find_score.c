/* Scores by local mean and spread, and their blobs (pipeline/posed/find/find_internal.h). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/find/find_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "tests/random.h"
#include "tests/small.h"
#include "tests/test.h"

#define SIDE 160

/* Noise of standard deviation 1 around `level`. */
static struct sst_map_f32 noise(double level, uint64_t seed)
{
    struct sst_map_f32 map = { 0 };

    assert_int_equal(sst_map_f32_init(&map, SIDE, SIDE), 0);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            sst_map_f32_row(&map, y)[x] = (float)(level + test_normal(&seed));
        }
    }
    return map;
}

static void add_square(struct sst_map_f32 *map, int x0, int y0, int side, float value)
{
    for (int y = y0; y < y0 + side; y++) {
        for (int x = x0; x < x0 + side; x++)
            sst_map_f32_row(map, y)[x] += value;
    }
}

static double largest(const struct sst_map_f32 *map, int x0, int y0, int side)
{
    double v = -INFINITY;

    for (int y = y0; y < y0 + side; y++) {
        for (int x = x0; x < x0 + side; x++)
            v = fmax(v, (double)sst_map_f32_row(map, y)[x]);
    }
    return v;
}

/* A level of 30,000 below the values changes scores by rounding alone. */
static void offset_does_not_count(void **state SST_UNUSED)
{
    const struct find_score_config cfg = find_score_defaults();
    struct sst_map_f32 low = noise(0, 5), high = { 0 }, a, b;

    assert_int_equal(sst_map_f32_init(&high, SIDE, SIDE), 0);
    add_square(&low, 70, 80, 8, 9);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            sst_map_f32_row(&low, y)[x] = roundf(64 * sst_map_f32_row(&low, y)[x]) / 64; /* exact above 30,000 */
            sst_map_f32_row(&high, y)[x] = sst_map_f32_row(&low, y)[x] + 30000;
        }
    }
    assert_int_equal(find_score(&a, &low, &cfg, 1), 0);
    assert_int_equal(find_score(&b, &high, &cfg, 2), 0);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++)
            assert_true(fabsf(sst_map_f32_row(&a, y)[x] - sst_map_f32_row(&b, y)[x]) < 0.01F);
    }
    assert_true(largest(&a, 70, 80, 8) > 6);
    sst_map_f32_fini(&low);
    sst_map_f32_fini(&high);
    sst_map_f32_fini(&a);
    sst_map_f32_fini(&b);
}

/* Squares that stand together hide each other unless values are cut. */
static void neighbours_stay_visible(void **state SST_UNUSED)
{
    struct find_score_config cfg = find_score_defaults();
    struct sst_map_f32 value = noise(100, 6), cut, plain;

    for (int i = 0; i < 4; i++)
        add_square(&value, 60 + 12 * (i % 2), 60 + 12 * (i / 2), 9, 12);
    assert_int_equal(find_score(&cut, &value, &cfg, 1), 0);
    cfg.rounds = 1;
    assert_int_equal(find_score(&plain, &value, &cfg, 1), 0);
    assert_true(largest(&cut, 60, 60, 21) > 1.3 * largest(&plain, 60, 60, 21));
    sst_map_f32_fini(&value);
    sst_map_f32_fini(&cut);
    sst_map_f32_fini(&plain);
}

/* Pixels that are not valid have no score and change no other's but by their lack. */
static void gaps(void **state SST_UNUSED)
{
    const struct find_score_config cfg = find_score_defaults();
    struct sst_map_f32 value = noise(50, 7), score;

    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE / 2; x++)
            sst_map_f32_row(&value, y)[x] = NAN;
    }
    add_square(&value, SIDE / 2, 40, 6, 10); /* at the edge of the valid pixels */
    assert_int_equal(find_score(&score, &value, &cfg, 1), 0);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++)
            assert_int_equal(isnan(sst_map_f32_row(&score, y)[x]), x < SIDE / 2);
    }
    assert_true(largest(&score, SIDE / 2, 40, 6) > 6);
    sst_map_f32_fini(&value);
    sst_map_f32_fini(&score);
}

static void equal_values(void **state SST_UNUSED)
{
    struct find_score_config cfg = find_score_defaults();
    struct find_blob_config blobs = { 5, 0.4, 5, 1, 1000 };
    struct sst_map_f32 value = { 0 }, score;
    struct sst_blob *blob;
    int count;

    assert_int_equal(sst_map_f32_init(&value, 1, 1), 0);
    assert_int_equal(find_score(&score, &value, &cfg, 4), 0);
    assert_true(isnan(sst_map_f32_row(&score, 0)[0]));
    assert_int_equal(find_blobs(&blob, &count, &score, 1, &blobs), 0);
    assert_int_equal(count, 0);
    free(blob);
    sst_map_f32_fini(&score);
    cfg.reach = 0;
    assert_int_equal(find_score(&score, &value, &cfg, 1), -EINVAL);
    sst_map_f32_fini(&value);
}

static void threads(void **state SST_UNUSED)
{
    const struct find_score_config cfg = find_score_defaults();
    struct sst_map_f32 value = noise(50, 8), one, many;

    assert_int_equal(find_score(&one, &value, &cfg, 1), 0);
    assert_int_equal(find_score(&many, &value, &cfg, 5), 0);
    for (int y = 0; y < SIDE; y++)
        assert_memory_equal(sst_map_f32_row(&one, y), sst_map_f32_row(&many, y), SIDE * sizeof(float));
    sst_map_f32_fini(&value);
    sst_map_f32_fini(&one);
    sst_map_f32_fini(&many);
}

/* --- blobs -------------------------------------------------------------------------------------------------------- */

static void hysteresis(void **state SST_UNUSED)
{
    const struct find_blob_config cfg = { .seed = 5, .grow = 0.4, .close_px = 5, .least_px = 20, .most_px = 400 };
    struct sst_map_f32 score = { 0 };
    struct sst_blob *blob;
    int count;

    assert_int_equal(sst_map_f32_init(&score, SIDE, SIDE), 0);
    add_square(&score, 10, 10, 8, 3);   /* grows to 8x8 of 3 ... */
    add_square(&score, 12, 12, 3, 4);   /* ... from a seed of 7 */
    add_square(&score, 21, 10, 8, 3);   /* a gap of 3 pixels separates no blobs */
    add_square(&score, 60, 60, 8, 4);   /* no seed */
    add_square(&score, 90, 90, 4, 9);   /* too small */
    add_square(&score, 100, 10, 30, 9); /* too large */
    add_square(&score, 40, 130, 6, -8);
    sst_map_f32_row(&score, 5)[5] = NAN;
    assert_int_equal(find_blobs(&blob, &count, &score, 1, &cfg), 0);
    assert_int_equal(count, 1);
    assert_int_equal(blob[0].box.x0, 10);
    assert_int_equal(blob[0].box.x1, 29);
    assert_int_equal(blob[0].box.y0, 10);
    assert_int_equal(blob[0].box.y1, 18);
    assert_true(blob[0].score > 6.9 && blob[0].score < 7.1);
    free(blob);
    assert_int_equal(find_blobs(&blob, &count, &score, -1, &cfg), 0);
    assert_int_equal(count, 1);
    assert_int_equal(blob[0].box.x0, 40);
    assert_int_equal(blob[0].pixels, 36);
    assert_true(fabs(blob[0].x - 42.5) < 1e-9 && fabs(blob[0].y - 132.5) < 1e-9);
    free(blob);
    sst_map_f32_fini(&score);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(offset_does_not_count),
        cmocka_unit_test(neighbours_stay_visible),
        cmocka_unit_test(gaps),
        cmocka_unit_test(equal_values),
        thread_test(threads),
        cmocka_unit_test(hysteresis),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
