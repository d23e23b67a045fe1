/* Scores by local mean and spread, from sums over rows and columns: windows of any size cost the same. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/find/find_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "base/thread.h"

#define GAUSS_REACH 3 /* standard deviations of the smoothing that are summed */

/* Sums over the rectangle above and left of each pixel, which itself does not count: [height + 1][width + 1]. */
struct sums {
    double *value, *square;
    int32_t *count;
    size_t stride;
};

static void sums_fini(struct sums *s)
{
    free(s->value);
    free(s->square);
    free(s->count);
}

static int sums_init(struct sums *s, int width, int height)
{
    const size_t n = (size_t)(width + 1) * (size_t)(height + 1);

    *s = (struct sums){ calloc(n, sizeof(double)), calloc(n, sizeof(double)), calloc(n, sizeof(int32_t)),
                        (size_t)width + 1 };
    return s->value && s->square && s->count ? 0 : -ENOMEM;
}

struct scoring {
    const struct sst_map_f32 *value; /* smoothed */
    struct sst_map_f32 *mean, *spread;
    const struct find_score_config *cfg;
    struct sums sums;
    double middle; /* of all values: subtracted, so that squares do not cancel */
    float least;
    bool cut; /* values are cut by the mean and spread of the round before */
};

static double cut_value(const struct scoring *s, int x, int y)
{
    const double v = (double)sst_map_f32_row(s->value, y)[x] - s->middle;
    double mean, reach;

    if (!s->cut || isnan(v))
        return v;
    mean = (double)sst_map_f32_row(s->mean, y)[x];
    reach = s->cfg->cut * (double)sst_map_f32_row(s->spread, y)[x];
    return fmin(fmax(v, mean - reach), mean + reach);
}

static void add_up(struct scoring *s)
{
    for (int y = 0; y < s->value->height; y++) {
        const size_t above = (size_t)y * s->sums.stride, at = above + s->sums.stride;
        double value = 0, square = 0;
        int32_t count = 0;

        for (int x = 0; x < s->value->width; x++) {
            const double v = cut_value(s, x, y);

            if (!isnan(v)) {
                value += v;
                square += v * v;
                count++;
            }
            s->sums.value[at + (size_t)x + 1] = s->sums.value[above + (size_t)x + 1] + value;
            s->sums.square[at + (size_t)x + 1] = s->sums.square[above + (size_t)x + 1] + square;
            s->sums.count[at + (size_t)x + 1] = s->sums.count[above + (size_t)x + 1] + count;
        }
    }
}

static int window_row(void *arg, int y, int worker SST_UNUSED)
{
    struct scoring *s = arg;
    const int w = s->value->width, reach = s->cfg->reach;
    const size_t top = (size_t)sst_max_int(y - reach, 0) * s->sums.stride;
    const size_t bottom = (size_t)sst_min_int(y + reach + 1, s->value->height) * s->sums.stride;
    float *mean = sst_map_f32_row(s->mean, y), *spread = sst_map_f32_row(s->spread, y);

    for (int x = 0; x < w; x++) {
        const size_t l = (size_t)sst_max_int(x - reach, 0), r = (size_t)sst_min_int(x + reach + 1, w);
        const double n =
            s->sums.count[bottom + r] - s->sums.count[bottom + l] - s->sums.count[top + r] + s->sums.count[top + l];
        const double v =
            s->sums.value[bottom + r] - s->sums.value[bottom + l] - s->sums.value[top + r] + s->sums.value[top + l];
        const double q =
            s->sums.square[bottom + r] - s->sums.square[bottom + l] - s->sums.square[top + r] + s->sums.square[top + l];

        mean[x] = n > 0 ? (float)(v / n) : 0;
        spread[x] = n > 0 ? (float)sqrt(fmax(q / n - (v / n) * (v / n), 0)) : 0;
    }
    return 0;
}

/* Median of a map where `where` is not NAN. @return NAN: none, or no memory (err) */
static double median_of(const struct sst_map_f32 *map, const struct sst_map_f32 *where, int *err)
{
    float *v = malloc((size_t)map->width * (size_t)map->height * sizeof(*v));
    size_t n = 0;
    double median;

    if (!v) {
        *err = -ENOMEM;
        return NAN;
    }
    for (int y = 0; y < map->height; y++) {
        for (int x = 0; x < map->width; x++) {
            if (!isnan(sst_map_f32_row(where, y)[x]))
                v[n++] = sst_map_f32_row(map, y)[x];
        }
    }
    median = n ? (double)sst_stats_upper_median_float(v, (int)n) : (double)NAN;
    free(v);
    return median;
}

/* --- smoothing ---------------------------------------------------------------------------------------------------- */

/* Along one axis; weights of pixels that are not valid go to the others. */
static void smooth_along(struct sst_map_f32 *to, const struct sst_map_f32 *from, const double *weight, int reach,
                         bool down)
{
    for (int y = 0; y < from->height; y++) {
        for (int x = 0; x < from->width; x++) {
            double sum = 0, weights = 0;

            for (int k = -reach; k <= reach; k++) {
                const int at_x = down ? x : x + k, at_y = down ? y + k : y;
                const bool inside = at_x >= 0 && at_y >= 0 && at_x < from->width && at_y < from->height;
                const double v = inside ? (double)sst_map_f32_row(from, at_y)[at_x] : (double)NAN;

                if (!isnan(v)) {
                    sum += weight[abs(k)] * v;
                    weights += weight[abs(k)];
                }
            }
            sst_map_f32_row(to, y)[x] = isnan(sst_map_f32_row(from, y)[x]) ? NAN : (float)(sum / weights);
        }
    }
}

static int smooth(struct sst_map_f32 *out, const struct sst_map_f32 *in, double sigma)
{
    const int reach = (int)ceil(GAUSS_REACH * sigma);
    double *weight = malloc((size_t)(reach + 1) * sizeof(*weight));
    struct sst_map_f32 across = { 0 };
    int err = weight ? sst_map_f32_init(&across, in->width, in->height) : -ENOMEM;

    err = err ? err : sst_map_f32_init(out, in->width, in->height);
    for (int k = 0; !err && k <= reach; k++)
        weight[k] = sigma > 0 ? exp(-0.5 * k * k / (sigma * sigma)) : 1;
    if (!err) {
        smooth_along(&across, in, weight, reach, false);
        smooth_along(out, &across, weight, reach, true);
    }
    sst_map_f32_fini(&across);
    free(weight);
    return err;
}

/* --- scores ------------------------------------------------------------------------------------------------------- */

struct find_score_config find_score_defaults(void)
{
    return (struct find_score_config){ .reach = 31, .cut = 2.5, .rounds = 3, .least = 0.7, .smooth_px = 1 };
}

static int rounds(struct scoring *s, int threads)
{
    int err = 0;

    for (int i = 0; i < s->cfg->rounds && !err; i++) {
        double median;

        s->cut = i > 0;
        add_up(s);
        err = sst_parallel_for(s->value->height, threads, window_row, s);
        median = err ? (double)NAN : median_of(s->spread, s->value, &err);
        s->least = (float)(s->cfg->least * median);
        for (int y = 0; !err && y < s->value->height; y++) {
            float *spread = sst_map_f32_row(s->spread, y);

            for (int x = 0; x < s->value->width; x++)
                spread[x] = isgreater(spread[x], s->least) ? spread[x] : s->least;
        }
    }
    return err;
}

int find_score(struct sst_map_f32 *score, const struct sst_map_f32 *value, const struct find_score_config *cfg,
               int threads)
{
    struct sst_map_f32 smoothed = { 0 }, mean = { 0 }, spread = { 0 };
    struct scoring s = { .value = &smoothed, .mean = &mean, .spread = &spread, .cfg = cfg };
    int err = cfg->reach < 1 || cfg->rounds < 1 ? -EINVAL : 0;

    err = err ? err : smooth(&smoothed, value, cfg->smooth_px);
    err = err ? err : sst_map_f32_init(&mean, value->width, value->height);
    err = err ? err : sst_map_f32_init(&spread, value->width, value->height);
    err = err ? err : sums_init(&s.sums, value->width, value->height);
    if (!err)
        s.middle = median_of(&smoothed, &smoothed, &err);
    err = err ? err : rounds(&s, threads);
    err = err ? err : sst_map_f32_init(score, value->width, value->height);
    for (int y = 0; !err && y < value->height; y++) {
        float *to = sst_map_f32_row(score, y);

        for (int x = 0; x < value->width; x++) {
            const float sd = sst_map_f32_row(&spread, y)[x];

            to[x] = isgreater(sd, 0) ? (float)(((double)sst_map_f32_row(&smoothed, y)[x] - s.middle -
                                                (double)sst_map_f32_row(&mean, y)[x]) /
                                               (double)sd)
                                     : NAN;
        }
    }
    sums_fini(&s.sums);
    sst_map_f32_fini(&smoothed);
    sst_map_f32_fini(&mean);
    sst_map_f32_fini(&spread);
    return err;
}
