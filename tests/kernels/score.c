/* Kernels of the live picture: every level against the reference, buffers ending at an unmapped page. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

static uint64_t seed = 1;

static unsigned below(unsigned n)
{
    return (unsigned)(sst_random_u64(&seed) % n);
}

static void check_span(const struct sst_kernels *k, size_t n, size_t rows, const char *name)
{
    const int end[] = { 0, 1, 2000, 40000, 65534, 65535 };
    const size_t stride = n + below(3); /* values; the last row ends the buffer */

    for (size_t i = 0; i < ARRAY_LEN(end); i++) {
        const size_t values = (rows - 1) * stride + n;
        uint16_t *disp = guard_random(values * sizeof(*disp), &seed), want[2] = { UINT16_MAX, 0 },
                 got[2] = { UINT16_MAX, 0 };

        for (size_t x = 0; x < values; x++)
            disp[x] = (uint16_t)(below(4) ? below(3000) : below(3) ? disp[x] : 0xFFFF);
        if (!below(3))
            want[0] = got[0] = want[1] = got[1] = (uint16_t)below(3000);
        sst_disp_span_ref(want, disp, stride * sizeof(*disp), end[i], n, rows);
        k->disp_span(got, disp, stride * sizeof(*disp), end[i], n, rows);
        if (memcmp(want, got, sizeof(want)))
            fail_msg("%s, span of %zu rows of %zu below %d: %u..%u, not %u..%u", name, rows, n, end[i], got[0], got[1],
                     want[0], want[1]);
    }
    guard_free_all();
}

/* Colours, each within `near` levels of those of now or anywhere. */
static void check_score(const struct sst_kernels *k, size_t n, int near, int learns, const char *name)
{
    struct sst_score_cells c;
    uint8_t *want = guard_random(n, &seed), *got = guard_random(n, &seed);
    uint16_t *usual = guard_random(n * sizeof(*usual), &seed), *followed = guard_random(n * sizeof(*usual), &seed);

    for (int j = 0; j < 3; j++) {
        uint8_t *now = guard_random(n, &seed);

        c.now[j] = now;
        for (int i = 0; i < SST_SCORE_SLOTS; i++) {
            uint8_t *slot = guard_random(n, &seed);

            for (size_t x = 0; x < n && near; x++)
                slot[x] = (uint8_t)sst_clamp_int(now[x] + (int)below(2 * (unsigned)near + 1) - near, 0, 255);
            c.slot[i][j] = slot;
        }
    }
    for (size_t x = 0; x < n; x++)
        usual[x] = followed[x] = (uint16_t)(below(9) ? below(256 * SST_SCORE_USUAL + 1) : 256 * SST_SCORE_USUAL);
    sst_cell_score_ref(want, usual, &c, learns, n);
    k->cell_score(got, followed, &c, learns, n);
    if (memcmp(want, got, n) || memcmp(usual, followed, n * sizeof(*usual)))
        fail_msg("%s, scores of %zu cells within %d levels, learns %d", name, n, near, learns);
    guard_free_all();
}

static void check_sum(const struct sst_kernels *k, size_t n, const char *name)
{
    uint16_t *want = guard_random(n * sizeof(*want), &seed), *got = guard_random(n * sizeof(*got), &seed);
    const uint8_t *score = guard_random(n, &seed);

    memcpy(got, want, n * sizeof(*got));
    sst_score_add_ref(want, score, n);
    k->score_add(got, score, n);
    if (memcmp(want, got, n * sizeof(*got)))
        fail_msg("%s, sum of %zu cells", name, n);
    guard_free_all();
}

static void scores_equal_reference(void **state SST_UNUSED)
{
    for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++) {
        const char *name = sst_cpu_level_name((enum sst_cpu_level)level);
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (size_t n = 1; n < 150; n++) {
            check_span(&k, n, 1 + n % 5, name);
            for (int learns = 0; learns < 2; learns++) {
                check_score(&k, n, 0, learns, name);
                check_score(&k, n, 30, learns, name);
            }
            check_sum(&k, n, name);
        }
    }
}

/* The most similar of the remembered colours counts, and only what exceeds the usual difference. */
static void score_is_what_exceeds_the_usual(void **state SST_UNUSED)
{
    const uint8_t now[2] = { 100, 100 }, like[2] = { 104, 100 }, other[2] = { 10, 200 };
    struct sst_score_cells c = { .now = { now, now, now } };
    uint16_t usual[2] = { 5 * 256 + 128, 3 * 256 };
    uint8_t score[2];

    for (int i = 0; i < SST_SCORE_SLOTS; i++)
        for (int j = 0; j < 3; j++)
            c.slot[i][j] = i == 5 ? like : other;
    sst_kernels_get()->cell_score(score, usual, &c, 0, 2);
    assert_int_equal(score[0], 12 - 5 - SST_SCORE_SLACK);
    assert_int_equal(score[1], 0);
    assert_int_equal(usual[0], 5 * 256 + 128);
    sst_kernels_get()->cell_score(score, usual, &c, 1, 2);
    assert_int_equal(usual[0], 5 * 256 + 128 + (12 * 256 - 5 * 256 - 128) / 32);
    assert_int_equal(usual[1], 3 * 256 - 3 * 256 / 32);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scores_equal_reference),
        cmocka_unit_test(score_is_what_exceeds_the_usual),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
