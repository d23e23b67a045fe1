/* List of all detections of a capture: sorted, chessboards numbered consistently within a frame. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/calibration/board/detect.h"

int sst_detections_init(struct sst_detections *all, const struct sst_detections *form)
{
    const int rows = form->rows, cols = form->cols, width = form->width, height = form->height;

    if (rows < 1 || cols < 1 || rows > SST_MAX_VIEWS || cols > SST_MAX_VIEWS || rows * cols > SST_MAX_VIEWS ||
        width < 1 || height < 1 || width > SST_IMAGE_MAX_SIDE || height > SST_IMAGE_MAX_SIDE)
        return -EINVAL;
    struct sst_detections made = { .board = form->board, .rows = rows, .cols = cols, .width = width, .height = height };

    made.camera_name = calloc((size_t)rows * (size_t)cols, sizeof(*made.camera_name));
    if (!made.camera_name)
        return -ENOMEM;
    *all = made;
    return 0;
}

void sst_detections_fini(struct sst_detections *all)
{
    for (int i = 0; i < all->count; i++)
        sst_detection_fini(&all->detection[i]);
    free(all->detection);
    free(all->frame_name);
    free(all->camera_name);
    free(all->drive_mm);
    *all = (struct sst_detections){ 0 };
}

int sst_detections_frame(struct sst_detections *all, const char *name)
{
    if (!sst_mem_grow(&all->frame_name, all->frames, &all->frame_capacity, sizeof(*all->frame_name)))
        return -ENOMEM;
    snprintf(all->frame_name[all->frames], sizeof(*all->frame_name), "%s", name);
    return all->frames++;
}

/* --- chessboards with rotational symmetry ------------------------------------------------------------------------ */

int sst_chessboard_ways(int cols, int rows)
{
    if ((cols + rows) % 2)
        return 1;
    return cols == rows && cols % 2 == 0 ? 4 : 2;
}

/* Direction of the board's x in the picture, by the best affine map from board to picture. */
static double heading(const struct sst_board *board, const struct sst_detection *d)
{
    double mean[4] = { 0 }, uu = 0, uv = 0, vv = 0, ux = 0, vx = 0, uy = 0, vy = 0, p[2];

    for (int i = 0; i < d->corners; i++) {
        sst_board_point(board, d->corner[i].id, p);
        mean[0] += p[0] / d->corners;
        mean[1] += p[1] / d->corners;
        mean[2] += d->corner[i].x / d->corners;
        mean[3] += d->corner[i].y / d->corners;
    }
    for (int i = 0; i < d->corners; i++) {
        const double x = d->corner[i].x - mean[2], y = d->corner[i].y - mean[3];

        sst_board_point(board, d->corner[i].id, p);
        p[0] -= mean[0];
        p[1] -= mean[1];
        uu += p[0] * p[0];
        uv += p[0] * p[1];
        vv += p[1] * p[1];
        ux += p[0] * x;
        vx += p[1] * x;
        uy += p[0] * y;
        vy += p[1] * y;
    }
    return atan2(uy * vv - vy * uv, ux * vv - vx * uv); /* the common denominator is positive */
}

static int by_id(const void *a, const void *b)
{
    return ((const struct sst_corner *)a)->id - ((const struct sst_corner *)b)->id;
}

/* Renumber the corners as if the board were rotated by `turns` of its `ways` symmetric positions, clockwise (y is
 * down). */
static void renumber(const struct sst_board *board, struct sst_detection *d, int turns, int ways)
{
    const int cols = board->cols - 1, rows = board->rows - 1;

    for (int k = 0; k < turns; k++) {
        for (int n = 0; n < d->corners; n++) {
            const int i = d->corner[n].id % cols, j = d->corner[n].id / cols;

            /* Half a turn reverses both axes. A quarter: the new x runs along the old y, the new y against the old
             * x. */
            d->corner[n].id = ways == 2 ? (rows - 1 - j) * cols + cols - 1 - i : (cols - 1 - i) * cols + j;
        }
    }
    qsort(d->corner, (size_t)d->corners, sizeof(*d->corner), by_id);
}

/*
 * Headings are known up to 1/ways of a turn. Their mean (of the angles times ways), in -pi/ways .. pi/ways, is the
 * frame's heading: each view uses the numbering with the heading nearest to it.
 */
static void number_alike(struct sst_detection *d, int n, const struct sst_board *board, int ways)
{
    double c = 0, s = 0, mean;

    for (int i = 0; i < n; i++) {
        const double angle = ways * heading(board, &d[i]);

        c += cos(angle);
        s += sin(angle);
    }
    mean = atan2(s, c) / ways;
    for (int i = 0; i < n; i++) {
        const double off = (mean - heading(board, &d[i])) * ways / (2 * M_PI);
        const int turns = (int)lround(off) % ways;

        renumber(board, &d[i], turns < 0 ? turns + ways : turns, ways);
    }
}

/* --- adding ------------------------------------------------------------------------------------------------------ */

static bool sound(const struct sst_detections *all, const struct sst_detection *d)
{
    if (d->view < 0 || d->view >= all->rows * all->cols || d->frame < 0 || d->frame >= all->frames || d->corners < 1)
        return false;
    for (int i = 0; i < d->corners; i++) {
        const struct sst_corner *c = &d->corner[i];

        if (c->id < 0 || c->id >= sst_board_points(&all->board) || (i > 0 && c->id <= c[-1].id))
            return false;
    }
    return true;
}

int sst_detections_add(struct sst_detections *all, struct sst_detection *detection)
{
    const int ways =
        all->board.kind == SST_BOARD_CHESSBOARD ? sst_chessboard_ways(all->board.cols - 1, all->board.rows - 1) : 1;
    int at = all->count, first, end;

    if (!sound(all, detection))
        return -EINVAL;
    while (at > 0 &&
           (all->detection[at - 1].frame > detection->frame ||
            (all->detection[at - 1].frame == detection->frame && all->detection[at - 1].view > detection->view)))
        at--;
    if (at > 0 && all->detection[at - 1].frame == detection->frame && all->detection[at - 1].view == detection->view)
        return -EINVAL;
    if (!sst_mem_grow(&all->detection, all->count, &all->capacity, sizeof(*all->detection)))
        return -ENOMEM;
    memmove(&all->detection[at + 1], &all->detection[at], (size_t)(all->count - at) * sizeof(*all->detection));
    all->detection[at] = *detection;
    all->count++;
    *detection = (struct sst_detection){ 0 };
    if (ways > 1) {
        for (first = at; first > 0 && all->detection[first - 1].frame == all->detection[at].frame;)
            first--;
        for (end = at + 1; end < all->count && all->detection[end].frame == all->detection[at].frame;)
            end++;
        number_alike(&all->detection[first], end - first, &all->board, ways);
    }
    return 0;
}
