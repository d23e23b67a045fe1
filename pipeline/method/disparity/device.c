/* Matching on a device: opening it, planes of the views, the report. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/disparity/disparity_internal.h"

_Static_assert(SST_MAX_VIEWS <= SST_PLANE_VIEWS, "a place each");

#define X(STAGE, name)
#define S(STAGE, step, name) &disparity_##step##_step,
static const struct sst_step *const steps[] = { &disparity_features_step, &disparity_match_step, &disparity_sweep_step,
                                                SST_DISPARITY_STAGE_LIST(X, S) };
#undef X
#undef S

#define X(STAGE, name)       name,
#define S(STAGE, step, name) name,
static const char *const stage_names[SST_DISPARITY_STAGES] = { SST_DISPARITY_STAGE_LIST(X, S) };
#undef X
#undef S

const char *sst_disparity_stage_name(enum sst_disparity_stage stage)
{
    return stage_names[stage];
}

int sst_disparity_device_create(struct sst_disparity_device **out, struct sst_runner *shared)
{
    struct sst_disparity_device *d = shared ? calloc(1, sizeof(*d)) : NULL;
    int err;

    *out = NULL;
    if (!shared)
        return 0;
    if (!d) {
        sst_log_error("not enough memory for a device");
        return -ENOMEM;
    }
    d->shared = shared;
    d->user = (struct sst_runner_user){ .steps = steps, .step_count = ARRAY_LEN(steps), .work = "match" };
    err = sst_runner_join(shared, &d->user);
    if (err)
        free(d);
    else
        *out = d;
    return err;
}

void sst_disparity_device_destroy(struct sst_disparity_device *d)
{
    if (d)
        sst_runner_leave(d->shared, &d->user);
    free(d);
}

struct sst_runner_user *disparity_device_user(struct sst_disparity_device *d)
{
    return d ? &d->user : NULL;
}

void sst_disparity_device_report(struct sst_disparity_device *d, struct sst_disparity_device_report *out)
{
    *out = d->report;
    out->step = d->user.report;
    d->report = (struct sst_disparity_device_report){ 0 };
    d->user.report = (struct sst_step_report){ 0 };
    memcpy(d->user.report.name, out->step.name, sizeof(out->step.name));
    memcpy(d->user.report.driver, out->step.driver, sizeof(out->step.driver));
}

void sst_disparity_device_note_stage(struct sst_disparity_device *d, enum sst_disparity_stage stage)
{
    if (d)
        d->user.report.stages_on_cpu |= 1u << stage;
}

void disparity_device_note_tested(struct sst_disparity_device *d, int tested, int on_cpu)
{
    if (!d)
        return;
    d->report.tested += tested;
    d->report.tested_on_cpu += on_cpu;
}

void disparity_device_note_views(const struct disparity_run *run, int on_device, int in_bands, int on_cpu)
{
    struct sst_disparity_device_report *report = run->cfg->device ? &run->cfg->device->report : NULL;

    if (!report)
        return;
    report->views += on_device;
    report->in_bands += in_bands;
    report->on_cpu += on_cpu;
    if (run->refused)
        snprintf(run->cfg->device->user.report.why, sizeof(run->cfg->device->user.report.why), "%s", run->refused);
}

/* --- planes ------------------------------------------------------------------------------------------------------- */

static void claim(struct sst_disparity_device *d, const void *of, int views, const size_t *pixels)
{
    sst_runner_lock(d->shared);
    sst_step_planes_claim(sst_runner_planes(d->shared), sst_runner_device(d->shared), of, views, pixels);
    sst_runner_unlock(d->shared);
}

void disparity_device_claim(struct sst_disparity_device *d, const struct disparity_run *run)
{
    const size_t matched = (size_t)run->width * (size_t)run->height;
    const size_t pixels[] = { (size_t)run->lf->width * (size_t)run->lf->height, matched, matched };

    if (!d)
        return;
    claim(d, run->lf, run->lf->rows * run->lf->cols, pixels);
    d->lf = run->lf;
}

void disparity_device_adopt(struct sst_disparity_device *d, const struct sst_visible_views *in)
{
    size_t n = 0;

    if (!d || d->lf)
        return;
    for (int k = 0; k < in->count; k++)
        n = in->view[k].image ? (size_t)in->view[k].disp->width * (size_t)in->view[k].disp->height : n;
    claim(d, in, in->count, (const size_t[]){ n, n, n });
}

void disparity_device_forget(struct sst_disparity_device *d, const struct disparity_run *run)
{
    if (!d || d->lf != run->lf)
        return;
    claim(d, NULL, 0, (const size_t[]){ 0, 0, 0 });
    d->lf = NULL;
}
