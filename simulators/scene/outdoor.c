/* The scenes "bush" and "pedestrian". */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/classes.h"
#include "simulators/scene/scene_internal.h"

/* --- bush: a man on a sofa before a house, behind dense leaves ---------------------------------------------------- */

/* Clothes depend on the seed. */
static struct sst_scene_material shirt(struct sst_scene_world *w, double scale_mm)
{
    static const unsigned colours[][2] = { { 0x2f5d8c, 0xd8dfe6 }, { 0xb5472f, 0xe0c49a }, { 0x3a6b4a, 0xe6dca8 },
                                           { 0x5a3a78, 0xd8b8d8 }, { 0x3a3a40, 0xc8a050 }, { 0x1f7a80, 0xf0e8d8 } };
    const unsigned *pick = colours[sst_random_u64(&w->rng) % ARRAY_LEN(colours)];
    struct sst_scene_material m = material(paint_cloth, pick[0], pick[1], scale_mm);

    m.k = sst_random(&w->rng) < 0.5 ? 0 : 1;
    return m;
}

static void add_sitter(struct sst_scene_world *w, struct sst_vec3 base)
{
    const struct sst_scene_material top = shirt(w, 66);
    const struct figure man = {
        .base = base,
        .scale = 1,
        .yaw = sst_random_in(&w->rng, -0.2, 0.2),
        .seated = true,
        .skin = material(sst_scene_paint_fbm, 0xc08a68, 0xdcab88, 60),
        .face = material(paint_face, 0xd6a280, 0x3a281c, 40),
        .shirt = top,
        .trousers = { paint_cloth, rgb_hex(0x4a4436), rgb_hex(0x7d745e), 30, 2, NULL },
        .shoes = material(sst_scene_paint_fbm, 0x1e1a18, 0x4c4038, 40),
    };

    sst_scene_begin(w, SST_LABEL_PEDESTRIAN, 0);
    add_figure(w, &man);
}

void build_bush(struct sst_scene_world *w)
{
    const struct sst_scene_material house = { paint_facade, rgb_hex(0xb07a58), rgb_hex(0xddd6c4), 240, 11, NULL };
    const double all_x[2] = { -780, 780 }, all_y[2] = { -560, 620 }, low_y[2] = { 260, 640 }, disp[2] = { 48, 72 };
    struct sst_vec3 base, wall;
    unsigned bush;

    w->focal = 3200;
    w->spacing_mm = 80;
    bush = world_occluder(w, "bush", SST_LABEL_TREE, SST_LABEL_PEDESTRIAN);
    base = world_at(w, sst_random_in(&w->rng, -25, 45), 235, 26);
    wall = vec3_add(base, vec3(150, -2900, 400));
    sst_scene_begin(w, SST_LABEL_BUILDING, 0);
    sst_scene_add_patch(w, wall, vec3(30000, 0, 0), vec3(0, 2900, 0), house);
    sst_scene_begin(w, SST_LABEL_PAVEMENT, 0);
    sst_scene_add_floor(w, base.y, 300, wall.z, material(paint_slabs, 0x8d8678, 0xb9b2a2, 420));
    add_shadow(w, vec3(base.x, base.y, base.z - 60), 1150, 620);
    sst_scene_begin(w, SST_LABEL_FURNITURE, 0);
    add_model(w, "sofa", (struct stand){ base, 1, 0 });
    add_sitter(w, base);

    sst_scene_begin(w, SST_LABEL_TREE, bush);
    for (int i = 0; i < 9; i++) {
        const double d = sst_random_in(&w->rng, disp[0], disp[1]), x = -700 + 175 * i;
        const struct sst_vec3 lean = sst_random_vec(&w->rng, 200);

        add_branch(w, world_at(w, x, 700, d), world_at(w, 0.8 * x + lean.x, lean.y - 325, d + 2), 9);
    }
    add_foliage(w, 3400, (struct room){ all_x, all_y, disp }, 17);
    add_foliage(w, 400, (struct room){ all_x, low_y, disp }, 17);
}

#define WALK_MM 4600.0 /* length of the walker's path, which takes WALK_S and a whole number of strides */
#define WALK_S  4.0
#define STRIDES 3
#define TURN    6.283185307179586

/* --- pedestrian: a walker before a parked van, a house front behind ----------------------------------------------- */

/* A model with its number plate. @param rear  on the road below the centre of the rear bumper */
static void add_car(struct sst_scene_world *w, const char *model, struct sst_vec3 rear, double up, const char *text)
{
    struct sst_scene_material plate = material(paint_text, 0xf3eecb, 0x15181c, 60);

    add_model(w, model, (struct stand){ rear, 1, 0 });
    plate.text = text;
    sst_scene_add_patch(w, vec3_add(rear, vec3(0, -up, -12)), vec3(310, 0, 0), vec3(0, 84, 0), plate)->grain = 0.06f;
}

static void add_walker(struct sst_scene_world *w, struct sst_vec3 base, unsigned hide)
{
    const struct sst_scene_material top = shirt(w, 90);
    const struct figure walker = {
        .base = base,
        .scale = 1,
        .yaw = 1.45,
        .stride = 0.42 * sin(0.9 + TURN * STRIDES / WALK_S * w->time_s),
        .skin = material(sst_scene_paint_fbm, 0xb98262, 0xd9a684, 60),
        .face = material(paint_face, 0xcf9c7a, 0x2b1d16, 40),
        .shirt = top,
        .trousers = { paint_cloth, rgb_hex(0x27364f), rgb_hex(0x52678a), 34, 2, NULL },
        .shoes = material(sst_scene_paint_fbm, 0x3a2a20, 0x6e5340, 40),
    };

    sst_scene_begin(w, SST_LABEL_PEDESTRIAN, hide);
    add_shadow(w, base, 420, 260);
    add_figure(w, &walker);
}

void build_pedestrian(struct sst_scene_world *w)
{
    const struct sst_scene_material house = { paint_facade, rgb_hex(0x9c4a36), rgb_hex(0xd9d2c2), 270, 8, NULL };
    const struct sst_scene_material asphalt = {
        sst_scene_paint_fbm, rgb_hex(0x3e3e42), rgb_hex(0x8e8e92), 50, 5, NULL
    };
    const double road = 8 * 161;
    struct sst_vec3 rear, walker;
    unsigned person, cars;
    const double walk = w->time_s / WALK_S;
    double front;

    w->focal = 1800;
    w->spacing_mm = 161;
    w->shift = 50;
    person = world_occluder(w, "pedestrian", SST_LABEL_PEDESTRIAN, SST_LABEL_CAR);
    cars = world_occluder(w, "car", SST_LABEL_CAR, SST_LABEL_BUILDING);
    rear = world_at(w, 60, 216, 27);
    walker = world_at(w, sst_random_in(&w->rng, 5, 45), 512, 64);
    front = world_at(w, 0, 0, 13).z;

    sst_scene_begin(w, SST_LABEL_BUILDING, 0);
    sst_scene_add_patch(w, vec3(600, road - 9000, front), vec3(90000, 0, 0), vec3(0, 9000, 0), house);
    sst_scene_begin(w, SST_LABEL_ROAD, 0);
    sst_scene_add_floor(w, road, 300, front - 4200, asphalt);
    sst_scene_add_patch(w, vec3(0, road - 2, 6900), vec3(60000, 0, 0), vec3(0, 0, -75),
                        material(sst_scene_paint_fbm, 0xb9b9b2, 0xe8e8e0, 120));
    sst_scene_begin(w, SST_LABEL_PAVEMENT, 0);
    sst_scene_add_floor(w, road - 130, front - 4200, front, material(paint_slabs, 0x8e8a82, 0xb8b4aa, 600));
    sst_scene_add_patch(w, vec3(0, road - 65, front - 4200), vec3(60000, 0, 0), vec3(0, 65, 0),
                        material(sst_scene_paint_fbm, 0x8a8882, 0xb8b6b0, 200));
    sst_scene_begin(w, SST_LABEL_POLE, 0);
    add_bar(w, vec3(-5300, road, front - 3900), vec3(-5300, road - 7000, front - 3900), 75,
            material(sst_scene_paint_fbm, 0x3c4440, 0x78827c, 200));

    sst_scene_begin(w, SST_LABEL_CAR, cars);
    add_car(w, "van", rear, 660, "SST 2036");
    add_car(w, "blue-car", vec3_add(rear, vec3(-2650, 0, 500)), 560, "LF 6X6");
    add_car(w, "red-car", vec3_add(rear, vec3(2700, 0, 250)), 560, "RAY 36");
    /* The walker leaves on the right and returns on the left. */
    walker.x += WALK_MM * (walk - floor(walk + 0.5));
    add_walker(w, walker, person | cars);
}
