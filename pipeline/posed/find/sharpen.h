/* pipeline/posed/find/sharpen.h - rotations of views refined by the sharpness of the integral of scores. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_FIND_SHARPEN_H
#define SST_PIPELINE_POSED_FIND_SHARPEN_H

#include "pipeline/posed/posed.h"
#include "pipeline/posed/surface.h"

struct sst_sharpen_config {
    double sigma_angle_deg; /* of each view's rotation, about the axes across its direction; 0: 0.5 */
    bool keep_lens;         /* lenses stay as they are */
    bool look;              /* only compute the sharpness of the poses as they are */
    int threads;
};

struct sst_sharpened {
    double before, after;     /* sharpness: mean product of two views' scores where both look, on the sharpest plane */
    struct sst_surface plane; /* the sharpest one, or where the source knows the ground */
    double distance_mm;       /* of this plane along the middle view's axis */
    double tilt_deg;          /* ... against planes across gravity, or across the middle view's axis */
    int moved;                /* views with a changed rotation */
    double focal,
        k1; /* the lens that was put before all views' own, as sst_camera_adjust(): focal is a factor; 1, 0: none */
    double lens_gain; /* ratio of sharpness with and without it; 0: lenses are as they were */
};

/**
 * Refine rotations by warm places: the scores of each view above 1.5 spreads are
 * registered with the other views on a plane, which is found, too. A view keeps its pose unless its agreement
 * with the others rises significantly, and all do unless the sharpness rises. One lens is fitted to all views, too, and
 * kept where warm places show it beyond doubt and the ground is sharper with it.
 *
 * @param posed  in and out; positions stay
 * @return 0, also where nothing is improved, -ENODATA (fewer than three views are placed, or they agree on no plane;
 * not logged), -ENOMEM, or as sst_posed_picture(); logged
 */
SST_MUST_CHECK int sst_posed_sharpen(struct sst_posed *posed, const char *dir, const struct sst_sharpen_config *cfg,
                                     struct sst_sharpened *out);

#endif
