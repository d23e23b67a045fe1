/* `sst rectify`: writes raw frames with their calibration, or rectified (baked) views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/lightfield_internal.h"

struct job {
    const struct sst_rectify_dir_config *cfg;
    struct sst_lightfield lf;
    const char *out; /* the output's temporary folder */
};

static int copy_frame(const struct job *job, int k, const struct view_file *from)
{
    char to[SST_PATH_MAX];
    struct sst_image img;
    int err = view_path(to, &job->lf, k, job->out);

    err = err ? err : sst_image_decode(&img, from->data, from->size, from->path);
    if (err)
        return err;
    if (img.width != job->lf.calibration->width || img.height != job->lf.calibration->height) {
        sst_log_error("%s has %dx%d pixels, the calibration is of frames of %dx%d", from->path, img.width, img.height,
                      job->lf.calibration->width, job->lf.calibration->height);
        err = -EBADMSG;
    }
    sst_image_fini(&img);
    return err ? err : sst_file_write(to, from->data, from->size);
}

/* Write the rectified picture as PNG. */
static int bake_frame(struct job *job, int k, const struct view_file *from)
{
    struct sst_view *v = &job->lf.views[k];
    struct sst_lightfield_file *file = &job->lf.files->view[k];
    char to[SST_PATH_MAX];
    int err = sst_image_decode_samples(&v->image, from->data, from->size, from->path, job->lf.samples);

    err = err ? err : sst_lightfield_rectify_view(&job->lf, k);
    if (err)
        return err;
    sst_view_name(&job->lf, k, file->name);
    strcat(file->name, ".png");
    file->sha256[0] = '\0';
    err = view_path(to, &job->lf, k, job->out);
    err = err ? err : sst_image_write_png(&v->image, to);
    sst_image_fini(&v->image);
    sst_map_u8_fini(&v->valid);
    return err;
}

static int convert_view(void *arg, int k, int worker)
{
    struct job *job = arg;
    struct view_file file;
    int err;

    if (!job->lf.views[k].present)
        return 0;
    if (!worker && job->cfg->progress)
        job->cfg->progress(job->cfg->progress_arg, k / ((double)job->lf.rows * job->lf.cols));
    err = read_view(&file, &job->lf, k, job->cfg->dir);
    if (err)
        return err;
    err = job->cfg->bake ? bake_frame(job, k, &file) : copy_frame(job, k, &file);
    free(file.data);
    return err;
}

/* The old geometry's disparity range, counted from infinity and scaled by f B where these are known, holds for the new
 * one, with infinity at 0. */
static void scale_range(struct sst_lightfield *lf, double old_fb, double old_infinity_px)
{
    const double scale = old_fb > 0 ? lf->focal_px * lf->spacing_mm / old_fb : 1;

    if (lf->range_min_px < lf->range_max_px) {
        lf->range_min_px = (lf->range_min_px - old_infinity_px) * scale;
        lf->range_max_px = fmin((lf->range_max_px - old_infinity_px) * scale, lf->range_min_px + SST_RANGE_MAX_PX);
    }
    lf->disp_min_px = floor(lf->range_min_px);
}

static int prepare(struct job *job)
{
    const struct sst_use_calibration *use = job->cfg->use;
    struct sst_lightfield *lf = &job->lf;
    const double old_fb = lf->focal_px * lf->spacing_mm, old_infinity_px = lf->infinity_px;
    int err;

    lf->files->external_disparity = lf->files->external_labels = false;
    lf->files->history[0] = '\0';
    lf->files->judged = false;
    if (!use && !lf->calibration) {
        sst_log_error("%s has no calibration; add --calib FILE", job->cfg->dir);
        return -EINVAL;
    }
    if (use) {
        calibration_drop(lf);
        err = sst_lightfield_fit_calibration(lf, use);
        err = err ? err : sst_lightfield_calibrate(lf, use);
        if (err)
            return err;
    }
    scale_range(lf, old_fb, old_infinity_px);
    return 0;
}

static int fill(struct job *job)
{
    int err = make_folder(job->out, "views");

    if (!err)
        err = sst_parallel_for(job->lf.rows * job->lf.cols, sst_thread_count(job->cfg->threads), convert_view, job);
    if (err)
        return err;
    if (job->cfg->bake) {
        struct sst_lightfield baked = job->lf; /* shallow copy without the calibration */

        baked.calibration = NULL;
        baked.rectified = NULL;
        baked.samples = (struct sst_samples){ 0, 0 };
        return sst_lightfield_write(&baked, job->out, job->cfg->threads);
    }
    return sst_lightfield_write(&job->lf, job->out, job->cfg->threads);
}

int sst_lightfield_rectify_dir(const struct sst_rectify_dir_config *cfg, struct sst_lightfield *calibrated)
{
    const char *const inputs[] = { cfg->dir, NULL };
    struct job job = { .cfg = cfg };
    struct sst_outdir out;
    int err = sst_path_check_output(cfg->out, cfg->force, "lightfield.json", inputs);

    err = err ? err : sst_lightfield_load(&job.lf, cfg->dir, SST_LOAD_UNCORRECTED, cfg->threads);
    if (err)
        return err;
    err = prepare(&job);
    err = err ? err : sst_outdir_open(&out, cfg->out, cfg->force);
    if (err)
        goto out;
    job.out = out.temporary;
    err = fill(&job);
    err = sst_outdir_end(&out, err);

out:
    if (err)
        sst_lightfield_fini(&job.lf);
    else
        *calibrated = job.lf;
    return err;
}
