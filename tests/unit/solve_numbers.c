/* The solver's algebra and derivatives against hand-worked values and differences; its compressed rows against all. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/calibration/solve/solve_internal.h"
#include "tests/calib_truth.h"
#include "tests/test.h"

#define assert_near(a, b, within) assert_true(fabs((double)(a) - (double)(b)) <= (within))

static void algebra(void **state)
{
    double a[9] = { 4, 0, 0, 2, 5, 0, -2, 3, 14 }, x[3] = { 4, 10, 15 }, work[3]; /* lower half of a */

    (void)state;
    assert_true(solve_cholesky(a, 3)); /* L = 2; 1 2; -1 2 3 */
    assert_near(a[0], 2, 0);
    assert_near(a[3], 1, 0);
    assert_near(a[4], 2, 0);
    assert_near(a[6], -1, 0);
    assert_near(a[7], 2, 0);
    assert_near(a[8], 3, 0);
    sst_numbers_substitute(a, 3, x); /* A (1, 0.7273.., ...) checked by multiplying back */
    assert_near(4 * x[0] + 2 * x[1] - 2 * x[2], 4, 1e-14);
    assert_near(2 * x[0] + 5 * x[1] + 3 * x[2], 10, 1e-14);
    assert_near(-2 * x[0] + 3 * x[1] + 14 * x[2], 15, 1e-14);
    solve_cholesky_inverse(a, 3, work);
    for (int i = 0; i < 3; i++) {
        const double m[3][3] = { { 4, 2, -2 }, { 2, 5, 3 }, { -2, 3, 14 } };

        for (int j = 0; j < 3; j++) {
            double sum = 0;

            for (int k = 0; k < 3; k++)
                sum += m[i][k] * a[3 * k + j];
            assert_near(sum, i == j, 1e-14);
        }
    }
}

static void not_definite(void **state)
{
    double a[4] = { 1, 0, 1, 1 }, zero[1] = { 0 }, nan[1] = { NAN };

    (void)state;
    assert_false(solve_cholesky(a, 2)); /* singular */
    assert_false(solve_cholesky(zero, 1));
    assert_false(solve_cholesky(nan, 1));
}

/* R'R = A'A, also with fewer rows than columns, equal columns and zeros. */
static void triangle(void **state)
{
    uint64_t seed = 3;

    (void)state;
    for (int trial = 0; trial < 60; trial++) {
        const int n = 1 + trial % 7, m = 1 + trial / 7;
        double a[80], r[80];

        for (int i = 0; i < m * n; i++)
            a[i] = trial % 5 == 4 && i % n == n / 2 ? 0 : trial % 3 == 2 ? 1 + i / n : test_normal(&seed);
        memcpy(r, a, sizeof(r));
        solve_qr(r, m, n);
        for (int i = 0; i < n * n; i++) {
            double want = 0, got = 0;

            for (int k = 0; k < m; k++)
                want += a[k * n + i / n] * a[k * n + i % n];
            for (int k = 0; k < m && k < n; k++)
                got += r[k * n + i / n] * r[k * n + i % n];
            assert_near(want, got, 1e-12 * (1 + fabs(want)));
        }
        for (int i = 0; i < m && i < n; i++) {
            for (int j = 0; j < i; j++)
                assert_near(r[i * n + j], 0, 0);
        }
    }
}

/* exp(v + e) = exp(J e) exp(v) for small e, near 0 and near half a turn. */
static void left_jacobian(void **state)
{
    static const double at[][3] = { { 0, 0, 0 },        { 1e-5, -2e-5, 1e-6 }, { 0.004, 0.003, 0.005 },
                                    { 0.02, 0, -0.01 }, { 0.3, -0.8, 0.5 },    { 2, 2, 1.2 } };
    static const double e[3] = { 3e-7, -2e-7, 1e-7 };

    (void)state;
    for (size_t t = 0; t < ARRAY_LEN(at); t++) {
        double j[9], je[3], by[9], r[9], want[9], sum[3];

        solve_left_jacobian(at[t], j);
        sst_numbers_apply3(j, e, je);
        sst_rotation_from_vector(je, by);
        sst_rotation_from_vector(at[t], r);
        sst_numbers_mul3(by, r, r);
        for (int i = 0; i < 3; i++)
            sum[i] = at[t][i] + e[i];
        sst_rotation_from_vector(sum, want);
        for (int i = 0; i < 9; i++)
            assert_near(r[i], want[i], 1e-12);
    }
}

/* --- a problem with its true state ---------------------------------------------------------------------------------
 */

static void problem(struct solve_problem *p, const struct truth *t, const struct sst_solve_config *cfg)
{
    assert_int_equal(solve_problem_make(p, &t->all, cfg), 0);
    for (int v = 0; v < p->views; v++) {
        const struct sst_calib_camera *c = &t->calib.camera[v];
        struct solve_camera *to = &p->camera[v];

        to->known = true;
        memcpy(to->lens, &c->fx, 4 * sizeof(double));
        memcpy(to->lens + 4, c->k, sizeof(c->k));
        memcpy(to->pose.rotation, c->rotation, sizeof(c->rotation));
        sst_numbers_apply3(c->rotation, c->position_mm, to->pose.shift);
        for (int i = 0; i < 3; i++)
            to->pose.shift[i] *= -1;
    }
    for (int f = 0; f < p->frames; f++) {
        p->frame[f].known = true;
        memcpy(p->frame[f].pose.rotation, t->frame[f].rotation, sizeof(t->frame[f].rotation));
        memcpy(p->frame[f].pose.shift, t->frame[f].position_mm, sizeof(t->frame[f].position_mm));
    }
    memcpy(p->warp, t->cfg.warp_mm, sizeof(p->warp));
}

/* Our projection is the public one. */
static void residuals_are_zero(void **state)
{
    struct truth_config cfg = truth_small();
    const struct sst_solve_config how = { .lens = 8 };
    struct truth t;
    struct solve_problem p;

    (void)state;
    cfg.noise_px = 0;
    cfg.lens = 8;
    cfg.k[5] = 0.02, cfg.k[6] = -0.03, cfg.k[7] = 0.01;
    cfg.warp_mm[0] = 1.5, cfg.warp_mm[1] = -0.5;
    truth_make(&t, &cfg);
    problem(&p, &t, &how);
    assert_true(p.count > 50);
    for (int i = 0; i < p.count; i++) {
        double r[200][2];

        solve_residuals(&p, &p.detection[i], r);
        for (int k = 0; k < p.detection[i].corners; k++)
            assert_true(hypot(r[k][0], r[k][1]) < 1e-9);
    }
    solve_problem_fini(&p);
    truth_free(&t);
}

/* A state moved by a step in its unit, from poses turned by `turn` already. */
static void nudge(struct solve_problem *p, const struct solve_layout *l, int state, double by, const double turn[3],
                  const struct solve_problem *from)
{
    for (int v = 0; v < p->views; v++) {
        if (l->lens[v] >= 0 && state >= l->lens[v] && state < l->lens[v] + l->lens_size)
            p->camera[v].lens[state - l->lens[v]] = from->camera[v].lens[state - l->lens[v]] + by * l->scale[state];
    }
    for (int k = 0; k < p->views + p->frames; k++) {
        const int at = k < p->views ? l->pose[k] : l->frame[k - p->views];
        const struct solve_pose *old = k < p->views ? &from->camera[k].pose : &from->frame[k - p->views].pose;
        struct solve_pose *to = k < p->views ? &p->camera[k].pose : &p->frame[k - p->views].pose;
        double v[3] = { turn[0], turn[1], turn[2] }, m[9];

        if (at < 0)
            continue;
        *to = *old;
        if (state >= at && state < at + 3)
            v[state - at] += by * l->scale[state];
        if (state >= at + 3 && state < at + 6)
            to->shift[state - at - 3] += by * l->scale[state];
        sst_rotation_from_vector(v, m);
        sst_numbers_mul3(m, old->rotation, to->rotation);
    }
    for (int i = 0; i < 2; i++)
        p->warp[i] = from->warp[i] + (l->warp >= 0 && state == l->warp + i ? by * l->scale[state] : 0);
}

/* All derivatives of one detection, with and without the loss, against central differences. */
static void check_derivatives(const struct solve_problem *at, const struct solve_detection *d, double loss_px)
{
    static const double turn[3] = { 0.2, -0.1, 0.3 };
    static double rows[3][400 * SOLVE_COLS_MAX];
    const int n = solve_block_columns(at);
    struct solve_problem p;
    struct solve_layout l;
    struct solve_spread s;
    struct solve_pose board;
    int count = 0;

    assert_int_equal(solve_problem_copy(&p, at), 0);
    assert_int_equal(solve_layout_init(&l, at), 0);
    for (int state = 0; state < l.states; state++) {
        double worst = 0, size = 0;

        for (int k = 0; k < 3; k++) {
            nudge(&p, &l, state, k ? (k == 1 ? 1e-3 : -1e-3) : 0, turn, at);
            solve_relative(&p, d, &board);
            count = solve_block(&p, d, &board, loss_px, rows[k]);
        }
        nudge(&p, &l, state, 0, turn, at);
        solve_spread_make(&s, &p, &l, d, (const double *[2]){ turn, turn });
        for (int i = 0; i < count; i++) {
            int states[40], entries;
            double value[40], want = (rows[1][i * n + n - 1] - rows[2][i * n + n - 1]) / 2e-3, got = 0;

            entries = solve_spread_row(&s, rows[0] + i * n, 0, states, value);
            for (int e = 0; e < entries; e++) {
                assert_true(!e || states[e] > states[e - 1]);
                got += states[e] == state ? value[e] : 0;
            }
            worst = fmax(worst, fabs(want - got));
            size = fmax(size, fabs(want));
        }
        if (worst > 1e-6 * size + 1e-8)
            fail_msg("state %d, loss %g: derivative off by %g of %g", state, loss_px, worst, size);
    }
    solve_layout_fini(&l);
    solve_problem_fini(&p);
}

static void derivatives(void **state)
{
    struct truth_config cfg = truth_small();
    struct truth t;

    (void)state;
    cfg.frames = 4;
    cfg.lens = 8;
    cfg.k[5] = 0.02, cfg.k[6] = -0.03, cfg.k[7] = 0.01;
    cfg.warp_mm[0] = 2;
    cfg.noise_px = 3; /* for the loss to bend */
    truth_make(&t, &cfg);
    for (int lens = 5; lens <= 8; lens += 3) {
        const struct sst_solve_config how = { .lens = lens, .flat = lens == 5 };
        struct solve_problem p;

        problem(&p, &t, &how);
        p.detection[1].corner[3].weight = 0.3;
        for (int i = 0; i < 6; i++) {
            check_derivatives(&p, &p.detection[i], 0);
            check_derivatives(&p, &p.detection[i], 2);
        }
        p.rig = true;
        check_derivatives(&p, &p.detection[2], 0);
        solve_problem_fini(&p);
    }
    truth_free(&t);
}

/* Points beside and behind the camera give numbers, never NaN. */
static void always_finite(void **state)
{
    const double lens[SOLVE_LENS_MAX] = { 700, 700, 320, 240, -0.3, 0.1, 0, 0, 0.01, -1, 0.5, 0 };
    const double q[][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 1e6, -1e6, 1e-9 }, { 3, 4, -5 }, { 1, 0, 1 } };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(q); i++) {
        double xy[2];
        struct solve_slopes slopes;

        solve_see(lens, 8, q[i], xy, &slopes);
        for (int k = 0; k < 2; k++) {
            assert_true(isfinite(xy[k]));
            for (int c = 0; c < SOLVE_LENS_MAX; c++)
                assert_true(isfinite(slopes.lens[k][c]) && isfinite(slopes.q[k][c % 3]));
        }
    }
}

/* A turned lens is the same lens; a focal length off by 1e-4 is not. */
static void lens_difference(void **state)
{
    const struct solve_problem p = { .width = 640, .height = 480, .lens = 5 };
    const double a[SOLVE_LENS_MAX] = { 700, 700, 320, 240, -0.1, 0.02 };
    double b[SOLVE_LENS_MAX];

    (void)state;
    memcpy(b, a, sizeof(b));
    assert_near(solve_lens_difference(&p, a, b, 0.8), 0, 1e-9);
    b[2] += 0.5; /* nearly a turn */
    assert_true(solve_lens_difference(&p, a, b, 0.8) < 0.05);
    memcpy(b, a, sizeof(b));
    b[0] *= 1.0001;
    b[1] *= 1.0001;
    /* 1e-4 of the distance to the centre, RMS over 0.8 of 640 x 480 px: some 0.8 * 231 px * 1e-4 */
    assert_near(solve_lens_difference(&p, a, b, 0.8), 0.0187, 0.002);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(algebra),       cmocka_unit_test(not_definite),       cmocka_unit_test(triangle),
        cmocka_unit_test(left_jacobian), cmocka_unit_test(residuals_are_zero), cmocka_unit_test(derivatives),
        cmocka_unit_test(always_finite), cmocka_unit_test(lens_difference),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
