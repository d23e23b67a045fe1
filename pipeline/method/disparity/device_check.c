/* The multi-view check and the filling on a device: all views' maps lie there in one buffer, with the check's results,
 * which the filling reads. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/gpu/check.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define STEP_MOST  32000     /* a disparity of 16 bits times this fits 32 bits */
#define SHIFT_MOST (1 << 30) /* px */

static size_t pixels_of(const struct disparity_run *run)
{
    return (size_t)run->width * (size_t)run->height;
}

static int dispatch(struct sst_disparity_device *d, const struct disparity_run *run, enum sst_gpu_shader shader,
                    const void *push, struct sst_gpu_buffer *a, struct sst_gpu_buffer *b, struct sst_gpu_buffer *c)
{
    const struct sst_gpu_work work = { .shader = shader,
                                       .push = push,
                                       .buffer = { a, b, c },
                                       .groups = { (uint32_t)(run->width + 31) / 32, (uint32_t)(run->height + 7) / 8,
                                                   1 } };

    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

int disparity_device_shift(struct sst_gpu_shift *out, double bx, double by, double disp_min_px)
{
    const struct sst_shift across = sst_shift_by(bx, disp_min_px), down = sst_shift_by(by, disp_min_px);

    if (llabs(across.step) > STEP_MOST || llabs(down.step) > STEP_MOST || llabs(across.at >> 16) > SHIFT_MOST ||
        llabs(down.at >> 16) > SHIFT_MOST)
        return -EOVERFLOW;
    *out = (struct sst_gpu_shift){ (int32_t)(across.at >> 16), (int32_t)(across.at & 0xFFFF), (int32_t)across.step,
                                   (int32_t)(down.at >> 16),   (int32_t)(down.at & 0xFFFF),   (int32_t)down.step };
    return 0;
}

static uint32_t first_of(const struct disparity_run *run, const struct sst_checked_view *v)
{
    return (uint32_t)((size_t)(v->disp_q6 - run->disp) * pixels_of(run));
}

/* All maps that are checked. */
static int load_maps(struct sst_disparity_device *d, const struct disparity_run *run)
{
    const size_t n = pixels_of(run);
    const int views = run->lf->rows * run->lf->cols;
    int err = disparity_device_keep(d, KEPT_PIXELS, (size_t)views * n, sizeof(uint32_t));

    for (int k = 0; k < views && !err; k++) {
        const struct device_view v = { .view = k,
                                       .width = run->width,
                                       .height = run->height,
                                       .disp = &run->disp[k],
                                       .confidence = &run->confidence[k] };
        const struct sst_gpu_convert push = {
            .width = run->width, .height = run->height, .conversion = SST_GPU_TO_PLAIN, .to = (uint32_t)((size_t)k * n)
        };
        struct sst_gpu_buffer *map;

        if (!run->lf->views[k].present || run_is_carried(run, k))
            continue;
        disparity_device_next_view(d);
        err = disparity_device_map(d, &v, &map);
        err = err ? err : disparity_device_convert(d, push, NULL, map, NULL, d->kept[KEPT_PIXELS]);
    }
    return err;
}

static int check_view(struct sst_disparity_device *d, const struct disparity_run *run, int view)
{
    struct sst_checked_view views[SST_MAX_NEIGHBOURS];
    struct sst_gpu_check_other other[SST_MAX_NEIGHBOURS];
    int near;
    const int count = run->carried ? run_checked_keys(run, view, views) : run_checked_views(run, view, views, &near);
    const struct sst_gpu_check push = { .width = run->width,
                                        .height = run->height,
                                        .own = (uint32_t)((size_t)view * pixels_of(run)),
                                        .count = count,
                                        .steps = run->carried ? 0 : run->range + 1 };
    int err = disparity_device_keep(d, KEPT_VIEWS, SST_MAX_NEIGHBOURS, sizeof(*other));

    for (int i = 0; i < count && !err; i++) {
        other[i].first = first_of(run, &views[i]);
        err = disparity_device_shift(&other[i].shift, -views[i].bx, -views[i].by, run->disp_min);
    }
    if (!err && count)
        err = disparity_device_upload(d, d->kept[KEPT_VIEWS], other, (size_t)count * sizeof(*other));
    return err ? err : dispatch(d, run, SST_GPU_CHECK, &push, d->kept[KEPT_VIEWS], d->kept[KEPT_PIXELS], NULL);
}

int disparity_device_fetch(struct sst_disparity_device *d, struct sst_gpu_buffer *from, size_t first, size_t n,
                           uint32_t *words)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = sst_gpu_wait(d->gpu);
    const int64_t done_ns = sst_clock_now_ns();

    err = err ? err : sst_gpu_download(d->gpu, words, from, first * sizeof(*words), n * sizeof(*words));
    d->report.wait_ns += done_ns - start_ns;
    d->report.download_ns += sst_clock_now_ns() - done_ns;
    return err;
}

static int fetch_status(struct sst_disparity_device *d, struct disparity_run *run, int view)
{
    const size_t n = pixels_of(run), width = (size_t)run->width;
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words));
    int err = words ? disparity_device_fetch(d, d->kept[KEPT_PIXELS], (size_t)view * n, n, words) : -ENOMEM;

    for (int y = 0; y < run->height && !err; y++) {
        uint8_t *to = sst_map_u8_row(&run->status[view], y);

        for (size_t x = 0; x < width; x++)
            to[x] = (uint8_t)(words[(size_t)y * width + x] >> 16);
    }
    return err;
}

static int check_views(struct sst_disparity_device *d, struct disparity_run *run)
{
    const int views = run->lf->rows * run->lf->cols;
    int err;

    disparity_device_drop(d);
    err = load_maps(d, run);
    for (int k = 0; k < views && !err; k++) {
        if (run->lf->views[k].present && !run_is_carried(run, k))
            err = check_view(d, run, k);
    }
    for (int k = 0; k < views && !err; k++) {
        if (!run->lf->views[k].present)
            continue;
        sst_map_u8_fini(&run->status[k]);
        err = sst_map_u8_init(&run->status[k], run->width, run->height);
        if (!run_is_carried(run, k))
            err = err ? err : fetch_status(d, run, k);
    }
    return err;
}

void disparity_device_leave(struct sst_disparity_device *d, enum sst_disparity_stage stage, int err)
{
    const char *why = err == -EOVERFLOW ? "views are too far apart" : sst_gpu_error(err);

    sst_disparity_device_note_stage(d, stage);
    if (err != -ENOMEM && err != -EOVERFLOW) {
        disparity_device_fail(d, err);
        return;
    }
    sst_log_warning("%s: %s; %s is done on the CPU", d->report.name, why, sst_disparity_stage_name(stage));
    snprintf(d->report.why, sizeof(d->report.why), "%s", why);
}

bool disparity_device_check(struct sst_disparity_device *d, struct disparity_run *run)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err;

    if (!disparity_device_begin(d)) {
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_CHECK);
        return false;
    }
    d->checked = NULL;
    err = check_views(d, run);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    if (err) {
        disparity_device_leave(d, SST_DISPARITY_STAGE_CHECK, err);
    } else {
        sst_gpu_shared_succeed(d->shared);
        d->checked = run;
    }
    disparity_device_end(d);
    return !err;
}

/* What the occlusions get from a group of views. */
static int project(struct sst_disparity_device *d, const struct disparity_run *run, const struct sst_gpu_fill *fill,
                   const struct sst_checked_view *views, int count)
{
    int err = 0;

    for (int i = 0; i < count && !err; i++) {
        struct sst_gpu_project push = { run->width, run->height, first_of(run, &views[i]), { 0 } };

        err = disparity_device_shift(&push.shift, views[i].bx, views[i].by, run->disp_min);
        err = err ? err
                  : dispatch(d, run, SST_GPU_FILL_PROJECT, &push, d->kept[KEPT_PIXELS], d->kept[KEPT_FILTERED], NULL);
    }
    return err ? err
               : dispatch(d, run, SST_GPU_FILL_TAKE, fill, d->kept[KEPT_PIXELS], d->kept[KEPT_FILTERED],
                          d->kept[KEPT_MAP]);
}

static int fill_view(struct sst_disparity_device *d, struct disparity_run *run, int view)
{
    const size_t n = pixels_of(run), width = (size_t)run->width;
    const struct sst_gpu_fill push = { run->width, run->height, (uint32_t)((size_t)view * n) };
    const struct sst_gpu_background background = { run->width, run->height };
    const struct sst_gpu_convert stays = { .width = run->width,
                                           .height = run->height,
                                           .conversion = SST_GPU_FROM_PLAIN };
    struct sst_checked_view views[SST_MAX_NEIGHBOURS];
    struct sst_map_u16 *out = &run->filled[view];
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words));
    int near, count = run_checked_views(run, view, views, &near);
    int err = words ? disparity_device_keep(d, KEPT_MAP, n, sizeof(*words)) : -ENOMEM;

    err = err ? err : disparity_device_keep(d, KEPT_FILTERED, n, sizeof(*words));
    err = err ? err
              : dispatch(d, run, SST_GPU_FILL_START, &push, d->kept[KEPT_PIXELS], d->kept[KEPT_MAP],
                         d->kept[KEPT_FILTERED]);
    if (near)
        err = err ? err : project(d, run, &push, views, near);
    if (count > near)
        err = err ? err : project(d, run, &push, views + near, count - near);
    err =
        err ? err : dispatch(d, run, SST_GPU_FILL_ALONG, &background, d->kept[KEPT_MAP], d->kept[KEPT_FILTERED], NULL);
    err = err ? err : dispatch(d, run, SST_GPU_FILL_DOWN, &background, d->kept[KEPT_FILTERED], d->kept[KEPT_MAP], NULL);
    err = err ? err : disparity_device_store(d, view, stays, NULL, d->kept[KEPT_MAP]);
    err = err ? err : disparity_device_fetch(d, d->kept[KEPT_MAP], 0, n, words);
    sst_map_u16_fini(out);
    err = err ? err : sst_map_u16_init(out, run->width, run->height);
    for (int y = 0; y < run->height && !err; y++) {
        uint16_t *to = sst_map_u16_row(out, y);

        for (size_t x = 0; x < width; x++)
            to[x] = (uint16_t)words[(size_t)y * width + x];
    }
    return err;
}

bool disparity_device_fill(struct sst_disparity_device *d, struct disparity_run *run)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = 0;

    disparity_device_resume(d);
    if (d->checked != run) {
        disparity_device_end(d);
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_FILL);
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_BACKGROUND);
        return false;
    }
    d->checked = NULL;
    for (int k = 0; k < run->lf->rows * run->lf->cols && !err; k++) {
        disparity_device_next_view(d);
        if (run->lf->views[k].present)
            err = fill_view(d, run, k);
    }
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    if (err) {
        sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_BACKGROUND);
        disparity_device_leave(d, SST_DISPARITY_STAGE_FILL, err);
    }
    disparity_device_end(d);
    return !err;
}
