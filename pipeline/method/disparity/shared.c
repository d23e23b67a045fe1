/* What processes share of a run beside its passes: check, filling, and measurements that one does for all. */
#include <math.h>

#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

static int block_of(const struct disparity_run *run)
{
    return sst_share_block((size_t)run->width * (size_t)run->height);
}

static void checked_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    if (run->lf->views[view].present && !run_is_carried(run, view)) /* the others' are not checked */
        sst_share_add_u8(out, &run->status[view]);
}

/* A device checks all views together: what processes share is checked on their processors. */
int run_check_views(struct disparity_run *run, int threads)
{
    struct sst_disparity_device *device = run->cfg->device;

    if (device && run->cfg->share)
        sst_disparity_device_note_stage(device, SST_DISPARITY_STAGE_CHECK);
    else if (device && disparity_device_check(device, run))
        return run_cancelled(run);
    return sst_share_blocks(run->cfg->share, run->lf->rows * run->lf->cols, block_of(run), threads, run_check, run,
                            checked_maps);
}

static void filled_maps(void *arg, int view, struct sst_share_maps *out)
{
    struct disparity_run *run = arg;

    if (run->lf->views[view].present)
        sst_share_add_u16(out, &run->filled[view]);
}

int run_fill_views(struct disparity_run *run, int threads)
{
    struct sst_disparity_device *device = run->cfg->device;

    if (device && run->cfg->share) {
        sst_disparity_device_note_stage(device, SST_DISPARITY_STAGE_FILL);
        sst_disparity_device_note_stage(device, SST_DISPARITY_STAGE_BACKGROUND);
    } else if (device && disparity_device_fill(device, run)) {
        return run_cancelled(run);
    }
    for (int k = 0; device && k < run->lf->rows * run->lf->cols; k++)
        disparity_device_map_changed(device, k);
    return sst_share_blocks(run->cfg->share, run->lf->rows * run->lf->cols, block_of(run), threads, run_fill, run,
                            filled_maps);
}

/* What one process measures for all. */
struct measured {
    struct disparity_run *run;
    const struct sst_visible_views *in;
    struct sst_map_u8 *status; /* or NULL */
    double error;
};

static void measured_values(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct measured *m = arg;

    sst_share_add_values(out, &m->error, sizeof(m->error));
}

static int measure_carrying(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct measured *m = arg;

    return sst_disparity_carry_error(m->in, m->status, m->run->lf->ref_view, &m->error);
}

int run_carrying_error(struct disparity_run *run, const struct sst_visible_views *in, struct sst_map_u8 *status,
                       double *error)
{
    struct measured m = { run, in, status, NAN };
    const int ref = run->lf->ref_view;
    int err = 0;

    if (run->lf->views[ref].present && !run->carried[ref])
        err = sst_share_for(run->cfg->share, 1, 1, measure_carrying, &m, measured_values);
    *error = m.error;
    return err;
}
