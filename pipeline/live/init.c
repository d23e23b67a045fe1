/* Set-up before the first frame: the geometry of the views and all memory. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/live/live_internal.h"

static int check_config(const struct sst_live_config *cfg)
{
    bool any = false;

    for (int k = 0; k < cfg->rows * cfg->cols && k < SST_MAX_VIEWS; k++)
        any |= cfg->present[k];
    if (!any || cfg->width < 1 || cfg->height < 1) {
        sst_log_error(
            "live: a grid of %dx%d with frames of %dx%d pixels has no views; configure cameras and their size",
            cfg->rows, cfg->cols, cfg->width, cfg->height);
        return -EINVAL;
    }
    return 0;
}

/* Positions of the views: from the calibration, or on the nominal grid. */
static int set_geometry(struct sst_lightfield *lf, const struct sst_live_config *cfg)
{
    double bx, by;
    int err;

    lf->width = cfg->width;
    lf->height = cfg->height;
    lf->range_min_px = cfg->range_min_px;
    lf->range_max_px = cfg->range_max_px;
    for (int k = 0; k < lf->rows * lf->cols; k++)
        lf->views[k].present = cfg->present[k];
    if (cfg->calibration) {
        err = sst_lightfield_fit_calibration(lf, cfg->calibration);
        err = err ? err : sst_lightfield_calibrate(lf, cfg->calibration);
        return err == -EBADMSG ? -EINVAL : err;
    }
    err = sst_lightfield_choose_ref(lf);
    if (err)
        return -EINVAL;
    bx = lf->views[lf->ref_view].bx;
    by = lf->views[lf->ref_view].by;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        lf->views[k].bx -= bx;
        lf->views[k].by -= by;
    }
    return 0;
}

static int make_stamps(struct sst_live *live)
{
    const struct sst_lightfield *lf = &live->lf;
    int err = sst_liveframes_changes_init(&live->changes, lf);

    for (int k = 0; k < lf->rows * lf->cols && !err; k++) {
        if (!lf->views[k].present)
            continue;
        live->stamp[k] = calloc((size_t)live->changes.cols * (size_t)live->changes.rows, sizeof(*live->stamp[k]));
        err = live->stamp[k] ? 0 : -ENOMEM;
    }
    live->tile_zones = calloc((size_t)live->changes.cols * (size_t)live->changes.rows, sizeof(*live->tile_zones));
    return err ? err : live->tile_zones ? 0 : -ENOMEM;
}

int live_use_device(struct sst_live *live, const char *name, uint64_t memory_bytes)
{
    const struct sst_render_live changes = { .stamp = live->stamp,
                                             .tile = SST_LIVE_TILE,
                                             .tile_cols = live->changes.cols,
                                             .tile_rows = live->changes.rows,
                                             .since = &live->present_serial };

    return sst_renderer_use_live_device(live->renderer, name, memory_bytes, &changes);
}

int live_init(struct sst_live *live, const struct sst_live_config *cfg)
{
    int err = check_config(cfg);

    sst_render_focus_init(&live->focus);
    live->min_px = live->max_px = NAN;
    live_cut_init(&live->cut);
    live->confirmed = 1;
    live->cfg = *cfg;
    live->cfg.threads = sst_thread_count(cfg->threads);
    if (err)
        return err;
    if (cfg->model) {
        live->cfg.model = live->model = strdup(cfg->model);
        if (!live->model)
            err = -ENOMEM;
    }
    err = err ? err : sst_lightfield_init(&live->lf, cfg->rows, cfg->cols);
    err = err ? err : set_geometry(&live->lf, cfg);
    err = err ? err : make_stamps(live);
    err = err ? err : live_zones_set(live, cfg->zone, cfg->zones);
    if (!err && cfg->posed.poses) /* rendered by posed/ */
        return 0;
    err = err ? err : sst_renderer_create(&live->renderer, &live->lf, cfg->threads);
    err = err ? err : sst_renderer_recount(live->renderer, NULL, 0, 1); /* no views yet */
    if (!err && cfg->device)
        err = live_use_device(live, cfg->device, cfg->device_memory_bytes);
    if (err == -ENOMEM)
        sst_log_error("live: no memory for views of %dx%d pixels", cfg->width, cfg->height);
    return err;
}

void live_fini(struct sst_live *live)
{
    sst_renderer_destroy(live->renderer);
    for (int k = 0; k < SST_MAX_VIEWS; k++)
        free(live->stamp[k]);
    sst_liveframes_changes_fini(&live->changes);
    sst_render_focus_fini(&live->focus);
    sst_lightfield_fini(&live->lf);
    free(live->tile_zones);
    free(live->model);
}
