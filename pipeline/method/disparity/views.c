/* Views of one run: described for matching, with their neighbours, checked against others, and filled. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/disparity/disparity_internal.h"

/* Where only some views are matched, they are checked against others up to this many spacings away. */
#define CHECKED_FAR 3.5

int run_cancelled(const struct disparity_run *run)
{
    return run->cfg->cancel && *run->cfg->cancel ? -ECANCELED : 0;
}

int run_describe(void *arg, int view, int worker)
{
    struct disparity_run *run = arg;
    const struct sst_view *v = &run->lf->views[view];
    struct sst_descriptor *desc = &run->desc[view];
    const enum sst_cost census =
        run->costs && !run->cache ? (enum sst_cost)(run->cfg->cost & SST_COST_CENSUS) : (enum sst_cost)0;
    int err;

    if (!v->present || !run->need[view])
        return 0;
    err = run_cancelled(run);
    if (!err && !desc->luma.data) {
        err = sst_descriptor_init(desc, &v->image, run->scale, census, NULL);
        if (!err && v->valid.data)
            err = sst_disparity_mask_reduce(&desc->seen, &v->valid, run->scale);
    } else if (!err && census) { /* it was made without, and the CPU needs it after all */
        err = sst_descriptor_add_census(desc);
    }
    if (!err && run->cfg->cost & SST_COST_MCCNN)
        err = run_add_features(run, view, run->nets ? run->nets[worker] : NULL);
    if (run->cache)
        return err ? err : run_compute_census(run, view);
    return err || run->cfg->frugal ? err : sst_descriptor_add_phases(desc, run->need[view]);
}

int run_view_at(const struct sst_lightfield *lf, int view, int dr, int dc)
{
    const int row = view / lf->cols + dr, col = view % lf->cols + dc;

    if (row < 0 || col < 0 || row >= lf->rows || col >= lf->cols || !lf->views[row * lf->cols + col].present)
        return -1;
    return row * lf->cols + col;
}

/* (dr, dc): left, right, up, down; the diagonals; two steps left, right, up, down. */
static const int sides[SST_MAX_NEIGHBOURS][2] = { { 0, -1 }, { 0, 1 }, { -1, 0 }, { 1, 0 }, { -1, -1 }, { -1, 1 },
                                                  { 1, -1 }, { 1, 1 }, { 0, -2 }, { 0, 2 }, { -2, 0 },  { 2, 0 } };

/* Sides that a view is matched with at most. */
static int matched_sides(const struct disparity_run *run)
{
    return run->cfg->joint ? run->cfg->neighbours : 4;
}

bool run_has_neighbours(const struct disparity_run *run, int view)
{
    bool has = false;

    for (int s = 0; s < matched_sides(run) && !has; s++)
        has = run_view_at(run->lf, view, sides[s][0], sides[s][1]) >= 0;
    return has;
}

void run_need_view(struct disparity_run *run, int view)
{
    const struct sst_lightfield *lf = run->lf;

    run->need[view] |= 1;
    for (int s = 0; s < matched_sides(run); s++) {
        const int n = run_view_at(lf, view, sides[s][0], sides[s][1]);

        if (n >= 0)
            run->need[n] |= 1 | sst_volume_phases(&run->shape, lf->views[n].bx - lf->views[view].bx,
                                                  lf->views[n].by - lf->views[view].by);
    }
}

int run_describe_for(struct disparity_run *run, const int *view, int count, int threads)
{
    const int views = run->lf->rows * run->lf->cols;
    int err = 0;

    memset(run->need, 0, (size_t)views * sizeof(*run->need));
    for (int i = 0; i < count; i++)
        run_need_view(run, view[i]);
    if (run->cache)
        err = run_place_census(run, run->later, run->laters);
    return err ? err : sst_parallel_for(views, threads, run_describe, run);
}

/* Phases of a neighbour that one view alone needs. */
static int add_phases(struct disparity_run *run, int view, int neighbour)
{
    const struct sst_view *from = &run->lf->views[view], *to = &run->lf->views[neighbour];

    return sst_descriptor_add_phases(&run->desc[neighbour],
                                     sst_volume_phases(&run->shape, to->bx - from->bx, to->by - from->by));
}

void run_drop_phases(struct disparity_run *run)
{
    for (int view = 0; view < run->lf->rows * run->lf->cols; view++)
        sst_descriptor_drop_phases(&run->desc[view]);
}

int run_gather_neighbours(struct disparity_run *run, int view, int first, int last, struct sst_neighbour *neighbours)
{
    const struct sst_lightfield *lf = run->lf;
    int count = 0, err = 0;

    for (int s = first; s <= last && !err; s++) {
        const int n = run_view_at(lf, view, sides[s][0], sides[s][1]);

        if (n >= 0)
            neighbours[count++] = (struct sst_neighbour){ &run->desc[n], lf->views[n].bx - lf->views[view].bx,
                                                          lf->views[n].by - lf->views[view].by };
        if (n >= 0 && run->cfg->frugal)
            err = add_phases(run, view, n);
    }
    return err ? err : count;
}

bool run_is_carried(const struct disparity_run *run, int view)
{
    return run->carried && run->carried[view];
}

static struct sst_checked_view checked_view(const struct disparity_run *run, int view, int n)
{
    const struct sst_view *from = &run->lf->views[view], *to = &run->lf->views[n];

    return (struct sst_checked_view){ &run->disp[n], &run->status[n], to->bx - from->bx, to->by - from->by };
}

/* Those at most CHECKED_FAR away. */
static void find_keys(const struct disparity_run *run, int view, struct sst_checked_views *out)
{
    const struct sst_lightfield *lf = run->lf;

    for (int n = 0; n < lf->rows * lf->cols && out->count < SST_MAX_NEIGHBOURS; n++) {
        const struct sst_view *from = &lf->views[view], *to = &lf->views[n];

        if (n != view && to->present && !run->carried[n] && hypot(to->bx - from->bx, to->by - from->by) < CHECKED_FAR)
            out->view[out->count++] = checked_view(run, view, n);
    }
}

void run_checked_views(const struct disparity_run *run, int view, struct sst_checked_views *out)
{
    *out = (struct sst_checked_views){ .disp_min_px = run->disp_min };
    if (run->carried) {
        find_keys(run, view, out);
        return;
    }
    for (int s = 0; s < SST_MAX_NEIGHBOURS; s++) {
        const int n = run_view_at(run->lf, view, sides[s][0], sides[s][1]);

        if (n >= 0)
            out->view[out->count++] = checked_view(run, view, n);
        if (s == 7)
            out->near = out->count;
    }
}

int run_check(void *arg, int view, int worker SST_UNUSED)
{
    struct disparity_run *run = arg;
    struct sst_checked_views from;
    int err;

    if (!run->lf->views[view].present)
        return 0;
    run_checked_views(run, view, &from);
    err = run_cancelled(run);
    sst_map_u8_fini(&run->status[view]);
    err = err ? err : sst_map_u8_init(&run->status[view], run->width, run->height);
    if (!err && !run_is_carried(run, view))
        sst_disparity_check_views(&run->status[view], &run->disp[view], &from, run->carried ? 0 : run->range + 1);
    return err;
}

int run_fill(void *arg, int view, int worker SST_UNUSED)
{
    struct disparity_run *run = arg;
    struct sst_map_u16 *out = &run->filled[view];
    struct sst_checked_views from;
    uint32_t *scratch = NULL;
    int err;

    if (!run->lf->views[view].present)
        return 0;
    run_checked_views(run, view, &from);
    err = run_cancelled(run);
    sst_map_u16_fini(out);
    err = err ? err : sst_map_u16_init(out, run->width, run->height);
    if (!err)
        scratch = sst_mem_alloc_raw((size_t)run->width * (size_t)run->height, sizeof(*scratch));
    err = err || scratch ? err : -ENOMEM;
    if (!err) {
        memcpy(out->data, run->disp[view].data, out->stride * (size_t)out->height);
        sst_fill_views(out, &run->status[view], &from, scratch);
    }
    sst_mem_free(scratch);
    return err;
}
