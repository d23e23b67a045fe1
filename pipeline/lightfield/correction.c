/* Corrections of pictures, by the resampling that also rectifies raw frames: a view without a calibration is a picture
 * of a pinhole camera with principal point, roll and focal length off. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/correction.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/camera/numbers.h"
#include "pipeline/image/srgb.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/lightfield_internal.h"
#include "pipeline/lightfield/share.h"

struct sst_correction sst_correction_none(void)
{
    return (struct sst_correction){ .gain = { 1, 1, 1 }, .exponent = 1 };
}

static bool moves(const struct sst_correction *c)
{
    return c->shift_x_px != 0 || c->shift_y_px != 0 || c->roll_deg != 0 || c->scale != 0;
}

/* Displacement that resampling undoes. */
static bool resamples(const struct sst_correction *c)
{
    return moves(c) || c->falloff != 0 || c->gain[0] != 1 || c->gain[1] != 1 || c->gain[2] != 1;
}

bool sst_correction_is_none(const struct sst_correction *c)
{
    return !resamples(c) && c->exponent == 1;
}

bool sst_correction_valid(const struct sst_correction *c)
{
    for (int i = 0; i < 3; i++) {
        if (!(c->gain[i] >= 1 / SST_CORRECTION_GAIN_MAX && c->gain[i] <= SST_CORRECTION_GAIN_MAX))
            return false;
    }
    if (!(c->exponent >= 1 / SST_CORRECTION_EXPONENT_MAX && c->exponent <= SST_CORRECTION_EXPONENT_MAX))
        return false;
    return fabs(c->shift_x_px) <= SST_CORRECTION_SHIFT_MAX_PX && fabs(c->shift_y_px) <= SST_CORRECTION_SHIFT_MAX_PX &&
           fabs(c->roll_deg) <= SST_CORRECTION_ROLL_MAX_DEG && fabs(c->falloff) <= SST_CORRECTION_FALLOFF_MAX &&
           fabs(c->scale) <= SST_CORRECTION_SCALE_MAX;
}

/* Rotation of directions by `deg` about the optical axis, x towards y. */
static void roll_matrix(double deg, double m[9])
{
    const double c = cos(deg * (M_PI / 180)), s = sin(deg * (M_PI / 180));
    const double rows[9] = { c, -s, 0, s, c, 0, 0, 0, 1 };

    memcpy(m, rows, sizeof(rows));
}

/* The polynomial of a calibration that is exp(falloff r2) at thirds of r2 = 1. */
static void falloff_polynomial(double out[3], double falloff)
{
    double a[3][3];

    for (int i = 0; i < 3; i++) {
        const double r2 = (i + 1) / 3.0;

        out[i] = exp(falloff * r2) - 1;
        for (int j = 0; j < 3; j++)
            a[i][j] = pow(r2, j + 1);
    }
    sst_stats_solve3(a, out);
}

/* The camera of the picture, which is off, and the one that should have been. */
static void pinhole(const struct sst_lightfield *lf, const struct sst_correction *c, struct sst_calib_camera *camera,
                    struct sst_calib *calib, struct sst_rectified *to)
{
    const double focal = sst_max_int(lf->width, lf->height); /* any: it cancels */

    *camera = (struct sst_calib_camera){ .known = true,
                                         .fx = focal * (1 + c->scale),
                                         .fy = focal * (1 + c->scale),
                                         .cx = 0.5 * (lf->width - 1) + c->shift_x_px,
                                         .cy = 0.5 * (lf->height - 1) + c->shift_y_px };
    memcpy(camera->gain, c->gain, sizeof(camera->gain));
    if (c->falloff != 0)
        falloff_polynomial(camera->falloff, c->falloff);
    roll_matrix(c->roll_deg, camera->rotation);
    *calib = (struct sst_calib){ .rows = 1, .cols = 1, .width = lf->width, .height = lf->height, .camera = camera };
    *to = (struct sst_rectified){ .rows = 1,
                                  .cols = 1,
                                  .width = lf->width,
                                  .height = lf->height,
                                  .focal_px = focal,
                                  .cx = 0.5 * (lf->width - 1),
                                  .cy = 0.5 * (lf->height - 1),
                                  .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 } };
    to->view[0].known = true;
    to->view[0].scale = 1;
}

/* Pixels with an unseen place in the uncorrected picture are not seen either. */
static void carry_valid(struct sst_map_u8 *valid, const struct sst_map_u8 *before, const struct sst_rectify_map *map,
                        int32_t *xy_q8)
{
    for (int y = 0; y < valid->height; y++) {
        uint8_t *row = sst_map_u8_row(valid, y);

        sst_rectify_map_row(map, 0, y, valid->width, xy_q8);
        for (int x = 0; x < valid->width; x++) {
            if (!row[x])
                continue;
            row[x] = sst_map_u8_row(
                before,
                sst_clamp_int((xy_q8[2 * x + 1] + 128) >> 8, 0,
                              before->height - 1))[sst_clamp_int((xy_q8[2 * x] + 128) >> 8, 0, before->width - 1)];
        }
    }
}

int remade_init(struct remade *made, const struct sst_lightfield *lf)
{
    const int err = sst_image_init(&made->image, lf->width, lf->height);

    return err ? err : sst_map_u8_init(&made->valid, lf->width, lf->height);
}

static bool all_set(const struct sst_map_u8 *map)
{
    for (int y = 0; y < map->height; y++) {
        if (memchr(sst_map_u8_row(map, y), 0, (size_t)map->width))
            return false;
    }
    return true;
}

int remade_take(struct sst_lightfield *lf, int view, struct remade *made, int err)
{
    struct sst_view *v = &lf->views[view];
    char name[16];

    if (err) {
        sst_view_name(lf, view, name);
        sst_log_error("cannot %s view %s: %s", made->what, name, strerror(-err));
        sst_image_fini(&made->image);
        sst_map_u8_fini(&made->valid);
        return err;
    }
    if (all_set(&made->valid))
        sst_map_u8_fini(&made->valid);
    if (!lf->calibration)
        sst_image_fini(&v->original);
    if (made->keep && !v->original.plane[0])
        v->original = v->image;
    else
        sst_image_fini(&v->image);
    sst_map_u8_fini(&v->valid);
    v->image = made->image;
    v->valid = made->valid;
    return 0;
}

static int make_map(struct sst_rectify_map **out, const struct sst_lightfield *lf, const struct sst_correction *c)
{
    struct sst_rectified *to = malloc(sizeof(*to));
    struct sst_calib_camera camera;
    struct sst_calib calib;
    int err = -ENOMEM;

    if (to) {
        pinhole(lf, c, &camera, &calib, to);
        err = sst_rectify_map_create(out, to, &calib, 0);
    }
    free(to);
    return err;
}

static int resample(struct remade *out, const struct sst_lightfield *lf, const struct sst_view *v,
                    const struct sst_correction *c)
{
    int32_t *xy_q8 = malloc(2 * sizeof(*xy_q8) * (size_t)lf->width);
    struct sst_rectify_map *map = NULL;
    int err = xy_q8 ? make_map(&map, lf, c) : -ENOMEM;

    err = err ? err : remade_init(out, lf);
    if (!err)
        err = sst_rectify_view(&(struct sst_rectified_view){ &out->image, &out->valid }, map, SST_CORRECTION_FILTER,
                               &v->image);
    if (!err && v->valid.data)
        carry_valid(&out->valid, &v->valid, map, xy_q8);
    sst_rectify_map_destroy(map);
    free(xy_q8);
    return err;
}

bool sst_lightfield_has_originals(const struct sst_lightfield *lf)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (lf->views[k].original.plane[0])
            return true;
    }
    return false;
}

int sst_correction_map(struct sst_rectify_map **out, const struct sst_lightfield *lf, int view)
{
    return make_map(out, lf, &lf->correction[view]);
}

/* Raise the light of all pixels to the power of 1 / exponent. */
static void straighten(struct sst_image *image, double exponent)
{
    uint8_t level[256];

    for (int i = 0; i < 256; i++)
        level[i] = (uint8_t)(255 * sst_light_to_srgb(pow(sst_srgb_to_light(i / 255.0), 1 / exponent)) + 0.5);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < image->height; y++) {
            uint8_t *row = sst_image_row(image, c, y);

            for (int x = 0; x < image->width; x++)
                row[x] = level[row[x]];
        }
    }
}

int correction_apply(struct sst_lightfield *lf, int view, const struct sst_correction *c, bool keep)
{
    struct remade made = { .what = "correct", .keep = keep };
    struct sst_view *v = &lf->views[view];

    if (!v->present)
        return 0;
    if (c->exponent != 1)
        straighten(&v->image, c->exponent);
    return resamples(c) ? remade_take(lf, view, &made, resample(&made, lf, v, c)) : 0;
}

/* The product to the third power of r2, the form of a calibration. */
static void multiply_falloff(double f[3], double falloff)
{
    double g[3];

    if (falloff == 0)
        return;
    falloff_polynomial(g, falloff);
    f[2] += f[1] * g[0] + f[0] * g[1] + g[2];
    f[1] += f[0] * g[0] + g[1];
    f[0] += g[0];
}

/* Small turns about x and y shift the picture, one about z rolls it: in rectified axes, before the camera's. */
static void correct_camera(struct sst_calib_camera *cam, const struct sst_rectified *r, const struct sst_correction *c)
{
    const double turn[3] = { -c->shift_y_px / r->focal_px, c->shift_x_px / r->focal_px, c->roll_deg * (M_PI / 180) };
    double m[9], in_rig[9];

    /* cam' = cam r^T turn r, each from the rig's axes. */
    sst_rotation_from_vector(turn, m);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            in_rig[3 * i + j] = 0;
            for (int k = 0; k < 3; k++) {
                for (int l = 0; l < 3; l++)
                    in_rig[3 * i + j] += r->rotation[3 * k + i] * m[3 * k + l] * r->rotation[3 * l + j];
            }
        }
    }
    sst_numbers_mul3(cam->rotation, in_rig, cam->rotation);
    cam->fx *= 1 + c->scale;
    cam->fy *= 1 + c->scale;
    for (int i = 0; i < 3; i++)
        cam->gain[i] *= c->gain[i];
    multiply_falloff(cam->falloff, c->falloff);
}

void correction_calibrate(struct sst_lightfield *lf)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (lf->views[k].present && !sst_correction_is_none(&lf->correction[k]))
            correct_camera(&lf->calibration->camera[k], lf->rectified, &lf->correction[k]);
    }
}

struct job {
    struct sst_lightfield *lf;
    const struct sst_correction *correction;
};

static int correct_job(void *arg, int view, int worker SST_UNUSED)
{
    const struct job *job = arg;

    return correction_apply(job->lf, view, &job->correction[view], job->lf->keeps_sources);
}

static void corrected_maps(void *arg, int view, struct sst_share_maps *out)
{
    const struct job *job = arg;
    struct sst_view *v = &job->lf->views[view];

    if (!v->present || sst_correction_is_none(&job->correction[view]))
        return;
    sst_share_add_image(out, &v->image);
    sst_share_add_u8(out, &v->valid);
}

int sst_lightfield_correct(struct sst_share *share, struct sst_lightfield *lf, const struct sst_correction *correction,
                           int threads)
{
    const size_t bytes = (size_t)(lf->rows * lf->cols) * sizeof(*correction);
    struct job job = { lf, correction };
    struct sst_correction *kept;
    bool valid = !lf->images_raw;
    int err;

    for (int k = 0; k < lf->rows * lf->cols; k++)
        valid &= sst_correction_valid(&correction[k]) && (correction[k].exponent == 1 || !lf->calibration);
    if (!valid) {
        sst_log_error("the correction of the views is out of its limits");
        return -EINVAL;
    }
    kept = malloc(bytes);
    if (!kept) {
        sst_log_error("not enough memory to correct the views");
        return -ENOMEM;
    }
    memcpy(kept, correction, bytes);
    err = sst_share_for(share, lf->rows * lf->cols, sst_thread_count(threads), correct_job, &job, corrected_maps);
    if (err) {
        free(kept);
        return err;
    }
    free(lf->correction);
    lf->correction = kept;
    return 0;
}

/* --- sources ------------------------------------------------------------------------------------------------------ */

static int settle_job(void *arg, int view, int worker SST_UNUSED)
{
    struct sst_lightfield *lf = arg;
    struct sst_view *v = &lf->views[view];

    if (!v->present || sst_correction_is_none(&lf->correction[view]))
        return 0;
    sst_image_fini(&v->image);
    v->image = v->original;
    v->original = (struct sst_image){ 0 };
    return sst_lightfield_rectify_view(lf, view);
}

int sst_lightfield_settle(struct sst_lightfield *lf, int threads)
{
    if (!lf->calibration || !lf->correction)
        return 0;
    correction_calibrate(lf);
    return sst_parallel_for(lf->rows * lf->cols, sst_thread_count(threads), settle_job, lf);
}

int sst_lightfield_borrow(struct sst_lightfield *out, const struct sst_lightfield *lf, unsigned what)
{
    const size_t views = (size_t)(lf->rows * lf->cols);
    const bool raw = lf->calibration && what & SST_LOAD_RAW;
    struct sst_view *view = malloc(views * sizeof(*view));

    if (!view)
        return -ENOMEM;
    memcpy(view, lf->views, views * sizeof(*view));
    for (size_t k = 0; k < views; k++) {
        if (raw) {
            view[k].image = view[k].original;
            view[k].valid = (struct sst_map_u8){ 0 };
        }
        if (lf->calibration || !(what & SST_LOAD_ORIGINALS))
            view[k].original = (struct sst_image){ 0 };
        if (!(what & SST_LOAD_CONFIDENCE))
            view[k].confidence = (struct sst_map_u8){ 0 };
    }
    *out = *lf;
    out->views = view;
    out->images_raw = raw;
    return 0;
}

void sst_lightfield_return(struct sst_lightfield *borrowed)
{
    free(borrowed->views);
    *borrowed = (struct sst_lightfield){ 0 };
}
