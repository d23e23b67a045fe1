/* Points in rig axes projected to pixels by a calibrated camera. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_CAMERA_PROJECT_H
#define SST_TESTS_CAMERA_PROJECT_H

#include <math.h>

#include "pipeline/camera/calib.h"

/* @return false: not in front of the camera, or beyond the fold of the lens, where undistortion returns another point
 */
static inline bool camera_project(const struct sst_calib_camera *cam, const double X[3], double *x, double *y)
{
    const double *r = cam->rotation, *c = cam->position_mm;
    const double d[3] = { X[0] - c[0], X[1] - c[1], X[2] - c[2] };
    const double z = r[6] * d[0] + r[7] * d[1] + r[8] * d[2];
    double a, b, seen[2], back[2];

    *x = *y = 0;
    if (!(z > 0))
        return false;
    a = (r[0] * d[0] + r[1] * d[1] + r[2] * d[2]) / z;
    b = (r[3] * d[0] + r[4] * d[1] + r[5] * d[2]) / z;
    sst_camera_distort(cam, a, b, &seen[0], &seen[1]);
    if (!isfinite(seen[0]) || !isfinite(seen[1]) || !sst_camera_undistort(cam, seen[0], seen[1], &back[0], &back[1]) ||
        !(hypot(back[0] - a, back[1] - b) < 1e-6))
        return false;
    *x = seen[0];
    *y = seen[1];
    return true;
}

#endif
