/* Matching of the views of one run: each against its neighbours, checked against others, and filled. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

/* Where only some views are matched, they are checked against others up to this many spacings away. */
#define CHECKED_FAR 3.5

int run_cancelled(const struct disparity_run *run)
{
    return run->cfg->cancel && *run->cfg->cancel ? -ECANCELED : 0;
}

/* Features, unless the CPU has them, or does not need them and the device has. */
static int describe_features(struct disparity_run *run, int view, int worker)
{
    struct sst_descriptor *desc = &run->desc[view];
    struct disparity_feature_run of = { run->device, run };
    struct sst_feature_keeper keeper = {
        .keep = disparity_device_keep_features, .feed = disparity_device_feed, .arg = &of, .view = view
    };

    if (!(run->cfg->cost & SST_COST_MCCNN) || desc->features ||
        (!run->costs && disparity_device_has_features(run->device, run, view)))
        return 0;
    return sst_descriptor_add_features(desc, run->nets[worker], run->device && !run->costs ? &keeper : NULL);
}

int run_describe(void *arg, int view, int worker)
{
    struct disparity_run *run = arg;
    const struct sst_view *v = &run->lf->views[view];
    struct sst_descriptor *desc = &run->desc[view];
    /* A device computes the census from pixels. */
    const enum sst_cost census = run->costs ? (enum sst_cost)(run->cfg->cost & SST_COST_CENSUS) : (enum sst_cost)0;
    int err;

    if (!v->present || !run->need[view])
        return 0;
    err = run_cancelled(run);
    if (!err && !desc->luma.data) {
        err = sst_descriptor_init(desc, &v->image, run->scale, census, NULL);
        if (!err && v->valid.data)
            err = sst_disparity_mask_reduce(&desc->seen, &v->valid, run->scale);
    } else if (!err && census) { /* the device, for which it was made, has failed */
        err = sst_descriptor_add_census(desc);
    }
    err = err ? err : describe_features(run, view, worker);
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

/* Note the phases that matching a view needs of its neighbours. */
static void need_view(struct disparity_run *run, int view)
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

    memset(run->need, 0, (size_t)views * sizeof(*run->need));
    for (int i = 0; i < count; i++)
        need_view(run, view[i]);
    return sst_parallel_for(views, threads, run_describe, run);
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

/* Match the tiles of one view. */
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

/* Neighbours of the sides in first..last. @return their number, or -ENOMEM */
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

/* Invalid pixels have no disparity and take no part in checking or filling. */
static void forget_unseen(struct sst_map_u16 *disp, const struct sst_map_u8 *seen)
{
    for (int y = 0; seen->data && y < disp->height; y++) {
        for (int x = 0; x < disp->width; x++) {
            if (!sst_map_u8_row(seen, y)[x])
                sst_map_u16_row(disp, y)[x] = SST_DISP_NONE;
        }
    }
}

bool run_is_carried(const struct disparity_run *run, int view)
{
    return run->carried && run->carried[view];
}

/* Views that are matched together. */
struct batch {
    struct disparity_run *run;
    const int *view;
};

static int match_job(void *arg, int index, int worker)
{
    const struct batch *b = arg;
    struct disparity_run *run = b->run;
    const int view = b->view[index];
    struct sst_support support = { 0 };
    int err = run_cancelled(run);

    if (!err && run->matched[view])
        return 0;
    if (!err && run->cfg->support_arm && !run->cfg->raw)
        err = sst_disparity_support_init(&support, &run->desc[view].image, run->cfg->support_arm, run->cfg->support_tau,
                                         run->inner);
    if (!err)
        err = run->cfg->joint ? match_sides(run, &run->volumes[worker], view, 0, run->cfg->neighbours - 1, &support,
                                            &run->disp[view], &run->confidence[view])
                              : match_apart(run, &run->volumes[worker], view, &support);
    sst_disparity_support_fini(&support);
    if (err == -ENODATA) { /* a view without neighbours: unknown everywhere, filled from distant views below */
        memset(run->disp[view].data, 0xFF, run->disp[view].stride * (size_t)run->height);
        return 0;
    }
    if (!err && !run->cfg->raw && run->inner == 1)
        err = sst_disparity_median5(&run->disp[view], &run->volumes[worker].lines);
    if (!err && !run->cfg->raw && run->inner == 1)
        err = sst_disparity_bilateral(&run->disp[view], &run->desc[view].luma, run->cfg->bilateral_tau);
    if (!err)
        forget_unseen(&run->disp[view], &run->desc[view].seen);
    return err;
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
    struct sst_map_u16 scratch = { 0 }, *out = &run->filled[view];
    struct sst_checked_views from;
    int err;

    if (!run->lf->views[view].present)
        return 0;
    run_checked_views(run, view, &from);
    err = run_cancelled(run);
    sst_map_u16_fini(out);
    err = err ? err : sst_map_u16_init(out, run->width, run->height);
    err = err ? err : sst_map_u16_init(&scratch, run->width, run->height);
    if (!err) {
        memcpy(out->data, run->disp[view].data, out->stride * (size_t)out->height);
        sst_fill_views(out, &run->status[view], &from, &scratch);
    }
    sst_map_u16_fini(&scratch);
    return err;
}

/* The first pass. */
struct match {
    struct disparity_run *run;
    int *view; /* [count] that are matched */
    int count, threads;
    sst_progress_fn *progress;
    void *progress_arg;
};

/* Match a view on the device. What that leaves is matched by match_job(). @param left  out: it is */
static int match_on_device(struct disparity_run *run, int view, bool *left)
{
    struct sst_neighbour neighbours[SST_MAX_NEIGHBOURS];
    struct device_match in = { .run = run,
                               .ref = &run->desc[view],
                               .neighbours = neighbours,
                               .height = run->height,
                               .filter = true,
                               .disp = &run->disp[view],
                               .confidence = &run->confidence[view] };
    int err = run_cancelled(run);

    in.count = err ? err : run_gather_neighbours(run, view, 0, run->cfg->neighbours - 1, neighbours);
    *left = true;
    if (in.count <= 0)
        return in.count;
    if (run->coarse) {
        const struct sst_coarse coarse = run_coarse_view(run, view);

        err = sst_tiles_init(&run->tiles[0], run->width, 0, run->height, &run->shape, &coarse);
        if (err)
            return err;
        in.tiles = &run->tiles[0];
        run->searched[view] = sst_tiles_share(in.tiles);
    }
    run->matched[view] = disparity_device_match(run->device, &in);
    *left = !run->matched[view];
    if (run->matched[view])
        forget_unseen(&run->disp[view], &run->desc[view].seen);
    return 0;
}

/* Match views on the device, as far as it goes. @param left  out: not all of them */
static int match_batch_on_device(struct disparity_run *run, const int *view, int count, bool *left)
{
    int err = 0;

    for (int i = 0; !err && i < count; i++) {
        bool this_one = false;

        if (run->device)
            err = match_on_device(run, view[i], &this_one);
        else
            disparity_device_note_cpu(run->cfg->device, run->refused);
        *left = *left || this_one;
    }
    return err;
}

/* Forget the descriptions of views whose rows are more than two away from those of these views. */
static void forget_far(struct disparity_run *run, const int *view, int count)
{
    const int cols = run->lf->cols, first = view[0] / cols, last = view[count - 1] / cols;

    for (int k = 0; k < run->lf->rows * cols; k++) {
        if (k / cols < sst_min_int(first, last) - 2 || k / cols > sst_max_int(first, last) + 2)
            sst_descriptor_fini(&run->desc[k]);
    }
}

/* Describe views and those around them, and match them. */
static int match_batch(void *arg, const int *index, int count)
{
    const struct match *m = arg;
    struct disparity_run *run = m->run;
    int view[SST_MAX_VIEWS], err;
    struct batch batch = { run, view };
    const int describing = run->nets ? m->threads : m->threads * run->inner; /* a network is one worker's */
    bool left = false;

    for (int i = 0; i < count; i++)
        view[i] = m->view[index[i]];
    forget_far(run, view, count);
    run->costs = !run->device;
    err = run_describe_for(run, view, count, describing);
    if (run->cfg->device)
        err = err ? err : match_batch_on_device(run, view, count, &left);
    if (left && !run->costs) {
        run->costs = true;
        err = err ? err : run_describe_for(run, view, count, describing);
    }
    err = err ? err : sst_parallel_for(count, m->threads, match_job, &batch);
    if (m->progress)
        m->progress(m->progress_arg, 0.9 * (index[count - 1] + 1) / m->count);
    return err;
}

static void matched_maps(void *arg, int index, struct sst_share_maps *out)
{
    const struct match *m = arg;
    struct disparity_run *run = m->run;
    const int view = m->view[index];

    sst_share_add_u16(out, &run->disp[view]);
    sst_share_add_u8(out, &run->confidence[view]);
    if (run->searched)
        sst_share_add_values(out, &run->searched[view], sizeof(run->searched[view]));
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

int run_match(struct disparity_run *run, int threads, sst_progress_fn *progress, void *progress_arg)
{
    const int views = run->lf->rows * run->lf->cols;
    struct match m = { run, calloc((size_t)views, sizeof(*m.view)), 0, threads, progress, progress_arg };
    int err = m.view ? sst_parallel_for(views, threads, init_maps, run) : -ENOMEM;

    for (int view = 0; m.view && view < views; view++) {
        if (run->lf->views[view].present && run_is_carried(run, view) == run->others)
            m.view[m.count++] = view;
    }
    err = err ? err : sst_share_batches(run->cfg->share, m.count, threads, match_batch, &m, matched_maps);
    free(m.view);
    return err;
}
