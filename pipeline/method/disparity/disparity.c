#include "pipeline/method/disparity/disparity.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/network/network.h"

/* Memory limit of the cost volumes of views that are matched at once. */
#define VOLUME_BUDGET_BYTES ((size_t)6 << 30)
/* Up to this range steps are quarter pixels, up to twice this range half pixels. */
#define FINE_RANGE_PX 24
/* Up to this many pixels a view is matched in quarter-pixel phases. */
#define FINE_PIXELS ((size_t)1200000)
/* Where only some views are matched, they are checked against others up to so many spacings away. */
#define CHECKED_FAR 3.5

/* State of one run; descriptors exist only while a grid row or its neighbours are matched. */
struct run {
    struct sst_lightfield *lf;
    const struct sst_disparity_config *cfg;
    struct sst_disparity_config census; /* what cfg points to with views_census */
    struct sst_network **nets;          /* [workers]; NULL without features */
    bool fill;
    bool *carried;                 /* [views] not matched, or after the key views; NULL: all are matched */
    bool others;                   /* the views that were to be carried are matched after all */
    int rounds;                    /* of the second pass */
    bool subpixel;                 /* refine between pixels */
    int scale, width, height;      /* of the images that are matched */
    int disp_min, range;           /* in pixels of those images; range + 1 whole disparities are searched */
    int divisor;                   /* steps per pixel */
    unsigned phases;               /* of the census that some pair of neighbours needs */
    struct sst_descriptor *desc;   /* [views] */
    struct sst_map_u16 *disp;      /* [views], at matching size */
    struct sst_map_u8 *confidence; /* [views] */
    struct sst_map_u8 *status;     /* [views] */
    struct sst_map_u16 *filled;    /* [views] */
    struct sst_volume shape;       /* without memory: disparities, steps and phases of a whole view's volume */
    struct sst_volume *volumes;    /* [workers] of whole views, or with `coarse` of tiles */
    struct sst_tiles *tiles;       /* [workers] */
    struct sst_lightfield *coarse; /* disparities at SST_COARSER times fewer pixels per side; NULL: not skip_ranges */
    double *searched;              /* [views] part of the disparities in the windows of its tiles, 0..1 */
    int first_view;                /* of the current grid row */
};

static int check_config(const struct sst_lightfield *lf, const struct sst_disparity_config *cfg)
{
    const double range = cfg->disp_max_px - cfg->disp_min_px;
    int neighbours = 0;

    if (!(range > 0) || range + 1 > SST_DISPARITY_MAX_STEPS || !(fabs(cfg->disp_min_px) < 1e4)) {
        sst_log_error("the disparity range %g..%g px is invalid: it must be ascending and span at most %d px",
                      cfg->disp_min_px, cfg->disp_max_px, SST_DISPARITY_MAX_STEPS - 1);
        return -EINVAL;
    }
    if ((cfg->paths != 4 && cfg->paths != 8) || cfg->p1 < 1 || cfg->p2 < cfg->p1 ||
        cfg->p2 > SST_DISPARITY_MAX_PENALTY || cfg->support_arm < 0 || cfg->support_arm > SST_SUPPORT_MAX_ARM ||
        (cfg->scale != 1 && cfg->scale != 2) || cfg->phase_step < 0 || cfg->phase_step > 2 || cfg->rounds < 0 ||
        cfg->rounds > SST_DISPARITY_MAX_ROUNDS || cfg->key_spacing < 0 || cfg->key_spacing > 5 ||
        cfg->subpixel_steps < 0 || cfg->subpixel_steps > SST_SUBPIXEL_MOST ||
        (cfg->subpixel_steps && (cfg->subpixel_views < 1 || cfg->subpixel_views > SST_SUBPIXEL_VIEWS))) {
        sst_log_error("matching parameters are outside their ranges: paths 4 or 8, 0 < P1 <= P2 <= %d, arm 0..%d, "
                      "rounds 0..%d",
                      SST_DISPARITY_MAX_PENALTY, SST_SUPPORT_MAX_ARM, SST_DISPARITY_MAX_ROUNDS);
        return -EINVAL;
    }
    for (int view = 0; view < lf->rows * lf->cols; view++) {
        const int col = view % lf->cols;

        if (!lf->views[view].present)
            continue;
        neighbours += col + 1 < lf->cols && lf->views[view + 1].present;
        neighbours += view + lf->cols < lf->rows * lf->cols && lf->views[view + lf->cols].present;
    }
    if (!neighbours) {
        sst_log_error("disparity needs two neighbouring views; this light field of %dx%d has none", lf->rows, lf->cols);
        return -EINVAL;
    }
    return 0;
}

static int cancelled(const struct run *run)
{
    return run->cfg->cancel && *run->cfg->cancel ? -ECANCELED : 0;
}

static int describe_job(void *arg, int index, int worker)
{
    struct run *run = arg;
    const int view = run->first_view + index;
    const struct sst_view *v = &run->lf->views[view];
    int err;

    if (run->desc[view].luma.data || !v->present)
        return 0;
    err = cancelled(run);
    err = err ? err
              : sst_descriptor_init(&run->desc[view], &v->image, run->scale, run->cfg->cost,
                                    run->nets ? run->nets[worker] : NULL);
    if (!err && v->valid.data)
        err = sst_disparity_mask_reduce(&run->desc[view].seen, &v->valid, run->scale);
    return err || run->cfg->frugal ? err : sst_descriptor_add_phases(&run->desc[view], run->phases);
}

/* View at (row + dr, col + dc), or -1. */
static int view_at(const struct sst_lightfield *lf, int view, int dr, int dc)
{
    const int row = view / lf->cols + dr, col = view % lf->cols + dc;

    if (row < 0 || col < 0 || row >= lf->rows || col >= lf->cols || !lf->views[row * lf->cols + col].present)
        return -1;
    return row * lf->cols + col;
}

/* (dr, dc): left, right, up, down; the diagonals; two steps left, right, up, down. */
static const int sides[SST_MAX_NEIGHBOURS][2] = { { 0, -1 }, { 0, 1 }, { -1, 0 }, { 1, 0 }, { -1, -1 }, { -1, 1 },
                                                  { 1, -1 }, { 1, 1 }, { 0, -2 }, { 0, 2 }, { -2, 0 },  { 2, 0 } };

/* Phases of a neighbour that one view alone needs. */
static int add_phases(struct run *run, int view, int neighbour)
{
    const struct sst_view *from = &run->lf->views[view], *to = &run->lf->views[neighbour];

    return sst_descriptor_add_phases(&run->desc[neighbour],
                                     sst_volume_phases(&run->shape, to->bx - from->bx, to->by - from->by));
}

static void drop_phases(struct run *run)
{
    for (int view = 0; view < run->lf->rows * run->lf->cols; view++)
        sst_descriptor_drop_phases(&run->desc[view]);
}

/* Match the tiles of one view. */
static int search_tiles(struct run *run, struct sst_tiles *tiles, struct sst_volume *v, int view,
                        const struct sst_neighbour *neighbours, int count, const struct sst_support *support,
                        struct sst_map_u16 *disp, struct sst_map_u8 *confidence)
{
    const struct sst_image *img = &run->desc[view].image;
    const int rounds = run->cfg->support_arm ? run->cfg->support_before : 0;
    struct sst_disparity_sgm_penalties penalties;
    int err = 0;

    sst_disparity_sgm_penalties_init(&penalties, run->cfg);
    for (int i = 0; !err && i < tiles->rows * tiles->columns; i++) {
        err = cancelled(run);
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

static struct sst_coarse coarse_view(const struct run *run, int view)
{
    return (struct sst_coarse){ &run->coarse->views[view].disp, (int)run->coarse->disp_min_px, SST_COARSER };
}

static int match_tiles(struct run *run, struct sst_volume *v, struct sst_tiles *tiles, int view,
                       const struct sst_neighbour *neighbours, int count, const struct sst_support *support,
                       struct sst_map_u16 *disp, struct sst_map_u8 *confidence)
{
    const struct sst_coarse coarse = coarse_view(run, view);
    const int err = sst_tiles_init(tiles, run->width, 0, run->height, &run->shape, &coarse);

    if (err)
        return err;
    run->searched[view] = sst_tiles_share(tiles);
    return search_tiles(run, tiles, v, view, neighbours, count, support, disp, confidence);
}

/* Neighbours of the sides in first..last. @return their number, or -ENOMEM */
static int gather_neighbours(struct run *run, int view, int first, int last, struct sst_neighbour *neighbours)
{
    const struct sst_lightfield *lf = run->lf;
    int count = 0, err = 0;

    for (int s = first; s <= last && !err; s++) {
        const int n = view_at(lf, view, sides[s][0], sides[s][1]);

        if (n >= 0)
            neighbours[count++] = (struct sst_neighbour){ &run->desc[n], lf->views[n].bx - lf->views[view].bx,
                                                          lf->views[n].by - lf->views[view].by };
        if (n >= 0 && run->cfg->frugal)
            err = add_phases(run, view, n);
    }
    return err ? err : count;
}

/* Match one view against the neighbours of the sides in first..last into disp and confidence. */
static int match_sides(struct run *run, struct sst_volume *v, int view, int first, int last,
                       const struct sst_support *support, struct sst_map_u16 *disp, struct sst_map_u8 *confidence)
{
    const struct sst_disparity_config *cfg = run->cfg;
    struct sst_neighbour neighbours[SST_MAX_NEIGHBOURS];
    const int count = gather_neighbours(run, view, first, last, neighbours);
    int err = 0;

    if (count <= 0)
        return count ? count : -ENODATA;
    if (run->coarse) {
        err = match_tiles(run, v, &run->tiles[v - run->volumes], view, neighbours, count, support, disp, confidence);
        if (cfg->frugal)
            drop_phases(run);
        return err;
    }
    sst_volume_fill(v, &run->desc[view], neighbours, count);
    if (cfg->frugal)
        drop_phases(run);
    if (cfg->raw)
        return sst_volume_winner(v, true, disp, confidence);
    err = cancelled(run);
    err = err ? err : sst_disparity_support_aggregate(v, support, cfg->support_arm ? cfg->support_before : 0);
    err = err ? err : cancelled(run);
    err = err ? err : sst_disparity_sgm(v, &run->desc[view].image, cfg);
    if (!err && cfg->support_arm && cfg->support_after) {
        sst_volume_requantise(v);
        err = sst_disparity_support_aggregate(v, support, cfg->support_after);
    }
    return err ? err : sst_volume_winner(v, cfg->support_arm && cfg->support_after, disp, confidence);
}

static int match_apart(struct run *run, struct sst_volume *v, int view, const struct sst_support *support)
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

static bool is_carried(const struct run *run, int view)
{
    return run->carried && run->carried[view];
}

static int match_job(void *arg, int index, int worker)
{
    struct run *run = arg;
    const int view = run->first_view + index;
    struct sst_support support = { 0 };
    int err;

    if (!run->lf->views[view].present)
        return 0;
    err = cancelled(run);
    if (!run->disp[view].data) {
        err = err ? err : sst_map_u16_init(&run->disp[view], run->width, run->height);
        err = err ? err : sst_map_u8_init(&run->confidence[view], run->width, run->height);
    }
    if (!err && is_carried(run, view) != run->others)
        return 0;
    if (!err && run->cfg->support_arm && !run->cfg->raw)
        err =
            sst_disparity_support_init(&support, &run->desc[view].image, run->cfg->support_arm, run->cfg->support_tau);
    if (!err)
        err = run->cfg->joint ? match_sides(run, &run->volumes[worker], view, 0, run->cfg->neighbours - 1, &support,
                                            &run->disp[view], &run->confidence[view])
                              : match_apart(run, &run->volumes[worker], view, &support);
    sst_disparity_support_fini(&support);
    if (err == -ENODATA) { /* a view without neighbours: unknown everywhere, filled from distant views below */
        memset(run->disp[view].data, 0xFF, run->disp[view].stride * (size_t)run->height);
        return 0;
    }
    if (!err && !run->cfg->raw)
        err = sst_disparity_median5(&run->disp[view], &run->volumes[worker].lines);
    if (!err && !run->cfg->raw)
        err = sst_disparity_bilateral(&run->disp[view], &run->desc[view].luma, run->cfg->bilateral_tau);
    if (!err)
        forget_unseen(&run->disp[view], &run->desc[view].seen);
    return err;
}

static struct sst_checked_view checked_view(const struct run *run, int view, int n)
{
    const struct sst_view *from = &run->lf->views[view], *to = &run->lf->views[n];

    return (struct sst_checked_view){ &run->disp[n], &run->status[n], to->bx - from->bx, to->by - from->by };
}

/* The matched views at most CHECKED_FAR away. */
static int checked_keys(const struct run *run, int view, struct sst_checked_view *out)
{
    const struct sst_lightfield *lf = run->lf;
    int count = 0;

    for (int n = 0; n < lf->rows * lf->cols && count < SST_MAX_NEIGHBOURS; n++) {
        const struct sst_view *from = &lf->views[view], *to = &lf->views[n];

        if (n != view && to->present && !run->carried[n] && hypot(to->bx - from->bx, to->by - from->by) < CHECKED_FAR)
            out[count++] = checked_view(run, view, n);
    }
    return count;
}

/* Views one and two steps away on all sides; the nearer ones first. @return their number; *near of them are one step
 * away. */
static int checked_views(const struct run *run, int view, struct sst_checked_view *out, int *near)
{
    const struct sst_lightfield *lf = run->lf;
    int count = 0;

    for (int s = 0; s < SST_MAX_NEIGHBOURS; s++) {
        const int n = view_at(lf, view, sides[s][0], sides[s][1]);

        if (n >= 0)
            out[count++] = checked_view(run, view, n);
        if (s == 7)
            *near = count;
    }
    return count;
}

static int check_job(void *arg, int view, int worker SST_UNUSED)
{
    struct run *run = arg;
    struct sst_checked_view views[SST_MAX_NEIGHBOURS];
    int near, count, err;

    if (!run->lf->views[view].present)
        return 0;
    count = run->carried ? checked_keys(run, view, views) : checked_views(run, view, views, &near);
    err = cancelled(run);
    sst_map_u8_fini(&run->status[view]);
    err = err ? err : sst_map_u8_init(&run->status[view], run->width, run->height);
    if (!err && !is_carried(run, view))
        sst_disparity_check_views(&run->status[view], &run->disp[view], run->disp_min,
                                  run->carried ? 0 : run->range + 1, views, count);
    return err;
}

static int fill_job(void *arg, int view, int worker SST_UNUSED)
{
    struct run *run = arg;
    struct sst_map_u16 scratch = { 0 }, *out = &run->filled[view];
    struct sst_checked_view views[SST_MAX_NEIGHBOURS];
    int near, count, err;

    if (!run->lf->views[view].present)
        return 0;
    count = checked_views(run, view, views, &near);
    err = cancelled(run);
    err = err ? err : sst_map_u16_init(out, run->width, run->height);
    err = err ? err : sst_map_u16_init(&scratch, run->width, run->height);
    if (!err) {
        memcpy(out->data, run->disp[view].data, out->stride * (size_t)out->height);
        sst_fill_views(out, &run->status[view], run->disp_min, views, count, near, &scratch);
    }
    sst_map_u16_fini(&scratch);
    return err;
}

/* Scale the map up to the view's size (disparities in full-size pixels) and store it. */
static int deliver(struct run *run, int view)
{
    struct sst_view *v = &run->lf->views[view];
    struct sst_map_u16 *from = run->filled[view].data ? &run->filled[view] : &run->disp[view], disp = { 0 };
    const struct sst_map_u8 *conf_from = &run->confidence[view];
    struct sst_map_u8 conf = { 0 };
    int err = sst_map_u16_init(&disp, run->lf->width, run->lf->height);

    err = err ? err : sst_map_u8_init(&conf, run->lf->width, run->lf->height);
    if (err) {
        sst_map_u16_fini(&disp);
        return err;
    }
    for (int y = 0; y < disp.height; y++) {
        const uint16_t *in = sst_map_u16_row(from, y / run->scale);
        const uint8_t *conf_in = sst_map_u8_row(conf_from, y / run->scale);
        const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;
        const uint8_t *status = run->fill ? sst_map_u8_row(&run->status[view], y / run->scale) : NULL;

        for (int x = 0; x < disp.width; x++) {
            const bool seen = !valid || valid[x];
            const unsigned d = seen ? in[x / run->scale] : SST_DISP_NONE;

            sst_map_u16_row(&disp, y)[x] = (uint16_t)(d == SST_DISP_NONE ? d : d * (unsigned)run->scale);
            /* Filled pixels have confidence 0. */
            sst_map_u8_row(&conf, y)[x] = !seen || (status && status[x / run->scale]) ? 0 : conf_in[x / run->scale];
        }
    }
    sst_map_u16_fini(&v->disp);
    sst_map_u8_fini(&v->confidence);
    v->disp = disp;
    v->confidence = conf;
    return 0;
}

static int match_all(struct run *run, int threads, sst_progress_fn *progress, void *progress_arg)
{
    const struct sst_lightfield *lf = run->lf;
    int err = 0;

    for (int row = 0; !err && row < lf->rows; row++) {
        for (int r = row; !err && r <= sst_min_int(row + 2, lf->rows - 1); r++) {
            run->first_view = r * lf->cols;
            err = sst_parallel_for(lf->cols, threads, describe_job, run);
        }
        run->first_view = row * lf->cols;
        err = err ? err : sst_parallel_for(lf->cols, threads, match_job, run);
        for (int col = 0; row > 1 && col < lf->cols; col++)
            sst_descriptor_fini(&run->desc[(row - 2) * lf->cols + col]);
        if (progress)
            progress(progress_arg, 0.9 * (row + 1) / lf->rows);
    }
    return err;
}

static int steps_of(const struct run *run)
{
    return run->range * run->divisor + 1;
}

int sst_disparity_divisor(int range)
{
    /* Short ranges allow finer steps, and need them: the depth of such scenes spans few pixels. */
    return range <= FINE_RANGE_PX ? 4 : range <= 2 * FINE_RANGE_PX ? 2 : 1;
}

int sst_disparity_phase_step(const struct sst_disparity_config *cfg, int width, int height)
{
    /* Half pixels if the views are so large that 16 phases would need too much memory. */
    return cfg->phase_step ? cfg->phase_step : (size_t)width * (size_t)height > FINE_PIXELS ? 2 : 1;
}

/* One worker's: of a whole view, or of a tile. */
static int make_volume(const struct run *run, struct sst_volume *v)
{
    const int halo = 2 * SST_TILE_HALO(run->cfg->support_arm ? run->cfg->support_before : 0);
    const int width = run->coarse ? sst_min_int(SST_TILE_WIDTH + halo, run->width) : run->width;
    const int height = run->coarse ? sst_min_int(SST_TILE_HEIGHT + halo, run->height) : run->height;
    const int err = sst_volume_init(v, width, height, run->disp_min, steps_of(run));

    if (!err) {
        v->divisor = run->shape.divisor;
        v->phase_step = run->shape.phase_step;
    }
    return err;
}

/* Image and mask of a view at SST_COARSER times fewer pixels per side than those that are matched. */
static int reduce_view(struct sst_view *to, const struct sst_view *from, int factor)
{
    struct sst_image halves[2] = { { 0 }, { 0 } }; /* 4 = 2 * 2, 8 = 2 * 2 * 2 */
    const struct sst_image *last = &from->image;
    int err = 0;

    to->present = from->present;
    to->bx = from->bx;
    to->by = from->by;
    if (!from->present)
        return 0;
    for (int i = 0, f = factor; !err && f > 1; f /= 2, i++) {
        struct sst_image *half = f == 2 ? &to->image : &halves[i % 2];

        sst_image_fini(half);
        err = sst_image_halve(half, last);
        last = half;
    }
    sst_image_fini(&halves[0]);
    sst_image_fini(&halves[1]);
    return err || !from->valid.data ? err : sst_disparity_mask_reduce(&to->valid, &from->valid, factor);
}

static int reduce_job(void *arg, int view, int worker SST_UNUSED)
{
    struct run *run = arg;

    return reduce_view(&run->coarse->views[view], &run->lf->views[view], SST_COARSER * run->scale);
}

/* The light field at SST_COARSER times fewer pixels per side, all its views matched in whole steps. */
static int match_coarse(struct run *run, int threads)
{
    const struct sst_disparity_config cfg = { .disp_min_px = floor((double)run->disp_min / SST_COARSER),
                                              .disp_max_px = ceil((double)(run->disp_min + run->range) / SST_COARSER),
                                              .cost = SST_COST_CENSUS,
                                              .paths = 4,
                                              .p1 = run->cfg->p1,
                                              .p2 = run->cfg->p2,
                                              .edge_step = run->cfg->edge_step,
                                              .fill = true,
                                              .joint = true,
                                              .neighbours = run->cfg->neighbours,
                                              .scale = 1,
                                              .phase_step = 2,
                                              .frugal = run->cfg->frugal,
                                              .threads = threads,
                                              .whole_steps = true,
                                              .skip_ranges = true,
                                              .range_error = run->cfg->range_error,
                                              .cancel = run->cfg->cancel };
    struct sst_lightfield *c = run->coarse;
    int err = sst_lightfield_init(c, run->lf->rows, run->lf->cols);

    c->width = (run->width + SST_COARSER - 1) / SST_COARSER;
    c->height = (run->height + SST_COARSER - 1) / SST_COARSER;
    c->ref_view = run->lf->ref_view;
    err = err ? err : sst_parallel_for(c->rows * c->cols, threads, reduce_job, run);
    return err ? err : sst_disparity_lightfield(c, &cfg, NULL, NULL);
}

/* With short ranges tile by tile where the configuration allows it and that pays. */
static int make_coarse(struct run *run, int threads)
{
    const struct sst_disparity_config *cfg = run->cfg;

    if (!cfg->skip_ranges || cfg->raw || cfg->paths != 4 || !cfg->joint || (cfg->support_arm && cfg->support_after) ||
        !sst_coarse_pays(&run->shape) ||
        sst_volume_bytes(run->width, run->height, run->shape.steps) <= cfg->range_bytes)
        return 0;
    run->coarse = calloc(1, sizeof(*run->coarse));
    run->searched = calloc((size_t)(run->lf->rows * run->lf->cols), sizeof(*run->searched));
    return run->coarse && run->searched ? match_coarse(run, threads) : -ENOMEM;
}

/* Mean over the views that were matched. */
static void report_ranges(const struct run *run)
{
    double sum = 0;
    int count = 0;

    for (int view = 0; run->coarse && view < run->lf->rows * run->lf->cols; view++) {
        sum += run->searched[view];
        count += run->searched[view] > 0;
    }
    if (count && run->cfg->report)
        run->cfg->report->ranges_skipped = 100 * (1 - sum / count);
}

/* All phases that matching any view with one of its neighbours needs. */
static unsigned phases_needed(const struct run *run)
{
    const struct sst_lightfield *lf = run->lf;
    unsigned phases = 0;

    for (int view = 0; view < lf->rows * lf->cols; view++) {
        for (int s = 0; lf->views[view].present && s < SST_MAX_NEIGHBOURS; s++) {
            const int n = view_at(lf, view, sides[s][0], sides[s][1]);

            if (n >= 0)
                phases |= sst_volume_phases(&run->shape, lf->views[n].bx - lf->views[view].bx,
                                            lf->views[n].by - lf->views[view].by);
        }
    }
    return phases;
}

/* One network per worker, each with its share of the threads: views side by side need no waiting between layers. */
static int open_networks(struct run *run, int workers, int threads)
{
    int err = 0;

    if (!(run->cfg->cost & SST_COST_MCCNN))
        return 0;
    run->nets = calloc((size_t)workers, sizeof(*run->nets));
    if (!run->nets)
        return -ENOMEM;
    for (int i = 0; !err && i < workers; i++)
        err = sst_network_open(&run->nets[i], run->cfg->model, run->cfg->precision, threads / workers);
    return err ? err : sst_descriptor_check_network(run->nets[0], run->cfg->model, run->width, run->height);
}

/* The views as the steps after the first pass see them. @param seen  [views], zeroed; owned by the caller */
static int visible_views(const struct run *run, struct sst_visible_views *out, struct sst_map_u8 *seen)
{
    const struct sst_lightfield *lf = run->lf;
    int err = 0;

    *out = (struct sst_visible_views){ .view = calloc((size_t)(lf->rows * lf->cols), sizeof(*out->view)),
                                       .count = lf->rows * lf->cols,
                                       .scale = run->scale,
                                       .disp_min_px = run->disp_min,
                                       .range = run->range,
                                       .skip_hypotheses = run->cfg->skip_hypotheses,
                                       .report = run->cfg->report,
                                       .cancel = run->cfg->cancel };
    if (!out->view)
        return -ENOMEM;
    for (int k = 0; !err && k < out->count; k++) {
        const struct sst_view *v = &lf->views[k];

        if (v->present && v->valid.data)
            err = sst_disparity_mask_reduce(&seen[k], &v->valid, run->scale);
        out->view[k] = (struct sst_visible_view){ .image = v->present ? &v->image : NULL,
                                                  .seen = &seen[k],
                                                  .disp = &run->disp[k],
                                                  .confidence = &run->confidence[k],
                                                  .bx = v->bx,
                                                  .by = v->by,
                                                  .carried = is_carried(run, k) };
    }
    return err;
}

/* Check the matched views against each other, and measure what carrying would do to the reference view. */
static int check_keys(struct run *run, const struct sst_visible_views *in, int threads, double *error)
{
    const int ref = run->lf->ref_view, err = sst_parallel_for(in->count, threads, check_job, run);

    *error = NAN;
    return err || !run->lf->views[ref].present || run->carried[ref]
               ? err
               : sst_disparity_carry_error(in, run->status, ref, error);
}

/* Check the matched views against each other, and carry them to the others. */
static int carry(struct run *run, const struct sst_visible_views *in, int threads)
{
    double error;
    int err = check_keys(run, in, threads, &error);

    if (!err && run->cfg->report)
        run->cfg->report->views_error = error;
    err = err ? err : sst_disparity_carry(in, run->status, threads);
    for (int k = 0; !err && k < in->count; k++) {
        if (in->view[k].image)
            sst_fill_background(&run->disp[k]);
        if (in->view[k].image && *sst_map_u16_row(&run->disp[k], 0) == SST_DISP_NONE) /* nothing arrived: far away */
            memset(run->disp[k].data, 0, run->disp[k].stride * (size_t)run->height);
    }
    return err;
}

/* Give the carried views the key views' maps, unless they were matched. */
static int carry_unmatched(const struct run *run, const struct sst_visible_views *in, int threads)
{
    return run->others ? 0 : sst_disparity_carry(in, NULL, threads);
}

/* The second pass of the key views, then that of the others. */
static int repair_views(struct run *run, struct sst_visible_views *in, int threads)
{
    struct sst_map_u8 *agreed = calloc((size_t)in->count, sizeof(*agreed));
    int err = agreed ? carry_unmatched(run, in, threads) : -ENOMEM;

    err = err ? err : sst_disparity_visible(in, run->rounds, threads);
    for (int k = 0; !err && k < in->count; k++)
        in->view[k].agreed = &agreed[k];
    err = err ? err : carry_unmatched(run, in, threads);
    in->repair = true;
    err = err ? err : sst_disparity_visible(in, run->rounds, threads);
    for (int k = 0; k < in->count; k++) {
        in->view[k].carried = false;
        in->view[k].agreed = NULL;
        if (agreed)
            sst_map_u8_fini(&agreed[k]);
    }
    free(agreed);
    free(run->carried);
    run->carried = NULL;
    return err;
}

/* What improves all maps together: the second pass, the refinement between pixels, check, filling or carrying. */
static int finish_maps(struct run *run, int threads)
{
    const int count = run->lf->rows * run->lf->cols;
    struct sst_map_u8 *seen = calloc((size_t)count, sizeof(*seen));
    struct sst_visible_views in = { 0 };
    int err = seen ? visible_views(run, &in, seen) : -ENOMEM;

    if (run->rounds)
        err = err            ? err
              : run->carried ? repair_views(run, &in, threads)
                             : sst_disparity_visible(&in, run->rounds, threads);
    if (run->subpixel)
        err = err ? err : sst_disparity_subpixel(&in, run->cfg->subpixel_steps, run->cfg->subpixel_views, threads);
    if (run->carried) {
        err = err ? err : carry(run, &in, threads);
    } else if (run->fill) {
        err = err ? err : sst_parallel_for(count, threads, check_job, run);
        err = err ? err : sst_parallel_for(count, threads, fill_job, run);
    }
    for (int k = 0; seen && k < count; k++)
        sst_map_u8_fini(&seen[k]);
    free(seen);
    free(in.view);
    return err;
}

/* Match the views that were to be carried as well if the scene does not allow that: where the first pass's maps of the
 * key views give the reference view too many other disparities. */
static int match_others(struct run *run, int workers)
{
    struct sst_map_u8 *seen = calloc((size_t)(run->lf->rows * run->lf->cols), sizeof(*seen));
    struct sst_visible_views in = { 0 };
    const int ref = run->lf->ref_view;
    double error = NAN;
    int err = seen ? visible_views(run, &in, seen) : -ENOMEM;

    if (!err && run->lf->views[ref].present && !run->carried[ref])
        err = sst_disparity_carry_error(&in, NULL, ref, &error);
    if (!err && error <= run->cfg->key_error) {
        if (run->cfg->report)
            run->cfg->report->views_error = error;
    } else if (!err) {
        run->others = true;
        err = match_all(run, workers, NULL, NULL);
        if (run->cfg->report)
            run->cfg->report->views_skipped = 0;
    }
    for (int k = 0; seen && k < in.count; k++)
        sst_map_u8_fini(&seen[k]);
    free(seen);
    free(in.view);
    return err;
}

/* Match a row of tiles of the reference view in the whole range and in windows, and add the pixels that differ by more
 * than 1 px to *off. */
static int compare_ranges(struct run *run, struct sst_volume *v, const struct sst_neighbour *neighbours, int count,
                          const struct sst_support *support, int top, int *off)
{
    const int view = run->lf->ref_view;
    const struct sst_coarse coarse = coarse_view(run, view);
    struct sst_map_u16 disp[2] = { { 0 }, { 0 } };
    int err = 0;

    for (int windows = 0; !err && windows < 2; windows++) {
        struct sst_tiles *tiles = &run->tiles[0];

        err = sst_map_u16_init(&disp[windows], run->width, top + SST_TILE_HEIGHT);
        err =
            err ? err : sst_tiles_init(tiles, run->width, top, SST_TILE_HEIGHT, &run->shape, windows ? &coarse : NULL);
        err = err ? err : search_tiles(run, tiles, v, view, neighbours, count, support, &disp[windows], NULL);
    }
    for (int y = top; !err && y < top + SST_TILE_HEIGHT; y++) {
        const uint16_t *a = sst_map_u16_row(&disp[0], y), *b = sst_map_u16_row(&disp[1], y);

        for (int x = 0; x < run->width; x++)
            *off += abs(a[x] - b[x]) > (int)SST_DISP_SCALE;
    }
    sst_map_u16_fini(&disp[0]);
    sst_map_u16_fini(&disp[1]);
    return err;
}

/* Percent of the pixels in three rows of tiles of the reference view whose disparity the windows change. */
static int measure_ranges(struct run *run, int threads, double *error)
{
    const int view = run->lf->ref_view, row = view / run->lf->cols;
    const int last = (run->height / SST_TILE_HEIGHT - 1) * SST_TILE_HEIGHT;
    struct sst_neighbour neighbours[SST_MAX_NEIGHBOURS];
    struct sst_support support = { 0 };
    int err = 0, count, off = 0;

    *error = NAN;
    if (!run->lf->views[view].present)
        return 0;
    for (int r = sst_max_int(row - 2, 0); !err && r <= sst_min_int(row + 2, run->lf->rows - 1); r++) {
        run->first_view = r * run->lf->cols;
        err = sst_parallel_for(run->lf->cols, threads, describe_job, run);
    }
    count = err ? err : gather_neighbours(run, view, 0, run->cfg->neighbours - 1, neighbours);
    if (count <= 0)
        return count;
    if (run->cfg->support_arm)
        err =
            sst_disparity_support_init(&support, &run->desc[view].image, run->cfg->support_arm, run->cfg->support_tau);
    for (int i = 0; !err && i < 3; i++)
        err = compare_ranges(run, &run->volumes[0], neighbours, count, &support, last * (2 * i + 1) / 6, &off);
    sst_disparity_support_fini(&support);
    if (run->cfg->frugal)
        drop_phases(run);
    *error = 100.0 * off / (3.0 * run->width * SST_TILE_HEIGHT);
    return err;
}

static void free_coarse(struct run *run)
{
    if (run->coarse)
        sst_lightfield_fini(run->coarse);
    free(run->coarse);
    run->coarse = NULL;
}

static int make_volumes(struct run *run, int workers)
{
    int err = 0;

    for (int i = 0; i < workers; i++)
        sst_volume_fini(&run->volumes[i]);
    for (int i = 0; !err && i < workers; i++)
        err = make_volume(run, &run->volumes[i]);
    return err;
}

/* Volumes of tiles, or of whole views where windows change too many disparities: foliage, whose gaps no coarse map has.
 */
static int choose_ranges(struct run *run, int workers, int threads)
{
    double error;
    int err = make_volumes(run, workers);

    if (err || !run->coarse)
        return err;
    err = measure_ranges(run, threads, &error);
    if (!err && error <= run->cfg->range_error) {
        if (run->cfg->report)
            run->cfg->report->ranges_error = error;
        return 0;
    }
    free_coarse(run);
    return err ? err : make_volumes(run, workers);
}

static int run_all(struct run *run, int threads, sst_progress_fn *progress, void *progress_arg)
{
    const int views = run->lf->rows * run->lf->cols;
    const size_t each = sst_volume_bytes(run->width, run->height, steps_of(run));
    const int most = run->cfg->frugal ? 1 : sst_min_int(threads, run->lf->cols);
    const int workers = sst_clamp_int((int)(VOLUME_BUDGET_BYTES / each), 1, most);
    int err = make_coarse(run, threads);

    if (err)
        return err;
    run->volumes = calloc((size_t)workers, sizeof(*run->volumes));
    run->tiles = calloc((size_t)workers, sizeof(*run->tiles));
    if (!run->volumes || !run->tiles) {
        free(run->volumes);
        free(run->tiles);
        return -ENOMEM;
    }
    run->phases = phases_needed(run);
    err = open_networks(run, workers, threads);
    err = err ? err : choose_ranges(run, workers, threads);
    err = err ? err : match_all(run, workers, progress, progress_arg);
    if (run->carried && run->rounds)
        err = err ? err : match_others(run, workers);
    for (int i = 0; i < workers; i++) {
        sst_volume_fini(&run->volumes[i]);
        sst_tiles_fini(&run->tiles[i]);
        if (run->nets)
            sst_network_close(run->nets[i]);
    }
    for (int view = 0; view < views; view++)
        sst_descriptor_fini(&run->desc[view]);
    free(run->volumes);
    free(run->tiles);
    free(run->nets);
    report_ranges(run);
    err = err ? err : finish_maps(run, threads);
    for (int view = 0; !err && view < views; view++) {
        if (run->lf->views[view].present)
            err = deliver(run, view);
    }
    if (!err)
        run->lf->disp_min_px = (double)run->disp_min * run->scale;
    if (!err && progress)
        progress(progress_arg, 1.0);
    return err;
}

/*
 * What many views decide in the second pass, learned costs and more paths in the first one do not improve. Where they
 * span few pixels, the learned cost, whose features are those of whole pixels, hides what the census finds between
 * them: the census alone is better, and with it half the penalties are enough.
 */
static void set_views_census(struct run *run, int present)
{
    const bool narrow = run->range < SST_VISIBLE_RANGE;

    if (run->cfg->raw || !run->cfg->views_census || present < SST_VISIBLE_LEAST || (!narrow && !run->cfg->rounds))
        return;
    run->census = *run->cfg;
    run->census.cost = SST_COST_CENSUS;
    if (narrow) {
        run->census.p1 = sst_max_int(run->cfg->p1 / 2, 1);
        run->census.p2 = sst_max_int(run->cfg->p2 / 2, run->census.p1);
    } else {
        run->census.paths = 4;
    }
    run->cfg = &run->census;
}

static int choose_keys(struct run *run, int present)
{
    const struct sst_lightfield *lf = run->lf;
    int keys;

    run->carried = calloc((size_t)(lf->rows * lf->cols), sizeof(*run->carried));
    if (!run->carried)
        return -ENOMEM;
    keys = sst_disparity_keys(lf, run->cfg->key_spacing, run->carried);
    if (run->cfg->report)
        run->cfg->report->views_skipped = 100.0 * (present - keys) / present;
    return 0;
}

static int run_init(struct run *run, struct sst_lightfield *lf, const struct sst_disparity_config *cfg)
{
    const size_t views = (size_t)(lf->rows * lf->cols);
    int present = 0;

    *run = (struct run){ .lf = lf, .cfg = cfg, .scale = cfg->scale, .fill = cfg->fill && !cfg->raw };
    run->width = (lf->width + cfg->scale - 1) / cfg->scale;
    run->height = (lf->height + cfg->scale - 1) / cfg->scale;
    run->disp_min = (int)floor(cfg->disp_min_px / cfg->scale);
    run->range = (int)ceil(cfg->disp_max_px / cfg->scale) - run->disp_min;
    run->divisor = cfg->whole_steps ? 1 : sst_disparity_divisor(run->range);
    run->shape = (struct sst_volume){ .width = run->width,
                                      .height = run->height,
                                      .disp_min = run->disp_min,
                                      .steps = steps_of(run),
                                      .divisor = run->divisor,
                                      .phase_step = sst_disparity_phase_step(cfg, run->width, run->height) };
    for (size_t k = 0; k < views; k++)
        present += lf->views[k].present;
    set_views_census(run, present);
    run->rounds = cfg->raw || present < SST_VISIBLE_LEAST || run->range < SST_VISIBLE_RANGE ? 0 : cfg->rounds;
    lf->disparity_tested = run->rounds > 0;
    run->subpixel =
        cfg->subpixel_steps > 0 && !cfg->raw && present >= SST_VISIBLE_LEAST && run->range <= SST_SUBPIXEL_RANGE;
    run->desc = calloc(views, sizeof(*run->desc));
    run->disp = calloc(views, sizeof(*run->disp));
    run->confidence = calloc(views, sizeof(*run->confidence));
    run->status = calloc(views, sizeof(*run->status));
    run->filled = calloc(views, sizeof(*run->filled));
    if (!run->desc || !run->disp || !run->confidence || !run->status || !run->filled)
        return -ENOMEM;
    /* A range too narrow for the second pass is too narrow for carried maps. */
    return cfg->key_spacing > 1 && run->fill && cfg->joint && present >= SST_VISIBLE_LEAST &&
                   (run->rounds || !cfg->rounds)
               ? choose_keys(run, present)
               : 0;
}

static void run_fini(struct run *run)
{
    for (int view = 0; view < run->lf->rows * run->lf->cols; view++) {
        if (run->desc)
            sst_descriptor_fini(&run->desc[view]);
        if (run->disp)
            sst_map_u16_fini(&run->disp[view]);
        if (run->confidence)
            sst_map_u8_fini(&run->confidence[view]);
        if (run->status)
            sst_map_u8_fini(&run->status[view]);
        if (run->filled)
            sst_map_u16_fini(&run->filled[view]);
    }
    free_coarse(run);
    free(run->searched);
    free(run->carried);
    free(run->desc);
    free(run->disp);
    free(run->confidence);
    free(run->status);
    free(run->filled);
}

int sst_disparity_lightfield(struct sst_lightfield *lf, const struct sst_disparity_config *cfg,
                             sst_progress_fn *progress, void *progress_arg)
{
    const int threads = sst_thread_count(cfg->threads);
    struct run run;
    int err = check_config(lf, cfg);

    if (err)
        return err;
    if (cfg->report)
        *cfg->report = (struct sst_disparity_report){ NAN, NAN, NAN, NAN, NAN, NAN };
    err = run_init(&run, lf, cfg);
    if (!err)
        err = run_all(&run, threads, progress, progress_arg);
    if (err == -ENOMEM)
        sst_log_error("not enough memory to match %d disparities at %dx%d; use fewer threads or a narrower range",
                      run.range + 1, run.width, run.height);
    run_fini(&run);
    return err;
}

int sst_disparity_stereo(struct sst_map_f32 *out, const struct sst_image *left, const struct sst_image *right,
                         const struct sst_disparity_config *cfg)
{
    struct sst_lightfield lf;
    int err;

    if (left->width != right->width || left->height != right->height) {
        sst_log_error("the pair differs in size: left %dx%d, right %dx%d", left->width, left->height, right->width,
                      right->height);
        return -EBADMSG;
    }
    err = sst_lightfield_init(&lf, 1, 2);
    if (err)
        return err;
    lf.width = left->width;
    lf.height = left->height;
    /* The pair is a light field of one row; its images are borrowed. */
    lf.views[0].present = lf.views[1].present = true;
    lf.views[0].image = *left;
    lf.views[1].image = *right;
    err = check_config(&lf, cfg);
    if (!err && cfg->paths == 4 && !cfg->raw && cfg->fill && !(cfg->support_arm && cfg->support_after)) {
        err = sst_disparity_pair(out, left, right, cfg);
        goto done;
    }
    err = err ? err : sst_disparity_lightfield(&lf, cfg, NULL, NULL);
    err = err ? err : sst_map_f32_init(out, left->width, left->height);
    for (int y = 0; !err && y < left->height; y++) {
        const uint16_t *d = sst_map_u16_row(&lf.views[0].disp, y);

        for (int x = 0; x < left->width; x++)
            sst_map_f32_row(out, y)[x] = d[x] == SST_DISP_NONE ? INFINITY : (float)sst_disp_px(&lf, d[x]);
    }
done:
    lf.views[0].image = lf.views[1].image = (struct sst_image){ 0 };
    sst_lightfield_fini(&lf);
    return err;
}
