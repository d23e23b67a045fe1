/* Resampling of posed views and products of descriptors: every level against the reference, byte for byte, pictures ending at an unmapped page; the
 * reference against interpolation in double. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

#define WIDTH    61
#define HEIGHT   23
#define N        300
#define SEGMENTS 9

static uint64_t seed = 5;

static int32_t below(int32_t n)
{
    return (int32_t)(sst_random_u64(&seed) % (uint64_t)n);
}

/* Ends of every segment are inside; corners of the picture first. */
static void random_segments(struct sst_warped_segment *s)
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
        s[i] = (struct sst_warped_segment){ from[0], from[1], step[0], step[1], at, lengths[i] };
        at += lengths[i] + below(5);
    }
    assert_true(at <= N);
}

static void warped_row_equals_reference(void **state SST_UNUSED)
{
    const uint16_t *const plane[3] = { guard_random(2 * WIDTH * HEIGHT, &seed), guard_random(2 * WIDTH * HEIGHT, &seed),
                                       guard_random(2 * WIDTH * HEIGHT, &seed) };

    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k)) {
            print_message("not run: %s\n", sst_cpu_level_name((enum sst_cpu_level)level));
            continue;
        }
        for (int round = 0; round < 200; round++) {
            const struct sst_warped_source from = {
                { plane[0], plane[1], plane[2] }, WIDTH, WIDTH, HEIGHT, round % 2 ? 3 : 1
            };
            static uint32_t want[3][N], got[3][N];
            static uint16_t count[2][N];
            struct sst_warped_segment segment[SEGMENTS];

            for (int i = 0; i < 3 * N; i++)
                want[i / N][i % N] = got[i / N][i % N] = (uint32_t)below(1 << 30);
            memset(count, 3, sizeof(count));
            random_segments(segment);
            sst_warped_row_ref((uint32_t *const[3]){ want[0], want[1], want[2] }, count[0], &from, segment, SEGMENTS);
            k.warped_row((uint32_t *const[3]){ got[0], got[1], got[2] }, count[1], &from, segment, SEGMENTS);
            assert_memory_equal(count[0], count[1], sizeof(count[0]));
            for (int i = 0; i < 3 * N; i++) {
                if (want[i / N][i % N] != got[i / N][i % N])
                    fail_msg("level %s, round %d, channel %d, pixel %d: %u, not %u",
                             sst_cpu_level_name((enum sst_cpu_level)level), round, i / N, i % N, got[i / N][i % N],
                             want[i / N][i % N]);
            }
        }
    }
    guard_free_all();
}

static void feature_products_equal_reference(void **state SST_UNUSED)
{
    enum { A = 5, B = 11 };
    static const size_t sizes[][2] = { { 1, 1 }, { 2, 4 }, { 2, 3 }, { 3, 4 }, { 4, 9 }, { A, B } };
    int16_t *const a = guard_random(A * SST_FEATURE_PARTS * sizeof(*a), &seed);
    int16_t *const b = guard_random(B * SST_FEATURE_PARTS * sizeof(*b), &seed);

    for (int i = 0; i < A * SST_FEATURE_PARTS; i++)
        a[i] = (int16_t)(i < SST_FEATURE_PARTS ? 512 : below(1025) - 512);
    for (int i = 0; i < B * SST_FEATURE_PARTS; i++)
        b[i] = (int16_t)(i < SST_FEATURE_PARTS ? -512 : below(1025) - 512);
    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        for (size_t i = 0; sst_kernels_at((enum sst_cpu_level)level, &k) && i < ARRAY_LEN(sizes); i++) {
            const size_t count = sizes[i][0], n = sizes[i][1];
            int32_t want[A * B], got[A * B];
            const int16_t *from[2] = { a + (A - count) * SST_FEATURE_PARTS, b + (B - n) * SST_FEATURE_PARTS };

            sst_feature_products_ref(want, from[0], count, from[1], n);
            k.feature_products(got, from[0], count, from[1], n);
            assert_memory_equal(got, want, count * n * sizeof(*want));
            k.feature_products(got, a, 1, b, 1);
            assert_int_equal(got[0], -512 * 512 * SST_FEATURE_PARTS);
        }
    }
    guard_free_all();
}

/* The largest sums: 1024 views of white stay below 2^32, and a place at the last sample gives exactly its level. */
static void sums_have_room(void **state SST_UNUSED)
{
    const uint16_t level[4] = { 7, 65535, 65535, 65535 };
    const struct sst_warped_source from = { { level }, 2, 2, 2, 1 };
    const struct sst_warped_segment segment = { 65536, 65536, 0, 0, 0, 1 };
    uint32_t sum = 0;
    uint16_t count = 0;

    for (int i = 0; i < 1024; i++)
        sst_warped_row_ref(&(uint32_t *const){ &sum }, &count, &from, &segment, 1);
    assert_int_equal(count, 1024);
    assert_true(sum == 1024u * 65535 * 64);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(warped_row_equals_reference),
        cmocka_unit_test(sums_have_room),
        cmocka_unit_test(feature_products_equal_reference),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
