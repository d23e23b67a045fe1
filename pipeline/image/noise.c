/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "base/stats.h"
#include "pipeline/image/image.h"

#define BLOCK    8
#define MOST     2048 /* blocks */
#define DARK     16   /* mean levels: clipped noise is small */
#define BRIGHT   239
#define QUANTILE 20 /* one block in this many is below */

/* Sum of |response| over a block's pixels; -1: dark or bright. */
static int response(const struct sst_image *img, int x0, int y0)
{
    int sum = 0, level = 0;

    for (int y = y0; y < y0 + BLOCK; y++) {
        const uint8_t *a = sst_image_row(img, 1, y - 1) + x0, *b = sst_image_row(img, 1, y) + x0,
                      *c = sst_image_row(img, 1, y + 1) + x0;

        for (int x = 0; x < BLOCK; x++) {
            sum += abs(a[x - 1] - 2 * a[x] + a[x + 1] - 2 * (b[x - 1] - 2 * b[x] + b[x + 1]) + c[x - 1] - 2 * c[x] +
                       c[x + 1]);
            level += b[x];
        }
    }
    return level < DARK * BLOCK * BLOCK || level > BRIGHT * BLOCK * BLOCK ? -1 : sum;
}

double sst_image_noise(const struct sst_image *img)
{
    const int cols = (img->width - 2) / BLOCK, rows = (img->height - 2) / BLOCK;
    int found[MOST], n = 0, step = 1;

    while (cols > 0 && rows > 0 && (int64_t)((cols - 1) / step + 1) * ((rows - 1) / step + 1) > MOST)
        step++;
    for (int row = 0; row < rows; row += step) {
        for (int col = 0; col < cols; col += step) {
            const int sum = response(img, 1 + col * BLOCK, 1 + row * BLOCK);

            if (sum >= 0)
                found[n++] = sum;
        }
    }
    if (!n)
        return 0;
    sst_stats_sort_int(found, n);
    return sqrt(M_PI / 2) / 6 * found[n / QUANTILE] / (BLOCK * BLOCK);
}

#define CONTRAST_STEP 4

double sst_image_contrast(const struct sst_image *img)
{
    return sst_image_channel_contrast(img, 1, CONTRAST_STEP);
}

double sst_image_channel_contrast(const struct sst_image *img, int channel, int step)
{
    int64_t sum = 0, squares = 0, n = 0;

    for (int y = 0; y < img->height; y += step) {
        const uint8_t *row = sst_image_row(img, channel, y);

        for (int x = 0; x < img->width; x += step, n++) {
            sum += row[x];
            squares += row[x] * row[x];
        }
    }
    return n ? sqrt(fmax((double)squares / (double)n - (double)sum / (double)n * ((double)sum / (double)n), 0)) : 0;
}
