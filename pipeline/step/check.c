/* Comparison of a step on a device with its definition on the CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/log.h"
#include "pipeline/step/step_internal.h"

#define SEEDS 2 /* if a step does not say; each optional map is there once, and once not */

/* True if the views' results are equal. */
static bool is_equal(const struct sst_step *step, void *device, void *host)
{
    bool equal = true;

    for (int i = 0; i < SST_STEP_SAMPLES && equal; i++) {
        struct sst_share_maps a = { 0 }, b = { 0 };

        if (!step->wants(host, i))
            continue;
        if (step->same) {
            equal = step->same(device, host, i);
            continue;
        }
        step->writes(device, i, &a);
        step->writes(host, i, &b);
        equal = sst_share_maps_equal(&a, &b, step->levels);
        sst_share_maps_fini(&a);
        sst_share_maps_fini(&b);
    }
    return equal;
}

static int check_seed(struct sst_run *r, uint32_t seed)
{
    void *host = r->step->sample(seed);
    bool done[SST_STEP_SAMPLES] = { false };

    r->done = done;
    r->job = r->step->sample(seed);
    r->err = r->job && host ? 0 : -ENOMEM;
    for (int plane = 0; plane < SST_PLANES; plane++) {
        for (int i = 0; i < SST_STEP_SAMPLES; i++)
            sst_step_plane_mark(&r->memory->planes, (enum sst_step_plane)plane, i, false);
    }
    for (int i = 0; i < SST_STEP_SAMPLES && !r->err; i++) {
        if (!r->step->wants(host, i))
            continue;
        runner_run_view(r, i);
        done[i] = true;
        if (!r->err && sst_gpu_is_dummy(r->gpu)) /* which has computed nothing */
            r->err = r->step->cpu(r->job, i, 0);
        r->err = r->err ? r->err : r->step->cpu(host, i, 0);
    }
    if (r->err == RUN_LEFT || (!r->err && (sst_gpu_dummy_was_wrong(r->gpu) || !is_equal(r->step, r->job, host))))
        r->err = -ENOTSUP;
    r->step->sample_free(r->job);
    r->step->sample_free(host);
    return r->err;
}

/* @param variant  the only one in use; SST_GPU_SHADERS: none @param asked  as of struct sst_run */
static int compare(struct sst_runner_user *user, struct sst_gpu *g, const struct sst_step_shaders *shaders,
                   enum sst_gpu_shader variant, bool *asked)
{
    const struct sst_step *step = shaders->step;
    const size_t n =
        step->sample_pixels ? (size_t)step->sample_pixels : (size_t)SST_STEP_SAMPLE_WIDTH * SST_STEP_SAMPLE_HEIGHT;
    const size_t pixels[SST_PLANE_MAP + 1] = { n, n, n };
    struct runner_memory *memory = calloc(1, sizeof(*memory));
    struct sst_step_report uncounted = { 0 };
    struct sst_run r = {
        .user = user,
        .memory = memory,
        .report = &uncounted,
        .gpu = g,
        .step = step,
        .shaders = shaders,
        .asked = asked,
        .variant = variant,
    };
    const uint32_t seeds = step->seeds ? (uint32_t)step->seeds : SEEDS;
    int err = memory ? 0 : -ENOMEM;

    if (memory)
        sst_step_planes_claim(&memory->planes, g, memory, SST_STEP_SAMPLES, pixels);
    for (uint32_t seed = 1; seed <= seeds && !err; seed++)
        err = check_seed(&r, seed);
    if (memory)
        runner_memory_drop(memory, g);
    free(memory);
    return err;
}

static bool is_due(const struct sst_gpu *g, const bool *asked, enum sst_gpu_shader variant)
{
    bool due = false;

    for (int i = 0; i < SST_GPU_SHADERS && !due; i++)
        due = asked[i] && sst_gpu_wants_variant(g, (enum sst_gpu_shader)i, variant);
    return due;
}

/* Compare the step once more for each variant that it would use. @return how many are refused, or an error */
static int compare_variants(struct sst_runner_user *user, struct sst_gpu *g, const struct sst_step_shaders *shaders,
                            bool *asked)
{
    int refused = 0;

    for (int i = 0; i < SST_GPU_SHADERS; i++) {
        const enum sst_gpu_shader variant = (enum sst_gpu_shader)i;
        int err = is_due(g, asked, variant) ? sst_gpu_prepare(g, variant) : 0;

        if (!err && is_due(g, asked, variant)) {
            err = compare(user, g, shaders, variant, asked);
            if (err)
                sst_gpu_refuse(g, variant, err);
        }
        if (err && err != -ENOTSUP && err != -ENOMEM)
            return err;
        refused += err != 0;
    }
    return refused;
}

int sst_step_check(struct sst_runner_user *user, struct sst_gpu *g, const struct sst_step_shaders *s)
{
    bool asked[SST_GPU_SHADERS] = { false };
    char test[SST_GPU_NAME];
    int err, refused = 0;

    snprintf(test, sizeof(test), "step %s", s->step->name);
    if (sst_gpu_has_passed(g, test))
        return 0;
    err = compare(user, g, s, SST_GPU_SHADERS, asked);
    if (!err)
        refused = compare_variants(user, g, s, asked);
    err = sst_min_int(refused, err);
    if ((!err && !refused) || err == -ENOTSUP) /* refusals are found again */
        sst_gpu_note_verdict(g, test, !err);
    if (err == -ENOTSUP)
        sst_log_warning("%s: the step `%s` is refused: its results differ from those of the CPU",
                        sst_gpu_get_info(g)->name, s->step->name);
    else if (err)
        sst_log_warning("%s: the step `%s` cannot be tested: %s", sst_gpu_get_info(g)->name, s->step->name,
                        sst_gpu_error(err));
    return err;
}
