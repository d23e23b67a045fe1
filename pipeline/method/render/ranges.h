/* pipeline/method/render/ranges.h - disparity ranges of labels and objects, from exact histograms over all views. */
#ifndef SST_PIPELINE_METHOD_RENDER_RANGES_H
#define SST_PIPELINE_METHOD_RENDER_RANGES_H

#include "pipeline/method/render/render.h"

/** Counts of every stored disparity by label, all views together. */
struct sst_label_histogram {
    double disp_min_px;   /* disparity of bin 0 */
    int bins;             /* largest stored disparity + 1; 0: no pixel has a disparity */
    int first_bin;        /* smallest stored disparity */
    bool present[256];    /* label occurs, with or without a disparity */
    uint64_t *count[256]; /* [bins]; NULL: no pixel of this label has a disparity */
    uint64_t *memory;     /* owned: what count points into */
    int row;              /* capacity in bins of each of the 256 rows of memory */
};

/** @return 0 or -ENOMEM (not logged). The same counts for any number of threads. */
SST_MUST_CHECK int sst_render_histogram_init(struct sst_label_histogram *h, const struct sst_lightfield *lf,
                                             int threads);
void sst_render_histogram_fini(struct sst_label_histogram *h);

/**
 * Recount from some views and every step-th of their rows and columns: ranges describe the scene, which a few views
 * cover. Memory is reused between calls. A zeroed histogram is valid.
 *
 * @param view  in, [views] numbers of views; those without a disparity map are skipped
 * @return 0 or -ENOMEM (not logged; h is empty then)
 */
SST_MUST_CHECK int sst_render_histogram_recount(struct sst_label_histogram *h, const struct sst_lightfield *lf,
                                                const int *view, int views, int step);

/**
 * Range of bins first..end-1 without the fraction `cut` at each end: the smallest and the largest value with more than
 * cut * total values up to and from it. @return false where those bins are empty.
 */
bool sst_render_histogram_range(const uint64_t *count, int first, int end, double cut, int *min_bin, int *max_bin);

/**
 * Split a label's histogram into objects: intervals of columns (SST_BLEND_COLUMNS of 1/4 px) between two of which the
 * counts, smoothed over 1.25 px, fall below a fifth of both neighbours' peaks. An interval with less than 0.5 % of the
 * label's pixels is merged into the one below it.
 *
 * @param end  out, [SST_BLEND_COLUMNS], columns at which the objects end, ascending; the last is SST_BLEND_COLUMNS
 * @return the number of objects, at least 1
 */
int sst_render_histogram_objects(const uint64_t *count, int bins, int *end);

/**
 * Table of label weights for the kernels: W_s by cfg, including the focus label's factor. The last column is for
 * unknown disparity and uses the label's whole range. A label that does not occur has W_s = 1.
 * @param table  out, [256][SST_BLEND_COLUMNS]
 */
void sst_render_label_weight_table(float *table, const struct sst_label_histogram *h,
                                   const struct sst_render_config *cfg);

/** True if the table's weights of more than the fraction `share` of the pixels differ from those of h by more than the
 * fraction `tolerance`. */
bool sst_render_label_weight_differs(const float *table, const struct sst_label_histogram *h,
                                     const struct sst_render_config *cfg, double tolerance, double share);

#endif
