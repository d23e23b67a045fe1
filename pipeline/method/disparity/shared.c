/* Steps of a run after its passes: check, filling, background. */
#include <math.h>
#include <string.h>

#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

static struct sst_run_options options_of(const struct disparity_run *run, int threads)
{
    return (struct sst_run_options){ run->cfg->share, threads,
                                     sst_share_block((size_t)run->width * (size_t)run->height), run->cfg->cancel };
}

int run_step(struct disparity_run *run, const struct sst_step *step, int threads)
{
    const struct sst_run_options how = options_of(run, threads);

    return sst_run(disparity_device_user(run->cfg->device), step, run, run->lf->rows * run->lf->cols, &how);
}

void run_free_sample(void *job)
{
    disparity_sample_free(job);
}

bool run_is_present(const void *job, int view)
{
    const struct disparity_run *run = job;

    return run->lf->views[view].present;
}

void run_source(const void *job, int view, struct sst_plane_source *out)
{
    const struct disparity_run *run = job;

    /* A filled map keeps the pixels that others are filled from. */
    *out = (struct sst_plane_source){ .disp = run->filled[view].data ? &run->filled[view] : &run->disp[view],
                                      .confidence = &run->confidence[view],
                                      .checked = &run->status[view] };
}

/* Views that a view is checked against or filled from, on a device. */
struct neighbours {
    int count, near;
    struct sst_gpu_range maps;                            /* with the view's own */
    uint32_t first;                                       /* where that begins */
    struct sst_gpu_check_other other[SST_MAX_NEIGHBOURS]; /* where the others begin, and how far pixels move */
};

/* @param sign  1: disparities move pixels from the view to the others; -1: from them to it */
static void load_maps(struct neighbours *to, struct sst_run *r, const struct disparity_run *run, int view, int sign)
{
    int index[SST_MAX_NEIGHBOURS + 1] = { view };
    struct sst_checked_views from;

    run_checked_views(run, view, &from);
    for (int i = 0; i < from.count; i++)
        index[i + 1] = (int)(from.view[i].disp_q6 - run->disp);
    *to = (struct neighbours){ .count = from.count, .near = from.near };
    to->maps = sst_run_planes(r, SST_PLANE_MAP, index, from.count + 1);
    to->first = sst_run_first(r, SST_PLANE_MAP, view);
    for (int i = 0; i < from.count; i++) {
        to->other[i].first = sst_run_first(r, SST_PLANE_MAP, index[i + 1]);
        sst_run_fail(r, sst_step_shift(&to->other[i].shift, sst_shift_by(sign * from.view[i].bx, run->disp_min),
                                       sst_shift_by(sign * from.view[i].by, run->disp_min)));
    }
}

/* --- check -------------------------------------------------------------------------------------------------------- */

static void checked_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    if (!run_is_carried(run, view)) /* the others' are not checked */
        sst_share_add_u8(out, &run->status[view]);
}

static void check_on_device(struct sst_run *r, void *job, int view)
{
    struct disparity_run *run = job;
    struct sst_gpu_check push = { .width = run->width,
                                  .height = run->height,
                                  .steps = run->carried ? 0 : run->range + 1 };
    struct neighbours from;
    const uint32_t *words;

    sst_map_u8_fini(&run->status[view]);
    sst_run_fail(r, sst_map_u8_init(&run->status[view], run->width, run->height));
    if (run_is_carried(run, view))
        return;
    load_maps(&from, r, run, view, -1);
    push.own = from.first;
    push.count = from.count;
    SST_RUN_PIXELS(r, SST_GPU_CHECK, &push, run->width, run->height, 1,
                   sst_run_upload(r, 0, from.other, (size_t)sst_max_int(from.count, 1) * sizeof(*from.other)),
                   from.maps);
    words = sst_run_fetch(r, sst_run_plane(r, SST_PLANE_MAP, view), (size_t)run->width * (size_t)run->height);
    if (words)
        sst_step_map_unpack(words, NULL, NULL, NULL, &run->status[view]);
}

static void *check_sample(uint32_t seed)
{
    return disparity_sample(seed, false, seed % 2);
}

const struct sst_step disparity_check_step = { .name = "check",
                                               .stages = 1U << SST_DISPARITY_STAGE_CHECK,
                                               RUN_STEP,
                                               .cpu = run_check,
                                               .device = check_on_device,
                                               .writes = checked_maps,
                                               .sample = check_sample };

/* --- filling ------------------------------------------------------------------------------------------------------ */

void run_dispatch_background(struct sst_run *r, struct sst_gpu_range map, struct sst_gpu_range scratch, int view,
                             const struct sst_gpu_background *push)
{
    SST_RUN_PIXELS(r, SST_GPU_FILL_ALONG, push, push->width, push->height, 1, map, scratch);
    SST_RUN_PIXELS(r, SST_GPU_FILL_DOWN, push, push->width, push->height, 1, scratch,
                   sst_run_output(r, SST_PLANE_MAP, view));
}

static void filled_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    sst_share_add_u16(out, &run->filled[view]);
}

static void fill_on_device(struct sst_run *r, void *job, int view)
{
    enum { FILLED, ARRIVED };
    struct disparity_run *run = job;
    const int width = run->width, height = run->height;
    const size_t n = (size_t)width * (size_t)height;
    const struct sst_gpu_background background = { width, height, SST_DISP_NONE };
    struct sst_gpu_fill push = { width, height, 0 };
    struct sst_gpu_range filled, arrived;
    struct neighbours from;
    const uint32_t *words;

    load_maps(&from, r, run, view, 1);
    push.own = from.first;
    filled = sst_run_scratch(r, FILLED, n * sizeof(uint32_t));
    arrived = sst_run_scratch(r, ARRIVED, n * sizeof(uint32_t));
    SST_RUN_PIXELS(r, SST_GPU_FILL_START, &push, width, height, 1, from.maps, filled, arrived);
    for (int i = 0; i < from.count; i++) {
        const struct sst_gpu_project other = { width, height, from.other[i].first, from.other[i].shift };

        SST_RUN_PIXELS(r, SST_GPU_FILL_PROJECT, &other, width, height, 1, from.maps, arrived);
        if (i + 1 == from.near || i + 1 == from.count)
            SST_RUN_PIXELS(r, SST_GPU_FILL_TAKE, &push, width, height, 1, from.maps, arrived, filled);
    }
    run_dispatch_background(r, filled, arrived, view, &background);
    words = sst_run_fetch(r, sst_run_plane(r, SST_PLANE_MAP, view), n);
    sst_map_u16_fini(&run->filled[view]);
    sst_run_fail(r, sst_map_u16_init(&run->filled[view], width, height));
    if (words && !sst_run_failed(r))
        sst_step_map_unpack(words, &run->filled[view], NULL, NULL, NULL);
}

static void *fill_sample(uint32_t seed)
{
    return disparity_sample(seed, true, false);
}

const struct sst_step disparity_fill_step = { .name = "filling",
                                              .stages =
                                                  1U << SST_DISPARITY_STAGE_FILL | 1U << SST_DISPARITY_STAGE_BACKGROUND,
                                              RUN_STEP,
                                              .cpu = run_fill,
                                              .device = fill_on_device,
                                              .writes = filled_maps,
                                              .sample = fill_sample };

static int fill_rest(void *arg, int view, int worker SST_UNUSED)
{
    const struct disparity_run *run = arg;
    struct sst_map_u16 *disp = &run->disp[view];

    sst_fill_background(disp);
    if (*sst_map_u16_row(disp, 0) == SST_DISP_NONE) /* nothing arrived: far away */
        memset(disp->data, 0, disp->stride * (size_t)run->height);
    return 0;
}

static void fill_rest_on_device(struct sst_run *r, void *job, int view)
{
    struct disparity_run *run = job;
    const size_t n = (size_t)run->width * (size_t)run->height;
    const struct sst_gpu_background push = { run->width, run->height, 0 };
    const struct sst_gpu_range map = sst_run_plane(r, SST_PLANE_MAP, view);
    const uint32_t *words;

    run_dispatch_background(r, map, sst_run_scratch(r, 0, n * sizeof(uint32_t)), view, &push);
    words = sst_run_fetch(r, map, n);
    if (words)
        sst_step_map_unpack(words, &run->disp[view], NULL, NULL, NULL);
}

static void rest_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    sst_share_add_u16(out, &run->disp[view]);
}

const struct sst_step disparity_background_step = { .name = "background",
                                                    .stages = 1U << SST_DISPARITY_STAGE_BACKGROUND,
                                                    RUN_STEP,
                                                    .cpu = fill_rest,
                                                    .device = fill_rest_on_device,
                                                    .writes = rest_maps,
                                                    .sample = check_sample };

int run_fill_background(struct disparity_run *run, int threads)
{
    struct sst_run_options how = options_of(run, threads);

    how.share = NULL; /* less work than to exchange it */
    return sst_run(run->cfg->share ? NULL : disparity_device_user(run->cfg->device), &disparity_background_step, run,
                   run->lf->rows * run->lf->cols, &how);
}
