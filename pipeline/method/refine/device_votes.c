/* Votes of views about labels on a device. */
#include <errno.h>
#include <stdlib.h>

#include "base/clock.h"
#include "pipeline/gpu/refine.h"
#include "pipeline/method/refine/refine_internal.h"

#define STEP_MOST  32767     /* a disparity of 16 bits times this fits 32 bits */
#define SHIFT_MOST (1 << 30) /* px */

_Static_assert((int)SST_GPU_VOTERS == SST_REFINE_VOTERS, "one buffer each");

int refine_set_shift(struct sst_gpu_shift *out, const struct sst_refine_voter *v)
{
    if (llabs(v->across.step) > STEP_MOST || llabs(v->down.step) > STEP_MOST ||
        llabs(v->across.at >> 16) > SHIFT_MOST || llabs(v->down.at >> 16) > SHIFT_MOST)
        return -EOVERFLOW;
    *out = (struct sst_gpu_shift){ (int32_t)(v->across.at >> 16),  (int32_t)(v->across.at & 0xFFFF),
                                   (int32_t)v->across.step,        (int32_t)(v->down.at >> 16),
                                   (int32_t)(v->down.at & 0xFFFF), (int32_t)v->down.step };
    return 0;
}

int refine_device_labels(struct sst_refine_device *d, enum refine_kept which, struct sst_map_u8 *out)
{
    const size_t width = (size_t)out->width, n = width * (size_t)out->height;
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words));
    const int err = words ? refine_device_download(d, which, words, n * sizeof(*words)) : -ENOMEM;

    for (int y = 0; y < out->height && !err; y++) {
        uint8_t *to = sst_map_u8_row(out, y);

        for (size_t x = 0; x < width; x++)
            to[x] = (uint8_t)words[(size_t)y * width + x];
    }
    return err;
}

int refine_device_dispatch(struct sst_refine_device *d, struct sst_gpu_work *work, int width, int height)
{
    const bool counts = work->shader == SST_GPU_REFINE_COUNT || work->shader == SST_GPU_REFINE_GROUND_MISSES;
    const int rows = counts ? SST_GPU_REFINE_COUNT_HEIGHT : SST_GPU_REFINE_HEIGHT;

    work->groups[0] = (uint32_t)(width + SST_GPU_REFINE_WIDTH - 1) / SST_GPU_REFINE_WIDTH;
    work->groups[1] = (uint32_t)(height + rows - 1) / (uint32_t)rows;
    work->groups[2] = 1;
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, work);
}

int refine_device_voters(struct sst_refine_device *d, struct sst_gpu_work *work, struct sst_gpu_shift *shift,
                         const struct sst_refine_carry *c)
{
    const unsigned planes = 1U << SST_GPU_PLANE_LABELS | 1U << SST_GPU_PLANE_COLOURS;
    const unsigned own = work->shader == SST_GPU_VOTE ? planes : REFINE_DISPARITIES | 1U << SST_GPU_PLANE_COLOURS;
    int err;

    d->turn++;
    err = refine_device_view(d, c->lf, c->view, own, NULL);
    for (int i = 0; i < SST_GPU_VOTERS && !err; i++) {
        const int from = i < c->count ? c->sources[i].view : c->view;

        if (i < c->count) {
            err = refine_set_shift(&shift[i], &c->sources[i]);
            err = err ? err : refine_device_view(d, c->lf, from, planes, c->entropies ? &c->entropies[from] : NULL);
        }
        work->buffer[SST_GPU_VOTE_VOTERS + i] = d->view[from].buffer;
    }
    work->buffer[SST_GPU_VOTE_OWN] = d->view[c->view].buffer;
    work->buffer[SST_GPU_VOTE_OUT] = d->kept[REFINE_KEPT_OUT];
    return err;
}

static int vote_whole(struct sst_refine_device *d, struct sst_map_u8 *out, const struct sst_refine_carry *c)
{
    struct sst_gpu_vote push = { .width = out->width, .height = out->height, .count = c->count };
    const struct sst_gpu_label_keep elected = { .way = SST_GPU_KEEP_ELECTED };
    struct sst_gpu_work work = { .shader = SST_GPU_VOTE, .push = &push };
    int err = refine_device_keep(d, REFINE_KEPT_OUT, (size_t)out->width * (size_t)out->height * sizeof(uint32_t));

    for (int i = 0; i < SST_GPU_VOTERS; i++)
        push.rows[i] = out->height;
    err = err ? err : refine_device_voters(d, &work, push.shift, c);
    err = err ? err : refine_device_dispatch(d, &work, out->width, out->height);
    err = err ? err : refine_device_keep_labels(d, c->lf, c->view, elected, d->kept[REFINE_KEPT_OUT]);
    return err ? err : refine_device_labels(d, REFINE_KEPT_OUT, out);
}

static int vote(struct sst_refine_device *d, struct sst_map_u8 *out, const struct sst_refine_carry *c)
{
    int err = d->band_rows ? -ENOMEM : vote_whole(d, out, c);

    if (err != -ENOMEM)
        return err;
    err = refine_device_exchange(d, out, NULL, c, true);
    d->report.voted_in_parts += !err;
    return err;
}

bool sst_refine_device_vote(struct sst_refine_device *d, struct sst_map_u8 *out, const struct sst_lightfield *lf,
                            int view, const struct sst_refine_voter *voters, int count)
{
    const struct sst_refine_carry c = { .lf = lf, .view = view, .sources = voters, .count = count };
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err;

    if (refine_device_begin(d, &err))
        err = vote(d, out, &c);
    done = refine_device_end(d, err, "views vote");
    d->report.voted += done;
    d->report.voted_on_cpu += !done;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    return done;
}
