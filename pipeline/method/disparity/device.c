/* Matching on a device: opening it, and the memory that lasts from view to view. The first pass is in device_match.c,
 * the second one in device_visible.c.
 *
 * A device that fails is closed. The view in work and the next ones are then matched on the CPU, one more after each
 * failure, twice as many each time; then the device is opened again. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/gpu/match.h"
#include "pipeline/method/disparity/disparity_internal.h"

static const enum sst_gpu_shader shaders[] = {
    SST_GPU_CENSUS,          SST_GPU_MATCH_COST,      SST_GPU_SUPPORT_ARMS,    SST_GPU_SUPPORT_SUM,
    SST_GPU_SUPPORT_MEAN,    SST_GPU_SGM_PATH,        SST_GPU_WINNER,          SST_GPU_MEDIAN,
    SST_GPU_BILATERAL,       SST_GPU_HYPOTHESIS_COST, SST_GPU_HYPOTHESIS_PATH, SST_GPU_HYPOTHESIS_CHOICE,
    SST_GPU_CHECK,           SST_GPU_FILL_START,      SST_GPU_FILL_PROJECT,    SST_GPU_FILL_TAKE,
    SST_GPU_FEATURE_COST,    SST_GPU_FILL_ALONG,      SST_GPU_FILL_DOWN,       SST_GPU_SUBPIXEL_FIT,
    SST_GPU_SUBPIXEL_WINDOW, SST_GPU_SWEEP_POINTS,    SST_GPU_SWEEP_GATHER,    SST_GPU_SWEEP_PEAKS,
    SST_GPU_SURFACE_ROWS,   SST_GPU_SURFACE_PROJECT, SST_GPU_SURFACE_LIST,    SST_GPU_CARRY_PROJECT,
    SST_GPU_CARRY_CLOSE,     SST_GPU_CONVERT
};

static const struct sst_step *const steps[] = { &disparity_check_step, &disparity_fill_step, &disparity_background_step,
                                                &disparity_sweep_step, &disparity_surfaces_step,
                                                &disparity_subpixel_step, &disparity_carry_step };

static const char *const stage_names[SST_DISPARITY_STAGES] = {
    [SST_DISPARITY_STAGE_RANGE] = "range",           [SST_DISPARITY_STAGE_SURFACES] = "surfaces",
    [SST_DISPARITY_STAGE_SUBPIXEL] = "subpixel",     [SST_DISPARITY_STAGE_CARRY] = "carrying",
    [SST_DISPARITY_STAGE_CHECK] = "check",           [SST_DISPARITY_STAGE_FILL] = "filling",
    [SST_DISPARITY_STAGE_BACKGROUND] = "background",
};

const char *sst_disparity_stage_name(enum sst_disparity_stage stage)
{
    return stage_names[stage];
}

/* --- opening and failing ------------------------------------------------------------------------------------------ */

void disparity_device_drop_views(struct sst_disparity_device *d)
{
    for (int i = 0; i < SST_MAX_VIEWS; i++) {
        sst_gpu_buffer_destroy(d->gpu, d->view[i].features);
        d->view[i].features = NULL;
    }
    d->run = NULL;
}

/* Free all buffers. */
static void drop_all(void *arg)
{
    struct sst_disparity_device *d = arg;

    d->gpu = sst_runner_device(d->shared);
    disparity_device_drop_views(d);
    for (int i = 0; i < KEPT; i++) {
        sst_gpu_buffer_destroy(d->gpu, d->kept[i]);
        d->kept[i] = NULL;
        d->bytes[i] = 0;
    }
    d->loaded = false;
}

static void note_name(struct sst_disparity_device *d)
{
    const struct sst_gpu_info *info = sst_runner_info(d->shared);

    snprintf(d->report.name, sizeof(d->report.name), "%s", info->name);
    snprintf(d->report.driver, sizeof(d->report.driver), "%s", info->driver);
}

int sst_disparity_device_create(struct sst_disparity_device **out, struct sst_runner *shared)
{
    struct sst_disparity_device *d;
    int err;

    *out = NULL;
    if (!shared)
        return 0;
    d = calloc(1, sizeof(*d));
    if (!d) {
        sst_log_error("not enough memory for a device");
        return -ENOMEM;
    }
    d->shared = shared;
    d->user = (struct sst_runner_user){ .shaders = shaders,
                                        .count = ARRAY_LEN(shaders),
                                        .steps = steps,
                                        .step_count = ARRAY_LEN(steps),
                                        .work = "match",
                                        .drop = drop_all,
                                        .arg = d };
    err = sst_runner_join(shared, &d->user);
    if (err) {
        free(d);
        return err;
    }
    note_name(d);
    *out = d;
    return 0;
}

void sst_disparity_device_destroy(struct sst_disparity_device *d)
{
    if (!d)
        return;
    sst_runner_leave(d->shared, &d->user);
    sst_mem_kept_fini(&d->words);
    free(d);
}

struct sst_runner_user *disparity_device_user(struct sst_disparity_device *d)
{
    return d ? &d->user : NULL;
}

void sst_disparity_device_report(struct sst_disparity_device *d, struct sst_disparity_device_report *out)
{
    const struct sst_step_report run = d->user.report;

    *out = d->report;
    out->failures += run.failures;
    out->stages_on_cpu |= run.stages_on_cpu;
    out->dispatches += run.dispatches;
    out->uploads += run.uploads;
    out->upload_bytes += run.upload_bytes;
    out->total_ns += run.total_ns;
    out->upload_ns += run.upload_ns;
    out->wait_ns += run.wait_ns;
    out->download_ns += run.download_ns;
    if (*run.why)
        snprintf(out->why, sizeof(out->why), "%s", run.why);
    d->user.report = (struct sst_step_report){ 0 };
    d->report = (struct sst_disparity_device_report){ 0 };
    memcpy(d->report.name, out->name, sizeof(out->name));
    memcpy(d->report.driver, out->driver, sizeof(out->driver));
}

void sst_disparity_device_note_stage(struct sst_disparity_device *d, enum sst_disparity_stage stage)
{
    if (d)
        d->report.stages_on_cpu |= 1u << stage;
}

void disparity_device_note_tested(struct sst_disparity_device *d, int tested, int on_cpu)
{
    if (!d)
        return;
    d->report.tested += tested;
    d->report.tested_on_cpu += on_cpu;
}

void disparity_device_fail(struct sst_disparity_device *d, int err)
{
    sst_log_warning("%s: %s; the view is done on the CPU, and the device is opened again after %d more", d->report.name,
                    sst_gpu_error(err), sst_runner_fail(d->shared));
    snprintf(d->report.why, sizeof(d->report.why), "%s", sst_gpu_error(err));
    d->report.failures++;
}

bool disparity_device_begin(struct sst_disparity_device *d)
{
    int err;

    sst_runner_lock(d->shared);
    d->gpu = sst_runner_take(d->shared, &d->user, &err);
    if (d->gpu) {
        note_name(d);
        return true;
    }
    if (err)
        disparity_device_fail(d, err);
    sst_runner_unlock(d->shared);
    return false;
}

void disparity_device_resume(struct sst_disparity_device *d)
{
    sst_runner_lock(d->shared);
    d->gpu = sst_runner_device(d->shared);
    disparity_device_next_view(d);
}

void disparity_device_end(struct sst_disparity_device *d)
{
    sst_runner_unlock(d->shared);
}

void disparity_device_drop(struct sst_disparity_device *d)
{
    static const enum device_kept large[] = { KEPT_CENSUS, KEPT_OTHER, KEPT_COST, KEPT_SUM };

    disparity_device_drop_views(d);
    d->loaded = false;
    for (size_t i = 0; i < ARRAY_LEN(large); i++) {
        sst_gpu_buffer_destroy(d->gpu, d->kept[large[i]]);
        d->kept[large[i]] = NULL;
        d->bytes[large[i]] = 0;
    }
}

void disparity_device_forget(struct sst_disparity_device *d, const struct disparity_run *run)
{
    if (!d)
        return;
    disparity_device_resume(d);
    if (d->run == run)
        disparity_device_drop_views(d);
    disparity_device_unclaim(d);
    disparity_device_end(d);
}

const char *disparity_device_refuses(const struct disparity_run *run)
{
    const struct sst_disparity_config *cfg = run->cfg;

    if (!cfg->joint)
        return "maps of two directions are fused";
    if (!cfg->raw && cfg->support_arm && cfg->support_after)
        return "costs are aggregated after the optimisation";
    /* As all_steps() has it. */
    if (run->shape.steps + 64 > SST_GPU_MATCH_STEPS)
        return "too many disparities";
    /* A path makes a pass for each pixel, and one for each 128 of its disparities: docs/design/gpu.md, Rules. */
    return (int64_t)sst_max_int(run->shape.width, run->shape.height) * (1 + (run->shape.steps + 64 + 127) / 128) >
                   SST_GPU_MATCH_PASSES
               ? "sides that are too long for so many disparities"
               : NULL;
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

void disparity_device_note_cpu(struct sst_disparity_device *d, const char *why)
{
    d->report.on_cpu++;
    if (why)
        snprintf(d->report.why, sizeof(d->report.why), "%s", why);
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

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

/* Free the features of all views but one. @param stays  or NULL @return likewise */
static bool drop_features(struct sst_disparity_device *d, const struct device_pixels *stays)
{
    bool any = false;

    for (int i = 0; i < SST_MAX_VIEWS; i++) {
        if (!d->view[i].features || &d->view[i] == stays)
            continue;
        sst_gpu_buffer_destroy(d->gpu, d->view[i].features);
        d->view[i].features = NULL;
        any = true;
    }
    return any;
}

bool disparity_device_make_room(struct sst_disparity_device *d, enum sst_step_plane plane)
{
    const bool trimmed = sst_step_planes_trim(sst_runner_planes(d->shared), d->gpu, (int)plane);
    const bool dropped = drop_features(d, NULL);

    return sst_runner_make_room(d->shared, &d->user) || trimmed || dropped;
}

/* @param stays  whose features are in use */
int disparity_device_create_buffer(struct sst_disparity_device *d, struct sst_gpu_buffer **out, size_t bytes,
                                   const struct device_pixels *stays)
{
    int err = sst_gpu_buffer_create(d->gpu, out, bytes);

    if (d->borrowed || bytes > sst_gpu_get_info(d->gpu)->buffer_bytes) /* whatever gives way */
        return err;
    if (err == -ENOMEM && disparity_device_drop_unused(d))
        err = sst_gpu_buffer_create(d->gpu, out, bytes);
    if (err == -ENOMEM && drop_features(d, stays))
        err = sst_gpu_buffer_create(d->gpu, out, bytes);
    return err == -ENOMEM && sst_runner_make_room(d->shared, &d->user) ? sst_gpu_buffer_create(d->gpu, out, bytes)
                                                                       : err;
}

int disparity_device_keep(struct sst_disparity_device *d, enum device_kept which, size_t count, size_t each)
{
    int err;

    if (d->bytes[which] >= count * each)
        return 0;
    sst_gpu_buffer_destroy(d->gpu, d->kept[which]);
    d->kept[which] = NULL;
    d->bytes[which] = 0;
    err = disparity_device_create_buffer(d, &d->kept[which], count * each, NULL);
    if (!err)
        d->bytes[which] = count * each;
    return err;
}

int disparity_device_upload_at(struct sst_disparity_device *d, struct sst_gpu_buffer *b, size_t offset,
                               const void *data, size_t bytes)
{
    const int64_t start_ns = sst_clock_now_ns();
    const int err = sst_gpu_upload(d->gpu, b, offset, data, bytes);

    d->report.upload_bytes += (int64_t)bytes;
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

int disparity_device_upload(struct sst_disparity_device *d, struct sst_gpu_buffer *b, const void *data, size_t bytes)
{
    return disparity_device_upload_at(d, b, 0, data, bytes);
}
