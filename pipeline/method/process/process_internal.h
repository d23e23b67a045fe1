/* pipeline/method/process/process_internal.h - labels carried from key views to the others, and voted on. */
#ifndef SST_PIPELINE_METHOD_PROCESS_PROCESS_INTERNAL_H
#define SST_PIPELINE_METHOD_PROCESS_PROCESS_INTERNAL_H

#include "pipeline/lightfield/lightfield.h"
#include "pipeline/method/refine/refine.h"

struct sst_share;

/** Labels carried from key views to others. */
struct process_carry {
    struct sst_lightfield *lf; /* disparities of all present views, labels of the key views */
    const bool *carried;       /* [views] the others */
    struct sst_share *share;   /* with other processes, by views; or NULL */
    int threads;
    struct sst_refine_device *device; /* with the same bytes; or NULL */
    struct sst_map_u8 *source; /* [views], zeroed, the caller's: filled by the first process_carry_labels(), for later
                                  ones of the same disparities; it frees the maps. NULL: not kept */
};

/**
 * Give the carried views the labels of the key views: each pixel gets that of the place where its disparity puts
 * it, in the nearest of four key views that shows the same surface (disparity within a pixel, colours alike) and has a
 * label there; else none. views[].label of them is made here.
 *
 * @param entropy  [views] of the labels, made here for the carried views, infinite where they have none; or NULL
 * @param fill     then the pixels without a label get that of the labelled pixel to their left or right whose disparity
 *                 is nearer to theirs, those that are not valid none; entropy is NULL
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int process_carry_labels(const struct process_carry *c, struct sst_map_f32 *entropy, bool fill);

/** Percent of a key view's labels that differ from those that the other key views carry to it, where there are both.
 *  NaN: none to compare. */
SST_MUST_CHECK int process_carry_error(const struct process_carry *c, int view, double *percent);

/** Share of a view's pixels whose surfaces its sources among the key views show: what could be carried to it. */
SST_MUST_CHECK int process_carry_shown(const struct process_carry *c, int view, double *share);

/**
 * Let the views vote about the label of every surface: each pixel gets the label that most of its own view and the
 * nearest four others see there (disparity within a pixel, colours alike). Its own counts where as many see it as
 * another; one without a label gets that of the others.
 *
 * @param skip    [views] these neither vote nor change; NULL: none
 * @param share   with other processes, by views; or NULL
 * @param device  that counts the votes of the views, or NULL
 * @return 0, -ENOMEM; then nothing has changed. The same bytes for any number of threads, and on every device.
 */
SST_MUST_CHECK int process_vote_labels(struct sst_lightfield *lf, const bool *skip, struct sst_share *share,
                                       int threads, struct sst_refine_device *device);

#endif
