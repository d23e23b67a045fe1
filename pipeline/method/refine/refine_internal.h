/* pipeline/method/refine/refine_internal.h - private declarations of this folder. */
#ifndef SST_PIPELINE_METHOD_REFINE_REFINE_INTERNAL_H
#define SST_PIPELINE_METHOD_REFINE_REFINE_INTERNAL_H

#include "pipeline/method/refine/parts.h"

/** The grounds of a view that are planes there. */
struct refine_grounds {
    uint64_t planar; /* bit i: label i + 1 is one */
    struct sst_ground ground[SST_MAX_CLASSES];
};

/** A refinement of all views. */
struct refine_job {
    struct sst_lightfield *lf; /* each view's labels are written by its own job */
    const struct sst_refine_config *cfg;
    struct sst_surface_frame frame;
    uint64_t ground;      /* bit i: label i + 1 is a ground */
    uint64_t *candidates; /* [SST_DISP_BINS] */
    int64_t *hist;        /* [n_workers][classes][SST_DISP_BINS] pixels, while the labels are fitted */
    struct sst_label_fit fits[SST_MAX_CLASSES];
    int *view; /* those that are refined */
    struct refine_worker *workers;
    int n_workers;
};

/** True if a view is refined. */
static inline bool refine_wants(const struct refine_job *job, int view)
{
    return job->lf->views[view].present && !(job->cfg->skip && job->cfg->skip[view]);
}

static inline bool refine_is_conflict(uint64_t candidates)
{
    return (candidates & (candidates - 1)) != 0;
}

#endif
