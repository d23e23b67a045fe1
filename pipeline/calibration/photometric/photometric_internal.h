/* pipeline/calibration/photometric/photometric_internal.h - gains and fall-off fitted to logs of light; callers use
 * photometric.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_PHOTOMETRIC_PHOTOMETRIC_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_PHOTOMETRIC_PHOTOMETRIC_INTERNAL_H

#include <stdbool.h>

#include "base/base.h"

#define PHOTOMETRIC_FALLOFF_MIN 0.125 /* of the light in the farthest corner: less is implausible */

/** A white patch observed by one camera, by ascending group. */
struct photometric_observation {
    int cam, group;  /* one patch at one moment: the same illumination for all cameras */
    double r2;       /* squares of half the diagonal */
    double value[3]; /* log of linear light */
};

/** Unknowns of one camera; its fall-off is 1 + (common[0] + own) r2 + common[1] r2^2 + common[2] r2^3: lenses of
 *  one model have nearly the same fall-off. Higher own coefficients would overfit to where a camera happened to see the
 *  board. */
struct photometric_camera {
    int part;       /* cameras of different parts share no patch; the mean log gain of each part is 0 */
    bool plain;     /* its fall-off is the common one: own stays 0 */
    double reach;   /* largest r2 in its picture */
    double gain[3]; /* logs */
    double own;
};

struct photometric_problem {
    int cams, parts, count;
    bool one_camera; /* at many poses: gains stay 0, the fall-off is the common one */
    int order;       /* of the polynomial, 0..3 */
    struct photometric_camera *cam;
    const struct photometric_observation *seen; /* [count] */
    double common[3];
    double scale; /* robust standard deviation of the residuals, of logs; out */
};

/** log of the fall-off. The polynomial must be positive there. */
double photometric_log_falloff(const struct photometric_problem *p, int cam, double r2);

/**
 * Whether every camera's fall-off within its picture is at least PHOTOMETRIC_FALLOFF_MIN and monotonic (to 1 % of the
 * light).
 * @return -1: all are; else the first camera where it is not, cams: the common one
 */
int photometric_falloff_fault(const struct photometric_problem *p);

/**
 * Gauss-Newton with the light of each group eliminated, weights by residual (Huber 1964, then Tukey's biweight).
 * common, own and gain are initial values and results; a prior holds own near 0.
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int photometric_fit_gains(struct photometric_problem *p);

#endif
