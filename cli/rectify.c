/* sst rectify: attach a calibration to a light field of raw frames, or resample it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

int cli_use_calibration(struct sst_use_calibration *use, const struct cli_command *cmd, const char *path,
                        const char *filter)
{
    int err;

    if (!sst_filter_find(&use->filter, filter))
        return cli_usage_error(cmd, "--filter %s is none of bilinear, bicubic or lanczos", filter);
    err = sst_use_calibration_read(use, path);
    return err ? cli_exit_code(err) : CLI_GO_ON;
}

/* The largest distance of a camera from the plane. */
static double worst_dz(const struct sst_rectified *to)
{
    double worst = 0;

    for (int k = 0; k < to->rows * to->cols; k++) {
        if (to->view[k].known)
            worst = fmax(worst, fabs(to->view[k].dz_mm));
    }
    return worst;
}

static int print_json(const struct sst_lightfield *lf, const struct sst_rectified_coverage *worst,
                      const struct sst_rectified_coverage *mean)
{
    const struct sst_rectified *to = lf->rectified;
    json_t *root = json_pack(
        "{s:i, s:i, s:f, s:[f, f], s:f, s:[f, f], s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:s, s:{s:f, s:f}, s:{s:f, s:f}}",
        "width", to->width, "height", to->height, "focal_px", to->focal_px, "principal_px", to->cx, to->cy,
        "spacing_mm", to->spacing_mm, "step_mm", to->step_mm[0], to->step_mm[1], "skew_deg", to->skew_deg,
        "lattice_rms_mm", to->lattice_rms_mm, "lattice_max_mm", to->lattice_max_mm, "out_rms_mm", to->out_rms_mm,
        "out_max_mm", to->out_max_mm, "dz_max_mm", worst_dz(to), "plane_mm", to->plane_mm, "filter",
        sst_filter_name((enum sst_filter)lf->filter), "filled", "mean", mean->filled, "worst", worst->filled, "kept",
        "mean", mean->kept, "worst", worst->kept);

    return cli_print_json(root);
}

static void print_text(const struct sst_lightfield *lf, const struct sst_rectified_coverage *worst,
                       const struct sst_rectified_coverage *mean)
{
    const struct sst_rectified *to = lf->rectified;
    const double dz = worst_dz(to);

    printf("common view: %dx%d, focal length %.2f px, principal point %.2f, %.2f, filter %s\n", to->width, to->height,
           to->focal_px, to->cx, to->cy, sst_filter_name((enum sst_filter)lf->filter));
    printf("lattice: steps %.3f and %.3f mm, %+.3f degrees from square; centres off it by %.3f mm RMS, %.3f mm at most "
           "(their true positions are used)\n",
           to->step_mm[0], to->step_mm[1], to->skew_deg, to->lattice_rms_mm, to->lattice_max_mm);
    printf("plane: centres off it by %.3f mm RMS, %.3f mm at most; ", to->out_rms_mm, to->out_max_mm);
    if (to->plane_mm > 0)
        printf("exact at %.0f mm, off by up to %.2f px at half of that\n", to->plane_mm,
               dz / to->plane_mm * hypot(to->width, to->height) / 2);
    else
        printf("exact at infinity\n");
    printf("pictures: %.1f %% filled (worst view %.1f %%), %.1f %% of the raw frames kept (worst %.1f %%)\n",
           100 * mean->filled, 100 * worst->filled, 100 * mean->kept, 100 * worst->kept);
}

/* Figures of the result; the geometry is that of the calibrated light field, which a baked one no longer holds. */
static int report(const char *out, struct sst_lightfield *calibrated, int threads, bool json)
{
    struct sst_rectified_coverage worst, mean;
    int err = sst_lightfield_coverage(calibrated, threads, &worst, &mean);

    if (!err && !json)
        err = cli_print_lightfield(out, out);
    if (err)
        return cli_exit_code(err);
    if (json)
        return print_json(calibrated, &worst, &mean);
    print_text(calibrated, &worst, &mean);
    return CLI_OK;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_rectify_dir_config cfg = { .progress = cli_progress, .progress_arg = (char[]){ "rectify" } };
    const char *calib = NULL, *filter = NULL;
    double focal = 0, plane = -1;
    struct sst_lightfield lf = { 0 };
    struct sst_use_calibration use;
    char own[SST_PATH_MAX];
    int size[2] = { 0, 0 }, err, r;
    bool json = false;
    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &cfg.out, "OUT", "light-field folder to write" },
        { "calib", 0, CLI_STRING, &calib, "FILE", "the array's calibration; default: the light field's own" },
        { "filter", 0, CLI_STRING, &filter, "F", "bilinear, bicubic (default) or lanczos", 0, 0, "bilinear bicubic lanczos" },
        { "focal", 0, CLI_DOUBLE, &focal, "PX", "focal length of the views; default: the cameras' mean", 1, 1e7 },
        { "plane", 0, CLI_DOUBLE, &plane, "MM",
          "depth at which views off the array's plane are exact; inf; default: "
          "the depth of the boards",
          1, (double)INFINITY },
        { "size", 0, CLI_SIZE, size, "WxH", "pixels of a view; default: the cameras'", 1, SST_IMAGE_MAX_SIDE },
        { "bake", 0, CLI_FLAG, &cfg.bake, NULL, "write rectified PNG views instead of raw frames and calibration" },
        { "threads", 't', CLI_INT, &cfg.threads, "N", "threads (all processors)", 1, 256 },
        { "force", 'f', CLI_FLAG, &cfg.force, NULL, "replace an existing light field" },
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };

    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &cfg.dir, 1, 1);
    if (r != CLI_GO_ON)
        return r;
    if (!cfg.out)
        return cli_usage_error(cmd, "-o OUT is missing");
    sst_use_calibration_defaults(&use);
    use.plan = (struct sst_rectify_config){
        .width = size[0], .height = size[1], .focal_px = focal, .plane_mm = isinf(plane) ? 0 : plane
    };
    /* Other settings need a new plan, of the light field's own calibration unless another is given. */
    if (!calib && (filter || focal > 0 || plane >= 0 || size[0])) {
        err = sst_path_join(own, cfg.dir, SST_CALIBRATION_FILE);
        if (err)
            return cli_exit_code(err);
        calib = own;
    }
    if (calib) {
        r = cli_use_calibration(&use, cmd, calib, filter ? filter : "bicubic");
        if (r != CLI_GO_ON)
            return r;
        cfg.use = &use;
    }
    err = sst_lightfield_rectify_dir(&cfg, &lf);
    cli_progress_end();
    r = err ? cli_exit_code(err) : report(cfg.out, &lf, cfg.threads, json);
    sst_lightfield_fini(&lf);
    sst_use_calibration_fini(&use);
    return r;
}

const struct cli_command cli_rectify = { "rectify", run };
