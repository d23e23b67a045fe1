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
#define LEAST_PX     256   /* but not below this width */
#define PARALLAX_PX  25.0  /* of the surface between compared views, there */
#define STEP_PX      1.0   /* of parallax, between surfaces */
#define STEPS        48    /* at most */
#define HIGHEST      1.1   /* of the highest points: where the surfaces in front end */
#define HIGHEST_SURE 0.5   /* of the distance, where no points are known */
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
    int white; /* of the pictures; 0: none was read yet */
    int *view; /* [count] placed ones */
    int count;
    struct greys greys;
    struct layers layers;
    struct sst_map_u8 *weight; /* [count] */
    bool *needed;              /* [count] seen by the camera, or compared with such a view */
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

/* Views inside the camera's picture, and their partners of comparison. */
static int choose_views(struct job *j, int threads)
{
    int err = layer_cells_find(j->layers.seen, &j->greys, &j->cfg->camera, &j->cfg->surface, threads);

    if (err)
        sst_log_error("no memory for the parts of %d views that the camera sees", j->count);
    for (int k = 0; k < j->count && !err; k++) {
        if (!j->layers.seen[k].cell)
            continue;
        j->needed[k] = true;
        for (int i = 0; i < LAYER_OTHERS && j->layers.other[k][i] >= 0; i++)
            j->needed[j->layers.other[k][i]] = true;
    }
    return err;
}

static int weigh_view(void *arg, int index, int worker SST_UNUSED)
{
    struct job *j = arg;

    if (!j->layers.seen[index].cell)
        return 0;
    return layers_weigh(&j->weight[index], &j->layers, index);
}

/* --- sums -----------------------------------------------------------------------------------------------------------
 */

/* Some views at once. */
struct chunk {
    struct job *job;
    int n, *index; /* [n] of the job's views */
    struct sst_deep *own; /* pictures that are not kept */
    struct sst_map_u16 *weight;
    struct weighted_view *view;
};

static int prepare_view(void *arg, int index, int worker SST_UNUSED)
{
    const struct chunk *chunk = arg;
    struct job *j = chunk->job;
    const int k = chunk->index[index];
    struct weighted_view *v = &chunk->view[index];
    int err;

    *v = (struct weighted_view){ .weight = &chunk->weight[index],
                                 .places = j->cfg->places,
                                 .view = j->view[k],
                                 .warp = warp_view_of(&j->cfg->camera, &j->posed->view[j->view[k]].camera,
                                                      j->posed->width, j->posed->height) };
    err = sst_posed_borrow(&v->picture, &chunk->own[index], j->posed, j->dir, j->view[k]);
    if (err)
        return err;
    err = weights_in_picture(&chunk->weight[index], &j->weight[k], &j->greys.camera[k], j->least);
    if (err)
        sst_log_error("no memory for the weights of %d views", j->count);
    return err;
}

/* @return -EINVAL: a picture that these sums may not have; logged */
static int check_chunk(const struct chunk *chunk)
{
    struct job *j = chunk->job;

    for (int i = 0; i < chunk->n; i++) {
        const struct sst_deep *picture = chunk->view[i].picture;

        if (picture->channels != j->posed->channels || picture->width != j->posed->width ||
            picture->height != j->posed->height || (j->white && picture->white != j->white)) {
            sst_log_error("%s: views have other sizes, channels or levels than the light field", j->dir);
            return -EINVAL;
        }
        j->white = picture->white;
    }
    return 0;
}

static int add_chunk(struct weighted *sums, struct chunk *chunk, int threads)
{
    int err = sst_parallel_for(chunk->n, threads, prepare_view, chunk);

    err = err ? err : check_chunk(chunk);
    err = err ? err : weighted_add(sums, chunk->view, chunk->n, chunk->job->greys.step);
    for (int i = 0; i < chunk->n; i++) {
        sst_deep_fini(&chunk->own[i]);
        chunk->own[i] = (struct sst_deep){ 0 };
        sst_map_u16_fini(&chunk->weight[i]);
    }
    chunk->n = 0;
    return err;
}

/* Add the views that the camera sees: all at once if they are in memory, else as many as there are threads. */
static int add_views(struct weighted *sums, struct job *j, int threads)
{
    const int most = j->posed->picture || j->posed->kept ? j->count : threads;
    struct chunk chunk = { .job = j };
    int err = 0;

    chunk.index = calloc((size_t)most, sizeof(*chunk.index));
    chunk.own = calloc((size_t)most, sizeof(*chunk.own));
    chunk.weight = calloc((size_t)most, sizeof(*chunk.weight));
    chunk.view = calloc((size_t)most, sizeof(*chunk.view));
    if (!chunk.index || !chunk.own || !chunk.weight || !chunk.view) {
        sst_log_error("no memory for the weights of %d views", j->count);
        err = -ENOMEM;
    }
    for (int k = 0; k < j->count && !err; k++) {
        if (!j->layers.seen[k].cell)
            continue;
        chunk.index[chunk.n++] = k;
        if (chunk.n == most)
            err = add_chunk(sums, &chunk, threads);
    }
    err = err || !chunk.n ? err : add_chunk(sums, &chunk, threads);
    free(chunk.index);
    free(chunk.own);
    free(chunk.weight);
    free(chunk.view);
    return err;
}

/* --- picture --------------------------------------------------------------------------------------------------------
 */

static double smooth(double v, double lo, double hi)
{
    const double t = sst_clamp_double((v - lo) / (hi - lo), 0, 1);

    return t * t * (3 - 2 * t);
}

struct finish_job {
    struct sst_posed_rendered *out;
    const struct weighted *sums;
    const struct job *job;
    struct sst_deep plain;
    struct sst_map_f32 rays;
};

/* The integral, and rays in sum, of a row. */
static int start_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct finish_job *f = arg;
    const struct weighted *sums = f->sums;
    const size_t width = (size_t)sums->warp.camera.width, at = (size_t)y * width;
    float *rays = sst_map_f32_row(&f->rays, y);

    for (int c = 0; c < sums->channels; c++) {
        uint16_t *row = sst_map_u16_row(&f->plain.plane[c], y);

        for (size_t x = 0; x < width; x++) {
            const uint32_t n = (uint32_t)sums->count[at + x] << SST_WARPED_SHIFT;

            row[x] = (uint16_t)(n ? ((uint64_t)sums->sum[c][at + x] + n / 2) / n : 0);
        }
    }
    for (size_t x = 0; x < width; x++)
        rays[x] = (float)sums->weight[at + x] * (1.0f / 255);
    memcpy(sst_map_u16_row(&f->out->views, y), sums->count + at, width * sizeof(*sums->count));
    return 0;
}

/* Means of weighted rays; of clear pictures, levels of unknown pixels become the dimmed integral, and means NAN. */
static int finish_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct finish_job *f = arg;
    const struct weighted *sums = f->sums;
    const bool clear = f->job->cfg->method == SST_POSED_CLEAR;
    const size_t width = (size_t)sums->warp.camera.width, at = (size_t)y * width;
    const double black = f->out->stretch.black, white = f->plain.white;
    const float *rays = sst_map_f32_row(&f->rays, y);
    uint16_t *views = sst_map_u16_row(&f->out->views, y);

    for (int c = 0; c < sums->channels; c++) {
        const uint16_t *plain = sst_map_u16_row(&f->plain.plane[c], y);
        uint16_t *level = sst_map_u16_row(&f->out->levels.plane[c], y);
        float *mean = sst_map_f32_row(&f->out->mean[c], y);

        for (size_t x = 0; x < width; x++) {
            const double r = (double)rays[x], all = plain[x], w = sums->weight[at + x];
            const double known = clear ? smooth(r, KNOWN_LO, KNOWN_HI) : 1, grey = black + DIM * (all - black);
            double shown;

            if (!views[x]) { /* no view sees it: level 0 */
                mean[x] = NAN;
                continue;
            }
            /* Of a dot that no ray reaches: all rays'. */
            shown = w > 0 ? (double)sums->weighted[c][at + x] / ((1 << SST_WARPED_SHIFT) * w) : all;
            mean[x] = clear && r < KNOWN ? NAN : (float)shown;
            level[x] = (uint16_t)sst_clamp_double(
                (double)(float)(known > 0 ? known * shown + (1 - known) * grey : grey) + 0.5, 0, white);
        }
    }
    for (size_t x = 0; clear && x < width; x++) {
        const double r = (double)rays[x];

        if (views[x])
            views[x] = (uint16_t)(r < KNOWN ? 0 : r + 0.5);
    }
    return 0;
}

static int finish(struct sst_posed_rendered *out, const struct weighted *sums, const struct job *j, int white)
{
    const struct sst_virtual *camera = &sums->warp.camera;
    const int width = camera->width, height = camera->height;
    struct finish_job f = { .out = out, .sums = sums, .job = j };
    int err = sst_deep_init(&f.plain, width, height, sums->channels, white);

    err = err ? err : sst_map_f32_init(&f.rays, width, height);
    err = err ? err : sst_map_u16_init(&out->views, width, height);
    err = err ? err : sst_parallel_for(height, sums->threads, start_row, &f);
    if (!err && j->cfg->method == SST_POSED_CLEAR)
        err =
            specks_remove(&f.rays, &f.plain, (const float[2]){ (float)KNOWN_LO, (float)KNOWN_HI }, LAYER_WINDOW * j->greys.step);
    out->seen = !err && posed_any(&out->views);
    err = err ? err : posed_stretch(&out->stretch, &f.plain, &out->views);
    err = err ? err : sst_deep_init(&out->levels, width, height, sums->channels, white);
    for (int c = 0; c < sums->channels && !err; c++)
        err = sst_map_f32_init(&out->mean[c], width, height);
    err = err ? err : sst_parallel_for(height, sums->threads, finish_row, &f);
    if (err)
        sst_log_error("no memory for a picture of %d x %d", width, height);
    sst_map_f32_fini(&f.rays);
    sst_deep_fini(&f.plain);
    return err;
}

static int render(struct sst_posed_rendered *out, struct job *j, int threads)
{
    struct weighted sums = { 0 };
    int err = weighted_init(&sums, &j->cfg->camera, &j->cfg->surface, j->posed->channels, threads);

    if (err)
        sst_log_error("no memory for a picture of %d x %d", j->cfg->camera.width, j->cfg->camera.height);
    err = err ? err : add_views(&sums, j, threads);
    err = err ? err : finish(out, &sums, j, j->white ? j->white : UINT16_MAX);
    weighted_fini(&sums);
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
    j.needed = calloc(views, sizeof(*j.needed));
    j.layers.other = calloc(views, sizeof(*j.layers.other));
    j.layers.seen = calloc(views, sizeof(*j.layers.seen));
    if (!j.view || !j.weight || !j.needed || !j.layers.other || !j.layers.seen) {
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
    j.greys.needed = j.needed;
    err = err ? err : warp_check_size(posed, dir);
    err = err ? err : greys_cameras(&j.greys, posed, j.view);
    err = err ? err : prepare_layers(&j);
    err = err ? err : choose_views(&j, threads);
    err = err ? err : greys_read(&j.greys, posed, dir, j.view, threads);
    if (!err) {
        err = sst_parallel_for(j.count, threads, weigh_view, &j);
        if (err)
            sst_log_error("no memory to compare %d views", j.count);
    }
    err = err ? err : render(out, &j, threads);
    for (int i = 0; i < j.count; i++) {
        sst_map_u8_fini(&j.weight[i]);
        free(j.layers.seen[i].cell);
    }
    greys_fini(&j.greys);
    free(j.weight);
    free(j.needed);
    free(j.layers.other);
    free(j.layers.seen);
    free(j.view);
    return err;
}
