/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/surface.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/posed/surface_internal.h"

struct sst_surface sst_surface_plane(const double normal[3], const double point_mm[3])
{
    struct sst_surface s = { .kind = SST_SURFACE_PLANE };

    memcpy(s.normal, normal, sizeof(s.normal));
    vector_unit(s.normal);
    s.offset_mm = vector_dot(s.normal, point_mm);
    return s;
}

bool sst_surface_plane_of(struct sst_surface *out, const double point_mm[3][3], const double eye_mm[3])
{
    double a[3], b[3], normal[3], to_eye[3];

    for (int i = 0; i < 3; i++) {
        a[i] = point_mm[1][i] - point_mm[0][i];
        b[i] = point_mm[2][i] - point_mm[0][i];
        to_eye[i] = eye_mm[i] - point_mm[0][i];
    }
    vector_cross(normal, a, b);
    if (!(vector_length(normal) > 1e-9 * vector_length(a) * vector_length(b)))
        return false;
    if (vector_dot(normal, to_eye) < 0) {
        for (int i = 0; i < 3; i++)
            normal[i] = -normal[i];
    }
    *out = sst_surface_plane(normal, point_mm[0]);
    return true;
}

int sst_surface_terrain(struct sst_surface *out, const struct sst_heights *heights, const double up[3])
{
    static const double x[3] = { 1, 0, 0 };
    const double c = cos(heights->turn_rad), n = sin(heights->turn_rad);
    struct sst_surface s = {
        .kind = SST_SURFACE_TERRAIN, .normal = { 0, 0, 1 }, .heights = heights, .low_mm = INFINITY, .high_mm = -INFINITY
    };

    if (vector_length(up) > 0)
        memcpy(s.normal, up, sizeof(s.normal));
    vector_unit(s.normal);
    if (fabs(s.normal[0]) > 0.99)
        return -EINVAL; /* the grid's x would stand upright */
    vector_cross(s.along[1], s.normal, x);
    vector_unit(s.along[1]);
    vector_cross(s.along[0], s.along[1], s.normal);
    for (int i = 0; i < 3; i++) {
        const double a = s.along[0][i], b = s.along[1][i];

        s.along[0][i] = c * a + n * b;
        s.along[1][i] = c * b - n * a;
    }
    for (int j = 0; j < heights->mm.height; j++) {
        for (int i = 0; i < heights->mm.width; i++) {
            const double mm = (double)sst_map_f32_row(&heights->mm, j)[i];

            if (isfinite(mm)) {
                s.low_mm = fmin(s.low_mm, mm);
                s.high_mm = fmax(s.high_mm, mm);
            }
        }
    }
    if (heights->mm.width < 2 || heights->mm.height < 2 || !(s.low_mm <= s.high_mm))
        return -EINVAL;
    *out = s;
    return 0;
}

struct sst_surface sst_surface_moved(const struct sst_surface *surface, double mm)
{
    struct sst_surface s = *surface;

    s.offset_mm += mm;
    return s;
}

/* A ray in samples of the grid and mm above the terrain's zero: at + t along. */
struct grid_ray {
    const struct sst_heights *heights;
    double at[3], along[3];
};

/* Ray's height above the terrain; NAN: no height is known there. */
static double above(const struct grid_ray *ray, double t)
{
    const struct sst_map_f32 *map = &ray->heights->mm;
    const double x = ray->at[0] + t * ray->along[0], y = ray->at[1] + t * ray->along[1];
    const float *row;
    double fx, fy;
    int i, j;

    if (!(x >= 0 && y >= 0 && x <= map->width - 1 && y <= map->height - 1))
        return NAN;
    i = sst_min_int((int)x, map->width - 2);
    j = sst_min_int((int)y, map->height - 2);
    fx = x - i;
    fy = y - j;
    row = sst_map_f32_row(map, j) + i;
    return ray->at[2] + t * ray->along[2] -
           ((1 - fy) * ((1 - fx) * (double)row[0] + fx * (double)row[1]) +
            fy * ((1 - fx) * (double)sst_map_f32_row(map, j + 1)[i] + fx * (double)sst_map_f32_row(map, j + 1)[i + 1]));
}

/* The zero between t[0], above the terrain, and t[1], not above it: regula falsi, halving the value that stays. */
static double zero_between(const struct grid_ray *ray, const double t[2], const double f[2])
{
    double lo = t[0], hi = t[1], f_lo = f[0], f_hi = f[1];
    int kept = 0;

    for (int i = 0; i < 60 && hi - lo > 1e-12 * hi; i++) {
        const double mid = f_lo - f_hi > 0 ? (lo * -f_hi + hi * f_lo) / (f_lo - f_hi) : (lo + hi) / 2;
        const double v = above(ray, mid);

        if (isnan(v) || fabs(v) < 1e-4) /* mm */
            return mid;
        if (v <= 0) {
            hi = mid;
            f_hi = v;
            f_lo *= kept < 0 ? 0.5 : 1;
            kept = -1;
        } else {
            lo = mid;
            f_lo = v;
            f_hi *= kept > 0 ? 0.5 : 1;
            kept = 1;
        }
    }
    return (lo + hi) / 2;
}

/* Narrow the range of t to where lo <= at + t along <= hi. */
static void clip(double range[2], double at, double along, double lo, double hi)
{
    if (along == 0) {
        if (at < lo || at > hi)
            range[1] = -INFINITY;
        return;
    }
    range[0] = fmax(range[0], ((along > 0 ? lo : hi) - at) / along);
    range[1] = fmin(range[1], ((along > 0 ? hi : lo) - at) / along);
}

static double meet_terrain(const struct sst_surface *s, const double origin_mm[3], const double direction[3])
{
    const struct sst_heights *h = s->heights;
    const double first[2] = { h->x_mm, h->y_mm }, step[2] = { h->step_x_mm, h->step_y_mm };
    struct grid_ray ray = { .heights = h };
    double range[2] = { 0, INFINITY }, t[2], f[2], across;

    for (int k = 0; k < 2; k++) {
        ray.at[k] = (vector_dot(s->along[k], origin_mm) - first[k]) / step[k];
        ray.along[k] = vector_dot(s->along[k], direction) / step[k];
    }
    ray.at[2] = vector_dot(s->normal, origin_mm) - s->offset_mm;
    ray.along[2] = vector_dot(s->normal, direction);
    clip(range, ray.at[0], ray.along[0], 0, h->mm.width - 1);
    clip(range, ray.at[1], ray.along[1], 0, h->mm.height - 1);
    clip(range, ray.at[2], ray.along[2], s->low_mm - 1, s->high_mm + 1);
    if (!(range[0] < range[1]) || !isfinite(range[1]))
        return INFINITY;
    across = fmax(fabs(ray.along[0]), fabs(ray.along[1])) * (range[1] - range[0]);
    t[0] = range[0];
    f[0] = above(&ray, t[0]);
    for (int i = 1, n = 1 + (int)fmin(across, 1e6); i <= n; i++) {
        t[1] = i < n ? range[0] + (range[1] - range[0]) * i / n : range[1];
        f[1] = above(&ray, t[1]);
        if (!isnan(f[0]) && !isnan(f[1]) && f[0] > 0 && f[1] <= 0)
            return zero_between(&ray, t, f);
        t[0] = t[1];
        f[0] = f[1];
    }
    return INFINITY;
}

double sst_surface_meet(const struct sst_surface *surface, const double origin_mm[3], const double direction[3])
{
    const double apart = surface->offset_mm - vector_dot(surface->normal, origin_mm);
    const double along = vector_dot(surface->normal, direction);

    if (surface->kind == SST_SURFACE_TERRAIN)
        return meet_terrain(surface, origin_mm, direction);
    return apart * along > 0 && fabs(apart) < 1e15 * fabs(along) ? apart / along : INFINITY;
}
