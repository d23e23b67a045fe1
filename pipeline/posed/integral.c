/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/integral.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/picture.h"
#include "pipeline/posed/surface_internal.h"

struct sst_integral {
    struct warp warp;
    struct warp_rows *rows; /* [threads] */
    int channels, threads;
    int white; /* of the pictures; 0: none yet */
    int views;
    uint32_t *sum[3]; /* [height][width] */
    uint16_t *count;
};

int sst_integral_create(struct sst_integral **out, const struct sst_virtual *camera, const struct sst_surface *surface,
                        int channels, int threads)
{
    const size_t pixels = (size_t)camera->width * (size_t)camera->height;
    struct sst_integral *s = calloc(1, sizeof(*s));
    int err = s ? 0 : -ENOMEM;

    if (err)
        return err;
    s->channels = channels;
    s->threads = sst_thread_count(threads);
    if ((channels != 1 && channels != 3) || camera->width < 1 || camera->height < 1 ||
        camera->width > SST_IMAGE_MAX_SIDE || camera->height > SST_IMAGE_MAX_SIDE || pixels > SST_IMAGE_MAX_PIXELS)
        err = -EINVAL;
    if (!err)
        err = warp_init(&s->warp, camera, surface);
    if (!err) {
        s->rows = calloc((size_t)s->threads, sizeof(*s->rows));
        s->count = sst_mem_alloc(pixels, sizeof(*s->count));
        err = s->rows && s->count ? 0 : -ENOMEM;
    }
    for (int c = 0; c < channels && !err; c++) {
        s->sum[c] = sst_mem_alloc(pixels, sizeof(*s->sum[c]));
        err = s->sum[c] ? 0 : -ENOMEM;
    }
    for (int i = 0; i < s->threads && !err; i++)
        err = warp_rows_init(&s->rows[i], &s->warp);
    if (err)
        sst_integral_destroy(s);
    else
        *out = s;
    return err;
}

void sst_integral_destroy(struct sst_integral *integral)
{
    if (!integral)
        return;
    for (int i = 0; integral->rows && i < integral->threads; i++)
        warp_rows_fini(&integral->rows[i]);
    for (int c = 0; c < 3; c++)
        sst_mem_free(integral->sum[c]);
    sst_mem_free(integral->count);
    warp_fini(&integral->warp);
    free(integral->rows);
    free(integral);
}

void sst_integral_restart(struct sst_integral *integral, const struct sst_surface *surface)
{
    const size_t pixels = (size_t)integral->warp.camera.width * (size_t)integral->warp.camera.height;

    for (int c = 0; c < integral->channels; c++)
        memset(integral->sum[c], 0, pixels * sizeof(*integral->sum[c]));
    memset(integral->count, 0, pixels * sizeof(*integral->count));
    integral->views = 0;
    integral->white = 0;
    if (surface)
        warp_restart(&integral->warp, surface);
}

/* --- views ----------------------------------------------------------------------------------------------------------
 */

/* Segments of a view's bands. */
struct kept_band {
    struct sst_warped_segment *segment; /* of all rows, one after another */
    int segments[WARP_CELL];
};

struct sst_integral_places {
    struct warp warp;
    struct warp_rows *rows; /* [threads] */
    const struct sst_posed *posed;
    int views;
    struct kept_band *band; /* [views][warp.bands] */
};

struct add_job {
    struct sst_integral *integral;
    const struct warp_view *view; /* [n], or NULL: */
    const struct sst_integral_places *places;
    const int *of; /* [n] views of the places */
    const struct sst_deep *const *picture;
    int n;
};

static void add_row(struct sst_integral *s, const struct sst_warped_source *from, int y,
                    const struct sst_warped_segment *segment, int segments)
{
    const size_t at = (size_t)y * (size_t)s->warp.camera.width;
    uint32_t *sum[3] = { NULL };

    if (!segments)
        return;
    for (int c = 0; c < s->channels; c++)
        sum[c] = s->sum[c] + at;
    sst_kernels_get()->warped_row(sum, s->count + at, from, segment, (size_t)segments);
}

static int add_band(void *arg, int band, int worker)
{
    const struct add_job *job = arg;
    struct sst_integral *s = job->integral;
    struct warp_rows *rows = &s->rows[worker];

    for (int k = 0; k < job->n; k++) {
        const struct sst_warped_source from = warp_source(job->picture[k]);

        if (job->view) {
            warp_band(rows, &s->warp, &job->view[k], band);
            for (int r = 0; r < WARP_CELL; r++)
                add_row(s, &from, band * WARP_CELL + r, rows->segment[r], rows->segments[r]);
        } else {
            const struct kept_band *kept = &job->places->band[job->of[k] * s->warp.bands + band];
            const struct sst_warped_segment *segment = kept->segment;

            for (int r = 0; r < WARP_CELL; segment += kept->segments[r], r++)
                add_row(s, &from, band * WARP_CELL + r, segment, kept->segments[r]);
        }
    }
    return 0;
}

/* @return -EINVAL: pictures that these sums may not have */
static int accept(struct sst_integral *integral, const struct sst_deep *const picture[], int n)
{
    if (integral->views + n > SST_POSED_MAX_VIEWS)
        return -EINVAL;
    for (int k = 0; k < n; k++) {
        if (!warp_source_fits(picture[k]->width, picture[k]->height) || picture[k]->channels != integral->channels ||
            (integral->white && picture[k]->white != integral->white))
            return -EINVAL;
        integral->white = picture[k]->white;
    }
    return 0;
}

int sst_integral_add(struct sst_integral *integral, const struct sst_calib_camera *const camera[],
                     const struct sst_deep *const picture[], int n)
{
    struct add_job job = { .integral = integral, .picture = picture, .n = n };
    struct warp_view *view;
    int err = accept(integral, picture, n);

    if (err)
        return err;
    view = malloc((size_t)sst_max_int(n, 1) * sizeof(*view));
    if (!view)
        return -ENOMEM;
    for (int k = 0; k < n; k++)
        view[k] = warp_view_of(&integral->warp.camera, camera[k], picture[k]->width, picture[k]->height);
    job.view = view;
    err = sst_parallel_for(integral->warp.bands, integral->threads, add_band, &job);
    integral->views += n;
    free(view);
    return err;
}

/* --- places that are kept -------------------------------------------------------------------------------------------
 */

static int keep_band(void *arg, int index, int worker)
{
    struct sst_integral_places *p = arg;
    struct warp_rows *rows = &p->rows[worker];
    const int band = index % p->warp.bands;

    for (int k = 0; k < p->views; k++) {
        struct kept_band *kept = &p->band[k * p->warp.bands + band];
        struct sst_warped_segment *to;
        struct warp_view view;
        size_t n = 0;

        if (!p->posed->view[k].camera.known)
            continue;
        view = warp_view_of(&p->warp.camera, &p->posed->view[k].camera, p->posed->width, p->posed->height);
        warp_band(rows, &p->warp, &view, band);
        for (int r = 0; r < WARP_CELL; r++)
            n += (size_t)rows->segments[r];
        to = kept->segment = malloc(n * sizeof(*to) + 1);
        if (!to)
            return -ENOMEM;
        for (int r = 0; r < WARP_CELL; to += rows->segments[r], r++) {
            kept->segments[r] = rows->segments[r];
            memcpy(to, rows->segment[r], (size_t)rows->segments[r] * sizeof(*to));
        }
    }
    return 0;
}

int sst_integral_places_create(struct sst_integral_places **out, const struct sst_virtual *camera,
                               const struct sst_surface *surface, const struct sst_posed *posed, int threads)
{
    struct sst_integral_places *p = calloc(1, sizeof(*p));
    const int workers = sst_thread_count(threads);
    int err = p ? 0 : -ENOMEM;

    if (err)
        return err;
    p->posed = posed;
    p->views = posed->count;
    err = warp_source_fits(posed->width, posed->height) ? warp_init(&p->warp, camera, surface) : -EINVAL;
    if (!err) {
        p->rows = calloc((size_t)workers, sizeof(*p->rows));
        p->band = calloc((size_t)p->views * (size_t)p->warp.bands, sizeof(*p->band));
        err = p->rows && p->band ? 0 : -ENOMEM;
    }
    for (int i = 0; i < workers && !err; i++)
        err = warp_rows_init(&p->rows[i], &p->warp);
    err = err ? err : sst_parallel_for(p->warp.bands, workers, keep_band, p);
    for (int i = 0; p->rows && i < workers; i++)
        warp_rows_fini(&p->rows[i]);
    free(p->rows);
    p->rows = NULL;
    warp_fini(&p->warp);
    if (err)
        sst_integral_places_destroy(p);
    else
        *out = p;
    return err;
}

void sst_integral_places_destroy(struct sst_integral_places *places)
{
    if (!places)
        return;
    for (int i = 0; places->band && i < places->views * places->warp.bands; i++)
        free(places->band[i].segment);
    free(places->band);
    free(places);
}

const struct sst_warped_segment *integral_kept(const int **segments, const struct sst_integral_places *places, int view,
                                               int band)
{
    const struct kept_band *kept = &places->band[view * places->warp.bands + band];

    *segments = kept->segments;
    return kept->segment;
}

int sst_integral_add_at(struct sst_integral *integral, const struct sst_integral_places *places, const int view[],
                        const struct sst_deep *const picture[], int n)
{
    struct add_job job = { .integral = integral, .places = places, .of = view, .picture = picture, .n = n };
    int err = accept(integral, picture, n);

    err = err ? err : sst_parallel_for(integral->warp.bands, integral->threads, add_band, &job);
    integral->views += err ? 0 : n;
    return err;
}

/* --- results --------------------------------------------------------------------------------------------------------
 */

struct levels_job {
    const struct sst_integral *integral;
    struct sst_deep *out;
};

static int level_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct levels_job *job = arg;
    const struct sst_integral *s = job->integral;
    const size_t width = (size_t)s->warp.camera.width, at = (size_t)y * width;

    for (int c = 0; c < s->channels; c++) {
        uint16_t *row = sst_map_u16_row(&job->out->plane[c], y);

        for (size_t x = 0; x < width; x++) {
            const uint32_t n = s->count[at + x] << SST_WARPED_SHIFT;

            if (n)
                row[x] = (uint16_t)(((uint64_t)s->sum[c][at + x] + n / 2) / n);
        }
    }
    return 0;
}

int sst_integral_levels(struct sst_deep *out, const struct sst_integral *integral)
{
    const struct sst_virtual *camera = &integral->warp.camera;
    struct levels_job job = { integral, out };
    int err = sst_deep_init(out, camera->width, camera->height, integral->channels,
                            integral->white ? integral->white : UINT16_MAX);

    return err ? err : sst_parallel_for(camera->height, integral->threads, level_row, &job);
}

int sst_integral_means(struct sst_map_f32 *out, const struct sst_integral *integral, int channel)
{
    const struct sst_virtual *camera = &integral->warp.camera;
    const int err = sst_map_f32_init(out, camera->width, camera->height);

    for (int y = 0; y < camera->height && !err; y++) {
        const size_t at = (size_t)y * (size_t)camera->width;

        for (int x = 0; x < camera->width; x++) {
            const double n = (double)(integral->count[at + (size_t)x] << SST_WARPED_SHIFT);

            sst_map_f32_row(out, y)[x] = n > 0 ? (float)(integral->sum[channel][at + (size_t)x] / n) : NAN;
        }
    }
    return err;
}

int sst_integral_views(struct sst_map_u16 *out, const struct sst_integral *integral)
{
    const struct sst_virtual *camera = &integral->warp.camera;
    const int err = sst_map_u16_init(out, camera->width, camera->height);

    for (int y = 0; y < camera->height && !err; y++)
        memcpy(sst_map_u16_row(out, y), integral->count + (size_t)y * (size_t)camera->width,
               (size_t)camera->width * sizeof(*integral->count));
    return err;
}

/* --- folders --------------------------------------------------------------------------------------------------------
 */

struct read_job {
    const struct sst_posed *posed;
    const char *dir;
    const int *view;
    struct sst_deep *picture;
};

static int read_view(void *arg, int index, int worker SST_UNUSED)
{
    const struct read_job *job = arg;

    return sst_posed_picture(&job->picture[index], job->posed, job->dir, job->view[index]);
}

/* Read `n` views at once and add them. */
static int add_some(struct sst_integral *s, const struct sst_posed *posed, const char *dir, const int *view, int n)
{
    const struct sst_calib_camera *camera[WARP_CELL];
    const struct sst_deep *picture[WARP_CELL];
    struct sst_deep deep[WARP_CELL] = { 0 };
    struct read_job job = { posed, dir, view, deep };
    int err = sst_parallel_for(n, s->threads, read_view, &job);

    for (int k = 0; k < n; k++) {
        camera[k] = &posed->view[view[k]].camera;
        picture[k] = &deep[k];
    }
    if (!err) {
        err = sst_integral_add(s, camera, picture, n);
        if (err == -EINVAL)
            sst_log_error("%s: views have other channels or levels than the light field", dir);
        else if (err)
            sst_log_error("no memory to add %d views", n);
    }
    for (int k = 0; k < n; k++)
        sst_deep_fini(&deep[k]);
    return err;
}

int sst_integral_add_all(struct sst_integral *integral, const struct sst_posed *posed, const char *dir)
{
    int view[WARP_CELL], n = 0, err;

    if (!sst_posed_placed(posed)) {
        sst_log_error("%s: no view is placed; `sst poses` finds poses", dir);
        return -ENODATA;
    }
    err = warp_check_size(posed, dir);
    for (int i = 0; i < posed->count && !err; i++) {
        if (!posed->view[i].camera.known)
            continue;
        view[n++] = i;
        if (n == sst_min_int(integral->threads, WARP_CELL)) {
            err = add_some(integral, posed, dir, view, n);
            n = 0;
        }
    }
    return err || !n ? err : add_some(integral, posed, dir, view, n);
}
