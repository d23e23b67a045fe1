/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/frames/frames_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/stats.h"
#include "pipeline/live/live.h"

#define LEVEL       8.0          /* 1/8 levels */
#define DARK        (12 * LEVEL) /* tiles below are not used to estimate the light */
#define GAIN_ONE    (1 << 14)
#define SETTLE_SETS 4 /* sets with lower thresholds after a change, so that its remainder is accepted too */
#define SETTLE      0.6
#define LASTING     8 /* sets with a difference above the lower thresholds: neither noise nor leaves that swing */
#define NOISE_FIRST LEVEL
#define NOISE_STEP  4    /* every NOISE_STEP-th tile measures the noise */
#define NOISE_RISE  1.25 /* maximum from picture to picture, since a large moving object is not noise */

/* Thresholds: floor + factor x median. Medians of |mean| are 0.67 sigma; of mean |e| 0.8 sigma of the cells, with a
 * spread of 0.15 sigma; of the largest of 16 2 sigma. All three thresholds stay beyond 6 sigma. */
static const struct {
    double floor, factor;
    double noise_most; /* of noise of 12 levels a pixel, which no sensor exceeds: more is motion in most tiles */
} limits[SST_DETECTOR_STATS] = {
    { SST_DETECTOR_MEAN * LEVEL, 9, 0.36 * LEVEL },
    { SST_DETECTOR_ABS * LEVEL, 2.2, 1.7 * LEVEL },
    { SST_DETECTOR_PEAK * LEVEL, 3, 4.2 * LEVEL },
};

int detector_init(struct change_detector *w, int width, int height)
{
    const int cols = (width + SST_LIVE_TILE - 1) / SST_LIVE_TILE, rows = (height + SST_LIVE_TILE - 1) / SST_LIVE_TILE;
    const size_t tiles = (size_t)cols * (size_t)rows;

    *w = (struct change_detector){ .width = width, .height = height, .cols = cols, .rows = rows };
    w->gain_kept = sst_mem_alloc(tiles, sizeof(*w->gain_kept));
    w->unsettled = sst_mem_alloc(tiles, 1);
    w->lasting = sst_mem_alloc(tiles, 1);
    w->scratch = sst_mem_alloc(tiles, SST_DETECTOR_STATS * sizeof(*w->scratch));
    if (!w->gain_kept || !w->unsettled || !w->lasting || !w->scratch || block_means_init(&w->now, width, height) ||
        block_means_init(&w->before, width, height) || block_means_init(&w->kept, width, height)) {
        detector_fini(w);
        return -ENOMEM;
    }
    detector_reset(w);
    return 0;
}

void detector_fini(struct change_detector *w)
{
    sst_mem_free(w->gain_kept);
    sst_mem_free(w->unsettled);
    sst_mem_free(w->lasting);
    sst_mem_free(w->scratch);
    block_means_fini(&w->now);
    block_means_fini(&w->before);
    block_means_fini(&w->kept);
    *w = (struct change_detector){ 0 };
}

void detector_reset(struct change_detector *w)
{
    w->judged = 0;
    w->gain = 1;
    w->before.planes = w->kept.planes = 0;
    for (int p = 0; p < 3; p++)
        for (int s = 0; s < SST_DETECTOR_STATS; s++)
            w->noise[p][s] = NOISE_FIRST;
}

/* --- tile statistics ---------------------------------------------------------------------------------------------- */

/* Cells of a tile in a plane. */
struct span {
    int x0, y0, x1, y1;
};

static struct span cells_of(const struct block_means *c, int p, int col, int row)
{
    const int sx = c->plane[p].step_x, sy = c->plane[p].step_y;

    return (struct span){ col * SST_LIVE_TILE / sx, row * SST_LIVE_TILE / sy,
                          sst_min_int(c->plane[p].cols, ((col + 1) * SST_LIVE_TILE + sx - 1) / sx),
                          sst_min_int(c->plane[p].rows, ((row + 1) * SST_LIVE_TILE + sy - 1) / sy) };
}

static int count_of(struct span s)
{
    return (s.x1 - s.x0) * (s.y1 - s.y0);
}

/* Sum of a tile's cells above zero light or colour. */
static int sum_of(const struct block_means *c, int p, struct span s)
{
    int sum = 0;

    for (int y = s.y0; y < s.y1; y++)
        for (int x = s.x0; x < s.x1; x++)
            sum += c->plane[p].mean[(size_t)y * (size_t)c->plane[p].cols + (size_t)x] - c->plane[p].zero;
    return sum;
}

/* Cells of a tile in two frames. */
struct cells {
    const int16_t *a, *b;
    size_t stride;
    int zero, gain_q14;
};

/* Inlined with a constant width, so that the loops are unrolled. */
static inline void compare_span(const struct cells *cells, int width, int height, float out[SST_DETECTOR_STATS])
{
    const int16_t *a = cells->a, *b = cells->b;
    const int zero = cells->zero, gain_q14 = cells->gain_q14;
    int sum = 0, abs_sum = 0, most = 0;

    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int e = a[x] - zero - (((b[x] - zero) * gain_q14 + GAIN_ONE / 2) >> 14), size = abs(e);

            sum += e;
            abs_sum += size;
            most = size > most ? size : most;
        }
        a += cells->stride;
        b += cells->stride;
    }
    out[0] = (float)abs(sum) / (float)(width * height);
    out[1] = (float)abs_sum / (float)(width * height);
    out[2] = (float)most;
}

/* |mean e|, mean |e|, max |e| with e = a - gain b, of a plane. */
static void compare(const struct mean_plane *a, const struct mean_plane *b, struct span s, double gain,
                    float out[SST_DETECTOR_STATS])
{
    const size_t stride = (size_t)a->cols, at = (size_t)s.y0 * stride + (size_t)s.x0;
    const struct cells cells = { a->mean + at, b->mean + at, stride, a->zero, (int)lrint(gain * GAIN_ONE) };
    const int w = s.x1 - s.x0, h = s.y1 - s.y0;

    if (w == 4 && h == 4)
        compare_span(&cells, 4, 4, out);
    else if (w == 2 && h == 4)
        compare_span(&cells, 2, 4, out);
    else if (w == 2 && h == 2)
        compare_span(&cells, 2, 2, out);
    else
        compare_span(&cells, w, h, out);
}

/* --- light -------------------------------------------------------------------------------------------------------- */

/*
 * Estimate the gain of the light: the median over the tiles of now / kept. A factor in light is also a factor in sRGB
 * codes (except for the darkest).
 * @return accumulated change since the tiles were accepted, in levels at half of white
 */
static double follow_light(struct change_detector *w)
{
    float *ratio = w->scratch, *raw = w->scratch + (size_t)w->cols * (size_t)w->rows;
    int n = 0;

    for (int t = 0; t < w->cols * w->rows; t++) {
        const struct span s = cells_of(&w->now, 0, t % w->cols, t / w->cols);
        const double kept = sum_of(&w->kept, 0, s);

        if (kept < DARK * count_of(s))
            continue;
        raw[n] = (float)(sum_of(&w->now, 0, s) / kept);
        ratio[n] = (float)(raw[n] * w->gain_kept[t]);
        n++;
    }
    if (n < sst_min_int(8, w->cols * w->rows))
        return 0;
    w->gain = sst_clamp_double(sst_stats_upper_median_float(ratio, n), 1e-3, 1e3);
    return fabs(sst_stats_upper_median_float(raw, n) - 1.0) * 128;
}

/* --- noise -------------------------------------------------------------------------------------------------------- */

/* Measure the noise between this picture and the one judged before, on a part of the tiles. */
static void follow_noise(struct change_detector *w, double gain_step)
{
    const int tiles = w->cols * w->rows, step = w->judged < 2 ? 1 : NOISE_STEP;

    w->noise_phase = (w->noise_phase + 1) % NOISE_STEP;
    for (int p = 0; p < w->now.planes; p++) {
        int n = 0;

        for (int t = w->noise_phase % step; t < tiles; t += step, n++) {
            float stat[SST_DETECTOR_STATS];

            compare(&w->now.plane[p], &w->before.plane[p], cells_of(&w->now, p, t % w->cols, t / w->cols), gain_step,
                    stat);
            for (int s = 0; s < SST_DETECTOR_STATS; s++)
                w->scratch[s * tiles + n] = stat[s];
        }
        for (int s = 0; n && s < SST_DETECTOR_STATS; s++) {
            const double median = sst_stats_upper_median_float(w->scratch + (size_t)s * (size_t)tiles, n);
            const double seen = fmin(median, limits[s].noise_most), known = w->noise[p][s];

            if (w->judged < 2)
                w->noise[p][s] = seen;
            else
                w->noise[p][s] += (fmin(seen, NOISE_RISE * known + LEVEL / 8) - known) / 8;
        }
    }
}

/* --- judging ------------------------------------------------------------------------------------------------------ */

static struct verdict all_changed(const struct change_detector *w, uint8_t *changed, double light)
{
    const int tiles = w->cols * w->rows;

    memset(changed, 1, (size_t)tiles);
    return (struct verdict){ .changed = tiles, .whole = true, .light = light };
}

/* @param ease  of the thresholds */
static bool exceeds(const struct change_detector *w, int t, double ease)
{
    const double gain = w->gain / w->gain_kept[t];

    for (int p = 0; p < w->now.planes; p++) {
        const struct span span = cells_of(&w->now, p, t % w->cols, t / w->cols);
        float stat[SST_DETECTOR_STATS];

        compare(&w->now.plane[p], &w->kept.plane[p], span, gain, stat);
        for (int s = 0; s < SST_DETECTOR_STATS; s++) {
            if (stat[s] > ease * limits[s].floor + limits[s].factor * w->noise[p][s])
                return true;
        }
        if (fabs(gain - 1) * 255 > SST_DETECTOR_BUDGET - SST_DETECTOR_MEAN &&
            fabs((double)sum_of(&w->now, p, span) - sum_of(&w->kept, p, span)) >
                (SST_DETECTOR_BUDGET * LEVEL + limits[0].factor * w->noise[p][0]) * count_of(span))
            return true;
    }
    return false;
}

/* After a change, and after a while of smaller differences, lower thresholds count: where most tiles move, a departed
 * person must not stay in the others. */
static bool tile_changed(struct change_detector *w, int t)
{
    const bool eased = w->unsettled[t] || w->lasting[t] + 1 >= LASTING;

    if (!exceeds(w, t, SETTLE)) {
        w->lasting[t] = 0;
        return false;
    }
    w->lasting[t]++;
    if (!eased && !exceeds(w, t, 1))
        return false;
    w->lasting[t] = 0;
    return true;
}

struct verdict detector_judge(struct change_detector *w, uint8_t *changed)
{
    struct verdict v = { 0 };
    const double gain_before = w->gain;

    if (!block_means_alike(&w->now, &w->kept)) {
        detector_reset(w);
        block_means_copy(&w->before, &w->now);
        w->judged = 1;
        return all_changed(w, changed, 0);
    }
    v.light = follow_light(w);
    follow_noise(w, w->gain / gain_before);
    w->judged = 2;
    block_means_copy(&w->before, &w->now);
    if (v.light > SST_DETECTOR_LIGHT)
        return all_changed(w, changed, v.light);
    for (int t = 0; t < w->cols * w->rows; t++) {
        changed[t] = tile_changed(w, t);
        v.changed += changed[t];
        if (changed[t])
            w->unsettled[t] = SETTLE_SETS;
        else if (w->unsettled[t])
            w->unsettled[t]--;
    }
    return v;
}

static void accept_tile(struct change_detector *w, int t)
{
    for (int p = 0; p < w->now.planes; p++) {
        const struct span s = cells_of(&w->now, p, t % w->cols, t / w->cols);
        const size_t cols = (size_t)w->now.plane[p].cols;

        for (int y = s.y0; y < s.y1; y++)
            memcpy(w->kept.plane[p].mean + (size_t)y * cols + s.x0, w->now.plane[p].mean + (size_t)y * cols + s.x0,
                   (size_t)(s.x1 - s.x0) * sizeof(int16_t));
    }
    w->gain_kept[t] = w->gain;
}

void detector_accept(struct change_detector *w, const uint8_t *changed)
{
    const int tiles = w->cols * w->rows;

    if (memchr(changed, 0, (size_t)tiles)) {
        for (int t = 0; t < tiles; t++) {
            if (changed[t])
                accept_tile(w, t);
        }
        return;
    }
    block_means_copy(&w->kept, &w->now);
    w->gain = 1;
    for (int t = 0; t < tiles; t++) {
        w->gain_kept[t] = 1;
        w->unsettled[t] = 0;
    }
}
