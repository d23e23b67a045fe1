/* Extent of a track behind leaves: the search that finds it reports a box of a few sizes, often of a part of a body, and
 * a depth of a few planes. The pixels of the reference view there, through the gaps, have its disparity, and reach from
 * head to foot.
 *
 * Rows around the box are added, and then columns, while enough of their pixels are at the disparity of the track; gaps
 * as of leaves are skipped. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "pipeline/live/live_internal.h"

#define REACH_PX  1.0 /* of disparities about the track's, or ... */
#define REACH     0.1 /* ... this fraction of it */
#define FARTHER   0.25 /* of its disparity: behind the search's depth, ... */
#define NEARER    0.1 /* ... and before it: a thing is there, since the search places things too near */
#define BEHIND    0.5 /* of the way from the farthest surfaces to the track: surfaces behind this are no part of it */
#define BINS      64
#define AROUND    0.5 /* of the box's width, to each side: columns that are counted */
#define ROW_LEAST 2   /* pixels of a row that is part of the thing */
#define GAP       0.2 /* of the height so far: rows without any that are skipped, ... */
#define GAP_PX    12  /* ... at least */
#define MOST      2.5 /* heights of the box by which it grows upwards or downwards */
#define LEAST     40  /* pixels in the box: else its part of the body is not seen in the reference view */
#define OUTSIDE   0.02 /* of the pixels, to the left and to the right of the grown box */

struct extent {
    const struct sst_map_u16 *disp;
    int from, to; /* stored disparities */
    int x0, x1;   /* columns */
};

static int count_row(const struct extent *e, int y, int x0, int x1)
{
    const uint16_t *disp = sst_map_u16_row(e->disp, y);
    int n = 0;

    for (int x = x0; x < x1; x++)
        n += disp[x] >= e->from && disp[x] <= e->to;
    return n;
}

/* The last row upwards (step -1) or downwards that is part of the thing. */
static int last_row(const struct extent *e, int y, int step, double height)
{
    const int most = (int)(MOST * height);
    int last = y, gap = 0;

    for (int i = 1; i <= most && gap <= fmax(GAP_PX, GAP * (height + abs(last - y))); i++) {
        const int at = y + i * step;

        if (at < 0 || at >= e->disp->height)
            break;
        gap++;
        if (count_row(e, at, e->x0, e->x1) < ROW_LEAST)
            continue;
        last = at;
        gap = 0;
    }
    return last;
}

/* Columns x0 .. x1 of rows y0 .. y1 with all but a few of the pixels. */
static void find_columns(const struct extent *e, int y0, int y1, double *left, double *right)
{
    int64_t all = 0, n = 0;

    for (int y = y0; y <= y1; y++)
        all += count_row(e, y, e->x0, e->x1);
    for (int x = e->x0; x < e->x1; x++) {
        const int64_t before = n;

        for (int y = y0; y <= y1; y++)
            n += count_row(e, y, x, x + 1);
        if ((double)before <= OUTSIDE * (double)all && (double)n > OUTSIDE * (double)all)
            *left = x;
        if ((double)before < (1 - OUTSIDE) * (double)all && (double)n >= (1 - OUTSIDE) * (double)all)
            *right = x + 1;
    }
}

/* The disparity that most pixels of the box have, around the track's. @return pixels that have it */
static int find_disparity(const struct sst_live *live, const struct sst_live_track *t, double *disp_px)
{
    const struct sst_lightfield *lf = &live->lf;
    const struct sst_map_u16 *disp = &lf->views[lf->ref_view].disp;
    const double far_px = live->min_px + BEHIND * (t->disp_px - live->min_px);
    const double from_px = fmax((1 - FARTHER) * t->disp_px, far_px), to_px = (1 + NEARER) * t->disp_px;
    const int x0 = sst_clamp_int((int)t->x0, 0, disp->width), x1 = sst_clamp_int((int)t->x1, 0, disp->width);
    const int y0 = sst_clamp_int((int)t->y0, 0, disp->height), y1 = sst_clamp_int((int)t->y1, 0, disp->height);
    int bin[BINS + 2] = { 0 }, best = 1;

    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const uint16_t d = sst_map_u16_row(disp, y)[x];
            const double px = sst_disp_px(lf, d);

            if (d != SST_DISP_NONE && px >= from_px && px < to_px)
                bin[1 + (int)((px - from_px) / (to_px - from_px) * BINS)]++;
        }
    }
    for (int i = 1; i <= BINS; i++)
        best = bin[i - 1] + 2 * bin[i] + bin[i + 1] > bin[best - 1] + 2 * bin[best] + bin[best + 1] ? i : best;
    *disp_px = from_px + (best - 0.5) * (to_px - from_px) / BINS;
    return best == 1 ? 0 : bin[best - 1] + bin[best] + bin[best + 1]; /* the first: the flank of another surface */
}

void live_track_grow(const struct sst_live *live, struct sst_live_track *t)
{
    const struct sst_lightfield *lf = &live->lf;
    const struct sst_map_u16 *disp = &lf->views[lf->ref_view].disp;
    const double around = AROUND * (t->x1 - t->x0);
    struct extent e = { .disp = disp };
    double reach_px, disp_px;
    int y0, y1;

    if (!disp->data || !(t->disp_px > fmax(live->min_px, 0)) || find_disparity(live, t, &disp_px) < LEAST)
        return;
    t->disp_px = disp_px;
    reach_px = fmax(REACH_PX, REACH * disp_px);
    e.from = sst_max_int((int)((t->disp_px - reach_px - lf->disp_min_px) * SST_DISP_SCALE), 0);
    e.to = sst_min_int((int)((t->disp_px + reach_px - lf->disp_min_px) * SST_DISP_SCALE), SST_DISP_NONE - 1);
    e.x0 = sst_clamp_int((int)(t->x0 - around), 0, disp->width);
    e.x1 = sst_clamp_int((int)(t->x1 + around), 0, disp->width);
    y0 = sst_clamp_int((int)t->y0, 0, disp->height - 1);
    y1 = sst_clamp_int((int)t->y1, 0, disp->height - 1);
    t->y0 = last_row(&e, y0, -1, t->y1 - t->y0);
    t->y1 = last_row(&e, y1, 1, y1 - y0) + 1;
    find_columns(&e, (int)t->y0, (int)t->y1 - 1, &t->x0, &t->x1);
    t->at[0] = t->x0;
    t->at[1] = t->y0;
    t->at[2] = t->x1;
    t->at[3] = t->y1;
}
