/* pipeline/method/render/plan.h - prepares one picture for rendering: shifts and weights of views, disparity ranges. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_PLAN_H
#define SST_PIPELINE_METHOD_RENDER_PLAN_H

#include <pthread.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/rectify/rectify.h"
#include "pipeline/method/render/render.h"

/** A ray this near to the focus, in sigma_d, ends at it: its depth weight above the floor is at least exp(-2). */
#define SST_END_SIGMAS 2.0

/* --- ranges.c: disparity ranges of labels and objects, from exact histograms over all views --- */

/** Counts of every stored disparity by label, all views together. */
struct sst_label_histogram {
    double disp_min_px;   /* disparity of bin 0 */
    int bins;             /* largest stored disparity + 1; 0: no pixel has a disparity */
    int first_bin;        /* smallest stored disparity */
    bool present[256];    /* label occurs, with or without a disparity */
    uint64_t *count[256]; /* [bins]; NULL: no pixel of this label has a disparity */
    uint64_t *memory;     /* owned: what count points into */
    int row;              /* capacity in bins of each of 256 rows of memory; 0: rows of labels that occur alone */
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

/** Columns first..last of the label weights; none if first > last. */
struct sst_columns {
    int first, last;
};

/**
 * Label weights for the kernels: W_s by cfg, including the focus label's factor. The last column is for unknown
 * disparity and uses the label's whole range. A label that does not occur has W_s = 1.
 *
 * @param table   out, up to [257][SST_BLEND_COLUMNS]: rows that `labels` refers to, one for all labels that do not occur
 * @param labels  out
 * @param within  out, [256] columns of known disparity in which the focus is within the range of the object, i.e. W_s
 *                exceeds its floor. They are contiguous, since the ranges of a label's objects ascend and all have the
 *                same margin. All columns where C2 is 1, or the label has no range.
 */
void sst_render_label_weights(float *table, struct sst_blend_labels *labels, struct sst_columns *within,
                              const struct sst_label_histogram *h, const struct sst_render_config *cfg);

/** True if the weights of more than the fraction `share` of the pixels differ from those of h by more than the fraction
 * `tolerance`. */
bool sst_render_label_weights_differ(const struct sst_blend_range *range, const struct sst_label_histogram *h,
                                     const struct sst_render_config *cfg, double tolerance, double share);

/* --- plan.c --- */

struct sst_verifier; /* verify.h */
struct explainer;    /* render_internal.h */
struct render_runner;
struct landed; /* landed.c */

/** Sums over pictures, see struct sst_render_skip_report. */
struct sst_skip_counts {
    int64_t pictures, rays, skipped, even;
    int64_t sampled, error2; /* pixels; squares of the differences of their three colours */
};

struct sst_renderer {
    /* fixed after create */
    const struct sst_lightfield *lf;
    int threads;
    struct render_runner *runner; /* that places pictures; NULL: threads render them. Owned; fixed while they do */
    /* under lock until computed, then fixed except for sst_renderer_recount() */
    pthread_mutex_t lock;
    bool counted;
    struct sst_label_histogram histogram;
    uint8_t rarity[SST_AGREE_BINS]; /* of colours, see verify.h */
    struct landed *landed;          /* rays of the last clear picture, for the next one; NULL while one is rendered */
    uint64_t series;                /* of clear pictures that continue each other */
    struct sst_skip_counts skips;
    struct sst_view *rectified; /* [rows * cols] what rays are of, with sst_renderer_use_rectified(); images are
                                   borrowed from raw, empty until the CPU needs them. NULL: frames are sampled */
    struct sst_raw_view *raw; /* [rows * cols] of a light field of raw frames or with originals, else NULL; each created
                                 on first use */
    SST_ATOMIC(uint8_t) * explained; /* see explainer_keep(); NULL until needed */
    uint64_t explained_key;
    int explained_levels;
};

/** A raw frame, or what a corrected picture was resampled from, and its mapping to rectified positions. */
struct sst_raw_view {
    struct sst_rectify_map *map;
    struct sst_sampler *sampler; /* NULL until the CPU needs it */
    struct sst_image rectified;  /* with seen, its valid pixels: empty until the CPU needs it */
    struct sst_map_u8 seen;
};

/**
 * One view of the aperture. Output pixel (x, y) with x0 <= x < x1, y0 <= y < y1 takes its colour between columns
 * x + ix, x + ix + 1 at fx (rows likewise) and its disparity and label at (x + nx, y + ny).
 */
struct sst_render_tap {
    int view;
    const struct sst_view *v;
    const struct sst_raw_view *frame;  /* source of its pixels in shaders; NULL: v's image */
    const struct sst_sampler *sampler; /* of frames, at (x + ix + fx, y + iy + fy); NULL: v's image is the view */
    int ix, iy, nx, ny;
    double fx, fy; /* 0, or at least 1e-6 from 0 and 1 */
    int x0, x1, y0, y1;
    double aperture;
};

/** True if all colour taps of output pixel (x, y), inside t's bounds, are valid in the view. Not for raw frames. */
static inline bool sst_render_tap_sees(const struct sst_render_tap *t, int x, int y)
{
    const uint8_t *top, *bottom;

    if (!t->v->valid.data)
        return true;
    top = sst_map_u8_row(&t->v->valid, y + t->iy) + x + t->ix;
    bottom = t->fy > 0 ? top + t->v->valid.stride : top;
    return top[0] && bottom[0] && (!(t->fx > 0) || (top[1] && bottom[1]));
}

/** Numbers that rays are verified with. */
struct sst_verify_numbers {
    float all;                /* sum of all apertures */
    float scale, most;        /* as in struct sst_voting */
    int nearest, nearest_end; /* largest stored disparities that do not end in front: of rays that make an occluder, and
                                 of those that are explained or not */
};

struct sst_render_plan {
    const struct sst_lightfield *lf;
    struct sst_render_config cfg;
    bool weighted; /* false: rays have aperture weights only, plain refocusing */
    bool summed;   /* ... which are all 1 */
    bool sampled;  /* colours are sampled from frames, where there are any, at the rays; else from rectified views */
    bool pending;  /* samplers or rectified views are not there yet: see render_need_frames() */
    int count;
    struct sst_render_tap tap[SST_MAX_VIEWS]; /* in view order: the order of summation */
    struct sst_blend blend;                   /* shared by all rows */
    float *table;                             /* owned; rows of label weights; NULL: they are all 1 */
    size_t table_rows;             /* that labels use: labels without a range share rows; 1 without a table */
    struct sst_blend_labels *labels; /* owned; NULL without a table */
    uint32_t ends[256];            /* rays that end at the focus, see sst_blend_support_fn; if weighted */
    /* for verification; only one caller at a time may render from a plan */
    int verifiers;
    struct sst_verifier **verifier; /* [verifiers], one per thread, owned; NULL: rays are not verified */
    struct sst_verify_numbers numbers;
    uint8_t *rarity;             /* [SST_AGREE_BINS] owned */
    struct explainer *explainer; /* owned; NULL: all rays vote */
    bool votes_only; /* the maps assign nothing to the focus: pixels without agreement are undefined */
    struct sst_map_u8 *agreed;   /* out, borrowed: how surely a rendered pixel shows the surface in focus, 0..255: share
                                    of its rays by the maps, or where votes replaced it share of all possible votes, times
                                    24; NULL: not wanted */
};

/** Output arrays for the rays of one view; they begin at the first requested pixel. */
struct sst_render_samples {
    uint8_t *colour[3];
    float *weight;
};

/** Sample the rays of a tap for output pixels x .. x+n-1 of row y, n at most SST_BLEND_MAX; elements without a ray are
 * not written. For plans with weights only. */
void sst_render_plan_sample(const struct sst_render_samples *to, const struct sst_render_plan *p,
                            const struct sst_render_tap *t, int x, int n, int y);

/** @return 0, -EINVAL, -ERANGE, -ENODATA, -ENOMEM; logged. */
SST_MUST_CHECK int sst_render_plan_init(struct sst_render_plan *p, struct sst_renderer *r,
                                        const struct sst_render_config *cfg);
void sst_render_plan_fini(struct sst_render_plan *p);

/* Sides of the cells that select parts of a picture, px: narrow runs cost more per pixel. */
#define SST_RENDER_CELL_WIDTH  64
#define SST_RENDER_CELL_HEIGHT 8

/**
 * Render a picture or a part of it, with the same bytes as in the whole picture.
 *
 * The plan stays valid while pixels of images and maps change, as long as views are neither added nor removed.
 * @param cells  [rows][cols], not 0: render this cell, other pixels are not written; NULL: all
 * @param out    of the light field's size
 * @param valid  likewise, or NULL, which saves the time to count support unless unsupported pixels are marked
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_render_plan_render(const struct sst_render_plan *p, const uint8_t *cells, struct sst_image *out,
                                          struct sst_map_u8 *valid);

/**
 * The same where the renderer's runner places it; without one a whole picture has the skips of the plan's
 * configuration. The maps may have changed since the last one.
 * @param cells  1: render this cell; NULL: all
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_render_plan_render_live(struct sst_renderer *r, const struct sst_render_plan *p,
                                               const uint8_t *cells, struct sst_image *out);

/**
 * Apply the renderer's new counts, if they change the weights of more than the fraction `share` of the rays by more
 * than the fraction `tolerance`, or the rarities of colours by that fraction.
 * @return true: applied, and the whole picture must be rendered; false: the plan is unchanged
 */
bool sst_render_plan_update(struct sst_render_plan *p, const struct sst_renderer *r, double tolerance, double share);

/** Recount disparities and labels with sst_render_histogram_recount(); no picture may be rendered meanwhile.
 *  @return 0 or -ENOMEM (logged) */
SST_MUST_CHECK int sst_renderer_recount(struct sst_renderer *r, const int *view, int views, int step);

/** W_s of a stored disparity and label. */
double sst_render_plan_label_weight(const struct sst_render_plan *p, int label, uint16_t disp_q6);

/** Count the histogram on the first call. @return 0 or -ENOMEM (logged). */
SST_MUST_CHECK int sst_renderer_count(struct sst_renderer *r);

/** One output pixel in double, weights from their logarithms: the plain refocus value if all are exactly 0, black
 *  without rays. @param rays  out, [SST_MAX_VIEWS] @return their number */
int sst_render_pixel_exact(const struct sst_render_plan *p, int x, int y, double rgb[3], struct sst_ray *rays);

#endif
