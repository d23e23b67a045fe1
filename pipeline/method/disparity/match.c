/* The first pass: views matched against their neighbours, some at a time. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define BLOCK 3 /* rows of views */

/* --- a view on the CPU -------------------------------------------------------------------------------------------- */

int run_search_tiles(struct disparity_run *run, struct sst_tiles *tiles, struct sst_volume *v, int view,
                     const struct sst_neighbour *neighbours, int count, const struct sst_support *support,
                     struct sst_map_u16 *disp, struct sst_map_u8 *confidence)
{
    const struct sst_image *img = &run->desc[view].image;
    const int rounds = run->cfg->support_arm ? run->cfg->support_before : 0;
    struct sst_disparity_sgm_penalties penalties;
    int err = 0;

    sst_disparity_sgm_penalties_init(&penalties, run->cfg);
    for (int i = 0; !err && i < tiles->rows * tiles->columns; i++) {
        err = run_cancelled(run);
        err =
            err ? err : sst_tiles_fill(tiles, &tiles->tile[i], v, &run->desc[view], neighbours, count, support, rounds);
    }
    for (int row = 0; !err && row < tiles->rows; row++)
        err = sst_tiles_paths_along(tiles, img, &penalties, row, &v->lines);
    for (int column = 0; !err && column < tiles->columns; column++)
        err = sst_tiles_paths_down(tiles, img, &penalties, column, &v->lines);
    for (int i = 0; !err && i < tiles->rows * tiles->columns; i++)
        err = sst_tiles_winner(tiles, &tiles->tile[i], disp, confidence, &v->lines);
    return err;
}

struct sst_coarse run_coarse_view(const struct disparity_run *run, int view)
{
    return (struct sst_coarse){ &run->coarse->views[view].disp, (int)run->coarse->disp_min_px, SST_COARSER };
}

static int match_tiles(struct disparity_run *run, struct sst_volume *v, struct sst_tiles *tiles, int view,
                       const struct sst_neighbour *neighbours, int count, const struct sst_support *support,
                       struct sst_map_u16 *disp, struct sst_map_u8 *confidence)
{
    const struct sst_coarse coarse = run_coarse_view(run, view);
    const int err = sst_tiles_init(tiles, run->width, 0, run->height, &run->shape, &coarse);

    if (err)
        return err;
    run->searched[view] = sst_tiles_share(tiles);
    return run_search_tiles(run, tiles, v, view, neighbours, count, support, disp, confidence);
}

/* Match one view on several threads, and filter its map. */
static int search_shared(struct disparity_run *run, struct sst_volume *v, int view,
                         const struct sst_neighbour *neighbours, int count, const struct sst_support *support)
{
    const struct sst_disparity_config *cfg = run->cfg;
    const struct sst_volume_search in = { .cfg = cfg,
                                          .ref = &run->desc[view],
                                          .neighbours = neighbours,
                                          .count = count,
                                          .support = support,
                                          .rounds = cfg->support_arm ? cfg->support_before : 0,
                                          .threads = run->inner,
                                          .disp = &run->disp[view],
                                          .confidence = &run->confidence[view] };

    return sst_volume_search(v, &run->parts[(v - run->volumes) * run->inner], &in);
}

/* Match one view against the neighbours of the sides in first..last into disp and confidence. */
static int match_sides(struct disparity_run *run, struct sst_volume *v, int view, int first, int last,
                       const struct sst_support *support, struct sst_map_u16 *disp, struct sst_map_u8 *confidence)
{
    const struct sst_disparity_config *cfg = run->cfg;
    struct sst_neighbour neighbours[SST_MAX_NEIGHBOURS];
    const int count = run_gather_neighbours(run, view, first, last, neighbours);
    int err = 0;

    if (count <= 0)
        return count ? count : -ENODATA;
    if (run->coarse) {
        err = match_tiles(run, v, &run->tiles[v - run->volumes], view, neighbours, count, support, disp, confidence);
        if (cfg->frugal)
            run_drop_phases(run);
        return err;
    }
    if (run->inner > 1)
        return search_shared(run, v, view, neighbours, count, support);
    sst_volume_fill(v, &run->desc[view], neighbours, count);
    if (cfg->frugal)
        run_drop_phases(run);
    if (cfg->raw)
        return sst_volume_winner(v, true, disp, confidence);
    err = run_cancelled(run);
    err = err ? err : sst_disparity_support_aggregate(v, support, cfg->support_arm ? cfg->support_before : 0);
    err = err ? err : run_cancelled(run);
    err = err ? err : sst_disparity_sgm(v, &run->desc[view].image, cfg);
    if (!err && cfg->support_arm && cfg->support_after) {
        sst_volume_requantise(v);
        err = sst_disparity_support_aggregate(v, support, cfg->support_after);
    }
    return err ? err : sst_volume_winner(v, cfg->support_arm && cfg->support_after, disp, confidence);
}

static int match_apart(struct disparity_run *run, struct sst_volume *v, int view, const struct sst_support *support)
{
    struct sst_map_u16 disp = { 0 };
    struct sst_map_u8 confidence = { 0 };
    int across, down = sst_map_u16_init(&disp, run->width, run->height);

    down = down ? down : sst_map_u8_init(&confidence, run->width, run->height);
    if (down)
        goto done;
    across = match_sides(run, v, view, 0, 1, support, &run->disp[view], &run->confidence[view]);
    down = across && across != -ENODATA ? across : match_sides(run, v, view, 2, 3, support, &disp, &confidence);
    if (!down && !across)
        sst_fuse(&run->disp[view], &run->confidence[view], &disp, &confidence);
    if (!down && across == -ENODATA) {
        memcpy(run->disp[view].data, disp.data, disp.stride * (size_t)disp.height);
        memcpy(run->confidence[view].data, confidence.data, confidence.stride * (size_t)confidence.height);
    }
    if (down == -ENODATA)
        down = across;
done:
    sst_map_u16_fini(&disp);
    sst_map_u8_fini(&confidence);
    return down;
}

void match_forget_unseen(struct sst_map_u16 *disp, const struct sst_map_u8 *seen)
{
    for (int y = 0; seen->data && y < disp->height; y++) {
        for (int x = 0; x < disp->width; x++) {
            if (!sst_map_u8_row(seen, y)[x])
                sst_map_u16_row(disp, y)[x] = SST_DISP_NONE;
        }
    }
}

/* --- the step ----------------------------------------------------------------------------------------------------- */

static bool is_matched(const void *job, int view)
{
    const struct match_batch *b = job;
    int i = 0;

    while (i < b->count && b->view[i] != view)
        i++;
    return i < b->count && run_has_neighbours(b->run, view);
}

/* The definition. */
static int match_job(void *job, int view, int worker)
{
    struct disparity_run *run = ((struct match_batch *)job)->run;
    const struct sst_disparity_config *cfg = run->cfg;
    struct sst_volume *volume = &run->volumes[worker];
    struct sst_support support = { 0 };
    int err = run_cancelled(run);

    if (!err && cfg->support_arm && !cfg->raw)
        err = sst_disparity_support_init(&support, &run->desc[view].image, cfg->support_arm, cfg->support_tau,
                                         run->inner);
    if (!err)
        err = cfg->joint ? match_sides(run, volume, view, 0, cfg->neighbours - 1, &support, &run->disp[view],
                                       &run->confidence[view])
                         : match_apart(run, volume, view, &support);
    sst_disparity_support_fini(&support);
    if (!err && !cfg->raw && run->inner == 1)
        err = sst_disparity_median5(&run->disp[view], &volume->lines);
    if (!err && !cfg->raw && run->inner == 1)
        err = sst_disparity_bilateral(&run->disp[view], &run->desc[view].luma, cfg->bilateral_tau);
    if (!err)
        match_forget_unseen(&run->disp[view], &run->desc[view].seen);
    return err;
}

/* Inputs of the CPU alone: the census, and features that are not on the host. */
static int make_costs(void *job)
{
    struct match_batch *b = job;

    b->run->costs = true;
    return run_describe_for(b->run, b->view, b->count, b->describing);
}

void run_match_source(const struct disparity_run *run, int view, struct sst_plane_source *out)
{
    const struct sst_descriptor *desc = &run->desc[view];

    *out = (struct sst_plane_source){ .image = &desc->image,
                                      .seen = &desc->seen,
                                      .features = desc->features,
                                      .feature_stride = desc->feature_stride,
                                      .width = run->width,
                                      .height = run->height };
}

static void match_source(const void *job, int view, struct sst_plane_source *out)
{
    run_match_source(((const struct match_batch *)job)->run, view, out);
}

static void maps_of(struct disparity_run *run, int view, struct sst_share_maps *out)
{
    sst_share_add_u16(out, &run->disp[view]);
    sst_share_add_u8(out, &run->confidence[view]);
    if (run->searched)
        sst_share_add_values(out, &run->searched[view], sizeof(run->searched[view]));
}

static void matched_maps(void *arg, int view, struct sst_share_maps *out)
{
    maps_of(((struct match_batch *)arg)->run, view, out);
}

static void *match_sample(uint32_t seed)
{
    struct match_sample *s = disparity_match_sample(seed);

    if (!s)
        return NULL;
    s->batch = (struct match_batch){ .run = &s->run, .view = s->view, .count = ARRAY_LEN(s->view), .sample = s };
    return &s->batch;
}

static void match_sample_free(void *job)
{
    disparity_match_sample_free(job ? ((struct match_batch *)job)->sample : NULL);
}

const struct sst_step disparity_match_step = { .name = "matching",
                                               .wants = is_matched,
                                               .source = match_source,
                                               .host = make_costs,
                                               .cpu = match_job,
                                               .counter = SST_DISPARITY_MATCHED,
                                               .writes = matched_maps,
                                               .changes = 1U << SST_PLANE_MAP,
                                               .sample = match_sample,
                                               .seeds = MATCH_SAMPLES,
                                               .sample_pixels = MATCH_SAMPLE_PIXELS,
                                               .sample_free = match_sample_free };

/* --- the first pass ----------------------------------------------------------------------------------------------- */

struct pass {
    struct disparity_run *run;
    int *view; /* [count] that are matched */
    int count, threads;
    sst_progress_fn *progress;
    void *progress_arg;
};

/* Forget the descriptions of views that are more than two rows away from these. */
static void forget_far(struct disparity_run *run, const int *view, int count)
{
    const int cols = run->lf->cols, first = view[0] / cols, last = view[count - 1] / cols;

    for (int k = 0; k < run->lf->rows * cols; k++) {
        if (k / cols < sst_min_int(first, last) - 2 || k / cols > sst_max_int(first, last) + 2)
            sst_descriptor_fini(&run->desc[k]);
    }
}

/* Describe views and their neighbours, and match. */
static int match_batch(void *arg, const int *index, int count)
{
    const struct pass *p = arg;
    struct disparity_run *run = p->run;
    const struct sst_run_options how = { .threads = p->threads, .cancel = run->cfg->cancel };
    int view[SST_MAX_VIEWS], err;
    struct match_batch b = { .run = run, .view = view, .count = count };

    b.describing = run->nets ? p->threads : p->threads * run->inner; /* a network is one worker's */
    for (int i = 0; i < count; i++) {
        view[i] = p->view[index[i]];
        if (!run_has_neighbours(run, view[i])) /* unknown everywhere, filled from distant views below */
            memset(run->disp[view[i]].data, 0xFF, run->disp[view[i]].stride * (size_t)run->height);
    }
    if (!run->cache)
        forget_far(run, view, count);
    run->later = p->view + index[0];
    run->laters = p->count - index[0];
    run->costs = !run->cfg->runner;
    err = run_describe_for(run, view, count, b.describing);
    err = err ? err : sst_run(run->cfg->runner, &disparity_match_step, &b, run->lf->rows * run->lf->cols, &how);
    if (p->progress)
        p->progress(p->progress_arg, 0.9 * (index[count - 1] + 1) / p->count);
    return err;
}

static void pass_maps(void *arg, int index, struct sst_share_maps *out)
{
    const struct pass *p = arg;

    maps_of(p->run, p->view[index], out);
}

static int init_maps(void *arg, int view, int worker SST_UNUSED)
{
    struct disparity_run *run = arg;
    int err;

    if (!run->lf->views[view].present || run->disp[view].data)
        return 0;
    err = sst_map_u16_init(&run->disp[view], run->width, run->height);
    return err ? err : sst_map_u8_init(&run->confidence[view], run->width, run->height);
}

/* The i-th view, by BLOCK rows column by column: views that have neighbours in common are near each other. */
static int in_blocks(const struct sst_lightfield *lf, int i)
{
    const int block = i / (BLOCK * lf->cols), first = BLOCK * block, rows = sst_min_int(BLOCK, lf->rows - first);
    const int at = i - first * lf->cols;

    return (first + at % rows) * lf->cols + at / rows;
}

int run_match(struct disparity_run *run, int threads, sst_progress_fn *progress, void *progress_arg)
{
    const int views = run->lf->rows * run->lf->cols;
    struct pass m = { run, calloc((size_t)views, sizeof(*m.view)), 0, threads, progress, progress_arg };
    int err = m.view ? sst_parallel_for(views, threads, init_maps, run) : -ENOMEM;

    for (int i = 0; m.view && i < views; i++) {
        const int view = run->cache ? in_blocks(run->lf, i) : i;

        if (run->lf->views[view].present && !run->matched[view] && (run->others || !run_is_carried(run, view)))
            m.view[m.count++] = view;
    }
    err = err ? err : sst_share_batches(run->cfg->share, m.count, threads, match_batch, &m, pass_maps);
    for (int i = 0; i < m.count; i++)
        run->matched[m.view[i]] = true;
    free(m.view);
    return err;
}
