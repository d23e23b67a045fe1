/* Disparity range of a light field from a coarse match of its reference view. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/log.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define REDUCED_SIDE 320    /* longer sides are halved until they are at most about this */
#define CONFIDENT    100    /* of 255: a clear second minimum; filled pixels have 0 */
#define CUT          0.005  /* fraction of the confident pixels cut off at each end */
#define CUT_AGREED   0.0005 /* likewise, of those on which two sides agree: few of them are chance matches */
#define AGREE        64     /* two sides have the same disparity: 1 px (reduced), in 1/64 px */
#define SHARE        0.25   /* if fewer agree, the views are not aligned, and each side has its own offset */

enum { SIDES = 4, BINS = 2 * SST_DISPARITY_MAX_STEPS };

static int reduce(struct sst_image *out, const struct sst_image *in, int *factor)
{
    struct sst_image half = { 0 };
    int err = sst_image_halve(out, in);

    *factor = 2;
    while (!err && (out->width > 2 * REDUCED_SIDE || out->height > 2 * REDUCED_SIDE)) {
        err = sst_image_halve(&half, out);
        if (err)
            break;
        sst_image_fini(out);
        *out = half;
        *factor *= 2;
    }
    return err;
}

/* A pair's disparity of a reference pixel, in 1/64 px from the lowest searched; < 0: none, or low confidence. */
static int confident(const struct sst_lightfield *pair, int x, int y)
{
    const uint16_t d = sst_map_u16_row(&pair->views[0].disp, y)[x];

    return sst_map_u8_row(&pair->views[0].confidence, y)[x] < CONFIDENT || d == SST_DISP_NONE ? -1 : d;
}

static bool agrees(const struct sst_lightfield pair[SIDES], int side, int x, int y)
{
    const int d = confident(&pair[side], x, y);

    for (int i = 0; i < SIDES; i++) {
        const int other = i != side && pair[i].width ? confident(&pair[i], x, y) : -1;

        if (other >= 0 && abs(other - d) <= AGREE)
            return true;
    }
    return false;
}

/* Disparities of the confident pixels of a side, in half pixels (reduced) from the lowest searched: all, and those that
 * another side confirms. Chance matches differ between sides, above all in leaves. */
static void collect(int64_t all[BINS], int64_t agreed[BINS], const struct sst_lightfield pair[SIDES], int side)
{
    for (int y = 0; y < pair[side].height; y++)
        for (int x = 0; x < pair[side].width; x++) {
            const int d = confident(&pair[side], x, y), bin = sst_min_int(d / 32, BINS - 1);

            if (d < 0)
                continue;
            all[bin]++;
            agreed[bin] += agrees(pair, side, x, y);
        }
}

static int64_t sum(const int64_t histogram[BINS])
{
    int64_t n = 0;

    for (int i = 0; i < BINS; i++)
        n += histogram[i];
    return n;
}

/* Fill an empty light field of one pair from two views of lf, reduced. */
static int make_pair(struct sst_lightfield *pair, const struct sst_lightfield *lf, int a, int b, int *factor)
{
    int err = 0;

    for (int i = 0; !err && i < 2; i++) {
        const struct sst_view *from = &lf->views[i ? b : a];

        err = reduce(&pair->views[i].image, &from->image, factor);
        if (!err && from->valid.data)
            err = sst_disparity_mask_reduce(&pair->views[i].valid, &from->valid, *factor);
        pair->views[i].present = true;
        pair->views[i].bx = from->bx - lf->views[a].bx;
        pair->views[i].by = from->by - lf->views[a].by;
        pair->width = pair->views[i].image.width;
        pair->height = pair->views[i].image.height;
    }
    return err;
}

/* The chosen view; the reference view, or the nearest present one. */
static int middle(const struct sst_lightfield *lf, int from)
{
    double best = INFINITY;
    int at = lf->ref_view;

    if (from)
        return from - 1;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const double far = hypot(lf->views[k].bx, lf->views[k].by);

        if (lf->views[k].present && (far < best || (k == lf->ref_view && far <= best))) {
            best = far;
            at = k;
        }
    }
    return at;
}

/* The chosen view matched with its neighbours, one after the other. */
struct sides {
    const struct sst_lightfield *lf;
    const struct sst_disparity_search *search;
    struct sst_lightfield pair[SIDES]; /* zeroed; without a width: no neighbour there */
    struct side {
        double reach; /* of the search to either side, px (reduced) */
        int factor, width, height;
    } side[SIDES]; /* without a width likewise */
};

static int match_side(void *arg, int side, int worker SST_UNUSED)
{
    struct sides *s = arg;
    const struct sst_lightfield *lf = s->lf;
    const int ref = middle(lf, s->search->from), col = ref % lf->cols, row = ref / lf->cols;
    const int c = col + (side == 0) - (side == 1), r = row + (side == 2) - (side == 3);
    struct sst_lightfield *pair = &s->pair[side];
    struct sst_disparity_config cfg;
    int factor = 1, err;

    if (c < 0 || r < 0 || c >= lf->cols || r >= lf->rows || !lf->views[r * lf->cols + c].present)
        return 0;
    err = sst_disparity_preset(&cfg, "balanced");
    err = err ? err : make_pair(pair, lf, ref, r * lf->cols + c, &factor);
    if (err)
        return err;
    s->side[side] = (struct side){ .factor = factor, .width = pair->width, .height = pair->height };
    /* Disparities up to a fifth of the picture's longer side per spacing, in both directions. */
    s->side[side].reach = fmin(ceil(sst_max_int(pair->width, pair->height) / 5.0), SST_DISPARITY_MAX_STEPS / 2 - 1);
    cfg.scale = s->search->scale;
    cfg.threads = s->search->threads;
    cfg.runner = s->search->runner;
    cfg.disp_min_px = -s->side[side].reach;
    cfg.disp_max_px = s->side[side].reach;
    return sst_disparity_lightfield(pair, &cfg, NULL, NULL);
}

static void side_maps(void *arg, int side, struct sst_share_maps *out)
{
    struct sides *s = arg;

    sst_share_add_values(out, &s->side[side], sizeof(s->side[side]));
    sst_share_add_u16(out, &s->pair[side].views[0].disp);
    sst_share_add_u8(out, &s->pair[side].views[0].confidence);
}

/* Histograms of all sides. */
static int match_sides(struct sides *s, int64_t all[BINS], int64_t agreed[BINS])
{
    const int64_t on_cpu = sst_run_on_cpu(s->search->runner, SST_DISPARITY_MATCHED);
    int err = 0;

    for (int side = 0; !err && side < SIDES; side++)
        err = sst_lightfield_init(&s->pair[side], 1, 2);
    err = err ? err : sst_share_for(s->search->share, SIDES, 1, match_side, s, side_maps);
    for (int side = 0; !err && side < SIDES; side++) {
        s->pair[side].width = s->side[side].width;
        s->pair[side].height = s->side[side].height;
    }
    for (int side = 0; !err && side < SIDES; side++)
        collect(all, agreed, s->pair, side);
    for (int side = 0; side < SIDES; side++)
        sst_lightfield_fini(&s->pair[side]);
    if (sst_run_on_cpu(s->search->runner, SST_DISPARITY_MATCHED) > on_cpu)
        sst_run_note(s->search->runner, 1U << SST_DISPARITY_STAGE_RANGE, NULL);
    return err;
}

int sst_disparity_range(const struct sst_lightfield *lf, const struct sst_disparity_search *search, double *min_px,
                        double *max_px)
{
    struct sides s = { .lf = lf, .search = search };
    int64_t all[BINS] = { 0 }, agreed[BINS] = { 0 }, below = 0;
    const int64_t *histogram = all;
    int64_t total;
    double reach = 0, cut = CUT;
    int factor = 1, first = -1, last = -1, err = match_sides(&s, all, agreed);

    if (err)
        return err;
    for (int side = 0; side < SIDES; side++) { /* the same on all sides that are there */
        factor = s.side[side].width ? s.side[side].factor : factor;
        reach = s.side[side].width ? s.side[side].reach : reach;
    }
    total = sum(all);
    if ((double)sum(agreed) >= SHARE * (double)total) {
        histogram = agreed;
        total = sum(agreed);
        cut = CUT_AGREED;
    }
    for (int i = 0; i < BINS; i++) {
        below += histogram[i];
        if (first < 0 && (double)below > cut * (double)total)
            first = i;
        if (last < 0 && (double)below >= (1 - cut) * (double)total && below > 0)
            last = i;
    }
    if (total < 100 || first < 0) {
        int views = 0;

        for (int k = 0; k < lf->rows * lf->cols; k++)
            views += lf->views[k].present;
        if (views < 2)
            sst_log_error("disparity needs two neighbouring views; this light field has %d in all", views);
        else
            sst_log_error("cannot estimate the disparity range from these views; set --range-min and --range-max");
        return -ENODATA;
    }
    /* One reduced pixel of margin: half a bin for the histogram's resolution, the rest for the pixels that were cut
     * off.
     */
    *min_px = floor((-reach + first * 0.5 - 1.0) * factor);
    *max_px = ceil((-reach + (last + 1) * 0.5 + 1.0) * factor);
    return 0;
}
