/* The kernels of the refinement between pixels, at every level this CPU has, against their plain references. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

static uint64_t seed = 0xFEDCBA987654321ull;

#define FOR_EACH_LEVEL(k, level)                                                                                       \
    for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++)                                                     \
        if (sst_kernels_at((enum sst_cpu_level)level, &(k)))

enum { MOST = 150, H = 9, STRIDE = MOST + 3, REACH = SST_SUBPIXEL_REACH };

static int below(int n)
{
    return (int)(sst_random_u64(&seed) % (uint64_t)n);
}

/* A view of nearly equal levels, some of whose surfaces are near, and whose readable pixels end at an unmapped page. */
static struct sst_packed_view random_view(int width)
{
    const ptrdiff_t stride = width + 3;
    uint32_t *p = guard_random((size_t)stride * (H + 2) * sizeof(*p), &seed);

    for (ptrdiff_t i = 0; i < stride * (H + 2); i++)
        p[i] = (p[i] & 0x0F0F) | (below(4) ? 0 : below(8) ? 500u : 65535u) << 16;
    return (struct sst_packed_view){ p + stride + 1, stride };
}

static struct sst_subpixel_fit random_fit(int width)
{
    struct sst_subpixel_fit f = { .own = random_view(width),
                                  .views = below(SST_SUBPIXEL_VIEWS + 1),
                                  .width = width,
                                  .height = H,
                                  .tolerance = below(100),
                                  .inverse_limit = 0.1f,
                                  .across = below(2) };

    for (int i = 0; i < f.views; i++)
        f.view[i] = (struct sst_subpixel_view){ .view = random_view(width),
                                                .x = below(8 * 65536) - 4 * 65536,
                                                .y = below(4 * 65536) - 2 * 65536,
                                                .dx = below(4096) - 2048,
                                                .dy = below(4096) - 2048,
                                                .bx = (float)(below(7) - 3),
                                                .by = (float)(below(7) - 3),
                                                .gain = 0.9f + 0.01f * (float)below(20),
                                                .offset = (float)(below(9) - 4) };
    return f;
}

static void fits(void **state SST_UNUSED)
{
    static const int widths[] = { 1, 7, 63, 64, 65, 128, MOST };
    struct sst_kernels k;

    for (size_t i = 0; i < ARRAY_LEN(widths); i++) {
        const size_t n = (size_t)widths[i], bytes = n * sizeof(float);
        const struct sst_subpixel_fit f = random_fit(widths[i]);
        int32_t *disp = guard_random(bytes, &seed);
        float *want[2] = { guard_random(bytes, &seed), guard_random(bytes, &seed) };
        float *got[2] = { guard_random(bytes, &seed), guard_random(bytes, &seed) };

        for (size_t x = 0; x < n; x++)
            disp[x] = below(8) ? below(512) : below(2) ? SST_SUBPIXEL_NONE : SST_SUBPIXEL_NONE - 1;
        for (int y = 0; y < H; y++) {
            sst_subpixel_fit_row_ref(want[0], want[1], disp, &f, y, n);
            FOR_EACH_LEVEL(k, level)
            {
                k.subpixel_fit_row(got[0], got[1], disp, &f, y, n);
                assert_memory_equal(got[0], want[0], bytes);
                assert_memory_equal(got[1], want[1], bytes);
            }
        }
        guard_free_all();
    }
}

/* A ramp of 8 levels a pixel that lies 0.25 px beside the disparity in both views: one step finds it. */
static void fit_of_a_ramp(void **state SST_UNUSED)
{
    enum { SIDE = 16 };
    static uint32_t pixels[3][SIDE * SIDE];
    struct sst_subpixel_fit f = {
        .own = { &pixels[0][SIDE + 1], SIDE }, .views = 2, .width = 12, .height = 8, .inverse_limit = 0.1f
    };
    const int32_t disp[5] = { 64, 64, 64, 64, 64 };
    struct sst_kernels k;
    float weight[5], product[5];

    for (int v = 0; v < 3; v++) {
        const int bx = v == 2 ? -1 : v; /* a point of the own view is at x - 1.25 bx */

        for (int i = 0; i < SIDE * SIDE; i++) {
            const int level = 20 + 8 * (i % SIDE) + 10 * bx;

            pixels[v][i] = (uint32_t)level | (uint32_t)(level + 8) << 8 | 64u << 16;
        }
        if (v)
            f.view[v - 1] = (struct sst_subpixel_view){
                .view = { &pixels[v][SIDE + 1], SIDE }, .dx = -bx * 1024, .bx = (float)bx, .gain = 1
            };
    }
    FOR_EACH_LEVEL(k, level)
    {
        k.subpixel_fit_row(weight, product, disp, &f, 3, 5);
        assert_true(fabsf(weight[4] - 2 * 0.8f * 64) < 1e-3f); /* differences of 2 levels of 10 */
        assert_true(fabsf(product[4] / weight[4] - 1.25f) < 1e-5f);
        f.view[0].gain = 2; /* differs by far more than the limit: the other view alone */
        k.subpixel_fit_row(weight, product, disp, &f, 3, 5);
        assert_true(fabsf(weight[4] - 0.8f * 64) < 1e-3f);
        f.view[0].gain = 1;
    }
}

enum { ROWS = 2 * REACH + 1, WIDE = MOST + 2 * REACH, ORIGIN = REACH * WIDE + REACH };

static float between(float lo, float hi)
{
    return lo + (hi - lo) * (float)below(1 << 16) / (1 << 16);
}

static void windows(void **state SST_UNUSED)
{
    static uint32_t colour[ROWS * WIDE];
    static int32_t disp[ROWS * WIDE];
    static float weight[ROWS * WIDE], product[ROWS * WIDE], slope[2][WIDE];
    struct sst_subpixel_window w = {
        colour + ORIGIN, disp + ORIGIN, weight + ORIGIN, product + ORIGIN, { slope[0], slope[1] }, WIDE, 24, 0.3f
    };
    struct sst_kernels k;

    for (int i = 0; i < ROWS * WIDE; i++) {
        colour[i] = (uint32_t)sst_random_u64(&seed) & (below(3) ? 0x1F1F1Fu : 0xFFFFFFu);
        disp[i] = below(4) ? below(40) : SST_SUBPIXEL_NONE;
        weight[i] = (float)below(100000) * 0.37f;
        product[i] = (float)below(100000) * 0.11f;
    }
    for (int x = 0; x < WIDE; x++) {
        slope[0][x] = between(-0.1f, 0.1f);
        slope[1][x] = between(-0.1f, 0.1f);
    }
    for (size_t n = 1; n <= MOST; n += n < 62 ? 61 : 1) {
        float *want[2] = { guard_random(n * sizeof(float), &seed), guard_random(n * sizeof(float), &seed) };
        float *got[2] = { guard_random(n * sizeof(float), &seed), guard_random(n * sizeof(float), &seed) };

        sst_subpixel_window_row_ref(want[0], want[1], &w, n);
        FOR_EACH_LEVEL(k, level)
        {
            k.subpixel_window_row(got[0], got[1], &w, n);
            assert_memory_equal(got[0], want[0], n * sizeof(float));
            assert_memory_equal(got[1], want[1], n * sizeof(float));
        }
        guard_free_all();
    }
}

static void planes(void **state SST_UNUSED)
{
    static uint32_t colour[ROWS * WIDE];
    static float disp[ROWS * WIDE], weight[ROWS * WIDE], slope[2][WIDE];
    struct sst_subpixel_planes p = { colour + ORIGIN, disp + ORIGIN, weight + ORIGIN, WIDE, 24, 0.2f };
    struct sst_kernels k;

    for (int i = 0; i < ROWS * WIDE; i++) {
        colour[i] = (uint32_t)sst_random_u64(&seed) & (below(3) ? 0x1F1F1Fu : 0xFFFFFFu);
        disp[i] = between(2, 2.6f);
        weight[i] = below(5) ? between(0, 1e5f) : 0;
    }
    for (int x = 0; x < WIDE; x++) {
        slope[0][x] = between(-0.02f, 0.02f);
        slope[1][x] = between(-0.02f, 0.02f);
    }
    memset(weight, 0, (size_t)WIDE * REACH * sizeof(*weight)); /* half of each window */
    for (size_t n = 1; n <= MOST; n += n < 62 ? 61 : 1) {
        const size_t bytes = n * sizeof(float);
        float *want[3] = { guard_random(bytes, &seed), guard_random(bytes, &seed), guard_random(bytes, &seed) };
        float *got[3] = { guard_random(bytes, &seed), guard_random(bytes, &seed), guard_random(bytes, &seed) };

        memcpy(want[1], slope[0], bytes);
        memcpy(want[2], slope[1], bytes);
        sst_subpixel_plane_row_ref(want[0], want + 1, &p, n);
        FOR_EACH_LEVEL(k, level)
        {
            memcpy(got[1], slope[0], bytes);
            memcpy(got[2], slope[1], bytes);
            k.subpixel_plane_row(got[0], got + 1, &p, n);
            for (int i = 0; i < 3; i++)
                assert_memory_equal(got[i], want[i], bytes);
        }
        guard_free_all();
    }
}

/* Columns of noise beside a plane, and one surface that is nearer: the slopes are the plane's, less the ridge's share,
 * and the middle lies on it. */
static void plane_of_a_slope(void **state SST_UNUSED)
{
    static uint32_t colour[ROWS * WIDE];
    static float disp[ROWS * WIDE], weight[ROWS * WIDE];
    const struct sst_subpixel_planes p = { colour + ORIGIN, disp + ORIGIN, weight + ORIGIN, WIDE, 24, 0.3f };
    float out[1], right[1] = { 0 }, down[1] = { 0 };
    struct sst_kernels k;

    for (int i = 0; i < ROWS * WIDE; i++) {
        disp[i] = 2 + 0.005f * (float)(i % WIDE - REACH) - 0.01f * (float)(i / WIDE - REACH);
        weight[i] = 1000;
        if (i % WIDE > REACH + 6) {
            disp[i] += 1;
            weight[i] = 1e5f;
        }
    }
    FOR_EACH_LEVEL(k, level)
    {
        right[0] = down[0] = 0;
        for (int i = 0; i < 3; i++)
            k.subpixel_plane_row(out, (float *const[]){ right, down }, &p, 1);
        assert_true(fabsf(out[0] - 2) < 1e-3f);
        assert_true(fabsf(right[0] - 0.005f) < 2e-4f);
        assert_true(fabsf(down[0] + 0.01f) < 2e-4f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fits),   cmocka_unit_test(fit_of_a_ramp),    cmocka_unit_test(windows),
        cmocka_unit_test(planes), cmocka_unit_test(plane_of_a_slope),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
