/* The second pass on a device: costs of hypotheses, their optimisation and the choice. The CPU gathers the surfaces
 * that are the hypotheses; all views' pixels with their depths lie on the device for a round. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/gpu/hypotheses.h"
#include "pipeline/method/disparity/disparity_internal.h"

/* After an error: note why views are the CPU's. Without memory the device is not to blame. */
static void give_up(struct sst_disparity_device *d, int err)
{
    if (err != -ENOMEM) {
        disparity_device_fail(d, err);
        return;
    }
    if (!*d->report.why)
        sst_log_warning("%s: %s; hypotheses are tested on the CPU", d->report.name, sst_gpu_error(err));
    snprintf(d->report.why, sizeof(d->report.why), "%s", sst_gpu_error(err));
}

int disparity_device_upload_packed(struct sst_disparity_device *d, const struct sst_packed_view *view, int count,
                                   int width, int height)
{
    const size_t n = (size_t)width * (size_t)height;
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words));
    int err;

    disparity_device_drop(d);
    err = words ? disparity_device_keep(d, KEPT_PIXELS, (size_t)count * n, sizeof(*words)) : -ENOMEM;
    for (int k = 0; k < count && !err; k++) {
        const int64_t start_ns = sst_clock_now_ns();

        for (int y = 0; view[k].pixels && y < height; y++)
            memcpy(words + (size_t)y * (size_t)width, view[k].pixels + y * view[k].stride,
                   (size_t)width * sizeof(*words));
        if (view[k].pixels)
            err =
                sst_gpu_upload(d->gpu, d->kept[KEPT_PIXELS], (size_t)k * n * sizeof(*words), words, n * sizeof(*words));
        d->report.uploads += view[k].pixels != NULL;
        d->report.upload_bytes += view[k].pixels ? (int64_t)(n * sizeof(*words)) : 0;
        d->report.upload_ns += sst_clock_now_ns() - start_ns;
    }
    return err;
}

bool disparity_device_load(struct sst_disparity_device *d, const struct sst_packed_view *view, int count, int width,
                           int height)
{
    int err;

    if (!disparity_device_begin(d))
        return false;
    err = disparity_device_upload_packed(d, view, count, width, height);
    if (err)
        give_up(d, err);
    else
        d->loaded = true;
    disparity_device_end(d);
    return !err;
}

/* Buffers, and what is uploaded for one view. */
static int prepare(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const struct sst_hypothesis_test *t = in->test;
    const size_t n = (size_t)t->width * (size_t)t->height, entries = n * SST_HYPOTHESES;
    struct sst_gpu_hypothesis_view view[SST_HYPOTHESIS_VIEWS];
    uint32_t table[256], *words = sst_mem_keep(&d->words, n, sizeof(*words));
    int err = words ? disparity_device_keep(d, KEPT_VIEWS, SST_HYPOTHESIS_VIEWS, sizeof(*view)) : -ENOMEM;

    err = err ? err : disparity_device_keep(d, KEPT_TABLE, 256, sizeof(*table));
    err = err ? err : disparity_device_keep(d, KEPT_LIST, entries, sizeof(uint16_t));
    err = err ? err : disparity_device_keep(d, KEPT_COUNTS, n, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_COSTS, entries, sizeof(uint16_t));
    err = err ? err : disparity_device_keep(d, KEPT_SUMS, entries, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_CHOSEN, n, sizeof(uint32_t));
    if (err)
        return err;
    for (int k = 0; k < t->views; k++)
        view[k] = (struct sst_gpu_hypothesis_view){ t->x[k], t->y[k], t->dx[k], t->dy[k],
                                                    (uint32_t)((size_t)in->nearest[k] * n) };
    for (int i = 0; i < 256; i++)
        table[i] = in->penalty->p1[i] | (uint32_t)in->penalty->p2[i] << 16;
    for (size_t i = 0; i < n; i++)
        words[i] = in->count[i];
    if (t->views)
        err = disparity_device_upload(d, d->kept[KEPT_VIEWS], view, (size_t)t->views * sizeof(*view));
    err = err ? err : disparity_device_upload(d, d->kept[KEPT_TABLE], table, sizeof(table));
    err = err ? err : disparity_device_upload(d, d->kept[KEPT_LIST], in->list, entries * sizeof(*in->list));
    return err ? err : disparity_device_upload(d, d->kept[KEPT_COUNTS], words, n * sizeof(*words));
}

static int test_costs(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const struct sst_hypothesis_test *t = in->test;
    const size_t n = (size_t)t->width * (size_t)t->height;
    const struct sst_gpu_hypothesis_cost push = { .width = t->width,
                                                  .height = t->height,
                                                  .views = t->views,
                                                  .own = (uint32_t)((size_t)in->view * n),
                                                  .tolerance = t->tolerance,
                                                  .similar = t->similar,
                                                  .most = in->most,
                                                  .settled = t->settled,
                                                  .change = in->change,
                                                  .cheap = in->cheap };

    d->report.dispatches++;
    return sst_gpu_dispatch(
        d->gpu,
        &(struct sst_gpu_work){ .shader = SST_GPU_HYPOTHESIS_COST,
                                .push = &push,
                                .buffer = { d->kept[KEPT_VIEWS], d->kept[KEPT_PIXELS], d->kept[KEPT_LIST],
                                            d->kept[KEPT_COUNTS], d->kept[KEPT_COSTS] },
                                .groups = { (uint32_t)(t->width + 31) / 32, (uint32_t)(t->height + 7) / 8, 1 } });
}

static int optimise(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    static const int ways[4][2] = { { 1, 0 }, { -1, 0 }, { 0, 1 }, { 0, -1 } };
    const struct sst_hypothesis_test *t = in->test;
    const size_t n = (size_t)t->width * (size_t)t->height;
    int err = 0;

    for (int i = 0; i < 4 && !err; i++) {
        const struct sst_gpu_hypothesis_path push = { .width = t->width,
                                                      .height = t->height,
                                                      .own = (uint32_t)((size_t)in->view * n),
                                                      .near = in->penalty->near,
                                                      .dx = ways[i][0],
                                                      .dy = ways[i][1],
                                                      .first = !i };
        const int paths = ways[i][1] ? t->width : t->height;

        d->report.dispatches++;
        err = sst_gpu_dispatch(
            d->gpu,
            &(struct sst_gpu_work){
                .shader = SST_GPU_HYPOTHESIS_PATH,
                .push = &push,
                .buffer = { d->kept[KEPT_PIXELS], d->kept[KEPT_TABLE], d->kept[KEPT_LIST], d->kept[KEPT_COUNTS],
                            d->kept[KEPT_COSTS], d->kept[KEPT_SUMS] },
                .groups = { 1, (uint32_t)(paths + SST_GPU_HYPOTHESIS_PATHS - 1) / SST_GPU_HYPOTHESIS_PATHS, 1 } });
    }
    return err;
}

static int choose(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const size_t n = (size_t)in->test->width * (size_t)in->test->height;
    const size_t across = (size_t)SST_GPU_HYPOTHESIS_PIXELS * SST_GPU_HYPOTHESIS_ACROSS;
    const struct sst_gpu_hypothesis_choice push = { (uint32_t)n };
    const int64_t start_ns = sst_clock_now_ns();
    int64_t done_ns;
    int err;

    d->report.dispatches++;
    err = sst_gpu_dispatch(
        d->gpu, &(struct sst_gpu_work){
                    .shader = SST_GPU_HYPOTHESIS_CHOICE,
                    .push = &push,
                    .buffer = { d->kept[KEPT_LIST], d->kept[KEPT_COUNTS], d->kept[KEPT_SUMS], d->kept[KEPT_CHOSEN] },
                    .groups = { SST_GPU_HYPOTHESIS_ACROSS, (uint32_t)((n + across - 1) / across), 1 } });
    err = err ? err : sst_gpu_wait(d->gpu);
    done_ns = sst_clock_now_ns();
    err = err ? err : sst_gpu_download(d->gpu, in->out, d->kept[KEPT_CHOSEN], 0, n * sizeof(*in->out));
    d->report.wait_ns += done_ns - start_ns;
    d->report.download_ns += sst_clock_now_ns() - done_ns;
    return err;
}

static int test(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    int err = prepare(d, in);

    err = err ? err : test_costs(d, in);
    err = err ? err : optimise(d, in);
    return err ? err : choose(d, in);
}

bool disparity_device_test(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool done = false;
    int err = 0;

    disparity_device_resume(d);
    if (d->loaded) {
        err = test(d, in);
        d->report.total_ns += sst_clock_now_ns() - start_ns;
        done = !err;
    }
    if (err)
        give_up(d, err);
    d->loaded = done;
    if (done) {
        sst_gpu_shared_succeed(d->shared);
        d->report.tested++;
    }
    disparity_device_end(d);
    return done;
}

void disparity_device_note_untested(struct sst_disparity_device *d)
{
    d->report.tested_on_cpu++;
}
