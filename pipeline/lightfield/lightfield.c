/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/lightfield.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/camera/calib.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield_internal.h"

int sst_lightfield_init(struct sst_lightfield *lf, int rows, int cols)
{
    struct sst_lightfield made = { .rows = rows, .cols = cols, .classes = sst_classes_default };
    const int ref_row = (rows - 1) / 2, ref_col = (cols - 1) / 2;

    if (rows < 1 || cols < 1 || rows > SST_MAX_VIEWS || cols > SST_MAX_VIEWS || rows * cols > SST_MAX_VIEWS)
        return -EINVAL;
    made.views = calloc((size_t)(rows * cols), sizeof(*made.views));
    if (!made.views)
        return -ENOMEM;
    made.ref_view = ref_row * cols + ref_col;
    for (int row = 0; row < rows; row++) {
        for (int col = 0; col < cols; col++) {
            made.views[row * cols + col].bx = col - ref_col;
            made.views[row * cols + col].by = row - ref_row;
        }
    }
    *lf = made;
    return 0;
}

int sst_lightfield_init_files(struct sst_lightfield *lf, int rows, int cols)
{
    struct sst_lightfield made;
    int err = sst_lightfield_init(&made, rows, cols);

    if (err)
        return err;
    made.files = calloc(1, sizeof(*made.files) + (size_t)(rows * cols) * sizeof(made.files->view[0]));
    if (!made.files) {
        sst_lightfield_fini(&made);
        return -ENOMEM;
    }
    *lf = made;
    return 0;
}

void sst_view_empty(struct sst_view *view)
{
    sst_image_fini(&view->image);
    sst_image_fini(&view->original);
    free(view->encoded);
    view->encoded = NULL;
    sst_map_u8_fini(&view->valid);
    sst_map_u16_fini(&view->disp);
    sst_map_u8_fini(&view->label);
    sst_map_u8_fini(&view->confidence);
}

void sst_lightfield_fini(struct sst_lightfield *lf)
{
    for (int k = 0; lf->views && k < lf->rows * lf->cols; k++)
        sst_view_empty(&lf->views[k]);
    free(lf->views);
    if (lf->calibration)
        sst_calib_fini(lf->calibration);
    free(lf->calibration);
    free(lf->rectified);
    free(lf->correction);
    free(lf->files);
    *lf = (struct sst_lightfield){ 0 };
}

int sst_lightfield_choose_ref(struct sst_lightfield *lf)
{
    const int ref_row = (lf->rows - 1) / 2, ref_col = (lf->cols - 1) / 2;
    int best = -1, best_dist2 = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const int dr = k / lf->cols - ref_row, dc = k % lf->cols - ref_col, dist2 = dr * dr + dc * dc;

        if (lf->views[k].present && (best < 0 || dist2 < best_dist2)) {
            best = k;
            best_dist2 = dist2;
        }
    }
    if (best < 0)
        return -EBADMSG;
    lf->ref_view = best;
    return 0;
}

void sst_view_name(const struct sst_lightfield *lf, int view, char out[16])
{
    /* Both are below SST_MAX_VIEWS; the remainder proves it to the compiler. */
    snprintf(out, 16, "%02u_%02u", (unsigned)(view / lf->cols) % 1000u, (unsigned)(view % lf->cols) % 1000u);
}

bool sst_view_has(const struct sst_view *v, enum sst_lightfield_load kind)
{
    return kind == SST_LOAD_DISPARITY ? v->disp.data != NULL
           : kind == SST_LOAD_LABELS  ? v->label.data != NULL
                                      : v->confidence.data != NULL;
}

bool sst_lightfield_has(const struct sst_lightfield *lf, enum sst_lightfield_load kind)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (sst_view_has(&lf->views[k], kind))
            return true;
    }
    return false;
}

int sst_view_copy(struct sst_view *to, const struct sst_view *from)
{
    const struct sst_image *img = &from->image;
    const size_t bytes = img->stride * (size_t)img->height;
    int err = 0;

    to->present = from->present;
    to->bx = from->bx;
    to->by = from->by;
    if (!to->present)
        return 0;
    if (!to->image.plane[0])
        err = sst_image_init(&to->image, img->width, img->height);
    for (int c = 0; !err && c < 3; c++)
        memcpy(to->image.plane[c], img->plane[c], bytes);
    if (!err && from->valid.data && !to->valid.data)
        err = sst_map_u8_init(&to->valid, from->valid.width, from->valid.height);
    if (!err && from->valid.data)
        memcpy(to->valid.data, from->valid.data, from->valid.stride * (size_t)from->valid.height);
    return err;
}

/* --- raw frames, some of them files that are decoded when they are needed ----------------------------------------- */

bool sst_view_has_frame(const struct sst_view *v)
{
    return v->image.plane[0] || v->encoded;
}

/* Name of a view in messages. */
static const char *name_of(const struct sst_lightfield *lf, int view)
{
    return lf->files ? lf->files->view[view].name : "frame";
}

int sst_lightfield_decode_frame(struct sst_image *out, const struct sst_lightfield *lf, int view)
{
    const struct sst_view *v = &lf->views[view];

    return sst_image_decode(out, v->encoded, v->encoded_bytes, name_of(lf, view));
}

int sst_lightfield_put_frame(uint8_t *rgbx, size_t stride, const struct sst_lightfield *lf, int view)
{
    const struct sst_view *v = &lf->views[view];
    const struct sst_calib *calib = lf->calibration;
    struct sst_image decoded = { 0 };
    int err = v->encoded ? sst_lightfield_decode_frame(&decoded, lf, view) : 0;

    if (!err && v->encoded && (decoded.width != calib->width || decoded.height != calib->height)) {
        sst_log_error("%s has %dx%d pixels instead of %dx%d; write it again", name_of(lf, view), decoded.width,
                      decoded.height, calib->width, calib->height);
        err = -EBADMSG;
    }
    if (!err)
        sst_image_put_rgbx(rgbx, stride, v->encoded ? &decoded : v->original.plane[0] ? &v->original : &v->image);
    sst_image_fini(&decoded);
    return err;
}

/* --- confirmed disparities ---------------------------------------------------------------------------------------- */

struct job {
    const struct sst_lightfield *lf;
    struct sst_confirmed count[SST_MAX_VIEWS];
};

struct sst_confirmed sst_view_confirmed(const struct sst_view *v)
{
    struct sst_confirmed n = { 0, 0 };

    for (int y = 0; y < v->confidence.height; y++) {
        const uint8_t *confidence = sst_map_u8_row(&v->confidence, y);
        const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;

        for (int x = 0; x < v->confidence.width; x++) {
            const int seen = !valid || valid[x];

            n.pixels += seen;
            n.confirmed += seen && confidence[x];
        }
    }
    return n;
}

static int count_view(void *arg, int view, int worker SST_UNUSED)
{
    struct job *job = arg;

    job->count[view] = sst_view_confirmed(&job->lf->views[view]);
    return 0;
}

double sst_lightfield_confirmed(const struct sst_lightfield *lf, int threads)
{
    const int views = lf->rows * lf->cols;
    struct job job = { .lf = lf };
    struct sst_confirmed all = { 0, 0 };

    if (sst_parallel_for(views, sst_thread_count(threads), count_view, &job))
        return NAN;
    for (int k = 0; k < views; k++) {
        all.pixels += job.count[k].pixels;
        all.confirmed += job.count[k].confirmed;
    }
    return all.pixels ? (double)all.confirmed / (double)all.pixels : NAN;
}
