/* Labels of pixels from those of a network's cells on a device, and the threshold of their entropies. */
#include <errno.h>
#include <math.h>

#include "base/clock.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/refine/refine_internal.h"

float refine_limit_of(double eps_h)
{
    const float limit = (float)eps_h;

    return (double)limit < eps_h ? nextafterf(limit, INFINITY) : limit;
}

static int enlarge_whole(struct sst_refine_device *d, const struct sst_refine_enlarge *e,
                         const struct sst_label_cells *cells, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                         const struct sst_gpu_label_cells *push)
{
    const size_t bytes = (size_t)label->width * (size_t)label->height * sizeof(uint32_t);
    const struct sst_gpu_label_keep words = { .way = SST_GPU_KEEP_WORDS, .entropies = entropy != NULL };
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_CELLS, .push = push };
    int err = refine_device_keep(d, REFINE_KEPT_OUT, (entropy ? 2 : 1) * bytes);

    d->turn++;
    refine_device_reserve(d, e->lf, e->view, entropy ? 3 : 2);
    err = err ? err : refine_device_view(d, e->lf, e->view, 1U << SST_GPU_PLANE_COLOURS, NULL);
    err = err ? err : refine_device_upload(d, REFINE_KEPT_CELLS, cells->cells, cells->cells_bytes);
    err = err ? err : refine_device_upload(d, REFINE_KEPT_PLACES, cells->places, cells->places_bytes);
    work.buffer[SST_GPU_LABEL_CELLS_VIEW] = d->view[e->view].buffer;
    work.buffer[SST_GPU_LABEL_CELLS_CELLS] = d->kept[REFINE_KEPT_CELLS];
    work.buffer[SST_GPU_LABEL_CELLS_PLACES] = d->kept[REFINE_KEPT_PLACES];
    work.buffer[SST_GPU_LABEL_CELLS_OUT] = d->kept[REFINE_KEPT_OUT];
    err = err ? err : refine_device_dispatch(d, &work, label->width, label->height);
    err = err ? err : refine_device_keep_labels(d, e->lf, e->view, words, d->kept[REFINE_KEPT_OUT]);
    if (entropy)
        return err ? err : refine_device_entropies(d, label, entropy);
    return err ? err : refine_device_labels(d, REFINE_KEPT_OUT, label);
}

static int enlarge(struct sst_refine_device *d, const struct sst_refine_enlarge *e, const struct sst_label_cells *cells,
                   struct sst_map_u8 *label, struct sst_map_f32 *entropy, double eps_h)
{
    const struct sst_gpu_label_cells push = { label->width,   label->height,          cells->width,   cells->height,
                                              cells->classes, refine_limit_of(eps_h), entropy != NULL };
    int err = d->band_rows ? -ENOMEM : enlarge_whole(d, e, cells, label, entropy, &push);

    if (err != -ENOMEM)
        return err;
    err = refine_device_enlarge(d, label, entropy, e, cells, &push);
    d->report.enlarged_in_parts += !err;
    return err;
}

bool sst_refine_device_enlarge(void *arg, const struct sst_label_cells *cells, struct sst_map_u8 *label,
                               struct sst_map_f32 *entropy, double eps_h)
{
    const struct sst_refine_enlarge *e = arg;
    struct sst_refine_device *d = e->device;
    int err;
    const bool begun = refine_device_begin(d, &err);
    const int64_t start_ns = sst_clock_now_ns(); /* networks of other threads may have had the device */
    bool done;

    if (begun)
        err = enlarge(d, e, cells, label, entropy, eps_h);
    done = refine_device_end_locked(d, err, "labels are enlarged");
    d->report.enlarged += done;
    d->report.enlarged_on_cpu += !done;
    if (!done)
        d->report.stages_on_cpu |= 1U << SST_REFINE_STAGE_ENTROPY;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    sst_gpu_shared_unlock(d->shared);
    return done;
}
