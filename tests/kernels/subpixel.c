/* The kernels of the refinement between pixels, at every level this CPU has, against their plain references. */
#include <math.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

static uint64_t seed = 0xFEDCBA987654321ull;

#define FOR_EACH_LEVEL(k, level)                                                                                       \
    for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++)                                                    \
        if (sst_kernels_at((enum sst_cpu_level)level, &(k)))

enum { MOST = 150, H = 9, STRIDE = MOST + 3, REACH = 8 };

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
                                  .inverse_limit = 0.1f };

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

static void windows(void **state SST_UNUSED)
{
    enum { ROWS = 2 * REACH + 1, WIDE = MOST + 2 * REACH };
    static uint32_t colour[ROWS * WIDE];
    static int32_t disp[ROWS * WIDE];
    static float weight[ROWS * WIDE], product[ROWS * WIDE];
    const ptrdiff_t origin = REACH * WIDE + REACH;
    struct sst_subpixel_window w = {
        colour + origin, disp + origin, weight + origin, product + origin, WIDE, 1, 24, 20
    };
    struct sst_kernels k;

    for (int i = 0; i < ROWS * WIDE; i++) {
        colour[i] = (uint32_t)sst_random_u64(&seed) & (below(3) ? 0x1F1F1Fu : 0xFFFFFFu);
        disp[i] = below(4) ? below(40) : SST_SUBPIXEL_NONE;
        weight[i] = (float)below(100000) * 0.37f;
        product[i] = (float)below(100000) * 0.11f;
    }
    for (w.step = 1; w.step <= 4; w.step += 3) {
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
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fits),
        cmocka_unit_test(fit_of_a_ramp),
        cmocka_unit_test(windows),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
