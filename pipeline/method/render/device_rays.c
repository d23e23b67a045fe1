/* Clear pictures on a device whose rays are sampled from raw frames: each ray has a place of its own in the frame of
 * its view. Views take their turn, the nearest to the viewpoint first, as rays that are not in their frame leave room
 * for others; so one frame at a time has to be there. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>

#include "pipeline/kernels/place_patch.h"
#include "pipeline/method/render/device_internal.h"

_Static_assert(sizeof(struct sst_gpu_clear_sample) == 112 && sizeof(struct sst_gpu_clear_state) == 12 &&
                   sizeof(struct sst_place_patch) == 144,
               "the layout of clear_sample.comp");

/* Constants of a view. @param t  NULL: it has no frame */
static struct sst_gpu_clear_sample describe(const struct clear_band *b, int k, const struct sst_rectify_tables *t)
{
    const struct sst_gpu_clear_view *v = &b->view[k];
    const struct sst_gpu_rectify plain = {
        .width = b->push.width, .height = b->push.height, .pitch = b->push.pitch, .flags = SST_GPU_SAMPLE_PLAIN
    };

    return (struct sst_gpu_clear_sample){ .frame = t ? device_describe_frame(b->d, t) : plain,
                                          .bx = v->bx,
                                          .by = v->by,
                                          .top = b->push.top,
                                          .rows = b->push.rows,
                                          .cell_rows = t ? t->cell_rows : 0,
                                          .view = (uint32_t)k };
}

/* Have the frame of a view on the device, with its tables. @return where it is */
static struct sst_gpu_range place_frame(const struct clear_band *b, int k, struct sst_rectify_tables *t)
{
    const struct sst_render_tap *tap = b->taps.tap[k];
    const struct device_frame *f;

    sst_rectify_map_tables(t, tap->frame->map, render_frame_filter(b->d->lf));
    device_ready_frames(b->d, &b->taps, k);
    if (sst_run_failed(b->d->run))
        return (struct sst_gpu_range){ NULL, 0 };
    f = device_find_frame(b->d, tap);
    assert(f);
    return device_upload_rays(b->d, f, t);
}

static void sample_view(struct sst_run *r, const struct clear_band *b, int k)
{
    const struct device_frames *f = &b->d->frames;
    const bool framed = b->taps.tap[k]->frame;
    struct sst_rectify_tables t;
    const struct sst_gpu_range source = framed ? place_frame(b, k, &t) : b->views.plane[DEVICE_PIXELS];
    const struct sst_gpu_clear_sample push = describe(b, k, framed ? &t : NULL);

    CLEAR_DISPATCH(r, b, SST_GPU_CLEAR_SAMPLE, &push, b->push.rows, 1, f->weights, source, f->places, f->list, f->light,
                   b->state, b->landed);
}

void clear_sample_rays(struct sst_run *r, const struct clear_band *b)
{
    CLEAR_DISPATCH(r, b, SST_GPU_CLEAR_SURFACE, &b->push, b->push.rows, 1, b->landed, b->state);
    for (int k = 0; k < b->c->count && !sst_run_failed(r); k++)
        sample_view(r, b, k);
}
