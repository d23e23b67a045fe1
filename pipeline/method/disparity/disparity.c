/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/disparity/disparity.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/method/disparity/disparity_internal.h"
#include "pipeline/method/disparity/pair_internal.h"

/* Memory limit of the cost volumes of views that are matched at once: of volumes that several threads can share, with
 * the census of views, ... */
#define SHARED_BYTES ((size_t)3 << 29)
/* ... and of others. */
#define VOLUME_BYTES ((size_t)6 << 30)
/* Times key_error above which key views of half size show that key views miss. */
#define KEYS_MISS 2
/* Percent of the reference view, by samples, above which maps of half size miss surfaces. */
#define MISSED_MOST 12

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
        (cfg->scale != 1 && cfg->scale != 2) || cfg->guided_rounds < 0 ||
        cfg->guided_rounds > SST_DISPARITY_MAX_ROUNDS || cfg->phase_step < 0 || cfg->phase_step > 2 ||
        cfg->rounds < 0 || cfg->rounds > SST_DISPARITY_MAX_ROUNDS || cfg->key_spacing < 0 || cfg->key_spacing > 5 ||
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

/* A row of the map at full size, disparities in pixels of that size. Filled pixels have confidence 0. */
static void deliver_row(uint16_t *disp, uint8_t *conf, const struct disparity_run *run, int view, int row)
{
    const struct sst_map_u16 *from = run->filled[view].data ? &run->filled[view] : &run->disp[view];
    const uint16_t *in = sst_map_u16_row(from, row);
    const uint8_t *conf_in = sst_map_u8_row(&run->confidence[view], row);
    const uint8_t *status = run->fill ? sst_map_u8_row(&run->status[view], row) : NULL;
    const int width = run->lf->width, pairs = (width + 1) / 2; /* an odd row's last one ends in its padding */

    if (run->scale == 1) {
        memcpy(disp, in, (size_t)width * sizeof(*disp));
        for (int x = 0; x < width; x++)
            conf[x] = (uint8_t)(status && status[x] ? 0 : conf_in[x]);
        return;
    }
    for (int x = 0; x < pairs; x++)
        disp[2 * x] = disp[2 * x + 1] = (uint16_t)(in[x] == SST_DISP_NONE ? in[x] : 2 * in[x]);
    for (int x = 0; x < pairs; x++)
        conf[2 * x] = conf[2 * x + 1] = (uint8_t)(status && status[x] ? 0 : conf_in[x]);
}

/* Unseen pixels have neither. */
static void deliver_unseen(uint16_t *disp, uint8_t *conf, const uint8_t *valid, int width)
{
    for (int x = 0; x < width; x++) {
        disp[x] = valid[x] ? disp[x] : (uint16_t)SST_DISP_NONE;
        conf[x] = valid[x] ? conf[x] : 0;
    }
}

/* Scale the map up to the view's size and store it. */
static int deliver(void *arg, int view, int worker SST_UNUSED)
{
    struct disparity_run *run = arg;
    struct sst_view *v = &run->lf->views[view];
    struct sst_map_u16 disp = { 0 };
    struct sst_map_u8 conf = { 0 };
    int err;

    if (!v->present)
        return 0;
    err = sst_map_u16_init(&disp, run->lf->width, run->lf->height);
    err = err ? err : sst_map_u8_init(&conf, run->lf->width, run->lf->height);
    if (err) {
        sst_map_u16_fini(&disp);
        return err;
    }
    for (int y = 0; y < disp.height; y++) {
        uint16_t *disp_row = sst_map_u16_row(&disp, y);
        uint8_t *conf_row = sst_map_u8_row(&conf, y);

        if (y % run->scale && !v->valid.data) { /* that above */
            memcpy(disp_row, sst_map_u16_row(&disp, y - 1), disp.stride);
            memcpy(conf_row, sst_map_u8_row(&conf, y - 1), conf.stride);
            continue;
        }
        deliver_row(disp_row, conf_row, run, view, y / run->scale);
        if (v->valid.data)
            deliver_unseen(disp_row, conf_row, sst_map_u8_row(&v->valid, y), disp.width);
    }
    sst_map_u16_fini(&v->disp);
    sst_map_u8_fini(&v->confidence);
    v->disp = disp;
    v->confidence = conf;
    return 0;
}

static int steps_of(const struct disparity_run *run)
{
    return run->range * run->divisor + 1;
}

int run_make_volume(const struct disparity_run *run, struct sst_volume *v)
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

/* One network per worker, each with its share of the threads: views side by side need no waiting between layers. */
static int open_networks(struct disparity_run *run, int threads)
{
    int err = 0;

    if (!(run->cfg->cost & SST_COST_MCCNN))
        return 0;
    run->networks = run->workers;
    run->nets = calloc((size_t)run->networks, sizeof(*run->nets));
    if (!run->nets)
        return -ENOMEM;
    for (int i = 0; !err && i < run->networks; i++)
        err = sst_network_open(&run->nets[i], run->cfg->model, run->cfg->precision, threads / run->networks);
    for (int i = 0; !err && i < run->networks; i++)
        sst_network_use_runner(run->nets[i], run->cfg->networks);
    return err ? err : sst_descriptor_check_network(run->nets[0], run->cfg->model, run->width, run->height);
}

int run_visible_views(const struct disparity_run *run, struct sst_visible_views *out, struct sst_map_u8 *seen)
{
    const struct sst_lightfield *lf = run->lf;
    int err = 0;

    *out = (struct sst_visible_views){ .view = calloc((size_t)(lf->rows * lf->cols), sizeof(*out->view)),
                                       .count = lf->rows * lf->cols,
                                       .scale = run->scale,
                                       .disp_min_px = run->disp_min,
                                       .range = run->range,
                                       .smooth = run->carried && !run->others,
                                       .skip_hypotheses = run->cfg->skip_hypotheses,
                                       .report = run->cfg->report,
                                       .cancel = run->cfg->cancel,
                                       .share = run->cfg->share,
                                       .runner = run->cfg->runner };
    if (!out->view)
        return -ENOMEM;
    for (int k = 0; !err && k < out->count; k++) {
        const struct sst_view *v = &lf->views[k];

        if (v->present && v->valid.data)
            err = sst_disparity_mask_reduce(&seen[k], &v->valid, run->scale);
        out->view[k] =
            (struct sst_visible_view){ .image = v->present ? &v->image : NULL,
                                       .seen = &seen[k],
                                       .disp = &run->disp[k],
                                       .confidence = &run->confidence[k],
                                       .bx = v->bx,
                                       .by = v->by,
                                       .agreed = run->settled && run->settled[k].data ? &run->settled[k] : NULL,
                                       .carried = !run->settled && run_is_carried(run, k) };
    }
    out->swept = run->settled;
    return err;
}

/* Check the matched views against each other, and carry them to the others. */
static int carry(struct disparity_run *run, const struct sst_visible_views *in, int threads)
{
    double error = NAN;
    int err = run_step(run, &disparity_check_step, threads);

    err = err ? err : run_carrying_error(run, in, run->status, &error);
    if (!err && run->cfg->report)
        run->cfg->report->views_error = error;
    err = err ? err : sst_disparity_carry(in, run->status, threads);
    return err ? err : run_fill_background(run, threads);
}

/* The second pass of the key views, then of all other views, to which maps are carried unless they were matched. */
static int repair_views(struct disparity_run *run, struct sst_visible_views *in, int threads)
{
    struct sst_map_u8 *agreed = calloc((size_t)in->count, sizeof(*agreed));
    const int err = agreed ? sst_disparity_repair(in, agreed, !run->others, run->rounds, threads) : -ENOMEM;

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
static int finish_maps(struct disparity_run *run, int threads)
{
    const int count = run->lf->rows * run->lf->cols;
    struct sst_map_u8 *seen = calloc((size_t)count, sizeof(*seen));
    struct sst_visible_views in = { 0 };
    int err = seen ? run_visible_views(run, &in, seen) : -ENOMEM;

    if (run->settled) { /* all views have maps of their own */
        free(run->carried);
        run->carried = NULL;
    }
    if (run->rounds)
        err = err            ? err
              : run->carried ? repair_views(run, &in, threads)
                             : sst_disparity_visible(&in, run->rounds, threads);
    if (run->subpixel)
        err = err ? err : sst_disparity_subpixel(&in, run->cfg->subpixel_steps, run->cfg->subpixel_views, threads);
    if (run->carried) {
        err = err ? err : carry(run, &in, threads);
    } else if (run->fill) {
        err = err ? err : run_step(run, &disparity_check_step, threads);
        err = err ? err : run_step(run, &disparity_fill_step, threads);
        if (run->settled && run->foliage && run->scale == 1)
            err = err ? err : sst_disparity_lift(&in, run->filled, run->status, threads);
    }
    for (int k = 0; seen && k < count; k++)
        sst_map_u8_fini(&seen[k]);
    free(seen);
    free(in.view);
    return err;
}

/* Views at once, and threads for each; views one by one, where their census needs a cache.
 * @return bytes of the cache; 0: none */
static size_t count_workers(struct disparity_run *run, int threads)
{
    const struct sst_disparity_config *cfg = run->cfg;
    const size_t each = sst_volume_bytes(run->width, run->height, steps_of(run));
    const bool shared = !run->coarse && !cfg->frugal && !cfg->raw && cfg->joint && cfg->paths == 4 &&
                        !(cfg->support_arm && cfg->support_after);
    const size_t bytes = cfg->memory ? cfg->memory : shared ? SHARED_BYTES : VOLUME_BYTES;
    const int most = cfg->frugal ? 1 : sst_min_int(run->nets ? run->networks : threads, run->lf->cols);

    const bool bounded = shared && !cfg->runner && !(cfg->cost & SST_COST_MCCNN);
    const size_t census = bounded ? run_census_bytes(run) : 0;

    run->workers = (int)(bytes / each) < most ? sst_max_int((int)(bytes / each), 1) : most;
    if ((size_t)run->workers * each + census <= bytes || census < bytes / 4) {
        run->inner = shared ? threads / run->workers : 1;
        return 0;
    }
    run->workers = 1;
    run->inner = threads;
    return bytes / 2 > each ? bytes / 2 - each : 1; /* more than half of all gains little */
}

static void free_volumes(struct disparity_run *run)
{
    run_free_census_cache(run);
    for (int i = 0; i < run->workers; i++)
        sst_volume_fini(&run->volumes[i]);
    for (int i = 0; i < run->workers * run->inner; i++)
        sst_volume_fini(&run->parts[i]);
}

static int make_volumes(struct disparity_run *run, int threads)
{
    size_t cache;
    int err = 0;

    free_volumes(run);
    cache = count_workers(run, threads);
    for (int i = 0; !err && i < run->workers; i++)
        err = run_make_volume(run, &run->volumes[i]);
    if (!err && cache)
        err = run_make_census_cache(run, cache);
    for (int i = 0; !err && run->inner > 1 && i < run->workers * run->inner; i++)
        err = sst_volume_share(&run->parts[i], &run->volumes[i / run->inner]);
    return err;
}

/* Free descriptions and volumes of the first pass. */
static void free_matching(struct disparity_run *run)
{
    free_volumes(run);
    for (int i = 0; i < run->workers; i++)
        sst_tiles_fini(&run->tiles[i]);
    for (int view = 0; view < run->lf->rows * run->lf->cols; view++)
        sst_descriptor_fini(&run->desc[view]);
}

/* The reference view and the key views that its map would be carried from, the only ones not to be carried for now;
 * with other key views, so that no worker is idle. */
static int choose_probed(struct disparity_run *run, const struct sst_visible_views *in, int workers)
{
    int source[CARRY_SOURCES];
    const int count = run_carry_sources(in, run->lf->ref_view, source);
    int idle = (workers - (count + 1) % workers) % workers;

    for (int k = 0; k < in->count; k++)
        run->carried[k] = k != run->lf->ref_view || in->view[k].carried;
    for (int i = 0; i < count; i++)
        run->carried[source[i]] = false;
    for (int k = 0; k < in->count && idle; k++) {
        if (run->carried[k] && in->view[k].image && !in->view[k].carried) {
            run->carried[k] = false;
            idle--;
        }
    }
    return sst_min_int(count, 0);
}

/* The share of the reference view that carrying would change, by as few matched views as show it. */
static int probe_carrying(struct disparity_run *run, int workers, double *error)
{
    const int count = run->lf->rows * run->lf->cols;
    struct sst_map_u8 *seen = calloc((size_t)count, sizeof(*seen));
    bool *keys = malloc((size_t)count * sizeof(*keys));
    struct sst_visible_views in = { 0 };
    int err = seen && keys ? run_visible_views(run, &in, seen) : -ENOMEM;

    if (keys)
        memcpy(keys, run->carried, (size_t)count * sizeof(*keys));
    err = err ? err : choose_probed(run, &in, workers);
    err = err ? err : run_match(run, workers, NULL, NULL);
    for (int k = 0; !err && k < count; k++)
        in.view[k].carried = run->carried[k];
    err = err ? err : run_carrying_error(run, &in, NULL, error);
    if (keys)
        memcpy(run->carried, keys, (size_t)count * sizeof(*keys));
    for (int k = 0; seen && k < count; k++)
        sst_map_u8_fini(&seen[k]);
    free(keys);
    free(seen);
    free(in.view);
    return err;
}

/* Allocate for as many workers as there may be. */
static int allocate_workers(struct disparity_run *run, int threads)
{
    run->volumes = calloc((size_t)threads, sizeof(*run->volumes));
    run->parts = calloc((size_t)threads, sizeof(*run->parts));
    run->tiles = calloc((size_t)threads, sizeof(*run->tiles));
    return run->volumes && run->parts && run->tiles ? 0 : -ENOMEM;
}

/* Free what the first pass alone needs. */
static void free_first(struct disparity_run *run)
{
    if (run->volumes && run->parts && run->tiles)
        free_matching(run);
    for (int i = 0; run->nets && i < run->networks; i++)
        sst_network_close(run->nets[i]);
    free(run->volumes);
    free(run->parts);
    free(run->tiles);
    free(run->nets);
}

/*
 * What many views decide in the second pass, learned costs and more paths in the first one do not improve. Where they
 * span few pixels, the learned cost, whose features are those of whole pixels, hides what the census finds between
 * them: the census alone is better, and with it half the penalties are enough.
 */
static void set_census(struct disparity_run *run, int present)
{
    const bool narrow = run->range < SST_VISIBLE_RANGE;

    if (run->cfg->raw || !run->cfg->census_suffices || present < SST_VISIBLE_LEAST || (!narrow && !run->cfg->rounds))
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

static int choose_keys(struct disparity_run *run, int present)
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

static int run_init(struct disparity_run *run, struct sst_lightfield *lf, const struct sst_disparity_config *cfg)
{
    const size_t views = (size_t)(lf->rows * lf->cols);
    int present = 0;

    *run = (struct disparity_run){ .lf = lf, .cfg = cfg, .scale = cfg->scale, .fill = cfg->fill && !cfg->raw };
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
    set_census(run, present);
    run->rounds = cfg->raw || present < SST_VISIBLE_LEAST || run->range < SST_VISIBLE_RANGE ? 0 : cfg->rounds;
    lf->disparity_tested = run->rounds > 0;
    run->subpixel =
        cfg->subpixel_steps > 0 && !cfg->raw && present >= SST_VISIBLE_LEAST && run->range <= SST_SUBPIXEL_RANGE;
    run->need = calloc(views, sizeof(*run->need));
    run->matched = calloc(views, sizeof(*run->matched));
    run->desc = calloc(views, sizeof(*run->desc));
    run->disp = calloc(views, sizeof(*run->disp));
    run->confidence = calloc(views, sizeof(*run->confidence));
    run->status = calloc(views, sizeof(*run->status));
    run->filled = calloc(views, sizeof(*run->filled));
    if (!run->need || !run->matched || !run->desc || !run->disp || !run->confidence || !run->status || !run->filled)
        return -ENOMEM;
    /* A range too narrow for the second pass is too narrow for carried maps. */
    return cfg->key_spacing > 1 && run->fill && cfg->joint && present >= SST_VISIBLE_LEAST &&
                   (run->rounds || (!cfg->rounds && !cfg->keys_in_texture))
               ? choose_keys(run, present)
               : 0;
}

static void run_fini(struct disparity_run *run)
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
    sst_run_forget(run->cfg->runner, run->lf);
    run_free_coarse(run);
    free(run->searched);
    for (int view = 0; run->settled && view < run->lf->rows * run->lf->cols; view++)
        sst_map_u8_fini(&run->settled[view]);
    free(run->settled);
    free(run->carried);
    free(run->need);
    free(run->matched);
    free(run->desc);
    free(run->disp);
    free(run->confidence);
    free(run->status);
    free(run->filled);
}

/* A view's map of half size, known everywhere, as the sweep starts from it. */
static void take_start(struct sst_map_u16 *out, struct disparity_run *half, int view, int disp_min)
{
    struct sst_map_u16 *from = half->filled[view].data ? &half->filled[view] : &half->disp[view];
    const int above = 32 * (2 * half->disp_min - disp_min);

    *out = *from;
    *from = (struct sst_map_u16){ 0 };
    for (int y = 0; y < out->height; y++) {
        uint16_t *row = sst_map_u16_row(out, y);

        for (int x = 0; x < out->width; x++)
            row[x] = (uint16_t)(row[x] == SST_DISP_NONE ? 0 : sst_max_int(row[x] + above, 0));
    }
}

/* Key views of half size, their maps carried to the others, unless they miss surfaces: some of them, or all alike, as
 * in closed gaps. */
static int carry_half(struct disparity_run *half, double *error, int threads)
{
    double missed = 0;
    int err = allocate_workers(half, threads);

    err = err ? err : make_volumes(half, threads);
    err = err ? err : probe_carrying(half, half->workers, error);
    if (!err && islessequal(*error, KEYS_MISS * half->cfg->key_error))
        err = run_missed(half, threads, &missed);
    if (missed > MISSED_MOST)
        *error = INFINITY;
    if (!err && islessequal(*error, half->cfg->key_error))
        err = run_match(half, half->workers, NULL, NULL);
    free_first(half);
    return err || !islessequal(*error, half->cfg->key_error) ? err : finish_maps(half, threads);
}

/* Maps of half size, where key views show the reference view there.
 * @param start  out [views], zero before; without memory: key views miss
 * @param error  out, percent of the reference view's pixels */
static int make_half(const struct disparity_run *run, int threads, struct sst_map_u16 *start, double *error)
{
    const bool tested = run->lf->disparity_tested;
    struct sst_disparity_config cfg = *run->cfg;
    struct disparity_run half;
    int err;

    cfg.scale = 2;
    cfg.support_arm = cfg.bilateral_tau = cfg.subpixel_steps = 0; /* no better with them */
    cfg.keys_in_texture = false;
    cfg.runner = NULL;
    cfg.share = NULL;
    cfg.report = NULL;
    err = run_init(&half, run->lf, &cfg);
    run->lf->disparity_tested = tested;
    if (!err && half.carried)
        err = carry_half(&half, error, threads);
    for (int k = 0; !err && islessequal(*error, cfg.key_error) && k < run->lf->rows * run->lf->cols; k++)
        take_start(&start[k], &half, k, run->disp_min);
    run_fini(&half);
    return err;
}

/* Maps of all views by the sweep, from maps of half size unless their key views miss: there many depths are near each
 * other, and colours that many views agree on find them. @return as run_sweep(); -EAGAIN: half size does not decide */
static int sweep_scene(struct disparity_run *run, int threads)
{
    const int count = run->lf->rows * run->lf->cols;
    struct sst_map_u16 *start = calloc((size_t)count, sizeof(*start));
    double error = NAN;
    int err = start ? make_half(run, threads, start, &error) : -ENOMEM;
    const struct sst_map_u16 *used = islessequal(error, run->cfg->key_error) ? start : NULL;

    if (!err && !used && !isgreater(error, KEYS_MISS * run->cfg->key_error))
        err = -EAGAIN;
    err = err ? err : run_sweep(run, used, threads);
    if (!err && run->cfg->report) {
        run->cfg->report->views_error = used ? error : NAN;
        run->cfg->report->views_skipped = used ? run->cfg->report->views_skipped : 0;
    }
    for (int k = 0; start && k < count; k++)
        sst_map_u16_fini(&start[k]);
    free(start);
    return err;
}

/* The sweep over all views, where they have texture and half size decides; else, or if it would need too much memory,
 * the key views, if the scene and the preset allow that the others are carried: where their maps give the reference
 * view few other disparities. Else the sweep, or all are matched. */
static int match_keys(struct disparity_run *run, int threads, sst_progress_fn *progress, void *progress_arg)
{
    const bool textured = run_may_sweep(run);
    bool sweeps = textured;
    double error = NAN;
    int err = 0;

    if (sweeps && run->scale == 1 && !run->networks) {
        free_matching(run);
        err = sweep_scene(run, threads);
        if (err != -E2BIG && err != -EAGAIN)
            return err;
        sweeps = err == -EAGAIN;
        err = make_volumes(run, threads);
    }
    if (textured || !run->cfg->keys_in_texture)
        err = err ? err : probe_carrying(run, run->workers, &error);
    run->others = !islessequal(error, run->cfg->key_error);
    if (run->cfg->report) {
        run->cfg->report->views_skipped = run->others ? 0 : run->cfg->report->views_skipped;
        run->cfg->report->views_error = run->others ? NAN : error;
    }
    if (!err && run->others && sweeps) {
        free_matching(run);
        err = run_sweep(run, NULL, threads);
        if (err != -E2BIG)
            return err;
        err = make_volumes(run, threads);
    }
    return err ? err : run_match(run, run->workers, progress, progress_arg);
}

/* Volumes of tiles, or of whole views where windows change too many disparities: foliage, whose gaps no coarse map has.
 */
static int choose_ranges(struct disparity_run *run, int threads)
{
    double error;
    int err = make_volumes(run, threads);

    if (err || !run->coarse)
        return err;
    err = run_measure_ranges(run, run->workers, &error);
    if (!err && islessequal(error, run->cfg->range_error)) {
        if (run->cfg->report)
            run->cfg->report->ranges_error = error;
        return 0;
    }
    run_free_coarse(run);
    for (int i = 0; i < run->workers; i++)
        sst_tiles_fini(&run->tiles[i]);
    return err ? err : make_volumes(run, threads);
}

static int run_all(struct disparity_run *run, int threads, sst_progress_fn *progress, void *progress_arg)
{
    const size_t matched = (size_t)run->width * (size_t)run->height;
    const size_t pixels[] = { (size_t)run->lf->width * (size_t)run->lf->height, matched, matched };
    int err = run_make_coarse(run, threads);

    if (err)
        return err;
    sst_run_claim(run->cfg->runner, run->lf, run->lf->rows * run->lf->cols, pixels);
    err = allocate_workers(run, threads);
    if (!err) {
        count_workers(run, threads);
        err = open_networks(run, threads);
    }
    err = err ? err : choose_ranges(run, threads);
    if (run->carried && run->rounds)
        err = err ? err : match_keys(run, threads, progress, progress_arg);
    else
        err = err ? err : run_match(run, run->workers, progress, progress_arg);
    free_first(run);
    run_report_ranges(run);
    err = err ? err : finish_maps(run, threads);
    err = err ? err : sst_parallel_for(run->lf->rows * run->lf->cols, threads, deliver, run);
    if (!err)
        run->lf->disp_min_px = (double)run->disp_min * run->scale;
    if (!err && progress)
        progress(progress_arg, 1.0);
    return err;
}

int sst_disparity_lightfield(struct sst_lightfield *lf, const struct sst_disparity_config *cfg,
                             sst_progress_fn *progress, void *progress_arg)
{
    const int threads = sst_thread_count(cfg->threads);
    struct disparity_run run;
    int err = check_config(lf, cfg);

    if (err)
        return err;
    if (cfg->report)
        *cfg->report = (struct sst_disparity_report){ NAN, NAN, NAN, NAN, NAN, NAN };
    err = run_init(&run, lf, cfg);
    err = err ? err : run_all(&run, threads, progress, progress_arg);
    if (err == -ENOMEM)
        sst_log_error("not enough memory to match %d disparities at %dx%d; use fewer threads or a narrower range",
                      run.range + 1, run.width, run.height);
    run_fini(&run);
    return err;
}

int sst_disparity_stereo(struct sst_map_f32 *out, const struct sst_image *left, const struct sst_image *right,
                         const struct sst_disparity_config *cfg)
{
    struct sst_disparity_config census = *cfg;
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
    if (cfg->census_suffices && !cfg->raw) {
        census.cost = SST_COST_CENSUS;
        cfg = &census;
    }
    err = check_config(&lf, cfg);
    if (!err && cfg->paths == 4 && !cfg->raw && cfg->fill && !(cfg->support_arm && cfg->support_after)) {
        err = pair_disparities(out, left, right, cfg);
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
    for (int y = 0; !err && y < left->height; y++)
        sst_border_unknown("disparities of a pair", sst_map_f32_row(out, y), (size_t)left->width);
    lf.views[0].image = lf.views[1].image = (struct sst_image){ 0 };
    sst_lightfield_fini(&lf);
    return err;
}
