/* Kernels of colour agreement and of map enlargement: every level against the reference, byte for byte, and the
 * references against hand-worked values. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define RAYS   36
#define STRIDE 128

static uint64_t seed = 1;

/* Exactly n bytes from the heap: the sanitizers detect reads beyond. */
static void *random_bytes(size_t n)
{
    uint8_t *data = malloc(n);

    assert_non_null(data);
    for (size_t i = 0; i < n; i++)
        data[i] = (uint8_t)sst_random_u64(&seed);
    return data;
}

static void for_levels(void (*check)(const struct sst_kernels *k, size_t n))
{
    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k)) {
            print_message("not run: %s\n", sst_cpu_level_name((enum sst_cpu_level)level));
            continue;
        }
        for (size_t n = 1; n <= 129; n++)
            check(&k, n);
        check(&k, SST_BLEND_MAX);
    }
}

static void check_votes(const struct sst_kernels *k, size_t n)
{
    uint8_t *c[3] = { random_bytes(n), random_bytes(n), random_bytes(n) }, *rarity = random_bytes(SST_AGREE_BINS);
    uint8_t *want = random_bytes(n), *got = random_bytes(n);
    const struct sst_voting v = { rarity, 0.5f, 0.3f, (float)(1 + n % 255) };
    float *weight = random_bytes(n * sizeof(float));

    for (size_t x = 0; x < n; x++)
        weight[x] = sst_random_u64(&seed) % 5 ? (float)(sst_random_u64(&seed) % 1000) / 1000 : -1;
    sst_agree_votes_ref(want, (const uint8_t *const *)c, weight, &v, n);
    k->agree_votes(got, (const uint8_t *const *)c, weight, &v, n);
    assert_memory_equal(got, want, n);
    for (int i = 0; i < 3; i++)
        free(c[i]);
    free(rarity);
    free(want);
    free(got);
    free(weight);
}

static void check_near(const struct sst_kernels *k, size_t n)
{
    uint8_t *c[6], *vote = random_bytes(n);
    uint16_t *want = random_bytes(2 * n), *got = random_bytes(2 * n);

    for (int i = 0; i < 6; i++)
        c[i] = random_bytes(n);
    for (size_t x = 0; x < n; x++) {
        for (int i = 0; i < 3 && x % 3; i++)
            c[i][x] = (uint8_t)(c[3 + i][x] + sst_random_u64(&seed) % 40);
    }
    sst_agree_near_ref(want, (const uint8_t *const *)c, (const uint8_t *const *)c + 3, vote, n);
    k->agree_near(got, (const uint8_t *const *)c, (const uint8_t *const *)c + 3, vote, n);
    assert_memory_equal(got, want, 2 * n);
    for (int i = 0; i < 6; i++)
        free(c[i]);
    free(vote);
    free(want);
    free(got);
}

static void check_sum(const struct sst_kernels *k, size_t n)
{
    uint16_t *near[3] = { random_bytes(2 * n + 4), random_bytes(2 * n + 4), random_bytes(2 * n + 4) };
    uint8_t *c[3] = { random_bytes(n), random_bytes(n), random_bytes(n) }, *vote = random_bytes(n);
    float *want[4], *got[4];

    for (int i = 0; i < 4; i++) {
        want[i] = calloc(n, sizeof(float));
        got[i] = calloc(n, sizeof(float));
        assert_true(want[i] && got[i]);
    }
    for (size_t x = 0; x < n; x++)
        vote[x] = x % 4 ? vote[x] : 0;
    for (int twice = 0; twice < 2; twice++) {
        sst_agree_sum_ref(want, (const uint16_t *const *)near, (const uint8_t *const *)c, vote, n);
        k->agree_sum(got, (const uint16_t *const *)near, (const uint8_t *const *)c, vote, n);
    }
    for (int i = 0; i < 4; i++) {
        assert_memory_equal(got[i], want[i], n * sizeof(float));
        free(want[i]);
        free(got[i]);
    }
    for (int i = 0; i < 3; i++) {
        free(near[i]);
        free(c[i]);
    }
    free(vote);
}

/* n rays. */
static void check_mode(const struct sst_kernels *k, size_t n)
{
    const size_t rays = n % RAYS + 1, step = 1 + n % 2;
    const unsigned most = 65535 / (SST_AGREE_MODE / 2) / (unsigned)rays;
    uint8_t *colour = random_bytes(rays * 3 * STRIDE), *vote = random_bytes(rays * STRIDE);
    uint8_t *want[3], *got[3];

    for (size_t i = 0; i < rays * 3 * STRIDE; i++)
        colour[i] = (uint8_t)(colour[i] % (16 + n));
    for (size_t i = 0; i < rays * STRIDE; i++)
        vote[i] = (uint8_t)(i % 7 ? vote[i] % (sst_min_int((int)most, 255) + 1) : 0);
    memset(vote, 0, 1);
    for (int c = 0; c < 3; c++) {
        want[c] = random_bytes(STRIDE);
        got[c] = random_bytes(STRIDE);
    }
    sst_agree_mode_ref(want, colour, vote, rays, step, STRIDE);
    k->agree_mode(got, colour, vote, rays, step, STRIDE);
    for (int c = 0; c < 3; c++) {
        assert_memory_equal(got[c], want[c], STRIDE);
        free(want[c]);
        free(got[c]);
    }
    free(colour);
    free(vote);
}

static void check_enlarge(const struct sst_kernels *k, size_t n)
{
    uint16_t *disp[2], *green4[2], *d[2] = { random_bytes(4 * n), random_bytes(4 * n) };
    uint8_t *label[2], *green = random_bytes(2 * n), *l[2] = { random_bytes(2 * n), random_bytes(2 * n) };
    struct sst_enlarge e = { .green = green, .step_q6 = 64 };

    for (int row = 0; row < 2; row++) {
        disp[row] = random_bytes(2 * (n + 2));
        green4[row] = random_bytes(2 * (n + 2));
        label[row] = random_bytes(n + 2);
        for (size_t x = 0; x < n + 2; x++) {
            disp[row][x] = (uint16_t)(x % 11 ? disp[row][x] % 200 : 0xFFFF);
            green4[row][x] %= 1021;
            label[row][x] %= 3;
        }
        e.disp[row] = disp[row] + 1;
        e.green4[row] = green4[row] + 1;
        e.label[row] = label[row] + 1;
    }
    sst_enlarge_row_ref(d[0], l[0], &e, n);
    k->enlarge_row(d[1], l[1], &e, n);
    assert_memory_equal(d[0], d[1], 4 * n);
    assert_memory_equal(l[0], l[1], 2 * n);
    for (int i = 0; i < 2; i++) {
        free(disp[i]);
        free(green4[i]);
        free(label[i]);
        free(d[i]);
        free(l[i]);
    }
    free(green);
}

static void kernels_equal_their_references(void **state SST_UNUSED)
{
    for_levels(check_votes);
    for_levels(check_near);
    for_levels(check_sum);
    for_levels(check_mode);
    for_levels(check_enlarge);
}

/* Four rays: two of 100,100,100 and 104,100,100 with 2 votes each, one of 200,0,0 with 9, one missing. Votes for the
 * first: 24 * 2 + 22 * 2 = 92; for the third: 24 * 9 = 216; without it the first wins over its equal. */
static void the_colour_with_most_votes_wins(void **state SST_UNUSED)
{
    static const uint8_t seen[4][4] = { { 100, 100, 100, 2 }, { 104, 100, 100, 2 }, { 200, 0, 0, 9 }, { 1, 1, 1, 0 } };
    uint8_t colour[4 * 3 * 64] = { 0 }, vote[4 * 64] = { 0 }, r[64], g[64], b[64], *const mode[3] = { r, g, b };
    const uint8_t *const one[3] = { colour + 3 * 64, colour + 4 * 64, colour + 5 * 64 };
    uint16_t near[64];

    for (size_t k = 0; k < 4; k++) {
        for (size_t c = 0; c < 3; c++)
            colour[(3 * k + c) * 64] = seen[k][c];
        vote[k * 64] = seen[k][3];
    }
    sst_agree_mode_ref(mode, colour, vote, 4, 1, 64);
    assert_true(r[0] == 200 && g[0] == 0 && b[0] == 0);
    assert_true(r[1] == 0 && g[1] == 0); /* no ray */
    vote[2 * 64] = 3;                    /* 72 */
    sst_agree_mode_ref(mode, colour, vote, 4, 1, 64);
    assert_true(r[0] == 100 && g[0] == 100 && b[0] == 100);
    sst_agree_near_ref(near, one, (const uint8_t *const *)mode, vote + 64, 64);
    assert_int_equal(near[0], (SST_AGREE_NEAR - 4) * 2);
}

/* A pixel of green 50 in a cell of mean 10; beside it, of another surface, one of mean 40; below one of mean 50 that is
 * of the same surface, and diagonally one of mean 45 of another label. */
static void a_pixel_takes_the_cell_that_it_is_like(void **state SST_UNUSED)
{
    const uint16_t disp[2][3] = { { 0, 100, 500 }, { 0, 100, 100 } },
                   green4[2][3] = { { 0, 40, 160 }, { 0, 200, 180 } };
    const uint8_t label[2][3] = { { 1, 1, 1 }, { 1, 1, 2 } }, green[2] = { 10, 50 };
    const struct sst_enlarge e = {
        { disp[0] + 1, disp[1] + 1 }, { green4[0] + 1, green4[1] + 1 }, { label[0] + 1, label[1] + 1 }, green, 64
    };
    uint16_t d[2];
    uint8_t l[2];

    sst_enlarge_row_ref(d, l, &e, 1);
    assert_true(d[0] == 100 && l[0] == 1);
    assert_true(d[1] == 100 && l[1] == 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kernels_equal_their_references),
        cmocka_unit_test(the_colour_with_most_votes_wins),
        cmocka_unit_test(a_pixel_takes_the_cell_that_it_is_like),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
