/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/edit_distance.h"
#include "base/file.h"
#include "base/log.h"
#include "cli/cli_internal.h"
#include "cli/posed_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/video/mp4.h"

/* Setting that changes from picture to picture. */
enum over { OVER_FOCUS, OVER_CUT, OVER_VIEW_X, OVER_VIEW_Y, OVERS };

static const char *const over_names[OVERS] = { "focus", "cut", "view-x", "view-y" };
static const char *const over_keys[OVERS] = { "focus_px", "cut_px", "view_x", "view_y" };

struct sweep {
    const struct render_input *in;
    struct render_args args;
    enum over over;
    double from, to, fps;
    int steps;
    bool bounce;
    const char *out;
};

#define SWEEP_DEFAULTS                                                                                                 \
    {                                                                                                                  \
        .over = OVER_FOCUS, .from = NAN, .to = NAN, .fps = 10, .steps = 20                                             \
    }

static int frame_count(const struct sweep *s)
{
    return s->bounce && s->steps > 2 ? 2 * s->steps - 2 : s->steps;
}

/* When bouncing, frame `steps` repeats the last but one, and the first frame is not repeated. */
static double value_of(const struct sweep *s, int frame)
{
    const int step = frame < s->steps ? frame : 2 * s->steps - 2 - frame;

    return s->steps > 1 ? s->from + (s->to - s->from) * step / (s->steps - 1) : s->from;
}

static struct sst_render_config config_at(const struct sweep *s, double value)
{
    struct sst_render_config cfg = s->args.cfg;
    double *const what[OVERS] = { &cfg.focus_px, &cfg.cut_px, &cfg.view_bx, &cfg.view_by };

    *what[s->over] = value;
    return cfg;
}

static int render_frame(const struct sweep *s, int frame, struct sst_image *img)
{
    const struct sst_render_config cfg = config_at(s, value_of(s, frame));

    cli_progress((void *)"sweep", (double)frame / frame_count(s));
    return sst_render(s->in->renderer, &cfg, img, NULL);
}

static int write_description(const struct sweep *s, const char *dir)
{
    json_t *frames = json_array(), *root;
    char name[32];
    int err;

    for (int i = 0; i < frame_count(s); i++) {
        snprintf(name, sizeof(name), "%04d.png", i);
        json_array_append_new(frames, json_pack("{s:s, s:f}", "file", name, over_keys[s->over], value_of(s, i)));
    }
    root = json_pack("{s:s, s:s, s:f, s:o}", "source", s->in->path, "method", cli_render_method(&s->args), "fps",
                     s->fps, "frames", frames);
    err = cli_write_json(root, dir, "sweep.json");
    json_decref(root);
    return err;
}

static int write_folder(const struct sweep *s, struct sst_image *img)
{
    struct sst_outdir dir;
    char path[SST_PATH_MAX], name[32];
    int err = sst_outdir_open(&dir, s->out, s->args.force);

    if (err)
        return err;
    for (int i = 0; i < frame_count(s) && !err; i++) {
        snprintf(name, sizeof(name), "%04d.png", i);
        err = render_frame(s, i, img);
        err = err ? err : sst_path_join(path, dir.temporary, name);
        err = err ? err : sst_image_write_png(img, path);
    }
    err = err ? err : write_description(s, dir.temporary);
    return sst_outdir_end(&dir, err);
}

static int write_video(const struct sweep *s, struct sst_image *img)
{
    const struct sst_mp4_config cfg = { .width = img->width, .height = img->height, .rate_hz = s->fps };
    struct sst_mp4 *v = NULL;
    int err = sst_mp4_open(&v, s->out, &cfg);

    for (int i = 0; i < frame_count(s) && !err; i++) {
        err = render_frame(s, i, img);
        err = err ? err : sst_mp4_add(v, img);
    }
    err = err ? err : sst_mp4_commit(v);
    sst_mp4_close(v);
    return err;
}

/* Without --from and --to the whole range: of the disparities, far to near; of cuts, from the nearest disparity to the
 * cut found by itself, else to the middle; of the views' positions. */
static int find_ends(struct sweep *s)
{
    const struct sst_lightfield *lf = &s->in->lf;
    double lo = INFINITY, hi = -INFINITY;

    if (!isnan(s->from))
        return CLI_GO_ON;
    for (int i = 0; s->over > OVER_CUT && i < lf->rows * lf->cols; i++) {
        const double at = s->over == OVER_VIEW_X ? lf->views[i].bx : lf->views[i].by;

        if (lf->views[i].present) {
            lo = fmin(lo, at);
            hi = fmax(hi, at);
        }
    }
    if (s->over <= OVER_CUT && !sst_renderer_disparities(s->in->renderer, &lo, &hi)) {
        sst_log_error("%s has no disparities to sweep over; run `sst process %s` first, or give --from A and --to B",
                      s->in->path, s->in->path);
        return CLI_INPUT;
    }
    s->from = s->over == OVER_CUT ? hi : lo;
    s->to = s->over != OVER_CUT ? hi : isfinite(s->args.cfg.cut_px) ? s->args.cfg.cut_px : (lo + hi) / 2;
    sst_log_info("%s from %.2f to %.2f", over_names[s->over], s->from, s->to);
    return CLI_GO_ON;
}

/* Check both ends before rendering the first picture. */
static int check_ends(const struct sweep *s)
{
    const struct sst_render_config from = config_at(s, s->from), to = config_at(s, s->to);
    struct sst_ray rays[SST_MAX_VIEWS];
    int n = sst_render_rays(s->in->renderer, &from, 0, 0, rays);

    n = n < 0 ? n : sst_render_rays(s->in->renderer, &to, 0, 0, rays);
    return sst_min_int(n, 0);
}

static int make_sweep(const struct sweep *s)
{
    struct sst_image img = { 0 };
    int err = check_ends(s);

    if (err)
        return err;
    err = sst_image_init(&img, s->in->lf.width, s->in->lf.height);
    if (err)
        sst_log_error("no memory for a picture of %d x %d", s->in->lf.width, s->in->lf.height);
    if (!err)
        err = cli_has_suffix(s->out, ".mp4") ? write_video(s, &img) : write_folder(s, &img);
    cli_progress_end();
    sst_image_fini(&img);
    if (!err)
        cli_render_report_device(s->in);
    return err;
}

/* Of an opened light field. */
static int run_opened(struct sweep *s)
{
    const int r = find_ends(s);

    return r == CLI_GO_ON ? cli_exit_code(make_sweep(s)) : r;
}

int cli_sweep_loaded(const struct render_loaded *loaded, struct render_args *a, const char *out, int steps)
{
    struct sweep s = SWEEP_DEFAULTS;
    struct render_input in;
    int r;

    s.in = &in;
    s.args = *a;
    s.args.cfg.focus_px = 0;
    s.args.disparities_needed = true;
    s.args.pictures = s.steps = steps;
    s.out = out;
    r = cli_render_open_loaded(&in, &s.args, &cli_sweep, loaded);
    if (r != CLI_GO_ON)
        return r;
    r = run_opened(&s);
    cli_render_close(&in);
    return r;
}

/* Refuse an output that cannot be written, and a folder with the name of a video: its ending is another format's, or a
 * misspelt one. A slash at the end makes it a folder. */
static int check_output(const struct sweep *s, const char *path, const struct cli_command *cmd)
{
    static const char *const endings[] = { "mp4",  "mkv", "webm", "avi",  "mov",  "m4v",  "mpg", "mpeg", "gif", "png",
                                           "apng", "jpg", "jpeg", "webp", "tiff", "h264", "ogv", "wmv",  "y4m", NULL };
    const char *dot = strrchr(sst_path_base(s->out), '.');
    char ending[8] = "";

    if (cli_has_suffix(s->out, ".mp4"))
        return cli_exit_code(sst_path_check_new(s->out, true));
    for (size_t i = 0; dot && strlen(dot) < sizeof(ending) && dot[i]; i++)
        ending[i] = (char)tolower((unsigned char)dot[i + 1]);
    for (int i = 0; strlen(ending) > 2 && endings[i]; i++) {
        if (sst_edit_distance(ending, endings[i]) <= 1)
            return cli_usage_error(
                cmd,
                "-o %s looks like a file; a sweep makes a video that ends in .mp4, or a folder of PNG "
                "files: for one of that name write %s/",
                s->out, s->out);
    }
    return cli_exit_code(
        sst_path_check_output(s->out, s->args.force, "sweep.json", (const char *const[]){ path, NULL }));
}

/* Read the setting that changes; by default the focus, or the cut of clear pictures. */
static int read_over(struct sweep *s, int over, double focus, const struct cli_command *cmd)
{
    const bool clear = s->args.cfg.method == SST_RENDER_CLEAR;

    s->over = over >= 0 ? (enum over)over : clear ? OVER_CUT : OVER_FOCUS;
    if (clear ? s->over == OVER_FOCUS : s->over == OVER_CUT)
        return cli_usage_error(cmd, "--over %s has no effect with --method %s", over_names[s->over],
                               cli_render_method(&s->args));
    if (!isnan(focus) && (clear || s->over == OVER_FOCUS))
        return cli_usage_error(cmd, clear ? "--focus has no effect with --method clear"
                                          : "--focus has no effect in a sweep over the focus");
    if (s->over == OVER_CUT)
        s->args.cut = s->from;
    s->args.cfg.focus_px = s->over == OVER_FOCUS ? 0 : focus;
    return CLI_GO_ON;
}

/* A light field with a pose for every view: the whole surface is raised. */
static int run_posed(const struct cli_command *cmd, struct sweep *s, const char *path, int over, char **argv)
{
    struct posed_sweep sweep = { s->from, s->to, s->steps, s->bounce, s->fps, s->out, { 0, 0 } };
    struct posed_scene scene;
    int r;

    if (over >= 0 && over != OVERS)
        return cli_usage_error(cmd, "--over %s: light fields with a pose for every view are swept over height",
                               over_names[over]);
    r = check_output(s, path, cmd);
    if (r != CLI_OK)
        return r;
    r = cli_posed_open(&scene, cmd, &s->args, path, argv);
    if (r != CLI_GO_ON)
        return r;
    r = cli_posed_sweep(&scene, &s->args, &sweep);
    cli_posed_close(&scene);
    return r;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sweep s = SWEEP_DEFAULTS;
    struct render_input in;
    const char *path;
    int over = -1;
    double focus = NAN;
    struct cli_option options[RENDER_OPTIONS + 8] = {
        { "from", 0, CLI_DOUBLE, &s.from, "A",
          "first focus (or cut), disparity in px per spacing; default: the whole range" },
        { "to", 0, CLI_DOUBLE, &s.to, "B", "last focus" },
        { "over", 0, CLI_WORD, &over, "W",
          "setting that changes: focus, cut, view-x or view-y (focus; clear: cut); posed: height, m", 0, 0,
          "focus cut view-x view-y height" },
        { "focus", 'f', CLI_AUTO, &focus, "D", "focus of a sweep over the viewpoint, or auto (default)" },
        { "steps", 'n', CLI_INT, &s.steps, "N", "pictures from A to B (20)", 1, 9999 },
        { "output", 'o', CLI_MADE, &s.out, "DIR", "folder of PNG files, or a video if it ends in .mp4" },
        { "fps", 0, CLI_DOUBLE, &s.fps, "F", "pictures per second of the video (10)", 0.1, 240 },
        { "bounce", 0, CLI_FLAG, &s.bounce, NULL, "go back to A as well, so that the video can loop" },
    };
    int r;

    cli_render_options(options + 8, &s.args);
    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &path, 1, 1);
    if (r != CLI_GO_ON)
        return r;
    if (isnan(s.from) != isnan(s.to))
        return cli_usage_error(cmd, "--from A and --to B must be given together");
    if (!s.out)
        return cli_usage_error(cmd, "-o DIR or -o FILE.mp4 is missing");
    cli_render_names(&s.args);
    if (sst_posed_is(path))
        return run_posed(cmd, &s, path, over, argv + 1);
    r = cli_render_check_posed(&s.args, cmd, path);
    if (r == CLI_GO_ON && over == OVERS)
        r = cli_usage_error(cmd, "--over height is for light fields with a pose for every view");
    if (r == CLI_GO_ON)
        r = read_over(&s, over, focus, cmd);
    if (r != CLI_GO_ON)
        return r;
    r = check_output(&s, path, cmd);
    if (r != CLI_OK)
        return r;
    s.args.pictures = frame_count(&s);
    s.args.disparities_needed = s.over == OVER_FOCUS && isnan(s.from);
    r = cli_render_open(&in, &s.args, cmd, path);
    if (r != CLI_GO_ON)
        return r;
    s.in = &in;
    r = run_opened(&s);
    if (!r && !s.args.json)
        cli_render_report_skips(&in, s.out);
    if (!r && s.args.json) {
        cli_dump_json(json_pack("{s:s, s:i, s:s, s:f, s:f, s:o, s:o}", "output", s.out, "frames", frame_count(&s),
                                "over", over_names[s.over], s.over > OVER_CUT ? "from" : "from_px", s.from,
                                s.over > OVER_CUT ? "to" : "to_px", s.to, "device", cli_render_device_json(&in), "skip",
                                cli_render_skips_json(&in, &s.args)),
                      JSON_INDENT(2));
    }
    cli_render_close(&in);
    return r;
}

const struct cli_command cli_sweep = { "sweep", run };
