/* Cross-validation: frames held out, odd against even frames. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calibration/solve/solve_internal.h"

#define LEAST_FRAMES_HELD_OUT 12   /* fewer frames are not split */
#define MOST_FRAMES_HELD_OUT  48   /* more do not improve the choice: every second, third ... is used */
#define BETTER                0.99 /* required ratio of the held-out errors of 8 and 5 coefficients */
#define LEAST_FRAMES_CROSS    8
#define CENTRAL               0.8
#define MOST_CROSS_RATIO      2 /* lens difference over its uncertainty: once in 20 000 cameras by chance */

/* Select frames: the ones with a number of k modulo n among the known ones, or all others. */
static void keep_frames(struct solve_problem *p, int n, int k, bool others)
{
    int number = -1, last = -1;

    for (int i = 0; i < p->count; i++) {
        struct solve_detection *d = &p->detection[i];

        if (d->frame != last && p->frame[d->frame].known) {
            last = d->frame;
            number++;
        }
        d->used = d->used && (number % n == k) != others;
    }
}

static int count_frames(const struct solve_problem *p)
{
    int n = 0, last = -1;

    for (int i = 0; i < p->count; i++) {
        if (p->detection[i].used && p->detection[i].frame != last) {
            n++;
            last = p->detection[i].frame;
        }
    }
    return n;
}

/*
 * Solve the cameras from three quarters of some frames, then the poses of the other boards with these cameras fixed.
 * @param out  the latter problem
 */
static int hold_out(const struct solve_problem *p, int lens, struct solve_problem *out)
{
    const struct solve_adjust_config cfg = { .max_iterations = 40, .tolerance = 0.02 };
    const int every = (count_frames(p) + MOST_FRAMES_HELD_OUT - 1) / MOST_FRAMES_HELD_OUT;
    struct solve_problem held = { 0 }, train = { 0 };
    struct solve_adjusted done;
    int err = solve_problem_copy(&held, p);

    if (err)
        return err;
    held.lens = lens;
    keep_frames(&held, every, 0, false);
    err = solve_problem_copy(&train, &held);
    if (!err) {
        keep_frames(&train, 4 * every, every, true);
        err = solve_adjust(&train, &cfg, &done);
    }
    if (!err) {
        memcpy(held.camera, train.camera, (size_t)p->views * sizeof(*held.camera));
        memcpy(held.warp, train.warp, sizeof(held.warp));
        held.keep_cameras = held.keep_lens = held.keep_warp = true;
        keep_frames(&held, 4 * every, every, false);
        err = solve_adjust(&held, &cfg, &done);
    }
    solve_problem_fini(&train);
    if (err)
        solve_problem_fini(&held);
    else
        *out = held;
    return err;
}

/* RMS per point of both problems over the corners that are inliers of at least one. */
static int compare(const struct solve_problem p[2], double limit_px, double rms[2])
{
    double sum[2] = { 0 };
    int n = 0, most = 1;
    double(*r[2])[2];

    for (int i = 0; i < p[0].count; i++)
        most = sst_max_int(most, p[0].detection[i].corners);
    r[0] = malloc((size_t)most * sizeof(*r[0]));
    r[1] = malloc((size_t)most * sizeof(*r[1]));
    for (int i = 0; r[0] && r[1] && i < p[0].count; i++) {
        const struct solve_detection *d = &p[0].detection[i];

        if (!d->used)
            continue;
        for (int k = 0; k < 2; k++)
            solve_residuals(&p[k], d, r[k]);
        for (int c = 0; c < d->corners; c++) {
            const double a = hypot(r[0][c][0], r[0][c][1]), b = hypot(r[1][c][0], r[1][c][1]);

            if (!(d->corner[c].weight * fmin(a, b) <= limit_px))
                continue;
            sum[0] += a * a;
            sum[1] += b * b;
            n++;
        }
    }
    for (int k = 0; k < 2; k++)
        rms[k] = n ? sqrt(sum[k] / n) : 0;
    most = r[0] && r[1];
    free(r[0]);
    free(r[1]);
    return most ? 0 : -ENOMEM;
}

int solve_choose_lens(struct solve_case *c)
{
    struct solve_problem half[2] = { { 0 } };
    struct solve_adjusted done;
    int err;

    if (count_frames(&c->p) < LEAST_FRAMES_HELD_OUT)
        return 0;
    err = solve_hard(&c->p, c->cfg->plain, &c->sigma_px, &done);
    for (int k = 0; k < 2 && !err; k++)
        err = hold_out(&c->p, k ? 8 : 5, &half[k]);
    err = err ? err : compare(half, SOLVE_OUTLIER_SIGMA * c->sigma_px, c->s.held_out_px);
    solve_problem_fini(&half[0]);
    solve_problem_fini(&half[1]);
    if (err == -EDOM)
        return 0; /* three quarters do not suffice for one camera: keep the lens with fewer coefficients */
    if (err)
        return err;
    sst_log_info("held-out frames: %.4f px with 5 coefficients, %.4f px with 8", c->s.held_out_px[0],
                 c->s.held_out_px[1]);
    if (c->s.held_out_px[1] < BETTER * c->s.held_out_px[0]) {
        /* Corners that the lens with 5 coefficients could not explain may still be inliers. */
        c->p.lens = 8;
        for (int i = 0; i < c->p.count; i++) {
            struct solve_detection *d = &c->p.detection[i];

            d->used = c->single[i].known && c->p.camera[d->view].known && c->p.frame[d->frame].known;
            for (int k = 0; k < d->corners; k++)
                d->corner[k].out = false;
        }
        err = solve_soft(&c->p, &c->sigma_px);
    }
    return err;
}

/* Two lenses of a problem's cameras, and the share of the picture that they are compared in. */
struct lenses {
    const struct solve_problem *p;
    const double *a, *b;
    double share;
};

/* Pixels of lens b for the directions of a grid of lens a's pixels after a rotation: normal equations of the
 * residuals. */
static double turned_distance(const struct lenses *l, const double turn[9], double normal[9], double g[3])
{
    const struct solve_problem *p = l->p;
    const struct sst_calib_camera cam = solve_camera_of(l->a);
    double sum = 0;
    int n = 0;

    memset(normal, 0, 9 * sizeof(*normal));
    memset(g, 0, 3 * sizeof(*g));
    for (int i = 0; i < 21 * 16; i++) {
        const double x = (p->width - 1) / 2.0 + l->share * (i % 21 - 10) / 20.0 * (p->width - 1);
        const double y = (p->height - 1) / 2.0 + l->share * (i / 21 - 7.5) / 15.0 * (p->height - 1);
        double q[3] = { 0, 0, 1 }, xy[2];
        struct solve_slopes slopes;

        if (!sst_camera_undistort(&cam, x, y, &q[0], &q[1]))
            continue;
        sst_numbers_apply3(turn, q, q);
        solve_see(l->b, p->lens, q, xy, &slopes);
        xy[0] -= x;
        xy[1] -= y;
        for (int k = 0; k < 2; k++) {
            double j[6];

            solve_by_motion(slopes.q[k], q, 1, j);
            for (int m = 0; m < 9; m++)
                normal[m] += j[m / 3] * j[m % 3];
            for (int m = 0; m < 3; m++)
                g[m] -= j[m] * xy[k];
        }
        sum += xy[0] * xy[0] + xy[1] * xy[1];
        n++;
    }
    return n ? sqrt(sum / n) : 0;
}

double solve_lens_difference(const struct solve_problem *p, const double *a, const double *b, double share)
{
    const struct lenses lenses = { p, a, b, share };
    double turn[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, normal[9], g[3], by[9];

    for (int step = 0; step < 4; step++) {
        turned_distance(&lenses, turn, normal, g);
        if (!solve_cholesky(normal, 3))
            break;
        sst_numbers_substitute(normal, 3, g);
        sst_rotation_from_vector(g, by);
        sst_numbers_mul3(by, turn, turn);
    }
    return turned_distance(&lenses, turn, normal, g);
}

static int solve_half(const struct solve_problem *p, int rest, struct solve_problem *half, struct solve_covariance *cov)
{
    const struct solve_adjust_config cfg = { .max_iterations = 40, .tolerance = 1e-3 };
    struct solve_adjusted done;
    int err = solve_problem_copy(half, p);

    if (err)
        return err;
    keep_frames(half, 2, rest, false);
    err = solve_adjust(half, &cfg, &done);
    return err ? err : solve_covariances(cov, half, solve_unit_sigma(&done));
}

/* Root of the mean square difference of two lenses in units of its uncertainty: sqrt(d' (A + B)^-1 d / n). */
static double lens_distance(const struct solve_problem half[2], const struct solve_covariance cov[2], int view)
{
    const int n = 4 + half[0].lens;
    double m[SOLVE_LENS_MAX * SOLVE_LENS_MAX], d[SOLVE_LENS_MAX], x[SOLVE_LENS_MAX], sum = 0;

    for (int i = 0; i < n; i++) {
        d[i] = x[i] = half[1].camera[view].lens[i] - half[0].camera[view].lens[i];
        for (int j = 0; j < n; j++) {
            m[i * n + j] = 0;
            for (int k = 0; k < 2; k++)
                m[i * n + j] += cov[k].m[(size_t)(cov[k].layout.lens[view] + i) * (size_t)cov[k].size +
                                         (size_t)(cov[k].layout.lens[view] + j)];
        }
    }
    if (!solve_cholesky(m, n))
        return 0;
    sst_numbers_substitute(m, n, x);
    for (int i = 0; i < n; i++)
        sum += d[i] * x[i];
    return sqrt(fmax(sum, 0) / n);
}

int solve_cross_validate(struct solve_case *c)
{
    struct solve_problem half[2] = { { 0 } };
    struct solve_covariance cov[2] = { { .size = 0 } };
    double worst = 0;
    int err = 0, worst_view = -1;
    char name[128];

    if (c->p.keep_lens || count_frames(&c->p) < LEAST_FRAMES_CROSS)
        return 0;
    for (int k = 0; k < 2 && !err; k++)
        err = solve_half(&c->p, k, &half[k], &cov[k]);
    for (int v = 0; v < c->p.views && !err; v++) {
        float map[2][SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS];
        double px, distance;

        if (cov[0].layout.lens[v] < 0 || cov[1].layout.lens[v] < 0)
            continue;
        distance = lens_distance(half, cov, v);
        if (distance > worst) {
            worst = distance;
            worst_view = v;
        }
        px = solve_lens_difference(&c->p, half[0].camera[v].lens, half[1].camera[v].lens, CENTRAL);
        if (c->s.cv_camera >= 0 && !(px > c->s.cv_px))
            continue;
        for (int k = 0; k < 2; k++)
            solve_lens_map(&half[k], &cov[k], v, CENTRAL, map[k]);
        c->s.cv_px = px;
        c->s.cv_expected_px =
            sqrt(2) * hypot(fmax(sst_uncertainty_rms(map[0]), 0), fmax(sst_uncertainty_rms(map[1]), 0));
        c->s.cv_camera = v;
    }
    for (int k = 0; k < 2; k++) {
        solve_problem_fini(&half[k]);
        solve_covariance_fini(&cov[k]);
    }
    if (err == -EDOM) {
        sst_log_warning("half of the frames do not determine all cameras: odd and even frames were not compared; take "
                        "more frames");
        return 0;
    }
    if (!err && worst > MOST_CROSS_RATIO)
        sst_log_warning(
            "odd and even frames give lenses of %s that differ by %.2g times what the corner noise explains "
            "(largest difference of all cameras %.2g px): something moves between frames, or the lens needs "
            "more coefficients",
            solve_name(c->all, worst_view, name), worst, c->s.cv_px);
    return err;
}
