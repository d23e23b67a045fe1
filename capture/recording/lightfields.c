/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/lightfields.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>
#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "capture/recording/recording_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/deep.h"
#include "pipeline/image/jpeg_tables.h"
#include "pipeline/image/raw.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/parallax.h"

#define MAX_NAMED 4 /* views named in one message */

/* One set; each thread writes only its own view's elements. */
struct job {
    const struct sst_recording *recording;
    const struct sst_recording_info *info;
    const struct sst_lightfields_config *cfg;
    const char *dir; /* of this light field, in the output's temporary folder; NULL: it is made in memory */
    int number;
    struct sst_samples *samples; /* of all sets: the first one's */
    struct sst_recording_set set;
    int cam[SST_MAX_VIEWS];         /* by view; -1: the array has no camera there */
    const char *why[SST_MAX_VIEWS]; /* the view is missing; NULL: it is there */
    struct sst_lightfield lf;
    struct sst_raw raw[SST_MAX_VIEWS]; /* in memory: frames that are no JPEG, until they become images; data is owned */
};

/* --- views -------------------------------------------------------------------------------------------------------- */

static bool is_jpeg(const struct job *job)
{
    return sst_raw_is_jpeg(job->info->fourcc);
}

static const char incomplete[] = "not a complete picture of the recording's size";

/* Is it a complete picture of the right size? */
static bool decodes(const struct sst_raw *raw)
{
    struct sst_image img;

    if (sst_raw_decode(&img, raw))
        return false;
    sst_image_fini(&img);
    return true;
}

static int write_view(struct job *job, int view, const struct sst_raw *raw)
{
    char name[300], path[SST_PATH_MAX];
    int err;

    if (is_jpeg(job) && !decodes(raw)) {
        job->why[view] = incomplete;
        return 0;
    }
    snprintf(name, sizeof(name), "views/%s", job->lf.files->view[view].name);
    err = sst_path_join(path, job->dir, name);
    if (err)
        return err;
    job->lf.views[view].present = true;
    return is_jpeg(job) ? sst_jpeg_write(path, raw->data, raw->bytes) : sst_raw_write_png(raw, path);
}

/* In memory: decode a JPEG; keep another frame, and own its data. */
static void keep_view(struct job *job, int view, struct sst_raw *raw)
{
    struct sst_lightfield_file *file = &job->lf.files->view[view];
    struct sst_view *v = &job->lf.views[view];

    file->quality = NAN;
    if (!is_jpeg(job)) {
        job->raw[view] = *raw;
        raw->data = NULL;
    } else if (sst_raw_decode(&v->image, raw)) {
        job->why[view] = incomplete;
        return;
    } else {
        file->quality = sst_jpeg_quality(raw->data, raw->bytes, file->name);
    }
    v->present = true;
}

static int take_view(void *arg, int view, int worker SST_UNUSED)
{
    struct job *job = arg;
    const int cam = job->cam[view];
    const struct sst_recording_frame *f = cam < 0 ? NULL : &job->set.frame[cam];
    struct sst_raw raw;
    uint8_t *data;
    size_t bytes;
    int err;

    if (!f)
        return 0;
    err = f->faults & SST_RECORDING_BAD_PICTURE
              ? -ECANCELED
              : sst_recording_picture(job->recording, &job->set, cam, &data, &bytes);
    job->why[view] = err == -ENODATA     ? "missing"
                     : err == -ECANCELED ? "marked bad by the driver"
                                         : "damaged on the disk";
    if (err == -ENODATA || err == -ECANCELED || err == -EBADMSG)
        return 0;
    if (err) {
        sst_log_error("cannot read set %d of %s: %s", job->number, sst_recording_dir(job->recording), strerror(-err));
        return err;
    }
    job->why[view] = NULL;
    raw = (struct sst_raw){ job->info->fourcc, job->info->width, job->info->height, f->stride, data, bytes };
    sst_view_name(&job->lf, view, job->lf.files->view[view].name);
    strcat(job->lf.files->view[view].name, is_jpeg(job) ? ".jpg" : ".png");
    if (job->dir)
        err = write_view(job, view, &raw);
    else
        keep_view(job, view, &raw);
    free((uint8_t *)(uintptr_t)raw.data);
    return err;
}

/* Refuse or report missing views. */
static int check_missing(const struct job *job)
{
    char named[MAX_NAMED * 64 + 8] = "";
    int missing = 0, cameras = job->info->cameras;

    for (int view = 0; view < job->lf.rows * job->lf.cols; view++) {
        char rr_cc[16];

        if (!job->why[view] || missing++ >= MAX_NAMED)
            continue;
        sst_view_name(&job->lf, view, rr_cc);
        sst_text_add(named, sizeof(named), "%s%s (%s)", *named ? ", " : "", rr_cc, job->why[view]);
    }
    if (missing > MAX_NAMED)
        strcat(named, " ...");
    if (missing == cameras || (missing && !job->cfg->allow_partial)) {
        sst_log_error("set %d of %s lacks %d of %d views: %s; %s", job->number, sst_recording_dir(job->recording),
                      missing, cameras, named, missing == cameras ? "leave it out" : "skip it or add --allow-partial");
        return -EBADMSG;
    }
    if (missing)
        sst_log_warning("set %d lacks %d of %d views: %s", job->number, missing, cameras, named);
    return 0;
}

/* --- one light field ---------------------------------------------------------------------------------------------- */

static void describe(struct job *job)
{
    const struct sst_recording_set *set = &job->set;
    struct sst_lightfield *lf = &job->lf;
    char wall[SST_CLOCK_TEXT];
    int present = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++)
        present += lf->views[k].present;
    lf->skew_us = (double)set->skew.spread_ns * 1e-3;
    sst_clock_text(wall, set->wall_ns);
    snprintf(lf->files->source, sizeof(lf->files->source),
             "recording import of %.700s, set %d: trigger %llu of run %d, %s, t_ns %lld "
             "(%s), skew %.3f us, %d of %d views",
             job->cfg->source ? job->cfg->source : sst_recording_dir(job->recording), job->number,
             (unsigned long long)set->index, set->session, wall, (long long)set->t_ns,
             set->edge ? "edge of the trigger" : "no edge", (double)set->skew.spread_ns * 1e-3, present,
             job->info->cameras);
    sst_text_make_utf8(lf->files->source);
}

/* Is it the camera that a calibration calls by this name? */
static bool is_called(const struct sst_recorder_track *t, const char *name)
{
    return name[0] && (!strcmp(t->serial, name) || !strcmp(t->port, name) || !strcmp(t->name, name));
}

static const struct sst_recorder_track *find_called(const struct sst_recording_info *info, const char *name)
{
    for (int cam = 0; cam < info->cameras; cam++) {
        if (is_called(&info->track[cam], name))
            return &info->track[cam];
    }
    return NULL;
}

/* A calibration that names none of the recording's cameras was made from files: nothing is compared. */
static int check_cameras(const struct job *job)
{
    const struct sst_recording_info *info = job->info;
    const struct sst_use_calibration *use = job->cfg->calibration;
    bool any = false;

    for (int k = 0; k < info->rows * info->cols; k++)
        any |= use->calib.camera[k].known && find_called(info, use->calib.camera[k].name);
    for (int cam = 0; any && cam < info->cameras; cam++) {
        const struct sst_recorder_track *t = &info->track[cam], *other;
        const struct sst_calib_camera *c = &use->calib.camera[t->row * info->cols + t->col];

        if (!c->known || is_called(t, c->name))
            continue;
        other = find_called(info, c->name);
        if (other)
            sst_log_error("%s does not fit %s: camera %s was calibrated at row %d, column %d, but recorded at row %d, "
                          "column %d; if cameras were swapped, calibrate again",
                          use->path, sst_recording_dir(job->recording), c->name, t->row, t->col, other->row,
                          other->col);
        else
            sst_log_error("%s does not fit %s: at row %d, column %d it has camera %s, but %s was recorded; calibrate "
                          "again",
                          use->path, sst_recording_dir(job->recording), t->row, t->col, c->name,
                          t->serial[0] ? t->serial
                          : t->port[0] ? t->port
                                       : t->name);
        return -EBADMSG;
    }
    return 0;
}

/* Refuse a calibration of another array; cameras that it does not contain have no views. */
static int fit_calibration(struct job *job)
{
    struct sst_lightfield *lf = &job->lf;
    int err;

    for (int k = 0; k < lf->rows * lf->cols; k++)
        lf->views[k].present = job->cam[k] >= 0;
    err = sst_lightfield_fit_calibration(lf, job->cfg->calibration);
    err = err ? err : check_cameras(job);
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (!lf->views[k].present)
            job->cam[k] = -1;
        lf->views[k].present = false;
    }
    return err;
}

static int prepare(struct job *job)
{
    const struct sst_recording_info *info = job->info;
    struct sst_lightfield *lf = &job->lf;
    int err = sst_lightfield_init_files(lf, info->rows, info->cols);

    if (err) {
        sst_log_error("%s has a grid of %dx%d; a light field has at most %d views", sst_recording_dir(job->recording),
                      info->rows, info->cols, SST_MAX_VIEWS);
        return err == -EINVAL ? -EBADMSG : err;
    }
    lf->width = info->width;
    lf->height = info->height;
    lf->spacing_mm = info->spacing_mm;
    if (job->cfg->range_min_px < job->cfg->range_max_px) {
        lf->range_min_px = job->cfg->range_min_px;
        lf->range_max_px = job->cfg->range_max_px;
        lf->disp_min_px = floor(lf->range_min_px);
    }
    for (int k = 0; k < lf->rows * lf->cols; k++)
        job->cam[k] = -1;
    for (int cam = 0; cam < info->cameras; cam++)
        job->cam[info->track[cam].row * info->cols + info->track[cam].col] = cam;
    return job->cfg->calibration ? fit_calibration(job) : 0;
}

static int set_offsets(struct sst_lightfield *lf)
{
    const int err = sst_lightfield_choose_ref(lf);

    for (int k = 0; !err && k < lf->rows * lf->cols; k++) {
        lf->views[k].bx = k % lf->cols - lf->ref_view % lf->cols;
        lf->views[k].by = k / lf->cols - lf->ref_view / lf->cols;
    }
    return err;
}

static int write_line(const struct job *job)
{
    char path[SST_PATH_MAX], *line;
    int err = sst_path_join(path, job->dir, "set.json");

    err = err ? err : sst_recording_line(job->recording, job->number, &line);
    if (err)
        return err;
    err = sst_file_write(path, line, strlen(line));
    free(line);
    return err;
}

static int write_picture(const struct job *job)
{
    char path[SST_PATH_MAX];
    const int err = sst_path_join(path, job->dir, job->cfg->picture);

    return err ? err : sst_file_write(path, job->cfg->picture_data, job->cfg->picture_bytes);
}

static int make_views_folder(const struct job *job)
{
    char path[SST_PATH_MAX];
    const int err = sst_path_join(path, job->dir, "views");

    return err ? err : sst_path_make_dir(path);
}

/* --- in memory ---------------------------------------------------------------------------------------------------- */

/* The range that samples of 16 bits are scaled from. */
static int choose_samples(struct job *job)
{
    struct sst_lightfield *lf = &job->lf;
    struct sst_sample_counts *counts = job->info->fourcc == V4L2_PIX_FMT_Y16 ? calloc(2, sizeof(*counts)) : NULL;
    int r = 1;

    if (!counts)
        return job->info->fourcc == V4L2_PIX_FMT_Y16 ? -ENOMEM : 0;
    for (int k = 0; r > 0 && k < lf->rows * lf->cols; k++) {
        if (lf->views[k].present)
            r = sst_raw_count_samples(&counts[0], &job->raw[k]);
    }
    if (r > 0)
        r = sst_raw_count_samples(&counts[1], &job->raw[lf->ref_view]);
    if (r > 0) {
        lf->samples = sst_samples_choose(&counts[0]);
        sst_samples_report(&counts[0], lf->samples, job->cfg->out);
        sst_samples_levels(&lf->files->levels[0], &lf->files->levels[1], &counts[1], lf->samples);
    } else
        sst_log_error("frames of set %d are too short", job->number);
    free(counts);
    return sst_min_int(r, 0);
}

static int finish_view(void *arg, int view, int worker SST_UNUSED)
{
    struct job *job = arg;
    struct sst_view *v = &job->lf.views[view];
    int err = 0;

    if (!v->present)
        return 0;
    if (!v->image.plane[0])
        err = sst_raw_to_image_samples(&v->image, &job->raw[view], job->lf.samples);
    if (err)
        sst_log_error("cannot convert the frame of %s: %s", job->lf.files->view[view].name, strerror(-err));
    return err || !job->lf.calibration ? err : sst_lightfield_rectify_view(&job->lf, view);
}

static int finish_in_memory(struct job *job)
{
    const int err = choose_samples(job);

    job->lf.keeps_sources = job->lf.files->without_folder = true;
    return err ? err
               : sst_parallel_for(job->lf.rows * job->lf.cols, sst_thread_count(job->cfg->threads), finish_view, job);
}

/* --- posed light fields ------------------------------------------------------------------------------------------- */

/* The views that are there, with their poses. */
static int fill_posed(struct sst_posed *out, const struct job *job)
{
    const struct sst_posed *poses = job->cfg->poses;
    const struct sst_lightfield *lf = &job->lf;
    int n = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_posed_view *v = &out->view[n];

        if (!lf->views[k].present)
            continue;
        *v = poses->view[k];
        sst_view_name(lf, k, v->name);
        snprintf(v->file, sizeof(v->file), "%s", lf->files->view[k].name);
        v->time_s = NAN;
        n++;
    }
    out->width = lf->width;
    out->height = lf->height;
    out->metric = poses->metric;
    memcpy(out->up, poses->up, sizeof(out->up));
    out->geographic = poses->geographic;
    out->latitude = poses->latitude;
    out->longitude = poses->longitude;
    out->altitude_m = poses->altitude_m;
    out->points = poses->points;
    out->point_count = poses->point_count;
    out->median_px = poses->median_px;
    snprintf(out->source, sizeof(out->source), "%s", lf->files->source);
    snprintf(out->history, sizeof(out->history), "%s", poses->history);
    return n;
}

/* The light field has the size, channels and bits of a view's file. */
static int kind_of_pictures(struct sst_posed *posed, const char *path)
{
    struct sst_deep_size found;
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size);

    if (err)
        return err;
    err = sst_deep_decode_size(&found, data, size, path);
    free(data);
    if (err)
        return err;
    posed->width = found.width;
    posed->height = found.height;
    posed->channels = found.channels;
    posed->bits = found.bits;
    return 0;
}

static int write_posed(const struct job *job)
{
    struct sst_posed posed;
    char name[300], path[SST_PATH_MAX];
    int present = 0, err;

    for (int k = 0; k < job->lf.rows * job->lf.cols; k++)
        present += job->lf.views[k].present;
    err = sst_posed_init(&posed, present);
    if (err)
        return err;
    if (fill_posed(&posed, job)) {
        snprintf(name, sizeof(name), "views/%.280s", posed.view[0].file);
        err = sst_path_join(path, job->dir, name);
        err = err ? err : kind_of_pictures(&posed, path);
    }
    err = err ? err : sst_posed_write(&posed, job->dir);
    posed.points = NULL; /* borrowed */
    sst_posed_fini(&posed);
    return err;
}

/* --- one light field, on the disk or in memory -------------------------------------------------------------------- */

static int fill(struct job *job)
{
    int err = job->dir ? make_views_folder(job) : 0;

    if (!err)
        err = sst_parallel_for(job->lf.rows * job->lf.cols, sst_thread_count(job->cfg->threads), take_view, job);
    err = err ? err : check_missing(job);
    err = err ? err : set_offsets(&job->lf);
    if (!err && job->cfg->calibration)
        err = sst_lightfield_calibrate(&job->lf, job->cfg->calibration);
    if (err)
        return err;
    describe(job);
    if (!job->dir)
        return finish_in_memory(job);
    err = write_line(job);
    if (!err && job->cfg->picture)
        err = write_picture(job);
    if (!err && job->cfg->poses)
        return write_posed(job);
    if (!err && job->number == job->cfg->sets[0])
        err = sst_lightfield_choose_samples(&job->lf, job->dir, job->cfg->out);
    else if (!err)
        job->lf.samples = *job->samples;
    return err ? err : sst_lightfield_write(&job->lf, job->dir, job->cfg->threads);
}

/* Where a light field goes. */
struct target {
    const char *dir; /* NULL: to memory */
    struct sst_samples *samples;
    struct sst_lightfield *lf; /* in memory, else NULL */
};

static int make_one(const struct sst_recording *recording, const struct sst_lightfields_config *cfg, int number,
                    struct target to)
{
    struct job *job = calloc(1, sizeof(*job));
    int err;

    if (!job)
        return -ENOMEM;
    *job = (struct job){
        .recording = recording, .info = sst_recording_info(recording), .cfg = cfg, .dir = to.dir, .number = number,
        .samples = to.samples
    };
    err = sst_recording_set(recording, number, &job->set);
    if (err)
        sst_log_error("cannot read set %d of %s: %s; skip it", number, sst_recording_dir(recording),
                      err == -EBADMSG ? "its line in sets.jsonl is damaged" : strerror(-err));
    err = err ? err : prepare(job);
    err = err ? err : fill(job);
    if (!err && to.dir && !cfg->poses && number == cfg->sets[0])
        sst_lightfield_warn_views(&job->lf, to.dir, cfg->out);
    *to.samples = job->lf.samples;
    for (int k = 0; k < SST_MAX_VIEWS; k++)
        free((uint8_t *)(uintptr_t)job->raw[k].data);
    if (err || !to.lf)
        sst_lightfield_fini(&job->lf);
    else
        *to.lf = job->lf;
    free(job);
    return err;
}

int sst_recording_to_memory(struct sst_lightfield *out, const struct sst_recording *recording,
                            const struct sst_lightfields_config *cfg)
{
    struct sst_samples samples;
    const int err = cfg->count == 1 && !cfg->poses ? make_one(recording, cfg, cfg->sets[0], (struct target){ NULL, &samples, out }) : -EINVAL;

    if (err == -ENOMEM)
        sst_log_error("no memory for set %d of %s", cfg->sets[0], sst_recording_dir(recording));
    return err;
}

/* --- all sets ----------------------------------------------------------------------------------------------------- */

static int make_each(const struct sst_recording *recording, const struct sst_lightfields_config *cfg, const char *out)
{
    json_t *list = json_array();
    struct sst_samples samples;
    char path[SST_PATH_MAX];
    int err = list ? 0 : -ENOMEM;

    for (int i = 0; !err && i < cfg->count; i++) {
        char name[32];

        snprintf(name, sizeof(name), "set-%06d", cfg->sets[i]);
        err = sst_path_join(path, out, name);
        err = err ? err : sst_path_make_dir(path);
        err = err ? err : make_one(recording, cfg, cfg->sets[i], (struct target){ path, &samples, NULL });
        if (!err && json_array_append_new(list, json_pack("{s:i, s:s}", "set", cfg->sets[i], "lightfield", name)))
            err = -ENOMEM;
        if (cfg->progress)
            cfg->progress(cfg->progress_arg, (i + 1.0) / cfg->count);
    }
    err = err ? err : sst_path_join(path, out, "sets.json");
    err = err ? err : manifest_write_json(path, list);
    json_decref(list);
    return err;
}

int sst_recording_to_lightfields(const struct sst_recording *recording, const struct sst_lightfields_config *cfg)
{
    const char *const inputs[] = { sst_recording_dir(recording), NULL };
    struct sst_samples samples;
    struct sst_outdir out;
    int err;

    if (cfg->count < 1 || (!cfg->each && cfg->count != 1) || (cfg->poses && cfg->calibration))
        return -EINVAL;
    err = sst_path_check_output(cfg->out, cfg->force, cfg->each ? "sets.json" : "lightfield.json", inputs);
    err = err ? err : sst_outdir_open(&out, cfg->out, cfg->force);
    if (err)
        return err;
    err = cfg->each ? make_each(recording, cfg, out.temporary)
                    : make_one(recording, cfg, cfg->sets[0], (struct target){ out.temporary, &samples, NULL });
    if (err == -ENOMEM)
        sst_log_error("no memory to import %s", sst_recording_dir(recording));
    return sst_outdir_end(&out, err);
}
