/* Pixels by label and disparity on a device: views are uploaded to be refined there, so that counting costs no copy. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/gpu/refine.h"
#include "pipeline/method/refine/refine_internal.h"

#define BINS (SST_DISP_BINS - 1) /* that of SST_DISP_NONE stays empty */

static int count_view(struct sst_refine_device *d, const struct sst_lightfield *lf, int view)
{
    const struct sst_gpu_refine_count push = { lf->width, lf->height, (uint32_t)lf->classes.count, BINS };
    struct sst_gpu_work work = { .shader = SST_GPU_REFINE_COUNT, .push = &push };
    int err;

    d->turn++;
    err = refine_device_view(d, lf, view, 1U << SST_GPU_PLANE_LABELS, NULL);
    work.buffer[SST_GPU_REFINE_COUNT_VIEW] = d->view[view].buffer;
    work.buffer[SST_GPU_REFINE_COUNT_COUNTS] = d->kept[REFINE_KEPT_COUNTS];
    return err ? err : refine_device_dispatch(d, &work, lf->width, lf->height);
}

/* Zeros: some are uploaded, and copied there. */
static int clear_counts(struct sst_refine_device *d, size_t bytes)
{
    static const uint32_t none[1 << 10];
    size_t done = sizeof(none) < bytes ? sizeof(none) : bytes;
    int err = refine_device_keep(d, REFINE_KEPT_COUNTS, bytes);

    err = err ? err : refine_device_upload(d, REFINE_KEPT_COUNTS, none, done);
    while (done < bytes && !err) {
        const size_t more = done < bytes - done ? done : bytes - done;

        err = sst_gpu_copy(d->gpu, d->kept[REFINE_KEPT_COUNTS], done, d->kept[REFINE_KEPT_COUNTS], 0, more);
        done += more;
    }
    return err;
}

static int count(struct sst_refine_device *d, const struct refine_job *job, int64_t *hist, uint32_t *counts)
{
    const struct sst_lightfield *lf = job->lf;
    const size_t n = (size_t)lf->classes.count * BINS;
    int err = clear_counts(d, n * sizeof(*counts));

    for (int view = 0; view < lf->rows * lf->cols && !err; view++) {
        if (refine_wants(job, view))
            err = count_view(d, lf, view);
    }
    err = err ? err : refine_device_download(d, REFINE_KEPT_COUNTS, counts, n * sizeof(*counts));
    for (size_t i = 0; i < n && !err; i++)
        hist[i / BINS * SST_DISP_BINS + i % BINS] = counts[i];
    refine_device_drop(d, REFINE_KEPT_COUNTS);
    return err;
}

bool refine_device_count(struct sst_refine_device *d, const struct refine_job *job, int64_t *hist)
{
    const struct sst_lightfield *lf = job->lf;
    const uint64_t pixels = (uint64_t)(lf->rows * lf->cols) * (uint64_t)lf->width * (uint64_t)lf->height;
    uint32_t *counts = calloc((size_t)lf->classes.count * BINS, sizeof(*counts));
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err;

    if (refine_device_begin(d, &err))
        err = counts && pixels <= UINT32_MAX ? count(d, job, hist, counts) : -ENOMEM;
    done = refine_device_end(d, err, "distributions are counted");
    if (!done)
        sst_refine_device_note_stage(d, SST_REFINE_STAGE_DISPARITY);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    free(counts);
    return done;
}
