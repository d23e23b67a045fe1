/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/stats.h"
#include "cli/cli_internal.h"
#include "cli/posed_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/correction.h"

#define MAX_REPEAT 1000

struct picture {
    struct sst_image image;
    struct sst_map_u8 valid;
    double ms[MAX_REPEAT]; /* of each repeat, ascending */
    int repeat;
};

static int make_picture(struct picture *p, const struct render_input *in, const struct sst_render_config *cfg)
{
    int err = sst_image_init(&p->image, in->lf.width, in->lf.height);

    err = err ? err : sst_map_u8_init(&p->valid, in->lf.width, in->lf.height);
    if (err)
        sst_log_error("no memory for a picture of %d x %d", in->lf.width, in->lf.height);
    /* The first call counts the labels' disparities once per light field, and the supported pixels; it is not timed. */
    err = err ? err : sst_render(in->renderer, cfg, &p->image, &p->valid);
    for (int i = 0; i < p->repeat && !err; i++) {
        const int64_t start_ns = sst_clock_now_ns();

        err = sst_render(in->renderer, cfg, &p->image, NULL);
        p->ms[i] = (double)(sst_clock_now_ns() - start_ns) * 1e-6;
    }
    sst_stats_sort_double(p->ms, p->repeat);
    return err;
}

/* Reason for which a picture cannot have more than 256 levels; NULL: none. */
static const char *only_levels(const struct sst_lightfield *lf, int before, int after)
{
    return !before                             ? "its views have 8 bits"
           : before == after                   ? "" /* none is lost */
           : lf->calibration || lf->images_raw ? "its views are rectified from raw frames"
           : lf->correction                    ? "its views are corrected (`sst process --align off` leaves them alone)"
                                               : NULL;
}

/* The picture in the samples of the views: of all their levels where that can be. */
static int write_samples(const struct picture *p, const struct render_input *in, const struct sst_render_config *cfg,
                         const char *out)
{
    const int views = in->lf.rows * in->lf.cols;
    struct sst_map_u16(*deep)[3], picture[3] = { 0 };
    int before, after, err = sst_lightfield_levels(&in->lf, in->path, false, &before, &after);
    const char *why = err ? NULL : only_levels(&in->lf, before, after);
    int64_t coarse = 0;

    if (err)
        return err;
    if (why) {
        if (*why)
            sst_log_warning("%s has 256 levels between samples %d and %d: %s", out, in->lf.samples.black,
                            in->lf.samples.white ? in->lf.samples.white : 65535, why);
        return sst_image_write_samples(&p->image, in->lf.samples, out);
    }
    deep = calloc((size_t)views, sizeof(*deep));
    err = deep ? sst_lightfield_read_deep(deep, &in->lf, in->path, cfg->threads) : -ENOMEM;
    for (int c = 0; c < 3 && !err; c++)
        err = sst_map_u16_init(&picture[c], in->lf.width, in->lf.height);
    if (err == -ENOMEM)
        sst_log_error("no memory for the samples of %d views", views);
    err = err ? err
              : sst_render_deep(in->renderer, cfg, picture, &p->image, (const struct sst_map_u16(*)[3])deep, &coarse);
    if (!err && coarse)
        sst_log_info("%s: %.1f %% of the pixels have one of 256 levels: no ray shows them, or rays were verified", out,
                     100.0 * (double)coarse / ((double)in->lf.width * in->lf.height));
    err = err ? err : sst_image_write_deep(picture, out);
    for (int i = 0; deep && i < 3 * views; i++)
        sst_map_u16_fini(&deep[i / 3][i % 3]);
    for (int c = 0; c < 3; c++)
        sst_map_u16_fini(&picture[c]);
    free(deep);
    return err;
}

static double share_percent(const struct sst_map_u8 *map, uint8_t value)
{
    int64_t n = 0;

    for (int y = 0; y < map->height; y++) {
        for (int x = 0; x < map->width; x++)
            n += sst_map_u8_row(map, y)[x] == value;
    }
    return 100.0 * (double)n / ((double)map->width * map->height);
}

/* Removed surfaces, and the part of the picture that no view shows. */
static void report_clear(json_t *root, const struct picture *p, const struct render_args *a)
{
    json_object_set_new(root, "cut_px", cli_real_json(isfinite(a->cfg.cut_px) ? a->cfg.cut_px : NAN));
    json_object_set_new(root, "remove_label", a->remove_label ? json_string(a->remove_label) : json_null());
    json_object_set_new(root, "remove_at", a->remove_at ? json_string(a->remove_at) : json_null());
    json_object_set_new(root, "seen_percent", json_real(share_percent(&p->valid, 255)));
    json_object_set_new(root, "filled_percent", json_real(share_percent(&p->valid, 64)));
}

static void print_report(const struct picture *p, const struct render_input *in, const struct render_args *a,
                         const char *out)
{
    const double supported = share_percent(&p->valid, 255);

    cli_render_report_skips(in, out);
    if (a->focus_found)
        printf("%s: focus %.2f px per spacing, found by itself\n", out, a->cfg.focus_px);
    if (p->repeat)
        printf("%s: %.1f ms (median of %d, fastest %.1f ms)\n", out, p->ms[p->repeat / 2], p->repeat, p->ms[0]);
    if (a->cfg.method == SST_RENDER_CLEAR && isfinite(a->cfg.cut_px))
        sst_log_info("removed what is nearer than %.2f px per spacing; %.2f %% of the pixels are filled from "
                     "their surroundings: fewer than two views show them",
                     a->cfg.cut_px, 100 - supported);
    else if (a->cfg.method == SST_RENDER_CLEAR)
        sst_log_info("%.2f %% of the pixels are filled from their surroundings: fewer than two views show them",
                     100 - supported);
    else if (supported < 100)
        sst_log_info("%.2f %% of the pixels are unsupported: none of their rays ends at the focus", 100 - supported);
}

static json_t *report_json(const struct picture *p, const struct render_input *in, const struct render_args *a,
                           const char *out)
{
    json_t *root = json_pack("{s:s, s:s, s:i, s:i}", "output", out, "method", cli_render_method(a), "width",
                             p->image.width, "height", p->image.height);
    double lo, hi;

    if (a->cfg.method == SST_RENDER_CLEAR)
        report_clear(root, p, a);
    else
        json_object_update_new(root, json_pack("{s:f, s:b, s:f}", "focus_px", a->cfg.focus_px, "focus_found",
                                               a->focus_found, "supported_percent", share_percent(&p->valid, 255)));
    json_object_set_new(root, "device", cli_render_device_json(in));
    json_object_set_new(root, "skip", cli_render_skips_json(in, a));
    if (in->lf.calibration || in->lf.correction) {
        const bool raw = (in->lf.images_raw && !in->rectified) || sst_lightfield_has_originals(&in->lf);

        json_object_set_new(root, "sampling", json_string(raw ? "raw" : "rectified"));
    }
    if (a->label)
        json_object_set_new(root, "label", json_string(a->label));
    if (a->cfg.method == SST_RENDER_SST) {
        const double confirmed = sst_renderer_confirmed(in->renderer);

        json_object_set_new(root, "verify_rays", json_string((const char *[]){ "off", "on", "auto" }[a->cfg.verify]));
        json_object_set_new(root, "confirmed_percent", cli_real_json(100 * confirmed));
    }
    if (sst_renderer_disparities(in->renderer, &lo, &hi))
        json_object_set_new(root, "disparity_px", json_pack("[f, f]", lo, hi));
    if (p->repeat)
        json_object_set_new(
            root, "render_ms",
            json_pack("{s:f, s:f, s:i}", "median", p->ms[p->repeat / 2], "min", p->ms[0], "repeat", p->repeat));
    return root;
}

static void report(const struct picture *p, const struct render_input *in, const struct render_args *a, const char *out)
{
    cli_render_report_device(in);
    if (a->json)
        cli_dump_json(report_json(p, in, a, out), JSON_INDENT(2));
    else
        print_report(p, in, a, out);
}

int cli_render_loaded(const struct render_loaded *loaded, struct render_args *a, const char *out, json_t **report)
{
    struct picture picture = { 0 };
    struct render_input in;
    int err, r = cli_render_open_loaded(&in, a, &cli_render, loaded);

    if (r != CLI_GO_ON)
        return r;
    err = make_picture(&picture, &in, &a->cfg);
    err = err ? err : sst_image_write_png(&picture.image, out);
    if (!err) {
        cli_render_report_device(&in);
        *report = report_json(&picture, &in, a, sst_path_base(out));
        err = *report ? 0 : -ENOMEM;
    }
    sst_image_fini(&picture.image);
    sst_map_u8_fini(&picture.valid);
    cli_render_close(&in);
    return cli_exit_code(err);
}

/* Parse "X,Y"; default: the centre. */
static int read_pixel(const struct cli_command *cmd, const char *text, const struct sst_lightfield *lf, int pixel[2])
{
    pixel[0] = lf->width / 2;
    pixel[1] = lf->height / 2;
    if (text && !cli_read_pair(text, ',', pixel))
        return cli_usage_error(cmd, "--explain-pixel %s is not X,Y, for example 500,375", text);
    if (pixel[0] >= lf->width || pixel[1] >= lf->height)
        return cli_usage_error(cmd, "--explain-pixel %s is outside the picture of %d x %d", text, lf->width,
                               lf->height);
    return CLI_GO_ON;
}

static int check_files(const struct cli_command *cmd, const struct render_args *a, double focus, const char *out,
                       const char *valid)
{
    const bool clear = a->cfg.method == SST_RENDER_CLEAR;

    if (!isnan(focus) && clear)
        return cli_usage_error(cmd, "--focus has no effect with --method clear, which is in focus everywhere");
    if (!out)
        return cli_usage_error(cmd, "-o FILE is missing");
    if (!cli_has_suffix(out, ".png") && !cli_has_suffix(out, ".jpg") && !cli_has_suffix(out, ".jpeg"))
        return cli_usage_error(cmd, "-o %s ends neither in .png nor in .jpg", out);
    if (valid && !cli_has_suffix(valid, ".png"))
        return cli_usage_error(cmd, "--valid %s does not end in .png", valid);
    return CLI_GO_ON;
}

/* A light field with a pose for every view. */
static int run_posed(const struct cli_command *cmd, const struct render_args *a, const char *path, char **argv,
                     const char *const files[2])
{
    static const char *const endings[] = { ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".pfm" };
    struct posed_scene scene;
    bool known = false;
    int r;

    if (!files[0])
        return cli_usage_error(cmd, "-o FILE is missing");
    for (size_t i = 0; i < ARRAY_LEN(endings); i++)
        known |= cli_has_suffix(files[0], endings[i]);
    if (!known)
        return cli_usage_error(cmd, "-o %s ends neither in .png, .jpg, .tif nor .pfm", files[0]);
    if (files[1] && !cli_has_suffix(files[1], ".png"))
        return cli_usage_error(cmd, "--valid %s does not end in .png", files[1]);
    r = cli_posed_open(&scene, cmd, a, path, argv);
    if (r != CLI_GO_ON)
        return r;
    if (scene.posed.channels > 1 && cli_has_suffix(files[0], ".pfm"))
        r = cli_usage_error(cmd, "-o %s: a PFM has one channel, and the views are coloured; .tif has 16 bits",
                            files[0]);
    else if (a->levels && !cli_has_suffix(files[0], ".jpg") && !cli_has_suffix(files[0], ".jpeg"))
        r = cli_usage_error(cmd, "--levels: %s keeps all levels; a .jpg is stretched by them", files[0]);
    else
        r = cli_posed_render(&scene, a, files[0], files[1]);
    cli_posed_close(&scene);
    return r;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    const char *path, *out = NULL, *explain = NULL, *pixel_text = NULL, *valid = NULL;
    struct picture picture = { 0 };
    struct render_input in;
    struct render_args a;
    double focus = NAN;
    bool samples = false;
    struct cli_option options[RENDER_OPTIONS + 7] = {
        { "focus", 'f', CLI_AUTO, &focus, "D",
          "disparity to focus on, px per spacing, or auto: behind the foreground (default)" },
        { "output", 'o', CLI_FILE, &out, "FILE", "picture, .png or .jpg; posed: also .tif and .pfm" },
        { "samples", 0, CLI_FLAG, &samples, NULL,
          "16-bit PNG in the samples of the views, of all their levels unless they are corrected or rectified; slow" },
        { "valid", 0, CLI_FILE, &valid, "FILE", "PNG of support by rays: 255 seen, 64 filled, 0 none", 0, 0 },
        { "repeat", 0, CLI_INT, &picture.repeat, "N", "render N times more and print the median time", 1, MAX_REPEAT },
        { "explain", 0, CLI_MADE, &explain, "DIR", "write maps and weights that explain the picture" },
        { "explain-pixel", 0, CLI_STRING, &pixel_text, "X,Y", "pixel with the rays to explain (the centre)" },
    };
    int r, err, pixel[2] = { 0, 0 };

    cli_render_options(options + 7, &a);
    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &path, 1, 1);
    if (r != CLI_GO_ON)
        return r;
    cli_render_names(&a);
    if (sst_posed_is(path))
        return run_posed(cmd, &a, path, argv + 1, (const char *const[]){ out, valid });
    r = cli_render_check_posed(&a, cmd, path);
    if (r == CLI_GO_ON)
        r = check_files(cmd, &a, focus, out, valid);
    if (r == CLI_GO_ON && samples && !cli_has_suffix(out, ".png"))
        r = cli_usage_error(cmd, "--samples writes PNG; -o %s does not end in .png", out);
    if (r != CLI_GO_ON)
        return r;
    err = !explain ? 0 : sst_path_check_output(explain, a.force, "explain.json", (const char *const[]){ path, NULL });
    if (err)
        return cli_exit_code(err);
    a.cfg.focus_px = focus;
    a.views_needed = explain;
    r = cli_render_open(&in, &a, cmd, path);
    if (r != CLI_GO_ON)
        return r;
    r = read_pixel(cmd, pixel_text, &in.lf, pixel);
    if (r == CLI_GO_ON) {
        err = make_picture(&picture, &in, &a.cfg);
        if (!err && explain)
            err = cli_render_explain(&in, &a, explain, pixel[0], pixel[1]);
        if (!err)
            err = samples                       ? write_samples(&picture, &in, &a.cfg, out)
                  : cli_has_suffix(out, ".png") ? sst_image_write_png(&picture.image, out)
                                                : sst_image_write_jpeg(&picture.image, out, 95);
        if (!err && valid)
            err = sst_map_u8_write_png(&picture.valid, valid, NULL);
        if (!err)
            report(&picture, &in, &a, out);
        r = cli_exit_code(err);
    }
    sst_image_fini(&picture.image);
    sst_map_u8_fini(&picture.valid);
    cli_render_close(&in);
    return r;
}

const struct cli_command cli_render = { "render", run };
