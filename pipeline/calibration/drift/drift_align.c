/* Sub-pixel alignment of a feature's window with another view.
 *
 * Lucas and Kanade's method in its inverse compositional form (Baker, Matthews 2004) for a shift, a gain and an offset:
 * the template's derivatives have their parts along the template and along a constant taken out, so that gain and
 * offset drop out of the equations. The fixed point is where these derivatives see no difference; it is unbiased if
 * the interpolation is (cubic, on smoothed values: below 0.01 px, tests/unit/check.c).
 *
 * A window that shows two depths aligns with neither. Its error was measured on scenes with known truth: close to
 * sqrt(1 - correlation) px, whatever the scene; so the correlation, less the loss by noise, is the quality that
 * matches are chosen and weighed by. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/calibration/drift/drift_internal.h"

#define RADIUS       7  /* of the largest window */
#define RADIUS_SMALL 4  /* tried where the largest shows several depths; and at levels above 0 */
#define LANES        16 /* a row of the window, filled up with zeros */
#define REACH        3  /* px that the alignment may go from its start */
#define ROUNDS       12
#define SETTLED      0.002 /* px */
#define CORRELATION  0.7   /* below this nothing was found */
#define BOTH_WAYS_PX 0.25
/* Variance of a sum over smoothed noise, over the variance of as many independent values: the filter's 1 / (sum of
 * squares) = (256 / 70)^2, reduced by the derivative's own frequencies; measured in tests. */
#define SMOOTHED       6.0
#define VARIANCE_FLOOR 2e-4 /* px^2: interpolation */

struct window {
    int radius;
    float t[2 * RADIUS + 1][LANES], gx[2 * RADIUS + 1][LANES], gy[2 * RADIUS + 1][LANES];
    float mean;
    double tt, xx, xy, yy, det; /* sums of squares of t; of the derivatives, without their parts along t and 1 */
};

static double window_sum(const float p[][LANES], const float q[][LANES], int rows)
{
    float lane[LANES] = { 0 };
    double sum = 0;

    for (int y = 0; y < rows; y++) {
        for (int x = 0; x < LANES; x++)
            lane[x] += p[y][x] * q[y][x];
    }
    for (int x = 0; x < LANES; x++)
        sum += lane[x];
    return sum;
}

/* Take out the mean and the part along t (if any). */
static void project(float p[][LANES], const struct window *w, bool along)
{
    const int n = 2 * w->radius + 1;
    double mean = 0, part;

    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++)
            mean += p[y][x];
    }
    mean /= n * n;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++)
            p[y][x] -= (float)mean;
    }
    if (!along)
        return;
    part = window_sum(p, w->t, n) / w->tt;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++)
            p[y][x] -= (float)part * w->t[y][x];
    }
}

/* A pixel of a level, around which windows lie. */
struct place {
    int level, x, y;
};

/* The square around a place. */
static struct sst_rect around(struct place at, int radius)
{
    return (struct sst_rect){ at.x - radius, at.y - radius, at.x + radius + 1, at.y + radius + 1 };
}

static bool window_read(struct window *w, const struct drift_pyramid *view, struct place at, int radius)
{
    const int n = 2 * radius + 1, side = n + 2;
    float patch[(2 * RADIUS + 3) * (2 * RADIUS + 3)];
    double sum = 0;

    if (!drift_read_patch(patch, view, at.level, around(at, radius + 1)))
        return false;
    memset(w, 0, sizeof(*w));
    w->radius = radius;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            const float *p = patch + (y + 1) * side + x + 1;

            w->t[y][x] = *p;
            w->gx[y][x] = 0.5f * (p[1] - p[-1]);
            w->gy[y][x] = 0.5f * (p[side] - p[-side]);
            sum += *p;
        }
    }
    w->mean = (float)(sum / (n * n));
    project(w->t, w, false);
    w->tt = window_sum(w->t, w->t, n);
    if (w->tt < 1e-3 * n * n)
        return false;
    project(w->gx, w, true);
    project(w->gy, w, true);
    w->xx = window_sum(w->gx, w->gx, n);
    w->xy = window_sum(w->gx, w->gy, n);
    w->yy = window_sum(w->gy, w->gy, n);
    w->det = w->xx * w->yy - w->xy * w->xy;
    return w->det > 1e-4 * w->xx * w->yy;
}

/* Cubic through four values (Keys 1981, a = -1/2), at t after the second. */
static void cubic(float w[4], double t)
{
    w[0] = (float)(t * (-0.5 + t * (1 - 0.5 * t)));
    w[1] = (float)(1 + t * t * (-2.5 + 1.5 * t));
    w[2] = (float)(t * (0.5 + t * (2 - 1.5 * t)));
    w[3] = (float)(t * t * (-0.5 + 0.5 * t));
}

/* Side of the patch in which a window is aligned. */
static int patch_side(const struct window *w)
{
    return 2 * (w->radius + REACH + 1) + 2;
}

/* The window at (px, py) of a patch, less its template's mean. */
static void resample(float out[][LANES], const struct window *w, const float *patch, double px, double py)
{
    const int side = patch_side(w), n = 2 * w->radius + 1;
    const int x0 = (int)floor(px), y0 = (int)floor(py);
    float wx[4], wy[4], rows[2 * RADIUS + 4][LANES] = { { 0 } };

    cubic(wx, px - x0);
    cubic(wy, py - y0);
    for (int y = 0; y < n + 3; y++) {
        const float *p = patch + (y0 - 1 + y) * side + x0 - 1;

        for (int x = 0; x < n; x++)
            rows[y][x] = wx[0] * p[x] + wx[1] * p[x + 1] + wx[2] * p[x + 2] + wx[3] * p[x + 3] - w->mean;
    }
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < LANES; x++)
            out[y][x] = wy[0] * rows[y][x] + wy[1] * rows[y + 1][x] + wy[2] * rows[y + 2][x] + wy[3] * rows[y + 3][x];
    }
}

/* Correlation of template and window; per-pixel variance of their difference in the template's grey levels. */
static double fit_quality(const struct window *w, float i[][LANES], double gain, double *variance)
{
    const int n = 2 * w->radius + 1;
    double spread;

    project(i, w, false);
    spread = window_sum((const float(*)[LANES])i, (const float(*)[LANES])i, n);
    *variance = fmax(spread / (gain * gain) - w->tt, 0) / (n * n - 4);
    return spread > 0 ? gain * sqrt(w->tt / spread) : 0;
}

/* A window in the other view: its displacement, in pixels of the level, and its fit. */
struct aligned {
    double x, y, variance, correlation;
};

/* Align view b with the window around a place. @param out  in and out: the displacement */
static bool align(const struct window *w, const struct drift_pyramid *b, struct place at, struct aligned *out)
{
    const int n = 2 * w->radius + 1, edge = w->radius + REACH + 1, side = patch_side(w);
    const int cx = (int)floor(out->x + 0.5), cy = (int)floor(out->y + 0.5);
    const int x0 = at.x + cx - edge, y0 = at.y + cy - edge;
    float patch[(2 * (RADIUS + REACH) + 4) * (2 * (RADIUS + REACH) + 4)], i[2 * RADIUS + 1][LANES] = { { 0 } };
    double x = out->x - cx, y = out->y - cy; /* from the patch's middle */

    if (!drift_read_patch(patch, b, at.level, (struct sst_rect){ x0, y0, x0 + side, y0 + side }))
        return false;
    for (int round = 0; round < ROUNDS; round++) {
        const double to = REACH + 1;
        double sx, sy, gain, dx, dy;

        resample(i, w, patch, x + to, y + to);
        gain = window_sum((const float(*)[LANES])i, w->t, n) / w->tt;
        if (gain < 0.2 || gain > 5)
            return false;
        sx = window_sum((const float(*)[LANES])i, w->gx, n) / gain;
        sy = window_sum((const float(*)[LANES])i, w->gy, n) / gain;
        dx = (w->yy * sx - w->xy * sy) / w->det;
        dy = (w->xx * sy - w->xy * sx) / w->det;
        x -= dx;
        y -= dy;
        if (fabs(x) > REACH - 1e-6 || fabs(y) > REACH - 1e-6)
            return false;
        if (dx * dx + dy * dy > SETTLED * SETTLED)
            continue;
        out->x = cx + x;
        out->y = cy + y;
        out->correlation = fit_quality(w, i, gain, &out->variance);
        return out->correlation > CORRELATION;
    }
    return false;
}

/* Variances by noise along u and across it, each with the other unknown: the inverse of the structure tensor. */
static void set_inverse(struct drift_match *m, const struct window *w, const struct drift_search *s)
{
    const double scale = SMOOTHED / w->det, ixx = w->yy * scale, ixy = -w->xy * scale, iyy = w->xx * scale;

    m->inverse[0] = s->u[0] * s->u[0] * ixx + 2 * s->u[0] * s->u[1] * ixy + s->u[1] * s->u[1] * iyy;
    m->inverse[1] = s->n[0] * s->n[0] * ixx + 2 * s->n[0] * s->n[1] * ixy + s->n[1] * s->n[1] * iyy;
}

void drift_weigh_match(struct drift_match *m, const struct drift_search *s)
{
    const double most = s->loose ? DRIFT_MISFIT_LOOSE : m->small ? DRIFT_MISFIT / 2 : DRIFT_MISFIT;
    const double allowed = DRIFT_NOISE_SHARE * s->noise * s->noise, by_noise = fmin(m->residual, allowed);

    if (m->outcome != DRIFT_FOUND)
        return;
    m->misfit = 0.5 * fmax(m->residual - allowed, 0) / m->energy;
    m->var_along = VARIANCE_FLOOR + (m->small ? 4 : 1) * m->misfit + by_noise * m->inverse[0];
    m->var_across = VARIANCE_FLOOR + (m->small ? 4 : 1) * m->misfit + by_noise * m->inverse[1];
    if (m->misfit > most)
        m->outcome = DRIFT_NOWHERE;
}

/* Follow a feature from m's displacement at a level to level 0. @return variance of its residual; NAN: not found */
static double forth(struct window *w, struct drift_match *m, const struct drift_views *v, struct place feature, int radius)
{
    struct aligned fit = { 0 };

    for (int level = feature.level; level >= 0; level--) {
        const struct place at = { level, drift_to_level(feature.x, level), drift_to_level(feature.y, level) };

        fit.x = m->dx / (1 << level);
        fit.y = m->dy / (1 << level);
        if (!window_read(w, v->a, at, level ? RADIUS_SMALL : radius) || !align(w, v->b, at, &fit))
            return NAN;
        m->dx = fit.x * (1 << level);
        m->dy = fit.y * (1 << level);
    }
    return fit.variance;
}

static void refine(struct drift_match *m, const struct drift_views *v, const struct drift_feature *f, int level, int radius)
{
    const struct drift_search *s = v->s;
    struct window w, back;
    struct aligned fit = { 0 };
    struct place there = { 0 };
    double misfit;

    m->outcome = DRIFT_NOWHERE;
    misfit = forth(&w, m, v, (struct place){ level, f->x, f->y }, radius);
    if (isnan(misfit))
        return;
    there.x = (int)floor(f->x + m->dx + 0.5);
    there.y = (int)floor(f->y + m->dy + 0.5);
    fit.x = -m->dx;
    fit.y = -m->dy;
    if (!window_read(&back, v->b, there, radius) || !align(&back, v->a, there, &fit) ||
        hypot(m->dx + fit.x, m->dy + fit.y) > BOTH_WAYS_PX)
        return;
    m->dx = 0.5 * (m->dx - fit.x);
    m->dy = 0.5 * (m->dy - fit.y);
    m->along = s->u[0] * m->dx + s->u[1] * m->dy;
    m->across = s->n[0] * m->dx + s->n[1] * m->dy;
    m->residual = misfit;
    m->small = radius < RADIUS;
    m->energy = w.tt / ((2 * radius + 1) * (2 * radius + 1));
    set_inverse(m, &w, s);
    m->outcome = DRIFT_FOUND;
    drift_weigh_match(m, s);
}

void drift_refine_match(struct drift_match *m, const struct drift_views *v, const struct drift_feature *f, int level)
{
    static const int radius[] = { RADIUS, RADIUS_SMALL };
    const struct drift_match start = *m;

    for (size_t i = 0; i < ARRAY_LEN(radius); i++) {
        *m = start;
        refine(m, v, f, level, radius[i]);
        if (m->outcome == DRIFT_FOUND)
            return;
    }
}
