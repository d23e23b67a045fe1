/* Grey pyramids of the views, and features: one well textured place per cell of the picture.
 *
 * Only what the search needs is made: the half-size level in one pass over the picture, smaller ones from it. Full
 * size is read around features alone (sst_check_patch). */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/calib/check_parts.h"

#define WINDOW   3  /* radius of a feature's structure tensor, half-size px */
#define MARGIN   6  /* features keep this far from the edge, half-size px: windows and filters fit */
#define SMALLEST 64 /* shorter side of a picture, px */
#define TEXTURE_FLOOR                                                                                                  \
    0.25                   /* least eigenvalue of the structure tensor, (grey levels / half-size px)^2: rounding alone \
                              gives 1/12 */
#define TEXTURE_NOISE 15.0 /* and this many times what noise gives */
#define NOISE_CAP     3.0  /* grey levels: what looks like more is texture everywhere */
#define CELL_STEP     2    /* the least eigenvalue is looked at on every second pixel both ways */

void sst_check_level_size(const struct sst_check_view *view, int level, int *width, int *height)
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

static void halve_grey(struct sst_map_u8 *out, const struct sst_map_u8 *in)
{
    for (int y = 0; y < out->height; y++) {
        const uint8_t *p = sst_map_u8_row(in, 2 * y), *q = sst_map_u8_row(in, 2 * y + 1);
        uint8_t *to = sst_map_u8_row(out, y);

        for (int x = 0; x < out->width; x++)
            to[x] = (uint8_t)((p[2 * x] + p[2 * x + 1] + q[2 * x] + q[2 * x + 1] + 2) >> 2);
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

static int compare_float(const void *pa, const void *pb)
{
    const float a = *(const float *)pa, b = *(const float *)pb;

    return (a > b) - (a < b);
}

/* RMS of noise in grey levels: second differences both ways (Immerkaer 1996) have 6 times it; of all cells that are
 * not clipped the quarter with the least, since texture only adds. */
static double noise_of(const struct sst_map_u8 *grey)
{
    float cell[SST_CHECK_FEATURES];
    int n = 0;

    for (int j = 0; j < SST_CHECK_CELLS_Y; j++) {
        for (int i = 0; i < SST_CHECK_CELLS_X; i++) {
            const int x0 = sst_max_int(i * grey->width / SST_CHECK_CELLS_X, 1);
            const int x1 = sst_min_int((i + 1) * grey->width / SST_CHECK_CELLS_X, grey->width - 1);
            const int y0 = sst_max_int(j * grey->height / SST_CHECK_CELLS_Y, 1);
            const int y1 = sst_min_int((j + 1) * grey->height / SST_CHECK_CELLS_Y, grey->height - 1);
            int64_t sum = 0, squares = 0, count = 0;

            for (int y = y0; y < y1; y += 2) {
                const uint8_t *p = sst_map_u8_row(grey, y - 1), *q = p + grey->stride, *r = q + grey->stride;

                for (int x = x0; x < x1; x += 2, count++) {
                    const int d = p[x - 1] - 2 * p[x] + p[x + 1] - 2 * (q[x - 1] - 2 * q[x] + q[x + 1]) + r[x - 1] -
                                  2 * r[x] + r[x + 1];

                    sum += q[x];
                    squares += d * d;
                }
            }
            if (count && sum > 4 * count && sum < 251 * count)
                cell[n++] = (float)sqrt((double)squares / (36.0 * (double)count));
        }
    }
    if (!n)
        return 0;
    qsort(cell, (size_t)n, sizeof(*cell), compare_float);
    return cell[n / 4];
}

/* Derivatives of white noise of 1 by Sobel / 8 have a variance of 12 / 64. */
static double texture_needed(const struct sst_map_u8 *grey)
{
    const double noise = fmin(noise_of(grey), NOISE_CAP);

    return fmax(TEXTURE_FLOOR, TEXTURE_NOISE * noise * noise * 12.0 / 64.0);
}

/* Best place of every cell, in the cells' order. */
static int find_features(struct sst_check_view *view)
{
    const struct sst_map_u8 *grey = &view->level[1];
    const double needed = texture_needed(grey);
    double best[SST_CHECK_FEATURES] = { 0 };
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
            const int i =
                y * SST_CHECK_CELLS_Y / grey->height * SST_CHECK_CELLS_X + x * SST_CHECK_CELLS_X / grey->width;
            const double e = least_eigenvalue(&t, x);

            if (e > needed && e > best[i]) {
                best[i] = e;
                view->feature[i] = (struct sst_check_feature){ 2 * x, 2 * y };
            }
        }
        add_row(&t, grey, y - WINDOW, -1);
    }
    for (int i = 0; i < SST_CHECK_FEATURES; i++) {
        if (best[i] > 0)
            view->feature[view->features++] = view->feature[i];
    }
    sst_mem_free(rows);
    return 0;
}

int sst_check_view_init(struct sst_check_view *view, const struct sst_image *image, int side)
{
    int w = image->width, h = image->height, err = 0;

    *view = (struct sst_check_view){ .image = image, .levels = 1 };
    if (w < SMALLEST || h < SMALLEST)
        return -EBADMSG;
    do {
        const int i = view->levels;

        w /= 2;
        h /= 2;
        err = sst_map_u8_init(&view->level[i], w, h);
        if (err)
            break;
        if (i == 1)
            halve_colour(&view->level[i], image);
        else
            halve_grey(&view->level[i], &view->level[i - 1]);
        view->levels++;
    } while (sst_max_int(w, h) > side && sst_min_int(w, h) >= SMALLEST && view->levels < SST_CHECK_LEVELS);
    if (!err)
        err = find_features(view);
    if (err)
        sst_check_view_fini(view);
    return err;
}

void sst_check_view_fini(struct sst_check_view *view)
{
    for (int i = 1; i < SST_CHECK_LEVELS; i++)
        sst_map_u8_fini(&view->level[i]);
    *view = (struct sst_check_view){ 0 };
}

/* --- patches ------------------------------------------------------------------------------------------------------ */

#define PATCH_MAX 64 /* with the margin */

/* A row of grey values: at full size R + 2 G + B over 4, unrounded. */
static void grey_row(float *out, const struct sst_check_view *view, int level, int x0, int y, int n)
{
    if (level) {
        const uint8_t *p = sst_map_u8_row(&view->level[level], y) + x0;

        for (int x = 0; x < n; x++)
            out[x] = p[x];
    } else {
        const uint8_t *r = sst_image_row(view->image, 0, y) + x0, *g = sst_image_row(view->image, 1, y) + x0;
        const uint8_t *b = sst_image_row(view->image, 2, y) + x0;

        for (int x = 0; x < n; x++)
            out[x] = 0.25f * (float)(r[x] + 2 * g[x] + b[x]);
    }
}

bool sst_check_patch(float *out, const struct sst_check_view *view, int level, int x0, int y0, int width, int height)
{
    float row[PATCH_MAX], across[PATCH_MAX][PATCH_MAX];
    int w, h;

    sst_check_level_size(view, level, &w, &h);
    if (x0 < 2 || y0 < 2 || x0 > w - width - 2 || y0 > h - height - 2 || width > PATCH_MAX - 4 ||
        height > PATCH_MAX - 4)
        return false;
    for (int y = 0; y < height + 4; y++) {
        grey_row(row, view, level, x0 - 2, y0 + y - 2, width + 4);
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
