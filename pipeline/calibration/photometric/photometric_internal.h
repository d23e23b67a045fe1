/* pipeline/calibration/photometric/photometric_internal.h - inside the photometric calibration: gains and fall-off that
 * fit the logs of light. */
#ifndef SST_PIPELINE_CALIBRATION_PHOTOMETRIC_PHOTOMETRIC_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_PHOTOMETRIC_PHOTOMETRIC_INTERNAL_H

#include <stdbool.h>

#include "base/base.h"

#define SST_LIGHT_FALLOFF_MIN 0.125 /* of the light in the farthest corner: less is no lens */

/** A white place seen by one camera, by ascending group. */
struct light_seen {
    int cam, group;  /* place on the board at one moment: lit alike for all cameras */
    double r2;       /* squares of half the diagonal */
    double value[3]; /* log of linear light */
};

/** What is sought of one camera; its fall-off is 1 + (common[0] + own) r2 + common[1] r2^2 + common[2] r2^3: lenses of
 *  one make lose light alike, some a little more. Higher own coefficients would follow the places that a camera happens
 *  to have seen the board at. */
struct light_cam {
    int part;       /* cameras of different parts share no place; the mean log gain of each part is 0 */
    bool plain;     /* its fall-off is the common one: own stays 0 */
    double reach;   /* largest r2 in its picture */
    double gain[3]; /* logs */
    double own;
};

struct light_problem {
    int cams, parts, count;
    bool one_camera; /* at many places: gains stay 0, the fall-off is the common one */
    int order;       /* of the polynomial, 0..3 */
    struct light_cam *cam;
    const struct light_seen *seen; /* [count] */
    double common[3];
    double scale; /* robust standard deviation of the residuals, of logs; out */
};

/** log of the fall-off. The polynomial must be positive there. */
double light_log_falloff(const struct light_problem *p, int cam, double r2);

/**
 * Is every camera's fall-off within its picture at least SST_LIGHT_FALLOFF_MIN, and does it go one way only (to 1 % of
 * the light)?
 * @return -1: yes; else the first camera where it is not, cams: the common one is not
 */
int light_fall_fault(const struct light_problem *p);

/**
 * Gauss-Newton with the light of each group eliminated, weights by residual (Huber 1964, then Tukey's biweight).
 * common, own and gain are started from and replaced; own is held near 0 by what cameras of one make differ.
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int light_fit_gains(struct light_problem *p);

#endif
