/* Solved positions compared with the grid's order, and with the drives of a rig. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calibration/solve/solve_internal.h"

#define MOST_SCALE    0.03 /* larger scale error between drives and board: one is wrong */
#define EXCHANGE_GAIN 10   /* exchanging two cameras reduces the sum of squares by this factor */
#define PLACE_SHARE   0.25 /* ... and fits the grid to this fraction of a step */

void solve_centre(const struct solve_camera *camera, double out[3])
{
    struct solve_pose back;

    solve_pose_inverse(&back, &camera->pose);
    memcpy(out, back.shift, sizeof(back.shift));
}

/* --- swapped cameras ---------------------------------------------------------------------------------------------- */

struct places {
    int views, cols;
    double (*centre)[3]; /* [views] */
    bool *known;
};

/* Regular grid through the centres, at + col step_x + row step_y by axis; a and b exchanged (or equal). @return
 * residual sum of squares, mm^2; negative: cameras on a line */
static double fit_grid(const struct places *p, int a, int b, double grid[3][3])
{
    double m[9] = { 0 }, sum = 0;

    memset(grid, 0, 9 * sizeof(double));
    for (int v = 0; v < p->views; v++) {
        const int from = v == a ? b : v == b ? a : v;
        const double j[3] = { 1, v % p->cols, v / p->cols };

        for (int i = 0; i < 9 && p->known[v]; i++) {
            m[i] += j[i / 3] * j[i % 3];
            grid[i / 3][i % 3] += j[i % 3] * p->centre[from][i / 3];
        }
    }
    for (int i = 0; i < 3; i++) /* a grid of one row or column has no step along the other */
        m[4 * i] += 1e-9;
    if (!solve_cholesky(m, 3))
        return -1;
    for (int axis = 0; axis < 3; axis++)
        sst_numbers_substitute(m, 3, grid[axis]);
    for (int i = 0; i < 3 * p->views; i++) {
        const int v = i / 3, axis = i % 3, from = v == a ? b : v == b ? a : v;
        const double d =
            p->centre[from][axis] - grid[axis][0] - grid[axis][1] * (v % p->cols) - grid[axis][2] * (v / p->cols);

        sum += p->known[v] ? d * d : 0;
    }
    return sum;
}

/* The pair that, exchanged, makes the centres a regular grid. */
static int check_exchanged(const struct solve_case *c, const struct places *p, int count)
{
    double grid[3][3], least, step2 = INFINITY;
    const double as_named = fit_grid(p, 0, 0, grid);
    int one = -1, other = -1;
    char first[128], second[128];

    least = as_named / EXCHANGE_GAIN;
    for (int a = 0; a < p->views; a++) {
        for (int b = a + 1; b < p->views; b++) {
            double left = p->known[a] && p->known[b] ? fit_grid(p, a, b, grid) : -1;

            if (left < 0 || !(left < least))
                continue;
            least = left;
            one = a;
            other = b;
        }
    }
    if (one < 0)
        return 0;
    least = fit_grid(p, one, other, grid);
    for (int i = 1; i <= 2; i++) {
        const double step = grid[0][i] * grid[0][i] + grid[1][i] * grid[1][i] + grid[2][i] * grid[2][i];

        step2 = i == 1 ? (c->all->cols > 1 ? step : INFINITY) : c->all->rows > 1 ? fmin(step2, step) : step2;
    }
    if (!(least / count < PLACE_SHARE * PLACE_SHARE * step2))
        return 0;
    return solve_reject(c->cfg,
                        "%s and %s are swapped: exchanged, all cameras are within %.2g mm of a regular "
                        "grid, as named within %.3g mm; swap their places in the configuration, or their folders",
                        solve_name(c->all, one, first), solve_name(c->all, other, second), sqrt(least / count),
                        sqrt(as_named / count));
}

/* Columns count to the right and rows downwards, seen from behind; a mirrored grid has wrong names. */
static void check_order(const struct solve_case *c, const struct places *p)
{
    double grid[3][3];

    if (c->all->rows < 2 || c->all->cols < 2 || fit_grid(p, 0, 0, grid) < 0)
        return;
    if (grid[0][1] * grid[1][2] - grid[0][2] * grid[1][1] < 0)
        sst_log_warning(
            "the cameras' grid is mirrored: seen from behind, columns must count from left to right and rows "
            "from top to bottom; rename the cameras if that was meant");
}

int solve_check_places(struct solve_case *c)
{
    const size_t views = (size_t)c->p.views;
    struct places p = { .views = c->p.views,
                        .cols = c->all->cols,
                        .centre = calloc(views, sizeof(*p.centre)),
                        .known = calloc(views, sizeof(*p.known)) };
    int count = 0, err = p.centre && p.known ? 0 : -ENOMEM;

    for (int v = 0; v < c->p.views && !err; v++) {
        p.known[v] = c->p.camera[v].known;
        count += p.known[v];
        if (p.known[v])
            solve_centre(&c->p.camera[v], p.centre[v]);
    }
    if (!err && count >= 5)
        err = check_exchanged(c, &p, count);
    if (!err && count >= 4)
        check_order(c, &p);
    free(p.centre);
    free(p.known);
    return err;
}

/* --- drives ------------------------------------------------------------------------------------------------------- */

/* Rotation from `from` to `to` (least squares, both about 0), by Gauss-Newton from an initial guess along three axes;
 * for collinear points the rotation about their line stays as it is. */
static void align(const double (*from)[3], const double (*to)[3], const bool *known, int n, double rotation[9])
{
    static const double start[4][3] = { { 0, 0, 0 }, { M_PI, 0, 0 }, { 0, M_PI, 0 }, { 0, 0, M_PI } };
    double best = INFINITY;

    for (int s = 0; s < 4; s++) {
        double r[9], cost = 0;

        sst_rotation_from_vector(start[s], r);
        for (int step = 0; step < 50; step++) {
            double a[9] = { 0 }, g[3] = { 0 }, by[9];

            cost = 0;
            for (int v = 0; v < n; v++) {
                double p[3], d[3];

                if (!known[v])
                    continue;
                sst_numbers_apply3(r, from[v], p);
                for (int i = 0; i < 3; i++)
                    d[i] = to[v][i] - p[i];
                cost += d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                g[0] += p[1] * d[2] - p[2] * d[1];
                g[1] += p[2] * d[0] - p[0] * d[2];
                g[2] += p[0] * d[1] - p[1] * d[0];
                for (int i = 0; i < 9; i++)
                    a[i] += (i % 4 == 0) * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - p[i / 3] * p[i % 3];
            }
            for (int i = 0; i < 3; i++)
                a[4 * i] += 1e-9 * (a[0] + a[4] + a[8]) + 1e-12;
            if (!solve_cholesky(a, 3))
                break;
            sst_numbers_substitute(a, 3, g);
            sst_rotation_from_vector(g, by);
            sst_numbers_mul3(by, r, r);
            if (fabs(g[0]) + fabs(g[1]) + fabs(g[2]) < 1e-12)
                break;
        }
        if (cost < best) {
            best = cost;
            memcpy(rotation, r, sizeof(r));
        }
    }
}

/* Angle between the solved rows and columns minus 90 degrees; drives are assumed to be square. */
static double skew(const double (*centre)[3], const double (*drive)[3], const bool *known, int n)
{
    double a[9] = { 0 }, b[3][3] = { { 0 } }, dot = 0, x = 0, y = 0;

    for (int v = 0; v < n; v++) {
        for (int i = 0; i < 9 && known[v]; i++) {
            a[i] += drive[v][i / 3] * drive[v][i % 3];
            b[i / 3][i % 3] += drive[v][i % 3] * centre[v][i / 3];
        }
    }
    if (!(a[0] > 1) || !(a[4] > 1) || !(a[0] * a[4] - a[1] * a[3] > 1e-6 * a[0] * a[4]))
        return NAN; /* moved along one axis only */
    a[8] += 1e-9 * (a[0] + a[4]);
    if (!solve_cholesky(a, 3))
        return NAN;
    for (int axis = 0; axis < 3; axis++) {
        sst_numbers_substitute(a, 3, b[axis]);
        dot += b[axis][0] * b[axis][1];
        x += b[axis][0] * b[axis][0];
        y += b[axis][1] * b[axis][1];
    }
    return x > 0 && y > 0 ? acos(sst_clamp_double(dot / sqrt(x * y), -1, 1)) * 180 / M_PI - 90 : NAN;
}

/* Both sets of positions about their means. @return number of common views */
static int centred(const struct solve_case *c, double (*centre)[3], double (*drive)[3], bool *known)
{
    double mean[2][3] = { { 0 } };
    int n = 0;

    for (int v = 0; v < c->p.views; v++) {
        const double *d = c->all->drive_mm[v];

        known[v] = c->p.camera[v].known && isfinite(d[0]) && isfinite(d[1]) && isfinite(d[2]);
        if (!known[v])
            continue;
        n++;
        solve_centre(&c->p.camera[v], centre[v]);
        memcpy(drive[v], d, 3 * sizeof(*d));
        for (int i = 0; i < 3; i++) {
            mean[0][i] += centre[v][i];
            mean[1][i] += drive[v][i];
        }
    }
    for (int v = 0; v < c->p.views; v++) {
        for (int i = 0; i < 3 && known[v]; i++) {
            centre[v][i] -= mean[0][i] / n;
            drive[v][i] -= mean[1][i] / n;
        }
    }
    return n;
}

static int judge_scale(const struct solve_case *c, double scale)
{
    const double square = c->all->board.square_mm;

    if (fabs(scale - 1) <= MOST_SCALE)
        return 0;
    return solve_reject(
        c->cfg,
        "the positions are %.3g times the drives': is the board's square %.4g mm instead of %.4g mm, or "
        "the drives' scale wrong?",
        scale, square / scale, square);
}

int solve_compare_drives(struct solve_case *c)
{
    const size_t views = (size_t)c->p.views;
    double(*centre)[3], (*drive)[3], top = 0, bottom = 0, sum = 0, rotation[9];
    bool *known;
    int n, err = -ENOMEM;

    if (!c->all->drive_mm)
        return 0;
    centre = calloc(views, sizeof(*centre));
    drive = calloc(views, sizeof(*drive));
    known = calloc(views, sizeof(*known));
    c->s.drive_residual_mm = calloc(views, sizeof(*c->s.drive_residual_mm));
    if (!centre || !drive || !known || !c->s.drive_residual_mm)
        goto out;
    err = 0;
    n = centred(c, centre, drive, known);
    align((const double(*)[3])drive, (const double(*)[3])centre, known, c->p.views, rotation);
    for (int v = 0; v < c->p.views; v++) {
        double at[3];

        if (!known[v])
            continue;
        sst_numbers_apply3(rotation, drive[v], at);
        for (int i = 0; i < 3; i++) {
            top += at[i] * centre[v][i];
            bottom += at[i] * at[i];
            c->s.drive_residual_mm[v][i] = centre[v][i] - at[i];
            sum += c->s.drive_residual_mm[v][i] * c->s.drive_residual_mm[v][i];
        }
    }
    if (n < 2 || !(bottom > 1e-6))
        goto out; /* nothing to compare */
    c->s.drive_rms_mm = sqrt(sum / n);
    c->s.drive_scale = top / bottom;
    c->s.drive_skew_deg = skew((const double(*)[3])centre, (const double(*)[3])drive, known, c->p.views);
    err = judge_scale(c, c->s.drive_scale);
out:
    free(centre);
    free(drive);
    free(known);
    return err;
}
