/* pipeline/posed/ground.h - ground under trees: the farthest plane on which views agree. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_GROUND_H
#define SST_PIPELINE_POSED_GROUND_H

#include "pipeline/posed/virtual.h"

struct sst_ground_config {
    double near_mm, far_mm; /* along the virtual camera's axis; 0: from the sparse points, else from the views' distances */
    bool level;             /* planes stay perpendicular to `up`, or to the axis where it is unknown */
    int threads;
    const SST_ATOMIC(bool) *canceled; /* NULL: it runs to its end */
};

#define SST_GROUND_PLANES 400

struct sst_posed_ground {
    struct sst_surface plane;
    double distance_mm; /* along the virtual camera's axis */
    double tilt_deg;    /* of the plane from where the sweep began */
    bool weak;          /* few patches decide: views hardly correlate over all pixels; the tilt is vague */
    int views;          /* that were compared */
    int planes;         /* of the sweep, near to far: */
    double at_mm[SST_GROUND_PLANES];
    double
        four[SST_GROUND_PLANES]; /* share of the pixels that four views see, and on whose patch at least four agree */
    double six[SST_GROUND_PLANES];
    int chosen; /* the plane of the sweep at which refinement began */
};

/**
 * Find the ground: planes from near to far, in each pixel the number of views whose 7x7 patches agree (zero-mean
 * normalised correlation above 0.7), as shares of pixels; of the local maxima of the share the farthest one is the
 * ground, nearer ones are canopy. Its distance and tilt are then refined, coarse to fine, to where views correlate most
 * over all pixels, or, without a clear peak of that, agree most.
 * A farther peak of the pixels on which six views agree counts as well; its plane is level. Where a compared pixel of
 * parallax is more than 0.03 of the distance, distant pairs of views decide, from 0.06 on alone, and a warning is
 * logged.
 *
 * At most 10 views around the middle are compared, at about 512 px.
 *
 * @return 0, -EINVAL (near and far are not given, no points exist and views are at one place), -ENODATA (fewer than
 *         three views see a plane, or no plane stands out), -ECANCELED (not logged), -ENOMEM, or as
 *         sst_posed_picture(); logged
 */
SST_MUST_CHECK int sst_posed_ground(struct sst_posed_ground *out, const struct sst_posed *posed, const char *dir,
                                    const struct sst_virtual *camera, const struct sst_ground_config *cfg);

#endif
