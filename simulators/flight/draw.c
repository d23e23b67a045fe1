/* Pictures of a flight: a depth buffer of triangles at FINE samples a pixel along each side, then light and colour of
 * each sample. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/flight/flight_internal.h"

#define FINE        2
#define NEAREST     0.5 /* m: nothing before it is drawn */
#define NO_TRIANGLE UINT32_MAX
#define NETD_K      0.05 /* noise of a thermal picture */
#define COLOUR_SD   1.5  /* noise of a colour picture, levels */

struct canvas {
    const struct flight_picture *p;
    int width, height;  /* samples */
    float *nearness;    /* 1 / depth; 0: nothing */
    uint32_t *triangle; /* of the world's mesh, then the walkers' */
};

/* In camera axes, m. */
static struct sst_vec3 in_camera(const struct sst_calib_camera *cam, struct sst_vec3 v)
{
    const double *r = cam->rotation;
    const double x = v.x - cam->position_mm[0] / 1000, y = v.y - cam->position_mm[1] / 1000;
    const double z = v.z - cam->position_mm[2] / 1000;

    return (struct sst_vec3){ r[0] * x + r[1] * y + r[2] * z, r[3] * x + r[4] * y + r[5] * z,
                              r[6] * x + r[7] * y + r[8] * z };
}

/* Sample columns and rows, and nearness, of a corner. */
static bool project(double out[3], const struct canvas *c, struct sst_vec3 v)
{
    const struct sst_calib_camera *cam = c->p->camera;
    const struct sst_vec3 q = in_camera(cam, v);

    if (q.z < NEAREST)
        return false;
    out[0] = FINE * (cam->fx * q.x / q.z + cam->cx) + (FINE - 1) / 2.0;
    out[1] = FINE * (cam->fy * q.y / q.z + cam->cy) + (FINE - 1) / 2.0;
    out[2] = 1 / q.z;
    return true;
}

static void fill(struct canvas *c, double v[3][3], uint32_t index)
{
    const double area = (v[1][0] - v[0][0]) * (v[2][1] - v[0][1]) - (v[1][1] - v[0][1]) * (v[2][0] - v[0][0]);
    double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };
    int from[2], to[2];

    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], v[i][k]);
            high[k] = fmax(high[k], v[i][k]);
        }
    }
    if (area == 0 || high[0] < 0 || high[1] < 0 || low[0] > c->width - 1 || low[1] > c->height - 1)
        return;
    from[0] = (int)ceil(fmax(low[0], 0));
    from[1] = (int)ceil(fmax(low[1], 0));
    to[0] = (int)floor(fmin(high[0], c->width - 1));
    to[1] = (int)floor(fmin(high[1], c->height - 1));
    for (int y = from[1]; y <= to[1]; y++) {
        for (int x = from[0]; x <= to[0]; x++) {
            const double b = ((x - v[0][0]) * (v[2][1] - v[0][1]) - (y - v[0][1]) * (v[2][0] - v[0][0])) / area;
            const double d = ((v[1][0] - v[0][0]) * (y - v[0][1]) - (v[1][1] - v[0][1]) * (x - v[0][0])) / area;
            const float near = (float)(v[0][2] + b * (v[1][2] - v[0][2]) + d * (v[2][2] - v[0][2]));
            const size_t at = (size_t)y * (size_t)c->width + (size_t)x;

            if (b >= 0 && d >= 0 && b + d <= 1 && near > c->nearness[at]) {
                c->nearness[at] = near;
                c->triangle[at] = index;
            }
        }
    }
}

static void fill_mesh(struct canvas *c, const struct flight_mesh *m, uint32_t first)
{
    for (size_t i = 0; i < m->triangles; i++) {
        const struct flight_triangle *t = &m->triangle[i];
        double v[3][3];
        bool ahead = !(t->tree && c->p->hide_trees);

        for (int k = 0; k < 3 && ahead; k++)
            ahead = project(v[k], c, m->vertex[t->corner[k]]);
        if (ahead)
            fill(c, v, first + (uint32_t)i);
    }
}

/* World point that a sample sees. */
static struct sst_vec3 seen_at(const struct canvas *c, int x, int y, float nearness)
{
    const struct sst_calib_camera *cam = c->p->camera;
    const double z = 1 / nearness, px = (x - (FINE - 1) / 2.0) / FINE, py = (y - (FINE - 1) / 2.0) / FINE;
    const double q[3] = { z * (px - cam->cx) / cam->fx, z * (py - cam->cy) / cam->fy, z };
    const double *r = cam->rotation;

    return (struct sst_vec3){ r[0] * q[0] + r[3] * q[1] + r[6] * q[2] + cam->position_mm[0] / 1000,
                              r[1] * q[0] + r[4] * q[1] + r[7] * q[2] + cam->position_mm[1] / 1000,
                              r[2] * q[0] + r[5] * q[1] + r[8] * q[2] + cam->position_mm[2] / 1000 };
}

/* Colour of the forest's floor: soil, litter and moss, each at its own scale. */
static void ground_colour(double rgb[3], const struct flight_world *w, struct sst_vec3 at)
{
    const uint32_t seed = (uint32_t)w->seed + 17;
    const struct sst_vec3 broad = { at.x / 2.5, at.y / 2.5, 0 }, fine = { at.x / 0.12, at.y / 0.12, 0 };
    const double moss = sst_noise_fbm(broad, 3, seed), litter = sst_noise_fbm(fine, 3, seed + 1);
    static const double soil[3] = { 112, 96, 74 }, green[3] = { 92, 104, 66 };

    for (int i = 0; i < 3; i++)
        rgb[i] = (soil[i] + (green[i] - soil[i]) * moss) * (0.6 + 0.8 * litter);
}

static double ground_kelvin(const struct flight_world *w, struct sst_vec3 at)
{
    const struct sst_vec3 broad = { at.x / 3, at.y / 3, 0 }, fine = { at.x / 0.3, at.y / 0.3, 0 };

    return 283.5 + 1.6 * sst_noise_fbm(broad, 2, (uint32_t)w->seed + 5) +
           0.7 * sst_noise_fbm(fine, 2, (uint32_t)w->seed + 6);
}

static double kelvin(const struct canvas *c, const struct flight_triangle *t, struct sst_vec3 at)
{
    switch ((enum flight_matter)t->matter) {
    case BARK:
        return 284.0;
    case LEAF:
        return 282.2 + 1.4 * t->shade / 255 + (t->rgb[1] - 100) * 0.008;
    case CLOTH:
        return 294.5 + 2.0 * t->shade / 255;
    case SKIN:
        return 304.0;
    default:
        return ground_kelvin(c->p->world, at);
    }
}

/* Value of a sample: red, green and blue, or kelvin. */
static void sample(double out[3], const struct canvas *c, int x, int y)
{
    const struct flight_world *w = c->p->world;
    const size_t at = (size_t)y * (size_t)c->width + (size_t)x;
    const uint32_t index = c->triangle[at];
    const struct flight_triangle *t;
    struct sst_vec3 point;

    out[0] = out[1] = out[2] = w->thermal ? 275 : 150; /* beyond the ground: sky and haze */
    if (index == NO_TRIANGLE)
        return;
    t = index < w->mesh.triangles ? &w->mesh.triangle[index] : &c->p->walkers->triangle[index - w->mesh.triangles];
    point = seen_at(c, x, y, c->nearness[at]);
    if (w->thermal) {
        out[0] = kelvin(c, t, point);
    } else if (t->matter == GROUND) {
        ground_colour(out, w, point);
    } else {
        for (int i = 0; i < 3; i++)
            out[i] = t->rgb[i] * t->shade / 255.0;
    }
}

/* Sum of four uniform numbers: near enough to a normal one, of standard deviation 1. */
static double noise_at(uint32_t seed, int x, int y, int channel)
{
    const uint32_t h = sst_noise_hash(x, y, channel, seed);

    return ((double)(h & 255) + (h >> 8 & 255) + (h >> 16 & 255) + (h >> 24) - 510) / 147.8;
}

static void shade_pixel(const struct canvas *c, struct sst_deep *out, int x, int y)
{
    const struct flight_world *w = c->p->world;
    double sum[3] = { 0 }, one[3];

    for (int k = 0; k < FINE * FINE; k++) {
        sample(one, c, FINE * x + k % FINE, FINE * y + k / FINE);
        for (int i = 0; i < 3; i++)
            sum[i] += one[i] / (FINE * FINE);
    }
    for (int i = 0; i < out->channels; i++) {
        const double noise = c->p->noise_seed ? noise_at(c->p->noise_seed, x, y, i) : 0;
        const double level = w->thermal ? (sum[0] + NETD_K * noise) / FLIGHT_KELVIN_SCALE : sum[i] + COLOUR_SD * noise;

        sst_map_u16_row(&out->plane[i], y)[x] = (uint16_t)sst_clamp_int((int)floor(level + 0.5), 0, out->white);
    }
}

static void put_depth(const struct canvas *c, struct sst_map_f32 *depth)
{
    for (int y = 0; y < depth->height; y++) {
        for (int x = 0; x < depth->width; x++) {
            const float near = c->nearness[(size_t)(FINE * y) * (size_t)c->width + (size_t)(FINE * x)];

            sst_map_f32_row(depth, y)[x] = near > 0 ? 1 / near : NAN;
        }
    }
}

static int canvas_init(struct canvas *c, const struct flight_picture *p, int width, int height)
{
    const size_t samples = (size_t)width * FINE * (size_t)height * FINE;

    *c = (struct canvas){ p, width * FINE, height * FINE, calloc(samples, sizeof(*c->nearness)),
                          malloc(samples * sizeof(*c->triangle)) };
    if (!c->nearness || !c->triangle)
        return -ENOMEM;
    memset(c->triangle, 0xFF, samples * sizeof(*c->triangle));
    fill_mesh(c, &p->world->mesh, 0);
    fill_mesh(c, p->walkers, (uint32_t)p->world->mesh.triangles);
    return 0;
}

static void canvas_fini(struct canvas *c)
{
    free(c->nearness);
    free(c->triangle);
}

int flight_draw(const struct flight_picture *p, struct sst_deep *out, struct sst_map_f32 *depth)
{
    struct canvas c;
    const int err = canvas_init(&c, p, out->width, out->height);

    for (int y = 0; !err && y < out->height; y++) {
        for (int x = 0; x < out->width; x++)
            shade_pixel(&c, out, x, y);
    }
    if (!err && depth)
        put_depth(&c, depth);
    canvas_fini(&c);
    return err;
}

int flight_show(const struct flight_picture *p, int width, int height, int64_t shown[FLIGHT_WALKERS])
{
    const size_t first = p->world->mesh.triangles,
                 each = p->walkers->triangles / (size_t)sst_max_int(p->world->walkers, 1);
    struct canvas c;
    const int err = canvas_init(&c, p, width, height);

    for (size_t i = 0; !err && i < (size_t)c.width * (size_t)c.height; i++) {
        if (c.triangle[i] != NO_TRIANGLE && c.triangle[i] >= first)
            shown[(c.triangle[i] - first) / each]++;
    }
    canvas_fini(&c);
    return err;
}
