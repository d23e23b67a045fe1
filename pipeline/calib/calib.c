#include "pipeline/calib/calib.h"

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

static bool all_finite(const double *v, int n)
{
    for (int i = 0; i < n; i++) {
        if (!isfinite(v[i]))
            return false;
    }
    return true;
}

/* How far R R^T is from 1, with det R = -1 counted as far. */
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

static const char *camera_fault(const struct sst_calib *calib, int view)
{
    const struct sst_calib_camera *c = &calib->camera[view];
    const int row = view / calib->cols, col = view % calib->cols;
    const char *what = NULL;

    if (!all_finite(&c->fx, 4) || !all_finite(c->k, SST_LENS_MAX) || !all_finite(c->rotation, 9) ||
        !all_finite(c->position_mm, 3) || !all_finite(c->gain, 3) || !all_finite(c->falloff, 3) ||
        !isfinite(c->rms_px) || !isfinite(c->sigma_px))
        what = "a number is not finite";
    else if (!(c->fx > 0) || !(c->fy > 0) || c->fx > 1e7 || c->fy > 1e7)
        what = "the focal length is not between 0 and 1e7 px";
    else if (c->lens != 0 && c->lens != 5 && c->lens != 8)
        what = "the lens has neither 0, 5 nor 8 coefficients";
    else if (not_a_rotation(c->rotation) > 1e-6)
        what = "rotation is no rotation matrix";
    else if (!(c->gain[0] > 0) || !(c->gain[1] > 0) || !(c->gain[2] > 0))
        what = "a gain is not positive";
    else if (!(fmin(1 + c->falloff[0] + c->falloff[1] + c->falloff[2], 1 + c->falloff[0] / 2) > 0))
        what = "the fall-off leaves no light in the corners";
    return what ? fault("camera of row %d, column %d: %s", row, col, what) : NULL;
}

const char *sst_calib_fault(const struct sst_calib *calib)
{
    int known = 0;

    if (calib->width < 1 || calib->height < 1 || calib->width > SST_IMAGE_MAX_SIDE ||
        calib->height > SST_IMAGE_MAX_SIDE)
        return fault("frames of %d x %d pixels", calib->width, calib->height);
    if (!isfinite(calib->range_mm) || calib->range_mm < 0)
        return fault("the working range is %g mm", calib->range_mm);
    if (calib->reference < 0 || calib->reference >= calib->rows * calib->cols || !calib->camera[calib->reference].known)
        return fault("the reference view %d is not a known camera", calib->reference);
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        const char *text = calib->camera[k].known ? camera_fault(calib, k) : NULL;

        if (text)
            return text;
        known += calib->camera[k].known;
    }
    return known ? NULL : fault("no camera is known");
}
