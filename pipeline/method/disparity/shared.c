/* Steps of a run after its passes: check, filling, background. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

static struct sst_run_options options_of(const struct disparity_run *run, int threads)
{
    return (struct sst_run_options){ run->cfg->share, threads,
                                     sst_share_block((size_t)run->width * (size_t)run->height), run->cfg->cancel };
}

int run_step(struct disparity_run *run, const struct sst_step *step, int threads)
{
    const struct sst_run_options how = options_of(run, threads);

    return sst_run(run->cfg->runner, step, run, run->lf->rows * run->lf->cols, &how);
}

void run_free_sample(void *job)
{
    disparity_sample_free(job);
}

bool run_is_present(const void *job, int view)
{
    const struct disparity_run *run = job;

    return run->lf->views[view].present;
}

void run_source(const void *job, int view, struct sst_plane_source *out)
{
    const struct disparity_run *run = job;

    /* A filled map keeps the pixels that others are filled from. */
    *out = (struct sst_plane_source){ .disp = run->filled[view].data ? &run->filled[view] : &run->disp[view],
                                      .confidence = &run->confidence[view],
                                      .checked = &run->status[view] };
}

/* --- check -------------------------------------------------------------------------------------------------------- */

static void checked_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    if (!run_is_carried(run, view)) /* the others' are not checked */
        sst_share_add_u8(out, &run->status[view]);
}

static void *check_sample(uint32_t seed)
{
    return disparity_sample(seed, false, seed % 2);
}

const struct sst_step disparity_check_step = { .name = "check",
                                               .stages = 1U << SST_DISPARITY_STAGE_CHECK,
                                               RUN_STEP,
                                               .cpu = run_check,
                                               .writes = checked_maps,
                                               .sample = check_sample };

/* --- filling ------------------------------------------------------------------------------------------------------ */

static void filled_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    sst_share_add_u16(out, &run->filled[view]);
}

static void *fill_sample(uint32_t seed)
{
    return disparity_sample(seed, true, false);
}

const struct sst_step disparity_fill_step = { .name = "filling",
                                              .stages =
                                                  1U << SST_DISPARITY_STAGE_FILL | 1U << SST_DISPARITY_STAGE_BACKGROUND,
                                              RUN_STEP,
                                              .cpu = run_fill,
                                              .writes = filled_maps,
                                              .sample = fill_sample };

static int fill_rest(void *arg, int view, int worker SST_UNUSED)
{
    const struct disparity_run *run = arg;
    struct sst_map_u16 *disp = &run->disp[view];

    sst_fill_background(disp);
    if (*sst_map_u16_row(disp, 0) == SST_DISP_NONE) /* nothing arrived: far away */
        memset(disp->data, 0, disp->stride * (size_t)run->height);
    return 0;
}

static void rest_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    sst_share_add_u16(out, &run->disp[view]);
}

const struct sst_step disparity_background_step = { .name = "background",
                                                    .stages = 1U << SST_DISPARITY_STAGE_BACKGROUND,
                                                    RUN_STEP,
                                                    .cpu = fill_rest,
                                                    .writes = rest_maps,
                                                    .sample = check_sample };

int run_fill_background(struct disparity_run *run, int threads)
{
    struct sst_run_options how = options_of(run, threads);

    how.share = NULL; /* less work than to exchange it */
    return sst_run(run->cfg->share ? NULL : run->cfg->runner, &disparity_background_step, run,
                   run->lf->rows * run->lf->cols, &how);
}
