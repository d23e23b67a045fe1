/*
 * The renderer: a z-buffer over bands of rows. With r = ((x-cx)/f, (y-cy)/f, 1) the ray of a pixel from the camera at C
 * = B (bx, by, 0), a patch o + s u + t v (normal n = u x v, dual axes u' = v x n / n.n, v' = n x u / n.n) is met at
 *   1/Z = n.r / n.(o-C),  s = (u'.r - u'.(o-C) / Z) Z,
 * so 1/Z, s/Z and t/Z are affine in the picture. An ellipsoid becomes the unit sphere in the coordinates
 * q_i = a_i.(P-o) / a_i.a_i of its half-axes a_i, where Z is a root of a quadratic.
 * Colour is the mean of four samples on a rotated grid; truth is a fifth one at the pixel's centre.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <float.h>

#include "base/mem.h"
#include "simulators/scene/scene_internal.h"

#define NEAREST_MM 1.0 /* corners nearer than this (or behind the camera) give no bounds */

static const double offset_x[SST_SAMPLES] = { 0.125, 0.375, -0.125, -0.375, 0 };
static const double offset_y[SST_SAMPLES] = { -0.375, 0.125, 0.375, -0.125, 0 };

static struct raster_affine along_ray(const struct sst_scene_raster *r, struct sst_vec3 a)
{
    const double x = a.x / r->focal_px, y = a.y / r->focal_px;

    return (struct raster_affine){ x, y, a.z - x * r->cx - y * r->cy };
}

static inline double at(struct raster_affine a, double x, double y)
{
    return a.x * x + a.y * y + a.c;
}

/* --- one surface in one view -------------------------------------------------------------------------------------- */

static void bounds(const struct sst_scene_raster *r, const struct sst_scene_surface *s, struct sst_vec3 e,
                   struct visible_surface *out)
{
    const double x[3] = { s->u.x, s->v.x, s->w.x }, y[3] = { s->u.y, s->v.y, s->w.y };
    const double z[3] = { s->u.z, s->v.z, s->w.z };
    /* The half extent of an ellipsoid's bounding box is the length of each row of its axes. */
    const double hx = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    const double hy = sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
    const double hz = sqrt(z[0] * z[0] + z[1] * z[1] + z[2] * z[2]);
    double lo_x = DBL_MAX, hi_x = -DBL_MAX, lo_y = DBL_MAX, hi_y = -DBL_MAX;

    for (int i = 0; i < (s->ellipsoid ? 8 : 4); i++) {
        const double a = i & 1 ? 1 : -1, b = i & 2 ? 1 : -1, c = i & 4 ? 1 : -1;
        const struct sst_vec3 p =
            vec3_add(e, s->ellipsoid ? vec3(a * hx, b * hy, c * hz) : vec3_add(vec3_mul(s->u, a), vec3_mul(s->v, b)));

        if (p.z < NEAREST_MM) {
            *out = (struct visible_surface){ .x1 = r->width, .y1 = r->height };
            return;
        }
        lo_x = fmin(lo_x, r->cx + r->focal_px * p.x / p.z);
        hi_x = fmax(hi_x, r->cx + r->focal_px * p.x / p.z);
        lo_y = fmin(lo_y, r->cy + r->focal_px * p.y / p.z);
        hi_y = fmax(hi_y, r->cy + r->focal_px * p.y / p.z);
    }
    if (r->warp)
        sst_scene_warp_box(r->warp, &lo_x, &hi_x, &lo_y, &hi_y);
    out->x0 = (int)sst_clamp_double(floor((lo_x - 0.5) / r->step_x), 0, r->width);
    out->x1 = (int)sst_clamp_double(ceil((hi_x + 0.5) / r->step_x) + 1, 0, r->width);
    out->y0 = (int)sst_clamp_double(floor((lo_y - 0.5) / r->step_y), 0, r->height);
    out->y1 = (int)sst_clamp_double(ceil((hi_y + 0.5) / r->step_y) + 1, 0, r->height);
}

static struct sst_vec3 patch_normal(const struct sst_scene_surface *s)
{
    return vec3_cross(s->u, s->v);
}

void surface_see(const struct sst_scene_raster *r, const struct sst_scene_surface *s, struct visible_surface *out)
{
    const struct sst_vec3 eye = vec3(r->bx * r->world->spacing_mm, r->by * r->world->spacing_mm, r->eye_z_mm);
    const struct sst_vec3 e = vec3_sub(s->origin, eye);
    const struct sst_vec3 n = patch_normal(s), axis[3] = { s->u, s->v, s->w };

    *out = (struct visible_surface){ 0 };
    if (s->hide & r->hidden)
        return;
    bounds(r, s, e, out);
    if (s->ellipsoid) {
        for (int i = 0; i < 3; i++) {
            const struct sst_vec3 dual = vec3_mul(axis[i], 1 / vec3_dot(axis[i], axis[i]));

            out->axis[i] = along_ray(r, dual);
            out->eye[i] = -vec3_dot(dual, e);
        }
        return;
    }
    if (vec3_dot(n, e) == 0) { /* exactly edge on */
        *out = (struct visible_surface){ 0 };
        return;
    }
    out->inv_z = along_ray(r, vec3_mul(n, 1 / vec3_dot(n, e)));
    for (int i = 0; i < 2; i++) {
        const struct sst_vec3 dual = vec3_mul(i ? vec3_cross(n, s->u) : vec3_cross(s->v, n), 1 / vec3_dot(n, n));
        const struct raster_affine a = along_ray(r, dual);
        const double k = vec3_dot(dual, e);

        out->axis[i] = (struct raster_affine){ a.x - k * out->inv_z.x, a.y - k * out->inv_z.y, a.c - k * out->inv_z.c };
    }
}

/* 1/Z where the ray of picture position (x, y) meets the surface nearer than 1/nearer_than, and there q; else 0. */
static inline double meet(const struct sst_scene_surface *s, const struct visible_surface *g, double x, double y,
                          double nearer_than, double q[3])
{
    if (s->ellipsoid) {
        double a = 0, b = 0, c = -1, d[3], disc, z;

        for (int i = 0; i < 3; i++) {
            d[i] = at(g->axis[i], x, y);
            a += d[i] * d[i];
            b += d[i] * g->eye[i];
            c += g->eye[i] * g->eye[i];
        }
        disc = b * b - a * c;
        if (disc <= 0)
            return 0;
        z = (-b - sqrt(disc)) / a;
        if (z <= 0 || z * nearer_than >= 1)
            return 0;
        for (int i = 0; i < 3; i++)
            q[i] = g->eye[i] + z * d[i];
        return 1 / z;
    }

    const double inv_z = at(g->inv_z, x, y);

    if (inv_z <= nearer_than)
        return 0;
    q[0] = at(g->axis[0], x, y);
    q[1] = at(g->axis[1], x, y);
    if (fabs(q[0]) > inv_z || fabs(q[1]) > inv_z)
        return 0;
    q[0] /= inv_z;
    q[1] /= inv_z;
    q[2] = 0;
    return !s->mask || s->mask(s, q[0], q[1]) ? inv_z : 0;
}

/* --- colour ------------------------------------------------------------------------------------------------------- */

static struct sst_scene_hit hit_at(const struct sst_scene_surface *s, const double q[3])
{
    struct sst_scene_hit h = { .q = { q[0], q[1], q[2] } };
    const struct sst_vec3 u = s->u, v = s->v, w = s->w;

    h.t = vec3(q[0] * sqrt(vec3_dot(u, u)), q[1] * sqrt(vec3_dot(v, v)), q[2] * sqrt(vec3_dot(w, w)));
    if (s->ellipsoid) {
        h.n = vec3_add(vec3_mul(u, q[0] / vec3_dot(u, u)),
                       vec3_add(vec3_mul(v, q[1] / vec3_dot(v, v)), vec3_mul(w, q[2] / vec3_dot(w, w))));
        h.n = vec3_unit(h.n);
        return h;
    }
    h.n = vec3_unit(vec3_cross(v, u));
    if (h.n.z > 0) /* seen from the other side: leaves have no inside */
        h.n = vec3_mul(h.n, -1);
    if (s->round)
        h.n = vec3_add(vec3_mul(h.n, sqrt(fmax(0, 1 - q[1] * q[1]))), vec3_mul(vec3_unit(v), q[1]));
    return h;
}

static float shade(const struct sst_scene_surface *s, const double q[3], struct sst_scene_rgb *out)
{
    static const struct sst_vec3 light = { -0.42, -0.66, -0.62 }; /* towards it; about unit length */
    const struct sst_scene_hit h = hit_at(s, q);
    const float alpha = s->mat.paint(s, &h, out);
    float gain = 1;

    if (s->grain > 0) {
        const struct sst_vec3 t = vec3_mul(h.t, 1 / s->grain_mm);

        gain += s->grain * (sst_noise(t, s->seed ^ 0x5bd1e995u) + sst_noise(vec3_mul(t, 0.43), s->seed + 77) - 1);
    }
    if (!s->unlit)
        gain *= (float)(0.6 + 0.5 * fmax(0, vec3_dot(h.n, light)));
    *out = (struct sst_scene_rgb){ out->r * gain, out->g * gain, out->b * gain };
    return alpha;
}

/* --- a band ------------------------------------------------------------------------------------------------------- */

int band_init(struct band *b, const struct sst_scene_raster *r, int capacity)
{
    const size_t cells = (size_t)capacity * (size_t)r->width;

    *b = (struct band){
        .r = r,
        .x1 = r->width,
        .capacity = capacity,
        .inv_z = sst_mem_alloc_raw(SST_SAMPLES * cells, sizeof(float)),
        .owner = sst_mem_alloc_raw(SST_SAMPLES * cells, sizeof(uint32_t)),
        .colour = r->image ? sst_mem_alloc_raw(SST_COLOURS * cells, sizeof(struct sst_scene_rgb)) : NULL,
    };
    return b->inv_z && b->owner && (b->colour || !r->image) ? 0 : -ENOMEM;
}

void band_fini(struct band *b)
{
    sst_mem_free(b->colour);
    sst_mem_free(b->owner);
    sst_mem_free(b->inv_z);
}

void band_clear(struct band *b)
{
    const size_t cells = (size_t)SST_SAMPLES * (size_t)b->capacity * (size_t)b->r->width;

    for (size_t i = 0; i < cells; i++) {
        b->inv_z[i] = 0;
        b->owner[i] = SST_NOTHING;
    }
}

/* Position of sample k of output pixel (x, y) in the ideal picture. */
static inline double sample_x(const struct sst_scene_raster *r, int x, int y, int k)
{
    return (r->warp ? warp_x(r->warp, x, y) : x * r->step_x) + offset_x[k];
}

static inline double sample_y(const struct sst_scene_raster *r, int x, int y, int k)
{
    return (r->warp ? warp_y(r->warp, x, y) : y * r->step_y) + offset_y[k];
}

static int first_sample(const struct band *b)
{
    return b->colour ? 0 : SST_CENTRE;
}

/* The centre sample is only needed for the truth. */
static int last_sample(const struct band *b)
{
    return b->r->disp || b->r->label || b->r->owner ? SST_SAMPLES : SST_COLOURS;
}

void band_opaque(struct band *b, uint32_t index)
{
    const struct sst_scene_raster *r = b->r;
    const struct sst_scene_surface *s = &r->world->surfaces[index];
    const struct visible_surface *g = &b->seen[index];
    const int y0 = sst_max_int(g->y0, b->y0), y1 = sst_min_int(g->y1, b->y0 + b->rows);
    const int x0 = sst_max_int(g->x0, b->x0), x1 = sst_min_int(g->x1, b->x1);

    for (int k = first_sample(b); k < last_sample(b); k++) {
        for (int y = y0; y < y1; y++) {
            float *inv_z = b->inv_z + band_cell(b, k, y, 0);
            uint32_t *owner = b->owner + band_cell(b, k, y, 0);

            for (int x = x0; x < x1; x++) {
                double q[3];
                const double iz = meet(s, g, sample_x(r, x, y, k), sample_y(r, x, y, k), inv_z[x], q);

                if (iz > 0) {
                    inv_z[x] = (float)iz;
                    owner[x] = index;
                }
            }
        }
    }
}

void band_colour(struct band *b, const bool *only)
{
    const struct sst_scene_raster *r = b->r;

    for (int k = 0; k < SST_COLOURS; k++) {
        for (int y = b->y0; y < b->y0 + b->rows; y++) {
            for (int x = b->x0; x < b->x1; x++) {
                const size_t i = band_cell(b, k, y, x);
                const uint32_t owner = b->owner[i];
                double q[3];

                if (only && (owner == SST_NOTHING || !only[owner]))
                    continue;
                b->colour[i] = (struct sst_scene_rgb){ 0.6f, 0.65f, 0.7f };
                if (owner == SST_NOTHING)
                    continue;
                meet(&r->world->surfaces[owner], &b->seen[owner], sample_x(r, x, y, k), sample_y(r, x, y, k), 0, q);
                shade(&r->world->surfaces[owner], q, &b->colour[i]);
            }
        }
    }
}

void band_translucent(struct band *b, uint32_t index)
{
    const struct sst_scene_raster *r = b->r;
    const struct sst_scene_surface *s = &r->world->surfaces[index];
    const struct visible_surface *g = &b->seen[index];
    const int y0 = sst_max_int(g->y0, b->y0), y1 = sst_min_int(g->y1, b->y0 + b->rows);
    const int x0 = sst_max_int(g->x0, b->x0), x1 = sst_min_int(g->x1, b->x1);

    for (int k = first_sample(b); k < last_sample(b); k++) {
        for (int y = y0; y < y1; y++) {
            for (int x = x0; x < x1; x++) {
                const size_t i = band_cell(b, k, y, x);
                struct sst_scene_rgb c;
                double q[3];
                const double iz = meet(s, g, sample_x(r, x, y, k), sample_y(r, x, y, k), b->inv_z[i], q);
                const float alpha = iz > 0 ? shade(s, q, &c) : 0;

                if (k < SST_COLOURS && alpha > 0)
                    b->colour[i] = blend_rgb(b->colour[i], c, alpha);
                if (k == SST_CENTRE && alpha > 0.5f) {
                    b->inv_z[i] = (float)iz;
                    b->owner[i] = index;
                }
            }
        }
    }
}

static uint8_t to_byte(float sum)
{
    const float v = sum * (255.0f / SST_COLOURS) + 0.5f;

    return (uint8_t)(v <= 0 ? 0 : v >= 255 ? 255 : v);
}

static void store_truth(const struct band *b, int x, int y)
{
    const struct sst_scene_raster *r = b->r;
    const size_t i = band_cell(b, SST_CENTRE, y, x);
    const struct sst_scene_surface *s = b->owner[i] == SST_NOTHING ? NULL : &r->world->surfaces[b->owner[i]];

    if (r->disp)
        sst_map_f32_row(r->disp, y)[x] = (float)(r->focal_px * r->world->spacing_mm * b->inv_z[i]);
    if (r->label)
        sst_map_u8_row(r->label, y)[x] = s ? s->label : 0;
    if (r->owner)
        sst_map_u8_row(r->owner, y)[x] = s ? (uint8_t)s->hide : 0;
}

void band_store(const struct band *b)
{
    const struct sst_scene_raster *r = b->r;

    for (int y = b->y0; y < b->y0 + b->rows; y++) {
        for (int x = b->x0; x < b->x1; x++) {
            if (last_sample(b) > SST_CENTRE)
                store_truth(b, x, y);
            if (r->image) {
                struct sst_scene_rgb c = { 0, 0, 0 };

                for (int k = 0; k < SST_COLOURS; k++) {
                    const struct sst_scene_rgb *p = &b->colour[band_cell(b, k, y, x)];

                    c = (struct sst_scene_rgb){ c.r + p->r, c.g + p->g, c.b + p->b };
                }
                sst_image_row(r->image, 0, y)[x] = to_byte(c.r);
                sst_image_row(r->image, 1, y)[x] = to_byte(c.g);
                sst_image_row(r->image, 2, y)[x] = to_byte(c.b);
            }
        }
    }
}

static void run_band(struct band *b)
{
    const struct sst_scene_world *w = b->r->world;

    band_clear(b);
    for (int i = 0; i < w->count; i++) {
        if (!w->surfaces[i].translucent)
            band_opaque(b, (uint32_t)i);
    }
    if (b->colour)
        band_colour(b, NULL);
    for (int i = 0; i < w->count; i++) {
        if (w->surfaces[i].translucent)
            band_translucent(b, (uint32_t)i);
    }
    band_store(b);
}

int sst_scene_raster_run(const struct sst_scene_raster *r)
{
    struct visible_surface *seen = sst_mem_alloc((size_t)r->world->count + 1, sizeof(*seen));
    struct band b;
    int err = band_init(&b, r, SST_BAND_ROWS);

    if (!seen)
        err = -ENOMEM;
    if (err)
        goto done;
    b.seen = seen;
    for (int i = 0; i < r->world->count; i++)
        surface_see(r, &r->world->surfaces[i], &seen[i]);
    for (b.y0 = 0; b.y0 < r->height; b.y0 += SST_BAND_ROWS) {
        b.top = b.y0;
        b.rows = sst_min_int(SST_BAND_ROWS, r->height - b.y0);
        run_band(&b);
    }

done:
    band_fini(&b);
    sst_mem_free(seen);
    return err;
}
