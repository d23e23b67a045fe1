/* Label refinement on a device: opening it, its memory, what ends on the CPU. The steps of a view: device_steps.c.
 *
 * A device that fails is closed. The view in work and the next ones are then refined on the CPU, one more after each
 * failure, twice as many each time; then the device is opened again. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/gpu/refine.h"
#include "pipeline/method/refine/refine_internal.h"

void refine_device_drop(struct sst_refine_device *d, enum refine_kept which)
{
    sst_gpu_buffer_destroy(sst_runner_device(d->shared), d->kept[which]);
    d->kept[which] = NULL;
    if (which == REFINE_KEPT_TABLES)
        d->tables_bytes = 0;
    d->bytes[which] = 0;
}

static void drop(void *arg)
{
    struct sst_refine_device *d = arg;

    for (int i = 0; i < REFINE_KEPT; i++)
        refine_device_drop(d, (enum refine_kept)i);
    d->has_table = false;
    d->rows = d->band_rows = 0;
    refine_drop_views(d);
}

bool refine_device_drop_kept(struct sst_refine_device *d)
{
    bool any = false;

    for (int i = 0; i < REFINE_KEPT; i++) {
        if (i == REFINE_KEPT_OUT || i == REFINE_KEPT_COUNTS || !d->kept[i])
            continue;
        refine_device_drop(d, (enum refine_kept)i);
        any = true;
    }
    d->has_table = false;
    return any;
}

static void note_name(struct sst_refine_device *d)
{
    const struct sst_gpu_info *info = sst_runner_info(d->shared);

    snprintf(d->report.name, sizeof(d->report.name), "%s", info->name);
    snprintf(d->report.driver, sizeof(d->report.driver), "%s", info->driver);
}

int sst_refine_device_create(struct sst_refine_device **out, struct sst_runner *shared)
{
    static const enum sst_gpu_shader shaders[] = { SST_GPU_REFINE_MASK,
                                                   SST_GPU_REFINE_COLUMNS,
                                                   SST_GPU_REFINE_COMPETE,
                                                   SST_GPU_REFINE_SUMS,
                                                   SST_GPU_REFINE_PLANES,
                                                   SST_GPU_REFINE_NORMALS,
                                                   SST_GPU_REFINE_ASSIGN,
                                                   SST_GPU_VOTE,
                                                   SST_GPU_LABEL_CARRY,
                                                   SST_GPU_LABEL_FILL,
                                                   SST_GPU_LABEL_CELLS,
                                                   SST_GPU_LABEL_INPUT,
                                                   SST_GPU_LABEL_GRID,
                                                   SST_GPU_REFINE_COUNT,
                                                   SST_GPU_REFINE_GROUND_SUMS,
                                                   SST_GPU_REFINE_GROUND_MISSES,
                                                   SST_GPU_REFINE_GROUND_LIMIT,
                                                   SST_GPU_REFINE_EXTENTS,
                                                   SST_GPU_CONVERT,
                                                   SST_GPU_LABEL_KEEP };
    struct sst_refine_device *d;
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
    d->user = (struct sst_runner_user){
        .shaders = shaders, .count = ARRAY_LEN(shaders), .work = "refine labels", .drop = drop, .arg = d
    };
    err = sst_runner_join(shared, &d->user);
    if (err) {
        free(d);
        return err;
    }
    note_name(d);
    *out = d;
    return 0;
}

void sst_refine_device_destroy(struct sst_refine_device *d)
{
    if (!d)
        return;
    sst_runner_leave(d->shared, &d->user);
    sst_mem_kept_fini(&d->words);
    sst_mem_kept_fini(&d->corners);
    sst_mem_kept_fini(&d->extents);
    sst_mem_kept_fini(&d->result);
    sst_mem_kept_fini(&d->tables);
    free(d);
}

const char *sst_refine_stage_name(enum sst_refine_stage stage)
{
    static const char *const names[SST_REFINE_STAGES] = { "entropy", "distributions", "carrying" };

    return names[stage];
}

void sst_refine_device_note_stage(struct sst_refine_device *d, enum sst_refine_stage stage)
{
    if (d)
        d->report.stages_on_cpu |= 1U << stage;
}

void sst_refine_device_report(struct sst_refine_device *d, struct sst_refine_device_report *out)
{
    *out = d->report;
    d->report = (struct sst_refine_device_report){ 0 };
    memcpy(d->report.name, out->name, sizeof(out->name));
    memcpy(d->report.driver, out->driver, sizeof(out->driver));
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

int refine_device_keep(struct sst_refine_device *d, enum refine_kept which, size_t bytes)
{
    int err;

    if (d->bytes[which] >= bytes)
        return 0;
    refine_device_drop(d, which);
    err = sst_gpu_buffer_create(d->gpu, &d->kept[which], bytes);
    if (err == -ENOMEM && d->borrowed)
        return err;
    if (err == -ENOMEM && sst_runner_make_room(d->shared, &d->user))
        err = sst_gpu_buffer_create(d->gpu, &d->kept[which], bytes);
    while (err == -ENOMEM && refine_drop_oldest(d))
        err = sst_gpu_buffer_create(d->gpu, &d->kept[which], bytes);
    if (!err)
        d->bytes[which] = bytes;
    return err;
}

int refine_device_upload(struct sst_refine_device *d, enum refine_kept which, const void *data, size_t bytes)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = refine_device_keep(d, which, bytes);

    err = err ? err : sst_gpu_upload(d->gpu, d->kept[which], 0, data, bytes);
    d->report.upload_bytes += (int64_t)bytes;
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

int refine_device_download(struct sst_refine_device *d, enum refine_kept which, void *data, size_t bytes)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = sst_gpu_wait(d->gpu);
    const int64_t done_ns = sst_clock_now_ns();

    err = err ? err : sst_gpu_download(d->gpu, data, d->kept[which], 0, bytes);
    d->report.wait_ns += done_ns - start_ns;
    d->report.download_ns += sst_clock_now_ns() - done_ns;
    return err;
}

/* --- begin and end ------------------------------------------------------------------------------------------------ */

bool refine_device_begin(struct sst_refine_device *d, int *err)
{
    sst_runner_lock(d->shared);
    d->gpu = sst_runner_take(d->shared, &d->user, err);
    if (d->gpu)
        note_name(d);
    return d->gpu;
}

bool refine_device_end_locked(struct sst_refine_device *d, int err, const char *what)
{
    const bool done = d->gpu && !err;

    if (done)
        sst_runner_succeed(d->shared);
    if (err)
        snprintf(d->report.why, sizeof(d->report.why), "%s",
                 err == -EOVERFLOW ? "views are too far apart" : sst_gpu_error(err));
    if (err && ((err != -ENOMEM && err != -EOVERFLOW) || !d->gpu)) { /* else the device is not to blame */
        sst_log_warning("%s: %s; %s on the CPU, and the device is opened again after %d more", d->report.name,
                        sst_gpu_error(err), what, sst_runner_fail(d->shared));
        d->report.failures++;
    }
    d->gpu = NULL;
    return done;
}

bool refine_device_end(struct sst_refine_device *d, int err, const char *what)
{
    const bool done = refine_device_end_locked(d, err, what);

    sst_runner_unlock(d->shared);
    return done;
}

/* @return true: the view is done */
static bool try_view(struct sst_refine_device *d, const struct refine_job *job, int view)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err;

    if (refine_device_begin(d, &err))
        err = refine_device_steps(d, job, view);
    done = refine_device_end(d, err, "the view is refined");
    d->report.views += done;
    d->report.on_cpu += !done;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    return done;
}

void refine_device_start(struct sst_refine_device *d)
{
    sst_runner_lock(d->shared);
    d->has_table = false;
    d->rows = d->band_rows = 0;
    sst_runner_unlock(d->shared);
}

int refine_on_device(struct sst_refine_device *d, struct refine_job *job, int count)
{
    for (int i = 0; i < count; i++) {
        if (job->cfg->cancel && *job->cfg->cancel)
            return -ECANCELED;
        job->done[refine_of_batch(job, i)] = try_view(d, job, refine_of_batch(job, i));
    }
    return 0;
}
