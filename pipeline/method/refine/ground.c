/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/refine/parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LIMIT_SIGMAS 5.0
#define MAD_TO_SIGMA 1.4826
#define COLLINEAR    1e-6
#define WHOLE        16777216.0 /* 2^24 */
#define MOST_SLOPE   0x1p40
#define MOST_VALUE   0x1p57
#define ROUNDS       4
#define SPREAD_Q24   124369502 /* limit by median residual: LIMIT_SIGMAS of MAD_TO_SIGMA median |residual| */

/* Sums over pixels with the label and a disparity d as it is stored: at most 2^28 of them, each term below 2^31. */
struct sums {
    int64_t n, x, y, d, xx, xy, yy, xd, yd;
};

static int64_t whole(double v, double most)
{
    return llround(sst_clamp_double(v * WHOLE, -most, most));
}

/* Least limit, by the matcher's noise. */
static int64_t least_limit(const struct sst_refine_config *cfg)
{
    return whole(LIMIT_SIGMAS * fmax(cfg->matcher_sigma_px * SST_DISP_SCALE, 0.5), MOST_VALUE);
}

/* n^2 times the centred moment of two sums. */
static double centred(int64_t uv, int64_t u, int64_t v, int64_t n)
{
    return (double)((__int128)n * uv - (__int128)u * v);
}

/* Plane of least squares; the limit stays. @return false (untouched): fewer than min_pixels, or all near one line */
static bool solve(struct sst_ground *g, const struct sums *s, int min_pixels)
{
    const double xx = centred(s->xx, s->x, s->x, s->n), yy = centred(s->yy, s->y, s->y, s->n);
    const double xy = centred(s->xy, s->x, s->y, s->n), det = xx * yy - xy * xy;
    const double xd = centred(s->xd, s->x, s->d, s->n), yd = centred(s->yd, s->y, s->d, s->n);
    double a, b;

    if (s->n < 3 || s->n < min_pixels || !(det > COLLINEAR * xx * yy))
        return false;
    a = (xd * yy - yd * xy) / det;
    b = (yd * xx - xd * xy) / det;
    g->a_q24 = whole(a, MOST_SLOPE);
    g->b_q24 = whole(b, MOST_SLOPE);
    g->d0_q24 = whole(((double)s->d - a * (double)s->x - b * (double)s->y) / (double)s->n, MOST_VALUE);
    return true;
}

/* Distance of a pixel to the plane. @param row_q24  the plane where the row begins */
static int64_t miss(const struct sst_ground *g, int64_t row_q24, int x, uint16_t q)
{
    return llabs(((int64_t)q << 24) - (row_q24 + g->a_q24 * x));
}

bool sst_ground_has(const struct sst_ground *ground, int x, int y, uint16_t disp_q6)
{
    return miss(ground, ground->d0_q24 + ground->b_q24 * y, x, disp_q6) <= ground->limit_q24;
}

static int first_of(const uint8_t *label, int width, int value)
{
    const uint8_t *first = memchr(label, value, (size_t)width);

    return first ? (int)(first - label) : width;
}

/* Add a row of the region, whose own sums are small. */
static void add_row(struct sums *s, const struct sst_ground *g, const struct sst_view *v, int y, int value)
{
    const int64_t row_q24 = g->d0_q24 + g->b_q24 * y;
    const uint8_t *label = sst_map_u8_row(&v->label, y);
    const uint16_t *q = sst_map_u16_row(&v->disp, y);
    const int width = v->label.width;
    int64_t n = 0, sum_x = 0, sum_d = 0;

    for (int x = first_of(label, width, value); x < width; x++) {
        if (label[x] != value || q[x] == SST_DISP_NONE || miss(g, row_q24, x, q[x]) > g->limit_q24)
            continue;
        n++;
        sum_x += x;
        sum_d += q[x];
        s->xx += (int64_t)x * x;
        s->xd += (int64_t)x * q[x];
    }
    s->n += n;
    s->x += sum_x;
    s->y += n * y;
    s->d += sum_d;
    s->xy += sum_x * y;
    s->yy += n * y * y;
    s->yd += sum_d * y;
}

/* Over the region's pixels whose residual to the current plane is within its limit. */
static struct sums sum_up(const struct sst_ground *g, const struct sst_view *v, int value)
{
    struct sums s = { 0 };

    for (int y = 0; y < v->label.height; y++)
        add_row(&s, g, v, y, value);
    return s;
}

static int bin_of(int64_t miss_q24)
{
    const int64_t rounded = (miss_q24 + (1 << 23)) >> 24;

    return rounded < SST_DISP_BINS - 1 ? (int)rounded : SST_DISP_BINS - 1;
}

/* Median residual of the region's pixels. @param n  how many there are */
static int median_miss(const struct sst_ground *g, const struct sst_view *v, int value, int64_t *hist, int64_t n)
{
    int64_t below;
    int m = 0;

    memset(hist, 0, SST_DISP_BINS * sizeof(*hist));
    for (int y = 0; y < v->label.height; y++) {
        const uint8_t *label = sst_map_u8_row(&v->label, y);
        const uint16_t *q = sst_map_u16_row(&v->disp, y);
        const int64_t row_q24 = g->d0_q24 + g->b_q24 * y;

        for (int x = first_of(label, v->label.width, value); x < v->label.width; x++) {
            if (label[x] == value && q[x] != SST_DISP_NONE)
                hist[bin_of(miss(g, row_q24, x, q[x]))]++;
        }
    }
    below = hist[0];
    while (2 * below < n)
        below += hist[++m];
    return m;
}

bool sst_ground_fit(struct sst_ground *ground, const struct sst_view *v, int value, const struct sst_refine_config *cfg,
                    int64_t *hist)
{
    struct sst_ground g = { .limit_q24 = INT64_MAX };
    struct sums s = sum_up(&g, v, value);
    const int64_t all = s.n, least_q24 = least_limit(cfg);

    for (int i = 0; i < ROUNDS; i++) {
        int64_t limit_q24;

        if (!solve(&g, &s, cfg->min_pixels))
            return false;
        limit_q24 = (int64_t)SPREAD_Q24 * median_miss(&g, v, value, hist, all);
        g.limit_q24 = limit_q24 > least_q24 ? limit_q24 : least_q24;
        s = sum_up(&g, v, value);
    }
    if (4 * (all - s.n) > all)
        return false;
    *ground = g;
    return true;
}
