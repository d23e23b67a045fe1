/* The second pass on a device: points that views find, the hypotheses of each view (device_surfaces.c), their costs,
 * the optimisation and the choice. All views' pixels with their depths, and their maps, lie on the device for a round.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/gpu/hypotheses.h"
#include "pipeline/method/disparity/disparity_internal.h"

/* After an error: note why views are the CPU's. Without memory, and where numbers do not fit, the device is not to
 * blame.
 */
static void give_up(struct sst_disparity_device *d, int err)
{
    const char *why = err == -EOVERFLOW ? "views are too far apart" : sst_gpu_error(err);

    if (err != -ENOMEM && err != -EOVERFLOW) {
        disparity_device_fail(d, err);
        return;
    }
    if (!*d->report.why)
        sst_log_warning("%s: %s; hypotheses are tested on the CPU", d->report.name, why);
    snprintf(d->report.why, sizeof(d->report.why), "%s", why);
}

struct device_view disparity_device_view(const struct sst_visible_views *in, int k)
{
    const struct sst_visible_view *v = &in->view[k];

    return (struct device_view){ .view = k,
                                 .width = v->disp->width,
                                 .height = v->disp->height,
                                 .image = v->image,
                                 .seen = v->seen,
                                 .disp = v->disp,
                                 .confidence = v->confidence,
                                 .agreed = v->agreed };
}

static int load_view(struct sst_disparity_device *d, const struct sst_visible_views *in, int k)
{
    const struct device_view v = disparity_device_view(in, k);
    struct sst_gpu_convert push = { .width = v.width,
                                    .height = v.height,
                                    .conversion = SST_GPU_TO_HYPOTHESES,
                                    .value = (uint32_t)in->range * 64 + 1,
                                    .to = (uint32_t)((size_t)k * (size_t)v.width * (size_t)v.height) };
    struct sst_gpu_range colours, map;
    int err;

    disparity_device_next_view(d);
    err = disparity_device_colours(d, &v, &colours);
    err = err ? err : disparity_device_map(d, &v, &map);
    err = err ? err : disparity_device_convert(d, push, colours, map, NO_RANGE, W(d->kept[KEPT_PIXELS]));
    push.conversion = SST_GPU_TO_SURFACES;
    return err ? err : disparity_device_convert(d, push, colours, map, NO_RANGE, W(d->kept[KEPT_MAPS]));
}

bool disparity_device_load(struct sst_disparity_device *d, const struct sst_visible_views *in)
{
    size_t n = 0;
    int err;

    for (int k = 0; k < in->count; k++)
        n = in->view[k].image ? (size_t)in->view[k].disp->width * (size_t)in->view[k].disp->height : n;
    disparity_device_adopt(d, in);
    if (!disparity_device_begin(d))
        return false;
    disparity_device_drop(d);
    err = disparity_device_keep(d, KEPT_PIXELS, (size_t)in->count * n, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_MAPS, (size_t)in->count * n, sizeof(uint32_t));
    for (int k = 0; k < in->count && !err; k++)
        err = in->view[k].image ? load_view(d, in, k) : 0;
    if (err)
        give_up(d, err);
    else
        d->loaded = true;
    disparity_device_end(d);
    return !err;
}

bool disparity_device_load_points(struct sst_disparity_device *d, const struct sst_sweep *sweep, int sweeps)
{
    bool done;
    int err = 0;

    disparity_device_resume(d);
    if (d->loaded)
        err = disparity_device_upload_points(d, sweep, sweeps);
    done = d->loaded && !err;
    if (err)
        give_up(d, err);
    d->loaded = done;
    disparity_device_end(d);
    return done;
}

/* The views that hypotheses are tested against. */
static int upload_views(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const struct sst_hypothesis_test *t = in->test;
    const size_t n = (size_t)t->width * (size_t)t->height;
    struct sst_gpu_hypothesis_view view[SST_HYPOTHESIS_VIEWS];
    int err = disparity_device_keep(d, KEPT_VIEWS, SST_HYPOTHESIS_VIEWS, sizeof(*view));

    for (int k = 0; k < t->views; k++)
        view[k] = (struct sst_gpu_hypothesis_view){ t->x[k], t->y[k], t->dx[k], t->dy[k],
                                                    (uint32_t)((size_t)in->nearest[k] * n) };
    return err || !t->views ? err
                            : disparity_device_upload(d, d->kept[KEPT_VIEWS], view, (size_t)t->views * sizeof(*view));
}

/* Buffers, and what is uploaded for one view. */
static int prepare(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const size_t n = (size_t)in->test->width * (size_t)in->test->height, entries = n * SST_HYPOTHESES;
    uint32_t table[256];
    int err = disparity_device_keep(d, KEPT_TABLE, 256, sizeof(*table));

    err = err ? err : disparity_device_keep(d, KEPT_COSTS, entries, sizeof(uint16_t));
    err = err ? err : disparity_device_keep(d, KEPT_SUMS, entries, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_CHOSEN, n, sizeof(uint32_t));
    for (int i = 0; i < 256; i++)
        table[i] = in->penalty->p1[i] | (uint32_t)in->penalty->p2[i] << 16;
    err = err ? err : upload_views(d, in);
    return err ? err : disparity_device_upload(d, d->kept[KEPT_TABLE], table, sizeof(table));
}

static struct sst_gpu_hypothesis_cost cost_of(const struct device_hypotheses *in)
{
    const struct sst_hypothesis_test *t = in->test;
    const size_t n = (size_t)t->width * (size_t)t->height;

    return (struct sst_gpu_hypothesis_cost){ .width = t->width,
                                             .height = t->height,
                                             .views = t->views,
                                             .own = (uint32_t)((size_t)in->view * n),
                                             .tolerance = t->tolerance,
                                             .similar = t->similar,
                                             .most = in->most,
                                             .settled = t->settled,
                                             .change = in->change,
                                             .cheap = in->cheap };
}

bool disparity_device_sweep(struct sst_disparity_device *d, const struct device_hypotheses *in, struct sst_sweep *out)
{
    const struct sst_gpu_hypothesis_cost test = cost_of(in);
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err = 0;

    disparity_device_resume(d);
    if (d->loaded) {
        err = upload_views(d, in);
        err = err ? err : disparity_device_find_points(d, in, &test, out);
        d->report.total_ns += sst_clock_now_ns() - start_ns;
    }
    done = d->loaded && !err;
    if (err)
        give_up(d, err);
    d->loaded = done;
    disparity_device_end(d);
    return done;
}

static int test_costs(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const struct sst_hypothesis_test *t = in->test;
    const struct sst_gpu_hypothesis_cost push = cost_of(in);

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
    static const int ways[2][2] = { { 0, 1 }, { 1, 3 } }; /* the first one, how many */
    const struct sst_hypothesis_test *t = in->test;
    const size_t n = (size_t)t->width * (size_t)t->height;
    enum sst_gpu_shader shader;
    int err = sst_gpu_prepare_fastest(d->gpu, SST_GPU_HYPOTHESIS_PATH, &shader);

    for (int i = 0; i < 2 && !err; i++) {
        const struct sst_gpu_hypothesis_path push = { .width = t->width,
                                                      .height = t->height,
                                                      .own = (uint32_t)((size_t)in->view * n),
                                                      .near = in->penalty->near,
                                                      .way = ways[i][0],
                                                      .ways = ways[i][1],
                                                      .first = !i };
        const int paths = sst_max_int(t->width, t->height);

        d->report.dispatches++;
        err = sst_gpu_dispatch(
            d->gpu, &(struct sst_gpu_work){
                        .shader = shader,
                        .push = &push,
                        .buffer = { d->kept[KEPT_PIXELS], d->kept[KEPT_TABLE], d->kept[KEPT_LIST], d->kept[KEPT_COUNTS],
                                    d->kept[KEPT_COSTS], d->kept[KEPT_SUMS] },
                        .groups = { (uint32_t)push.ways,
                                    (uint32_t)(paths + SST_GPU_HYPOTHESIS_PATHS - 1) / SST_GPU_HYPOTHESIS_PATHS, 1 } });
    }
    return err;
}

static int choose(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    const size_t n = (size_t)in->test->width * (size_t)in->test->height;
    const size_t across = (size_t)SST_GPU_HYPOTHESIS_PIXELS * SST_GPU_HYPOTHESIS_ACROSS;
    const struct sst_gpu_hypothesis_choice push = { (uint32_t)n };
    const struct sst_gpu_convert stays = { .width = in->test->width,
                                           .height = in->test->height,
                                           .conversion = SST_GPU_FROM_CHOICE };
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
    err = err ? err : disparity_device_store(d, in->view, stays, NO_RANGE, d->kept[KEPT_CHOSEN]);
    err = err ? err : sst_gpu_wait(d->gpu);
    done_ns = sst_clock_now_ns();
    err = err ? err : sst_gpu_download(d->gpu, in->out, d->kept[KEPT_CHOSEN], 0, n * sizeof(*in->out));
    for (int y = in->first; in->list && y < in->test->height && !err; y += in->every) {
        const size_t row = (size_t)in->test->width * SST_HYPOTHESES, at = (size_t)y * row;

        err = sst_gpu_download(d->gpu, in->list + at, d->kept[KEPT_LIST], at * sizeof(*in->list),
                               row * sizeof(*in->list));
    }
    d->report.wait_ns += done_ns - start_ns;
    d->report.download_ns += sst_clock_now_ns() - done_ns;
    return err;
}

static int test(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    int err = prepare(d, in);

    err = err ? err : disparity_device_gather(d, in);
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
        sst_runner_succeed(d->shared);
        d->report.tested++;
    }
    disparity_device_end(d);
    return done;
}

void disparity_device_note_untested(struct sst_disparity_device *d)
{
    d->report.tested_on_cpu++;
    sst_disparity_device_note_stage(d, SST_DISPARITY_STAGE_SURFACES);
}
