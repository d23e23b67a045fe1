/* Real pictures of a chessboard by two cameras: our solution against OpenCV's from the same corners. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/calibration/solve/solve.h"
#include "pipeline/image/codec.h"
#include "tests/test.h"
#include "tests/unit/solve_oracle.h"

#define FOLDER "../shared/data/calib-opencv-stereo"
#if WITH_OPENCV
#define COLS      9
#define ROWS      6
#define POINTS    (COLS * ROWS)
#define SQUARE_MM 25.0

static const int numbers[] = { 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14 };
#define PICTURES ((int)ARRAY_LEN(numbers))

static float xy[2][ARRAY_LEN(numbers)][2 * POINTS];
static int width, height;

static int read_all(void **state)
{
    (void)state;
    for (int side = 0; side < 2; side++) {
        for (int i = 0; i < PICTURES; i++) {
            struct sst_image image;
            char path[128];
            uint8_t *grey;

            snprintf(path, sizeof(path), FOLDER "/%s%02d.jpg", side ? "right" : "left", numbers[i]);
            if (sst_image_read(&image, path))
                return -1;
            width = image.width, height = image.height;
            grey = malloc((size_t)width * (size_t)height);
            assert_non_null(grey);
            for (int k = 0; k < width * height; k++)
                grey[k] = image.plane[1][(size_t)(k / width) * image.stride + (size_t)(k % width)];
            assert_int_equal(oracle_corners(grey, width, height, COLS, ROWS, xy[side][i]), 1);
            free(grey);
            sst_image_fini(&image);
        }
    }
    return 0;
}

/* One camera (right: 0 or 1) or both. */
static void detections(struct sst_detections *all, int first, int last)
{
    const struct sst_board board = {
        .kind = SST_BOARD_CHESSBOARD, .cols = COLS + 1, .rows = ROWS + 1, .square_mm = SQUARE_MM
    };

    assert_int_equal(sst_detections_init(
                         all,
                         &(struct sst_detections){
                             .board = board, .rows = 1, .cols = last - first + 1, .width = width, .height = height }),
                     0);
    for (int side = first; side <= last; side++)
        snprintf(all->camera_name[side - first], sizeof(all->camera_name[0]), "%s", side ? "right" : "left");
    for (int i = 0; i < PICTURES; i++) {
        char name[32];

        snprintf(name, sizeof(name), "%02d", numbers[i]);
        assert_int_equal(sst_detections_frame(all, name), i);
        for (int side = first; side <= last; side++) {
            struct sst_detection d = { .view = side - first, .frame = i, .corners = POINTS };

            d.corner = calloc(POINTS, sizeof(*d.corner));
            assert_non_null(d.corner);
            for (int k = 0; k < POINTS; k++)
                d.corner[k] = (struct sst_corner){
                    .id = k, .x = (double)xy[side][i][2 * k], .y = (double)xy[side][i][2 * k + 1], .weight = 1
                };
            assert_int_equal(sst_detections_add(all, &d), 0);
        }
    }
}

/* The same model and corners, least squares over all: the same minimum. */
static void one_camera_equals_calibrate_camera(void **state)
{
    const struct sst_solve_config how = { .lens = 5, .plain = true, .flat = true, .threads = 1 };

    (void)state;
    for (int side = 0; side < 2; side++) {
        struct sst_detections all;
        struct sst_solution s;
        double k[9];
        const double rms = oracle_calibrate(xy[side][0], PICTURES, COLS, ROWS, SQUARE_MM, width, height, k);

        detections(&all, side, side);
        assert_int_equal(sst_solve(&s, &all, &how), 0);
        print_message("%s: RMS %.6f px, OpenCV's %.6f px; focal length %.3f px, OpenCV's %.3f px\n",
                      side ? "right" : "left", s.rms_px, rms, s.calib.camera[0].fx, k[0]);
        assert_true(rms > 0);
        assert_true(fabs(s.rms_px - rms) < 1e-4);
        assert_true(side || s.rms_px <= 0.3926);
        assert_true(fabs(s.calib.camera[0].fx - k[0]) < 0.02);
        for (int i = 0; i < 5; i++)
            assert_true(fabs(s.calib.camera[0].k[i] - k[4 + i]) < 2e-3);
        sst_solution_fini(&s);
        sst_detections_fini(&all);
    }
}

static void both_are_no_worse_than_stereo_calibrate(void **state)
{
    const struct sst_solve_config how = { .lens = 5, .plain = true, .flat = true, .threads = 1 };
    struct sst_detections all;
    struct sst_solution s;
    double distance;
    const double rms = oracle_stereo(xy[0][0], xy[1][0], PICTURES, COLS, ROWS, SQUARE_MM, width, height, &distance);
    const double *at;

    (void)state;
    detections(&all, 0, 1);
    assert_int_equal(sst_solve(&s, &all, &how), 0);
    at = s.calib.camera[1].position_mm;
    print_message("both: RMS %.6f px, OpenCV's %.6f px; %.3f mm apart, OpenCV's %.3f mm\n", s.rms_px, rms,
                  sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]), distance);
    assert_true(rms > 0 && s.rms_px <= rms + 1e-6);
    assert_true(fabs(sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]) - distance) < 0.5);
    sst_solution_fini(&s);
    sst_detections_fini(&all);
}

/* As users run it: robust, with warp and comparison. */
static void robust_is_better(void **state)
{
    const struct sst_solve_config how = { .lens = 5, .cross_validate = true, .threads = 1, .max_outliers = 0.1 };
    struct sst_detections all;
    struct sst_solution s;

    (void)state;
    detections(&all, 0, 1);
    assert_int_equal(sst_solve(&s, &all, &how), 0);
    print_message("robust: RMS %.4f px, noise %.4f px, %d outliers of %d, warp %.3f %.3f mm, odd/even %.3f px (%.3f "
                  "expected), right camera known to %.3f px\n",
                  s.rms_px, s.noise_px, s.outliers, s.corners + s.outliers, s.warp_mm[0], s.warp_mm[1], s.cv_px,
                  s.cv_expected_px, s.calib.camera[1].sigma_px);
    assert_true(s.rms_px < 0.45);
    assert_true(isfinite(s.cv_px) && s.calib.camera[1].sigma_px > 0);
    sst_solution_fini(&s);
    sst_detections_fini(&all);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_camera_equals_calibrate_camera),
        cmocka_unit_test(both_are_no_worse_than_stereo_calibrate),
        cmocka_unit_test(robust_is_better),
    };

    if (access(FOLDER "/left01.jpg", R_OK)) {
        print_message("skipped: " FOLDER " is not there\n");
        return 77;
    }
    if (!WITH_DOGLEG) {
        print_message("skipped: built without libdogleg\n");
        return 77;
    }
    return cmocka_run_group_tests(tests, read_all, NULL);
}
#else
int main(void)
{
    print_message("skipped: built without OpenCV\n");
    return 77;
}
#endif
