/* The hypotheses of the second pass on a device: the surfaces around each pixel of a view, those that other views
 * project onto it and those that the sweep finds. The points that single views found come back once, so that the CPU
 * can go on from there. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/gpu/surfaces.h"
#include "pipeline/gpu/sweep.h"
#include "pipeline/method/disparity/disparity_internal.h"

_Static_assert(SST_SWEEP_LEVELS == SST_GPU_SWEEP_LEVELS && SST_SWEEP_PEAKS == SST_GPU_CELL_PEAKS &&
                   SST_AROUND_EXTREMES == 2 * SST_GPU_SURFACE_WINDOWS,
               "the layout of the shaders");

#define PROJECTED_SPACINGS 2.5 /* to matched views whose surfaces are projected, along both axes together */

static size_t pixels_of(const struct device_hypotheses *in)
{
    return (size_t)in->test->width * (size_t)in->test->height;
}

static uint32_t own_of(const struct device_hypotheses *in)
{
    return (uint32_t)((size_t)in->view * pixels_of(in));
}

static int dispatch(struct sst_disparity_device *d, enum sst_gpu_shader shader, const void *push,
                    const enum device_kept *buffer, size_t count, uint32_t x, uint32_t y, uint32_t z)
{
    struct sst_gpu_work work = { .shader = shader, .push = push, .groups = { x, y, z } };

    for (size_t i = 0; i < count; i++)
        work.buffer[i] = d->kept[buffer[i]];
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* Over all pixels of a view. */
static int dispatch_plane(struct sst_disparity_device *d, const struct device_hypotheses *in,
                          enum sst_gpu_shader shader, const void *push, const enum device_kept *buffer, size_t count,
                          uint32_t layers)
{
    return dispatch(d, shader, push, buffer, count, (uint32_t)(in->test->width + 31) / 32,
                    (uint32_t)(in->test->height + 7) / 8, layers);
}

/* --- points of a view --------------------------------------------------------------------------------------------- */

int disparity_device_find_points(struct sst_disparity_device *d, const struct device_hypotheses *in,
                                 const struct sst_gpu_hypothesis_cost *test, struct sst_sweep *out)
{
    static const enum device_kept buffers[] = { KEPT_VIEWS, KEPT_PIXELS, KEPT_MAPS, KEPT_CHOSEN };
    const struct sst_sweep_plan *p = in->plan;
    const struct sst_gpu_sweep push = { *test, p->stride, p->level, p->levels, p->apart, p->distinct, p->weight_most };
    const int columns = sst_gpu_sweep_samples(test->width, p->stride);
    const int rows = sst_gpu_sweep_samples(test->height, p->stride);
    const size_t n = (size_t)sst_max_int(columns, 0) * (size_t)sst_max_int(rows, 0);
    uint32_t *words = sst_mem_keep(&d->words, n + 1, sizeof(*words));
    struct sst_sweep_point *point = sst_mem_alloc_raw(n + 1, sizeof(*point));
    int err = words && point ? disparity_device_keep(d, KEPT_CHOSEN, n + 1, sizeof(*words)) : -ENOMEM;

    if (n)
        err = err ? err
                  : dispatch(d, SST_GPU_SWEEP_POINTS, &push, buffers, ARRAY_LEN(buffers), (uint32_t)columns,
                             (uint32_t)rows, 1);
    if (n)
        err = err ? err : disparity_device_fetch(d, d->kept[KEPT_CHOSEN], 0, n, words);
    if (err) {
        sst_mem_free(point);
        return err;
    }
    out->point = point;
    out->count = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t x = i % (size_t)columns * (size_t)p->stride, y = i / (size_t)columns * (size_t)p->stride;
        const size_t half = (size_t)p->stride / 2;

        if (words[i])
            point[out->count++] = (struct sst_sweep_point){ (uint16_t)(x + half), (uint16_t)(y + half),
                                                            (uint16_t)words[i], (uint16_t)(words[i] >> 16) };
    }
    return 0;
}

int disparity_device_upload_points(struct sst_disparity_device *d, const struct sst_sweep *sweep, int sweeps)
{
    struct sst_gpu_sweep_point *points;
    size_t n = 0, at = 0;
    int err;

    for (int i = 0; i < sweeps; i++)
        n += sweep[i].count;
    points = sst_mem_keep(&d->words, n + 1, sizeof(*points));
    err = points ? disparity_device_keep(d, KEPT_POINTS, n + 1, sizeof(*points)) : -ENOMEM;
    if (err)
        return err;
    for (int i = 0; i < sweeps; i++) {
        for (size_t k = 0; k < sweep[i].count; k++) {
            const struct sst_sweep_point *p = &sweep[i].point[k];

            points[at++] = (struct sst_gpu_sweep_point){ p->x | (uint32_t)p->y << 16,
                                                         p->level | (uint32_t)p->weight << 8 | (uint32_t)i << 16 };
        }
    }
    d->points = (uint32_t)n;
    return n ? disparity_device_upload(d, d->kept[KEPT_POINTS], points, n * sizeof(*points)) : 0;
}

/* --- surfaces of a view ------------------------------------------------------------------------------------------- */

/* Memory for the surfaces of a view. @return 0 or an error */
static int reserve(struct sst_disparity_device *d, const struct device_hypotheses *in, size_t weights)
{
    const size_t n = pixels_of(in), cells = (size_t)in->plan->cols * (size_t)in->plan->rows;
    int err = disparity_device_keep(d, KEPT_ROWS, 4 * n, sizeof(uint32_t));

    err = err ? err : disparity_device_keep(d, KEPT_PROJECTED, 2 * n, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_OTHERS, SST_MAX_VIEWS, sizeof(struct sst_gpu_check_other));
    err = err ? err
              : disparity_device_keep(d, KEPT_SHIFTS, (size_t)sst_max_int(in->sweeps, 1) * (size_t)in->plan->levels,
                                      2 * sizeof(int32_t));
    err = err ? err : disparity_device_keep(d, KEPT_WEIGHTS, weights, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_PEAKS, cells * SST_SWEEP_PEAKS, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_LIST, n * SST_HYPOTHESES, sizeof(uint16_t));
    return err ? err : disparity_device_keep(d, KEPT_COUNTS, n, sizeof(uint32_t));
}

/* What the matched views around put into the view. */
static int project(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    static const enum device_kept buffers[] = { KEPT_OTHERS, KEPT_MAPS, KEPT_PROJECTED };
    const struct sst_gpu_surface_project push = { in->test->width, in->test->height };
    const struct sst_visible_view *own = &in->in->view[in->view];
    struct sst_gpu_check_other other[SST_MAX_VIEWS];
    uint32_t count = 0;
    int err = 0;

    for (int i = 0; i < in->in->count && !err; i++) {
        const struct sst_visible_view *v = &in->in->view[i];
        const double bx = v->bx - own->bx, by = v->by - own->by;

        if (i == in->view || !v->image || v->carried || !(fabs(bx) + fabs(by) < PROJECTED_SPACINGS))
            continue;
        other[count].first = (uint32_t)((size_t)i * pixels_of(in));
        err = sst_step_shift(&other[count++].shift, sst_shift_by(bx, in->in->disp_min_px),
                             sst_shift_by(by, in->in->disp_min_px));
    }
    if (err || !count)
        return err;
    err = disparity_device_upload(d, d->kept[KEPT_OTHERS], other, count * sizeof(*other));
    return err ? err : dispatch_plane(d, in, SST_GPU_SURFACE_PROJECT, &push, buffers, ARRAY_LEN(buffers), count);
}

/* The points of all sweeps, seen from the view. */
static int gather_points(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    static const enum device_kept buffers[] = { KEPT_POINTS, KEPT_SHIFTS, KEPT_WEIGHTS };
    const struct sst_sweep_plan *p = in->plan;
    const struct sst_visible_view *own = &in->in->view[in->view];
    const struct sst_gpu_sweep_gather push = { d->points, p->levels, p->cell, p->cols, p->rows };
    const size_t across = (size_t)SST_GPU_HYPOTHESIS_PIXELS * SST_GPU_HYPOTHESIS_ACROSS;
    const size_t levels = (size_t)p->levels;
    int32_t(*shift)[2] = sst_mem_keep(&d->words, (size_t)sst_max_int(in->sweeps, 1) * levels, sizeof(*shift));
    int err;

    if (!shift)
        return -ENOMEM;
    if (!d->points)
        return 0;
    for (int i = 0; i < in->sweeps; i++)
        sst_sweep_shifts(shift + (size_t)i * levels, p, own->bx - in->sweep[i].bx, own->by - in->sweep[i].by,
                         in->in->disp_min_px);
    err = disparity_device_upload(d, d->kept[KEPT_SHIFTS], shift, (size_t)in->sweeps * levels * sizeof(*shift));
    return err ? err
               : dispatch(d, SST_GPU_SWEEP_GATHER, &push, buffers, ARRAY_LEN(buffers), SST_GPU_HYPOTHESIS_ACROSS,
                          (uint32_t)((d->points + across - 1) / across), 1);
}

static int pick_peaks(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    static const enum device_kept buffers[] = { KEPT_MAPS, KEPT_WEIGHTS, KEPT_PEAKS };
    const struct sst_sweep_plan *p = in->plan;
    const struct sst_gpu_sweep_peaks push = { .width = in->test->width,
                                              .height = in->test->height,
                                              .own = own_of(in),
                                              .stride = p->stride,
                                              .cell = p->cell,
                                              .cols = p->cols,
                                              .rows = p->rows,
                                              .levels = p->levels,
                                              .level = p->level,
                                              .apart = p->peaks_apart,
                                              .gathered = p->gathered,
                                              .mapped = p->mapped };

    return dispatch(d, SST_GPU_SWEEP_PEAKS, &push, buffers, ARRAY_LEN(buffers), (uint32_t)p->cols, (uint32_t)p->rows,
                    1);
}

int disparity_device_gather(struct sst_disparity_device *d, const struct device_hypotheses *in)
{
    static const enum device_kept first[] = { KEPT_MAPS, KEPT_ROWS, KEPT_PROJECTED, KEPT_WEIGHTS };
    static const enum device_kept last[] = { KEPT_MAPS, KEPT_ROWS, KEPT_PROJECTED, KEPT_PEAKS, KEPT_LIST, KEPT_COUNTS };
    const struct sst_sweep_plan *p = in->plan;
    const size_t weights = (size_t)p->cols * (size_t)p->rows * (size_t)p->levels;
    const struct sst_gpu_surface_start start = { in->test->width, in->test->height, own_of(in), in->step * 3 / 2,
                                                 (uint32_t)weights };
    const struct sst_gpu_surface_list list = { .width = in->test->width,
                                               .height = in->test->height,
                                               .own = own_of(in),
                                               .apart = sst_max_int(in->step, 1),
                                               .cell = p->cell,
                                               .cols = p->cols };
    int err = reserve(d, in, weights);

    err = err ? err : dispatch_plane(d, in, SST_GPU_SURFACE_START, &start, first, ARRAY_LEN(first), 1);
    err = err ? err : project(d, in);
    err = err ? err : gather_points(d, in);
    err = err ? err : pick_peaks(d, in);
    return err ? err : dispatch_plane(d, in, SST_GPU_SURFACE_LIST, &list, last, ARRAY_LEN(last), 1);
}
