/* Drawings of the report's page: maps, residual vectors, cut-outs of the worst pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calibration/report/report_internal.h"
#include "pipeline/image/codec.h"

#define VECTORS       300   /* of a camera, at most */
#define VECTORS_ALL   12000 /* of the page */
#define VECTORS_LEAST 20
#define MEAN_CORNERS  8    /* of a region with a drawn mean */
#define SHOWN_PX      1100 /* wider cut-outs are halved */
#define QUALITY       80

/* --- cameras ------------------------------------------------------------------------------------------------------ */

static json_t *sigma_map(const float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS])
{
    json_t *list = json_array();
    bool any = false;

    for (int i = 0; list && i < SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; i++) {
        const double v = (double)map[i / SST_UNCERTAINTY_COLS][i % SST_UNCERTAINTY_COLS];

        any = any || isfinite(v);
        json_array_append_new(list, report_json_number(v));
    }
    if (any)
        return list;
    json_decref(list);
    return json_null();
}

/* x, y, dx, dy of one corner; nothing where the residual is unknown. @return whether it is known */
static bool add_vector(json_t *list, const struct sst_corner *c, const double residual[2])
{
    if (!isfinite(residual[0]) || !isfinite(residual[1]))
        return false;
    if (list) {
        json_array_append_new(list, report_json_number(c->x));
        json_array_append_new(list, report_json_number(c->y));
        json_array_append_new(list, json_real(residual[0]));
        json_array_append_new(list, json_real(residual[1]));
    }
    return true;
}

static int vectors_of_camera(const struct report_figures *f)
{
    return sst_max_int(VECTORS_LEAST, sst_min_int(VECTORS, VECTORS_ALL / sst_max_int(f->known, 1)));
}

/* A subset of a camera's residuals, evenly over their number: used corners, or outliers. */
static json_t *vectors(const struct sst_calibration_report *report, const struct report_figures *f, int view,
                       bool outliers)
{
    const struct sst_detections *all = report->detections;
    const int64_t total = outliers ? f->camera[view].outliers : f->camera[view].used, most = vectors_of_camera(f);
    json_t *list = json_array();
    int64_t at = 0;

    for (int frame = 0; frame < all->frames; frame++) {
        const int i = f->detection[(size_t)frame * (size_t)f->views + (size_t)view];
        const struct sst_solve_view *v = i >= 0 ? &report->solution->view[i] : NULL;

        for (int j = 0; v && v->residual && j < all->detection[i].corners; j++) {
            const bool drawn = total <= most || (at + 1) * most / total > at * most / total;

            if ((v->outlier && v->outlier[j]) == outliers)
                at += add_vector(drawn ? list : NULL, &all->detection[i].corner[j], v->residual[j]);
        }
    }
    return list;
}

/* RMS of each region, and the means of regions with enough corners. */
static void regions(json_t *rms, json_t *mean, const struct report_camera *cam)
{
    for (int i = 0; i < REPORT_ROWS * REPORT_COLS; i++) {
        const struct report_region *r = &cam->region[i / REPORT_COLS][i % REPORT_COLS];

        json_array_append_new(rms, report_json_number(r->rms_px));
        for (int a = 0; a < 2; a++)
            json_array_append_new(mean, r->corners >= MEAN_CORNERS ? report_json_number(r->mean[a]) : json_null());
    }
}

/* RMS of the camera's picture in each frame. */
static json_t *frames_of_camera(const struct sst_calibration_report *report, const struct report_figures *f, int view)
{
    json_t *list = json_array();

    for (int frame = 0; frame < report->detections->frames; frame++) {
        const int i = f->detection[(size_t)frame * (size_t)f->views + (size_t)view];

        json_array_append_new(list, report_json_number(i >= 0 ? report->solution->view[i].rms_px : (double)NAN));
    }
    return list;
}

static json_t *camera(const struct sst_calibration_report *report, const struct report_figures *f, int view)
{
    const struct sst_solution *s = report->solution;
    json_t *seen = json_array(), *rms = json_array(), *mean = json_array();

    for (int i = 0; i < SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; i++)
        json_array_append_new(seen,
                              json_integer(f->camera[view].seen[i / SST_UNCERTAINTY_COLS][i % SST_UNCERTAINTY_COLS]));
    regions(rms, mean, &f->camera[view]);
    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "seen", seen, "rms", rms, "mean", mean, "lens",
                     s->lens_sigma ? sigma_map(s->lens_sigma[view]) : json_null(), "transfer",
                     s->transfer_sigma ? sigma_map(s->transfer_sigma[view][s->calib.range_mm > 0]) : json_null(),
                     "used", vectors(report, f, view, false), "outliers", vectors(report, f, view, true), "frames",
                     frames_of_camera(report, f, view));
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* The part of a picture around the board, px. */
struct cut {
    int x, y, width, height;
};

static struct cut cut_around(const struct sst_detections *all, const struct sst_detection *d)
{
    double lo[2] = { all->width, all->height }, hi[2] = { 0, 0 }, margin;
    const double size[2] = { all->width, all->height };
    int from[2], to[2];

    for (int i = 0; i < d->corners; i++) {
        const double at[2] = { d->corner[i].x, d->corner[i].y };

        for (int a = 0; a < 2; a++) {
            lo[a] = fmin(lo[a], at[a]);
            hi[a] = fmax(hi[a], at[a]);
        }
    }
    margin = 0.15 * fmax(hi[0] - lo[0], hi[1] - lo[1]) + 8;
    for (int a = 0; a < 2; a++) {
        from[a] = (int)sst_clamp_double(lo[a] - margin, 0, size[a] - 1);
        to[a] = (int)sst_clamp_double(hi[a] + margin + 1, from[a] + 1, size[a]);
    }
    return (struct cut){ from[0], from[1], to[0] - from[0], to[1] - from[1] };
}

/* Cut out, and halve until it is small enough to be shown. */
static int cut_out(struct sst_image *out, const struct sst_image *in, struct cut cut)
{
    int err = sst_image_init(out, cut.width, cut.height);

    for (int c = 0; c < 3 && !err; c++) {
        for (int y = 0; y < cut.height; y++)
            memcpy(sst_image_row(out, c, y), sst_image_row(in, c, cut.y + y) + cut.x, (size_t)cut.width);
    }
    return err ? err : sst_image_shrink(out, SHOWN_PX);
}

/* RFC 4648. @return to free, NULL: no memory */
static char *base64(const uint8_t *data, size_t size)
{
    static const char sign[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char *out = malloc((size + 2) / 3 * 4 + 1), *at = out;

    for (size_t i = 0; out && i < size; i += 3) {
        const size_t left = size - i;
        const uint32_t three =
            (uint32_t)data[i] << 16 | (left > 1 ? (uint32_t)data[i + 1] << 8 : 0) | (left > 2 ? data[i + 2] : 0u);

        *at++ = sign[three >> 18];
        *at++ = sign[three >> 12 & 63];
        *at++ = left > 1 ? sign[three >> 6 & 63] : '=';
        *at++ = left > 2 ? sign[three & 63] : '=';
    }
    if (out)
        *at = '\0';
    return out;
}

/* The cut-out as a JPEG in base64, null where the picture is not available. */
static json_t *jpeg_of(const struct sst_calibration_report *r, const struct report_figures *f,
                       const struct sst_detection *d, struct cut cut)
{
    struct sst_image whole = { 0 }, part = { 0 };
    uint8_t *jpeg = NULL;
    size_t size = 0;
    char *text = NULL;
    json_t *out;

    if (!r->picture || r->picture(r->arg, d->view, d->frame, &whole))
        return json_null();
    if (whole.width != r->detections->width || whole.height != r->detections->height)
        sst_log_warning("the picture of camera %s, frame %s, has %dx%d pixels, its corners are of %dx%d; the report "
                        "leaves it out",
                        f->camera[d->view].name, r->detections->frame_name[d->frame], whole.width, whole.height,
                        r->detections->width, r->detections->height);
    else if (cut_out(&part, &whole, cut) || sst_image_encode_jpeg(&part, QUALITY, &jpeg, &size) ||
             !(text = base64(jpeg, size)))
        sst_log_warning("no memory for a picture of the report; it is left out");
    out = text ? json_string(text) : json_null();
    free(text);
    free(jpeg);
    sst_image_fini(&part);
    sst_image_fini(&whole);
    return out;
}

static json_t *picture(const struct sst_calibration_report *report, const struct report_figures *f, int index)
{
    const struct sst_detection *d = &report->detections->detection[index];
    const struct sst_solve_view *v = &report->solution->view[index];
    const struct cut cut = cut_around(report->detections, d);
    json_t *used = json_array(), *outliers = json_array();

    for (int i = 0; i < d->corners; i++)
        add_vector(v->outlier && v->outlier[i] ? outliers : used, &d->corner[i], v->residual[i]);
    return json_pack("{s:i, s:i, s:i, s:i, s:o, s:o, s:o}", "x", cut.x, "y", cut.y, "width", cut.width, "height",
                     cut.height, "jpeg", jpeg_of(report, f, d, cut), "used", used, "outliers", outliers);
}

json_t *report_drawing_json(const struct sst_calibration_report *report, const struct report_figures *f)
{
    json_t *cameras = json_array(), *pictures = json_array();

    for (int k = 0; k < f->views; k++) {
        if (f->camera[k].expected)
            json_array_append_new(cameras, camera(report, f, k));
    }
    for (int i = 0; i < f->worst_count; i++)
        json_array_append_new(pictures, picture(report, f, f->worst[i].detection));
    return json_pack("{s:[i, i], s:[i, i], s:i, s:o, s:o}", "cells", SST_UNCERTAINTY_COLS, SST_UNCERTAINTY_ROWS,
                     "regions", REPORT_COLS, REPORT_ROWS, "vectors", vectors_of_camera(f), "cameras", cameras,
                     "pictures", pictures);
}
