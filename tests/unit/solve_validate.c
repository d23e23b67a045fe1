/* Faulty captures are refused with a message that names fault, place and size; never fitted silently. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calibration/solve/solve.h"
#include "tests/calib_truth.h"
#include "tests/camera_project.h"
#include "tests/test.h"

static char said[SST_LOG_MAX];

/* Solve and capture the log. @return the error, or 0 */
static int solve(const struct truth *t, const struct sst_solve_config *cfg, struct sst_solution *s)
{
    char *before = sst_log_hold_errors(said);
    int err;

    said[0] = 0;
    err = sst_solve(s, &t->all, cfg);
    sst_log_hold_errors(before);
    return err;
}

/* Refused with all of these words, and nothing written to the output. */
static void refused(const struct truth *t, const char *const *words)
{
    const struct sst_solve_config how = { .lens = 5, .threads = 2 };
    struct sst_solution s;

    memset(&s, 0x5a, sizeof(s));
    assert_int_equal(solve(t, &how, &s), -EBADMSG);
    print_message("%s\n", said);
    for (size_t i = 0; i < sizeof(s); i++)
        assert_int_equal(((unsigned char *)&s)[i], 0x5a);
    for (; *words; words++)
        assert_contains(said, *words);
}

#define REFUSED(t, ...) refused(t, (const char *const[]){ __VA_ARGS__, NULL })

/* With force: solved, every number finite. */
static void forced(const struct truth *t, struct sst_solution *s)
{
    const struct sst_solve_config how = { .lens = 5, .threads = 2, .force = true };

    assert_int_equal(solve(t, &how, s), 0);
    assert_null(sst_calib_fault(&s->calib));
    assert_true(isfinite(s->rms_px) && isfinite(s->noise_px) && isfinite(s->predicted_rms_px));
    for (int i = 0; i < t->all.count; i++) {
        for (int k = 0; k < t->all.detection[i].corners; k++)
            assert_true(isfinite(s->view[i].residual[k][0]) && isfinite(s->view[i].residual[k][1]));
    }
}

static struct truth_config six(void)
{
    struct truth_config cfg = truth_small();

    cfg.cols = 3;
    return cfg;
}

static struct sst_detection *find(struct truth *t, int view, int frame)
{
    for (int i = 0; i < t->all.count; i++) {
        if (t->all.detection[i].view == view && t->all.detection[i].frame == frame)
            return &t->all.detection[i];
    }
    return NULL;
}

/* Keep the detections that keep() selects. */
static void keep_only(struct truth *t, bool (*keep)(const struct sst_detection *d))
{
    int n = 0;

    for (int i = 0; i < t->all.count; i++) {
        if (keep(&t->all.detection[i]))
            t->all.detection[n++] = t->all.detection[i];
        else
            sst_detection_fini(&t->all.detection[i]);
    }
    t->all.count = n;
}

static bool not_view_4(const struct sst_detection *d)
{
    return d->view != 4;
}

static void camera_without_detections(void **state)
{
    const struct truth_config cfg = six();
    struct truth t;
    struct sst_solution s;

    (void)state;
    truth_make(&t, &cfg);
    keep_only(&t, not_view_4);
    REFUSED(&t, "01_01", "row 1, column 1", "24 frames");
    forced(&t, &s);
    assert_false(s.calib.camera[4].known);
    assert_true(s.calib.camera[5].known);
    sst_solution_fini(&s);
    truth_free(&t);
}

static bool groups(const struct sst_detection *d)
{
    return (d->view == 2 || d->view == 5) == (d->frame >= 12);
}

static void unlinked_cameras(void **state)
{
    const struct truth_config cfg = six();
    struct truth t;
    struct sst_solution s;

    (void)state;
    truth_make(&t, &cfg);
    keep_only(&t, groups);
    REFUSED(&t, "2 cameras", "00_02", "01_02");
    forced(&t, &s);
    assert_false(s.calib.camera[2].known);
    assert_false(s.calib.camera[5].known);
    assert_true(s.calib.camera[4].known);
    sst_solution_fini(&s);
    truth_free(&t);
}

static bool three_frames(const struct sst_detection *d)
{
    return d->frame < 3;
}

static bool nothing(const struct sst_detection *d)
{
    (void)d;
    return false;
}

static void too_few_frames(void **state)
{
    const struct truth_config cfg = truth_small();
    const struct sst_solve_config force = { .lens = 5, .force = true };
    struct truth t;
    struct sst_solution s;

    (void)state;
    truth_make(&t, &cfg);
    keep_only(&t, three_frames);
    REFUSED(&t, "3 frames", "4");
    keep_only(&t, nothing);
    REFUSED(&t, "no frame shows the board");
    assert_int_equal(solve(&t, &force, &s), -EBADMSG);
    truth_free(&t);
}

static void too_few_regions(void **state)
{
    struct truth_config cfg = truth_small();
    struct truth t;

    (void)state;
    cfg.board.square_mm = 20;
    cfg.aside = 0.05;
    cfg.near_mm = 1200;
    truth_make(&t, &cfg);
    REFUSED(&t, "regions", "camera 00_00", "at least 8");
    truth_free(&t);
}

static void focal_length_unknown(void **state)
{
    struct truth_config cfg = truth_small();
    struct truth t;

    (void)state;
    cfg.tilt_deg = 0.5; /* all boards face the cameras, all at one depth */
    cfg.near_mm = 1000, cfg.far_mm = 1010;
    cfg.frames = 12;
    truth_make(&t, &cfg);
    REFUSED(&t, "focal length", "tilted");
    truth_free(&t);
}

static void corners_not_finite(void **state)
{
    static const double bad[] = { NAN, INFINITY, -1e300 };
    const struct truth_config cfg = truth_small();

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        struct truth t;
        struct sst_solution s;

        truth_make(&t, &cfg);
        find(&t, 1, 5)->corner[2].x = bad[i];
        find(&t, 2, 6)->corner[0].id = i ? 5000 : -1;
        REFUSED(&t, "frame005", "camera 00_01");
        forced(&t, &s);
        sst_solution_fini(&s);
        truth_free(&t);
    }
}

/* Pictures of another size than in the file; a corner far outside its picture. */
static void corners_outside(void **state)
{
    const struct truth_config cfg = truth_small();
    struct truth t;
    struct sst_solution s;

    (void)state;
    truth_make(&t, &cfg);
    t.all.width = cfg.width / 2;
    REFUSED(&t, "outside the 320x480 pictures", "detect the corners again");
    t.all.width = cfg.width;
    find(&t, 1, 5)->corner[2].y = -700;
    REFUSED(&t, "frame005", "camera 00_01", "-700", "in a picture of 640x480");
    find(&t, 1, 5)->corner[3].x = 1300;
    forced(&t, &s); /* looks at a residual of each corner of each detection */
    for (int i = 0; i < t.all.count; i++) {
        for (int k = 0; k < t.all.detection[i].corners && &t.all.detection[i] == find(&t, 1, 5); k++) {
            assert_int_equal(s.view[i].outlier[k], k == 2 || k == 3);
            assert_true((k == 2 || k == 3) == (s.view[i].residual[k][0] == 0));
        }
    }
    sst_solution_fini(&s);
    truth_free(&t);
}

/* Lenses are in pixels: lenses of other pictures would be fitted around. */
static void lenses_of_another_size(void **state)
{
    const struct truth_config cfg = truth_small();
    struct sst_solve_config how = { .lens = 5, .threads = 2 };
    struct sst_calib half;
    struct sst_solution s;
    struct truth t;

    (void)state;
    truth_make(&t, &cfg);
    forced(&t, &s);
    assert_int_equal(sst_calib_copy(&half, &s.calib), 0);
    sst_solution_fini(&s);
    how.lenses = &half;
    assert_int_equal(solve(&t, &how, &s), 0);
    sst_solution_fini(&s);
    half.width /= 2;
    assert_int_equal(solve(&t, &how, &s), -EBADMSG);
    assert_non_null(strstr(said, "pictures of"));
    sst_calib_fini(&half);
    truth_free(&t);
}

static void too_many_outliers(void **state)
{
    struct truth_config cfg = truth_small();
    struct truth t;
    struct sst_solution s;

    (void)state;
    cfg.outliers = 0.12;
    truth_make(&t, &cfg);
    REFUSED(&t, "outliers", "3.0 %", "camera", "frame");
    forced(&t, &s);
    assert_true(s.outliers > s.corners / 12);
    sst_solution_fini(&s);
    truth_free(&t);
}

static void exchange(struct truth *t, int a, int b, int from, int to)
{
    for (int f = from; f < to; f++) {
        struct sst_detection *x = find(t, a, f), *y = find(t, b, f);

        if (x && y) {
            struct sst_detection other = *x;

            x->corner = y->corner, x->corners = y->corners;
            y->corner = other.corner, y->corners = other.corners;
        }
    }
}

static void cameras_exchanged_from_a_frame_on(void **state)
{
    const struct truth_config cfg = six();
    struct truth t;

    (void)state;
    truth_make(&t, &cfg);
    exchange(&t, 1, 5, 15, 24);
    REFUSED(&t, "00_01", "01_02", "exchanged in", "from frame015");
    truth_free(&t);
}

static void cameras_exchanged_in_all_frames(void **state)
{
    const struct truth_config cfg = six();
    struct truth t;

    (void)state;
    truth_make(&t, &cfg);
    exchange(&t, 1, 5, 0, 24);
    REFUSED(&t, "00_01", "01_02", "are swapped", "regular grid");
    truth_free(&t);
}

/* Camera 3 is turned from frame 10 on. */
static void camera_moved(void **state)
{
    static const double turns_deg[] = { 0.05, 0.3, 4 };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(turns_deg); i++) {
        struct truth_config cfg = six();
        struct truth t, moved;
        const double turn[3] = { 0.2 * turns_deg[i] * M_PI / 180, turns_deg[i] * M_PI / 180, 0 };
        double by[9], r[9];

        truth_make(&t, &cfg);
        truth_make(&moved, &cfg);
        sst_rotation_from_vector(turn, by);
        memcpy(r, t.calib.camera[3].rotation, sizeof(r));
        for (int k = 0; k < 9; k++)
            moved.calib.camera[3].rotation[k] =
                by[k / 3 * 3] * r[k % 3] + by[k / 3 * 3 + 1] * r[3 + k % 3] + by[k / 3 * 3 + 2] * r[6 + k % 3];
        for (int f = 10; f < cfg.frames; f++) {
            struct sst_detection *d = find(&t, 3, f);

            for (int k = 0; d && k < d->corners; k++) {
                double X[3], before[2], after[2];

                truth_point(&t, f, d->corner[k].id, X);
                assert_true(camera_project(&t.calib.camera[3], X, &before[0], &before[1]));
                assert_true(camera_project(&moved.calib.camera[3], X, &after[0], &after[1]));
                d->corner[k].x += after[0] - before[0];
                d->corner[k].y += after[1] - before[1];
            }
        }
        REFUSED(&t, "camera 01_00", "moved", "before frame frame010", "degrees");
        truth_free(&t);
        truth_free(&moved);
    }
}

/* One of two cameras moved: which one cannot be determined. */
static void one_of_two_moved(void **state)
{
    struct truth_config cfg = truth_small();
    struct truth t;

    (void)state;
    cfg.rows = 1;
    truth_make(&t, &cfg);
    for (int f = 12; f < cfg.frames; f++) {
        struct sst_detection *d = find(&t, 1, f);

        for (int k = 0; d && k < d->corners; k++)
            d->corner[k].x += 4;
    }
    REFUSED(&t, "moved against the other", "frame012");
    truth_free(&t);
}

static void mirrored_and_renumbered(void **state)
{
    const struct truth_config cfg = six();
    struct truth t;

    (void)state;
    truth_make(&t, &cfg);
    for (int f = 0; f < cfg.frames; f++) {
        for (int view = 1; view <= 2; view++) {
            struct sst_detection *d = find(&t, view, f);

            for (int k = 0; d && k < d->corners; k++)
                d->corner[k].x = cfg.width - 1 - d->corner[k].x;
        }
    }
    REFUSED(&t, "00_01", "mirrored", "flipped");
    truth_free(&t);

    /* 8 x 6 points numbered by columns */
    truth_make(&t, &cfg);
    for (int f = 0; f < cfg.frames; f++) {
        struct sst_detection *d = find(&t, 4, f);

        for (int k = 0; d && k < d->corners; k++)
            d->corner[k].id = d->corner[k].id % 8 * 6 + d->corner[k].id / 8;
    }
    REFUSED(&t, "01_01");
    truth_free(&t);

    /* numbered from the opposite corner in a third of the frames */
    truth_make(&t, &cfg);
    for (int f = 0; f < cfg.frames; f += 3) {
        struct sst_detection *d = find(&t, 4, f);

        for (int k = 0; d && k < d->corners; k++)
            d->corner[k].id = 47 - d->corner[k].id;
    }
    REFUSED(&t, "01_01", "another corner");
    truth_free(&t);
}

/* In frame 7 the board moves while the cameras expose one after the other. */
static void board_moved(void **state)
{
    const struct truth_config cfg = six();
    struct truth t;
    struct sst_solution s;

    (void)state;
    truth_make(&t, &cfg);
    for (int view = 0; view < 6; view++) {
        struct sst_detection *d = find(&t, view, 7);

        for (int k = 0; d && k < d->corners; k++) {
            d->corner[k].x += 3 * (view - 2.5);
            d->corner[k].y -= 2 * (view % 3 - 1);
        }
    }
    REFUSED(&t, "board moved", "frame007");
    forced(&t, &s);
    for (int v = 0; v < 6; v++)
        assert_true(fabs(s.calib.camera[v].fx - t.calib.camera[v].fx) < 4);
    sst_solution_fini(&s);
    truth_free(&t);
}

/* A camera with garbage does not affect the others. */
static void bad_camera_pulls_nobody(void **state)
{
    const struct truth_config cfg = six();
    struct truth t;
    struct sst_solution good, bad;

    (void)state;
    truth_make(&t, &cfg);
    forced(&t, &good);
    for (int f = 0; f < cfg.frames; f++) {
        struct sst_detection *d = find(&t, 5, f);
        const double off[2] = { 60 * test_normal(&t.state), 60 * test_normal(&t.state) };

        for (int k = 0; d && k < d->corners; k++) {
            d->corner[k].x += off[0];
            d->corner[k].y += off[1];
        }
    }
    REFUSED(&t, "01_02", "contradicts");
    forced(&t, &bad);
    for (int v = 0; v < 5; v++) {
        assert_true(fabs(good.calib.camera[v].fx - bad.calib.camera[v].fx) < 1);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(good.calib.camera[v].position_mm[i] - bad.calib.camera[v].position_mm[i]) < 0.7);
    }
    sst_solution_fini(&good);
    sst_solution_fini(&bad);
    truth_free(&t);
}

/* Squares of 25 mm called 30: a rig's drives know better. */
static void board_of_another_size(void **state)
{
    struct truth_config cfg = truth_small();
    struct truth t;

    (void)state;
    cfg.rig = true;
    cfg.frames = 8;
    cfg.board.square_mm = 25;
    cfg.near_mm = 400, cfg.far_mm = 900;
    truth_make(&t, &cfg);
    t.all.board.square_mm = 30;
    REFUSED(&t, "1.2 times", "25", "30");
    truth_free(&t);
}

/* 40 % of the detections and a quarter of the corners gone, cameras far apart: solved, or refused with a reason. */
static void sparse_captures(void **state)
{
    int solved = 0;

    (void)state;
    for (uint64_t seed = 1; seed <= 12; seed++) {
        const struct sst_solve_config how = { .lens = 5, .threads = 2 };
        struct truth_config cfg = truth_small();
        struct truth t;
        struct sst_solution s;
        int err;

        cfg.seed = seed;
        cfg.frames = 8;
        cfg.detections = 0.6;
        cfg.corners = 0.75;
        cfg.spacing_mm = 250;
        truth_make(&t, &cfg);
        err = solve(&t, &how, &s);
        assert_true(err == 0 || (err == -EBADMSG && strlen(said) > 40));
        if (!err) {
            solved++;
            assert_null(sst_calib_fault(&s.calib));
            assert_true(s.rms_px < 0.16);
            sst_solution_fini(&s);
        }
        truth_free(&t);
    }
    print_message("%d of 12 solved\n", solved);
    assert_true(solved >= 6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(camera_without_detections),
        cmocka_unit_test(unlinked_cameras),
        cmocka_unit_test(too_few_frames),
        cmocka_unit_test(too_few_regions),
        cmocka_unit_test(focal_length_unknown),
        cmocka_unit_test(corners_not_finite),
        cmocka_unit_test(corners_outside),
        cmocka_unit_test(lenses_of_another_size),
        cmocka_unit_test(too_many_outliers),
        cmocka_unit_test(cameras_exchanged_from_a_frame_on),
        cmocka_unit_test(cameras_exchanged_in_all_frames),
        cmocka_unit_test(camera_moved),
        cmocka_unit_test(one_of_two_moved),
        cmocka_unit_test(mirrored_and_renumbered),
        cmocka_unit_test(board_moved),
        cmocka_unit_test(bad_camera_pulls_nobody),
        cmocka_unit_test(board_of_another_size),
        cmocka_unit_test(sparse_captures),
    };

    if (!WITH_DOGLEG) {
        print_message("skipped: built without libdogleg\n");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
