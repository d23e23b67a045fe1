#include "simulators/world/truth.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "base/file.h"
#include "base/log.h"
#include "simulators/world/board.h"

/* jansson's pack functions take over what they are given and return NULL if any of it is NULL. */
static json_t *row3(const double v[3])
{
    return json_pack("[f, f, f]", v[0], v[1], v[2]);
}

static json_t *matrix(const double m[9])
{
    return json_pack("[o, o, o]", row3(m), row3(m + 3), row3(m + 6));
}

static json_t *camera(const struct sst_sim_settings *s, const struct sst_sim_camera *c, int cam)
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

/* Where the camera is from a frame of the loop on. */
static json_t *moved(const struct sst_sim_camera *c, int at)
{
    return json_pack("{s: i, s: o, s: o}", "at_pose", at, "rotation", matrix(c->rotation), "position_mm",
                     row3(c->position_mm));
}

static json_t *board(const struct sst_sim_board *b)
{
    static const char *const kinds[] = { "none", "chessboard", "charuco", "aprilgrid" };
    json_t *poses = json_array();
    double width, height;

    sst_sim_board_size(b, &width, &height);
    for (int i = 0; i < b->poses; i++) {
        double r[9];

        sst_sim_rotation(b->pose[i].rotation_deg, r);
        json_array_append_new(poses, json_pack("{s: o, s: o, s: f}", "rotation", matrix(r), "position_mm",
                                               row3(b->pose[i].position_mm), "blur_px", b->pose[i].blur_px));
    }
    return json_pack("{s: s, s: [i, i], s: f, s: f, s: f, s: f, s: o}", "kind", kinds[b->kind], "squares", b->cols,
                     b->rows, "square_mm", b->square_mm, "marker", b->marker, "width_mm", width, "height_mm", height,
                     "poses", poses);
}

static json_t *world(const struct sst_sim_settings *s, const struct sst_sim_stage *stage)
{
    const struct sst_sim_optics *o = sst_sim_stage_optics(stage);
    const struct sst_sim_board *b = sst_sim_stage_board(stage);
    const int cams = s->rig ? 1 : s->rows * s->cols;
    json_t *cameras = json_array(), *all;

    for (int i = 0; i < cams; i++) {
        json_t *one = camera(s, sst_sim_stage_camera(stage, i), i);
        int at;
        const struct sst_sim_camera *later = sst_sim_stage_moved(stage, i, &at);

        if (one && later)
            json_object_set_new(one, "moved", moved(later, at));
        json_array_append_new(cameras, one);
    }
    all = json_pack("{s: s, s: I, s: {s: i, s: i}, s: b, s: i, s: i, s: f, s: i, s: i,"
                    " s: {s: i, s: f}, s: {s: s, s: f}, s: {s: f, s: f, s: f}, s: o}",
                    "scene", s->scene, "seed", (json_int_t)s->seed, "grid", "rows", s->rows, "cols", s->cols, "rig",
                    s->rig, "width", s->width, "height", s->height, "spacing_mm", o->spacing_mm, "reference",
                    (s->rows - 1) / 2 * s->cols + (s->cols - 1) / 2, "exposure_us", s->exposure_us, "loop", "frames",
                    sst_sim_stage_frames(stage), "rate_hz", s->rate_hz, "shutter", "kind",
                    s->rolling ? "rolling" : "global", "line_us", s->rolling ? s->line_us : 0.0, "ideal", "focal_px",
                    o->focal_px, "cx", o->cx, "cy", o->cy, "cameras", cameras);
    if (all && b->kind && json_object_set_new(all, "board", board(b))) {
        json_decref(all);
        return NULL;
    }
    return all;
}

int sst_sim_truth_write(const struct sst_sim_settings *s, const struct sst_sim_stage *stage, const char *path)
{
    json_t *all = world(s, stage);
    char *text = all ? json_dumps(all, JSON_INDENT(2)) : NULL;
    int err = -ENOMEM;

    if (text)
        err = sst_file_write(path, text, strlen(text));
    else
        sst_log_error("no memory for the truth of the world in %s", path);
    free(text);
    json_decref(all);
    return err;
}
