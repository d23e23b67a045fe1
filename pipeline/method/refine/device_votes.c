/* Votes of views about labels on a device: each view is uploaded once, pixels, label and disparity. Where not all of
 * them fit, the one that was used least recently gives way. */
#include <errno.h>
#include <stdlib.h>

#include "base/clock.h"
#include "pipeline/gpu/vote.h"
#include "pipeline/method/refine/refine_internal.h"

#define STEP_MOST  32767     /* a disparity of 16 bits times this fits 32 bits */
#define SHIFT_MOST (1 << 30) /* px */

_Static_assert((int)SST_GPU_VOTERS == SST_REFINE_VOTERS, "one buffer each");

static void drop_view(struct sst_refine_device *d, int view)
{
    sst_gpu_buffer_destroy(sst_gpu_shared_device(d->shared), d->view[view].buffer);
    d->view[view].buffer = NULL;
}

void refine_drop_votes(struct sst_refine_device *d)
{
    for (int i = 0; i < SST_MAX_VIEWS; i++)
        drop_view(d, i);
}

void sst_refine_device_forget_votes(struct sst_refine_device *d)
{
    if (!d)
        return;
    sst_gpu_shared_lock(d->shared);
    refine_drop_votes(d);
    sst_gpu_shared_unlock(d->shared);
}

/* Free the view that was used least recently, but none of this turn. @return whether there was one */
static bool drop_oldest(struct sst_refine_device *d)
{
    int oldest = -1;

    for (int i = 0; i < SST_MAX_VIEWS; i++) {
        if (d->view[i].buffer && d->view[i].used != d->turn && (oldest < 0 || d->view[i].used < d->view[oldest].used))
            oldest = i;
    }
    if (oldest >= 0)
        drop_view(d, oldest);
    return oldest >= 0;
}

static int create_view(struct sst_refine_device *d, int view, size_t bytes)
{
    int err = sst_gpu_buffer_create(d->gpu, &d->view[view].buffer, bytes);

    if (err == -ENOMEM && (refine_device_drop_kept(d) || sst_gpu_shared_make_room(d->shared, &d->user)))
        err = sst_gpu_buffer_create(d->gpu, &d->view[view].buffer, bytes);
    while (err == -ENOMEM && drop_oldest(d))
        err = sst_gpu_buffer_create(d->gpu, &d->view[view].buffer, bytes);
    return err;
}

/* The pixels of a view on the device. */
static int need_view(struct sst_refine_device *d, const struct sst_view *v, int view)
{
    const size_t width = (size_t)v->label.width, n = width * (size_t)v->label.height;
    const int64_t start_ns = sst_clock_now_ns();
    uint32_t(*words)[2];
    int err;

    d->view[view].used = d->turn;
    if (d->view[view].buffer)
        return 0;
    words = sst_mem_keep(&d->words, n, sizeof(*words));
    err = words ? create_view(d, view, n * sizeof(*words)) : -ENOMEM;
    for (int y = 0; y < v->label.height && !err; y++) {
        const uint8_t *r = sst_image_row(&v->image, 0, y), *g = sst_image_row(&v->image, 1, y);
        const uint8_t *b = sst_image_row(&v->image, 2, y), *label = sst_map_u8_row(&v->label, y);
        const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);
        uint32_t(*to)[2] = words + (size_t)y * width;

        for (size_t x = 0; x < width; x++) {
            to[x][0] = (uint32_t)(r[x] | g[x] << 8 | b[x] << 16) | (uint32_t)label[x] << 24;
            to[x][1] = disp[x] | (!valid || valid[x] ? 0xFF0000U : 0);
        }
    }
    err = err ? err : sst_gpu_upload(d->gpu, d->view[view].buffer, 0, words, n * sizeof(*words));
    if (err)
        drop_view(d, view);
    d->report.uploads++;
    d->report.upload_bytes += (int64_t)(n * sizeof(*words));
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

/* @return 0, -EOVERFLOW (views so far apart that numbers of 32 bits do not hold it) */
static int set_shift(struct sst_gpu_shift *out, const struct sst_refine_voter *v)
{
    if (llabs(v->across.step) > STEP_MOST || llabs(v->down.step) > STEP_MOST ||
        llabs(v->across.at >> 16) > SHIFT_MOST || llabs(v->down.at >> 16) > SHIFT_MOST)
        return -EOVERFLOW;
    *out = (struct sst_gpu_shift){ (int32_t)(v->across.at >> 16),  (int32_t)(v->across.at & 0xFFFF),
                                   (int32_t)v->across.step,        (int32_t)(v->down.at >> 16),
                                   (int32_t)(v->down.at & 0xFFFF), (int32_t)v->down.step };
    return 0;
}

static int vote(struct sst_refine_device *d, struct sst_map_u8 *out, const struct sst_lightfield *lf, int view,
                const struct sst_refine_voter *voters, int count)
{
    const int width = out->width, height = out->height;
    struct sst_gpu_vote push = { .width = width, .height = height, .count = count };
    const size_t n = (size_t)width * (size_t)height;
    struct sst_gpu_work work = { .shader = SST_GPU_VOTE,
                                 .push = &push,
                                 .groups = { (uint32_t)(width + 31) / 32, (uint32_t)(height + 7) / 8, 1 } };
    uint32_t *words;
    int err = refine_device_keep(d, REFINE_KEPT_OUT, n * sizeof(*words));

    d->turn++;
    err = err ? err : need_view(d, &lf->views[view], view);
    for (int i = 0; i < SST_GPU_VOTERS && !err; i++) {
        const int from = i < count ? voters[i].view : view;

        if (i < count)
            err = set_shift(&push.shift[i], &voters[i]);
        err = err ? err : need_view(d, &lf->views[from], from);
        work.buffer[SST_GPU_VOTE_VOTERS + i] = d->view[from].buffer;
    }
    work.buffer[SST_GPU_VOTE_OWN] = d->view[view].buffer;
    work.buffer[SST_GPU_VOTE_OUT] = d->kept[REFINE_KEPT_OUT];
    words = sst_mem_keep(&d->words, n, sizeof(*words));
    err = err || words ? err : -ENOMEM;
    d->report.dispatches += !err;
    err = err ? err : sst_gpu_dispatch(d->gpu, &work);
    err = err ? err : refine_device_download(d, REFINE_KEPT_OUT, words, n * sizeof(*words));
    for (int y = 0; y < height && !err; y++) {
        uint8_t *to = sst_map_u8_row(out, y);

        for (int x = 0; x < width; x++)
            to[x] = (uint8_t)words[(size_t)y * (size_t)width + (size_t)x];
    }
    return err;
}

bool sst_refine_device_vote(struct sst_refine_device *d, struct sst_map_u8 *out, const struct sst_lightfield *lf,
                            int view, const struct sst_refine_voter *voters, int count)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err;

    if (refine_device_begin(d, &err))
        err = vote(d, out, lf, view, voters, count);
    done = refine_device_end(d, err, "views vote");
    d->report.voted += done;
    d->report.voted_on_cpu += !done;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    return done;
}
