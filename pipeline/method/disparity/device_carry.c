/* Maps carried to other views on a device: what arrives at each pixel, gaps in it, where the sources agree. What
 * nothing arrives at is left to the CPU, which continues the background. */
#include <errno.h>
#include <stdlib.h>

#include "base/clock.h"
#include "pipeline/gpu/carry.h"
#include "pipeline/method/disparity/disparity_internal.h"

static size_t pixels_of(const struct sst_visible_view *v)
{
    return (size_t)v->disp->width * (size_t)v->disp->height;
}

/* A map whose check was the CPU's. */
static int upload_view(struct sst_disparity_device *d, const struct sst_visible_view *v,
                       const struct sst_map_u8 *status, int k)
{
    const size_t n = pixels_of(v);
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words)), *to = words;

    if (!words)
        return -ENOMEM;
    for (int y = 0; y < v->disp->height; y++) {
        const uint16_t *from = sst_map_u16_row(v->disp, y);
        const uint8_t *confidence = sst_map_u8_row(v->confidence, y), *checked = sst_map_u8_row(status, y);

        for (int x = 0; x < v->disp->width; x++)
            *to++ = from[x] | (uint32_t)(confidence[x] >> 1) << 16 |
                    (checked[x] == SST_DISPARITY_CORRECT ? SST_GPU_CARRY_CONFIRMED : 0);
    }
    d->report.uploads++;
    return disparity_device_upload_at(d, d->kept[KEPT_MAPS], (size_t)k * n * sizeof(*words), words, n * sizeof(*words));
}

static int load_view(struct sst_disparity_device *d, const struct sst_visible_views *in,
                     const struct sst_map_u8 *status, int k)
{
    const struct device_view v = disparity_device_view(in, k);
    const size_t n = (size_t)v.width * (size_t)v.height;
    const struct sst_gpu_convert push = { .width = v.width,
                                          .height = v.height,
                                          .conversion = SST_GPU_TO_SOURCES,
                                          .value = status != NULL,
                                          .from = (uint32_t)((size_t)k * n),
                                          .to = (uint32_t)((size_t)k * n) };
    int err = disparity_device_keep(d, KEPT_MAPS, (size_t)in->count * n, sizeof(uint32_t));
    struct sst_gpu_buffer *map;

    disparity_device_next_view(d);
    if (status && !d->checked)
        return err ? err : upload_view(d, &in->view[k], &status[k], k);
    err = err ? err : disparity_device_map(d, &v, &map);
    return err ? err
               : disparity_device_convert(d, push, NULL, map, status ? d->kept[KEPT_PIXELS] : map, d->kept[KEPT_MAPS]);
}

bool disparity_device_carry_load(struct sst_disparity_device *d, const struct sst_visible_views *in,
                                 const struct sst_map_u8 *status, const bool *wanted)
{
    int err = 0;

    if (!disparity_device_begin(d)) {
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_CARRY);
        return false;
    }
    disparity_device_drop(d);
    for (int k = 0; k < in->count && !err; k++) {
        if (wanted[k])
            err = load_view(d, in, status, k);
    }
    d->loaded = !err;
    if (err)
        disparity_device_leave(d, SST_DISPARITY_STAGE_CARRY, err);
    disparity_device_end(d);
    return !err;
}

static int dispatch(struct sst_disparity_device *d, const struct device_carry *in, enum sst_gpu_shader shader,
                    struct sst_gpu_buffer *a, struct sst_gpu_buffer *b, struct sst_gpu_buffer *c, uint32_t layers)
{
    const struct sst_map_u16 *map = in->in->view[in->view].disp;
    const struct sst_gpu_carry push = { map->width, map->height, in->agreed };
    const struct sst_gpu_work work = { .shader = shader,
                                       .push = &push,
                                       .buffer = { a, b, c },
                                       .groups = { (uint32_t)(map->width + 31) / 32, (uint32_t)(map->height + 7) / 8,
                                                   layers } };

    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* What the sources put into the view. */
static int project(struct sst_disparity_device *d, const struct device_carry *in)
{
    const struct sst_visible_view *own = &in->in->view[in->view];
    struct sst_gpu_check_other source[SST_MAX_NEIGHBOURS];
    int err = 0;

    for (int i = 0; i < in->sources && !err; i++) {
        const struct sst_visible_view *from = &in->in->view[in->source[i]];

        source[i].first = (uint32_t)((size_t)in->source[i] * pixels_of(own));
        err = disparity_device_shift(&source[i].shift, from->bx - own->bx, from->by - own->by, in->in->disp_min_px);
    }
    if (err || !in->sources)
        return err;
    err = disparity_device_upload(d, d->kept[KEPT_OTHERS], source, (size_t)in->sources * sizeof(*source));
    return err ? err
               : dispatch(d, in, SST_GPU_CARRY_PROJECT, d->kept[KEPT_OTHERS], d->kept[KEPT_MAPS],
                          d->kept[KEPT_PROJECTED], (uint32_t)in->sources);
}

/* The view's map from now on. */
static int store(struct sst_disparity_device *d, const struct device_carry *in)
{
    const struct sst_map_u16 *map = in->in->view[in->view].disp;
    const struct sst_gpu_convert push = { .width = map->width,
                                          .height = map->height,
                                          .conversion = SST_GPU_FROM_SOURCES };
    const int err = disparity_device_store(d, in->view, push, NULL, d->kept[KEPT_CHOSEN]);

    return err ? err : disparity_device_background(d, in->view, map->width, map->height);
}

static int carry(struct sst_disparity_device *d, const struct device_carry *in)
{
    const size_t n = pixels_of(&in->in->view[in->view]);
    int err = disparity_device_keep(d, KEPT_PROJECTED, 3 * n, sizeof(uint32_t));

    err = err ? err : disparity_device_keep(d, KEPT_OTHERS, SST_MAX_VIEWS, sizeof(struct sst_gpu_check_other));
    err = err ? err : disparity_device_keep(d, KEPT_CHOSEN, n, sizeof(uint32_t));
    err = err ? err : dispatch(d, in, SST_GPU_CARRY_START, d->kept[KEPT_PROJECTED], NULL, NULL, 1);
    err = err ? err : project(d, in);
    err = err ? err : dispatch(d, in, SST_GPU_CARRY_CLOSE, d->kept[KEPT_PROJECTED], d->kept[KEPT_CHOSEN], NULL, 1);
    if (in->stays)
        err = err ? err : store(d, in);
    return err ? err : disparity_device_fetch(d, d->kept[KEPT_CHOSEN], 0, n, in->out);
}

bool disparity_device_carry(struct sst_disparity_device *d, const struct device_carry *in)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err = 0;

    disparity_device_resume(d);
    if (d->loaded)
        err = carry(d, in);
    else
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_CARRY); /* others needed the memory */
    done = d->loaded && !err;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    if (err)
        disparity_device_leave(d, SST_DISPARITY_STAGE_CARRY, err);
    if (done)
        sst_gpu_shared_succeed(d->shared);
    d->loaded = done;
    disparity_device_end(d);
    return done;
}
