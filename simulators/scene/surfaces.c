/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/scene_internal.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/mem.h"

#define GRAIN    0.16f
#define GRAIN_PX 2.6 /* design pixels between values of the fine texture */
#define TINT     0.05
#define TURN     6.283185307179586
#define SWAY_S   2.0 /* period of the leaves' motion */

struct sst_vec3 world_at(const struct sst_scene_world *w, double x, double y, double disp_px)
{
    const double z = w->focal * w->spacing_mm / disp_px;

    return vec3(x * z / w->focal, y * z / w->focal, z);
}

double world_mm(const struct sst_scene_world *w, double disp_px)
{
    return w->spacing_mm / disp_px;
}

unsigned world_occluder(struct sst_scene_world *w, const char *name, int label, int target_label)
{
    struct sst_scene_occluder *o = &w->occluders[w->occluder_count];

    snprintf(o->name, sizeof(o->name), "%s", name);
    o->label = label;
    o->target_label = target_label;
    return 1u << w->occluder_count++;
}

void sst_scene_begin(struct sst_scene_world *w, int label, unsigned hide)
{
    w->label = label;
    w->hide = hide;
    w->tint.r = w->tint.g = w->tint.b = (float)sst_random_in(&w->rng, 0.9, 1.04);
    w->tint.r *= (float)sst_random_in(&w->rng, 1 - TINT, 1 + TINT);
    w->tint.b *= (float)sst_random_in(&w->rng, 1 - TINT, 1 + TINT);
}

static struct sst_scene_rgb tinted(const struct sst_scene_world *w, struct sst_scene_rgb c)
{
    return (struct sst_scene_rgb){ c.r * w->tint.r, c.g * w->tint.g, c.b * w->tint.b };
}

static struct sst_scene_surface *add(struct sst_scene_world *w)
{
    if (!sst_mem_grow(&w->surfaces, w->count, &w->capacity, sizeof(*w->surfaces))) {
        w->failed = true;
        return &w->scrap;
    }
    return &w->surfaces[w->count++];
}

struct sst_scene_surface *sst_scene_add_patch(struct sst_scene_world *w, struct sst_vec3 centre, struct sst_vec3 u,
                                              struct sst_vec3 v, struct sst_scene_material mat)
{
    struct sst_scene_surface *s = add(w);

    *s = (struct sst_scene_surface){
        .label = (uint8_t)w->label,
        .hide = w->hide,
        .seed = (uint32_t)sst_random_u64(&w->rng),
        .grain = GRAIN,
        .grain_mm = GRAIN_PX * fmax(centre.z, 1) / w->focal,
        .mat = mat,
        .origin = centre,
        .u = u,
        .v = v,
    };
    s->mat.a = tinted(w, mat.a);
    s->mat.b = tinted(w, mat.b);
    return s;
}

struct sst_scene_surface *add_ellipsoid(struct sst_scene_world *w, struct sst_vec3 centre, struct axes axes,
                                        struct sst_scene_material mat)
{
    struct sst_scene_surface *s = sst_scene_add_patch(w, centre, axes.u, axes.v, mat);

    s->w = axes.w;
    s->ellipsoid = true;
    return s;
}

struct sst_scene_surface *add_ball(struct sst_scene_world *w, struct sst_vec3 centre, struct sst_vec3 r,
                                   struct sst_scene_material mat)
{
    return add_ellipsoid(w, centre, (struct axes){ vec3(r.x, 0, 0), vec3(0, r.y, 0), vec3(0, 0, r.z) }, mat);
}

/* Two unit vectors perpendicular to a unit vector; the first lies in the picture plane if possible. */
static void across(struct sst_vec3 a, struct sst_vec3 *b, struct sst_vec3 *c)
{
    *b = vec3_cross(vec3(0, 0, 1), a);
    if (vec3_dot(*b, *b) < 1e-6)
        *b = vec3(1, 0, 0);
    *b = vec3_unit(*b);
    *c = vec3_cross(a, *b);
}

struct sst_scene_surface *add_limb(struct sst_scene_world *w, struct sst_vec3 p, struct sst_vec3 q, double radius,
                                   struct sst_scene_material mat)
{
    const struct sst_vec3 half = vec3_mul(vec3_sub(q, p), 0.5), along = vec3_unit(half);
    const double length = sqrt(vec3_dot(half, half)) + 0.55 * radius;
    struct sst_vec3 b, c;

    across(along, &b, &c);
    return add_ellipsoid(w, vec3_add(p, half),
                         (struct axes){ vec3_mul(b, radius), vec3_mul(along, length), vec3_mul(c, radius) }, mat);
}

struct sst_scene_surface *add_bar(struct sst_scene_world *w, struct sst_vec3 p, struct sst_vec3 q, double half_width,
                                  struct sst_scene_material mat)
{
    const struct sst_vec3 half = vec3_mul(vec3_sub(q, p), 0.5), along = vec3_unit(half);
    struct sst_scene_surface *s;
    struct sst_vec3 b, c;

    across(along, &b, &c);
    s = sst_scene_add_patch(w, vec3_add(p, half), half, vec3_mul(b, half_width), mat);
    s->round = true;
    return s;
}

void add_box(struct sst_scene_world *w, struct sst_vec3 centre, struct axes axes, struct sst_scene_material mat)
{
    const struct sst_vec3 u = axes.u, v = axes.v, axis_w = axes.w;

    /* The normal of a patch is v x u: the second axis of each face is turned so that it points out of the box. */
    sst_scene_add_patch(w, vec3_sub(centre, axis_w), u, v, mat);
    sst_scene_add_patch(w, vec3_add(centre, axis_w), u, vec3_mul(v, -1), mat);
    sst_scene_add_patch(w, vec3_sub(centre, v), u, vec3_mul(axis_w, -1), mat);
    sst_scene_add_patch(w, vec3_add(centre, v), u, axis_w, mat);
    sst_scene_add_patch(w, vec3_sub(centre, u), axis_w, vec3_mul(v, -1), mat);
    sst_scene_add_patch(w, vec3_add(centre, u), axis_w, v, mat);
}

struct sst_scene_surface *add_board(struct sst_scene_world *w, struct sst_vec3 at, double half_x, double half_y,
                                    struct sst_scene_material mat)
{
    const double mm = world_mm(w, at.z);

    return sst_scene_add_patch(w, world_at(w, at.x, at.y, at.z), vec3(half_x * mm, 0, 0), vec3(0, half_y * mm, 0), mat);
}

struct sst_scene_surface *sst_scene_add_floor(struct sst_scene_world *w, double y, double z0, double z1,
                                              struct sst_scene_material mat)
{
    return sst_scene_add_patch(w, vec3(0, y, (z0 + z1) / 2), vec3(3 * z1, 0, 0), vec3(0, 0, (z0 - z1) / 2), mat);
}

void add_shadow(struct sst_scene_world *w, struct sst_vec3 at, double rx, double rz)
{
    struct sst_scene_surface *s = sst_scene_add_patch(w, vec3(at.x, at.y - 1e-4 * at.z, at.z), vec3(rx, 0, 0),
                                                      vec3(0, 0, -rz), material(paint_shadow, 0x101010, 0, 1));

    s->translucent = true;
    s->hide = 0;
}

/* --- foliage ------------------------------------------------------------------------------------------------------ */

static const unsigned leaf_colours[][2] = {
    { 0x3f7a2a, 0x7fae3c }, { 0x2f6424, 0x5f9a38 }, { 0x54862a, 0x9dbb45 },
    { 0x2a5a30, 0x4f8a48 }, { 0x6b8f2e, 0xb4c455 },
};

/* light: 0 deep in the bush .. 1 at its surface. */
static void add_leaf(struct sst_scene_world *w, struct sst_vec3 centre, double half_mm, float light)
{
    const double turn = TURN * sst_random(&w->rng), tilt = sst_random_in(&w->rng, -0.9, 0.9);
    const double roll = sst_random_in(&w->rng, -0.8, 0.8), phase = TURN * sst_random(&w->rng);
    const double sway = 0.3 * sin(TURN / SWAY_S * w->time_s + phase) - 0.3 * sin(phase);
    const double length = half_mm * sst_random_in(&w->rng, 1.7, 2.3);
    const size_t pick = (size_t)(sst_random(&w->rng) * ARRAY_LEN(leaf_colours));
    const double a = turn + 0.4 * sway;
    const struct sst_vec3 u = vec3(cos(a) * cos(tilt), sin(a) * cos(tilt), sin(tilt));
    struct sst_vec3 v = vec3_unit(vec3_cross(u, vec3(sin(roll) * sin(a), -sin(roll) * cos(a), cos(roll))));
    const struct sst_scene_rgb black = { 0.02f, 0.05f, 0.02f };
    struct sst_scene_material mat = material(paint_leaf, leaf_colours[pick][0], leaf_colours[pick][1], half_mm);
    struct sst_scene_surface *s;

    centre.x += sway * half_mm;
    mat.a = blend_rgb(black, mat.a, 0.5f + 0.5f * light);
    mat.b = blend_rgb(black, mat.b, 0.5f + 0.5f * light);
    s = sst_scene_add_patch(w, centre, vec3_mul(u, length), vec3_mul(v, half_mm), mat);
    s->mask = mask_leaf;
}

void add_foliage(struct sst_scene_world *w, int count, struct room room, double half_mm)
{
    const double *x = room.x, *y = room.y, *d = room.disp_px;

    for (int i = 0; i < count; i++) {
        const double px = sst_random_in(&w->rng, x[0], x[1]), py = sst_random_in(&w->rng, y[0], y[1]);
        const double disp = sst_random_in(&w->rng, d[0], d[1]), size = sst_random_in(&w->rng, 0.7, 1.15);

        add_leaf(w, world_at(w, px, py, disp), half_mm * size, (float)((disp - d[0]) / (d[1] - d[0])));
    }
}

void add_branch(struct sst_scene_world *w, struct sst_vec3 a, struct sst_vec3 b, double half_mm)
{
    const struct sst_scene_material bark = material(sst_scene_paint_wood, 0x4a3826, 0x7a6248, half_mm * 1.5);
    const int parts = 6;
    struct sst_vec3 p = a;

    for (int i = 1; i <= parts; i++) {
        const double t = (double)i / parts, bend = half_mm * (i < parts ? 5 : 0);
        const struct sst_vec3 twig = sst_random_vec(&w->rng, 1);
        struct sst_vec3 q = vec3_add(vec3_add(a, vec3_mul(vec3_sub(b, a), t)), sst_random_vec(&w->rng, bend));

        add_bar(w, p, q, half_mm * (1.1 - 0.7 * t), bark);
        add_bar(w, p, vec3_add(p, vec3_mul(vec3_unit(twig), half_mm * 16)), half_mm * 0.35, bark);
        p = q;
    }
}
