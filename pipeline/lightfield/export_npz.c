/* Export of a light field as arrays of NumPy: views as every command of sst sees them, maps, and places of the cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/image/npz.h"
#include "pipeline/lightfield/lightfield_internal.h"

struct npz_job {
    const struct sst_export_config *cfg;
    struct sst_lightfield lf;
    struct sst_npz npz;
    int *view; /* [views] present ones */
    size_t views;
    bool has[4]; /* by index in `kinds` */
    uint8_t *row; /* a row of the widest array */
};

/* Arrays with a picture or map of each view. */
static const struct {
    const char *name, *type;
    unsigned load;
    size_t channels; /* 0: no axis of channels */
} kinds[] = {
    { "views", "u1", SST_LOAD_IMAGES, 3 },
    { "disparity", "f4", SST_LOAD_DISPARITY, 0 },
    { "labels", "u1", SST_LOAD_LABELS, 0 },
    { "confidence", "u1", SST_LOAD_CONFIDENCE, 0 },
};

static void put_rgb(uint8_t *out, const struct sst_image *img, int y)
{
    for (int c = 0; c < 3; c++) {
        const uint8_t *in = sst_image_row(img, c, y);

        for (int x = 0; x < img->width; x++)
            out[3 * x + c] = in[x];
    }
}

/* Row y of a view's picture or map; of a map that the view lacks, unknown values. */
static void put_row(const struct npz_job *job, size_t kind, const struct sst_view *v, int y)
{
    const size_t width = (size_t)job->lf.width;
    float *px = (float *)(void *)job->row;

    switch (kinds[kind].load) {
    case SST_LOAD_IMAGES:
        put_rgb(job->row, &v->image, y);
        break;
    case SST_LOAD_DISPARITY:
        for (size_t x = 0; x < width; x++) {
            const uint16_t d = v->disp.data ? sst_map_u16_row(&v->disp, y)[x] : SST_DISP_NONE;

            px[x] = d == SST_DISP_NONE ? (float)NAN : (float)sst_disp_px(&job->lf, d);
        }
        break;
    default: {
        const struct sst_map_u8 *map = kinds[kind].load == SST_LOAD_LABELS ? &v->label : &v->confidence;

        if (map->data)
            memcpy(job->row, sst_map_u8_row(map, y), width);
        else
            memset(job->row, 0, width);
    }
    }
}

static int put_views(struct npz_job *job, size_t kind)
{
    const size_t width = (size_t)job->lf.width, height = (size_t)job->lf.height, channels = kinds[kind].channels;
    const size_t row_bytes = width * (channels ? channels : kinds[kind].type[1] - (size_t)'0');
    const struct sst_npz_array array = { kinds[kind].name, kinds[kind].type, channels ? 4 : 3, { job->views, height, width, channels } };
    int err = sst_npz_begin(&job->npz, &array);

    for (size_t i = 0; !err && i < job->views; i++) {
        struct sst_view *v = &job->lf.views[job->view[i]];

        err = sst_lightfield_load_view(&job->lf, job->cfg->dir, kinds[kind].load, job->view[i]);
        for (int y = 0; !err && y < job->lf.height; y++) {
            put_row(job, kind, v, y);
            err = sst_npz_put(&job->npz, job->row, row_bytes);
        }
        sst_view_empty(v);
    }
    return err;
}

/* Kinds of maps that any view has. */
static int look_for_maps(struct npz_job *job)
{
    int err = 0;

    job->has[0] = !job->cfg->maps;
    for (size_t kind = 1; kind < ARRAY_LEN(kinds); kind++) {
        for (size_t i = 0; !err && !job->has[kind] && i < job->views; i++) {
            struct sst_view *v = &job->lf.views[job->view[i]];

            err = sst_lightfield_load_view(&job->lf, job->cfg->dir, kinds[kind].load, job->view[i]);
            job->has[kind] = sst_view_has(v, kinds[kind].load);
            sst_view_empty(v);
        }
    }
    return err;
}

static int put_number(struct sst_npz *npz, const char *name, double value)
{
    return sst_npz_add(npz, &(struct sst_npz_array){ name, "f8", 0, { 0 } }, &value);
}

static int put_cameras(struct npz_job *job)
{
    double matrix[9], position[3];
    struct sst_calib_camera c;
    int err = 0;

    if (!sst_lightfield_camera(&c, &job->lf, job->lf.ref_view))
        return 0;
    err = sst_npz_begin(&job->npz, &(struct sst_npz_array){ "camera_matrix", "f8", 3, { job->views, 3, 3 } });
    for (size_t i = 0; !err && i < job->views; i++) {
        (void)sst_lightfield_camera(&c, &job->lf, job->view[i]);
        memcpy(matrix, (const double[9]){ c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1 }, sizeof(matrix));
        err = sst_npz_put(&job->npz, matrix, sizeof(matrix));
    }
    err = err ? err : sst_npz_begin(&job->npz, &(struct sst_npz_array){ "position_mm", "f8", 2, { job->views, 3 } });
    for (size_t i = 0; !err && i < job->views; i++) {
        (void)sst_lightfield_camera(&c, &job->lf, job->view[i]);
        memcpy(position, c.position_mm, sizeof(position));
        err = sst_npz_put(&job->npz, position, sizeof(position));
    }
    return err;
}

static int put_grid(struct npz_job *job)
{
    const struct sst_lightfield *lf = &job->lf;
    int err = sst_npz_begin(&job->npz, &(struct sst_npz_array){ "place", "i4", 2, { job->views, 2 } });
    int32_t reference = 0;

    for (size_t i = 0; !err && i < job->views; i++) {
        const int32_t place[2] = { job->view[i] / lf->cols, job->view[i] % lf->cols };

        reference = job->view[i] == lf->ref_view ? (int32_t)i : reference;
        err = sst_npz_put(&job->npz, place, sizeof(place));
    }
    err = err ? err : sst_npz_begin(&job->npz, &(struct sst_npz_array){ "offset", "f8", 2, { job->views, 2 } });
    for (size_t i = 0; !err && i < job->views; i++) {
        const double offset[2] = { lf->views[job->view[i]].bx, lf->views[job->view[i]].by };

        err = sst_npz_put(&job->npz, offset, sizeof(offset));
    }
    err = err ? err : sst_npz_add(&job->npz, &(struct sst_npz_array){ "reference", "i4", 0, { 0 } }, &reference);
    err = err ? err : put_number(&job->npz, "focal_px", lf->focal_px > 0 ? lf->focal_px : (double)NAN);
    err = err ? err : put_number(&job->npz, "spacing_mm", lf->spacing_mm > 0 ? lf->spacing_mm : (double)NAN);
    return err ? err : put_number(&job->npz, "infinity_px", lf->infinity_known ? lf->infinity_px : (double)NAN);
}

static int put_label_names(struct npz_job *job)
{
    char names[SST_MAX_CLASSES + 1][SST_CLASS_NAME_MAX] = { "unlabeled" };

    memcpy(names + 1, job->lf.classes.names, sizeof(job->lf.classes.names));
    return sst_npz_add_texts(&job->npz, "label_names", names[0], sizeof(names[0]), (size_t)job->lf.classes.count + 1);
}

static int fill(struct npz_job *job)
{
    int err = look_for_maps(job);

    err = err ? err : sst_npz_open(&job->npz, job->cfg->out);
    if (err)
        return err;
    for (size_t kind = 0; !err && kind < ARRAY_LEN(kinds); kind++)
        err = job->has[kind] ? put_views(job, kind) : 0;
    err = err ? err : put_grid(job);
    err = err ? err : put_cameras(job);
    err = err || !job->has[2] ? err : put_label_names(job);
    return sst_npz_end(&job->npz, err);
}

int sst_export_npz(const struct sst_export_config *cfg)
{
    struct npz_job job = { .cfg = cfg };
    int err = sst_path_check_keeps(cfg->out, cfg->dir);

    err = err ? err : sst_lightfield_load(&job.lf, cfg->dir, 0, 1);
    if (err)
        return err;
    job.view = calloc((size_t)(job.lf.rows * job.lf.cols), sizeof(*job.view));
    job.row = malloc((size_t)job.lf.width * 4);
    for (int k = 0; job.view && k < job.lf.rows * job.lf.cols; k++) {
        if (job.lf.views[k].present)
            job.view[job.views++] = k;
    }
    err = job.view && job.row ? fill(&job) : -ENOMEM;
    if (err == -ENOMEM && !(job.view && job.row))
        sst_log_error("not enough memory to export %s", cfg->dir);
    free(job.view);
    free(job.row);
    sst_lightfield_fini(&job.lf);
    return err;
}
