/* Blending kernels: every level against the reference, byte for byte, buffers ending at an unmapped page. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/exp_neg.h"
#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

static uint64_t seed = 1;

static float *guard_floats(size_t n)
{
    float *f = guard_random(n * sizeof(*f), &seed);

    for (size_t i = 0; i < n; i++)
        f[i] = (float)(sst_random_u64(&seed) % 4096) / 16;
    return f;
}

struct accumulators {
    float *row[4];
    int32_t *sum[3]; /* the same memory */
};

static struct accumulators guard_accumulators(size_t n, const struct accumulators *from)
{
    struct accumulators a;

    for (int c = 0; c < 4; c++) {
        a.row[c] = guard_floats(n);
        if (from)
            memcpy(a.row[c], from->row[c], n * sizeof(float));
        if (c < 3)
            a.sum[c] = (int32_t *)(void *)a.row[c];
    }
    return a;
}

static float random_share(void)
{
    return (float)(sst_random_u64(&seed) % 1000) / 1000;
}

/* Weights by label and disparity, four different weights outside of ranges if `few`; every fifth label has irregular
 * weights. */
struct weights {
    float table[256 * SST_BLEND_COLUMNS];
    struct sst_blend_labels by;
};

static struct weights *random_weights(bool few)
{
    const float share[] = { 0.02f, 1, 0.19f, 0.91f };
    bool present[256];
    struct weights *w = malloc(sizeof(*w));

    assert_non_null(w);
    for (size_t label = 0; label < 256; label++) {
        float *row = w->table + label * SST_BLEND_COLUMNS;
        struct sst_blend_range *r = &w->by.range[label];

        *r = (struct sst_blend_range){ .weight = row,
                                       .ranges = (int)(label % 5),
                                       .outside = few ? share[label % 4] : random_share() };
        for (size_t c = 0; c < SST_BLEND_COLUMNS; c++)
            row[c] = r->ranges > SST_BLEND_RANGES || c == SST_BLEND_COLUMNS - 1 ? random_share() : r->outside;
        for (int i = 0; i < r->ranges && r->ranges <= SST_BLEND_RANGES; i++) {
            const size_t from = 20 * (size_t)i + sst_random_u64(&seed) % 10, to = from + 1 + sst_random_u64(&seed) % 9;

            r->first[i] = (uint16_t)(from * 16);
            r->count[i] = (uint16_t)((to - from) * 16);
            r->inside[i] = random_share();
            for (size_t c = from; c < to; c++)
                row[c] = r->inside[i];
        }
    }
    for (int label = 0; label < 256; label++)
        present[label] = sst_random_u64(&seed) % 4 != 0;
    sst_blend_labels_few(&w->by, present);
    return w;
}

/* Runs of random length with one value, so that blocks have one label, few or many. */
static const uint8_t *random_labels(size_t n)
{
    uint8_t *label = guard_random(n, &seed);
    const size_t run = sst_random_u64(&seed) % 100 + 1, labels = sst_random_u64(&seed) % 3 ? 5 : 256;

    for (size_t x = 0; x < n; x++)
        label[x] = (uint8_t)(x % run ? label[x - 1] : label[x] % labels);
    return label;
}

static const uint16_t *random_disparities(size_t n)
{
    uint16_t *disp = guard_random(n * sizeof(*disp), &seed);
    const bool unknown = sst_random_u64(&seed) % 2, far = sst_random_u64(&seed) % 3 == 0;

    for (size_t x = 0; x < n; x++) {
        if (unknown && sst_random_u64(&seed) % 5 == 0)
            disp[x] = (uint16_t)(disp[x] % 7 ? disp[x] : 65500 + disp[x] % 36);
        else
            disp[x] = (uint16_t)(far ? 1000 + disp[x] % 64 : disp[x] % 600);
    }
    return disp;
}

static struct sst_blend random_blend(size_t n, const struct weights *weights)
{
    struct sst_blend b = { .aperture = 0.75f, .by = &weights->by, .near = { .scale = 0.01f } };

    if (sst_random_u64(&seed) % 4)
        sst_blend_near_set(&b.near, sst_random_in(&seed, -50, 700), exp2(sst_random_in(&seed, -2, 9)),
                           sst_random_u64(&seed) % 3 ? 0.01 : 0);
    sst_blend_set_taps(b.tap, (double)random_share(), (double)random_share());
    if (sst_random_u64(&seed) % 4 == 0) {
        sst_blend_set_taps(b.tap, 0.998330071, 0.995215170);
        assert_int_equal(b.tap[0], -1); /* rounded, and so the only negative one */
    }
    for (int c = 0; c < 3; c++) {
        b.top[c] = guard_random(n + 1, &seed);
        b.bottom[c] = guard_random(n + 1, &seed);
    }
    b.disp = sst_random_u64(&seed) % 9 ? random_disparities(n) : NULL;
    b.label = sst_random_u64(&seed) % 4 ? random_labels(n) : NULL;
    return b;
}

static void check_level(const struct sst_kernels *k, size_t n, const struct weights *weights, const char *level)
{
    for (int plain = 0; plain < 2; plain++) {
        const struct accumulators want = guard_accumulators(n, NULL), got = guard_accumulators(n, &want);
        const int views =
            sst_random_u64(&seed) % 2 ? SST_BLEND_VIEWS : 1 + (int)(sst_random_u64(&seed) % SST_BLEND_VIEWS);
        struct sst_blend b[SST_BLEND_VIEWS];

        for (int v = 0; v < views; v++) {
            b[v] = random_blend(n, weights);
            b[v].below = sst_random_u64(&seed) % 2 ? 4096 : 0;
            b[v].disp_below = b[v].label_below = b[v].below;
        }
        if (plain) {
            sst_blend_plain_ref(want.sum, want.row[3], b, views, n);
            k->blend_plain(got.sum, got.row[3], b, views, n);
        } else {
            sst_blend_rays_ref(want.row, b, views, n);
            k->blend_rays(got.row, b, views, n);
        }
        for (int c = 0; c < 4; c++) {
            if (memcmp(got.row[c], want.row[c], n * sizeof(float)))
                fail_msg("n=%zu level=%s plain=%d views=%d row=%d", n, level, plain, views, c);
        }
        guard_free_all();
    }
}

static void check_take(const struct sst_kernels *k, size_t n, const struct weights *weights, const char *level)
{
    const struct sst_blend b = random_blend(n, weights);
    uint8_t *want[4], *got[4];

    for (int c = 0; c < 4; c++) {
        want[c] = guard_random(c < 3 ? n : n * sizeof(float), &seed);
        got[c] = guard_random(c < 3 ? n : n * sizeof(float), &seed);
    }
    sst_blend_take_ref(want, (float *)(void *)want[3], &b, n);
    k->blend_take(got, (float *)(void *)got[3], &b, n);
    for (int c = 0; c < 4; c++) {
        if (memcmp(got[c], want[c], c < 3 ? n : n * sizeof(float)))
            fail_msg("take: n=%zu level=%s row=%d", n, level, c);
    }
    guard_free_all();
}

static void blend_equals_reference(void **state SST_UNUSED)
{
    struct weights *all[2] = { random_weights(false), random_weights(true) };

    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k)) {
            print_message("not run: %s\n", sst_cpu_level_name((enum sst_cpu_level)level));
            continue;
        }
        for (int round = 0; round < 8; round++) {
            const struct weights *weights = all[round % 2];

            for (size_t n = 1; n <= 129; n++) {
                check_level(&k, n, weights, sst_cpu_level_name((enum sst_cpu_level)level));
                check_take(&k, n, weights, sst_cpu_level_name((enum sst_cpu_level)level));
            }
            check_level(&k, SST_BLEND_MAX, weights, sst_cpu_level_name((enum sst_cpu_level)level));
        }
    }
    free(all[0]);
    free(all[1]);
}

static void finish_equals_reference(void **state SST_UNUSED)
{
    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (size_t n = 1; n <= 129; n++) {
            float *weight = guard_floats(n), *sum = guard_floats(n);
            uint8_t *want = guard_random(n, &seed), *got = guard_random(n, &seed);

            for (size_t x = 0; x < n; x++) {
                weight[x] = x % 5 ? weight[x] / 256 : 0;
                sum[x] = weight[x] * SST_BLEND_LEVEL * (float)(sst_random_u64(&seed) % 255001) / 1000;
            }
            sst_blend_finish_ref(want, sum, weight, n);
            k.blend_finish(got, sum, weight, n);
            assert_memory_equal(got, want, n);
            guard_free_all();
        }
    }
}

static void support_equals_reference(void **state SST_UNUSED)
{
    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (size_t n = 1; n <= 129; n++) {
            const uint16_t *disp = guard_random(n * sizeof(*disp), &seed);
            const uint8_t *label = n % 3 ? guard_random(n, &seed) : NULL;
            uint32_t *ends = guard_random(256 * sizeof(*ends), &seed); /* half of them empty */
            uint8_t *want = guard_random(n, &seed), *got = guard_random(n, &seed);

            memcpy(got, want, n);
            sst_blend_support_ref(want, disp, label, ends, n);
            k.blend_support(got, disp, label, ends, n);
            assert_memory_equal(got, want, n);
            guard_free_all();
        }
    }
}

static void support_by_hand(void **state SST_UNUSED)
{
    const uint32_t ends[256] = { 0xFFFFu << 16, 100 | 200u << 16, 0xFFFF };
    const uint16_t disp[] = { 99, 100, 200, 201, 0xFFFF, 150, 0 };
    const uint8_t label[] = { 1, 1, 1, 1, 2, 2, 0 }, want[] = { 7, 255, 255, 7, 7, 7, 255 };
    uint8_t support[] = { 7, 7, 7, 7, 7, 7, 7 };

    sst_blend_support_ref(support, disp, label, ends, 7);
    assert_memory_equal(support, want, 7);
    sst_blend_support_ref(support, disp, NULL, ends, 7);
    for (int i = 0; i < 7; i++)
        assert_int_equal(support[i], 255);
}

/* One pixel by hand: rows {10, 30} and {50, 110} at fx = 0.5, fy = 0.25: left 20, right 50, colour 35. Disparity 8 from
 * the focus, 2 sigma^2 = 64: exp(-1) = 0.36788; c1 = 0.2: W_d = 0.49430; W_s = 0.5, A = 2: weight 0.49430. */
static void reference_is_the_formula(void **state SST_UNUSED)
{
    static float row[SST_BLEND_COLUMNS];
    static const struct sst_blend_labels by = { .range = { [7] = { .weight = row, .ranges = SST_BLEND_RANGES + 1 } } };
    const uint8_t top[] = { 10, 30 }, bottom[] = { 50, 110 }, label = 7;
    const uint16_t disp = 100;
    struct sst_blend b = { .top = { top, top, top },
                           .bottom = { bottom, bottom, bottom },
                           .aperture = 2,
                           .disp = &disp,
                           .label = &label,
                           .by = &by };
    float r = 1, g = 0, blue = 0, w = 0, *const acc[4] = { &r, &g, &blue, &w };
    int32_t sums[3] = { 1, 0, 0 }, *const sum[3] = { sums, sums + 1, sums + 2 };
    const uint16_t none = 0xFFFF;

    sst_blend_near_set(&b.near, 92, sqrt(32), 0.2);
    sst_blend_set_taps(b.tap, 0.5, 0.25);
    row[100 / 16] = 0.5f;
    row[SST_BLEND_COLUMNS - 1] = 1;
    sst_blend_rays_ref(acc, &b, 1, 1);
    assert_true(fabs(w - 0.494304) < 2e-4);
    assert_true(fabs(r - (1 + 35 * SST_BLEND_LEVEL * 0.494304)) < 0.0002 * 50 * SST_BLEND_LEVEL);
    assert_true(fabs(blue - 35 * SST_BLEND_LEVEL * 0.494304) < 0.0002 * 50 * SST_BLEND_LEVEL);
    b.disp = &none;
    w = 0;
    sst_blend_rays_ref(acc, &b, 1, 1);
    assert_true(fabs(w - 0.4) < 1e-6);
    w = 0;
    sst_blend_plain_ref(sum, &w, &b, 1, 1);
    assert_true(w == 1 && sums[0] == 1 + 35 * SST_BLEND_LEVEL && sums[2] == 35 * SST_BLEND_LEVEL);
}

static void exponential_is_within_its_bound(void **state SST_UNUSED)
{
    double worst = 0;

    for (double t = 0; t <= (double)SST_EXP_NEG_MAX; t += 1.0 / 4096) {
        const float f = (float)t;

        worst = fmax(worst, fabs((double)sst_exp_neg(f) / exp(-(double)f) - 1));
    }
    print_message("exp_neg: worst relative error %.3g\n", worst);
    assert_true(worst <= 2e-7);
    assert_true(sst_exp_neg(0) == 1.0f);
}

/* Focus, sigma in stored units, C1: against the formula, and 1 in focus. Unknown: C1. */
static void weight_of_depth_is_the_formula(void **state SST_UNUSED)
{
    static const double cases[][3] = { { 300, 40, 0.005 },   { 300.5, 40, 0 },    { -90, 60, 0.1 },
                                       { 65000, 900, 0.01 }, { 12.25, 0.9, 0.2 }, { 9000, 6000, 0 },
                                       { 100, 200000, 0.5 }, { 20000, 7, 0.999 } };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const double focus = cases[i][0], sigma = cases[i][1], c1 = cases[i][2];
        const double bound = c1 > 0 ? 2.2e-3 : 1.4e-2;
        struct sst_blend_near n;

        sst_blend_near_set(&n, focus, sigma, c1);
        assert_true(n.bits > 0);
        for (int disp = 0; disp < 65536; disp++) {
            const double z = (disp - focus) / sigma, got = (double)(sst_blend_near(&n, (uint16_t)disp) * n.scale);
            const double want = disp < SST_BLEND_UNKNOWN ? (1 - c1) * exp(-z * z / 2) + c1 : c1;

            if (fabs(disp - focus) <= 31999 && fabs(got - want) > bound * want + 1e-31) /* far below SST_BLEND_FLOOR */
                fail_msg("case %zu, disparity %d: %.9g, not %.9g", i, disp, got, want);
        }
    }
}

/* W_d = C1 where all disparities are far from the focus. */
static void focus_out_of_reach(void **state SST_UNUSED)
{
    struct sst_blend_near n;

    sst_blend_near_set(&n, -5000, 40, 0.25);
    assert_true(n.bits == 0 && n.scale == 0.25f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blend_equals_reference),         cmocka_unit_test(finish_equals_reference),
        cmocka_unit_test(support_equals_reference),       cmocka_unit_test(support_by_hand),
        cmocka_unit_test(reference_is_the_formula),       cmocka_unit_test(exponential_is_within_its_bound),
        cmocka_unit_test(weight_of_depth_is_the_formula), cmocka_unit_test(focus_out_of_reach),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
