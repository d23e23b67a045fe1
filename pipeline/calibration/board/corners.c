/*
 * Two crossing edges under blur. With the distances t1, t2 of a pixel from the edges in widths of their blur, and the
 * correlation c of the blur between the directions across both (a blur that is longer in one direction than in the
 * other has one),
 *
 *   S = E[sign(t1 + e1) sign(t2 + e2)] = P(t1) P(t2) + 4 f(t1) f(t2) (c + c^2 t1 t2 / 2 + c^3 (t1^2-1)(t2^2-1) / 6 ...)
 *
 * P(t) = erf(t / sqrt 2), f the normal density: the expansion of the bivariate normal distribution (Mehler), of
 * which the first three terms are kept. S(-t1, -t2) = S(t1, t2).
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/board/board_internal.h"

#include <math.h>
#include <string.h>

#include "pipeline/camera/numbers.h"

#define PARAMETERS  11
#define MAX_SIDE    64 /* of the window, px */
#define ROUNDS      20
#define MARGIN_PX   1.5 /* margin to pixels outside the four quadrants */
#define FAR         4.0 /* widths from an edge beyond which its blur is negligible */
#define MIN_BLUR_PX 0.2
#define MAX_BLUR_PX 12.0
#define MAX_SLOPE   0.05 /* of the illumination, per px */
#define MAX_SKEW    0.8  /* of the correlation, where three terms still suffice */

/* x and y relative to the window's middle; log of the blur's widths. */
enum { X, Y, ANGLE1, ANGLE2, BLUR1, BLUR2, SKEW, LEVEL, CONTRAST, LIGHT_X, LIGHT_Y };

struct window {
    int n;
    double middle[2];
    float dx[MAX_SIDE * MAX_SIDE], dy[MAX_SIDE * MAX_SIDE], grey[MAX_SIDE * MAX_SIDE], weight[MAX_SIDE * MAX_SIDE];
};

/* --- the window -------------------------------------------------------------------------------------------------- */

/* 1 inside, falling to 0 over the last third before the limit. */
static double taper(double x, double limit)
{
    return sst_clamp_double(3 * (1 - fabs(x) / limit), 0, 1);
}

/* Collect the pixels around a point that show the four quadrants. @return false: too few, or a side is missing */
static bool collect(struct window *w, const struct sst_map_u8 *luma, const struct saddle_place *place,
                    const double at[2], double largest_px)
{
    const double x = at[0], y = at[1];
    const double *s = place->slope, det = s[0] * s[3] - s[1] * s[2];
    /* step in u and v, mm, between lines u, v = const one pixel apart */
    const double step_u = hypot(s[3], s[1]) / det, step_v = hypot(s[2], s[0]) / det;
    const double half_u = fmin(place->half_mm - MARGIN_PX * step_u, largest_px * step_u);
    const double half_v = fmin(place->half_mm - MARGIN_PX * step_v, largest_px * step_v);
    const double core_u = place->core_mm - MARGIN_PX * step_u, core_v = place->core_mm - MARGIN_PX * step_v;
    const double reach_x = half_u * fabs(s[0]) + half_v * fabs(s[1]);
    const double reach_y = half_u * fabs(s[2]) + half_v * fabs(s[3]);
    const int x0 = (int)ceil(x - reach_x), x1 = (int)floor(x + reach_x);
    const int y0 = (int)ceil(y - reach_y), y1 = (int)floor(y + reach_y);
    int total = 0;

    w->n = 0;
    w->middle[0] = x;
    w->middle[1] = y;
    if (!(half_u > 0) || !(half_v > 0) || x1 - x0 >= MAX_SIDE || y1 - y0 >= MAX_SIDE)
        return false;
    for (int j = y0; j <= y1; j++) {
        for (int i = x0; i <= x1; i++) {
            const double dx = i - x, dy = j - y;
            const double u = (s[3] * dx - s[1] * dy) / det, v = (s[0] * dy - s[2] * dx) / det;
            const double weight = taper(u, half_u) * taper(v, half_v);

            if (!(weight > 0) || (u * v * place->core_sign > 0 && fabs(u) > core_u && fabs(v) > core_v))
                continue;
            total++;
            if (i < 0 || j < 0 || i >= luma->width || j >= luma->height)
                continue;
            w->dx[w->n] = (float)dx;
            w->dy[w->n] = (float)dy;
            w->grey[w->n] = sst_map_u8_row(luma, j)[i];
            w->weight[w->n++] = (float)weight;
        }
    }
    return w->n >= 24 && 4 * w->n >= 3 * total;
}

/* --- the model --------------------------------------------------------------------------------------------------- */

struct edge {
    double t, p, slope; /* distance in widths, P(t), dP/dt */
};

static struct edge edge_at(double t)
{
    struct edge e = { t, t < 0 ? -1 : 1, 0 };

    if (fabs(t) < FAR) {
        /* erf to 1.5e-7 with the exponential that is needed anyway (Hastings 1955, sheet 43). */
        const double bell = exp(-t * t / 2), k = 1 / (1 + 0.3275911 * M_SQRT1_2 * fabs(t));
        const double tail =
            k * (0.254829592 + k * (-0.284496736 + k * (1.421413741 + k * (-1.453152027 + k * 1.061405429))));

        e.p = copysign(1 - tail * bell, t);
        e.slope = M_SQRT1_2 * M_2_SQRTPI * bell;
    }
    return e;
}

/* S and its derivatives by t1, t2 and the correlation c. */
static double crossing(const struct edge *a, const struct edge *b, double c, double by[3])
{
    const double f = a->slope * b->slope, aa = a->t * a->t - 1, bb = b->t * b->t - 1;
    const double series = c + c * c * a->t * b->t / 2 + c * c * c * aa * bb / 6;

    by[0] = a->slope * b->p + f * (c * c * b->t / 2 + c * c * c * a->t * bb / 3 - a->t * series);
    by[1] = b->slope * a->p + f * (c * c * a->t / 2 + c * c * c * b->t * aa / 3 - b->t * series);
    by[2] = f * (1 + c * a->t * b->t + c * c * aa * bb / 2);
    return a->p * b->p + f * series;
}

/* Effect of the model's parameters on every pixel. */
struct pose {
    const double *q;
    double ca, sa, cb, sb, wa, wb; /* cosine and sine of the edges' angles, 1 / widths */
};

static struct pose pose_of(const double q[PARAMETERS])
{
    return (struct pose){
        q, cos(q[ANGLE1]), sin(q[ANGLE1]), cos(q[ANGLE2]), sin(q[ANGLE2]), exp(-q[BLUR1]), exp(-q[BLUR2])
    };
}

/* The model's grey at a pixel, and its derivatives; by[0 .. SKEW] are all 0 where first is LEVEL. */
static double model(const struct pose *m, double dx, double dy, double by[PARAMETERS], int *first)
{
    const double *q = m->q, x = dx - q[X], y = dy - q[Y];
    const struct edge a = edge_at(m->wa * (m->ca * x + m->sa * y)), b = edge_at(m->wb * (m->cb * x + m->sb * y));
    const double light = 1 + q[LIGHT_X] * dx + q[LIGHT_Y] * dy, lit = light * q[CONTRAST];
    double s = a.p * b.p, d[3], grey;

    *first = LEVEL;
    if (a.slope > 0 || b.slope > 0) {
        *first = X;
        s = crossing(&a, &b, q[SKEW], d);
        by[X] = -lit * (d[0] * m->wa * m->ca + d[1] * m->wb * m->cb);
        by[Y] = -lit * (d[0] * m->wa * m->sa + d[1] * m->wb * m->sb);
        by[ANGLE1] = lit * d[0] * m->wa * (m->ca * y - m->sa * x);
        by[ANGLE2] = lit * d[1] * m->wb * (m->cb * y - m->sb * x);
        by[BLUR1] = -lit * d[0] * a.t;
        by[BLUR2] = -lit * d[1] * b.t;
        by[SKEW] = lit * d[2];
    }
    grey = q[LEVEL] + q[CONTRAST] * s;
    by[LEVEL] = light;
    by[CONTRAST] = light * s;
    by[LIGHT_X] = grey * dx;
    by[LIGHT_Y] = grey * dy;
    return light * grey;
}

/* Priors, one more measurement each: value and 1 / sigma. They keep parameters that the window does not determine (the
 * width of an edge between two pixels) from diverging. */
static const double prior_value[PARAMETERS] = { [BLUR1] = -0.2, [BLUR2] = -0.2 };
static const double prior_weight[PARAMETERS] = {
    [BLUR1] = 1 / 0.7, [BLUR2] = 1 / 0.7, [SKEW] = 1 / 0.4, [LIGHT_X] = 1 / 0.005, [LIGHT_Y] = 1 / 0.005
};

/* Normal equations a step = b at q. noise2: variance of a grey value. @return the sum of squares */
static double equations(const struct window *w, const double q[PARAMETERS], double noise2,
                        double a[PARAMETERS * PARAMETERS], double b[PARAMETERS])
{
    const struct pose m = pose_of(q);
    double sum = 0, by[PARAMETERS];

    memset(a, 0, PARAMETERS * PARAMETERS * sizeof(*a));
    memset(b, 0, PARAMETERS * sizeof(*b));
    for (int i = 0; i < w->n; i++) {
        int first;
        const double off = w->grey[i] - model(&m, w->dx[i], w->dy[i], by, &first), weight = w->weight[i];

        sum += weight * off * off;
        for (int j = first; j < PARAMETERS; j++) {
            const double scaled = weight * by[j];

            for (int k = first; k <= j; k++)
                a[PARAMETERS * j + k] += scaled * by[k];
            b[j] += scaled * off;
        }
    }
    for (int j = BLUR1; j < PARAMETERS; j++) {
        const double off = prior_value[j] - q[j], weight = noise2 * prior_weight[j] * prior_weight[j];

        sum += weight * off * off;
        a[PARAMETERS * j + j] += weight;
        b[j] += weight * off;
    }
    return sum;
}

/* --- the fit ----------------------------------------------------------------------------------------------------- */

/* Clamp the bounded parameters: an edge between two pixels hardly determines its width, and three terms of the series
 * hold up to MAX_SKEW. @return false: not finite, or far away */
static bool limit(double q[PARAMETERS])
{
    q[BLUR1] = sst_clamp_double(q[BLUR1], log(MIN_BLUR_PX), log(MAX_BLUR_PX));
    q[BLUR2] = sst_clamp_double(q[BLUR2], log(MIN_BLUR_PX), log(MAX_BLUR_PX));
    q[SKEW] = sst_clamp_double(q[SKEW], -MAX_SKEW, MAX_SKEW);
    q[LIGHT_X] = sst_clamp_double(q[LIGHT_X], -MAX_SLOPE, MAX_SLOPE);
    q[LIGHT_Y] = sst_clamp_double(q[LIGHT_Y], -MAX_SLOPE, MAX_SLOPE);
    for (int i = 0; i < PARAMETERS; i++) {
        if (!isfinite(q[i]))
            return false;
    }
    return fmax(fabs(q[X]), fabs(q[Y])) < MAX_SIDE;
}

/* Levenberg-Marquardt descent from q until a step moves the point by less than enough_px. @return the sum of squares */
static double descend(const struct window *w, double q[PARAMETERS], double noise2, double enough_px)
{
    double a[2][PARAMETERS * PARAMETERS], b[2][PARAMETERS], damping = 1e-3;
    int at = 0;
    double sum = equations(w, q, noise2, a[0], b[0]);

    for (int round = 0; round < ROUNDS && damping < 1e6; round++) {
        double m[PARAMETERS * PARAMETERS], step[PARAMETERS], next[PARAMETERS] = { 0 }, moved = 0, to = INFINITY;

        memcpy(m, a[at], sizeof(m));
        memcpy(step, b[at], sizeof(step));
        for (int i = 0; i < PARAMETERS; i++)
            m[PARAMETERS * i + i] = m[PARAMETERS * i + i] * (1 + damping) + 1e-12;
        if (sst_numbers_solve(m, step, PARAMETERS)) {
            for (int i = 0; i < PARAMETERS; i++)
                next[i] = q[i] + step[i];
            moved = hypot(step[X], step[Y]);
            if (limit(next))
                to = equations(w, next, noise2, a[!at], b[!at]);
        }
        if (to < sum) {
            memcpy(q, next, sizeof(next));
            sum = to;
            at = !at;
            damping = fmax(damping / 8, 1e-9);
        } else {
            damping *= 8;
        }
        if (moved > 0 && moved < enough_px && damping < 0.1)
            break;
    }
    return sum;
}

/* Initial greys: means of both diagonals' quadrants. */
static void begin(double q[PARAMETERS], const struct window *w, const struct saddle_place *place, double blur_px)
{
    const double *s = place->slope;
    double sum[2] = { 0, 0 }, n[2] = { 0, 0 };

    memset(q, 0, PARAMETERS * sizeof(*q));
    q[ANGLE1] = atan2(-s[1], s[3]); /* u grows this way */
    q[ANGLE2] = atan2(s[0], -s[2]);
    q[BLUR1] = q[BLUR2] = log(blur_px);
    for (int i = 0; i < w->n; i++) {
        const double u = s[3] * w->dx[i] - s[1] * w->dy[i], v = s[0] * w->dy[i] - s[2] * w->dx[i];

        sum[u * v > 0] += w->weight[i] * w->grey[i];
        n[u * v > 0] += w->weight[i];
    }
    q[LEVEL] = (sum[0] / fmax(n[0], 1e-9) + sum[1] / fmax(n[1], 1e-9)) / 2;
    q[CONTRAST] = sum[1] / fmax(n[1], 1e-9) - q[LEVEL];
}

/* Expected error of the position from the inverse of the normal equations. */
static bool expected(double *noise_px, const struct window *w, const double q[PARAMETERS], double noise2)
{
    double a[PARAMETERS * PARAMETERS], b[PARAMETERS], m[PARAMETERS * PARAMETERS], variance = 0;

    equations(w, q, noise2, a, b);
    for (int k = X; k <= Y; k++) {
        double unit[PARAMETERS] = { 0 };

        memcpy(m, a, sizeof(m));
        unit[k] = 1;
        if (!sst_numbers_solve(m, unit, PARAMETERS))
            return false;
        variance += unit[k];
    }
    *noise_px = sqrt(noise2 * variance / 2);
    return isfinite(*noise_px);
}

/* The point spread with the fitted widths across the two edges and their correlation: with the normals n1, n2 of the
 * edges, n1' B n1 = s1^2, n2' B n2 = s2^2, n1' B n2 = c s1 s2. */
static void spread(struct saddle *out, const double q[PARAMETERS])
{
    const double n[4] = { cos(q[ANGLE1]), sin(q[ANGLE1]), cos(q[ANGLE2]), sin(q[ANGLE2]) };
    const double det = n[0] * n[3] - n[1] * n[2], s1 = exp(q[BLUR1]), s2 = exp(q[BLUR2]);
    const double i[4] = { n[3] / det, -n[1] / det, -n[2] / det, n[0] / det }; /* inverse of N = (n1; n2) */
    const double c = q[SKEW] * s1 * s2;

    /* B = N^-1 C N^-T */
    out->blur_xx = i[0] * i[0] * s1 * s1 + 2 * i[0] * i[1] * c + i[1] * i[1] * s2 * s2;
    out->blur_xy = i[0] * i[2] * s1 * s1 + (i[0] * i[3] + i[1] * i[2]) * c + i[1] * i[3] * s2 * s2;
    out->blur_yy = i[2] * i[2] * s1 * s1 + 2 * i[2] * i[3] * c + i[3] * i[3] * s2 * s2;
}

static double angle_between(double a, double b)
{
    return fabs(remainder(a - b, 2 * M_PI));
}

/* True if the result matches the requested point. */
static bool plausible(const struct saddle *s, const double q[PARAMETERS], const double start[PARAMETERS],
                      const struct saddle_place *place, double reach_window_px)
{
    return q[CONTRAST] * place->sign > 4 && fabs(q[CONTRAST]) > 2.5 * s->left_over &&
           hypot(s->x - place->x, s->y - place->y) <= place->reach_px &&
           angle_between(q[ANGLE1], start[ANGLE1]) < 0.3 && angle_between(q[ANGLE2], start[ANGLE2]) < 0.3 &&
           fabs(sin(q[ANGLE1] - q[ANGLE2])) > 0.2 && exp(fmax(q[BLUR1], q[BLUR2])) < 0.6 * reach_window_px;
}

static bool usable(const struct saddle_place *place)
{
    double sum = place->x + place->y;

    for (int i = 0; i < 4; i++)
        sum += place->slope[i];
    return isfinite(sum) && fabs(place->x) < 1e6 && fabs(place->y) < 1e6 &&
           place->slope[0] * place->slope[3] - place->slope[1] * place->slope[2] > 1e-12;
}

/* Fit once in a window around the current estimate. */
static bool fit(struct saddle *s, double q[PARAMETERS], struct window *w, double *noise2, double enough_px)
{
    double weights = 0, sum = descend(w, q, *noise2, enough_px);

    for (int i = 0; i < w->n; i++)
        weights += w->weight[i];
    *noise2 = fmax(sum / weights * w->n / sst_max_int(w->n - PARAMETERS, 1), 0.1);
    s->x = w->middle[0] + q[X];
    s->y = w->middle[1] + q[Y];
    return isfinite(s->x + s->y);
}

bool saddle_refine(struct saddle *out, const struct sst_map_u8 *luma, const struct saddle_place *place,
                   double largest_px)
{
    double q[PARAMETERS] = { 0 }, start[PARAMETERS], noise2 = 4, reach;
    struct saddle s = { .x = place->x, .y = place->y };
    struct window w;

    if (!usable(place) || !collect(&w, luma, place, (const double[2]){ s.x, s.y }, largest_px))
        return false;
    reach =
        fmin(place->half_mm * sqrt(place->slope[0] * place->slope[3] - place->slope[1] * place->slope[2]), largest_px);
    begin(q, &w, place, fmax(1, reach / 6));
    memcpy(start, q, sizeof(start));
    if (!(q[CONTRAST] * place->sign > 4) || !fit(&s, q, &w, &noise2, 0.02) ||
        hypot(s.x - place->x, s.y - place->y) > place->reach_px)
        return false;
    /* Second fit: the window is centred on the point, the blur known. */
    q[LEVEL] *= 1 + q[LIGHT_X] * q[X] + q[LIGHT_Y] * q[Y];
    q[X] = q[Y] = 0;
    if (!collect(&w, luma, place, (const double[2]){ s.x, s.y }, largest_px) || !fit(&s, q, &w, &noise2, 5e-4))
        return false;
    s.angle[0] = q[ANGLE1];
    s.angle[1] = q[ANGLE2];
    s.contrast = q[CONTRAST];
    s.left_over = sqrt(noise2);
    spread(&s, q);
    if (!plausible(&s, q, start, place, reach) || !expected(&s.noise_px, &w, q, noise2))
        return false;
    *out = s;
    return true;
}
