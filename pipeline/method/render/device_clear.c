/* Clear pictures on a device: rays land at the viewpoint, then the pixels are coloured. */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/method/render/render_internal.h"

/* Buffers of clear pictures: where rays land, and masks of what is removed where there are any. */
static int make_clear_buffers(struct render_device *d, const struct device_clear *c)
{
    int err = 0;

    if (c->count > d->clear_views) {
        sst_gpu_buffer_destroy(d->gpu, d->landed);
        sst_gpu_buffer_destroy(d->gpu, d->masks);
        d->landed = d->masks = NULL;
        d->clear_views = 0;
        err = sst_gpu_buffer_create(d->gpu, &d->landed, 4 * (size_t)c->count * device_view_pixels(d));
        d->clear_views = err ? 0 : c->count;
    }
    if (!err && c->remove && !d->masks)
        err = sst_gpu_buffer_create(d->gpu, &d->masks, (size_t)d->clear_views * device_view_pixels(d));
    if (!err && !d->clear_params)
        err = sst_gpu_buffer_create(d->gpu, &d->clear_params, SST_GPU_CLEAR_VIEWS * sizeof(c->view[0]));
    return err;
}

/* Put all views into one chunk. @return -ENOMEM: they do not fit into one, or into the memory */
static int gather_views(struct render_device *d, const struct device_clear *c, const struct device_taps *taps)
{
    const struct device_slot *first = NULL;
    int err = 0;

    for (int k = 0; k < c->count && !err; k++) {
        struct device_slot *s = device_find_slot(d, c->tap[k]->view);

        if (!s && !d->slots)
            err = device_grow(d);
        if (!s && !err)
            s = device_free_slot(d);
        first = first ? first : s;
        if (!err && (!s || s->chunk != first->chunk))
            err = -ENOMEM;
        if (!err)
            err = device_ready_frames(d, taps, k);
        if (!err)
            err = device_place_view(d, s, c->tap[k], false, c->threads);
        if (!err) {
            s->used = ++d->turn;
            s->pending = true;
        }
    }
    for (int i = 0; i < d->slots; i++)
        d->slot[i].pending = false;
    return err;
}

static int upload_masks(struct render_device *d, const struct device_clear *c)
{
    uint8_t *memory = sst_mem_keep(&d->packed, device_view_pixels(d), 1);
    int err = memory ? 0 : -ENOMEM;

    for (int k = 0; k < c->count && !err; k++) {
        const struct sst_map_u8 *mask = &c->remove[c->tap[k]->view];

        if (!mask->data)
            continue;
        for (int y = 0; y < mask->height; y++)
            memcpy(memory + (size_t)y * (size_t)d->pitch, sst_map_u8_row(mask, y), (size_t)mask->width);
        err = sst_gpu_upload(d->gpu, d->masks, (size_t)k * device_view_pixels(d), memory, device_view_pixels(d));
    }
    return err;
}

static void describe_clear(struct device_clear *c, struct render_device *d)
{
    for (int k = 0; k < c->count; k++) {
        const struct sst_view *v = c->tap[k]->v;

        c->view[k].first = (uint32_t)((size_t)device_find_slot(d, c->tap[k]->view)->index * device_view_pixels(d));
        c->view[k].flags = (c->tap[k]->frame || v->valid.data ? SST_GPU_CLEAR_VALID : 0U) |
                           (v->label.data ? SST_GPU_CLEAR_LABELS : 0U) |
                           (c->remove && c->remove[c->tap[k]->view].data ? SST_GPU_CLEAR_MASK : 0U);
    }
    c->push.pitch = d->pitch;
    c->push.views = (uint32_t)c->count;
}

/* Land all rays, and colour the pixels. */
static int dispatch_clear(struct render_device *d, const struct device_clear *c)
{
    const struct device_chunk *from = &d->chunk[device_find_slot(d, c->tap[0]->view)->chunk];
    struct sst_gpu_clear push = c->push;
    struct sst_gpu_work land = {
        .shader = SST_GPU_CLEAR_LAND,
        .push = &push,
        .buffer = { d->clear_params, from->pixels, from->disp, from->valid, d->masks ? d->masks : from->valid,
                    d->landed },
        .groups = { (uint32_t)(push.width + SST_GPU_CLEAR_GROUP_WIDTH - 1) / SST_GPU_CLEAR_GROUP_WIDTH,
                    (uint32_t)(push.height + SST_GPU_CLEAR_GROUP_HEIGHT - 1) / SST_GPU_CLEAR_GROUP_HEIGHT, push.views },
    };
    const struct sst_gpu_work blend = { .shader = SST_GPU_CLEAR_BLEND,
                                        .push = &push,
                                        .buffer = { d->clear_params, from->pixels, d->landed, d->sums, d->out },
                                        .groups = { land.groups[0], land.groups[1], 1 } };
    int err;

    push.zero = 1;
    err = sst_gpu_dispatch(d->gpu, &land);
    push.zero = 0;
    if (!err)
        err = sst_gpu_dispatch(d->gpu, &land);
    if (!err)
        err = sst_gpu_dispatch(d->gpu, &blend);
    d->report.dispatches += 3;
    return err ? err : sst_gpu_wait(d->gpu);
}

int device_render_clear(struct render_device *d, struct device_clear *c)
{
    const size_t n = (size_t)d->lf->width * (size_t)d->lf->height;
    struct device_taps taps = { .count = c->count, .threads = c->threads };
    int64_t start_ns;
    int err;

    memcpy(taps.tap, c->tap, (size_t)c->count * sizeof(c->tap[0]));
    err = device_make_frames(d, &taps);
    if (!err)
        err = device_make_bands(d);

    if (!err && (d->rows < d->lf->height || !sst_mem_keep(&d->words, n, 4) ||
                 (c->push.merged && !sst_mem_keep(&d->weights, n, 4))))
        err = -ENOMEM;
    if (!err)
        err = make_clear_buffers(d, c);
    if (!err)
        err = gather_views(d, c, &taps);
    if (err)
        return err;
    describe_clear(c, d);
    err = sst_gpu_upload(d->gpu, d->clear_params, 0, c->view, (size_t)c->count * sizeof(c->view[0]));
    if (!err && c->remove)
        err = upload_masks(d, c);
    if (!err)
        err = dispatch_clear(d, c);
    start_ns = sst_clock_now_ns();
    if (!err)
        err = sst_gpu_download(d->gpu, d->words.data, d->out, 0, 4 * n);
    if (!err && c->push.merged)
        err = sst_gpu_download(d->gpu, d->weights.data, d->sums, 0, 4 * n);
    d->report.download_ns += sst_clock_now_ns() - start_ns;
    return err;
}
