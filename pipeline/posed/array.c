/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/array.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/log.h"

#define PROPORTIONS 1e-3 /* relative difference of the two factors of size */

static int from_calibration(struct sst_posed *out, const char *path, const struct sst_posed_array *array)
{
    struct sst_calib calib;
    int err = sst_calib_read(&calib, path);

    if (err)
        return err;
    if (calib.rows != array->rows || calib.cols != array->cols) {
        sst_log_error("%s is of %d x %d cameras, the array has %d x %d; calibrate it", path, calib.rows, calib.cols,
                      array->rows, array->cols);
        err = -EBADMSG;
    }
    err = err ? err : sst_posed_init(out, calib.rows * calib.cols);
    for (int k = 0; k < calib.rows * calib.cols && !err; k++)
        out->view[k].camera = calib.camera[k];
    if (!err) {
        out->width = calib.width;
        out->height = calib.height;
        out->metric = true;
        snprintf(out->history, sizeof(out->history), "calibration: %s", calib.source);
    }
    sst_calib_fini(&calib);
    return err;
}

static int from_folder(struct sst_posed *out, const char *path, const struct sst_posed_array *array)
{
    int err = sst_posed_load(out, path);

    if (!err && out->count != array->rows * array->cols) {
        sst_log_error("%s has %d views, the array %d positions; their order is that of the views", path, out->count,
                      array->rows * array->cols);
        sst_posed_fini(out);
        err = -EBADMSG;
    }
    return err;
}

/* Lenses for frames of the array's size. @return false: other proportions */
static bool scale(struct sst_posed *posed, int width, int height)
{
    const double by = (double)width / posed->width, high = (double)height / posed->height;

    if (fabs(by / high - 1) > PROPORTIONS)
        return false;
    for (int k = 0; k < posed->count; k++) {
        struct sst_calib_camera *c = &posed->view[k].camera;

        c->fx *= by;
        c->fy *= high;
        c->cx = (c->cx + 0.5) * by - 0.5;
        c->cy = (c->cy + 0.5) * high - 0.5;
    }
    posed->width = width;
    posed->height = height;
    return true;
}

int sst_posed_array_read(struct sst_posed *out, const char *path, const struct sst_posed_array *array)
{
    struct sst_posed made = { 0 };
    int err = sst_posed_is(path) ? from_folder(&made, path, array) : from_calibration(&made, path, array);

    if (err)
        return err;
    for (int k = 0; k < made.count; k++) {
        struct sst_posed_view *v = &made.view[k];

        snprintf(v->name, sizeof(v->name), "%02d_%02d", k / array->cols, k % array->cols);
        v->file[0] = v->sha256[0] = 0;
        v->moment = 0;
        v->time_s = (double)NAN;
    }
    if (!sst_posed_placed(&made)) {
        sst_log_error("%s: no view is placed; `sst poses` finds poses", path);
        err = -EBADMSG;
    } else if (!scale(&made, array->width, array->height)) {
        sst_log_error("%s is of pictures of %d x %d pixels, the cameras' have %d x %d, other proportions", path,
                      made.width, made.height, array->width, array->height);
        err = -EBADMSG;
    }
    made.channels = array->channels;
    made.bits = 8;
    made.samples = (struct sst_samples){ 0 };
    made.kelvin_scale = made.kelvin_offset = 0;
    if (err)
        sst_posed_fini(&made);
    else
        *out = made;
    return err;
}
