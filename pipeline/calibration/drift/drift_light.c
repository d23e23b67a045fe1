/* Gains between cameras, their fall-off and their exponents, from matches: windows that show the same surface have the same
 * light.
 *
 * A match of a and b gives log light(b) - log light(a) = g_b - g_a, a colour at a time, g the logs of the gains.
 * Robust least squares over all matches; views that matches do not connect have a common gain of their own.
 *
 * With a fall-off, the mean of the colours is g_b + f_b r_b^2 - g_a - f_a r_a^2: differences between cameras show all
 * over the picture, the common part by the disparity alone, which moves a surface to another distance from the centre.
 * The gains at the centres follow from the light without the fall-off.
 *
 * With exponents (another gamma), a camera's log light is (1 + e) l + a constant: g_b + e_b (l - m) - g_a - e_a (l - m), l the
 * mean log light of the match, m of all matches. The common part is not observable, and is not undone. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/calibration/drift/drift_internal.h"
#include "pipeline/camera/numbers.h"
#include "pipeline/image/srgb.h"

#define HALF      3     /* windows of 7x7 px */
#define CLIPPED   250   /* levels from here on are not trusted */
#define DARK      0.002 /* linear light: darker windows are mostly noise and black level */
#define ROUNDS    12
#define TUKEY     4.685
#define SCALE_MIN 0.002 /* of the residuals, logs */
#define EXPONENT_MOST 0.8 /* from 1 */

struct ratio {
    int a, b;
    double log[4];     /* red, green, blue, their mean */
    double r2_a, r2_b; /* squared half diagonals from the centre */
    double level;      /* mean log light, less the mean of all matches */
};

#define MEAN 3

enum term { TERM_NONE = 0, TERM_FALLOFF = 1, TERM_EXPONENT = 2 };

struct solver {
    enum term term;         /* beside the gains */
    int views, size, count; /* size: unknowns, a gain for each view, then the term of each or none */
    struct ratio *ratio;
    double *normal, *right, *x; /* [size][size] lower half, then its factor; [size]; [size] */
    double *sort;               /* [count] */
};

/* Mean light of a window at a fractional place, by colour. @return false: outside, clipped or dark */
static bool window_light(const struct sst_image *image, const double *light, double x, double y, double out[3])
{
    const int x0 = (int)floor(x), y0 = (int)floor(y);
    const double tx = x - x0, ty = y - y0;

    if (x0 - HALF < 0 || y0 - HALF < 0 || x0 + HALF + 1 >= image->width || y0 + HALF + 1 >= image->height)
        return false;
    for (int c = 0; c < 3; c++) {
        double sum = 0;

        for (int j = -HALF; j <= HALF + 1; j++) {
            const uint8_t *row = sst_image_row(image, c, y0 + j) + x0;
            const double wy = j == -HALF ? 1 - ty : j == HALF + 1 ? ty : 1;

            for (int i = -HALF; i <= HALF + 1; i++) {
                if (row[i] >= CLIPPED)
                    return false;
                sum += wy * (i == -HALF ? 1 - tx : i == HALF + 1 ? tx : 1) * light[row[i]];
            }
        }
        out[c] = sum / ((2 * HALF + 1) * (2 * HALF + 1));
        if (out[c] < DARK)
            return false;
    }
    return true;
}

static double radius2(const struct sst_image *image, double x, double y)
{
    const double cx = 0.5 * (image->width - 1), cy = 0.5 * (image->height - 1);

    return ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / (cx * cx + cy * cy);
}

static int collect(struct ratio *out, const struct drift_work *w)
{
    double light[256];
    int n = 0;

    for (int i = 0; i < 256; i++)
        light[i] = sst_srgb_to_light(i / 255.0);
    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i];

        for (int k = 0; drift_link_useful(l) && k < DRIFT_CELLS; k++) {
            const struct drift_feature *p = &w->view[l->a].feature[l->feature[k]];
            double la[3], lb[3];

            if (!l->used[k] || !window_light(w->view[l->a].image, light, p->x, p->y, la) ||
                !window_light(w->view[l->b].image, light, p->x + l->m[k].dx, p->y + l->m[k].dy, lb))
                continue;
            out[n] = (struct ratio){ .a = l->a,
                                     .b = l->b,
                                     .r2_a = radius2(w->view[l->a].image, p->x, p->y),
                                     .r2_b = radius2(w->view[l->b].image, p->x + l->m[k].dx, p->y + l->m[k].dy) };
            for (int c = 0; c < 3; c++) {
                out[n].log[c] = log(lb[c] / la[c]);
                out[n].log[MEAN] += out[n].log[c] / 3;
                out[n].level += log(la[c] * lb[c]) / 6;
            }
            n++;
        }
    }
    return n;
}

/* @return the mean, which is subtracted */
static double centre_levels(struct ratio *ratio, int n)
{
    double mean = 0;

    for (int i = 0; i < n; i++)
        mean += ratio[i].level / n;
    for (int i = 0; i < n; i++)
        ratio[i].level -= mean;
    return mean;
}

/* A match's equation: unknowns and their factors. @return how many */
static int equation(int unknown[4], double factor[4], const struct solver *s, const struct ratio *r)
{
    unknown[0] = r->b;
    factor[0] = 1;
    unknown[1] = r->a;
    factor[1] = -1;
    if (s->term == TERM_NONE)
        return 2;
    unknown[2] = s->views + r->b;
    factor[2] = s->term == TERM_FALLOFF ? r->r2_b : r->level;
    unknown[3] = s->views + r->a;
    factor[3] = -(s->term == TERM_FALLOFF ? r->r2_a : r->level);
    return 4;
}

static double misfit(const struct solver *s, const struct ratio *r, int colour)
{
    double f[4], sum = 0;
    int u[4];
    const int n = equation(u, f, s, r);

    for (int i = 0; i < n; i++)
        sum += f[i] * s->x[u[i]];
    return r->log[colour] - sum;
}

static double *at(const struct solver *s, int row, int col)
{
    return &s->normal[(size_t)row * (size_t)s->size + (size_t)col];
}

static double residual_scale(const struct solver *s, int colour)
{
    for (int i = 0; i < s->count; i++)
        s->sort[i] = fabs(misfit(s, &s->ratio[i], colour));
    return fmax(1.4826 * sst_stats_quantile(s->sort, s->count, 0.5), SCALE_MIN);
}

/* One round of reweighted least squares. A weak prior fixes the mean, which no match does. */
static void iterate(const struct solver *s, int colour, double scale)
{
    memset(s->normal, 0, (size_t)s->size * (size_t)s->size * sizeof(*s->normal));
    memset(s->right, 0, (size_t)s->size * sizeof(*s->right));
    for (int v = 0; v < s->size; v++)
        *at(s, v, v) = 1e-6 / (scale * scale);
    for (int i = 0; i < s->count; i++) {
        const struct ratio *r = &s->ratio[i];
        const double t = misfit(s, r, colour) / (TUKEY * scale);
        const double weight = fabs(t) >= 1 ? 0 : (1 - t * t) * (1 - t * t) / (scale * scale);
        double f[4];
        int u[4];
        const int n = equation(u, f, s, r);

        for (int j = 0; j < n; j++) {
            for (int k = 0; k < n; k++) {
                if (u[j] >= u[k])
                    *at(s, u[j], u[k]) += weight * f[j] * f[k];
            }
            s->right[u[j]] += weight * f[j] * r->log[colour];
        }
    }
    (void)sst_numbers_factor(s->normal, s->size); /* positive definite by the prior */
    sst_numbers_substitute(s->normal, s->size, s->right);
    memcpy(s->x, s->right, (size_t)s->size * sizeof(*s->x));
}

/* Sigma of each camera's gain relative to the mean of all, from the last factor. */
static void add_sigmas(struct sst_drift_camera *camera, const struct solver *s, const int *matches, double *column)
{
    int n = 0;

    for (int v = 0; v < s->views; v++)
        n += matches[v] > 0;
    for (int v = 0; v < s->views; v++) {
        if (!matches[v])
            continue;
        for (int i = 0; i < s->views; i++)
            column[i] = matches[i] ? (i == v) - 1.0 / n : 0;
        memcpy(s->right, column, (size_t)s->views * sizeof(*column));
        sst_numbers_substitute(s->normal, s->size, s->right);
        double variance = 0;

        for (int i = 0; i < s->views; i++)
            variance += column[i] * s->right[i];
        camera[v].gain_sigma = fmax(isnan(camera[v].gain_sigma) ? 0 : camera[v].gain_sigma, sqrt(fmax(variance, 0)));
    }
}

/* From loose to the scale of the matches: first gains are not yet known. */
static void fit(const struct solver *s, int colour)
{
    memset(s->x, 0, (size_t)s->size * sizeof(*s->x));
    for (int i = 0; i < ROUNDS; i++)
        iterate(s, colour, fmax(residual_scale(s, colour), i < ROUNDS / 2 ? 0.3 / (1 << i) : 0));
}

static double mean_gain(const struct solver *s, const int *matches)
{
    double mean = 0;
    int n = 0;

    for (int v = 0; v < s->views; v++) {
        if (matches[v])
            mean += (s->x[v] - mean) / ++n;
    }
    return mean;
}

static void solve_gains(struct sst_drift_camera *camera, const struct solver *s, const int *matches, double *column)
{
    for (int c = 0; c < 3; c++) {
        fit(s, c);
        for (int v = 0; v < s->views; v++) {
            if (matches[v])
                camera[v].gain[c] = exp(s->x[v] - mean_gain(s, matches));
        }
        add_sigmas(camera, s, matches, column);
    }
}

/* Fit gains and a term: values and sigmas of the cameras' terms. @return scale of the residuals */
static double solve_term(double *value, double *sigma, struct solver *s, enum term term, const int *matches)
{
    const bool relative = term == TERM_EXPONENT; /* the common part has no sigma */
    double contrast[SST_MAX_VIEWS];
    const int n = s->views;
    int known = 0;

    s->term = term;
    s->size = 2 * n;
    fit(s, MEAN);
    for (int v = 0; v < n; v++)
        known += matches[v] > 0;
    for (int v = 0; v < n; v++) {
        double variance = 0;

        value[v] = matches[v] ? s->x[n + v] : 0;
        memset(s->right, 0, (size_t)s->size * sizeof(*s->right));
        for (int i = 0; i < n; i++)
            s->right[n + i] = contrast[i] = (i == v) - (relative && matches[i] ? 1.0 / known : 0);
        sst_numbers_substitute(s->normal, s->size, s->right);
        for (int i = 0; i < n; i++)
            variance += contrast[i] * s->right[n + i];
        sigma[v] = matches[v] ? sqrt(fmax(variance, 0)) : NAN;
    }
    return residual_scale(s, MEAN);
}

/* Gains of the light without the terms, which are subtracted from it, and added again with sign -1. */
static void subtract_term(const struct solver *s, const double *value, enum term term, int sign)
{
    for (int i = 0; i < s->count; i++) {
        struct ratio *r = &s->ratio[i];
        const double by = term == TERM_FALLOFF ? r->r2_b * value[r->b] - r->r2_a * value[r->a]
                                               : r->level * (value[r->b] - value[r->a]);

        for (int c = 0; c < 3; c++)
            r->log[c] -= sign * by;
    }
}

static void solve_falloffs(struct sst_drift *out, struct solver *s, const int *matches)
{
    struct sst_drift_camera *camera = out->camera;
    double value[SST_MAX_VIEWS], sigma[SST_MAX_VIEWS];

    out->light_scale[TERM_FALLOFF] = solve_term(value, sigma, s, TERM_FALLOFF, matches);
    subtract_term(s, value, TERM_FALLOFF, 1);
    s->term = TERM_NONE;
    s->size = s->views;
    for (int v = 0; v < s->views; v++) {
        camera[v].falloff = value[v];
        camera[v].falloff_sigma = sigma[v];
    }
    for (int c = 0; c < 3; c++) {
        fit(s, c);
        for (int v = 0; v < s->views; v++)
            camera[v].even_gain[c] = matches[v] ? exp(s->x[v] - mean_gain(s, matches)) : 1;
    }
    subtract_term(s, value, TERM_FALLOFF, -1);
}

/* @param level  mean log light */
static void solve_exponents(struct sst_drift *out, struct solver *s, const int *matches, double level)
{
    struct sst_drift_camera *camera = out->camera;
    double value[SST_MAX_VIEWS], sigma[SST_MAX_VIEWS], mean = 0;
    int known = 0;

    out->light_scale[TERM_EXPONENT] = solve_term(value, sigma, s, TERM_EXPONENT, matches);
    for (int v = 0; v < s->views; v++) {
        if (matches[v])
            mean += (value[v] - mean) / ++known;
    }
    for (int v = 0; v < s->views; v++)
        value[v] = matches[v] ? sst_clamp_double(value[v] - mean, -EXPONENT_MOST, EXPONENT_MOST) : 0;
    subtract_term(s, value, TERM_EXPONENT, 1);
    s->term = TERM_NONE;
    s->size = s->views;
    for (int c = 0; c < 3; c++) {
        fit(s, c);
        for (int v = 0; v < s->views; v++)
            camera[v].bent_gain[c] =
                matches[v] ? exp((s->x[v] - mean_gain(s, matches) - value[v] * level) / (1 + value[v])) : 1;
    }
    for (int v = 0; v < s->views; v++) {
        camera[v].exponent = 1 + value[v];
        camera[v].exponent_sigma = sigma[v];
    }
}

int drift_solve_gains(struct sst_drift *out, const struct drift_work *w)
{
    struct sst_drift_camera *camera = out->camera;
    const size_t n = 2 * (size_t)w->views;
    int *matches = calloc(n, sizeof(*matches));
    double *column = calloc(n, sizeof(*column));
    struct solver s = { .views = w->views,
                        .size = w->views,
                        .ratio = malloc(((size_t)w->links * DRIFT_CELLS + 1) * sizeof(*s.ratio)),
                        .normal = calloc(n * n, sizeof(double)),
                        .right = calloc(n, sizeof(double)),
                        .x = calloc(n, sizeof(double)) };
    int err = -ENOMEM;

    for (int v = 0; v < w->views; v++) {
        for (int c = 0; c < 3; c++)
            camera[v].gain[c] = camera[v].even_gain[c] = camera[v].bent_gain[c] = 1;
        camera[v].gain_sigma = camera[v].falloff_sigma = camera[v].exponent_sigma = NAN;
        camera[v].falloff = 0;
        camera[v].exponent = 1;
    }
    if (s.ratio && matches && column && s.normal && s.right && s.x) {
        s.count = collect(s.ratio, w);
        s.sort = malloc(((size_t)s.count + 1) * sizeof(*s.sort));
        err = s.sort ? 0 : -ENOMEM;
        for (int i = 0; i < s.count; i++) {
            matches[s.ratio[i].a]++;
            matches[s.ratio[i].b]++;
        }
        if (!err && s.count) {
            const double level = centre_levels(s.ratio, s.count);

            solve_gains(camera, &s, matches, column);
            solve_falloffs(out, &s, matches);
            solve_exponents(out, &s, matches, level);
        }
    }
    free(s.ratio);
    free(matches);
    free(column);
    free(s.normal);
    free(s.right);
    free(s.x);
    free(s.sort);
    return err;
}
