/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/external_maps.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield_internal.h"

struct job {
    struct sst_lightfield *lf;
    const char *dir;
    bool store;        /* second pass over disparity: stores the values, the first only measures them */
    double *min, *max; /* [views] of the finite values; min above max: none */
    int *max_label;    /* [views] */
};

static int map_path(char out[SST_PATH_MAX], const struct job *job, int k, const char *extension)
{
    char name[32];

    sst_view_name(job->lf, k, name);
    strcat(name, extension);
    return sst_path_join(out, job->dir, name);
}

static int check_size(const struct job *job, const char *path, int width, int height)
{
    if (width == job->lf->width && height == job->lf->height)
        return 0;
    sst_log_error("%s has %dx%d pixels, the views have %dx%d; give maps of the views' size", path, width, height,
                  job->lf->width, job->lf->height);
    return -EBADMSG;
}

/* Infinite values mean unknown. */
static int measure(const struct sst_map_f32 *map, const char *path, double *min, double *max)
{
    *min = INFINITY;
    *max = -INFINITY;
    for (int y = 0; y < map->height; y++) {
        const float *row = sst_map_f32_row(map, y);

        for (int x = 0; x < map->width; x++) {
            if (isinf(row[x]))
                continue;
            if (fabsf(row[x]) > (float)SST_DISP_ABS_MAX_PX) {
                sst_log_error("%s has disparity %g at column %d, row %d, beyond %g; mark unknown values as inf", path,
                              (double)row[x], x, y, SST_DISP_ABS_MAX_PX);
                return -EBADMSG;
            }
            *min = fmin(*min, (double)row[x]);
            *max = fmax(*max, (double)row[x]);
        }
    }
    return 0;
}

static int store(struct sst_lightfield *lf, int k, const struct sst_map_f32 *map)
{
    struct sst_map_u16 *disp = &lf->views[k].disp;
    int err = sst_map_u16_init(disp, map->width, map->height);

    for (int y = 0; !err && y < map->height; y++) {
        for (int x = 0; x < map->width; x++)
            sst_map_u16_row(disp, y)[x] = sst_disp_q6(lf, (double)sst_map_f32_row(map, y)[x]);
    }
    return err;
}

static int disparity_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    struct sst_map_f32 map;
    char path[SST_PATH_MAX];
    int err = job->lf->views[k].present ? map_path(path, job, k, ".pfm") : 0;

    if (err || !job->lf->views[k].present)
        return err;
    err = sst_map_f32_read_pfm(&map, path);
    if (err)
        return err;
    err = check_size(job, path, map.width, map.height);
    if (!err)
        err = job->store ? store(job->lf, k, &map) : measure(&map, path, &job->min[k], &job->max[k]);
    sst_map_f32_fini(&map);
    return err;
}

int sst_lightfield_read_disparity(struct sst_lightfield *lf, const char *dir, int threads)
{
    double min[SST_MAX_VIEWS], max[SST_MAX_VIEWS], lo = INFINITY, hi = -INFINITY;
    struct job job = { .lf = lf, .dir = dir, .min = min, .max = max };
    const int count = lf->rows * lf->cols;
    int err = sst_parallel_for(count, threads, disparity_view, &job);

    if (err)
        return err;
    for (int k = 0; k < count; k++) {
        if (lf->views[k].present) {
            lo = fmin(lo, min[k]);
            hi = fmax(hi, max[k]);
        }
    }
    if (lo > hi) {
        sst_log_error("%s holds no known disparity; leave out --disparity", dir);
        return -EBADMSG;
    }
    if (hi - floor(lo) > SST_RANGE_MAX_PX) {
        sst_log_error("the disparities in %s run from %g to %g px; more than %g px cannot be stored", dir, lo, hi,
                      SST_RANGE_MAX_PX);
        return -EBADMSG;
    }
    lf->disp_min_px = floor(lo);
    if (lf->range_min_px == lf->range_max_px) {
        lf->range_min_px = lo;
        lf->range_max_px = hi;
    }
    lf->files->external_disparity = true;
    lf->disparity_tested = false;
    job.store = true;
    return sst_parallel_for(count, threads, disparity_view, &job);
}

static int labels_view(void *arg, int k, int worker SST_UNUSED)
{
    const struct job *job = arg;
    struct sst_map_u8 *label = &job->lf->views[k].label;
    char path[SST_PATH_MAX];
    int err = job->lf->views[k].present ? map_path(path, job, k, ".png") : 0;

    if (err || !job->lf->views[k].present)
        return err;
    err = sst_map_u8_read_png(label, path);
    err = err ? err : check_size(job, path, label->width, label->height);
    for (int y = 0; !err && y < label->height; y++) {
        for (int x = 0; x < label->width; x++)
            job->max_label[k] = sst_max_int(job->max_label[k], sst_map_u8_row(label, y)[x]);
    }
    if (!err && job->max_label[k] > SST_MAX_CLASSES) {
        sst_log_error("%s has label %d; labels are 0 (unlabeled) to %d", path, job->max_label[k], SST_MAX_CLASSES);
        err = -EBADMSG;
    }
    return err;
}

int sst_lightfield_read_labels(struct sst_lightfield *lf, const char *dir, int threads)
{
    int max_label[SST_MAX_VIEWS] = { 0 };
    struct job job = { .lf = lf, .dir = dir, .max_label = max_label };
    struct sst_classes *classes = &lf->classes;
    int err = sst_parallel_for(lf->rows * lf->cols, threads, labels_view, &job);

    /* Labels missing from the class list are added as LabelN. */
    for (int k = 0; !err && k < lf->rows * lf->cols; k++) {
        while (classes->count < max_label[k]) {
            snprintf(classes->names[classes->count], SST_CLASS_NAME_MAX, "Label%d", classes->count + 1);
            classes->count++;
        }
    }
    if (!err)
        lf->files->external_labels = true;
    return err;
}
