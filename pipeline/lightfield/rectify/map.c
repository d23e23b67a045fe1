/*
 * The map of one view: the exact chain at the corners of a grid of cells, cubic in between.
 *
 * Lens and homography are smooth: a cubic through four nodes h apart is off by at most 3/128 h^4 of their fourth
 * derivative, 1e-4 px for h = 32 and the lenses of ordinary cameras. The bound is verified: building compares each cell
 * with the chain where cubics err most (its centre and the midpoints of two edges), halves the cells until the worst
 * error is below TOLERANCE_PX, and uses the chain itself, pixel by pixel, for cells that never get there.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/border.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/place_patch.h"
#include "pipeline/lightfield/rectify/rectify_internal.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_SHIFT  5
#define LAST_SHIFT   2
#define TOLERANCE_PX (1.0 / 1024) /* positions are rounded to 1/512 px: 1/341 together */
#define SNAP_PX      (1.0 / 512)  /* positions nearer to the border than this are on it */
#define FAR_PX       1e6          /* positions beyond are invalid */
#define STRETCH_MAX  4096         /* px between two nodes: beyond, single precision inside a cell does not suffice */

enum cell {
    CELL_SMOOTH = 0, /* cubic */
    CELL_EXACT = 1,  /* by the chain */
    CELL_NONE = 2,   /* no pixel has a position in the raw picture */
};

static void chain_init(struct rectify_chain *chain, const struct sst_rectified *to, const struct sst_calib *calib,
                       int view)
{
    const struct sst_calib_camera *cam = &calib->camera[view];

    *chain = (struct rectify_chain){ .cam = *cam,
                                     .focal_px = to->focal_px * to->view[view].scale,
                                     .cx = to->cx,
                                     .cy = to->cy,
                                     .raw_width = calib->width,
                                     .raw_height = calib->height };
    sst_rotation_between(cam->rotation, to->rotation, chain->turn);
}

/* Position of rectified (x, y) in the raw picture or beyond its borders; false: behind the camera, or beyond the fold
 * of the lens. Beyond the fold a lens maps to the same pixels again: only points that undistortion returns to are
 * valid. */
static bool chain_place(const struct rectify_chain *chain, double x, double y, double *raw_x, double *raw_y)
{
    const double *m = chain->turn;
    const double a = (x - chain->cx) / chain->focal_px, b = (y - chain->cy) / chain->focal_px;
    const double p[3] = { m[0] * a + m[1] * b + m[2], m[3] * a + m[4] * b + m[5], m[6] * a + m[7] * b + m[8] };
    double u, v, back[2];

    if (!(p[2] > 1e-6 * (fabs(p[0]) + fabs(p[1]))))
        return false;
    sst_camera_distort(&chain->cam, p[0] / p[2], p[1] / p[2], &u, &v);
    if (!(fabs(u) < FAR_PX && fabs(v) < FAR_PX) || !sst_camera_undistort(&chain->cam, u, v, &back[0], &back[1]) ||
        !(fabs(back[0] - p[0] / p[2]) + fabs(back[1] - p[1] / p[2]) < 1e-6))
        return false;
    *raw_x = u;
    *raw_y = v;
    return true;
}

static bool in_picture(const struct rectify_chain *chain, double u, double v, double margin)
{
    return u >= -margin && v >= -margin && u <= chain->raw_width - 1 + margin && v <= chain->raw_height - 1 + margin;
}

bool sst_rectify_point(const struct sst_rectified *to, const struct sst_calib *calib, int view, const double at[2],
                       double raw[2])
{
    struct rectify_chain chain;
    double u, v;

    if (view < 0 || view >= to->rows * to->cols || !to->view[view].known)
        return false;
    chain_init(&chain, to, calib, view);
    if (!chain_place(&chain, at[0], at[1], &u, &v) || !in_picture(&chain, u, v, SNAP_PX))
        return false;
    raw[0] = u;
    raw[1] = v;
    return true;
}

/* --- cubics through nodes at -1, 0, 1, 2 -------------------------------------------------------------------------- */

static void node_weights(double t, double w[4])
{
    w[0] = -t * (t - 1) * (t - 2) / 6;
    w[1] = (t + 1) * (t - 1) * (t - 2) / 2;
    w[2] = -(t + 1) * t * (t - 2) / 2;
    w[3] = (t + 1) * t * (t - 1) / 6;
}

static const double *node_at(const struct sst_rectify_map *map, int i, int j)
{
    return map->node[(size_t)(j + 1) * (size_t)(map->cells_x + 3) + (size_t)(i + 1)];
}

/* Nodes i .. i + 3 of the line between node rows j and j + 1 at which the weights are w. */
struct line {
    double w[4], p[4][2];
    int j, i; /* i: INT_MIN before the first line_move() */
};

static void line_init(struct line *line, int j, double t)
{
    line->j = j;
    line->i = INT_MIN;
    node_weights(t, line->w);
}

static void line_node(const struct sst_rectify_map *map, const struct line *line, int i, double p[2])
{
    for (int axis = 0; axis < 2; axis++) {
        p[axis] = 0;
        for (int m = 0; m < 4; m++)
            p[axis] += line->w[m] * node_at(map, i, line->j - 1 + m)[axis];
    }
}

/* One node is new where i is the next one. */
static void line_move(const struct sst_rectify_map *map, struct line *line, int i)
{
    const bool next = line->i != INT_MIN && i == line->i + 1;

    if (next)
        memmove(line->p[0], line->p[1], 3 * sizeof(line->p[0]));
    for (int l = next ? 3 : 0; l < 4; l++)
        line_node(map, line, i + l, line->p[l]);
    line->i = i;
}

/* --- building ----------------------------------------------------------------------------------------------------- */

/* Largest error of a smooth cell inside the picture; INFINITY: the chain has no position where the cubic has one. */
static double cell_error(const struct sst_rectify_map *map, int i, int j)
{
    static const double at[3][2] = { { 0.5, 0.5 }, { 0.5, 0 }, { 0, 0.5 } };
    const double side = 1 << map->shift;
    double worst = 0;

    for (int k = 0; k < 3; k++) {
        double wx[4], u, v, du, dv;
        struct line line;

        node_weights(at[k][0], wx);
        line_init(&line, j, at[k][1]);
        line_move(map, &line, i - 1);
        if (!chain_place(&map->chain, (i + at[k][0]) * side, (j + at[k][1]) * side, &u, &v))
            return INFINITY;
        if (!in_picture(&map->chain, u, v, side))
            continue;
        du = wx[0] * line.p[0][0] + wx[1] * line.p[1][0] + wx[2] * line.p[2][0] + wx[3] * line.p[3][0] - u;
        dv = wx[0] * line.p[0][1] + wx[1] * line.p[1][1] + wx[2] * line.p[2][1] + wx[3] * line.p[3][1] - v;
        worst = fmax(worst, hypot(du, dv));
    }
    return worst;
}

/* Classify a cell by the 16 surrounding nodes. */
static enum cell classify(const struct sst_rectify_map *map, const bool *seen, int i, int j)
{
    const size_t row = (size_t)(map->cells_x + 3);
    int all = 0, corners = 0;

    for (int m = 0; m < 4; m++) {
        for (int l = 0; l < 4; l++) {
            const bool is = seen[(size_t)(j + m) * row + (size_t)(i + l)];

            all += is;
            corners += is && m > 0 && m < 3 && l > 0 && l < 3;
        }
    }
    if (!corners)
        return CELL_NONE;
    for (int l = 0; all == 16 && l < 16; l++) {
        const double *from = node_at(map, i - 1 + l % 4, j - 1 + l / 4), *here = node_at(map, i, j);

        if (fmax(fabs(from[0] - here[0]), fabs(from[1] - here[1])) > STRETCH_MAX)
            all = 0;
    }
    return all == 16 ? CELL_SMOOTH : CELL_EXACT;
}

/* Build nodes and cells for the current shift. @return 0, -ENOMEM, or -ERANGE: smaller cells are needed */
static int make_cells(struct sst_rectify_map *map)
{
    const int side = 1 << map->shift;
    size_t nodes;
    bool *seen;

    map->cells_x = (map->width + side - 1) / side;
    map->cells_y = (map->height + side - 1) / side;
    nodes = (size_t)(map->cells_x + 3) * (size_t)(map->cells_y + 3);
    free(map->node);
    free(map->cell);
    map->node = calloc(nodes, sizeof(*map->node));
    map->cell = calloc((size_t)map->cells_x, (size_t)map->cells_y);
    seen = calloc(nodes, sizeof(*seen));
    if (!map->node || !map->cell || !seen) {
        free(seen);
        return -ENOMEM;
    }
    for (size_t k = 0; k < nodes; k++) {
        const int i = (int)(k % (size_t)(map->cells_x + 3)) - 1, j = (int)(k / (size_t)(map->cells_x + 3)) - 1;

        seen[k] = chain_place(&map->chain, i * side, j * side, &map->node[k][0], &map->node[k][1]);
    }
    for (int j = 0; j < map->cells_y; j++) {
        for (int i = 0; i < map->cells_x; i++) {
            enum cell kind = classify(map, seen, i, j);
            const double error = kind == CELL_SMOOTH ? cell_error(map, i, j) : 0;

            if (error > TOLERANCE_PX && isfinite(error) && map->shift > LAST_SHIFT) {
                free(seen);
                return -ERANGE;
            }
            if (error > TOLERANCE_PX)
                kind = CELL_EXACT;
            map->cell[(size_t)j * (size_t)map->cells_x + (size_t)i] = (uint8_t)kind;
        }
    }
    free(seen);
    return 0;
}

/* Source of the map, and its places where it is smooth: elsewhere, pixels behind the camera have no place. */
static void check_border(const struct sst_rectify_map *map, const struct sst_rectified *to,
                         const struct sst_calib_camera *c, int view)
{
    const double places[] = { c->fx, c->fy, c->cx, c->cy, to->focal_px, to->cx, to->cy, to->view[view].scale };

    sst_border_doubles("geometry of a rectified view", places, ARRAY_LEN(places));
    sst_border_doubles("lens of a rectified view", c->k, (size_t)c->lens);
    sst_border_doubles("rotation of a rectified view", c->rotation, 9);
    sst_border_doubles("gains of a rectified view", c->gain, 3);
    sst_border_doubles("fall-off of a rectified view", c->falloff, 3);
    for (int j = 0; j < map->cells_y; j++) {
        for (int i = 0; i < map->cells_x; i++) {
            if (map->cell[(size_t)j * (size_t)map->cells_x + (size_t)i] == CELL_SMOOTH)
                sst_border_doubles("map of a rectified view", node_at(map, i, j), 2);
        }
    }
}

int sst_rectify_map_create(struct sst_rectify_map **out, const struct sst_rectified *to, const struct sst_calib *calib,
                           int view)
{
    struct sst_rectify_map *map;
    int err;

    if (view < 0 || view >= to->rows * to->cols || to->rows != calib->rows || to->cols != calib->cols ||
        !to->view[view].known || !calib->camera[view].known)
        return -EINVAL;
    map = calloc(1, sizeof(*map));
    if (!map)
        return -ENOMEM;
    chain_init(&map->chain, to, calib, view);
    map->width = to->width;
    map->height = to->height;
    map->shift = FIRST_SHIFT;
    while ((err = make_cells(map)) == -ERANGE)
        map->shift--;
    err = err ? err : gain_map_create(&map->light, to, calib, view);
    if (err) {
        sst_rectify_map_destroy(map);
        return err;
    }
    check_border(map, to, &calib->camera[view], view);
    *out = map;
    return 0;
}

void sst_rectify_map_destroy(struct sst_rectify_map *map)
{
    if (!map)
        return;
    gain_map_destroy(map->light);
    free(map->node);
    free(map->cell);
    free(map);
}

/* --- rows --------------------------------------------------------------------------------------------------------- */

/* One axis of a smooth cell; k counts pixels from the cell's left edge. @param per_px  1 over a cell's side */
static void set_cubic(struct sst_places *places, const struct line *line, int axis, double per_px)
{
    const double a = line->p[0][axis], b = line->p[1][axis], c = line->p[2][axis], d = line->p[3][axis],
                 whole = floor(b);
    float *to = places->c[axis];

    places->whole_q8[axis] = (int32_t)whole * 256;
    to[0] = (float)((b - whole) * 256);
    to[1] = (float)((c - b / 2 - (2 * a + d) * (1.0 / 6)) * 256 * per_px);
    to[2] = (float)(((a + c) / 2 - b) * 256 * (per_px * per_px));
    to[3] = (float)(((b - c) / 2 + (d - a) * (1.0 / 6)) * 256 * (per_px * per_px * per_px));
}

static void smooth_run(const struct sst_rectify_map *map, const struct line *line, float k0, int n, int32_t *xy_q8)
{
    struct sst_places places = { .most = { 256 * (map->chain.raw_width - 1), 256 * (map->chain.raw_height - 1) } };

    for (int axis = 0; axis < 2; axis++)
        set_cubic(&places, line, axis, 1.0 / (1 << map->shift));
    sst_kernels_get()->place_row(xy_q8, &places, k0, (size_t)n);
}

static void exact_run(const struct sst_rectify_map *map, double x0, double y, int n, int32_t *xy_q8)
{
    for (int i = 0; i < n; i++) {
        double u, v;

        xy_q8[2 * i] = xy_q8[2 * i + 1] = INT32_MIN;
        if (!chain_place(&map->chain, x0 + i, y, &u, &v) || !in_picture(&map->chain, u, v, SNAP_PX))
            continue;
        xy_q8[2 * i] = sst_clamp_int((int)lrint(u * 256), 0, 256 * (map->chain.raw_width - 1));
        xy_q8[2 * i + 1] = sst_clamp_int((int)lrint(v * 256), 0, 256 * (map->chain.raw_height - 1));
    }
}

void sst_rectify_map_row(const struct sst_rectify_map *map, double x0, double y, int n, int32_t *xy_q8)
{
    const double side = 1 << map->shift;
    const int j = sst_clamp_int((int)floor(y / side), 0, map->cells_y - 1);
    struct line line;

    line_init(&line, j, y / side - j);
    for (int done = 0; done < n;) {
        const int i = sst_clamp_int((int)floor((x0 + done) / side), 0, map->cells_x - 1);
        const int to_edge = (int)ceil((i + 1) * side - x0), end = i + 1 < map->cells_x ? sst_min_int(n, to_edge) : n;
        int32_t *out = xy_q8 + 2 * (size_t)done;

        switch (map->cell[(size_t)j * (size_t)map->cells_x + (size_t)i]) {
        case CELL_SMOOTH:
            line_move(map, &line, i - 1);
            smooth_run(map, &line, (float)(x0 + done - i * side), end - done, out);
            break;
        case CELL_EXACT:
            exact_run(map, x0 + done, y, end - done, out);
            break;
        default:
            for (int k = 0; k < 2 * (end - done); k++)
                out[k] = INT32_MIN;
        }
        done = end;
    }
}

/* --- tables for a device ------------------------------------------------------------------------------------------ */

void sst_rectify_map_tables(struct sst_rectify_tables *out, const struct sst_rectify_map *map, enum sst_filter filter)
{
    *out = (struct sst_rectify_tables){ .width = map->width,
                                        .height = map->height,
                                        .raw_width = map->chain.raw_width,
                                        .raw_height = map->chain.raw_height,
                                        .cell_shift = map->shift,
                                        .cells = map->cells_x,
                                        .cell_rows = map->cells_y };
    out->weight = filter_weights(filter, &out->taps);
    if (map->light)
        gain_map_tables(map->light, out);
}

/* Room for n more places. */
static int reserve(struct sst_rectify_list *list, int n)
{
    const size_t needed = list->count + (size_t)n;
    int32_t *more;

    if (needed <= list->room)
        return 0;
    more = realloc(list->xy, 4 * needed * sizeof(*more));
    if (!more)
        return -ENOMEM;
    list->xy = more;
    list->room = 2 * needed;
    return 0;
}

/* Append the exact places of n columns. */
static int list_exact(const struct sst_rectify_map *map, double x0, double y, int n, struct sst_rectify_list *list)
{
    if (reserve(list, n))
        return -ENOMEM;
    exact_run(map, x0, y, n, list->xy + 2 * list->count);
    list->count += (size_t)n;
    return 0;
}

int sst_rectify_map_cells(const struct sst_rectify_map *map, double x0, double y, struct sst_places *cells,
                          struct sst_rectify_list *list)
{
    const int side = 1 << map->shift, j = sst_clamp_int((int)floor(y / side), 0, map->cells_y - 1);
    const uint8_t *kind = map->cell + (size_t)j * (size_t)map->cells_x;
    struct line line;
    int err = 0;

    line_init(&line, j, y / side - (double)j);
    for (int i = 0; i < map->cells_x && !err; i++) {
        struct sst_places places = { .most = { 256 * (map->chain.raw_width - 1), 256 * (map->chain.raw_height - 1) } };

        if (kind[i] == CELL_SMOOTH) {
            line_move(map, &line, i - 1);
            for (int axis = 0; axis < 2; axis++)
                set_cubic(&places, &line, axis, 1.0 / side);
        } else if (kind[i] == CELL_EXACT) {
            places.most[0] = SST_PLACES_LISTED;
            places.whole_q8[0] = (int32_t)list->count;
            err = list_exact(map, x0 + i * side, y, sst_min_int(side, map->width - i * side), list);
        } else {
            places.most[0] = SST_PLACES_NONE;
        }
        cells[i] = places;
    }
    return err;
}

/* Coefficients of the cubic through nodes at -1, 0, 1, 2: of each node by power, as in node_weights(). */
static const double by_power[4][4] = { { 0, -1.0 / 3, 1.0 / 2, -1.0 / 6 },
                                       { 1, -1.0 / 2, -1, 1.0 / 2 },
                                       { 0, 1, 1.0 / 2, -1.0 / 2 },
                                       { 0, -1.0 / 6, 0, 1.0 / 6 } };

/* One axis of a smooth cell. */
static void set_bicubic(struct sst_place_patch *patch, const struct sst_rectify_map *map, int i, int j, int axis)
{
    const double whole = floor(node_at(map, i, j)[axis]);

    patch->whole_q8[axis] = (int32_t)whole * 256;
    for (int across = 0; across < 4; across++) {
        for (int down = 0; down < 4; down++) {
            double sum = 0;

            for (int node = 0; node < 16; node++)
                sum += by_power[node % 4][across] * by_power[node / 4][down] *
                       (node_at(map, i - 1 + node % 4, j - 1 + node / 4)[axis] - whole);
            patch->c[axis][across][down] = (float)ldexp(sum * 256, -map->shift * (across + down));
        }
    }
}

/* Append the exact places of a cell's whole positions, its end included. */
static int list_corners(const struct sst_rectify_map *map, int i, int j, struct sst_rectify_list *list)
{
    const int side = 1 << map->shift;

    if (reserve(list, (side + 1) * (side + 1)))
        return -ENOMEM;
    for (int y = j * side; y <= (j + 1) * side; y++) {
        for (int x = i * side; x <= (i + 1) * side; x++) {
            int32_t *to = list->xy + 2 * list->count++;
            double u, v;

            to[0] = to[1] = INT32_MIN;
            if (!chain_place(&map->chain, x, y, &u, &v) || fmax(fabs(u), fabs(v)) > SST_PATCH_FAR_PX)
                continue;
            to[0] = (int32_t)lrint(u * (1 << SST_PATCH_LISTED_BITS));
            to[1] = (int32_t)lrint(v * (1 << SST_PATCH_LISTED_BITS));
        }
    }
    return 0;
}

int sst_rectify_map_patches(const struct sst_rectify_map *map, struct sst_place_patch *patches,
                            struct sst_rectify_list *list)
{
    int err = 0;

    for (int cell = 0; cell < map->cells_x * map->cells_y && !err; cell++) {
        const int i = cell % map->cells_x, j = cell / map->cells_x;
        struct sst_place_patch patch = { .kind = SST_PLACES_NONE };

        if (map->cell[cell] == CELL_SMOOTH) {
            patch.kind = 0;
            for (int axis = 0; axis < 2; axis++)
                set_bicubic(&patch, map, i, j, axis);
        } else if (map->cell[cell] == CELL_EXACT) {
            patch.kind = SST_PLACES_LISTED;
            patch.whole_q8[0] = (int32_t)list->count;
            err = list_corners(map, i, j, list);
        }
        patches[cell] = patch;
    }
    return err;
}
