/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/photometric/photometric_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/camera/numbers.h"

#define ROUNDS       40
#define HUBER_ROUNDS 6
#define HUBER        1.5
#define TUKEY        4.685
#define DONE         1e-9
#define OWN_SIGMA    0.01 /* spread of coefficients between cameras of one model */
#define ALIKE        10   /* residuals of a camera in one frame are correlated: this many count as one */
#define SCALE_MIN    5e-4 /* quantisation; keeps the weights defined where everything fits */
#define STEPS        64   /* of r2 at which a fall-off is checked */
#define VALUES       5    /* derivatives of one value that are not 0 */

/* Of the common coefficients: of cos^4 of a lens with 60 degrees across the diagonal they are -0.67, 0.33, -0.15. Where
 * the board never was, this keeps the polynomial from going anywhere. */
static const double common_sigma[3] = { 0.7, 0.3, 0.15 };

/*
 * value = light of the group + gain[cam][colour] + log falloff(cam, r2). With J the derivatives of the last two, w the
 * weights and y the residuals, eliminating the group's light leaves of the normal equations
 *   sum w J J' - (sum w J) (sum w J)' / sum w   and   sum w J (y - mean y).
 * Unknowns: 3 gains of each camera, 3 coefficients of the common polynomial, 1 own coefficient of each camera.
 */
struct fit {
    struct photometric_problem *p;
    int unknowns;
    double *normal;                    /* [unknowns][unknowns], lower triangle */
    double *right, *step, *sum;        /* [unknowns]; sum: of w J in a group */
    int *touched;                      /* [unknowns] indices where sum is not 0 */
    double *residual, *weight, *sizes; /* [count][3] */
};

struct jacobian {
    int n, index[VALUES];
    double value[VALUES];
};

static double poly(const double a[3], double r2)
{
    return 1 + r2 * (a[0] + r2 * (a[1] + r2 * a[2]));
}

static void coefficients(const struct photometric_problem *p, int cam, double a[3])
{
    memcpy(a, p->common, sizeof(p->common));
    if (cam < p->cams)
        a[0] += p->cam[cam].own;
}

double photometric_log_falloff(const struct photometric_problem *p, int cam, double r2)
{
    double a[3];

    coefficients(p, cam, a);
    return log(poly(a, r2));
}

static double lowest(const double a[3], double reach)
{
    double least = 1;

    for (int i = 1; i <= STEPS; i++)
        least = fmin(least, poly(a, reach * i / STEPS));
    return least;
}

int photometric_falloff_fault(const struct photometric_problem *p)
{
    double reach = 1;

    for (int i = 0; i < p->cams; i++)
        reach = fmax(reach, p->cam[i].reach);
    for (int cam = p->cams; cam >= 0; cam--) { /* the common one first */
        const double end = cam < p->cams ? p->cam[cam].reach : reach;
        double a[3], up = 0, down = 0, before = 1;

        coefficients(p, cam, a);
        for (int i = 1; i <= STEPS; i++) {
            const double v = poly(a, end * i / STEPS);

            up += fmax(v - before, 0);
            down += fmax(before - v, 0);
            before = v;
        }
        if (!(lowest(a, end) >= PHOTOMETRIC_FALLOFF_MIN) || !(fmin(up, down) <= 0.01))
            return cam;
    }
    return -1;
}

static void differentiate(const struct fit *f, const struct photometric_observation *s, int colour, struct jacobian *j)
{
    const struct photometric_problem *p = f->p;
    double a[3], power;

    coefficients(p, s->cam, a);
    power = s->r2 / poly(a, s->r2);
    j->n = 0;
    if (!p->one_camera) {
        j->index[0] = 3 * s->cam + colour;
        j->value[j->n++] = 1;
    }
    for (int i = 0; i < p->order; i++) {
        j->index[j->n] = 3 * p->cams + i;
        j->value[j->n++] = power;
        if (i == 0 && !p->one_camera && !p->cam[s->cam].plain) {
            j->index[j->n] = 3 * p->cams + 3 + s->cam;
            j->value[j->n++] = power;
        }
        power *= s->r2;
    }
}

static int group_end(const struct photometric_problem *p, int from)
{
    int end = from + 1;

    while (end < p->count && p->seen[end].group == p->seen[from].group)
        end++;
    return end;
}

/* Residuals against the weighted mean of their group. @return their weighted cost */
static void find_residuals(struct fit *f)
{
    const struct photometric_problem *p = f->p;

    for (int from = 0, end; from < p->count; from = end) {
        end = group_end(p, from);
        for (int c = 0; c < 3; c++) {
            double sum = 0, weights = 0;

            for (int i = from; i < end; i++) {
                const struct photometric_observation *s = &p->seen[i];
                const double y = s->value[c] - p->cam[s->cam].gain[c] - photometric_log_falloff(p, s->cam, s->r2);

                f->residual[3 * i + c] = y;
                sum += f->weight[3 * i + c] * y;
                weights += f->weight[3 * i + c];
            }
            for (int i = from; i < end && weights > 0; i++)
                f->residual[3 * i + c] -= sum / weights;
        }
    }
}

/* Robust scale, and weights for the next step. A residual of a group is never quite without weight, so that each
 * group's mean stays defined. */
static void weigh(struct fit *f, int round)
{
    const int n = 3 * f->p->count;

    for (int i = 0; i < n; i++)
        f->sizes[i] = fabs(f->residual[i]);
    f->p->scale = fmax(1.4826 * sst_stats_upper_median(f->sizes, n), SCALE_MIN);
    for (int i = 0; i < n; i++) {
        const double u = fabs(f->residual[i]) / f->p->scale, rest = 1 - u * u / (TUKEY * TUKEY);

        if (round < HUBER_ROUNDS)
            f->weight[i] = u > HUBER ? HUBER / u : 1;
        else
            f->weight[i] = fmax(u < TUKEY ? rest * rest : 0, 1e-6);
    }
}

/* --- normal equations -------------------------------------------------------------------------------------------- */

static void add_group(struct fit *f, int from, int end, int colour)
{
    const size_t n = (size_t)f->unknowns;
    double weights = 0;
    int touched = 0;

    for (int i = from; i < end; i++) {
        const double w = f->weight[3 * i + colour], y = f->residual[3 * i + colour];
        struct jacobian j;

        differentiate(f, &f->p->seen[i], colour, &j);
        weights += w;
        for (int a = 0; a < j.n; a++) {
            if (!(j.value[a] > 0)) /* r2 = 0 */
                continue;
            for (int b = 0; b < j.n; b++) {
                if (j.index[a] >= j.index[b])
                    f->normal[(size_t)j.index[a] * n + (size_t)j.index[b]] += w * j.value[a] * j.value[b];
            }
            f->right[j.index[a]] += w * j.value[a] * y;
            if (f->sum[j.index[a]] == 0)
                f->touched[touched++] = j.index[a];
            f->sum[j.index[a]] += w * j.value[a];
        }
    }
    for (int a = 0; a < touched; a++) {
        double *row = f->normal + (size_t)f->touched[a] * n;

        for (int b = 0; b < touched; b++) {
            if (f->touched[a] >= f->touched[b])
                row[f->touched[b]] -= f->sum[f->touched[a]] * f->sum[f->touched[b]] / weights;
        }
    }
    for (int a = 0; a < touched; a++)
        f->sum[f->touched[a]] = 0;
}

/* Gauge and priors: the mean gain of each part, unobserved coefficients. */
static void add_priors(struct fit *f)
{
    const struct photometric_problem *p = f->p;
    const size_t n = (size_t)f->unknowns;
    const double s2 = ALIKE * p->scale * p->scale;

    for (int i = 0; i < f->unknowns; i++) {
        const int k = i - 3 * p->cams, cam = k - 3; /* of the common polynomial, of the own coefficients */
        const bool fixed = k < 0     ? p->one_camera
                           : cam < 0 ? k >= p->order
                                     : p->one_camera || p->cam[cam].plain || !p->order;
        const double sigma = cam < 0 ? common_sigma[k < 0 ? 0 : k] : OWN_SIGMA;
        const double weight = fixed ? 1 : k < 0 ? 1e-9 : s2 / (sigma * sigma);
        const double value = fixed || k < 0 ? 0 : cam < 0 ? p->common[k] : p->cam[cam].own;

        f->normal[(size_t)i * n + (size_t)i] += weight;
        f->right[i] -= weight * value;
    }
    for (int i = 0; i < p->cams && !p->one_camera; i++) {
        for (int k = 0; k <= i; k++) {
            for (int c = 0; c < 3 && p->cam[i].part == p->cam[k].part; c++)
                f->normal[(size_t)(3 * i + c) * n + (size_t)(3 * k + c)] += 1;
        }
    }
}

/* --- steps ------------------------------------------------------------------------------------------------------- */

static void move(struct fit *f, double share)
{
    struct photometric_problem *p = f->p;
    const double *x = f->step;

    for (int i = 0; i < 3; i++)
        p->common[i] += share * x[3 * p->cams + i];
    for (int k = 0; k < p->cams; k++) {
        for (int i = 0; i < 3; i++)
            p->cam[k].gain[i] += share * x[3 * k + i];
        p->cam[k].own += share * x[3 * p->cams + 3 + k];
    }
}

static bool all_positive(const struct photometric_problem *p)
{
    for (int k = 0; k < p->cams; k++) {
        double a[3];

        coefficients(p, k, a);
        if (!(lowest(a, p->cam[k].reach) > 0.02))
            return false;
    }
    return true;
}

/* @return the largest change of an unknown */
static double go(struct fit *f)
{
    double largest = 0, share = 1;

    move(f, share);
    while (share > 1e-6 && !all_positive(f->p)) {
        move(f, -share / 2);
        share /= 2;
    }
    if (!all_positive(f->p)) {
        move(f, -share);
        share = 0;
    }
    for (int i = 0; i < f->unknowns; i++)
        largest = fmax(largest, share * fabs(f->step[i]));
    return largest;
}

/* The mean log gain of each part is exactly 0 in each colour. */
static void centre(struct photometric_problem *p)
{
    for (int part = 0; part < p->parts; part++) {
        for (int c = 0; c < 3; c++) {
            double sum = 0;
            int n = 0;

            for (int k = 0; k < p->cams; k++) {
                sum += p->cam[k].part == part ? p->cam[k].gain[c] : 0;
                n += p->cam[k].part == part;
            }
            for (int k = 0; k < p->cams; k++)
                p->cam[k].gain[c] -= p->cam[k].part == part ? sum / n : 0;
        }
    }
}

static int fit_init(struct fit *f, struct photometric_problem *p)
{
    const size_t n = 4 * (size_t)p->cams + 3, values = 3 * (size_t)p->count;

    *f = (struct fit){ .p = p, .unknowns = (int)n };
    f->normal = malloc(n * n * sizeof(double));
    f->right = calloc(3 * n, sizeof(double));
    f->touched = calloc(n, sizeof(int));
    f->residual = calloc(3 * values, sizeof(double));
    if (!f->normal || !f->right || !f->touched || !f->residual)
        return -ENOMEM;
    f->step = f->right + n;
    f->sum = f->step + n;
    f->weight = f->residual + values;
    f->sizes = f->weight + values;
    for (size_t i = 0; i < values; i++)
        f->weight[i] = 1;
    return 0;
}

static void fit_fini(struct fit *f)
{
    free(f->normal);
    free(f->right);
    free(f->touched);
    free(f->residual);
}

int photometric_fit_gains(struct photometric_problem *p)
{
    struct fit f;
    int err = fit_init(&f, p);

    for (int round = 0; round < ROUNDS && !err; round++) {
        find_residuals(&f);
        weigh(&f, round);
        find_residuals(&f); /* the means follow the weights */
        memset(f.normal, 0, (size_t)f.unknowns * (size_t)f.unknowns * sizeof(double));
        memset(f.right, 0, (size_t)f.unknowns * sizeof(double));
        for (int from = 0, end; from < p->count; from = end) {
            end = group_end(p, from);
            for (int c = 0; c < 3; c++)
                add_group(&f, from, end, c);
        }
        add_priors(&f);
        memcpy(f.step, f.right, (size_t)f.unknowns * sizeof(double));
        (void)sst_numbers_solve(f.normal, f.step, f.unknowns); /* the priors determine what the samples do not */
        if (go(&f) < DONE && round > HUBER_ROUNDS)
            break;
    }
    if (!err)
        centre(p);
    fit_fini(&f);
    return err;
}
