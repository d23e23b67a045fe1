/* Clear pictures on a device: rays land at the viewpoint, then the pixels are coloured. Here with all views there at
 * once; what does not fit is done in parts: device_parts.c. */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/method/render/render_internal.h"

void device_drop_clear(struct render_device *d)
{
    sst_gpu_buffer_destroy(d->gpu, d->clear_params);
    sst_gpu_buffer_destroy(d->gpu, d->landed);
    sst_gpu_buffer_destroy(d->gpu, d->masks);
    sst_gpu_buffer_destroy(d->gpu, d->levels);
    d->clear_params = d->landed = d->masks = d->levels = NULL;
    d->clear_views = 0;
}

/* Buffers of clear pictures: where rays land, masks of what is removed where there are any, levels to fill holes. */
static int make_clear_buffers(struct render_device *d, const struct device_clear *c)
{
    const size_t slots = (size_t)(d->lf->rows * d->lf->cols);
    int err = 0;

    if (c->count > d->clear_views) {
        sst_gpu_buffer_destroy(d->gpu, d->landed);
        d->landed = NULL;
        d->clear_views = 0;
        err = sst_gpu_buffer_create(d->gpu, &d->landed, 4 * (size_t)c->count * device_view_pixels(d));
        d->clear_views = err ? 0 : c->count;
    }
    if (!err && c->remove && !d->masks)
        err = sst_gpu_buffer_create(d->gpu, &d->masks, slots * device_view_pixels(d));
    if (!err && !*d->why_holes && !d->levels)
        err = sst_gpu_buffer_create(d->gpu, &d->levels, device_hole_bytes(d));
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
        err = sst_gpu_upload(d->gpu, d->masks, c->view[k].first, memory, device_view_pixels(d));
    }
    return err;
}

uint32_t device_clear_flags(const struct device_clear *c, int k, bool frame)
{
    const struct sst_view *v = c->tap[k]->v;

    return (frame || v->valid.data ? SST_GPU_CLEAR_VALID : 0U) | (v->label.data ? SST_GPU_CLEAR_LABELS : 0U) |
           (c->remove && c->remove[c->tap[k]->view].data ? SST_GPU_CLEAR_MASK : 0U);
}

static void describe_clear(struct device_clear *c, struct render_device *d)
{
    for (int k = 0; k < c->count; k++) {
        const struct device_slot *s = device_find_slot(d, c->tap[k]->view);

        c->view[k].first = (uint32_t)((size_t)s->index * device_view_pixels(d));
        c->view[k].flags = device_clear_flags(c, k, c->tap[k]->frame != NULL);
        c->view[k].top = 0;
        c->view[k].end = d->lf->height;
    }
    c->push.pitch = d->pitch;
    c->push.views = (uint32_t)c->count;
    c->push.top = 0;
    c->push.rows = d->lf->height;
}

static uint32_t groups(int n, int of)
{
    return (uint32_t)((n + of - 1) / of);
}

int device_dispatch_clear(struct render_device *d, const struct device_clear *c, const struct device_chunk *views,
                          struct sst_gpu_buffer *masks, struct sst_gpu_buffer *landed, struct sst_gpu_buffer *seen,
                          struct sst_gpu_buffer *out)
{
    struct sst_gpu_clear push = c->push;
    struct sst_gpu_work land = {
        .shader = SST_GPU_CLEAR_LAND,
        .push = &push,
        .buffer = { d->clear_params, views->pixels, views->disp, views->valid, masks ? masks : views->valid, landed },
        .groups = { groups(push.width, SST_GPU_CLEAR_GROUP_WIDTH), groups(push.rows, SST_GPU_CLEAR_GROUP_HEIGHT),
                    push.views },
    };
    const struct sst_gpu_work blend = { .shader = SST_GPU_CLEAR_BLEND,
                                        .push = &push,
                                        .buffer = { d->clear_params, views->pixels, landed, seen,
                                                    push.sampled ? d->parts.state : landed, out },
                                        .groups = { land.groups[0], land.groups[1], 1 } };
    int most = 0, err;

    for (int k = 0; k < c->count; k++)
        most = sst_max_int(most, c->view[k].end - c->view[k].top);
    push.zero = 1;
    err = sst_gpu_dispatch(d->gpu, &land);
    push.zero = 0;
    land.groups[1] = groups(most, SST_GPU_CLEAR_GROUP_HEIGHT);
    if (!err && most)
        err = sst_gpu_dispatch(d->gpu, &land);
    if (!err && push.sampled)
        err = device_sample_rays(d, c, landed);
    if (!err)
        err = sst_gpu_dispatch(d->gpu, &blend);
    d->report.dispatches += 3;
    return err ? err : sst_gpu_wait(d->gpu);
}

/* @return -ENOMEM: it does not fit */
static int render_whole(struct render_device *d, struct device_clear *c)
{
    const size_t n = (size_t)d->lf->width * (size_t)d->lf->height;
    struct device_taps taps = { .count = c->count, .threads = c->threads };
    int64_t start_ns;
    int err;

    memcpy(taps.tap, c->tap, (size_t)c->count * sizeof(c->tap[0]));
    err = device_make_frames(d, &taps);
    if (!err)
        err = device_make_bands(d);
    if (!err && d->rows < d->lf->height)
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
        err = device_dispatch_clear(d, c, &d->chunk[device_find_slot(d, c->tap[0]->view)->chunk], d->masks, d->landed,
                                    d->sums, d->out);
    c->filled = !c->push.merged && d->levels;
    if (!err && c->filled)
        err = device_fill_holes(d, &(struct device_holes){ d->levels, d->out, d->lf->height, true });
    start_ns = sst_clock_now_ns();
    if (!err && !c->filled)
        err = sst_gpu_download(d->gpu, d->words.data, d->out, 0, 4 * n);
    if (!err && c->push.merged)
        err = sst_gpu_download(d->gpu, d->weights.data, d->sums, 0, 4 * n);
    d->report.download_ns += sst_clock_now_ns() - start_ns;
    return err;
}

int device_fill_words(struct render_device *d)
{
    const struct device_parts *p = &d->parts;
    const int rows = (int)(p->pixels / (size_t)d->lf->width);

    if (d->levels)
        return device_fill_holes(d, &(struct device_holes){ d->levels, d->out, d->lf->height, false });
    if (!p->levels)
        return -ENOMEM;
    return device_fill_holes(
        d, &(struct device_holes){ p->levels, p->out, rows < d->lf->height ? rows / 2 * 2 : d->lf->height, false });
}

/* Whether all views and their rays may fit, if nothing else is there. */
static bool may_fit(const struct render_device *d, const struct device_clear *c)
{
    const uint64_t pixels = (uint64_t)c->count * device_view_pixels(d);
    const uint64_t levels = *d->why_holes ? 0 : device_hole_bytes(d);

    return !c->push.sampled && (!d->too_many || c->count < d->too_many) &&
           4 * pixels <= sst_gpu_get_info(d->gpu)->buffer_bytes &&
           (DEVICE_PIXEL_BYTES + d->doubts + 4 + (c->remove != NULL)) * pixels + levels <= d->limit_bytes;
}

int device_render_clear(struct render_device *d, struct device_clear *c)
{
    const size_t n = (size_t)d->lf->width * (size_t)d->lf->height;
    const bool whole = may_fit(d, c);
    int err = -ENOMEM;

    if (!sst_mem_keep(&d->words, n, 4) || (c->push.merged && !sst_mem_keep(&d->weights, n, 4)))
        return err;
    if (whole)
        err = render_whole(d, c);
    if (whole && err == -ENOMEM && d->verify.params) { /* what rays are verified with gives way */
        device_drop_verify(d);
        d->full = false;
        err = render_whole(d, c);
    }
    if (err != -ENOMEM)
        return err;
    if (whole) {
        device_drop_clear(d);
        d->too_many = c->count;
    }
    return c->pending ? -EAGAIN : device_render_parts(d, c);
}
