/* Rays verified on a device, of a band of the picture that was blended: which pixels the maps leave to votes, then the
 * votes of some rows at a time, as many as there is room for.
 *
 * The CPU looks at the cells once: without pixels left to votes nothing else is done, and only their rows are gone
 * through. Votes are gathered view by view, wherever these lie. What the maps explain: device_explain.c. */
#include "pipeline/gpu/verify.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/verify_ref.h"
#include "pipeline/method/render/device_internal.h"

_Static_assert(SST_GPU_VERIFY_VIEWS == SST_MAX_VIEWS &&
                   sizeof(((struct sst_gpu_verify_params *)0)->rarity) == SST_AGREE_BINS,
               "views and colours of a picture");
_Static_assert(sizeof(struct sst_gpu_verify_view) == 208 && sizeof(struct sst_gpu_verify_params) == 6144,
               "the layout of verify_*.comp");
_Static_assert(SST_VERIFY_CELL_WIDTH == SST_RENDER_CELL_WIDTH && SST_VERIFY_CELL_HEIGHT == SST_RENDER_CELL_HEIGHT,
               "cells are those of pictures");

#define PARAMS_BYTES (sizeof(struct sst_gpu_verify_params) + SST_MAX_VIEWS * sizeof(struct sst_gpu_blend_view))
#define LEAST_ROWS   3     /* one that is verified, and those around it */

static int cell_cols(const struct render_device *d)
{
    return (d->lf->width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;
}

static int cell_rows(const struct render_device *d)
{
    return (d->lf->height + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
}

/* --- what is needed ----------------------------------------------------------------------------------------------- */

bool device_can_verify(struct render_device *d, const struct sst_render_plan *p)
{
    enum device_unverified why = DEVICE_UNVERIFIED_NOT;

    for (int k = 0; k < p->count && p->explainer; k++)
        why = p->tap[k].frame ? DEVICE_UNVERIFIED_FRAMES : why;
    if (p->agreed)
        why = DEVICE_UNVERIFIED_AGREED;
    if (d->verify.small)
        why = DEVICE_UNVERIFIED_SMALL;
    if (d->verify.cramped && p->explainer)
        why = DEVICE_UNVERIFIED_CRAMPED;
    d->verify.why = why;
    return why == DEVICE_UNVERIFIED_NOT;
}

void device_drop_verify(struct render_device *d)
{
    struct device_verify *v = &d->verify;
    struct sst_gpu_buffer **const all[] = { &v->params, &v->cells,  &v->share, &v->rays,
                                            &v->near,   &v->totals, &v->views, &v->disp_px };

    for (size_t i = 0; i < ARRAY_LEN(all); i++) {
        sst_gpu_buffer_destroy(d->gpu, *all[i]);
        *all[i] = NULL;
    }
    device_destroy_chunk(d, &v->near_views);
    v->count = v->rows = 0;
}

/* Room for the rays of `rows` rows of the picture, those around them included. */
static int make_rays(struct render_device *d, int count, int rows)
{
    const size_t n = (size_t)rows * (size_t)d->lf->width;
    struct device_verify *v = &d->verify;
    int err = sst_gpu_buffer_create(d->gpu, &v->rays, 4 * n * (size_t)count);

    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &v->near, 4 * n * (size_t)((count + 1) / 2));
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &v->totals, 8 * n);
    if (err)
        return err;
    v->count = count;
    v->rows = rows;
    return 0;
}

/* As many rows as a quarter of the memory and the largest buffer hold; LEAST_ROWS even if they need more. */
static int find_rows(const struct render_device *d, int count)
{
    const double row_bytes = (double)d->lf->width * (4 * count + 4 * ((count + 1) / 2) + 8);
    const double most = fmax((double)sst_gpu_free_bytes(d->gpu) / 4 / row_bytes, LEAST_ROWS);
    const double largest = (double)sst_gpu_get_info(d->gpu)->buffer_bytes / (4.0 * d->lf->width * count);

    return (int)sst_clamp_double(fmin(most, largest), 0, d->lf->height);
}

static int make_buffers(struct render_device *d, const struct sst_render_plan *p)
{
    struct device_verify *v = &d->verify;
    int err = 0, rows;

    if (!v->params)
        err = sst_gpu_buffer_create(d->gpu, &v->params, PARAMS_BYTES);
    if (!err && !v->cells)
        err = sst_gpu_buffer_create(d->gpu, &v->cells, 4 * (size_t)cell_cols(d) * (size_t)cell_rows(d));
    if (!err && !v->share)
        err = sst_gpu_buffer_create(d->gpu, &v->share, 12 * (size_t)d->rows * (size_t)d->lf->width);
    if (err || p->count <= v->count)
        return err;
    sst_gpu_buffer_destroy(d->gpu, v->rays);
    sst_gpu_buffer_destroy(d->gpu, v->near);
    sst_gpu_buffer_destroy(d->gpu, v->totals);
    v->rays = v->near = v->totals = NULL;
    v->count = 0;
    rows = find_rows(d, p->count);
    return rows < sst_min_int(LEAST_ROWS, d->lf->height) ? -ENOMEM : make_rays(d, p->count, rows);
}

/* True if chunks lack the confidences that the picture's views have. */
static bool lacks_confidences(const struct render_device *d, const struct sst_render_plan *p)
{
    bool any = false;

    for (int k = 0; k < p->count; k++)
        any = any || p->tap[k].v->confidence.data;
    return any && !d->doubts;
}

/* Rarities of colours, and rows of labels. */
static int upload_params(struct render_device *d, const struct sst_render_plan *p)
{
    struct sst_gpu_verify_params params;

    for (int i = 0; i < 256; i++)
        params.label[i] = (struct sst_gpu_blend_label){
            p->table ? (uint32_t)((size_t)(p->range[i].weight - p->table) / SST_BLEND_COLUMNS) : 0, p->ends[i]
        };
    memcpy(params.rarity, p->rarity, sizeof(params.rarity));
    return sst_gpu_upload(d->gpu, d->verify.params, 0, &params, sizeof(params));
}

static int upload_cells(struct render_device *d, const uint8_t *cells)
{
    const size_t n = (size_t)cell_cols(d) * (size_t)cell_rows(d);
    uint32_t *word = d->verify.cell;

    for (size_t i = 0; i < n; i++)
        word[i] = !cells || cells[i] ? SST_GPU_CELL_WANTED : 0;
    return sst_gpu_upload(d->gpu, d->verify.cells, 0, word, 4 * n);
}

int device_make_verify(struct render_device *d, const struct device_batch *b)
{
    int err = d->rows < d->lf->height && d->rows % SST_RENDER_CELL_HEIGHT ? -ENOMEM : 0; /* not one row of cells */

    if (!err && !d->verify.cell) {
        d->verify.cell = calloc((size_t)cell_cols(d) * (size_t)cell_rows(d), sizeof(*d->verify.cell));
        err = d->verify.cell ? 0 : -ENOMEM;
    }
    if (!err && lacks_confidences(d, b->p)) {
        d->doubts = true;
        err = d->slots ? -ENOMEM : 0; /* make room first: the views come again with them */
    }
    if (!err)
        err = make_buffers(d, b->p);
    if (!err && b->p->explainer)
        err = device_make_explained(d, b);
    if (!err)
        err = upload_params(d, b->p);
    return err ? err : upload_cells(d, b->cells);
}

/* --- dispatches --------------------------------------------------------------------------------------------------- */

int device_dispatch_verify(struct render_device *d, enum sst_gpu_shader shader, const struct sst_gpu_verify *push,
                           struct sst_gpu_buffer *const *buffer, int buffers, int rows)
{
    struct sst_gpu_work work = {
        .shader = shader,
        .push = push,
        .groups = { (uint32_t)(push->blend.width + SST_GPU_VERIFY_GROUP_WIDTH - 1) / SST_GPU_VERIFY_GROUP_WIDTH,
                    (uint32_t)(rows + SST_GPU_VERIFY_GROUP_HEIGHT - 1) / SST_GPU_VERIFY_GROUP_HEIGHT, 1 }
    };

    if (shader == SST_GPU_VERIFY_SCREEN) {
        work.groups[0] = (uint32_t)cell_cols(d);
        work.groups[1] = (uint32_t)(rows + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
    }
    memcpy(work.buffer, buffer, (size_t)buffers * sizeof(*buffer));
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

static int upload_views(struct render_device *d, const struct device_batch *b)
{
    return b->push.blend.views ? sst_gpu_upload(d->gpu, d->verify.params, sizeof(struct sst_gpu_verify_params), b->view,
                                                b->push.blend.views * sizeof(b->view[0]))
                               : 0;
}

static int send_share(struct render_device *d, struct device_batch *b, bool last)
{
    const struct device_verify *v = &d->verify;
    struct sst_gpu_verify push = b->push;
    int err = upload_views(d, b);

    push.blend.flags = (b->begun ? 0U : SST_GPU_BLEND_FIRST) | (last ? SST_GPU_BLEND_LAST : 0U);
    if (!err)
        err = device_dispatch_verify(
            d, SST_GPU_VERIFY_SHARE, &push,
            (struct sst_gpu_buffer *[]){ v->params, d->chunk[b->chunk].disp, d->sums, d->out, v->share, v->cells },
            SST_GPU_SHARE_BUFFERS, push.blend.rows);
    device_batch_sent(d, b);
    return err;
}

static int send_rays(struct render_device *d, struct device_batch *b, bool last SST_UNUSED)
{
    const struct device_chunk *c = &d->chunk[b->chunk];
    const struct device_verify *v = &d->verify;
    int err = upload_views(d, b);

    if (!err)
        err = device_dispatch_verify(d, SST_GPU_VERIFY_RAYS, &b->push,
                                     (struct sst_gpu_buffer *[]){ v->params, c->pixels, c->disp, c->valid, d->table,
                                                                  c->confidence ? c->confidence : c->valid, v->share,
                                                                  v->rays },
                                     SST_GPU_RAYS_BUFFERS, (int)b->push.rays / b->push.blend.width);
    device_batch_sent(d, b);
    return err;
}

static void begin(struct device_batch *b, int (*send)(struct render_device *, struct device_batch *, bool))
{
    b->send = send;
    b->begun = false;
}

/* --- pixels left to votes ----------------------------------------------------------------------------------------- */

static int find_share(struct render_device *d, struct device_batch *b)
{
    const struct sst_gpu_blend *push = &b->push.blend;
    int err = 0;

    begin(b, send_share);
    for (int k = 0; k < b->p->count && !err; k++) {
        const struct sst_render_tap *t = &b->p->tap[k];

        if (t->x0 < t->x1 && t->y0 < push->top + push->rows && t->y1 > push->top)
            err = device_add_tap(d, b, k);
    }
    return err ? err : send_share(d, b, true);
}

/* The rows of the band that have open cells: none if from = to. @return -EAGAIN: a pixel left to votes has no colour */
static int find_open(struct render_device *d, struct device_batch *b)
{
    const int cols = cell_cols(d), first = b->push.blend.top / SST_RENDER_CELL_HEIGHT;
    const int rows = (b->push.blend.rows + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
    /* A dummy device has looked at nothing. */
    const uint32_t open = sst_gpu_is_dummy(d->gpu) ? SST_GPU_CELL_WANTED : SST_GPU_CELL_OPEN;
    uint32_t *cell = d->verify.cell;
    int err = sst_gpu_download(d->gpu, cell, d->verify.cells, 4 * (size_t)first * (size_t)cols,
                               4 * (size_t)rows * (size_t)cols);

    b->push.from = b->push.to = b->push.blend.top;
    for (int i = 0; i < rows * cols && !err; i++) {
        const int y = b->push.blend.top + i / cols * SST_RENDER_CELL_HEIGHT;

        if (cell[i] & SST_GPU_CELL_BELOW)
            err = -EAGAIN;
        if (!(cell[i] & open))
            continue;
        if (b->push.from == b->push.to)
            b->push.from = y;
        b->push.to = sst_min_int(y + SST_RENDER_CELL_HEIGHT, b->push.blend.top + b->push.blend.rows);
    }
    return err;
}

/* --- votes -------------------------------------------------------------------------------------------------------- */

/* The rays of all views. */
static int gather_rays(struct render_device *d, struct device_batch *b)
{
    const int top = sst_max_int(b->push.from - 1, 0), end = top + (int)b->push.rays / b->push.blend.width;
    int err = 0;

    begin(b, send_rays);
    for (int k = 0; k < b->p->count && !err; k++) {
        const struct sst_render_tap *t = &b->p->tap[k];

        if (t->x0 < t->x1 && t->y0 < end && t->y1 > top)
            err = device_add_tap(d, b, k);
        else /* no rays here: the view need not be there */
            b->view[b->push.blend.views++] = (struct sst_gpu_blend_view){ .index = (uint32_t)k };
    }
    return err ? err : send_rays(d, b, true);
}

/* Verify the rows from .. to - 1. */
static int vote(struct render_device *d, struct device_batch *b)
{
    const int rows = sst_min_int(b->push.to + 1, d->lf->height) - sst_max_int(b->push.from - 1, 0);
    const struct device_verify *v = &d->verify;
    int err;

    b->push.rays = (uint32_t)rows * (uint32_t)d->lf->width;
    err = gather_rays(d, b);
    if (!err && b->p->explainer)
        err = device_find_unexplained(d, b, rows);
    if (!err)
        err = device_dispatch_verify(d, SST_GPU_VERIFY_MODE, &b->push,
                                     (struct sst_gpu_buffer *[]){ v->share, v->rays, v->near, v->totals },
                                     SST_GPU_MODE_BUFFERS, rows);
    if (!err)
        err = device_dispatch_verify(d, SST_GPU_VERIFY_BLEND, &b->push,
                                     (struct sst_gpu_buffer *[]){ v->share, v->rays, v->near, v->totals, d->out },
                                     SST_GPU_MIX_BUFFERS, b->push.to - b->push.from);
    return err;
}

int device_verify_band(struct render_device *d, struct device_batch *b)
{
    const struct sst_verify_numbers *numbers = &b->p->numbers;
    int err, end;

    b->push.nearest = numbers->nearest;
    b->push.all = numbers->all;
    b->push.scale = numbers->scale;
    b->push.most = numbers->most;
    b->push.doubt_step = SST_VERIFY_DOUBT_STEP;
    err = find_share(d, b);
    if (!err)
        err = find_open(d, b);
    end = b->push.to;
    if (!err && b->push.from < end && b->p->explainer)
        err = device_screen(d, b);
    while (!err && b->push.from < end) {
        b->push.to = sst_min_int(b->push.from + d->verify.rows - 2, end);
        if (d->verify.rows == d->lf->height)
            b->push.to = end;
        if (b->p->explainer)
            err = device_place_explained(d, b);
        if (!err)
            err = vote(d, b);
        b->push.from = b->push.to;
    }
    return err;
}
