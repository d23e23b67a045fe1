/* light_row: against the exact chain in double, every level against the reference, buffers ending at unmapped pages. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

#define SAMPLES (SST_LIGHT_WHITE + 1)

static double to_light(double v)
{
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double to_code(double light)
{
    return light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1 / 2.4) - 0.055;
}

/* The definition, 0..255 before rounding. */
static double exact(double v, double f)
{
    const double corrected = 255 * to_code(fmin(1, f * to_light(v / 255))), keep = 255 - SST_LIGHT_KEEP * (255 - v);

    return fmin(255, fmax(corrected, keep));
}

static void every_sample_and_factor_is_near_the_exact_chain(void **state SST_UNUSED)
{
    uint16_t *value = malloc(SAMPLES * sizeof(*value));
    float *falloff = malloc(SAMPLES * sizeof(*falloff)), *root = malloc(SAMPLES * sizeof(*root));
    uint8_t *out = malloc(SAMPLES);
    double worst = 0;

    assert_true(value && falloff && root && out);
    for (int i = 0; i < SAMPLES; i++)
        value[i] = (uint16_t)i;
    for (double log_f = -3; log_f <= 3; log_f += 0.125) {
        const double f = exp2(log_f), gain = 0.9;
        const struct sst_light l = { value, falloff, root, (float)gain, (float)pow(gain, 1 / 2.4) };

        for (int i = 0; i < SAMPLES; i++) {
            falloff[i] = (float)(f / gain);
            root[i] = (float)pow(f / gain, 1 / 2.4);
        }
        sst_light_row_ref(out, &l, SAMPLES);
        for (int i = 0; i < SAMPLES; i++) {
            const double error = fabs(out[i] - exact(i / 128.0, f)) - 0.5;

            if (error > worst)
                worst = error;
            if (error > 0.02)
                fail_msg("value %g times %g: %d instead of %.3f", i / 128.0, f, out[i], exact(i / 128.0, f));
            if (i && out[i] < out[i - 1])
                fail_msg("times %g: %d at %g, %d before it", f, out[i], i / 128.0, out[i - 1]);
        }
    }
    print_message("worst error %.4f levels besides rounding\n", worst);
    free(value);
    free(falloff);
    free(root);
    free(out);
}

/* 128 is light 0.21586; half of it is 0.10793: code 92.06. White that was clipped stays white, black black; a factor of
 * 1 changes nothing. */
static void hand_worked_values(void **state SST_UNUSED)
{
    const uint16_t value[] = { 128 << 7, 255 << 7, 0, 5 << 7, 200 << 7 };
    const float half[] = { 0.5f, 0.5f, 0.5f, 0.5f, 2 }, one[] = { 1, 1, 1, 1, 1 };
    const float r = (float)pow(0.5, 1 / 2.4), root[] = { r, r, r, r, 1 / r };
    struct sst_light l = { value, half, root, 1, 1 };
    uint8_t out[5];

    sst_light_row_ref(out, &l, 5);
    assert_int_equal(out[0], 92);
    assert_int_equal(out[1], 255);
    assert_int_equal(out[2], 0);
    assert_int_equal(out[3], 3); /* 2.5 and up */
    assert_int_equal(out[4], 255);
    l.falloff = l.falloff_root = one;
    sst_light_row_ref(out, &l, 5);
    for (int i = 0; i < 5; i++)
        assert_int_equal(out[i], value[i] >> 7);
}

static void levels_equal_the_reference(void **state SST_UNUSED)
{
    static const size_t widths[] = { 1, 7, 15, 16, 17, 31, 32, 33, 63, 64, 65, 129, 512 };
    uint64_t seed = 5;

    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k)) {
            print_message("level %s is not tested: this processor lacks it\n",
                          sst_cpu_level_name((enum sst_cpu_level)level));
            continue;
        }
        for (size_t w = 0; w < ARRAY_LEN(widths); w++) {
            const size_t n = widths[w];
            uint16_t *value = guard_random(n * 2, &seed);
            float *falloff = guard_random(n * 4, &seed), *root = guard_random(n * 4, &seed);
            uint8_t *got = guard_random(n, &seed), want[512];
            const struct sst_light l = { value, falloff, root, 1.07f, (float)pow(1.07, 1 / 2.4) };

            for (size_t i = 0; i < n; i++) {
                const bool bright = i / 64 % 2 || i % 64 < 33; /* whole blocks of bright samples, and some dark ones */

                value[i] = (uint16_t)(bright ? SAMPLES - 1 - sst_random_u64(&seed) % (SAMPLES / 2)
                                             : sst_random_u64(&seed) % SAMPLES);
                falloff[i] = (float)sst_random_in(&seed, 0.2, 4.2);
                root[i] = (float)pow(falloff[i], 1 / 2.4);
            }
            sst_light_row_ref(want, &l, n);
            k.light_row(got, &l, n);
            if (memcmp(got, want, n))
                fail_msg("n=%zu level=%s", n, sst_cpu_level_name((enum sst_cpu_level)level));
            guard_free_all();
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_sample_and_factor_is_near_the_exact_chain),
        cmocka_unit_test(hand_worked_values),
        cmocka_unit_test(levels_equal_the_reference),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
