/* Procedural textures of general use; paint_objects.c has the ones of single objects. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/scene_internal.h"

static struct sst_vec3 scaled(const struct sst_scene_hit *h, double x_mm, double y_mm)
{
    return vec3(h->t.x / x_mm, h->t.y / y_mm, h->t.z / x_mm);
}

/* Distance to the nearest joint of a lattice with the given pitch, 0 .. pitch / 2. */
static double to_joint(double x, double pitch)
{
    const double f = x / pitch - floor(x / pitch);

    return pitch * fmin(f, 1 - f);
}

float sst_scene_paint_fbm(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double x = s->mat.scale_mm, y = s->mat.k > 0 ? x * s->mat.k : x;

    *out = blend_rgb(s->mat.a, s->mat.b, sst_noise_fbm(scaled(h, x, y), 5, s->seed));
    return 1;
}

float paint_cloth(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm, x = h->t.x / p - floor(h->t.x / p), y = h->t.y / p - floor(h->t.y / p);
    const float folds = sst_noise_fbm(scaled(h, 3 * p, 1.5 * p), 3, s->seed);
    float t = 0;

    switch ((int)s->mat.k) {
    case 0:
        t = (x < 0.35 ? 0.45f : 0) + (y < 0.35 ? 0.45f : 0) + (fabs(x - 0.7) < 0.06 || fabs(y - 0.7) < 0.06 ? 0.5f : 0);
        break;
    case 1:
        t = y < 0.5 ? 1 : 0;
        break;
    case 2:
        t = sst_noise(scaled(h, 0.1 * p, 0.5 * p), s->seed + 9);
        break;
    default:
        t = (float)fabs(2 * x - 1);
    }
    *out = dimmed(blend_rgb(s->mat.a, s->mat.b, t), 0.72f + 0.5f * folds);
    return 1;
}

float paint_brick(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double length = s->mat.scale_mm, height = length * 0.36, joint = length * 0.035;
    const double row = floor(h->t.y / height);
    const double x = h->t.x + (fmod(fabs(row), 2) > 0.5 ? length / 2 : 0);
    const uint32_t one = sst_noise_hash((int32_t)floor(x / length), (int32_t)row, 0, s->seed);
    const float rough = sst_noise_fbm(scaled(h, length * 0.3, length * 0.3), 4, s->seed);

    if (to_joint(x, length) < joint || to_joint(h->t.y, height) < joint) {
        *out = dimmed(s->mat.b, 0.7f + 0.5f * rough);
        return 1;
    }
    *out = dimmed(blend_rgb(s->mat.a, s->mat.b, 0.25f * (float)(one & 255) / 255), 0.6f + 0.65f * rough);
    out->r *= 0.9f + 0.25f * (float)(one >> 8 & 255) / 255;
    return 1;
}

float sst_scene_paint_wood(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm, board = floor(h->t.y / p);
    const uint32_t seed = s->seed + 31 * (uint32_t)(int32_t)board;
    const float grain = sst_noise_fbm(scaled(h, 2.2 * p, 0.13 * p), 4, seed);
    const float tone = (float)(sst_noise_hash((int32_t)board, 0, 0, s->seed) & 255) / 255;
    const float gap = to_joint(h->t.y, p) < 0.018 * p ? 0.55f : 1;

    *out = dimmed(blend_rgb(s->mat.a, s->mat.b, grain), (0.85f + 0.25f * tone) * gap);
    return 1;
}

float paint_slabs(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm;
    const uint32_t one = sst_noise_hash((int32_t)floor(h->t.x / p), (int32_t)floor(h->t.y / p), 1, s->seed);
    const float tone = (float)(one & 255) / 255, rough = sst_noise_fbm(scaled(h, 0.2 * p, 0.2 * p), 5, s->seed);
    const bool joint = to_joint(h->t.x, p) < 0.02 * p || to_joint(h->t.y, p) < 0.02 * p;

    *out = dimmed(blend_rgb(s->mat.a, s->mat.b, 0.25f * tone + 0.75f * rough), joint ? 0.55f : 1);
    return 1;
}

float paint_leaf(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double x = h->q.x, y = fabs(h->q.y);
    const double vein = to_joint(x * 2 - 1.2 * y, 0.45);
    float t = 0.15f + 0.5f * sst_noise_fbm(scaled(h, 0.4 * s->mat.scale_mm, 0.4 * s->mat.scale_mm), 3, s->seed);

    if (y < 0.07)
        t += 0.5f;
    else if (vein < 0.04)
        t += 0.25f;
    *out = dimmed(blend_rgb(s->mat.a, s->mat.b, t), h->q.y < 0 ? 0.88f : 1.06f);
    return 1;
}

float paint_fur(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm;
    const float hair = sst_noise_fbm(scaled(h, 0.25 * p, p), 3, s->seed);
    const float wave = sst_noise_fbm(scaled(h, 3 * p, 3 * p), 2, s->seed + 5);
    const float stripe = (float)(0.5 + 0.5 * sin(h->t.y / (0.55 * p) + 5 * wave));

    *out = blend_rgb(s->mat.b, s->mat.a, hair);
    *out = dimmed(*out, (1 - (float)s->mat.k * (stripe > 0.55f ? 1.0f : 0.0f)) * (0.85f + 0.3f * wave));
    return 1;
}

float paint_feather(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm, row = floor(h->t.y / (0.6 * p));
    const double x = h->t.x / p + (fmod(fabs(row), 2) > 0.5 ? 0.5 : 0), y = h->t.y / (0.6 * p) - row;
    const double dx = 2 * (x - floor(x)) - 1, edge = y + 0.5 * dx * dx;
    const uint32_t one = sst_noise_hash((int32_t)floor(x), (int32_t)row, 2, s->seed);
    const float barb = sst_noise(vec3(12 * dx, 2 * y + 4, 0), one);
    const float t = (edge > 0.85 ? 0.85f : 0.2f) * 0.8f + 0.3f * barb;

    *out = dimmed(blend_rgb(s->mat.a, s->mat.b, t), 0.75f + 0.35f * (float)(one & 255) / 255);
    return 1;
}

float paint_camouflage(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const struct sst_vec3 p = scaled(h, s->mat.scale_mm, s->mat.scale_mm);
    const float t = sst_noise_fbm(p, 3, s->seed), dark = sst_noise_fbm(p, 3, s->seed + 50);

    *out = t > 0.56f ? s->mat.a : s->mat.b;
    if (dark > 0.62f)
        *out = dimmed(s->mat.b, 0.45f);
    *out = dimmed(*out, 0.8f + 0.4f * sst_noise_fbm(vec3_mul(p, 5), 2, s->seed + 8));
    return 1;
}

float paint_shadow(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const float r2 = (float)(h->q.x * h->q.x + h->q.y * h->q.y);

    *out = s->mat.a;
    return r2 >= 1 ? 0 : 0.48f * (1 - r2);
}

/* --- outlines ----------------------------------------------------------------------------------------------------- */

/* Pointed at both ends, widest before the middle. */
bool mask_leaf(const struct sst_scene_surface *s SST_UNUSED, double x, double y)
{
    return fabs(y) < (1 - x * x) * (1 - 0.35 * x) * 0.93;
}

bool mask_disc(const struct sst_scene_surface *s SST_UNUSED, double x, double y)
{
    return x * x + y * y < 1;
}

bool mask_rounded(const struct sst_scene_surface *s, double x, double y)
{
    const double aspect = sqrt(vec3_dot(s->u, s->u) / vec3_dot(s->v, s->v)), r = s->outline;
    const double dx = fmax(0, (fabs(x) - 1) * aspect + r), dy = fmax(0, fabs(y) - 1 + r);

    return dx * dx + dy * dy <= r * r;
}

bool mask_trapezoid(const struct sst_scene_surface *s, double x, double y)
{
    return fabs(x) < s->outline + (1 - s->outline) * (y + 1) / 2;
}

bool mask_wheel(const struct sst_scene_surface *s, double x, double y)
{
    const double r2 = x * x + y * y;
    double turn;

    if (r2 >= 1)
        return false;
    if (s->outline > 0 || r2 > 0.86 * 0.86 || r2 < 0.1 * 0.1)
        return true;
    turn = atan2(y, x) * 9 / 3.141592653589793; /* 18 spokes */
    return fabs(turn - floor(turn + 0.5)) * sqrt(r2) < 0.075;
}
