/* pipeline/posed/solve/solve.h - poses of the views of a light field from its pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_SOLVE_SOLVE_H
#define SST_PIPELINE_POSED_SOLVE_SOLVE_H

#include "pipeline/posed/posed.h"

struct sst_posed_solve_config {
    double focal_px;          /* of every view; 0: of the views' lenses, else it is searched */
    bool search_focal;        /* the views' lenses count for nothing */
    bool free_lens;           /* focal length and k1, shared, are adjusted */
    bool keep_lens;           /* lenses stay, although warm places show others */
    bool refine;              /* start from the given poses, which are priors, in place of none */
    double sigma_position_mm; /* of given positions; 0: a tenth of the mean distance of neighbours */
    double sigma_angle_deg;   /* of given rotations; 0: 2 */
    double spacing_mm;        /* mean distance of neighbours; 0: unknown */
    bool one_rig;             /* several light fields are of one array: its views' relative poses are shared */
    int threads;              /* 0: all processors */
    void (*progress)(void *arg, double done);
    void *progress_arg;
};

/** Result of one light field; placed views are in its sst_posed. */
struct sst_posed_solved {
    int placed;
    double median_px, p90_px; /* residuals of all sights of points */
    double focal_px;          /* of the first placed view */
    double free_focal_px;     /* that the matches ask for, where a given one was kept; 0: none was */
    double focal_doubt;       /* relative: how far one that was found may be off; 0: it was given */
    double spacing_mm;        /* mean distance of neighbours on a line, else by name, in the light field's unit */
    bool *doubtful;           /* [views] placed, but not plausibly: its neighbours' distances or directions differ */
    double *view_px;          /* [views] median residual; NAN: not placed */
    double sharper;           /* ratio of sharpness after and before, where warm places refined poses; else 0 */
    double lens_gain; /* ratio of sharpness with and without a lens that warm places show; 0: lenses are as they were */
    double lens_focal_px, lens_k1; /* of the first placed view before, and k1 of the lens before the view's own */
    double ground_mm;       /* distance of the plane on which they are sharp, along the middle view's axis, ... */
    double ground_tilt_deg; /* and its tilt */
};

void sst_posed_solved_fini(struct sst_posed_solved *solved);

/**
 * Place the views of light fields by their pictures: poses, lens, points, history, and the kind of unit.
 *
 * Features of neighbours (SIFT) become tracks; a start by similarities of pictures is adjusted with a robust loss from
 * wide to narrow (docs/design/posed.md). Neighbours follow each other by name; of up to 30 views, in the order
 * along which pictures match. The first placed view by name, or given positions, define the axes.
 * Views without enough matches are left unplaced. The same bytes for any number of threads.
 * Given poses of one channel are also refined by warm places (find/sharpen.h); the sharper result is kept.
 *
 * @param posed   in and out [count]; unchanged on failure
 * @param dir     [count] folders of the pictures
 * @param solved  out [count]
 * @return 0, -EDOM (no pose can be found: one sentence), -EBADMSG (views of one rig differ), -ENOTSUP (no
 * OpenCV), -ENOMEM, or of the pictures; logged
 */
SST_MUST_CHECK int sst_posed_solve(struct sst_posed *posed, const char *const *dir, int count,
                                   const struct sst_posed_solve_config *cfg, struct sst_posed_solved *solved);

/** Figures of poses that another program found: views, mean distance of neighbours, doubtful ones by their places
 *  alone. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_posed_judge(const struct sst_posed *posed, struct sst_posed_solved *solved);

/** Mean distance of neighbours among the placed views in the order of names, in the light field's unit; 0: none */
double sst_posed_spacing(const struct sst_posed *posed);

#endif
