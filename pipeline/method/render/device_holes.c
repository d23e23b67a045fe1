/* The holes of clear pictures on a device: a pyramid of weighted means, as fill.c makes it. The levels lie there as a
 * whole; the picture may go through in bands of rows, first to make the finest level, then to be filled from it. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/gpu/hole.h"
#include "pipeline/kernels/pyramid_ref.h"
#include "pipeline/method/render/render_internal.h"

size_t device_hole_bytes(const struct render_device *d)
{
    return clear_fill_bytes(d->lf->width, d->lf->height);
}

int device_prepare_holes(struct render_device *d)
{
    int err = sst_gpu_prepare(d->gpu, SST_GPU_HOLE_PULL);

    if (!err)
        err = sst_gpu_prepare(d->gpu, SST_GPU_HOLE_PUSH);
    snprintf(d->why_holes, sizeof(d->why_holes), "%s", err ? sst_gpu_error(err) : "");
    return err == -ENOTSUP ? 0 : err;
}

/* What a dispatch works between: the picture and the first level, or a level and the next one. */
struct step {
    struct sst_gpu_hole push;
    struct sst_gpu_buffer *levels, *picture;
};

static uint32_t groups(int n, int of)
{
    return (uint32_t)((n + of - 1) / of);
}

static int pull(struct render_device *d, const struct step *s)
{
    const struct sst_gpu_work work = {
        .shader = SST_GPU_HOLE_PULL,
        .push = &s->push,
        .buffer = { s->levels, s->picture },
        .groups = { groups(sst_pyramid_half(s->push.width), SST_GPU_HOLE_GROUP_WIDTH),
                    groups(sst_pyramid_half(s->push.rows), SST_GPU_HOLE_GROUP_HEIGHT), 1 },
    };

    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

static int push(struct render_device *d, const struct step *s)
{
    const struct sst_gpu_work work = { .shader = SST_GPU_HOLE_PUSH,
                                       .push = &s->push,
                                       .buffer = { s->levels, s->picture },
                                       .groups = { groups(s->push.width, SST_GPU_HOLE_GROUP_WIDTH),
                                                   groups(s->push.rows, SST_GPU_HOLE_GROUP_HEIGHT), 1 } };

    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* Steps between levels, the finest first. @return their number */
static int plan_steps(struct sst_gpu_hole step[SST_GPU_HOLE_LEVELS_MOST], int width, int height)
{
    uint32_t at = 0;
    int n = 0;

    width = sst_pyramid_half(width);
    height = sst_pyramid_half(height);
    for (; width > 1 || height > 1; n++) {
        const uint32_t next = at + (uint32_t)width * (uint32_t)height;

        step[n] =
            (struct sst_gpu_hole){ .width = width, .height = height, .rows = height, .finer = at, .coarser = next };
        width = sst_pyramid_half(width);
        height = sst_pyramid_half(height);
        at = next;
    }
    return n;
}

/* All levels from the first one, filled. */
static int fill_levels(struct render_device *d, struct step *s)
{
    struct sst_gpu_hole step[SST_GPU_HOLE_LEVELS_MOST];
    const int n = plan_steps(step, d->lf->width, d->lf->height);
    int err = 0;

    for (int i = 0; i < n && !err; i++) {
        s->push = step[i];
        err = pull(d, s);
    }
    for (int i = n - 1; i >= 0 && !err; i--) {
        s->push = step[i];
        err = push(d, s);
    }
    return err;
}

/* Have a band of the picture there, and make the first level of it, or fill it and have it in d->words. */
static int do_band(struct render_device *d, struct step *s, const struct device_holes *h, int top, bool pushed)
{
    const size_t width = (size_t)d->lf->width;
    const int rows = sst_min_int(h->rows, d->lf->height - top);
    uint32_t *words = (uint32_t *)d->words.data + (size_t)top * width;
    const size_t bytes = 4 * (size_t)rows * width;
    const bool whole = h->rows >= d->lf->height;
    int64_t start_ns;
    int err = 0;

    s->push = (struct sst_gpu_hole){
        .width = d->lf->width, .height = d->lf->height, .top = top, .rows = rows, .from_picture = 1
    };
    if (!h->there && !(whole && pushed)) {
        start_ns = sst_clock_now_ns();
        err = sst_gpu_upload(d->gpu, h->picture, 0, words, bytes);
        d->report.upload_bytes += (int64_t)bytes;
        d->report.upload_ns += sst_clock_now_ns() - start_ns;
    }
    if (!err)
        err = pushed ? push(d, s) : pull(d, s);
    if (err || !pushed)
        return err;
    err = sst_gpu_wait(d->gpu);
    start_ns = sst_clock_now_ns();
    if (!err)
        err = sst_gpu_download(d->gpu, words, h->picture, 0, bytes);
    d->report.download_ns += sst_clock_now_ns() - start_ns;
    return err;
}

int device_fill_holes(struct render_device *d, const struct device_holes *h)
{
    struct step s = { .levels = h->levels, .picture = h->picture };
    int err = 0;

    for (int top = 0; top < d->lf->height && !err; top += h->rows)
        err = do_band(d, &s, h, top, false);
    if (!err)
        err = fill_levels(d, &s);
    for (int top = 0; top < d->lf->height && !err; top += h->rows)
        err = do_band(d, &s, h, top, true);
    return err;
}
