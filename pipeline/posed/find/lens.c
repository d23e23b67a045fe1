/* Fit of one lens and of rotations to places on a plane that views see. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/find/find_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/camera/numbers.h"
#include "pipeline/posed/surface_internal.h"

#define ROUNDS      15
#define LOSS_PX     1.0  /* of Cauchy's loss */
#define SIGMA_FOCAL 0.05 /* priors: lenses are within this of their maker's focal length, ... */
#define SIGMA_K1    0.2
#define SIGMA_RAISE 0.05 /* planes of their distance, ... */
#define SIGMA_SLOPE 0.1  /* and level */
#define SHARED      4    /* unknowns of all: two of the lens, two slopes */
#define OWN         9    /* unknowns of a sight: these, three of its view, two of its place */
#define TINY        1e-6

struct fit {
    struct lens_fit *f;
    int n;       /* unknowns: four shared ones, three of each view, two of each place */
    double *a;   /* [n][n] */
    double *b;   /* [n] */
    double away; /* mm: mean distance of the places */
};

/* Place after steps of the plane and along it. @param shared  [SHARED] @param along  [2], in mean distances */
static void move_place(double at[3], const struct fit *t, const double *shared, const double *along)
{
    const struct lens_fit *f = t->f;
    double apart[3], raise = f->plane_moves ? shared[0] * t->away : 0;

    for (int c = 0; c < 2; c++) {
        raise -= along[c] * t->away * f->slope[c];
        for (int i = 0; i < 3; i++)
            at[i] += along[c] * t->away * f->across[c][i];
    }
    for (int i = 0; i < 3; i++)
        apart[i] = at[i] - f->pivot_mm[i];
    for (int c = 0; c < 2; c++)
        raise -= shared[2 + c] * vector_dot(apart, f->across[c]);
    for (int i = 0; i < 3; i++)
        at[i] += raise * f->normal[i];
}

/* Pixel of a place in a view. @param change  of the sight's own unknowns */
static bool project(const struct fit *t, const struct lens_sight *s, const double change[OWN], double px[2])
{
    const struct lens_fit *f = t->f;
    const struct sst_calib_camera *cam = &f->camera[s->view];
    const double *turn = change + SHARED;
    double at[3], p[3], scale, r2, x, y, k1 = f->k1 + change[1];

    memcpy(at, f->place_mm[s->place], sizeof(at));
    move_place(at, t, change, change + SHARED + 3);
    for (int i = 0; i < 3; i++)
        at[i] -= cam->position_mm[i];
    sst_numbers_apply3(cam->rotation, at, p);
    at[0] = p[0] + turn[1] * p[2] - turn[2] * p[1];
    at[1] = p[1] + turn[2] * p[0] - turn[0] * p[2];
    at[2] = p[2] + turn[0] * p[1] - turn[1] * p[0];
    if (!(at[2] > 0))
        return false;
    x = at[0] / at[2];
    y = at[1] / at[2];
    r2 = x * x + y * y;
    scale = f->focal * (f->plane_moves ? 1 : exp(change[0])) * (1 + k1 * r2);
    sst_camera_distort(cam, scale * x, scale * y, &px[0], &px[1]);
    return isfinite(px[0]) && isfinite(px[1]);
}

static int unknown_of(const struct lens_fit *f, const struct lens_sight *s, int own)
{
    const int of_view = own - SHARED, of_place = of_view - 3;

    return of_view < 0 ? own : SHARED + (of_place < 0 ? 3 * s->view + of_view : 3 * f->views + 2 * s->place + of_place);
}

/* Pixel of a sight's place, and its slopes by the sight's own unknowns. @return false: it is behind the view */
static bool slopes(const struct fit *t, const struct lens_sight *s, double px[2], double by[2][OWN])
{
    if (!project(t, s, (double[OWN]){ 0 }, px))
        return false;
    for (int i = 0; i < OWN; i++) {
        double more[2], less[2], change[OWN] = { 0 };

        change[i] = TINY;
        if (!project(t, s, change, more))
            return false;
        change[i] = -TINY;
        if (!project(t, s, change, less))
            return false;
        for (int c = 0; c < 2; c++)
            by[c][i] = i < 2 && !t->f->free_lens ? 0 : (more[c] - less[c]) / (2 * TINY);
    }
    return true;
}

static double weight_of(const struct lens_sight *s, const double off[2])
{
    return s->weight / (1 + (off[0] * off[0] + off[1] * off[1]) / (LOSS_PX * LOSS_PX));
}

/* Add a sight to the normal equations. @return false: its place is behind the view */
static bool add_sight(struct fit *t, const struct lens_sight *s)
{
    double px[2], by[2][OWN], off[2], weight;

    if (!slopes(t, s, px, by))
        return false;
    off[0] = s->x - px[0];
    off[1] = s->y - px[1];
    weight = weight_of(s, off);
    for (int i = 0; i < OWN; i++) {
        const int row = unknown_of(t->f, s, i);

        t->b[row] += weight * (by[0][i] * off[0] + by[1][i] * off[1]);
        for (int j = 0; j < OWN; j++)
            t->a[(size_t)row * (size_t)t->n + (size_t)unknown_of(t->f, s, j)] +=
                weight * (by[0][i] * by[0][j] + by[1][i] * by[1][j]);
    }
    return true;
}

static void add_prior(struct fit *t, int unknown, double off, double sigma)
{
    t->a[(size_t)unknown * (size_t)(t->n + 1)] += 1 / (sigma * sigma);
    t->b[unknown] -= off / (sigma * sigma);
}

/* Turn of a view from its given rotation. */
static void turn_of(double v[3], const struct lens_fit *f, int k)
{
    double turn[9];

    sst_rotation_between(f->camera[k].rotation, f->given[k], turn);
    sst_rotation_to_vector(turn, v);
}

/* Normal equations at the present state. @return false: a sight is behind its view */
static bool set_up(struct fit *t)
{
    struct lens_fit *f = t->f;

    memset(t->a, 0, (size_t)t->n * (size_t)t->n * sizeof(*t->a));
    memset(t->b, 0, (size_t)t->n * sizeof(*t->b));
    for (int s = 0; s < f->sights; s++) {
        if (!add_sight(t, &f->sight[s]))
            return false;
    }
    for (int c = 0; c < 2; c++)
        add_prior(t, 2 + c, f->slope[c], SIGMA_SLOPE);
    if (f->free_lens) {
        add_prior(t, 0, f->plane_moves ? f->raise_mm / t->away : log(f->focal),
                  f->plane_moves ? SIGMA_RAISE : SIGMA_FOCAL);
        add_prior(t, 1, f->k1, SIGMA_K1);
    }
    for (int k = 0; k < f->views; k++) {
        double v[3];

        turn_of(v, f, k);
        for (int i = 0; i < 3; i++)
            add_prior(t, SHARED + 3 * k + i, v[i], f->sigma_rad);
    }
    return true;
}

static void take_step(struct fit *t)
{
    struct lens_fit *f = t->f;

    f->raise_mm += f->plane_moves ? t->b[0] * t->away : 0;
    f->focal *= f->plane_moves ? 1 : exp(t->b[0]);
    f->k1 += t->b[1];
    for (int k = 0; k < f->views; k++) {
        double turn[9];

        sst_rotation_from_vector(t->b + SHARED + 3 * k, turn);
        sst_numbers_mul3(turn, f->camera[k].rotation, f->camera[k].rotation);
    }
    for (int p = 0; p < f->places; p++)
        move_place(f->place_mm[p], t, t->b, t->b + SHARED + 3 * f->views + 2 * (ptrdiff_t)p);
    for (int c = 0; c < 2; c++)
        f->slope[c] += t->b[2 + c];
}

/* Add a sight's pull at two combinations of the unknowns to the pulls of its view and of its place. */
static void add_pulls(double (*pull)[2], const struct fit *t, const struct lens_sight *s, const double *of[2])
{
    const struct lens_fit *f = t->f;
    double px[2], by[2][OWN], off[2], weight, sum[2] = { 0 };

    if (!slopes(t, s, px, by))
        return;
    off[0] = s->x - px[0];
    off[1] = s->y - px[1];
    weight = weight_of(s, off);
    for (int i = 0; i < OWN; i++) {
        const int unknown = unknown_of(f, s, i);

        for (int c = 0; c < 2; c++)
            sum[c] += weight * of[c][unknown] * (by[0][i] * off[0] + by[1][i] * off[1]);
    }
    for (int c = 0; c < 2; c++) {
        pull[s->view][c] += sum[c];
        pull[f->views + s->place][c] += sum[c];
    }
}

/* Worth of the lens in its standard errors. Sights of one place err alike, since persons are no points, and so do
 * the sights of one view: the larger sum of squares, by places or by views, counts. */
static int judge(struct fit *t)
{
    struct lens_fit *f = t->f;
    const double v[2] = { f->plane_moves ? 0 : log(f->focal), f->k1 };
    double(*pull)[2] = calloc((size_t)(f->views + f->places), sizeof(*pull));
    double *of = calloc(2 * (size_t)t->n, sizeof(*of)), cov[2][3] = { { 0 } }, det;

    if (!pull || !of) {
        free(pull);
        free(of);
        return -ENOMEM;
    }
    sst_numbers_factor(t->a, t->n);
    for (int c = 0; c < 2; c++) {
        of[c * t->n + c] = 1;
        sst_numbers_substitute(t->a, t->n, of + (ptrdiff_t)c * t->n);
    }
    for (int s = 0; s < f->sights; s++)
        add_pulls(pull, t, &f->sight[s], (const double *[2]){ of, of + t->n });
    for (int k = 0; k < f->views; k++) { /* given rotations err as well */
        double turn[3];

        turn_of(turn, f, k);
        for (int i = 0; i < 6; i++)
            pull[k][i / 3] -= of[i / 3 * t->n + SHARED + 3 * k + i % 3] * turn[i % 3] / (f->sigma_rad * f->sigma_rad);
    }
    for (int i = 0; i < f->views + f->places; i++) {
        for (int j = 0; j < 3; j++)
            cov[i >= f->views][j] += pull[i][j / 2] * pull[i][(j + 1) / 2];
    }
    for (int j = 0; j < 3; j++)
        cov[0][j] = cov[0][2] > cov[1][2] ? cov[0][j] : cov[1][j];
    det = cov[0][0] * cov[0][2] - cov[0][1] * cov[0][1];
    if (f->plane_moves)
        f->chi2 = cov[0][2] > 0 ? v[1] * v[1] / cov[0][2] : 0;
    else
        f->chi2 = det > 0 ? (v[0] * v[0] * cov[0][2] - 2 * v[0] * v[1] * cov[0][1] + v[1] * v[1] * cov[0][0]) / det : 0;
    free(pull);
    free(of);
    return 0;
}

static int find_median(struct fit *t)
{
    struct lens_fit *f = t->f;
    double *off = malloc((size_t)f->sights * sizeof(*off)), px[2];
    int n = 0;

    if (!off)
        return -ENOMEM;
    for (int s = 0; s < f->sights; s++) {
        if (project(t, &f->sight[s], (double[OWN]){ 0 }, px))
            off[n++] = hypot(f->sight[s].x - px[0], f->sight[s].y - px[1]);
    }
    f->median_px = n ? sst_stats_median(off, n) : 0;
    free(off);
    return 0;
}

int lens_fit(struct lens_fit *f)
{
    struct fit t = { .f = f, .n = SHARED + 3 * f->views + 2 * f->places };
    int err = 0;

    f->raise_mm = f->chi2 = 0;
    for (int s = 0; s < f->sights; s++) {
        const double *at = f->place_mm[f->sight[s].place], *from = f->camera[f->sight[s].view].position_mm;

        t.away += hypot(hypot(at[0] - from[0], at[1] - from[1]), at[2] - from[2]) / f->sights;
    }
    if (!(t.away > 0))
        return -EDOM;
    t.a = malloc((size_t)t.n * (size_t)t.n * sizeof(*t.a));
    t.b = malloc((size_t)t.n * sizeof(*t.b));
    if (!t.a || !t.b)
        err = -ENOMEM;
    for (int round = 0; round < ROUNDS && !err; round++) {
        err = set_up(&t) ? 0 : -EDOM;
        if (!err) {
            sst_numbers_solve(t.a, t.b, t.n); /* the lens is left out where it is not free */
            take_step(&t);
        }
    }
    if (!err && !(set_up(&t) && f->focal > 0.5 && f->focal < 2 && fabs(f->k1) < 1))
        err = -EDOM;
    if (!err)
        err = find_median(&t);
    if (!err && f->free_lens)
        err = judge(&t);
    free(t.a);
    free(t.b);
    return err;
}
