/* Resampling kernel: every level against the reference, byte for byte, pictures ending at an unmapped page; the
 * reference against interpolation in double. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

#define WIDTH  37
#define HEIGHT 23
#define SIDE   (2 * SST_RESAMPLE_BORDER)
#define STRIDE (4 * (WIDTH + SIDE))

static uint64_t seed = 3;

static const uint8_t *guarded_picture(void)
{
    const size_t bytes = (size_t)STRIDE * (HEIGHT + SIDE);
    uint8_t *data = guard_random(bytes, &seed);

    for (size_t i = 0; i < bytes; i++)
        data[i] = sst_random_u64(&seed) % 3 ? data[i] : sst_random_u64(&seed) % 2 ? 255 : 0;
    return data;
}

static void bilinear_weights(int16_t *w)
{
    for (int p = 0; p < SST_RESAMPLE_PHASES; p++) {
        w[2 * p] = (int16_t)(64 * (256 - p));
        w[2 * p + 1] = (int16_t)(64 * p);
    }
}

/* Sums of 2^14, magnitudes of up to 2^15; two taps have the given ones. */
static void random_weights(int16_t *w, int taps)
{
    if (taps == 2)
        bilinear_weights(w);
    for (int p = 0; taps > 2 && p < SST_RESAMPLE_PHASES; p++) {
        const int middle = taps / 2 - 1;
        int left = 16384;

        for (int i = 0; i < taps; i++) {
            w[p * taps + i] = (int16_t)(i == middle       ? 0
                                        : i == middle + 1 ? (int)(sst_random_u64(&seed) % 16384)
                                                          : -(int)(sst_random_u64(&seed) % 2048));
            left -= w[p * taps + i];
        }
        w[p * taps + middle] = (int16_t)left;
    }
}

static struct sst_resample source(const uint8_t *picture, const int16_t *weight, int taps)
{
    return (struct sst_resample){
        .pixel = picture + SST_RESAMPLE_BORDER * (STRIDE + 4), .stride = STRIDE, .weight = weight, .taps = taps
    };
}

/* Corners of the picture first, then anywhere; some nowhere. */
static void random_places(int32_t *xy, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        xy[2 * i] =
            i < 4 ? (int32_t)(i & 1) * 256 * (WIDTH - 1) : (int32_t)(sst_random_u64(&seed) % (256 * (WIDTH - 1) + 1));
        xy[2 * i + 1] =
            i < 4 ? (int32_t)(i / 2) * 256 * (HEIGHT - 1) : (int32_t)(sst_random_u64(&seed) % (256 * (HEIGHT - 1) + 1));
        if (i > 4 && sst_random_u64(&seed) % 7 == 0)
            xy[2 * i] = xy[2 * i + 1] = INT32_MIN;
    }
}

static void resample_equals_reference(void **state SST_UNUSED)
{
    static const size_t counts[] = { 1, 2, 3, 7, 8, 9, 63, 129, 512 };
    const uint8_t *picture = guarded_picture();

    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k)) {
            print_message("not run: %s\n", sst_cpu_level_name((enum sst_cpu_level)level));
            continue;
        }
        for (int round = 0; round < 3 * (int)ARRAY_LEN(counts); round++) {
            const int taps = 2 + round % 3 * 2;
            const size_t n = counts[round / 3];
            uint16_t want[3][512], got[3][512];
            int16_t weight[SST_RESAMPLE_PHASES * 6];
            int32_t xy[2 * 512];
            struct sst_resample from = source(picture, weight, taps);

            random_weights(weight, taps);
            random_places(xy, n);
            sst_resample_row_ref((uint16_t *const[3]){ want[0], want[1], want[2] }, &from, xy, n);
            k.resample_row((uint16_t *const[3]){ got[0], got[1], got[2] }, &from, xy, n);
            for (int c = 0; c < 3; c++) {
                for (size_t i = 0; i < n; i++) {
                    if (want[c][i] != got[c][i])
                        fail_msg("level %s, %d taps, n=%zu, colour %d, place %zu (%d, %d): %d, not %d",
                                 sst_cpu_level_name((enum sst_cpu_level)level), taps, n, c, i, xy[2 * i], xy[2 * i + 1],
                                 got[c][i], want[c][i]);
                }
            }
        }
    }
    guard_free_all();
}

/* Runs that leave the picture on each side; halves of 1/256 px round to even. */
static void places_equal_reference(void **state SST_UNUSED)
{
    int32_t want[2 * 129], got[2 * 129];

    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (int round = 0; round < 200; round++) {
            const size_t n = 1 + sst_random_u64(&seed) % 129;
            const float k0 = (float)(sst_random_u64(&seed) % 256) / (round % 2 ? 4 : 1);
            struct sst_places p = { .most = { 256 * (WIDTH - 1), 256 * (HEIGHT - 1) } };

            for (int axis = 0; axis < 2; axis++) {
                p.whole_q8[axis] = (int32_t)(sst_random_u64(&seed) % (WIDTH * 256)) - 1024;
                for (int i = 0; i < 4; i++)
                    p.c[axis][i] = round < 20 ? 0.5f * (float)(i < 2)
                                              : ((float)(sst_random_u64(&seed) % 2001) - 1000) / powf(64, (float)i);
            }
            sst_place_row_ref(want, &p, k0, n);
            k.place_row(got, &p, k0, n);
            assert_memory_equal(got, want, 2 * n * sizeof(*got));
        }
    }
}

/* Against the sum in double with the same weights: columns are rounded to 1/64 (1/128 off at most, times the weights'
 * magnitudes), the result to 1/128. */
static void reference_is_the_sum(void **state SST_UNUSED)
{
    const uint8_t *picture = guarded_picture();

    for (int taps = 2; taps <= 6; taps += 2) {
        uint16_t got[3][512];
        int16_t weight[SST_RESAMPLE_PHASES * 6];
        int32_t xy[2 * 512];
        struct sst_resample from = source(picture, weight, taps);
        double worst = 0;

        random_weights(weight, taps);
        random_places(xy, 512);
        sst_resample_row_ref((uint16_t *const[3]){ got[0], got[1], got[2] }, &from, xy, 512);
        for (int i = 0; i < 512; i++) {
            for (int c = 0; c < 3; c++) {
                double sum = 0;

                for (int t = 0; t < taps * taps && xy[2 * i] != INT32_MIN; t++) {
                    const int px = (xy[2 * i] >> 8) + 1 - taps / 2 + t % taps,
                              py = (xy[2 * i + 1] >> 8) + 1 - taps / 2 + t / taps;

                    sum += weight[(xy[2 * i] & 255) * taps + t % taps] / 16384.0 *
                           weight[(xy[2 * i + 1] & 255) * taps + t / taps] / 16384.0 *
                           from.pixel[py * STRIDE + 4 * px + c];
                }
                worst = fmax(worst, fabs(sst_clamp_double(sum, 0, 255) - got[c][i] / 128.0));
            }
        }
        print_message("%d taps: worst error %.4f levels\n", taps, worst);
        assert_true(worst <= 2 / 128.0 + 1 / 256.0);
    }
    guard_free_all();
}

/* One position by hand, two taps: 3/4 of the way right, half way down between 10, 50 over 30, 110. Columns 20 and 80,
 * value 65, in 1/128: 8320. */
static void by_hand(void **state SST_UNUSED)
{
    uint8_t picture[(2 + SIDE) * 4 * (2 + SIDE)] = { 0 };
    const size_t stride = (2 + SIDE) * 4;
    int16_t weight[SST_RESAMPLE_PHASES * 2];
    uint8_t *pixel = picture + SST_RESAMPLE_BORDER * (stride + 4);
    const struct sst_resample from = { .pixel = pixel, .stride = stride, .weight = weight, .taps = 2 };
    const int32_t xy[] = { 192, 128, 256, 256, INT32_MIN, INT32_MIN };
    uint16_t red[3], green[3], blue[3];

    bilinear_weights(weight);
    for (int c = 0; c < 3; c++) {
        pixel[c] = 10;
        pixel[4 + c] = 50;
        pixel[stride + c] = 30;
        pixel[stride + 4 + c] = (uint8_t)(110 + c);
    }
    sst_resample_row_ref((uint16_t *const[3]){ red, green, blue }, &from, xy, 3);
    assert_int_equal(red[0], 8320);
    assert_int_equal(red[1], 110 * 128);
    assert_int_equal(blue[1], 112 * 128);
    assert_int_equal(green[2], 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(resample_equals_reference),
        cmocka_unit_test(places_equal_reference),
        cmocka_unit_test(reference_is_the_sum),
        cmocka_unit_test(by_hand),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
