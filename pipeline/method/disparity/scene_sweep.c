/* Maps of all views by the sweep in scene space (pipeline/method/sweep/). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/disparity/disparity_internal.h"
#include "pipeline/method/sweep/sweep.h"
#include "pipeline/step/run.h"

/* Mean difference to the consensus, of R, G and B together, up to which a disparity is not tested again: of foliage,
 * and after maps of half size. */
#define SETTLED      36
#define SETTLED_HALF 24
/* The sweep in scene space compares windows of 3x3: it is for views of which at most this percent of larger windows are
 * of one colour. */
#define FLAT_MOST    10
#define FLAT_REACH   3 /* of these windows, px, in views of FLAT_PIXELS; wider in larger views as these are */
#define FLAT_PIXELS  750000
#define FLAT_LEVELS  16 /* largest difference of a channel in one */
#define FLAT_SPACING 4  /* px between windows that are looked at, as FLAT_REACH */

/* Is a window of one colour? */
static bool is_flat(const struct sst_image *img, int reach, int x0, int y0)
{
    for (int c = 0; c < 3; c++) {
        int least = 255, most = 0;

        for (int y = y0 - reach; y <= y0 + reach; y++) {
            const uint8_t *row = sst_image_row(img, c, y);

            for (int x = x0 - reach; x <= x0 + reach; x++) {
                least = sst_min_int(row[x], least);
                most = sst_max_int(row[x], most);
            }
        }
        if (most - least > FLAT_LEVELS)
            return false;
    }
    return true;
}

/* Has a view texture nearly everywhere? */
static bool is_textured(const struct sst_image *img)
{
    const int size = sst_max_int((int)lround(sqrt((double)img->width * img->height / FLAT_PIXELS)), 1);
    const int reach = FLAT_REACH * size, spacing = FLAT_SPACING * size;
    int64_t windows = 0, flat = 0;

    for (int y = reach; y + reach < img->height; y += spacing) {
        for (int x = reach; x + reach < img->width; x += spacing) {
            windows++;
            flat += is_flat(img, reach, x, y);
        }
    }
    return windows && 100 * flat <= FLAT_MOST * windows;
}

bool run_may_sweep(const struct disparity_run *run)
{
    const struct sst_view *reference = &run->lf->views[run->lf->ref_view];

    return !run->cfg->frugal && reference->present && is_textured(&reference->image);
}

int run_missed(const struct disparity_run *run, int threads, double *percent)
{
    const struct sst_lightfield *lf = run->lf;
    const int count = lf->rows * lf->cols;
    struct sst_planesweep_view *view = calloc((size_t)count, sizeof(*view));
    const struct sst_planesweep in = { .view = view,
                                       .views = count,
                                       .disp_min_px = run->disp_min * run->scale,
                                       .range = run->range * run->scale,
                                       .threads = threads,
                                       .cancel = run->cfg->cancel };
    int err = view ? 0 : -ENOMEM;

    for (int k = 0; !err && k < count; k++) {
        const struct sst_view *v = &lf->views[k];

        view[k] = (struct sst_planesweep_view){ v->present ? &v->image : NULL, &v->valid, v->bx, v->by, NULL, NULL };
    }
    err = err ? err : sst_planesweep_missed(&in, lf->ref_view, &run->disp[lf->ref_view], run->scale, percent);
    free(view);
    return err;
}

/* Confidence of a view's map from its costs, and its settled pixels. @param most  cost of a settled pixel */
static int settle(struct disparity_run *run, int view, int most)
{
    struct sst_map_u8 *cost = &run->settled[view], *confidence = &run->confidence[view];
    int err = 0;

    sst_map_u8_fini(confidence);
    err = sst_map_u8_init(confidence, cost->width, cost->height);
    for (int y = 0; !err && y < cost->height; y++) {
        uint8_t *c = sst_map_u8_row(cost, y), *to = sst_map_u8_row(confidence, y);

        for (int x = 0; x < cost->width; x++) {
            to[x] = (uint8_t)(255 - 2 * sst_min_int(c[x], 127));
            c[x] = c[x] <= most ? 255 : 0;
        }
    }
    return err;
}

/* The filters of matched maps: planes' disparities jump where texture is weak. */
static int smooth(void *arg, int view, int worker SST_UNUSED)
{
    struct disparity_run *run = arg;
    struct sst_map_u16 *disp = &run->disp[view];
    struct sst_map_u8 luma = { 0 };
    struct sst_mem_kept lines = { 0 };
    int err;

    if (!disp->data)
        return 0;
    err = sst_luma(&luma, &run->lf->views[view].image);
    err = err ? err : sst_disparity_median5(disp, &lines);
    err = err ? err : sst_disparity_bilateral(disp, &luma, run->cfg->bilateral_tau);
    sst_map_u8_fini(&luma);
    sst_mem_kept_fini(&lines);
    return err;
}

int run_sweep(struct disparity_run *run, const struct sst_map_u16 *start, int threads)
{
    const int count = run->lf->rows * run->lf->cols;
    struct sst_map_u8 *seen = calloc((size_t)count, sizeof(*seen));
    struct sst_image *half = calloc((size_t)count, sizeof(*half));
    struct sst_planesweep_view *view = calloc((size_t)count, sizeof(*view));
    struct sst_visible_views in = { 0 };
    int err = seen && half && view ? run_visible_views(run, &in, seen) : -ENOMEM;

    run->foliage = !start;
    run->settled = calloc((size_t)count, sizeof(*run->settled));
    err = run->settled ? err : -ENOMEM;
    for (int k = 0; !err && k < count; k++) {
        const struct sst_visible_view *v = &in.view[k];

        sst_map_u16_fini(v->disp);
        sst_map_u8_fini(v->confidence);
        sst_run_changed(run->cfg->runner, k, 1U << SST_PLANE_MAP);
        if (v->image && run->scale > 1)
            err = sst_image_halve(&half[k], v->image);
        view[k] = (struct sst_planesweep_view){
            !v->image ? NULL : run->scale > 1 ? &half[k] : v->image, v->seen, v->bx, v->by, v->disp, &run->settled[k]
        };
    }
    if (!err)
        err = sst_planesweep(&(struct sst_planesweep){ .view = view,
                                                       .views = count,
                                                       .disp_min_px = run->disp_min,
                                                       .range = run->range,
                                                       .bytes = run->cfg->memory,
                                                       .start = start,
                                                       .threads = threads,
                                                       .cancel = run->cfg->cancel });
    if (err == -E2BIG) { /* all views are to be matched, as if there had been no map */
        sst_log_warning(
            "the sweep of this scene needs more memory than it may take: its views are matched one by one, which "
            "gives other maps; a higher --memory avoids it");
        free(run->settled);
        run->settled = NULL;
        memset(run->matched, 0, (size_t)count * sizeof(*run->matched));
    } else {
        sst_run_note(run->cfg->runner, 1U << SST_DISPARITY_STAGE_SWEEP, NULL);
    }
    for (int k = 0; k < count; k++) {
        if (!err && run->settled[k].data)
            err = settle(run, k, start ? SETTLED_HALF : SETTLED);
        if (half)
            sst_image_fini(&half[k]);
        if (seen)
            sst_map_u8_fini(&seen[k]);
    }
    if (!err && start)
        err = sst_parallel_for(count, threads, smooth, run);
    free(seen);
    free(half);
    free(view);
    free(in.view);
    return err;
}
