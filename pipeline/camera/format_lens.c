/* Lenses in models with fewer coefficients: linear least squares over rays that cover the picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/camera/format.h"
#include "pipeline/camera/numbers.h"

#define STEPS_X 48
#define STEPS_Y 36
#define MOST    5    /* coefficients that are fitted */
#define TELL_PX 1e-3 /* errors from here on are warned about */

/* Columns of the fit at a ray, in OpenCV's order: a distorted point is (a, b) + sum k_j (x_j, y_j). */
static void columns(double a, double b, double x[MOST], double y[MOST])
{
    const double r2 = a * a + b * b;

    x[0] = a * r2, y[0] = b * r2;
    x[1] = a * r2 * r2, y[1] = b * r2 * r2;
    x[2] = 2 * a * b, y[2] = r2 + 2 * b * b;
    x[3] = r2 + 2 * a * a, y[3] = 2 * a * b;
    x[4] = a * r2 * r2 * r2, y[4] = b * r2 * r2 * r2;
}

/* The ray of a grid point; the grid's corners are corner pixels of the picture. */
static bool ray(const struct sst_calib_camera *cam, int width, int height, int i, double *a, double *b)
{
    const double x = (double)(i % (STEPS_X + 1)) * (width - 1) / STEPS_X;
    const double y = (double)(i / (STEPS_X + 1)) * (height - 1) / STEPS_Y;

    return sst_camera_undistort(cam, x, y, a, b);
}

/* @return number of rays */
static int fit(struct sst_calib_camera *out, const struct sst_calib_camera *in, int width, int height, int n)
{
    double m[MOST * MOST] = { 0 }, v[MOST] = { 0 }, a, b, x, y, r2 = 0, by[MOST];
    int rays = 0;

    for (int i = 0; i < (STEPS_X + 1) * (STEPS_Y + 1); i++) {
        if (ray(in, width, height, i, &a, &b))
            r2 = fmax(r2, a * a + b * b);
    }
    if (!(r2 > 0))
        r2 = 1;
    by[0] = by[2] = by[3] = r2; /* scale of the coefficients, so that all columns have similar size */
    by[1] = r2 * r2;
    by[4] = r2 * r2 * r2;
    for (int i = 0; i < (STEPS_X + 1) * (STEPS_Y + 1); i++) {
        double cx[MOST], cy[MOST];

        if (!ray(in, width, height, i, &a, &b))
            continue;
        sst_camera_distort(in, a, b, &x, &y);
        columns(a, b, cx, cy);
        for (int j = 0; j < n; j++) {
            for (int l = 0; l <= j; l++)
                m[j * n + l] += (in->fx * in->fx * cx[j] * cx[l] + in->fy * in->fy * cy[j] * cy[l]) / (by[j] * by[l]);
            v[j] += (in->fx * cx[j] * (x - in->cx - in->fx * a) + in->fy * cy[j] * (y - in->cy - in->fy * b)) / by[j];
        }
        rays++;
    }
    (void)sst_numbers_solve(m, v, n); /* a picture of one pixel leaves coefficients undetermined: they are 0 */
    *out = *in;
    memset(out->k, 0, sizeof(out->k));
    out->lens = 5;
    for (int j = 0; j < n; j++)
        out->k[j] = v[j] / by[j];
    return rays;
}

int sst_lens_reduce(struct sst_calib_camera *out, double *worst_px, const struct sst_calib_camera *in, int width,
                    int height, int coefficients)
{
    struct sst_calib_camera made = *in;
    bool needed = false;
    double worst = 0;

    for (int i = coefficients; i < SST_LENS_MAX; i++)
        needed |= in->k[i] != 0;
    if (needed && fit(&made, in, width, height, coefficients) < 2 * STEPS_X)
        return -EBADMSG;
    for (int i = 0; needed && i < (STEPS_X + 1) * (STEPS_Y + 1); i++) {
        double a, b, x[2], y[2];

        if (!ray(in, width, height, i, &a, &b))
            continue;
        sst_camera_distort(in, a, b, &x[0], &y[0]);
        sst_camera_distort(&made, a, b, &x[1], &y[1]);
        worst = fmax(worst, hypot(x[1] - x[0], y[1] - y[0]));
    }
    if (made.lens > 5) {
        made.lens = 5;
        memset(made.k + 5, 0, (SST_LENS_MAX - 5) * sizeof(double));
    }
    *out = made;
    *worst_px = worst;
    return 0;
}

int sst_calib_reduce(struct sst_calib *out, const struct sst_calib *in, int coefficients, bool lossy, const char *what)
{
    struct sst_calib made;
    double worst = 0, one;
    int at = 0, err;

    if (sst_calib_copy(&made, in)) {
        sst_log_error("not enough memory to write a calibration");
        return -ENOMEM;
    }
    for (int k = 0; k < in->rows * in->cols; k++) {
        if (!in->camera[k].known)
            continue;
        err = sst_lens_reduce(&made.camera[k], &one, &in->camera[k], in->width, in->height, coefficients);
        if (err) {
            sst_log_error(
                "the lens of the camera of row %d, column %d folds over within its picture; calibrate it again "
                "with corners up to the edges",
                k / in->cols, k % in->cols);
            sst_calib_fini(&made);
            return err;
        }
        if (one > worst) {
            worst = one;
            at = k;
        }
    }
    if (worst > SST_LENS_LOSS_PX && !lossy) {
        sst_log_error(
            "%s has %d coefficients for a lens, with which the camera of row %d, column %d is off by up to %.3g "
            "px, more than %g; --lossy writes it anyway",
            what, coefficients, at / in->cols, at % in->cols, worst, SST_LENS_LOSS_PX);
        sst_calib_fini(&made);
        return -EBADMSG;
    }
    if (worst >= TELL_PX)
        sst_log_warning(
            "%s has %d coefficients for a lens: fitted again, they are off by up to %.3g px (row %d, column "
            "%d)",
            what, coefficients, worst, at / in->cols, at % in->cols);
    *out = made;
    return 0;
}
