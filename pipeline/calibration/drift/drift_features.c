/* Grey pyramids of the views, and features: one well textured place per cell of the picture.
 *
 * Only the levels that the search needs are made: the half-size level in one pass over the picture, smaller ones from
 * it. Full size is read around features alone (drift_read_patch). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "base/stats.h"
#include "pipeline/calibration/drift/drift_internal.h"

#define WINDOW   3  /* radius of a feature's structure tensor, half-size px */
#define MARGIN   6  /* features keep this far from the edge, half-size px: windows and filters fit */
/* Least eigenvalue of the structure tensor, (grey levels / half-size px)^2: rounding alone gives 1/12. */
#define TEXTURE_FLOOR 0.25
#define TEXTURE_NOISE 15.0 /* and this many times the noise's */
#define NOISE_CAP     3.0  /* grey levels: more than that is texture everywhere */
#define NOISE_BLOCK   8    /* half-size px */
#define NOISE_BLOCKS  2000 /* at most */
#define NOISE_BIAS    1.25 /* of the 2 % of blocks with the least noise, where there is nothing but noise */
#define CELL_STEP     2    /* the least eigenvalue is computed on every second pixel both ways */

void drift_level_size(const struct drift_pyramid *view, int level, int *width, int *height)
{
    *width = level ? view->level[level].width : view->image->width;
    *height = level ? view->level[level].height : view->image->height;
}

/* Four pixels of R + 2 G + B: a rounded mean. @return 0, -ENOMEM */
static int halve_colour(struct sst_map_u8 *out, const struct sst_image *in)
{
    const int width = 2 * out->width;
    uint16_t *sum = sst_mem_alloc((size_t)width, sizeof(*sum)); /* of two rows */

    if (!sum)
        return -ENOMEM;
    for (int y = 0; y < out->height; y++) {
        uint8_t *to = sst_map_u8_row(out, y);
        const uint8_t *p[2][3];

        for (int i = 0; i < 2; i++) {
            for (int c = 0; c < 3; c++)
                p[i][c] = sst_image_row(in, c, 2 * y + i);
        }
        for (int x = 0; x < width; x++)
            sum[x] =
                (uint16_t)(p[0][0][x] + p[1][0][x] + 2 * (p[0][1][x] + p[1][1][x]) + p[0][2][x] + p[1][2][x] + 4);
        for (int x = 0; x < out->width; x++)
            to[x] = (uint8_t)((sum[2 * x] + sum[2 * x + 1]) >> 4);
    }
    sst_mem_free(sum);
    return 0;
}

/* --- features ----------------------------------------------------------------------------------------------------- */

#define ROWS (2 * WINDOW + 1)

/* Products of Sobel derivatives (8 times the slope), summed over the rows of the window, the last one replacing the
 * first, then over its columns: whole numbers, so exact. */
struct tensor {
    int32_t *row[3][ROWS]; /* [width] xx, xy, yy of the rows: row y in y % ROWS */
    int32_t *sum[3];       /* [width] over the rows */
    int32_t *window[3];    /* [width] around each column */
    int16_t *slope[2];     /* [width] of one row; 0 at its ends */
    int width;
};

/* Replace a row of products; the sums get the differences. */
static void replace_products(int32_t *restrict sum, int32_t *restrict row, const int16_t *a, const int16_t *b, int n)
{
    for (int x = 0; x < n; x++) {
        const int32_t product = a[x] * b[x];

        sum[x] += product - row[x];
        row[x] = product;
    }
}

static void slopes(int16_t *restrict gx, int16_t *restrict gy, const uint8_t *p, size_t stride, int n)
{
    const uint8_t *q = p + stride, *r = q + stride;

    for (int x = 1; x < n - 1; x++) {
        gx[x] = (int16_t)((p[x + 1] - p[x - 1]) + 2 * (q[x + 1] - q[x - 1]) + (r[x + 1] - r[x - 1]));
        gy[x] = (int16_t)((r[x - 1] - p[x - 1]) + 2 * (r[x] - p[x]) + (r[x + 1] - p[x + 1]));
    }
}

static void replace_row(struct tensor *t, const struct sst_map_u8 *grey, int y)
{
    slopes(t->slope[0], t->slope[1], sst_map_u8_row(grey, y - 1), grey->stride, t->width);
    for (int i = 0; i < 3; i++)
        replace_products(t->sum[i], t->row[i][y % ROWS], t->slope[i / 2], t->slope[(i + 1) / 2], t->width);
}

static void sum_columns(struct tensor *t)
{
    for (int i = 0; i < 3; i++) {
        const int32_t *restrict v = t->sum[i];
        int32_t *restrict out = t->window[i];
        const int end = t->width - WINDOW;

        for (int x = WINDOW; x < end; x++)
            out[x] = v[x - 3] + v[x - 2] + v[x - 1] + v[x] + v[x + 1] + v[x + 2] + v[x + 3];
    }
}

#define TENSOR_SCALE (1.0 / (64.0 * ROWS * ROWS)) /* of the sums: to (grey levels / px)^2 */

/* Least eigenvalue of the mean tensor around x, (grey levels / px)^2. */
static double least_eigenvalue(const struct tensor *t, int x)
{
    const double xy = t->window[1][x];
    const double half = 0.5 * (double)(t->window[0][x] + t->window[2][x]);
    const double diff = 0.5 * (double)(t->window[0][x] - t->window[2][x]);

    return TENSOR_SCALE * (half - sqrt(diff * diff + xy * xy));
}

/* Lower bound of both diagonal entries of a tensor with a least eigenvalue above e, which no entry is below. */
static int32_t least_entries(double e)
{
    return (int32_t)(e / TENSOR_SCALE) - 1;
}

/* Mean square of second differences both ways (Immerkaer 1996) in a block, over the 36 that they have of white noise of
 * 1; negative: clipped values. */
static float block_noise(const struct sst_map_u8 *grey, int x0, int y0)
{
    int sum = 0, squares = 0;

    for (int y = y0; y < y0 + NOISE_BLOCK; y++) {
        const uint8_t *p = sst_map_u8_row(grey, y - 1), *q = p + grey->stride, *r = q + grey->stride;

        for (int x = x0; x < x0 + NOISE_BLOCK; x++) {
            const int d =
                p[x - 1] - 2 * p[x] + p[x + 1] - 2 * (q[x - 1] - 2 * q[x] + q[x + 1]) + r[x - 1] - 2 * r[x] + r[x + 1];

            sum += q[x];
            squares += d * d;
        }
    }
    if (sum < 4 * NOISE_BLOCK * NOISE_BLOCK || sum > 251 * NOISE_BLOCK * NOISE_BLOCK)
        return -1;
    return (float)squares / (36.0f * NOISE_BLOCK * NOISE_BLOCK);
}

/* RMS of noise in grey levels, from the least of many small blocks: texture only adds. */
static double noise_of(const struct sst_map_u8 *grey)
{
    const int step = sst_max_int(NOISE_BLOCK, (int)sqrt((double)grey->width * grey->height / NOISE_BLOCKS) + 1);
    float v[NOISE_BLOCKS];
    int n = 0;

    for (int y = 1; y + NOISE_BLOCK < grey->height; y += step) {
        for (int x = 1; x + NOISE_BLOCK < grey->width; x += step) {
            const float noise = block_noise(grey, x, y);

            if (noise >= 0 && n < NOISE_BLOCKS)
                v[n++] = noise;
        }
    }
    if (!n)
        return 0;
    return NOISE_BIAS * sqrt(sst_stats_quantile_float(v, n, (n / 50 + 0.5) / n));
}

/* Derivatives of white noise of 1 by Sobel / 8 have a variance of 12 / 64. */
static double texture_needed(double noise)
{
    return fmax(TEXTURE_FLOOR, TEXTURE_NOISE * noise * noise * 12.0 / 64.0);
}

#define PARTS_X (DRIFT_CELLS_X * DRIFT_SPLIT)
#define PARTS_Y (DRIFT_CELLS_Y * DRIFT_SPLIT)

/* Cell by cell, the best first. */
static void sort_features(struct drift_pyramid *view, const double *best, const struct drift_feature *at)
{
    int n = 0;

    for (int cell = 0; cell < DRIFT_CELLS; cell++) {
        const int x0 = cell % DRIFT_CELLS_X * DRIFT_SPLIT, y0 = cell / DRIFT_CELLS_X * DRIFT_SPLIT;
        double value[DRIFT_SPLIT * DRIFT_SPLIT];
        const int first = n;

        view->first[cell] = n;
        for (int k = 0; k < DRIFT_SPLIT * DRIFT_SPLIT; k++) {
            const int part = (y0 + k / DRIFT_SPLIT) * PARTS_X + x0 + k % DRIFT_SPLIT;
            int i = n;

            if (best[part] <= 0)
                continue;
            for (; i > first && value[i - 1 - first] < best[part]; i--) {
                value[i - first] = value[i - 1 - first];
                view->feature[i] = view->feature[i - 1];
            }
            value[i - first] = best[part];
            view->feature[i] = at[part];
            n++;
        }
    }
    view->first[DRIFT_CELLS] = n;
}

/* Whether all pixels around a position of level 1 are valid. The invalid part of a rectified view is a border without
 * holes, so its corners suffice. */
static bool is_valid_around(const struct sst_map_u8 *valid, int x, int y)
{
    const int reach = 2 * MARGIN;

    if (!valid->data)
        return true;
    for (int i = 0; i < 4; i++) {
        const int at_x = sst_clamp_int(2 * x + (i & 1 ? reach : -reach), 0, valid->width - 1);
        const int at_y = sst_clamp_int(2 * y + (i & 2 ? reach : -reach), 0, valid->height - 1);

        if (!sst_map_u8_row(valid, at_y)[at_x])
            return false;
    }
    return true;
}

/* Best place of every part of every cell. */
static int find_features(struct drift_pyramid *view, const struct sst_map_u8 *valid)
{
    const struct sst_map_u8 *grey = &view->level[1];
    const double needed = texture_needed(view->noise);
    double best[PARTS_X * PARTS_Y] = { 0 };
    struct drift_feature at[PARTS_X * PARTS_Y];
    int32_t least[PARTS_X * PARTS_Y];
    struct tensor t = { .width = grey->width };
    int32_t *rows = sst_mem_alloc((size_t)grey->width * (3 * (ROWS + 2) + 2), sizeof(*rows)), *row = rows;

    if (!rows)
        return -ENOMEM;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < ROWS; k++, row += t.width)
            t.row[i][k] = row;
        t.sum[i] = row;
        t.window[i] = row + t.width;
        row += 2 * t.width;
    }
    t.slope[0] = (int16_t *)(row + t.width);
    t.slope[1] = t.slope[0] + t.width;
    for (int x = 0; x < grey->width; x++)
        row[x] = x * PARTS_X / grey->width; /* its part */
    for (int i = 0; i < PARTS_X * PARTS_Y; i++)
        least[i] = least_entries(needed);
    for (int y = MARGIN - WINDOW; y < MARGIN + WINDOW; y++)
        replace_row(&t, grey, y);
    for (int y = MARGIN; y < grey->height - MARGIN; y++) {
        replace_row(&t, grey, y + WINDOW);
        if (y % CELL_STEP)
            continue;
        sum_columns(&t);
        for (int x = MARGIN; x < grey->width - MARGIN; x += CELL_STEP) {
            const int i = y * PARTS_Y / grey->height * PARTS_X + row[x];
            double e;

            if (t.window[0][x] <= least[i] || t.window[2][x] <= least[i])
                continue;
            e = least_eigenvalue(&t, x);
            if (e > needed && e > best[i] && is_valid_around(valid, x, y)) {
                best[i] = e;
                least[i] = least_entries(e);
                at[i] = (struct drift_feature){ 2 * x, 2 * y };
            }
        }
    }
    sst_mem_free(rows);
    sort_features(view, best, at);
    return 0;
}

int drift_pyramid_init(struct drift_pyramid *view, const struct sst_image *image, const struct sst_map_u8 *valid,
                       int side)
{
    int w = image->width, h = image->height, err = 0;

    *view = (struct drift_pyramid){ .image = image, .levels = 1 };
    if (w < DRIFT_SMALLEST || h < DRIFT_SMALLEST)
        return -EBADMSG;
    do {
        const int i = view->levels;

        w /= 2;
        h /= 2;
        err = i == 1 ? sst_map_u8_init(&view->level[i], w, h) : sst_map_u8_halve(&view->level[i], &view->level[i - 1]);
        if (err)
            break;
        view->levels++;
        if (i == 1)
            err = halve_colour(&view->level[i], image);
    } while (!err && sst_max_int(w, h) > side && sst_min_int(w, h) >= DRIFT_SMALLEST && view->levels < DRIFT_LEVELS);
    if (!err) {
        view->noise = fmin(noise_of(&view->level[1]), NOISE_CAP);
        err = find_features(view, valid);
    }
    if (err)
        drift_pyramid_fini(view);
    return err;
}

void drift_pyramid_fini(struct drift_pyramid *view)
{
    for (int i = 1; i < DRIFT_LEVELS; i++)
        sst_map_u8_fini(&view->level[i]);
    *view = (struct drift_pyramid){ 0 };
}

/* --- patches ------------------------------------------------------------------------------------------------------ */

int drift_to_level(int x, int level)
{
    return (int)floor((x - 0.5 * ((1 << level) - 1)) / (1 << level) + 0.5);
}

void drift_read_grey(int16_t *out, const struct drift_pyramid *view, int level, struct sst_rect part)
{
    const int n = part.x1 - part.x0;

    for (int y = part.y0; y < part.y1; y++, out += n) {
        if (level) {
            const uint8_t *p = sst_map_u8_row(&view->level[level], y) + part.x0;

            for (int x = 0; x < n; x++)
                out[x] = p[x];
        } else {
            const uint8_t *r = sst_image_row(view->image, 0, y) + part.x0;
            const uint8_t *g = sst_image_row(view->image, 1, y) + part.x0;
            const uint8_t *b = sst_image_row(view->image, 2, y) + part.x0;

            for (int x = 0; x < n; x++)
                out[x] = (int16_t)((r[x] + 2 * g[x] + b[x] + 2) >> 2);
        }
    }
}

#define PATCH_MAX 64 /* with the margin */

/* Columns x0 .. x1 - 1 of a row of grey values: at full size R + 2 G + B over 4, unrounded. */
static void grey_row(float *out, const struct drift_pyramid *view, int level, int y, const int x[2])
{
    const int x0 = x[0], n = x[1] - x0;

    if (level) {
        const uint8_t *p = sst_map_u8_row(&view->level[level], y) + x0;

        for (int i = 0; i < n; i++)
            out[i] = p[i];
    } else {
        const uint8_t *r = sst_image_row(view->image, 0, y) + x0, *g = sst_image_row(view->image, 1, y) + x0;
        const uint8_t *b = sst_image_row(view->image, 2, y) + x0;

        for (int i = 0; i < n; i++)
            out[i] = 0.25f * (float)(r[i] + 2 * g[i] + b[i]);
    }
}

bool drift_read_patch(float *out, const struct drift_pyramid *view, int level, struct sst_rect part)
{
    const int width = part.x1 - part.x0, height = part.y1 - part.y0, columns[2] = { part.x0 - 2, part.x1 + 2 };
    float row[PATCH_MAX], across[PATCH_MAX][PATCH_MAX];
    int w, h;

    drift_level_size(view, level, &w, &h);
    if (part.x0 < 2 || part.y0 < 2 || part.x1 > w - 2 || part.y1 > h - 2 || width > PATCH_MAX - 4 ||
        height > PATCH_MAX - 4)
        return false;
    for (int y = 0; y < height + 4; y++) {
        grey_row(row, view, level, part.y0 + y - 2, columns);
        for (int x = 0; x < width; x++)
            across[y][x] = row[x] + row[x + 4] + 4 * (row[x + 1] + row[x + 3]) + 6 * row[x + 2];
    }
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++)
            out[y * width + x] =
                (across[y][x] + across[y + 4][x] + 4 * (across[y + 1][x] + across[y + 3][x]) + 6 * across[y + 2][x]) /
                256;
    }
    return true;
}
