/* Chessboards: detected by OpenCV, then renumbered to our convention. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/calibration/board/board_internal.h"

/* Corners row by row. */
struct grid {
    int cols, rows;
    float (*at)[2];
};

static const float *corner(const struct grid *g, int i, int j)
{
    return g->at[j * g->cols + i];
}

static void swap(float a[2], float b[2])
{
    const float x = a[0], y = a[1];

    a[0] = b[0];
    a[1] = b[1];
    b[0] = x;
    b[1] = y;
}

static void reverse(float (*at)[2], int n)
{
    for (int i = 0; i < n / 2; i++)
        swap(at[i], at[n - 1 - i]);
}

/* Rotate a square grid by a quarter turn: the last column, read upwards, becomes the first row. */
static void rotate_quarter(struct grid *g)
{
    for (int j = 0; j < g->rows; j++) {
        for (int i = 0; i < j; i++)
            swap(g->at[j * g->cols + i], g->at[i * g->cols + j]);
    }
    for (int j = 0; j < g->rows; j++)
        reverse(g->at + j * g->cols, g->cols);
}

/* Mean grey of the squares with an even column + row, minus the others'. */
static double even_brighter(const struct grid *g, const struct sst_map_u8 *luma)
{
    double sum[2] = { 0, 0 }, n[2] = { 0, 0 };

    for (int j = 0; j + 1 < g->rows; j++) {
        for (int i = 0; i + 1 < g->cols; i++) {
            const float *a = corner(g, i, j), *b = corner(g, i + 1, j + 1), *c = corner(g, i + 1, j),
                        *d = corner(g, i, j + 1);
            const int x = (int)lround((a[0] + b[0] + c[0] + d[0]) / 4.0);
            const int y = (int)lround((a[1] + b[1] + c[1] + d[1]) / 4.0);

            sum[(i + j) % 2] +=
                sst_map_u8_row(luma, sst_clamp_int(y, 0, luma->height - 1))[sst_clamp_int(x, 0, luma->width - 1)];
            n[(i + j) % 2]++;
        }
    }
    return sum[0] / fmax(n[0], 1) - sum[1] / fmax(n[1], 1);
}

/* Direction of the board's x in the picture, rad. */
static double heading(const struct grid *g)
{
    double x = 0, y = 0;

    for (int j = 0; j < g->rows; j++) {
        x += corner(g, g->cols - 1, j)[0] - corner(g, 0, j)[0];
        y += corner(g, g->cols - 1, j)[1] - corner(g, 0, j)[1];
    }
    return atan2(y, x);
}

/*
 * Renumber to our convention: not mirrored, a black square at the upper left where the board has one; among equivalent
 * rotations the one with the x axis most to the right. @return true: the upper left square is white nevertheless
 */
static bool normalise_order(struct grid *g, const struct sst_map_u8 *luma)
{
    const float *a = corner(g, 0, 0), *b = corner(g, 1, 0), *c = corner(g, 0, 1);
    const bool square = g->cols == g->rows;
    int ways;

    if ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0) {
        for (int j = 0; j < g->rows; j++)
            reverse(g->at + j * g->cols, g->cols);
    }
    if (even_brighter(g, luma) > 0) {
        if ((g->cols + g->rows) % 2)
            reverse(g->at, g->cols * g->rows);
        else if (square && g->cols % 2)
            rotate_quarter(g);
    }
    ways = sst_chessboard_ways(g->cols, g->rows);
    for (int k = 1; k < ways && fabs(heading(g)) > M_PI / ways; k++) {
        if (ways == 4)
            rotate_quarter(g);
        else
            reverse(g->at, g->cols * g->rows);
    }
    return even_brighter(g, luma) > 0;
}

static int store_corners(struct sighting *s, const struct grid *g, double scale)
{
    const int n = g->cols * g->rows;

    s->anchor = malloc((size_t)n * sizeof(*s->anchor));
    if (!s->anchor)
        return -ENOMEM;
    s->anchors = n;
    for (int i = 0; i < n; i++) {
        sst_board_point(s->board, i, s->anchor[i].board);
        for (int axis = 0; axis < 2; axis++)
            s->anchor[i].px[axis] = scale * (g->at[i][axis] + 0.5) - 0.5;
        s->anchor[i].weight = 0.1;
    }
    return 1;
}

static int find_at(struct sighting *s, struct grid *g, const struct sst_map_u8 *luma, double scale, bool thorough)
{
    const int r = cv_chessboard(g->at, luma, g->cols, g->rows, thorough);

    if (r <= 0)
        return r;
    s->other = normalise_order(g, luma);
    return store_corners(s, g, scale);
}

int find_chessboard(struct sighting *s, bool quick)
{
    struct grid g = { s->board->cols - 1, s->board->rows - 1, NULL };
    struct pyramid p;
    int r = pyramid_init(&p, s->luma);

    if (r)
        return r;
    g.at = malloc((size_t)sst_board_points(s->board) * sizeof(*g.at));
    if (!g.at)
        r = -ENOMEM;
    for (int n = p.levels - 1; n >= 0 && !r; n--) {
        r = find_at(s, &g, p.level[n], 1 << n, false);
        if (quick)
            break;
    }
    if (!r && !quick) /* in a large picture this would take seconds */
        r = find_at(s, &g, p.level[p.levels - 1], 1 << (p.levels - 1), true);
    pyramid_fini(&p);
    free(g.at);
    return r;
}
