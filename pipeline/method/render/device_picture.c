/* Pictures on a device: a dispatch of `blend` per run of views that share a chunk.
 *
 * Where the views or scratch buffers do not fit into the memory, the picture is made in bands of rows; views that do
 * not fit together are uploaded for each band, only the rows that it needs. The order of the views' rays, and so the
 * bytes, stay the same. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "pipeline/method/render/device_internal.h"

_Static_assert(sizeof(struct sst_gpu_blend_view) == 64 && sizeof(struct sst_gpu_blend_params) == 6144 &&
                   sizeof(((struct sst_gpu_blend_params *)0)->rarity) == SST_AGREE_BINS,
               "the layout of blend.comp");

#define ROW_BYTES (SST_BLEND_COLUMNS * sizeof(float)) /* of the table of label weights */

static uint32_t flags_of(const struct sst_render_plan *p)
{
    return (p->weighted ? SST_GPU_BLEND_WEIGHTED : 0U) | (p->summed ? SST_GPU_BLEND_SUMMED : 0U) |
           (p->table ? SST_GPU_BLEND_BY_LABEL : 0U) | (p->verifier ? SST_GPU_BLEND_WEIGHTS : 0U);
}

static void describe(struct device_batch *b, struct render_runner *d, const struct render_picture *pic)
{
    const struct sst_render_plan *p = pic->plan;

    b->d = d;
    b->p = p;
    b->cells = pic->cells;
    b->verify = pic->verify;
    b->flags = flags_of(p);
    b->push = (struct sst_gpu_verify){ .height = d->lf->height,
                                       .count = (uint32_t)p->count,
                                       .explained = p->explainer != NULL };
    b->push.blend = (struct sst_gpu_blend){ .width = d->lf->width,
                                            .pitch = d->pitch,
                                            .near = { p->blend.near.first, p->blend.near.last, p->blend.near.times,
                                                      p->blend.near.focus, p->blend.near.slope, p->blend.near.bits },
                                            .floor = p->blend.near.floor,
                                            .scale = p->blend.near.scale };
    b->taps.sampled = p->sampled;
    b->taps.threads = sst_thread_count(p->cfg.threads);
    b->taps.count = p->count;
    for (int k = 0; k < p->count; k++) {
        const struct sst_render_tap *t = &p->tap[k];

        b->taps.tap[k] = t;
        b->taps.wanted[k] = (b->verify && p->explainer) || (t->x0 < t->x1 && t->y0 <= pic->end && t->y1 >= pic->top);
    }
}

/* --- views -------------------------------------------------------------------------------------------------------- */

/* Pixels that were sampled at the rays, each from its frame, are taken as they are. */
struct sst_gpu_blend_view device_describe_tap(const struct device_batch *b, int k)
{
    const struct sst_render_tap *t = &b->p->tap[k];
    const bool sampled = b->p->sampled && t->frame;
    const double fx = sampled ? 0 : t->fx, fy = sampled ? 0 : t->fy;
    struct sst_gpu_blend_view v = { .ix = t->ix,
                                    .iy = t->iy,
                                    .nx = t->nx,
                                    .ny = t->ny,
                                    .x0 = t->x0,
                                    .x1 = t->x1,
                                    .y0 = t->y0,
                                    .y1 = t->y1,
                                    .aperture = (float)t->aperture,
                                    .first = b->taps.place[k].first,
                                    .index = (uint32_t)k };
    int16_t tap[4];

    sst_blend_set_taps(tap, fx, fy);
    for (int i = 0; i < 4; i++)
        v.tap[i] = tap[i];
    v.flags = (fx > 0 ? SST_GPU_VIEW_RIGHT : 0U) | (fy > 0 ? SST_GPU_VIEW_BELOW : 0U) |
              (t->frame || t->v->valid.data ? SST_GPU_VIEW_VALID : 0U) | (t->v->label.data ? SST_GPU_VIEW_LABELS : 0U) |
              (b->d->doubts && t->v->confidence.data ? SST_GPU_VIEW_CONFIDENCE : 0U);
    return v;
}

void device_begin_runs(struct device_batch *b)
{
    b->push.blend.first_view = b->push.blend.views = 0;
}

const struct device_chunk *device_next_run(struct device_batch *b)
{
    const uint32_t first = b->push.blend.first_view + b->push.blend.views;
    const struct device_place *place = b->taps.place;
    uint32_t end = first;

    while (end < b->push.count && place[end].chunk == place[first].chunk)
        end++;
    b->push.blend.first_view = first;
    b->push.blend.views = end - first;
    b->push.blend.flags =
        b->flags | (first ? 0U : SST_GPU_BLEND_FIRST) | (end < b->push.count ? 0U : SST_GPU_BLEND_LAST);
    return first < end ? place[first].chunk : NULL;
}

/* --- a picture ---------------------------------------------------------------------------------------------------- */

/* Memory for bands of some rows: views come last. */
static void reserve(struct device_batch *b, int rows)
{
    const size_t n = (size_t)rows * (size_t)b->d->lf->width;
    struct sst_run *r = b->d->run;

    b->params =
        sst_run_scratch(r, DEVICE_SCRATCH_PARAMS,
                        sizeof(struct sst_gpu_blend_params) + (size_t)b->p->count * sizeof(struct sst_gpu_blend_view));
    b->table = sst_run_scratch(r, DEVICE_SCRATCH_TABLE, b->p->table_rows * ROW_BYTES);
    b->sums = sst_run_scratch(r, DEVICE_SCRATCH_SUMS, 16 * n);
    b->out = sst_run_scratch(r, DEVICE_SCRATCH_OUT, 4 * n);
    if (b->verify)
        device_reserve_verify(b, rows);
    device_reserve_frames(b->d, &b->taps);
}

/* Upload all views, or reserve room for rows of each. @return true: bands upload rows */
static bool place_views(struct device_batch *b, const struct render_picture *p, int rows)
{
    if (!p->bands.split && device_gather(b->d, &b->taps, b->verify && b->p->explainer))
        return false;
    if (b->d->full)
        device_drop_views(b->d);
    device_reserve_band(b, p->top, p->end, rows);
    return true;
}

/* Weights by label, and rarities of colours. */
static void upload_params(struct device_batch *b)
{
    const struct sst_render_plan *p = b->p;
    struct sst_gpu_blend_params params = { .rarity = { 0 } };

    for (int i = 0; i < 256; i++) {
        const size_t row = p->table ? (size_t)(p->labels->range[i].weight - p->table) / SST_BLEND_COLUMNS : 0;

        params.label[i] = (struct sst_gpu_blend_label){ (uint32_t)row, p->ends[i] };
    }
    if (p->rarity)
        memcpy(params.rarity, p->rarity, sizeof(params.rarity));
    sst_run_write(b->d->run, b->params, &params, sizeof(params));
    if (p->table)
        sst_run_write(b->d->run, b->table, p->table, p->table_rows * ROW_BYTES);
}

static void blend(struct device_batch *b)
{
    struct sst_gpu_range views = b->params;
    struct sst_gpu_blend_view view[SST_MAX_VIEWS];
    const struct device_chunk *c;

    for (int k = 0; k < b->p->count; k++)
        view[k] = device_describe_tap(b, k);
    views.offset = sizeof(struct sst_gpu_blend_params);
    sst_run_write(b->d->run, views, view, (size_t)b->p->count * sizeof(view[0]));
    device_begin_runs(b);
    while ((c = device_next_run(b)) != NULL)
        DEVICE_DISPATCH(b, SST_GPU_BLEND, &b->push.blend, b->push.blend.rows, SST_GPU_BLEND_GROUP_HEIGHT, b->params,
                        c->plane[DEVICE_PIXELS], c->plane[DEVICE_DISP], c->plane[DEVICE_VALID], b->table, b->sums,
                        b->out);
}

static void render_band(struct device_batch *b, int top, int rows)
{
    struct render_runner *d = b->d;
    const size_t n = (size_t)rows * (size_t)d->lf->width, at = (size_t)top * (size_t)d->lf->width;
    struct sst_gpu_range weights = b->sums;

    b->push.blend.top = top;
    b->push.blend.rows = rows;
    if (!b->taps.slots)
        device_place_band(b, top, top + rows);
    blend(b);
    if (b->verify)
        device_verify_band(b);
    sst_run_read(d->run, (uint32_t *)d->words.data + at, b->out, 4 * n);
    weights.offset = 12 * n;
    if (b->p->verifier && !b->verify)
        sst_run_read(d->run, (float *)d->weights.data + at, weights, 4 * n);
}

/* Chunks have confidences from the first picture on that needs them. */
static void note_doubts(struct device_batch *b)
{
    bool any = false;

    for (int k = 0; k < b->p->count; k++)
        any = any || b->p->tap[k].v->confidence.data;
    if (any && !b->d->doubts)
        device_drop_views(b->d);
    b->d->doubts |= any;
}

void device_picture(struct sst_run *r, struct render_picture *p)
{
    struct render_runner *d = p->runner;
    const int height = d->lf->height, rows = sst_run_rows(r, p->bands.rows, SST_RENDER_CELL_HEIGHT);
    const size_t n = (size_t)d->lf->width * (size_t)height;
    const int64_t start_ns = sst_clock_now_ns();
    struct device_batch b = { .d = NULL };
    bool split;

    device_begin(d, r);
    describe(&b, d, p);
    if (b.verify)
        note_doubts(&b);
    if (!sst_mem_keep(&d->words, n, 4) || (b.p->verifier && !b.verify && !sst_mem_keep(&d->weights, n, 4)))
        sst_run_fail(r, -ENOMEM);
    reserve(&b, rows);
    split = !sst_run_failed(r) && place_views(&b, p, rows);
    upload_params(&b);
    if (b.verify)
        device_upload_cells(&b);
    for (int y = p->top; y < p->end && !sst_run_failed(r); y += rows)
        render_band(&b, y, sst_min_int(rows, p->end - y));
    d->held = false;
    if (sst_run_failed(r))
        return;
    p->bands = (struct render_bands){ rows, split };
    p->words = d->words.data;
    p->weights = b.p->verifier && !b.verify ? d->weights.data : NULL;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
}
