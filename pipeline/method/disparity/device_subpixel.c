/* The refinement between pixels on a device: all views' lumas with their disparities lie there in one buffer; each
 * view's steps run without leaving it. Gains between views are the CPU's, which measures them at a few pixels. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/gpu/subpixel.h"
#include "pipeline/method/disparity/disparity_internal.h"

/* Memory of the second pass, which is over. */
#define KEPT_DISP    KEPT_CHOSEN /* of this step and of the next one, in turn */
#define KEPT_NEXT    KEPT_SUMS
#define KEPT_FITS    KEPT_COSTS
#define KEPT_WINDOWS KEPT_LIST

static size_t pixels_of(const struct device_refine *in)
{
    return (size_t)in->fit->width * (size_t)in->fit->height;
}

static int dispatch(struct sst_disparity_device *d, const struct device_refine *in, enum sst_gpu_shader shader,
                    const void *push, const struct sst_gpu_range *range, size_t count)
{
    struct sst_gpu_work work = { .shader = shader,
                                 .push = push,
                                 .groups = { (uint32_t)(in->fit->width + 31) / 32, (uint32_t)(in->fit->height + 7) / 8,
                                             1 } };

    for (size_t i = 0; i < count; i++) {
        work.buffer[i] = range[i].buffer;
        work.offset[i] = range[i].offset;
    }
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* Colours and disparities of the view, and the views that it is compared with. @param colours  out */
static int load_view(struct sst_disparity_device *d, const struct device_refine *in, struct sst_gpu_range *colours)
{
    const struct sst_subpixel_fit *f = in->fit;
    const size_t n = pixels_of(in);
    const struct device_view own = disparity_device_view(in->in, in->view);
    const struct sst_gpu_convert push = { .width = f->width, .height = f->height, .conversion = SST_GPU_TO_STEPS };
    struct sst_gpu_subpixel_view view[SST_SUBPIXEL_VIEWS];
    struct sst_gpu_range map;
    int err = disparity_device_colours(d, &own, colours);

    err = err ? err : disparity_device_map(d, &own, &map);
    err = err ? err : disparity_device_convert(d, push, NO_RANGE, map, NO_RANGE, W(d->kept[KEPT_DISP]));
    for (int k = 0; k < f->views; k++) {
        const struct sst_subpixel_view *v = &f->view[k];

        view[k] = (struct sst_gpu_subpixel_view){ v->x,    v->y,      v->dx,
                                                  v->dy,   v->bx,     v->by,
                                                  v->gain, v->offset, (uint32_t)((size_t)in->nearest[k] * n) };
    }
    return err || !f->views ? err
                            : disparity_device_upload(d, d->kept[KEPT_VIEWS], view, (size_t)f->views * sizeof(*view));
}

static int prepare(struct sst_disparity_device *d, const struct device_refine *in, struct sst_gpu_range *colours)
{
    const size_t n = pixels_of(in), weight = sizeof(struct sst_gpu_subpixel_weight);
    int err = disparity_device_keep(d, KEPT_VIEWS, SST_SUBPIXEL_VIEWS, sizeof(struct sst_gpu_subpixel_view));

    err = err ? err : disparity_device_keep(d, KEPT_DISP, n, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_NEXT, n, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_FITS, n, weight);
    err = err ? err : disparity_device_keep(d, KEPT_WINDOWS, n, weight);
    return err ? err : load_view(d, in, colours);
}

/* A step from one buffer of disparities to another. */
static int refine(struct sst_disparity_device *d, const struct device_refine *in, int views,
                  struct sst_gpu_range colours, struct sst_gpu_buffer *from, struct sst_gpu_buffer *to)
{
    const struct sst_subpixel_fit *f = in->fit;
    const struct sst_gpu_subpixel_fit push = { f->width,     f->height,
                                               views,        (uint32_t)((size_t)in->view * pixels_of(in)),
                                               f->tolerance, f->inverse_limit };
    struct sst_gpu_buffer **kept = d->kept;
    const int err = dispatch(
        d, in, SST_GPU_SUBPIXEL_FIT, &push,
        (const struct sst_gpu_range[]){ W(kept[KEPT_VIEWS]), W(kept[KEPT_PIXELS]), W(from), W(kept[KEPT_FITS]) },
        SST_GPU_SUBPIXEL_FIT_BUFFERS);

    return err ? err
               : dispatch(d, in, SST_GPU_SUBPIXEL_WINDOW, in->window,
                          (const struct sst_gpu_range[]){ colours, W(from), W(kept[KEPT_FITS]), W(kept[KEPT_WINDOWS]),
                                                          W(to) },
                          SST_GPU_SUBPIXEL_WINDOW_BUFFERS);
}

static int refine_view(struct sst_disparity_device *d, const struct device_refine *in)
{
    const size_t n = pixels_of(in), width = (size_t)in->fit->width;
    const struct sst_gpu_convert stays = { .width = in->fit->width,
                                           .height = in->fit->height,
                                           .conversion = SST_GPU_FROM_PLAIN };
    struct sst_gpu_range colours = { 0 };
    struct sst_gpu_buffer *from, *to, *swap;
    uint32_t *words;
    int err = prepare(d, in, &colours);

    from = d->kept[KEPT_DISP];
    to = d->kept[KEPT_NEXT];
    for (int i = 0; i < in->steps && !err; i++) {
        err = refine(d, in, i ? in->fit->views : sst_min_int(in->fit->views, in->first_views), colours, from, to);
        swap = from;
        from = to;
        to = swap;
    }
    /* The large windows write no weights. */
    err = err ? err
              : dispatch(d, in, SST_GPU_SUBPIXEL_WINDOW, in->wide,
                         (const struct sst_gpu_range[]){ colours, W(from), W(d->kept[KEPT_WINDOWS]),
                                                         W(d->kept[KEPT_FITS]), W(to) },
                         SST_GPU_SUBPIXEL_WINDOW_BUFFERS);
    err = err ? err : disparity_device_store(d, in->view, stays, NO_RANGE, to);
    words = sst_mem_keep(&d->words, n, sizeof(*words));
    err = err ? err : words ? disparity_device_fetch(d, to, 0, n, words) : -ENOMEM;
    for (int y = 0; y < in->fit->height && !err; y++) {
        uint16_t *out = sst_map_u16_row(in->out, y);

        for (size_t x = 0; x < width; x++)
            out[x] = (uint16_t)words[(size_t)y * width + x];
    }
    return err;
}

/* Lumas of a view. */
static int load_luma(struct sst_disparity_device *d, const struct sst_visible_views *in, int k)
{
    const struct device_view v = disparity_device_view(in, k);
    const struct sst_gpu_convert push = { .width = v.width,
                                          .height = v.height,
                                          .conversion = SST_GPU_TO_LUMA,
                                          .to = (uint32_t)((size_t)k * (size_t)v.width * (size_t)v.height) };
    struct sst_gpu_range colours, map;
    int err;

    disparity_device_next_view(d);
    err = disparity_device_colours(d, &v, &colours);
    err = err ? err : disparity_device_map(d, &v, &map);
    return err ? err : disparity_device_convert(d, push, colours, map, NO_RANGE, W(d->kept[KEPT_PIXELS]));
}

bool disparity_device_begin_refining(struct sst_disparity_device *d, const struct sst_visible_views *in)
{
    size_t n = 0;
    int err;

    for (int k = 0; k < in->count; k++)
        n = in->view[k].image ? (size_t)in->view[k].disp->width * (size_t)in->view[k].disp->height : n;
    disparity_device_adopt(d, in);
    if (!disparity_device_begin(d)) {
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_SUBPIXEL);
        return false;
    }
    disparity_device_drop(d);
    err = disparity_device_keep(d, KEPT_PIXELS, (size_t)in->count * n, sizeof(uint32_t));
    for (int k = 0; k < in->count && !err; k++)
        err = in->view[k].image ? load_luma(d, in, k) : 0;
    d->loaded = !err;
    if (err)
        disparity_device_leave(d, SST_DISPARITY_STAGE_SUBPIXEL, err);
    disparity_device_end(d);
    return !err;
}

bool disparity_device_refine(struct sst_disparity_device *d, const struct device_refine *in)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err = 0;

    disparity_device_resume(d);
    if (d->loaded)
        err = refine_view(d, in);
    else
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_SUBPIXEL); /* others needed the memory */
    done = d->loaded && !err;
    if (err)
        disparity_device_leave(d, SST_DISPARITY_STAGE_SUBPIXEL, err);
    if (done)
        sst_runner_succeed(d->shared);
    d->loaded = done;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    disparity_device_end(d);
    return done;
}
