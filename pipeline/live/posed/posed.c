/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/posed/posed_internal.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/posed/solve/solve.h"

#define RETRY_NS INT64_C(20000000000) /* after a fit that failed */
#define NEARER   0.5                  /* of a plane that is given: reach of the focus */
#define FARTHER  1.5

/* --- opening ------------------------------------------------------------------------------------------------------ */

static int copy_poses(struct sst_posed *out, const struct sst_posed *in)
{
    int err = sst_posed_init(out, in->count);
    struct sst_posed_view *view = out->view;

    if (err)
        return err;
    *out = *in;
    out->view = view;
    memcpy(view, in->view, (size_t)in->count * sizeof(*view));
    out->sights = NULL; /* of no use here */
    out->sight_count = 0;
    out->points = NULL;
    if (in->point_count) {
        out->points = malloc((size_t)in->point_count * sizeof(*out->points));
        if (!out->points)
            return -ENOMEM;
        memcpy(out->points, in->points, (size_t)in->point_count * sizeof(*out->points));
    }
    return 0;
}

static void set_plane(struct sst_liveposed *p, double distance_mm)
{
    const double *axis = p->camera.rotation + 6, back[3] = { -axis[0], -axis[1], -axis[2] };
    double at[3];

    for (int i = 0; i < 3; i++)
        at[i] = p->camera.centre_mm[i] + distance_mm * axis[i];
    p->ground = (struct sst_posed_ground){ .plane = sst_surface_plane(back, at), .distance_mm = distance_mm };
    p->reach_mm[0] = p->near_mm > 0 ? p->near_mm : NEARER * distance_mm;
    p->reach_mm[1] = p->far_mm > 0 ? p->far_mm : FARTHER * distance_mm;
    p->known = true;
}

static int check(const struct sst_liveposed *p)
{
    const struct sst_live_posed *c = &p->cfg->posed;
    const struct sst_lightfield *lf = p->lf;

    if (p->all.count != lf->rows * lf->cols || p->all.width != lf->width || p->all.height != lf->height ||
        sst_posed_placed(&p->all) < 3) {
        sst_log_error("live: a surface is seen by at least three cameras with poses, of the size of the frames");
        return -EINVAL;
    }
    if (!(c->plane_mm > 0) && p->all.point_count < 10 && !(c->near_mm > 0 && c->far_mm > c->near_mm)) {
        sst_log_error("live: the ground is sought between two distances; give both near_m and far_m, such as two "
                      "thirds and one and a half of the height, or a plane: surface_m");
        return -EINVAL;
    }
    return 0;
}

/* Distance of pictures until the ground is known: between its limits, or the points' median. */
static int guess_distance(struct sst_liveposed *p)
{
    const double *axis = p->camera.rotation + 6;
    double *depth;

    p->start_mm = sqrt(p->near_mm * p->far_mm);
    if (p->start_mm > 0 || !p->all.point_count)
        return 0;
    depth = malloc((size_t)p->all.point_count * sizeof(*depth));
    if (!depth)
        return -ENOMEM;
    for (int i = 0; i < p->all.point_count; i++) {
        depth[i] = 0;
        for (int k = 0; k < 3; k++)
            depth[i] += axis[k] * (p->all.points[i].at_mm[k] - p->camera.centre_mm[k]);
    }
    sst_stats_sort_double(depth, p->all.point_count);
    p->start_mm = depth[p->all.point_count / 2];
    free(depth);
    return 0;
}

/* Cameras that are configured and have a pose are views. */
static int set_geometry(struct sst_liveposed *p)
{
    int middle;

    for (int k = 0; k < p->all.count; k++) {
        p->all.view[k].camera.known &= p->cfg->present[k];
        p->lf->views[k].present &= p->all.view[k].camera.known;
    }
    middle = sst_posed_middle(&p->all);
    if (middle < 0)
        return 0; /* check() refuses it */
    p->camera = sst_virtual_of_view(&p->all, middle);
    p->lf->ref_view = middle;
    p->lf->focal_px = p->camera.fx;
    p->lf->spacing_mm = sst_posed_spacing(&p->all);
    return guess_distance(p);
}

int sst_liveposed_open(struct sst_liveposed **out, const struct sst_live_config *cfg, struct sst_lightfield *lf)
{
    struct sst_liveposed *p = calloc(1, sizeof(*p));
    int err = p ? 0 : -ENOMEM;

    if (!err) {
        p->cfg = cfg;
        p->lf = lf;
        p->near_mm = cfg->posed.near_mm;
        p->far_mm = cfg->posed.far_mm;
        p->serial = 1;
        err = copy_poses(&p->all, cfg->posed.poses);
        err = err ? err : set_geometry(p);
        err = err ? err : check(p);
        err = err ? err : copy_poses(&p->now, &p->all);
    }
    for (int k = 0; k < (err ? 0 : p->now.count); k++)
        p->now.view[k].camera.known = false;
    if (!err) {
        p->now.picture = p->picture;
        if (cfg->posed.plane_mm > 0)
            set_plane(p, cfg->posed.plane_mm);
        *out = p;
        return 0;
    }
    if (err == -ENOMEM)
        sst_log_error("live: no memory for the poses of %d cameras", lf->rows * lf->cols);
    sst_liveposed_close(p);
    return err;
}

void sst_liveposed_close(struct sst_liveposed *p)
{
    if (!p)
        return;
    atomic_store(&p->fit.canceled, true);
    posed_fit_end(&p->fit);
    for (int i = 0; i < POSED_PLACES; i++)
        sst_integral_places_destroy(p->places[i].places);
    sst_integral_destroy(p->integral);
    sst_image_fini(&p->last.image);
    for (int k = 0; k < SST_MAX_VIEWS; k++)
        sst_deep_fini(&p->picture[k]);
    sst_posed_fini(&p->now);
    sst_posed_fini(&p->all);
    free(p);
}

/* --- views -------------------------------------------------------------------------------------------------------- */

struct take_job {
    struct sst_liveposed *p;
    const struct sst_liveframes_changes *changes;
};

/* Rows of tiles with a change become levels. */
static int take_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct take_job *job = arg;
    const struct sst_liveframes_changes *c = job->changes;
    const struct sst_image *image = &job->p->lf->views[k].image;
    struct sst_deep *deep = &job->p->picture[k];
    const bool fresh = !deep->plane[0].data;
    int err = 0;

    if (!job->p->all.view[k].camera.known || !image->plane[0] || !c->map[k])
        return 0;
    if (fresh)
        err = sst_deep_init(deep, image->width, image->height, job->p->all.channels, 255);
    for (int y = 0; y < image->height && !err; y++) {
        const uint8_t *tiles = c->map[k] + y / SST_LIVE_TILE * c->cols;

        if (!fresh && !c->whole && !memchr(tiles, 1, (size_t)c->cols))
            continue;
        for (int plane = 0; plane < deep->channels; plane++) {
            const uint8_t *from = sst_image_row(image, deep->channels == 1 ? 1 : plane, y);
            uint16_t *to = sst_map_u16_row(&deep->plane[plane], y);

            for (int x = 0; x < image->width; x++)
                to[x] = from[x];
        }
    }
    return err;
}

static void start_fit(struct sst_liveposed *p)
{
    const struct sst_ground_config cfg = { .near_mm = p->near_mm, .far_mm = p->far_mm, .threads = p->cfg->threads };
    const int err = posed_fit_start(&p->fit, &p->now, &p->camera, &cfg);

    p->due_ns = sst_clock_now_ns() + RETRY_NS;
    if (err)
        snprintf(p->why, sizeof(p->why), "the ground cannot be fitted now: %s", strerror(-err));
}

int sst_liveposed_update(struct sst_liveposed *p, const struct sst_liveframes_changes *changes, bool fit)
{
    struct take_job job = { p, changes };
    const int64_t now_ns = sst_clock_now_ns();
    int placed = 0, err = sst_parallel_for(p->all.count, p->cfg->threads, take_view, &job);

    if (err) {
        sst_log_error("live: no memory for views of %d x %d pixels", p->lf->width, p->lf->height);
        return err;
    }
    p->serial += changes->changed > 0 || changes->whole;
    for (int k = 0; k < p->all.count; k++) {
        const struct sst_view *v = &p->lf->views[k];
        const bool known = p->all.view[k].camera.known && v->present && p->picture[k].plane[0].data;

        p->serial += known != p->now.view[k].camera.known;
        p->now.view[k].camera.known = known;
        placed += known;
    }
    fit |= !p->known;
    if (fit && !(p->cfg->posed.plane_mm > 0) && !p->fit.running && now_ns >= p->due_ns &&
        placed >= sst_min_int(sst_posed_placed(&p->all), 3))
        start_fit(p);
    return 0;
}

/* --- the surface -------------------------------------------------------------------------------------------------- */

bool sst_liveposed_unsettled(const struct sst_liveposed *p)
{
    return atomic_load(&p->fit.done);
}

bool sst_liveposed_settle(struct sst_liveposed *p)
{
    const double every_s = p->cfg->posed.every_s;

    if (!sst_liveposed_unsettled(p))
        return false;
    posed_fit_end(&p->fit);
    snprintf(p->why, sizeof(p->why), "%s", p->fit.err ? p->fit.why : "");
    if (p->fit.err)
        return false; /* it is tried again */
    p->ground = p->fit.ground;
    p->reach_mm[0] = p->ground.at_mm[0];
    p->reach_mm[1] = p->ground.at_mm[p->ground.planes - 1];
    p->fitted_ns = sst_clock_now_ns();
    if (p->due_ns) /* 0: demanded again meanwhile */
        p->due_ns = every_s > 0 ? p->fitted_ns + (int64_t)(every_s * 1e9) : INT64_MAX;
    p->known = true;
    p->serial++;
    return true;
}

void sst_liveposed_refit(struct sst_liveposed *p)
{
    p->due_ns = 0;
}

void sst_liveposed_surface(const struct sst_liveposed *p, struct sst_live_surface *out)
{
    *out = (struct sst_live_surface){ .known = p->known,
                                      .fitted = p->fitted_ns > 0,
                                      .fitting = p->fit.running,
                                      .distance_mm = p->known ? p->ground.distance_mm : (double)NAN,
                                      .tilt_deg = p->known ? p->ground.tilt_deg : (double)NAN,
                                      .views = p->ground.views,
                                      .fitted_ns = p->fitted_ns };
    if (p->why[0])
        snprintf(out->why, sizeof(out->why), "%.*s", (int)sizeof(out->why) - 1, p->why);
    else if (!p->known)
        snprintf(out->why, sizeof(out->why), "the ground is being sought");
}

static double scale(const struct sst_liveposed *p)
{
    return p->lf->focal_px * p->lf->spacing_mm;
}

double sst_liveposed_focus(const struct sst_liveposed *p)
{
    return p->known ? scale(p) / p->ground.distance_mm : (double)NAN;
}

bool sst_liveposed_range(const struct sst_liveposed *p, double *min_px, double *max_px)
{
    if (!p->known)
        return false;
    *min_px = scale(p) / p->reach_mm[1];
    *max_px = scale(p) / p->reach_mm[0];
    return true;
}

struct sst_surface posed_surface(const struct sst_liveposed *p, double focus_px)
{
    const double *axis = p->camera.rotation + 6, own_px = sst_liveposed_focus(p);
    double normal[3], at[3], mm = p->start_mm;

    if (p->known && !(focus_px > 0 && fabs(focus_px - own_px) > 1e-9))
        return p->ground.plane;
    if (p->known)
        mm = sst_clamp_double(scale(p) / focus_px, p->reach_mm[0], p->reach_mm[1]);
    for (int i = 0; i < 3; i++) {
        normal[i] = p->known ? p->ground.plane.normal[i] : -axis[i];
        at[i] = p->camera.centre_mm[i] + mm * axis[i];
    }
    return sst_surface_plane(normal, at);
}

double sst_liveposed_disparity(const struct sst_liveposed *p, double focus_px, int x, int y)
{
    const struct sst_surface surface = posed_surface(p, focus_px);
    double ray[3], depth_mm;

    sst_virtual_ray(&p->camera, x, y, ray);
    depth_mm = sst_surface_meet(&surface, p->camera.centre_mm, ray);
    return isfinite(depth_mm) ? scale(p) / depth_mm : (double)NAN;
}
