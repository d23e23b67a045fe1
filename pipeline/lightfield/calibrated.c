/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/calibrated.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define MAX_NAMED   4    /* views named in one message */
#define OFFSET_SLIP 1e-9 /* spacings: stored offsets agree with the calibration */

void sst_use_calibration_defaults(struct sst_use_calibration *use)
{
    *use = (struct sst_use_calibration){ .plan = { .plane_mm = -1 }, .filter = SST_FILTER_BICUBIC };
}

int sst_use_calibration_read(struct sst_use_calibration *use, const char *path)
{
    const size_t n = strlen(path);

    if (n >= sizeof(use->path)) {
        sst_log_error("the path of the calibration is longer than %zu bytes; use a shorter one", sizeof(use->path) - 1);
        return -ENAMETOOLONG;
    }
    memcpy(use->path, path, n + 1);
    return sst_calib_read(&use->calib, path);
}

void sst_use_calibration_fini(struct sst_use_calibration *use)
{
    sst_calib_fini(&use->calib);
}

/* --- attaching a calibration --------------------------------------------------------------------------- */

int sst_lightfield_fit_calibration(struct sst_lightfield *lf, const struct sst_use_calibration *use)
{
    const struct sst_calib *c = &use->calib;
    char named[MAX_NAMED * 18 + 8] = "";
    int unknown = 0;

    if (c->rows != lf->rows || c->cols != lf->cols) {
        sst_log_error("%s is for a grid of %dx%d cameras, the views form one of %dx%d; calibrate this array", use->path,
                      c->rows, c->cols, lf->rows, lf->cols);
        return -EBADMSG;
    }
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        char rr_cc[16];

        if (!lf->views[k].present || c->camera[k].known)
            continue;
        lf->views[k].present = false;
        if (unknown++ >= MAX_NAMED)
            continue;
        sst_view_name(lf, k, rr_cc);
        strcat(strcat(named, named[0] ? ", " : ""), rr_cc);
    }
    if (unknown > MAX_NAMED)
        strcat(named, " ...");
    if (sst_lightfield_choose_ref(lf)) {
        sst_log_error("%s has none of the cameras that have views; calibrate them", use->path);
        return -EBADMSG;
    }
    if (unknown)
        sst_log_warning("views left out because %s does not have their cameras: %s (%d)", use->path, named, unknown);
    return 0;
}

/* Offsets from the light field's own reference, which may not be the calibration's where views are missing. */
static void set_offsets(struct sst_lightfield *lf, const struct sst_rectified *to)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        lf->views[k].bx = to->view[k].known ? to->view[k].bx - to->view[lf->ref_view].bx : 0;
        lf->views[k].by = to->view[k].known ? to->view[k].by - to->view[lf->ref_view].by : 0;
    }
}

/* True if any pixel of the view comes from its raw frame; tests one in 256. */
static bool sees(const struct sst_rectified *to, const struct sst_calib *calib, int view)
{
    for (int y = 0; y < to->height; y += 16) {
        for (int x = 0; x < to->width; x += 16) {
            double at[2];

            if (sst_rectify_point(to, calib, view, (const double[2]){ x, y }, at))
                return true;
        }
    }
    return false;
}

/* Rejects well-formed but absurd calibrations, which leave nothing of a camera's picture. */
static int check_views(const struct sst_rectified *to, const struct sst_calib *calib, const char *path)
{
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (!calib->camera[k].known || sees(to, calib, k))
            continue;
        sst_log_error("%s: nothing of the frames of camera %s%s(row %d, column %d) is in the common view; correct its "
                      "lens and rotation, or choose a smaller focal length",
                      path, calib->camera[k].name, calib->camera[k].name[0] ? " " : "", k / calib->cols,
                      k % calib->cols);
        return -EBADMSG;
    }
    return 0;
}

void rectified_geometry(struct sst_lightfield *lf)
{
    lf->infinity_known = true;
    lf->infinity_px = 0;
    lf->off_centre_px[0] = lf->rectified->cx - (lf->width - 1) / 2.0;
    lf->off_centre_px[1] = lf->rectified->cy - (lf->height - 1) / 2.0;
}

int sst_lightfield_calibrate(struct sst_lightfield *lf, const struct sst_use_calibration *use)
{
    struct sst_calib *calib = calloc(1, sizeof(*calib));
    struct sst_rectified *to = calloc(1, sizeof(*to));
    int err = calib && to ? sst_calib_copy(calib, &use->calib) : -ENOMEM;

    if (err) {
        sst_log_error("no memory for the calibration %s", use->path);
    } else if (calib->width != lf->width || calib->height != lf->height) {
        sst_log_error(
            "%s is for frames of %dx%d pixels, the views have %dx%d; calibrate with the size that is captured",
            use->path, calib->width, calib->height, lf->width, lf->height);
        err = -EBADMSG;
    } else {
        err = sst_rectify_plan(to, calib, &use->plan);
        err = err ? err : check_views(to, calib, use->path);
    }
    if (err) {
        if (calib)
            sst_calib_fini(calib);
        free(calib);
        free(to);
        return err;
    }
    lf->calibration = calib;
    lf->rectified = to;
    lf->filter = (int)use->filter;
    lf->width = to->width;
    lf->height = to->height;
    lf->focal_px = to->focal_px;
    lf->spacing_mm = to->spacing_mm;
    rectified_geometry(lf);
    set_offsets(lf, to);
    return 0;
}

void calibration_drop(struct sst_lightfield *lf)
{
    if (!lf->calibration)
        return;
    lf->width = lf->calibration->width;
    lf->height = lf->calibration->height;
    lf->files->calibration_sha256[0] = '\0';
    sst_calib_fini(lf->calibration);
    free(lf->calibration);
    free(lf->rectified);
    lf->calibration = NULL;
    lf->rectified = NULL;
}

/* --- loading ------------------------------------------------------------------------------------------------------ */

/* Verify that the offsets in lightfield.json follow from the calibration beside it. */
static int check_offsets(const struct sst_lightfield *lf, const char *path)
{
    const struct sst_rectified *to = lf->rectified;
    const int ref = lf->ref_view;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];

        if (!v->present)
            continue;
        if (to->view[k].known && fabs(to->view[k].bx - to->view[ref].bx - v->bx) <= OFFSET_SLIP &&
            fabs(to->view[k].by - to->view[ref].by - v->by) <= OFFSET_SLIP)
            continue;
        sst_log_error("%s does not match its light field: the view of row %d, column %d has another position; run `sst "
                      "rectify` again",
                      path, k / lf->cols, k % lf->cols);
        return -EBADMSG;
    }
    return 0;
}

int calibration_load(struct sst_lightfield *lf, const char *dir)
{
    char path[SST_PATH_MAX], hash[65];
    struct sst_calib *calib;
    int err = sst_path_join(path, dir, SST_CALIBRATION_FILE);

    err = err ? err : file_sha256(hash, path);
    if (err)
        return err;
    if (strcmp(hash, lf->files->calibration_sha256)) {
        sst_log_error(
            "%s has changed since the light field was made (its SHA-256 differs); to use it, run `sst rectify "
            "%s --calib %s -o NEW`",
            path, dir, path);
        return -EBADMSG;
    }
    calib = calloc(1, sizeof(*calib));
    if (!calib)
        return -ENOMEM;
    err = sst_calib_read(calib, path);
    if (err) {
        free(calib);
        return err;
    }
    lf->calibration = calib;
    if (calib->rows != lf->rows || calib->cols != lf->cols || !calib->camera[lf->rectified->reference].known) {
        sst_log_error("%s is not for the light field's grid of %dx%d; run `sst rectify` again", path, lf->rows,
                      lf->cols);
        return -EBADMSG;
    }
    err = sst_rectified_place(lf->rectified, calib);
    return err ? err : check_offsets(lf, path);
}

int sst_lightfield_rectify_view(struct sst_lightfield *lf, int view)
{
    struct remade made = { .what = "rectify", .keep = lf->keeps_sources };
    struct sst_rectify_map *map = NULL;
    int err = sst_rectify_map_create(&map, lf->rectified, lf->calibration, view);

    err = err ? err : remade_init(&made, lf);
    if (!err)
        err = sst_rectify_view(&(struct sst_rectified_view){ &made.image, &made.valid }, map,
                               (enum sst_filter)lf->filter, &lf->views[view].image);
    sst_rectify_map_destroy(map);
    return remade_take(lf, view, &made, err);
}

/* --- coverage --------------------------------------------------------------------------------------------- */

#define KEPT_STEP 16

static void view_coverage(const struct sst_lightfield *lf, int view, struct sst_rectified_coverage *out)
{
    const struct sst_calib *c = lf->calibration;
    const int cols = (lf->width + KEPT_STEP - 1) / KEPT_STEP, rows = (lf->height + KEPT_STEP - 1) / KEPT_STEP;
    const double middle_x = (lf->width - 1) / 2.0, middle_y = (lf->height - 1) / 2.0;
    double seen = 0, area = 0;

    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < cols; i++) {
            /* Samples squares of pixels, spread evenly up to the borders, and sums the areas they cover in the raw
             * frame. */
            const double x = (i + 0.5) * lf->width / cols - 0.5, y = (j + 0.5) * lf->height / rows - 0.5;
            const double dx = x < middle_x ? 1 : -1, dy = y < middle_y ? 1 : -1;
            double at[2], right[2], below[2];

            if (!sst_rectify_point(lf->rectified, c, view, (const double[2]){ x, y }, at))
                continue;
            seen++;
            if (sst_rectify_point(lf->rectified, c, view, (const double[2]){ x + dx, y }, right) &&
                sst_rectify_point(lf->rectified, c, view, (const double[2]){ x, y + dy }, below))
                area += fabs((right[0] - at[0]) * (below[1] - at[1]) - (right[1] - at[1]) * (below[0] - at[0]));
        }
    }
    out->filled = seen / ((double)cols * rows);
    out->kept =
        fmin(1, area * ((double)lf->width / cols) * ((double)lf->height / rows) / ((double)c->width * c->height));
}

struct kept_job {
    const struct sst_lightfield *lf;
    struct sst_rectified_coverage view[SST_MAX_VIEWS];
};

static int kept_work(void *arg, int view, int worker SST_UNUSED)
{
    struct kept_job *job = arg;

    if (job->lf->views[view].present)
        view_coverage(job->lf, view, &job->view[view]);
    return 0;
}

int sst_lightfield_coverage(const struct sst_lightfield *lf, int threads, struct sst_rectified_coverage *worst,
                            struct sst_rectified_coverage *mean)
{
    struct kept_job *job = calloc(1, sizeof(*job));
    int n = 0, err;

    if (!job) {
        sst_log_error("not enough memory to measure the coverage of rectification");
        return -ENOMEM;
    }
    job->lf = lf;
    err = sst_parallel_for(lf->rows * lf->cols, sst_thread_count(threads), kept_work, job);
    *worst = (struct sst_rectified_coverage){ 1, 1 };
    *mean = (struct sst_rectified_coverage){ 0, 0 };
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (!lf->views[k].present)
            continue;
        worst->filled = fmin(worst->filled, job->view[k].filled);
        worst->kept = fmin(worst->kept, job->view[k].kept);
        mean->filled += job->view[k].filled;
        mean->kept += job->view[k].kept;
        n++;
    }
    mean->filled /= n; /* a light field has at least one view */
    mean->kept /= n;
    free(job);
    return err;
}

/* From x_k = x - b_k (f B / Z + infinity). */
bool sst_lightfield_camera(struct sst_calib_camera *out, const struct sst_lightfield *lf, int view)
{
    const struct sst_view *v = &lf->views[view];

    *out = (struct sst_calib_camera){ .known = v->present && lf->focal_px > 0 && lf->spacing_mm > 0 };
    out->fx = out->fy = lf->focal_px;
    out->cx = (lf->width - 1) / 2.0 + lf->off_centre_px[0] - v->bx * lf->infinity_px;
    out->cy = (lf->height - 1) / 2.0 + lf->off_centre_px[1] - v->by * lf->infinity_px;
    out->position_mm[0] = v->bx * lf->spacing_mm;
    out->position_mm[1] = v->by * lf->spacing_mm;
    for (int i = 0; i < 3; i++)
        out->rotation[4 * i] = out->gain[i] = 1;
    return out->known;
}
