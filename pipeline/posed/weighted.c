/* Sums of levels and of weighted levels of all views on a surface, in one pass over each view's places. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/surface_internal.h"

#define NODE   8 /* px between exact places of weights in a picture with a lens */
#define BEFORE 1 /* px of border of the maps of weights: the first places of a picture are half a pixel before it, ... */
#define AFTER  2 /* ... the last ones up to one and a half behind it */

/* Row in work. One thread. */
struct weighted_row {
    int y;
    struct warp_rows places;
    struct sst_warped_segment *weights; /* [width] */
    uint32_t *level[3], *weight;        /* [width] */
    uint16_t *count, *others;           /* [width]; of the weights */
};

static bool row_init(struct weighted_row *row, const struct warp *warp, int channels)
{
    const size_t width = (size_t)warp->across * WARP_CELL;

    row->weights = sst_mem_alloc_raw(width, sizeof(*row->weights));
    row->weight = sst_mem_alloc((1 + (size_t)channels) * width, sizeof(*row->weight));
    row->count = sst_mem_alloc(2 * width, sizeof(*row->count));
    if (warp_rows_init(&row->places, warp) || !row->weights || !row->weight || !row->count)
        return false;
    for (int c = 0; c < channels; c++)
        row->level[c] = row->weight + (1 + (size_t)c) * width;
    row->others = row->count + width;
    return true;
}

int weighted_init(struct weighted *out, const struct sst_virtual *camera, const struct sst_surface *surface,
                  int channels, int threads)
{
    const size_t pixels = (size_t)camera->width * (size_t)camera->height;
    struct weighted w = { .channels = channels, .threads = threads };
    int err = warp_init(&w.warp, camera, surface);

    w.row = calloc((size_t)threads, sizeof(*w.row));
    w.sum[0] = sst_mem_alloc((size_t)channels * pixels, sizeof(*w.sum[0]));
    w.weighted[0] = sst_mem_alloc((size_t)channels * pixels, sizeof(*w.weighted[0]));
    w.weight = sst_mem_alloc(pixels, sizeof(*w.weight));
    w.count = sst_mem_alloc(pixels, sizeof(*w.count));
    if (!err && (!w.row || !w.sum[0] || !w.weighted[0] || !w.weight || !w.count))
        err = -ENOMEM;
    for (int i = 0; i < threads && !err; i++)
        err = row_init(&w.row[i], &w.warp, channels) ? 0 : -ENOMEM;
    for (int c = 1; c < channels && !err; c++) {
        w.sum[c] = w.sum[0] + (size_t)c * pixels;
        w.weighted[c] = w.weighted[0] + (size_t)c * pixels;
    }
    if (err)
        weighted_fini(&w);
    else
        *out = w;
    return err;
}

void weighted_fini(struct weighted *w)
{
    for (int i = 0; w->row && i < w->threads; i++) {
        warp_rows_fini(&w->row[i].places);
        sst_mem_free(w->row[i].weights);
        sst_mem_free(w->row[i].weight);
        sst_mem_free(w->row[i].count);
    }
    free(w->row);
    sst_mem_free(w->sum[0]);
    sst_mem_free(w->weighted[0]);
    sst_mem_free(w->weight);
    sst_mem_free(w->count);
    warp_fini(&w->warp);
    *w = (struct weighted){ 0 };
}

/* --- maps of weights ------------------------------------------------------------------------------------------------
 */

/* Place of a picture's pixel in its map of weights, which has no distortion. */
static void undistorted(double uv[2], const struct sst_calib_camera *cam, int x, int y)
{
    double a = (x - cam->cx) / cam->fx, b = (y - cam->cy) / cam->fy;

    if (cam->lens && !sst_camera_undistort(cam, x, y, &a, &b)) {
        a = (x - cam->cx) / cam->fx;
        b = (y - cam->cy) / cam->fy;
    }
    uv[0] = cam->fx * a + cam->cx;
    uv[1] = cam->fy * b + cam->cy;
}

/* Weight at a place, bilinear; the border goes on. */
static double weight_at(const struct sst_map_u8 *map, double x, double y)
{
    const double u = fmin(fmax(x, 0), map->width - 1), v = fmin(fmax(y, 0), map->height - 1); /* also if no number */
    const int i = sst_min_int((int)u, sst_max_int(map->width - 2, 0)),
              j = sst_min_int((int)v, sst_max_int(map->height - 2, 0));
    const int right = map->width > 1, below = map->height > 1;
    const uint8_t *a = sst_map_u8_row(map, j) + i, *b = sst_map_u8_row(map, j + below) + i;

    return (1 - (v - j)) * ((1 - (u - i)) * a[0] + (u - i) * a[right]) +
           (v - j) * ((1 - (u - i)) * b[0] + (u - i) * b[right]);
}

static void distort_cell(struct sst_map_u16 *out, const struct sst_map_u8 *weight, const struct sst_calib_camera *cam,
                         int x0, int y0)
{
    double p[4][2];

    for (int i = 0; i < 4; i++)
        undistorted(p[i], cam, x0 + i % 2 * NODE - BEFORE, y0 + i / 2 * NODE - BEFORE);
    for (int y = y0; y < y0 + NODE && y < out->height; y++) {
        for (int x = x0; x < x0 + NODE && x < out->width; x++) {
            const double fx = (double)(x - x0) / NODE, fy = (double)(y - y0) / NODE;
            double uv[2];

            for (int i = 0; i < 2; i++)
                uv[i] = (1 - fy) * ((1 - fx) * p[0][i] + fx * p[1][i]) + fy * ((1 - fx) * p[2][i] + fx * p[3][i]);
            sst_map_u16_row(out, y)[x] = (uint16_t)(WEIGHT_ONE * weight_at(weight, uv[0], uv[1]) + 0.5);
        }
    }
}

int weights_in_picture(struct sst_map_u16 *out, const struct sst_map_u8 *weight, const struct sst_calib_camera *cam,
                       int least)
{
    const int err = sst_map_u16_init(out, weight->width + BEFORE + AFTER, weight->height + BEFORE + AFTER);

    for (int y = 0; !err && cam->lens && y < out->height; y += NODE) {
        for (int x = 0; x < out->width; x += NODE)
            distort_cell(out, weight, cam, x, y);
    }
    for (int y = 0; !err && y < out->height; y++) {
        const uint8_t *from = sst_map_u8_row(weight, sst_clamp_int(y - BEFORE, 0, weight->height - 1));
        uint16_t *row = sst_map_u16_row(out, y);

        for (int x = 0; x < out->width; x++) {
            const int w =
                cam->lens ? row[x] : from[sst_clamp_int(x - BEFORE, 0, weight->width - 1)] * WEIGHT_ONE;

            row[x] = (uint16_t)sst_max_int(w, least * WEIGHT_ONE);
        }
    }
    return err;
}

/* --- views ----------------------------------------------------------------------------------------------------------
 */

/* Places of a row in a map of weights: a pixel of it is `step` of the picture's. */
static void scale_segments(struct sst_warped_segment *out, const struct sst_warped_segment *in, int n, int step)
{
    for (int i = 0; i < n; i++) {
        out[i] = in[i];
        out[i].x_q16 = (in[i].x_q16 + 32768) / step - 32768 + BEFORE * 65536;
        out[i].y_q16 = (in[i].y_q16 + 32768) / step - 32768 + BEFORE * 65536;
        out[i].dx_q16 = in[i].dx_q16 / step;
        out[i].dy_q16 = in[i].dy_q16 / step;
    }
}

struct add_job {
    struct weighted *w;
    const struct weighted_view *view;
    int n, step;
};

static void add_row(const struct add_job *job, const struct weighted_view *view, struct weighted_row *row,
                    const struct sst_warped_segment *segment, int segments)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    const struct weighted *w = job->w;
    const size_t at = (size_t)row->y * (size_t)w->warp.camera.width;
    const struct sst_warped_source from = warp_source(view->picture);
    const struct sst_warped_source weights = { .plane = { view->weight->data },
                                               .stride = view->weight->stride / sizeof(uint16_t),
                                               .width = view->weight->width,
                                               .height = view->weight->height,
                                               .channels = 1 };
    struct sst_weighted_sums sums = { .weight = w->weight, .count = w->count };
    struct sst_weighted_rays rays = { .weight = row->weight, .count = row->count, .channels = w->channels };
    size_t first = SIZE_MAX, end = 0, n;

    for (int i = 0; i < segments; i++) {
        first = (size_t)segment[i].at < first ? (size_t)segment[i].at : first;
        end = (size_t)(segment[i].at + segment[i].n) > end ? (size_t)(segment[i].at + segment[i].n) : end;
    }
    if (end <= first)
        return;
    n = end - first;
    for (int c = 0; c < w->channels; c++) {
        memset(row->level[c] + first, 0, n * sizeof(*row->level[c]));
        rays.level[c] = row->level[c] + first;
        sums.level[c] = w->sum[c] + at + first;
        sums.weighted[c] = w->weighted[c] + at + first;
    }
    memset(row->weight + first, 0, n * sizeof(*row->weight));
    memset(row->count + first, 0, n * sizeof(*row->count));
    rays.weight += first;
    rays.count += first;
    sums.weight += at + first;
    sums.count += at + first;
    scale_segments(row->weights, segment, segments, job->step);
    kernels->warped_row(row->level, row->count, &from, segment, (size_t)segments);
    kernels->warped_row((uint32_t *const[3]){ row->weight }, row->others, &weights, row->weights, (size_t)segments);
    kernels->weighted_add(&sums, &rays, n);
}

static int add_band(void *arg, int band, int worker)
{
    const struct add_job *job = arg;
    struct weighted *w = job->w;
    struct weighted_row *row = &w->row[worker];

    for (int k = 0; k < job->n; k++) {
        const struct weighted_view *view = &job->view[k];

        if (view->places) {
            const int *segments;
            const struct sst_warped_segment *segment = integral_kept(&segments, view->places, view->view, band);

            for (int r = 0; r < WARP_CELL; segment += segments[r], r++) {
                row->y = band * WARP_CELL + r;
                add_row(job, view, row, segment, segments[r]);
            }
        } else {
            warp_band(&row->places, &w->warp, &view->warp, band);
            for (int r = 0; r < WARP_CELL; r++) {
                row->y = band * WARP_CELL + r;
                add_row(job, view, row, row->places.segment[r], row->places.segments[r]);
            }
        }
    }
    return 0;
}

int weighted_add(struct weighted *w, const struct weighted_view view[], int n, int step)
{
    struct add_job job = { w, view, n, step };

    return sst_parallel_for(w->warp.bands, w->threads, add_band, &job);
}
