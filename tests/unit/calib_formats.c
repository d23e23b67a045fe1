/* Calibrations of other tools: hand-worked answers for each convention, refusals, and round trips. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/yaml.h"
#include "pipeline/camera/format.h"
#include "tests/folder.h"
#include "tests/test.h"

typedef int parse_fn(struct sst_calib *out, const char *text, size_t size, const char *name,
                     const struct sst_calib_format_config *cfg);

static struct sst_calib parsed(parse_fn *parse, const char *text, int rows, int cols)
{
    struct sst_calib calib;

    assert_int_equal(
        parse(&calib, text, strlen(text), "t", &(struct sst_calib_format_config){ .rows = rows, .cols = cols }), 0);
    return calib;
}

static void check_position(const struct sst_calib *calib, int view, double x, double y, double z)
{
    const double *p = calib->camera[view].position_mm;

    if (!(fabs(p[0] - x) < 1e-9 && fabs(p[1] - y) < 1e-9 && fabs(p[2] - z) < 1e-9))
        fail_msg("view %d is at %.12g, %.12g, %.12g", view, p[0], p[1], p[2]);
}

static void check_rotation(const struct sst_calib *calib, int view, const double want[9])
{
    for (int i = 0; i < 9; i++) {
        if (!(fabs(calib->camera[view].rotation[i] - want[i]) < 1e-12))
            fail_msg("view %d: rotation[%d] is %.17g", view, i, calib->camera[view].rotation[i]);
    }
}

static const double eye[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
static const double quarter[9] = { 0, -1, 0, 1, 0, 0, 0, 0, 1 }, quarter_back[9] = { 0, 1, 0, -1, 0, 0, 0, 0, 1 };

/* --- Kalibr ------------------------------------------------------------------------------------------------------- */

#define KALIBR(n, more)                                                                                                \
    "cam" n ":\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]\n  distortion_model: radtan\n"      \
    "  intrinsics: [500, 501, 320, 240]\n  resolution: [640, 480]\n  rostopic: /cam" n                                 \
    "/image_raw\n  cam_overlaps: [1]\n" more
#define TURN                                                                                                           \
    "  T_cn_cnm1:\n  - [0.0, -1.0, 0.0, 0.1]\n  - [1.0, 0.0, 0.0, 0.2]\n  - [0.0, 0.0, 1.0, 0.3]\n"                    \
    "  - [0.0, 0.0, 0.0, 1.0]\n"
#define SLIDE                                                                                                          \
    "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.05]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n"                   \
    "  - [0.0, 0.0, 0.0, 1.0]\n"

/* X_1 = Rz(90) X_0 + (100, 200, 300) mm, so camera 1 is at -Rz(-90) t = (-200, 100, -300). */
static void kalibr_chain_by_hand(void **state SST_UNUSED)
{
    struct sst_calib calib = parsed(sst_kalibr_parse, KALIBR("0", "") KALIBR("1", TURN), 1, 2);
    const struct sst_calib_camera *c = &calib.camera[1];

    assert_int_equal(calib.width, 640);
    assert_int_equal(calib.height, 480);
    assert_int_equal(calib.reference, 0);
    assert_true(c->fx == 500 && c->fy == 501 && c->cx == 320 && c->cy == 240);
    assert_int_equal(c->lens, 5);
    assert_true(c->k[0] == 0.1 && c->k[1] == 0.2 && c->k[2] == 0.3 && c->k[3] == 0.4 && c->k[4] == 0);
    check_position(&calib, 0, 0, 0, 0);
    check_position(&calib, 1, -200, 100, -300);
    check_rotation(&calib, 1, quarter);
    sst_calib_fini(&calib);

    /* Three in a row: the middle one is the reference, and the axes are its own. X_2 = X_1 - (50, 0, 0). */
    calib = parsed(sst_kalibr_parse, KALIBR("0", "") KALIBR("1", TURN) KALIBR("2", SLIDE), 1, 3);
    assert_int_equal(calib.reference, 1);
    check_position(&calib, 0, 100, 200, 300);
    check_rotation(&calib, 0, quarter_back);
    check_position(&calib, 1, 0, 0, 0);
    check_rotation(&calib, 1, eye);
    check_position(&calib, 2, 50, 0, 0);
    check_rotation(&calib, 2, eye);
    sst_calib_fini(&calib);
}

static void kalibr_keeps_places_and_units(void **state SST_UNUSED)
{
    static const char text[] = KALIBR("0", "  row: 1\n  col: 1\n") KALIBR("1", SLIDE "  row: 0\n  col: 0\n");
    struct sst_calib calib;

    assert_int_equal(
        sst_kalibr_parse(&calib, text, strlen(text), "t", &(struct sst_calib_format_config){ .unit_mm = 1 }), 0);
    assert_int_equal(calib.rows, 2);
    assert_int_equal(calib.cols, 2);
    assert_false(calib.camera[1].known);
    assert_int_equal(calib.reference, 0); /* (0, 0) is there */
    check_position(&calib, 3, -0.05, 0, 0);
    sst_calib_fini(&calib);
}

/* --- multical ----------------------------------------------------------------------------------------------------- */

#define CAM(dist)                                                                                                      \
    "{\"image_size\": [2000.0, 1500.0], \"K\": [[2251.5, 0, 985.7], [0, 2252.8, 763], [0, 0, 1]], \"dist\": " dist "}"

/* As its documentation's example: cam2 is 50 mm to the right of cam1, so cam2_to_cam1 has T = (-0.05, 0, 0). */
static void multical_poses_by_hand(void **state SST_UNUSED)
{
    static const char text[] = "{\"cameras\": {\"cam1\": " CAM("[-0.12, 0.32, 0.01, 0.02, -0.2]") ", \"cam2\": " CAM(
        "[[1, 2, 3, 4, 5, 6, 7, "
        "8]]") ", \"cam3\": " CAM("null") "}, \"camera_poses\": {"
                                          "\"cam3_to_cam2\": {\"R\": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], \"T\": [0.1, "
                                          "0.2, 0.3]},"
                                          "\"cam2_to_cam1\": {\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"T\": [-0.05, "
                                          "0, 0]},"
                                          "\"cam1\": {\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"T\": [0, 0, 0]}}, "
                                          "\"image_sets\": {}}";
    struct sst_calib calib = parsed(sst_multical_parse, text, 3, 1);

    assert_int_equal(calib.reference, 1); /* cam2, so all moves by -50 mm */
    assert_string_equal(calib.camera[0].name, "cam1");
    assert_int_equal(calib.width, 2000);
    assert_int_equal(calib.height, 1500);
    assert_true(calib.camera[0].fx == 2251.5 && calib.camera[0].fy == 2252.8 && calib.camera[0].cx == 985.7);
    assert_int_equal(calib.camera[0].lens, 5);
    assert_true(calib.camera[0].k[2] == 0.01 && calib.camera[0].k[4] == -0.2);
    assert_int_equal(calib.camera[1].lens, 8);
    assert_true(calib.camera[1].k[7] == 8);
    assert_int_equal(calib.camera[2].lens, 0);
    check_position(&calib, 0, -50, 0, 0);
    check_position(&calib, 1, 0, 0, 0);
    check_position(&calib, 2, -200, 100, -300); /* X_3 = Rz(90) X_2 + t, as above */
    check_rotation(&calib, 2, quarter);
    sst_calib_fini(&calib);
}

/* --- OpenCV ------------------------------------------------------------------------------------------------------- */

#define MATRIX(name, rows, cols, data)                                                                                 \
    name ": !!opencv-matrix\n   rows: " rows "\n   cols: " cols "\n   dt: d\n   data: [ " data " ]\n"
#define HEAD  "%YAML:1.0\n---\n"
#define K_YML MATRIX("camera_matrix", "3", "3", "5.0e+02, 0., 320.,\n       0., 501., 240., 0., 0., 1.")
#define D_YML MATRIX("distortion_coefficients", "1", "5", "1., 2., 3., 4., 5.")
#define S_YML "image_width: 640\nimage_height: 480\n"

static const char *const opencv_files[] = {
    HEAD "calibration_time: \"now & then\"\n" S_YML K_YML D_YML,
    "<?xml version=\"1.0\"?>\n<!-- by hand -->\n<opencv_storage>\n<calibration_time>\"x &lt; \\ "
    "y\"</calibration_time>\n"
    "<image_width>640</image_width>\n<image_height>480</image_height>\n<flags></flags>\n"
    "<list>\n  <_>\n    a b</_><_>2</_></list>\n"
    "<camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n"
    "    5.0e+02 0. 320. 0.\n    501. 240. 0. 0. 1.</data></camera_matrix>\n"
    "<distortion_coefficients type_id=\"opencv-matrix\"><rows>5</rows><cols>1</cols><dt>d</dt><data>1. 2. 3. 4. 5."
    "</data></distortion_coefficients>\n</opencv_storage>\n",
    "{\n    \"image_width\": 640,\n    \"image_height\": 480,\n    \"camera_matrix\": {\n        \"type_id\": "
    "\"opencv-matrix\",\n \"rows\": 3,\n \"cols\": 3,\n \"dt\": \"d\",\n \"data\": [ 5.0e+02, 0.0, 320.0, 0.0, 501.0, "
    "240.0, 0.0, 0.0, 1.0 ]\n    },\n \"distortion_coefficients\": {\"rows\": 1, \"cols\": 5, \"dt\": \"d\", \"data\": "
    "[1.0, 2, 3, 4, 5]}}\n",
    /* ROS */
    "image_width: 640\nimage_height: 480\ncamera_name: narrow\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [500, 0, 320, 0, 501, 240, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n"
    "  cols: 5\n  data: [1, 2, 3, 4, 5]\n",
};

static void opencv_files_by_hand(void **state SST_UNUSED)
{
    for (size_t i = 0; i < ARRAY_LEN(opencv_files); i++) {
        struct sst_calib calib = parsed(sst_opencv_parse, opencv_files[i], 0, 0);
        const struct sst_calib_camera *c = calib.camera;

        assert_string_equal(c->name, i == 3 ? "narrow" : "t");
        assert_true(calib.rows == 1 && calib.cols == 1 && calib.width == 640 && calib.height == 480);
        assert_true(c->fx == 500 && c->fy == 501 && c->cx == 320 && c->cy == 240);
        assert_int_equal(c->lens, 5);
        for (int k = 0; k < 5; k++)
            assert_true(c->k[k] == k + 1);
        sst_calib_fini(&calib);
    }
}

/* A folder: two cameras by their names, the second with a rotation vector; T in the unit given. */
static void opencv_folder_by_hand(void **state SST_UNUSED)
{
    static const char a[] =
        HEAD S_YML K_YML D_YML MATRIX("R", "3", "3", "1,0,0,0,1,0,0,0,1") MATRIX("T", "3", "1", "0,0,0");
    static const char b[] = HEAD S_YML K_YML MATRIX("distCoeffs", "4", "1", "1.,2.,3.,4.")
        MATRIX("R", "3", "1", "0., 0., 1.5707963267948966") MATRIX("T", "1", "3", "10.,20.,30.");
    const struct sst_calib_format_config cfg = { .unit_mm = 10 };
    struct sst_calib calib;

    assert_int_equal(sst_path_make_dir(test_path("cv")), 0);
    assert_int_equal(sst_file_write(test_path("cv/cam_00_00.yml"), a, strlen(a)), 0);
    assert_int_equal(sst_file_write(test_path("cv/cam_02_01.yaml"), b, strlen(b)), 0);
    assert_string_equal(sst_calib_format_of(test_path("cv"))->name, "opencv");
    assert_int_equal(sst_calib_format_find("opencv")->read(&calib, test_path("cv"), &cfg), 0);
    assert_int_equal(calib.rows, 3);
    assert_int_equal(calib.cols, 2);
    assert_int_equal(calib.reference, 0); /* nearest to (1, 0) */
    assert_int_equal(calib.camera[5].lens, 5);
    assert_true(calib.camera[5].k[3] == 4 && calib.camera[5].k[4] == 0);
    check_position(&calib, 5, -200, 100, -300);
    check_rotation(&calib, 5, quarter);
    sst_calib_fini(&calib);
}

static void opencv_stereo_by_hand(void **state SST_UNUSED)
{
    static const char in[] =
        HEAD MATRIX("M1", "3", "3", "500.,0,320,0,501,240,0,0,1") MATRIX("D1", "1", "5", "1,2,3,4,5")
            MATRIX("M2", "3", "3", "600.,0,321,0,601,241,0,0,1") MATRIX("D2", "1", "8", "1,2,3,4,5,6,7,8");
    static const char ex[] = HEAD MATRIX("R", "3", "3", "0,-1,0,1,0,0,0,0,1") MATRIX("T", "3", "1", "100.,200.,300.")
        MATRIX("Q", "4", "4", "1,0,0,0,0,1,0,0,0,0,0,0,0,0,0,1");
    struct sst_calib_format_config cfg = { .width = 640, .height = 480 };
    struct sst_calib calib;

    assert_int_equal(sst_path_make_dir(test_path("pair")), 0);
    assert_int_equal(sst_file_write(test_path("pair/intrinsics.yml"), in, strlen(in)), 0);
    assert_int_equal(sst_file_write(test_path("pair/extrinsics.yml"), ex, strlen(ex)), 0);
    assert_string_equal(sst_calib_format_of(test_path("pair"))->name, "opencv-stereo");
    assert_string_equal(sst_calib_format_of(test_path("pair/intrinsics.yml"))->name, "opencv-stereo");
    for (int i = 0; i < 2; i++) {
        const char *path = i ? test_path("pair/intrinsics.yml") : test_path("pair");

        assert_int_equal(sst_calib_format_find("opencv-stereo")->read(&calib, path, &cfg), 0);
        assert_true(calib.rows == 1 && calib.cols == 2);
        assert_true(calib.camera[1].fx == 600 && calib.camera[1].lens == 8 && calib.camera[1].k[7] == 8);
        check_position(&calib, 1, -200, 100, -300);
        check_rotation(&calib, 1, quarter);
        sst_calib_fini(&calib);
    }
}

/* --- refusals ----------------------------------------------------------------------------------------------------- */

static void refusals_say_why(void **state SST_UNUSED)
{
    static const struct {
        parse_fn *parse;
        int rows, cols, err;
        const char *text, *said;
    } cases[] = {
        { sst_kalibr_parse, 0, 0, -EINVAL, KALIBR("0", "") KALIBR("1", SLIDE), "add --grid" },
        { sst_kalibr_parse, 1, 3, -EINVAL, KALIBR("0", "") KALIBR("1", SLIDE), "do not fill a grid of 1 x 3" },
        { sst_kalibr_parse, 1, 2, -EBADMSG, KALIBR("0", "") KALIBR("1", ""), "lacks T_cn_cnm1" },
        { sst_kalibr_parse, 1, 2, -EBADMSG, "x: 1\n", "holds no camera" },
        { sst_kalibr_parse, 1, 1, -EBADMSG,
          "cam0:\n  camera_model: omni\n  distortion_model: equidistant\n  intrinsics: [1, 1, 1, 1]\n"
          "  resolution: [1, 1]\n",
          "t:3:21: distortion_model is equidistant, a fisheye model" },
        { sst_kalibr_parse, 1, 1, -EBADMSG,
          "cam0:\n  camera_model: pinhole\n  distortion_model: none\n  intrinsics: [0, 1, 1, 1]\n  resolution: [1, "
          "1]\n",
          "camera cam0: the focal length" },
        { sst_kalibr_parse, 1, 2, -EBADMSG,
          KALIBR("0", "") KALIBR("1", "  T_cn_cnm1: [[1,0,0,0],[0,1,0,0],[0,0,2,0],[0,0,0,1]]\n"),
          "not a rotation matrix" },
        { sst_kalibr_parse, 1, 2, -EBADMSG,
          KALIBR("0", "") KALIBR("1", "  T_cn_cnm1: [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]\n"), "end with the row" },
        { sst_kalibr_parse, 0, 0, -EBADMSG,
          KALIBR("0", "  row: 0\n  col: 0\n") KALIBR("1", SLIDE "  row: 0\n  col: 0\n"), "the same place" },
        { sst_kalibr_parse, 1, 1, -EINVAL,
          KALIBR("0", "  row: 0\n  col: 0\n") KALIBR("1", SLIDE "  row: 0\n  col: 1\n"), "beyond the --grid given" },
        { sst_kalibr_parse, 0, 0, -EINVAL, KALIBR("0", "  row: 255\n  col: 255\n"), "beyond the maximum of 256 views" },
        { sst_kalibr_parse, 1, 3, -EBADMSG, KALIBR("0", "") KALIBR("1", SLIDE) KALIBR("3", SLIDE),
          "cam3 follows cam2, which is missing" },
        { sst_kalibr_parse, 1, 2, -EBADMSG, KALIBR("1", SLIDE) KALIBR("2", SLIDE),
          "cam1 follows cam0, which is missing" },
        { sst_kalibr_parse, 1, 2, -EBADMSG, KALIBR("0", SLIDE) KALIBR("1", SLIDE), "no camera to start from" },
        { sst_kalibr_parse, 1, 2, -EBADMSG, KALIBR("0", "") KALIBR("1", SLIDE) KALIBR("01", SLIDE),
          "has the number of" },
        { sst_kalibr_parse, 1, 1, -EBADMSG, KALIBR("0", "") KALIBR("_left", SLIDE),
          "cam_left is a camera that is not" },
        { sst_kalibr_parse, 1, 1, -EBADMSG, KALIBR("0", "  xi: 1.2\n"), "xi is set (1.2)" },
        { sst_kalibr_parse, 1, 1, -EBADMSG,
          "cam0:\n  camera_model: ds\n  distortion_model: none\n  intrinsics: [1, 1, 1, 1]\n  resolution: [1, 1]\n",
          "camera_model is ds" },
        { sst_kalibr_parse, 1, 1, -EBADMSG,
          "cam0:\n  camera_model: pinhole\n  distortion_model: none\n  distortion_coeffs: [0.1, 0, 0, 0]\n"
          "  intrinsics: [1, 1, 1, 1]\n  resolution: [1, 1]\n",
          "distortion_model is none" },
        { sst_multical_parse, 0, 0, -EBADMSG,
          "{\"cameras\": {\"a\": " CAM("[[-0.02], [0.004], [-0.0008], [0.0001]]") "}}",
          "a: dist has four coefficients" },
        { sst_multical_parse, 0, 0, -EBADMSG,
          "{\"cameras\": {\"a\": " CAM("[0, 0, 0, 0, 0], \"model\": \"fisheye\"") "}}", "a: model is fisheye" },
        { sst_multical_parse, 0, 0, -EBADMSG, "{\"cameras\": {\"a\": " CAM("[0, 0, 0, 0, 0], \"xi\": [[1.5]]") "}}",
          "a: xi is set (1.5)" },
        { sst_multical_parse, 0, 0, -EBADMSG,
          "{\"is_fisheye\": true, \"cameras\": {\"a\": " CAM("[0, 0, 0, 0, 0]") "}}", "t: is_fisheye is set (true)" },
        { sst_multical_parse, 0, 0, -EBADMSG, "{", "t:1:1: not JSON" },
        { sst_multical_parse, 0, 0, -EBADMSG, "{}", "no objects" },
        { sst_multical_parse, 0, 0, -EBADMSG, "{\"cameras\": {\"a\": {}}}", "a: K is not a 3 x 3 matrix" },
        { sst_multical_parse, 0, 0, -EBADMSG, "{\"cameras\": {\"a\": " CAM("[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]") "}}",
          "thin-prism" },
        { sst_multical_parse, 0, 0, -EBADMSG, "{\"cameras\": {\"a\": " CAM("[1, 2]") "}}", "not 0, 4, 5" },
        { sst_multical_parse, 1, 2, -EBADMSG, "{\"cameras\": {\"a\": " CAM("[]") ", \"b\": " CAM("[]") "}}",
          "camera a: its pose (R, T) is missing" },
        { sst_multical_parse, 1, 1, -EBADMSG,
          "{\"cameras\": {\"a\": " CAM("[]") "}, \"camera_poses\": {\"c_to_a\": {}}}", "c_to_a: camera_poses names" },
        { sst_opencv_parse, 0, 0, -EINVAL, HEAD K_YML D_YML, "add --size" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML D_YML, "t:3:1: camera_matrix is missing" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML, "t:3:1: distortion_coefficients are missing" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML D_YML MATRIX("K", "3", "3", "1, 2, 0, 0, 1, 0, 0, 0, 1"),
          "K cannot be used: the camera matrix has a skew" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML D_YML MATRIX("K", "3", "3", "1, 0, 0, 0, .Nan, 0, 0, 0, 1"),
          "data must be a number" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML MATRIX("D", "2", "3", "1, 2, 3, 4"),
          "has 4 numbers, not rows times cols" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "fisheye_model: 1\n", "fisheye_model is set" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "distortion_model: equidistant\n",
          "is equidistant; only pinholes" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "xi: 1.35\n", "xi is set (1.35)" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML MATRIX("xi", "1", "1", "1.35"), "xi is set (1.35)" },
        { sst_opencv_parse, 0, 0, -EBADMSG,
          "<opencv_storage>\n<camera_matrix><rows>3</rows><cols>3</cols><data>500 0 320 0 501 240 0 0 1</data>"
          "</camera_matrix><distCoeffs><rows>1</rows><cols>4</cols><data>1 2 3 4</data></distCoeffs>\n"
          "<xi type_id=\"opencv-matrix\"><rows>1</rows><cols>1</cols><data>1.2</data></xi></opencv_storage>",
          "t:3:" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "alpha: 0.6\ncamera_model: eucm\n",
          "camera_model is eucm" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "use_fisheye: true\n", "use_fisheye is set" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "tauX: 0.01\n", "tauX is set" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "xi_1: 1.2\n", "xi_1 is set (1.2)" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD "cameraResolution: [ 0, 480 ]\n" K_YML D_YML, "cameraResolution" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "use_thin_prism: 1\n", "use_thin_prism is set" },
        { sst_opencv_parse, 0, 0, -EBADMSG, HEAD S_YML K_YML D_YML "lens:\n  model: Kannala-Brandt\n",
          "model is Kannala-Brandt" },
        { sst_opencv_parse, 0, 0, -EBADMSG,
          HEAD S_YML MATRIX("K", "3", "3", "5,0,2,0,5,2,0,0,1") MATRIX("D", "4", "1", "1,2,3,4"), "as a fisheye lens" },
        { sst_opencv_parse, 0, 0, -EBADMSG,
          HEAD S_YML K_YML D_YML MATRIX("R", "1", "3", "0., 90., 0.") MATRIX("T", "1", "3", "0., 0., 0."),
          "in degrees" },
        { sst_opencv_parse, 0, 0, -EBADMSG, "<?xml version=\"1.0\"?>\n<a></a>\n", "t:2: the outermost element" },
        { sst_opencv_parse, 0, 0, -EBADMSG, "<opencv_storage>\n<a>1</b></opencv_storage>", "closes another" },
        { sst_opencv_parse, 0, 0, -EBADMSG, "<opencv_storage>\n<!DOCTYPE x>", "unusual tag" },
        { sst_opencv_parse, 0, 0, -EBADMSG, "<opencv_storage><!-- ", "without an end" },
        { sst_opencv_parse, 0, 0, -EBADMSG, "<opencv_storage><a><_>1</_><b>2</b></a></opencv_storage>", "are mixed" },
        { sst_opencv_parse, 0, 0, -EBADMSG, "<", "unusual tag" },
        { sst_opencv_parse, 0, 0, -EBADMSG, "", "must contain keys" },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_calib calib = { .rows = 77 };
        char said[SST_LOG_MAX] = "";
        int err;

        sst_log_hold_errors(said);
        err = cases[i].parse(&calib, cases[i].text, strlen(cases[i].text), "t",
                             &(struct sst_calib_format_config){ .rows = cases[i].rows, .cols = cases[i].cols });
        sst_log_hold_errors(NULL);
        if (err != cases[i].err || !strstr(said, cases[i].said))
            fail_msg("case %zu: %d, not '%s' but '%s'", i, err, cases[i].said, said);
        assert_int_equal(calib.rows, 77);
    }
}

/* Parameters that look like another lens or a broken chain and are none. */
static void what_changes_nothing_is_read(void **state SST_UNUSED)
{
    static const struct {
        parse_fn *parse;
        int cameras;
        const char *text;
    } cases[] = {
        { sst_opencv_parse, 1,
          HEAD S_YML K_YML D_YML "xi: 0.\nfisheye_model: 0\nuse_fisheye: false\nmodel: ELP-720\n" },
        { sst_opencv_parse, 1,
          HEAD S_YML MATRIX("K", "3", "3", "5,0,2,0,5,2,0,0,1")
              MATRIX("D", "4", "1", "1,2,3,4") "distortion_model: plumb_bob\ncamera_model: pinhole\n" },
        { sst_kalibr_parse, 2, KALIBR("1", SLIDE) KALIBR("0", "") },
        { sst_kalibr_parse, 2, KALIBR("00", "") KALIBR("01", SLIDE) },
        { sst_kalibr_parse, 2, KALIBR("1", "") KALIBR("2", SLIDE) },
        { sst_kalibr_parse, 12,
          KALIBR("0", "") KALIBR("1", SLIDE) KALIBR("10", SLIDE) KALIBR("11", SLIDE) KALIBR("2", SLIDE)
              KALIBR("3", SLIDE) KALIBR("4", SLIDE) KALIBR("5", SLIDE) KALIBR("6", SLIDE) KALIBR("7", SLIDE)
                  KALIBR("8", SLIDE) KALIBR("9", SLIDE) },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_calib calib = parsed(cases[i].parse, cases[i].text, 1, cases[i].cameras);

        for (int k = 0; k < cases[i].cameras; k++)
            check_position(&calib, k, 50 * (k - calib.reference), 0, 0);
        sst_calib_fini(&calib);
    }
}

/* As PyYAML writes values that occur twice. */
static void kalibr_reads_aliases(void **state SST_UNUSED)
{
    static const char text[] =
        "cam0:\n  camera_model: pinhole\n  distortion_coeffs: &id001\n  - 0.1\n  - 0.2\n  - 0.3\n  - 0.4\n"
        "  distortion_model: &m radtan\n  intrinsics: [500, 501, 320, 240]\n  resolution: &id002 [640, 480]\n"
        "cam1:\n  camera_model: pinhole\n  distortion_coeffs: *id001\n  distortion_model: *m\n"
        "  intrinsics: [500, 501, 320, 240]\n  resolution: *id002\n" SLIDE;
    struct sst_calib calib = parsed(sst_kalibr_parse, text, 1, 2);

    assert_int_equal(calib.camera[1].lens, 5);
    assert_true(calib.camera[1].k[3] == 0.4 && calib.width == 640);
    check_position(&calib, 1, 50, 0, 0);
    sst_calib_fini(&calib);
}

/* Serial numbers look like places. */
static void names_need_not_be_places(void **state SST_UNUSED)
{
    static const char text[] = "{\"cameras\": {\"rig_0_3\": " CAM("[]") ", \"rig_0_12\": " CAM(
        "[]") "}, \"camera_poses\": {\"rig_0_3\": {\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"T\": [0, 0, 0]}, "
              "\"rig_0_12\": {\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"T\": [-0.05, 0, 0]}}}";
    struct sst_calib_format_config cfg = { .rows = 1, .cols = 2 };
    struct sst_calib calib;
    char said[SST_LOG_MAX] = "";

    sst_log_hold_errors(said);
    assert_int_equal(sst_multical_parse(&calib, text, strlen(text), "t", &cfg), -EINVAL);
    sst_log_hold_errors(NULL);
    assert_non_null(strstr(said, "--plain-names"));
    cfg.plain_names = true;
    assert_int_equal(sst_multical_parse(&calib, text, strlen(text), "t", &cfg), 0);
    assert_int_equal(calib.cols, 2);
    check_position(&calib, 1, 50, 0, 0);
    sst_calib_fini(&calib);
}

/* Every kind of text with the mark that Windows' editors begin with; and with the points of 500 pictures. */
static void files_may_have_a_mark_and_many_points(void **state SST_UNUSED)
{
    const char *path = test_path("marked");
    char said[SST_LOG_MAX] = "", *text;
    struct sst_calib_format_config cfg = { 0 };
    struct sst_calib calib;
    size_t size;
    FILE *f;

    for (size_t i = 0; i < ARRAY_LEN(opencv_files); i++) {
        f = open_memstream(&text, &size);
        fprintf(f, "\xef\xbb\xbf%s", opencv_files[i]);
        fclose(f);
        assert_int_equal(sst_file_write(path, text, size), 0);
        free(text);
        assert_int_equal(sst_calib_format_of(path)->read(&calib, path, &cfg), 0);
        assert_true(calib.camera[0].fx == 500);
        sst_calib_fini(&calib);
    }
    assert_int_equal(sst_file_write(path, "\xff\xfe%\0Y\0", 6), 0);
    sst_log_hold_errors(said);
    assert_null(sst_calib_format_of(path));
    sst_log_hold_errors(NULL);
    assert_non_null(strstr(said, "UTF-16"));

    f = open_memstream(&text, &size);
    fputs(HEAD S_YML K_YML D_YML
          "image_points: !!opencv-matrix\n   rows: 500\n   cols: 88\n   dt: \"2f\"\n   data: [ 0.",
          f);
    for (int i = 1; i < 88000; i++)
        fprintf(f, ", 3.%015d", i);
    fputs(" ]\npoints:\n", f);
    for (int i = 0; i < 500; i++)
        fputs("   - { a: [ [ 1., 2. ], [ 1., 2. ] ] }\n", f);
    fclose(f);
    assert_int_equal(sst_file_write(path, text, size), 0);
    assert_true(size > SST_YAML_MAX_BYTES);
    free(text);
    assert_int_equal(sst_calib_format_of(path)->read(&calib, path, &cfg), 0);
    assert_true(calib.camera[0].fx == 500 && calib.camera[0].k[4] == 5);
    sst_calib_fini(&calib);
}

/* --- there and back ----------------------------------------------------------------------------------------------- */

static void fill(struct sst_calib *calib, int lens)
{
    assert_int_equal(sst_calib_init(calib, 2, 3), 0);
    calib->width = 640;
    calib->height = 480;
    calib->range_mm = 1500;
    for (int k = 0; k < 6; k++) {
        struct sst_calib_camera *c = &calib->camera[k];
        const double v[3] = { 0.03 * sin(k), 0.05 * cos(3.0 * k), 0.02 * k };

        c->known = k != 4;
        snprintf(c->name, sizeof(c->name), "serial %d", k);
        c->fx = 500 + k / 3.0;
        c->fy = 501 - k / 7.0;
        c->cx = 320 + sin(5.0 * k);
        c->cy = 240 - k / 11.0;
        c->lens = lens;
        c->k[0] = lens ? -0.1 - 0.01 * k : 0;
        c->k[1] = lens ? 0.02 : 0;
        c->k[2] = lens ? 1e-4 * k : 0;
        c->k[3] = lens ? -1e-5 : 0;
        c->k[4] = lens ? 1e-3 * k : 0;
        c->k[6] = lens == 8 ? 0.01 * k : 0;
        if (k == calib->reference)
            continue;
        sst_rotation_from_vector(v, c->rotation);
        c->position_mm[0] = 40 * (k % 3 - 1) + 0.1 * k;
        c->position_mm[1] = 40 * (k / 3) - 0.3 * k;
        c->position_mm[2] = 0.2 * k;
    }
}

static void check_like(const struct sst_calib *a, const struct sst_calib *b, bool lens)
{
    assert_int_equal(a->rows, b->rows);
    assert_int_equal(a->cols, b->cols);
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    assert_int_equal(a->reference, b->reference);
    for (int k = 0; k < 6; k++) {
        const struct sst_calib_camera *p = &a->camera[k], *q = &b->camera[k];

        assert_int_equal(p->known, q->known);
        if (!p->known)
            continue;
        assert_memory_equal(&p->fx, &q->fx, 4 * sizeof(double));
        for (int i = 0; lens && i < SST_LENS_MAX; i++)
            assert_true(p->k[i] == q->k[i]);
        check_position(b, k, p->position_mm[0], p->position_mm[1], p->position_mm[2]);
        check_rotation(b, k, p->rotation);
    }
}

static void every_format_reads_what_it_writes(void **state SST_UNUSED)
{
    static const struct {
        const char *format, *path;
    } cases[] = { { "opencv", "folder" },
                  { "multical", "calibration.json" },
                  { "kalibr", "camchain.yaml" },
                  { "sst", "calib.yaml" } };
    const struct sst_calib_format_config cfg = { .lossy = true };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        for (int lens = 0; lens <= 8; lens += lens ? 3 : 5) {
            const char *path = test_path("%s", cases[i].path);
            struct sst_calib calib, back;

            sst_path_remove_tree(path);
            fill(&calib, lens);
            sst_log_set_level(SST_LOG_ERROR); /* the Kalibr format warns about lost data */
            assert_string_equal(sst_calib_format_for(path)->name, cases[i].format);
            assert_int_equal(sst_calib_format_for(path)->write(&calib, path, &cfg), 0);
            sst_log_set_level(SST_LOG_WARNING);
            assert_string_equal(sst_calib_format_of(path)->name, cases[i].format);
            assert_int_equal(sst_calib_format_of(path)->read(&back, path, &(struct sst_calib_format_config){ 0 }), 0);
            check_like(&calib, &back, i != 2);
            sst_calib_fini(&calib);
            sst_calib_fini(&back);
        }
    }
}

static void stereo_reads_what_it_writes(void **state SST_UNUSED)
{
    const struct sst_calib_format *f = sst_calib_format_find("opencv-stereo");
    const char *path = test_path("stereo");
    struct sst_calib calib, back;
    char said[SST_LOG_MAX] = "";

    fill(&calib, 8);
    sst_log_hold_errors(said);
    assert_int_equal(f->write(&calib, path, &(struct sst_calib_format_config){ 0 }), -EINVAL);
    sst_log_hold_errors(NULL);
    assert_non_null(strstr(said, "two cameras"));
    assert_false(sst_path_exists(path));
    for (int k = 0; k < 6; k++)
        calib.camera[k].known = k == 1 || k == 2;
    assert_int_equal(f->write(&calib, path, &(struct sst_calib_format_config){ 0 }), 0);
    assert_int_equal(f->read(&back, path, &(struct sst_calib_format_config){ 0 }), 0);
    assert_true(back.rows == 1 && back.cols == 2 && back.width == 640);
    assert_memory_equal(&back.camera[1].fx, &calib.camera[2].fx, 4 * sizeof(double));
    assert_memory_equal(back.camera[1].k, calib.camera[2].k, sizeof(back.camera[1].k));
    for (int i = 0; i < 3; i++)
        assert_true(fabs(back.camera[1].position_mm[i] - calib.camera[2].position_mm[i]) < 1e-9);
    sst_calib_fini(&calib);
    sst_calib_fini(&back);
}

/* --- lenses with fewer coefficients ------------------------------------------------------------------------------- */

static struct sst_calib_camera wide(void)
{
    struct sst_calib_camera cam = { .known = true, .fx = 500, .fy = 500, .cx = 320, .cy = 240, .lens = 5 };

    memcpy(cam.rotation, eye, sizeof(eye));
    cam.gain[0] = cam.gain[1] = cam.gain[2] = 1;
    return cam;
}

static void lens_that_fits_is_kept(void **state SST_UNUSED)
{
    struct sst_calib_camera in = wide(), out;
    double worst = 9;

    in.lens = 8;
    in.k[0] = -0.1;
    in.k[1] = 0.01;
    in.k[2] = 1e-3;
    in.k[3] = -1e-3;
    assert_int_equal(sst_lens_reduce(&out, &worst, &in, 640, 480, 4), 0);
    assert_true(worst == 0);
    assert_int_equal(out.lens, 5);
    assert_memory_equal(out.k, in.k, sizeof(in.k));
    in.k[4] = 0.01;
    assert_int_equal(sst_lens_reduce(&out, &worst, &in, 640, 480, 5), 0);
    assert_true(worst == 0 && out.k[4] == 0.01);
    in = wide();
    in.lens = 0;
    assert_int_equal(sst_lens_reduce(&out, &worst, &in, 640, 480, 4), 0);
    assert_true(worst == 0 && out.lens == 0);
}

/* (1 + k1 r2) / (1 + k4 r2) with k4 = k1 is 1: the fit finds no distortion. */
static void lens_that_cancels_becomes_none(void **state SST_UNUSED)
{
    struct sst_calib_camera in = wide(), out;
    double worst;

    in.lens = 8;
    in.k[0] = in.k[5] = 0.3;
    assert_int_equal(sst_lens_reduce(&out, &worst, &in, 640, 480, 4), 0);
    assert_true(worst < 1e-9);
    for (int i = 0; i < 4; i++)
        assert_true(fabs(out.k[i]) < 1e-10);
}

/* Least squares: no small change of a coefficient makes the sum of squares over the picture smaller. */
static double squares(const struct sst_calib_camera *a, const struct sst_calib_camera *b)
{
    double sum = 0;

    for (int i = 0; i < 49 * 37; i++) {
        double u, v, x[2], y[2];

        assert_true(sst_camera_undistort(a, i % 49 * 639.0 / 48, i / 49 * 479.0 / 36, &u, &v));
        sst_camera_distort(a, u, v, &x[0], &y[0]);
        sst_camera_distort(b, u, v, &x[1], &y[1]);
        sum += (x[1] - x[0]) * (x[1] - x[0]) + (y[1] - y[0]) * (y[1] - y[0]);
    }
    return sum;
}

static void lens_fit_is_the_least(void **state SST_UNUSED)
{
    struct sst_calib_camera in = wide(), out;
    double worst, least;

    in.k[0] = -0.2;
    in.k[1] = 0.1;
    in.k[2] = 1e-3;
    in.k[3] = 2e-3;
    in.k[4] = 0.3;
    in.cx = 300;
    in.fy = 510;
    assert_int_equal(sst_lens_reduce(&out, &worst, &in, 640, 480, 4), 0);
    least = squares(&in, &out);
    if (!(worst > 0.1 && worst < 10))
        fail_msg("%g px", worst);
    for (int i = 0; i < 8; i++) {
        struct sst_calib_camera near = out;

        near.k[i / 2] += i % 2 ? 1e-5 : -1e-5;
        assert_true(squares(&in, &near) > least);
    }
}

static void lens_in_odd_pictures(void **state SST_UNUSED)
{
    struct sst_calib_camera in = wide(), out;
    double worst;

    in.k[4] = 0.5;
    assert_int_equal(sst_lens_reduce(&out, &worst, &in, 1, 1, 4), 0); /* one pixel: one equation for all */
    assert_true(isfinite(out.k[0]) && isfinite(out.k[3]) && worst < 1e-3);
    in.k[0] = -50; /* folds over near the centre */
    in.k[4] = 0;
    in.k[5] = 1e-3;
    assert_int_equal(sst_lens_reduce(&out, &worst, &in, 640, 480, 4), -EBADMSG);
}

static void lossy_is_asked_for(void **state SST_UNUSED)
{
    struct sst_calib calib, out = { .rows = 77 };
    char said[SST_LOG_MAX] = "";

    fill(&calib, 8);
    calib.camera[2].k[4] = 0.5;
    sst_log_hold_errors(said);
    assert_int_equal(sst_calib_reduce(&out, &calib, 4, false, "Test"), -EBADMSG);
    sst_log_hold_errors(NULL);
    assert_non_null(strstr(said, "row 0, column 2"));
    assert_non_null(strstr(said, "--lossy"));
    assert_int_equal(out.rows, 77);
    sst_log_set_level(SST_LOG_ERROR);
    assert_int_equal(sst_calib_reduce(&out, &calib, 4, true, "Test"), 0);
    sst_log_set_level(SST_LOG_WARNING);
    assert_true(out.camera[2].k[4] == 0);
    sst_calib_fini(&calib);
    sst_calib_fini(&out);
}

/* --- which format ------------------------------------------------------------------------------------------------- */

static void names_suggest_formats(void **state SST_UNUSED)
{
    static const char *const cases[][2] = {
        { "calib.yaml", "sst" },  { "x/rig-camchain-1.yaml", "kalibr" },
        { "a.json", "multical" }, { "cam.yml", "opencv" },
        { "folder", "opencv" },   { "a.b/folder", "opencv" },
        { "folder/", "opencv" },  { "a.cameramodel", "mrcal" },
    };
    static const char *const names[] = { "sst", "opencv", "opencv-stereo", "kalibr", "multical", "mrcal" };
    char said[SST_LOG_MAX] = "";

    for (size_t i = 0; i < ARRAY_LEN(cases); i++)
        assert_string_equal(sst_calib_format_for(cases[i][0])->name, cases[i][1]);
    sst_log_hold_errors(said);
    assert_null(sst_calib_format_for("a.txt"));
    assert_null(sst_calib_format_find("colmap"));
    assert_null(sst_calib_format_of("/nonexistent"));
    sst_log_hold_errors(NULL);
    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        assert_string_equal(sst_calib_format_find(names[i])->name, names[i]);
        assert_non_null(sst_calib_format_find(names[i])->write);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kalibr_chain_by_hand),
        cmocka_unit_test(kalibr_keeps_places_and_units),
        cmocka_unit_test(multical_poses_by_hand),
        cmocka_unit_test(opencv_files_by_hand),
        cmocka_unit_test(opencv_folder_by_hand),
        cmocka_unit_test(opencv_stereo_by_hand),
        cmocka_unit_test(refusals_say_why),
        cmocka_unit_test(what_changes_nothing_is_read),
        cmocka_unit_test(kalibr_reads_aliases),
        cmocka_unit_test(names_need_not_be_places),
        cmocka_unit_test(files_may_have_a_mark_and_many_points),
        cmocka_unit_test(every_format_reads_what_it_writes),
        cmocka_unit_test(stereo_reads_what_it_writes),
        cmocka_unit_test(lens_that_fits_is_kept),
        cmocka_unit_test(lens_that_cancels_becomes_none),
        cmocka_unit_test(lens_fit_is_the_least),
        cmocka_unit_test(lens_in_odd_pictures),
        cmocka_unit_test(lossy_is_asked_for),
        cmocka_unit_test(names_suggest_formats),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
