/* The largest error of every kernel that computes with floats or rounds, against the formulas of tests/reference/, and
 * the largest sums of those that count. All levels give the bytes of the references (the other tests of this folder),
 * so the references are measured here. Every kernel has a line. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/exp_neg.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/log_pos.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/disparity/stage.h"
#include "simulators/scene/noise.h"
#include "tests/bounds.h"
#include "tests/reference/disparity.h"
#include "tests/reference/labels.h"
#include "tests/reference/render.h"
#include "tests/small.h"

#define N 129

static uint64_t seed = 20261125;

static unsigned below(unsigned n)
{
    return (unsigned)(sst_random_u64(&seed) % n);
}

/* Inputs of a bound: fewer under a sanitizer and in an emulator. */
static int rounds(int n)
{
    return small_level() ? n / 8 : n;
}

static float real(double lo, double hi)
{
    return (float)sst_random_in(&seed, lo, hi);
}

/* --- whole numbers: what the largest sum is ------------------------------------------------------------------------
 */

/* Kernels of whole numbers give the bytes of their references at every level; the largest value of a sum, and its room.
 */
static const struct {
    const char *name;
    double largest, room;
    const char *why;
} counted[] = {
    { "census_row", 62, 64, "bits" },
    { "hamming_row", 4 * 62, SST_COST_MAX, "4 popcount of 62 bits" },
    { "hamming_steps_row", 4 * 62, SST_COST_MAX, "likewise" },
    { "feature_cost_rows", SST_FEATURE_CHANNELS * 128.0 * 255, INT32_MAX, "64 signed by unsigned bytes" },
    { "colour_step_row", 255, UINT8_MAX, "difference of bytes" },
    { "consensus_first", (double)SST_CONSENSUS_REACH *((SST_CONSENSUS_VIEWS + 3) / 4), UINT8_MAX,
      "a mean for each four views" },
    { "consensus_again", 255.0 * SST_CONSENSUS_VIEWS + SST_CONSENSUS_ALONE *(SST_CONSENSUS_LEAST + 1), UINT16_MAX,
      "a byte for each view, and the cost of views that are missing" },
    { "consensus_cost_row", 255, UINT8_MAX, "sums that saturate" },
    { "consensus_mean_row", 3 * SST_CONSENSUS_MOST, UINT8_MAX, "costs of three of 3x3 pixels" },
    { "consensus_least_row", 3 * SST_CONSENSUS_MOST, UINT8_MAX, "costs of three of 3x3 pixels" },
    { "consensus_path_row", 255, UINT8_MAX, "sums that saturate" },
    { "consensus_choose_row", 255, UINT8_MAX, "sums that saturate" },
    { "cheapest_hamming_row", 4 * 62, SST_COST_MAX, "4 popcount of 62 bits" },
    { "cheapest_row", 2 * 255 + 1, UINT16_MAX, "mean of two bytes, rounded up" },
    { "cheapest_mean_row", 3 * 255 + 255 + 2, UINT16_MAX, "3 a + b" },
    { "transpose_u8", 255, UINT8_MAX, "moves bytes" },
    { "support_sum_row", 121 * 255, UINT16_MAX, "support regions of 11x11 costs, differences modulo 2^16" },
    { "sgm_across_row", 8 * (SST_COST_MAX + SST_DISPARITY_MAX_PENALTY), UINT16_MAX,
      "8 (Cmax + P2), Hirschmueller 2008" },
    { "sgm_along_rows", 8 * (SST_COST_MAX + SST_DISPARITY_MAX_PENALTY), UINT16_MAX, "likewise" },
    { "winner_row", UINT16_MAX, UINT16_MAX, "compares sums of 16 bits" },
    { "winner_other_row", UINT32_MAX, UINT32_MAX, "sum << 16 | d" },
    { "median5_row", UINT16_MAX, UINT16_MAX, "compares" },
    { "median_votes_row", 86.0 * 225, UINT16_MAX, "a row's 11 shares, 86 at most, of colours' 225" },
    { "land_row", 65534 * 32768.0 + 65535, INT32_MAX, "disparity times spacing, and the part" },
    { "hypothesis_cost_row", 8 * (SST_HYPOTHESIS_VIEWS + SST_HYPOTHESIS_BEST) * (double)SST_HYPOTHESIS_LIMIT * 9,
      INT32_MAX, "windows of 9, 24 + 4 views" },
    { "hypothesis_path_row", 4.0 * (SST_HYPOTHESIS_FAR + SST_DISPARITY_MAX_PENALTY), UINT16_MAX, "4 paths" },
    { "blend_plain", 512.0 * 255 * SST_BLEND_LEVEL, INT32_MAX, "512 views of 255 levels" },
    { "blend_support", 255, UINT8_MAX, "compares" },
    { "clear_removed", 1, UINT8_MAX, "compares" },
    { "clear_state", 2, UINT8_MAX, "compares" },
    { "agree_mode", 256 * 255.0 * (SST_AGREE_MODE / 2), UINT32_MAX, "256 rays of 255 votes" },
    { "agree_near", SST_AGREE_NEAR * 255.0, UINT16_MAX, "distance times votes" },
    { "agree_sum", 9 * SST_AGREE_NEAR * 255.0, 1 << FLT_MANT_DIG, "9 pixels; whole numbers in a float" },
    { "enlarge_row", 4 * 255, UINT16_MAX, "four levels" },
    { "split_row", UINT8_MAX, UINT8_MAX, "moves" },
    { "cell_land", UINT16_MAX, UINT16_MAX, "compares and moves" },
    { "shown_row", 65534 * 32768.0 + 65535, INT32_MAX, "disparity times spacing, and the part" },
    { "conv_spread", 100 * 255, INT16_MAX, "rows of B, whose magnitudes have the sum 10, twice" },
    { "conv_products", 2.0 * 25500 * 6223, INT32_MAX, "two products; their sums are modulo 2^32 by definition" },
    { "conv_gather", SST_CONV_MOST - 1, INT32_MAX, "sums modulo 2^32 of 64 times the result" },
    { "disp_span", UINT16_MAX, UINT16_MAX, "compares" },
    { "cell_score", 256 * SST_SCORE_USUAL, INT16_MAX, "three differences of bytes; 1/256 level of the usual one" },
    { "score_add", 4 * 256.0 * SST_SCORE_CAP, UINT16_MAX, "scores of four rows of 256 views" },
    { "correlate_places", SST_CORRELATE_SIZE *SST_CORRELATE_SIZE * 255.0 * 255, INT32_MAX,
      "72 times products of 72 pairs of levels" },
    { "feature_products", SST_FEATURE_PARTS * 512.0 * 512, INT32_MAX,
      "128 products of 512, of unit length 512 at most" },
    { "level_row", SST_LEVEL_MAX, INT16_MAX, "half of 16 bits, shifted" },
    { "window_squares", (double)SST_WINDOW_AREA *SST_LEVEL_MAX *SST_LEVEL_MAX, INT32_MAX, "49 squares of 4096" },
    { "window_products", (double)SST_WINDOW_AREA *SST_LEVEL_MAX *SST_LEVEL_MAX, INT32_MAX, "49 products of 4096" },
    { "window_agree", 255, UINT8_MAX, "counts of up to 256 views" },
    { "weighted_add", 1024.0 * 65535 * 64, UINT32_MAX, "1024 views of 65535 levels; products are floats" },
    { "sha256_blocks", UINT32_MAX, UINT32_MAX, "sums modulo 2^32 by definition" },
};

static void whole_numbers_have_room(void **state SST_UNUSED)
{
    for (size_t i = 0; i < ARRAY_LEN(counted); i++) {
        struct bound b = {
            counted[i].name, "whole numbers", "error: exact at every level", counted[i].why, 0, 0, 0, ""
        };

        bound_note(&b, 0, "-");
        snprintf(b.input, sizeof(b.input), "largest value %.0f of %.0f", counted[i].largest, counted[i].room);
        assert_true(counted[i].largest <= counted[i].room);
        bound_end(&b);
    }
}

/* --- functions ------------------------------------------------------------------------------------------------------
 */

static void exponentials(void **state SST_UNUSED)
{
    struct bound e = { "sst_exp_neg", "float", "relative", "series to r^7, exp_neg.h", 2e-7, 0, 0, "" };

    for (int i = 0; i <= 200000; i++) {
        const float t = (float)i * (SST_EXP_NEG_MAX / 200000);

        bound_relative(&e, sst_exp_neg(t), expl(-(wide)t), 0, "t = %.9g", (double)t);
    }
    bound_end(&e);
}

static void logarithms(void **state SST_UNUSED)
{
    struct bound b = { "sst_log_pos", "float", "of 1 + |log x|", "series to z^13, log_pos.h", 1e-7, 0, 0, "" };

    for (double x = 1.2e-38; x < 3e38; x *= 1.0007) {
        const wide want = logl((wide)(float)x);

        bound_note(&b, (double)(fabsl((wide)sst_log_pos((float)x) - want) / (1 + fabsl(want))), "x = %.9g", x);
    }
    bound_end(&b);
}

/* --- labels ---------------------------------------------------------------------------------------------------------
 */

static void draw_distribution(float *p, size_t count, int kind)
{
    const float power = kind == 0 ? 1 : real(0, 60);
    float sum = 0;

    for (size_t c = 0; c < count; c++)
        sum += p[c] = kind == 1 ? (c == 0) : kind == 2 ? 1 : powf((float)sst_random(&seed), power);
    for (size_t c = 0; c < count && sum > 0; c++)
        p[c] /= sum;
    if (!(sum > 0))
        p[0] = 1;
}

static void entropy_of_distributions(void **state SST_UNUSED)
{
    struct bound b = { "class_row", "float", "of 1 + H", "kernels.h", 1e-6, 0, 0, "" };
    float p[64], h;
    uint8_t top;

    for (int i = 0; i < rounds(20000); i++) {
        const size_t count = 1 + below(64);
        wide want;

        draw_distribution(p, count, i % 8);
        sst_class_row_ref(&top, &h, p, 1, count, 1);
        want = ref_entropy(p, 1, count);
        bound_note(&b, (double)(fabsl((wide)h - want) / (1 + want)), "%zu classes, H = %.7Lf", count, want);
        assert_true(h >= 0);
    }
    bound_end(&b);
}

static void guided_cells(void **state SST_UNUSED)
{
    struct bound b = { "guide_cells", "float", "relative", "16 terms and exp(-t), positive values", 2e-6, 0, 0, "" };
    float cell[16][8], across[16], out[8];
    uint8_t pixel[3];
    struct sst_guide g = { .across = across, .pixel = { &pixel[0], &pixel[1], &pixel[2] }, .cells = 16, .values = 8 };

    for (int i = 0; i < rounds(5000); i++) {
        for (int k = 0; k < 16; k++) {
            across[k] = real(0.01, 1);
            g.down[k] = real(0.01, 1);
            g.cell[k] = cell[k];
            for (int c = 0; c < 3; c++)
                g.colour[c][k] = i % 2 ? real(0, 255) : (float)(255 * below(2));
            for (int v = 0; v < 8; v++)
                cell[k][v] = real(0, 1);
        }
        for (int c = 0; c < 3; c++)
            pixel[c] = (uint8_t)below(256);
        sst_guide_cells_ref(out, &g, 1);
        for (int v = 0; v < 8; v++) {
            wide want = 0;

            for (int k = 0; k < 16; k++) {
                wide t = 0;

                for (int c = 0; c < 3; c++)
                    t += (pixel[c] - (wide)g.colour[c][k]) * (pixel[c] - (wide)g.colour[c][k]);
                t = fminl(t / (2 * (wide)SST_GUIDE_SIGMA * (wide)SST_GUIDE_SIGMA), (wide)SST_EXP_NEG_MAX);
                want += (wide)across[k] * (wide)g.down[k] * (expl(-t) + (wide)SST_GUIDE_FLOOR) * (wide)cell[k][v];
            }
            bound_relative(&b, out[v], want, 0, "pixel %d %d %d", pixel[0], pixel[1], pixel[2]);
        }
    }
    bound_end(&b);
}

/* --- disparity ------------------------------------------------------------------------------------------------------
 */

/* Means of costs over a support region, by a reciprocal that is rounded up. */
static void finished_sums(void **state SST_UNUSED)
{
    struct bound b = { "conv_finish", "float", "of the sum of magnitudes", "4 roundings", 2.4e-7, 0, 0, "" };

    for (int i = 0; i < rounds(5000); i++) {
        const float scale[SST_CONV_BLOCK] = { real(1e-6f, 1e-3f) }, bias[SST_CONV_BLOCK] = { real(-1e6f, 1e6f) };
        const struct sst_conv_finish f = { scale, bias, i % 2, 0, SST_CONV_F32, SST_CONV_F32, real(0.1f, 2) };
        const int32_t sums[SST_CONV_PIXELS * SST_CONV_BLOCK] = { (int32_t)below(SST_CONV_MOST) - SST_CONV_MOST / 2 };
        float out[SST_CONV_BLOCK] = { real(-100, 100) };
        const wide residual = (wide)out[0] * (wide)f.residual_scale, sum = (wide)sums[0] * (wide)scale[0];
        const wide offset = (wide)bias[0] * (i % 2 ? (wide)scale[0] : 1);
        void *to[SST_CONV_PIXELS] = { out };

        sst_conv_finish_ref(to, sums, &f);
        bound_note(
            &b,
            (double)(fabsl((wide)out[0] - (sum + offset + residual)) / (fabsl(sum) + fabsl(offset) + fabsl(residual))),
            "sum %d", sums[0]);
    }
    bound_end(&b);
}

static void support_means(void **state SST_UNUSED)
{
    struct bound b = { "support_mean_row",
                       "whole numbers",
                       "cost steps",
                       "1/2, and sums of 30855 by a reciprocal of 16 bits",
                       0.5 + 30855 / 65536.0,
                       0,
                       0,
                       "" };

    for (unsigned count = 2; count <= 121; count++) {
        for (unsigned sum = 0; sum <= 255 * count; sum += 1 + below(count)) {
            uint16_t lo = (uint16_t)(sum + 65000), hi = 65000;
            const uint16_t *const rows[2] = { &hi, &lo };
            const uint8_t zero = 0;
            const uint16_t n = (uint16_t)count;
            uint8_t out = 0;

            sst_support_mean_row_ref(&out, rows + 1, &zero, &zero, &n, 1, 1);
            bound_note(&b, fabs(out - (double)sum / count), "sum %u of %u", sum, count);
        }
    }
    bound_end(&b);
}

static void bilateral_means(void **state SST_UNUSED)
{
    struct bound b = {
        "bilateral_row", "whole numbers, one float quotient", "1/64 px", "rounded once: 1/2", 0.5, 0, 0, ""
    };
    uint16_t disp[7][7];
    uint8_t luma[7][7];
    int16_t weight[49];

    for (int i = 0; i < rounds(20000); i++) {
        const uint16_t *rows[7];
        const uint8_t *lumas[7];
        const unsigned middle = i % 3 ? 96 + below(65000) : below(2) ? 0 : 65535 - SST_BILATERAL_STEP_Q6 - 200;
        uint16_t out;

        for (int k = 0; k < 49; k++) {
            disp[k / 7][k % 7] = (uint16_t)(middle + below(i % 2 ? 190 : 3));
            luma[k / 7][k % 7] = (uint8_t)(100 + below(40));
            weight[k] = (int16_t)below(669);
        }
        weight[24] = (int16_t)(weight[24] + 1);
        for (int k = 0; k < 7; k++) {
            rows[k] = &disp[k][3];
            lumas[k] = &luma[k][3];
        }
        sst_bilateral_row_ref(&out, rows, lumas, weight, 20, 1);
        bound_note(&b, (double)fabsl(out - ref_bilateral(rows, lumas, weight, 20, 0)), "around %u", middle);
    }
    bound_end(&b);
}

static void parabolas(void **state SST_UNUSED)
{
    struct bound b = { "sst_parabola_q6", "whole numbers", "1/64 px", "rounded once: 1/2", 0.5, 0, 0, "" };

    for (int i = 0; i < rounds(20000); i++) {
        const int at = i % 4 ? (int)below(60000) : 0, before = at + (int)below(i % 2 ? 3 : 5000),
                  after = at + (int)below(i % 2 ? 3 : 5000);

        bound_note(&b, (double)fabsl(sst_parabola_q6(before, at, after) - 64 * ref_parabola(before, at, after)),
                   "costs %d, %d, %d", before, at, after);
    }
    bound_end(&b);
}

enum { W = 40, H = 9, STRIDE = W + 3 };

static void subpixel_steps(void **state SST_UNUSED)
{
    static uint32_t pixels[4][STRIDE * (H + 2)];
    struct bound w = {
        "subpixel_fit_row", "float", "of the largest weight", "24 terms of 8 roundings", 2e-5, 0, 0, ""
    };
    struct bound p = { "subpixel_fit_row, product", "float", "of weight times (1 + |d|)", "likewise", 2e-5, 0, 0, "" };

    for (int i = 0; i < 200; i++) {
        struct sst_subpixel_fit f = { .own = { pixels[3] + STRIDE + 1, STRIDE },
                                      .views = 1 + (int)below(SST_SUBPIXEL_VIEWS),
                                      .width = W,
                                      .height = H,
                                      .tolerance = 70,
                                      .inverse_limit = 1 / 12.0F,
                                      .across = i / 2 % 2 };
        float weight[W], product[W];
        int32_t disp[W];

        for (size_t k = 0; k < sizeof(pixels) / 4; k++)
            pixels[k / (STRIDE * (H + 2))][k % (STRIDE * (H + 2))] =
                (uint32_t)(100 + below(i % 2 ? 12 : 120)) | (uint32_t)(100 + below(12)) << 8 | below(500) << 16;
        for (int k = 0; k < f.views; k++)
            f.view[k] = (struct sst_subpixel_view){ { pixels[k % 3] + STRIDE + 1, STRIDE },
                                                    (int)below(1 << 18) - (1 << 17),
                                                    (int)below(1 << 17) - (1 << 16),
                                                    (int)below(2048) - 1024,
                                                    (int)below(2048) - 1024,
                                                    real(-3, 3),
                                                    real(-3, 3),
                                                    real(0.9, 1.1),
                                                    real(-4, 4) };
        for (int x = 0; x < W; x++)
            disp[x] = (int32_t)below(512);
        sst_subpixel_fit_row_ref(weight, product, disp, &f, 4, W);
        for (int x = 0; x < W; x++) {
            const double most = f.views * 255.0 * 255 / 4;
            wide want[2];

            ref_subpixel(&want[0], &want[1], disp[x], &f, x, 4);
            bound_note(&w, (double)fabsl((wide)weight[x] - want[0]) / most, "%d views, weight %.3Lf", f.views, want[0]);
            bound_note(&p, (double)fabsl((wide)product[x] - want[1]) / (most * (1 + disp[x] / 64.0)), "%d views, d %d",
                       f.views, disp[x]);
        }
    }
    bound_end(&w);
    bound_end(&p);
}

static void subpixel_windows(void **state SST_UNUSED)
{
    struct bound b = { "subpixel_window_row", "float", "relative", "25 positive terms: 24 u", 24 * 6e-8, 0, 0, "" };
    uint32_t colour[25];
    int32_t disp[25];
    float weight[25], product[25], out[2], slope[2];
    const struct sst_subpixel_window w = { colour + 12,          disp + 12, weight + 12, product + 12,
                                           { slope, slope + 1 }, 5,         10,          20.5F / 64 };

    for (int i = 0; i < rounds(20000); i++) {
        wide want = 0;

        slope[0] = (float)((int)below(9) - 4) / 64; /* exact, as are the disparities */
        slope[1] = (float)((int)below(9) - 4) / 64;
        for (int k = 0; k < 25; k++) {
            colour[k] = 100 + below(14);
            disp[k] = 1000 + (int)below(30);
            product[k] = weight[k] = i % 3 ? real(0, 65000) : exp2f(real(-20, 20));
        }
        for (int k = 0; k < 25; k++) {
            const int off = (int)(64 * slope[0]) * (k % 5 - 2) + (int)(64 * slope[1]) * (k / 5 - 2);

            want += abs((int)colour[k] - (int)colour[12]) <= 10 && abs(disp[k] - disp[12] - off) <= 20 ? (wide)weight[k]
                                                                                                       : 0;
        }
        sst_subpixel_window_row_ref(&out[0], &out[1], &w, 1);
        bound_relative(&b, out[0], want, 0, "sum %.3Lg", want);
    }
    bound_end(&b);
}

/* All pixels of a window on one plane but for `apart`: least squares with the ridge, in wide numbers. */
static void ref_plane(wide out[3], const float *disp, const float *weight, int stride)
{
    wide n = 0, x = 0, y = 0, z = 0, xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, det, u, v;

    for (int pass = 0; pass < 2; pass++) { /* means, then differences from them */
        const wide mx = pass ? x / n : 0, my = pass ? y / n : 0, mz = pass ? z / n : 0;

        for (int i = -3; i <= 3; i++) {
            for (int j = -3; j <= 3; j++) {
                const ptrdiff_t at = SST_SUBPIXEL_STEP * (i * stride + j);
                const wide w = weight[at], a = j - mx, b = i - my, c = (wide)disp[at] - disp[0] - mz;

                n += pass ? 0 : w;
                x += pass ? 0 : w * a;
                y += pass ? 0 : w * b;
                z += pass ? 0 : w * c;
                xx += pass ? w * a * a : 0;
                xy += pass ? w * a * b : 0;
                yy += pass ? w * b * b : 0;
                xz += pass ? w * a * c : 0;
                yz += pass ? w * b * c : 0;
            }
        }
    }
    xx += n * (wide)SST_SUBPIXEL_RIDGE;
    yy += n * (wide)SST_SUBPIXEL_RIDGE;
    det = xx * yy - xy * xy;
    u = (xz * yy - yz * xy) / det;
    v = (yz * xx - xz * xy) / det;
    out[0] = disp[0] + z / n - u * x / n - v * y / n;
    out[1] = u / SST_SUBPIXEL_STEP;
    out[2] = v / SST_SUBPIXEL_STEP;
}

static void subpixel_planes(void **state SST_UNUSED)
{
    enum { SIDE = 2 * SST_SUBPIXEL_REACH + 1, MIDDLE = SST_SUBPIXEL_REACH * SIDE + SST_SUBPIXEL_REACH };
    static uint32_t colour[SIDE * SIDE];
    static float disp[SIDE * SIDE], weight[SIDE * SIDE];
    struct bound b = { "subpixel_plane_row",
                       "float",
                       "px",
                       "9 sums of 49 terms within 1/4 px, det over 1/25 of its terms",
                       1e-5,
                       0,
                       0,
                       "" };
    const struct sst_subpixel_planes p = { colour + MIDDLE, disp + MIDDLE, weight + MIDDLE, SIDE, 10, 0.5F };

    for (int i = 0; i < rounds(5000); i++) {
        float at[1], slope[2] = { 0, 0 };
        wide want[3];

        for (int k = 0; k < SIDE * SIDE; k++) {
            disp[k] = real(2, 2.25);
            weight[k] = i % 3 ? real(10, 1e5) : exp2f(real(4, 16));
            weight[k] = i % 2 || k % SIDE <= SST_SUBPIXEL_REACH ? weight[k] : 0; /* one side alone */
        }
        weight[MIDDLE] += 10;
        ref_plane(want, disp + MIDDLE, weight + MIDDLE, SIDE);
        sst_subpixel_plane_row_ref(at, (float *const[]){ slope, slope + 1 }, &p, 1);
        bound_note(&b, (double)fabsl(at[0] - want[0]), "at %.5Lf", want[0]);
        bound_note(&b, (double)fabsl(slope[0] - want[1]), "to the right %.5Lf", want[1]);
        bound_note(&b, (double)fabsl(slope[1] - want[2]), "down %.5Lf", want[2]);
    }
    bound_end(&b);
}

/* --- rendering ------------------------------------------------------------------------------------------------------
 */

/* One ray per pixel; what it adds, against W_s W_d C in wide numbers. */
static void rays_of_a_view(void **state SST_UNUSED)
{
    static float table[SST_BLEND_COLUMNS];
    static struct sst_blend_labels by;
    /* Exponents are in 2^-10 at least where C1 is 0.001 or more, in 2^-8 where it is 0: two roundings down, slope and
     * focus rounded: three and five steps at the largest exponent. */
    struct bound some = {
        "blend_rays, C1 > 0", "16 bits", "relative", "3 steps of an exponent in 2^-10, blend_near.h", 2.2e-3, 0, 0, ""
    };
    struct bound none = {
        "blend_rays, C1 = 0", "16 bits", "relative", "5 steps of an exponent in 2^-8, blend_near.h", 1.4e-2, 0, 0, ""
    };
    struct bound t = { "blend_take", "float", "levels", "1/2 and 1/32", 0.5 + 1.0 / 32, 0, 0, "" };

    for (int i = 0; i < rounds(30000); i++) {
        const uint8_t top[2] = { (uint8_t)below(256), (uint8_t)below(256) };
        const uint8_t bottom[2] = { (uint8_t)below(256), (uint8_t)below(256) };
        const double fx = sst_random(&seed), fy = below(3) ? sst_random(&seed) : 0;
        const double c1 = below(3) ? 0.001 * below(1000) : 0, sigma = exp2(sst_random_in(&seed, -3, 4));
        const double focus_q6 = sst_random_in(&seed, 0, 8000),
                     far = sst_random_in(&seed, 0, 12.2); /* as plans see to */
        const double at_q6 = focus_q6 + (below(2) ? 64 : -64) * far * sigma;
        const uint16_t disp = (uint16_t)fmin(fmax(at_q6, 0), 65534);
        const uint8_t label = 3;
        struct sst_blend blend = { .top = { top, top, top }, .bottom = { bottom, bottom, bottom } };
        float sum[4][1] = { { 0 }, { 0 }, { 0 }, { 0 } }, taken;
        uint8_t colour[3];
        wide w, c;

        sst_blend_set_taps(blend.tap, fx, fy);
        blend.aperture = real(0.1, 1);
        blend.disp = &disp;
        blend.label = &label;
        blend.by = &by;
        by.range[3].weight = table;
        table[disp >> SST_BLEND_COLUMN_SHIFT] = real(0.05, 1);
        sst_blend_near_set(&blend.near, focus_q6, 64 * sigma, c1);
        sst_blend_rays_ref((float *const[4]){ sum[0], sum[1], sum[2], sum[3] }, &blend, 1, 1);
        w = (wide)blend.aperture * (wide)table[disp >> SST_BLEND_COLUMN_SHIFT] *
            ref_weight_depth((wide)focus_q6, disp, (wide)64 * sigma, (wide)c1);
        c = ref_bilinear(top, bottom, fx, fy);
        bound_relative(c1 > 0 ? &some : &none, sum[3][0], w, 1e-37, "%.2f sigma from the focus, C1 %.3f",
                       fabs(disp - focus_q6) / 64 / sigma, c1);
        sst_blend_take_ref((uint8_t *const[3]){ &colour[0], &colour[1], &colour[2] }, &taken, &blend, 1);
        if (taken != sum[3][0])
            fail_msg("weight %.9g taken, %.9g summed", (double)taken, (double)sum[3][0]);
        bound_note(&t, (double)fabsl(colour[0] - c), "fx %.6f, fy %.6f", fx, fy);
    }
    bound_end(&some);
    bound_end(&none);
    bound_end(&t);
}

static void quotients(void **state SST_UNUSED)
{
    struct bound b = { "blend_finish",       "float", "levels", "1/2 and three roundings of 255",
                       0.5 + 255 * 4 * 6e-8, 0,       0,        "" };

    for (int i = 0; i < rounds(30000); i++) {
        const float weight = exp2f(real(-90, 9)), level = below(4) ? real(0, 255) : (float)(255 * below(2));
        const float sum = weight * level * SST_BLEND_LEVEL;
        uint8_t out;

        sst_blend_finish_ref(&out, &sum, &weight, 1);
        bound_note(&b, (double)fabsl(out - (wide)sum / SST_BLEND_LEVEL / ((wide)weight + (wide)SST_BLEND_TINY)),
                   "weight %.3g, level %.6f", (double)weight, (double)level);
    }
    bound_end(&b);
}

/* --- the clear picture ----------------------------------------------------------------------------------------------
 */

static void landings(void **state SST_UNUSED)
{
    struct bound b = { "clear_land", "float", "px", "q x + x0, two roundings of up to 2^12 px", 1.0 / 1024, 0, 0, "" };

    for (int i = 0; i < rounds(50000); i++) {
        const uint16_t q = (uint16_t)below(65535);
        const double bx = sst_random_in(&seed, -6, 6), min = sst_random_in(&seed, -30, 100);
        const float x_q6 = (float)(bx / 64), x_0 = (float)(min * bx + 0.5);
        const wide want = (wide)q * bx / 64 + min * bx + (wide)0.5;
        const float got = (float)q * x_q6 + x_0;

        bound_note(&b, fabsl(want) < 4096 ? (double)fabsl((wide)got - want) : 0, "q %d, b %.4f, %.1Lf px", q, bx, want);
    }
    bound_end(&b);
}

static void surfaces(void **state SST_UNUSED)
{
    struct bound b = { "clear_surface", "float", "relative", "one quotient of whole numbers: u", 6e-8, 0, 0, "" };
    uint16_t landed[36][SST_CLEAR_BLOCK];
    const uint16_t *rows[36];
    float out[SST_CLEAR_BLOCK];

    for (int k = 0; k < 36; k++)
        rows[k] = landed[k];
    for (int i = 0; i < 500; i++) {
        const unsigned base = 2 * (1 + below(32000));

        for (int k = 0; k < 36; k++) {
            for (int x = 0; x < SST_CLEAR_BLOCK; x++)
                landed[k][x] = (uint16_t)(base + below(90));
        }
        sst_clear_surface_ref(out, rows, 36);
        for (int x = 0; x < SST_CLEAR_BLOCK; x++) {
            wide sum = 0;

            for (int k = 0; k < 36; k++)
                sum += landed[k][x] / 2U;
            bound_relative(&b, out[x], sum / 36, 0, "levels from %u on", base / 2);
        }
    }
    bound_end(&b);
}

/* Colours at 1/64 px: what a neighbour's difference of up to 255 levels makes of half of that. */
static void taken_colours(void **state SST_UNUSED)
{
    struct bound b = {
        "clear_take", "float, 1/64 px", "levels", "2/128 px of 255 levels, and float positions", 4.1, 0, 0, ""
    };
    static uint8_t plane[3][64 * 16 + 15];
    static float weight[2][SST_CLEAR_BLOCK], colour[3][2][SST_CLEAR_BLOCK], agree[2][SST_CLEAR_BLOCK];

    for (int i = 0; i < 500; i++) {
        struct sst_clear_rays rays = { .weight = weight,
                                       .agree = agree,
                                       .colour = { colour[0], colour[1], colour[2] } };
        const struct sst_clear_view v = { .width = 64,
                                          .height = 16,
                                          .plane = { plane[0], plane[1], plane[2] },
                                          .stride = 64,
                                          .bx = real(-2, 2),
                                          .by = real(-2, 2) };
        uint16_t landed[SST_CLEAR_BLOCK];

        for (size_t k = 0; k < sizeof(plane); k++)
            plane[k / sizeof(plane[0])][k % sizeof(plane[0])] = (uint8_t)(i % 2 ? below(256) : 255 * below(2));
        for (int x = 0; x < SST_CLEAR_BLOCK; x++) {
            landed[x] = 201;
            rays.first[x] = rays.last[x] = 100;
            rays.px[x] = real(0, 4);
            rays.wanted[x] = 9;
        }
        sst_clear_take_ref(&rays, &v, landed, 16, 8);
        for (int x = 0; x < SST_CLEAR_BLOCK; x++) {
            const wide at_x = 16 + x - (wide)rays.px[x] * (wide)v.bx, at_y = 8 - (wide)rays.px[x] * (wide)v.by;
            const int x0 = (int)floorl(at_x), y0 = (int)floorl(at_y);

            if (weight[0][x] == 0 || x0 < 0 || y0 < 0 || x0 > 62 || y0 > 14)
                continue;
            bound_note(
                &b,
                (double)fabsl((wide)colour[0][0][x] - ref_bilinear(&plane[0][64 * y0 + x0],
                                                                   &plane[0][64 * y0 + 64 + x0], at_x - x0, at_y - y0)),
                "at %.5Lf %.5Lf", at_x, at_y);
        }
    }
    bound_end(&b);
}

static void blended_colours(void **state SST_UNUSED)
{
    struct bound b = {
        "clear_blend", "float", "levels", "16 rays, two steps; within 1e-3 of the limit of 12 levels left out",
        2e-3,          0,       0,        ""
    };
    static float weight[16][SST_CLEAR_BLOCK], agree[16][SST_CLEAR_BLOCK], colour[3][16][SST_CLEAR_BLOCK];
    const struct sst_clear_rays rays = {
        .slots = 16, .weight = weight, .agree = agree, .colour = { colour[0], colour[1], colour[2] }
    };
    struct sst_clear_colours out;

    for (int i = 0; i < rounds(1000); i++) {
        const float spread = exp2f(real(-2, 8));

        for (int k = 0; k < 16; k++) {
            for (int x = 0; x < SST_CLEAR_BLOCK; x++) {
                weight[k][x] = below(5) ? below(4) ? 1 : SST_CLEAR_RIM : 0;
                for (int c = 0; c < 3; c++)
                    colour[c][k][x] = weight[k][x] > 0 ? fminf(128 + real(-0.5, 0.5) * spread, 255) : 0;
            }
        }
        sst_clear_blend_ref(&out, &rays, -1);
        for (int x = 0; x < SST_CLEAR_BLOCK; x++) {
            wide want[3];

            if (fabsl(ref_clear_blend(want, &rays, x) - 12) < 1e-3L)
                continue;
            for (int c = 0; c < 3; c++)
                bound_note(&b, (double)fabsl((wide)out.colour[c][x] - want[c]), "spread %.2f levels", (double)spread);
        }
    }
    bound_end(&b);
}

/* --- rays that agree, rectification ---------------------------------------------------------------------------------
 */

static void votes(void **state SST_UNUSED)
{
    static uint8_t rarity[SST_AGREE_BINS];
    struct bound b = { "agree_votes", "float", "votes", "truncated: 1, and rounding at whole numbers",
                       1 + 1e-4,      0,       0,       "" };
    const uint8_t black = 0;

    for (int i = 0; i < rounds(50000); i++) {
        const struct sst_voting v = { rarity, real(0, 2), real(0, 3), real(1, 255) };
        const float weight = below(9) ? real(0, 1) : 0;
        wide want;
        uint8_t got;

        rarity[0] = (uint8_t)below(256);
        sst_agree_votes_ref(&got, (const uint8_t *const[3]){ &black, &black, &black }, &weight, &v, 1);
        want = fminl(1 + (wide)v.scale * ((wide)weight + (wide)v.doubt) * rarity[0], (wide)v.most);
        bound_note(&b, (double)(want - got), "%.7Lf votes", want);
        assert_true(got >= want - 1 - 1e-4L && got <= want + 1e-4L);
    }
    bound_end(&b);
}

static void places(void **state SST_UNUSED)
{
    struct bound b = { "place_row", "float", "1/256 px", "1/2, and 3 roundings below 2^18", 0.5 + 0.1, 0, 0, "" };

    for (int i = 0; i < rounds(50000); i++) {
        struct sst_places p = { { 1 << 18, 1 << 18 }, { { 0 } }, { INT32_MAX, INT32_MAX } };
        const float k = (float)below(256);
        wide want;
        int32_t got[2];

        p.c[0][0] = real(-256, 256);
        p.c[0][1] = real(-300, 300);
        p.c[0][2] = real(-0.3, 0.3);
        p.c[0][3] = real(-1e-4, 1e-4);
        sst_place_row_ref(got, &p, k, 1);
        want = (wide)p.c[0][0] + (wide)k * ((wide)p.c[0][1] + (wide)k * ((wide)p.c[0][2] + (wide)k * (wide)p.c[0][3]));
        bound_note(&b, (double)fabsl(got[0] - p.whole_q8[0] - want), "k %g, %.3Lf", (double)k, want);
    }
    bound_end(&b);
}

/* Two roundings on the way: 1/128 level a column, whose weights sum to at most 2, and 1/256 at the end. */
static void resampled(void **state SST_UNUSED)
{
    static int16_t weight[SST_RESAMPLE_PHASES][6];
    struct bound b = {
        "resample_row", "whole numbers", "levels", "2/128 by columns, 1/256 by the sum", 2 / 128.0 + 1 / 256.0, 0, 0, ""
    };
    uint8_t pixel[6][32];
    uint16_t out[3];

    for (int p = 0; p < SST_RESAMPLE_PHASES; p++) { /* sums of 2^14 with negative lobes */
        const int lobe = (int)below(2048), right = p * 64;

        memcpy(weight[p],
               ((int16_t[]){ (int16_t)(lobe / 2), (int16_t)-lobe, (int16_t)(16384 - right + lobe / 2),
                             (int16_t)(right + lobe / 2), (int16_t)-lobe, (int16_t)(lobe / 2) }),
               sizeof(weight[p]));
    }
    for (int i = 0; i < rounds(30000); i++) {
        const int32_t at[2] = { (2 << 8) + (int32_t)below(256), (2 << 8) + (int32_t)below(256) };
        const struct sst_resample from = { pixel[0], 32, weight[0], 6 };
        wide want = 0;

        for (size_t k = 0; k < sizeof(pixel); k++)
            pixel[k / 32][k % 32] = (uint8_t)(i % 2 ? below(256) : 255 * below(2));
        sst_resample_row_ref((uint16_t *const[3]){ &out[0], &out[1], &out[2] }, &from, at, 1);
        for (int ty = 0; ty < 6; ty++) {
            for (int tx = 0; tx < 6; tx++)
                want += (wide)weight[at[1] & 255][ty] * weight[at[0] & 255][tx] * pixel[ty][4 * tx];
        }
        want = fminl(fmaxl(want / (16384.0L * 16384), 0), 255);
        bound_note(&b, (double)fabsl(out[0] / 128.0L - want), "phases %d %d, %.4Lf", at[0] & 255, at[1] & 255, want);
    }
    bound_end(&b);
}

/* Places are rounded to 1/256 px, so the level may be off by 1/512 of the differences across and down. */
static void posed_levels(void **state SST_UNUSED)
{
    struct bound b = { "warped_row",
                       "whole numbers",
                       "levels of 65535",
                       "1/512 of the largest difference twice, 1/128 of the sum",
                       2 * 65535 / 512.0 + 1 / 128.0,
                       0,
                       0,
                       "" };

    for (int i = 0; i < rounds(30000); i++) {
        const uint16_t level[4] = { (uint16_t)below(65536), (uint16_t)below(65536), (uint16_t)below(65536),
                                    (uint16_t)(i % 2 ? below(65536) : 65535 * below(2)) };
        const struct sst_warped_source from = { { level }, 2, 2, 2, 1 };
        const struct sst_warped_segment s = { (int32_t)below(65537), (int32_t)below(65537), 0, 0, 0, 1 };
        const wide x = s.x_q16 / 65536.0L, y = s.y_q16 / 65536.0L;
        const wide want = (1 - y) * ((1 - x) * level[0] + x * level[1]) + y * ((1 - x) * level[2] + x * level[3]);
        uint32_t sum = 0;
        uint16_t count = 0;

        sst_warped_row_ref(&(uint32_t *const){ &sum }, &count, &from, &s, 1);
        bound_note(&b, (double)fabsl(sum / 64.0L - want), "place %d %d, %.4Lf", s.x_q16, s.y_q16, want);
    }
    bound_end(&b);
}

/* Column sums of a random window of two views, and its moments in standard deviations: means, squares, product. */
static void random_window(int32_t column[5][SST_WINDOW], wide moment[5])
{
    const int32_t middle[2] = { (int32_t)below(2 * 3000) - 3000, (int32_t)below(2 * 3000) - 3000 };
    const int32_t spread = (int32_t)below(1000) + 1;

    memset(column, 0, 5 * sizeof(*column));
    memset(moment, 0, 5 * sizeof(*moment));
    for (int i = 0; i < SST_WINDOW_AREA; i++) {
        int32_t v[2];

        for (int k = 0; k < 2; k++)
            v[k] = middle[k] + (int32_t)below((uint32_t)(2 * spread)) - spread;
        for (int m = 0; m < 5; m++) {
            const int32_t term = m < 2 ? v[m] : m < 4 ? v[m - 2] * v[m - 2] : v[0] * v[1];

            column[m][i % SST_WINDOW] += term;
            moment[m] += (wide)term / SST_WINDOW_AREA / SST_LEVEL_ONE / (m < 2 ? 1 : SST_LEVEL_ONE);
        }
    }
}

/* Squares of 6 standard deviations lose what floats of 36 do, over the square root of the floor. */
static void windows(void **state SST_UNUSED)
{
    struct bound stats = { "window_stats", "float", "relative", "5e-6, and 36 in floats over twice a floor of 0.01",
                           6e-4,           0,       0,          "" };
    struct bound best = {
        "window_best", "float", "of a correlation", "5e-6, and 36 in floats over a floor of 0.01", 2e-3, 0, 0, ""
    };

    for (int i = 0; i < rounds(30000); i++) {
        int32_t column[5][SST_WINDOW];
        float mean[2], inverse[2], got = 0;
        wide moment[5], deviation[2], want;

        random_window(column, moment);
        for (int k = 0; k < 2; k++) {
            const struct sst_window_sums in = { column[k], column[2 + k], { NULL, NULL }, 0.01f };

            sst_window_stats_ref(&mean[k], &inverse[k], &in, 1);
            deviation[k] = sqrtl(moment[2 + k] - moment[k] * moment[k] + 0.01L);
            bound_note(&stats, (double)fabsl((wide)inverse[k] * deviation[k] - 1), "mean %.4Lf, deviation %.5Lf",
                       moment[k], deviation[k]);
        }
        want = (moment[4] - moment[0] * moment[1] + 0.01L * fmaxl(0, 1 - fabsl(moment[0] - moment[1]))) /
               (deviation[0] * deviation[1]);
        sst_window_best_ref(&got,
                            &(struct sst_window_row){ .mean = &mean[0],
                                                      .inverse = &inverse[0],
                                                      .other_mean = { &mean[1] },
                                                      .other_inverse = { &inverse[1] },
                                                      .products = { column[4] },
                                                      .others = 1,
                                                      .floor = 0.01f },
                            1);
        bound_note(&best, (double)fabsl(2 * (wide)got - fmaxl(want, 0)), "means %.4Lf %.4Lf", moment[0], moment[1]);
    }
    bound_end(&stats);
    bound_end(&best);
}

static double to_light(double v)
{
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double to_code(double light)
{
    return light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1 / 2.4) - 0.055;
}

static void light(void **state SST_UNUSED)
{
    struct bound b = { "light_row", "float", "levels", "1/2 and 0.02, factors of 1/8 to 8", 0.52, 0, 0, "" };

    for (int i = 0; i < rounds(100000); i++) {
        const uint16_t value = (uint16_t)below(SST_LIGHT_WHITE + 1);
        const double f = exp2(sst_random_in(&seed, -3, 3)), v = value / 128.0;
        const float falloff = (float)f, root = (float)pow(f, 1 / 2.4);
        const struct sst_light l = { &value, &falloff, &root, 1, 1 };
        const double want =
            fmin(255, fmax(255 * to_code(fmin(1, f * to_light(v / 255))), 255 - SST_LIGHT_KEEP * (255 - v)));
        uint8_t out;

        sst_light_row_ref(&out, &l, 1);
        bound_note(&b, fabs(out - want), "%.4f levels times %.5f", v, f);
    }
    bound_end(&b);
}

/* Kernels with a line above, beside those that count. */
static const char *const measured[] = {
    "class_row",          "guide_cells",         "support_mean_row", "bilateral_row", "subpixel_fit_row",
    "subpixel_plane_row", "subpixel_window_row", "blend_rays",       "blend_take",    "blend_finish",
    "clear_land",         "clear_surface",       "clear_take",       "clear_blend",   "agree_votes",
    "place_row",          "resample_row",        "light_row",        "warped_row",    "window_stats",
    "window_best",        "conv_finish"
};

static void every_kernel_has_a_bound(void **state SST_UNUSED)
{
#define X(name) #name,
    static const char *const all[] = { SST_KERNEL_LIST(X) };
#undef X

    for (size_t i = 0; i < ARRAY_LEN(all); i++) {
        bool found = false;

        for (size_t k = 0; k < ARRAY_LEN(counted); k++)
            found |= !strcmp(counted[k].name, all[i]);
        for (size_t k = 0; k < ARRAY_LEN(measured); k++)
            found |= !strcmp(measured[k], all[i]);
        if (!found)
            fail_msg("%s: no bound; add it to tests/kernels/bounds.c", all[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kernel_has_a_bound),
        cmocka_unit_test(whole_numbers_have_room),
        cmocka_unit_test(exponentials),
        cmocka_unit_test(logarithms),
        cmocka_unit_test(entropy_of_distributions),
        cmocka_unit_test(guided_cells),
        cmocka_unit_test(finished_sums),
        cmocka_unit_test(support_means),
        cmocka_unit_test(bilateral_means),
        cmocka_unit_test(parabolas),
        cmocka_unit_test(subpixel_steps),
        cmocka_unit_test(subpixel_windows),
        cmocka_unit_test(subpixel_planes),
        cmocka_unit_test(rays_of_a_view),
        cmocka_unit_test(quotients),
        cmocka_unit_test(landings),
        cmocka_unit_test(surfaces),
        cmocka_unit_test(taken_colours),
        cmocka_unit_test(blended_colours),
        cmocka_unit_test(votes),
        cmocka_unit_test(places),
        cmocka_unit_test(resampled),
        cmocka_unit_test(posed_levels),
        cmocka_unit_test(windows),
        cmocka_unit_test(light),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
