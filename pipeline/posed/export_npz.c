/* Export of a posed light field as arrays of NumPy: pictures as they are, lenses and poses, points. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/image/npz.h"
#include "pipeline/posed/export.h"
#include "pipeline/posed/picture.h"

struct npz_job {
    const struct sst_export_config *cfg;
    struct sst_posed posed;
    struct sst_npz npz;
};

/* Numbers of a view, NaN where unknown. */
static void put_matrix(double *out, const struct sst_posed_view *v)
{
    const struct sst_calib_camera *c = &v->camera;
    const double m[9] = { c->fx, 0, c->cx, 0, c->fy, c->cy, 0, 0, 1 };

    for (int i = 0; i < 9; i++)
        out[i] = c->fx > 0 ? m[i] : (double)NAN;
}

static void put_distortion(double *out, const struct sst_posed_view *v)
{
    for (int i = 0; i < SST_LENS_MAX; i++)
        out[i] = v->camera.fx > 0 ? v->camera.k[i] : (double)NAN;
}

static void put_rotation(double *out, const struct sst_posed_view *v)
{
    for (int i = 0; i < 9; i++)
        out[i] = v->camera.known ? v->camera.rotation[i] : (double)NAN;
}

static void put_position(double *out, const struct sst_posed_view *v)
{
    for (int i = 0; i < 3; i++)
        out[i] = v->camera.known ? v->camera.position_mm[i] : (double)NAN;
}

static void put_time(double *out, const struct sst_posed_view *v)
{
    out[0] = v->time_s;
}

static const struct {
    const char *name;
    int n_dims;
    size_t dims[2];
    void (*put)(double *out, const struct sst_posed_view *v);
} numbers[] = {
    { "camera_matrix", 3, { 3, 3 }, put_matrix },
    { "distortion", 2, { SST_LENS_MAX }, put_distortion },
    { "rotation", 3, { 3, 3 }, put_rotation },
    { "position_mm", 2, { 3 }, put_position },
    { "time_s", 1, { 0 }, put_time },
};

static int put_numbers(struct npz_job *job, size_t i)
{
    const size_t views = (size_t)job->posed.count;
    const size_t n = numbers[i].n_dims == 1 ? 1 : numbers[i].dims[0] * (numbers[i].n_dims == 3 ? numbers[i].dims[1] : 1);
    double value[9];
    int err = sst_npz_begin(&job->npz, &(struct sst_npz_array){ numbers[i].name, "f8", numbers[i].n_dims,
                                                                { views, numbers[i].dims[0], numbers[i].dims[1] } });

    for (size_t k = 0; !err && k < views; k++) {
        numbers[i].put(value, &job->posed.view[k]);
        err = sst_npz_put(&job->npz, value, n * sizeof(*value));
    }
    return err;
}

/* A row of a picture, channels together. */
static size_t put_row(uint8_t *out, const struct sst_deep *deep, int y)
{
    const size_t n = (size_t)deep->channels;

    for (size_t c = 0; c < n; c++) {
        const uint16_t *in = sst_map_u16_row(&deep->plane[c], y);

        for (size_t x = 0; x < (size_t)deep->width; x++) {
            if (deep->white > 255)
                memcpy(out + 2 * (x * n + c), &in[x], 2);
            else
                out[x * n + c] = (uint8_t)in[x];
        }
    }
    return n * (size_t)deep->width * (deep->white > 255 ? 2 : 1);
}

static int put_views(struct npz_job *job)
{
    const struct sst_posed *posed = &job->posed;
    const struct sst_npz_array array = { "views", posed->bits > 8 ? "u2" : "u1", posed->channels > 1 ? 4 : 3,
                                         { (size_t)posed->count, (size_t)posed->height, (size_t)posed->width, (size_t)posed->channels } };
    uint8_t *row = malloc((size_t)posed->width * 6);
    int err = row ? sst_npz_begin(&job->npz, &array) : -ENOMEM;

    if (!row)
        sst_log_error("not enough memory to export %s", job->cfg->dir);
    for (int k = 0; !err && k < posed->count; k++) {
        struct sst_deep deep = { 0 };

        err = sst_posed_picture(&deep, posed, job->cfg->dir, k);
        for (int y = 0; !err && y < posed->height; y++)
            err = sst_npz_put(&job->npz, row, put_row(row, &deep, y));
        sst_deep_fini(&deep);
    }
    free(row);
    return err;
}

static int put_world(struct npz_job *job)
{
    const struct sst_posed *posed = &job->posed;
    const double kelvin[2] = { posed->kelvin_scale, posed->kelvin_offset };
    int err = sst_npz_add_texts(&job->npz, "names", posed->view[0].name, sizeof(posed->view[0]), (size_t)posed->count);

    err = err ? err : sst_npz_begin(&job->npz, &(struct sst_npz_array){ "moment", "i4", 1, { (size_t)posed->count } });
    for (int k = 0; !err && k < posed->count; k++)
        err = sst_npz_put(&job->npz, &(int32_t){ posed->view[k].moment }, 4);
    err = err ? err : sst_npz_add(&job->npz, &(struct sst_npz_array){ "metric", "b1", 0, { 0 } }, &(uint8_t){ posed->metric });
    err = err ? err : sst_npz_add(&job->npz, &(struct sst_npz_array){ "up", "f8", 1, { 3 } }, posed->up);
    if (!err && posed->kelvin_scale != 0)
        err = sst_npz_add(&job->npz, &(struct sst_npz_array){ "kelvin", "f8", 1, { 2 } }, kelvin);
    if (err || !posed->point_count)
        return err;
    err = sst_npz_begin(&job->npz, &(struct sst_npz_array){ "points_mm", "f8", 2, { (size_t)posed->point_count, 3 } });
    for (int i = 0; !err && i < posed->point_count; i++)
        err = sst_npz_put(&job->npz, posed->points[i].at_mm, sizeof(posed->points[i].at_mm));
    return err;
}

int sst_posed_export_npz(const struct sst_export_config *cfg)
{
    struct npz_job job = { .cfg = cfg };
    int err = sst_path_check_keeps(cfg->out, cfg->dir);

    err = err ? err : sst_posed_load(&job.posed, cfg->dir);
    if (err)
        return err;
    err = sst_npz_open(&job.npz, cfg->out);
    if (!err) {
        err = put_views(&job);
        for (size_t i = 0; !err && i < ARRAY_LEN(numbers); i++)
            err = put_numbers(&job, i);
        err = err ? err : put_world(&job);
        err = sst_npz_end(&job.npz, err);
    }
    sst_posed_fini(&job.posed);
    return err;
}
