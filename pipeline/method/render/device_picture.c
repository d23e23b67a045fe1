/* Pictures on a device: a dispatch of `blend` per run of views that share a chunk.
 *
 * Pictures too large for a buffer are made in bands of rows. The order of the views' rays, and so the bytes, stay the
 * same. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "pipeline/method/render/device_internal.h"

_Static_assert(sizeof(struct sst_gpu_blend_view) == 64 && sizeof(struct sst_gpu_blend_label) == 8,
               "the layout of blend.comp");

#define SUM_BYTES 20                                  /* of a pixel of the picture: four sums and the result */
#define ROW_BYTES (SST_BLEND_COLUMNS * sizeof(float)) /* of the table of label weights */

static uint32_t flags_of(const struct sst_render_plan *p)
{
    return (p->weighted ? SST_GPU_BLEND_WEIGHTED : 0U) | (p->summed ? SST_GPU_BLEND_SUMMED : 0U) |
           (p->table ? SST_GPU_BLEND_BY_LABEL : 0U) | (p->verifier ? SST_GPU_BLEND_WEIGHTS : 0U);
}

static void begin_batch(struct device_batch *b, const struct render_device *d, const struct sst_render_plan *p)
{
    b->p = p;
    b->chunk = 0;
    b->begun = false;
    b->push = (struct sst_gpu_verify){ .height = d->lf->height,
                                       .count = (uint32_t)p->count,
                                       .explained = p->explainer != NULL };
    b->push.blend = (struct sst_gpu_blend){ .width = d->lf->width,
                                            .pitch = d->pitch,
                                            .flags = flags_of(p),
                                            .focus_whole_q6 = p->blend.focus_whole_q6,
                                            .focus_part_q6 = p->blend.focus_part_q6,
                                            .scale = p->blend.scale,
                                            .c1 = p->blend.c1,
                                            .first = p->blend.first,
                                            .count = p->blend.count };
    memcpy(b->push.blend.power, p->blend.power, sizeof(b->push.blend.power));
    b->taps.count = 0;
    b->taps.sampled = p->sampled;
    b->taps.rays = false;
    b->taps.threads = sst_thread_count(p->cfg.threads);
    for (int k = 0; k < p->count; k++)
        b->taps.tap[b->taps.count++] = &p->tap[k];
}

/* Buffers of a band of the picture, as many rows as fit: sums and results use at most a quarter of the memory. */
static int make_bands(struct render_device *d)
{
    const uint64_t row_bytes = (uint64_t)SUM_BYTES * (uint64_t)d->lf->width;
    const uint64_t quarter = sst_gpu_free_bytes(d->gpu) / 4;
    const uint64_t largest = sst_gpu_get_info(d->gpu)->buffer_bytes;
    int err;

    if (d->rows)
        return 0;
    d->rows = (int)sst_clamp_double((double)((quarter < largest ? quarter : largest) / row_bytes), 0, d->lf->height);
    if (!d->rows)
        return -ENOMEM;
    if (d->rows < d->lf->height && d->rows > SST_RENDER_CELL_HEIGHT)
        d->rows -= d->rows % SST_RENDER_CELL_HEIGHT;
    err = sst_gpu_buffer_create(d->gpu, &d->sums, (size_t)d->rows * (size_t)d->lf->width * 16);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &d->out, (size_t)d->rows * (size_t)d->lf->width * 4);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &d->params,
                                    256 * sizeof(struct sst_gpu_blend_label) +
                                        SST_MAX_VIEWS * sizeof(struct sst_gpu_blend_view));
    return err;
}

/* What does not depend on the views. A larger table than before comes first again: views may use all the memory. */
static int make_room(struct render_device *d, const struct sst_render_plan *p, const struct device_taps *taps)
{
    const size_t rows = p->table_rows;
    int err;

    if (rows > d->table_rows)
        device_drop(d);
    err = device_make_frames(d, taps);
    if (!d->slots)
        device_drop_kept(d);
    if (!err)
        err = make_bands(d);
    if (err || d->table)
        return err;
    d->table_rows = rows;
    return sst_gpu_buffer_create(d->gpu, &d->table, rows * ROW_BYTES);
}

/* The weights by label. */
static int upload_labels(struct render_device *d, const struct sst_render_plan *p)
{
    struct sst_gpu_blend_label label[256];
    int err;

    for (int i = 0; i < 256; i++) {
        const size_t row = p->table ? (size_t)(p->range[i].weight - p->table) / SST_BLEND_COLUMNS : 0;

        label[i] = (struct sst_gpu_blend_label){ (uint32_t)row, p->ends[i] };
    }
    err = sst_gpu_upload(d->gpu, d->params, 0, label, sizeof(label));
    return err || !p->table ? err
                            : sst_gpu_upload(d->gpu, d->table, 0, p->table, p->table_rows * ROW_BYTES);
}

void device_batch_sent(struct render_device *d, struct device_batch *b)
{
    for (int i = 0; i < d->slots; i++)
        d->slot[i].pending = false;
    b->push.blend.views = 0;
    b->begun = true;
}

/* Sum the rays of the views gathered. @param last  of the band */
static int send_blend(struct render_device *d, struct device_batch *b, bool last)
{
    const struct device_chunk *c = &d->chunk[b->chunk];
    struct sst_gpu_blend push = b->push.blend;
    const struct sst_gpu_work work = {
        .shader = SST_GPU_BLEND,
        .push = &push,
        .buffer = { d->params, c->pixels, c->disp, c->valid, d->table, d->sums, d->out },
        .groups = { (uint32_t)(push.width + SST_GPU_BLEND_GROUP_WIDTH - 1) / SST_GPU_BLEND_GROUP_WIDTH,
                    (uint32_t)(push.rows + SST_GPU_BLEND_GROUP_HEIGHT - 1) / SST_GPU_BLEND_GROUP_HEIGHT, 1 },
    };
    int err = 0;

    push.flags |= (b->begun ? 0U : SST_GPU_BLEND_FIRST) | (last ? SST_GPU_BLEND_LAST : 0U);
    if (push.views)
        err = sst_gpu_upload(d->gpu, d->params, 256 * sizeof(struct sst_gpu_blend_label), b->view,
                             push.views * sizeof(b->view[0]));
    if (!err)
        err = sst_gpu_dispatch(d->gpu, &work);
    device_batch_sent(d, b);
    d->report.dispatches++;
    return err;
}

/* Pixels that were sampled at the rays, each from its frame, are taken as they are. */
struct sst_gpu_blend_view device_describe_tap(const struct render_device *d, const struct device_batch *b, int k,
                                              uint32_t first)
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
                                    .first = first,
                                    .index = (uint32_t)k };
    int16_t tap[4];

    sst_blend_set_taps(tap, fx, fy);
    for (int i = 0; i < 4; i++)
        v.tap[i] = tap[i];
    v.flags = (fx > 0 ? SST_GPU_VIEW_RIGHT : 0U) | (fy > 0 ? SST_GPU_VIEW_BELOW : 0U) |
              (t->frame || t->v->valid.data ? SST_GPU_VIEW_VALID : 0U) | (t->v->label.data ? SST_GPU_VIEW_LABELS : 0U) |
              (d->doubts && t->v->confidence.data ? SST_GPU_VIEW_CONFIDENCE : 0U);
    return v;
}

uint32_t device_slot_first(const struct render_device *d, const struct device_slot *s)
{
    return (uint32_t)((size_t)s->index * device_view_pixels(d));
}

/* A slot for one more view; the batch is sent if it reads all there are. */
static int find_room(struct render_device *d, struct device_batch *b, struct device_slot **out)
{
    struct device_slot *s = device_free_slot(d);
    int err = 0;

    if ((!s || s->view != DEVICE_NO_VIEW) && !d->full) {
        err = device_grow(d);
        if (err && (err != -ENOMEM || !d->slots))
            return err;
        s = device_free_slot(d);
    }
    err = s ? 0 : b->send(d, b, false);
    *out = s ? s : device_free_slot(d);
    return err;
}

int device_add_tap(struct render_device *d, struct device_batch *b, int k)
{
    const struct sst_render_tap *t = &b->p->tap[k];
    int err = device_ready_frames(d, &b->taps, k);
    struct device_slot *s = device_find_slot(d, t->view);

    if (!err && !s)
        err = find_room(d, b, &s);
    if (!err && b->push.blend.views && b->chunk != s->chunk)
        err = b->send(d, b, false);
    if (!err)
        err = device_place_view(d, s, t, b->p->sampled, b->taps.threads);
    if (err)
        return err;
    s->used = ++d->turn;
    s->pending = true;
    b->chunk = s->chunk;
    b->view[b->push.blend.views++] = device_describe_tap(d, b, k, device_slot_first(d, s));
    return 0;
}

static int render_band(struct render_device *d, struct device_batch *b, int top, int rows)
{
    const size_t n = (size_t)rows * (size_t)d->lf->width, at = (size_t)top * (size_t)d->lf->width;
    int64_t start_ns;
    int err = 0;

    b->begun = false;
    b->send = send_blend;
    b->push.blend.top = top;
    b->push.blend.rows = rows;
    for (int k = 0; k < b->p->count && !err; k++) {
        const struct sst_render_tap *t = &b->p->tap[k];

        if (t->x0 < t->x1 && t->y0 < top + rows && t->y1 > top)
            err = device_add_tap(d, b, k);
    }
    if (!err)
        err = send_blend(d, b, true);
    if (!err && b->verify)
        err = device_verify_band(d, b);
    if (!err)
        err = sst_gpu_wait(d->gpu);
    start_ns = sst_clock_now_ns();
    if (!err)
        err = sst_gpu_download(d->gpu, (uint32_t *)d->words.data + at, d->out, 0, 4 * n);
    if (!err && b->p->verifier && !b->verify)
        err = sst_gpu_download(d->gpu, (float *)d->weights.data + at, d->sums, 12 * n, 4 * n);
    d->report.download_ns += sst_clock_now_ns() - start_ns;
    return err;
}

/* All but the views, which may use all the memory. */
static int make_all(struct render_device *d, const struct device_batch *b)
{
    int err = make_room(d, b->p, &b->taps);

    if (err || !b->verify)
        return err;
    err = device_make_verify(d, b);
    if (err != -ENOMEM || (!device_make_room(d) && !d->slots))
        return err;
    device_drop(d);
    err = make_room(d, b->p, &b->taps);
    return err ? err : device_make_verify(d, b);
}

/* Blend, and verify as b->verify says. */
static int render_rows(struct render_device *d, struct device_batch *b, int top, int end)
{
    const size_t n = (size_t)d->lf->width * (size_t)d->lf->height;
    int err = make_all(d, b);

    if (!err && (!sst_mem_keep(&d->words, n, 4) || (b->p->verifier && !b->verify && !sst_mem_keep(&d->weights, n, 4))))
        err = -ENOMEM;
    if (!err)
        err = upload_labels(d, b->p);
    if (!err && !d->slots)
        err = device_grow(d); /* a dispatch names buffers even where no view overlaps */
    for (int y = top; y < end && !err; y += d->rows)
        err = render_band(d, b, y, sst_min_int(d->rows, end - y));
    return err;
}

/* Note why rays are not verified on the device. @return false: it failed for another reason */
static bool note_unverified(struct render_device *d, int err)
{
    d->verify.small = d->verify.small || err == -ENOMEM;
    d->verify.cramped = d->verify.cramped || err == -EOVERFLOW;
    d->verify.why = err == -EAGAIN      ? DEVICE_UNVERIFIED_WEIGHTS
                    : err == -ENOTSUP   ? DEVICE_UNVERIFIED_REFUSED
                    : err == -EOVERFLOW ? DEVICE_UNVERIFIED_CRAMPED
                                        : DEVICE_UNVERIFIED_SMALL;
    return err == -EAGAIN || err == -ENOTSUP || err == -EOVERFLOW || err == -ENOMEM;
}

void device_picture(struct sst_run *r, struct render_picture *p)
{
    struct render_device *d = p->device;
    const int64_t start_ns = sst_clock_now_ns();
    struct device_batch b;
    int err;

    d->gpu = sst_run_gpu(r);
    begin_batch(&b, d, p->plan);
    b.cells = p->cells;
    b.verify = p->verify;
    err = render_rows(d, &b, p->top, p->end);
    sst_run_fail(r, err);
    d->report.total_ns += err ? 0 : sst_clock_now_ns() - start_ns;
    p->words = d->words.data;
    p->weights = p->plan->verifier && !p->verify ? d->weights.data : NULL;
}

static int render(struct render_device *d, struct render_picture *p)
{
    return sst_run_item(&d->user, d->user.steps[p->verify ? RENDER_STEP_VERIFY : RENDER_STEP_PICTURE], p, 0);
}

int device_render_picture(struct render_device *d, struct render_picture *p)
{
    int err;

    p->verify = p->plan->verifier && device_can_verify(d, p->plan);
    err = p->verify ? device_prepare(d, RENDER_STEP_VERIFY) : 0;
    if (!err)
        err = render(d, p);
    if (err == -EXDEV)
        err = render(d, p); /* once more, with rows of the views in one buffer */
    if (err && p->verify && note_unverified(d, err)) {
        device_drop_verify(d);
        d->full = false;
        p->verify = false;
        err = render(d, p);
    }
    return err;
}
