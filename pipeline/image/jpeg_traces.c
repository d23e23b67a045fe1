/* Traces of JPEG in decoded pixels: in blocks of 8x8 pixels from the corner on, each frequency of the luma is a
 * multiple of its quantisation step. Scenes do not prefer multiples of anything, so that the mean of
 * cos(2 pi coefficient / step) is near 0 but for that step (and its parts). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "base/stats.h"
#include "pipeline/image/image.h"

#define BLOCK      8
#define BLOCKS     600 /* at most, spread over the picture */
#define LOWEST     9   /* frequencies that are tested */
#define STEP_MOST  60
#define STEP_LEAST 3    /* below, rounding of the pixels hides it: quality 90 */
#define OUTSIDE    0.6  /* steps: coefficients nearer to 0 say nothing */
#define VALUES     30   /* of a frequency; with fewer it has no step */
#define AGREE      0.5  /* mean of the cosines; chance has 1 / sqrt(2 VALUES) = 0.13, 58 steps reach 0.4 */
#define BETTER     0.15 /* ... by which a part of a step must be better than the step */
#define STEPS      4    /* frequencies with a step */

/* Row and column of the frequency, and its step at quality 50 (ISO/IEC 10918-1, table K.1). */
static const int lowest[LOWEST][3] = { { 0, 1, 11 }, { 1, 0, 12 }, { 1, 1, 12 }, { 0, 2, 10 }, { 2, 0, 14 },
                                       { 1, 2, 14 }, { 2, 1, 13 }, { 0, 3, 16 }, { 3, 0, 14 } };

static void read_block(double luma[BLOCK][BLOCK], const struct sst_image *image, int x0, int y0)
{
    for (int y = 0; y < BLOCK; y++) {
        const uint8_t *r = sst_image_row(image, 0, y0 + y) + x0, *g = sst_image_row(image, 1, y0 + y) + x0,
                      *b = sst_image_row(image, 2, y0 + y) + x0;

        for (int x = 0; x < BLOCK; x++)
            luma[y][x] = 0.299 * r[x] + 0.587 * g[x] + 0.114 * b[x];
    }
}

/* Coefficients of all blocks. @param out  [LOWEST][BLOCKS] @return blocks */
static int transform(double (*out)[BLOCKS], const struct sst_image *image)
{
    const int cols = image->width / BLOCK, rows = image->height / BLOCK;
    double basis[4][BLOCK], luma[BLOCK][BLOCK];
    int step = 1, n = 0;

    for (int u = 0; u < 4; u++) {
        for (int x = 0; x < BLOCK; x++)
            basis[u][x] = cos((2 * x + 1) * u * M_PI / 16) * (u ? 0.5 : sqrt(0.125));
    }
    while (cols > 0 && rows > 0 && ((cols - 1) / step + 1) * ((rows - 1) / step + 1) > BLOCKS)
        step++;
    for (int row = 0; row < rows; row += step) {
        for (int col = 0; col < cols; col += step, n++) {
            read_block(luma, image, col * BLOCK, row * BLOCK);
            for (int f = 0; f < LOWEST; f++) {
                double sum = 0;

                for (int y = 0; y < BLOCK; y++) {
                    for (int x = 0; x < BLOCK; x++)
                        sum += basis[lowest[f][0]][y] * basis[lowest[f][1]][x] * luma[y][x];
                }
                out[f][n] = sum;
            }
        }
    }
    return n;
}

/* cos(2 pi turns), within 1e-8: means of thousands are compared with thresholds. */
static double cos_turns(double turns)
{
    const double whole = (turns + 0x1.8p52) - 0x1.8p52; /* rounds to the nearest */
    const double x = M_PI * (turns - whole), x2 = x * x;
    const double sine =
        x * (1 + x2 * (-1. / 6 + x2 * (1. / 120 + x2 * (-1. / 5040 + x2 * (1. / 362880 - x2 / 39916800)))));

    return 1 - 2 * sine * sine;
}

/* The step of a frequency; 0: none is seen. */
static int find_step(const double *coefficient, int n)
{
    double best = 0;
    int found = 0;

    for (int step = STEP_MOST; step >= STEP_LEAST; step--) {
        double sum = 0;
        int used = 0;

        for (int i = 0; i < n; i++) {
            if (fabs(coefficient[i]) > OUTSIDE * step) {
                sum += cos_turns(coefficient[i] / step);
                used++;
            }
        }
        if (used >= VALUES && sum / used > AGREE && sum / used > (found ? best + BETTER : 0)) {
            best = sum / used;
            found = step;
        }
    }
    return found;
}

double sst_image_jpeg_quality(const struct sst_image *image)
{
    double(*coefficient)[BLOCKS] = malloc(LOWEST * sizeof(*coefficient)), percent[LOWEST], scale;
    int n, steps = 0;

    if (!coefficient)
        return NAN;
    n = transform(coefficient, image);
    for (int f = 0; f < LOWEST; f++) {
        const int step = find_step(coefficient[f], n);

        if (step)
            percent[steps++] = 100.0 * step / lowest[f][2];
    }
    free(coefficient);
    if (steps < STEPS)
        return NAN;
    scale = sst_stats_median(percent, steps);
    return scale <= 100 ? (200 - scale) / 2 : 5000 / scale;
}
