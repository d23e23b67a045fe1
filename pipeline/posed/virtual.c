/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/virtual.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/posed/surface_internal.h"

#define NADIR_HEIGHTS 10.0 /* diagonals of the covered ground that the camera is above it */

struct sst_virtual sst_virtual_of_view(const struct sst_posed *posed, int view)
{
    const struct sst_calib_camera *cam = &posed->view[view].camera;
    struct sst_virtual v = { posed->width, posed->height, cam->fx, cam->fy, cam->cx, cam->cy, { 0 }, { 0 } };

    memcpy(v.rotation, cam->rotation, sizeof(v.rotation));
    memcpy(v.centre_mm, cam->position_mm, sizeof(v.centre_mm));
    return v;
}

struct sst_virtual sst_virtual_scaled(const struct sst_virtual *camera, double factor)
{
    struct sst_virtual v = *camera;

    v.width = sst_max_int(2, (int)floor(camera->width / factor));
    v.height = sst_max_int(2, (int)floor(camera->height / factor));
    v.fx /= factor;
    v.fy /= factor;
    v.cx = (camera->cx + 0.5) / factor - 0.5;
    v.cy = (camera->cy + 0.5) / factor - 0.5;
    return v;
}

void sst_virtual_ray(const struct sst_virtual *camera, double x, double y, double direction[3])
{
    const double a = (x - camera->cx) / camera->fx, b = (y - camera->cy) / camera->fy;
    const double *r = camera->rotation;

    for (int i = 0; i < 3; i++)
        direction[i] = r[i] * a + r[3 + i] * b + r[6 + i];
}

/* Covered ground in the level axes of a nadir camera, and the sizes of pixels on it. */
struct footprint {
    double lo[2], hi[2];
    double height_mm; /* sum along up */
    double *pixel_mm;
    int count;
};

static void add_footprint(struct footprint *f, const struct sst_posed *posed, int view,
                          const struct sst_surface *surface, const double rotation[9])
{
    const struct sst_virtual camera = sst_virtual_of_view(posed, view);
    double ray[3], at[3], t, reach;

    sst_virtual_ray(&camera, (camera.width - 1) / 2.0, (camera.height - 1) / 2.0, ray);
    t = sst_surface_meet(surface, camera.centre_mm, ray);
    if (!isfinite(t))
        return;
    for (int i = 0; i < 3; i++)
        at[i] = camera.centre_mm[i] + t * ray[i];
    f->pixel_mm[f->count++] = t / camera.fx;
    f->height_mm -= vector_dot(rotation + 6, at);
    reach = t / camera.fx * sst_min_int(camera.width, camera.height) / 2;
    for (int k = 0; k < 2; k++) {
        f->lo[k] = fmin(f->lo[k], vector_dot(rotation + 3 * k, at) - reach);
        f->hi[k] = fmax(f->hi[k], vector_dot(rotation + 3 * k, at) + reach);
    }
}

/* Axes of a camera that looks down: its picture's top is north, or as near to the middle view's as that can be. */
static void nadir_axes(double rotation[9], const struct sst_posed *posed)
{
    const double *middle = posed->view[sst_posed_middle(posed)].camera.rotation;
    double top[3] = { 0, 1, 0 };

    for (int i = 0; i < 3; i++) {
        rotation[6 + i] = -posed->up[i];
        /* The picture's top of a view that looks to the horizon is upwards, its forward direction is the ground's. */
        top[i] = posed->geographic ? top[i] : middle[6 + i] - middle[3 + i];
    }
    vector_cross(rotation, rotation + 6, top);
    vector_unit(rotation);
    vector_cross(rotation + 3, rotation + 6, rotation);
}

int sst_virtual_nadir(struct sst_virtual *out, const struct sst_posed *posed, const struct sst_surface *surface,
                      double most_pixels)
{
    struct sst_virtual v = { 0 };
    struct footprint f = { .lo = { INFINITY, INFINITY }, .hi = { -INFINITY, -INFINITY } };
    double pixel_mm, high_mm, middle[2], size[2];

    if (sst_posed_middle(posed) < 0 || !(vector_length(posed->up) > 0.5)) {
        sst_log_error("a nadir camera needs placed views and the direction of gravity");
        return -EINVAL;
    }
    f.pixel_mm = malloc((size_t)posed->count * sizeof(*f.pixel_mm));
    if (!f.pixel_mm) {
        sst_log_error("no memory for the footprints of %d views", posed->count);
        return -ENOMEM;
    }
    nadir_axes(v.rotation, posed);
    for (int i = 0; i < posed->count; i++) {
        if (posed->view[i].camera.known)
            add_footprint(&f, posed, i, surface, v.rotation);
    }
    sst_stats_sort_double(f.pixel_mm, f.count);
    pixel_mm = f.count ? f.pixel_mm[f.count / 2] : 0;
    free(f.pixel_mm);
    for (int k = 0; k < 2; k++)
        size[k] = f.hi[k] - f.lo[k];
    if (!isfinite(size[0] * size[1])) {
        sst_log_error("no view's centre meets the surface");
        return -EINVAL;
    }
    for (int k = 0; k < 2; k++)
        middle[k] = (f.lo[k] + f.hi[k]) / 2;
    pixel_mm = fmax(pixel_mm, sqrt(size[0] * size[1] / most_pixels));
    pixel_mm = fmax(pixel_mm, fmax(size[0], size[1]) / (SST_IMAGE_MAX_SIDE / 2));
    v.width = sst_max_int(2, (int)ceil(size[0] / pixel_mm));
    v.height = sst_max_int(2, (int)ceil(size[1] / pixel_mm));
    v.cx = (v.width - 1) / 2.0;
    v.cy = (v.height - 1) / 2.0;
    high_mm = NADIR_HEIGHTS * hypot(size[0], size[1]);
    v.fx = v.fy = high_mm / pixel_mm;
    for (int i = 0; i < 3; i++)
        v.centre_mm[i] = v.rotation[i] * middle[0] + v.rotation[3 + i] * middle[1] +
                         posed->up[i] * (f.height_mm / f.count + high_mm);
    *out = v;
    return 0;
}
