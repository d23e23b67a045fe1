/* tests/raw_field.h - a light field of raw frames from simulated cameras with known faults, rectified and as it is, and
 * the exact picture that refocusing it should give. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_RAW_FIELD_H
#define SST_TESTS_RAW_FIELD_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/camera/calib.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/lightfield_internal.h"
#include "pipeline/method/render/render.h"
#include "simulators/scene/world/world_internal.h"

/** NULL-terminated by a failed step: ok says whether everything below is there. */
struct raw_field {
    struct sst_sim_settings settings;
    struct sst_use_calibration use;
    struct sst_lightfield raw, rectified;
};

static inline int raw_field_keep(void *arg, int frame SST_UNUSED, const struct sst_image *image)
{
    struct sst_image *out = (struct sst_image *)arg;
    int err = out->plane[0] ? 0 : sst_image_init(out, image->width, image->height);

    for (int c = 0; c < 3 && !err; c++) {
        for (int y = 0; y < image->height; y++)
            memcpy(sst_image_row(out, c, y), sst_image_row(image, c, y), (size_t)image->width);
    }
    return err;
}

/** Scene, lens, turned cameras, uneven light (percent; 0: all alike), one frame. */
static inline void raw_field_settings(struct sst_sim_settings *s, const char *scene, int rows, int cols, int width,
                                      int height, double uneven)
{
    static const double lens[5] = { -0.1, 0.03, 0, 0, 0 };

    sst_sim_settings_defaults(s, scene);
    s->rows = rows;
    s->cols = cols;
    s->width = width;
    s->height = height;
    s->strip = false;
    s->loop_s = 0.01;
    memcpy(s->distortion, lens, sizeof(lens));
    s->focal_spread_percent = 0.3;
    s->principal_spread_px = 3;
    s->rotation_spread_deg = 0.3;
    s->gain_spread_percent = uneven;
    s->balance_spread_percent = uneven;
    s->vignetting = uneven > 0 ? 0.3 : 0;
}

/** The truth as a calibration. */
static inline int raw_field_calib(struct sst_calib *calib, const struct sst_sim_settings *s,
                                  const struct sim_stage *stage)
{
    double mean[3] = { 0 };
    int err = sst_calib_init(calib, s->rows, s->cols);

    if (err)
        return err;
    calib->width = s->width;
    calib->height = s->height;
    for (int k = 0; k < s->rows * s->cols; k++) {
        for (int c = 0; c < 3; c++)
            mean[c] += log(sim_stage_camera(stage, k)->gain[c]) / (s->rows * s->cols);
    }
    for (int k = 0; k < s->rows * s->cols; k++) {
        const struct sim_camera *from = sim_stage_camera(stage, k);
        struct sst_calib_camera *to = &calib->camera[k];

        to->known = true;
        to->fx = from->fx;
        to->fy = from->fy;
        to->cx = from->cx;
        to->cy = from->cy;
        to->lens = 5;
        memcpy(to->k, from->distortion, sizeof(from->distortion));
        memcpy(to->rotation, from->rotation, sizeof(to->rotation));
        memcpy(to->position_mm, from->position_mm, sizeof(to->position_mm));
        to->falloff[0] = -s->vignetting;
        for (int c = 0; c < 3; c++)
            to->gain[c] = from->gain[c] / exp(mean[c]);
        snprintf(to->name, sizeof(to->name), "cam%d", k);
    }
    return 0;
}

static inline int raw_field_fill(struct sst_lightfield *lf, const struct raw_field *f, const struct sim_stage *stage)
{
    int err = sst_lightfield_init(lf, f->settings.rows, f->settings.cols);

    if (err)
        return err;
    lf->width = f->settings.width;
    lf->height = f->settings.height;
    for (int k = 0; k < lf->rows * lf->cols && !err; k++) {
        lf->views[k].present = true;
        err = sim_stage_loop(stage, k, raw_field_keep, &lf->views[k].image);
    }
    err = err ? err : sst_lightfield_calibrate(lf, &f->use);
    lf->images_raw = true;
    return err;
}

/** @return 0 or a negative errno */
static inline int raw_field_make(struct raw_field *f, const struct sst_sim_settings *settings)
{
    struct sim_stage *stage = NULL;
    int err;

    memset(f, 0, sizeof(*f));
    f->settings = *settings;
    sst_use_calibration_defaults(&f->use);
    err = sim_stage_open(&stage, &f->settings);
    if (err)
        return err;
    err = raw_field_calib(&f->use.calib, &f->settings, stage);
    err = err ? err : raw_field_fill(&f->raw, f, stage);
    err = err ? err : raw_field_fill(&f->rectified, f, stage);
    for (int k = 0; k < f->raw.rows * f->raw.cols && !err; k++)
        err = sst_lightfield_rectify_view(&f->rectified, k);
    f->rectified.images_raw = false;
    sim_stage_close(stage);
    return err;
}

static inline void raw_field_free(struct raw_field *f)
{
    sst_lightfield_fini(&f->raw);
    sst_lightfield_fini(&f->rectified);
    sst_use_calibration_fini(&f->use);
}

/**
 * What plain refocusing of the views of the aperture gives without any interpolation: each of them drawn by an ideal
 * camera whose principal point is shifted by the focus, their mean.
 *
 * @param sum  [3][height][width] doubles, 0..255
 */
static inline int raw_field_truth(const struct raw_field *f, const struct sst_render_config *cfg, double *sum)
{
    const struct sst_rectified *to = f->raw.rectified;
    const size_t plane = (size_t)f->raw.width * (size_t)f->raw.height;
    struct sim_stage *stage = NULL;
    struct sim_optics optics;
    struct sst_sim_settings s;
    int err, n = 0;

    sst_sim_settings_defaults(&s, f->settings.scene);
    s.rows = f->settings.rows;
    s.cols = f->settings.cols;
    s.width = f->raw.width;
    s.height = f->raw.height;
    s.strip = false;
    s.loop_s = 0.01;
    err = sim_stage_open(&stage, &s);
    if (err)
        return err;
    optics = *sim_stage_optics(stage);
    sim_stage_close(stage);
    memset(sum, 0, 3 * plane * sizeof(*sum));
    for (int k = 0; k < f->raw.rows * f->raw.cols; k++) {
        const double bx = to->view[k].bx - cfg->view_bx, by = to->view[k].by - cfg->view_by;

        s.camera[k].given = SST_SIM_FOCAL | SST_SIM_PRINCIPAL;
        s.camera[k].focal_percent = 100 * (to->focal_px / optics.focal_px - 1);
        s.camera[k].principal_px[0] = to->cx + cfg->focus_px * bx - optics.cx;
        s.camera[k].principal_px[1] = to->cy + cfg->focus_px * by - optics.cy;
    }
    err = sim_stage_open(&stage, &s);
    for (int k = 0; k < f->raw.rows * f->raw.cols && !err; k++) {
        struct sst_image image = { 0 };

        if (hypot(to->view[k].bx - cfg->view_bx, to->view[k].by - cfg->view_by) > cfg->aperture + 1e-9)
            continue;
        err = sim_stage_loop(stage, k, raw_field_keep, &image);
        for (size_t i = 0; i < 3 * plane && !err; i++)
            sum[i] += sst_image_row(&image, (int)(i / plane), (int)(i % plane) / image.width)[i % (size_t)image.width];
        n++;
        sst_image_fini(&image);
    }
    for (size_t i = 0; i < 3 * plane && n; i++)
        sum[i] /= n;
    sim_stage_close(stage);
    return err;
}

#endif
