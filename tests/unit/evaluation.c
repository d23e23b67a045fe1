/* pipeline/eval/report: a small simulated light field on disk, measured against its own truth and against damaged
 * truth. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/eval/evaluation.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/folder.h"
#include "simulators/scene/scene.h"
#include "tests/folder.h"
#include "tests/test.h"

#define WIDTH  200
#define HEIGHT 150
#define SIDE   5

static void write_text(const char *path, const char *text)
{
    assert_int_equal(sst_file_write(path, text, strlen(text)), 0);
}

/* One view into views/ and truth/, its exact maps into the light field. */
static void write_view(struct sst_lightfield *lf, const struct sst_scene *scene, int k)
{
    struct sst_view *v = &lf->views[k];
    struct sst_map_f32 disp;
    char name[16];

    v->present = true;
    sst_view_name(lf, k, name);
    snprintf(lf->files->view[k].name, sizeof(lf->files->view[k].name), "%s.png", name);
    assert_int_equal(sst_image_init(&v->image, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_f32_init(&disp, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&v->label, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u16_init(&v->disp, WIDTH, HEIGHT), 0);
    assert_int_equal(
        sst_scene_render(scene, v->bx, v->by, 0,
                         &(struct sst_scene_maps){ .image = &v->image, .disp = &disp, .label = &v->label }),
        0);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sst_map_u16_row(&v->disp, i / WIDTH)[i % WIDTH] = sst_disp_q6(lf, sst_map_f32_row(&disp, i / WIDTH)[i % WIDTH]);
    assert_int_equal(sst_image_write_png(&v->image, test_path("views/%s.png", name)), 0);
    assert_int_equal(sst_map_f32_write_pfm(&disp, test_path("truth/%s.pfm", name)), 0);
    assert_int_equal(sst_map_u8_write_png(&v->label, test_path("truth/%s.png", name), NULL), 0);
    sst_map_f32_fini(&disp);
}

static void write_truth(const struct sst_lightfield *lf, const struct sst_scene *scene)
{
    const struct sst_view *ref = &lf->views[lf->ref_view];
    struct sst_map_u8 hidden, mask;
    struct sst_image behind;
    char text[1024];

    assert_int_equal(sst_image_init(&behind, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&hidden, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&mask, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_scene_render(scene, 0, 0, 1, &(struct sst_scene_maps){ .image = &behind, .label = &hidden }),
                     0);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int x = i % WIDTH, y = i / WIDTH;

        if (sst_map_u8_row(&hidden, y)[x] != sst_map_u8_row(&ref->label, y)[x])
            sst_map_u8_row(&mask, y)[x] = 255;
    }
    assert_int_equal(sst_image_write_png(&behind, test_path("truth/behind.png")), 0);
    assert_int_equal(sst_map_u8_write_png(&mask, test_path("truth/occluder.png"), NULL), 0);
    snprintf(
        text, sizeof(text),
        "{\"reference\": \"02_02\", \"focus_px\": %.6f, \"occluders\": [{\"name\": \"bush\", \"label\": \"Tree\","
        " \"target\": \"Pedestrian\", \"focus_px\": %.6f, \"behind\": \"behind.png\", \"mask\": \"occluder.png\"}]}",
        sst_scene_occluder_at(scene, 0)->focus_px, sst_scene_occluder_at(scene, 0)->focus_px);
    write_text(test_path("truth/truth.json"), text);
    sst_image_fini(&behind);
    sst_map_u8_fini(&hidden);
    sst_map_u8_fini(&mask);
}

static int setup(void **state SST_UNUSED)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;
    struct sst_lightfield lf;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.rows = cfg.cols = SIDE;
    assert_int_equal(test_folder_create(NULL), 0);
    assert_int_equal(
        mkdir(test_path("views"), 0755) | mkdir(test_path("truth"), 0755) | mkdir(test_path("labels_hcsm"), 0755), 0);
    assert_int_equal(sst_scene_create(&scene, "bush", &cfg), 0);
    assert_int_equal(sst_lightfield_init_files(&lf, SIDE, SIDE), 0);
    lf.width = WIDTH;
    lf.height = HEIGHT;
    lf.classes = sst_classes_default;
    for (int k = 0; k < SIDE * SIDE; k++)
        write_view(&lf, scene, k);
    write_truth(&lf, scene);
    assert_int_equal(sst_lightfield_write(&lf, test_folder, 2), 0);
    sst_scene_destroy(scene);
    sst_lightfield_fini(&lf);
    return 0;
}

static int measure(struct sst_evaluation *out, int threads)
{
    struct sst_render_config cfg;
    struct sst_lightfield lf;
    struct sst_truth truth;
    int err = sst_truth_read(&truth, test_path("truth"));

    if (err)
        return err;
    sst_render_config_defaults(&cfg);
    assert_int_equal(sst_lightfield_load(&lf, test_folder, SST_LOAD_ALL, threads), 0);
    err = sst_eval_lightfield(out, &(struct sst_eval_input){ &lf, test_folder, &truth, test_path("truth"), &cfg },
                              threads);
    sst_lightfield_fini(&lf);
    return err;
}

static void exact_maps_are_perfect(void **state SST_UNUSED)
{
    struct sst_evaluation r, again;

    assert_int_equal(measure(&r, 3), 0);
    assert_int_equal(r.disparity_views, SIDE * SIDE);
    assert_int_equal(r.disparity.pixels, SIDE * SIDE * WIDTH * HEIGHT);
    assert_true(r.disparity.bad_half == 0 && r.disparity.density == 100);
    assert_true(r.disparity.rmse > 0 && r.disparity.rmse <= 1 / 128.0);
    assert_true(r.disparity_nonocc.pixels < r.disparity.pixels && r.disparity_nonocc.pixels > r.disparity.pixels / 2);
    assert_int_equal(r.label_views, SIDE * SIDE);
    assert_true(r.refined.miou == 100 && r.refined.coverage == 100 && r.refined.accuracy == 100);
    assert_true(isnan(r.initial.miou) && isnan(r.hcsm.miou) && isnan(r.hcsm.coverage));
    assert_int_equal(r.occluders, 1);
    assert_true(r.occluder[0].covered > 1 && r.occluder[0].covered < 90);
    assert_true(r.occluder[0].rejected == 0 && r.occluder[0].accepted_wrong < 0.5);
    for (int i = 0; i < SST_EVAL_GAPS; i++)
        assert_true(isnan(r.occluder[0].rejected_gap[i]) || r.occluder[0].rejected_gap[i] == 0);
    assert_true(r.occluder[0].rejected_gap[SST_EVAL_GAPS - 1] == 0);
    assert_true(r.occluder[0].psnr_median > 5 && r.occluder[0].psnr_median < r.occluder[0].render.psnr_target);
    assert_true(r.occluder[0].render.psnr_occluded > r.occluder[0].refocus.psnr_occluded + 1);
    assert_true(r.occluder[0].render.ssim_occluded > r.occluder[0].refocus.ssim_occluded);
    assert_true(r.occluder[0].render.psnr > 10 && r.occluder[0].render.ssim > 0);
    assert_int_equal(measure(&again, 1), 0);
    r.occluder[0].render.seconds = r.occluder[0].refocus.seconds = 0;
    again.occluder[0].render.seconds = again.occluder[0].refocus.seconds = 0;
    assert_true(r.disparity.rmse == again.disparity.rmse);
    assert_true(r.disparity_nonocc.mean_abs == again.disparity_nonocc.mean_abs);
    assert_true(r.occluder[0].render.psnr == again.occluder[0].render.psnr);
    assert_true(r.occluder[0].render.ssim_occluded == again.occluder[0].render.ssim_occluded);
}

/* An HCSM of one view with an unlabeled upper half: half covered, all of it right. */
static void label_stages_are_read(void **state SST_UNUSED)
{
    struct sst_map_u8 map;
    struct sst_evaluation r;

    assert_int_equal(sst_map_u8_read_png(&map, test_path("truth/01_01.png")), 0);
    for (int y = 0; y < HEIGHT / 2; y++)
        memset(sst_map_u8_row(&map, y), 0, WIDTH);
    assert_int_equal(sst_map_u8_write_png(&map, test_path("labels_hcsm/01_01.png"), NULL), 0);
    assert_int_equal(measure(&r, 2), 0);
    assert_true(fabs(r.hcsm.coverage - 50) < 1e-9 && r.hcsm.accuracy == 100);
    assert_true(r.hcsm.miou > 1 && r.hcsm.miou < 100 && isnan(r.initial.miou));
    sst_map_u8_fini(&map);
    assert_int_equal(sst_map_u8_init(&map, 3, 3), 0);
    assert_int_equal(sst_map_u8_write_png(&map, test_path("labels_hcsm/01_01.png"), NULL), 0);
    assert_int_equal(measure(&r, 2), -EBADMSG);
    assert_int_equal(unlink(test_path("labels_hcsm/01_01.png")), 0);
    sst_map_u8_fini(&map);
}

static void damaged_truth_is_refused(void **state SST_UNUSED)
{
    static const char *const bad[] = {
        "",
        "[]",
        "{}",
        "{\"reference\": \"2\"}",
        "{\"reference\": \"09_09\", \"focus_px\": 10}",
        "{\"reference\": \"02_02\", \"occluders\": 3}",
        "{\"reference\": \"02_02\", \"occluders\": [{\"name\": \"a\"}]}",
        "{\"reference\": \"02_02\", \"focus_px\": \"ten\"}",
        "{\"reference\": \"02_02\", \"occluders\": [{\"name\": \"a\", \"label\": \"b\", \"target\": \"c\", "
        "\"focus_px\": 9,"
        " \"behind\": \"../behind.png\", \"mask\": \"occluder.png\"}]}",
    };
    struct sst_evaluation r = { .disparity_views = -7 };

    assert_int_equal(rename(test_path("truth/truth.json"), test_path("truth.json")), 0);
    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        write_text(test_path("truth/truth.json"), bad[i]);
        assert_int_equal(measure(&r, 2), -EBADMSG);
    }
    assert_int_equal(r.disparity_views, -7);
    write_text(test_path("truth/truth.json"), "{\"reference\": \"02_02\", \"focus_px\": 12.5}");
    assert_int_equal(measure(&r, 2), 0);
    assert_int_equal(r.occluders, 1);
    assert_int_equal(unlink(test_path("truth/truth.json")), 0);
    assert_int_equal(measure(&r, 2), 0);
    assert_int_equal(r.occluders, 0);
    assert_int_equal(r.disparity_views, SIDE * SIDE);
    assert_int_equal(rename(test_path("truth.json"), test_path("truth/truth.json")), 0);
    assert_int_equal(rename(test_path("truth/occluder.png"), test_path("occluder.png")), 0);
    assert_int_equal(measure(&r, 2), -ENOENT);
    assert_int_equal(rename(test_path("occluder.png"), test_path("truth/occluder.png")), 0);
}

static void nothing_to_measure_is_refused(void **state SST_UNUSED)
{
    struct sst_evaluation r;

    assert_int_equal(rename(test_path("disparity"), test_path("away")), 0);
    assert_int_equal(measure(&r, 2), -ENOENT);
    assert_int_equal(rename(test_path("away"), test_path("disparity")), 0);
    assert_int_equal(rename(test_path("truth"), test_path("away")), 0);
    assert_int_equal(measure(&r, 2), -ENOENT);
    assert_int_equal(mkdir(test_path("truth"), 0755), 0);
    assert_int_equal(measure(&r, 2), -ENOENT);
    assert_int_equal(rmdir(test_path("truth")), 0);
    assert_int_equal(rename(test_path("away"), test_path("truth")), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exact_maps_are_perfect),
        cmocka_unit_test(label_stages_are_read),
        cmocka_unit_test(damaged_truth_is_refused),
        cmocka_unit_test(nothing_to_measure_is_refused),
    };

    return cmocka_run_group_tests(tests, setup, test_folder_remove);
}
