/* pipeline/calibration/drift/drift_internal.h - the pieces of the check; code outside pipeline/camera uses check.h. */
#ifndef SST_PIPELINE_CALIBRATION_DRIFT_DRIFT_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_DRIFT_DRIFT_INTERNAL_H

#include "pipeline/calibration/drift/check.h"

#define SST_CHECK_LEVELS   10
#define SST_CHECK_CELLS_X  16 /* one feature at most per cell of the picture */
#define SST_CHECK_CELLS_Y  12
#define SST_CHECK_CELLS    (SST_CHECK_CELLS_X * SST_CHECK_CELLS_Y)
#define SST_CHECK_SPLIT    2 /* a cell offers the best place of each of its 2 x 2 parts */
#define SST_CHECK_FEATURES (SST_CHECK_CELLS * SST_CHECK_SPLIT * SST_CHECK_SPLIT)

/* --- check_grey.c: grey pyramids and features --------------------------------------------------------------------- */

struct check_feature {
    int x, y; /* px */
};

/** A view's grey values at half size, quarter size ...; level 0 is the picture itself and is not copied. */
struct check_view {
    const struct sst_image *image;
    int levels;                                /* level 0 among them */
    struct sst_map_u8 level[SST_CHECK_LEVELS]; /* [0] is empty */
    double noise;                              /* of level 1, RMS in grey levels */
    int first[SST_CHECK_CELLS +
              1]; /* features of a cell: first[cell] .. first[cell + 1] - 1, the best textured first */
    struct check_feature feature[SST_CHECK_FEATURES];
};

/**
 * Halve until the longer side is at most `side`; find features.
 * @param valid  0: no picture there, and no features near; may be empty
 * @return 0, -ENOMEM, -EBADMSG (too small; not logged)
 */
SST_MUST_CHECK int check_view_init(struct check_view *view, const struct sst_image *image,
                                   const struct sst_map_u8 *valid, int side);
void check_view_fini(struct check_view *view);

/** Where level 0's pixel x is on another level, rounded: (x - (2^level - 1) / 2) / 2^level. */
int check_to_level(int x, int level);

/** Grey values of a row: (R + 2 G + B) / 4 at level 0, rounded. */
void check_grey_row(uint8_t *out, const struct check_view *view, int level, int x0, int y, int n);

/** Size of a level. */
void check_level_size(const struct check_view *view, int level, int *width, int *height);

/**
 * Grey values of a rectangle of a level, smoothed by the binomial filter 1 4 6 4 1 both ways.
 * @param out  [height][width]
 * @return false: the rectangle with the two pixels around it is not inside the picture
 */
SST_MUST_CHECK bool check_patch(float *out, const struct check_view *view, int level, int x0, int y0, int width,
                                int height);

/* --- check_search.c, check_align.c: where a feature is in another view ---------------------------------------------
 */

/* Matches with a larger misfit are no good: their error is about the root of it, px. */
#define SST_CHECK_MISFIT 0.003
/* What noise of 1 at half size (where it is measured) is in the difference of two smoothed windows, variance: white at
 * full size it is twice that, then (70 / 256)^2, twice: 0.6; the rest is for what is not white. */
#define SST_CHECK_NOISE_SHARE 1.3

enum check_outcome {
    SST_CHECK_MATCHED = 0,
    SST_CHECK_OUTSIDE = 1,   /* would be outside of the other picture, or too near its edge */
    SST_CHECK_AMBIGUOUS = 2, /* fits at several places */
    SST_CHECK_NOWHERE = 3,   /* fits nowhere, or not both ways */
};

/** Where to look, in px of level 0: along the line from `from_px` to `to_px` (disparity times -1 times the offset's
 *  length), across it from -band_px to band_px about cross_px. */
struct check_search {
    double u[2]; /* unit vector along the line, from a's centre to b's */
    double n[2]; /* across it; its larger component is positive */
    double from_px, to_px, cross_px, band_px;
    double noise; /* grey levels at half size, RMS: misfit that it explains does not count */
};

struct check_match {
    enum check_outcome outcome;
    double dx, dy;       /* place in b less place in a, px */
    double along, cross; /* the same along u and n */
    bool small;          /* window */
    double residual;     /* variance of the windows' difference, grey levels^2 */
    double energy;       /* of the window itself */
    double inverse[2];   /* of the structure tensor, along and across: variance for noise of 1, (px / grey level)^2 */
    double misfit;       /* 1 - correlation of both windows, less what noise makes of it */
    double var_along, var_cross; /* px^2, by the noise of the fit; each with the other unknown */
};

/** Coarse search on one level: px of level 0, good to about half a pixel of that level. */
void check_search(struct check_match *out, const struct check_view *a, const struct check_view *b,
                  const struct check_feature *f, const struct check_search *s, int level);

/**
 * From dx, dy of *m, good to two pixels of `level`, to sub-pixel ones at level 0, forth and back.
 * Sets all of *m.
 */
void check_refine(struct check_match *m, const struct check_view *a, const struct check_view *b,
                  const struct check_feature *f, const struct check_search *s, int level);

/** Outcome, misfit and variances of a match by the noise that its residual is to be judged by. */
void check_weigh(struct check_match *m, double noise);

/* --- check_pairs.c: the matches of all pairs ---------------------------------------------------------------------- */

struct check_link {
    int a, b;
    double length;         /* spacings between the centres */
    struct check_search s; /* as searched */
    enum sst_check_pair_state state;
    int features, matches;
    double median_px, spread_px;           /* of cross over all matches: median, robust sigma about it */
    double mean_px, rms_px, p95_px;        /* of cross over the used ones; p95 of the magnitude; 0 without any */
    struct check_match m[SST_CHECK_CELLS]; /* by cell of a */
    int feature[SST_CHECK_CELLS];          /* of a, which m is about */
    bool used[SST_CHECK_CELLS];            /* matched, and no outlier among the pair's */
};

/** Everything the check works on. */
struct check_work {
    const struct sst_lightfield *lf;
    struct sst_check_config cfg; /* defaults filled in */
    int views;                   /* rows * cols */
    struct check_view *view;     /* [views]; those absent are empty */
    double (*offset)[2];         /* [views] spacings */
    int links;
    struct check_link *link; /* [links] */
    double range[2];         /* disparities, px per spacing */
    double noise_factor;     /* of the views' noise, that is not texture */
};

/** Links of every present view with the next ones to the right and below. @return 0, -ENOMEM */
SST_MUST_CHECK int check_links(struct check_work *w);

/** Find the disparity range (unless the light field has one) and every link's coarse position, then all matches.
 *  @param only  links to do, by index, or NULL: all */
SST_MUST_CHECK int check_match_links(struct check_work *w, const bool *only);

/** Link of two views as if they were neighbours. */
void check_link_set(struct check_link *link, const struct check_work *w, int a, int b);

/** Count matches, drop outliers, set state. */
void check_link_judge(struct check_link *link, int min_matches);

/** Are its matches more than chance? */
bool check_link_useful(const struct check_link *link);

/** Is the pair's match, or its failing, a sign of something wrong? */
bool check_link_bad(const struct check_link *link, double unusable_px);

/* --- check_far.c: what ties more than two views together --------------------------------------------------------- */

/** Disparity along p less that along q, links of one view, of the feature in cell k; px per spacing.
 *  @return false: not both have it */
SST_MUST_CHECK bool check_two_disparities(double *out, const struct check_link *p, const struct check_link *q, int k);

/** The link that begins at the same view as `index` and is useful too (then index is the one to the right). */
const struct check_link *check_other_link(const struct check_work *w, int index);

/** Median of the magnitude of two disparities' difference, NAN without any. @return 0, -ENOMEM */
SST_MUST_CHECK int check_axes(const struct check_work *w, double *axes_px);

/** The corner-to-corner figures. */
SST_MUST_CHECK int check_far(struct sst_check *out, struct check_work *w);

/* --- check_cameras.c: which cameras explain the matches ----------------------------------------------------------- */

/** Fill camera[views], all but residual_px, drifted and lost. @return 0, -ENOMEM */
SST_MUST_CHECK int check_cameras(struct sst_check_camera *camera, const struct check_work *w);

/* Least variance of the offsets along which shifts were seen, spacings^2, for shifts in proportion to them to be told
 * apart from others: a row sees vertical shifts, but its cameras hardly differ in height. */
#define SST_CHECK_SPREAD 0.05

/** Take off the cameras' states what no match can tell (check_rest.c): the common shift, one in proportion to the
 *  offsets, the medians of roll and scale. NAN stays. */
void check_rest(struct sst_check_camera *camera, const struct check_work *w);

/* --- check_places.c: views in each other's places ----------------------------------------------------------------- */

/** Is exchanging two views, or turning the grid over, what makes the bad pairs good? Sets swapped_a, swapped_b, or
 *  says in `whole` (else "") how the grid is turned. */
SST_MUST_CHECK int check_places(struct sst_check *out, const struct check_work *w, char whole[128]);

/* --- small sums --------------------------------------------------------------------------------------------------- */

/** Element at share 0..1 of v sorted (v is sorted here); n >= 1. */
double check_quantile(double *v, int n, double share);

#endif
