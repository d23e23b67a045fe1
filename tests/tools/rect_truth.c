/*
 * Exact truth of a calibrated light field that was captured in a simulated world:
 *   rect_truth WORLD LIGHTFIELD OUT [FRAME]
 * OUT/all/rr_cc.pfm is the disparity of the rectified reference view: each of its pixels is carried to the raw picture
 * by the calibration, from there into the scene through the true lens and mounting, and the depth that is met there
 * becomes a disparity by the rectified focal length and spacing. Pixels from outside the raw picture, and those that
 * meet nothing, are infinite: unknown. OUT/visible/rr_cc.pfm is the same with those pixels unknown too that one of the
 * neighbouring cameras does not see.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/lightfield/rectify/rectify.h"
#include "simulators/scene/world/world_internal.h"

#define HIDDEN 0.998 /* a surface nearer than this share of a point's depth hides it */

struct work {
    const struct sst_lightfield *lf;
    const struct sim_stage *stage;
    int frame;
    struct sst_scene_warp rays;
    struct sst_map_f32 depth, disp, visible;
    double (*at)[3]; /* [height][width] point in the scene, mm */
};

static size_t cell(const struct work *w, int x, int y)
{
    return (size_t)y * (size_t)w->rays.width + (size_t)x;
}

static void aim(struct work *w, int x, int y, const double ray[3])
{
    const struct sim_optics *o = sim_stage_optics(w->stage);

    w->rays.x[cell(w, x, y)] = (float)(o->focal_px * ray[0] / ray[2] + o->cx);
    w->rays.y[cell(w, x, y)] = (float)(o->focal_px * ray[1] / ray[2] + o->cy);
}

/* The true ray, z = 1, of a rectified pixel. @return false: it is from outside the raw picture */
static bool true_ray(const struct work *w, int view, int x, int y, double ray[3])
{
    const struct sim_camera *c = sim_stage_camera(w->stage, view);
    const struct sst_calib *calib = w->lf->calibration;
    double raw[2], a, b, to[3];

    if (!sst_rectify_point(w->lf->rectified, calib, view, (const double[2]){ x, y }, raw) || !(raw[0] >= 0) ||
        !(raw[1] >= 0) || raw[0] > calib->width - 1 || raw[1] > calib->height - 1 ||
        !sim_camera_undistort(c, (raw[0] - c->cx) / c->fx, (raw[1] - c->cy) / c->fy, &a, &b))
        return false;
    for (int i = 0; i < 3; i++)
        to[i] = c->rotation[i] * a + c->rotation[3 + i] * b + c->rotation[6 + i];
    for (int i = 0; i < 3; i++)
        ray[i] = to[i] / to[2];
    return to[2] > 0;
}

/* Depth along the rectified axis of a point as the calibration would have it, if it knew where the point is. */
static double rectified_depth(const struct work *w, int view, const double at[3])
{
    const struct sim_camera *c = sim_stage_camera(w->stage, view);
    const double *r = w->lf->rectified->rotation;
    double z = 0;

    for (int i = 0; i < 3; i++) {
        const double *row = c->rotation + 3 * i;

        z += r[6 + i] * (row[0] * (at[0] - c->position_mm[0]) + row[1] * (at[1] - c->position_mm[1]) +
                         row[2] * (at[2] - c->position_mm[2]));
    }
    return z;
}

static int find_disparity(struct work *w)
{
    const int view = w->lf->ref_view;
    const struct sim_camera *c = sim_stage_camera(w->stage, view);
    const struct sst_rectified *to = w->lf->rectified;
    int err;

    for (int y = 0; y < w->rays.height; y++) {
        for (int x = 0; x < w->rays.width; x++) {
            double ray[3] = { 0, 0, 1 };

            sst_map_f32_row(&w->disp, y)[x] = true_ray(w, view, x, y, ray) ? 0 : INFINITY;
            aim(w, x, y, ray);
            memcpy(w->at[cell(w, x, y)], ray, sizeof(ray));
        }
    }
    err = sim_stage_look(w->stage, w->frame, c->position_mm, &w->rays, &w->depth, NULL);
    for (int y = 0; y < w->rays.height && !err; y++) {
        for (int x = 0; x < w->rays.width; x++) {
            const double depth = sst_map_f32_row(&w->depth, y)[x];
            double *at = w->at[cell(w, x, y)];
            float *disp = &sst_map_f32_row(&w->disp, y)[x];

            for (int i = 0; i < 3; i++)
                at[i] = c->position_mm[i] + at[i] * depth;
            if (isfinite(*disp))
                *disp = depth > 0 ? (float)(to->focal_px * to->spacing_mm / rectified_depth(w, view, at)) : INFINITY;
            sst_map_f32_row(&w->visible, y)[x] = *disp;
        }
    }
    return err;
}

/* Make surfaces that another camera does not see unknown in `visible`. */
static int hide(struct work *w, int view)
{
    const double *eye = sim_stage_camera(w->stage, view)->position_mm;
    int err;

    for (int y = 0; y < w->rays.height; y++) {
        for (int x = 0; x < w->rays.width; x++) {
            const double *at = w->at[cell(w, x, y)], ray[3] = { at[0] - eye[0], at[1] - eye[1], at[2] - eye[2] };

            aim(w, x, y, ray[2] > 0 ? ray : (const double[3]){ 0, 0, 1 });
        }
    }
    err = sim_stage_look(w->stage, w->frame, eye, &w->rays, &w->depth, NULL);
    for (int y = 0; y < w->rays.height && !err; y++) {
        for (int x = 0; x < w->rays.width; x++) {
            const double d = sst_map_f32_row(&w->disp, y)[x], depth = w->at[cell(w, x, y)][2] - eye[2];
            const double px = x - d * w->lf->views[view].bx, py = y - d * w->lf->views[view].by;

            if (sst_map_f32_row(&w->depth, y)[x] < HIDDEN * depth ||
                !(px >= 0 && py >= 0 && px <= w->rays.width - 1 && py <= w->rays.height - 1))
                sst_map_f32_row(&w->visible, y)[x] = INFINITY;
        }
    }
    return err;
}

static int write_map(const struct sst_map_f32 *map, const struct sst_lightfield *lf, const char *out, const char *name)
{
    char dir[SST_PATH_MAX], path[SST_PATH_MAX], file[32], view[16];
    int err = sst_path_join(dir, out, name);

    sst_view_name(lf, lf->ref_view, view);
    snprintf(file, sizeof(file), "%s.pfm", view);
    if (!err)
        err = sst_path_make_dir(dir);
    if (!err)
        err = sst_path_join(path, dir, file);
    return err ? err : sst_map_f32_write_pfm(map, path);
}

static int run(struct work *w, const char *out)
{
    static const int steps[4][2] = { { 0, 1 }, { 0, -1 }, { 1, 0 }, { -1, 0 } };
    const struct sst_lightfield *lf = w->lf;
    const int row = lf->ref_view / lf->cols, col = lf->ref_view % lf->cols;
    int err = find_disparity(w);

    for (int i = 0; i < 4 && !err; i++) {
        const int r = row + steps[i][0], c = col + steps[i][1];

        if (r >= 0 && c >= 0 && r < lf->rows && c < lf->cols && lf->views[r * lf->cols + c].present)
            err = hide(w, r * lf->cols + c);
    }
    if (!err)
        err = sst_path_make_dir(out);
    if (!err)
        err = write_map(&w->disp, lf, out, "all");
    return err ? err : write_map(&w->visible, lf, out, "visible");
}

static int make_room(struct work *w, int width, int height)
{
    int err = sst_scene_warp_init(&w->rays, width, height);

    if (!err)
        err = sst_map_f32_init(&w->depth, width, height);
    if (!err)
        err = sst_map_f32_init(&w->disp, width, height);
    if (!err)
        err = sst_map_f32_init(&w->visible, width, height);
    w->at = calloc((size_t)width * (size_t)height, sizeof(*w->at));
    return w->at ? err : -ENOMEM;
}

int main(int argc, char **argv)
{
    static struct sst_sim_settings settings;
    struct sim_stage *stage = NULL;
    struct sst_lightfield lf = { 0 };
    struct work w = { .lf = &lf, .frame = argc > 4 ? atoi(argv[4]) : 0 };
    int err;

    if (argc < 4) {
        fprintf(stderr, "usage: rect_truth WORLD LIGHTFIELD OUT [FRAME]\n");
        return 2;
    }
    err = sst_sim_settings_read(&settings, argv[1]);
    if (!err)
        err = sim_stage_open(&stage, &settings);
    w.stage = stage;
    if (!err)
        err = sst_lightfield_load(&lf, argv[2], 0, 1);
    if (!err &&
        (!lf.calibration || !lf.rectified || settings.rig || lf.rows != settings.rows || lf.cols != settings.cols)) {
        sst_log_error("%s has no calibration, or is not of the array in %s; rectify a recording of it", argv[2],
                      argv[1]);
        err = -EINVAL;
    }
    if (!err)
        err = make_room(&w, lf.rectified->width, lf.rectified->height);
    if (!err)
        err = run(&w, argv[3]);
    free(w.at);
    sst_map_f32_fini(&w.visible);
    sst_map_f32_fini(&w.disp);
    sst_map_f32_fini(&w.depth);
    sst_scene_warp_fini(&w.rays);
    sst_lightfield_fini(&lf);
    sim_stage_close(stage);
    return err ? EXIT_FAILURE : EXIT_SUCCESS;
}
