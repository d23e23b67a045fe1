/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/rectify/rectify_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"

#define CELLS      48 /* minimum across the longer side */
#define FACTOR_MAX 8.0
#define SRGB_POWER (1 / 2.4)

/* Nodes every `step` pixels, the last ones on or beyond the last pixel. */
struct gain_map {
    int step, cols, rows;
    float gain[3], gain_root[3];
    float *falloff, *root; /* [rows][cols], one allocation */
};

/* 1 / light, clamped to the limits even for an implausible calibration. */
static double factor_for(double light)
{
    return 1 / sst_clamp_double(light, 1 / FACTOR_MAX, FACTOR_MAX);
}

/* Light at a position of the raw picture relative to that at the principal point. Outside the picture the polynomial
 * is invalid: the value of the farthest corner is used. */
static double falloff_at(const struct sst_calib *calib, const struct sst_calib_camera *cam, double x, double y)
{
    const double far_x = fmax(cam->cx, calib->width - 1 - cam->cx), far_y = fmax(cam->cy, calib->height - 1 - cam->cy);
    const double half2 = 0.25 * ((double)calib->width * calib->width + (double)calib->height * calib->height);
    const double dx = x - cam->cx, dy = y - cam->cy, most = (far_x * far_x + far_y * far_y) / half2;
    const double r2 = fmin((dx * dx + dy * dy) / half2, most);

    return 1 + r2 * (cam->falloff[0] + r2 * (cam->falloff[1] + r2 * cam->falloff[2]));
}

/* Extrapolate a node without a position in the raw picture from the next two on one side; 0 if there are none. */
static float extend(const float *grid, int cols, int rows, int x, int y)
{
    static const int side[4][2] = { { 1, 0 }, { -1, 0 }, { 0, 1 }, { 0, -1 } };
    float sum = 0;
    int n = 0;

    for (int i = 0; i < 4; i++) {
        const int x1 = x + side[i][0], y1 = y + side[i][1], x2 = x1 + side[i][0], y2 = y1 + side[i][1];

        if (x2 < 0 || y2 < 0 || x2 >= cols || y2 >= rows || !(grid[y1 * cols + x1] > 0) || !(grid[y2 * cols + x2] > 0))
            continue;
        sum += (float)sst_clamp_double(2 * grid[y1 * cols + x1] - grid[y2 * cols + x2], 1 / FACTOR_MAX, FACTOR_MAX);
        n++;
    }
    return n ? sum / (float)n : 0;
}

/* Pixels near the picture's edge lie between nodes inside and outside of it: the outer ones are extrapolated ring by
 * ring. @param next  scratch [rows][cols] */
static void fill(float *grid, float *next, int cols, int rows)
{
    int found = 1;

    while (found) {
        found = 0;
        for (int i = 0; i < cols * rows; i++) {
            next[i] = grid[i] > 0 ? 0 : extend(grid, cols, rows, i % cols, i / cols);
            found += next[i] > 0;
        }
        for (int i = 0; i < cols * rows; i++)
            grid[i] = next[i] > 0 ? next[i] : grid[i];
    }
    for (int i = 0; i < cols * rows; i++)
        grid[i] = grid[i] > 0 ? grid[i] : 1;
}

static bool is_neutral(const struct sst_calib_camera *cam)
{
    for (int i = 0; i < 3; i++) {
        if (cam->gain[i] != 1 || cam->falloff[i] != 0)
            return false;
    }
    return true;
}

int gain_map_create(struct gain_map **out, const struct sst_rectified *to, const struct sst_calib *calib, int view)
{
    const struct sst_calib_camera *cam = &calib->camera[view];
    const int longer = sst_max_int(to->width, to->height);
    struct gain_map *m;
    int step = 1, nodes;

    if (is_neutral(cam)) {
        *out = NULL;
        return 0;
    }
    m = calloc(1, sizeof(*m));
    if (!m)
        return -ENOMEM;
    while (2 * step * CELLS <= longer)
        step *= 2;
    m->step = step;
    m->cols = (to->width + step - 1) / step + 1;
    m->rows = (to->height + step - 1) / step + 1;
    nodes = m->cols * m->rows;
    m->falloff = sst_mem_alloc(2 * (size_t)nodes, sizeof(float));
    if (!m->falloff) {
        free(m);
        return -ENOMEM;
    }
    m->root = m->falloff + nodes;
    for (int i = 0; i < nodes; i++) {
        const double at[2] = { i % m->cols * step, i / m->cols * step };
        double raw[2];

        if (sst_rectify_point(to, calib, view, at, raw))
            m->falloff[i] = (float)factor_for(falloff_at(calib, cam, raw[0], raw[1]));
    }
    fill(m->falloff, m->root, m->cols, m->rows);
    for (int i = 0; i < nodes; i++)
        m->root[i] = (float)pow(m->falloff[i], SRGB_POWER);
    for (int c = 0; c < 3; c++) {
        m->gain[c] = (float)factor_for(cam->gain[c]);
        m->gain_root[c] = (float)pow(m->gain[c], SRGB_POWER);
    }
    *out = m;
    return 0;
}

void gain_map_destroy(struct gain_map *map)
{
    if (!map)
        return;
    sst_mem_free(map->falloff);
    free(map);
}

/* Straight lines between the nodes of one grid at y, from x0 on: cell by cell, whole ones eight values at a time. */
static void interpolate(const struct gain_map *m, const float *grid, const struct sst_rectified_row *to, float *out)
{
    const double x0 = to->x0, at = sst_clamp_double(to->y / m->step, 0, m->rows - 1);
    const int n = to->n, before = (int)floor(x0);
    const int row = sst_min_int((int)at, m->rows - 2), first = sst_clamp_int((int)(x0 / m->step), 0, m->cols - 2);
    const float down = (float)(at - row), per_px = 1.0f / (float)m->step;
    const float *node = grid + row * m->cols + first;
    float right = node[0] + down * (node[m->cols] - node[0]);
    int i = 0;

    for (int col = first; i < n; col++, node++) {
        const int end = col >= m->cols - 2 ? n : sst_min_int(n, (col + 1) * m->step - before);
        const float left = right;
        float into = (float)(x0 + i - (double)col * m->step), slope;

        right = node[1] + down * (node[m->cols + 1] - node[1]);
        slope = (right - left) * per_px;
        for (; i + 8 <= end; i += 8, into += 8) {
            for (int k = 0; k < 8; k++)
                out[i + k] = left + slope * (into + (float)k);
        }
        for (int k = 0; i < end; i++, k++)
            out[i] = left + slope * (into + (float)k);
    }
}

void gain_map_row(const struct gain_map *map, const struct sst_rectified_row *row, float *scratch,
                  struct gain_factors *out)
{
    interpolate(map, map->falloff, row, scratch);
    interpolate(map, map->root, row, scratch + row->n);
    out->falloff = scratch;
    out->falloff_root = scratch + row->n;
    for (int c = 0; c < 3; c++) {
        out->gain[c] = map->gain[c];
        out->gain_root[c] = map->gain_root[c];
    }
}

void gain_map_tables(const struct gain_map *map, struct sst_rectify_tables *out)
{
    out->light_shift = __builtin_ctz((unsigned)map->step);
    out->light_cols = map->cols;
    out->light_rows = map->rows;
    out->falloff = map->falloff;
    out->falloff_root = map->root;
    memcpy(out->gain, map->gain, sizeof(out->gain));
    memcpy(out->gain_root, map->gain_root, sizeof(out->gain_root));
}
