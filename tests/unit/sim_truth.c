/* Simulated geometry against its truth: projected points, disparity of an ideal array, incremental drawing of motion,
 * the rolling shutter, the rig's pose, and boards read by OpenCV. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/sim_truth.h"

#include <sys/wait.h>

#include "simulators/scene/surfaces.h"
#include "tests/strip_read.h"

static void corners_are_where_the_truth_puts_them(void **state SST_UNUSED)
{
    struct sst_sim_world *w = sim_open("scene: board\ngrid: [1, 2]\nsize: [640, 480]\nseed: 5\njpeg_quality: 95\n"
                                       "optics: {distortion: [-0.2, 0.08, 0.001, -0.002, -0.01], distortion_spread: "
                                       "[0.02, 0.01, 0.001, 0.001, 0.002],\n"
                                       "  focal_spread_percent: 1, principal_spread_px: 6}\nmounting: "
                                       "{rotation_spread_deg: 1, position_spread_mm: 4}\n"
                                       "board: {kind: chessboard, squares: [9, 7], square_mm: 45, poses: 2}\n");
    json_t *truth = sim_truth_of(), *board = json_object_get(truth, "board");
    double sum = 0, moved = 0;
    int found = 0, near = 0;

    for (int i = 0; i < 4; i++) {
        const struct sst_sim_exposure e = {
            .cam = i / 2, .trigger = (uint64_t)i, .t_ns = i % 2 * 1000000000LL + 1, .exposure_us = 5000, .gain = 1
        };
        const json_t *pose = json_array_get(json_object_get(board, "poses"), (size_t)i % 2);
        uint8_t *luma = sim_luma(w, &e);
        double turn[3][3], centre[3], shift[2] = { 0, 0 };
        struct sim_view v, plain;
        const int before = found;

        sim_read_view(truth, (size_t)i / 2, &v);
        plain = v;
        memset(plain.d, 0, sizeof(plain.d));
        sim_read_matrix(json_object_get(pose, "rotation"), turn);
        sim_read_vector(json_object_get(pose, "position_mm"), centre, 3);
        for (int corner = 0; corner < 48; corner++) {
            const double x = (corner % 8 - 3.5) * 45, y = (corner / 8 - 2.5) * 45;
            double p[3], want[2], without[2], at[2];

            for (int k = 0; k < 3; k++)
                p[k] = centre[k] + turn[k][0] * x + turn[k][1] * y;
            sim_project(&v, p, want);
            sim_project(&plain, p, without);
            at[0] = want[0] + 1;
            at[1] = want[1] - 1;
            if (want[1] < 36 || !sim_find_corner(luma, 640, 480, at))
                continue;
            found++;
            near += hypot(at[0] - want[0], at[1] - want[1]) < 0.1;
            sum += hypot(at[0] - want[0], at[1] - want[1]);
            moved = fmax(moved, hypot(want[0] - without[0], want[1] - without[1]));
            shift[0] += at[0] - want[0];
            shift[1] += at[1] - want[1];
        }
        assert_true(found > before);
        assert_true(hypot(shift[0], shift[1]) / (found - before) < 0.025); /* no picture is displaced */
        free(luma);
    }
    print_message("%d of %d corners within 0.1 px, mean %.3f px off; distortion up to %.1f px\n", near, found,
                  sum / found, moved);
    assert_true(found > 150);
    assert_true(moved > 4); /* or the distortion was not tried */
    assert_true(near > 0.97 * found);
    assert_true(sum / found < 0.06);
    json_decref(truth);
    sst_sim_world_close(w);
}

/* --- an ideal array is the scene ---------------------------------------------------------------------------------- */

static void scene_view(const char *name, double time_s, int rows, int cols, double bx, double by, int width, int height,
                       struct sst_image *image, struct sst_map_f32 *disp)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;

    sst_scene_config_defaults(&cfg);
    cfg.width = width;
    cfg.height = height;
    cfg.rows = rows;
    cfg.cols = cols;
    cfg.time_s = time_s;
    assert_int_equal(sst_scene_create(&scene, name, &cfg), 0);
    assert_int_equal(sst_image_init(image, width, height), 0);
    if (disp)
        assert_int_equal(sst_map_f32_init(disp, width, height), 0);
    assert_int_equal(sst_scene_render(scene, bx, by, 0, &(struct sst_scene_maps){ .image = image, .disp = disp }), 0);
    sst_scene_destroy(scene);
}

/* Sum of differences of a 9x9 block in two frames, the second one further left by d. */
static int block(const uint8_t *left, const uint8_t *right, int width, int x, int y, int d)
{
    int sum = 0;

    for (int v = -4; v <= 4; v++) {
        for (int u = -4; u <= 4; u++)
            sum += abs(left[(y + v) * width + x + u] - right[(y + v) * width + x + u - d]);
    }
    return sum;
}

static void an_ideal_array_has_the_scenes_views_and_disparity(void **state SST_UNUSED)
{
    struct sst_sim_world *w = sim_open("scene: cat\ngrid: [2, 3]\nsize: [320, 240]\njpeg_quality: 98\n");
    struct sst_image image;
    struct sst_map_f32 disp;
    uint8_t *luma[6];
    int tried = 0, hit = 0;

    for (int cam = 0; cam < 6; cam++) { /* reference: row 0, column 1 */
        const struct sst_sim_exposure e = { .cam = cam, .exposure_us = 5000, .gain = 1 };

        luma[cam] = sim_luma(w, &e);
        scene_view("cat", 0, 2, 3, cam % 3 - 1, cam / 3, 320, 240, &image, cam == 1 ? &disp : NULL);
        assert_true(sim_psnr(luma[cam], &image, strip_height(320), 240) > 38);
        sst_image_fini(&image);
    }
    for (int y = 60; y < 230; y += 7) {
        for (int x = 40; x < 310; x += 7) {
            const double d = sst_map_f32_row(&disp, y)[x];
            int best = 0;

            if (fabs(d - round(d)) > 0.2 || fabs(sst_map_f32_row(&disp, y)[x - 4] - d) > 0.2 ||
                fabs(sst_map_f32_row(&disp, y)[x + 4] - d) > 0.2 || fabs(sst_map_f32_row(&disp, y - 4)[x] - d) > 0.2 ||
                fabs(sst_map_f32_row(&disp, y + 4)[x] - d) > 0.2 || d > x - 6)
                continue; /* between two pixels, on an edge, or outside the neighbour */
            for (int k = -2; k <= 2; k++) {
                if (block(luma[1], luma[2], 320, x, y, (int)lround(d) + k) <
                    block(luma[1], luma[2], 320, x, y, (int)lround(d) + best))
                    best = k;
            }
            tried++;
            hit += best == 0;
        }
    }
    print_message("disparity right in %d of %d blocks\n", hit, tried);
    assert_true(tried > 50);
    assert_true(hit > 0.95 * tried);
    for (int cam = 0; cam < 6; cam++)
        free(luma[cam]);
    sst_map_f32_fini(&disp);
    sst_sim_world_close(w);
}

/* --- motion ------------------------------------------------------------------------------------------------------- */

static void build(struct sst_scene_world *w, const char *scene, double time_s)
{
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.time_s = time_s;
    assert_int_equal(sst_scene_world_build(w, scene, &cfg), 0);
}

static void drawing_what_moves_gives_the_bytes_of_the_whole(void **state SST_UNUSED)
{
    static const char *const scenes[] = { "pedestrian", "bush" };

    for (int i = 0; i < 2; i++) {
        struct sst_image whole, parts;
        struct sst_scene_layers *layers;
        struct sst_scene_world at0, at1;
        struct sst_scene_raster r;
        bool *moving;
        int count = 0;

        build(&at0, scenes[i], 0);
        build(&at1, scenes[i], 0.7);
        assert_int_equal(sst_image_init(&whole, 200, 150), 0);
        assert_int_equal(sst_image_init(&parts, 200, 150), 0);
        moving = calloc((size_t)at0.count, sizeof(*moving));
        sst_scene_world_compare(&at0, &at1, moving);
        for (int s = 0; s < at0.count; s++)
            count += moving[s];
        assert_true(count > 5 && count < at0.count);
        r = (struct sst_scene_raster){ .world = &at0,
                                       .focal_px = at0.focal / 5,
                                       .cx = 99.5,
                                       .cy = 80,
                                       .width = 200,
                                       .height = 150,
                                       .step_x = 1,
                                       .step_y = 1,
                                       .bx = 1,
                                       .by = -0.5,
                                       .eye_z_mm = 20,
                                       .image = &parts };
        assert_int_equal(sst_scene_layers_create(&layers, &r, moving, 3), 0);
        sst_scene_layers_draw(layers, &at1, 0, 70);
        sst_scene_layers_draw(layers, &at1, 70, 150);
        r.world = &at1;
        r.image = &whole;
        assert_int_equal(sst_scene_raster_run(&r), 0);
        for (int c = 0; c < 3; c++) {
            for (int y = 0; y < 150; y++)
                assert_memory_equal(sst_image_row(&parts, c, y), sst_image_row(&whole, c, y), 200);
        }
        sst_scene_layers_destroy(layers);
        free(moving);
        sst_image_fini(&whole);
        sst_image_fini(&parts);
        sst_scene_world_fini(&at0);
        sst_scene_world_fini(&at1);
    }
}

static void loops_have_no_seam(void **state SST_UNUSED)
{
    static const struct {
        const char *scene;
        double period_s;
    } cases[] = { { "pedestrian", 4 }, { "bush", 2 } };

    for (int i = 0; i < 2; i++) {
        struct sst_scene_world a, b, c;
        double seam = 0, step = 0;

        build(&a, cases[i].scene, 0);
        build(&b, cases[i].scene, cases[i].period_s);
        build(&c, cases[i].scene, 0.1);
        for (int s = 0; s < a.count; s++) {
            seam = fmax(seam, fabs(a.surfaces[s].origin.x - b.surfaces[s].origin.x) +
                                  fabs(a.surfaces[s].u.y - b.surfaces[s].u.y));
            step = fmax(step, fabs(a.surfaces[s].origin.x - c.surfaces[s].origin.x));
        }
        assert_true(seam < 1e-6);
        assert_true(step > 1); /* mm: something does move */
        sst_scene_world_fini(&a);
        sst_scene_world_fini(&b);
        sst_scene_world_fini(&c);
    }
}

static void a_rolling_shutter_sees_lower_rows_later(void **state SST_UNUSED)
{
    /* 2 ms a row: the band of rows 160..175 is exposed 0.32 s after the first one. */
    struct sst_sim_world *w = sim_open("scene: pedestrian\ngrid: [1, 1]\nsize: [320, 240]\njpeg_quality: 98\n"
                                       "shutter: {kind: rolling, line_us: 2000}\nloop: {seconds: 4, rate_hz: 1}\n");
    const struct sst_sim_exposure e = { .exposure_us = 5000, .gain = 1 };
    uint8_t *luma = sim_luma(w, &e);
    struct sst_image early, late;

    scene_view("pedestrian", 0, 1, 1, 0, 0, 320, 240, &early, NULL);
    scene_view("pedestrian", 0.32, 1, 1, 0, 0, 320, 240, &late, NULL);
    print_message("rows 160..175: %.1f dB against 0.32 s later, %.1f dB against the start\n",
                  sim_psnr(luma, &late, 160, 176), sim_psnr(luma, &early, 160, 176));
    assert_true(sim_psnr(luma, &late, 160, 176) > 38);
    assert_true(sim_psnr(luma, &early, 160, 176) < 30);
    sst_image_fini(&early);
    sst_image_fini(&late);
    free(luma);
    sst_sim_world_close(w);
}

static void the_rigs_pose_decides_the_view(void **state SST_UNUSED)
{
    struct sst_sim_world *w = sim_open("scene: humvee\ngrid: [3, 4]\nsize: [320, 240]\nrig: true\njpeg_quality: 98\n");
    json_t *truth = sim_truth_of();
    const double step = json_number_value(json_object_get(truth, "spacing_mm")) * 1000;

    assert_int_equal(sst_sim_world_cameras(w), 1);
    for (int i = 0; i < 3; i++) { /* the reference is row 1, column 1: pose 0 is one spacing to its upper left */
        const struct sst_sim_exposure e = { .trigger = (uint64_t)i,
                                            .exposure_us = 5000,
                                            .gain = 1,
                                            .pose_um = { (int32_t)lround(i * step), (int32_t)lround(i / 2 * step),
                                                         0 } };
        uint8_t *luma = sim_luma(w, &e), *again;
        struct sst_sim_exposure got;
        struct sst_image image;

        scene_view("humvee", 0, 3, 4, i - 1, i / 2 - 1, 320, 240, &image, NULL);
        assert_true(sim_psnr(luma, &image, 48, 240) > 38);
        assert_int_equal(strip_read(luma, 320, 320, 240, &got), 0);
        assert_int_equal(got.pose_um[0], e.pose_um[0]);
        again = sim_luma(w, &e);
        assert_memory_equal(again, luma, 320 * 240);
        free(again);
        free(luma);
        sst_image_fini(&image);
    }
    json_decref(truth);
    sst_sim_world_close(w);
}

/* --- boards ------------------------------------------------------------------------------------------------------- */

/* Frames of each kind of board are left in the folder, and OpenCV's Python module looks for the boards in them. */
static void opencv_reads_the_boards(void **state SST_UNUSED)
{
    static const char *const boards[] = { "{kind: chessboard, squares: [8, 7], poses: 2}", "{kind: charuco, poses: 2}",
                                          "{kind: aprilgrid, squares: [5, 4], poses: 2}" };
    char command[256];
    int status;

    if (system("/usr/bin/python3 -c 'import cv2, numpy; cv2.aruco.DICT_4X4_50' 2>/dev/null")) {
        print_message("no OpenCV for Python (python3-opencv): boards not read\n");
        skip();
    }
    for (int i = 0; i < 3; i++) {
        char text[512], name[32];
        struct sst_sim_world *w;

        snprintf(text, sizeof(text),
                 "scene: board\ngrid: [1, 1]\nsize: [800, 600]\nseed: %d\n"
                 "optics: {distortion: [-0.1, 0, 0, 0, 0]}\nsensor: {full_well_e: 10000}\nboard: %s\n",
                 i + 1, boards[i]);
        w = sim_open(text);
        for (int k = 0; k < 2; k++) {
            const struct sst_sim_exposure e = {
                .trigger = (uint64_t)k, .t_ns = k * 1000000000LL, .exposure_us = 5000, .gain = 1
            };
            const size_t bytes = sim_frame(w, &e, V4L2_PIX_FMT_MJPEG, 800, 600);

            snprintf(name, sizeof(name), "%d-%d.jpg", i, k);
            assert_int_equal(sst_file_write(test_path("%s", name), sim_out, bytes), 0);
        }
        snprintf(name, sizeof(name), "%d.json", i);
        assert_int_equal(sst_sim_world_parameters(test_path("w.yaml"), test_path("%s", name)), 0);
        sst_sim_world_close(w);
    }
    snprintf(command, sizeof(command), "timeout 600 /usr/bin/python3 tests/sim_boards.py %s", test_folder);
    status = system(command);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(corners_are_where_the_truth_puts_them, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(an_ideal_array_has_the_scenes_views_and_disparity, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(drawing_what_moves_gives_the_bytes_of_the_whole, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(loops_have_no_seam, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(a_rolling_shutter_sees_lower_rows_later, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(the_rigs_pose_decides_the_view, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(opencv_reads_the_boards, test_folder_create, test_folder_remove),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
