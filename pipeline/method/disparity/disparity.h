/* pipeline/method/disparity/disparity.h - computes dense disparity, for all views or for one rectified pair. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_DISPARITY_H
#define SST_PIPELINE_METHOD_DISPARITY_DISPARITY_H

#include "pipeline/lightfield/lightfield.h"
#include "pipeline/method/network/network.h"
#include "pipeline/step/runner.h"

/** Matching costs; with both, their mean. */
enum sst_cost {
    SST_COST_CENSUS = 1,
    SST_COST_MCCNN = 2,
    SST_COST_BOTH = 3,
};

/* Largest number of one-pixel steps searched, and of the penalty: with costs up to 255, 8 paths sum to at most
 * 8 * (255 + 4000) = 34040 < 2^16 (see sgm.c). */
#define SST_DISPARITY_MAX_STEPS   512
#define SST_DISPARITY_MAX_PENALTY 4000
#define SST_DISPARITY_MAX_ROUNDS  8
#define SST_SUBPIXEL_MOST         8
/* Longest support arm: 11^2 * 255 < 2^16, so column sums modulo 2^16 are exact; so are the means of equal costs, which
 * the rounded-up reciprocal of the kernel makes inexact from 151 pixels on. */
#define SST_SUPPORT_MAX_ARM 5

struct sst_share;
struct sst_runner_user; /* that places the steps (pipeline/step/runner.h); one run at a time */

struct sst_disparity_config {
    double disp_min_px, disp_max_px; /* searched, inclusive; max > min; at most SST_DISPARITY_MAX_STEPS */
    enum sst_cost cost;
    bool census_suffices; /* pairs, and light fields of SST_VISIBLE_LEAST views and more: census alone and 4 paths,
                             whatever `cost` and `paths` are (design.md, 5.7, 5.8) */
    struct sst_runner_user *networks; /* that runs the network of features; NULL: on the CPU */
    const char *model;            /* ONNX of the MC-CNN features; needed by SST_COST_MCCNN */
    enum sst_precision precision; /* of that network */
    int paths;                    /* of the semi-global optimisation: 4 or 8 */
    int p1, p2;                   /* smoothness penalties in cost units (costs are 0..255); 0 < p1 <= p2 */
    int edge_step;                /* intensity step (0..255) at which p2 is halved; larger steps weaken it further */
    int support_arm;              /* longest arm of the cross-based support region, px; 0 switches aggregation off */
    int support_tau;              /* largest intensity step inside an arm, 1..255 */
    int support_before, support_after; /* rounds of aggregation before and after the optimisation */
    int bilateral_tau;                 /* eps_I of the bilateral filter, 1..255; 0 switches it off */
    bool guided_holes; /* pairs: holes are filled with what looks like them (pair_fill_alike()) */
    int guided_rounds; /* pairs: of pair_guided_median(), 0..SST_DISPARITY_MAX_ROUNDS */
    bool raw;       /* the cheapest disparity of each pixel, to evaluate costs: no aggregation, optimisation, filter or
                       filling; their parameters are ignored */
    bool fill;      /* check and fill: the result is dense */
    bool joint;     /* horizontal and vertical neighbours share one cost volume, instead of two maps fused */
    int neighbours; /* joint: how many views share the volume at most: 4 (sides), 8 (diagonals), 12 (two steps) */
    int rounds;     /* of the second pass (design.md, 5.7), 0..SST_DISPARITY_MAX_ROUNDS; light fields of few views
                       or of a narrow range have none */
    int subpixel_steps; /* of the refinement between pixels (design.md, 5.8), 0..SST_SUBPIXEL_MOST; light fields of few
                           views or of a wide range are not refined */
    int subpixel_views; /* compared in it at most, up to SST_SUBPIXEL_VIEWS */
    int scale;          /* 1 full size, 2 half size with the result scaled up */
    int phase_step;     /* census between pixels in quarters (1) or in halves (2), which needs a quarter of the memory;
                           0: in quarters unless views are very large */
    bool frugal; /* one view after the other on one thread, with its neighbours' phases computed for it and freed again:
                    the same result in a fraction of the memory; no sweep in scene space, which needs more */
    int threads;
    /* Light fields of SST_VISIBLE_LEAST views and more: 5 or 3: one view in this many is matched, and the maps of the
     * others are carried over from those and, with a second pass, repaired; 1: every view is matched. Without `fill` or
     * `joint`, or where the range is too narrow for the second pass asked for, every one is. */
    int key_spacing;
    bool keys_in_texture; /* that only where views have texture nearly everywhere; else every view is matched */
    double key_error; /* with a second pass: percent of the reference view's disparities that may change by more than 1
                         px if it is carried; else a sweep in scene space makes the maps of all views */
    bool whole_steps; /* one step per pixel, however short the range is */
    bool skip_ranges; /* the first pass searches, tile by tile, the disparities around those of a match at a quarter of
                         the size; with 4 paths, a joint volume and no aggregation after the optimisation */
    size_t range_bytes;  /* of light fields only those where a view's whole cost volume would be larger */
    size_t memory;       /* bytes of cost volumes of views that are matched at once: beyond that, several threads share
                            one or fewer work; at least one is; and of the planes of a sweep in scene space, without
                            which all views are matched; 0: 1.5 GiB, 6 where threads cannot share, and 3 */
    double range_error;  /* percent of the reference view's disparities that skip_ranges may change by more than 1 px;
                            else, and where there is no such view, the whole range is searched; pairs are not tested */
    bool
        skip_hypotheses; /* the second pass tests no other disparity where the first pass's explains the colours well */
    const SST_ATOMIC(bool) * cancel; /* once true, matching of a light field stops within a part of a view; or NULL */
    struct sst_disparity_report *report; /* out, or NULL; of what this process does */
    struct sst_share *share; /* with other processes (pipeline/lightfield/share.h), which all have the same maps and
                                report then: both passes, checks and carrying by views; or NULL */
    struct sst_runner_user *runner; /* that places the steps, with the same bytes; NULL: on the CPU */
};

/** What was skipped, and the error that this adds; percent, NaN where nothing was. */
struct sst_disparity_report {
    double views_skipped;      /* of the views: carried, not matched */
    double views_error;        /* disparities that change by more than 1 px if the reference view is carried as well,
                                  before any repair */
    double ranges_skipped;     /* of the disparities of the first pass */
    double ranges_error;       /* pixels in three rows of tiles of the reference view whose disparity in the whole range
                                  differs by more than 1 px */
    double hypotheses_skipped; /* of the second pass */
    double hypotheses_error;   /* pixels in a sample of rows whose cheapest hypothesis was not tested */
};

/** Stages that a runner names where they are done on the CPU, for lack of shaders or after a failure: X(STAGE, name). */
#define SST_DISPARITY_STAGE_LIST(X)                                                                                    \
    X(RANGE, "range")           /* of disparities of a light field: a pair of its views */                             \
    X(SURFACES, "surfaces")     /* of the second pass: around each pixel, its hypotheses */                            \
    X(SUBPIXEL, "subpixel")     /* refinement between pixels */                                                        \
    X(CARRY, "carrying")        /* maps carried to other views */                                                      \
    X(CHECK, "check")           /* of views against each other */                                                      \
    X(FILL, "filling")          /* of refused pixels, from other views and around it ... */                            \
    X(BACKGROUND, "background") /* ... and of the rest */                                                              \
    X(SWEEP, "sweep")           /* in scene space, where maps are not carried */

enum sst_disparity_stage {
#define X(STAGE, name) SST_DISPARITY_STAGE_##STAGE,
    SST_DISPARITY_STAGE_LIST(X)
#undef X
        SST_DISPARITY_STAGES
};

const char *sst_disparity_stage_name(enum sst_disparity_stage stage);

/** Items that the report of the runner counts: views that are matched, views of coarser maps as well; views in the second
 * pass, by round, whose hypotheses are tested. */
enum sst_disparity_counter { SST_DISPARITY_MATCHED = 1, SST_DISPARITY_TESTED = 2 };

/** Values of a preset: "preview", "balanced", "accurate". @return 0 or -EINVAL (logged with the list). */
SST_MUST_CHECK int sst_disparity_preset(struct sst_disparity_config *cfg, const char *preset);

/**
 * Choose the key views of a light field: a lattice that contains the reference view, of spacing 5 (each other view is a
 * step away from one of it) or 3 (half of the others lie between three), and views that have none of it around them.
 * Views without any other one to match with are none.
 *
 * @param carried  out, [views] true for all that are not key views
 * @return number of key views
 */
int sst_disparity_keys(const struct sst_lightfield *lf, int spacing, bool *carried);

/** Called repeatedly with 0..1, from the calling thread. */
typedef void sst_progress_fn(void *arg, double done);

/**
 * Fill views[].disp and views[].confidence of every present view; images must be loaded. Sets lf->disp_min_px.
 * @return 0, -EINVAL, -ENOMEM, -ENOENT/-EBADMSG (model); logged; -ECANCELED, not logged.
 */
SST_MUST_CHECK int sst_disparity_lightfield(struct sst_lightfield *lf, const struct sst_disparity_config *cfg,
                                            sst_progress_fn *progress, void *progress_arg);

/** How the range of disparities is searched. */
struct sst_disparity_search {
    int scale; /* 1; 2: matched at half of that size, in a tenth of the time; gaps of foliage may be missed then */
    int threads;
    struct sst_runner_user *runner; /* as of struct sst_disparity_config; a pair that is matched on the CPU all the same is
                                       noted as SST_DISPARITY_STAGE_RANGE */
    struct sst_share *share;        /* with other processes: the neighbours; or NULL */
    int from;                       /* 1 + the view that is matched with its neighbours; 0: the reference view */
};

/**
 * The range of disparities in a light field, from a coarse match of one view with its neighbours (images of
 * those must be loaded): nearly all confident pixels on which two neighbours agree, plus a margin (all confident pixels
 * if too few agree: views that are not aligned).
 * @return 0, -ENODATA (not enough texture; logged), -ENOMEM
 */
SST_MUST_CHECK int sst_disparity_range(const struct sst_lightfield *lf, const struct sst_disparity_search *search,
                                       double *min_px, double *max_px);

/**
 * Disparity of the left image of a rectified pair: left(x) matches right(x - d). Unknown is +inf.
 * @param out  out, initialised here
 */
SST_MUST_CHECK int sst_disparity_stereo(struct sst_map_f32 *out, const struct sst_image *left,
                                        const struct sst_image *right, const struct sst_disparity_config *cfg);

#endif
