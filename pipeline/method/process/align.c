/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/process/align.h"

#include <math.h>

#include "base/border.h"
#include "base/stats.h"

#define OFF_PX     0.3  /* a view beyond this and OFF_SIGMAS is off */
#define OFF_SIGMAS 6    /* of some 250 tests, with tails that foliage makes heavy: 4 call undisturbed views off */
#define MANY       0.25 /* of the views: the array is off, not some of its views */
#define MOST_PX    8.0  /* views farther off stay as they are */
#define OFF_GAIN   0.12 /* like OFF_PX, of logs: 5 % of the grey levels; hard scenes reach 0.1 */
#define TILTED     0.5  /* of the variance: deviations that grow with the offsets are no jitter */
/* Sigma of a slope that a scene feigns, px per spacing: of the median sigma, and at least. Bush, humvee, cell, cat. */
#define FEIGNED      0.7
#define FEIGNED_PX   0.005
#define MOST_GAIN    1.4  /* like MOST_PX: a factor of 4 */
#define MOST_FALL    2.0  /* SST_CORRECTION_FALLOFF_MAX */
#define FALL_APART   0.1  /* RMS of undisturbed scenes' fall-offs about what they share: up to 0.08 */
#define FALL_SIGMA   2    /* ... of which sigma explains half */
#define APART_PX     0.15 /* RMS of displacements of a kind: the array is off; undisturbed scenes have up to 0.1 */
#define APART_SIGMA  3
#define BENT_APART   0.04 /* RMS of undisturbed scenes' exponents: up to 0.033, foliage 0.05 with a sigma of 0.023 */
#define BENT_SIGMA   3
#define BENT_MOST    0.5 /* from 1; beyond, pictures are too dark or bright to be bent back */
#define AGREE        3   /* robust sigmas from the median: these make the mean that stays */
#define ROUNDS       10
#define STAY_SPREADS 2 /* RMS of all views */
#define WHOLE_SIGMA  0.5 /* sigma of a whole check over the sigma of a quarter of the matches */

/* One kind of deviation of all views. */
struct kind {
    double value[SST_MAX_VIEWS], sigma[SST_MAX_VIEWS]; /* px or logs; NAN: not measured */
};

/* Mean of the values that agree: jitter of all views leaves their mean, a few views that are off change nothing. */
static double common_value(const struct kind *kind, int views)
{
    double v[SST_MAX_VIEWS], middle = 0, spread;
    int n = 0;

    for (int k = 0; k < views; k++) {
        if (!isnan(kind->value[k]))
            v[n++] = kind->value[k];
    }
    if (!n)
        return 0;
    middle = sst_stats_median(v, n);
    for (int round = 0; round < ROUNDS; round++) {
        double sum = 0;
        int near = 0;

        for (int i = 0, k = 0; k < views; k++) {
            if (!isnan(kind->value[k]))
                v[i++] = fabs(kind->value[k] - middle);
        }
        spread = 1.4826 * sst_stats_median(v, n);
        for (int k = 0; k < views; k++) {
            if (isnan(kind->value[k]) || fabs(kind->value[k] - middle) > AGREE * spread)
                continue;
            sum += kind->value[k];
            near++;
        }
        if (!near)
            break;
        middle = sum / near;
    }
    return middle;
}

/* RMS of the known values about `middle`. */
static double rms_about(const struct kind *kind, int views, double middle)
{
    double sum = 0;
    int n = 0;

    for (int k = 0; k < views; k++) {
        if (!isnan(kind->value[k])) {
            sum += (kind->value[k] - middle) * (kind->value[k] - middle);
            n++;
        }
    }
    return n ? sqrt(sum / n) : 0;
}

static double median_of(const double *value, int views)
{
    double v[SST_MAX_VIEWS];
    int n = 0;

    for (int k = 0; k < views; k++) {
        if (!isnan(value[k]))
            v[n++] = value[k];
    }
    return n ? sst_stats_median(v, n) : NAN;
}

/* Least squares plane over the views' offsets. */
struct plane {
    double mean[2], spread[2]; /* of the offsets; sum of squares about it */
    double slope[2];
    double all, left; /* sums of squares about the values' mean, about the plane */
    int n;            /* values */
};

static struct plane fit_plane(const struct kind *kind, const struct sst_lightfield *lf)
{
    double a[3][3] = { { 1e-9, 0, 0 }, { 0, 1e-9, 0 }, { 0, 0, 1e-9 } }, v[3] = { 0 }, mean;
    struct plane p = { 0 };

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const double row[3] = { 1, lf->views[k].bx, lf->views[k].by };

        if (isnan(kind->value[k]))
            continue;
        p.n++;
        for (int i = 0; i < 3; i++) {
            v[i] += row[i] * kind->value[k];
            for (int j = 0; j < 3; j++)
                a[i][j] += row[i] * row[j];
        }
    }
    if (!p.n)
        return p;
    mean = v[0] / p.n;
    for (int i = 0; i < 2; i++) {
        p.mean[i] = a[0][i + 1] / p.n;
        p.spread[i] = fmax(a[i + 1][i + 1] - p.n * p.mean[i] * p.mean[i], 0);
    }
    sst_stats_solve3(a, v);
    p.slope[0] = v[1];
    p.slope[1] = v[2];
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const double plane = v[0] + v[1] * lf->views[k].bx + v[2] * lf->views[k].by;

        if (isnan(kind->value[k]))
            continue;
        p.all += (kind->value[k] - mean) * (kind->value[k] - mean);
        p.left += (kind->value[k] - plane) * (kind->value[k] - plane);
    }
    return p;
}

/* Subtract what of the plane over the views' offsets the scene feigns. Where a slanted edge of something
 * near crosses others behind it, the crossings wander along the edge, by the same amount from every view to the next:
 * matches of meshes show a picture that moves down from column to column. Cameras that were knocked or sagged do not:
 * a plane that explains most of the deviations goes. Else the slope is estimated from its two sources: jitter of n
 * views has a slope of variance (jitter's variance) / (sum of the squares of the offsets), scenes feign one in
 * proportion to the sigma; the first one's expected share stays. */
static void remove_tilt(struct kind *kind, const struct sst_lightfield *lf)
{
    const int views = lf->rows * lf->cols;
    const struct plane p = fit_plane(kind, lf);
    const double sigma = median_of(kind->sigma, views), feigned = hypot(FEIGNED * sigma, FEIGNED_PX);
    double jitter, goes[2];

    if (p.n <= 3)
        return;
    jitter = fmax(p.left / (p.n - 3) - sigma * sigma, 0);
    for (int i = 0; i < 2; i++)
        goes[i] = p.left < (1 - TILTED) * p.all ? 1 : 1 - jitter / (jitter + feigned * feigned * p.spread[i] + 1e-12);
    for (int k = 0; k < views; k++) /* NAN stays */
        kind->value[k] -=
            goes[0] * p.slope[0] * (lf->views[k].bx - p.mean[0]) + goes[1] * p.slope[1] * (lf->views[k].by - p.mean[1]);
}

/* Whether the views scatter about what they share by more than measuring them does. */
static bool is_apart(const struct kind *kind, int views, double least, double sigmas)
{
    return rms_about(kind, views, common_value(kind, views)) > fmax(least, sigmas * median_of(kind->sigma, views));
}

/* Mark the views that are off. @return how many */
static int mark_off(bool *off, const struct kind *kind, int views, double least, double most)
{
    int n = 0;

    for (int k = 0; k < views; k++) {
        const double value = isnan(kind->value[k]) ? 0 : fabs(kind->value[k]);

        off[k] = value > least && value > OFF_SIGMAS * kind->sigma[k] && value <= most;
        n += off[k];
    }
    return n;
}

static int subtract(struct kind *kind, int views, double common)
{
    int known = 0;

    for (int k = 0; k < views; k++) {
        kind->value[k] -= common;
        known += !isnan(kind->value[k]);
    }
    return known;
}

struct significance {
    bool all; /* the array is off */
    int stay; /* where the array is off, this view stays as it is, unless it is far off itself; -1: none */
    double least, most;
};

/* Subtract the value that all share; 0 without significance. */
static void keep_significant(struct kind *kind, int views, const struct significance *s)
{
    const int known = subtract(kind, views, common_value(kind, views));
    bool off[SST_MAX_VIEWS];
    int n = mark_off(off, kind, views, s->least, s->most);

    if (s->stay >= 0 && (s->all || n > MANY * known) &&
        islessequal(fabs(kind->value[s->stay]), STAY_SPREADS * rms_about(kind, views, 0))) {
        subtract(kind, views, kind->value[s->stay]);
        n = mark_off(off, kind, views, s->least, s->most);
    }
    for (int k = 0; k < views; k++) {
        const double value = isnan(kind->value[k]) ? 0 : fabs(kind->value[k]);

        if (!value || (!off[k] && !((s->all || n > MANY * known) && value > kind->sigma[k] && value <= s->most)))
            kind->value[k] = 0;
    }
}

static void plan_places(struct sst_correction *correction, struct sst_align_report *report,
                        const struct sst_lightfield *lf, const struct sst_drift *check)
{
    const double width = lf->width, height = lf->height, radius = sqrt((width * width + height * height) / 12);
    const double roll_px = radius * (M_PI / 180);
    const int views = lf->rows * lf->cols;
    struct kind kind[4];

    for (int k = 0; k < views; k++) {
        const struct sst_drift_camera *c = &check->camera[k];
        const bool use = lf->views[k].present && c->known && !c->lost;

        kind[0].value[k] = use ? c->shift_x_px : NAN;
        kind[1].value[k] = use ? c->shift_y_px : NAN;
        kind[2].value[k] = use ? c->roll_deg * roll_px : NAN;
        kind[3].value[k] = use ? c->scale * radius : NAN;
        kind[0].sigma[k] = kind[1].sigma[k] = use ? c->sigma_px : NAN;
        kind[2].sigma[k] = use ? c->roll_sigma_deg * roll_px : NAN;
        kind[3].sigma[k] = use ? c->scale_sigma * radius : NAN;
        report->unmeasured += lf->views[k].present && !use;
    }
    report->sigma_px = median_of(kind[0].sigma, views);
    for (int i = 0; i < 4; i++) {
        remove_tilt(&kind[i], lf);
        keep_significant(&kind[i], views,
                         &(struct significance){ is_apart(&kind[i], views, APART_PX, APART_SIGMA), lf->ref_view, OFF_PX,
                                                 MOST_PX });
    }
    for (int k = 0; k < views; k++) {
        const double off = hypot(hypot(kind[0].value[k], kind[1].value[k]), hypot(kind[2].value[k], kind[3].value[k]));

        correction[k].shift_x_px = kind[0].value[k];
        correction[k].shift_y_px = kind[1].value[k];
        correction[k].roll_deg = kind[2].value[k] / roll_px;
        correction[k].scale = kind[3].value[k] / radius;
        report->moved += off > 0;
        report->worst_px = fmax(report->worst_px, off);
    }
}

/* Bars of a fence look alike: matched a period off, or where a bar crosses what is behind it, they feign displacements
 * of many pixels. So the matches of a pair say different things, which no displacement of its cameras explains. */
static void leave_places(struct sst_correction *correction, struct sst_align_report *report, int views)
{
    for (int k = 0; k < views; k++)
        correction[k] = sst_correction_none();
    report->contradictory = report->moved > 0;
    report->moved = 0;
    report->worst_px = 0;
}

/* Fall-offs that differ show all over the pictures. What all share shows by the disparities alone, and glossy surfaces
 * and foliage feign 0.1 and more of it: it is believed, of lenses that darken the corners, where cameras are apart. */
static void plan_falloffs(struct sst_correction *correction, struct sst_align_report *report,
                          const struct sst_lightfield *lf, const struct sst_drift *check)
{
    const int views = lf->rows * lf->cols;
    struct kind kind = { 0 };
    double common;
    bool apart;

    for (int k = 0; k < views; k++) {
        const struct sst_drift_camera *c = &check->camera[k];
        const bool use = lf->views[k].present && !c->lost && !isnan(c->falloff_sigma);

        kind.value[k] = use ? c->falloff : NAN;
        kind.sigma[k] = use ? c->falloff_sigma : NAN;
    }
    report->falloff_sigma = median_of(kind.sigma, views);
    common = common_value(&kind, views);
    apart = is_apart(&kind, views, FALL_APART, FALL_SIGMA);
    keep_significant(&kind, views, &(struct significance){ apart, -1, OFF_GAIN, MOST_FALL });
    for (int k = 0; k < views; k++) {
        const double all = apart && common < -OFF_GAIN && lf->views[k].present && !isnan(kind.sigma[k]) ? common : 0;

        correction[k].falloff = sst_clamp_double(kind.value[k] + all, -MOST_FALL, MOST_FALL);
        report->faded += correction[k].falloff != 0;
        report->worst_falloff = fmax(report->worst_falloff, fabs(1 - exp(correction[k].falloff)));
    }
}

/* Exponents that differ show in bright and dark places all over the pictures, so that fall-offs explain them badly, and
 * they fall-offs. All views are bent back, or none. @return whether they are */
static bool plan_exponents(struct sst_correction *correction, struct sst_align_report *report,
                           const struct sst_lightfield *lf, const struct sst_drift *check)
{
    const int views = lf->rows * lf->cols;
    struct kind kind = { 0 };

    for (int k = 0; k < views; k++) {
        const struct sst_drift_camera *c = &check->camera[k];
        const bool use = lf->views[k].present && !c->lost && !isnan(c->exponent_sigma);

        kind.value[k] = use ? c->exponent - 1 : NAN;
        kind.sigma[k] = use ? c->exponent_sigma : NAN;
    }
    report->exponent_sigma = median_of(kind.sigma, views);
    if (!(rms_about(&kind, views, 0) > fmax(BENT_APART, BENT_SIGMA * report->exponent_sigma)) ||
        check->light_scale[2] >= check->light_scale[1])
        return false;
    report->bent_kept = lf->calibration;
    for (int k = 0; k < views && !report->bent_kept; k++) {
        if (isnan(kind.value[k]) || fabs(kind.value[k]) > BENT_MOST)
            continue;
        correction[k].exponent = 1 + kind.value[k];
        for (int c = 0; c < 3; c++)
            correction[k].gain[c] = check->camera[k].bent_gain[c];
        report->bent++;
        report->worst_exponent = fmax(report->worst_exponent, fabs(kind.value[k]));
    }
    return report->bent > 0;
}

static void plan_gains(struct sst_correction *correction, struct sst_align_report *report,
                       const struct sst_lightfield *lf, const struct sst_drift *check)
{
    const int views = lf->rows * lf->cols;
    double sigma[SST_MAX_VIEWS];

    for (int colour = 0; colour < 3; colour++) {
        struct kind kind;

        for (int k = 0; k < views; k++) {
            const struct sst_drift_camera *c = &check->camera[k];
            const bool use = lf->views[k].present && !c->lost && !isnan(c->gain_sigma);

            kind.value[k] = use ? log(report->faded ? c->even_gain[colour] : c->gain[colour]) : NAN;
            kind.sigma[k] = sigma[k] = use ? c->gain_sigma : NAN;
        }
        keep_significant(&kind, views, &(struct significance){ false, -1, OFF_GAIN, MOST_GAIN });
        for (int k = 0; k < views; k++)
            correction[k].gain[colour] = exp(kind.value[k]);
    }
    report->gain_sigma = median_of(sigma, views);
    for (int k = 0; k < views; k++) {
        const double *g = correction[k].gain;
        const double most = fmax(fabs(g[0] - 1), fmax(fabs(g[1] - 1), fabs(g[2] - 1)));

        report->lit += most > 0;
        report->worst_gain = fmax(report->worst_gain, most);
    }
}

void sst_align_plan(struct sst_correction *correction, struct sst_align_report *report, const struct sst_lightfield *lf,
                    const struct sst_drift *check)
{
    *report = (struct sst_align_report){ 0 };
    for (int k = 0; k < lf->rows * lf->cols; k++)
        correction[k] = sst_correction_none();
    plan_places(correction, report, lf, check);
    if (check->contradiction_px > SST_DRIFT_CONTRADICTION_PX)
        leave_places(correction, report, lf->rows * lf->cols);
    if (!plan_exponents(correction, report, lf, check)) {
        plan_falloffs(correction, report, lf, check);
        plan_gains(correction, report, lf, check);
    }
    for (int k = 0; k < lf->rows * lf->cols; k++)
        sst_border_doubles("corrections of the views", &correction[k].shift_x_px, sizeof(*correction) / sizeof(double));
}

/* Whether a view has a pair along its row, or along its column, that is not lost, or no such pair with features. In a
 * narrow band up to 15 % of a displaced view's features match by chance. */
static bool is_tied(const struct sst_drift *check, int view, bool along_rows)
{
    bool has_features = false;

    for (int i = 0; i < check->pairs; i++) {
        const struct sst_drift_pair *p = &check->pair[i];

        if ((p->a != view && p->b != view) || (p->a / check->cols == p->b / check->cols) != along_rows ||
            p->features < SST_DRIFT_LEAST_MATCHES)
            continue;
        has_features = true;
        if (check->narrow ? 4 * p->matches >= p->features : p->state != SST_DRIFT_PAIR_LOST)
            return true;
    }
    return !has_features;
}

bool sst_align_is_clean(const struct sst_lightfield *lf, const struct sst_drift *check)
{
    struct sst_correction correction[SST_MAX_VIEWS];
    struct sst_drift_camera camera[SST_MAX_VIEWS];
    struct sst_drift sure = *check;
    struct sst_align_report r;

    sure.camera = camera;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_drift_camera *c = &camera[k];

        *c = check->camera[k];
        if (lf->views[k].present &&
            (isnan(c->gain_sigma) || !is_tied(check, k, true) || !is_tied(check, k, false)))
            return false;
        c->sigma_px *= WHOLE_SIGMA;
        c->roll_sigma_deg *= WHOLE_SIGMA;
        c->scale_sigma *= WHOLE_SIGMA;
        c->gain_sigma *= WHOLE_SIGMA;
        c->falloff_sigma *= WHOLE_SIGMA;
        c->exponent_sigma *= WHOLE_SIGMA;
    }
    sst_align_plan(correction, &r, lf, &sure);
    return !r.unmeasured && !r.moved && !r.contradictory && !r.lit && !r.faded && !r.bent && !r.bent_kept;
}
