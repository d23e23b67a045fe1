/* The scenes of small disparities, weak textures and slopes: "bust" and "terrace". */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/classes.h"
#include "simulators/scene/scene_internal.h"

/* Set the strength of the fine texture of all surfaces from `first` on. */
static void set_grain(struct sst_scene_world *w, int first, float grain)
{
    for (int i = first; i < w->count; i++)
        w->surfaces[i].grain = grain;
}

/*
 * A wall, and the floor before it down to the lower edge of the picture. `lines` is the height of the cameras above the
 * floor in spacings: its disparity grows by 1 / lines a row. @return this height, mm
 */
static double add_hall(struct sst_scene_world *w, double lines, double wall_px)
{
    const double y = lines * w->spacing_mm, z = world_at(w, 0, 0, wall_px).z, mm = world_mm(w, wall_px);

    sst_scene_begin(w, SST_LABEL_PAVEMENT, 0);
    sst_scene_add_floor(w, y, 0.05 * z, z, material(sst_scene_paint_fbm, 0x8c8880, 0xa49f96, 120 * mm))->grain = 0.03f;
    sst_scene_begin(w, SST_LABEL_BUILDING, 0);
    sst_scene_add_patch(w, vec3(0, y - 2000 * mm, z), vec3(8000 * mm, 0, 0), vec3(0, 2000 * mm, 0),
                        material(sst_scene_paint_fbm, 0x96938e, 0xaca8a0, 160 * mm))
        ->grain = 0.02f;
    return y;
}

/* --- bust: a head of stone on a pedestal -------------------------------------------------------------------------- */

/* @param m  mm per design pixel */
static void add_head(struct sst_scene_world *w, struct sst_vec3 chest, double m, double turn)
{
    const struct sst_scene_material stone = material(sst_scene_paint_fbm, 0xb4aca0, 0xc8c2b6, 45 * m);
    const struct sst_vec3 right = vec3(cos(turn), 0, sin(turn)), front = vec3(sin(turn), 0, -cos(turn));
    const struct sst_vec3 head = vec3_add(chest, vec3(0, -235 * m, -15 * m)), face = vec3_mul(front, 92 * m);
    const int first = w->count;

    add_ellipsoid(w, chest, (struct axes){ vec3_mul(right, 175 * m), vec3(0, 105 * m, 0), vec3_mul(front, 80 * m) },
                  stone);
    add_limb(w, vec3_add(chest, vec3(0, -60 * m, 0)), vec3_add(head, vec3(0, 70 * m, 0)), 55 * m, stone);
    add_ellipsoid(w, head, (struct axes){ vec3_mul(right, 88 * m), vec3(0, 122 * m, 0), vec3_mul(front, 98 * m) },
                  stone);
    add_limb(w, vec3_add(head, vec3_add(face, vec3(0, -20 * m, 0))),
             vec3_add(head, vec3_add(vec3_mul(face, 1.12), vec3(0, 22 * m, 0))), 14 * m, stone);
    add_limb(w, vec3_add(head, vec3_add(vec3_mul(face, 0.88), vec3_add(vec3_mul(right, -22 * m), vec3(0, 58 * m, 0)))),
             vec3_add(head, vec3_add(vec3_mul(face, 0.88), vec3_add(vec3_mul(right, 22 * m), vec3(0, 58 * m, 0)))),
             9 * m, stone);
    set_grain(w, first, 0.025f);
    for (int i = 0; i < 26; i++) { /* curls */
        const double a = sst_random_in(&w->rng, 0.15, 2.99), b = sst_random_in(&w->rng, -1.1, 1.1);
        const struct sst_vec3 out =
            vec3_add(vec3_mul(right, 84 * m * cos(a) * cos(b)),
                     vec3_add(vec3(0, -118 * m * sin(a) * cos(0.7 * b), 0), vec3_mul(front, 92 * m * sin(b))));

        add_ball(w, vec3_add(head, out), vec3(24 * m, 22 * m, 24 * m), stone);
    }
    set_grain(w, first + 5, 0.05f);
}

void build_bust(struct sst_scene_world *w)
{
    const struct sst_scene_material marble = material(sst_scene_paint_fbm, 0x9a948a, 0xb0aaa0, 90);
    double disp, m, y, x, turn;
    struct sst_vec3 top;
    unsigned bit;
    int first;

    w->focal = 1400;
    w->spacing_mm = 10;
    w->shift = 90;
    bit = world_occluder(w, "bust", SST_LABEL_TOY, SST_LABEL_BUILDING);
    y = add_hall(w, 25, 2);
    disp = sst_random_in(&w->rng, 6, 7);
    x = sst_random_in(&w->rng, -60, 60);
    turn = sst_random_in(&w->rng, -0.5, 0.5);
    m = world_mm(w, disp);
    top = world_at(w, x, 65, disp);
    sst_scene_begin(w, SST_LABEL_FURNITURE, 0);
    first = w->count;
    add_box(w, vec3(top.x, (top.y + y) / 2, top.z),
            (struct axes){ vec3(115 * m * cos(turn), 0, 115 * m * sin(turn)), vec3(0, (y - top.y) / 2, 0),
                           vec3(-115 * m * sin(turn), 0, 115 * m * cos(turn)) },
            marble);
    add_box(w, vec3(top.x, top.y - 14 * m, top.z),
            (struct axes){ vec3(135 * m * cos(turn), 0, 135 * m * sin(turn)), vec3(0, 16 * m, 0),
                           vec3(-135 * m * sin(turn), 0, 135 * m * cos(turn)) },
            marble);
    set_grain(w, first, 0.015f);
    sst_scene_begin(w, SST_LABEL_TOY, bit);
    add_head(w, vec3_add(top, vec3(0, -85 * m, 0)), m, turn);
}

/* --- terrace: slopes among boards that face the cameras ----------------------------------------------------------- */

void build_terrace(struct sst_scene_world *w)
{
    unsigned bit;
    double y;
    int first;

    w->focal = 1400;
    w->spacing_mm = 10;
    w->shift = -80;
    bit = world_occluder(w, "boards", SST_LABEL_CASE, SST_LABEL_PAVEMENT);
    y = add_hall(w, 40, 2);
    sst_scene_begin(w, SST_LABEL_FENCE, 0); /* slopes against the wall */
    first = w->count;
    for (int i = 0; i < 3; i++) {
        const double d = sst_random_in(&w->rng, 3, 3.6), mm = world_mm(w, d), turn = sst_random_in(&w->rng, 0.9, 1.2);
        const double along = 120 * mm, c = cos(turn) * along, s = (i == 1 ? -1 : 1) * sin(turn) * along;
        const struct sst_vec3 at = world_at(w, -300 + 300 * i + sst_random_in(&w->rng, -40, 40), -100, d);

        sst_scene_add_patch(w, at, vec3(c, 0, s), vec3(0, 80 * mm, 0),
                            material(sst_scene_paint_fbm, 0xa08c78, 0xb4a08c, 50 * mm));
    }
    set_grain(w, first, 0.03f);
    sst_scene_begin(w, SST_LABEL_CASE, bit);
    first = w->count;
    for (int i = 0; i < 6; i++) {
        const double d = 3.5 + i + sst_random_in(&w->rng, -0.4, 0.4), mm = world_mm(w, d);
        const double x = (i % 2 ? 190 : -190) + sst_random_in(&w->rng, -120, 120);
        const double half = sst_random_in(&w->rng, 35, 60) * mm;
        const struct sst_vec3 foot = world_at(w, x, 0, d);

        sst_scene_add_patch(
            w, vec3(foot.x, y - half, foot.z), vec3(1.2 * half, 0, 0), vec3(0, half, 0),
            material(sst_scene_paint_fbm, i % 3 ? 0x8a9096 : 0x9a8478, i % 3 ? 0xa0a6ac : 0xae988c, 70 * mm));
    }
    set_grain(w, first, 0.015f);
}
