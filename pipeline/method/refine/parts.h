/* pipeline/method/refine/parts.h - pieces of label refinement; code outside pipeline/method/refine and pipeline/live
 * uses refine.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_REFINE_PARTS_H
#define SST_PIPELINE_METHOD_REFINE_PARTS_H

#include <string.h>

#include "pipeline/method/refine/refine.h"

#define SST_DISP_BINS         65536 /* one per stored disparity; the one of SST_DISP_NONE stays empty */
#define SST_NORMAL_WINDOW_MIN 21    /* smaller windows give noise: 5x5 normals are off by some 30 degrees */
#define SST_NORMAL_WINDOW_MAX 127   /* keeps every product of sums inside int64_t */

/* --- fit.c: the distribution of a label's disparities ------------------------------------------------------------- */

/**
 * Robust normal distribution of disparities given as a histogram. All sums are exact integers, so neither the order of
 * the pixels nor the number of threads matters.
 *
 * Rule: with the median M and sigma_r = max(1.4826 MAD, floor), disparities further than 5 sigma_r from M are trimmed,
 * unless they are more than a quarter: then they are not outliers but a second object of the label (near and far
 * trees), and none is trimmed. Mean and sample variance of the rest; the spread is floored by floor^2 = quantum^2 / 12
 * + matcher_sigma_px^2.   Equation: design.md, 5.3.
 *
 * @param hist  [SST_DISP_BINS] pixels per stored disparity
 * @return a fit with usable set if it has at least cfg->min_pixels pixels; without pixels: mean 0 and the floor
 */
struct sst_label_fit sst_refine_fit_histogram(const int64_t *hist, double disp_min_px,
                                              const struct sst_refine_config *cfg);

/** Density of the fit at disp_px, 1/px. */
double sst_refine_fit_density(const struct sst_label_fit *fit, double disp_px);

/**
 * Bit i of mask[q] is set where label i + 1 takes part and g_i(D) > eps_d, D the disparity stored as q.
 *
 * @param mask  out [SST_DISP_BINS]; 0 for SST_DISP_NONE
 */
void sst_candidate_masks(uint64_t *mask, const struct sst_label_fit *fits, int count, double disp_min_px, double eps_d);

/* --- distance.c: squared distances from every pixel to a region --------------------------------------------------- */

/** Working memory of sst_distance_row() for rows of `width` pixels. */
struct sst_distance_scratch {
    double *start;   /* [width] first abscissa at which a parabola is the lowest */
    int32_t *vertex; /* [width] column of that parabola */
    uint32_t *row;   /* [width] squared vertical distances */
};

/**
 * Exact squared Euclidean distance from every pixel to the nearest one whose label is `value`.
 *
 * Separable: vertical distances by two sweeps, then per row the lower envelope of the parabolas (x - i)^2 + g(i)^2
 * (Felzenszwalb and Huttenlocher 2012). O(pixels). SST_IMAGE_MAX_SIDE bounds the result by 2^31.
 *
 * The first function makes the vertical distances of all rows, the second one squared distances of a row of these.
 * @param dist  out [height][width], tightly packed; untouched when the region is empty
 * @return false: no pixel has this label
 */
bool sst_distance_columns(uint32_t *dist, const struct sst_map_u8 *label, int value);
void sst_distance_row(uint32_t *dist, int width, struct sst_distance_scratch *scratch);

/** Outermost pixels of a region in each row: the first column, and 2^16 times the last one. */
#define SST_EXTENT_NONE 0xFFFFU /* no pixel in this row */

/** @param extents  out [height] */
void sst_region_extents(uint32_t *extents, const struct sst_map_u8 *label, int value);

/** Vertices of the convex hull of a region, no three of them on a line. */
struct sst_hull {
    int count;
    int32_t *x, *y; /* [2 * height + 2] capacity */
};

/** Hull of a region (monotone chain over the outermost pixels of each row); count 0: it is empty. */
void sst_hull_build(struct sst_hull *hull, const uint32_t *extents, int height);

/**
 * Largest squared distance from (x, y) to the region: that to the farthest vertex of its hull, because a convex
 * function on a convex polygon is largest at a vertex. Exact; 0 for an empty hull.
 */
uint32_t sst_hull_farthest(const struct sst_hull *hull, int x, int y);

/* --- normals.c: surface normals from planes in disparity space ---------------------------------------------------- */

#define SST_SURFACE_NONE 1e30F /* variance of a window without a plane */

/** Plane d = d0 + a (x - x0) + b (y - y0) of the window around a pixel (x0, y0). */
struct sst_surface_plane {
    float a, b;     /* px per px */
    float d0;       /* px above disp_min_px */
    float variance; /* of the residuals, px^2; SST_SURFACE_NONE: fewer than 3 pixels, or all near one line */
};

/** Camera that turns disparity planes into normals in space. */
struct sst_surface_frame {
    float focal_px;  /* > 0 */
    float cx, cy;    /* principal point */
    float zero_px;   /* disparity of stored value 0, counted from points at infinity */
    float score_max; /* px^2, below SST_SURFACE_NONE: a plane with a residual variance of this or more has no normal */
};

/** Planes of a view. */
struct sst_planes {
    int width, height, window;
    struct sst_surface_plane *at;   /* [height][width] */
    const struct sst_map_u16 *disp; /* set by sst_planes_fit() */
};

#define SST_PLANE_SUMS 6 /* of sst_planes_fit() for each column */

/**
 * Least squares planes in windows clipped at the border, without unknown disparities. Sums slide and are exact
 * integers, planes are floats. Rejected: determinant of the centred 2x2 system below a thousandth of the product of its
 * diagonal.
 *
 * @param sums  scratch [SST_PLANE_SUMS * width]
 */
void sst_planes_fit(struct sst_planes *planes, const struct sst_map_u16 *disp, int64_t *sums);

/** The image centre is the principal point. Unknown focal length: the image width. A light field with negative
 *  disparities converges inside the scene: infinity is then placed at disp_min_px, so that all points are in front.
 * Planes may deviate from their pixels by twice the matcher's noise: foliage, with a dozen leaves in one window, has no
 * normals. */
struct sst_surface_frame sst_normal_frame_of(const struct sst_lightfield *lf, const struct sst_refine_config *cfg);

/**
 * Unit normal of the surface at a pixel.
 *
 * The plane belongs to one of the nine windows that are centred on the pixel or touch it with an edge or corner: the
 * one with the least residual variance, centre first, plus the squared residual of the pixel itself where it exceeds
 * noise. So windows across an edge lose to one on the pixel's own side of it. With d = a x + b y + c from the principal
 * point, the plane in space is f a X + f b Y + c Z = f B, so the normal is (f a, f b, c), c the plane's value at the
 * principal point. Its product with the viewing ray (x, y, f) is f d > 0: all normals point away from the camera, so
 * normals of one surface agree in sign.
 *
 * @return false if there is none, or the best score is frame->score_max or more; n is then untouched
 */
bool sst_normal_at(float n[3], const struct sst_planes *planes, const struct sst_surface_frame *frame, int x, int y);

/* --- ground.c: the plane of a ground in one view ------------------------------------------------------------------ */

/** d = d0 + a x + b y in steps of 2^-24 of a stored disparity, x and y from the corner; `limit` bounds the residuals of
 * its own pixels. Slopes up to 2^40, values up to 2^57. */
struct sst_ground {
    int64_t a_q24, b_q24, d0_q24, limit_q24;
};

/**
 * Fit the plane of a ground's confident pixels in one view.
 *
 * A ground spans many depths, so the distribution of its disparities says little about a pixel; its plane determines
 * it. Least squares with exact sums, repeated three times without the pixels whose residual exceeds the limit: 5 times
 * the larger of 1.4826 median |residual| and the matcher's noise. The median is one of residuals rounded to stored
 * disparities.
 *
 * @param hist  scratch [SST_DISP_BINS]
 * @return false (untouched): fewer than cfg->min_pixels, all near one line, or over a quarter beyond the limit: no
 * plane
 */
bool sst_ground_fit(struct sst_ground *ground, const struct sst_view *v, int value, const struct sst_refine_config *cfg,
                    int64_t *hist);

/** True if a disparity at a pixel lies on the ground, within its limit. */
bool sst_ground_has(const struct sst_ground *ground, int x, int y, uint16_t disp_q6);

/** 1 / v by four of Newton's iterations, relative error at most 3e-7. @param v  1e-30 .. 1e30 */
static inline float sst_reciprocal(float v)
{
    uint32_t bits;
    float r;

    memcpy(&bits, &v, sizeof(bits));
    bits = 0x7EF311C7U - bits;
    memcpy(&r, &bits, sizeof(r));
    for (int i = 0; i < 4; i++)
        r = r * (2.0F - v * r);
    return r;
}

/* --- energy.c: E = p_n E_n + p_d E_d ------------------------------------------------------------------------------ */

#define SST_SURFACE_ONE 1048576 /* 2^20: a component of 1 of a normal, as a whole number: sums are exact */

/** Confident region of a label in one view, as used by the energy. */
struct sst_region {
    int64_t sum_q20[3]; /* of the unit normals of its pixels, SST_SURFACE_ONE each */
    int64_t normals;    /* how many */
    int64_t pixels;     /* looked at, with a normal or without */
    float mean[3];      /* of the normals; set by sst_region_finish() */
};

/** Add the unit normal of a pixel. */
void sst_region_add(struct sst_region *region, const float normal[3]);

/** Set the mean from the sums; 0 without normals. */
void sst_region_finish(struct sst_region *region);

/** True if at least half of its pixels have a normal; else it is no surface to compare normals with. */
bool sst_region_has_normal(const struct sst_region *region);

/**
 * E_n = -S / (S + tau |R|), S = sum over the region of <m, n(r)>: of the mean normal, -s / (s + tau) with s = <m,
 * mean>; in (-1, 0], lower is more parallel.
 *
 * tau counts per pixel of the region: with one tau for all, the larger region would win regardless of its normals. s <=
 * 0 (normals that oppose m) counts as no consistency: 0, which also keeps the denominator positive. No normals: 0.
 */
float sst_energy_normal(const float m[3], const struct sst_region *region, double tau);

/** E_d = min |p-r|^2 / max |p-r|^2, 0..1, rounded down to steps of 2^-24: equal shares are equal. farthest2 0: a region
 * of one pixel, at it; E_d is 0. */
float sst_energy_distance(uint32_t nearest2, uint32_t farthest2);

/** True if E_d of the first pair is less than E_d of the second, exactly. @param farthest2  above 0 */
bool sst_energy_is_nearer(uint32_t nearest2, uint32_t farthest2, uint32_t other_nearest2, uint32_t other_farthest2);

#endif
