/* Windows of posed views: every level against the reference, byte for byte, buffers ending at an unmapped page; the
 * reference against correlations in double; running sums against sums from the beginning. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/root_inverse.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

#define WIDTH    61
#define HEIGHT   23
#define N        300
#define SEGMENTS 9

static const size_t sizes[] = { 1, 7, 8, 15, 16, 17, 63, 64, 65, 130, 300 };
static uint64_t seed = 7;

static int32_t below(int32_t n)
{
    return (int32_t)(sst_random_u64(&seed) % (uint64_t)n);
}

static int16_t *levels(size_t n, bool extreme)
{
    int16_t *level = guard_random(n * sizeof(*level), &seed);

    for (size_t i = 0; i < n; i++)
        level[i] = (int16_t)(extreme ? (below(2) ? SST_LEVEL_MAX : -SST_LEVEL_MAX)
                                     : below(2 * SST_LEVEL_MAX + 1) - SST_LEVEL_MAX);
    return level;
}

static int32_t *sums(size_t n, int32_t most, bool negative)
{
    int32_t *sum = guard_random(n * sizeof(*sum), &seed);

    for (size_t i = 0; i < n; i++)
        sum[i] = below(most) - (negative ? most / 2 : 0);
    return sum;
}

static float *floats(size_t n, float lo, float hi)
{
    float *v = guard_random(n * sizeof(*v), &seed);

    for (size_t i = 0; i < n; i++)
        v[i] = lo + (hi - lo) * (float)below(1 << 20) / (1 << 20);
    return v;
}

static void *again(const void *p, size_t bytes)
{
    void *copy = guard_random(bytes, &seed);

    memcpy(copy, p, bytes);
    return copy;
}

/* Levels above the reference that this processor has. @return false: there are no more */
static bool next_level(int *level, struct sst_kernels *k)
{
    while (++*level < SST_CPU_LEVELS) {
        if (sst_kernels_at((enum sst_cpu_level)*level, k))
            return true;
        print_message("not run: %s\n", sst_cpu_level_name((enum sst_cpu_level)*level));
    }
    return false;
}

#define SAME(want, got, n, what)                                                                                       \
    do {                                                                                                               \
        if (memcmp(want, got, (n) * sizeof(*(want))))                                                                  \
            fail_msg("level %s, %zu pixels: %s differ", sst_cpu_level_name((enum sst_cpu_level)level), n, what);       \
    } while (0)

/* Ends of every segment are inside; corners of the picture first. `near`: steps as of a view beside the camera. */
static void random_segments(struct sst_warped_segment *s, bool near)
{
    static const int lengths[SEGMENTS] = { 1, 2, 7, 8, 15, 16, 17, 32, 64 };
    int at = 0;

    for (int i = 0; i < SEGMENTS; i++) {
        const int32_t most[2] = { (WIDTH - 1) << 16, (HEIGHT - 1) << 16 };
        int32_t from[2], step[2];

        for (int k = 0; k < 2; k++) {
            const int32_t end = i % 4 == 0 ? most[k] : below(most[k] + 1);

            from[k] = i % 4 == 1 ? 0 : below(most[k] + 1);
            step[k] = lengths[i] > 1 ? (end - from[k]) / (lengths[i] - 1) : 0;
            from[k] = lengths[i] > 1 ? from[k] : end;
        }
        for (int k = 0; k < 2 && near && lengths[i] < 60; k++) {
            const int32_t size = (lengths[i] - 1) * (k ? 20000 : 104000);

            step[k] = k ? below(40000) - 20000 : below(104000);
            step[k] = size < most[k] ? step[k] : most[k] / lengths[i];
            from[k] = i % 3 ? below(most[k] - abs(step[k]) * (lengths[i] - 1) + 1) : 0;
            from[k] += step[k] < 0 ? -step[k] * (lengths[i] - 1) : 0;
        }
        s[i] = (struct sst_warped_segment){ from[0], from[1], step[0], step[1], at, lengths[i] };
        at += lengths[i] + below(5);
    }
    assert_true(at <= N);
}

static void levels_equal_the_reference(void **state SST_UNUSED)
{
    uint16_t *plane = guard_random(2 * WIDTH * HEIGHT, &seed);
    const struct sst_warped_source from = { { plane }, WIDTH, WIDTH, HEIGHT, 1 };
    struct sst_kernels k;

    for (int i = 0; i < WIDTH * HEIGHT; i++)
        plane[i] = (uint16_t)(i % 3 ? plane[i] : i % 2 ? 65535 : 0);
    for (int level = SST_CPU_REF; next_level(&level, &k);) {
        for (int round = 0; round < 200; round++) {
            int16_t want[N] = { 0 }, got[N] = { 0 };
            uint8_t seen[2][N] = { { 0 } };
            uint32_t sum[N] = { 0 };
            uint16_t count[N] = { 0 };
            struct sst_warped_segment segment[SEGMENTS];

            random_segments(segment, round % 2);
            sst_level_row_ref(want, seen[0], &from, segment, SEGMENTS);
            k.level_row(got, seen[1], &from, segment, SEGMENTS);
            SAME(want, got, (size_t)N, "levels");
            SAME(seen[0], seen[1], (size_t)N, "seen pixels");
            sst_warped_row_ref((uint32_t *const[3]){ sum }, count, &from, segment, SEGMENTS);
            for (int i = 0; i < N; i++) {
                assert_int_equal(count[i], seen[0][i]);
                if (count[i]) /* within half of a level and two roundings */
                    assert_true(fabs(want[i] - (sum[i] / 64.0 - 32768) / (1 << SST_LEVEL_SHIFT)) <= 0.5 + 1.0 / 64);
            }
        }
    }
    guard_free_all();
}

static void column_sums_equal_the_reference(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (int level = SST_CPU_REF; next_level(&level, &k);) {
        for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
            const size_t n = sizes[i];
            const int16_t *const a[2] = { levels(n, i % 2), levels(n, i % 2) };
            const int16_t *const b[2] = { levels(n, i % 2), levels(n, i % 2) };
            int32_t *want[2] = { sums(n, 1 << 29, true), sums(n, 1 << 29, false) };
            int32_t *got[2] = { again(want[0], 4 * n), again(want[1], 4 * n) };

            sst_window_squares_ref(want[0], want[1], a, n);
            k.window_squares(got[0], got[1], a, n);
            SAME(want[0], got[0], n, "sums");
            SAME(want[1], got[1], n, "squares");
            sst_window_products_ref(want[0], a, b, n);
            k.window_products(got[0], a, b, n);
            SAME(want[0], got[0], n, "products");
            guard_free_all();
        }
    }
}

static void statistics_equal_the_reference(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (int level = SST_CPU_REF; next_level(&level, &k);) {
        for (size_t i = 0; i < 2 * ARRAY_LEN(sizes); i++) {
            const size_t n = sizes[i / 2], more = n + SST_WINDOW - 1;
            uint8_t *seen[2] = { guard_random(more, &seed), guard_random(more, &seed) };
            const struct sst_window_sums in = { sums(more, 7 * SST_LEVEL_MAX, true),
                                                sums(more, 7 * SST_LEVEL_MAX * SST_LEVEL_MAX, false),
                                                { i % 2 ? seen[0] : NULL, i % 2 ? seen[1] : NULL },
                                                0.01f };
            float *want = floats(2 * n, 0, 1), *got = floats(2 * n, 0, 1);

            for (size_t x = 0; x < 2 * more; x++)
                seen[x / more][x % more] &= 1;
            sst_window_stats_ref(want, want + n, &in, n);
            k.window_stats(got, got + n, &in, n);
            SAME(want, got, 2 * n, "means or deviations");
            guard_free_all();
        }
    }
}

static void correlations_equal_the_reference(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (int level = SST_CPU_REF; next_level(&level, &k);) {
        for (size_t i = 0; i < 5 * ARRAY_LEN(sizes); i++) {
            const size_t n = sizes[i / 5], more = n + SST_WINDOW - 1;
            struct sst_window_row row = {
                .mean = floats(n, -2, 2), .inverse = floats(n, 0, 3), .others = i % 5, .floor = 0.01f
            };
            float *want = floats(n, 0, 1), *got = again(want, n * sizeof(*want));

            for (size_t o = 0; o < row.others; o++) {
                row.other_mean[o] = floats(n, -2, 2);
                row.other_inverse[o] = floats(n, 0, 3);
                row.products[o] = sums(more, 1 << 24, true);
            }
            sst_window_best_ref(want, &row, n);
            k.window_best(got, &row, n);
            SAME(want, got, n, "correlations");
            guard_free_all();
        }
    }
}

static void agreement_equals_the_reference(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (int level = SST_CPU_REF; next_level(&level, &k);) {
        for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
            const size_t n = sizes[i];
            const struct sst_window_pair pair = { { floats(n, -1, 1), floats(n, -1, 1) },
                                                  { floats(n, 0, 2), floats(n, 0, 2) },
                                                  sums(n + SST_WINDOW - 1, 1 << 22, true),
                                                  0.2f };
            uint8_t *want = guard_random(2 * n, &seed), *got = again(want, 2 * n);

            sst_window_agree_ref(want, want + n, &pair, n);
            k.window_agree(got, got + n, &pair, n);
            SAME(want, got, 2 * n, "counts");
            guard_free_all();
        }
    }
}

static void weighted_sums_equal_the_reference(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (int level = SST_CPU_REF; next_level(&level, &k);) {
        for (size_t i = 0; i < 2 * ARRAY_LEN(sizes); i++) {
            const size_t n = sizes[i / 2];
            struct sst_weighted_rays rays = { .channels = i % 2 ? 3 : 1 };
            struct sst_weighted_sums sum[2];
            uint32_t *weight = (uint32_t *)sums(n, 255 * 128 * 64 + 1, false);
            uint16_t *count = guard_random(2 * n, &seed);

            rays.weight = weight;
            rays.count = count;
            for (int c = 0; c < rays.channels; c++) {
                rays.level[c] = (uint32_t *)sums(n, 65535 * 64 + 1, false);
                sum[0].level[c] = (uint32_t *)sums(n, 1 << 30, false);
                sum[1].level[c] = again(sum[0].level[c], 4 * n);
                sum[0].weighted[c] = floats(n, 0, 1e12f);
                sum[1].weighted[c] = again(sum[0].weighted[c], 4 * n);
            }
            sum[0].weight = (uint32_t *)sums(n, 1 << 30, false);
            sum[1].weight = again(sum[0].weight, 4 * n);
            sum[0].count = guard_random(2 * n, &seed);
            sum[1].count = again(sum[0].count, 2 * n);
            sst_weighted_add_ref(&sum[0], &rays, n);
            k.weighted_add(&sum[1], &rays, n);
            for (int c = 0; c < rays.channels; c++) {
                SAME(sum[0].level[c], sum[1].level[c], n, "levels");
                SAME(sum[0].weighted[c], sum[1].weighted[c], n, "weighted levels");
            }
            SAME(sum[0].weight, sum[1].weight, n, "weights");
            SAME(sum[0].count, sum[1].count, n, "counts");
            guard_free_all();
        }
    }
}

static void roots_are_precise(void **state SST_UNUSED)
{
    for (double v = 1e-4; v < 200; v *= 1.0007)
        assert_true(fabs((double)sst_root_inverse((float)v) * sqrt((double)(float)v) - 1) < 5e-6);
}

/* Rows of two views, the second one half of the first and noise: correlations of running sums equal sums in double. */
static void correlations_are_right(void **state SST_UNUSED)
{
    enum { SIDE = 24, WINDOWS = SIDE - SST_WINDOW + 1 };
    static int16_t view[2][SIDE][SIDE], zero[SIDE];
    int32_t sum[2][2][SIDE] = { { { 0 } } }, products[SIDE] = { 0 };

    for (int i = 0; i < SIDE * SIDE; i++) {
        int16_t *a = &view[0][i / SIDE][i % SIDE];

        *a = (int16_t)(below(2000) - 1500);
        view[1][i / SIDE][i % SIDE] = (int16_t)(*a / 2 + below(500));
    }
    for (int y = 0; y < SIDE; y++) {
        float mean[2][WINDOWS], inverse[2][WINDOWS], best[WINDOWS] = { 0 };
        const struct sst_window_row row = { .mean = mean[0],
                                            .inverse = inverse[0],
                                            .other_mean = { mean[1] },
                                            .other_inverse = { inverse[1] },
                                            .products = { products },
                                            .others = 1,
                                            .floor = 0.01f };
        const int16_t *rows[2][2];

        for (int k = 0; k < 2; k++) {
            const struct sst_window_sums in = { sum[k][0], sum[k][1], { NULL, NULL }, 0.01f };

            rows[k][0] = view[k][y];
            rows[k][1] = y < SST_WINDOW ? zero : view[k][y - SST_WINDOW];
            sst_window_squares_ref(sum[k][0], sum[k][1], rows[k], SIDE);
            sst_window_stats_ref(mean[k], inverse[k], &in, WINDOWS);
        }
        sst_window_products_ref(products, rows[0], rows[1], SIDE);
        sst_window_best_ref(best, &row, WINDOWS);
        for (int x = 0; x < WINDOWS && y >= SST_WINDOW - 1; x++) {
            double m[2] = { 0, 0 }, v[2] = { 0, 0 }, both = 0, want;

            for (int i = 0; i < SST_WINDOW_AREA; i++) {
                const double a = view[0][y - i / SST_WINDOW][x + i % SST_WINDOW] / (double)SST_LEVEL_ONE;
                const double b = view[1][y - i / SST_WINDOW][x + i % SST_WINDOW] / (double)SST_LEVEL_ONE;

                m[0] += a / SST_WINDOW_AREA;
                m[1] += b / SST_WINDOW_AREA;
                v[0] += a * a / SST_WINDOW_AREA;
                v[1] += b * b / SST_WINDOW_AREA;
                both += a * b / SST_WINDOW_AREA;
            }
            want = (both - m[0] * m[1] + 0.01 * fmax(0, 1 - fabs(m[0] - m[1]))) /
                   sqrt((v[0] - m[0] * m[0] + 0.01) * (v[1] - m[1] * m[1] + 0.01));
            assert_true(want > 0.3 && fabs(2 * (double)best[x] - want) < 1e-4); /* half: one other view */
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_equal_the_reference),
        cmocka_unit_test(column_sums_equal_the_reference),
        cmocka_unit_test(statistics_equal_the_reference),
        cmocka_unit_test(correlations_equal_the_reference),
        cmocka_unit_test(agreement_equals_the_reference),
        cmocka_unit_test(weighted_sums_equal_the_reference),
        cmocka_unit_test(roots_are_precise),
        cmocka_unit_test(correlations_are_right),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
