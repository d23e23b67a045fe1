/* Figures beyond the solution's own numbers: sums over regions, worst pictures, histogram, directions. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/calibration/board/coverage.h"
#include "pipeline/calibration/report/report_internal.h"

#define REGIONS      (REPORT_ROWS * REPORT_COLS)
#define TEST_CORNERS 8    /* of a region with tested directions */
#define UNLIKELY     13.8 /* chi square of 2 degrees of freedom: probability 0.001 */

/* Sums over one region's used corners. */
struct sums {
    double sum[2], squares, direction[2];
};

static int cell_of(double at, int size, int cells)
{
    const double c = size > 0 ? (at + 0.5) / size * cells : 0;

    return c > 0 ? (int)fmin(c, cells - 1) : 0;
}

static bool usable(const struct sst_solve_view *v, int corner)
{
    return v->residual && isfinite(v->residual[corner][0]) && isfinite(v->residual[corner][1]);
}

static bool is_outlier(const struct sst_solve_view *v, int corner)
{
    return v->outlier && v->outlier[corner];
}

/* Keep the `most` largest, ties in the order of insertion. @return the new count */
static int keep_largest(struct report_outlier *list, int count, int most, struct report_outlier far)
{
    int at = count < most ? count : most;

    while (at > 0 && list[at - 1].px < far.px)
        at--;
    if (at == most)
        return count;
    if (count < most)
        count++;
    memmove(list + at + 1, list + at, (size_t)(count - 1 - at) * sizeof(*list));
    list[at] = far;
    return count;
}

static void count_axis(struct report_figures *f, double in_sigma)
{
    const double at = (in_sigma + 5) * REPORT_BINS / 10, size = fabs(in_sigma);

    f->samples++;
    for (int i = 0; i < 3; i++)
        f->within[i] += size <= i + 1;
    if (at < 0)
        f->below++;
    else if (at >= REPORT_BINS)
        f->above++;
    else
        f->bin[(int)at]++;
}

static void add_used(struct report_figures *f, const struct sst_calibration_report *report, const struct sst_corner *c,
                     const double e[2], struct sums *s)
{
    const double noise = report->solution->noise_px, length = hypot(e[0], e[1]);

    s->squares += e[0] * e[0] + e[1] * e[1];
    for (int i = 0; i < 2; i++) {
        s->sum[i] += e[i];
        if (length > 0)
            s->direction[i] += e[i] / length;
        if (noise > 0)
            count_axis(f, e[i] * c->weight / noise);
    }
}

/* Add one detection to its camera's figures and the lists of the worst. */
static void add_detection(struct report_figures *f, const struct sst_calibration_report *report, int index,
                          struct sums (*sums)[REGIONS])
{
    const struct sst_detections *all = report->detections;
    const struct sst_detection *d = &all->detection[index];
    const struct sst_solve_view *v = &report->solution->view[index];
    struct report_camera *cam = &f->camera[d->view];

    cam->frames++;
    for (int i = 0; i < d->corners; i++) {
        const struct sst_corner *c = &d->corner[i];
        const int row = cell_of(c->y, all->height, REPORT_ROWS), col = cell_of(c->x, all->width, REPORT_COLS);

        cam->seen[cell_of(c->y, all->height, SST_UNCERTAINTY_ROWS)][cell_of(c->x, all->width, SST_UNCERTAINTY_COLS)]++;
        cam->outliers += is_outlier(v, i);
        if (!usable(v, i))
            continue;
        if (!is_outlier(v, i)) {
            cam->used++;
            cam->region[row][col].corners++;
            add_used(f, report, c, v->residual[i], &sums[d->view][row * REPORT_COLS + col]);
            continue;
        }
        f->outliers++;
        f->listed = keep_largest(f->outlier, f->listed, REPORT_LISTED,
                                 (struct report_outlier){ index, i, hypot(v->residual[i][0], v->residual[i][1]) });
    }
}

/* Median distance of all corners, outliers included: a few do not count. @param length  scratch */
static double median_off(const struct sst_detection *d, const struct sst_solve_view *v, double *length)
{
    int n = 0;

    for (int i = 0; i < d->corners; i++) {
        if (usable(v, i))
            length[n++] = hypot(v->residual[i][0], v->residual[i][1]);
    }
    return n ? sst_stats_upper_median(length, n) : (double)NAN;
}

/* The worst picture of each frame, and of these the worst: a frame taken in motion is bad in all its pictures. */
static int rank_pictures(struct report_figures *f, const struct sst_calibration_report *report)
{
    const struct sst_detections *all = report->detections;
    struct report_outlier worst = { -1, -1, 0 };
    int most = 1;
    double *length;

    for (int i = 0; i < all->count; i++)
        most = sst_max_int(most, all->detection[i].corners);
    length = malloc((size_t)most * sizeof(*length));
    if (!length)
        return -ENOMEM;
    for (int i = 0; i < all->count; i++) {
        const double off = median_off(&all->detection[i], &report->solution->view[i], length);

        if (isfinite(off) && (worst.detection < 0 || off > worst.px))
            worst = (struct report_outlier){ i, -1, off };
        if (worst.detection < 0 || (i + 1 < all->count && all->detection[i + 1].frame == all->detection[i].frame))
            continue;
        f->worst_count = keep_largest(f->worst, f->worst_count, REPORT_WORST, worst);
        worst.detection = -1;
    }
    free(length);
    return 0;
}

/* Means of one camera's regions, less the share of random residuals, estimated from their spread. */
static void finish_camera(struct report_figures *f, int view, const struct sums *s, double total[3])
{
    struct report_camera *cam = &f->camera[view];
    double excess = 0, corners = 0, random = 0;

    for (int i = 0; i < REGIONS; i++) {
        struct report_region *r = &cam->region[i / REPORT_COLS][i % REPORT_COLS];
        const double n = r->corners;

        for (int a = 0; a < 2; a++)
            r->mean[a] = n > 0 ? s[i].sum[a] / n : (double)NAN;
        r->rms_px = n > 0 ? sqrt(s[i].squares / n) : (double)NAN;
        if (r->corners < TEST_CORNERS)
            continue;
        random = (s[i].squares - n * (r->mean[0] * r->mean[0] + r->mean[1] * r->mean[1])) / (n - 1) / n;
        excess += n * (r->mean[0] * r->mean[0] + r->mean[1] * r->mean[1] - random);
        corners += n;
        random = 2 * (s[i].direction[0] * s[i].direction[0] + s[i].direction[1] * s[i].direction[1]) / n;
        f->regions++;
        f->regions_off += random > UNLIKELY;
        total[2] += random;
    }
    cam->systematic_px = corners > 0 ? sqrt(fmax(excess, 0) / corners) : (double)NAN;
    total[0] += excess;
    total[1] += corners;
    if (corners > 0 && (f->systematic_camera < 0 || cam->systematic_px > f->camera[f->systematic_camera].systematic_px))
        f->systematic_camera = view;
}

/* Wilson and Hilferty 1931: the cube root of a chi square over its degrees of freedom is nearly normal. */
static double chi_square_z(double chi2, int freedom)
{
    const double v = 2.0 / (9.0 * freedom);

    return (cbrt(chi2 / freedom) - (1 - v)) / sqrt(v);
}

/* Names, maps and the worst of the cameras. */
static void describe_cameras(struct report_figures *f, const struct sst_calibration_report *report)
{
    const struct sst_solution *s = report->solution;
    const struct sst_detections *all = report->detections;

    for (int k = 0; k < f->views; k++) {
        struct report_camera *cam = &f->camera[k];
        const struct sst_calib_camera *c = &s->calib.camera[k];
        const char *name = c->name[0] ? c->name : all->camera_name ? all->camera_name[k] : "";
        char place[24];

        snprintf(place, sizeof(place), "%02d_%02d", k / all->cols, k % all->cols);
        if (name[0])
            snprintf(cam->name, sizeof(cam->name), "%s", name);
        else
            snprintf(cam->name, sizeof(cam->name), "%s", place);
        if (strcmp(cam->name, place) != 0)
            snprintf(cam->title, sizeof(cam->title), "%d,%d (%s)", k / all->cols, k % all->cols, cam->name);
        else
            snprintf(cam->title, sizeof(cam->title), "%s", place);
        cam->expected = c->known || name[0] || cam->frames;
        f->known += c->known;
        f->missing += cam->expected && !c->known;
        cam->lens_px = sst_uncertainty_rms(s->lens_sigma ? s->lens_sigma[k] : NULL);
        for (int i = 0; i < 2; i++)
            cam->transfer_px[i] = sst_uncertainty_rms(s->transfer_sigma ? s->transfer_sigma[k][i] : NULL);
        if (!c->known)
            continue;
        if (c->rms_px > 0 && (f->worst_camera < 0 || c->rms_px > s->calib.camera[f->worst_camera].rms_px))
            f->worst_camera = k;
        if (c->sigma_px > 0 && (f->worst_transfer < 0 || c->sigma_px > s->calib.camera[f->worst_transfer].sigma_px))
            f->worst_transfer = k;
    }
}

static int describe_coverage(struct report_figures *f, const struct sst_detections *all)
{
    struct sst_coverage *coverage = calloc((size_t)f->views, sizeof(*coverage));

    if (!coverage)
        return -ENOMEM;
    sst_coverage_count(coverage, all);
    for (int k = 0; k < f->views; k++) {
        if (f->camera[k].expected)
            sst_coverage_missing(&coverage[k], f->camera[k].lacking);
    }
    free(coverage);
    return 0;
}

static void describe_frames(struct report_figures *f, const struct sst_calibration_report *report)
{
    const struct sst_solution *s = report->solution;

    for (int i = 0; s->frame && i < report->detections->frames; i++) {
        if (!s->frame[i].known)
            continue;
        f->used_frames++;
        if (isfinite(s->frame[i].rms_px) &&
            (f->worst_frame < 0 || s->frame[i].rms_px > s->frame[f->worst_frame].rms_px))
            f->worst_frame = i;
    }
}

static void add_all(struct report_figures *f, const struct sst_calibration_report *report, struct sums (*sums)[REGIONS])
{
    const struct sst_detections *all = report->detections;
    double total[3] = { 0 }; /* excess of means, corners, chi square of the directions */

    for (int i = 0; i < all->count; i++) {
        f->detection[(size_t)all->detection[i].frame * (size_t)f->views + (size_t)all->detection[i].view] = i;
        add_detection(f, report, i, sums);
    }
    for (int k = 0; k < f->views; k++)
        finish_camera(f, k, sums[k], total);
    f->systematic_px = total[1] > 0 ? sqrt(fmax(total[0], 0) / total[1]) : (double)NAN;
    f->direction_z = f->regions ? chi_square_z(total[2], 2 * f->regions) : (double)NAN;
}

int report_figures_init(struct report_figures *out, const struct sst_calibration_report *report)
{
    const struct sst_detections *all = report->detections;
    const size_t views = (size_t)all->rows * (size_t)all->cols, slots = views * (size_t)all->frames;
    struct report_figures f = { .views = (int)views,
                                .worst_camera = -1,
                                .worst_frame = -1,
                                .worst_transfer = -1,
                                .systematic_camera = -1,
                                .pair_worst = { -1, -1 } };
    struct sums(*sums)[REGIONS] = calloc(views, sizeof(*sums));
    int err = -ENOMEM;

    f.camera = calloc(views, sizeof(*f.camera));
    f.detection = malloc((slots ? slots : 1) * sizeof(*f.detection));
    if (!sums || !f.camera || !f.detection)
        goto out;
    for (size_t i = 0; i < slots; i++)
        f.detection[i] = -1;
    add_all(&f, report, sums);
    describe_cameras(&f, report);
    describe_frames(&f, report);
    report_figures_centres(&f, report);
    err = describe_coverage(&f, report->detections);
    err = err ? err : rank_pictures(&f, report);
    err = err ? err : report_figures_pairs(&f, report);
    if (err)
        goto out;
    report_figures_judge(&f, report);
    *out = f;
    f = (struct report_figures){ 0 };

out:
    if (err == -ENOMEM)
        sst_log_error("no memory for the report of %d pictures; close other programs", all->count);
    free(sums);
    report_figures_fini(&f);
    return err;
}

void report_figures_fini(struct report_figures *figures)
{
    free(figures->camera);
    free(figures->detection);
    figures->camera = NULL;
    figures->detection = NULL;
}
