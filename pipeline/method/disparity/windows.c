/* Windows of disparities: from a match of all views at fewer pixels, and what they change. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

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
    struct disparity_run *run = arg;

    return reduce_view(&run->coarse->views[view], &run->lf->views[view], SST_COARSER * run->scale);
}

/* The light field at SST_COARSER times fewer pixels per side, all its views matched in whole steps. */
static int match_coarse(struct disparity_run *run, int threads)
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
                                              .cancel = run->cfg->cancel,
                                              .share = run->cfg->share,
                                              .runner = run->cfg->runner };
    struct sst_lightfield *c = run->coarse;
    int err = sst_lightfield_init(c, run->lf->rows, run->lf->cols);

    c->width = (run->width + SST_COARSER - 1) / SST_COARSER;
    c->height = (run->height + SST_COARSER - 1) / SST_COARSER;
    c->ref_view = run->lf->ref_view;
    err = err ? err : sst_parallel_for(c->rows * c->cols, threads, reduce_job, run);
    return err ? err : sst_disparity_lightfield(c, &cfg, NULL, NULL);
}

int run_make_coarse(struct disparity_run *run, int threads)
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

void run_report_ranges(const struct disparity_run *run)
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

/* The neighbours of the reference view, with what matching on the CPU needs as run->costs has it. */
static int gather_compared(struct windows_compared *c)
{
    struct disparity_run *run = c->run;
    const int view = run->lf->ref_view, err = run_describe_for(run, &view, 1, c->workers);

    c->count = err ? err : run_gather_neighbours(run, view, 0, run->cfg->neighbours - 1, c->neighbours);
    return c->count < 0 ? c->count : 0;
}

static bool is_compared(const void *job SST_UNUSED, int item SST_UNUSED)
{
    return true;
}

static void compared_source(const void *job, int view, struct sst_plane_source *out)
{
    run_match_source(((const struct windows_compared *)job)->run, view, out);
}

int windows_lay_out(const struct windows_compared *c, int item, struct sst_tiles *tiles)
{
    const struct disparity_run *run = c->run;
    const struct sst_coarse coarse = run_coarse_view(run, run->lf->ref_view);

    return sst_tiles_init(tiles, run->width, c->top[item / 2], SST_TILE_HEIGHT, &run->shape, item % 2 ? &coarse : NULL);
}

/* Inputs of the CPU alone. */
static int make_costs(void *job)
{
    struct windows_compared *c = job;
    const struct sst_disparity_config *cfg = c->run->cfg;
    int err;

    c->run->costs = true;
    err = gather_compared(c);
    if (!err && cfg->support_arm)
        err = sst_disparity_support_init(&c->support, &c->run->desc[c->run->lf->ref_view].image, cfg->support_arm,
                                         cfg->support_tau, c->workers);
    return err;
}

static int compare_job(void *job, int item, int worker)
{
    struct windows_compared *c = job;
    struct disparity_run *run = c->run;
    const int err = windows_lay_out(c, item, &run->tiles[worker]);

    return err ? err
               : run_search_tiles(run, &run->tiles[worker], &run->volumes[worker], run->lf->ref_view, c->neighbours,
                                  c->count, &c->support, &c->disp[item], NULL);
}

const struct sst_step disparity_compare_step = {
    .name = "matching", .wants = is_compared, .source = compared_source, .host = make_costs, .cpu = compare_job
};

/* Pixels of a row of tiles that differ by more than 1 px. */
static int count_off(const struct windows_compared *c, int i)
{
    int off = 0;

    for (int y = c->top[i]; y < c->top[i] + SST_TILE_HEIGHT; y++) {
        const uint16_t *a = sst_map_u16_row(&c->disp[2 * i], y), *b = sst_map_u16_row(&c->disp[2 * i + 1], y);

        for (int x = 0; x < c->run->width; x++)
            off += abs(a[x] - b[x]) > (int)SST_DISP_SCALE;
    }
    return off;
}

/* What one process measures for all. */
struct measured {
    struct disparity_run *run;
    int workers;
    double error;
};

static void measured_values(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct measured *m = arg;

    sst_share_add_values(out, &m->error, sizeof(m->error));
}

/* Percent of the pixels in some rows of tiles of the reference view whose disparity the windows change. */
static int measure_ranges(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct measured *m = arg;
    struct disparity_run *run = m->run;
    const int last = (run->height / SST_TILE_HEIGHT - 1) * SST_TILE_HEIGHT;
    const struct sst_run_options how = { .threads = m->workers, .cancel = run->cfg->cancel };
    struct windows_compared c = { .run = run, .workers = m->workers };
    int err, off = 0;

    if (!run->lf->views[run->lf->ref_view].present)
        return 0;
    run->costs = !run->cfg->runner;
    err = gather_compared(&c);
    if (err || !c.count)
        return err;
    for (int i = 0; i < 2 * WINDOWS_COMPARED && !err; i++) {
        c.top[i / 2] = last * (i / 2 * 2 + 1) / (2 * WINDOWS_COMPARED);
        err = sst_map_u16_init(&c.disp[i], run->width, c.top[i / 2] + SST_TILE_HEIGHT);
    }
    err = err ? err : sst_run(run->cfg->runner, &disparity_compare_step, &c, 2 * WINDOWS_COMPARED, &how);
    for (int i = 0; i < WINDOWS_COMPARED && !err; i++)
        off += count_off(&c, i);
    for (int i = 0; i < 2 * WINDOWS_COMPARED; i++)
        sst_map_u16_fini(&c.disp[i]);
    sst_disparity_support_fini(&c.support);
    if (run->cfg->frugal)
        run_drop_phases(run);
    m->error = 100.0 * off / ((double)WINDOWS_COMPARED * run->width * SST_TILE_HEIGHT);
    return err;
}

int run_measure_ranges(struct disparity_run *run, int workers, double *error)
{
    struct measured m = { .run = run, .workers = workers, .error = NAN };
    const int err = sst_share_for(run->cfg->share, 1, 1, measure_ranges, &m, measured_values);

    *error = m.error;
    return err;
}

void run_free_coarse(struct disparity_run *run)
{
    if (run->coarse)
        sst_lightfield_fini(run->coarse);
    free(run->coarse);
    run->coarse = NULL;
}
