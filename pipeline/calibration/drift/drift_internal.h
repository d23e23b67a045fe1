/* pipeline/calibration/drift/drift_internal.h - features, matches and camera states of the drift check; callers use the
 * public header. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_DRIFT_DRIFT_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_DRIFT_DRIFT_INTERNAL_H

#include "pipeline/calibration/drift/drift.h"

#define DRIFT_LEVELS        10
#define DRIFT_SMALLEST      64 /* shorter side of a picture, px */
#define DRIFT_CELLS_X       16 /* one feature at most per cell of the picture */
#define DRIFT_CELLS_Y       12
#define DRIFT_CELLS         (DRIFT_CELLS_X * DRIFT_CELLS_Y)
#define DRIFT_SPLIT         2 /* a cell offers the best place of each of its 2 x 2 parts */
#define DRIFT_FEATURES      (DRIFT_CELLS * DRIFT_SPLIT * DRIFT_SPLIT)

/* --- drift_features.c: grey pyramids and features ----------------------------------------------------------------- */

struct drift_feature {
    int x, y; /* px */
};

/** A view's grey values at half size, quarter size ...; level 0 is the picture itself and is not copied. */
struct drift_pyramid {
    const struct sst_image *image;
    int levels;                            /* level 0 among them */
    struct sst_map_u8 level[DRIFT_LEVELS]; /* [0] is empty */
    double noise;                          /* of level 1, RMS in grey levels */
    int first[DRIFT_CELLS + 1]; /* features of a cell: first[cell] .. first[cell + 1] - 1, the best textured first */
    struct drift_feature feature[DRIFT_FEATURES];
};

/**
 * Halve until the longer side is at most `side`; find features.
 * @param valid  0: no picture there, and no features near; may be empty
 * @return 0, -ENOMEM, -EBADMSG (too small; not logged)
 */
SST_MUST_CHECK int drift_pyramid_init(struct drift_pyramid *view, const struct sst_image *image,
                                      const struct sst_map_u8 *valid, int side);
void drift_pyramid_fini(struct drift_pyramid *view);

/** Where level 0's pixel x is on another level, rounded: (x - (2^level - 1) / 2) / 2^level. */
int drift_to_level(int x, int level);

/** Grey values of a rectangle of a level: (R + 2 G + B) / 4 at level 0, rounded. @param out  [height][width] */
void drift_read_grey(int16_t *out, const struct drift_pyramid *view, int level, struct sst_rect part);

/** Size of a level. */
void drift_level_size(const struct drift_pyramid *view, int level, int *width, int *height);

/**
 * Grey values of a rectangle of a level, smoothed by the binomial filter 1 4 6 4 1 both ways.
 * @param out  [height][width]
 * @return false: the rectangle with the two pixels around it is not inside the picture
 */
SST_MUST_CHECK bool drift_read_patch(float *out, const struct drift_pyramid *view, int level, struct sst_rect part);

/* --- drift_search.c, drift_align.c: a feature in another view ----------------------------------------------------- */

/* Matches with a larger misfit are dropped: their error is about its root, px. */
#define DRIFT_MISFIT       0.003
#define DRIFT_MISFIT_LOOSE 0.03 /* in foliage ten times as many */
/* Variance of the difference of two smoothed windows by noise of 1 at half size (where it is measured): white at full
 * size it is twice that, then (70 / 256)^2, twice: 0.6; the rest is for noise that is not white. */
#define DRIFT_NOISE_SHARE 1.3

enum drift_outcome {
    DRIFT_FOUND = 0,
    DRIFT_OUTSIDE = 1,   /* would be outside of the other picture, or too near its edge */
    DRIFT_AMBIGUOUS = 2, /* fits at several places */
    DRIFT_NOWHERE = 3,   /* fits nowhere, or not both ways */
};

/** Search range, px of level 0: along the line from `from_px` to `to_px` (disparity times -1 times the offset's
 *  length), across it from -band_px to band_px about across_px. */
struct drift_search {
    double u[2]; /* unit vector along the line, from a's centre to b's */
    double n[2]; /* across it; its larger component is positive */
    double from_px, to_px, across_px, band_px;
    double noise; /* grey levels at half size, RMS: misfit within it does not count */
    bool loose;   /* DRIFT_MISFIT_LOOSE */
};

/** Two views: features of the first are searched in the second. */
struct drift_views {
    const struct drift_pyramid *a, *b;
    const struct drift_search *s;
};

struct drift_match {
    enum drift_outcome outcome;
    double dx, dy;        /* place in b less place in a, px */
    double along, across; /* dx, dy along u and n */
    bool small;           /* window */
    double residual;      /* variance of the windows' difference, grey levels^2 */
    double energy;        /* of the window itself */
    double inverse[2];    /* of the structure tensor, along and across: variance for noise of 1, (px / grey level)^2 */
    double misfit;        /* 1 - correlation of both windows, less the share of noise */
    double var_along, var_across; /* px^2, by the noise of the fit; each with the other unknown */
};

/** Coarse search on one level: px of level 0, good to about half a pixel of its level. */
void drift_search_match(struct drift_match *out, const struct drift_views *v, const struct drift_feature *f, int level);

/**
 * From dx, dy of *m, good to two pixels of `level`, to sub-pixel ones at level 0, forth and back.
 * Sets all of *m.
 */
void drift_refine_match(struct drift_match *m, const struct drift_views *v, const struct drift_feature *f, int level);

/** Set outcome, misfit and variances of a match from its residual and the noise. */
void drift_weigh_match(struct drift_match *m, const struct drift_search *s);

/* --- drift_pairs.c: the matches of all pairs ---------------------------------------------------------------------- */

struct drift_link {
    int a, b;
    double length;         /* spacings between the centres */
    struct drift_search s; /* as searched */
    enum sst_drift_pair_state state;
    int features, matches;
    double median_px, spread_px;       /* of across over all matches: median, robust sigma about it */
    double mean_px, rms_px, p95_px;    /* of across over the used ones; p95 of the magnitude; 0 without any */
    struct drift_match m[DRIFT_CELLS]; /* by cell of a */
    int feature[DRIFT_CELLS];          /* of a, which m is about */
    bool used[DRIFT_CELLS];            /* matched, and no outlier among the pair's */
};

enum drift_stage {
    DRIFT_WHOLE = 0,
    DRIFT_FIRST = 1,  /* a part of the cells, where they are if nothing is displaced */
    DRIFT_CLOSER = 2, /* some of these that DRIFT_FIRST did not find, at full size */
};

/** State of one check. */
struct drift_work {
    const struct sst_lightfield *lf;
    struct sst_drift_config cfg; /* defaults filled in */
    int views;                   /* rows * cols */
    struct drift_pyramid *view;  /* [views]; absent ones are empty */
    double (*offset)[2];         /* [views] spacings */
    int links;
    struct drift_link *link; /* [links] */
    enum drift_stage stage;
    double range[2];         /* disparities, px per spacing */
    double noise_factor;     /* of the views' noise, that is not texture */
};

/** Links of every present view with the next ones to the right and below. @return 0, -ENOMEM */
SST_MUST_CHECK int drift_make_links(struct drift_work *w);

/** Find the disparity range (unless the light field has one) and every link's coarse position, then all matches.
 *  @param only  links to do, by index, or NULL: all */
SST_MUST_CHECK int drift_match_links(struct drift_work *w, const bool *only);

/** Link of two views as if they were neighbours. */
void drift_link_set(struct drift_link *link, const struct drift_work *w, int a, int b);

/** Count matches, drop outliers, set state. */
void drift_link_judge(struct drift_link *link, int min_matches);

/** Whether its matches are more than chance. */
bool drift_link_useful(const struct drift_link *link);

/** Whether the pair is lost, or measured with a large error. */
bool drift_link_bad(const struct drift_link *link, double unusable_px);

/* --- drift_far.c: consistency beyond neighbours ------------------------------------------------------------------- */

/** Disparity along p less that along q, links of one view, of the feature in cell k; px per spacing.
 *  @return false: not both have it */
SST_MUST_CHECK bool drift_disparity_difference(double *out, const struct drift_link *p, const struct drift_link *q,
                                               int k);

/** The link that begins at the same view as `index` and is useful too (then index is the one to the right). */
const struct drift_link *drift_other_link(const struct drift_work *w, int index);

/** Median of the magnitude of two disparities' difference, NAN without any. @return 0, -ENOMEM */
SST_MUST_CHECK int drift_measure_axes(const struct drift_work *w, double *axes_px);

/** The corner-to-corner figures. */
SST_MUST_CHECK int drift_measure_corner_pairs(struct sst_drift *out, struct drift_work *w);

/* --- drift_cameras.c: camera displacements from matches ----------------------------------------------------------- */

/** Fill contradiction_px, rough_px and camera[views], all but residual_px, drifted and lost. @return 0, -ENOMEM */
SST_MUST_CHECK int drift_solve_cameras(struct sst_drift *out, const struct drift_work *w);

/* Least variance of the offsets along which shifts were seen, spacings^2, for shifts in proportion to them to be
 * distinguishable from others: a row sees vertical shifts, but its cameras hardly differ in height. */
#define DRIFT_SPREAD 0.05

/** Subtract the unobservable part of the cameras' states (drift_gauge.c): the common shift, one in proportion to the
 *  offsets, the medians of roll and scale. NAN stays. */
void drift_fix_gauge(struct sst_drift_camera *camera, const struct drift_work *w);

/* --- drift_light.c: gains ----------------------------------------------------------------------------------------- */

/** Fill light_scale, and the members about light of out->camera[views]. @return 0, -ENOMEM */
SST_MUST_CHECK int drift_solve_gains(struct sst_drift *out, const struct drift_work *w);

/* --- drift_order.c: swapped views --------------------------------------------------------------------------------- */

/** Find two swapped views or a mirrored or transposed grid that explain the bad pairs. Sets swapped_a, swapped_b, or
 *  describes the wrong order of the grid in `order` (else ""). */
SST_MUST_CHECK int drift_find_wrong_order(struct sst_drift *out, const struct drift_work *w, char order[128]);

#endif
