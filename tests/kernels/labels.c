/* Kernels of the labels: known values of the reference, every level equal to it, buffers ending at an unmapped page. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/log_pos.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

static uint64_t seed = 1;

static float *guarded(size_t n)
{
    return guard_random(n * sizeof(float), &seed);
}

static void logarithms_are_those_of_libm(void **state SST_UNUSED)
{
    assert_true(sst_log_pos(1) == 0);
    for (double x = 1.2e-38; x < 3; x *= 1.003) {
        const float v = (float)x;

        assert_true(fabs((double)sst_log_pos(v) - log((double)v)) < 1e-7 + 1e-7 * fabs(log((double)v)));
    }
    for (float z = -1.0f / 3; z < 1.0f / 3; z += 1e-4f)
        assert_true(fabs((double)sst_atanh2(z) - 2 * atanh((double)z)) <= 3e-7 * fabs(atanh((double)z)));
}

/* One pixel of `count` classes. */
static float entropy_of(const float *p, size_t count, int top)
{
    uint8_t found;
    float h;

    sst_class_row_ref(&found, &h, p, 1, count, 1);
    assert_int_equal(found, top);
    return h;
}

static void entropies_have_known_values(void **state SST_UNUSED)
{
    const float one_hot[] = { 0, 0, 1, 0 }, half[] = { 0.5f, 0.5f }, skew[] = { 0.25f, 0.75f }, single[] = { 1 };
    const float sure[] = { 1, 1e-10f, 0 }; /* only the other class shows that p is not 1 */
    const double e = (double)1e-10f, want = e * (1 - log(e));
    float uniform[23];

    assert_true(entropy_of(one_hot, 4, 2) == 0 && entropy_of(single, 1, 0) == 0);
    assert_true(fabs((double)entropy_of(half, 2, 0) - log(2)) < 2e-7); /* a tie: the smaller class */
    /* -(1/4) log(1/4) - (3/4) log(3/4) */
    assert_true(fabs((double)entropy_of(skew, 2, 1) - 0.56233514461880834) < 2e-7);
    assert_true(fabs((double)entropy_of(sure, 3, 0) / want - 1) < 1e-6);
    for (size_t n = 1; n <= 23; n++) {
        for (size_t i = 0; i < n; i++)
            uniform[i] = 1.0f / (float)n;
        assert_true(fabs((double)entropy_of(uniform, n, 0) - log((double)n)) < 1e-6 + 1e-6 * log((double)n));
    }
}

/* Two colours of cells, 15 + 1: a pixel of the first colour takes w (1 + floor) of 15 cells and w floor of the other.
 */
static void guided_cells_have_known_values(void **state SST_UNUSED)
{
    static const float first[8] = { 1, 2 }, other[8] = { 1, 18 };
    float across[16], out[8];
    const uint8_t dark = 0;
    struct sst_guide g = { .across = across, .pixel = { &dark, &dark, &dark }, .cells = 16, .values = 8 };

    for (int k = 0; k < 16; k++) {
        across[k] = 0.5f;
        g.down[k] = 2;
        g.cell[k] = k == 5 ? other : first;
        g.colour[0][k] = g.colour[1][k] = g.colour[2][k] = k == 5 ? 255 : 0;
    }
    sst_guide_cells_ref(out, &g, 1);
    assert_true(fabs((double)out[0] - (15 * 1.001 + 0.001)) < 1e-5 && out[2] == 0);
    assert_true(fabs((double)out[1] - (15 * 1.001 * 2 + 0.001 * 18)) < 1e-5);
    g.colour[0][5] = SST_GUIDE_SIGMA; /* one deviation away in each channel: exp(-3/2) */
    g.colour[1][5] = g.colour[2][5] = SST_GUIDE_SIGMA;
    sst_guide_cells_ref(out, &g, 1);
    assert_true(fabs((double)out[1] - (15 * 1.001 * 2 + (exp(-1.5) + 0.001) * 18)) < 1e-4);
}

/* Distributions from nearly certain to nearly even. */
static void random_distributions(float *p, size_t count, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float power = (float)(60 * sst_random(&seed) * sst_random(&seed));
        float sum = 0;

        for (size_t c = 0; c < count; c++)
            sum += p[c * n + x] = powf((float)sst_random(&seed), power);
        for (size_t c = 0; c < count && sum > 0; c++)
            p[c * n + x] /= sum;
    }
}

static void check_classes(const struct sst_kernels *k, size_t count, size_t n)
{
    float *p = guarded(count * n), *want = guarded(n), *got = guarded(n);
    uint8_t want_top[SST_CLASS_ROW_MAX], got_top[SST_CLASS_ROW_MAX];

    random_distributions(p, count, n);
    sst_class_row_ref(want_top, want, p, n, count, n);
    k->class_row(got_top, got, p, n, count, n);
    assert_memory_equal(got_top, want_top, n);
    assert_memory_equal(got, want, n * sizeof(*got));
    for (size_t x = 0; x < n; x++) {
        double h = 0;

        for (size_t c = 0; c < count; c++)
            h -= p[c * n + x] > 0 ? (double)p[c * n + x] * log((double)p[c * n + x]) : 0;
        assert_true(fabs((double)got[x] - h) < 1e-6 + 1e-6 * h);
    }
    memset(got_top, 99, sizeof(got_top));
    k->class_row(got_top, NULL, p, n, count, n);
    assert_memory_equal(got_top, want_top, n);
    guard_free_all();
}

static void check_guide(const struct sst_kernels *k, size_t values, size_t n)
{
    float *across = guarded(16 * n), *want = guarded(values * n), *got = guarded(values * n);
    uint8_t *pixels = guard_random(3 * n, &seed);
    struct sst_guide g = { .across = across, .cells = 16, .values = values };

    for (size_t i = 0; i < 3 * n; i++)
        pixels[i] = (uint8_t)(255 * sst_random(&seed));
    for (int c = 0; c < 3; c++)
        g.pixel[c] = pixels + (size_t)c * n;
    for (size_t i = 0; i < 16 * n; i++)
        across[i] = (float)sst_random(&seed);
    for (size_t i = 0; i < 16; i++) {
        float *cell = guarded(values);

        for (size_t v = 0; v < values; v++)
            cell[v] = (float)sst_random(&seed);
        g.cell[i] = cell;
        g.down[i] = (float)sst_random(&seed);
        for (int c = 0; c < 3; c++)
            g.colour[c][i] = (float)(255 * sst_random(&seed));
    }
    sst_guide_cells_ref(want, &g, n);
    k->guide_cells(got, &g, n);
    assert_memory_equal(got, want, values * n * sizeof(*got));
    guard_free_all();
}

static void check_level(const struct sst_kernels *k, size_t count, size_t n)
{
    check_classes(k, count, n);
    check_guide(k, SST_GUIDE_VALUES * (1 + count / SST_GUIDE_VALUES), n);
}

#define SHOWN_W 37
#define SHOWN_H 5

/* Disparity 64 moves by one to the right: whole numbers, a part of 1/2, 2^16 / 64 a step. */
static const struct sst_shown shown_right = { .width = SHOWN_W,
                                              .height = SHOWN_H,
                                              .part = { 32768, 32768 },
                                              .step = { 1024, 0 },
                                              .y = 2,
                                              .same = 64,
                                              .similar = 24 };

static uint64_t ray_of(uint32_t colour, uint8_t label, uint16_t disp, int x)
{
    return colour | (uint64_t)label << SST_RAY_LABEL | (uint64_t)disp << SST_RAY_DISP | (uint64_t)x << SST_RAY_COLUMN;
}

static void shown_surfaces_have_known_places(void **state SST_UNUSED)
{
    const uint64_t own[] = { ray_of(0x102030, 0, 64, 3),  ray_of(0x102030, 0, 128, 3), ray_of(0x102049, 0, 64, 3),
                             ray_of(0x102048, 0, 64, 3),  ray_of(0x102030, 0, 95, 3),  ray_of(0x102030, 0, 96, 2),
                             ray_of(0x102030, 0, 64, 36), ray_of(0x102030, 0, 191, 2) };
    const int32_t want[] = { 2 << 16 | 4, 2 << 16 | 5, -1, 2 << 16 | 4, 2 << 16 | 4, 2 << 16 | 4, -1, -1 };
    uint64_t rays[SHOWN_H * SHOWN_W];
    struct sst_shown s = shown_right;
    uint8_t label[ARRAY_LEN(own)];
    int32_t at[ARRAY_LEN(own)];

    for (int i = 0; i < SHOWN_H * SHOWN_W; i++)
        rays[i] = ray_of(0x102030, (uint8_t)(i / SHOWN_W), 80, 0);
    s.rays = rays;
    sst_shown_row_ref(at, label, &s, own, ARRAY_LEN(own));
    for (size_t i = 0; i < ARRAY_LEN(own); i++) {
        assert_int_equal(at[i], want[i]);
        assert_int_equal(label[i], want[i] < 0 ? 0 : 2);
    }
}

/* Rays that are nearly alike, moved by up to two pixels beyond the borders. */
static void check_shown(const struct sst_kernels *k, size_t n)
{
    uint64_t *rays = guard_random(SHOWN_W * SHOWN_H * sizeof(*rays), &seed);
    uint64_t *own = guard_random(n * sizeof(*own), &seed);
    int32_t *want = guard_random(n * sizeof(*want), &seed), *got = guard_random(n * sizeof(*got), &seed);
    uint8_t *want_label = guard_random(n, &seed), *got_label = guard_random(n, &seed);
    struct sst_shown s = shown_right;

    s.rays = rays;
    s.step[0] = (int32_t)(4096 * sst_random(&seed)) - 2048;
    s.step[1] = (int32_t)(4096 * sst_random(&seed)) - 2048;
    s.whole[0] = (int32_t)(5 * sst_random(&seed)) - 2;
    s.y = (int)(SHOWN_H * sst_random(&seed));
    for (int i = 0; i < SHOWN_W * SHOWN_H; i++)
        rays[i] &= ray_of(0x1F1F1F, 3, 127, 0xFFFF);
    for (size_t i = 0; i < n; i++)
        own[i] = (own[i] & ray_of(0x1F1F1F, 255, 127, 0)) | ray_of(0, 0, 0, (int)(i % SHOWN_W));
    sst_shown_row_ref(want, want_label, &s, own, n);
    k->shown_row(got, got_label, &s, own, n);
    assert_memory_equal(got, want, n * sizeof(*got));
    assert_memory_equal(got_label, want_label, n);
    s = (struct sst_shown){ rays, SHOWN_W, SHOWN_H, { -32768, 32768 }, { 65535, 65535 }, { 32768, -32768 },
                            2,    0xFFFF,  255 }; /* the largest numbers */
    for (size_t i = 0; i < n; i++)
        own[i] = (own[i] & ~((uint64_t)0xFFFF << SST_RAY_DISP)) | (uint64_t)0xFFFE << SST_RAY_DISP;
    sst_shown_row_ref(want, want_label, &s, own, n);
    k->shown_row(got, got_label, &s, own, n);
    assert_memory_equal(got, want, n * sizeof(*got));
    assert_memory_equal(got_label, want_label, n);
    guard_free_all();
}

static void every_level_equals_the_reference(void **state SST_UNUSED)
{
    static const size_t widths[] = { 1, 3, 7, 16, 33, 64, 127, SST_CLASS_ROW_MAX };

    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k)) {
            printf("not run: %s\n", sst_cpu_level_name((enum sst_cpu_level)level));
            continue;
        }
        for (size_t i = 0; i < ARRAY_LEN(widths); i++) {
            check_level(&k, 23, widths[i]);
            check_level(&k, 1 + i, widths[i]);
            for (int times = 0; times < 20; times++)
                check_shown(&k, widths[i]);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(logarithms_are_those_of_libm),     cmocka_unit_test(entropies_have_known_values),
        cmocka_unit_test(guided_cells_have_known_values),   cmocka_unit_test(shown_surfaces_have_known_places),
        cmocka_unit_test(every_level_equals_the_reference),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
