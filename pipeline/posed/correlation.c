/* Correlation of views on a surface: the mean product of pairs of views, in local spreads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/correlation_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/stats.h"
#include "base/thread.h"

#define MEAN_REACH   3    /* px: the local mean's window is twice as wide and one */
#define SPREAD_REACH 8    /* ... and the local spread's */
#define LEAST        0.15f /* of the usual spread, added: flat places do not count */
#define MOST         2.5f /* spreads */
#define UNIT         4096 /* levels of a local picture, a spread */

/* Sums of one band. */
struct correlation_rows {
    struct warp_rows warp;
    uint32_t *level;  /* [width] of one view */
    uint16_t *seen;   /* [width] */
    int32_t *sum;     /* [WARP_CELL][width] */
    uint32_t *square; /* [WARP_CELL][width] */
    uint8_t *count;   /* [WARP_CELL][width] */
};

/* --- local pictures ------------------------------------------------------------------------------------------------- */

/* Means of windows along one axis, narrower at the borders. @param size  of the axis and of the other one @param step
 * from pixel to pixel along both */
static void mean_along(float *out, const float *in, const int size[2], const ptrdiff_t step[2], int reach)
{
    const int n = size[0];

    for (int line = 0; line < size[1]; line++) {
        const float *from = in + line * step[1];
        float *to = out + line * step[1];
        double sum = 0;

        for (int i = 0; i < sst_min_int(reach, n); i++)
            sum += (double)from[i * step[0]];
        for (int i = 0; i < n; i++) {
            const int first = sst_max_int(i - reach, 0), last = sst_min_int(i + reach, n - 1);

            sum += i + reach < n ? (double)from[(i + reach) * step[0]] : 0;
            to[i * step[0]] = (float)(sum / (last - first + 1));
            sum -= i >= reach ? (double)from[(i - reach) * step[0]] : 0;
        }
    }
}

/* @param work  room for as many */
static void mean_of(float *out, float *work, const float *in, const int size[2], int reach)
{
    mean_along(work, in, size, (const ptrdiff_t[2]){ 1, size[0] }, reach);
    mean_along(out, work, (const int[2]){ size[1], size[0] }, (const ptrdiff_t[2]){ size[0], 1 }, reach);
}

/* Levels of a picture, smoothed by 1 2 1 along both axes: half pixels of noise are not compared. */
static void read_levels(float *out, float *work, const struct sst_deep *from)
{
    const int width = from->width, height = from->height;

    for (int y = 0; y < height; y++) {
        const uint16_t *row = sst_map_u16_row(&from->plane[0], y);

        for (int x = 0; x < width; x++)
            work[(size_t)y * (size_t)width + (size_t)x] =
                (float)(row[sst_max_int(x - 1, 0)] + 2 * row[x] + row[sst_min_int(x + 1, width - 1)]) *
                (0.25f / GREY_SPREAD);
    }
    for (int y = 0; y < height; y++) {
        const float *row = work + (size_t)y * (size_t)width;
        const float *above = work + (size_t)sst_max_int(y - 1, 0) * (size_t)width;
        const float *below = work + (size_t)sst_min_int(y + 1, height - 1) * (size_t)width;

        for (int x = 0; x < width; x++)
            out[(size_t)y * (size_t)width + (size_t)x] = 0.25f * (above[x] + 2 * row[x] + below[x]);
    }
}

static int make_local(void *arg, int k, int worker SST_UNUSED)
{
    const struct correlation *c = arg;
    const struct sst_deep *from = &c->greys->picture[k];
    const int size[2] = { from->width, from->height };
    const size_t n = (size_t)from->width * (size_t)from->height;
    float *level = malloc(4 * n * sizeof(*level)), *mean = level + n, *spread = mean + n, *work = spread + n, usual;
    int err = level ? sst_deep_init(&c->local[k], from->width, from->height, 1, UINT16_MAX) : -ENOMEM;

    if (err)
        goto done;
    read_levels(level, work, from);
    mean_of(mean, work, level, size, MEAN_REACH);
    for (size_t i = 0; i < n; i++) {
        level[i] -= mean[i];
        spread[i] = level[i] * level[i];
    }
    mean_of(mean, work, spread, size, SPREAD_REACH);
    for (size_t i = 0; i < n; i++)
        spread[i] = work[i] = sqrtf(fmaxf(mean[i], 0));
    usual = sst_stats_upper_median_float(work, (int)n);
    for (size_t i = 0; i < n; i++) {
        const float by = spread[i] + LEAST * usual, v = by > 0 ? fminf(fmaxf(level[i] / by, -MOST), MOST) : 0;

        sst_map_u16_row(&c->local[k].plane[0], (int)i / size[0])[(int)i % size[0]] =
            (uint16_t)(32768.5f + v * UNIT);
    }
done:
    free(level);
    return err;
}

/* --- products ------------------------------------------------------------------------------------------------------- */

static int rows_init(struct correlation_rows *r, const struct warp *warp)
{
    const size_t width = (size_t)warp->camera.width;

    r->level = sst_mem_alloc_raw(width, sizeof(*r->level));
    r->seen = sst_mem_alloc_raw(width, sizeof(*r->seen));
    r->sum = sst_mem_alloc_raw(width * WARP_CELL, sizeof(*r->sum));
    r->square = sst_mem_alloc_raw(width * WARP_CELL, sizeof(*r->square));
    r->count = sst_mem_alloc_raw(width * WARP_CELL, sizeof(*r->count));
    return r->level && r->seen && r->sum && r->square && r->count ? warp_rows_init(&r->warp, warp) : -ENOMEM;
}

static void rows_fini(struct correlation_rows *r)
{
    warp_rows_fini(&r->warp);
    sst_mem_free(r->level);
    sst_mem_free(r->seen);
    sst_mem_free(r->sum);
    sst_mem_free(r->square);
    sst_mem_free(r->count);
}

int correlation_init(struct correlation *out, const struct sst_virtual *camera, const struct sst_surface *surface,
                     const struct greys *greys, int threads)
{
    struct correlation c = { .greys = greys, .threads = sst_thread_count(threads) };
    int err = warp_init(&c.warp, camera, surface);

    c.local = calloc((size_t)greys->count, sizeof(*c.local));
    c.rows = calloc((size_t)c.threads, sizeof(*c.rows));
    c.tally = calloc((size_t)c.warp.bands, sizeof(*c.tally));
    err = err || !c.local || !c.rows || !c.tally ? -ENOMEM : 0;
    for (int i = 0; i < c.threads && !err; i++)
        err = rows_init(&c.rows[i], &c.warp);
    err = err ? err : sst_parallel_for(greys->count, c.threads, make_local, &c);
    if (err)
        correlation_fini(&c);
    else
        *out = c;
    return err;
}

void correlation_fini(struct correlation *c)
{
    for (int k = 0; c->local && k < c->greys->count; k++)
        sst_deep_fini(&c->local[k]);
    for (int i = 0; c->rows && i < c->threads; i++)
        rows_fini(&c->rows[i]);
    free(c->local);
    free(c->rows);
    free(c->tally);
    warp_fini(&c->warp);
    *c = (struct correlation){ 0 };
}

/* Add the levels of one view on a row. */
static void add_row(struct correlation_rows *r, int row, int width)
{
    int32_t *restrict sum = r->sum + (size_t)row * (size_t)width;
    uint32_t *restrict square = r->square + (size_t)row * (size_t)width;
    uint8_t *restrict count = r->count + (size_t)row * (size_t)width;

    for (int x = 0; x < width; x++) {
        const int32_t v = r->seen[x] ? (int32_t)(r->level[x] >> SST_WARPED_SHIFT) - 32768 : 0;

        sum[x] += v;
        square[x] += (uint32_t)(v * v);
        count[x] = (uint8_t)(count[x] + r->seen[x]);
    }
}

static int add_band(void *arg, int band, int worker)
{
    struct correlation *c = arg;
    const struct sst_kernels *kernels = sst_kernels_get();
    struct correlation_rows *r = &c->rows[worker];
    const int width = c->warp.camera.width, rows = sst_min_int(WARP_CELL, c->warp.camera.height - band * WARP_CELL);
    const size_t all = (size_t)width * WARP_CELL;
    int64_t product = 0, pairs = 0;

    memset(r->sum, 0, all * sizeof(*r->sum));
    memset(r->square, 0, all * sizeof(*r->square));
    memset(r->count, 0, all * sizeof(*r->count));
    for (int k = 0; k < c->greys->count; k++) {
        const struct sst_warped_source from = warp_source(&c->local[k]);
        const struct warp_view view =
            warp_view_of(&c->warp.camera, &c->greys->camera[k], c->local[k].width, c->local[k].height);

        warp_band(&r->warp, &c->warp, &view, band);
        for (int y = 0; y < rows; y++) {
            if (!r->warp.segments[y])
                continue;
            memset(r->level, 0, (size_t)width * sizeof(*r->level));
            memset(r->seen, 0, (size_t)width * sizeof(*r->seen));
            kernels->warped_row((uint32_t *const[3]){ r->level }, r->seen, &from, r->warp.segment[y],
                                (size_t)r->warp.segments[y]);
            add_row(r, y, width);
        }
    }
    for (size_t i = 0; i < (size_t)(width * rows); i++) {
        product += (int64_t)r->sum[i] * r->sum[i] - r->square[i];
        pairs += r->count[i] * (r->count[i] - 1);
    }
    c->tally[band][0] = product;
    c->tally[band][1] = pairs;
    return 0;
}

int correlation_on(double *out, struct correlation *c, const struct sst_surface *surface)
{
    int64_t product = 0, pairs = 0;
    int err;

    warp_restart(&c->warp, surface);
    err = sst_parallel_for(c->warp.bands, c->threads, add_band, c);
    for (int band = 0; band < c->warp.bands; band++) {
        product += c->tally[band][0];
        pairs += c->tally[band][1];
    }
    *out = pairs ? (double)product / (double)pairs / ((double)UNIT * UNIT) : 0;
    return err;
}
