/* Blur of a picture's sharpest edges: an edge that is blurred again by a known width loses the less the wider it was
 * (Zhuo and Sim 2011). The sharpest edges do not depend on the scene, but for views out of focus. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "base/stats.h"
#include "pipeline/image/image.h"

#define TILE     32 /* px */
#define TILES    64 /* at most, spread over the picture */
#define AGAIN_PX 1.0
#define TAPS     4 /* either way, of the second blur */
#define MARGIN   (TAPS + 1)
#define SIDE     (TILE + 2 * MARGIN)
#define STEEP    0.9 /* quantile of the gradients from which a pixel is on an edge */
#define LEAST    8.0 /* levels per px: weaker ones are noise */
#define SHARPEST 0.9 /* quantile of the ratios */
#define EDGES    50  /* pixels; with fewer nothing is measured */

struct tile {
    double level[SIDE][SIDE], across[SIDE][SIDE], blurred[SIDE][SIDE];
};

static bool read_tile(struct tile *t, const struct sst_image *image, const struct sst_map_u8 *valid, int x0, int y0)
{
    for (int y = 0; y < SIDE; y++) {
        const uint8_t *row = sst_image_row(image, 1, y0 + y) + x0;
        const uint8_t *seen = valid && valid->data ? sst_map_u8_row(valid, y0 + y) + x0 : NULL;

        for (int x = 0; x < SIDE; x++) {
            if (seen && !seen[x])
                return false;
            t->level[y][x] = row[x];
        }
    }
    return true;
}

static void blur_tile(struct tile *t, const double weight[TAPS + 1])
{
    for (int y = 0; y < SIDE; y++) {
        for (int x = TAPS; x < SIDE - TAPS; x++) {
            double sum = weight[0] * t->level[y][x];

            for (int i = 1; i <= TAPS; i++)
                sum += weight[i] * (t->level[y][x - i] + t->level[y][x + i]);
            t->across[y][x] = sum;
        }
    }
    for (int y = TAPS; y < SIDE - TAPS; y++) {
        for (int x = TAPS; x < SIDE - TAPS; x++) {
            double sum = weight[0] * t->across[y][x];

            for (int i = 1; i <= TAPS; i++)
                sum += weight[i] * (t->across[y - i][x] + t->across[y + i][x]);
            t->blurred[y][x] = sum;
        }
    }
}

static double gradient(double v[SIDE][SIDE], int x, int y)
{
    const double across = v[y][x + 1] - v[y][x - 1], down = v[y + 1][x] - v[y - 1][x];

    return 0.5 * sqrt(across * across + down * down);
}

/* Gradients before and after the second blur. @return how many pixels */
static int measure_tile(struct tile *t, double *before, double *after)
{
    int n = 0;

    for (int y = MARGIN; y < SIDE - MARGIN; y++) {
        for (int x = MARGIN; x < SIDE - MARGIN; x++) {
            before[n] = gradient(t->level, x, y);
            after[n++] = gradient(t->blurred, x, y);
        }
    }
    return n;
}

static int measure(double *before, double *after, struct tile *t, const struct sst_image *image,
                   const struct sst_map_u8 *valid)
{
    const int cols = (image->width - 2 * MARGIN) / TILE, rows = (image->height - 2 * MARGIN) / TILE;
    double weight[TAPS + 1], sum = 0;
    int step = 1, n = 0;

    for (int i = 0; i <= TAPS; i++) {
        weight[i] = exp(-0.5 * (i / AGAIN_PX) * (i / AGAIN_PX));
        sum += i ? 2 * weight[i] : weight[i];
    }
    for (int i = 0; i <= TAPS; i++)
        weight[i] /= sum;
    while (cols > 0 && rows > 0 && ((cols - 1) / step + 1) * ((rows - 1) / step + 1) > TILES)
        step++;
    for (int row = 0; row < rows; row += step) {
        for (int col = 0; col < cols; col += step) {
            if (!read_tile(t, image, valid, col * TILE, row * TILE))
                continue;
            blur_tile(t, weight);
            n += measure_tile(t, before + n, after + n);
        }
    }
    return n;
}

double sst_image_edge_px(const struct sst_image *image, const struct sst_map_u8 *valid)
{
    const size_t most = (size_t)TILES * TILE * TILE;
    double *before = malloc(2 * most * sizeof(*before)), *sorted = malloc(most * sizeof(*sorted)),
           *after = before + most;
    struct tile *tile = malloc(sizeof(*tile));
    double px = NAN, ratio;
    int n = 0, edges = 0;

    if (before && sorted && tile)
        n = measure(before, after, tile, image, valid);
    if (n) {
        for (int i = 0; i < n; i++)
            sorted[i] = before[i];
        const double least = fmax(sst_stats_quantile(sorted, n, STEEP), LEAST);

        for (int i = 0; i < n; i++) {
            if (before[i] >= least)
                sorted[edges++] = before[i] / fmax(after[i], 1e-3);
        }
    }
    if (edges >= EDGES) {
        ratio = sst_stats_quantile(sorted, edges, SHARPEST);
        px = AGAIN_PX / sqrt(fmax(ratio * ratio - 1, 1e-3));
    }
    free(before);
    free(sorted);
    free(tile);
    return px;
}
