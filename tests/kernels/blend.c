/* Blending kernels: every level against the reference, byte for byte, buffers ending at an unmapped page. */
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
};

static struct accumulators guard_accumulators(size_t n, const struct accumulators *from)
{
    struct accumulators a;

    for (int c = 0; c < 4; c++) {
        a.row[c] = guard_floats(n);
        if (from)
            memcpy(a.row[c], from->row[c], n * sizeof(float));
    }
    return a;
}

static struct sst_blend random_blend(size_t n, const float *table)
{
    struct sst_blend b = { .fx = (float)(sst_random_u64(&seed) % 1000) / 1000,
                           .fy = (float)(sst_random_u64(&seed) % 1000) / 1000,
                           .aperture = 0.75f,
                           .label_weight = table,
                           .focus_whole_q6 = 300,
                           .focus_part_q6 = -0.25f,
                           .half_inverse_variance = 1 / 3000.0f,
                           .c1 = 0.01f,
                           .one_minus_c1 = 0.99f,
                           .unknown = 0.01f };
    uint16_t *disp = guard_random(n * sizeof(*disp), &seed);

    for (int c = 0; c < 3; c++) {
        b.top[c] = guard_random(n + 1, &seed);
        b.bottom[c] = guard_random(n + 1, &seed);
    }
    for (size_t x = 0; x < n; x++)
        disp[x] = sst_random_u64(&seed) % 5 ? disp[x] % 600 : disp[x] % 7 ? disp[x] : 0xFFFF;
    b.disp = disp;
    b.label = sst_random_u64(&seed) % 4 ? guard_random(n, &seed) : NULL;
    return b;
}

static void check_level(const struct sst_kernels *k, size_t n, const float *table, const char *level)
{
    for (int plain = 0; plain < 2; plain++) {
        const struct accumulators want = guard_accumulators(n, NULL), got = guard_accumulators(n, &want);
        const struct sst_blend b = random_blend(n, table);

        (plain ? sst_blend_plain_ref : sst_blend_rays_ref)(want.row, &b, n);
        (plain ? k->blend_plain : k->blend_rays)(got.row, &b, n);
        for (int c = 0; c < 4; c++) {
            if (memcmp(got.row[c], want.row[c], n * sizeof(float)))
                fail_msg("n=%zu level=%s plain=%d row=%d", n, level, plain, c);
        }
        guard_free_all();
    }
}

static void blend_equals_reference(void **state SST_UNUSED)
{
    float *table = malloc(256 * SST_BLEND_COLUMNS * sizeof(*table));

    assert_non_null(table);
    for (size_t i = 0; i < 256 * SST_BLEND_COLUMNS; i++)
        table[i] = (float)(sst_random_u64(&seed) % 1000) / 1000;
    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k)) {
            print_message("not run: %s\n", sst_cpu_level_name((enum sst_cpu_level)level));
            continue;
        }
        for (size_t n = 1; n <= 129; n++)
            check_level(&k, n, table, sst_cpu_level_name((enum sst_cpu_level)level));
        check_level(&k, SST_BLEND_MAX, table, sst_cpu_level_name((enum sst_cpu_level)level));
    }
    free(table);
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
                sum[x] = weight[x] * (float)(sst_random_u64(&seed) % 255001) / 1000;
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
    static float table[256 * SST_BLEND_COLUMNS];
    const uint8_t top[] = { 10, 30 }, bottom[] = { 50, 110 }, label = 7;
    const uint16_t disp = 100;
    struct sst_blend b = { .top = { top, top, top },
                           .bottom = { bottom, bottom, bottom },
                           .fx = 0.5f,
                           .fy = 0.25f,
                           .aperture = 2,
                           .disp = &disp,
                           .label = &label,
                           .label_weight = table,
                           .focus_whole_q6 = 92,
                           .half_inverse_variance = 1 / 64.0f,
                           .c1 = 0.2f,
                           .one_minus_c1 = 0.8f,
                           .unknown = 0.2f };
    float r = 1, g = 0, blue = 0, w = 0, *const acc[4] = { &r, &g, &blue, &w };
    const uint16_t none = 0xFFFF;

    table[7 * SST_BLEND_COLUMNS + 100 / 16] = 0.5f;
    table[7 * SST_BLEND_COLUMNS + SST_BLEND_COLUMNS - 1] = 1;
    sst_blend_rays_ref(acc, &b, 1);
    assert_true(fabs(w - 0.494304) < 1e-6);
    assert_true(fabs(r - (1 + 35 * 0.494304)) < 1e-4);
    assert_true(fabs(blue - 35 * 0.494304) < 1e-4);
    b.disp = &none;
    w = 0;
    sst_blend_rays_ref(acc, &b, 1);
    assert_true(fabs(w - 0.4) < 1e-6);
    w = 0;
    g = 0;
    sst_blend_plain_ref(acc, &b, 1);
    assert_true(w == 2 && g == 70);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blend_equals_reference),   cmocka_unit_test(finish_equals_reference),
        cmocka_unit_test(support_equals_reference), cmocka_unit_test(support_by_hand),
        cmocka_unit_test(reference_is_the_formula), cmocka_unit_test(exponential_is_within_its_bound),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
