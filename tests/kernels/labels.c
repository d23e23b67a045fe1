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

/* --- convolutions by tiles --- */

#define TILE_CHANNELS 32

/* Spread inputs of bytes. */
static int16_t *spread_tile(const struct sst_kernels *k, uint8_t *pixels, int is_signed)
{
    const uint8_t *pixel[SST_CONV_PARTS];
    int16_t *out = guard_random(SST_CONV_PARTS * TILE_CHANNELS * sizeof(*out), &seed);

    for (int i = 0; i < SST_CONV_PARTS; i++)
        pixel[i] = pixels + i * TILE_CHANNELS;
    k->conv_spread(out, TILE_CHANNELS, pixel, TILE_CHANNELS, is_signed);
    return out;
}

static uint8_t *tile_pixels(void)
{
    return guard_random(SST_CONV_PARTS * TILE_CHANNELS, &seed);
}

/* The result of one kernel of 3x3, spread here by G', is its sum of products at every place. */
static void tiles_are_sums_of_products(void **state SST_UNUSED)
{
    static const int8_t rows[SST_CONV_TILE][3] = { { 1, 0, 0 }, { -1, -1, -1 }, { -1, 1, -1 },
                                                   { 1, 2, 4 }, { 1, -2, 4 },   { 0, 0, 1 } };
    struct sst_kernels k;

    assert_true(sst_kernels_at(SST_CPU_REF, &k));
    for (int is_signed = 0; is_signed < 2; is_signed++) {
        uint8_t *pixels = tile_pixels();
        int8_t *g = guard_random(9 * TILE_CHANNELS, &seed);
        int32_t m[SST_CONV_PARTS * SST_CONV_BLOCK] = { 0 }, out[SST_CONV_PIXELS * SST_CONV_BLOCK];
        int16_t *spread;

        memset(pixels, is_signed ? 128 : 255, 9 * TILE_CHANNELS); /* and the largest numbers */
        memset(g, 127, 6);
        spread = spread_tile(&k, pixels, is_signed);
        for (int part = 0; part < SST_CONV_PARTS; part++) {
            int16_t weights[TILE_CHANNELS * SST_CONV_BLOCK] = { 0 };

            for (int c = 0; c < TILE_CHANNELS; c++) {
                for (int i = 0; i < 9; i++)
                    weights[c / 2 * SST_CONV_BLOCK * 2 + c % 2] +=
                        (int16_t)(rows[part / SST_CONV_TILE][i / 3] * rows[part % SST_CONV_TILE][i % 3] * g[9 * c + i]);
            }
            k.conv_products(m + part * SST_CONV_BLOCK, spread + part * TILE_CHANNELS, weights, TILE_CHANNELS, 1);
        }
        k.conv_gather(out, m, SST_CONV_BLOCK);
        for (int p = 0; p < SST_CONV_PIXELS; p++) {
            int want = 0;

            for (int i = 0; i < 9 * TILE_CHANNELS; i++) {
                const int tap = i % 9, at = (p / SST_CONV_OUT + tap / 3) * SST_CONV_TILE + p % SST_CONV_OUT + tap % 3;
                const uint8_t value = pixels[at * TILE_CHANNELS + i / 9];

                want += g[i] * (is_signed ? (int8_t)value : value);
            }
            assert_int_equal(out[p * SST_CONV_BLOCK], want);
        }
        guard_free_all();
    }
}

static void *copy_of(const void *from, size_t bytes)
{
    return memcpy(guard_random(bytes, &seed), from, bytes);
}

static void check_finish(const struct sst_kernels *k, const struct sst_conv_finish *f, const int32_t *sums)
{
    const size_t bytes = SST_CONV_BLOCK * (f->type == SST_CONV_F32 ? sizeof(float) : 1);
    void *want[SST_CONV_PIXELS], *got[SST_CONV_PIXELS];

    for (size_t p = 0; p < SST_CONV_PIXELS; p++) {
        want[p] = p % 5 ? guard_random(bytes, &seed) : NULL;
        got[p] = want[p] ? copy_of(want[p], bytes) : NULL;
    }
    for (size_t p = 0; p < SST_CONV_PIXELS && f->residual == SST_CONV_F32; p++) {
        for (size_t i = 0; i < SST_CONV_BLOCK && want[p]; i++)
            ((float *)want[p])[i] = ((float *)got[p])[i] = (float)(sst_random(&seed) - 0.5);
    }
    sst_conv_finish_ref(want, sums, f);
    k->conv_finish(got, sums, f);
    for (size_t p = 0; p < SST_CONV_PIXELS; p++) {
        if (want[p])
            assert_memory_equal(got[p], want[p], bytes);
    }
    guard_free_all();
}

static void check_tiles(const struct sst_kernels *k, size_t n)
{
    int16_t *tiles = guard_random(n * TILE_CHANNELS * sizeof(*tiles), &seed);
    int16_t *weights = guard_random(TILE_CHANNELS * SST_CONV_BLOCK * sizeof(*weights), &seed);
    int32_t *want = guard_random(n * SST_CONV_BLOCK * sizeof(*want), &seed);
    int32_t *got = copy_of(want, n * SST_CONV_BLOCK * sizeof(*want));
    int32_t *m = guard_random(SST_CONV_PARTS * SST_CONV_BLOCK * sizeof(*m), &seed);
    int32_t sums[2][SST_CONV_PIXELS * SST_CONV_BLOCK];
    float scale[SST_CONV_BLOCK], bias[SST_CONV_BLOCK];
    struct sst_kernels ref;

    for (size_t i = 0; i < n * TILE_CHANNELS; i++)
        tiles[i] = tiles[i] == INT16_MIN ? 0 : tiles[i];
    sst_conv_products_ref(want, tiles, weights, TILE_CHANNELS, n);
    k->conv_products(got, tiles, weights, TILE_CHANNELS, n);
    assert_memory_equal(got, want, n * SST_CONV_BLOCK * sizeof(*want));
    assert_true(sst_kernels_at(SST_CPU_REF, &ref));
    for (int is_signed = 0; is_signed < 2; is_signed++) {
        uint8_t *pixels = tile_pixels();

        assert_memory_equal(spread_tile(k, pixels, is_signed), spread_tile(&ref, pixels, is_signed),
                            SST_CONV_PARTS * TILE_CHANNELS * sizeof(int16_t));
    }
    sst_conv_gather_ref(sums[0], m, SST_CONV_BLOCK);
    k->conv_gather(sums[1], m, SST_CONV_BLOCK);
    assert_memory_equal(sums[1], sums[0], sizeof(sums[0]));
    for (int i = 0; i < SST_CONV_BLOCK; i++) {
        scale[i] = (float)sst_random(&seed) * 1e-5f;
        bias[i] = (float)(sst_random(&seed) - 0.5) * 1e6f;
    }
    for (int way = 0; way < 4; way++) {
        const struct sst_conv_finish ways[] = {
            { scale, bias, 1, 1, SST_CONV_U8, SST_CONV_U8, 0.7f },
            { scale, bias, 0, 0, SST_CONV_S8, SST_CONV_U8, 1 },
            { scale, bias, 1, 0, SST_CONV_F32, SST_CONV_F32, 1 },
            { scale, bias, 1, 1, SST_CONV_U8, SST_CONV_NONE, 0 },
        };

        check_finish(k, &ways[way], sums[0]);
    }
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
            check_tiles(&k, 1 + i);
            for (int times = 0; times < 20; times++)
                check_shown(&k, widths[i]);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(logarithms_are_those_of_libm),   cmocka_unit_test(entropies_have_known_values),
        cmocka_unit_test(guided_cells_have_known_values), cmocka_unit_test(shown_surfaces_have_known_places),
        cmocka_unit_test(tiles_are_sums_of_products),     cmocka_unit_test(every_level_equals_the_reference),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
