/* Every kernel of the disparity stage, at every level this CPU has, against its plain reference. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

static uint64_t seed = 0x9E3779B97F4A7C15ull;

static void *random_bytes(size_t n)
{
    uint8_t *p = sst_mem_alloc(n, 1);

    assert_non_null(p);
    for (size_t i = 0; i < n; i++)
        p[i] = (uint8_t)sst_random_u64(&seed);
    return p;
}

static void *copy_of(const void *from, size_t n)
{
    void *p = sst_mem_alloc(n, 1);

    assert_non_null(p);
    memcpy(p, from, n);
    return p;
}

static void same(const void *got, const void *want, size_t n, const char *what, int level, size_t size)
{
    if (memcmp(got, want, n))
        fail_msg("%s at %s differs from its reference, n=%zu", what, sst_cpu_level_name((enum sst_cpu_level)level),
                 size);
}

#define FOR_EACH_LEVEL(k, level)                                                                                       \
    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++)                                                    \
        if (sst_kernels_at((enum sst_cpu_level)level, &(k)))

static void census_and_hamming(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (size_t n = 1; n < 150; n++) {
        uint8_t *base = random_bytes(7 * 256);
        const uint8_t *rows[7];
        uint64_t want[160], got[160];
        uint8_t cost_want[160], cost_got[160];

        for (size_t j = 0; j < 7; j++)
            rows[j] = base + j * 256 + 8;
        sst_census_row_ref(want, rows, n);
        sst_hamming_row_ref(cost_want, want, want + n / 2, n - n / 2);
        FOR_EACH_LEVEL(k, level)
        {
            k.census_row(got, rows, n);
            same(got, want, n * sizeof(*want), "census_row", level, n);
            k.hamming_row(cost_got, want, want + n / 2, n - n / 2);
            same(cost_got, cost_want, n - n / 2, "hamming_row", level, n);
        }
        sst_mem_free(base);
    }
}

static void hamming_by_steps(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (size_t n = 1; n < 60; n++) {
        for (size_t nd = 32; nd <= 160; nd += 32) {
            uint8_t *want = sst_mem_alloc(n, nd), *got = sst_mem_alloc(n, nd);
            uint64_t *bits = (uint64_t *)random_bytes((2 * n + nd) * sizeof(uint64_t));

            for (size_t i = 0; i < 2 * n + nd; i++)
                bits[i] >>= 2;
            sst_hamming_steps_row_ref(want, bits, bits + n + nd - 1, n, nd);
            FOR_EACH_LEVEL(k, level)
            {
                k.hamming_steps_row(got, bits, bits + n + nd - 1, n, nd);
                same(got, want, n * nd, "hamming_steps_row", level, n);
            }
            sst_mem_free(bits);
            sst_mem_free(want);
            sst_mem_free(got);
        }
    }
}

/* One centre of 10 with the row above darker: the three bits of rows 0-2 are set, all others are not. */
static void census_of_known_pixels(void **state SST_UNUSED)
{
    uint8_t dark[16], bright[16];
    const uint8_t *rows[7] = { dark + 4, dark + 4, dark + 4, bright + 4, bright + 4, bright + 4, bright + 4 };
    uint64_t out;

    memset(dark, 9, sizeof(dark));
    memset(bright, 10, sizeof(bright));
    sst_census_row_ref(&out, rows, 1);
    assert_true(out == ((1ull << 27) - 1) << 35);
}

enum { GROUPS = SST_FEATURE_CHANNELS / 4 };

/* Vectors of about unit length, whose costs fill the range; every fourth position has arbitrary bytes. */
static void feature_costs(void **state SST_UNUSED)
{
    static const size_t sizes[] = { 16, 48, 64, 144 }, counts[] = { 1, 2, 3, 4, 5, 8, 17 };
    struct sst_kernels k;

    for (size_t i = 0; i < ARRAY_LEN(sizes) * ARRAY_LEN(counts); i++) {
        const size_t n = sizes[i % ARRAY_LEN(sizes)], count = counts[i / ARRAY_LEN(sizes)], stride = 4 * n + 12;
        const size_t bytes = (GROUPS - 1) * stride + 4 * n, out = (count - 1) * (n + 5) + n;
        uint8_t *a = guard_random(bytes, &seed), *want = guard_random(out, &seed), *got = guard_random(out, &seed),
                *rows[17];
        const uint8_t *b[17];

        for (size_t at = 0; at < bytes; at++)
            a[at] = (uint8_t)(SST_FEATURE_ZERO + a[at] % 48 - 24); /* of about unit length */
        for (size_t j = 0; j < count; j++) {
            b[j] = rows[j] = guard_random(bytes, &seed);
            for (size_t at = 0; at < bytes && j % 4 != 3; at++)
                rows[j][at] = (uint8_t)(a[at] + rows[j][at] % (8 * j + 1));
        }
        memcpy(want, got, out);
        sst_feature_cost_rows_ref(want, n + 5, a, b, count, stride, n);
        FOR_EACH_LEVEL(k, level)
        {
            k.feature_cost_rows(got, n + 5, a, b, count, stride, n);
            same(got, want, out, "feature_cost_rows", level, n);
        }
        guard_free_all();
    }
}

/* Unit vectors: equal ones cost 0, orthogonal and opposite ones the maximum; one of half the length costs (127 * 127 -
 * 127 * 64) >> 6 = 125. */
static void feature_costs_of_known_vectors(void **state SST_UNUSED)
{
    uint8_t a[GROUPS * 4], half[GROUPS * 4], orthogonal[GROUPS * 4], opposite[GROUPS * 4], cost[4];
    const uint8_t *b[4] = { a, half, orthogonal, opposite };

    memset(a, SST_FEATURE_ZERO, sizeof(a));
    memset(half, SST_FEATURE_ZERO, sizeof(a));
    memset(orthogonal, SST_FEATURE_ZERO, sizeof(a));
    memset(opposite, SST_FEATURE_ZERO, sizeof(a));
    a[62] = SST_FEATURE_ZERO + 127;
    half[62] = SST_FEATURE_ZERO + 64;
    orthogonal[1] = SST_FEATURE_ZERO + 127;
    opposite[62] = SST_FEATURE_ZERO - 127;
    sst_feature_cost_rows_ref(cost, 1, a, b, 4, 4, 1);
    assert_int_equal(cost[0], 0);
    assert_int_equal(cost[1], 125);
    assert_int_equal(cost[2], SST_FEATURE_COST_MAX);
    assert_int_equal(cost[3], SST_FEATURE_COST_MAX);
}

static void cheapest(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (size_t n = 1; n < 150; n++) {
        uint8_t *first = guard_random(n, &seed), *second = guard_random(n, &seed), *a = guard_random(n, &seed),
                *b = guard_random(n, &seed);
        uint8_t want[2][150], got[2][150];

        for (size_t x = 0; x < n; x++) {
            second[x] = first[x] > second[x] ? first[x] : second[x];
            a[x] = x % 7 ? a[x] : 255;
            b[x] = x % 7 ? b[x] : 255;
        }
        memcpy(want[0], first, n);
        memcpy(want[1], second, n);
        sst_cheapest_row_ref(want[0], want[1], a, b, n);
        FOR_EACH_LEVEL(k, level)
        {
            memcpy(got[0], first, n);
            memcpy(got[1], second, n);
            k.cheapest_row(got[0], got[1], a, b, n);
            same(got[0], want[0], n, "cheapest_row first", level, n);
            same(got[1], want[1], n, "cheapest_row second", level, n);
        }
        for (int two = 0; two < 2; two++) {
            memcpy(want[0], first, n);
            sst_cheapest_mean_row_ref(want[0], second, two, n);
            FOR_EACH_LEVEL(k, level)
            {
                memcpy(got[0], first, n);
                k.cheapest_mean_row(got[0], second, two, n);
                same(got[0], want[0], n, "cheapest_mean_row", level, n);
            }
        }
        guard_free_all();
    }
}

/* Every pair of costs, 256 at a time. */
/* Of 0 to 12 neighbours, whose censuses have a few bits other than the own one, so that many costs are equal. */
static void cheapest_of_neighbours(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (size_t n = 1; n < 200; n += n < 140 ? 1 : 29) {
        uint64_t *a = random_bytes(n * sizeof(*a)), *other[12];
        uint8_t want[2][200], got[2][200];

        for (int i = 0; i < 12; i++) {
            other[i] = random_bytes(n * sizeof(*a));
            for (size_t x = 0; x < n; x++)
                other[i][x] = i % 4 ? a[x] ^ (other[i][x] & 0x1F) : other[i][x] >> 2 ^ (a[x] & ~(UINT64_MAX >> 2));
        }
        for (int count = 0; count <= 12; count++) {
            sst_cheapest_hamming_row_ref(want[0], want[1], a, (const uint64_t *const *)other, count, n);
            FOR_EACH_LEVEL(k, level)
            {
                k.cheapest_hamming_row(got[0], got[1], a, (const uint64_t *const *)other, count, n);
                same(got[0], want[0], n, "cheapest_hamming_row, first", level, n);
                same(got[1], want[1], n, "cheapest_hamming_row, second", level, n);
            }
        }
        for (int i = 0; i < 12; i++)
            sst_mem_free(other[i]);
        sst_mem_free(a);
    }
}

static void cheapest_of_known_neighbours(void **state SST_UNUSED)
{
    const uint64_t own = 0, far = UINT64_MAX >> 2, near = 3, same_bits = 0;
    const uint64_t *const other[] = { &far, &near, &same_bits };
    uint8_t first, second;

    sst_cheapest_hamming_row_ref(&first, &second, &own, other, 0, 1);
    assert_int_equal(first, SST_COST_ABSENT);
    assert_int_equal(second, SST_COST_ABSENT);
    sst_cheapest_hamming_row_ref(&first, &second, &own, other, 1, 1);
    assert_int_equal(first, 248);
    assert_int_equal(second, SST_COST_ABSENT);
    sst_cheapest_hamming_row_ref(&first, &second, &own, other, 3, 1);
    assert_int_equal(first, 0);
    assert_int_equal(second, 8);
}

static void cheapest_means(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (int a = 0; a < 2 * 256; a++) {
        uint8_t first[256], second[256], want[256];

        for (int b = 0; b < 256; b++)
            second[b] = (uint8_t)b;
        memset(want, a / 2, sizeof(want));
        sst_cheapest_mean_row_ref(want, second, a % 2, 256);
        FOR_EACH_LEVEL(k, level)
        {
            memset(first, a / 2, sizeof(first));
            k.cheapest_mean_row(first, second, a % 2, 256);
            same(first, want, 256, "cheapest_mean_row", level, (size_t)a);
        }
    }
}

/* Means 3 (of 2 and 3, rounded up), 5, 254 (of 255 twice: never the value for unseen) and 7 (equal to both). */
static void cheapest_of_known_costs(void **state SST_UNUSED)
{
    const uint8_t a[4] = { 2, 5, 255, 7 }, b[4] = { 3, 5, 255, 7 };
    const uint8_t want_first[4] = { 3, 4, 254, 7 }, want_second[4] = { 4, 5, 255, 7 };
    uint8_t first[4] = { 4, 4, 255, 7 }, second[4] = { 9, 6, 255, 7 };

    sst_cheapest_row_ref(first, second, a, b, 4);
    assert_memory_equal(first, want_first, 4);
    assert_memory_equal(second, want_second, 4);
}

static void transpose(void **state SST_UNUSED)
{
    struct sst_kernels k;
    uint8_t *in = random_bytes(64 * 96), want[64 * 96], got[64 * 96];

    sst_transpose_u8_ref(want, 64, in, 96, 96, 64);
    FOR_EACH_LEVEL(k, level)
    {
        k.transpose_u8(got, 64, in, 96, 96, 64);
        same(got, want, sizeof(want), "transpose_u8", level, 96);
    }
    sst_mem_free(in);
}

static void support(void **state SST_UNUSED)
{
    enum { N = 37, ND = 32 };
    struct sst_kernels k;
    uint8_t *cost = random_bytes(N * ND), left[N], right[N], up[N], down[N];
    uint16_t *sums = random_bytes(5 * N * ND * 2), prefix[(N + 1) * ND], want[N * ND], got[N * ND], count[N];
    const uint16_t *rows[5];

    for (int x = 0; x < N; x++) {
        left[x] = (uint8_t)(x < 7 ? x : (int)(sst_random_u64(&seed) % 8));
        right[x] = (uint8_t)(N - 1 - x < 7 ? N - 1 - x : (int)(sst_random_u64(&seed) % 8));
        up[x] = (uint8_t)(sst_random_u64(&seed) % 2);
        down[x] = (uint8_t)(sst_random_u64(&seed) % 3);
        count[x] = (uint16_t)(1 + sst_random_u64(&seed) % 225);
    }
    for (int j = 0; j < 5; j++)
        rows[j] = sums + j * N * ND;
    sst_support_sum_row_ref(want, sums, prefix, cost, left, right, N, ND);
    FOR_EACH_LEVEL(k, level)
    {
        k.support_sum_row(got, sums, prefix, cost, left, right, N, ND);
        same(got, want, sizeof(want), "support_sum_row", level, N);
    }
    {
        uint8_t *mean_want = copy_of(cost, N * ND), *mean_got = copy_of(cost, N * ND);

        sst_support_mean_row_ref(mean_want, rows + 2, up, down, count, N, ND);
        FOR_EACH_LEVEL(k, level)
        {
            memcpy(mean_got, cost, N * ND);
            k.support_mean_row(mean_got, rows + 2, up, down, count, N, ND);
            same(mean_got, mean_want, N * ND, "support_mean_row", level, N);
        }
        sst_mem_free(mean_want);
        sst_mem_free(mean_got);
    }
    sst_mem_free(cost);
    sst_mem_free(sums);
}

static void sgm_of(size_t steps)
{
    enum { ROWS = SST_SGM_ROWS + 2, N = 23 };
    const size_t entry = steps + 2 * SST_SGM_PAD, cells = (N + 1) * steps;
    const uint16_t p1[2] = { 10, 5 }, p2[2] = { 3000, 60 };
    struct sst_kernels k;
    uint8_t *cost = random_bytes(ROWS * cells), penalty[ROWS * N];
    uint16_t *start = random_bytes(ROWS * cells * 2);
    uint16_t *want = copy_of(start, ROWS * cells * 2), *got = copy_of(start, ROWS * cells * 2);
    uint16_t *prev = sst_mem_alloc(ROWS * (N + 2) * entry, 2), *cur = sst_mem_alloc((N + 2) * entry, 2);
    uint16_t *line = sst_mem_alloc(ROWS * (N + 2) * entry, 2);

    for (size_t i = 0; i < sizeof(penalty); i++)
        penalty[i] = (uint8_t)(sst_random_u64(&seed) % 2);
    sst_sgm_along_rows_ref(prev, want, cost, cells, penalty, N, p1, p2, 1, 1, ROWS, N, steps);
    sst_sgm_across_row_ref(cur, prev, want, cost, penalty, p1, p2, 1, 0, N, steps);
    sst_sgm_along_rows_ref(line, want, cost, cells, penalty, N, p1, p2, -1, 0, ROWS, N, steps);
    FOR_EACH_LEVEL(k, level)
    {
        uint16_t *prev_got = sst_mem_alloc(ROWS * (N + 2) * entry, 2);

        memcpy(got, start, ROWS * cells * 2);
        k.sgm_along_rows(prev_got, got, cost, cells, penalty, N, p1, p2, 1, 1, ROWS, N, steps);
        for (size_t r = 0; r < ROWS; r++) {
            const size_t last = (r * (N + 2) + N) * entry + SST_SGM_PAD - 2;

            same(prev_got + last, prev + last, (steps + 3) * 2, "sgm's last entry", level, N);
        }
        k.sgm_across_row(cur, prev, got, cost, penalty, p1, p2, 1, 0, N, steps);
        k.sgm_along_rows(line, got, cost, cells, penalty, N, p1, p2, -1, 0, ROWS, N, steps);
        same(got, want, ROWS * cells * 2, "sgm rows", level, N);
        sst_mem_free(prev_got);
    }
    sst_mem_free(cost);
    sst_mem_free(start);
    sst_mem_free(want);
    sst_mem_free(got);
    sst_mem_free(prev);
    sst_mem_free(cur);
    sst_mem_free(line);
}

/* One register, two, and more. */
static void sgm(void **state SST_UNUSED)
{
    for (size_t steps = 32; steps <= 96; steps += 32)
        sgm_of(steps);
}

/* Two pixels, costs {0, 9, 9} then {9, 9, 0}, P1 = 2, P2 = 5, left to right: L of the second pixel is
 * C + min(P[d], P[d-1] + 2, P[d+1] + 2, 0 + 5) - 0 = 9 + 0, 9 + min(9, 2, 11, 5) = 11, 0 + min(9, 11, 5) = 5. */
static void sgm_of_known_pixels(void **state SST_UNUSED)
{
    enum { ND = 3, ENTRY = ND + 2 * SST_SGM_PAD };
    const uint8_t cost[6] = { 0, 9, 9, 9, 9, 0 }, penalty[2] = { 0, 0 };
    const uint16_t p1 = 2, p2 = 5;
    const uint16_t want[6] = { 0, 9, 9, 9, 11, 5 };
    uint16_t sum[6], line[4 * ENTRY] = { 0 };

    sst_sgm_along_rows_ref(line, sum, cost, 2 * ND, penalty, 2, &p1, &p2, 1, 1, 1, 2, ND);
    assert_memory_equal(sum, want, sizeof(want));
}

static void winner_other(void **state SST_UNUSED)
{
    struct sst_kernels k;
    static const size_t counts[] = { 1, 2, 15, 16, 31, 32, 33, 64, 100, 128 };
    uint16_t *sum = random_bytes(50 * 128 * 2);
    uint32_t want[50 + 128], got[50 + 128];

    for (size_t i = 0; i < 50 * 128; i++)
        sum[i] = (uint16_t)(sum[i] % 512); /* ties */
    for (size_t i = 0; i < ARRAY_LEN(counts); i++) {
        memset(want, 0xFF, sizeof(want));
        sst_winner_other_row_ref(want, sum, 128, 50, counts[i]);
        FOR_EACH_LEVEL(k, level)
        {
            memset(got, 0xFF, sizeof(got));
            k.winner_other_row(got, sum, 128, 50, counts[i]);
            same(got, want, sizeof(got), "winner_other_row", level, counts[i]);
        }
    }
    sst_mem_free(sum);
}

static void winner_and_median(void **state SST_UNUSED)
{
    struct sst_kernels k;
    static const size_t counts[] = { 1, 2, 3, 5, 31, 32, 33, 100 };
    uint16_t *sum = random_bytes(50 * 128 * 2), want[128], got[128], want2[64], got2[64];

    for (size_t i = 0; i < 50 * 128; i++)
        sum[i] = (uint16_t)(i < 128 ? 65535 : sum[i] % 512); /* ties */
    for (size_t i = 0; i < ARRAY_LEN(counts); i++) {
        sst_winner_row_ref(want, want2, sum, 128, 50, counts[i]);
        FOR_EACH_LEVEL(k, level)
        {
            k.winner_row(got, got2, sum, 128, 50, counts[i]);
            same(got, want, 100, "winner_row best", level, counts[i]);
            same(got2, want2, 100, "winner_row second", level, counts[i]);
            memset(got, 0xFF, sizeof(got));
            k.winner_row(got, NULL, sum, 128, 50, counts[i]);
            same(got, want, 100, "winner_row, best alone", level, counts[i]);
        }
    }
    for (size_t n = 1; n < 100; n++) {
        const uint16_t *rows[5];

        for (size_t j = 0; j < 5; j++)
            rows[j] = sum + j * 150 + 4;
        sst_median5_row_ref(want, rows, n);
        FOR_EACH_LEVEL(k, level)
        {
            k.median5_row(got, rows, n);
            same(got, want, n * 2, "median5_row", level, n);
        }
    }
    sst_mem_free(sum);
}

static void bilateral(void **state SST_UNUSED)
{
    struct sst_kernels k;
    uint16_t *disp = random_bytes(7 * 150 * 2);
    uint8_t *luma = random_bytes(7 * 150);
    int16_t weight[49];

    for (int i = 0; i < 7 * 150; i++)
        disp[i] = (uint16_t)(i % 31 == 0 ? 65535 : (i % 150 < 60 ? 0 : 1000) + disp[i] % 200);
    for (int i = 0; i < 49; i++)
        weight[i] = (int16_t)(i == 24 ? 4096 : sst_random_u64(&seed) % 600);
    for (size_t n = 1; n < 130; n++) {
        const uint16_t *d[7];
        const uint8_t *l[7];
        uint16_t want[140], got[140];

        for (size_t j = 0; j < 7; j++) {
            d[j] = disp + j * 150 + 4;
            l[j] = luma + j * 150 + 4;
        }
        sst_bilateral_row_ref(want, d, l, weight, 100, n);
        FOR_EACH_LEVEL(k, level)
        {
            k.bilateral_row(got, d, l, weight, 100, n);
            same(got, want, n * 2, "bilateral_row", level, n);
        }
    }
    sst_mem_free(disp);
    sst_mem_free(luma);
}

/* Of blocks that end at unmapped pages, surfaces that differ by 0 to 90 steps. */
static void median_votes(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (size_t n = 1; n < 150; n++) {
        const size_t row = n + 2 * SST_MEDIAN_REACH;
        const uint16_t *d[SST_MEDIAN_SIDE];
        const uint8_t *c[3][SST_MEDIAN_SIDE];
        uint16_t *disp = guard_random(SST_MEDIAN_SIDE * row * 2, &seed);
        uint8_t *colour = guard_random(3 * SST_MEDIAN_SIDE * row, &seed);
        uint32_t want[2][150], got[2][150];

        for (size_t i = 0; i < SST_MEDIAN_SIDE * row; i++)
            disp[i] = (uint16_t)(i % 31 == 0 ? 65535 : disp[i] % 91);
        for (size_t i = 0; i < 3 * SST_MEDIAN_SIDE * row; i++)
            colour[i] = n % 3 ? colour[i] % 64 : colour[i];
        for (size_t j = 0; j < SST_MEDIAN_SIDE; j++) {
            d[j] = disp + j * row + SST_MEDIAN_REACH;
            for (size_t i = 0; i < 3; i++)
                c[i][j] = colour + (i * SST_MEDIAN_SIDE + j) * row + SST_MEDIAN_REACH;
        }
        sst_median_votes_row_ref(want[0], want[1], d, c, n);
        FOR_EACH_LEVEL(k, level)
        {
            k.median_votes_row(got[0], got[1], d, c, n);
            same(got[0], want[0], n * sizeof(**want), "median_votes_row, own", level, n);
            same(got[1], want[1], n * sizeof(**want), "median_votes_row, all", level, n);
        }
        guard_free_all();
    }
}

/* One colour and disparity: all shares count whole. A pixel in front of others of another colour has its own alone. */
static void median_votes_of_known_pixels(void **state SST_UNUSED)
{
    uint16_t disp[SST_MEDIAN_SIDE][SST_MEDIAN_SIDE] = { { 0 } };
    uint8_t level[SST_MEDIAN_SIDE][SST_MEDIAN_SIDE] = { { 0 } };
    const uint16_t *d[SST_MEDIAN_SIDE];
    const uint8_t *c[3][SST_MEDIAN_SIDE];
    uint32_t near, all, shares = 0;

    for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
        d[j] = disp[j] + SST_MEDIAN_REACH;
        c[0][j] = c[1][j] = c[2][j] = level[j] + SST_MEDIAN_REACH;
        for (int i = 0; i < SST_MEDIAN_SIDE; i++)
            shares += sst_median_near[j][i];
    }
    sst_median_votes_row_ref(&near, &all, d, c, 1);
    assert_int_equal(all, shares * 225);
    assert_int_equal(near, all);
    disp[SST_MEDIAN_REACH][SST_MEDIAN_REACH] = SST_MEDIAN_STEP_Q6 + 1;
    sst_median_votes_row_ref(&near, &all, d, c, 1);
    assert_int_equal(all, shares * 225);
    assert_int_equal(near, 16 * 225);
    level[SST_MEDIAN_REACH][SST_MEDIAN_REACH] = SST_MEDIAN_CONTRAST / 3;
    sst_median_votes_row_ref(&near, &all, d, c, 1);
    assert_int_equal(all, 16 * 225);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(census_and_hamming),
        cmocka_unit_test(hamming_by_steps),
        cmocka_unit_test(census_of_known_pixels),
        cmocka_unit_test(feature_costs),
        cmocka_unit_test(feature_costs_of_known_vectors),
        cmocka_unit_test(cheapest),
        cmocka_unit_test(cheapest_of_neighbours),
        cmocka_unit_test(cheapest_of_known_neighbours),
        cmocka_unit_test(cheapest_means),
        cmocka_unit_test(cheapest_of_known_costs),
        cmocka_unit_test(transpose),
        cmocka_unit_test(support),
        cmocka_unit_test(sgm),
        cmocka_unit_test(sgm_of_known_pixels),
        cmocka_unit_test(winner_other),
        cmocka_unit_test(winner_and_median),
        cmocka_unit_test(bilateral),
        cmocka_unit_test(median_votes),
        cmocka_unit_test(median_votes_of_known_pixels),
    };

    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            printf("not run: %s, which this CPU lacks\n", sst_cpu_level_name((enum sst_cpu_level)level));
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
