/* Noise, blur, JPEG and missing views. Each figure is one of the pictures themselves, not of a model of the scene, and
 * each threshold lies well beyond what undisturbed light fields have (docs/design/design.md, 5.9). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/process/notice.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/border.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/share.h"

struct job {
    const struct sst_lightfield *lf;
    struct sst_notice_view *view; /* [views] */
};

/* Of a view that is known to be of a JPEG; NAN: unknown */
static double file_quality(const struct sst_lightfield *lf, int view)
{
    return lf->files && lf->files->without_folder ? lf->files->view[view].quality : NAN;
}

static void measure(struct sst_notice_view *out, const struct sst_view *v, double quality)
{
    *out = (struct sst_notice_view){ .present = true,
                                     .noise = sst_image_noise(&v->image),
                                     .edge = sst_image_edge_px(&v->image, &v->valid),
                                     .quality = isnan(quality) ? sst_image_jpeg_quality(&v->image) : quality,
                                     .contrast = sst_image_contrast(&v->image) };
}

static int measure_view(void *arg, int view, int worker SST_UNUSED)
{
    const struct job *job = arg;
    const struct sst_view *v = &job->lf->views[view];

    if (v->present && v->image.plane[0])
        measure(&job->view[view], v, file_quality(job->lf, view));
    return 0;
}

void sst_notice_view(struct sst_notice_view *out, const struct sst_image *image, const struct sst_map_u8 *valid)
{
    measure(out, &(struct sst_view){ .image = *image, .valid = *valid }, NAN);
}

/* One of the figures of all views that are there; NAN: others. */
static void gather(double *out, const struct sst_notice_view *view, int views, size_t figure)
{
    for (int k = 0; k < views; k++)
        out[k] = view[k].present ? *(const double *)(const void *)((const char *)&view[k] + figure) : NAN;
}

/* The upper median of the known values; NAN: none. */
static double middle(const double *value, int views)
{
    double known[SST_MAX_VIEWS];
    int n = 0;

    for (int k = 0; k < views; k++) {
        if (!isnan(value[k]))
            known[n++] = value[k];
    }
    return n ? sst_stats_upper_median(known, n) : NAN;
}

static void find_soft(struct sst_notices *out, const double *edge, int views)
{
    for (int k = 0; k < views; k++) {
        double px;

        if (isnan(edge[k]) || !isgreater(edge[k], SST_NOTICE_SOFTER * out->edge_px))
            continue;
        px = sqrt(edge[k] * edge[k] - out->edge_px * out->edge_px);
        if (px < SST_NOTICE_SOFTER_PX)
            continue;
        out->soft_view[k] = true;
        out->soft++;
        if (px > out->soft_px) {
            out->soft_px = px;
            out->softest = k;
        }
    }
}

static void find_blank(struct sst_notices *out, const double *contrast, int views)
{
    const double usual = middle(contrast, views);

    for (int k = views - 1; k >= 0; k--) {
        if (isless(contrast[k], SST_NOTICE_BLANK * usual)) { /* never so for NAN */
            out->blank++;
            out->first_blank = k;
        }
    }
}

void sst_notice_jpeg_files(struct sst_notices *out, const double *quality, int views)
{
    int files = 0;

    for (int k = 0; k < views; k++)
        files += !isnan(quality[k]);
    if (!files)
        return;
    out->jpeg_views = files;
    out->jpeg_quality = NAN;
    for (int k = 0; k < views; k++)
        out->jpeg_quality = fmin(out->jpeg_quality, quality[k]);
}

void sst_notice_sum(struct sst_notices *out, const struct sst_notice_view *view, int rows, int cols)
{
    const int views = rows * cols;
    double v[SST_MAX_VIEWS], noise;

    *out = (struct sst_notices){ .edge_px = NAN, .jpeg_quality = NAN, .softest = -1, .first_blank = -1 };
    gather(v, view, views, offsetof(struct sst_notice_view, noise));
    noise = middle(v, views);
    out->noise_levels = isnan(noise) ? 0 : noise;
    gather(v, view, views, offsetof(struct sst_notice_view, edge));
    out->edge_px = middle(v, views);
    find_soft(out, v, views);
    gather(v, view, views, offsetof(struct sst_notice_view, quality));
    sst_notice_jpeg_files(out, v, views);
    gather(v, view, views, offsetof(struct sst_notice_view, contrast));
    find_blank(out, v, views);
    for (int k = 0; k < views; k++)
        out->missing += !view[k].present;
    sst_border_doubles("noise and blur of the pictures", (const double[]){ out->noise_levels, out->soft_px }, 2);
}

static void measured_values(void *arg, int view, struct sst_share_maps *out)
{
    const struct job *job = arg;

    if (job->lf->views[view].present)
        sst_share_add_values(out, &job->view[view], sizeof(job->view[view]));
}

int sst_notice_measure(struct sst_notices *out, const struct sst_lightfield *lf, struct sst_share *share, int threads)
{
    const int views = lf->rows * lf->cols, block = sst_share_block((size_t)lf->width * (size_t)lf->height);
    struct job job = { lf, calloc((size_t)views, sizeof(*job.view)) };
    int err =
        job.view ? sst_share_blocks(share, views, block, sst_thread_count(threads), measure_view, &job, measured_values)
                 : -ENOMEM;

    if (job.view)
        sst_notice_sum(out, job.view, lf->rows, lf->cols);
    if (!err) {
        out->missing = 0;
        for (int k = 0; k < views; k++)
            out->missing += !lf->views[k].present;
        out->blank = 0;
        out->skew_us = lf->skew_us;
    }
    free(job.view);
    return err;
}

bool sst_notice_skew(char text[320], double skew_us)
{
    if (isnan(skew_us) || skew_us < SST_NOTICE_SKEW_US)
        return false;
    snprintf(
        text, 320,
        "the views were exposed up to %.0f ms apart: what moves is matched at wrong depths, or not at all; trigger "
        "the cameras together, or check their wiring",
        skew_us / 1000);
    return true;
}

SST_PRINTF(3, 4) static void add(struct sst_notices *out, const char *what, const char *fmt, ...)
{
    va_list args;

    out->notice[out->count].what = what;
    va_start(args, fmt);
    vsnprintf(out->notice[out->count].text, sizeof(out->notice[0].text), fmt, args);
    va_end(args);
    out->count++;
}

void sst_notice_describe(struct sst_notices *out, int rows, int cols)
{
    const int views = rows * cols;
    char skew[320];

    out->count = 0;
    if (out->noise_levels >= SST_NOTICE_NOISE_LEVELS)
        add(out, "noise",
            "the pictures have noise of %.0f levels: expect less of the maps; expose longer, or lower the cameras' "
            "gain",
            out->noise_levels);
    if (isgreaterequal(out->edge_px, SST_NOTICE_EDGE_PX)) /* never so for NAN */
        add(out, "blur",
            "the pictures are blurred: their sharpest edges are %.2f px wide (sigma; sharp ones have 0.3); focus the "
            "lenses, or make the views smaller",
            out->edge_px);
    if (out->soft)
        add(out, "soft-views",
            "%d of %d views are less sharp than the others, that of row %d, column %d most (blurred by %.1f px); focus "
            "or clean the lens",
            out->soft, views - out->missing, out->softest / cols, out->softest % cols, out->soft_px);
    if (isless(out->jpeg_quality, SST_NOTICE_JPEG_QUALITY))
        add(out, "jpeg",
            "%d of %d views are or were JPEG, of quality %.0f at worst: fine structure is lost, and clear pictures "
            "lose "
            "several dB; record with quality 90 or more",
            out->jpeg_views, views - out->missing, out->jpeg_quality);
    if (out->missing >= SST_NOTICE_MISSING * views)
        add(out, "missing-views",
            "%d of %d views are missing: what is behind leaves is seen by fewer; look after their cameras, or record "
            "them again",
            out->missing, views);
    if (out->blank)
        add(out, "blank-views",
            "%d of %d views show next to nothing, the first is that of row %d, column %d: black, covered or "
            "over-exposed; "
            "uncover the lens, or set the exposure",
            out->blank, views - out->missing, out->first_blank / cols, out->first_blank % cols);
    if (sst_notice_skew(skew, out->skew_us))
        add(out, "time-offsets", "%s", skew);
}
