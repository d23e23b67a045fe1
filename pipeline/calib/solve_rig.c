/* Solved places against what was known of them: the grid's order, and the drives of a rig. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calib/solve_parts.h"

#define MOST_SCALE   0.03 /* drives and board disagree on lengths by more: one of them is wrong */
#define PLACE_ROUNDS 20

void sst_solve_centre(const struct solve_camera *camera, double out[3])
{
    struct solve_pose back;

    sst_solve_pose_inverse(&back, &camera->pose);
    memcpy(out, back.shift, sizeof(back.shift));
}

/* --- cameras at each other's places --------------------------------------------------------------------------------
 */

/* Regular grid through the centres: at + col step_x + row step_y, by weights. */
static bool fit_grid(const double (*centre)[3], const bool *known, const double *weight, int views, int cols,
                     double grid[3][3])
{
    double a[9] = { 0 }, b[3][3] = { { 0 } };

    for (int v = 0; v < views; v++) {
        const double j[3] = { 1, v % cols, v / cols };

        for (int i = 0; i < 9 && known[v]; i++) {
            a[i] += weight[v] * j[i / 3] * j[i % 3];
            b[i / 3][i % 3] += weight[v] * j[i % 3] * centre[v][i / 3];
        }
    }
    for (int i = 0; i < 3; i++) /* a grid of one row or column has no step along the other */
        a[4 * i] += 1e-9;
    if (!sst_solve_cholesky(a, 3))
        return false;
    for (int axis = 0; axis < 3; axis++) {
        sst_solve_cholesky_solve(a, 3, b[axis]);
        memcpy(grid[axis], b[axis], sizeof(b[axis]));
    }
    return true;
}

static double off_grid(const double centre[3], double grid[3][3], int row, int col)
{
    double sum = 0;

    for (int axis = 0; axis < 3; axis++) {
        const double d = centre[axis] - grid[axis][0] - grid[axis][1] * col - grid[axis][2] * row;

        sum += d * d;
    }
    return sqrt(sum);
}

/* Pairs of which each camera stands where the other should. */
static int find_exchanged(const struct solve_case *c, const double (*centre)[3], const bool *known, double grid[3][3])
{
    const int cols = c->all->cols;
    char one[128], other[128];

    for (int a = 0; a < c->p.views; a++) {
        for (int b = a + 1; b < c->p.views; b++) {
            const double apart = off_grid((double[3]){ grid[0][0] + grid[0][1] * (a % cols) + grid[0][2] * (a / cols),
                                                       grid[1][0] + grid[1][1] * (a % cols) + grid[1][2] * (a / cols),
                                                       grid[2][0] + grid[2][1] * (a % cols) + grid[2][2] * (a / cols) },
                                          grid, b / cols, b % cols);

            if (known[a] && known[b] && off_grid(centre[a], grid, a / cols, a % cols) > 0.6 * apart &&
                off_grid(centre[b], grid, b / cols, b % cols) > 0.6 * apart &&
                off_grid(centre[a], grid, b / cols, b % cols) < 0.3 * apart &&
                off_grid(centre[b], grid, a / cols, a % cols) < 0.3 * apart)
                return sst_solve_refuse(
                    c->cfg,
                    "%s and %s stand at each other's places, %.3g mm from their own: exchange their "
                    "places in the configuration or their folders",
                    sst_solve_name(c->all, a, one), sst_solve_name(c->all, b, other), apart);
        }
    }
    return 0;
}

int sst_solve_check_places(struct solve_case *c)
{
    const size_t views = (size_t)c->p.views;
    double(*centre)[3] = calloc(views, sizeof(*centre)), *weight = malloc(views * sizeof(*weight)), grid[3][3];
    bool *known = calloc(views, sizeof(*known)), fine = true;
    int count = 0, err = centre && weight && known ? 0 : -ENOMEM;

    for (int v = 0; v < c->p.views && !err; v++) {
        known[v] = c->p.camera[v].known;
        count += known[v];
        weight[v] = 1;
        if (known[v])
            sst_solve_centre(&c->p.camera[v], centre[v]);
    }
    /* Sum of distances instead of squares, by weights: what most cameras agree on. */
    for (int round = 0; round < PLACE_ROUNDS && !err && fine && count >= 5; round++) {
        fine = fit_grid(centre, known, weight, c->p.views, c->all->cols, grid);
        for (int v = 0; v < c->p.views && fine; v++)
            weight[v] = 1 / fmax(off_grid(centre[v], grid, v / c->all->cols, v % c->all->cols), 1e-3);
    }
    if (!err && fine && count >= 5)
        err = find_exchanged(c, centre, known, grid);
    free(centre);
    free(weight);
    free(known);
    return err;
}

/* --- drives --------------------------------------------------------------------------------------------------------
 */

/* Rotation that turns `from` onto `to` best (least squares, both about 0), by Gauss and Newton from a first guess that
 * three axes give; points of one line leave the turn about it where it is. */
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
                sst_solve_apply3(r, from[v], p);
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
            if (!sst_solve_cholesky(a, 3))
                break;
            sst_solve_cholesky_solve(a, 3, g);
            sst_rotation_from_vector(g, by);
            sst_solve_mul3(by, r, r);
            if (fabs(g[0]) + fabs(g[1]) + fabs(g[2]) < 1e-12)
                break;
        }
        if (cost < best) {
            best = cost;
            memcpy(rotation, r, sizeof(r));
        }
    }
}

/* Angle between what the grid's rows and columns became, over 90 degrees; drives are taken as square. */
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
    if (!sst_solve_cholesky(a, 3))
        return NAN;
    for (int axis = 0; axis < 3; axis++) {
        sst_solve_cholesky_solve(a, 3, b[axis]);
        dot += b[axis][0] * b[axis][1];
        x += b[axis][0] * b[axis][0];
        y += b[axis][1] * b[axis][1];
    }
    return x > 0 && y > 0 ? acos(sst_clamp_double(dot / sqrt(x * y), -1, 1)) * 180 / M_PI - 90 : NAN;
}

/* Both about their means. @return views known to both */
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
        sst_solve_centre(&c->p.camera[v], centre[v]);
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
    return sst_solve_refuse(
        c->cfg,
        "the positions are %.3g times the drives': is the board's square %.4g mm instead of %.4g mm, or "
        "the drives' scale wrong?",
        scale, square / scale, square);
}

int sst_solve_compare_drives(struct solve_case *c)
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
    c->drive_residual_mm = calloc(views, sizeof(*c->drive_residual_mm));
    if (!centre || !drive || !known || !c->drive_residual_mm)
        goto out;
    err = 0;
    n = centred(c, centre, drive, known);
    align((const double(*)[3])drive, (const double(*)[3])centre, known, c->p.views, rotation);
    for (int v = 0; v < c->p.views; v++) {
        double at[3];

        if (!known[v])
            continue;
        sst_solve_apply3(rotation, drive[v], at);
        for (int i = 0; i < 3; i++) {
            top += at[i] * centre[v][i];
            bottom += at[i] * at[i];
            c->drive_residual_mm[v][i] = centre[v][i] - at[i];
            sum += c->drive_residual_mm[v][i] * c->drive_residual_mm[v][i];
        }
    }
    if (n < 2 || !(bottom > 1e-6))
        goto out; /* nowhere to compare */
    c->drive_rms_mm = sqrt(sum / n);
    c->drive_scale = top / bottom;
    c->drive_skew_deg = skew((const double(*)[3])centre, (const double(*)[3])drive, known, c->p.views);
    err = judge_scale(c, c->drive_scale);
out:
    free(centre);
    free(drive);
    free(known);
    return err;
}
