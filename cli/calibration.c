/* sst calibration: show a calibration in any known format, or convert it to another. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/edit_distance.h"
#include "base/log.h"
#include "cli/cli_internal.h"
#include "pipeline/camera/format.h"

#define DEG (180 / M_PI)

static double angle_deg(const struct sst_calib_camera *cam)
{
    double v[3];

    sst_rotation_to_vector(cam->rotation, v);
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) * DEG;
}

/* --- show --------------------------------------------------------------------------------------------------------- */

static json_t *numbers(const double *v, int n)
{
    json_t *list = json_array();

    for (int i = 0; i < n; i++)
        json_array_append_new(list, json_real(v[i]));
    return list;
}

static json_t *camera_to_json(const struct sst_calib *calib, int view)
{
    const struct sst_calib_camera *c = &calib->camera[view];
    const double focal[2] = { c->fx, c->fy }, centre[2] = { c->cx, c->cy };

    return json_pack("{s:i, s:i, s:s, s:o, s:o, s:o, s:o, s:o, s:f, s:o, s:o, s:f, s:i, s:f}", "row",
                     view / calib->cols, "col", view % calib->cols, "name", c->name, "focal_px", numbers(focal, 2),
                     "centre_px", numbers(centre, 2), "distortion", numbers(c->k, c->lens), "rotation",
                     numbers(c->rotation, 9), "position_mm", numbers(c->position_mm, 3), "angle_deg", angle_deg(c),
                     "gain", numbers(c->gain, 3), "falloff", numbers(c->falloff, 3), "rms_px", c->rms_px, "corners",
                     c->corners, "sigma_px", c->sigma_px);
}

static int print_json(const struct sst_calib *calib, const char *format)
{
    json_t *root, *cameras = json_array();

    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (calib->camera[k].known)
            json_array_append_new(cameras, camera_to_json(calib, k));
    }
    root = json_pack("{s:s, s:i, s:i, s:i, s:i, s:[ii], s:b, s:f, s:f, s:s, s:s, s:o}", "format", format, "rows",
                     calib->rows, "cols", calib->cols, "width", calib->width, "height", calib->height, "reference",
                     calib->reference / calib->cols, calib->reference % calib->cols, "rig", calib->rig, "range_mm",
                     calib->range_mm, "noise_px", calib->noise_px, "source", calib->source, "board", calib->board,
                     "cameras", cameras);
    if (!cli_dump_json(root, JSON_COMPACT))
        return 0;
    sst_log_error("calibration show: not enough memory, or a name in it is not UTF-8");
    return -ENOMEM;
}

static void print_camera(const struct sst_calib *calib, int view)
{
    const struct sst_calib_camera *c = &calib->camera[view];

    printf("%3d %3d%s %-16.16s %9.2f %9.2f %8.2f %8.2f %4d %9.2f %9.2f %9.2f %7.3f ", view / calib->cols,
           view % calib->cols, view == calib->reference ? "*" : " ", c->name, c->fx, c->fy, c->cx, c->cy, c->lens,
           c->position_mm[0], c->position_mm[1], c->position_mm[2], angle_deg(c));
    if (c->rms_px > 0)
        printf("%7.3f %7d\n", c->rms_px, c->corners);
    else
        printf("%7s %7s\n", "-", "-");
}

static void print_text(const struct sst_calib *calib, const char *format)
{
    int known = 0;

    for (int k = 0; k < calib->rows * calib->cols; k++)
        known += calib->camera[k].known;
    printf("%d camera%s in a grid of %d x %d, %d x %d pixels, format %s", known, known == 1 ? "" : "s", calib->rows,
           calib->cols, calib->width, calib->height, format);
    if (*calib->source)
        printf("\nfrom %s", calib->source);
    if (*calib->board)
        printf("\nboard %s", calib->board);
    if (calib->noise_px > 0)
        printf("\ncorner noise %.3f px per axis", calib->noise_px);
    if (calib->range_mm > 0)
        printf("\nworking range %.0f mm", calib->range_mm);
    printf("\n\n%3s %3s  %-16s %9s %9s %8s %8s %4s %9s %9s %9s %7s %7s %7s\n", "row", "col", "name", "fx px", "fy px",
           "cx px", "cy px", "lens", "x mm", "y mm", "z mm", "turn", "RMS px", "corners");
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (calib->camera[k].known)
            print_camera(calib, k);
    }
    printf("\n* reference, whose axes are those of all (x right, y down, z forward); lens: number of distortion\n"
           "coefficients; turn: degrees from the reference; RMS: of the corners used, per point.\n");
}

/* --- convert ------------------------------------------------------------------------------------------------------ */

struct request {
    const char *in, *out, *from, *to;
    bool json;
    struct sst_calib_format_config cfg;
};

static int convert(const struct request *q, const struct sst_calib *calib, const struct sst_calib_format *from)
{
    const struct sst_calib_format *to = q->to ? sst_calib_format_find(q->to) : sst_calib_format_for(q->out);
    int known = 0, err;

    if (!to)
        return -EINVAL;
    err = to->write(calib, q->out, &q->cfg);
    if (err)
        return err;
    for (int k = 0; k < calib->rows * calib->cols; k++)
        known += calib->camera[k].known;
    printf("%s: %d camera%s, %s from %s\n", q->out, known, known == 1 ? "" : "s", to->name, from->name);
    if (*to->lost)
        printf("not stored by %s: %s\n", to->name, to->lost);
    return 0;
}

static int work(const struct request *q, bool show)
{
    const struct sst_calib_format *from = q->from ? sst_calib_format_find(q->from) : sst_calib_format_of(q->in);
    struct sst_calib calib;
    int err = from ? 0 : q->from ? -EINVAL : -EBADMSG;

    if (!err && !from->read) {
        sst_log_error("%s: %s is a write-only format; convert the calibration that it was written from", q->in,
                      from->name);
        err = -EBADMSG;
    }
    err = err ? err : from->read(&calib, q->in, &q->cfg);
    if (err)
        return err;
    if (!show)
        err = convert(q, &calib, from);
    else if (q->json)
        err = print_json(&calib, from->name);
    else
        print_text(&calib, from->name);
    sst_calib_fini(&calib);
    return err;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct request q = { 0 };
    int grid[2] = { 0 }, size[2] = { 0 };
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &q.out, "OUT", "convert: file or folder to write" },
        { "from", 0, CLI_STRING, &q.from, "F", "format of IN (default: by its content)", 0, 0,
          "sst opencv opencv-stereo kalibr multical" },
        { "to", 0, CLI_STRING, &q.to, "F", "format of OUT (default: by its name)", 0, 0,
          "sst opencv opencv-stereo kalibr multical mrcal" },
        { "grid", 'g', CLI_GRID, grid, "RxC", "rows and columns, where IN does not have the cameras' positions", 1,
          256 },
        { "plain-names", 0, CLI_FLAG, &q.cfg.plain_names, NULL, "names such as 04_12 in IN are no places; add --grid" },
        { "size", 0, CLI_SIZE, size, "WxH", "size of the pictures, where IN does not have it", 1, SST_IMAGE_MAX_SIDE },
        { "unit-mm", 0, CLI_DOUBLE, &q.cfg.unit_mm, "U", "unit of the lengths in IN (OpenCV: 1, others: 1000)", 1e-6,
          1e6 },
        { "lossy", 0, CLI_FLAG, &q.cfg.lossy, NULL, "write lenses also where OUT's model is off by over 0.05 px" },
        { "force", 'f', CLI_FLAG, &q.cfg.force, NULL, "replace an earlier folder" },
        { "json", 0, CLI_FLAG, &q.json, NULL, "show: print one JSON object" },
    };
    const char *args[2];
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, args, 2, 2);
    bool show;

    if (r != CLI_GO_ON)
        return r;
    show = !strcmp(args[0], "show");
    if (!show && strcmp(args[0], "convert") != 0)
        return cli_usage_error(cmd, "unknown action `%s`;%s use show or convert", args[0],
                               sst_edit_hint(args[0], (const char *const[]){ "show", "convert", NULL }));
    if (!show && !q.out)
        return cli_usage_error(cmd, "-o OUT is missing");
    if (show && (q.out || q.to || q.cfg.lossy || q.cfg.force))
        return cli_usage_error(cmd, "show writes nothing; it does not combine with -o, --to, --lossy or --force");
    q.in = args[1];
    q.cfg.rows = grid[0];
    q.cfg.cols = grid[1];
    q.cfg.width = size[0];
    q.cfg.height = size[1];
    return cli_exit_code(work(&q, show));
}

const struct cli_command cli_calibration = { "calibration", run };
