/* People, built from ellipsoids on a skeleton. Lengths are mm of a person 1750 mm tall. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/scene_internal.h"

struct body {
    struct sst_scene_world *w;
    const struct figure *f;
    struct sst_vec3 right, forward; /* of the person, in the world */
};

/* A point at `right` of the person's centre, `up` from the ground and `forward`. */
static struct sst_vec3 point(const struct body *b, double right, double up, double forward)
{
    struct sst_vec3 p = vec3_add(vec3_mul(b->right, right), vec3_mul(b->forward, forward));

    p.y -= up;
    return vec3_add(b->f->base, vec3_mul(p, b->f->scale));
}

static void limb(const struct body *b, struct sst_vec3 p, struct sst_vec3 q, double radius,
                 struct sst_scene_material mat)
{
    add_limb(b->w, p, q, radius * b->f->scale, mat);
}

/* @param half  width, height and depth, halved */
static void bulk(const struct body *b, struct sst_vec3 c, struct sst_vec3 half, struct sst_scene_material mat)
{
    const double k = b->f->scale;

    add_ellipsoid(
        b->w, c,
        (struct axes){ vec3_mul(b->right, half.x * k), vec3(0, half.y * k, 0), vec3_mul(b->forward, half.z * k) }, mat);
}

static void add_head(const struct body *b, double up, double forward)
{
    limb(b, point(b, 0, up - 190, forward - 15), point(b, 0, up - 80, forward), 56, b->f->skin);
    bulk(b, point(b, 0, up, forward), vec3(80, 118, 96), b->f->face);
    bulk(b, point(b, 0, up - 14, forward + 97), vec3(13, 25, 17), b->f->skin);
    bulk(b, point(b, 82, up - 8, forward - 8), vec3(12, 30, 18), b->f->skin);
    bulk(b, point(b, -82, up - 8, forward - 8), vec3(12, 30, 18), b->f->skin);
}

/* side: 1 right, -1 left. */
static void add_arm(const struct body *b, double side, double shoulder_up, double swing)
{
    const bool seated = b->f->seated;
    const double e_fwd = seated ? 40 : 270 * sin(swing), e_up = shoulder_up - (seated ? 275 : 270 * cos(swing));
    const double h_fwd = seated ? 260 : e_fwd + 240 * sin(swing + 0.35);
    const double h_up = seated ? e_up - 10 : e_up - 240 * cos(swing + 0.35);
    const double out = seated ? 250 : 205;
    const struct sst_vec3 shoulder = point(b, side * 168, shoulder_up, 0), elbow = point(b, side * out, e_up, e_fwd);
    const struct sst_vec3 wrist = point(b, side * (seated ? 150 : 200), h_up, h_fwd);

    limb(b, point(b, side * 30, shoulder_up + 75, -10), shoulder, 60, b->f->shirt);
    bulk(b, shoulder, vec3(72, 74, 66), b->f->shirt);
    limb(b, shoulder, elbow, 58, b->f->shirt);
    limb(b, elbow, wrist, 45, b->f->shirt);
    limb(b, wrist, vec3_add(wrist, vec3_mul(vec3_sub(wrist, elbow), 0.3)), 34, b->f->skin);
}

static void add_leg(const struct body *b, double side, double swing)
{
    const bool seated = b->f->seated;
    const double bend = swing < 0 ? 0.3 : 0.1; /* the trailing knee bends */
    const double k_fwd = seated ? 420 : 430 * sin(swing), k_up = seated ? 500 : 930 - 430 * cos(swing);
    const double a_fwd = seated ? 440 : k_fwd + 420 * sin(swing - bend);
    const double a_up = seated ? 90 : k_up - 420 * cos(swing - bend);
    const double spread = seated ? 130 : 85;
    const struct sst_vec3 hip = point(b, side * 90, seated ? 520 : 930, 0), knee = point(b, side * spread, k_up, k_fwd);
    const struct sst_vec3 ankle = point(b, side * spread, a_up, a_fwd);

    limb(b, hip, knee, 86, b->f->trousers);
    limb(b, hip, vec3_add(hip, vec3_mul(vec3_sub(knee, hip), 0.45)), 104, b->f->trousers);
    limb(b, vec3_add(hip, vec3_mul(vec3_sub(knee, hip), 0.75)), vec3_add(knee, vec3_mul(vec3_sub(ankle, knee), 0.55)),
         74, b->f->trousers);
    limb(b, knee, ankle, 62, b->f->trousers);
    bulk(b, point(b, side * spread, a_up - 45, a_fwd + 60), vec3(50, 46, 135), b->f->shoes);
}

void add_figure(struct sst_scene_world *w, const struct figure *f)
{
    const struct body b = {
        .w = w,
        .f = f,
        .right = vec3(-cos(f->yaw), 0, -sin(f->yaw)),
        .forward = vec3(sin(f->yaw), 0, -cos(f->yaw)),
    };
    const double hips = f->seated ? 540 : 950, shoulders = hips + 465;

    bulk(&b, point(&b, 0, hips, 0), vec3(165, 115, 125), f->trousers);
    bulk(&b, point(&b, 0, hips + 200, 5), vec3(165, 230, 122), f->shirt);
    bulk(&b, point(&b, 0, hips + 350, 0), vec3(188, 200, 128), f->shirt);
    add_head(&b, hips + 690, 15);
    for (int side = -1; side <= 1; side += 2) {
        const double swing = side * f->stride;

        add_leg(&b, side, swing);
        add_arm(&b, side, shoulders, -0.8 * swing);
    }
}
