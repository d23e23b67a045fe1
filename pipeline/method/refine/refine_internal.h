/* pipeline/method/refine/refine_internal.h - private declarations of this folder. */
#ifndef SST_PIPELINE_METHOD_REFINE_REFINE_INTERNAL_H
#define SST_PIPELINE_METHOD_REFINE_REFINE_INTERNAL_H

#include "base/mem.h"
#include "pipeline/gpu/label.h"
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
    int *view;        /* those that are refined */
    const int *batch; /* of view: those that are refined at once */
    bool *done;       /* [views] on the device */
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

/** A view on the device, in planes: pipeline/gpu/label.h. */
struct refine_pixels {
    struct sst_gpu_buffer *buffer; /* NULL: not there */
    size_t bytes;
    bool colours, disparities, labels, entropies; /* are there, those of the light field */
    bool elected;                                 /* a vote's labels lie beside them, which are to become its labels */
    int64_t used;                                 /* turn in which it was used last */
};

/** A plane of a view of which the disparities alone are needed: a bit beside those of enum sst_gpu_label_plane. */
#define REFINE_DISPARITIES (1U << 3)

/** Memory on the device, kept from view to view. */
enum refine_kept {
    REFINE_KEPT_TABLE,
    REFINE_KEPT_GROUNDS, /* of the view in work */
    REFINE_KEPT_GROUND_SUMS,
    REFINE_KEPT_GROUND_MISSES,
    REFINE_KEPT_EXTENTS,
    REFINE_KEPT_SEEN,
    REFINE_KEPT_CHOICE,
    REFINE_KEPT_MASK,
    REFINE_KEPT_COLUMNS,
    REFINE_KEPT_HULL,
    REFINE_KEPT_SUMS, /* then the normals */
    REFINE_KEPT_PLANES,
    REFINE_KEPT_REGIONS,
    REFINE_KEPT_MEANS,
    REFINE_KEPT_COUNTS,
    REFINE_KEPT_OUT, /* also of votes and carried labels */
    REFINE_KEPT_FILLED,
    REFINE_KEPT_CELLS,
    REFINE_KEPT_PLACES,
    REFINE_KEPT_TABLES, /* of struct sst_label_result */
    REFINE_KEPT_BAND,   /* rows of a view that gets labels */
    REFINE_KEPT_FIRST,  /* and of those that it gets them from: SST_REFINE_VOTERS */
    REFINE_KEPT_SECOND,
    REFINE_KEPT_THIRD,
    REFINE_KEPT_FOURTH,
    REFINE_KEPT
};

struct sst_refine_device {
    struct sst_runner *shared;
    struct sst_runner_user user;
    struct sst_refine_device_report report;
    struct sst_mem_kept words, corners, extents, result; /* of the host */
    struct sst_mem_kept tables;                          /* what REFINE_KEPT_TABLES holds */
    size_t tables_bytes;                                 /* 0: nothing */
    /* under the lock of shared */
    struct sst_gpu *gpu; /* in work */
    struct sst_gpu_buffer *kept[REFINE_KEPT];
    size_t bytes[REFINE_KEPT];
    bool has_table;                           /* REFINE_KEPT_TABLE holds the candidates of this refinement */
    struct refine_pixels view[SST_MAX_VIEWS]; /* least recently used ones make room */
    int in_work;                              /* view that is refined */
    int rows;                                 /* of a band that it is refined in, in this stage; 0: of the whole view */
    int band_rows;                            /* the same of votes, carried labels and labels from cells */
    bool borrowed;                            /* from a network that runs: no other buffer is freed to make room */
    int64_t turn;                             /* of the view in work: views of this turn stay */
};

/** Begin a refinement, whose table of candidates is another one. */
void refine_device_start(struct sst_refine_device *d);

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

/** The same, but the lock of `shared` is still to be released: for work of several threads, which all count. */
bool refine_device_end_locked(struct sst_refine_device *d, int err, const char *what);

/* Between these two; the size of memory only grows, and what it held is then lost. */
SST_MUST_CHECK int refine_device_keep(struct sst_refine_device *d, enum refine_kept which, size_t bytes);
SST_MUST_CHECK int refine_device_download(struct sst_refine_device *d, enum refine_kept which, void *data,
                                          size_t bytes);

void refine_device_drop(struct sst_refine_device *d, enum refine_kept which);

/** Free all memory that a view needs only while it is in work, but results. @return whether there was any */
bool refine_device_drop_kept(struct sst_refine_device *d);

/* --- device_steps.c --- */

/** Refine a view; its labels change only if nothing fails. @return 0, or an error of the device */
SST_MUST_CHECK int refine_device_steps(struct sst_refine_device *d, const struct refine_job *job, int view);

/* --- device_count.c --- */

/** Pixels of all views that are refined by label and disparity. @param hist  out [classes][SST_DISP_BINS] @return
 * false: they are to be counted on the CPU; logged, noted */
bool refine_device_count(struct sst_refine_device *d, const struct refine_job *job, int64_t *hist);

/* --- device_ground.c --- */

/**
 * Fit the planes of the grounds of a view, which is there. They are in REFINE_KEPT_GROUNDS afterwards.
 * @param out  those that are planes; their limits are on the device alone
 */
SST_MUST_CHECK int refine_device_grounds(struct sst_refine_device *d, const struct refine_job *job, int view,
                                         struct refine_grounds *out);

/* --- device_views.c --- */

/**
 * Planes of a view on the device: what is not there is made of what stays of the matching, or uploaded. It stays for
 * this turn. What refine_device_keep() made for this turn, but results, may be lost.
 * @param planes     bits by enum sst_gpu_label_plane, and REFINE_DISPARITIES
 * @param entropies  of its labels, needed too; or NULL
 */
SST_MUST_CHECK int refine_device_view(struct sst_refine_device *d, const struct sst_lightfield *lf, int view,
                                      unsigned planes, const struct sst_map_f32 *entropies);

/** Room for a view of as many planes, if there is any; what it holds of fewer is lost. */
void refine_device_reserve(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, int planes);

/** What a step leaves of a view that is there becomes its labels. @param way  width and height are set here @param from
 * or NULL */
SST_MUST_CHECK int refine_device_keep_labels(struct sst_refine_device *d, const struct sst_lightfield *lf, int view,
                                             struct sst_gpu_label_keep way, struct sst_gpu_buffer *from);

/** Rows top .. end - 1 of a view's planes, in memory of this turn. @param planes, entropies  as above */
SST_MUST_CHECK int refine_device_rows(struct sst_refine_device *d, enum refine_kept which,
                                      const struct sst_lightfield *lf, int view, unsigned planes,
                                      const struct sst_map_f32 *entropies, int top, int end);

/** Free the view that was used least recently, but none of this turn. @return whether there was one */
bool refine_drop_oldest(struct sst_refine_device *d);

/** Free all of them, under the lock. */
void refine_drop_views(struct sst_refine_device *d);

/* --- device_cells.c --- */

/** The smallest float that is not below a number: what is below one is below the other. */
float refine_limit_of(double eps_h);

/* --- device_votes.c, device_carry.c --- */

/**
 * Views of a vote, or those that labels are carried from, as buffers of `vote`; a new turn. REFINE_KEPT_OUT is there.
 * @param shift  out [SST_GPU_VOTERS]
 * @return 0, -EOVERFLOW (views so far apart that numbers of 32 bits do not hold it), or an error of the device
 */
SST_MUST_CHECK int refine_device_voters(struct sst_refine_device *d, struct sst_gpu_work *work,
                                        struct sst_gpu_shift *shift, const struct sst_refine_carry *c);

/** @return 0, -EOVERFLOW: likewise */
SST_MUST_CHECK int refine_set_shift(struct sst_gpu_shift *out, const struct sst_refine_voter *v);

/* --- device_bands.c: where not all views fit that take part --- */

/** Votes, or carried labels. @param label, entropy, c  as of sst_refine_device_carry() @return as
 * refine_device_voters(); -ENOMEM: not even a row fits */
SST_MUST_CHECK int refine_device_exchange(struct sst_refine_device *d, struct sst_map_u8 *label,
                                          struct sst_map_f32 *entropy, const struct sst_refine_carry *c, bool vote);

/** Labels from cells. @param push  of the whole view */
SST_MUST_CHECK int refine_device_enlarge(struct sst_refine_device *d, struct sst_map_u8 *label,
                                         struct sst_map_f32 *entropy, const struct sst_refine_enlarge *e,
                                         const struct sst_label_cells *cells, const struct sst_gpu_label_cells *push);

/** Dispatch over all pixels of a view, in groups as large as the shader's. @param work  its groups are set */
SST_MUST_CHECK int refine_device_dispatch(struct sst_refine_device *d, struct sst_gpu_work *work, int width,
                                          int height);

/** Upload to memory that is made large enough. */
SST_MUST_CHECK int refine_device_upload(struct sst_refine_device *d, enum refine_kept which, const void *data,
                                        size_t bytes);

/** Download a word a pixel of a result, of which the lowest byte is written. */
SST_MUST_CHECK int refine_device_labels(struct sst_refine_device *d, enum refine_kept which, struct sst_map_u8 *out);

/** Likewise of REFINE_KEPT_OUT, with bits of floats in a second plane. */
SST_MUST_CHECK int refine_device_entropies(struct sst_refine_device *d, struct sst_map_u8 *label,
                                           struct sst_map_f32 *entropy);

#endif
