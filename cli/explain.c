/* Explanation of a picture: maps and weights of the reference view, and the rays of one pixel. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "cli/cli_internal.h"
#include "cli/render_internal.h"
#include "pipeline/image/codec.h"

#define PATCH       15 /* pixels around a ray */
#define MAGNIFY     4  /* pixels across each view's pixel */
#define BAR         8  /* rows of the bar below */
#define GAP         4
#define CELL_WIDTH  (PATCH * MAGNIFY + GAP)
#define CELL_HEIGHT (PATCH * MAGNIFY + BAR + GAP)

struct explanation {
    const struct render_input *in;
    const struct render_args *args;
    const struct sst_view *view; /* the reference view */
    char name[16];               /* "rr_cc" of it */
    const char *dir;
    json_t *root;
};

/* Dark blue over green to yellow, each step brighter than the one before. u in 0..1. */
static void colour_of(double u, uint8_t rgb[3])
{
    static const double stop[][3] = {
        { 20, 10, 80 }, { 50, 60, 150 }, { 30, 130, 140 }, { 90, 190, 90 }, { 250, 235, 60 }
    };
    const double at = sst_clamp_double(u, 0, 1) * (double)(ARRAY_LEN(stop) - 1);
    const size_t i = at >= (double)(ARRAY_LEN(stop) - 1) ? ARRAY_LEN(stop) - 2 : (size_t)at;

    for (int c = 0; c < 3; c++)
        rgb[c] = (uint8_t)(stop[i][c] + (at - (double)i) * (stop[i + 1][c] - stop[i][c]) + 0.5);
}

/* Unknown disparity is black. */
static int write_disparity(const struct explanation *e)
{
    const struct sst_map_u16 *disp = &e->view->disp;
    uint16_t lo = SST_DISP_NONE, hi = 0;
    struct sst_image img = { 0 };
    char path[SST_PATH_MAX];
    int err;

    if (!disp->data)
        return 0;
    for (int y = 0; y < disp->height; y++) {
        for (int x = 0; x < disp->width; x++) {
            const uint16_t d = sst_map_u16_row(disp, y)[x];

            lo = d < lo ? d : lo;
            hi = d > hi && d != SST_DISP_NONE ? d : hi;
        }
    }
    err = sst_image_init(&img, disp->width, disp->height);
    for (int y = 0; y < disp->height && !err; y++) {
        for (int x = 0; x < disp->width; x++) {
            const uint16_t d = sst_map_u16_row(disp, y)[x];
            uint8_t rgb[3] = { 0 };

            if (d != SST_DISP_NONE)
                colour_of(hi > lo ? (double)(d - lo) / (hi - lo) : 0.5, rgb);
            for (int c = 0; c < 3; c++)
                sst_image_row(&img, c, y)[x] = rgb[c];
        }
    }
    err = err ? err : sst_path_join(path, e->dir, "disparity.png");
    err = err ? err : sst_image_write_png(&img, path);
    if (!err && lo <= hi)
        json_object_set_new(
            e->root, "disparity_px",
            json_pack("{s:f, s:f}", "dark_blue", sst_disp_px(&e->in->lf, lo), "yellow", sst_disp_px(&e->in->lf, hi)));
    sst_image_fini(&img);
    return err;
}

static int write_labels(const struct explanation *e, const struct sst_map_u8 *label, const char *file)
{
    const uint8_t(*palette)[3] = sst_classes_palette();
    bool seen[256] = { false };
    json_t *legend = json_object();
    char path[SST_PATH_MAX], colour[16];
    int err = sst_path_join(path, e->dir, file);

    for (int y = 0; y < label->height; y++) {
        for (int x = 0; x < label->width; x++)
            seen[sst_map_u8_row(label, y)[x]] = true;
    }
    for (int i = 0; i < 256; i++) {
        snprintf(colour, sizeof(colour), "#%02x%02x%02x", palette[i][0], palette[i][1], palette[i][2]);
        if (seen[i])
            json_object_set_new(legend, sst_classes_name(&e->in->lf.classes, i), json_string(colour));
    }
    json_object_set_new(e->root, file, legend);
    return err ? err : sst_map_u8_write_png(label, path, palette);
}

/* Copy a map of the reference view, if the light field has it: grey, or with the labels' colours. */
static int write_stored(const struct explanation *e, const char *folder, bool labels)
{
    char path[SST_PATH_MAX], name[64];
    struct sst_map_u8 map = { 0 };
    int err;

    snprintf(name, sizeof(name), "%s/%s.png", folder, e->name);
    err = sst_path_join(path, e->in->path, name);
    if (err || !sst_path_exists(path))
        return err;
    err = sst_map_u8_read_png(&map, path);
    if (err)
        return err;
    snprintf(name, sizeof(name), "%s.png", folder);
    err = labels ? write_labels(e, &map, name) : sst_path_join(path, e->dir, name);
    if (!err && !labels)
        err = sst_map_u8_write_png(&map, path, NULL);
    sst_map_u8_fini(&map);
    return err;
}

/* A weight of 0..1 as grey; b may be NULL, else the product is shown. */
static int write_weight(const struct explanation *e, const struct sst_map_f32 *a, const struct sst_map_f32 *b,
                        const char *file)
{
    struct sst_map_u8 grey = { 0 };
    char path[SST_PATH_MAX];
    int err = sst_map_u8_init(&grey, a->width, a->height);

    for (int y = 0; y < a->height && !err; y++) {
        for (int x = 0; x < a->width; x++) {
            const float w = sst_map_f32_row(a, y)[x] * (b ? sst_map_f32_row(b, y)[x] : 1);

            sst_map_u8_row(&grey, y)[x] = (uint8_t)(255 * w + 0.5f);
        }
    }
    err = err ? err : sst_path_join(path, e->dir, file);
    err = err ? err : sst_map_u8_write_png(&grey, path, NULL);
    sst_map_u8_fini(&grey);
    return err;
}

static int write_weights(const struct explanation *e)
{
    struct sst_map_f32 depth = { 0 }, label = { 0 };
    int err = sst_map_f32_init(&depth, e->in->lf.width, e->in->lf.height);

    err = err ? err : sst_map_f32_init(&label, e->in->lf.width, e->in->lf.height);
    err = err ? err : sst_render_weights(e->in->renderer, &e->args->cfg, e->in->lf.ref_view, &depth, &label);
    err = err ? err : write_weight(e, &depth, NULL, "weight_depth.png");
    err = err ? err : write_weight(e, &label, NULL, "weight_label.png");
    err = err ? err : write_weight(e, &depth, &label, "weight.png");
    sst_map_f32_fini(&depth);
    sst_map_f32_fini(&label);
    return err;
}

/* The view around the ray, and below it a bar as long as the ray's share relative to the largest. */
static void draw_ray(struct sst_image *img, const struct sst_lightfield *lf, const struct sst_ray *ray, double largest)
{
    const int left = ray->view % lf->cols * CELL_WIDTH, top = ray->view / lf->cols * CELL_HEIGHT;
    const int bar = largest > 0 ? (int)(ray->share / largest * PATCH * MAGNIFY + 0.5) : 0;
    const int x0 = (int)floor(ray->x + 0.5) - PATCH / 2, y0 = (int)floor(ray->y + 0.5) - PATCH / 2;

    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < PATCH * MAGNIFY; y++) {
            const int sy = sst_clamp_int(y0 + y / MAGNIFY, 0, lf->height - 1);
            const uint8_t *row = sst_image_row(&lf->views[ray->view].image, c, sy);

            for (int x = 0; x < PATCH * MAGNIFY; x++)
                sst_image_row(img, c, top + y)[left + x] = row[sst_clamp_int(x0 + x / MAGNIFY, 0, lf->width - 1)];
        }
        for (int y = 0; y < BAR; y++)
            memset(sst_image_row(img, c, top + PATCH * MAGNIFY + y) + left, 255, (size_t)bar);
    }
}

static json_t *describe_ray(const struct sst_lightfield *lf, const struct sst_ray *ray)
{
    json_t *j =
        json_pack("{s:i, s:i, s:f, s:f, s:s, s:f, s:f, s:f, s:f, s:[f, f, f]}", "row", ray->view / lf->cols, "col",
                  ray->view % lf->cols, "x", ray->x, "y", ray->y, "label", sst_classes_name(&lf->classes, ray->label),
                  "aperture", ray->aperture, "weight_depth", ray->w_depth, "weight_label", ray->w_label, "share",
                  ray->share, "rgb", ray->colour[0], ray->colour[1], ray->colour[2]);

    json_object_set_new(j, "disparity_px", isnan(ray->disp_px) ? json_null() : json_real(ray->disp_px));
    return j;
}

static int write_rays(const struct explanation *e, int x, int y)
{
    const struct sst_lightfield *lf = &e->in->lf;
    struct sst_ray rays[SST_MAX_VIEWS];
    json_t *list = json_array();
    struct sst_image img = { 0 };
    char path[SST_PATH_MAX];
    double largest = 0;
    const int n = sst_render_rays(e->in->renderer, &e->args->cfg, x, y, rays);
    int err = sst_min_int(n, 0);

    json_object_set_new(e->root, "pixel", json_pack("[i, i]", x, y));
    json_object_set_new(e->root, "rays", list);
    err = err ? err : sst_image_init(&img, lf->cols * CELL_WIDTH - GAP, lf->rows * CELL_HEIGHT - GAP);
    for (int i = 0; i < n && !err; i++)
        largest = fmax(largest, rays[i].share);
    for (int i = 0; i < n && !err; i++) {
        draw_ray(&img, lf, &rays[i], largest);
        json_array_append_new(list, describe_ray(lf, &rays[i]));
    }
    err = err ? err : sst_path_join(path, e->dir, "rays.png");
    err = err ? err : sst_image_write_png(&img, path);
    sst_image_fini(&img);
    return err;
}

int cli_render_explain(const struct render_input *in, const struct render_args *a, const char *dir, int x, int y)
{
    struct explanation e = { .in = in, .args = a, .view = &in->lf.views[in->lf.ref_view] };
    const bool clear = a->cfg.method == SST_RENDER_CLEAR;
    struct sst_outdir out;
    int err = sst_outdir_open(&out, dir, a->force);

    if (err)
        return err;
    e.dir = out.temporary;
    e.root = json_pack("{s:o}", clear ? "cut_px" : "focus_px",
                       cli_real_json(!clear                    ? a->cfg.focus_px
                                     : isfinite(a->cfg.cut_px) ? a->cfg.cut_px
                                                               : NAN));
    sst_view_name(&in->lf, in->lf.ref_view, e.name);
    err = write_disparity(&e);
    if (!err && e.view->label.data)
        err = write_labels(&e, &e.view->label, "labels.png");
    err = err ? err : write_stored(&e, "labels_hcsm", true);
    err = err ? err : write_stored(&e, "confidence", false);
    err = err ? err : write_stored(&e, "entropy", false);
    if (!err && e.view->disp.data && !clear)
        err = write_weights(&e);
    err = err ? err : write_rays(&e, x, y);
    err = err ? err : cli_write_json(e.root, e.dir, "explain.json");
    json_decref(e.root);
    if (err == -ENOMEM)
        sst_log_error("no memory to explain the picture");
    return sst_outdir_end(&out, err);
}
