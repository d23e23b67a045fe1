/* Grey pyramids of the views, and features: one well textured place per cell of the picture.
 *
 * Only the levels that the search needs are made: the half-size level in one pass over the picture, smaller ones from
 * it. Full size is read around features alone (drift_read_patch). */
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

/* Four pixels of R + 2 G + B: a rounded mean. */
static void halve_colour(struct sst_map_u8 *out, const struct sst_image *in)
{
    for (int y = 0; y < out->height; y++) {
        uint8_t *to = sst_map_u8_row(out, y);
        const uint8_t *p[2][3];

        for (int i = 0; i < 2; i++) {
            for (int c = 0; c < 3; c++)
                p[i][c] = sst_image_row(in, c, 2 * y + i);
        }
        for (int x = 0; x < out->width; x++) {
            int sum = 8;

            for (int i = 0; i < 2; i++)
                sum += p[i][0][2 * x] + p[i][0][2 * x + 1] + 2 * (p[i][1][2 * x] + p[i][1][2 * x + 1]) +
                       p[i][2][2 * x] + p[i][2][2 * x + 1];
            to[x] = (uint8_t)(sum >> 4);
        }
    }
}

/* --- features ----------------------------------------------------------------------------------------------------- */

/* Products of Sobel derivatives (8 times the slope), summed over the rows of the window by adding the row that enters
 * and taking off the one that leaves: integers, so exact. */
struct tensor {
    int32_t *xx, *xy, *yy; /* [width] sums over 2 WINDOW + 1 rows */
    int width;
};

static void add_row(struct tensor *t, const struct sst_map_u8 *grey, int y, int sign)
{
    const uint8_t *p = sst_map_u8_row(grey, y - 1), *q = sst_map_u8_row(grey, y), *r = sst_map_u8_row(grey, y + 1);

    for (int x = 1; x + 1 < t->width; x++) {
        const int gx = (p[x + 1] - p[x - 1]) + 2 * (q[x + 1] - q[x - 1]) + (r[x + 1] - r[x - 1]);
        const int gy = (r[x - 1] - p[x - 1]) + 2 * (r[x] - p[x]) + (r[x + 1] - p[x + 1]);

        t->xx[x] += sign * gx * gx;
        t->xy[x] += sign * gx * gy;
        t->yy[x] += sign * gy * gy;
    }
}

/* Least eigenvalue of the mean tensor around x, (grey levels / px)^2. */
static double least_eigenvalue(const struct tensor *t, int x)
{
    const double scale = 1.0 / (64.0 * (2 * WINDOW + 1) * (2 * WINDOW + 1));
    int64_t xx = 0, xy = 0, yy = 0;
    double half, diff;

    for (int i = x - WINDOW; i <= x + WINDOW; i++) {
        xx += t->xx[i];
        xy += t->xy[i];
        yy += t->yy[i];
    }
    half = 0.5 * (double)(xx + yy);
    diff = 0.5 * (double)(xx - yy);
    return scale * (half - sqrt(diff * diff + (double)xy * (double)xy));
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
    sst_stats_sort_float(v, n);
    return NOISE_BIAS * sqrt(v[n / 50]);
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
    struct tensor t = { .width = grey->width };
    int32_t *rows = sst_mem_alloc((size_t)grey->width * 3, sizeof(*rows));

    if (!rows)
        return -ENOMEM;
    t.xx = rows;
    t.xy = rows + grey->width;
    t.yy = rows + 2 * grey->width;
    for (int y = MARGIN - WINDOW; y < MARGIN + WINDOW; y++)
        add_row(&t, grey, y, 1);
    for (int y = MARGIN; y < grey->height - MARGIN; y++) {
        add_row(&t, grey, y + WINDOW, 1);
        for (int x = MARGIN; y % CELL_STEP == 0 && x < grey->width - MARGIN; x += CELL_STEP) {
            const int i = y * PARTS_Y / grey->height * PARTS_X + x * PARTS_X / grey->width;
            const double e = least_eigenvalue(&t, x);

            if (e > needed && e > best[i] && is_valid_around(valid, x, y)) {
                best[i] = e;
                at[i] = (struct drift_feature){ 2 * x, 2 * y };
            }
        }
        add_row(&t, grey, y - WINDOW, -1);
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
        if (i == 1)
            halve_colour(&view->level[i], image);
        view->levels++;
    } while (sst_max_int(w, h) > side && sst_min_int(w, h) >= DRIFT_SMALLEST && view->levels < DRIFT_LEVELS);
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

void drift_read_grey(uint8_t *out, const struct drift_pyramid *view, int level, struct sst_rect part)
{
    const int n = part.x1 - part.x0;

    for (int y = part.y0; y < part.y1; y++, out += n) {
        if (level) {
            memcpy(out, sst_map_u8_row(&view->level[level], y) + part.x0, (size_t)n);
        } else {
            const uint8_t *r = sst_image_row(view->image, 0, y) + part.x0;
            const uint8_t *g = sst_image_row(view->image, 1, y) + part.x0;
            const uint8_t *b = sst_image_row(view->image, 2, y) + part.x0;

            for (int x = 0; x < n; x++)
                out[x] = (uint8_t)((r[x] + 2 * g[x] + b[x] + 2) >> 2);
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
