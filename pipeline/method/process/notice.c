/* Noise, blur, JPEG and missing views. Each figure is one of the pictures themselves, not of a model of the scene, and
 * each threshold lies well beyond what undisturbed light fields have (docs/design/design.md, 5.9). */
#include "pipeline/method/process/notice.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/border.h"
#include "base/stats.h"
#include "base/thread.h"

struct job {
    const struct sst_lightfield *lf;
    double *noise, *edge, *quality; /* [views]; NAN: absent or not measured */
};

static int measure_view(void *arg, int view, int worker SST_UNUSED)
{
    const struct job *job = arg;
    const struct sst_view *v = &job->lf->views[view];

    job->noise[view] = job->edge[view] = job->quality[view] = NAN;
    if (!v->present || !v->image.plane[0])
        return 0;
    job->noise[view] = sst_image_noise(&v->image);
    job->edge[view] = sst_image_edge_px(&v->image, &v->valid);
    job->quality[view] = sst_image_jpeg_quality(&v->image);
    return 0;
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

        if (isnan(edge[k]) || !(edge[k] > SST_NOTICE_SOFTER * out->edge_px))
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

int sst_notice_measure(struct sst_notices *out, const struct sst_lightfield *lf, int threads)
{
    const int views = lf->rows * lf->cols;
    double *v = malloc(3 * (size_t)views * sizeof(*v));
    struct job job = { lf, v, v + views, v + 2 * views };
    int err;

    *out = (struct sst_notices){ .edge_px = NAN, .jpeg_quality = NAN, .softest = -1 };
    if (!v)
        return -ENOMEM;
    err = sst_parallel_for(views, sst_thread_count(threads), measure_view, &job);
    if (!err) {
        const double noise = middle(job.noise, views);

        out->noise_levels = isnan(noise) ? 0 : noise;
        out->edge_px = middle(job.edge, views);
        find_soft(out, job.edge, views);
        sst_notice_jpeg_files(out, job.quality, views);
        sst_border_doubles("noise and blur of the pictures", (const double[]){ out->noise_levels, out->soft_px }, 2);
    }
    for (int k = 0; k < views; k++)
        out->missing += !lf->views[k].present;
    free(v);
    return err;
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

void sst_notice_describe(struct sst_notices *out, const struct sst_lightfield *lf)
{
    const int views = lf->rows * lf->cols;

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
            out->soft, views - out->missing, out->softest / lf->cols, out->softest % lf->cols, out->soft_px);
    if (isless(out->jpeg_quality, SST_NOTICE_JPEG_QUALITY))
        add(out, "jpeg",
            "%d of %d views are or were JPEG, of quality %.0f at worst: fine structure is lost, and clear pictures "
            "lose "
            "several dB; record with quality 90 or more",
            out->jpeg_views, views - out->missing, out->jpeg_quality);
    if (out->missing >= SST_NOTICE_MISSING * views)
        add(out, "missing-views",
            "%d of %d views are missing: what is behind leaves is seen by fewer; record them again", out->missing,
            views);
}
