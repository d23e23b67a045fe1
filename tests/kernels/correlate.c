/* Kernel of the drift check: every level against the reference, and the reference against hand-worked values. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

#define STRIDE 23
#define ROWS   (SST_CORRELATE_HEIGHT + 4)
#define PLACES (STRIDE - SST_CORRELATE_WIDTH + 1)

static uint64_t seed = 1;

static void fill(struct sst_correlate *c, int16_t *grey, int levels)
{
    int32_t squares = 0;

    for (int i = 0; i < STRIDE * ROWS; i++)
        grey[i] = (int16_t)(255 - (int)(sst_random_u64(&seed) % (uint64_t)levels));
    c->grey = grey;
    c->stride = STRIDE;
    c->sum = 0;
    for (int i = 0; i < SST_CORRELATE_SIZE; i++) {
        int16_t *v = &c->block[i / SST_CORRELATE_WIDTH][i % SST_CORRELATE_WIDTH];

        *v = (int16_t)(sst_random_u64(&seed) & 255);
        c->sum += *v;
        squares += *v * *v;
    }
    c->spread = (double)squares * SST_CORRELATE_SIZE - (double)c->sum * c->sum;
}

/* The last place ends the memory. */
static void correlations_equal_reference(void **state SST_UNUSED)
{
    static const int levels[] = { 1, 2, 256 };

    for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (int n = 1; n < 90; n++) {
            int16_t *grey = guard_random(sizeof(*grey) * STRIDE * ROWS, &seed);
            int32_t *at = guard_random(sizeof(*at) * (size_t)n, &seed);
            float *want = guard_random(sizeof(*want) * (size_t)n, &seed);
            float *got = guard_random(sizeof(*got) * (size_t)n, &seed);
            struct sst_correlate c;

            fill(&c, grey, levels[n % 3]);
            for (int i = 0; i < n; i++)
                at[i] = i % 11 == 5 ? -1 : (int32_t)(i % (ROWS - SST_CORRELATE_HEIGHT + 1) * STRIDE + i * 7 % PLACES);
            at[n - 1] = (ROWS - SST_CORRELATE_HEIGHT) * STRIDE + PLACES - 1;
            sst_correlate_places_ref(want, &c, at, (size_t)n);
            k.correlate_places(got, &c, at, (size_t)n);
            if (memcmp(want, got, sizeof(*want) * (size_t)n))
                fail_msg("%s, %d places of %d levels", sst_cpu_level_name((enum sst_cpu_level)level), n, levels[n % 3]);
            guard_free_all();
        }
    }
}

/* 1 for the block itself at another gain and offset, -1 for its negative, 0 for a flat block. */
static void correlations_are_those_of_blocks(void **state SST_UNUSED)
{
    const int32_t at[] = { 0, 9 * 8, 18 * 8, -1 };
    int16_t grey[27 * 8] = { 0 };
    struct sst_correlate c = { .grey = grey, .stride = 8 };
    float v[4];

    for (int y = 0; y < SST_CORRELATE_HEIGHT; y++) {
        for (int x = 0; x < SST_CORRELATE_WIDTH; x++) {
            c.block[y][x] = (int16_t)(x == 2 && y == 3 ? 72 : 0);
            grey[y * 8 + x] = (int16_t)(5 + c.block[y][x] / 2);
            grey[(y + 9) * 8 + x] = (int16_t)(255 - c.block[y][x]);
        }
    }
    c.sum = 72;
    c.spread = 72.0 * 72 * 72 - 72 * 72;
    sst_kernels_get()->correlate_places(v, &c, at, 4);
    assert_true(v[0] == 1 && v[1] == -1 && v[2] == 0 && v[3] == SST_CORRELATE_NONE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(correlations_equal_reference),
        cmocka_unit_test(correlations_are_those_of_blocks),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
