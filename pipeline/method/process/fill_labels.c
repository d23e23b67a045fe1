/*
 * Labels of pixels that no labelled view shows, from the first labelled pixel in each of eight directions. Two sweeps
 * over the rows, downwards and upwards, remember for each column and diagonal the row of the last labelled pixel.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/process/process_internal.h"

#define SPAN_SHARE 4 /* surfaces farther apart than this part of a view's span of disparities do not share labels */
#define NOWHERE    (-2 * PROCESS_FILL_REACH) /* a row that is out of reach of all */

/* Directions in the order in which equals win. */
enum { LEFT, RIGHT, UP, DOWN, UP_LEFT, UP_RIGHT, DOWN_LEFT, DOWN_RIGHT };

/* A pixel without a label, and the best that was found for it. */
struct gap {
    uint32_t least; /* far << 31 | difference of colour << 16 | of disparity */
    uint16_t x;
    uint8_t label, direction;
};

struct gaps {
    const struct sst_view *v;
    int far;         /* 1/64 px: disparities that differ by more win only where all do */
    struct gap *gap; /* row by row */
    size_t *row;     /* [height + 1] first one of each row */
    int *last;       /* [columns, falling diagonals, rising diagonals] row of the last labelled pixel, see sweep() */
};

static void consider(const struct gaps *gaps, struct gap *g, int y, struct process_place from, int direction)
{
    const struct sst_view *v = gaps->v;
    const int off_disp = abs(sst_map_u16_row(&v->disp, y)[g->x] - sst_map_u16_row(&v->disp, from.y)[from.x]);
    uint32_t colour = 0, off;

    for (int c = 0; c < 3; c++)
        colour += (uint32_t)abs(sst_image_row(&v->image, c, y)[g->x] - sst_image_row(&v->image, c, from.y)[from.x]);
    off = (uint32_t)(off_disp > gaps->far) << 31 | colour << 16 | (uint32_t)off_disp;
    if (off < g->least || (off == g->least && direction < g->direction)) {
        g->least = off;
        g->label = sst_map_u8_row(&v->label, from.y)[from.x];
        g->direction = (uint8_t)direction;
    }
}

/* @return the first column without a label from x on; width: none */
static int start_of_gap(const uint8_t *label, int x, int width)
{
    const uint8_t *at = x < width ? memchr(label + x, SST_LABEL_NONE, (size_t)(width - x)) : NULL;

    return at ? (int)(at - label) : width;
}

/* Columns x .. end - 1 have no label. @return end */
static int end_of_gap(const uint8_t *label, int x, int width)
{
    while (x < width && label[x] == SST_LABEL_NONE)
        x++;
    return x;
}

static int list_gaps(struct gaps *g)
{
    const struct sst_map_u8 *label = &g->v->label;
    size_t n = 0;

    for (int y = 0; y < label->height; y++) {
        const uint8_t *row = sst_map_u8_row(label, y);

        for (int x = 0; x < label->width; x++)
            n += row[x] == SST_LABEL_NONE;
        g->row[y + 1] = n;
    }
    g->gap = malloc((n + !n) * sizeof(*g->gap));
    if (!g->gap)
        return -ENOMEM;
    n = 0;
    for (int y = 0; y < label->height; y++) {
        const uint8_t *row = sst_map_u8_row(label, y);

        for (int from = start_of_gap(row, 0, label->width), end; from < label->width;
             from = start_of_gap(row, end, label->width)) {
            end = end_of_gap(row, from, label->width);
            for (int x = from; x < end; x++) {
                struct gap *gap = &g->gap[n++];

                *gap = (struct gap){ UINT32_MAX, (uint16_t)x, SST_LABEL_NONE, 0 };
                if (from > 0 && x - from < PROCESS_FILL_REACH)
                    consider(g, gap, y, (struct process_place){ from - 1, y }, LEFT);
                if (end < label->width && end - x <= PROCESS_FILL_REACH)
                    consider(g, gap, y, (struct process_place){ end, y }, RIGHT);
            }
        }
    }
    return 0;
}

/* Columns and diagonals from one side. Rows are counted from that side: row i is y = i or height - 1 - i. Pixel x of
 * row i lies on falling diagonal x - i + height - 1 and on rising one x + i. */
static void sweep(struct gaps *g, bool up)
{
    const struct sst_map_u8 *label = &g->v->label;
    const int w = label->width, h = label->height, across = w + h - 1;
    int *column = g->last, *falling = column + w, *rising = falling + across;

    for (int k = 0; k < w + 2 * across; k++)
        column[k] = NOWHERE;
    for (int i = 0; i < h; i++) {
        const int y = up ? h - 1 - i : i, step = up ? 1 : -1;
        const uint8_t *row = sst_map_u8_row(label, y);

        for (size_t k = g->row[y]; k < g->row[y + 1]; k++) {
            struct gap *gap = &g->gap[k];
            const int x = gap->x, straight = i - column[x], left = i - falling[x - i + h - 1],
                      right = i - rising[x + i];

            if (straight <= PROCESS_FILL_REACH)
                consider(g, gap, y, (struct process_place){ x, y + step * straight }, up ? DOWN : UP);
            if (left <= PROCESS_FILL_REACH)
                consider(g, gap, y, (struct process_place){ x - left, y + step * left }, up ? DOWN_LEFT : UP_LEFT);
            if (right <= PROCESS_FILL_REACH)
                consider(g, gap, y, (struct process_place){ x + right, y + step * right }, up ? DOWN_RIGHT : UP_RIGHT);
        }
        for (int x = 0; x < w; x++)
            column[x] = row[x] != SST_LABEL_NONE ? i : column[x];
        for (int x = 0; x < w; x++)
            falling[x - i + h - 1] = row[x] != SST_LABEL_NONE ? i : falling[x - i + h - 1];
        for (int x = 0; x < w; x++)
            rising[x + i] = row[x] != SST_LABEL_NONE ? i : rising[x + i];
    }
}

/* Write the labels of gaps of row y; where none was found, that of the nearer disparity beside them in the row. */
static void fill_row(struct sst_view *v, const struct gap *gap, int y)
{
    const uint16_t *d = sst_map_u16_row(&v->disp, y);
    const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;
    uint8_t *label = sst_map_u8_row(&v->label, y);
    const int width = v->label.width;

    for (int from = start_of_gap(label, 0, width), end; from < width; from = start_of_gap(label, end, width)) {
        end = end_of_gap(label, from, width);
        for (int x = from; x < end; x++, gap++) {
            const bool left = from > 0 && (end == width || abs(d[x] - d[from - 1]) <= abs(d[x] - d[end]));

            if (gap->label != SST_LABEL_NONE)
                label[x] = gap->label;
            else if (from > 0 || end < width)
                label[x] = left ? label[from - 1] : label[end];
        }
    }
    for (int x = 0; valid && x < width; x++)
        label[x] &= valid[x];
}

/* Disparities of a view from the least to the greatest, 1/64 px. */
static int span_of(const struct sst_map_u16 *disp)
{
    int least = SST_DISP_NONE, most = 0;

    for (int y = 0; y < disp->height; y++) {
        const uint16_t *d = sst_map_u16_row(disp, y);

        for (int x = 0; x < disp->width; x++) {
            least = sst_min_int(least, d[x]);
            most = d[x] == SST_DISP_NONE ? most : sst_max_int(most, d[x]);
        }
    }
    return sst_max_int(most - least, 0);
}

int process_fill_labels(struct sst_view *v)
{
    const size_t w = (size_t)v->label.width, h = (size_t)v->label.height;
    struct gaps g = { v, span_of(&v->disp) / SPAN_SHARE, NULL, calloc(h + 1, sizeof(*g.row)),
                      malloc((w + 2 * (w + h - 1)) * sizeof(*g.last)) };
    int err = g.row && g.last ? list_gaps(&g) : -ENOMEM;

    for (int up = 0; !err && up < 2 && g.row[h]; up++)
        sweep(&g, up);
    for (int y = 0; !err && y < v->label.height; y++)
        fill_row(v, g.gap + g.row[y], y);
    free(g.gap);
    free(g.row);
    free(g.last);
    return err;
}
