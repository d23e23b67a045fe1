/* Rays verified on a device, of a band of the picture that was blended: which pixels the maps leave to votes, then the
 * votes of some rows at a time, as many as there is room for. Where the maps explain rays (SST_VERIFY_AUTO), colours of
 * a view are compared with the views around it, which the shaders read from one buffer.
 *
 * The CPU looks at the cells once: without pixels left to votes nothing else is done, and only their rows are gone
 * through. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/verify.h"

#include <errno.h>
#include <math.h>

#include "pipeline/kernels/verify_ref.h"
#include "pipeline/method/render/device_internal.h"

_Static_assert(SST_GPU_VERIFY_VIEWS == SST_MAX_VIEWS && sizeof(struct sst_gpu_verify_view) == 208,
               "the layout of verify_*.comp");
_Static_assert(SST_VERIFY_CELL_WIDTH == SST_RENDER_CELL_WIDTH && SST_VERIFY_CELL_HEIGHT == SST_RENDER_CELL_HEIGHT,
               "cells are those of pictures");

#define LEAST_ROWS 3 /* a row that is verified, and its neighbours */

static size_t cell_cols(const struct device_batch *b)
{
    return (size_t)(b->d->lf->width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;
}

static size_t cell_rows(int rows)
{
    return (size_t)(rows + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
}

/* Stored disparities that pictures may have. */
static size_t disp_values(const struct device_batch *b)
{
    return b->d->changes ? SST_DISP_NONE : (size_t)explainer_bins(b->p->explainer);
}

/* --- before a picture --------------------------------------------------------------------------------------------- */

bool device_can_verify(struct render_runner *d, const struct sst_render_plan *p)
{
    enum device_unverified why = DEVICE_UNVERIFIED_NOT;

    for (int k = 0; k < p->count && p->explainer; k++)
        why = p->tap[k].frame ? DEVICE_UNVERIFIED_FRAMES : why;
    if (p->agreed)
        why = DEVICE_UNVERIFIED_AGREED;
    if (d->small)
        why = DEVICE_UNVERIFIED_SMALL;
    if (d->cramped && p->explainer)
        why = DEVICE_UNVERIFIED_CRAMPED;
    d->why = why;
    return why == DEVICE_UNVERIFIED_NOT;
}

/* As many rows as a quarter of the memory and the largest buffer hold; LEAST_ROWS even if they need more. */
static int find_rows(const struct device_batch *b, int rows)
{
    const double width = b->d->lf->width, count = b->p->count,
                 row_bytes = width * (4 * count + 4 * ceil(count / 2) + 8);
    const double most = fmax((double)b->d->limit_bytes / 4 / row_bytes, LEAST_ROWS);
    const double largest = (double)sst_gpu_get_info(b->d->gpu)->buffer_bytes / (4 * width * count);

    return (int)sst_clamp_double(fmin(most, largest), 0, sst_min_int(rows + 2, b->d->lf->height));
}

void device_reserve_verify(struct device_batch *b, int rows)
{
    const size_t width = (size_t)b->d->lf->width, count = (size_t)b->p->count;
    struct sst_run *r = b->d->run;
    size_t n;

    b->vote_rows = find_rows(b, rows);
    if (b->vote_rows < sst_min_int(LEAST_ROWS, b->d->lf->height))
        sst_run_fail(r, -ENOMEM);
    n = (size_t)b->vote_rows * width;
    b->cells_at = sst_run_scratch(r, DEVICE_SCRATCH_CELLS, 4 * cell_cols(b) * cell_rows(b->d->lf->height));
    b->share = sst_run_scratch(r, DEVICE_SCRATCH_SHARE, 12 * (size_t)rows * width);
    b->rays = sst_run_scratch(r, DEVICE_SCRATCH_RAYS, 4 * n * count);
    b->near = sst_run_scratch(r, DEVICE_SCRATCH_NEAR, 4 * n * ((count + 1) / 2));
    b->totals = sst_run_scratch(r, DEVICE_SCRATCH_TOTALS, 8 * n);
    if (!b->p->explainer)
        return;
    b->around = sst_run_scratch(r, DEVICE_SCRATCH_AROUND, count * sizeof(struct sst_gpu_verify_view));
    b->disp_px = sst_run_scratch(r, DEVICE_SCRATCH_DISP_PX, disp_values(b) * sizeof(float));
}

void device_upload_cells(struct device_batch *b)
{
    const size_t n = cell_cols(b) * cell_rows(b->d->lf->height);
    uint32_t *word = sst_run_words(b->d->run, n);

    for (size_t i = 0; word && i < n; i++)
        word[i] = !b->cells || b->cells[i] ? SST_GPU_CELL_WANTED : 0;
    sst_run_write(b->d->run, b->cells_at, word, 4 * n);
}

/* --- pixels left to votes ----------------------------------------------------------------------------------------- */

static void find_share(struct device_batch *b)
{
    const struct device_chunk *c;

    device_begin_runs(b);
    while ((c = device_next_run(b)) != NULL)
        DEVICE_DISPATCH(b, SST_GPU_VERIFY_SHARE, &b->push, b->push.blend.rows, SST_GPU_VERIFY_GROUP_HEIGHT, b->params,
                        c->plane[DEVICE_DISP], b->sums, b->out, b->share, b->cells_at);
}

/* The rows of the band that have open cells: none if from = to. */
static void find_open(struct device_batch *b)
{
    const size_t cols = cell_cols(b), first = cell_rows(b->push.blend.top), n = cols * cell_rows(b->push.blend.rows);
    const struct sst_gpu_range cells = { b->cells_at.buffer, 4 * first * cols };
    /* A dummy device has looked at nothing. */
    const uint32_t open = sst_gpu_is_dummy(b->d->gpu) ? SST_GPU_CELL_WANTED : SST_GPU_CELL_OPEN;
    const uint32_t *cell = sst_run_fetch(b->d->run, cells, n);

    b->push.from = b->push.to = b->push.blend.top;
    for (size_t i = 0; cell && i < n; i++) {
        const int y = b->push.blend.top + (int)(i / cols) * SST_RENDER_CELL_HEIGHT;

        if (cell[i] & SST_GPU_CELL_BELOW)
            sst_run_fail(b->d->run, -EAGAIN);
        if (!(cell[i] & open))
            continue;
        if (b->push.from == b->push.to)
            b->push.from = y;
        b->push.to = sst_min_int(y + SST_RENDER_CELL_HEIGHT, b->push.blend.top + b->push.blend.rows);
    }
}

/* --- explanations by the maps ------------------------------------------------------------------------------------- */

/* Places of all views and of their neighbours, and disparities in pixels by the stored value, as
 * explainer_contradicts() has them. */
static void upload_explained(struct device_batch *b)
{
    struct sst_gpu_verify_view *view;
    float *px;

    sst_run_fail(b->d->run, explainer_prepare(b->p->explainer));
    view = (void *)sst_run_words(b->d->run, (size_t)b->p->count * sizeof(*view) / sizeof(uint32_t));
    for (int k = 0; view && k < b->p->count; k++) {
        struct explainer_near near[EXPLAINER_AROUND];
        const int around = explainer_around(b->p->explainer, k, near);

        view[k] = (struct sst_gpu_verify_view){ .at = device_describe_tap(b, k), .around = (uint32_t)around };
        for (int i = 0; i < around; i++)
            view[k].near[i] = (struct sst_gpu_verify_near){ near[i].bx, near[i].by, (uint32_t)near[i].tap, 0 };
    }
    sst_run_write(b->d->run, b->around, view, (size_t)b->p->count * sizeof(*view));
    px = (void *)sst_run_words(b->d->run, disp_values(b));
    for (size_t i = 0; px && i < disp_values(b); i++)
        px[i] = (float)sst_disp_px(b->d->lf, (uint16_t)i);
    sst_run_write(b->d->run, b->disp_px, px, disp_values(b) * sizeof(*px));
}

/* Close cells of which the maps explain most rays, or sum up unexplained rays. @param last  the last buffer of the
 * shader
 * @param height  of a group */
static void explain(struct device_batch *b, enum sst_gpu_shader shader, struct sst_gpu_range last, int rows, int height)
{
    const struct device_chunk *c = b->taps.place[0].chunk;
    const int cols = shader == SST_GPU_VERIFY_SCREEN
                         ? (int)cell_cols(b)
                         : (b->push.blend.width + SST_GPU_VERIFY_GROUP_WIDTH - 1) / SST_GPU_VERIFY_GROUP_WIDTH;
    struct sst_gpu_verify push = b->push;

    push.nearest = b->p->numbers.nearest_end;
    push.levels = explainer_levels(b->p->explainer);
    SST_RUN_GROUPS(b->d->run, shader, &push, cols, (rows + height - 1) / height, 1, b->around, c->plane[DEVICE_PIXELS],
                   c->plane[DEVICE_DISP], c->plane[DEVICE_VALID], b->disp_px, b->share, last);
}

/* --- votes -------------------------------------------------------------------------------------------------------- */

/* Verify the rows from .. to - 1. */
static void vote(struct device_batch *b)
{
    const int rows = sst_min_int(b->push.to + 1, b->d->lf->height) - sst_max_int(b->push.from - 1, 0);
    const struct device_chunk *c;

    b->push.rays = (uint32_t)rows * (uint32_t)b->d->lf->width;
    device_begin_runs(b);
    while ((c = device_next_run(b)) != NULL)
        DEVICE_DISPATCH(b, SST_GPU_VERIFY_RAYS, &b->push, rows, SST_GPU_VERIFY_GROUP_HEIGHT, b->params,
                        c->plane[DEVICE_PIXELS], c->plane[DEVICE_DISP], c->plane[DEVICE_VALID], b->table,
                        c->plane[c->plane[DEVICE_CONFIDENCE].buffer ? DEVICE_CONFIDENCE : DEVICE_VALID], b->share,
                        b->rays);
    if (b->p->explainer)
        explain(b, SST_GPU_VERIFY_UNEXPLAINED, b->totals, rows, SST_GPU_VERIFY_GROUP_HEIGHT);
    DEVICE_DISPATCH(b, SST_GPU_VERIFY_MODE, &b->push, rows, SST_GPU_VERIFY_GROUP_HEIGHT, b->share, b->rays, b->near,
                    b->totals);
    DEVICE_DISPATCH(b, SST_GPU_VERIFY_BLEND, &b->push, b->push.to - b->push.from, SST_GPU_VERIFY_GROUP_HEIGHT, b->share,
                    b->rays, b->near, b->totals, b->out);
}

void device_verify_band(struct device_batch *b)
{
    const struct sst_verify_numbers *numbers = &b->p->numbers;
    int end;

    b->push.nearest = numbers->nearest;
    b->push.all = numbers->all;
    b->push.scale = numbers->scale;
    b->push.most = numbers->most;
    b->push.doubt_step = SST_VERIFY_DOUBT_STEP;
    find_share(b);
    find_open(b);
    end = b->push.to;
    if (b->push.from < end && b->p->explainer) {
        upload_explained(b);
        explain(b, SST_GPU_VERIFY_SCREEN, b->cells_at, end - b->push.from, SST_RENDER_CELL_HEIGHT);
    }
    while (b->push.from < end && !sst_run_failed(b->d->run)) {
        b->push.to = b->vote_rows == b->d->lf->height ? end : sst_min_int(b->push.from + b->vote_rows - 2, end);
        vote(b);
        b->push.from = b->push.to;
    }
}
