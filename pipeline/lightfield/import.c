/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/import.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/edit_distance.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/develop.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/lightfield/external_maps.h"
#include "pipeline/lightfield/lightfield_internal.h"
#include "pipeline/lightfield/parallax.h"

#define MAX_NAMED 4 /* files or views named in one message */

static const struct {
    const char *name;
    int (*plan)(struct import_plan *plan);
} formats[] = {
    { "stanford", import_stanford },
    { "hci", import_hci },
    { "folder", import_folder },
};

/* Shared by the threads; each writes only the elements of its own view. */
struct job {
    struct import_plan *plan;
    const char *out; /* the output's temporary folder */
    int width[SST_MAX_VIEWS], height[SST_MAX_VIEWS];
    uint8_t orientation[SST_MAX_VIEWS]; /* EXIF's, which is not applied */
    double truth_min[SST_MAX_VIEWS], truth_max[SST_MAX_VIEWS]; /* min above max: none */
};

static int check_config(const struct sst_import_config *cfg)
{
    const bool folder = !strcmp(cfg->format, "folder");

    if (!sst_path_is_dir(cfg->source)) {
        sst_log_error("%s is not a folder; name the folder with the images", cfg->source);
        return -ENOENT;
    }
    if (folder && (cfg->rows < 1 || cfg->cols < 1)) {
        sst_log_error("import folder needs the grid; add --grid ROWSxCOLUMNS");
        return -EINVAL;
    }
    if (!folder && (cfg->disparity_dir || cfg->labels_dir || cfg->spacing_px > 0)) {
        sst_log_error("--disparity, --labels and --spacing-px belong to the format folder, not to %s", cfg->format);
        return -EINVAL;
    }
    if (!folder && cfg->calibration) {
        sst_log_error("--calib is for raw frames, from a folder or a recording; %s holds rectified views", cfg->format);
        return -EINVAL;
    }
    if (cfg->part[2] && (cfg->disparity_dir || cfg->labels_dir || cfg->calibration)) {
        sst_log_error("--part does not go with --disparity, --labels and --calib, which belong to the whole grid");
        return -EINVAL;
    }
    if (cfg->calibration && cfg->infinity_px) {
        sst_log_error("--infinity-px has no effect with --calib, which makes parallel views");
        return -EINVAL;
    }
    if (!isfinite(cfg->range_min_px) || !isfinite(cfg->range_max_px) || cfg->range_min_px > cfg->range_max_px ||
        cfg->range_max_px - floor(cfg->range_min_px) > SST_RANGE_MAX_PX ||
        fabs(cfg->range_min_px) > SST_DISP_ABS_MAX_PX) {
        sst_log_error("the range %g to %g px is not ascending or exceeds the %g px that can be stored; correct "
                      "--range-min and --range-max",
                      cfg->range_min_px, cfg->range_max_px, SST_RANGE_MAX_PX);
        return -EINVAL;
    }
    return 0;
}

/* --- the grid ----------------------------------------------------------------------------------------------------- */

static bool has_neighbours(const struct sst_lightfield *lf)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (lf->views[k].present && ((k % lf->cols + 1 < lf->cols && lf->views[k + 1].present) ||
                                     (k + lf->cols < lf->rows * lf->cols && lf->views[k + lf->cols].present)))
            return true;
    }
    return false;
}

/* Holes need an explicit --grid, so that a file forgotten in a copy is noticed. */
static int check_holes(const struct import_plan *plan)
{
    const struct sst_lightfield *lf = &plan->lf;
    const int count = lf->rows * lf->cols;
    char named[MAX_NAMED * 66 + 8] = "";
    int missing = 0;

    for (int k = 0; k < count; k++) {
        if (lf->views[k].present || missing++ >= MAX_NAMED)
            continue;
        strcat(strcat(named, named[0] ? ", " : ""), plan->views[k].expected);
    }
    if (missing > MAX_NAMED)
        strcat(named, " ...");
    if (missing && !plan->cfg->rows) {
        sst_log_error("%s lacks %d of %d views: %s; add the files, or --grid %dx%d to import without them",
                      plan->cfg->source, missing, count, named, lf->rows, lf->cols);
        return -EBADMSG;
    }
    if (missing)
        sst_log_warning("%s lacks %d of %d views: %s", plan->cfg->source, missing, count, named);
    return 0;
}

static int check_neighbours(const struct import_plan *plan)
{
    const struct sst_lightfield *lf = &plan->lf;

    if (lf->rows * lf->cols == 1 || has_neighbours(lf))
        return 0;
    sst_log_error("%s has no two neighbouring views of a grid of %dx%d; add files or correct --%s", plan->cfg->source,
                  lf->rows, lf->cols, plan->cfg->part[2] ? "part" : "grid");
    return -EBADMSG;
}

static void warn_unused(const struct import_plan *plan)
{
    char named[MAX_NAMED * (SST_NAME_MAX + 2) + 8] = "";
    int unused = 0;

    for (int i = 0; i < plan->names.count; i++) {
        if (plan->names.used[i] || !sst_image_is_picture(plan->names.name[i]) || unused++ >= MAX_NAMED)
            continue;
        strcat(strcat(named, named[0] ? ", " : ""), plan->names.name[i]);
    }
    if (unused > MAX_NAMED)
        strcat(named, " ...");
    if (unused)
        sst_log_warning("%s: %d images are not named as this format requires and are left out: %s", plan->cfg->source,
                        unused, named);
}

/* Offsets in spacings from the reference view. */
static int set_offsets(struct import_plan *plan)
{
    struct sst_lightfield *lf = &plan->lf;
    const struct import_view *ref;

    if (!(plan->spacing > 0) || !isfinite(plan->spacing)) {
        sst_log_error("%s: the computed camera spacing is %g; correct the positions of the cameras", plan->cfg->source,
                      plan->spacing);
        return -EBADMSG;
    }
    if (sst_lightfield_choose_ref(lf))
        return -EBADMSG;
    ref = &plan->views[lf->ref_view];
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        lf->views[k].bx = (plan->views[k].pos_x - ref->pos_x) / plan->spacing;
        lf->views[k].by = (plan->views[k].pos_y - ref->pos_y) / plan->spacing;
    }
    return 0;
}

/* --- views -------------------------------------------------------------------------------------------------------- */

/* Copies a view's true disparity, converted to our unit, under the view's name. */
static int copy_truth(struct job *job, int k)
{
    const struct import_plan *plan = job->plan;
    char path[SST_PATH_MAX], name[64], rr_cc[16];
    struct sst_map_f32 map;
    int err = sst_path_join(path, plan->cfg->source, plan->names.name[plan->views[k].truth]);

    err = err ? err : sst_map_f32_read_pfm(&map, path);
    if (err)
        return err;
    if (map.width != job->width[k] || map.height != job->height[k]) {
        sst_log_error("%s has %dx%d pixels, its view %dx%d; remove or correct it", path, map.width, map.height,
                      job->width[k], job->height[k]);
        err = -EBADMSG;
        goto out;
    }
    for (int y = 0; y < map.height; y++) {
        float *row = sst_map_f32_row(&map, y);

        for (int x = 0; x < map.width; x++) {
            row[x] = (float)(row[x] * plan->truth_scale);
            if (isinf(row[x]))
                continue;
            job->truth_min[k] = fmin(job->truth_min[k], (double)row[x]);
            job->truth_max[k] = fmax(job->truth_max[k], (double)row[x]);
        }
    }
    sst_view_name(&plan->lf, k, rr_cc);
    snprintf(name, sizeof(name), "truth/%s.pfm", rr_cc);
    err = sst_path_join(path, job->out, name);
    err = err ? err : sst_map_f32_write_pfm(&map, path);

out:
    sst_map_f32_fini(&map);
    return err;
}

/* A raw file of a still camera becomes a PNG. @param data  out: that PNG's bytes, in place of the raw file's */
static int develop_view(const char *from, const char *to, uint8_t **data, size_t *size)
{
    struct sst_image img = { 0 };
    int err = sst_image_develop(&img, *data, *size, from);

    err = err ? err : sst_image_write_png(&img, to);
    sst_image_fini(&img);
    free(*data);
    *data = NULL;
    return err ? err : sst_file_read(to, SST_VIEW_FILE_MAX, data, size);
}

/* Decodes (to reject a damaged image now), hashes and copies the bytes unchanged. */
static int copy_view(void *arg, int k, int worker SST_UNUSED)
{
    struct job *job = arg;
    struct import_plan *plan = job->plan;
    struct sst_lightfield_file *file = &plan->lf.files->view[k];
    char path[SST_PATH_MAX], to[SST_PATH_MAX];
    struct sst_image img;
    uint8_t *data = NULL;
    size_t size;
    int err;

    job->truth_min[k] = INFINITY;
    job->truth_max[k] = -INFINITY;
    if (!plan->lf.views[k].present)
        return 0;
    err = sst_path_join(path, plan->cfg->source, plan->names.name[plan->views[k].name]);
    err = err ? err : sst_file_read(path, SST_VIEW_FILE_MAX, &data, &size);
    if (err)
        return err;
    sst_view_name(&plan->lf, k, file->name);
    strcat(file->name, plan->raw ? ".png" : sst_image_ending(data, size));
    err = view_path(to, &plan->lf, k, job->out);
    if (!err && plan->raw)
        err = develop_view(path, to, &data, &size);
    err = err ? err : sst_image_decode(&img, data, size, path);
    if (err)
        goto out;
    job->orientation[k] = (uint8_t)sst_image_orientation(data, size);
    job->width[k] = img.width;
    job->height[k] = img.height;
    sst_image_fini(&img);
    sst_sha256_hex(file->sha256, data, size);
    if (!plan->raw)
        err = sst_file_write(to, data, size);
    if (!err && plan->views[k].truth >= 0)
        err = copy_truth(job, k);

out:
    free(data);
    return err;
}

static void warn_orientations(const struct job *job)
{
    const struct import_plan *plan = job->plan;
    const char *name[SST_MAX_VIEWS] = { NULL };
    const int n = plan->lf.rows * plan->lf.cols;

    for (int k = 0; k < n; k++)
        name[k] = plan->lf.views[k].present ? plan->names.name[plan->views[k].name] : NULL;
    sst_image_warn_orientations(plan->cfg->source, name, job->orientation, n);
}

static int check_sizes(const struct job *job)
{
    const struct import_plan *plan = job->plan;
    const int ref = plan->lf.ref_view;

    for (int k = 0; k < plan->lf.rows * plan->lf.cols; k++) {
        if (!plan->lf.views[k].present || (job->width[k] == job->width[ref] && job->height[k] == job->height[ref]))
            continue;
        sst_log_error("%s/%s has %dx%d pixels, but %s has %dx%d; all views must have one size", plan->cfg->source,
                      plan->names.name[plan->views[k].name], job->width[k], job->height[k],
                      plan->names.name[plan->views[ref].name], job->width[ref], job->height[ref]);
        return -EBADMSG;
    }
    return 0;
}

/* --- the import --------------------------------------------------------------------------------------------------- */

/* Where infinity is, by precedence: as the user gives it, as the source does, or by the distance at which it converges. */
static void set_infinity(struct import_plan *plan)
{
    struct sst_lightfield *lf = &plan->lf;
    const struct import_view *ref = &plan->views[lf->ref_view];

    if (plan->cfg->infinity_px)
        lf->infinity_px = *plan->cfg->infinity_px;
    else if (isinf(plan->focus_mm))
        lf->infinity_px = 0;
    else if (plan->focus_mm != 0 && lf->focal_px > 0 && lf->spacing_mm > 0)
        lf->infinity_px = -lf->focal_px * lf->spacing_mm / plan->focus_mm;
    else
        return;
    lf->infinity_known = true;
    for (int i = 0; i < 2; i++) {
        const double pos = i ? ref->pos_y : ref->pos_x;

        if (isnan(plan->centre[0]))
            lf->off_centre_px[i] += plan->moved[i] / plan->spacing * lf->infinity_px;
        else
            lf->off_centre_px[i] = (plan->centre[i] - pos) / plan->spacing * lf->infinity_px;
    }
}

/* Range by precedence: the user's, the source's, the true disparities'. */
static void set_range(const struct job *job)
{
    const struct sst_import_config *cfg = job->plan->cfg;
    struct sst_lightfield *lf = &job->plan->lf;
    double lo = INFINITY, hi = -INFINITY;

    if (cfg->range_min_px < cfg->range_max_px) {
        lf->range_min_px = cfg->range_min_px;
        lf->range_max_px = cfg->range_max_px;
    }
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        lo = fmin(lo, job->truth_min[k]);
        hi = fmax(hi, job->truth_max[k]);
    }
    if (lf->range_min_px == lf->range_max_px && lo <= hi) {
        lf->range_min_px = lo;
        lf->range_max_px = hi;
    }
    if (lf->range_min_px < lf->range_max_px)
        lf->disp_min_px = floor(lf->range_min_px);
}

/* JSON requires UTF-8; a path may hold any bytes. */
static void set_source(struct sst_lightfield_files *files, const struct sst_import_config *cfg)
{
    snprintf(files->source, sizeof(files->source), "%s import of %.900s", cfg->format, cfg->source);

    if (cfg->part[2])
        sst_text_add(files->source, sizeof(files->source), ", part %d,%d,%dx%d", cfg->part[0], cfg->part[1],
                     cfg->part[2], cfg->part[3]);
    if (cfg->spacing_px > 0)
        sst_text_add(files->source, sizeof(files->source), ", spacing %.17g px", cfg->spacing_px);
    sst_text_make_utf8(files->source);
}

static int make_folders(const struct job *job)
{
    bool truth = false;
    int err = make_folder(job->out, "views");

    for (int k = 0; k < job->plan->lf.rows * job->plan->lf.cols; k++)
        truth |= job->plan->lf.views[k].present && job->plan->views[k].truth >= 0;
    return err || !truth ? err : make_folder(job->out, "truth");
}

static int fill(struct job *job)
{
    struct import_plan *plan = job->plan;
    const struct sst_import_config *cfg = plan->cfg;
    const int threads = sst_thread_count(cfg->threads), ref = plan->lf.ref_view;
    const char *fault;
    int err = make_folders(job);

    err = err ? err : sst_parallel_for(plan->lf.rows * plan->lf.cols, threads, copy_view, job);
    if (!err)
        warn_orientations(job);
    err = err ? err : check_sizes(job);
    if (err)
        return err;
    plan->lf.width = job->width[ref];
    plan->lf.height = job->height[ref];
    if (plan->focal_sides > 0)
        plan->lf.focal_px = plan->focal_sides * sst_max_int(plan->lf.width, plan->lf.height);
    set_infinity(plan);
    if (cfg->calibration)
        err = sst_lightfield_calibrate(&plan->lf, cfg->calibration);
    if (err)
        return err;
    set_range(job);
    set_source(plan->lf.files, cfg);
    fault = lightfield_fault(&plan->lf);
    if (fault) {
        sst_log_error("%s gives an invalid light field: %s; correct its names or parameters", cfg->source, fault);
        return -EBADMSG;
    }
    if (cfg->disparity_dir)
        err = sst_lightfield_read_disparity(&plan->lf, cfg->disparity_dir, threads);
    if (!err && cfg->labels_dir)
        err = sst_lightfield_read_labels(&plan->lf, cfg->labels_dir, threads);
    err = err ? err : sst_lightfield_choose_samples(&plan->lf, job->out, cfg->out);
    return err ? err : sst_lightfield_write(&plan->lf, job->out, threads);
}

static int run(struct import_plan *plan, int (*format)(struct import_plan *), const char *out)
{
    struct job job = { .plan = plan, .out = out };
    int err = names_read(&plan->names, plan->cfg->source);

    err = err ? err : format(plan);
    err = err ? err : check_holes(plan);
    if (!err && plan->cfg->part[2])
        err = import_take_part(plan);
    err = err ? err : check_neighbours(plan);
    if (!err && plan->cfg->calibration)
        err = sst_lightfield_fit_calibration(&plan->lf, plan->cfg->calibration);
    err = err ? err : set_offsets(plan);
    if (err)
        return err;
    warn_unused(plan);
    err = fill(&job);
    if (!err)
        sst_lightfield_warn_views(&plan->lf, out, plan->cfg->out);
    return err;
}

int sst_import(const struct sst_import_config *cfg)
{
    const char *inputs[] = { cfg->source, cfg->disparity_dir, cfg->labels_dir, NULL, NULL };
    struct import_plan plan = { .cfg = cfg, .spacing = 1, .truth_scale = 1, .centre = { (double)NAN, (double)NAN } };
    struct sst_outdir out;
    size_t i = 0;
    int err;

    while (i < ARRAY_LEN(formats) && strcmp(cfg->format, formats[i].name))
        i++;
    if (i == ARRAY_LEN(formats)) {
        sst_log_error("unknown import format `%s`;%s use stanford, hci, folder, recording, poses or pictures", cfg->format,
                      sst_edit_hint(cfg->format, (const char *const[]){ "stanford", "hci", "folder", "recording", "poses",
                                                                        "pictures", NULL }));
        return -EINVAL;
    }
    if (!inputs[1]) /* the list ends at the first NULL */
        inputs[1] = inputs[2];
    err = check_config(cfg);
    err = err ? err : sst_path_check_output(cfg->out, cfg->force, "lightfield.json", inputs);
    err = err ? err : sst_outdir_open(&out, cfg->out, cfg->force);
    if (err)
        return err;
    err = run(&plan, formats[i].plan, out.temporary);
    if (err == -ENOMEM)
        sst_log_error("not enough memory to import %s", cfg->source);
    err = sst_outdir_end(&out, err);
    sst_lightfield_fini(&plan.lf);
    names_fini(&plan.names);
    free(plan.views);
    return err;
}
