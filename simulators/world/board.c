#include "simulators/world/board.h"

#include "pipeline/labels/classes.h"
#include "simulators/world/camera.h"

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

/* --- paints: of a patch that is the pattern and its margin; scale_mm is the side of a square or tag, k the marker - */

static float paint_bit(const struct sst_surface *s, bool white, struct sst_rgb *out)
{
    *out = white ? s->mat.a : s->mat.b;
    return 1;
}

/* Module at (x, y), 0..1 each from the marker's upper left: the border is black. */
static bool module(uint64_t bits, int modules, int border, double x, double y)
{
    const int side = modules + 2 * border;
    const int column = (int)(x * side) - border, row = (int)(y * side) - border;

    if (column < 0 || row < 0 || column >= modules || row >= modules)
        return false;
    return bits >> (modules * modules - 1 - row * modules - column) & 1;
}

/* Squares across the pattern, whose margin is half of one on each side. */
static int squares(struct sst_vec3 half_axis, double square_mm)
{
    return (int)lround(2 * sqrt(sst_dot(half_axis, half_axis)) / square_mm) - 1;
}

static float paint_squares(const struct sst_surface *s, const struct sst_hit *h, struct sst_rgb *out)
{
    const int cols = squares(s->u, s->mat.scale_mm), rows = squares(s->v, s->mat.scale_mm);
    const double x = h->t.x / s->mat.scale_mm + cols / 2.0, y = h->t.y / s->mat.scale_mm + rows / 2.0;
    const int column = (int)floor(x), row = (int)floor(y);
    const bool inside = column >= 0 && row >= 0 && column < cols && row < rows;
    double u, v;
    int id;

    if (!inside || !((column + row) & 1))
        return paint_bit(s, !inside, out);
    if (!(s->mat.k > 0))
        return paint_bit(s, true, out);
    u = (x - column - 0.5) / s->mat.k + 0.5;
    v = (y - row - 0.5) / s->mat.k + 0.5;
    if (u < 0 || v < 0 || u >= 1 || v >= 1)
        return paint_bit(s, true, out);
    /* White squares before this one: of two rows together there are cols, the first of them has cols / 2. */
    id = row / 2 * cols + (row & 1) * (cols / 2) + column / 2;
    return paint_bit(s, module(charuco_marker[id], CHARUCO_MODULES, 1, u, v), out);
}

static float paint_tags(const struct sst_surface *s, const struct sst_hit *h, struct sst_rgb *out)
{
    const double tag = s->mat.scale_mm, gap = s->mat.k, pitch = 1 + gap;
    const double width = 2 * sqrt(sst_dot(s->u, s->u)) / tag - 2 * gap;
    const double height = 2 * sqrt(sst_dot(s->v, s->v)) / tag - 2 * gap;
    const int cols = (int)lround((width - gap) / pitch), rows = (int)lround((height - gap) / pitch);
    const double x = h->t.x / tag + width / 2, y = h->t.y / tag + height / 2;
    const int column = (int)floor(x / pitch), row = (int)floor(y / pitch);
    const double u = x - column * pitch, v = y - row * pitch; /* first the gap, then the tag */

    if (x < 0 || y < 0 || x >= width || y >= height)
        return paint_bit(s, true, out);
    if (u < gap || v < gap)
        return paint_bit(s, !(u < gap && v < gap), out);
    if (column >= cols || row >= rows)
        return paint_bit(s, true, out);
    return paint_bit(s, module(april_tag[row * cols + column], APRIL_MODULES, APRIL_BORDER, u - gap, v - gap), out);
}

/* --- boards in worlds -------------------------------------------------------------------------------------------- */

void sst_sim_board_size(const struct sst_sim_board *b, double *width_mm, double *height_mm)
{
    const double pitch = b->kind == SST_SIM_APRILGRID ? 1 + b->marker : 1;
    const double more = b->kind == SST_SIM_APRILGRID ? b->marker : 0;

    *width_mm = (b->cols * pitch + more) * b->square_mm;
    *height_mm = (b->rows * pitch + more) * b->square_mm;
}

/* Half of what is left of the picture beside the board, at a distance where a design pixel spans mm, so that the
 * outermost cameras still see most of it. */
static double room(double picture, double mm, double board_mm, int cameras, double spacing_mm)
{
    return fmax(0, (picture * mm - 0.9 * board_mm - (cameras - 1) * spacing_mm) / 2);
}

void sst_sim_board_seed_poses(struct sst_sim_board *b, const struct sst_sim_settings *s, const struct sst_world *w)
{
    uint64_t rng = s->seed ^ 0x626F617264ull;
    double width, height;

    sst_sim_board_size(b, &width, &height);
    for (int i = 0; i < b->poses; i++) {
        const double share = sst_random_in(&rng, 0.3, 0.55); /* of the picture's width */
        const double z = w->focal * width / (share * PICTURE_WIDTH), mm = z / w->focal;
        const double x = room(PICTURE_WIDTH, mm, width, s->cols, w->spacing_mm);
        const double y = room(PICTURE_HEIGHT, mm, height, s->rows, w->spacing_mm);
        struct sst_sim_pose *p = &b->pose[i];

        p->position_mm[0] = sst_random_in(&rng, -x, x) + ((s->cols - 1) / 2.0 - (s->cols - 1) / 2) * w->spacing_mm;
        p->position_mm[1] = sst_random_in(&rng, -y, y) + ((s->rows - 1) / 2.0 - (s->rows - 1) / 2) * w->spacing_mm;
        p->position_mm[2] = z;
        p->rotation_deg[0] = sst_random_in(&rng, -32, 32);
        p->rotation_deg[1] = sst_random_in(&rng, -32, 32);
        p->rotation_deg[2] = sst_random_in(&rng, -25, 25);
    }
}

void sst_sim_board_add(struct sst_world *w, const struct sst_sim_board *b, int pose)
{
    const bool tags = b->kind == SST_SIM_APRILGRID;
    const double margin = tags ? b->marker * b->square_mm : b->square_mm / 2;
    const struct sst_sim_pose *p = &b->pose[pose];
    struct sst_material mat = sst_mat(tags ? paint_tags : paint_squares, 0xECECEC, 0x141414, b->square_mm);
    double width, height, r[9];
    struct sst_surface *s;

    mat.k = b->kind == SST_SIM_CHESSBOARD ? 0 : b->marker;
    sst_sim_board_size(b, &width, &height);
    sst_sim_rotation(p->rotation_deg, r);
    sst_begin(w, SST_LABEL_POSTER, 0);
    w->tint = (struct sst_rgb){ 1, 1, 1 };
    s = sst_add_patch(w, sst_v(p->position_mm[0], p->position_mm[1], p->position_mm[2]),
                      sst_mul(sst_v(r[0], r[3], r[6]), width / 2 + margin),
                      sst_mul(sst_v(r[1], r[4], r[7]), height / 2 + margin), mat);
    s->unlit = true;
    s->grain = 0;
}

void sst_sim_board_backdrop(struct sst_world *w)
{
    const double floor_mm = 900, wall_mm = 4000;

    w->focal = 1200;
    w->spacing_mm = 60;
    sst_begin(w, SST_LABEL_BUILDING, 0);
    sst_add_patch(w, sst_v(0, floor_mm - 3000, wall_mm), sst_v(9000, 0, 0), sst_v(0, 3000, 0),
                  sst_mat(sst_paint_fbm, 0x9a9a96, 0xb4b4ae, 500));
    sst_begin(w, SST_LABEL_PAVEMENT, 0);
    sst_add_floor(w, floor_mm, 300, wall_mm, sst_mat(sst_paint_wood, 0x7a6a58, 0x94836e, 120));
}
