/* pipeline/method/refine/refine_internal.h - private declarations of this folder. */
#ifndef SST_PIPELINE_METHOD_REFINE_REFINE_INTERNAL_H
#define SST_PIPELINE_METHOD_REFINE_REFINE_INTERNAL_H

#include "base/mem.h"
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
    uint64_t ground;                /* bit i: label i + 1 is a ground */
    uint64_t *candidates;           /* [SST_DISP_BINS] */
    struct refine_grounds *grounds; /* [views] */
    int64_t *hist;                  /* [n_workers][classes][SST_DISP_BINS] pixels, while the labels are fitted */
    struct sst_label_fit fits[SST_MAX_CLASSES];
    int *view;                      /* those that are refined */
    const int *batch;               /* of view: those that are refined at once */
    bool *done;                     /* [views] on the device */
    struct refine_worker *workers;
    int n_workers;
};

/** True if a view is refined. */
static inline bool refine_wants(const struct refine_job *job, int view)
{
    return job->lf->views[view].present && !(job->cfg->skip && job->cfg->skip[view]);
}

/** A view of those that are refined at once. */
static inline int refine_of_batch(const struct refine_job *job, int index)
{
    return job->view[job->batch[index]];
}

static inline bool refine_is_conflict(uint64_t candidates)
{
    return (candidates & (candidates - 1)) != 0;
}

/* --- device.c --- */

/** Pixels of a view on the device. */
struct refine_pixels {
    struct sst_gpu_buffer *buffer; /* NULL: not there */
    int64_t used;                  /* turn in which it was used last */
};

/** Memory on the device, kept from view to view. */
enum refine_kept {
    REFINE_KEPT_VIEW,
    REFINE_KEPT_TABLE,
    REFINE_KEPT_GROUNDS,
    REFINE_KEPT_SEEN,
    REFINE_KEPT_CHOICE,
    REFINE_KEPT_MASK,
    REFINE_KEPT_COLUMNS,
    REFINE_KEPT_HULL,
    REFINE_KEPT_SUMS, /* then the normals */
    REFINE_KEPT_PLANES,
    REFINE_KEPT_REGIONS,
    REFINE_KEPT_MEANS,
    REFINE_KEPT_OUT, /* also of votes */
    REFINE_KEPT
};

struct sst_refine_device {
    struct sst_gpu_shared *shared;
    struct sst_gpu_user user;
    struct sst_refine_device_report report;
    struct sst_mem_kept words, corners; /* of the host */
    /* under the lock of shared */
    struct sst_gpu *gpu; /* in work */
    struct sst_gpu_buffer *kept[REFINE_KEPT];
    size_t bytes[REFINE_KEPT];
    bool has_table;                           /* REFINE_KEPT_TABLE holds the candidates of this refinement */
    struct refine_pixels view[SST_MAX_VIEWS]; /* that vote */
    int64_t turn;
};

/**
 * Refine the `count` views of the batch on the device; those that it fails at are left to the CPU, counted and logged.
 * @param job  its `done` is set for those that are done
 * @return 0 or -ECANCELED
 */
SST_MUST_CHECK int refine_on_device(struct sst_refine_device *d, struct refine_job *job, int count);

/** Begin a piece of work; refine_device_end() follows. @param err  out: for that @return false: not on the device */
bool refine_device_begin(struct sst_refine_device *d, int *err);

/** End it: note an error, and log what fails. @param what  "the view is refined" @return true: it is done */
bool refine_device_end(struct sst_refine_device *d, int err, const char *what);

/* Between these two; the size of memory only grows, and what it held is then lost. */
SST_MUST_CHECK int refine_device_keep(struct sst_refine_device *d, enum refine_kept which, size_t bytes);
bool refine_device_drop_kept(struct sst_refine_device *d); /* all but REFINE_KEPT_OUT @return whether there was any */
SST_MUST_CHECK int refine_device_download(struct sst_refine_device *d, enum refine_kept which, void *data,
                                          size_t bytes);

/* --- device_votes.c --- */

/** Free the views that vote, under the lock. */
void refine_drop_votes(struct sst_refine_device *d);

#endif
