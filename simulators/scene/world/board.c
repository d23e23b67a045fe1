/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include "pipeline/image/classes.h"

#define CHARUCO_MODULES 4
#define APRIL_MODULES   6
#define APRIL_BORDER    2
#define PICTURE_WIDTH   1000 /* design px */
#define PICTURE_HEIGHT  750

/* Modules of markers, row by row, high bit first, 1 is white: dictionary DICT_4X4_50 of ArUco (Garrido-Jurado et al.
 * 2014) and the first tags of the family 36h11 (Olson 2011). */
static const uint16_t charuco_marker[SST_SIM_CHARUCO_MARKERS] = {
    0xB532, 0x0F9A, 0x332D, 0x9946, 0x549E, 0x79CD, 0x9E2E, 0xC4F2, 0xFEDA, 0xCF56, 0xF991, 0x11A7, 0x0EB7,
    0x2A0F, 0x24B1, 0x263E, 0x4665, 0x6600, 0x6C5E, 0x76AF, 0x868B, 0xB02B, 0xCCD5, 0xDD82, 0xFE47, 0x9471,
    0xACE4, 0xA554, 0x2123, 0x346F, 0x4415, 0x57B2, 0x9ECF, 0xF0CB, 0x08AE, 0x0929, 0x1875, 0x04FF, 0x0DF6,
    0x1C5A, 0x1718, 0x2A28, 0x328C, 0x38B2, 0x24E8, 0x2EEB, 0x2D3F, 0x4B64, 0x502E, 0x5013,
};
static const uint64_t april_tag[SST_SIM_APRIL_TAGS] = {
    0x21A146BAB, 0x92D18FE9B, 0x7089014BB, 0x193979E27, 0x44153D3D7, 0x35CD5B8CF, 0xA10BA56A0, 0x2B874A608, 0xB57FB8D44,
    0x4E20B5A64, 0x61D897F2C, 0xAB3469FFC, 0x594CA45C2, 0xFA1C2D2E2, 0x97C24B972, 0x75928624A, 0x1CAAFE99A, 0x3236DDC16,
    0x884E527D6, 0x5771A8C7E, 0xF52925B81, 0x2E59CC1A1, 0x7FA58AB31, 0xEB43384F9, 0x3913D5345, 0xD79B1A3B5, 0x0DFBE768D,
    0x5CD7A031D, 0xB9C8F7A4B, 0x46987E06B, 0x6E0C5D527, 0x5BC567BB4, 0x1E6302BC2, 0x8AC7D046A, 0xA65FE2326, 0x5400EB616,
};

/* --- the pattern -------------------------------------------------------------------------------------------------- */

/* Colour of the module at (x, y), 0..1 each from the marker's upper left; the border is black. */
static bool module(uint64_t bits, int modules, int border, double x, double y)
{
    const int side = modules + 2 * border;
    const int column = (int)(x * side) - border, row = (int)(y * side) - border;

    if (column < 0 || row < 0 || column >= modules || row >= modules)
        return false;
    return bits >> (modules * modules - 1 - row * modules - column) & 1;
}

/* Inline replacements of floor() and fmin(), which would cost a hundred million calls. */
static int whole(double x)
{
    return (int)(x + 1024) - 1024; /* boards have fewer squares */
}

static double lesser(double a, double b)
{
    return a < b ? a : b;
}

/* From x to the nearest whole number. */
static double to_line(double x)
{
    const double rest = x - whole(x);

    return lesser(rest, 1 - rest);
}

/* In squares from the upper left corner of the pattern. */
static bool squares(const struct sst_sim_board *b, double x, double y, double *clear)
{
    const int column = whole(x), row = whole(y), side = CHARUCO_MODULES + 2;
    double u, v, out;
    int id;

    *clear = lesser(to_line(x), to_line(y));
    if (column < 0 || row < 0 || column >= b->cols || row >= b->rows)
        return true;
    if (!((column + row) & 1))
        return false;
    if (b->kind == SST_SIM_CHESSBOARD)
        return true;
    u = (x - column - 0.5) / b->marker + 0.5;
    v = (y - row - 0.5) / b->marker + 0.5;
    out = -lesser(lesser(u, 1 - u), lesser(v, 1 - v));
    if (out >= 0) {
        *clear = lesser(*clear, out * b->marker);
        return true;
    }
    *clear = lesser(to_line(u * side), to_line(v * side)) * b->marker / side;
    /* Number of white squares before this one: two rows together have cols, the first has cols / 2. */
    id = row / 2 * b->cols + (row & 1) * (b->cols / 2) + column / 2;
    return module(charuco_marker[id], CHARUCO_MODULES, 1, u, v);
}

/* To the nearest edge across one axis: first the gap, then the tag. */
static double tag_edge(double u, double gap)
{
    const int side = APRIL_MODULES + 2 * APRIL_BORDER;

    return u < gap ? lesser(u, gap - u) : to_line((u - gap) * side) / side;
}

/* In tags from the upper left corner of the pattern. */
static bool tags(const struct sst_sim_board *b, double x, double y, double *clear)
{
    const double gap = b->marker, pitch = 1 + gap, width = b->cols * pitch + gap, height = b->rows * pitch + gap;
    const int column = whole(x / pitch), row = whole(y / pitch);
    const double u = x - column * pitch, v = y - row * pitch;

    *clear = lesser(tag_edge(u, gap), tag_edge(v, gap));
    if (x < 0 || y < 0 || x >= width || y >= height)
        return true;
    if (u < gap || v < gap)
        return !(u < gap && v < gap);
    if (column >= b->cols || row >= b->rows)
        return true;
    return module(april_tag[row * b->cols + column], APRIL_MODULES, APRIL_BORDER, u - gap, v - gap);
}

void sim_board_size(const struct sst_sim_board *b, double *width_mm, double *height_mm)
{
    const double pitch = b->kind == SST_SIM_APRILGRID ? 1 + b->marker : 1;
    const double more = b->kind == SST_SIM_APRILGRID ? b->marker : 0;

    *width_mm = (b->cols * pitch + more) * b->square_mm;
    *height_mm = (b->rows * pitch + more) * b->square_mm;
}

double sim_board_margin(const struct sst_sim_board *b)
{
    return b->kind == SST_SIM_APRILGRID ? b->marker * b->square_mm : b->square_mm / 2;
}

bool sim_board_white(const struct sst_sim_board *b, double x_mm, double y_mm, double *clear_mm)
{
    double width, height, x, y;
    bool white;

    sim_board_size(b, &width, &height);
    x = (x_mm + width / 2) / b->square_mm;
    y = (y_mm + height / 2) / b->square_mm;
    white = b->kind == SST_SIM_APRILGRID ? tags(b, x, y, clear_mm) : squares(b, x, y, clear_mm);
    *clear_mm *= b->square_mm;
    return white;
}

static float paint_board(const struct sst_scene_surface *s, const struct sst_scene_hit *h, struct sst_scene_rgb *out)
{
    double clear;

    *out = sim_board_white(s->own, h->t.x, h->t.y, &clear) ? s->mat.a : s->mat.b;
    return 1;
}

/* --- boards in worlds --------------------------------------------------------------------------------------------- */

/* Half of the free space beside the board in the picture, at a distance where a design pixel spans mm, so that the
 * outermost cameras still see most of the board. */
static double room(double picture, double mm, double board_mm, int cameras, double spacing_mm)
{
    return fmax(0, (picture * mm - 0.9 * board_mm - (cameras - 1) * spacing_mm) / 2);
}

#define NEAR_SHARE 0.52 /* of the picture's width, of the nearer layer of poses that fill the pictures ... */
#define FAR_SHARE  0.33 /* ... and of the farther one */
#define EDGE_SHARE 0.32 /* of the board's width: the outermost poses' middle is this far inside the picture */
#define TILT_DEG   27.0
#define JITTER_DEG 5.0
#define NEAR_LAYER 0.6 /* of the poses */

/* Poses first .. first+n-1 at one depth. */
struct layer {
    int first, n;
    double share; /* of the picture's width */
};

/* Poses of a layer, in a grid over all that the outermost cameras see. Tilts change from place to place: straight, then
 * to each side. */
static void fill_layer(struct sst_sim_board *b, struct layer layer, const struct sst_sim_settings *s,
                       const struct sst_scene_world *w, uint64_t *rng)
{
    const int n = layer.n;
    static const int tilt[5][2] = { { 0, 0 }, { 0, 1 }, { 1, 0 }, { 0, -1 }, { -1, 0 } };
    double width, height, x, y, z, mm;
    int cols, rows;

    if (!n)
        return;
    sim_board_size(b, &width, &height);
    z = w->focal * width / (layer.share * PICTURE_WIDTH);
    mm = z / w->focal;
    x = fmax(1, (PICTURE_WIDTH * mm + (s->cols - 1) * w->spacing_mm) / 2 - EDGE_SHARE * width);
    y = fmax(1, (PICTURE_HEIGHT * mm + (s->rows - 1) * w->spacing_mm) / 2 - EDGE_SHARE * height);
    cols = sst_clamp_int((int)lround(sqrt(n * x * height / (width * y))), 1, n);
    rows = sst_max_int(n / cols, 1);
    for (int i = 0; i < n; i++) {
        const int col = i % cols, row = i / cols;
        const int *to = tilt[(col + 2 * row) % 5];
        struct sst_sim_pose *p = &b->pose[layer.first + i];
        double at[2] = { cols > 1 ? 2.0 * col / (cols - 1) - 1 : 0, rows > 1 ? 2.0 * row / (rows - 1) - 1 : 0 };

        for (int c = 0; c < 2 && row >= rows; c++) /* rows that no grid needs */
            at[c] = sst_random_in(rng, -0.5, 0.5);
        p->position_mm[0] = at[0] * x + ((s->cols - 1) / 2.0 - (s->cols - 1) / 2) * w->spacing_mm;
        p->position_mm[1] = at[1] * y + ((s->rows - 1) / 2.0 - (s->rows - 1) / 2) * w->spacing_mm - w->shift * mm;
        p->position_mm[2] = z;
        p->rotation_deg[0] = to[0] * TILT_DEG + sst_random_in(rng, -JITTER_DEG, JITTER_DEG);
        p->rotation_deg[1] = to[1] * TILT_DEG + sst_random_in(rng, -JITTER_DEG, JITTER_DEG);
        p->rotation_deg[2] = sst_random_in(rng, -15, 15);
    }
}

void sim_board_seed_poses(struct sst_sim_board *b, const struct sst_sim_settings *s, const struct sst_scene_world *w)
{
    uint64_t rng = s->seed ^ 0x626F617264ull;
    double width, height;

    if (b->fill) {
        const int near = (int)ceil(NEAR_LAYER * b->poses);

        fill_layer(b, (struct layer){ 0, near, NEAR_SHARE }, s, w, &rng);
        fill_layer(b, (struct layer){ near, b->poses - near, FAR_SHARE }, s, w, &rng);
        return;
    }
    sim_board_size(b, &width, &height);
    for (int i = 0; i < b->poses; i++) {
        const double share = sst_random_in(&rng, 0.3, 0.55); /* board size over picture width */
        const double z = w->focal * width / (share * PICTURE_WIDTH), mm = z / w->focal;
        const double x = room(PICTURE_WIDTH, mm, width, s->cols, w->spacing_mm);
        const double y = room(PICTURE_HEIGHT, mm, height, s->rows, w->spacing_mm);
        struct sst_sim_pose *p = &b->pose[i];

        p->position_mm[0] = sst_random_in(&rng, -x, x) + ((s->cols - 1) / 2.0 - (s->cols - 1) / 2) * w->spacing_mm;
        p->position_mm[1] =
            sst_random_in(&rng, -y, y) + ((s->rows - 1) / 2.0 - (s->rows - 1) / 2) * w->spacing_mm - w->shift * mm;
        p->position_mm[2] = z;
        p->rotation_deg[0] = sst_random_in(&rng, -32, 32);
        p->rotation_deg[1] = sst_random_in(&rng, -32, 32);
        p->rotation_deg[2] = sst_random_in(&rng, -25, 25);
    }
}

void sim_board_add(struct sst_scene_world *w, const struct sst_sim_board *b, int pose)
{
    const double margin = sim_board_margin(b);
    const struct sst_sim_pose *p = &b->pose[pose];
    const struct sst_scene_material mat =
        material(paint_board, SST_SIM_BOARD_WHITE * 0x10101, SST_SIM_BOARD_BLACK * 0x10101, 0);
    double width, height, r[9];
    struct sst_scene_surface *s;

    sim_board_size(b, &width, &height);
    sim_rotation(p->rotation_deg, r);
    sst_scene_begin(w, SST_LABEL_POSTER, 0);
    w->tint = (struct sst_scene_rgb){ 1, 1, 1 };
    s = sst_scene_add_patch(w, vec3(p->position_mm[0], p->position_mm[1], p->position_mm[2]),
                            vec3_mul(vec3(r[0], r[3], r[6]), width / 2 + margin),
                            vec3_mul(vec3(r[1], r[4], r[7]), height / 2 + margin), mat);
    s->own = b;
    s->unlit = true;
    s->grain = 0;
}

double sim_board_wall_mm(double focal)
{
    return 4000 * fmax(1, focal / SST_SIM_BOARD_FOCAL);
}

void sim_board_room(struct sst_scene_world *w)
{
    const double floor_mm = SST_SIM_BOARD_FLOOR_MM, wall_mm = sim_board_wall_mm(w->focal);

    sst_scene_begin(w, SST_LABEL_BUILDING, 0);
    sst_scene_add_patch(w, vec3(0, floor_mm - 3000, wall_mm), vec3(9000, 0, 0), vec3(0, 3000, 0),
                        material(sst_scene_paint_fbm, 0x9a9a96, 0xb4b4ae, 500));
    sst_scene_begin(w, SST_LABEL_PAVEMENT, 0);
    sst_scene_add_floor(w, floor_mm, 300, wall_mm, material(sst_scene_paint_wood, 0x7a6a58, 0x94836e, 120));
}
