/* Light fields of raw frames: a plane with a known picture on it, seen by an array that is mounted badly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/lightfield/correction.h"
#include "pipeline/lightfield/import.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/render/render.h"
#include "simulators/scene/noise.h"
#include "tests/folder.h"
#include "tests/small.h"
#include "tests/test.h"

#define ROWS   2
#define COLS   3
#define WIDTH  320
#define HEIGHT 240
#define DEPTH  2000.0

static uint64_t seed = 5;

/* The plane's picture in sRGB levels: waves of 60 mm and more, 8 px and more at 300 px / 2000 mm. */
static double picture(double X, double Y, int c)
{
    return 128 + 40 * sin(X / 19.0 + c) * cos(Y / 31.0) + 50 * sin((X + 2 * Y) / 83.0 - c) +
           20 * cos(X / 23.0 - Y / 17.0);
}

/* Camera centre and direction in rig axes to the plane z = DEPTH. */
static double seen(const double centre[3], const double d[3], int c)
{
    const double t = (DEPTH - centre[2]) / d[2];

    return picture(centre[0] + t * d[0], centre[1] + t * d[1], c);
}

static struct sst_calib bad_array(void)
{
    struct sst_calib calib;

    assert_int_equal(sst_calib_init(&calib, ROWS, COLS), 0);
    calib.width = WIDTH;
    calib.height = HEIGHT;
    calib.range_mm = DEPTH;
    for (int k = 0; k < ROWS * COLS; k++) {
        struct sst_calib_camera *cam = &calib.camera[k];
        const double v[3] = { sst_random_in(&seed, -0.02, 0.02), sst_random_in(&seed, -0.02, 0.02),
                              sst_random_in(&seed, -0.02, 0.02) };
        const double lens[5] = { -0.2, 0.06, 5e-4, -5e-4, 0 };

        *cam = (struct sst_calib_camera){ .known = true,
                                          .fx = sst_random_in(&seed, 295, 305),
                                          .fy = sst_random_in(&seed, 295, 305),
                                          .cx = sst_random_in(&seed, 155, 164),
                                          .cy = sst_random_in(&seed, 115, 124),
                                          .lens = 5,
                                          .gain = { 1, 1, 1 } };
        snprintf(cam->name, sizeof(cam->name), "cam%d", k);
        memcpy(cam->k, lens, sizeof(lens));
        if (k != calib.reference) {
            sst_rotation_from_vector(v, cam->rotation);
            cam->position_mm[0] = 100 * (k % COLS - 1) + sst_random_in(&seed, -3, 3);
            cam->position_mm[1] = 100 * (k / COLS) + sst_random_in(&seed, -3, 3);
        } else {
            sst_rotation_from_vector((const double[3]){ 0, 0, 0 }, cam->rotation);
        }
    }
    return calib;
}

static double encode(double linear)
{
    return 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055);
}

static double decode(double code)
{
    return code / 255 <= 0.04045 ? code / 255 / 12.92 : pow((code / 255 + 0.055) / 1.055, 2.4);
}

/* The frame that a camera takes, in PNG; the other way round than rectification. */
static void take_frame(const struct sst_calib *calib, int k)
{
    const struct sst_calib_camera *cam = &calib->camera[k];
    const double half2 = 0.25 * (WIDTH * WIDTH + HEIGHT * HEIGHT);
    struct sst_image img;

    assert_int_equal(sst_image_init(&img, WIDTH, HEIGHT), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            double ray[3] = { 0, 0, 1 }, d[3];
            const double r2 = ((x - cam->cx) * (x - cam->cx) + (y - cam->cy) * (y - cam->cy)) / half2;
            const double falloff = 1 + r2 * (cam->falloff[0] + r2 * (cam->falloff[1] + r2 * cam->falloff[2]));

            assert_true(sst_camera_undistort(cam, x, y, &ray[0], &ray[1]));
            for (int i = 0; i < 3; i++)
                d[i] = cam->rotation[i] * ray[0] + cam->rotation[3 + i] * ray[1] + cam->rotation[6 + i];
            for (int c = 0; c < 3; c++) {
                const double light = decode(seen(cam->position_mm, d, c)) * cam->gain[c] * falloff;

                sst_image_row(&img, c, y)[x] = (uint8_t)(fmin(encode(light), 255) + 0.5);
            }
        }
    }
    assert_int_equal(sst_image_write_png(&img, test_path("frames/%02d_%02d.png", k / COLS, k % COLS)), 0);
    sst_image_fini(&img);
}

/* Frames of the whole array in frames/, its calibration in calib.yaml. */
static void take_frames(const struct sst_calib *calib)
{
    sst_path_remove_tree(test_path("frames"));
    assert_int_equal(mkdir(test_path("frames"), 0777), 0);
    for (int k = 0; k < ROWS * COLS; k++)
        take_frame(calib, k);
    assert_int_equal(sst_calib_write(calib, test_path("calib.yaml")), 0);
}

static struct sst_use_calibration use_file(void)
{
    struct sst_use_calibration use;

    sst_use_calibration_defaults(&use);
    assert_int_equal(sst_use_calibration_read(&use, test_path("calib.yaml")), 0);
    return use;
}

static int import(const char *out, const struct sst_use_calibration *use)
{
    const struct sst_import_config cfg = { .format = "folder",
                                           .source = test_path("frames"),
                                           .out = out,
                                           .rows = ROWS,
                                           .cols = COLS,
                                           .calibration = use,
                                           .force = true,
                                           .threads = 2 };

    return sst_import(&cfg);
}

static void make(const char *name)
{
    struct sst_use_calibration use = use_file();

    assert_int_equal(import(test_path("%s", name), &use), 0);
    sst_use_calibration_fini(&use);
}

/* Largest and RMS difference of a view from the plane as the rectified camera sees it. */
static double worst_error(const struct sst_lightfield *lf, int k, double *rms)
{
    const struct sst_rectified *to = lf->rectified;
    const struct sst_view *v = &lf->views[k];
    double worst = 0, sum2 = 0, n = 0;

    for (int y = 0; y < lf->height; y++) {
        for (int x = 0; x < lf->width; x++) {
            const double f = to->focal_px * to->view[k].scale, a = (x - to->cx) / f, b = (y - to->cy) / f;
            double d[3];

            if (v->valid.data && !sst_map_u8_row(&v->valid, y)[x]) {
                assert_int_equal(sst_image_row(&v->image, 0, y)[x], 0);
                continue;
            }
            for (int i = 0; i < 3; i++)
                d[i] = to->rotation[i] * a + to->rotation[3 + i] * b + to->rotation[6 + i];
            for (int c = 0; c < 3; c++) {
                const double e = sst_image_row(&v->image, c, y)[x] - seen(lf->calibration->camera[k].position_mm, d, c);

                worst = fmax(worst, fabs(e));
                sum2 += e * e;
                n++;
            }
        }
    }
    assert_true(n > 3 * 0.8 * WIDTH * HEIGHT);
    *rms = sqrt(sum2 / n);
    return worst;
}

static void rectified_views_show_the_plane(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();
    struct sst_lightfield lf;

    take_frames(&calib);
    make("lf");
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_IMAGES, 2), 0);
    assert_non_null(lf.calibration);
    assert_true(fabs(lf.spacing_mm - 100) < 3 && fabs(lf.focal_px - 300) < 5 && lf.ref_view == 1);
    for (int k = 0; k < ROWS * COLS; k++) {
        double rms, worst = worst_error(&lf, k, &rms);

        print_message("view %d: worst %.2f, RMS %.3f levels\n", k, worst, rms);
        assert_true(rms < 0.7);
        assert_true(worst < 3);
        assert_true(fabs(lf.views[k].bx - (k % COLS - 1)) < 0.1 && fabs(lf.views[k].by - k / COLS) < 0.1);
    }
    sst_lightfield_fini(&lf);
    sst_calib_fini(&calib);
}

/* Gains and fall-off as cameras have them are taken back: each camera's frames are its mean light's again. */
static void light_is_corrected(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();
    struct sst_lightfield lf;

    for (int k = 0; k < ROWS * COLS; k++) {
        for (int c = 0; c < 3; c++)
            calib.camera[k].gain[c] = 1 + 0.1 * ((k + c) % 3 - 1);
        calib.camera[k].falloff[0] = -0.3;
    }
    take_frames(&calib);
    make("lf");
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_IMAGES, 2), 0);
    for (int k = 0; k < ROWS * COLS; k++) {
        double rms;

        assert_true(worst_error(&lf, k, &rms) < 3);
        assert_true(rms < 0.8);
    }
    sst_lightfield_fini(&lf);
    sst_calib_fini(&calib);
}

/* Turn a camera's calibration away from its frames, by the correction `c`: in rectified axes, small. */
static void misplace(struct sst_calib_camera *cam, const struct sst_rectified *to, const struct sst_correction *c)
{
    const double w[3] = { c->shift_y_px / to->focal_px, -c->shift_x_px / to->focal_px, -c->roll_deg * (M_PI / 180) };
    const double true_rotation[9] = { cam->rotation[0], cam->rotation[1], cam->rotation[2],
                                      cam->rotation[3], cam->rotation[4], cam->rotation[5],
                                      cam->rotation[6], cam->rotation[7], cam->rotation[8] };
    double in_rig[3], turn[9];

    for (int i = 0; i < 3; i++)
        in_rig[i] = to->rotation[i] * w[0] + to->rotation[3 + i] * w[1] + to->rotation[6 + i] * w[2];
    sst_rotation_from_vector(in_rig, turn);
    for (int i = 0; i < 9; i++) {
        cam->rotation[i] = 0;
        for (int k = 0; k < 3; k++)
            cam->rotation[i] += true_rotation[i / 3 * 3 + k] * turn[3 * k + i % 3];
    }
    cam->fx *= 1 - c->scale;
    cam->fy *= 1 - c->scale;
}

/* A correction beside a calibration turns the cameras as the displacement says, and multiplies light. */
static void a_correction_corrects_the_calibration(void **state SST_UNUSED)
{
    struct sst_correction c[ROWS * COLS];
    struct sst_calib calib = bad_array();
    struct sst_lightfield lf;
    double rms;

    for (int k = 0; k < ROWS * COLS; k++) { /* an error of the frames that the calibration does not know */
        const double f = -0.1 * k;

        calib.camera[k].gain[1] = 1 + 0.05 * k;
        calib.camera[k].falloff[0] = f;
        calib.camera[k].falloff[1] = f * f / 2;
    }
    take_frames(&calib);
    make("lf");
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), 0, 2), 0);
    for (int k = 0; k < ROWS * COLS; k++) {
        c[k] = sst_correction_none();
        if (k != calib.reference)
            c[k] = (struct sst_correction){ 1.5 - k,         0.5 * k,     0.4 * (k % 3 - 1),
                                            0.004 * (k % 2), { 1, 1, 1 }, .exponent = 1 };
        misplace(&calib.camera[k], lf.rectified, &c[k]);
        c[k].gain[1] = calib.camera[k].gain[1];
        c[k].falloff = calib.camera[k].falloff[0];
        calib.camera[k].gain[1] = 1;
        calib.camera[k].falloff[0] = calib.camera[k].falloff[1] = 0;
    }
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_calib_write(&calib, test_path("calib.yaml")), 0);
    make("lf");
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_IMAGES, 2), 0);
    for (int k = 0; k < ROWS * COLS; k++) {
        (void)worst_error(&lf, k, &rms);
        assert_true(!k || k == lf.ref_view || rms > 2);
    }
    lf.correction = malloc(sizeof(c));
    memcpy(lf.correction, c, sizeof(c));
    assert_int_equal(sst_lightfield_save_maps(&lf, test_path("lf"), 2), 0);
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_IMAGES, 2), 0);
    for (int k = 0; k < ROWS * COLS; k++) {
        const double worst = worst_error(&lf, k, &rms);

        if (rms > 0.6) /* the worst ones are on the border of the frame */
            fail_msg("view %d: worst %.2f, RMS %.3f levels", k, worst, rms);
    }
    sst_lightfield_fini(&lf);
    sst_calib_fini(&calib);
}

static void same_images(const struct sst_lightfield *a, const struct sst_lightfield *b)
{
    for (int k = 0; k < a->rows * a->cols; k++) {
        for (int y = 0; y < a->height; y++) {
            for (int c = 0; c < 3; c++)
                assert_memory_equal(sst_image_row(&a->views[k].image, c, y), sst_image_row(&b->views[k].image, c, y),
                                    (size_t)a->width);
        }
    }
}

static void threads_raw_and_bake(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();
    struct sst_rectify_dir_config cfg = { .bake = true, .force = true, .threads = 2 };
    struct sst_lightfield one, three, raw, own;
    struct sst_image frame;

    take_frames(&calib);
    make("lf");
    assert_int_equal(sst_lightfield_load(&one, test_path("lf"), SST_LOAD_IMAGES, 1), 0);
    assert_int_equal(sst_lightfield_load(&three, test_path("lf"), SST_LOAD_IMAGES, 3), 0);
    same_images(&one, &three);
    sst_lightfield_fini(&three);
    assert_int_equal(sst_lightfield_load(&raw, test_path("lf"), SST_LOAD_IMAGES | SST_LOAD_RAW, 2), 0);
    assert_int_equal(sst_image_read(&frame, test_path("frames/01_02.png")), 0);
    assert_memory_equal(sst_image_row(&raw.views[5].image, 1, 100), sst_image_row(&frame, 1, 100), WIDTH);
    assert_null(raw.views[5].valid.data);
    sst_image_fini(&frame);
    sst_lightfield_fini(&raw);
    cfg.dir = test_path("lf");
    cfg.out = test_path("baked");
    assert_int_equal(sst_lightfield_rectify_dir(&cfg, &own), 0);
    sst_lightfield_fini(&own);
    assert_int_equal(sst_lightfield_load(&three, test_path("baked"), SST_LOAD_IMAGES, 2), 0);
    assert_null(three.calibration);
    same_images(&one, &three);
    assert_true(one.views[0].bx == three.views[0].bx && one.focal_px == three.focal_px);
    /* Where the principal point and infinity are stays known without the calibration. */
    assert_true(three.infinity_known && three.infinity_px == 0 && one.infinity_known);
    assert_true(fabs(three.off_centre_px[0] + (WIDTH - 1) / 2.0 - one.rectified->cx) < 1e-12);
    assert_true(fabs(three.off_centre_px[1] + (HEIGHT - 1) / 2.0 - one.rectified->cy) < 1e-12);
    assert_true(three.off_centre_px[0] != 0 && one.off_centre_px[0] == three.off_centre_px[0]);
    sst_lightfield_fini(&three);
    sst_lightfield_fini(&one);
    sst_calib_fini(&calib);
}

/* Maps go into the folder and come back beside the calibration; a light field without one stays of version 1. */
static void maps_and_versions(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();
    struct sst_lightfield lf;
    uint8_t *text;
    size_t size;

    take_frames(&calib);
    make("lf");
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), 0, 1), 0);
    assert_int_equal(sst_map_u16_init(&lf.views[2].disp, lf.width, lf.height), 0);
    sst_map_u16_row(&lf.views[2].disp, 7)[9] = 777;
    assert_int_equal(sst_lightfield_save_maps(&lf, test_path("lf"), 1), 0);
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_ALL, 1), 0);
    assert_non_null(lf.calibration);
    assert_int_equal(sst_map_u16_row(&lf.views[2].disp, 7)[9], 777);
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_file_read(test_path("lf/lightfield.json"), 1 << 20, &text, &size), 0);
    assert_non_null(strstr((char *)text, "\"version\": 2"));
    free(text);
    assert_int_equal(import(test_path("plain"), NULL), 0);
    assert_int_equal(sst_file_read(test_path("plain/lightfield.json"), 1 << 20, &text, &size), 0);
    assert_non_null(strstr((char *)text, "\"version\": 1"));
    assert_null(strstr((char *)text, "calibration"));
    free(text);
    sst_calib_fini(&calib);
}

static void refused(int err, int want, const char *words, const char *text)
{
    assert_int_equal(err, want);
    assert_contains(text, words);
}

#define REFUSED(call, want, words)                                                                                     \
    do {                                                                                                               \
        char said[SST_LOG_MAX] = "", *before = sst_log_hold_errors(said);                                              \
        const int got = (call);                                                                                        \
                                                                                                                       \
        sst_log_hold_errors(before);                                                                                   \
        refused(got, want, words, said);                                                                               \
    } while (0)

static void what_does_not_fit(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();
    struct sst_use_calibration use;
    struct sst_lightfield lf;
    struct sst_image small;
    uint8_t *text;
    size_t size;

    take_frames(&calib);
    make("lf");
    use = use_file();
    use.calib.width = 640;
    REFUSED(import(test_path("no"), &use), -EBADMSG, "frames of 640x240 pixels, the views have 320x240");
    use.calib.width = WIDTH;
    use.calib.rows = COLS;
    use.calib.cols = ROWS;
    REFUSED(import(test_path("no"), &use), -EBADMSG, "grid of 3x2 cameras, the views form one of 2x3");
    use.calib.rows = ROWS;
    use.calib.cols = COLS;
    assert_false(sst_path_exists(test_path("no")));
    use.calib.camera[4].k[0] = 1e11; /* no lens sees like this */
    REFUSED(import(test_path("no"), &use), -EBADMSG, "nothing of the frames of camera");
    use.calib.camera[4].k[0] = calib.camera[4].k[0];
    assert_false(sst_path_exists(test_path("no")));
    use.calib.camera[5].known = false; /* a hole; the rest goes on */
    assert_int_equal(import(test_path("hole"), &use), 0);
    assert_int_equal(sst_lightfield_load(&lf, test_path("hole"), SST_LOAD_IMAGES, 1), 0);
    assert_false(lf.views[5].present);
    assert_false(sst_path_exists(test_path("hole/views/01_02.png")));
    sst_lightfield_fini(&lf);
    sst_use_calibration_fini(&use);
    /* The folder after someone has been at it. */
    assert_int_equal(sst_image_init(&small, 32, 24), 0);
    assert_int_equal(sst_image_write_png(&small, test_path("lf/views/00_01.png")), 0);
    sst_image_fini(&small);
    REFUSED(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_IMAGES, 1), -EBADMSG,
            "32x24 pixels, the calibration is of");
    assert_int_equal(sst_file_read(test_path("lf/calibration.yaml"), 1 << 20, &text, &size), 0);
    assert_int_equal(sst_file_write(test_path("lf/calibration.yaml"), text, size - 1), 0);
    REFUSED(sst_lightfield_load(&lf, test_path("lf"), 0, 1), -EBADMSG, "has changed since the light field was made");
    assert_int_equal(remove(test_path("lf/calibration.yaml")), 0);
    REFUSED(sst_lightfield_load(&lf, test_path("lf"), 0, 1), -ENOENT, "calibration.yaml");
    free(text);
    sst_calib_fini(&calib);
}

/* Focused on the plane, all views show one picture: also at its borders, where some views have nothing to show. */
static void rays_from_outside_do_not_count(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();
    struct sst_render_config cfg;
    struct sst_renderer *r;
    struct sst_lightfield lf;
    struct sst_image out;
    struct sst_map_u8 valid;
    int differ = 0, dark = 0;

    take_frames(&calib);
    make("lf");
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_IMAGES, 2), 0);
    assert_int_equal(sst_renderer_create(&r, &lf, 2), 0);
    assert_int_equal(sst_image_init(&out, lf.width, lf.height), 0);
    assert_int_equal(sst_map_u8_init(&valid, lf.width, lf.height), 0);
    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_REFOCUS;
    cfg.focus_px = lf.focal_px * lf.spacing_mm / DEPTH;
    assert_int_equal(sst_render(r, &cfg, &out, &valid), 0);
    for (int y = 0; y < lf.height; y++) {
        for (int x = 0; x < lf.width; x++) {
            const struct sst_rectified *to = lf.rectified;
            const double a = (x - to->cx) / to->focal_px, b = (y - to->cy) / to->focal_px;
            double d[3];

            if (!sst_map_u8_row(&valid, y)[x]) {
                dark++;
                continue;
            }
            for (int i = 0; i < 3; i++)
                d[i] = to->rotation[i] * a + to->rotation[3 + i] * b + to->rotation[6 + i];
            /* A tilted array's plane has more than one depth: some blur is left, black is not. */
            differ += fabs(sst_image_row(&out, 1, y)[x] - seen((const double[3]){ 0, 0, 0 }, d, 1)) > 12;
        }
    }
    print_message("%d pixels without a ray, %d of the others off\n", dark, differ);
    assert_true(dark < lf.width * lf.height / 50);
    assert_int_equal(differ, 0);
    sst_map_u8_fini(&valid);
    sst_image_fini(&out);
    sst_renderer_destroy(r);
    sst_lightfield_fini(&lf);
    sst_calib_fini(&calib);
}

/* Pixels from outside the raw frame have no disparity, and do not spoil their neighbours. */
static void borders_do_not_match(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();
    struct sst_use_calibration use;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;
    long black = 0, wrong = 0, all = 0;

    take_frames(&calib);
    use = use_file();
    use.plan.focal_px = 250;
    assert_int_equal(import(test_path("lf"), &use), 0);
    sst_use_calibration_fini(&use);
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), SST_LOAD_IMAGES, 2), 0);
    assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
    cfg.disp_min_px = 4;
    cfg.disp_max_px = 24;
    cfg.threads = 2;
    assert_int_equal(sst_disparity_lightfield(&lf, &cfg, NULL, NULL), 0);
    for (int k = 0; k < ROWS * COLS; k++) {
        const struct sst_view *v = &lf.views[k];

        for (int y = 0; y < lf.height; y++) {
            for (int x = 0; x < lf.width; x++) {
                const uint16_t d = sst_map_u16_row(&v->disp, y)[x];

                if (!sst_map_u8_row(&v->valid, y)[x]) {
                    assert_true(d == SST_DISP_NONE && sst_map_u8_row(&v->confidence, y)[x] == 0);
                    black++;
                    continue;
                }
                all++;
                wrong += d == SST_DISP_NONE || fabs(sst_disp_px(&lf, d) - 250 * lf.spacing_mm / DEPTH) > 1.5;
            }
        }
    }
    print_message("%ld black, %ld of %ld others wrong\n", black, wrong, all);
    assert_true(black > 50000 && wrong < all / 100);
    sst_lightfield_fini(&lf);
    sst_calib_fini(&calib);
}

/* lightfield.json with `from` replaced by `to`. */
static void damage(const char *from, const char *to, const char *words)
{
    struct sst_lightfield lf;
    uint8_t *text;
    char *place, *changed;
    size_t size;

    assert_int_equal(sst_file_read(test_path("lf/lightfield.json"), 1 << 20, &text, &size), 0);
    place = strstr((char *)text, from);
    assert_non_null(place);
    changed = malloc(size + strlen(to) + 1);
    assert_non_null(changed);
    snprintf(changed, size + strlen(to) + 1, "%.*s%s%s", (int)(place - (char *)text), (char *)text, to,
             place + strlen(from));
    assert_int_equal(sst_file_write(test_path("lf/lightfield.json"), changed, strlen(changed)), 0);
    REFUSED(sst_lightfield_load(&lf, test_path("lf"), 0, 1), -EBADMSG, words);
    assert_int_equal(sst_file_write(test_path("lf/lightfield.json"), text, size), 0);
    free(changed);
    free(text);
}

static void damaged_folders(void **state SST_UNUSED)
{
    struct sst_calib calib = bad_array();

    take_frames(&calib);
    make("lf");
    damage("\"version\": 2", "\"version\": 3", "version 3 is newer than 2");
    damage("\"version\": 2", "\"version\": 1", "calibration is a field that this version does not know");
    damage("\"filter\": \"bicubic\"", "\"filter\": \"best\"", "calibration.filter is not bilinear");
    damage("\"file\": \"calibration.yaml\"", "\"file\": \"/etc/passwd\"", "calibration.file is not");
    damage("\"reference\": 1", "\"reference\": 6", "calibration.reference is not a whole number in 0..5");
    damage("\"rotation\": [", "\"rotation\": [ 1,", "calibration.rotation is not a list of at most 9");
    damage("\"plane_mm\"", "\"plane\"", "calibration.plane_mm is missing");
    damage("\"plane_mm\": 2000.0", "\"plane_mm\": -1", "spacing_mm is out of range");
    damage("\"spacing_mm\": ", "\"spacing_mm\": 1", "does not match its light field");
    damage("\"sha256\": \"", "\"sha256\": \"X", "sha256 is not");
    sst_calib_fini(&calib);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(rectified_views_show_the_plane),
        serial_test(light_is_corrected),
        serial_test(a_correction_corrects_the_calibration),
        cmocka_unit_test(threads_raw_and_bake),
        cmocka_unit_test(maps_and_versions),
        serial_test(what_does_not_fit),
        serial_test(rays_from_outside_do_not_count),
        serial_test(borders_do_not_match),
        serial_test(damaged_folders),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
