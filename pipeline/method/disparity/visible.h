/* pipeline/method/disparity/visible.h - passes over the maps of all views of a light field: the second pass, carried
 * maps, refinement between pixels, check and filling. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_VISIBLE_H
#define SST_PIPELINE_METHOD_DISPARITY_VISIBLE_H

#include "pipeline/method/disparity/stage.h"

/** A view of the second pass; all maps of one size, disparities in 1/64 px above disp_min_px. */
struct sst_visible_view {
    const struct sst_image *image; /* at full size; NULL: no view here */
    const struct sst_map_u8 *seen; /* 0 where pixels must not be matched; NULL or empty: all may be */
    struct sst_map_u16 *disp;      /* in and out; SST_DISP_NONE: unknown */
    struct sst_map_u8 *confidence; /* in and out */
    double bx, by;
    bool carried;              /* not matched: its map comes from the matched views */
    struct sst_map_u8 *agreed; /* out of sst_disparity_carry(): 255 where most sources put the same surface and none
                                  another, nearer or behind it; NULL: not wanted; empty: nowhere */
};

struct sst_visible_views {
    struct sst_visible_view *view; /* [count] */
    int count;
    int scale;                           /* of the maps: 1 full size, 2 half size */
    double disp_min_px;                  /* at their size */
    int range;                           /* whole pixels from there */
    bool repair;                         /* sst_disparity_visible(): the carried views, not the matched ones */
    bool swept;                          /* maps of a sweep in scene space: no surface is missing in all */
    bool smooth;                         /* few surfaces: few views tell hypotheses apart */
    bool skip_hypotheses;                /* see struct sst_disparity_config */
    struct sst_disparity_report *report; /* out, skip_hypotheses' counters, or NULL */
    const SST_ATOMIC(bool) * cancel;     /* as in struct sst_disparity_config */
    struct sst_share *share;             /* as there */
    struct sst_runner_user *runner;      /* as there */
};

/**
 * The views nearest to view k, sorted by distance and number. Displacements are 32-bit numbers in 2^-16 px: views so
 * far away that they do not fit are left out, nothing of view k is seen there.
 *
 * @param most     at most SST_HYPOTHESIS_VIEWS
 * @param nearest  out [most], indices of in->view
 * @return their number
 */
int sst_visible_nearest(const struct sst_visible_views *in, int k, int most, int *nearest);

/** Spacings along both axes together to views whose surfaces are projected into another one. */
static inline double sst_visible_reach(const struct sst_visible_views *in)
{
    return in->swept ? 1.5 : 2.5;
}

/** Views that processes exchange together (sst_share_block()). */
int sst_visible_block(const struct sst_visible_views *in);

/* Least views and range of the second pass. It samples the nearest pixels: surfaces of a narrow range are nearer to
 * each other than that can distinguish. */
#define SST_VISIBLE_LEAST 6 /* views */
#define SST_VISIBLE_RANGE 8 /* px */

/**
 * The second pass (design.md, 5.7): choose each pixel's disparity again, among the surfaces around it, by its
 * colours in the views where it is visible. Matched views are refined, or carried ones (`repair`); the maps of the
 * other views stay and only occlude. Where a carried pixel's sources agree, it stays.
 *
 * @param rounds  1 or more: each starts from the maps of the last one
 * @return 0, -ENOMEM, -ECANCELED; the maps then are those of the last whole round
 */
SST_MUST_CHECK int sst_disparity_visible(const struct sst_visible_views *in, int rounds, int threads);

/**
 * The second pass of the matched views, then the second pass of the carried views, which starts from the new maps and
 * from the same points of the sweep.
 *
 * @param agreed  [count] out: `agreed` of in->view from then on; empty before
 * @param carry   carry the matched views' maps to the others before each of the two
 */
SST_MUST_CHECK int sst_disparity_repair(struct sst_visible_views *in, struct sst_map_u8 *agreed, bool carry, int rounds,
                                        int threads);

/**
 * Carry the maps of the matched views to the others (design.md, 5.7), which become dense.
 *
 * @param status  [count] enum sst_disparity_check of the matched views' pixels; out for the others: pixels whose
 *                disparity comes from a correct one are correct, all others occluded; NULL: none is correct
 * @return 0, -ENOMEM, -ECANCELED
 */
SST_MUST_CHECK int sst_disparity_carry(const struct sst_visible_views *in, struct sst_map_u8 *status, int threads);

/** Percent of a matched view's disparities that differ by more than 1 px from disparities carried to it from the
 * other matched views, which are farther away than the sources of a carried view. NaN: none to compare. */
SST_MUST_CHECK int sst_disparity_carry_error(const struct sst_visible_views *in, struct sst_map_u8 *status, int k,
                                             double *percent);

/* Surfaces that the first pass missed (design.md, 5.7, sweep.c). Disparities are tested at levels of half of a step,
 * from the disparity of stored value 0 on. */
#define SST_SWEEP_PEAKS 6

/** Points in space that one view found. */
struct sst_sweep {
    struct sst_sweep_point {
        uint16_t x, y, level, weight;
    } * point; /* owned */
    size_t count;
    double bx, by; /* of the view; set by the caller */
};

#define SST_SWEEP_LEVELS 256 /* at most */

/** Parameters of a sweep and of its candidates, the same for all views of a size. */
struct sst_sweep_plan {
    int width, height;         /* of a view */
    int step;                  /* 1/64 px: surfaces that are nearer to each other are one */
    int stride;                /* px between sparse pixels, from half of it on */
    int level, levels;         /* disparities that are tested: multiples of `level`, 1/64 px */
    int apart;                 /* levels: nearer ones explain a pixel together */
    int distinct, weight_most; /* least and largest distance to the cost of the next one that counts */
    int cell, cols, rows;      /* px of a cell's side; cells of a view */
    int peaks_apart;           /* levels: nearer ones are one candidate */
    uint32_t gathered, mapped; /* least weight of a candidate; most sparse pixels of a map, counted twice, that do
                                  not make a surface */
};

void sst_sweep_plan_init(struct sst_sweep_plan *plan, int width, int height, int range_q6, int step);

/**
 * Whole pixels that a point of each level moves by to a view at offset (bx, by), so that it is found in the right cell:
 * it is at (x, y) - shift there.
 *  shift  out [plan->levels] along x and y
 */
void sst_sweep_shifts(int32_t (*shift)[2], const struct sst_sweep_plan *plan, double bx, double by, double disp_min_px);

/**
 * Find the points of sparse pixels that their own disparity does not explain, as `test` decides it.
 * @param out  out; sst_sweep_fini() frees it, also after a failure
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_sweep_view(struct sst_sweep *out, const struct sst_sweep_plan *plan,
                                  const struct sst_hypothesis_test *test, const struct sst_map_u16 *disp,
                                  const struct sst_map_u8 *seen);
void sst_sweep_fini(struct sst_sweep *s);

/** Points of several views. */
struct sst_sweeps {
    struct sst_sweep_plan plan;
    struct sst_sweep *sweep; /* [count] */
    int count;
};

/** Disparities at which points gather, by cell of a view. */
struct sst_sweep_candidates {
    int cell, cols; /* px of a side; cells of a row */
    struct sst_sweep_peak {
        uint16_t disp; /* SST_DISP_NONE: no more */
        bool absent;   /* the view's map hardly has it around there */
    } * peak;          /* [rows][cols][SST_SWEEP_PEAKS], heaviest first; owned */
};

/**
 * Candidates of a view from the points of sweeps.
 * @param out  out; sst_sweep_candidates_fini() frees it, also after a failure
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_sweep_candidates(struct sst_sweep_candidates *out, const struct sst_sweeps *sweeps,
                                        const struct sst_visible_view *view, double disp_min_px);
void sst_sweep_candidates_fini(struct sst_sweep_candidates *c);

/** [SST_SWEEP_PEAKS] candidates at a pixel. */
const struct sst_sweep_peak *sst_sweep_candidates_at(const struct sst_sweep_candidates *c, int x, int y);

#define SST_AROUND_EXTREMES 6 /* farthest and nearest in windows of three sizes */

/** Surfaces around each pixel of a view; zeroed before the first one. Its maps are written again for the next view. */
struct sst_around {
    struct sst_map_u16 steps;
    struct sst_map_u16 flat[SST_AROUND_EXTREMES / 2]; /* 0 where the window holds a step: a slant alone has none */
    struct sst_map_u16 extreme[SST_AROUND_EXTREMES];
    struct {
        struct sst_map_u16 far, near; /* of other views: the farthest (SST_DISP_NONE: none) and the nearest (0) */
    } projected;
    struct sst_sweep_candidates swept;
    int apart; /* least difference between two hypotheses of a pixel, 1/64 px */
    struct sst_mem_kept lines;
};

/** Gather the surfaces of view k. @return 0, -ENOMEM; sst_around_fini() frees all, also after a failure */
SST_MUST_CHECK int sst_around_init(struct sst_around *a, const struct sst_visible_views *in, int k,
                                   const struct sst_sweeps *sweeps);
void sst_around_fini(struct sst_around *a);

/** Pixels of a row. */
struct sst_around_part {
    int left, y, n;
};

/**
 * Hypotheses of pixels of view v, a pixel's own disparity first; unused entries are any number.
 * @param list   out [n][SST_HYPOTHESES]
 * @param count  out [n]; 0: nothing is known, or the pixel must not be matched
 */
void sst_around_list(uint16_t *list, uint8_t *count, const struct sst_around *a, const struct sst_visible_view *v,
                     const struct sst_around_part *part);

/* Sub-pixel refinement pays where the range is narrow: steps of the first pass are then coarse against it. */
#define SST_SUBPIXEL_RANGE 16 /* px: wider light fields are not refined */

/**
 * Refine disparities by the luma of the views around, in small windows, by at most 20/64 px (design.md, 5.8).
 * Confidences are not used.
 *
 * @param steps  of Gauss-Newton, 1 or more
 * @param views  compared at most, 1..SST_SUBPIXEL_VIEWS
 * @return 0, -ENOMEM, -ECANCELED; the maps are unchanged then
 */
SST_MUST_CHECK int sst_disparity_subpixel(const struct sst_visible_views *in, int steps, int views, int threads);

/**
 * Give filled and doubtful pixels to a nearer surface beside them where they look like it, and most views show other
 * colours at their own disparity: mixed colours of outlines, thin things.
 *
 * @param in      views of scale 1; `agreed`: 255 where a pixel is not in doubt
 * @param filled  [count] dense maps of the views that are there
 * @param status  [count] enum sst_disparity_check of their pixels before they were filled
 * @return 0, -ENOMEM, -ECANCELED; the maps are unchanged then
 */
SST_MUST_CHECK int sst_disparity_lift(const struct sst_visible_views *in, struct sst_map_u16 *filled,
                                      const struct sst_map_u8 *status, int threads);

/** Give unknown pixels the farther of the nearest known disparities to their left and right, empty rows the disparities
 * of the next row. A map without any known pixel stays. */
void sst_fill_background(struct sst_map_u16 *disp);

/** A neighbouring view's disparities at offset b from the view under check. */
struct sst_checked_view {
    const struct sst_map_u16 *disp_q6; /* same disparity of value 0 as the view's own */
    const struct sst_map_u8 *status;   /* for filling; NULL while checking */
    double bx, by;
};

/** Neighbours of a view. */
struct sst_checked_views {
    struct sst_checked_view view[SST_MAX_NEIGHBOURS]; /* the nearer ones first */
    int count, near;                                  /* near: one spacing away, the first ones */
    double disp_min_px;                               /* disparity of stored value 0 */
};

/**
 * design.md, 5.2 step 4, any set of views: with d = D(p), correct if |d - D_n(p - d b_n)| <= 1 for one view;
 * mismatch if that holds for some other whole-pixel d of disp_min .. disp_min + steps - 1 (none: 0); else occlusion.
 *
 * @param status  out, enum sst_disparity_check
 */
void sst_disparity_check_views(struct sst_map_u8 *status, const struct sst_map_u16 *disp_q6,
                               const struct sst_checked_views *from, int steps);

/**
 * design.md, 5.2 step 5: occlusions get the disparity of a neighbour's correct pixel that projects onto them (near
 * views first, the nearest surface of several), mismatches the median of the nearest correct pixels in 16 directions,
 * the rest the smaller of the nearest correct disparities to both sides (background). The result is dense if any pixel
 * is correct.
 *
 * @param scratch  [height][width]; without neighbours NULL
 */
void sst_fill_views(struct sst_map_u16 *disp_q6, const struct sst_map_u8 *status, const struct sst_checked_views *from,
                    uint32_t *scratch);

#endif
