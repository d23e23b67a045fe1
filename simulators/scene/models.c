/* Models of single objects, as models.txt describes them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "simulators/scene/scene_internal.h"

#define MATERIALS 8 /* of one model */

__asm__(".section .rodata\nscene_models: .incbin \"simulators/scene/models.txt\"\n.byte 0\n.previous");
extern const char scene_models[];

struct model {
    struct sst_scene_world *w;
    struct sst_vec3 base, front, left;
    double scale;
    char names[MATERIALS][16];
    struct sst_scene_material materials[MATERIALS];
    int count;
};

static const struct {
    char name[16];
    sst_scene_paint_fn *paint;
} paints[] = {
    { "fbm", sst_scene_paint_fbm }, { "fur", paint_fur },
    { "feather", paint_feather },   { "camouflage", paint_camouflage },
    { "cloth", paint_cloth },       { "wheel", paint_wheel },
    { "van", paint_van },           { "car", paint_car },
    { "glass", paint_glass },
};

/* Patches with an outline. */
static const struct {
    char name[16];
    sst_scene_mask_fn *mask;
    int outline; /* which of the numbers it is; 4: of a circle */
} patches[] = {
    { "disc", mask_disc, 4 },
    { "wheel", mask_wheel, 4 },
    { "rounded", mask_rounded, 6 },
    { "trapezoid", mask_trapezoid, 6 },
};

static struct sst_vec3 at(const struct model *m, const double v[3])
{
    struct sst_vec3 p = vec3_add(vec3_mul(m->front, v[0]), vec3_mul(m->left, v[2]));

    p.y -= v[1];
    return vec3_add(m->base, vec3_mul(p, m->scale));
}

static void add_material(struct model *m, const char *line)
{
    char paint[16];
    unsigned a, b;
    double size, k = 0;

    if (m->count == MATERIALS ||
        sscanf(line, "%*s %15s %15s %x %x %lf %lf", m->names[m->count], paint, &a, &b, &size, &k) < 5)
        return;
    for (size_t i = 0; i < ARRAY_LEN(paints); i++) {
        if (strcmp(paints[i].name, paint) == 0)
            m->materials[m->count] = material(paints[i].paint, a, b, size * m->scale);
    }
    m->materials[m->count++].k = k;
}

static void add_shape(const struct model *m, const char *shape, const struct sst_scene_material *mat, const double *v)
{
    const double k = m->scale;
    const struct sst_vec3 c = at(m, v);
    /* Of a box equal from the left and the right: the first axis runs along the picture. */
    const struct axes axes = { vec3_mul(m->front, v[3] * k), vec3(0, v[4] * k, 0), vec3_mul(m->left, v[5] * k) };
    struct sst_scene_surface *s;

    if (strcmp(shape, "limb") == 0) {
        add_limb(m->w, c, at(m, v + 3), v[6] * k, *mat);
    } else if (strcmp(shape, "bar") == 0) {
        add_bar(m->w, c, at(m, v + 3), v[6] * k, *mat);
    } else if (strcmp(shape, "ball") == 0) {
        add_ellipsoid(m->w, c, axes, *mat);
    } else if (strcmp(shape, "box") == 0) {
        add_box(m->w, c, axes, *mat);
    } else if (strcmp(shape, "shadow") == 0) {
        add_shadow(m->w, c, v[3] * k, v[4] * k);
    }
    for (size_t i = 0; i < ARRAY_LEN(patches); i++) {
        const bool circle = patches[i].outline == 4;

        if (strcmp(patches[i].name, shape) != 0)
            continue;
        s = sst_scene_add_patch(m->w, c, axes.u, circle ? vec3(0, v[3] * k, 0) : vec3_add(axes.v, axes.w), *mat);
        s->mask = patches[i].mask;
        s->outline = v[patches[i].outline];
    }
}

void add_model(struct sst_scene_world *w, const char *name, struct stand stand)
{
    struct model m = { .w = w,
                       .base = stand.base,
                       .front = vec3(cos(stand.yaw), 0, -sin(stand.yaw)),
                       .left = vec3(sin(stand.yaw), 0, cos(stand.yaw)),
                       .scale = stand.scale };
    bool found = false;
    size_t length;

    for (const char *line = scene_models; *line; line += length + (line[length] == '\n')) {
        char word[16] = "", of[16] = "";
        double v[7] = { 0 };

        length = strcspn(line, "\n");
        if (length == 0 || sscanf(line, "%15s %15s %lf %lf %lf %lf %lf %lf %lf", word, of, &v[0], &v[1], &v[2], &v[3],
                                  &v[4], &v[5], &v[6]) < 2)
            continue;
        if (strcmp(word, "model") == 0)
            found = strcmp(of, name) == 0;
        else if (found && strcmp(word, "material") == 0)
            add_material(&m, line);
        for (int i = 0; found && i < m.count; i++) {
            if (strcmp(m.names[i], of) == 0 && strcmp(word, "material") != 0)
                add_shape(&m, word, &m.materials[i], v);
        }
    }
}
