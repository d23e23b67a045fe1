/* A light field as a folder: lightfield.json, views/, and the derived disparity/, labels/ and confidence/. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/correction.h"
#include "pipeline/lightfield/lightfield_internal.h"
#include "pipeline/lightfield/share.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/camera/calib.h"
#include "pipeline/image/codec.h"
#include "pipeline/kernels/sha256.h"

/* The kinds of derived maps and their folders. */
enum map_kind {
    MAP_DISPARITY = 0,
    MAP_LABELS = 1,
    MAP_CONFIDENCE = 2,
    MAP_KINDS = 3,
};

static const struct {
    const char *folder;
    enum sst_lightfield_load load;
} kinds[MAP_KINDS] = {
    [MAP_DISPARITY] = { "disparity", SST_LOAD_DISPARITY },
    [MAP_LABELS] = { "labels", SST_LOAD_LABELS },
    [MAP_CONFIDENCE] = { "confidence", SST_LOAD_CONFIDENCE },
};

struct job {
    struct sst_lightfield *lf;       /* loading */
    const struct sst_lightfield *in; /* writing, verifying */
    const char *dir;
    unsigned what;
    char (*hashes)[65];
};

static int map_path(char out[SST_PATH_MAX], const struct sst_lightfield *lf, const char *dir, enum map_kind kind,
                    int view)
{
    char name[64], rr_cc[16];

    sst_view_name(lf, view, rr_cc);
    snprintf(name, sizeof(name), "%s/%s.png", kinds[kind].folder, rr_cc);
    return sst_path_join(out, dir, name);
}

int make_folder(const char *dir, const char *name)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, name);

    return err ? err : sst_path_make_dir(path);
}

int view_path(char out[SST_PATH_MAX], const struct sst_lightfield *lf, int k, const char *dir)
{
    char name[300];

    snprintf(name, sizeof(name), "views/%s", lf->files->view[k].name);
    return sst_path_join(out, dir, name);
}

int view_file_read(struct view_file *out, const struct sst_lightfield *lf, int k, const char *dir)
{
    int err;

    out->data = NULL;
    err = view_path(out->path, lf, k, dir);
    return err ? err : sst_file_read(out->path, SST_VIEW_FILE_MAX, &out->data, &out->size);
}

/* Compare a view's file with the hash of lightfield.json. @param remedy  for the message */
static int check_hash(const struct sst_lightfield *lf, int k, const struct view_file *file, const char *remedy)
{
    char hash[65];

    sst_sha256_hex(hash, file->data, file->size);
    if (!strcmp(hash, lf->files->view[k].sha256))
        return 0;
    sst_log_error("%s has changed since it was stored (its SHA-256 differs); %s", file->path, remedy);
    return -EBADMSG;
}

int read_view(struct view_file *out, const struct sst_lightfield *lf, int k, const char *dir)
{
    int err = view_file_read(out, lf, k, dir);

    err = err ? err : check_hash(lf, k, out, "import it again");
    if (err) {
        free(out->data);
        out->data = NULL;
    }
    return err;
}

/* --- loading ------------------------------------------------------------------------------------------------------ */

int view_check_size(const struct sst_lightfield *lf, const char *path, int width, int height)
{
    if (width == lf->width && height == lf->height)
        return 0;
    sst_log_error("%s has %dx%d pixels, the light field %dx%d; make the light field again", path, width, height,
                  lf->width, lf->height);
    return -EBADMSG;
}

static int check_raw_size(const struct sst_calib *calib, const char *path, const struct sst_image *img)
{
    if (img->width == calib->width && img->height == calib->height)
        return 0;
    sst_log_error("%s has %dx%d pixels, the calibration is of frames of %dx%d; make the light field again", path,
                  img->width, img->height, calib->width, calib->height);
    return -EBADMSG;
}

/* Keep the file of a raw frame, which is decoded when it is needed. Owns its data in any case. */
static int keep_encoded(const struct job *job, int k, const struct view_file *file)
{
    struct sst_image frame = { 0 }; /* its size alone */
    int err = sst_image_decode_size(&frame.width, &frame.height, file->data, file->size, file->path);

    err = err ? err : check_raw_size(job->lf->calibration, file->path, &frame);
    if (!err && !(job->what & SST_LOAD_UNVERIFIED))
        err = check_hash(job->lf, k, file, "import it again, or add --no-verify");
    if (err) {
        free(file->data);
        return err;
    }
    job->lf->views[k].encoded = file->data;
    job->lf->views[k].encoded_bytes = file->size;
    return 0;
}

/* A file that cannot be decoded or has another size is reported as such, not as one that has changed. */
static int load_image(const struct job *job, int k)
{
    struct sst_view *v = &job->lf->views[k];
    const struct sst_calib *calib = job->lf->calibration;
    struct view_file file;
    int err = view_file_read(&file, job->lf, k, job->dir);

    if (!err && calib && job->what & SST_LOAD_RAW && job->what & SST_LOAD_ENCODED &&
        sst_image_is_jpeg(file.data, file.size))
        return keep_encoded(job, k, &file);
    err = err ? err : sst_image_decode_samples(&v->image, file.data, file.size, file.path, job->lf->samples);
    if (!err)
        err = calib ? check_raw_size(calib, file.path, &v->image)
                    : view_check_size(job->lf, file.path, v->image.width, v->image.height);
    if (!err && !(job->what & SST_LOAD_UNVERIFIED))
        err = check_hash(job->lf, k, &file, "import it again, or add --no-verify");
    free(file.data);
    if (!err && !calib && job->lf->correction)
        err = correction_apply(job->lf, k, &job->lf->correction[k], job->what & SST_LOAD_ORIGINALS);
    return err || !calib || job->what & SST_LOAD_RAW ? err : sst_lightfield_rectify_view(job->lf, k);
}

/* Labels index the class list in every later stage. */
static int check_labels(const struct sst_lightfield *lf, const char *path, const struct sst_map_u8 *map)
{
    for (int y = 0; y < map->height; y++) {
        const uint8_t *row = sst_map_u8_row(map, y);

        for (int x = 0; x < map->width; x++) {
            if (row[x] > lf->classes.count) {
                sst_log_error("%s has label %d at column %d, row %d; the class list ends at %d", path, row[x], x, y,
                              lf->classes.count);
                return -EBADMSG;
            }
        }
    }
    return 0;
}

static int load_map(const struct sst_lightfield *lf, const char *dir, enum map_kind kind, int k)
{
    struct sst_view *v = &lf->views[k];
    char path[SST_PATH_MAX];
    int err = map_path(path, lf, dir, kind, k);

    if (err || !sst_path_exists(path))
        return err;
    switch (kind) {
    case MAP_DISPARITY:
        err = sst_map_u16_read_png(&v->disp, path);
        return err ? err : view_check_size(lf, path, v->disp.width, v->disp.height);
    case MAP_LABELS:
        err = sst_map_u8_read_png(&v->label, path);
        err = err ? err : view_check_size(lf, path, v->label.width, v->label.height);
        return err ? err : check_labels(lf, path, &v->label);
    case MAP_CONFIDENCE:
        err = sst_map_u8_read_png(&v->confidence, path);
        return err ? err : view_check_size(lf, path, v->confidence.width, v->confidence.height);
    case MAP_KINDS:
        break;
    }
    return -EINVAL;
}

static int load_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    int err = 0;

    if (!job->lf->views[k].present)
        return 0;
    if (job->what & SST_LOAD_IMAGES)
        err = load_image(job, k);
    for (enum map_kind kind = 0; !err && kind < MAP_KINDS; kind++) {
        if (job->what & kinds[kind].load)
            err = load_map(job->lf, job->dir, kind, k);
    }
    return err;
}

static void loaded_maps(void *arg, int k, struct sst_share_maps *out)
{
    const struct job *job = arg;
    struct sst_view *v = &job->lf->views[k];

    if (!v->present)
        return;
    sst_share_add_image(out, &v->image);
    sst_share_add_image(out, &v->original);
    sst_share_add_u8(out, &v->valid);
    sst_share_add_u16(out, &v->disp);
    sst_share_add_u8(out, &v->label);
    sst_share_add_u8(out, &v->confidence);
}

int sst_lightfield_load_view(struct sst_lightfield *lf, const char *dir, unsigned what, int view)
{
    struct job job = { .lf = lf, .dir = dir, .what = what };

    return load_view(&job, view, 0);
}

int sst_lightfield_load(struct sst_lightfield *lf, const char *dir, unsigned what, int threads)
{
    return sst_lightfield_shared_load(NULL, lf, dir, what, threads);
}

int sst_lightfield_shared_load(struct sst_share *share, struct sst_lightfield *lf, const char *dir, unsigned what,
                               int threads)
{
    struct sst_lightfield made;
    struct job job = { .lf = &made, .dir = dir, .what = what };
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, "lightfield.json");

    if (err)
        return err;
    if (!sst_path_exists(path) && !sst_path_is_denied(path)) {
        sst_log_error("%s is not a light field: %s; make one with `sst import` or `sst scene`", dir,
                      sst_path_is_dir(dir)   ? "it has no lightfield.json"
                      : sst_path_exists(dir) ? "it is not a folder"
                                             : "there is no such folder");
        return -ENOENT;
    }
    err = lightfield_read_json(&made, path);
    if (err)
        return err;
    if (what & SST_LOAD_UNCORRECTED) {
        free(made.correction);
        made.correction = NULL;
    }
    if (made.rectified)
        err = calibration_load(&made, dir);
    if (!err && made.calibration && made.correction)
        correction_calibrate(&made);
    made.images_raw = made.rectified && what & SST_LOAD_IMAGES && what & SST_LOAD_RAW;
    made.keeps_sources = what & SST_LOAD_SOURCES;
    if (!err)
        err = sst_share_for(share, made.rows * made.cols, sst_thread_count(threads), load_view, &job, loaded_maps);
    if (err)
        sst_lightfield_fini(&made);
    else
        *lf = made;
    return err;
}

/* --- hashes ------------------------------------------------------------------------------------------------------- */

int file_sha256(char out[65], const char *path)
{
    uint8_t *data;
    size_t size;
    const int err = sst_file_read(path, SST_VIEW_FILE_MAX, &data, &size);

    if (err)
        return err;
    sst_sha256_hex(out, data, size);
    free(data);
    return 0;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

/* Map `index % MAP_KINDS` of view `index / MAP_KINDS`. */
static int write_map(void *arg, int index, int worker SST_UNUSED)
{
    const struct job *job = arg;
    const enum map_kind kind = (enum map_kind)(index % MAP_KINDS);
    const int k = index / MAP_KINDS;
    const struct sst_view *v = &job->in->views[k];
    char path[SST_PATH_MAX];
    int err;

    if (!sst_view_has(v, kinds[kind].load))
        return 0;
    err = map_path(path, job->in, job->dir, kind, k);
    if (err)
        return err;
    switch (kind) {
    case MAP_DISPARITY:
        return sst_map_u16_write_png(&v->disp, path);
    case MAP_LABELS:
        return sst_map_u8_write_png(&v->label, path, sst_classes_palette());
    case MAP_CONFIDENCE:
    case MAP_KINDS:
    default:
        return sst_map_u8_write_png(&v->confidence, path, NULL);
    }
}

static int hash_if_empty(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    char path[SST_PATH_MAX];
    int err;

    if (!job->in->views[k].present || job->in->files->view[k].sha256[0])
        return 0;
    err = view_path(path, job->in, k, job->dir);
    return err ? err : file_sha256(job->hashes[k], path);
}

static bool fits(const struct sst_lightfield *lf, const void *data, int width, int height)
{
    return !data || (width == lf->width && height == lf->height);
}

static bool maps_fit(const struct sst_lightfield *lf)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];

        if (!fits(lf, v->disp.data, v->disp.width, v->disp.height) ||
            !fits(lf, v->label.data, v->label.width, v->label.height) ||
            !fits(lf, v->confidence.data, v->confidence.width, v->confidence.height))
            return false;
    }
    return true;
}

/* Write calibration.yaml and return its hash. */
static int write_calibration(char sha256[65], const struct sst_calib *calib, const char *dir)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, SST_CALIBRATION_FILE);

    err = err ? err : sst_calib_write(calib, path);
    return err ? err : file_sha256(sha256, path);
}

/* Write lightfield.json and all maps into the folder out; missing hashes are computed from the views in dir. */
static int write_files(const struct sst_lightfield *lf, const char *calibration_sha256, const char *dir,
                       const char *out, int threads)
{
    struct job job = { .in = lf, .dir = dir };
    const char *fault = lightfield_fault(lf);
    char path[SST_PATH_MAX], *json = NULL;
    int err = sst_path_join(path, out, "lightfield.json");

    if (err)
        return err;
    if (!fault && !maps_fit(lf))
        fault = "a map differs in size from the views";
    if (fault) {
        sst_log_error("cannot write %s: %s", path, fault);
        return -EINVAL;
    }
    threads = sst_thread_count(threads);
    job.hashes = calloc((size_t)(lf->rows * lf->cols), sizeof(*job.hashes));
    if (!job.hashes)
        goto no_memory;
    err = sst_parallel_for(lf->rows * lf->cols, threads, hash_if_empty, &job);
    for (enum map_kind kind = 0; !err && kind < MAP_KINDS; kind++) {
        if (sst_lightfield_has(lf, kinds[kind].load))
            err = make_folder(out, kinds[kind].folder);
    }
    job.dir = out;
    err = err ? err : sst_parallel_for(lf->rows * lf->cols * MAP_KINDS, SST_WRITE_THREADS, write_map, &job);
    if (err)
        goto out;
    json = lightfield_to_json(lf, job.hashes, calibration_sha256);
    if (!json)
        goto no_memory;
    err = sst_file_write(path, json, strlen(json));

out:
    free(json);
    free(job.hashes);
    return err;

no_memory:
    sst_log_error("no memory to write %s, or a text in it is not UTF-8", path);
    err = -ENOMEM;
    goto out;
}

int sst_lightfield_write(const struct sst_lightfield *lf, const char *dir, int threads)
{
    char calibration_sha256[65] = "";
    const int err = lf->calibration ? write_calibration(calibration_sha256, lf->calibration, dir) : 0;

    return err ? err : write_files(lf, calibration_sha256, dir, dir, threads);
}

/* Swap fresh/name with dir/name, which need not exist. */
static int swap_in(const char *dir, const char *fresh, const char *name)
{
    char from[SST_PATH_MAX], to[SST_PATH_MAX];
    int err = sst_path_join(from, fresh, name);

    err = err ? err : sst_path_join(to, dir, name);
    return err ? err : sst_path_swap(from, to);
}

/* Undo a swap after a later failure. */
static void swap_back(const char *dir, const char *fresh, const char *name)
{
    char from[SST_PATH_MAX], to[SST_PATH_MAX];

    if (sst_path_join(from, fresh, name) || sst_path_join(to, dir, name))
        return;
    if (sst_path_exists(from) ? sst_path_swap(from, to) : rename(to, from))
        sst_log_error("cannot restore %s: the new file stays, without its maps", to);
}

int sst_lightfield_save_maps(const struct sst_lightfield *lf, const char *dir, int threads)
{
    const char *names[MAP_KINDS + 1], *failed = NULL;
    struct sst_outdir fresh;
    char path[SST_PATH_MAX];
    int count = 0, done = 0, err = sst_path_join(path, dir, ".maps");

    err = err ? err : sst_outdir_open(&fresh, path, true);
    if (err)
        return err;
    fresh.synced = true;
    err = write_files(lf, lf->files ? lf->files->calibration_sha256 : "", dir, fresh.temporary, threads);
    if (!err) {
        err = sst_outdir_sync(&fresh);
        if (err) {
            sst_log_error("cannot sync the new maps of %s: %s", dir, strerror(-err));
            err = -EIO;
        }
    }
    for (enum map_kind kind = 0; kind < MAP_KINDS; kind++) {
        if (sst_lightfield_has(lf, kinds[kind].load))
            names[count++] = kinds[kind].folder;
    }
    names[count++] = "lightfield.json";
    sst_file_hold_interrupt();
    while (!err && done < count) {
        err = swap_in(dir, fresh.temporary, names[done]);
        if (err)
            failed = names[done];
        else
            done++;
    }
    while (err && done > 0)
        swap_back(dir, fresh.temporary, names[--done]);
    sst_file_allow_interrupt();
    if (failed) {
        sst_log_error("cannot replace %s/%s: %s", dir, failed, strerror(-err));
        err = -EIO;
    }
    sst_outdir_abort(&fresh);
    return err;
}
