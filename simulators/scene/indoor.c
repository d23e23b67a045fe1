/* The scenes on a table: "transportation", "humvee", "cd-cases", "cat", and "cell" under a microscope. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/classes.h"
#include "simulators/scene/scene_internal.h"

/*
 * A table top from in front of the cameras to a wall. `lines` is the height of the cameras above it in spacings, so a
 * point on it at disparity d is at design row lines * d.
 */
static double add_room(struct sst_scene_world *w, double lines, double wall_px)
{
    const double y = lines * w->spacing_mm, z = world_at(w, 0, 0, wall_px).z;
    const double mm = world_mm(w, wall_px);

    sst_scene_begin(w, SST_LABEL_TABLE, 0);
    sst_scene_add_floor(w, y, 0.02 * z, z, material(sst_scene_paint_wood, 0x7a5230, 0xc09060, 55 * mm));
    sst_scene_begin(w, SST_LABEL_BUILDING, 0);
    sst_scene_add_patch(w, vec3(0, y - 2000 * mm, z), vec3(8000 * mm, 0, 0), vec3(0, 2000 * mm, 0),
                        material(paint_brick, 0xa9826a, 0xd8cfbe, 62 * mm));
    return y;
}

/** Point on the table at design column x and disparity d. */
static struct sst_vec3 on_table(const struct sst_scene_world *w, double x, double y_mm, double disp_px)
{
    struct sst_vec3 p = world_at(w, x, 0, disp_px);

    p.y = y_mm;
    return p;
}

static struct sst_scene_material picture(unsigned a, unsigned b, double scale_mm, const char *text)
{
    struct sst_scene_material m = material(paint_poster, a, b, scale_mm);

    m.text = text;
    return m;
}

/* --- transportation: one table top spans the disparities of all three models -------------------------------------- */

void build_transportation(struct sst_scene_world *w)
{
    struct stand horse, bicycle, motorcycle;
    unsigned bit_bicycle, bit_horse;
    double y;

    w->focal = 1700;
    w->spacing_mm = 15;
    w->shift = -225;
    bit_bicycle = world_occluder(w, "bicycle", SST_LABEL_BICYCLE, SST_LABEL_MOTORCYCLE);
    bit_horse = world_occluder(w, "horse", SST_LABEL_HORSE, SST_LABEL_BICYCLE);
    y = add_room(w, 8, 16);
    sst_scene_begin(w, SST_LABEL_POSTER, 0);
    add_board(w, vec3(-60, 20, 16.4), 250, 105, picture(0x2c4a78, 0xd8b070, 12, "ARRAY 6X6"));
    horse = (struct stand){ on_table(w, sst_random_in(&w->rng, -110, -50), y, 72), 0.04, 0.15 };
    bicycle = (struct stand){ on_table(w, sst_random_in(&w->rng, 0, 40), y, 47), 0.088, 0.1 };
    motorcycle = (struct stand){ on_table(w, sst_random_in(&w->rng, 25, 65), y, 31), 0.098, 0.1 };
    add_shadow(w, motorcycle.base, 120, 24);
    add_shadow(w, bicycle.base, 90, 14);
    add_shadow(w, horse.base, 42, 13);
    sst_scene_begin(w, SST_LABEL_MOTORCYCLE, 0);
    add_model(w, "motorcycle", motorcycle);
    sst_scene_begin(w, SST_LABEL_BICYCLE, bit_bicycle);
    add_model(w, "bicycle", bicycle);
    sst_scene_begin(w, SST_LABEL_HORSE, bit_horse | bit_bicycle);
    add_model(w, "horse", horse);
}

/* --- humvee: toys behind leaves ----------------------------------------------------------------------------------- */

static void add_soldier(struct sst_scene_world *w, struct sst_vec3 base, double scale, double yaw)
{
    const double k = scale * 350;
    const struct sst_scene_material cloth = material(paint_camouflage, 0x9a9060, 0x59613a, k);
    const struct figure soldier = {
        .base = base,
        .scale = scale,
        .yaw = yaw,
        .stride = 0.2,
        .skin = material(sst_scene_paint_fbm, 0xa87858, 0xcf9c78, 0.2 * k),
        .face = material(paint_face, 0xc08c68, 0x2a2018, 0.15 * k),
        .shirt = cloth,
        .trousers = cloth,
        .shoes = material(sst_scene_paint_fbm, 0x1c1814, 0x4a4036, 0.2 * k),
    };
    struct sst_vec3 head = base;

    add_figure(w, &soldier);
    head.y -= 1710 * scale;
    add_ball(w, head, vec3(118 * scale, 92 * scale, 125 * scale), cloth);
    add_limb(w, vec3_add(base, vec3(-260 * scale, -1050 * scale, -190 * scale)),
             vec3_add(base, vec3(330 * scale, -1330 * scale, -190 * scale)), 34 * scale,
             material(sst_scene_paint_fbm, 0x1a1a1a, 0x55514a, 0.2 * k));
}

void build_humvee(struct sst_scene_world *w)
{
    const double all_x[2] = { -800, 800 }, all_y[2] = { -580, 640 }, disp[2] = { 52, 76 };
    struct stand car;
    struct sst_vec3 man;
    unsigned leaves;
    double y, turn;

    w->focal = 1900;
    w->spacing_mm = 20;
    leaves = world_occluder(w, "leaves", SST_LABEL_TREE, SST_LABEL_TOY);
    y = add_room(w, 7.2, 28);
    sst_scene_begin(w, SST_LABEL_POSTER, 0);
    add_board(w, vec3(0, -70, 28.2), 470, 235, material(paint_landscape, 0x7fa4c8, 0x8a7446, 10));
    turn = sst_random_in(&w->rng, 0.2, 0.35);
    car = (struct stand){ on_table(w, sst_random_in(&w->rng, -110, -50), y, 29.5), 0.066, turn };
    man = on_table(w, sst_random_in(&w->rng, 260, 310), y, 30.5);
    add_shadow(w, car.base, 165, 95);
    add_shadow(w, man, 45, 30);
    sst_scene_begin(w, SST_LABEL_TOY, 0);
    add_model(w, "humvee", car);
    add_soldier(w, man, 0.125, -0.3);
    sst_scene_begin(w, SST_LABEL_TREE, leaves);
    for (int i = 0; i < 6; i++) {
        const double d = sst_random_in(&w->rng, disp[0], disp[1]), x = -650 + 260 * i;
        const double lean = sst_random_in(&w->rng, -250, 250);

        add_branch(w, world_at(w, x, -650, d), world_at(w, x + lean, 500, d), 2.4);
    }
    add_foliage(w, 3400, (struct room){ all_x, all_y, disp }, 4.4);
}

/* --- cd-cases: cases on stands before a poster -------------------------------------------------------------------- */

void build_cd_cases(struct sst_scene_world *w)
{
    static const struct {
        double x, y, disp, turn;
        unsigned a, b;
        const char *text;
    } cases[] = {
        { -330, 40, 66, 0.25, 0x203a70, 0x9fc4e8, "BLUE" },   { -150, 190, 72, -0.2, 0x7a1f2a, 0xe8a860, "OPUS 3" },
        { -20, -10, 62, 0.1, 0x1f5a3a, 0xcfe0a0, "FOREST" },  { 130, 150, 78, 0.3, 0x5a2a70, 0xe0b0d8, "SONATA" },
        { 270, 10, 68, -0.25, 0x705020, 0xf0dca0, "DUNES" },  { 380, 230, 74, 0.15, 0x104a58, 0x90d8d0, "TIDE 7" },
        { -420, 260, 84, -0.1, 0x3a3a44, 0xd0c8c0, "MONO" },  { -210, -60, 65, 0.2, 0x6a3018, 0xf0c8a0, "AMBER" },
        { -290, 150, 70, -0.15, 0x285038, 0xe8e0b0, "FERN" }, { 40, 90, 67, 0.2, 0x30306a, 0xd8a8c0, "NIGHT" },
        { 210, -70, 63, -0.1, 0x6a1c48, 0xf0c0a8, "ROSE" },   { 310, 120, 71, 0.25, 0x18485a, 0xe8d0a0, "COAST" },
    };
    unsigned bit;
    double y;

    w->focal = 1800;
    w->spacing_mm = 40;
    w->shift = -90;
    bit = world_occluder(w, "cases", SST_LABEL_CASE, SST_LABEL_POSTER);
    y = add_room(w, 8, 23);
    sst_scene_begin(w, SST_LABEL_POSTER, 0);
    add_board(w, vec3(0, -25, 27), 480, 235, picture(0x24365c, 0xe0b868, 22, "SEE THROUGH 2036"));
    sst_scene_begin(w, SST_LABEL_CASE, bit);
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const double half = 54 * world_mm(w, cases[i].disp), c = cos(cases[i].turn), s = sin(cases[i].turn);
        const struct sst_vec3 p = world_at(w, cases[i].x, cases[i].y, cases[i].disp);

        sst_scene_add_patch(w, p, vec3(half * c, 0, half * s), vec3(0, 0.9 * half, 0.08 * half),
                            picture(cases[i].a, cases[i].b, 5, cases[i].text));
        add_bar(w, vec3_add(p, vec3(0, 0.9 * half, 1)), vec3(p.x, y, p.z), 1.6,
                material(sst_scene_paint_fbm, 0x50545a, 0xb0b4ba, 6));
    }
}

/* --- cat: a hen of nearly the same depth and colours before it, where seeing through must fail -------------------- */

void build_cat(struct sst_scene_world *w)
{
    struct stand cat, hen;
    unsigned bit;
    double y;

    w->focal = 1700;
    w->spacing_mm = 25;
    w->shift = -120;
    bit = world_occluder(w, "hen", SST_LABEL_HEN, SST_LABEL_CAT);
    y = add_room(w, 7.6, 24);
    sst_scene_begin(w, SST_LABEL_POSTER, 0);
    add_board(w, vec3(190, -40, 24.5), 200, 120, picture(0x7a4a2a, 0xe8c890, 14, "FARM"));
    cat = (struct stand){ on_table(w, sst_random_in(&w->rng, 20, 60), y, 52), 0.5, 0.12 };
    hen = (struct stand){ on_table(w, sst_random_in(&w->rng, -190, -150), y, 60), 0.36, 0.2 };
    add_shadow(w, cat.base, 190, 70);
    add_shadow(w, hen.base, 85, 45);
    sst_scene_begin(w, SST_LABEL_CAT, 0);
    add_model(w, "cat", cat);
    sst_scene_begin(w, SST_LABEL_HEN, bit);
    add_model(w, "hen", hen);
}

/* --- cell: a translucent layer of membranes over the layer of the nuclei ------------------------------------------ */

void build_cell(struct sst_scene_world *w)
{
    struct sst_scene_surface *s;
    unsigned bit;

    w->focal = 1500;
    w->spacing_mm = 0.02;
    bit = world_occluder(w, "membrane", SST_LABEL_MEMBRANE, SST_LABEL_NUCLEUS);
    sst_scene_begin(w, SST_LABEL_NUCLEUS, 0);
    s = add_board(w, vec3(0, 0, 30), 20000, 20000, material(paint_tissue, 0x5a3a98, 0x8a5cc0, 120 * world_mm(w, 30)));
    s->unlit = true;
    sst_scene_begin(w, SST_LABEL_MEMBRANE, bit);
    s = add_board(w, vec3(0, 0, 62), 20000, 20000, material(paint_membrane, 0xc05878, 0xf0a0a8, 128 * world_mm(w, 62)));
    s->unlit = true;
    s->translucent = true;
}
