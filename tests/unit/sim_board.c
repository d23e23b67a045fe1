/* Boards of simulated worlds: cameras that move on the way, the optics of another scene, a board that moves during the
 * exposure, one that stays in a pose, and parameters without a prepared world. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/camera_project.h"
#include "tests/sim_truth.h"

#include <errno.h>

#include "pipeline/camera/calib.h"

#define BOARD                                                                                                          \
    "board: {kind: chessboard, squares: [7, 5], square_mm: 50, poses: [{position_mm: [0, 0, 1200]}, "                  \
    "{position_mm: [40, -30, 1100], rotation_deg: [10, -20, 5]%s}]}\n"

static struct sst_sim_exposure at_pose(int cam, int pose)
{
    return (struct sst_sim_exposure){
        .cam = cam, .trigger = (uint64_t)pose, .t_ns = pose * 1000000000LL + 1, .exposure_us = 5000, .gain = 1
    };
}

/* Mean distance, px, of the corners in a frame from where a view puts them; all 24 must be found. */
static double corner_error(struct sst_sim_world *w, const json_t *truth, const struct sim_view *v, int cam, int pose)
{
    const struct sst_sim_exposure e = at_pose(cam, pose);
    const json_t *p = json_array_get(json_object_get(json_object_get(truth, "board"), "poses"), (size_t)pose);
    uint8_t *luma = sim_luma(w, &e);
    double turn[3][3], centre[3], sum = 0;

    sim_read_matrix(json_object_get(p, "rotation"), turn);
    sim_read_vector(json_object_get(p, "position_mm"), centre, 3);
    for (int corner = 0; corner < 24; corner++) {
        const double x = (corner % 6 - 2.5) * 50, y = (corner / 6 - 1.5) * 50;
        double at[3], want[2], found[2];

        for (int k = 0; k < 3; k++)
            at[k] = centre[k] + turn[k][0] * x + turn[k][1] * y;
        sim_project(v, at, want);
        found[0] = want[0] + 0.5;
        found[1] = want[1] - 0.5;
        assert_true(sim_find_corner(luma, 640, 480, found));
        sum += hypot(found[0] - want[0], found[1] - want[1]);
    }
    free(luma);
    return sum / 24;
}

static struct sst_sim_world *open_board(const char *pose, const char *more)
{
    char text[1024];

    snprintf(text, sizeof(text), "scene: board\ngrid: [1, 2]\nsize: [640, 480]\njpeg_quality: 95\n" BOARD "%s", pose,
             more);
    return sim_open(text);
}

/* Turned about x by a, the new y is cos a of the old one less sin a of the old z. */
static void a_camera_moves_at_a_pose(void **state SST_UNUSED)
{
    struct sst_sim_world *w =
        open_board("", "optics: {distortion: [-0.1, 0, 0, 0, 0]}\ncameras: [{camera: 1, rotation_deg: [0, 0, 1], "
                       "moves: {at_pose: 1, rotation_deg: [0.8, 0, 0], position_mm: [3, 0, -2]}}]\n");
    json_t *truth = sim_truth_of(), *cam = json_array_get(json_object_get(truth, "cameras"), 1);
    const json_t *moved = json_object_get(cam, "moved");
    const double c = cos(0.8 * M_PI / 180), s = sin(0.8 * M_PI / 180);
    struct sim_view before, after, still;

    sim_read_view(truth, 0, &still);
    sim_read_view(truth, 1, &before);
    after = before;
    assert_int_equal(json_integer_value(json_object_get(moved, "at_pose")), 1);
    assert_null(json_object_get(json_array_get(json_object_get(truth, "cameras"), 0), "moved"));
    sim_read_matrix(json_object_get(moved, "rotation"), after.r);
    sim_read_vector(json_object_get(moved, "position_mm"), after.c, 3);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(after.r[0][i] - before.r[0][i]) < 1e-12);
        assert_true(fabs(after.r[1][i] - (c * before.r[1][i] - s * before.r[2][i])) < 1e-12);
        assert_true(fabs(after.r[2][i] - (s * before.r[1][i] + c * before.r[2][i])) < 1e-12);
        assert_true(fabs(after.c[i] - before.c[i] - (i == 0 ? 3 : i == 2 ? -2 : 0)) < 1e-12);
    }
    assert_true(corner_error(w, truth, &before, 1, 0) < 0.06);
    assert_true(corner_error(w, truth, &after, 1, 1) < 0.06);
    assert_true(corner_error(w, truth, &still, 0, 1) < 0.06);
    json_decref(truth);
    sst_sim_world_close(w);

    /* From the start, in any scene: it is just another camera. */
    w = sim_open("scene: cat\ngrid: [1, 1]\nsize: [160, 192]\ncameras: [{camera: 0, moves: {position_mm: 7}}]\n");
    truth = sim_truth_of();
    sim_read_view(truth, 0, &still);
    assert_true(fabs(still.c[0] - 7) < 1e-12);
    json_decref(truth);
    sst_sim_world_close(w);
}

static void the_array_of_another_scene_sees_boards(void **state SST_UNUSED)
{
    static const char common[] = "grid: [2, 2]\nsize: [160, 192]\nseed: 9\noptics: {distortion_spread: [0.01, 0, 0, 0, "
                                 "0], focal_spread_percent: 1, principal_spread_px: 2%s}\n"
                                 "mounting: {rotation_spread_deg: 0.5, position_spread_mm: 1}\n";
    json_t *truth[2];

    for (int i = 0; i < 2; i++) {
        char text[1024], optics[512];
        struct sst_sim_world *w;

        snprintf(optics, sizeof(optics), common, i ? ", scene: cat" : "");
        snprintf(text, sizeof(text), "scene: %s\n%s%s", i ? "board" : "cat", optics, i ? "board: {poses: 2}\n" : "");
        w = sim_open(text);
        truth[i] = sim_truth_of();
        sst_sim_world_close(w);
    }
    assert_true(json_equal(json_object_get(truth[0], "cameras"), json_object_get(truth[1], "cameras")));
    assert_true(json_equal(json_object_get(truth[0], "ideal"), json_object_get(truth[1], "ideal")));
    assert_true(json_equal(json_object_get(truth[0], "spacing_mm"), json_object_get(truth[1], "spacing_mm")));
    json_decref(truth[0]);
    json_decref(truth[1]);
}

/* Greatest difference between neighbours across and down. */
static void steepest(const uint8_t *luma, int steep[2])
{
    steep[0] = steep[1] = 0;
    for (int y = 100; y < 380; y++) {
        for (int x = 150; x < 500; x++) {
            const uint8_t *p = luma + y * 640 + x;

            steep[0] = sst_max_int(steep[0], abs(p[1] - p[0]));
            steep[1] = sst_max_int(steep[1], abs(p[640] - p[0]));
        }
    }
}

static void a_moving_board_is_blurred_along_x(void **state SST_UNUSED)
{
    int sharp[2], blurred[2];

    for (int i = 0; i < 2; i++) {
        struct sst_sim_world *w = open_board(i ? ", blur_px: 8" : "", "");
        const struct sst_sim_exposure e = at_pose(0, 1);
        uint8_t *luma = sim_luma(w, &e);

        steepest(luma, i ? blurred : sharp);
        free(luma);
        sst_sim_world_close(w);
    }
    print_message("steepest edge across %d, moving %d; down %d, moving %d\n", sharp[0], blurred[0], sharp[1],
                  blurred[1]);
    assert_true(sharp[0] > 100 && sharp[1] > 100);
    assert_true(blurred[0] < sharp[0] / 2); /* 216 levels over 8 px and the slant of the edges */
    assert_true(blurred[1] > 60);
}

static void a_board_stays_where_it_is_held(void **state SST_UNUSED)
{
    struct sst_sim_world *w = open_board("", "");
    const struct sst_sim_exposure first = at_pose(0, 0), second = at_pose(0, 1);
    uint8_t *by_time[2] = { sim_luma(w, &first), sim_luma(w, &second) }, *held;

    assert_int_equal(sst_sim_world_hold(w, 2), 0);
    held = sim_luma(w, &first);
    /* Below the strip, which tells the time. */
    assert_memory_equal(held + 640 * 24, by_time[1] + 640 * 24, 640 * 456);
    assert_int_equal(sst_sim_world_hold(w, 3), -ERANGE);
    assert_int_equal(sst_sim_world_hold(w, -1), -ERANGE);
    free(held);
    assert_int_equal(sst_sim_world_hold(w, 0), 0);
    held = sim_luma(w, &first);
    assert_memory_equal(held + 640 * 24, by_time[0] + 640 * 24, 640 * 456);
    free(held);
    free(by_time[0]);
    free(by_time[1]);
    sst_sim_world_close(w);
}

static void a_rig_sees_the_first_pose_until_told(void **state SST_UNUSED)
{
    struct sst_sim_world *w = open_board("", "rig: true\n");
    json_t *truth = sim_truth_of();
    struct sst_sim_exposure e = at_pose(0, 1);
    struct sim_view v;

    sim_read_view(truth, 0, &v);
    e.pose_um[0] = 30000;
    v.c[0] += 30;
    for (int pose = 0; pose < 2; pose++) {
        assert_int_equal(sst_sim_world_hold(w, pose ? 2 : 0), 0);
        e.trigger = (uint64_t)pose;
        uint8_t *luma = sim_luma(w, &e);
        const json_t *p = json_array_get(json_object_get(json_object_get(truth, "board"), "poses"), (size_t)pose);
        double turn[3][3], centre[3], at[3], want[2], found[2];

        sim_read_matrix(json_object_get(p, "rotation"), turn);
        sim_read_vector(json_object_get(p, "position_mm"), centre, 3);
        for (int k = 0; k < 3; k++)
            at[k] = centre[k] + turn[k][0] * 25 + turn[k][1] * 25;
        sim_project(&v, at, want);
        found[0] = want[0] + 0.5;
        found[1] = want[1] + 0.5;
        assert_true(sim_find_corner(luma, 640, 480, found));
        assert_true(hypot(found[0] - want[0], found[1] - want[1]) < 0.1);
        free(luma);
    }
    json_decref(truth);
    sst_sim_world_close(w);
}

static void parameters_need_no_prepared_world(void **state SST_UNUSED)
{
    static const char world[] = "scene: board\nseed: 4\nmounting: {rotation_spread_deg: 1}\nboard: {poses: 3}\n";
    json_t *truth;

    assert_int_equal(sst_file_write(test_path("w.yaml"), world, strlen(world)), 0);
    assert_true(sst_sim_world_parameters(test_path("w.yaml"), "/no/such/folder/p.json") < 0);
    assert_int_equal(sst_sim_world_parameters(test_path("w.yaml"), test_path("p.json")), 0);
    truth = json_load_file(test_path("p.json"), 0, NULL);
    assert_int_equal(json_array_size(json_object_get(truth, "cameras")), 36);
    assert_int_equal(json_array_size(json_object_get(json_object_get(truth, "board"), "poses")), 3);
    json_decref(truth);
    assert_int_equal(sst_sim_world_parameters("/no/such/world.yaml", test_path("p.json")), -EINVAL);
}

/* A point is seen in the same place by the world's own formulas and by a calibration in the reference camera's axes. */
static void true_parameters_are_a_calibration(void **state SST_UNUSED)
{
    static const char world[] = "scene: board\ngrid: [2, 3]\nseed: 4\nmounting: {rotation_spread_deg: 1, "
                                "position_spread_mm: 3}\noptics: {distortion: [-0.1, 0.02, 0.001, 0.002, 0.003], "
                                "focal_spread_percent: 1, vignetting: 0.2}\nsensor: {gain_spread_percent: 5}\n"
                                "board: {kind: aprilgrid, poses: 3}\n%s";
    const double points[][3] = { { 0, 0, 1000 }, { 300, -200, 900 }, { -250, 150, 2500 }, { 10, 240, 700 } };
    char text[1024];

    for (int rig = 0; rig < 2; rig++) {
        struct sst_calib calib;
        struct sst_sim_world *w;
        struct sim_view v, reference;
        double gain = 0;
        json_t *truth;

        snprintf(text, sizeof(text), world, rig ? "rig: true\nsize: [160, 192]\n" : "size: [160, 192]\n");
        w = sim_open(text);
        truth = sim_truth_of();
        assert_int_equal(sst_sim_world_parameters(test_path("w.yaml"), test_path("p.yaml")), 0);
        assert_int_equal(sst_calib_read(&calib, test_path("p.yaml")), 0);
        assert_string_equal(calib.board, "aprilgrid:6x6:50mm:0.3");
        assert_true(calib.range_mm > 500);
        assert_int_equal(calib.reference, 1);
        sim_read_view(truth, rig ? 0 : 1, &reference);
        if (rig) { /* its place in view 1 is one spacing to the right of pose 0 */
            reference.c[0] += 60;
        }
        for (int view = 0; view < 6; view++) {
            const struct sst_calib_camera *cam = &calib.camera[view];

            sim_read_view(truth, rig ? 0 : (size_t)view, &v);
            if (rig) {
                v.c[0] += 60 * (view % 3);
                v.c[1] += 60 * (view / 3);
            }
            for (size_t i = 0; i < ARRAY_LEN(points); i++) {
                double want[2], x, y, from_reference[3];

                for (int k = 0; k < 3; k++)
                    from_reference[k] = reference.r[k][0] * (points[i][0] - reference.c[0]) +
                                        reference.r[k][1] * (points[i][1] - reference.c[1]) +
                                        reference.r[k][2] * (points[i][2] - reference.c[2]);
                sim_project(&v, points[i], want);
                assert_true(camera_project(cam, from_reference, &x, &y));
                assert_true(hypot(x - want[0], y - want[1]) < 1e-9);
            }
            gain += cam->gain[1] / 6;
            assert_true(cam->falloff[0] == -0.2);
        }
        assert_true(fabs(gain - 1) < 1e-12);
        sst_calib_fini(&calib);
        json_decref(truth);
        sst_sim_world_close(w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_camera_moves_at_a_pose, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(the_array_of_another_scene_sees_boards, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(a_moving_board_is_blurred_along_x, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(a_board_stays_where_it_is_held, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(a_rig_sees_the_first_pose_until_told, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(parameters_need_no_prepared_world, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(true_parameters_are_a_calibration, test_folder_create, test_folder_remove),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
