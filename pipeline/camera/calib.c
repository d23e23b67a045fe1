/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/camera/calib.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int sst_calib_init(struct sst_calib *calib, int rows, int cols)
{
    if (rows < 1 || cols < 1 || rows > SST_MAX_VIEWS || cols > SST_MAX_VIEWS || rows * cols > SST_MAX_VIEWS)
        return -EINVAL;
    *calib = (struct sst_calib){ .rows = rows, .cols = cols, .reference = (rows - 1) / 2 * cols + (cols - 1) / 2 };
    calib->camera = calloc((size_t)rows * (size_t)cols, sizeof(*calib->camera));
    if (!calib->camera)
        return -ENOMEM;
    for (int k = 0; k < rows * cols; k++) {
        for (int i = 0; i < 3; i++) {
            calib->camera[k].rotation[4 * i] = 1;
            calib->camera[k].gain[i] = 1;
        }
    }
    return 0;
}

int sst_calib_copy(struct sst_calib *out, const struct sst_calib *in)
{
    const size_t n = (size_t)in->rows * (size_t)in->cols;
    struct sst_calib_camera *camera = malloc(n * sizeof(*camera));

    if (!camera)
        return -ENOMEM;
    memcpy(camera, in->camera, n * sizeof(*camera));
    *out = *in;
    out->camera = camera;
    return 0;
}

void sst_calib_fini(struct sst_calib *calib)
{
    free(calib->camera);
    *calib = (struct sst_calib){ 0 };
}

static _Thread_local char fault_text[160];

static const char *fault(const char *fmt, ...) SST_PRINTF(1, 2);
static const char *fault(const char *fmt, ...)
{
    va_list args;

    va_start(args, fmt);
    vsnprintf(fault_text, sizeof(fault_text), fmt, args);
    va_end(args);
    return fault_text;
}

static bool all_sound(const double *v, int n)
{
    for (int i = 0; i < n; i++) {
        if (!(fabs(v[i]) <= SST_CALIB_LARGEST))
            return false;
    }
    return true;
}

/* Distance of R R^T from 1; det R = -1 counts as far. */
static double not_a_rotation(const double r[9])
{
    double worst = 0;

    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double dot = i == j ? -1 : 0;

            for (int l = 0; l < 3; l++)
                dot += r[3 * i + l] * r[3 * j + l];
            worst = fmax(worst, fabs(dot));
        }
    }
    if (r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]) <
        0)
        worst = 2;
    return worst;
}

const char *sst_camera_fault(const struct sst_calib_camera *c)
{
    const double lens[] = { c->fx, c->fy, c->cx, c->cy, c->rms_px, c->sigma_px };

    if (!all_sound(lens, 6) || !all_sound(c->k, SST_LENS_MAX) || !all_sound(c->rotation, 9) ||
        !all_sound(c->position_mm, 3) || !all_sound(c->gain, 3) || !all_sound(c->falloff, 3))
        return "a number is not finite or beyond 1e12";
    if (!(c->fx > 0) || !(c->fy > 0) || c->fx > 1e7 || c->fy > 1e7)
        return "the focal length is not between 0 and 1e7 px";
    if (c->lens != 0 && c->lens != 5 && c->lens != 8)
        return "the lens has neither 0, 5 nor 8 coefficients";
    for (int i = c->lens; i < SST_LENS_MAX; i++) {
        if (c->k[i] != 0)
            return "a coefficient beyond the lens's number of them is not 0";
    }
    if (not_a_rotation(c->rotation) > 1e-6)
        return "rotation is not a rotation matrix";
    if (!(c->gain[0] > 0) || !(c->gain[1] > 0) || !(c->gain[2] > 0))
        return "a gain is not positive";
    if (!(fmin(1 + c->falloff[0] + c->falloff[1] + c->falloff[2], 1 + c->falloff[0] / 2) > 0))
        return "the fall-off leaves no light in the corners";
    if (c->rms_px < 0 || c->sigma_px < 0 || c->corners < 0)
        return "an error or a number of corners is negative";
    return NULL;
}

const char *sst_calib_fault(const struct sst_calib *calib)
{
    int known = 0;

    if (calib->width < 1 || calib->height < 1 || calib->width > SST_IMAGE_MAX_SIDE ||
        calib->height > SST_IMAGE_MAX_SIDE)
        return fault("frames of %d x %d pixels", calib->width, calib->height);
    if (!(calib->range_mm >= 0 && calib->range_mm <= SST_CALIB_LARGEST))
        return fault("the working range is %g mm", calib->range_mm);
    if (!(calib->noise_px >= 0 && calib->noise_px <= SST_CALIB_LARGEST))
        return fault("the corner noise is %g px", calib->noise_px);
    if (calib->reference < 0 || calib->reference >= calib->rows * calib->cols || !calib->camera[calib->reference].known)
        return fault("the reference view %d is not a known camera", calib->reference);
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        const char *text = calib->camera[k].known ? sst_camera_fault(&calib->camera[k]) : NULL;

        if (text)
            return fault("camera of row %d, column %d: %s", k / calib->cols, k % calib->cols, text);
        known += calib->camera[k].known;
    }
    return known ? NULL : fault("no camera is known");
}
