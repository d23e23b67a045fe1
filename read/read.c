/* libsst-read: light fields of sst for other programs. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "read/sst/read.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/posed/picture.h"

struct sst_read {
    char dir[SST_PATH_MAX];
    bool is_posed;
    struct sst_lightfield lattice;
    struct sst_posed posed;
};

static _Thread_local char error_text[SST_LOG_MAX];

/* Errors of the calls between begin() and end() become the thread's text. */
static char *begin(void)
{
    error_text[0] = 0;
    return sst_log_hold_errors(error_text);
}

static int end(char *before, int err)
{
    sst_log_hold_errors(before);
    if (err && !error_text[0])
        snprintf(error_text, sizeof(error_text), "%s", err == -ENOMEM ? "not enough memory" : strerror(-err));
    return err;
}

static int refuse(int err, const char *text)
{
    snprintf(error_text, sizeof(error_text), "%s", text);
    return err;
}

const char *sst_read_error(void)
{
    return error_text;
}

int sst_read_open(struct sst_read **out, const char *dir)
{
    struct sst_read *made = calloc(1, sizeof(*made));
    char *before = begin();
    int err = made ? sst_path_join(made->dir, dir, NULL) : -ENOMEM;

    sst_log_set_level(SST_LOG_ERROR); /* the library's own */
    if (!err) {
        made->is_posed = sst_posed_is(dir);
        err = made->is_posed ? sst_posed_load(&made->posed, dir) : sst_lightfield_load(&made->lattice, dir, 0, 1);
    }
    if (err)
        free(made);
    else
        *out = made;
    return end(before, err);
}

void sst_read_close(struct sst_read *lf)
{
    if (!lf)
        return;
    if (lf->is_posed)
        sst_posed_fini(&lf->posed);
    else
        sst_lightfield_fini(&lf->lattice);
    free(lf);
}

static int view_count(const struct sst_read *lf)
{
    return lf->is_posed ? lf->posed.count : lf->lattice.rows * lf->lattice.cols;
}

int sst_read_get_info(const struct sst_read *lf, struct sst_read_info *info)
{
    const struct sst_lightfield *l = &lf->lattice;
    const struct sst_posed *p = &lf->posed;
    const size_t size = info->size;
    struct sst_read_info made = { .size = size, .posed = lf->is_posed, .views = view_count(lf) };

    error_text[0] = 0;
    if (size < sizeof(size) || size > sizeof(made))
        return refuse(-EINVAL, "info->size is not that of struct sst_read_info");
    made.focal_px = made.spacing_mm = made.infinity_px = (double)NAN;
    if (lf->is_posed) {
        made.reference = sst_posed_middle(p);
        made.width = p->width;
        made.height = p->height;
        made.channels = p->channels;
        made.bits = p->bits;
        made.metric = p->metric;
        made.kelvin_scale = p->kelvin_scale;
        made.kelvin_offset = p->kelvin_offset;
    } else {
        made.rows = l->rows;
        made.cols = l->cols;
        made.reference = l->ref_view;
        made.width = l->width;
        made.height = l->height;
        made.channels = 3;
        made.bits = 8;
        made.labels = l->classes.count;
        made.metric = l->spacing_mm > 0;
        made.focal_px = l->focal_px > 0 ? l->focal_px : made.focal_px;
        made.spacing_mm = l->spacing_mm > 0 ? l->spacing_mm : made.spacing_mm;
        made.infinity_px = l->infinity_known ? l->infinity_px : made.infinity_px;
    }
    memcpy(info, &made, size);
    return 0;
}

static void put_camera(struct sst_read_view *out, const struct sst_calib_camera *c)
{
    out->placed = c->known;
    out->fx = c->fx;
    out->fy = c->fy;
    out->cx = c->cx;
    out->cy = c->cy;
    memcpy(out->k, c->k, sizeof(out->k));
    memcpy(out->rotation, c->rotation, sizeof(out->rotation));
    memcpy(out->position_mm, c->position_mm, sizeof(out->position_mm));
    if (c->known)
        return;
    out->fx = out->fy = out->cx = out->cy = (double)NAN;
    for (size_t i = 0; i < ARRAY_LEN(out->k); i++)
        out->k[i] = (double)NAN;
    for (size_t i = 0; i < ARRAY_LEN(out->rotation); i++)
        out->rotation[i] = (double)NAN;
    for (size_t i = 0; i < ARRAY_LEN(out->position_mm); i++)
        out->position_mm[i] = (double)NAN;
}

int sst_read_get_view(const struct sst_read *lf, int view, struct sst_read_view *out)
{
    const size_t size = out->size;
    struct sst_read_view made = { .size = size, .time_s = (double)NAN };

    error_text[0] = 0;
    if (size < sizeof(size) || size > sizeof(made))
        return refuse(-EINVAL, "out->size is not that of struct sst_read_view");
    if (view < 0 || view >= view_count(lf))
        return refuse(-EINVAL, "the light field has no view of this number");
    if (lf->is_posed) {
        const struct sst_posed_view *v = &lf->posed.view[view];

        made.present = 1;
        made.moment = v->moment;
        made.time_s = v->time_s;
        made.name = v->name;
        put_camera(&made, &v->camera);
    } else {
        const struct sst_view *v = &lf->lattice.views[view];
        struct sst_calib_camera camera;

        made.present = v->present;
        made.row = view / lf->lattice.cols;
        made.col = view % lf->lattice.cols;
        made.bx = v->bx;
        made.by = v->by;
        made.name = lf->lattice.files->view[view].name;
        (void)sst_lightfield_camera(&camera, &lf->lattice, view);
        put_camera(&made, &camera);
    }
    memcpy(out, &made, size);
    return 0;
}

const char *sst_read_label_name(const struct sst_read *lf, int label)
{
    const struct sst_classes *c = &lf->lattice.classes;

    return lf->is_posed || label < 0 || label > c->count ? NULL : label ? c->names[label - 1] : "unlabeled";
}

/* --- pixels ------------------------------------------------------------------------------------------------------- */

/* @param item  bytes of a pixel @param stride  in and out: 0 becomes rows without gaps */
static int check_view(const struct sst_read *lf, int view, size_t item, size_t *stride)
{
    const size_t row = item * (size_t)(lf->is_posed ? lf->posed.width : lf->lattice.width);

    if (view < 0 || view >= view_count(lf))
        return refuse(-EINVAL, "the light field has no view of this number");
    if (!lf->is_posed && !lf->lattice.views[view].present)
        return refuse(-ENODATA, "the light field has no view at this place of its lattice");
    *stride = *stride ? *stride : row;
    return *stride < row ? refuse(-EINVAL, "stride is below the bytes of a row") : 0;
}

static void put_image(uint8_t *rgb, size_t stride, const struct sst_image *img)
{
    for (int y = 0; y < img->height; y++) {
        for (int c = 0; c < 3; c++) {
            const uint8_t *in = sst_image_row(img, c, y);
            uint8_t *out = rgb + (size_t)y * stride;

            for (int x = 0; x < img->width; x++)
                out[3 * x + c] = in[x];
        }
    }
}

/* Levels of 16 bits, or of 8 bits times 257. */
static void put_deep(uint16_t *rgb, size_t stride, const struct sst_deep *deep)
{
    const int factor = deep->white > 255 ? 1 : 257;

    for (int y = 0; y < deep->height; y++) {
        for (int c = 0; c < 3; c++) {
            const uint16_t *in = sst_map_u16_row(&deep->plane[deep->channels > 1 ? c : 0], y);
            uint8_t *out = (uint8_t *)rgb + (size_t)y * stride;

            for (int x = 0; x < deep->width; x++) {
                const uint16_t v = (uint16_t)(in[x] * factor);

                memcpy(out + 2 * (3 * x + c), &v, sizeof(v));
            }
        }
    }
}

/* The picture of a posed view, or the file of a lattice's, levels as they are. */
static int read_deep(struct sst_deep *out, const struct sst_read *lf, int view)
{
    return lf->is_posed ? sst_posed_picture(out, &lf->posed, lf->dir, view)
                        : sst_lightfield_read_file(out, &lf->lattice, lf->dir, view);
}

static int read_image(struct sst_image *out, struct sst_read *lf, int view)
{
    struct sst_deep deep = { 0 };
    struct sst_view *v;
    int err;

    if (lf->is_posed) {
        err = read_deep(&deep, lf, view);
        err = err ? err : sst_deep_to_image(out, &deep, deep.white > 255 ? lf->posed.samples : (struct sst_samples){ 0 });
        sst_deep_fini(&deep);
        return err;
    }
    v = &lf->lattice.views[view];
    err = sst_lightfield_load_view(&lf->lattice, lf->dir, SST_LOAD_IMAGES, view);
    if (!err) {
        *out = v->image;
        v->image = (struct sst_image){ 0 };
    }
    sst_view_empty(v);
    return err;
}

int sst_read_rgb8(struct sst_read *lf, int view, uint8_t *rgb, size_t stride)
{
    char *before = begin();
    struct sst_image img = { 0 };
    int err = check_view(lf, view, 3, &stride);

    err = err ? err : read_image(&img, lf, view);
    if (!err)
        put_image(rgb, stride, &img);
    sst_image_fini(&img);
    return end(before, err);
}

int sst_read_rgb16(struct sst_read *lf, int view, uint16_t *rgb, size_t stride)
{
    char *before = begin();
    struct sst_deep deep = { 0 };
    struct sst_image img = { 0 };
    int err = check_view(lf, view, 6, &stride);

    if (!err && !lf->is_posed && (lf->lattice.calibration || lf->lattice.correction)) {
        err = read_image(&img, lf, view);
        for (int y = 0; !err && y < img.height; y++) {
            for (int i = 0; i < 3 * img.width; i++) {
                const uint16_t v = (uint16_t)(sst_image_row(&img, i % 3, y)[i / 3] * 257);

                memcpy((uint8_t *)rgb + (size_t)y * stride + 2 * (size_t)i, &v, sizeof(v));
            }
        }
    } else if (!err) {
        err = read_deep(&deep, lf, view);
        if (!err)
            put_deep(rgb, stride, &deep);
    }
    sst_image_fini(&img);
    sst_deep_fini(&deep);
    return end(before, err);
}

/* --- maps --------------------------------------------------------------------------------------------------------- */

/* Load a map of a view, which sst_view_empty() frees. */
static int load_map(struct sst_read *lf, int view, enum sst_lightfield_load kind)
{
    int err;

    if (lf->is_posed)
        return refuse(-ENODATA, "a light field with a pose for every view has no maps");
    err = sst_lightfield_load_view(&lf->lattice, lf->dir, kind, view);
    if (!err && !sst_view_has(&lf->lattice.views[view], kind))
        err = refuse(-ENODATA, "the view has no map of this kind; `sst process` makes disparities and labels");
    return err;
}

int sst_read_disparity(struct sst_read *lf, int view, float *px, size_t stride)
{
    char *before = begin();
    int err = check_view(lf, view, sizeof(float), &stride);
    struct sst_view *v = err || lf->is_posed ? NULL : &lf->lattice.views[view];

    err = err ? err : load_map(lf, view, SST_LOAD_DISPARITY);
    for (int y = 0; !err && y < v->disp.height; y++) {
        const uint16_t *in = sst_map_u16_row(&v->disp, y);

        for (int x = 0; x < v->disp.width; x++) {
            const float d = in[x] == SST_DISP_NONE ? (float)NAN : (float)sst_disp_px(&lf->lattice, in[x]);

            memcpy((uint8_t *)px + (size_t)y * stride + sizeof(d) * (size_t)x, &d, sizeof(d));
        }
    }
    if (v)
        sst_view_empty(v);
    return end(before, err);
}

static int read_u8(struct sst_read *lf, int view, enum sst_lightfield_load kind, uint8_t *out, size_t stride)
{
    char *before = begin();
    int err = check_view(lf, view, 1, &stride);
    struct sst_view *v = err || lf->is_posed ? NULL : &lf->lattice.views[view];

    err = err ? err : load_map(lf, view, kind);
    if (!err) {
        const struct sst_map_u8 *map = kind == SST_LOAD_LABELS ? &v->label : &v->confidence;

        for (int y = 0; y < map->height; y++)
            memcpy(out + (size_t)y * stride, sst_map_u8_row(map, y), (size_t)map->width);
    }
    if (v)
        sst_view_empty(v);
    return end(before, err);
}

int sst_read_labels(struct sst_read *lf, int view, uint8_t *label, size_t stride)
{
    return read_u8(lf, view, SST_LOAD_LABELS, label, stride);
}

int sst_read_confidence(struct sst_read *lf, int view, uint8_t *confidence, size_t stride)
{
    return read_u8(lf, view, SST_LOAD_CONFIDENCE, confidence, stride);
}
