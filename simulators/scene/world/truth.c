/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "base/file.h"
#include "base/log.h"
#include "base/stats.h"
#include "pipeline/camera/calib.h"

/* jansson's pack functions take ownership of their arguments and return NULL if any is NULL. */
static json_t *row3(const double v[3])
{
    return json_pack("[f, f, f]", v[0], v[1], v[2]);
}

static json_t *matrix(const double m[9])
{
    return json_pack("[o, o, o]", row3(m), row3(m + 3), row3(m + 6));
}

static json_t *camera(const struct sst_sim_settings *s, const struct sim_camera *c, int cam)
{
    const double *k = c->distortion, intrinsics[9] = { c->fx, 0, c->cx, 0, c->fy, c->cy, 0, 0, 1 };
    const struct sst_sim_timing *t = &c->timing;
    const int row = s->rig ? 0 : cam / s->cols, col = s->rig ? 0 : cam % s->cols;

    return json_pack("{s: i, s: i, s: i, s: o, s: [f, f, f, f, f], s: o, s: o, s: o, s: f,"
                     " s: {s: I, s: I, s: I, s: I, s: f, s: I}}",
                     "camera", cam, "row", row, "col", col, "K", matrix(intrinsics), "distortion", k[0], k[1], k[2],
                     k[3], k[4], "rotation", matrix(c->rotation), "position_mm", row3(c->position_mm), "gain",
                     row3(c->gain), "vignetting", s->vignetting, "timing", "delay_ns", (json_int_t)t->delay_ns,
                     "jitter_ns", (json_int_t)t->jitter_ns, "latency_ns", (json_int_t)t->latency_ns, "clock_offset_ns",
                     (json_int_t)t->clock_offset_ns, "clock_drift_ppm", t->clock_drift_ppm, "phase_ns",
                     (json_int_t)t->phase_ns);
}

/* The camera's pose from a frame of the loop on. */
static json_t *moved(const struct sim_camera *c, int at)
{
    return json_pack("{s: i, s: o, s: o}", "at_pose", at, "rotation", matrix(c->rotation), "position_mm",
                     row3(c->position_mm));
}

static json_t *board(const struct sst_sim_board *b)
{
    static const char *const kinds[] = { "none", "chessboard", "charuco", "aprilgrid" };
    json_t *poses = json_array();
    double width, height;

    sim_board_size(b, &width, &height);
    for (int i = 0; i < b->poses; i++) {
        double r[9];

        sim_rotation(b->pose[i].rotation_deg, r);
        json_array_append_new(poses, json_pack("{s: o, s: o, s: f}", "rotation", matrix(r), "position_mm",
                                               row3(b->pose[i].position_mm), "blur_px", b->pose[i].blur_px));
    }
    return json_pack("{s: s, s: [i, i], s: f, s: f, s: f, s: f, s: o}", "kind", kinds[b->kind], "squares", b->cols,
                     b->rows, "square_mm", b->square_mm, "marker", b->marker, "width_mm", width, "height_mm", height,
                     "poses", poses);
}

static json_t *world(const struct sst_sim_settings *s, const struct sim_stage *stage)
{
    const struct sim_optics *o = sim_stage_optics(stage);
    const struct sst_sim_board *b = sim_stage_board(stage);
    const int cams = s->rig ? 1 : s->rows * s->cols;
    json_t *cameras = json_array(), *all;

    for (int i = 0; i < cams; i++) {
        json_t *one = camera(s, sim_stage_camera(stage, i), i);
        int at;
        const struct sim_camera *later = sim_stage_moved(stage, i, &at);

        if (one && later)
            json_object_set_new(one, "moved", moved(later, at));
        json_array_append_new(cameras, one);
    }
    all = json_pack("{s: s, s: I, s: {s: i, s: i}, s: b, s: i, s: i, s: f, s: i, s: i,"
                    " s: {s: i, s: f}, s: {s: s, s: f}, s: {s: f, s: f, s: f}, s: o}",
                    "scene", s->scene, "seed", (json_int_t)s->seed, "grid", "rows", s->rows, "cols", s->cols, "rig",
                    s->rig, "width", s->width, "height", s->height, "spacing_mm", o->spacing_mm, "reference",
                    (s->rows - 1) / 2 * s->cols + (s->cols - 1) / 2, "exposure_us", s->exposure_us, "loop", "frames",
                    sim_stage_steps(stage), "rate_hz", s->rate_hz, "shutter", "kind", s->rolling ? "rolling" : "global",
                    "line_us", s->rolling ? s->line_us : 0.0, "ideal", "focal_px", o->focal_px, "cx", o->cx, "cy",
                    o->cy, "cameras", cameras);
    if (all && b->kind && json_object_set_new(all, "board", board(b))) {
        json_decref(all);
        return NULL;
    }
    return all;
}

int sim_truth_write(const struct sst_sim_settings *s, const struct sim_stage *stage, const char *path)
{
    json_t *all = world(s, stage);
    char *text = all ? json_dumps(all, JSON_INDENT(2)) : NULL;
    int err = -ENOMEM;

    if (text)
        err = sst_file_write(path, text, strlen(text));
    else
        sst_log_error("out of memory for the truth of the world in %s", path);
    free(text);
    json_decref(all);
    return err;
}

/* --- as a calibration --------------------------------------------------------------------------------------------- */

/* a v */
static void turned(const double a[9], const double v[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[3 * i] * v[0] + a[3 * i + 1] * v[1] + a[3 * i + 2] * v[2];
}

/* A camera in another one's axes. @param at  their positions */
static void fill_camera(struct sst_calib_camera *to, const struct sim_camera *c, const double at[3],
                        const struct sim_camera *reference, const double reference_at[3])
{
    const double *k = c->distortion,
                 away[3] = { at[0] - reference_at[0], at[1] - reference_at[1], at[2] - reference_at[2] };

    to->known = true;
    to->fx = c->fx;
    to->fy = c->fy;
    to->cx = c->cx;
    to->cy = c->cy;
    for (int i = 0; i < 5; i++) {
        to->k[i] = k[i];
        to->lens = k[i] != 0 ? 5 : to->lens;
    }
    sst_rotation_between(c->rotation, reference->rotation, to->rotation);
    turned(reference->rotation, away, to->position_mm);
    memcpy(to->gain, c->gain, sizeof(to->gain));
}

/* Normalise gains to the mean camera's. */
static void even_gains(struct sst_calib *calib)
{
    const int cams = calib->rows * calib->cols;

    for (int c = 0; c < 3; c++) {
        double mean = 0;

        for (int i = 0; i < cams; i++)
            mean += calib->camera[i].gain[c] / cams;
        for (int i = 0; i < cams && mean > 0; i++)
            calib->camera[i].gain[c] /= mean;
    }
}

/* The board's text, and the median depth of its poses in the reference camera's axes. */
static void fill_board(struct sst_calib *calib, const struct sst_sim_board *b, const struct sim_camera *reference,
                       const double reference_at[3])
{
    static const char *const kinds[] = { "", "chessboard", "charuco", "aprilgrid" };
    double z[SST_SIM_POSES_MAX];
    int n =
        snprintf(calib->board, sizeof(calib->board), "%s:%dx%d:%gmm", kinds[b->kind], b->cols, b->rows, b->square_mm);

    if (b->kind != SST_SIM_CHESSBOARD)
        snprintf(calib->board + n, sizeof(calib->board) - (size_t)n, ":%g", b->marker);
    for (int i = 0; i < b->poses; i++) {
        double away[3], at[3];

        for (int k = 0; k < 3; k++)
            away[k] = b->pose[i].position_mm[k] - reference_at[k];
        turned(reference->rotation, away, at);
        z[i] = at[2];
    }
    sst_stats_sort_double(z, b->poses);
    if (b->poses && z[b->poses / 2] > 0)
        calib->range_mm = z[b->poses / 2];
}

static const double straight[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };

static void fill(struct sst_calib *calib, const struct sst_sim_settings *s, const struct sim_stage *stage)
{
    const double step = sim_stage_optics(stage)->spacing_mm;
    const struct sim_camera *reference = sim_stage_camera(stage, s->rig ? 0 : calib->reference);
    double reference_at[3];

    memcpy(reference_at, reference->position_mm, sizeof(reference_at));
    if (s->rig) { /* its pose 0 is view (0, 0) */
        reference_at[0] += step * (calib->reference % s->cols);
        reference_at[1] += step * (calib->reference / s->cols);
    }
    calib->width = s->width;
    calib->height = s->height;
    calib->rig = s->rig;
    snprintf(calib->source, sizeof(calib->source), "true parameters of the simulated world %s", s->scene);
    for (int i = 0; i < s->rows * s->cols; i++) {
        const struct sim_camera *c = sim_stage_camera(stage, s->rig ? 0 : i);
        struct sst_calib_camera *to = &calib->camera[i];
        const double at[3] = { c->position_mm[0] + (s->rig ? step * (i % s->cols) : 0),
                               c->position_mm[1] + (s->rig ? step * (i / s->cols) : 0), c->position_mm[2] };

        fill_camera(to, c, at, reference, reference_at);
        to->falloff[0] = -s->vignetting;
        snprintf(to->name, sizeof(to->name), "SIM%04d", s->rig ? 0 : i);
        if (s->rig || i == calib->reference)
            memcpy(to->rotation, straight, sizeof(straight)); /* without the last bit's noise */
    }
    even_gains(calib);
    if (sim_stage_board(stage)->kind)
        fill_board(calib, sim_stage_board(stage), reference, reference_at);
}

int sim_truth_calib(const struct sst_sim_settings *s, const struct sim_stage *stage, const char *path)
{
    struct sst_calib calib;
    int err = sst_calib_init(&calib, s->rows, s->cols);

    if (err)
        return err;
    fill(&calib, s, stage);
    err = sst_calib_write(&calib, path);
    sst_calib_fini(&calib);
    return err;
}
