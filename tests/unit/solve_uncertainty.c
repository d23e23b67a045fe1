/* Predicted uncertainty against what really happens: many made-up arrays, each solved, each compared with its truth. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/calibration/solve/solve.h"
#include "tests/calib_truth.h"
#include "tests/camera_project.h"
#include "tests/small.h"
#include "tests/test.h"

#define TRIALS    24
#define STRETCHES 4 /* |error| over sigma: 0.5, 1, 1.5, 2 */

struct tally {
    long inside[STRETCHES], all;
    double square; /* of error over sigma */
};

static void count(struct tally *t, double error, double sigma)
{
    const double ratio = fabs(error) / sigma;

    for (int i = 0; i < STRETCHES; i++)
        t->inside[i] += ratio < 0.5 * (i + 1);
    t->all++;
    t->square += ratio * ratio;
}

/* A pixel of the reference view, carried to view k by the truth and by the solution. */
static bool carried(const struct sst_calib *c, int k, double x, double y, double z, double out[2])
{
    struct sst_calib_camera to = c->camera[k];
    double X[3];

    if (!sst_camera_undistort(&c->camera[c->reference], x, y, &X[0], &X[1]))
        return false;
    X[2] = 1;
    for (int i = 0; i < 3; i++) {
        X[i] *= z > 0 ? z : 1;
        to.position_mm[i] *= z > 0;
    }
    return camera_project(&to, X, &out[0], &out[1]);
}

static void compare(struct tally tally[2], const struct truth *t, const struct sst_solution *s)
{
    for (int k = 0; k < t->cfg.rows * t->cfg.cols; k++) {
        for (int cell = 0; cell < 2 * SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; cell++) {
            const int at = cell / 2, row = at / SST_UNCERTAINTY_COLS, col = at % SST_UNCERTAINTY_COLS;
            const double sigma = (double)s->transfer_sigma[k][cell % 2][row][col];
            const double x = (col + 0.5) / SST_UNCERTAINTY_COLS * t->cfg.width - 0.5;
            const double y = (row + 0.5) / SST_UNCERTAINTY_ROWS * t->cfg.height - 0.5;
            const double z = cell % 2 ? s->calib.range_mm : 0;
            double seen[2][2];

            if (k == t->calib.reference) {
                assert_true(sigma == 0);
                continue;
            }
            if (!isfinite(sigma) || !carried(&t->calib, k, x, y, z, seen[0]))
                continue;
            assert_true(carried(&s->calib, k, x, y, z, seen[1]));
            for (int i = 0; i < 2; i++)
                count(&tally[cell % 2], seen[1][i] - seen[0][i], sigma);
        }
    }
}

static void truth_is_inside(void **state)
{
    static const double normal[STRETCHES] = { 0.383, 0.683, 0.866, 0.954 };
    struct tally tally[2] = { { { 0 }, 0, 0 } };
    double cross = 0;
    int crossed = 0;

    (void)state;
    for (uint64_t seed = 1; seed <= TRIALS; seed++) {
        const struct sst_solve_config how = { .lens = 5, .threads = 2, .cross_validate = true };
        struct truth_config cfg = truth_small();
        struct truth t;
        struct sst_solution s;

        cfg.seed = 100 + seed;
        cfg.cols = 3;
        cfg.noise_px = 0.05 + 0.01 * (double)seed;
        truth_make(&t, &cfg);
        assert_int_equal(sst_solve(&s, &t.all, &how), 0);
        compare(tally, &t, &s);
        if (isfinite(s.cv_px)) {
            cross += s.cv_px / s.cv_expected_px;
            crossed++;
        }
        sst_solution_fini(&s);
        truth_free(&t);
    }
    for (int k = 0; k < 2; k++) {
        print_message("%s: %ld errors, RMS %.3f sigma; inside", k ? "working range" : "infinity", tally[k].all,
                      sqrt(tally[k].square / (double)tally[k].all));
        for (int i = 0; i < STRETCHES; i++)
            print_message(" %.1f sigma: %.1f %% (%.1f),", 0.5 * (i + 1),
                          100.0 * (double)tally[k].inside[i] / (double)tally[k].all, 100 * normal[i]);
        print_message("\n");
        assert_true(tally[k].all > 20000);
        assert_true(tally[k].inside[1] > 0.60 * (double)tally[k].all);
        assert_true(tally[k].inside[1] < 0.76 * (double)tally[k].all);
        assert_true(tally[k].inside[3] > 0.90 * (double)tally[k].all);
    }
    /* The worst of six cameras is somewhat above what one is expected to be. */
    print_message("odd against even frames: %.2f times what is expected, worst of 6 cameras\n", cross / crossed);
    assert_int_equal(crossed, TRIALS);
    assert_true(cross / crossed > 0.8 && cross / crossed < 2.2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        plain_test(truth_is_inside),
    };

    if (!WITH_DOGLEG) {
        print_message("skipped: built without libdogleg\n");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
