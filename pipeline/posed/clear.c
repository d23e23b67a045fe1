/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/posed/integral.h"
#include "pipeline/posed/picture.h"
#include "pipeline/posed/surface_internal.h"

#define WIDTH_PX     512   /* of the compared pictures, about, ... */
#define PIXELS       2.8e6 /* of all of them, about; larger pixels than that, ... */
#define KEEP_BYTES   1e9   /* of views that are read once */
#define LEAST_PX     256   /* but not below this width */
#define PARALLAX_PX  25.0  /* of the surface between compared views, there */
#define STEP_PX      1.0   /* of parallax, between surfaces */
#define STEPS        48    /* at most */
#define HIGHEST      1.1   /* of the highest points: where the surfaces in front end */
#define HIGHEST_SURE 0.5   /* of the distance, where no points are known */
#define NODE         8     /* px between exact places of weights in a view */
#define SEE_THROUGH  13    /* of 255: least weight of a ray */
#define KNOWN_LO     0.8   /* rays in sum: below, a pixel shows the dimmed integral alone, ... */
#define KNOWN        1.2   /* is unknown, ... */
#define KNOWN_HI     2.0   /* from here on the clear picture alone */
#define DIM          0.35

struct job {
    const struct sst_posed *posed;
    const char *dir;
    const struct sst_posed_render_config *cfg;
    int least; /* weight */
    int *view; /* [count] placed ones */
    int count;
    struct greys greys;
    struct layers layers;
    struct sst_map_u8 *weight; /* [count] */
    struct sst_deep *deep[3];  /* of views in work: picture, weighted picture, weights; [threads] each */
};

/* --- surfaces in front, and views to compare ------------------------------------------------------------------------
 */

double layers_height(const struct layers *layers, int step)
{
    return layers->distance_mm - 1 / (1 / layers->distance_mm + step * layers->step);
}

static double apart(const struct sst_calib_camera *a, const struct sst_calib_camera *b)
{
    const double d[3] = { a->position_mm[0] - b->position_mm[0], a->position_mm[1] - b->position_mm[1],
                          a->position_mm[2] - b->position_mm[2] };

    return vector_length(d);
}

/* The views whose distance is next to the best baseline. @return mean distance, mm; 0: no other view is elsewhere */
static double choose_others(struct job *j, double baseline_mm)
{
    double sum = 0;
    int n = 0;

    for (int k = 0; k < j->count; k++) {
        int *other = j->layers.other[k], found = 0;
        double off[LAYER_OTHERS];

        for (int i = 0; i < LAYER_OTHERS; i++)
            other[i] = -1;
        for (int i = 0; i < j->count; i++) {
            const double mm = apart(&j->greys.camera[k], &j->greys.camera[i]),
                         by = fabs(log(fmax(mm, 1e-9) / baseline_mm));
            int at = found;

            if (mm < 0.05 * baseline_mm || (found == LAYER_OTHERS && by >= off[found - 1]))
                continue;
            at = sst_min_int(at, LAYER_OTHERS - 1);
            for (; at > 0 && off[at - 1] > by; at--) {
                off[at] = off[at - 1];
                other[at] = other[at - 1];
            }
            off[at] = by;
            other[at] = i;
            found = sst_min_int(found + 1, LAYER_OTHERS);
        }
        for (int i = 0; i < found; i++, n++)
            sum += apart(&j->greys.camera[k], &j->greys.camera[other[i]]);
    }
    return n ? sum / n : 0;
}

/* Median distance of the surface along the views' axes. @return 0: none meets it */
static double surface_distance(const struct job *j)
{
    double *distance = malloc((size_t)j->count * sizeof(*distance)), median;
    int n = 0;

    if (!distance)
        return -ENOMEM;
    for (int k = 0; k < j->count; k++) {
        const struct sst_virtual v = sst_virtual_of_view(j->posed, j->view[k]);
        double ray[3];

        sst_virtual_ray(&v, (v.width - 1) / 2.0, (v.height - 1) / 2.0, ray);
        distance[n] = sst_surface_meet(&j->cfg->surface, v.centre_mm, ray);
        n += isfinite(distance[n]);
    }
    sst_stats_sort_double(distance, n);
    median = n ? distance[n / 2] : 0;
    free(distance);
    return median;
}

/* Height above the surface that hardly any point exceeds, along its normal. */
static double highest(const struct job *j)
{
    const struct sst_surface *s = &j->cfg->surface;
    double *height = malloc((size_t)sst_max_int(j->posed->point_count, 1) * sizeof(*height)), most = 0;
    int n = 0;

    for (int i = 0; height && i < j->posed->point_count; i++) {
        const double *at = j->posed->points[i].at_mm;
        double from[3], t;

        for (int k = 0; k < 3; k++)
            from[k] = at[k] + s->normal[k] * j->layers.distance_mm;
        t = sst_surface_meet(s, from, (const double[3]){ -s->normal[0], -s->normal[1], -s->normal[2] });
        height[n] = t - j->layers.distance_mm;
        n += isfinite(t) && t > j->layers.distance_mm;
    }
    sst_stats_sort_double(height, n);
    most = n >= 10 ? HIGHEST * height[n - 1 - n / 50] : HIGHEST_SURE * j->layers.distance_mm;
    if (j->cfg->near_mm > 0)
        most = fmax(j->layers.distance_mm - j->cfg->near_mm, 0);
    free(height);
    return fmin(most, 0.9 * j->layers.distance_mm);
}

static int prepare_layers(struct job *j)
{
    const double focal_px = j->posed->view[j->view[0]].camera.fx / j->greys.step;
    const double distance_mm = surface_distance(j);
    double baseline_mm, steps;

    if (distance_mm <= 0) {
        sst_log_error("%s: no view's axis meets the surface", j->dir);
        return -ENODATA;
    }
    j->layers.greys = &j->greys;
    j->layers.surface = j->cfg->surface;
    j->layers.distance_mm = distance_mm;
    baseline_mm = choose_others(j, PARALLAX_PX * distance_mm / focal_px);
    if (!(baseline_mm > 0)) {
        sst_log_error("%s: all views are at one place, which shows no depth", j->dir);
        return -ENODATA;
    }
    j->layers.step = STEP_PX / (focal_px * baseline_mm);
    steps = ceil((1 / (distance_mm - highest(j)) - 1 / distance_mm) / j->layers.step) + 1;
    j->layers.step *= fmax(steps / STEPS, 1);
    j->layers.steps = (int)fmin(steps, STEPS);
    return 0;
}

/* Pixels of a view that one of its compared picture is wide: fewer pixels of many views. */
static int choose_step(const struct sst_posed *posed, int compare_px)
{
    const double all = (double)sst_posed_placed(posed) * posed->width * posed->height;
    const int usual = (int)lround((double)posed->width / WIDTH_PX), fewer = (int)ceil(sqrt(all / PIXELS));

    if (compare_px > 0)
        return greys_step(posed, (int)lround((double)posed->width / compare_px));
    return greys_step(posed, sst_max_int(usual, sst_min_int(fewer, posed->width / LEAST_PX)));
}

static int weigh_view(void *arg, int index, int worker SST_UNUSED)
{
    struct job *j = arg;

    return layers_weigh(&j->weight[index], &j->layers, index);
}

/* --- weighted pictures ----------------------------------------------------------------------------------------------
 */

/* Weight at a place of the map of weights, bilinear; the border goes on. */
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

/* Place of a view's pixel in its map of weights, which has no distortion. */
static void weight_place(double uv[2], const struct sst_calib_camera *cam, int step, int x, int y)
{
    double a = (x - cam->cx) / cam->fx, b = (y - cam->cy) / cam->fy;

    if (cam->lens && !sst_camera_undistort(cam, x, y, &a, &b)) {
        a = (x - cam->cx) / cam->fx;
        b = (y - cam->cy) / cam->fy;
    }
    uv[0] = (cam->fx * a + cam->cx + 0.5) / step - 0.5;
    uv[1] = (cam->fy * b + cam->cy + 0.5) / step - 0.5;
}

static void weigh_cell(const struct job *j, int k, int worker, int x0, int y0)
{
    const struct sst_calib_camera *cam = &j->posed->view[j->view[k]].camera;
    struct sst_deep *picture = &j->deep[0][worker], *weighted = &j->deep[1][worker], *weight = &j->deep[2][worker];
    double p[4][2];

    for (int i = 0; i < 4; i++)
        weight_place(p[i], cam, j->greys.step, x0 + i % 2 * NODE, y0 + i / 2 * NODE);
    for (int y = y0; y < y0 + NODE && y < picture->height; y++) {
        for (int x = x0; x < x0 + NODE && x < picture->width; x++) {
            const double fx = (double)(x - x0) / NODE, fy = (double)(y - y0) / NODE;
            double uv[2];
            uint32_t w;

            for (int i = 0; i < 2; i++)
                uv[i] = (1 - fy) * ((1 - fx) * p[0][i] + fx * p[1][i]) + fy * ((1 - fx) * p[2][i] + fx * p[3][i]);
            w = (uint32_t)sst_max_int((int)(weight_at(&j->weight[k], uv[0], uv[1]) + 0.5), j->least);
            sst_map_u16_row(&weight->plane[0], y)[x] = (uint16_t)w;
            for (int c = 0; c < picture->channels; c++) {
                const uint32_t level = sst_map_u16_row(&picture->plane[c], y)[x];

                sst_map_u16_row(&weighted->plane[c], y)[x] =
                    (uint16_t)(picture->white == 255 ? level * w : (level * w + 127) / 255);
            }
        }
    }
}

struct read_job {
    struct job *job;
    int first;
};

static int read_weighted(void *arg, int index, int worker SST_UNUSED)
{
    const struct read_job *read = arg;
    struct job *j = read->job;
    const int k = read->first + index;
    int err = 0;

    if (j->greys.kept) {
        j->deep[0][index] = j->greys.kept[k];
        j->greys.kept[k] = (struct sst_deep){ 0 };
    } else {
        err = sst_posed_picture(&j->deep[0][index], j->posed, j->dir, j->view[k]);
    }
    if (err)
        return err;
    err = sst_deep_init(&j->deep[1][index], j->posed->width, j->posed->height, j->posed->channels, UINT16_MAX);
    err = err ? err : sst_deep_init(&j->deep[2][index], j->posed->width, j->posed->height, 1, UINT16_MAX);
    if (err) {
        sst_log_error("no memory for the weights of %d views", j->count);
        return err;
    }
    for (int y = 0; y < j->posed->height; y += NODE) {
        for (int x = 0; x < j->posed->width; x += NODE)
            weigh_cell(j, k, index, x, y);
    }
    return 0;
}

/* Sums of pictures, weighted pictures and weights. */
static int add_views(struct sst_integral *sum[3], struct job *j, int threads)
{
    int err = 0;

    for (int first = 0; first < j->count && !err; first += threads) {
        const int n = sst_min_int(threads, j->count - first);
        struct read_job read = { j, first };

        err = sst_parallel_for(n, threads, read_weighted, &read);
        for (int k = 0; k < n; k++) {
            const struct sst_calib_camera *cam = &j->posed->view[j->view[first + k]].camera;

            for (int i = 0; i < 3 && !err; i++) {
                const struct sst_deep *deep = &j->deep[i][k];

                err = j->cfg->places ? sst_integral_add_at(sum[i], j->cfg->places, &j->view[first + k], &deep, 1)
                                     : sst_integral_add(sum[i], &cam, &deep, 1);
                if (err)
                    sst_log_error("%s: views have other channels or levels than the light field, or no memory", j->dir);
            }
            for (int i = 0; i < 3; i++)
                sst_deep_fini(&j->deep[i][k]);
        }
    }
    return err;
}

/* --- picture --------------------------------------------------------------------------------------------------------
 */

static double smooth(double v, double lo, double hi)
{
    const double t = sst_clamp_double((v - lo) / (hi - lo), 0, 1);

    return t * t * (3 - 2 * t);
}

/* Rays in sum of each pixel; of clear pictures, without specks. */
static int sum_rays(struct sst_map_f32 *rays, const struct sst_map_f32 *weight, const struct sst_map_u16 *views,
                    const struct job *j)
{
    int err = sst_map_f32_init(rays, weight->width, weight->height);

    for (int y = 0; y < weight->height && !err; y++) {
        for (int x = 0; x < weight->width; x++) {
            const float w = sst_map_f32_row(weight, y)[x];

            sst_map_f32_row(rays, y)[x] = isnan(w) ? 0 : w * (float)sst_map_u16_row(views, y)[x] / 255;
        }
    }
    if (!err && j->cfg->method == SST_POSED_CLEAR)
        err = specks_remove(rays, (const float[2]){ (float)KNOWN_LO, (float)KNOWN_HI }, LAYER_WINDOW * j->greys.step);
    return err;
}

/* Means of weighted rays; of clear pictures, levels of unknown pixels become the dimmed integral, and means NAN. */
static int finish(struct sst_posed_rendered *out, struct sst_integral *const sum[3], const struct job *j)
{
    const bool clear = j->cfg->method == SST_POSED_CLEAR;
    struct sst_map_f32 weight = { 0 }, rays = { 0 };
    struct sst_deep plain = { 0 };
    int err = sst_integral_levels(&plain, sum[0]);
    double scale;

    err = err ? err : sst_integral_means(&weight, sum[2], 0);
    err = err ? err : sst_integral_views(&out->views, sum[2]);
    err = err ? err : sum_rays(&rays, &weight, &out->views, j);
    out->seen = !err && posed_any(&out->views);
    err = err ? err : posed_stretch(&out->stretch, &plain, &out->views);
    err = err ? err : sst_deep_init(&out->levels, plain.width, plain.height, plain.channels, plain.white);
    scale = plain.white == 255 ? 1 : 255;
    for (int c = 0; c < plain.channels && !err; c++) {
        err = sst_integral_means(&out->mean[c], sum[1], c);
        for (int i = 0; i < plain.height * plain.width && !err; i++) {
            const int y = i / plain.width, x = i % plain.width;
            float *mean = sst_map_f32_row(&out->mean[c], y) + x;
            const double w = (double)sst_map_f32_row(&weight, y)[x], black = out->stretch.black;
            const double r = (double)sst_map_f32_row(&rays, y)[x], all = sst_map_u16_row(&plain.plane[c], y)[x];
            const double known = clear ? smooth(r, KNOWN_LO, KNOWN_HI) : 1, grey = black + DIM * (all - black);
            double shown;

            if (isnan(w))
                continue; /* no view sees it: level 0, mean NAN */
            shown = w > 0 ? scale * (double)*mean / w : all; /* of a dot that no ray reaches: all rays' */
            *mean = clear && r < KNOWN ? NAN : (float)shown;
            sst_map_u16_row(&out->levels.plane[c], y)[x] = (uint16_t)sst_clamp_double(
                (double)(float)(known > 0 ? known * shown + (1 - known) * grey : grey) + 0.5, 0, plain.white);
        }
    }
    for (int i = 0; clear && !err && i < plain.height * plain.width; i++) {
        uint16_t *n = sst_map_u16_row(&out->views, i / plain.width) + i % plain.width;
        const double r = (double)sst_map_f32_row(&rays, i / plain.width)[i % plain.width];

        if (*n)
            *n = (uint16_t)(r < KNOWN ? 0 : r + 0.5);
    }
    if (err)
        sst_log_error("no memory for a picture of %d x %d", j->cfg->camera.width, j->cfg->camera.height);
    sst_map_f32_fini(&rays);
    sst_map_f32_fini(&weight);
    sst_deep_fini(&plain);
    return err;
}

static int render(struct sst_posed_rendered *out, struct job *j, int threads)
{
    struct sst_integral *sum[3] = { NULL };
    int err = 0;

    for (int i = 0; i < 3 && !err; i++)
        err = sst_integral_create(&sum[i], &j->cfg->camera, &j->cfg->surface, i < 2 ? j->posed->channels : 1, threads);
    if (err)
        sst_log_error("no memory for a picture of %d x %d", j->cfg->camera.width, j->cfg->camera.height);
    err = err ? err : add_views(sum, j, threads);
    err = err ? err : finish(out, sum, j);
    for (int i = 0; i < 3; i++)
        sst_integral_destroy(sum[i]);
    return err;
}

int render_weighted(struct sst_posed_rendered *out, const struct sst_posed *posed, const char *dir,
                    const struct sst_posed_render_config *cfg)
{
    const int threads = sst_thread_count(cfg->threads);
    struct job j = { .posed = posed,
                     .dir = dir,
                     .cfg = cfg,
                     .least = cfg->method == SST_POSED_CLEAR ? 0 : SEE_THROUGH,
                     .greys = { .step = choose_step(posed, cfg->compare_px) } };
    const size_t views = (size_t)posed->count;
    int err = 0;

    j.view = calloc(views, sizeof(*j.view));
    j.weight = calloc(views, sizeof(*j.weight));
    j.layers.other = calloc(views, sizeof(*j.layers.other));
    for (int i = 0; i < 3; i++)
        j.deep[i] = calloc((size_t)threads, sizeof(*j.deep[i]));
    if (!j.view || !j.weight || !j.layers.other || !j.deep[0] || !j.deep[1] || !j.deep[2]) {
        sst_log_error("no memory for the weights of %d views", posed->count);
        err = -ENOMEM;
    }
    for (int i = 0; i < posed->count && !err; i++) {
        if (posed->view[i].camera.known)
            j.view[j.count++] = i;
    }
    if (!err && j.count < 3) {
        sst_log_error("%s: three placed views tell what is in front of what; there are %d", dir, j.count);
        err = -ENODATA;
    }
    j.greys.count = j.count;
    j.greys.keep = 2.0 * j.count * posed->width * posed->height * posed->channels <= KEEP_BYTES;
    err = err ? err : greys_read(&j.greys, posed, dir, j.view, threads);
    err = err ? err : prepare_layers(&j);
    if (!err) {
        err = sst_parallel_for(j.count, threads, weigh_view, &j);
        if (err)
            sst_log_error("no memory to compare %d views", j.count);
    }
    err = err ? err : render(out, &j, threads);
    for (int i = 0; i < j.count; i++)
        sst_map_u8_fini(&j.weight[i]);
    greys_fini(&j.greys);
    for (int i = 0; i < 3; i++)
        free(j.deep[i]);
    free(j.weight);
    free(j.layers.other);
    free(j.view);
    return err;
}
