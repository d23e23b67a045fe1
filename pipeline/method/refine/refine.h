/* pipeline/method/refine/refine.h - labels the unlabeled rays by their disparity (paper: disparity-guided
 * refinement). */
#ifndef SST_PIPELINE_METHOD_REFINE_REFINE_H
#define SST_PIPELINE_METHOD_REFINE_REFINE_H

#include "pipeline/lightfield/lightfield.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/step/runner.h"

struct sst_refine_device; /* that views are refined on; one refinement at a time */

struct sst_share;

struct sst_refine_config {
    double eps_d;                /* density threshold eps_D, 1/px: a label is a candidate where g_i(D) > eps_d */
    double matcher_sigma_px;     /* noise of the disparities: floor of the fitted spread */
    int min_pixels;              /* labels with fewer confident pixels (all views together) are ignored */
    double p_normal, p_distance; /* weights p_n, p_d of the energy */
    double tau;        /* of the normal consistency, in inner products per pixel of the region (see parts.h); > 0 */
    int normal_window; /* side of the window that normals are fitted in; odd, 21..127 */
    bool ground_plane; /* a ground that is a plane in a view is a candidate only for pixels on that plane (not in the
                          paper) */
    const bool *skip;  /* [views] these take no part and stay as they are; NULL: none */
    int threads;       /* 0: all processors */
    const SST_ATOMIC(bool) * cancel;  /* once true, processing stops within one view; or NULL */
    struct sst_refine_device *device; /* with the same bytes; NULL: on the CPU */
    struct sst_share *share;          /* with other processes (pipeline/lightfield/share.h), by views; or NULL */
};

void sst_refine_config_defaults(struct sst_refine_config *cfg);

/** The normal distribution of one label's disparities (robust, see parts.h). */
struct sst_label_fit {
    int64_t count; /* confident pixels */
    double mean_px, sigma_px;
    bool usable;
};

/**
 * Refine views[].label in place: HCSM in (0 = unlabeled), labels with the gaps filled out. Needs disp of every present
 * view.
 *
 * Distributions come from the confident pixels of all views, the regions of the energy from those of the same view.
 * An unlabeled pixel without a candidate or a disparity stays unlabeled; a single candidate is assigned. Among several,
 * objects compete by E_d alone, and so do grounds; the best object and the best ground then compete by E = p_n E_n +
 * p_d E_d, because normals only distinguish a ground from objects on it. Ties go to the smaller label. A candidate that
 * is absent from the view's HCSM has E_d = 1; where one of the two has no normals (absent, foliage), E_n is left out.
 * Source: design.md, 5.3.
 *
 * @param fits  out, lf->classes.count entries, or NULL
 * @return 0, -EINVAL (maps missing), -ENOMEM; logged; -ECANCELED, not logged.  The same bytes for any number of
 * threads.
 */
SST_MUST_CHECK int sst_refine_labels(struct sst_lightfield *lf, const struct sst_refine_config *cfg,
                                     struct sst_label_fit *fits);

/** What is done on the CPU although there is a device: it failed. Views that are refined there are `on_cpu`. */
enum sst_refine_stage {
    SST_REFINE_STAGE_ENTROPY = 0, /* labels and entropies of pixels from those of the network's cells, the threshold */
    SST_REFINE_STAGE_DISPARITY = 1, /* pixels counted for the distributions of the labels' disparities */
    SST_REFINE_STAGE_CARRY = 2,     /* labels carried to other views */
    SST_REFINE_STAGES
};

const char *sst_refine_stage_name(enum sst_refine_stage stage);

/** What a device has done. */
struct sst_refine_device_report {
    char name[SST_GPU_NAME], driver[SST_GPU_NAME];
    int64_t views;                                               /* refined there */
    int64_t in_parts;                                            /* of them: in bands of rows */
    int64_t on_cpu;                                              /* others */
    int64_t enlarged, enlarged_on_cpu;                           /* whose labels were found from the network's cells */
    int64_t finished;                                            /* of them: whose cells never left the device */
    int64_t voted, voted_on_cpu;                                 /* whose pixels other views voted on */
    int64_t carried, carried_on_cpu;                             /* that labels were carried to, once each time */
    int64_t enlarged_in_parts, voted_in_parts, carried_in_parts; /* of them: in bands of rows */
    int64_t failures;                                            /* times that the device failed */
    char why[128];                                               /* the last that something was on the CPU */
    unsigned stages_on_cpu; /* bits by enum sst_refine_stage: those that were needed */
    int64_t dispatches, uploads, upload_bytes;
    int64_t total_ns, upload_ns, wait_ns, download_ns; /* of views; wait_ns: until the device has computed them */
};

/**
 * Refine labels on a device: grounds, candidates, distances, planes, normals, energies and labels of a view. The
 * results are the bytes of the CPU, which makes distributions, planes and corners of hulls from what the device counts
 * and sums up. A device that fails is logged as a warning and counted; the view is then refined on the CPU, and the
 * device is tried again later.
 *
 * @param shared  the device, which lives longer; NULL: *out is NULL
 * @return 0, -ENOMEM, or an error of sst_runner_join(); logged
 */
SST_MUST_CHECK int sst_refine_device_create(struct sst_refine_device **out, struct sst_runner *shared);
void sst_refine_device_destroy(struct sst_refine_device *d);

/** A view that votes about the labels of another one, or that they are carried from. */
struct sst_refine_voter {
    int view;
    struct sst_shift across, down; /* from that view's pixels to the voter's */
};

#define SST_REFINE_VOTERS  4
#define SST_REFINE_SOURCES 8

/**
 * Begin a stage: what did not fit is tried again.
 * @param d  or NULL
 */
void sst_refine_device_next_stage(struct sst_refine_device *d);

/** The labels of a view, or their entropies, change on the CPU: they are uploaded when they are needed next. What the
 * functions below leave on the device are its labels without that. @param d  or NULL */
void sst_refine_device_changed(struct sst_refine_device *d, int view);

/** Labels of all views whose entropies are not below a limit are dropped, as sst_hcsm() does on the CPU. @param d  or
 * NULL */
void sst_refine_device_threshold(struct sst_refine_device *d, const struct sst_lightfield *lf, double eps_h);

/** Free all views: after the last stage of a light field, before another one. @param d  or NULL */
void sst_refine_device_forget(struct sst_refine_device *d);

/**
 * The labels of a view after the vote, see process_vote_labels(); the light field stays as it is.
 *
 * @param voters  the nearest first; at most SST_REFINE_VOTERS
 * @param out     out, of the view's size
 * @return false: it is to be done on the CPU; logged, noted
 */
bool sst_refine_device_vote(struct sst_refine_device *d, struct sst_map_u8 *out, const struct sst_lightfield *lf,
                            int view, const struct sst_refine_voter *voters, int count);

/** All views have voted, and what a view's pixels got is its labels from now on. @param d  or NULL */
void sst_refine_device_take_vote(struct sst_refine_device *d, const struct sst_lightfield *lf, int view);

struct sst_label_cells;

/** A view whose labels are brought to its size. */
struct sst_refine_enlarge {
    struct sst_refine_device *device;
    const struct sst_lightfield *lf;
    int view;
};

/** A sst_label_enlarge_fn (pipeline/method/labels/labels.h) with the bytes of the CPU. Thread: any number, one after
 * the other. @param arg  struct sst_refine_enlarge @return false: it is to be done on the CPU; logged, noted */
bool sst_refine_device_enlarge(void *arg, const struct sst_label_cells *cells, struct sst_map_u8 *label,
                               struct sst_map_f32 *entropy, double eps_h);

struct sst_gpu;
struct sst_gpu_buffer;
struct sst_label_result;

/** A sst_label_feed_fn: the colours of the view are uploaded unless they are there. */
bool sst_refine_device_feed(void *arg, struct sst_gpu *g, struct sst_gpu_buffer *to, size_t at,
                            const struct sst_label_result *result, bool entropies);

/** A sst_label_finish_fn, likewise: false also where the device is not this one, or lacks room. */
bool sst_refine_device_finish(void *arg, struct sst_gpu *g, struct sst_gpu_buffer *from, size_t at,
                              const struct sst_label_result *result, struct sst_map_u8 *label,
                              struct sst_map_f32 *entropy, double eps_h);

/** Labels carried to a view. */
struct sst_refine_carry {
    const struct sst_lightfield *lf;
    int view;
    const struct sst_refine_voter *sources; /* the nearest first; at most SST_REFINE_SOURCES */
    int count;
    const struct sst_map_f32 *entropies; /* [views] of the sources, which are carried too; or NULL */
    bool fill;                           /* then what has no label gets one, see process_fill_labels() */
};

/**
 * See process_carry_labels(); the light field stays as it is.
 *
 * @param label    out, of the view's size
 * @param entropy  out, likewise; NULL: c->entropies is NULL
 * @return false: it is to be done on the CPU; logged, noted
 */
bool sst_refine_device_carry(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                             const struct sst_refine_carry *c);

/** Note that a stage was done on the CPU. @param d  or NULL: nothing is noted */
void sst_refine_device_note_stage(struct sst_refine_device *d, enum sst_refine_stage stage);

/** What it has done since the last report. */
void sst_refine_device_report(struct sst_refine_device *d, struct sst_refine_device_report *out);

#endif
