/* Features of a run's views, which stay on the device if the network runs there: its result, gathered as the matching
 * reads it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/method/disparity/device_internal.h"

#define PLENTY 4 /* times the features of a view that are left to other memory */

/* Rows of a view. */
struct gathered {
    struct sst_descriptor *desc;
    int view, width;
    struct sst_disparity_feature_band band;
    /* The network's result from row band.start on: on the device; or on the host, of a sample. */
    struct sst_gpu_range result;
    size_t at; /* words */
    int8_t *bytes;
};

static bool is_gathered(const void *job, int view)
{
    return view == ((const struct gathered *)job)->view;
}

static int gather_job(void *job, int view SST_UNUSED, int worker SST_UNUSED)
{
    struct gathered *b = job;

    sst_descriptor_gather(b->desc, b->bytes, &b->band);
    return 0;
}

void dispatch_features(struct sst_run *r, void *job, int view)
{
    const struct gathered *b = job;
    const int words = b->width * SST_PLANE_FEATURE_WORDS, first = b->band.first, rows = b->band.end - first;
    const struct sst_gpu_convert push = { .width = words,
                                          .height = rows,
                                          .full_width = b->width,
                                          .conversion = SST_GPU_TO_FEATURES,
                                          .from = (uint32_t)(b->at + (size_t)(first - b->band.start) * (size_t)words),
                                          .to = (uint32_t)((size_t)first * (size_t)words) };
    const struct sst_gpu_range to = sst_run_output(r, SST_PLANE_FEATURES, view);
    const size_t bytes = (size_t)(b->band.end - b->band.start) * (size_t)words * sizeof(uint32_t);
    const struct sst_gpu_range from = b->bytes ? sst_run_upload(r, 0, b->bytes, bytes) : b->result;
    const uint32_t *result;

    SST_RUN_PIXELS(r, SST_GPU_CONVERT, &push, words, rows, 1, from, from, from, to);
    if (!b->bytes)
        return;
    result = sst_run_fetch(r, to, (size_t)b->band.end * (size_t)words);
    for (int y = first * SST_PLANE_FEATURE_WORDS; result && y < b->band.end * SST_PLANE_FEATURE_WORDS; y++)
        memcpy(b->desc->features + (size_t)y * b->desc->feature_stride, result + (size_t)y * (size_t)b->width,
               (size_t)b->width * sizeof(*result));
}

static void gathered_bytes(void *job, int view SST_UNUSED, struct sst_share_maps *out)
{
    const struct sst_descriptor *desc = ((struct gathered *)job)->desc;

    sst_share_add_values(out, desc->features, desc->feature_stride * SST_PLANE_FEATURE_WORDS * (size_t)desc->height);
}

static void gather_sample_free(void *job)
{
    struct gathered *b = job;

    if (b && b->desc)
        sst_descriptor_fini(b->desc);
    if (b) {
        free(b->desc);
        free(b->bytes);
    }
    free(b);
}

static void *gather_sample(uint32_t seed)
{
    struct gathered *b = calloc(1, sizeof(*b));
    uint32_t state = seed;

    if (!b)
        return NULL;
    *b = (struct gathered){ .desc = calloc(1, sizeof(*b->desc)), .width = 37, .band = { 1, (int)seed + 1, 13 } };
    b->bytes = malloc((size_t)(b->band.end - b->band.start) * (size_t)b->width * SST_FEATURE_CHANNELS);
    if (b->desc)
        *b->desc = (struct sst_descriptor){ .width = b->width, .height = b->band.end + 2 };
    if (!b->desc || !b->bytes || sst_descriptor_need_features(b->desc)) {
        gather_sample_free(b);
        return NULL;
    }
    for (int i = 0; i < (b->band.end - b->band.start) * b->width * SST_FEATURE_CHANNELS; i++) {
        b->bytes[i] = (int8_t)((int)(sst_step_random(&state) >> 16) - 128);
    }
    return b;
}

const struct sst_step disparity_features_step = { .name = "features",
                                                  .wants = is_gathered,
                                                  .cpu = gather_job,
                                                  .writes = gathered_bytes,
                                                  .changes = 1U << SST_PLANE_FEATURES,
                                                  .sample = gather_sample,
                                                  .sample_free = gather_sample_free };

/* Places for the features of all views, if there is room for them beside a volume. */
static bool make_places(const struct disparity_run *run, struct sst_gpu *g, struct sst_step_planes *p)
{
    const size_t pixels = (size_t)run->width * (size_t)run->height;
    const size_t bytes = SST_FEATURE_CHANNELS * pixels;

    if (!p->plane[SST_PLANE_FEATURES].buffer &&
        (sst_gpu_free_bytes(g) < (size_t)(p->views + PLENTY) * bytes + 4 * pixels * (size_t)(run->shape.steps + 64) ||
         sst_step_plane_create(p, g, SST_PLANE_FEATURES, p->views)))
        return false;
    return p->plane[SST_PLANE_FEATURES].places >= p->views;
}

/* As struct sst_feature_keeper has it. */
static bool keep(void *keeper, const struct sst_run_result *result)
{
    struct sst_feature_keeper *k = keeper;
    struct disparity_run *run = k->arg;
    struct sst_runner_user *user = run->cfg->runner;
    struct sst_step_planes *p = sst_runner_planes(user->runner);
    struct gathered b = {
        .view = k->view, .width = k->width, .band = k->band, .result = { result->buffer, 0 }, .at = result->at
    };

    if (result->gpu != sst_runner_device(user->runner) || p->of != run->lf || !make_places(run, result->gpu, p))
        return false;
    k->kept = !sst_run_item(user, &disparity_features_step, &b, k->view);
    sst_step_plane_mark(p, SST_PLANE_FEATURES, k->view, k->kept && k->band.end == k->height);
    return k->kept;
}

static bool has_features(const struct disparity_run *run, int view)
{
    struct sst_runner_user *user = run->cfg->runner;
    const struct sst_step_planes *p;
    bool has;

    sst_runner_lock(user->runner);
    p = sst_runner_planes(user->runner);
    has = p->of == run->lf && p->plane[SST_PLANE_FEATURES].view[view].current;
    sst_runner_unlock(user->runner);
    return has;
}

int run_add_features(struct disparity_run *run, int view, struct sst_network *net)
{
    struct sst_descriptor *desc = &run->desc[view];
    struct sst_feature_keeper keeper = { .keep = keep, .arg = run, .view = view };
    const bool placed =
        !run->costs && sst_run_places(run->cfg->runner, &disparity_match_step, &(struct match_batch){ .run = run });

    if (desc->features || (placed && has_features(run, view)))
        return 0;
    return sst_descriptor_add_features(desc, net, placed ? &keeper : NULL);
}
