/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"
#include "cli/render_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/method/render/device.h"
#include "pipeline/method/render/focus.h"

void cli_render_options(struct cli_option options[RENDER_OPTIONS], struct render_args *a)
{
    struct sst_render_config *cfg = &a->cfg;

    *a = (struct render_args){ .device = "cpu", .cut = NAN, .pictures = 1 };
    sst_render_config_defaults(cfg);
    const struct cli_option made[RENDER_OPTIONS] = {
        { "method", 'm', CLI_WORD, &cfg->method, "M", "see-through or sst (default), refocus (all rays alike) or clear",
          0, 0, "refocus sst clear see-through" },
        { "cut", 0, CLI_DOUBLE, &a->cut, "D", "clear: remove all nearer than D px per spacing (found by itself)", 0,
          0 },
        { "remove-label", 0, CLI_STRING, &a->remove_label, "NAME", "clear: remove objects with this label" },
        { "remove-at", 0, CLI_STRING, &a->remove_at, "X,Y", "clear: remove the object at this pixel" },
        { "label", 'l', CLI_STRING, &a->label, "NAME", "focus label: the other labels weigh less" },
        { "label-factor", 0, CLI_DOUBLE, &cfg->label_factor, "F", "by this factor (2)", 1, 1e6 },
        { "sigma", 0, CLI_DOUBLE, &cfg->sigma_px, "S", "depth weight: width in px per spacing, or inf (range / 10)",
          1e-6, INFINITY },
        { "c1", 0, CLI_DOUBLE, &cfg->c1, "C", "depth weight: least weight, 0..1 (0.005)", 0, 1 },
        { "c2", 0, CLI_DOUBLE, &cfg->c2, "C", "label weight: least weight, 0..1 (0.02; 1: labels ignored)", 0, 1 },
        { "range", 0, CLI_WORD, &cfg->range, "R", "depth range of a label: object (default), percentile, minmax", 0, 0,
          "object percentile minmax" },
        { "percentile", 0, CLI_DOUBLE, &cfg->range_percentile, "P", "share cut off at each end of a range (0.01)", 0,
          0.5 },
        { "unsupported", 0, CLI_WORD, &cfg->unsupported, "U",
          "pixels without a ray that ends at the focus: shown (refocus, default) or black (invalid)", 0, 0,
          "refocus invalid" },
        CLI_VERIFY_OPTION(cfg->verify),
        { "aperture", 'a', CLI_DOUBLE, &cfg->aperture, "R", "use views within R spacings of the viewpoint", 0,
          INFINITY },
        { "f-stop", 0, CLI_DOUBLE, &a->f_stop, "N", "the same as 1/N of the widest aperture, N >= 1", 1, 1e6 },
        { "soft", 0, CLI_FLAG, &cfg->aperture_soft, NULL, "aperture that fades towards its rim" },
        { "max-views", 0, CLI_INT, &cfg->max_views, "N", "use at most the N views nearest to the viewpoint", 1,
          SST_MAX_VIEWS },
        { "view-x", 0, CLI_DOUBLE, &cfg->view_bx, "BX", "viewpoint, spacings right of the reference view",
          -SST_MAX_VIEWS, SST_MAX_VIEWS },
        { "view-y", 0, CLI_DOUBLE, &cfg->view_by, "BY", "viewpoint, spacings below the reference view", -SST_MAX_VIEWS,
          SST_MAX_VIEWS },
        { "sampling", 0, CLI_WORD, &a->sampling, "S",
          "calibrated or corrected views: straight from the files, from resampled views, or auto", 0, 0,
          "auto raw rectified" },
        CLI_NO_VERIFY_OPTION(a->no_verify),
        { "device", 0, CLI_STRING, &a->device, "D",
          "where rays are summed: cpu (default), gpu, auto (gpu if there is one) or a part of a device's name", 0, 0 },
        { "device-memory", 0, CLI_INT, &a->device_memory, "MIB", CLI_DEVICE_MEMORY_HELP, 1, 1 << 24 },
        { "skip", 0, CLI_STRING, &a->skip, "LIST",
          "rays: leave rays or their weights out where that changes little; none (default: exact)", 0, 0 },
        { "skip-error", 0, CLI_DOUBLE, &cfg->skip_error_db, "DB",
          "least PSNR with skips against the exact picture (50)", 20, 100 },
        { "threads", 't', CLI_INT, &cfg->threads, "N", "threads (all processors)", 1, 256 },
        { "surface", 0, CLI_STRING, &a->surface, "S",
          "posed: ground (found, default), plane:Z, plane:NX,NY,NZ,D, three points plane:X,Y,Z,... or a terrain file" },
        { "levels", 0, CLI_STRING, &a->levels, "LOW,HIGH",
          "posed, 16 bits: the levels that become black and white in .jpg and videos (found)" },
        { "utm", 0, CLI_STRING, &a->utm, "ZONE", "posed: UTM zone of a terrain file that does not name it, as 33N" },
        { "view", 0, CLI_STRING, &a->view, "NAME", "posed: the view to render from (the middle one), or nadir" },
        { "near", 0, CLI_DOUBLE, &a->near_m, "M", "posed: the ground is sought from this distance on", 1e-3, 1e6 },
        { "far", 0, CLI_DOUBLE, &a->far_m, "M", "... up to this one (by the points of the scene)", 1e-3, 1e6 },
        { "force", 0, CLI_FLAG, &a->force, NULL, "replace an existing folder" },
        { "json", 0, CLI_FLAG, &a->json, NULL, "print one JSON object" },
    };

    memcpy(options, made, sizeof(made));
}

const char *cli_render_method(const struct render_args *a)
{
    return (const char *[]){ "refocus", "sst", "clear" }[a->cfg.method];
}

void cli_render_names(struct render_args *a)
{
    if ((int)a->cfg.method == SST_RENDER_CLEAR + 1)
        a->cfg.method = SST_RENDER_SST;
}

int cli_render_check_posed(const struct render_args *a, const struct cli_command *cmd, const char *path)
{
    const bool posed = a->surface || a->utm || a->levels || a->view || a->near_m > 0 || a->far_m > 0;

    if (posed && !sst_path_is_dir(path)) {
        sst_log_error("%s: there is no such folder", path);
        return CLI_INPUT;
    }
    if (posed)
        return cli_usage_error(cmd, "--surface, --utm, --view, --near, --far and --levels are for light fields with a pose "
                                    "for every view (`sst import poses`); lattices have --focus, --view-x and --view-y");
    return CLI_GO_ON;
}

/* Skips; `views` and `tiles` of earlier versions equal `rays`. */
static int read_skips(struct render_args *a, const struct cli_command *cmd)
{
    const struct cli_skip skips[] = { { "rays", &a->cfg.skip_rays },
                                      { "views", &a->cfg.skip_rays },
                                      { "tiles", &a->cfg.skip_rays } };
    const int r = cli_read_skips(cmd, "skip", a->skip, skips, ARRAY_LEN(skips));

    if (r != CLI_GO_ON || !a->cfg.skip_rays)
        return r;
    if (a->cfg.method == SST_RENDER_CLEAR)
        return cli_usage_error(cmd,
                               "--skip %s has no effect with --method clear, which stops at the 16 nearest views "
                               "that see a pixel's surface anyway",
                               a->skip);
    if (strcmp(a->device, "cpu"))
        return cli_usage_error(cmd, "--skip %s and --device %s contradict each other: devices sum all rays", a->skip,
                               a->device);
    return CLI_GO_ON;
}

static int check_options(struct render_args *a, const struct cli_command *cmd)
{
    if ((a->views_needed || a->remove_at) && a->sampling == RENDER_RAW)
        return cli_usage_error(cmd, "--explain and --remove-at need rectified views; leave out --sampling raw");
    if (a->f_stop > 0 && isfinite(a->cfg.aperture))
        return cli_usage_error(cmd, "--aperture and --f-stop set the same value; use one of them");
    if (a->label && a->cfg.method != SST_RENDER_SST)
        return cli_usage_error(cmd, "--label has no effect with --method %s, which focuses on no label",
                               cli_render_method(a));
    if (a->cfg.method != SST_RENDER_CLEAR && (!isnan(a->cut) || a->remove_label || a->remove_at))
        return cli_usage_error(cmd, "--cut, --remove-label and --remove-at need --method clear");
    return read_skips(a, cmd);
}

/* Number of a label that occurs in the light field. @param option  that asks for it */
static int find_label(struct render_input *in, const char *option, const char *name, int *out,
                      const struct cli_command *cmd)
{
    const struct sst_classes *classes = &in->lf.classes;
    char list[512] = "";
    int labels[255], n, label;

    if (!name)
        return CLI_GO_ON;
    n = sst_renderer_labels(in->renderer, labels);
    if (!n) {
        sst_log_error("%s has no labels; run `sst process %s` first, or leave out --%s", in->path, in->path, option);
        return CLI_INPUT;
    }
    label = sst_classes_find(classes, name);
    for (int i = 0; i < n; i++) {
        if (labels[i] == label) {
            *out = label;
            return CLI_GO_ON;
        }
        snprintf(list + strlen(list), sizeof(list) - strlen(list), "%s%s", i ? ", " : "",
                 sst_classes_name(classes, labels[i]));
    }
    return cli_usage_error(cmd, "the label %s does not occur in %s, which has %s", name, in->path, list);
}

/* Find the object of --remove-at in all views. */
static int find_object(struct render_input *in, const struct render_args *a, const struct cli_command *cmd)
{
    int at[2], err;

    if (!cli_read_pair(a->remove_at, ',', at))
        return cli_usage_error(cmd, "--remove-at %s is not X,Y, for example 500,375", a->remove_at);
    if (at[0] >= in->lf.width || at[1] >= in->lf.height)
        return cli_usage_error(cmd, "--remove-at %s is outside the picture of %d x %d", a->remove_at, in->lf.width,
                               in->lf.height);
    in->removed = calloc((size_t)(in->lf.rows * in->lf.cols), sizeof(*in->removed));
    if (!in->removed) {
        sst_log_error("no memory for the object at %d,%d", at[0], at[1]);
        return cli_exit_code(-ENOMEM);
    }
    err = sst_render_grow_object(in->removed, &in->lf, at[0], at[1], sst_thread_count(a->cfg.threads));
    return err ? cli_exit_code(err) : CLI_GO_ON;
}

/* Set the removal of the clear method: the one of the options, else all nearer than a cut found automatically. */
static int find_removed(struct render_input *in, struct render_args *a, const struct cli_command *cmd)
{
    int r = a->cfg.method == SST_RENDER_CLEAR && a->remove_at ? find_object(in, a, cmd) : CLI_GO_ON;

    if (r == CLI_GO_ON)
        r = find_label(in, "remove-label", a->remove_label, &a->cfg.remove_label, cmd);
    if (r != CLI_GO_ON || a->cfg.method != SST_RENDER_CLEAR)
        return r;
    a->cfg.remove = in->removed;
    if (isnan(a->cut) && !a->remove_label && !a->remove_at) {
        const int err = sst_render_find_cut(in->renderer, &a->cut);

        if (err == -ENODATA)
            sst_log_warning("%s: its disparities show no gap between what stands in front and the rest, so nothing is "
                            "removed; give --cut D, --remove-label NAME or --remove-at X,Y",
                            in->path);
        else if (err)
            return cli_exit_code(err);
    }
    a->cfg.cut_px = isnan(a->cut) ? INFINITY : a->cut;
    return CLI_GO_ON;
}

/* The focus, unless it was given. */
static int find_focus(struct render_input *in, struct render_args *a)
{
    int err;

    if (!isnan(a->cfg.focus_px))
        return CLI_GO_ON;
    a->cfg.focus_px = 0;
    if (a->cfg.method == SST_RENDER_CLEAR)
        return CLI_GO_ON;
    err = sst_render_find_focus(&in->lf, &a->cfg.focus_px);
    a->focus_found = !err;
    if (err == -ENODATA) {
        sst_log_error("%s has no disparities to find a focus in; run `sst process %s` first, or give --focus D",
                      in->path, in->path);
        return CLI_INPUT;
    }
    return err ? cli_exit_code(err) : CLI_GO_ON;
}

static void set_aperture(const struct sst_lightfield *lf, struct render_args *a)
{
    double widest = 0;

    if (a->f_stop <= 0)
        return;
    for (int i = 0; i < lf->rows * lf->cols; i++) {
        if (lf->views[i].present)
            widest = fmax(widest, hypot(lf->views[i].bx - a->cfg.view_bx, lf->views[i].by - a->cfg.view_by));
    }
    a->cfg.aperture = widest / a->f_stop;
}

static int check_maps(const struct render_input *in, const struct render_args *a)
{
    for (int i = 0; i < in->lf.rows * in->lf.cols && a->cfg.method != SST_RENDER_REFOCUS; i++) {
        if (in->lf.views[i].present && !in->lf.views[i].disp.data) {
            sst_log_error("%s has no disparity map of view %02d_%02d; run `sst process %s` first, or add "
                          "--method refocus",
                          in->path, i / in->lf.cols, i % in->lf.cols, in->path);
            return CLI_INPUT;
        }
    }
    return CLI_GO_ON;
}

/* Whether rays may be verified, which needs the colours of all views. */
static bool verifies(const struct render_args *a, const struct sst_lightfield *lf)
{
    return a->cfg.method == SST_RENDER_SST && a->cfg.verify != SST_VERIFY_OFF &&
           !(a->cfg.verify == SST_VERIFY_AUTO && lf->disparity_tested);
}

/* Choose the data to load: images by option or cost, confidences only to verify rays. A device rectifies raw frames
 * itself where nothing else needs the views. Converts the f-stop to a radius. @param lf  its images need not be there
 */
static int choose_data(struct render_input *in, struct render_args *a, const struct sst_lightfield *lf, unsigned *what)
{
    bool raw, frames;

    *what =
        a->cfg.method != SST_RENDER_REFOCUS ? SST_LOAD_IMAGES | SST_LOAD_DISPARITY | SST_LOAD_LABELS : SST_LOAD_IMAGES;
    *what |= a->no_verify ? SST_LOAD_UNVERIFIED : 0;
    *what |= isnan(a->cfg.focus_px) || a->disparities_needed ? SST_LOAD_DISPARITY : 0;
    *what |= a->cfg.method == SST_RENDER_SST && a->cfg.verify != SST_VERIFY_OFF ? SST_LOAD_CONFIDENCE : 0;
    set_aperture(lf, a);
    raw = a->sampling == RENDER_RAW || (a->sampling == RENDER_AUTO && !(a->views_needed && lf->calibration) &&
                                        sst_render_prefers_raw(lf, &a->cfg, a->pictures));
    if (raw && !lf->calibration && !lf->correction) {
        sst_log_error(
            "%s has neither a calibration nor a correction: its files are the views, not raw frames; leave out "
            "--sampling raw",
            in->path);
        return CLI_INPUT;
    }
    frames = strcmp(a->device, "cpu") && lf->calibration && !a->views_needed && !verifies(a, lf);
    in->rectified = frames && !raw;
    if (frames)
        *what |= SST_LOAD_RAW | SST_LOAD_ENCODED;
    if (raw)
        *what |= lf->calibration ? SST_LOAD_RAW : SST_LOAD_ORIGINALS;
    if (lf->disparity_tested && a->cfg.verify == SST_VERIFY_AUTO)
        *what &= ~(unsigned)SST_LOAD_CONFIDENCE;
    return CLI_GO_ON;
}

static int load(struct render_input *in, struct render_args *a)
{
    struct sst_lightfield lf;
    unsigned what = 0;
    int err = sst_lightfield_load(&lf, in->path, 0, 1), r;

    if (err)
        return cli_exit_code(err);
    r = choose_data(in, a, &lf, &what);
    sst_lightfield_fini(&lf);
    if (r != CLI_GO_ON)
        return r;
    err = sst_lightfield_load(&in->lf, in->path, what, a->cfg.threads);
    return err ? cli_exit_code(err) : CLI_GO_ON;
}

/* What the device rectifies from encoded frames is there already. */
static int borrow(struct render_input *in, struct render_args *a, const struct sst_lightfield *lf)
{
    unsigned what = 0;
    const int r = choose_data(in, a, lf, &what);

    if (r != CLI_GO_ON)
        return r;
    if (in->rectified)
        what &= ~(unsigned)SST_LOAD_RAW;
    in->rectified = false;
    in->borrowed = true;
    if (!sst_lightfield_borrow(&in->lf, lf, what))
        return CLI_GO_ON;
    sst_log_error("no memory for a list of views");
    return CLI_MEMORY;
}

/* Everything but the data. @param loaded  or NULL: from the folder */
static int open_renderer(struct render_input *in, struct render_args *a, const struct cli_command *cmd,
                         const struct render_loaded *loaded)
{
    int err = sst_renderer_create(&in->renderer, &in->lf, a->cfg.threads), r;

    if (!err && in->rectified)
        err = sst_renderer_use_rectified(in->renderer);
    if (!err)
        err = loaded ? sst_renderer_share_device(in->renderer, loaded->device)
                     : sst_renderer_use_device(in->renderer, a->device, (uint64_t)a->device_memory << 20);
    r = err ? cli_exit_code(err) : check_maps(in, a);
    if (r == CLI_GO_ON)
        r = find_label(in, "label", a->label, &a->cfg.focus_label, cmd);
    if (r == CLI_GO_ON)
        r = find_focus(in, a);
    return r == CLI_GO_ON ? find_removed(in, a, cmd) : r;
}

/* @param loaded  or NULL: from the folder */
static int open_input(struct render_input *in, struct render_args *a, const struct cli_command *cmd,
                      const struct render_loaded *loaded)
{
    int r = check_options(a, cmd);

    if (r != CLI_GO_ON)
        return r;
    a->views_needed |= a->remove_at != NULL;
    r = loaded ? borrow(in, a, loaded->lf) : load(in, a);
    if (r == CLI_GO_ON)
        r = open_renderer(in, a, cmd, loaded);
    if (r != CLI_GO_ON)
        cli_render_close(in);
    return r;
}

int cli_render_open(struct render_input *in, struct render_args *a, const struct cli_command *cmd, const char *path)
{
    *in = (struct render_input){ .path = path };
    return open_input(in, a, cmd, NULL);
}

int cli_render_open_loaded(struct render_input *in, struct render_args *a, const struct cli_command *cmd,
                           const struct render_loaded *loaded)
{
    *in = (struct render_input){ .path = loaded->name };
    return open_input(in, a, cmd, loaded);
}

json_t *cli_render_skips_json(const struct render_input *in, const struct render_args *a)
{
    struct sst_render_skip_report s;

    if (!sst_renderer_skips(in->renderer, &s))
        return json_null();
    return json_pack("{s:f, s:f, s:f, s:I, s:o, s:o}", "budget_db", a->cfg.skip_error_db, "rays_skipped_percent",
                     100 * s.rays_skipped, "rays_even_percent", 100 * s.rays_even, "sampled_pixels",
                     (json_int_t)s.sampled, "error_levels", cli_real_json(s.error_levels), "error_db",
                     cli_real_json(s.error_db));
}

void cli_render_report_skips(const struct render_input *in, const char *out)
{
    struct sst_render_skip_report s;

    if (!sst_renderer_skips(in->renderer, &s))
        return;
    printf("%s: %.1f %% of the rays skipped, %.1f %% without weights", out, 100 * s.rays_skipped, 100 * s.rays_even);
    if (s.sampled)
        printf("; error %.2f levels in %lld pixels rendered exactly as well", s.error_levels, (long long)s.sampled);
    printf("\n");
}

/* Mean of the pictures on the device. */
static json_t *mean_ms(int64_t ns, int64_t pictures)
{
    return cli_real_json(pictures ? (double)ns * 1e-6 / (double)pictures : NAN);
}

json_t *cli_render_device_json(const struct render_input *in)
{
    struct sst_render_device_report d;
    json_t *root;

    if (!sst_renderer_device(in->renderer, &d))
        return json_string("cpu");
    root = json_pack("{s:o, s:o, s:I, s:I, s:I, s:I}", "name", cli_text_json(d.name), "driver", cli_text_json(d.driver),
                     "pictures", (json_int_t)d.pictures, "verified_on_cpu", (json_int_t)d.verified_on_cpu, "on_cpu",
                     (json_int_t)d.on_cpu, "failures", (json_int_t)d.failures);
    json_object_set_new(root, "why_cpu", d.on_cpu ? cli_text_json(d.why) : json_null());
    json_object_set_new(root, "why_verified_on_cpu", d.verified_on_cpu ? cli_text_json(d.why_verified) : json_null());
    json_object_set_new(root, "filled_on_cpu", json_integer((json_int_t)d.filled_on_cpu));
    json_object_set_new(root, "why_filled_on_cpu", d.filled_on_cpu ? cli_text_json(d.why_filled) : json_null());
    json_object_update_new(root,
                           json_pack("{s:i, s:I, s:I, s:I}", "chunks", d.chunks, "dispatches", (json_int_t)d.dispatches,
                                     "uploads", (json_int_t)d.uploads, "upload_bytes", (json_int_t)d.upload_bytes));
    json_object_set_new(root, "in_parts", json_integer((json_int_t)d.in_parts));
    json_object_set_new(root, "rectified", json_integer((json_int_t)d.rectified));
    json_object_set_new(root, "frames_ms", json_real((double)d.frames_ns * 1e-6));
    json_object_set_new(root, "picture_ms", mean_ms(d.total_ns - d.upload_ns, d.pictures));
    json_object_set_new(root, "download_ms", mean_ms(d.download_ns, d.pictures));
    json_object_set_new(root, "upload_ms", json_real((double)d.upload_ns * 1e-6));
    return root;
}

void cli_render_report_device(const struct render_input *in)
{
    struct sst_render_device_report d;

    if (!sst_renderer_device(in->renderer, &d))
        return;
    if (d.on_cpu)
        sst_log_warning("%lld of %lld pictures were rendered on the CPU instead of %s: %s", (long long)d.on_cpu,
                        (long long)(d.on_cpu + d.pictures), d.name, d.why);
    else if (d.verified_on_cpu)
        sst_log_warning("%s: the rays of %lld of %lld pictures were verified on the CPU: %s", d.name,
                        (long long)d.verified_on_cpu, (long long)d.pictures, d.why_verified);
    else if (d.filled_on_cpu)
        sst_log_warning("%s: the holes of %lld of %lld pictures were filled on the CPU: %s", d.name,
                        (long long)d.filled_on_cpu, (long long)d.pictures, d.why_filled);
    else
        sst_log_info("rendered on %s", d.name);
}

void cli_render_close(struct render_input *in)
{
    for (int i = 0; in->removed && i < in->lf.rows * in->lf.cols; i++)
        sst_map_u8_fini(&in->removed[i]);
    free(in->removed);
    sst_renderer_destroy(in->renderer);
    if (in->borrowed)
        sst_lightfield_return(&in->lf);
    else
        sst_lightfield_fini(&in->lf);
}

bool cli_has_suffix(const char *path, const char *suffix)
{
    const size_t n = strlen(path), m = strlen(suffix);

    return n > m && !strcasecmp(path + n - m, suffix);
}
