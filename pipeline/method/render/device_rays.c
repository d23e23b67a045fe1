/* Clear pictures on a device whose rays are sampled from raw frames: each ray has a place of its own in the frame of
 * its view. Views take their turn, the nearest to the viewpoint first, as rays that are not in their frame leave room
 * for others; so one frame at a time has to be there. */
#include <assert.h>
#include <string.h>

#include "pipeline/gpu/clear_sample.h"
#include "pipeline/method/render/render_internal.h"

static uint32_t groups(int n, int of)
{
    return (uint32_t)((n + of - 1) / of);
}

static int find_surfaces(struct render_device *d, const struct device_clear *c, struct sst_gpu_buffer *landed)
{
    const struct sst_gpu_work work = { .shader = SST_GPU_CLEAR_SURFACE,
                                       .push = &c->push,
                                       .buffer = { landed, d->parts.state },
                                       .groups = { groups(c->push.width, SST_GPU_CLEAR_GROUP_WIDTH),
                                                   groups(c->push.rows, SST_GPU_CLEAR_GROUP_HEIGHT), 1 } };

    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* What a view's rays are sampled with. @param t  NULL: it has no frame */
static struct sst_gpu_clear_sample describe(const struct device_clear *c, int k, const struct sst_rectify_tables *t)
{
    const struct sst_gpu_clear_view *v = &c->view[k];
    struct sst_gpu_clear_sample push = { .frame = { .width = c->push.width,
                                                    .height = c->push.height,
                                                    .pitch = c->push.pitch,
                                                    .flags = SST_GPU_SAMPLE_PLAIN },
                                         .bx = v->bx,
                                         .by = v->by,
                                         .top = c->push.top,
                                         .rows = c->push.rows,
                                         .view = (uint32_t)k };

    if (!t)
        return push;
    push.frame.raw_width = t->raw_width;
    push.frame.raw_height = t->raw_height;
    push.frame.taps = t->taps;
    push.frame.cell_shift = t->cell_shift;
    push.frame.cells = t->cells;
    push.frame.flags = t->falloff ? SST_GPU_RECTIFY_LIT : 0U;
    push.frame.light_shift = t->light_shift;
    push.frame.light_cols = t->light_cols;
    push.frame.light_rows = t->light_rows;
    memcpy(push.frame.gain, t->gain, sizeof(push.frame.gain));
    memcpy(push.frame.gain_root, t->gain_root, sizeof(push.frame.gain_root));
    push.cell_rows = t->cell_rows;
    return push;
}

/* Have the frame of a view on the device, with its tables. */
static int place_frame(struct render_device *d, const struct device_clear *c, int k, struct sst_rectify_tables *t,
                       struct sst_gpu_buffer **source)
{
    const struct sst_render_tap *tap = c->tap[k];
    int err = device_ready_frames(d, c->taps, k);
    const struct device_frame *f;

    if (err)
        return err;
    f = device_find_frame(d, tap);
    assert(f);
    sst_rectify_map_tables(t, tap->frame->map, render_frame_filter(d->lf));
    return device_upload_rays(d, f, t, source);
}

static int sample_view(struct render_device *d, const struct device_clear *c, int k, struct sst_gpu_buffer *landed)
{
    const struct device_frames *f = &d->frames;
    struct sst_gpu_buffer *source = d->parts.rows.pixels;
    const bool framed = c->tap[k]->frame;
    struct sst_rectify_tables t;
    int err = framed ? place_frame(d, c, k, &t, &source) : 0;
    const struct sst_gpu_clear_sample push = describe(c, k, framed && !err ? &t : NULL);
    const struct sst_gpu_work work = {
        .shader = SST_GPU_CLEAR_SAMPLE,
        .push = &push,
        .buffer = { f->weights, source, f->places, f->list, f->light, d->parts.state, landed },
        .groups = { groups(c->push.width, SST_GPU_CLEAR_GROUP_WIDTH), groups(c->push.rows, SST_GPU_CLEAR_GROUP_HEIGHT),
                    1 },
    };

    d->report.dispatches++;
    return err ? err : sst_gpu_dispatch(d->gpu, &work);
}

int device_sample_rays(struct render_device *d, const struct device_clear *c, struct sst_gpu_buffer *landed)
{
    int err = find_surfaces(d, c, landed);

    for (int k = 0; k < c->count && !err; k++)
        err = sample_view(d, c, k, landed);
    return err;
}
