/* `sst rectify`: the raw frames of a light field with a calibration, or what it makes of them. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/import.h"
#include "pipeline/lightfield/lightfield_internal.h"

struct job {
    const struct sst_rectify_dir_config *cfg;
    struct sst_lightfield lf;
    const char *out; /* the output's temporary folder */
};

static int view_path(char out[SST_PATH_MAX], const char *dir, const char *file)
{
    char name[300];

    snprintf(name, sizeof(name), "views/%s", file);
    return sst_path_join(out, dir, name);
}

static int copy_frame(const struct job *job, struct sst_view *v, const char *from, const uint8_t *data, size_t size)
{
    char to[SST_PATH_MAX];
    struct sst_image img;
    int err = view_path(to, job->out, v->file);

    if (!err)
        err = sst_image_decode(&img, data, size, from);
    if (err)
        return err;
    if (img.width != job->lf.calibration->width || img.height != job->lf.calibration->height) {
        sst_log_error("%s has %dx%d pixels, the calibration is of frames of %dx%d", from, img.width, img.height,
                      job->lf.calibration->width, job->lf.calibration->height);
        err = -EBADMSG;
    }
    sst_image_fini(&img);
    return err ? err : sst_file_write(to, data, size);
}

/* The rectified picture as PNG. */
static int bake_frame(struct job *job, int k, const char *from, const uint8_t *data, size_t size)
{
    struct sst_view *v = &job->lf.views[k];
    char to[SST_PATH_MAX];
    int err = sst_image_decode(&v->image, data, size, from);

    if (!err)
        err = calibration_rectify_view(&job->lf, k);
    if (err)
        return err;
    sst_view_name(&job->lf, k, v->file);
    strcat(v->file, ".png");
    v->sha256[0] = '\0';
    err = view_path(to, job->out, v->file);
    if (!err)
        err = sst_image_write_png(&v->image, to);
    sst_image_fini(&v->image);
    sst_map_u8_fini(&v->valid);
    return err;
}

static int take_view(void *arg, int k, int worker)
{
    struct job *job = arg;
    struct sst_view *v = &job->lf.views[k];
    char path[SST_PATH_MAX], hash[65];
    uint8_t *data;
    size_t size;
    int err;

    if (!v->present)
        return 0;
    if (!worker && job->cfg->progress)
        job->cfg->progress(job->cfg->progress_arg, k / ((double)job->lf.rows * job->lf.cols));
    err = view_path(path, job->cfg->dir, v->file);
    if (!err)
        err = sst_file_read(path, SST_VIEW_FILE_MAX, &data, &size);
    if (err)
        return err;
    sha256_hex(hash, data, size);
    if (strcmp(hash, v->sha256)) {
        sst_log_error("%s has changed since it was stored (its SHA-256 differs); import it again", path);
        err = -EBADMSG;
    } else {
        err = job->cfg->bake ? bake_frame(job, k, path, data, size) : copy_frame(job, v, path, data, size);
    }
    free(data);
    return err;
}

/* What is known about the old geometry's disparities holds for the new one after scaling by f B, if both are known. */
static void carry_range(struct sst_lightfield *lf, double old_fb)
{
    const double scale = old_fb > 0 ? lf->focal_px * lf->spacing_mm / old_fb : 1;

    if (lf->range_min_px < lf->range_max_px) {
        lf->range_min_px *= scale;
        lf->range_max_px = fmin(lf->range_max_px * scale, lf->range_min_px + SST_RANGE_MAX_PX);
    }
    lf->disp_min_px = floor(lf->range_min_px);
}

static int prepare(struct job *job)
{
    const struct sst_use_calibration *use = job->cfg->use;
    struct sst_lightfield *lf = &job->lf;
    const double old_fb = lf->focal_px * lf->spacing_mm;
    int err;

    lf->disparity_given = lf->labels_given = false;
    lf->history[0] = '\0';
    if (!use && !lf->calibration) {
        sst_log_error("%s has no calibration; add --calib FILE", job->cfg->dir);
        return -EINVAL;
    }
    if (use) {
        calibration_drop(lf);
        err = sst_lightfield_fit_calibration(lf, use);
        if (!err)
            err = sst_lightfield_calibrate(lf, use);
        if (err)
            return err;
    }
    carry_range(lf, old_fb);
    return 0;
}

static int fill(struct job *job)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, job->out, "views");

    if (!err)
        err = sst_path_make_dir(path);
    if (!err)
        err = sst_parallel_for(job->lf.rows * job->lf.cols, sst_thread_count(job->cfg->threads), take_view, job);
    if (err)
        return err;
    if (job->cfg->bake) {
        struct sst_lightfield baked = job->lf; /* borrows everything, and has no calibration */

        baked.calibration = NULL;
        baked.rectified = NULL;
        return sst_lightfield_write(&baked, job->out, job->cfg->threads);
    }
    return sst_lightfield_write(&job->lf, job->out, job->cfg->threads);
}

int sst_lightfield_rectify_dir(const struct sst_rectify_dir_config *cfg, struct sst_lightfield *calibrated)
{
    const char *const inputs[] = { cfg->dir, NULL };
    struct job job = { .cfg = cfg };
    struct sst_outdir out;
    int err = sst_check_output(cfg->out, cfg->force, "lightfield.json", inputs);

    if (!err)
        err = sst_lightfield_load(&job.lf, cfg->dir, 0, cfg->threads);
    if (err)
        return err;
    err = prepare(&job);
    if (!err)
        err = sst_outdir_open(&out, cfg->out, cfg->force);
    if (err)
        goto out;
    job.out = out.temporary;
    err = fill(&job);
    if (err)
        sst_outdir_abort(&out);
    else
        err = sst_outdir_commit(&out);

out:
    if (err)
        sst_lightfield_fini(&job.lf);
    else
        *calibrated = job.lf;
    return err;
}
