/* Textures of single objects: a face, a number plate, the rear of a car, a house front, a poster, stained cells. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "simulators/scene/scene_internal.h"

static float noise_at(const struct sst_scene_surface *s, const struct sst_scene_hit *h, double mm, uint32_t salt)
{
    return sst_noise_fbm(vec3_mul(h->t, 1 / mm), 4, s->seed + salt);
}

float paint_text(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const int columns = 6 * (int)strlen(s->mat.text) - 1;
    const double dx = (h->q.x * 0.5 + 0.5) * (columns + 5) - 2.5, dy = (h->q.y * 0.5 + 0.5) * 10.5 - 1.75;
    const bool border = dx < -1.4 || dx > columns + 1.4 || dy < -0.9 || dy > 7.9;
    const bool ink = border || sst_font_dot(s->mat.text, (int)floor(dx), (int)floor(dy));

    *out = dimmed(ink ? s->mat.b : s->mat.a, 0.88f + 0.2f * noise_at(s, h, s->mat.scale_mm, 0));
    return 1;
}

/* --- people ------------------------------------------------------------------------------------------------------- */

float paint_face(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    static const struct sst_scene_rgb white = { 0.93f, 0.92f, 0.9f }, dark = { 0.13f, 0.09f, 0.08f },
                                      lip = { 0.66f, 0.31f, 0.28f };
    const double x = fabs(h->q.x), y = h->q.y;
    const float rough = noise_at(s, h, 14, 0);
    const double eye_x = (x - 0.36) / 0.17, eye_y = (y + 0.06) / 0.075, hairline = -0.5 + 0.16 * rough;

    *out = dimmed(s->mat.a, 0.86f + 0.26f * rough);
    if (h->q.z < -0.05 ? y < 0.38 : y < hairline) {
        const float strand = sst_noise_fbm(vec3(h->t.x / 3, h->t.y / 18, h->t.z / 3), 3, s->seed);

        *out = dimmed(s->mat.b, 0.6f + 0.9f * strand);
    } else if (h->q.z > 0) {
        if (eye_x * eye_x + eye_y * eye_y < 1)
            *out = fabs(x - 0.36) < 0.075 ? dark : white;
        else if (fabs(x - 0.36) < 0.22 && fabs(y + 0.2 - 0.3 * (x - 0.36) * (x - 0.36)) < 0.045)
            *out = s->mat.b;
        else if (x < 0.27 && fabs(y - 0.52 + 0.4 * x * x) < 0.05)
            *out = lip;
        else if (x < 0.3 && y > 0.3 && y < 0.75)
            *out = blend_rgb(*out, s->mat.b, 0.12f);
    }
    return 1;
}

/* --- cars and houses ---------------------------------------------------------------------------------------------- */

/* @param box  x0, x1, y0, y1 */
static bool inside(double x, double y, const double box[4])
{
    return x > box[0] && x < box[1] && y > box[2] && y < box[3];
}

/* A reflecting pane: sky above, street below, streaks between. */
static struct sst_scene_rgb pane(const struct sst_scene_surface *s, const struct sst_scene_hit *h, double mm, float up)
{
    const float cloud = sst_noise_fbm(vec3(h->t.x / mm, h->t.y / (0.5 * mm), 0), 5, s->seed + 3);
    const struct sst_scene_rgb low = { 0.09f, 0.11f, 0.13f }, high = { 0.45f, 0.55f, 0.65f };

    return blend_rgb(low, high, 1.1f * cloud * cloud * (0.4f + 0.6f * up) + 0.1f * up);
}

static struct sst_scene_rgb lamp(const struct sst_scene_surface *s, const struct sst_scene_hit *h, double y)
{
    const struct sst_scene_rgb red = { 0.72f, 0.07f, 0.06f }, amber = { 0.9f, 0.5f, 0.1f },
                               clear = { 0.9f, 0.88f, 0.85f };
    const float ribs = 0.75f + 0.45f * sst_noise(vec3(h->t.x / 9, h->t.y / 9, 0), s->seed + 12);

    return dimmed(y < 0.33 ? amber : y < 0.62 ? clear : red, ribs);
}

float paint_van(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double x = fabs(h->q.x), y = h->q.y;
    const float dirt = noise_at(s, h, 160, 0), fine = noise_at(s, h, 22, 4);
    const float low = (float)sst_clamp_double(y, 0, 1);

    *out = dimmed(s->mat.a, 0.8f + 0.16f * fine + 0.1f * dirt - 0.3f * low * dirt);
    if (inside(x, y, (const double[4]){ 0.08, 0.74, -0.78, -0.22 })) {
        const double edge = fmin(fmin(x - 0.08, 0.74 - x), fmin(y + 0.78, -0.22 - y));

        *out = edge < 0.025 ? rgb_hex(0x1c1c1e) : pane(s, h, 240, (float)(0.5 - y));
    } else if (inside(x, y, (const double[4]){ 0.86, 0.97, -0.1, 0.52 })) {
        *out = lamp(s, h, (y + 0.1) / 0.62);
    } else if (y > 0.72) {
        *out = dimmed(s->mat.b, 0.7f + 0.5f * fine);
    } else if (x < 0.008 || fabs(x - 0.82) < 0.006 || fabs(y + 0.12) < 0.006 || fabs(y - 0.68) < 0.006) {
        *out = dimmed(*out, 0.45f);
    } else if (inside(x, y, (const double[4]){ 0.78, 0.85, -0.6, -0.54 }) ||
               inside(x, y, (const double[4]){ 0.78, 0.85, 0.3, 0.36 }) ||
               inside(h->q.x, y, (const double[4]){ 0.03, 0.16, 0.0, 0.05 })) {
        *out = rgb_hex(0x2a2a2c);
    }
    return 1;
}

float paint_car(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double x = fabs(h->q.x), y = h->q.y;
    const float fine = noise_at(s, h, 30, 4), sheen = noise_at(s, h, 260, 6);

    *out = dimmed(s->mat.a, 0.72f + 0.2f * fine + 0.35f * sheen - 0.2f * (float)y);
    if (inside(x, y, (const double[4]){ 0.64, 0.96, -0.7, -0.3 }))
        *out = lamp(s, h, (x - 0.64) / 0.32);
    else if (y > 0.62)
        *out = dimmed(s->mat.b, 0.7f + 0.5f * fine);
    else if (fabs(y + 0.1) < 0.015 || (y < 0.05 && fabs(x - 0.62) < 0.01) || (x < 0.62 && fabs(y - 0.05) < 0.012))
        *out = dimmed(*out, 0.4f);
    else if (x < 0.09 && fabs(y + 0.5) < 0.09)
        *out = rgb_hex(0xd8d8dc);
    return 1;
}

float paint_glass(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double edge = fmin(s->outline + (1 - s->outline) * (h->q.y + 1) / 2 - fabs(h->q.x), 1 - fabs(h->q.y));

    *out = edge < 0.1 ? dimmed(s->mat.a, 0.9f) : pane(s, h, 200, (float)(0.5 - 0.5 * h->q.y));
    if (edge >= 0.1 && fabs(h->q.y * 8 - floor(h->q.y * 8 + 0.5)) < 0.06)
        *out = dimmed(*out, 1.4f);
    return 1;
}

float paint_facade(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm * s->mat.k, px = h->t.x / p, py = h->t.y / (1.25 * p);
    const double x = px - floor(px) - 0.5, y = py - floor(py) - 0.5, ax = fabs(x);
    const uint32_t one = sst_noise_hash((int32_t)floor(px), (int32_t)floor(py), 3, s->seed);
    const float up = (float)(0.5 - y);

    if (ax < 0.24 && fabs(y) < 0.3) {
        const bool bar = ax < 0.012 || ax > 0.215 || fabs(y) > 0.28 || fabs(y + 0.08) < 0.012;
        const bool curtain = (one & 3) != 0 && ax > 0.08 + 0.08 * (double)(one >> 4 & 15) / 15;
        const float fold = sst_noise(vec3(h->t.x / 60, h->t.y / 900, 0), one);

        *out = bar ? dimmed(s->mat.b, 0.85f + 0.2f * noise_at(s, h, 60, 1)) : pane(s, h, 0.3 * p, up);
        if (!bar && curtain)
            *out = blend_rgb(*out, dimmed(rgb_hex(one & 256 ? 0xcfc4a8 : 0xb9c4cc), 0.5f + 0.6f * fold), 0.75f);
        return 1;
    }
    paint_brick(s, h, out);
    if (ax < 0.28 && y >= 0.3 && y < 0.34)
        *out = dimmed(s->mat.b, 0.8f + 0.25f * noise_at(s, h, 90, 2));
    else if (ax < 0.27 && y <= -0.3 && y > -0.37)
        *out = dimmed(rgb_hex(0xb8ad98), 0.75f + 0.35f * noise_at(s, h, 90, 2));
    else if (fabs(y) > 0.475)
        *out = dimmed(s->mat.b, 0.7f + 0.3f * noise_at(s, h, 120, 7));
    return 1;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* Hills before a sky: sky a, ground b. */
float paint_landscape(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double mm = s->mat.scale_mm;
    const float cloud = sst_noise_fbm(vec3(h->q.x * 3, h->q.y * 9, 0), 5, s->seed), fine = noise_at(s, h, mm, 2);

    *out = blend_rgb(s->mat.a, rgb_hex(0xf4f2ee), cloud * cloud);
    for (int i = 0; i < 4; i++) {
        const double x = h->q.x * (1.5 + 1.2 * i) + 7 * i + 50, top = -0.35 + 0.3 * i;

        if (h->q.y > top + 0.5 * (sst_noise_fbm(vec3(x, 3.5, 0), 4, s->seed + 20) - 0.5)) {
            const float bush =
                sst_noise_fbm(vec3(h->t.x / (3 * mm), h->t.y / (1.5 * mm), 0), 4, s->seed + 3 * (uint32_t)i);

            *out = blend_rgb(rgb_hex(0x9aa6a8), s->mat.b, 0.4f + 0.2f * (float)i);
            *out = dimmed(*out, 0.55f + 0.8f * bush);
        }
    }
    *out = dimmed(*out, 0.8f + 0.35f * fine);
    return 1;
}

/* A disc or a tilted square of the picture's palette. */
static void add_shape(const struct sst_scene_surface *s, const struct sst_scene_hit *h, uint32_t one,
                      struct sst_scene_rgb *out)
{
    const double aspect = sqrt(vec3_dot(s->u, s->u) / vec3_dot(s->v, s->v));
    const double dx = (h->q.x - (one & 255) / 127.5 + 1) * aspect, dy = h->q.y - (one >> 8 & 255) / 127.5 + 1;
    const double r = 0.12 + (one >> 16 & 63) / 200.0;
    const double d = one >> 31 ? sqrt(dx * dx + dy * dy) : fmax(fabs(dx + 0.4 * dy), fabs(dy - 0.4 * dx));
    struct sst_scene_rgb c = blend_rgb(s->mat.a, s->mat.b, (float)(one >> 3 & 255) / 180);

    if (d >= r)
        return;
    c = (struct sst_scene_rgb){ c.r * (0.7f + 0.6f * (float)(one >> 11 & 255) / 255), c.g, c.b };
    *out = blend_rgb(c, dimmed(c, 0.5f), (float)(d / r) * (one >> 28 & 1 ? 1.0f : 0.3f));
}

float paint_poster(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const float t = sst_noise_fbm(vec3(h->q.x * 2.5 + 9, h->q.y * 2.5, 0), 5, s->seed);
    const float fine = noise_at(s, h, s->mat.scale_mm, 2);

    *out = blend_rgb(s->mat.a, s->mat.b, t);
    for (int i = 0; i < 16; i++)
        add_shape(s, h, sst_noise_hash(i, 0, 5, s->seed), out);
    if (s->mat.text) {
        const int columns = 6 * (int)strlen(s->mat.text) - 1;
        const double x = (h->q.x + 0.86) / 1.72 * columns, y = (h->q.y - 0.56) / 0.3 * 7;

        if (h->q.y > 0.5 && h->q.y < 0.92)
            *out = rgb_hex(0xf2ead8);
        if (sst_font_dot(s->mat.text, (int)floor(x), (int)floor(y)))
            *out = rgb_hex(0x1b2030);
    }
    *out = dimmed(*out, 0.7f + 0.5f * fine);
    if (fmax(fabs(h->q.x), fabs(h->q.y)) > 0.965)
        *out = dimmed(rgb_hex(0xe8e6e0), 0.8f + 0.25f * fine);
    return 1;
}

float paint_wheel(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double r = sqrt(h->q.x * h->q.x + h->q.y * h->q.y), rim = s->outline > 0 ? s->outline : 0.9;
    const float fine = noise_at(s, h, s->mat.scale_mm, 0);

    *out = dimmed(r > rim ? s->mat.a : s->mat.b, 0.6f + 0.7f * fine);
    if (s->outline > 0 && r < rim) {
        const double turn = atan2(h->q.y, h->q.x) * 5 / 6.283185307179586;

        if (r > 0.15 && r < 0.85 * rim && fabs(turn - floor(turn + 0.5)) > 0.27)
            *out = dimmed(s->mat.a, 0.7f + 0.5f * fine);
    }
    return 1;
}

/* --- stained cells ------------------------------------------------------------------------------------------------ */

/* Distance to the nearest and the second nearest of one random point per lattice cell, and a number of the nearest. */
static uint32_t nearest_seeds(double x, double y, uint32_t seed, double *first, double *second)
{
    const int32_t cx = (int32_t)floor(x), cy = (int32_t)floor(y);
    double near = 1e9, next = 1e9;
    uint32_t found = 0;

    for (int32_t j = cy - 1; j <= cy + 1; j++) {
        for (int32_t i = cx - 1; i <= cx + 1; i++) {
            const uint32_t one = sst_noise_hash(i, j, 4, seed);
            const double dx = i + 0.15 + 0.7 * (one & 0xffff) / 65536.0 - x,
                         dy = j + 0.15 + 0.7 * (one >> 16) / 65536.0 - y;
            const double d = dx * dx + dy * dy;

            if (d < near) {
                next = near;
                near = d;
                found = one;
            } else if (d < next) {
                next = d;
            }
        }
    }
    *first = sqrt(near);
    *second = sqrt(next);
    return found;
}

float paint_membrane(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm;
    const float wobble = sst_noise_fbm(vec3_mul(h->t, 3.3 / p), 2, s->seed + 1);
    double d1, d2, r;
    const uint32_t one = nearest_seeds(h->t.x / p + 0.2 * wobble, h->t.y / p + 0.2 * (1 - wobble), s->seed, &d1, &d2);

    r = d1 / (0.32 + 0.1 * (one >> 5 & 255) / 255);
    if (r >= 1)
        return 0;
    *out = blend_rgb(s->mat.a, s->mat.b, sst_noise_fbm(vec3_mul(h->t, 16 / p), 2, s->seed + 2));
    *out = dimmed(*out, 0.75f + 0.4f * wobble);
    if (r > 0.85) { /* the wall of the cell is denser */
        *out = dimmed(*out, 0.7f);
        return 0.78f;
    }
    return 0.44f + 0.22f * wobble;
}

float paint_tissue(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    const double p = s->mat.scale_mm;
    const float bulk = sst_noise_fbm(vec3_mul(h->t, 2.5 / p), 3, s->seed + 1);
    const float fine = sst_noise_fbm(vec3_mul(h->t, 16 / p), 2, s->seed + 2);
    double d1, d2, r;
    const uint32_t one = nearest_seeds(h->t.x / p + 0.25 * bulk, h->t.y / p, s->seed, &d1, &d2);

    r = d1 / (0.2 + 0.12 * (one >> 5 & 255) / 255);
    if (r < 1) {
        *out = dimmed(r > 0.85 ? dimmed(s->mat.b, 0.6f) : blend_rgb(s->mat.a, s->mat.b, fine), 0.7f + 0.5f * bulk);
        if (r < 0.35)
            *out = dimmed(s->mat.b, 0.45f + 0.3f * fine);
        return 1;
    }
    *out = dimmed(blend_rgb(rgb_hex(0xe8cfe0), rgb_hex(0xc79ac0), bulk), 0.75f + 0.35f * fine);
    if (d2 - d1 < 0.05) {
        *out = dimmed(rgb_hex(0x9a6fa8), 0.7f + 0.5f * fine);
    } else if (r > 1.1) {
        const uint32_t spot = nearest_seeds(h->t.x / (0.16 * p), h->t.y / (0.16 * p), s->seed + 9, &d1, &d2);

        if (d1 < 0.12 + 0.16 * (spot >> 4 & 255) / 255 && (spot & 3) > 0)
            *out = dimmed(rgb_hex(0x3f7f86), 0.7f + 0.6f * fine);
    }
    return 1;
}
