/* Labels of pixels from those of a network's cells on a device, and the threshold of their entropies. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/refine/refine_internal.h"

float refine_limit_of(double eps_h)
{
    const float limit = (float)eps_h;

    return (double)limit < eps_h ? nextafterf(limit, INFINITY) : limit;
}

/* Room for labels of a view, with entropies if they are wanted, and its colours; a new turn. */
static int begin_view(struct sst_refine_device *d, const struct sst_refine_enlarge *e, bool entropies)
{
    const struct sst_image *image = &e->lf->views[e->view].image;
    const size_t bytes = (size_t)image->width * (size_t)image->height * sizeof(uint32_t);
    int err = refine_device_keep(d, REFINE_KEPT_OUT, (entropies ? 2 : 1) * bytes);

    d->turn++;
    refine_device_reserve(d, e->lf, e->view, entropies ? 3 : 2);
    return err ? err : refine_device_view(d, e->lf, e->view, 1U << SST_GPU_PLANE_COLOURS, NULL);
}

/* Labels from cells that are there. */
static int find_labels(struct sst_refine_device *d, const struct sst_refine_enlarge *e, enum refine_kept places,
                       const struct sst_gpu_label_cells *push, struct sst_map_u8 *label, struct sst_map_f32 *entropy)
{
    const struct sst_gpu_label_keep words = { .way = SST_GPU_KEEP_WORDS, .entropies = entropy != NULL };
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_CELLS, .push = push };
    int err;

    work.buffer[SST_GPU_LABEL_CELLS_VIEW] = d->view[e->view].buffer;
    work.buffer[SST_GPU_LABEL_CELLS_CELLS] = d->kept[REFINE_KEPT_CELLS];
    work.buffer[SST_GPU_LABEL_CELLS_PLACES] = d->kept[places];
    work.buffer[SST_GPU_LABEL_CELLS_OUT] = d->kept[REFINE_KEPT_OUT];
    err = refine_device_dispatch(d, &work, label->width, label->height);
    err = err ? err : refine_device_keep_labels(d, e->lf, e->view, words, d->kept[REFINE_KEPT_OUT]);
    if (entropy)
        return err ? err : refine_device_entropies(d, label, entropy);
    return err ? err : refine_device_labels(d, REFINE_KEPT_OUT, label);
}

static int enlarge_whole(struct sst_refine_device *d, const struct sst_refine_enlarge *e,
                         const struct sst_label_cells *cells, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                         const struct sst_gpu_label_cells *push)
{
    int err = begin_view(d, e, entropy != NULL);

    err = err ? err : refine_device_upload(d, REFINE_KEPT_CELLS, cells->cells, cells->cells_bytes);
    err = err ? err : refine_device_upload(d, REFINE_KEPT_PLACES, cells->places, cells->places_bytes);
    return err ? err : find_labels(d, e, REFINE_KEPT_PLACES, push, label, entropy);
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
    sst_runner_unlock(d->shared);
    return done;
}

/* --- where the network runs --------------------------------------------------------------------------------------- */

/* Tables are the same for all views, and uploaded once. */
static int need_tables(struct sst_refine_device *d, const struct sst_label_result *r)
{
    void *copy;
    int err;

    if (d->tables_bytes == r->tables_bytes && !memcmp(d->tables.data, r->tables, r->tables_bytes))
        return 0;
    copy = sst_mem_keep(&d->tables, r->tables_bytes, 1);
    d->tables_bytes = 0;
    if (!copy)
        return -ENOMEM;
    err = refine_device_upload(d, REFINE_KEPT_TABLES, r->tables, r->tables_bytes);
    if (err)
        return err;
    memcpy(copy, r->tables, r->tables_bytes);
    d->tables_bytes = r->tables_bytes;
    return 0;
}

/* Use the device on which a network runs. @return false: it is another one, or cannot be used now */
static bool borrow_device(struct sst_refine_device *d, struct sst_gpu *g, const enum sst_gpu_shader *shaders, size_t n)
{
    int err = g == sst_runner_device(d->shared) && !d->band_rows ? 0 : 1;

    for (size_t i = 0; i < n && !err; i++)
        err = sst_gpu_prepare(g, shaders[i]);
    if (err)
        return false;
    d->gpu = g;
    d->borrowed = true;
    return true;
}

static void return_device(struct sst_refine_device *d, int64_t start_ns)
{
    d->borrowed = false;
    d->gpu = NULL;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
}

static int feed(struct sst_refine_device *d, const struct sst_refine_enlarge *e, const struct sst_label_result *r,
                struct sst_gpu_buffer *to, size_t at, bool entropies)
{
    struct sst_gpu_label_input input = r->input;
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_INPUT, .push = &input };
    int err = begin_view(d, e, entropies);

    input.to = (uint32_t)at;
    err = err ? err : need_tables(d, r);
    work.buffer[SST_GPU_LABEL_INPUT_VIEW] = d->view[e->view].buffer;
    work.buffer[SST_GPU_LABEL_INPUT_TABLES] = d->kept[REFINE_KEPT_TABLES];
    work.buffer[SST_GPU_LABEL_INPUT_TO] = to;
    return err ? err : refine_device_dispatch(d, &work, input.in_width, input.in_height);
}

bool sst_refine_device_feed(void *arg, struct sst_gpu *g, struct sst_gpu_buffer *to, size_t at,
                            const struct sst_label_result *result, bool entropies)
{
    static const enum sst_gpu_shader shaders[] = { SST_GPU_LABEL_INPUT };
    const struct sst_refine_enlarge *e = arg;
    const int64_t start_ns = sst_clock_now_ns();
    int err;

    if (!borrow_device(e->device, g, shaders, ARRAY_LEN(shaders)))
        return false;
    err = feed(e->device, e, result, to, at, entropies);
    return_device(e->device, start_ns);
    return !err;
}

/* @return 1: the result is invalid, which the CPU reports */
static int check(struct sst_refine_device *d, const struct sst_label_result *r)
{
    uint32_t invalid;
    int err = sst_gpu_download(d->gpu, &invalid, d->kept[REFINE_KEPT_TABLES], r->grid.invalid * sizeof(invalid),
                               sizeof(invalid));

    if (err || !invalid)
        return err;
    d->tables_bytes = 0; /* says so from now on */
    return 1;
}

static int finish(struct sst_refine_device *d, const struct sst_refine_enlarge *e, const struct sst_label_result *r,
                  struct sst_gpu_buffer *from, size_t at, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                  double eps_h)
{
    const size_t cells = (size_t)r->grid.grid_width * (size_t)r->grid.grid_height;
    struct sst_gpu_label_grid grid = r->grid;
    const struct sst_gpu_label_cells push = { grid.width,       grid.height,  grid.grid_width,
                                              grid.grid_height, grid.classes, refine_limit_of(eps_h),
                                              entropy != NULL };
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_GRID, .push = &grid };
    int err = begin_view(d, e, entropy != NULL);

    grid.from = (uint32_t)at;
    err = err ? err : refine_device_keep(d, REFINE_KEPT_CELLS, cells * (size_t)(grid.classes + 5) * sizeof(float));
    err = err ? err : need_tables(d, r);
    work.buffer[SST_GPU_LABEL_GRID_VIEW] = d->view[e->view].buffer;
    work.buffer[SST_GPU_LABEL_GRID_TABLES] = d->kept[REFINE_KEPT_TABLES];
    work.buffer[SST_GPU_LABEL_GRID_FROM] = from;
    work.buffer[SST_GPU_LABEL_GRID_CELLS] = d->kept[REFINE_KEPT_CELLS];
    err = err ? err : refine_device_dispatch(d, &work, grid.grid_width, grid.grid_height);
    err = err ? err : find_labels(d, e, REFINE_KEPT_TABLES, &push, label, entropy);
    err = err ? err : check(d, r);
    if (err)
        d->view[e->view].labels = d->view[e->view].entropies = false;
    return err;
}

bool sst_refine_device_finish(void *arg, struct sst_gpu *g, struct sst_gpu_buffer *from, size_t at,
                              const struct sst_label_result *result, struct sst_map_u8 *label,
                              struct sst_map_f32 *entropy, double eps_h)
{
    static const enum sst_gpu_shader shaders[] = { SST_GPU_LABEL_GRID, SST_GPU_LABEL_CELLS, SST_GPU_LABEL_KEEP };
    const struct sst_refine_enlarge *e = arg;
    struct sst_refine_device *d = e->device;
    const int64_t start_ns = sst_clock_now_ns();
    int err;

    if (!borrow_device(d, g, shaders, ARRAY_LEN(shaders)))
        return false;
    err = finish(d, e, result, from, at, label, entropy, eps_h);
    return_device(d, start_ns);
    d->report.finished += !err;
    d->report.enlarged += !err;
    return !err;
}
