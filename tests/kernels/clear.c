/* Kernels of the clear picture and of moving maps: every level against the reference, byte for byte, buffers ending at
 * an unmapped page.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

#define VIEWS 40
#define MAX_W 150

static uint64_t seed = 1;

static unsigned below(unsigned n)
{
    return (unsigned)(sst_random_u64(&seed) % n);
}

static struct sst_clear_view random_view(int w, int h)
{
    const size_t n = (size_t)w * (size_t)h;
    const float x = (float)below(1000) / 100 - 5, y = below(3) ? (float)below(1000) / 100 - 5 : 0;
    const float min = (float)below(20) - 10;
    struct sst_clear_view v = { .width = w,
                                .height = h,
                                .stride = (size_t)w,
                                .bx = x,
                                .by = y,
                                .x_q6 = x / 64,
                                .x_0 = min * x + 0.5F,
                                .y_q6 = y / 64,
                                .y_0 = min * y + 0.5F,
                                .coarse = !below(4) };

    for (int c = 0; c < 3; c++)
        v.plane[c] = guard_random(n + 15, &seed);
    return v;
}

/* A smooth map with steps, which has all values if `any`, and states that are mostly kept. */
static void check_land(const struct sst_kernels *k, int w, int h, int any, enum sst_cpu_level level)
{
    const size_t stride = (size_t)(w + 31) / 32 * 32, n = stride * (size_t)h;
    struct sst_clear_view v = random_view(w, h);
    uint16_t *want = calloc(n, sizeof(*want)), *got = guard_random(n * sizeof(*got), &seed);
    uint16_t *disp = guard_random((size_t)w * sizeof(*disp), &seed);
    uint8_t *state = guard_random((size_t)w, &seed);
    unsigned at = below(2000);
    int part;

    assert_non_null(want);
    v.coarse |= any;
    memset(got, 0, n * sizeof(*got));
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            at = below(20) ? at + below(3) : below(any ? 65536 : 2000);
            disp[x] = (uint16_t)at;
            state[x] = (uint8_t)(below(9) ? SST_CLEAR_KEPT : below(2));
        }
        part = (int)below((unsigned)w + 1); /* in two stretches */
        sst_clear_land_ref(want, stride, &v, disp, state, 0, y, w);
        k->clear_land(got, stride, &v, disp + part, state + part, part, y, w - part);
        k->clear_land(got, stride, &v, disp, state, 0, y, part);
    }
    if (memcmp(want, got, n * sizeof(*got)))
        fail_msg("%s, %dx%d", sst_cpu_level_name(level), w, h);
    free(want);
    guard_free_all();
}

/* Cells with steps and gaps, of which some leave the picture. */
static void check_cells(const struct sst_kernels *k, int w, int h, enum sst_cpu_level level)
{
    const size_t n = (size_t)w * (size_t)h;
    const struct sst_cell_way way = { .zero_q6 = (int)below(2000) - 1000,
                                      .bx_q16 = (int)below(600000) - 300000,
                                      .by_q16 = below(3) ? (int)below(600000) - 300000 : 0,
                                      .rank = below(64) << 24,
                                      .width = w,
                                      .height = h };
    uint32_t *want = calloc(n, sizeof(*want)), *got = guard_random(n * sizeof(*got), &seed);
    uint32_t *cells = guard_random((size_t)w * sizeof(*cells), &seed);
    unsigned disp = below(2000);

    assert_non_null(want);
    memset(got, 0, n * sizeof(*got));
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            disp = below(20) ? disp : below(9) ? below(2000) : below(65536);
            cells[x] = below(30) ? 1U << 31 | disp << 8 | below(256) : 0;
        }
        sst_cell_land_ref(want, &way, cells, 0, y, w);
        k->cell_land(got, &way, cells, 0, y, w);
    }
    if (memcmp(want, got, n * sizeof(*got)))
        fail_msg("%s, cells, %dx%d", sst_cpu_level_name(level), w, h);
    free(want);
    guard_free_all();
}

static void check_split(const struct sst_kernels *k, size_t n, enum sst_cpu_level level)
{
    const uint8_t *pixels = guard_random(4 * n, &seed);
    uint8_t *want[3], *got[3];

    for (int c = 0; c < 3; c++) {
        want[c] = guard_random(n, &seed);
        got[c] = guard_random(n, &seed);
    }
    sst_split_row_ref(want, pixels, n);
    k->split_row(got, pixels, n);
    for (int c = 0; c < 3; c++) {
        if (memcmp(want[c], got[c], n))
            fail_msg("%s, split, n=%zu", sst_cpu_level_name(level), n);
    }
    guard_free_all();
}

static void check_states(const struct sst_kernels *k, size_t n, enum sst_cpu_level level)
{
    uint16_t *disp = guard_random(n * sizeof(*disp), &seed);
    uint8_t *want = guard_random(n, &seed), *got = guard_random(n, &seed), *row[3];
    const int cut[] = { -1, 0, 30000, 65534, 65535 }, bins[] = { 0, 1, 40000, 65535 };

    disp[0] = 0xFFFF;
    for (size_t i = 0; i < ARRAY_LEN(cut); i++) {
        sst_clear_removed_ref(want, disp, cut[i], n);
        k->clear_removed(got, disp, cut[i], n);
        if (memcmp(want, got, n))
            fail_msg("%s, removed, %zu pixels, cut %d", sst_cpu_level_name(level), n, cut[i]);
    }
    for (size_t i = 0; i < ARRAY_LEN(bins); i++) {
        for (int j = 0; j < 3; j++) {
            row[j] = guard_random(n + 2, &seed);
            for (size_t x = 0; x < n + 2; x++)
                row[j][x] = row[j][x] < 20;
        }
        sst_clear_state_ref(want, (const uint8_t *const[3]){ row[0] + 1, row[1] + 1, row[2] + 1 }, disp, bins[i], n);
        k->clear_state(got, (const uint8_t *const[3]){ row[0] + 1, row[1] + 1, row[2] + 1 }, disp, bins[i], n);
        if (memcmp(want, got, n))
            fail_msg("%s, states, %zu pixels, bins %d", sst_cpu_level_name(level), n, bins[i]);
    }
    guard_free_all();
}

/* What a pixel sees: nothing, one surface with noise, several, or anything. */
static void check_surface(const struct sst_kernels *k, size_t views, int layers, enum sst_cpu_level level)
{
    uint16_t landed[VIEWS][SST_CLEAR_BLOCK];
    const uint16_t *row[VIEWS];
    float want[SST_CLEAR_BLOCK], got[SST_CLEAR_BLOCK];

    for (size_t j = 0; j < views; j++) {
        row[j] = landed[j];
        for (int i = 0; i < SST_CLEAR_BLOCK; i++)
            landed[j][i] = (uint16_t)(!layers || !below(4) ? 0
                                      : layers > 5         ? below(65536)
                                                           : 30 + 100 * below((unsigned)layers) + below(90));
    }
    sst_clear_surface_ref(want, row, views);
    k->clear_surface(got, row, views);
    if (memcmp(want, got, sizeof(want)))
        fail_msg("%s, %zu views, %d layers", sst_cpu_level_name(level), views, layers);
}

struct rays {
    struct sst_clear_rays rays;
    float weight[VIEWS][SST_CLEAR_BLOCK], agree[VIEWS][SST_CLEAR_BLOCK], colour[3][VIEWS][SST_CLEAR_BLOCK];
};

static void rays_init(struct rays *r)
{
    memset(r, 0, sizeof(*r));
    r->rays.weight = r->weight;
    r->rays.agree = r->agree;
    for (int c = 0; c < 3; c++)
        r->rays.colour[c] = r->colour[c];
}

static void check_rays(const struct rays *want, const struct rays *got, const char *what, enum sst_cpu_level level)
{
    const size_t used = (size_t)want->rays.slots * sizeof(want->weight[0]);

    if (want->rays.slots != got->rays.slots || memcmp(want->rays.wanted, got->rays.wanted, sizeof(want->rays.wanted)) ||
        memcmp(want->weight, got->weight, used) || memcmp(want->agree, got->agree, used))
        fail_msg("%s, %s", what, sst_cpu_level_name(level));
    for (int c = 0; c < 3; c++)
        if (memcmp(want->colour[c], got->colour[c], used))
            fail_msg("%s, %s: colour %d", what, sst_cpu_level_name(level), c);
}

static void check_colours(const struct sst_kernels *k, struct rays *want, struct rays *got, enum sst_cpu_level level)
{
    struct sst_clear_colours a, b;

    for (int own = -1; own < 1 && own < want->rays.slots; own++) {
        sst_clear_blend_ref(&a, &want->rays, own);
        k->clear_blend(&b, &got->rays, own);
        if (memcmp(&a, &b, sizeof(a)))
            fail_msg("%s: blended colours, own %d", sst_cpu_level_name(level), own);
        check_rays(want, got, "agreement", level);
    }
}

/* Views of one row; the last block of a row may reach beyond the picture, where nothing has landed. */
static void check_take(const struct sst_kernels *k, int w, int h, enum sst_cpu_level level)
{
    const int x = (int)below((unsigned)w), y = (int)below((unsigned)h);
    struct rays want, got;

    rays_init(&want);
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const unsigned at = 200 + 3 * (unsigned)i;

        want.rays.first[i] = (uint16_t)(below(9) ? at - 48 : 1);
        want.rays.last[i] = (uint16_t)(want.rays.first[i] > 1 ? at + 48 : 0);
        want.rays.px[i] = (float)at / 64 - (float)below(9) / 100;
        want.rays.wanted[i] = (int16_t)below(6);
    }
    rays_init(&got);
    memcpy(&got.rays, &want.rays, offsetof(struct sst_clear_rays, weight));
    for (int j = 0; j < 5; j++) {
        struct sst_clear_view v = random_view(w, h);
        uint16_t landed[SST_CLEAR_BLOCK];

        for (int i = 0; i < SST_CLEAR_BLOCK; i++)
            landed[i] = (uint16_t)(x + i >= w || !below(9) ? 0 : 2 * (150 + below(200)) + below(2));
        v.bx *= j ? 1 : 0;
        v.by *= j ? 1 : 0;
        if (j == 4)
            v.plane[0] = v.plane[1] = v.plane[2] = NULL;
        assert_int_equal(sst_clear_take_ref(&want.rays, &v, landed, x, y), k->clear_take(&got.rays, &v, landed, x, y));
        check_rays(&want, &got, "taken", level);
        guard_free_all();
    }
    check_colours(k, &want, &got, level);
}

static void clear_equals_reference(void **state SST_UNUSED)
{
    for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++) {
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (int w = 1; w < MAX_W; w++) {
            const int h = 1 + (int)below(12);

            check_states(&k, (size_t)w, (enum sst_cpu_level)level);
            check_split(&k, (size_t)w, (enum sst_cpu_level)level);
            check_land(&k, w, h, w % 2, (enum sst_cpu_level)level);
            check_cells(&k, w, h, (enum sst_cpu_level)level);
            for (int i = 0; i < 10; i++)
                check_take(&k, w, h, (enum sst_cpu_level)level);
        }
        for (size_t views = 1; views <= VIEWS; views++)
            for (int layers = 0; layers < 8; layers++)
                check_surface(&k, views, layers, (enum sst_cpu_level)level);
    }
}

/* Two rays make a surface, one does not, and a nearer one alone is passed over. */
static void surface_needs_two_rays(void **state SST_UNUSED)
{
    uint16_t landed[3][SST_CLEAR_BLOCK] = { { 1000, 1000, 1001 }, { 0, 941, 600 }, { 0, 0, 601 } };
    const uint16_t *const row[3] = { landed[0], landed[1], landed[2] };
    float surface[SST_CLEAR_BLOCK];

    sst_kernels_get()->clear_surface(surface, row, 3);
    assert_float_equal(surface[0], 0, 0);
    assert_float_equal(surface[1], 485, 0);
    assert_float_equal(surface[2], 300, 0);
    assert_float_equal(surface[3], 0, 0);
}

/* One colour far from four equal ones does not count, and the viewpoint's own camera wins where it agrees. */
static void colours_are_robust(void **state SST_UNUSED)
{
    struct sst_clear_colours out;
    struct rays r;

    rays_init(&r);
    r.rays.slots = 5;
    for (int k = 0; k < 5; k++) {
        r.weight[k][0] = r.weight[k][1] = 1;
        for (int c = 0; c < 3; c++) {
            r.colour[c][k][0] = k == 1 ? 250 : 100;
            r.colour[c][k][1] = k ? 100 : 104;
        }
    }
    sst_kernels_get()->clear_blend(&out, &r.rays, 0);
    for (int c = 0; c < 3; c++) {
        assert_float_equal(out.colour[c][0], 100, 0.1);
        assert_float_equal(out.colour[c][1], 104, 0);
        assert_float_equal(out.colour[c][2], 0, 0);
    }
    assert_float_equal(out.weight[0], 5, 0);
    assert_float_equal(out.weight[2], 0, 0);
    assert_true(out.support[0] < 4.05F && out.support[0] > 3.9F);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clear_equals_reference),
        cmocka_unit_test(surface_needs_two_rays),
        cmocka_unit_test(colours_are_robust),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
