/* calib.yaml: every number survives a round trip bit for bit, every fault is reported with its position. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/camera/calib.h"
#include "tests/test.h"

static char path[] = "/tmp/sst-calib-XXXXXX.yaml";

static int setup(void **state SST_UNUSED)
{
    const int fd = mkstemps(path, 5);

    return fd < 0 ? -1 : close(fd);
}

static int teardown(void **state SST_UNUSED)
{
    unlink(path);
    return 0;
}

/* Numbers with long fractions, different for each view. */
static double odd(int view, int i)
{
    return sin(view * 37.0 + i * 1.7 + 0.1);
}

static void fill_camera(struct sst_calib_camera *c, int view)
{
    const double turn[3] = { 0.02 * odd(view, 20), 0.02 * odd(view, 21), 0.02 * odd(view, 22) };

    c->known = true;
    snprintf(c->name, sizeof(c->name), "cam \"%d\" \\ ü", view);
    c->fx = 2250 + odd(view, 0);
    c->fy = 2251 + odd(view, 1);
    c->cx = 999.5 + odd(view, 2);
    c->cy = 749.5 + odd(view, 3);
    c->lens = view % 3 == 0 ? 8 : view % 3 == 1 ? 5 : 0;
    for (int i = 0; i < c->lens; i++)
        c->k[i] = 0.1 * odd(view, 4 + i);
    sst_rotation_from_vector(turn, c->rotation);
    for (int i = 0; i < 3; i++) {
        c->position_mm[i] = 100 * odd(view, 12 + i);
        c->gain[i] = 1 + 0.1 * odd(view, 15 + i);
        c->falloff[i] = -0.1 * fabs(odd(view, 18 + i));
    }
    c->rms_px = 0.1 + 0.01 * odd(view, 23);
    c->corners = 1000 + view;
    c->sigma_px = 0.02;
}

static void fill(struct sst_calib *calib, int rows, int cols)
{
    assert_int_equal(sst_calib_init(calib, rows, cols), 0);
    calib->width = 2000;
    calib->height = 1500;
    calib->range_mm = 2000.0 / 3;
    calib->created_wall_ns = 1795270981123456789;
    calib->noise_px = 0.1;
    calib->rig = rows == 2;
    strcpy(calib->source, "captures/today: 36 cameras, 40 frames # all");
    strcpy(calib->board, "charuco:9x7:50mm:0.7");
    for (int k = 0; k < rows * cols; k++)
        fill_camera(&calib->camera[k], k);
}

static void check_same(const struct sst_calib *a, const struct sst_calib *b)
{
    assert_int_equal(a->rows, b->rows);
    assert_int_equal(a->cols, b->cols);
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    assert_int_equal(a->reference, b->reference);
    assert_int_equal(a->rig, b->rig);
    assert_memory_equal(&a->range_mm, &b->range_mm, sizeof(double));
    assert_memory_equal(&a->noise_px, &b->noise_px, sizeof(double));
    assert_true(a->created_wall_ns == b->created_wall_ns);
    assert_string_equal(a->source, b->source);
    assert_string_equal(a->board, b->board);
    for (int k = 0; k < a->rows * a->cols; k++) {
        const struct sst_calib_camera *p = &a->camera[k], *q = &b->camera[k];

        assert_int_equal(p->known, q->known);
        assert_string_equal(p->name, q->name);
        assert_int_equal(p->lens, q->lens);
        assert_int_equal(p->corners, q->corners);
        assert_memory_equal(&p->fx, &q->fx, 4 * sizeof(double));
        assert_memory_equal(p->k, q->k, sizeof(p->k));
        assert_memory_equal(p->rotation, q->rotation, sizeof(p->rotation));
        assert_memory_equal(p->position_mm, q->position_mm, sizeof(p->position_mm));
        assert_memory_equal(p->gain, q->gain, sizeof(p->gain));
        assert_memory_equal(p->falloff, q->falloff, sizeof(p->falloff));
        assert_memory_equal(&p->rms_px, &q->rms_px, sizeof(double));
        assert_memory_equal(&p->sigma_px, &q->sigma_px, sizeof(double));
    }
}

static void there_and_back(const struct sst_calib *calib)
{
    struct sst_calib back;

    assert_int_equal(sst_calib_write(calib, path), 0);
    assert_int_equal(sst_calib_read(&back, path), 0);
    check_same(calib, &back);
    sst_calib_fini(&back);
}

static void round_trip_is_exact(void **state SST_UNUSED)
{
    struct sst_calib calib;

    fill(&calib, 2, 3);
    calib.camera[4].known = false; /* a hole */
    memset(&calib.camera[4].name, 0, sizeof(calib.camera[4].name));
    calib.camera[4] = (struct sst_calib_camera){ .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, .gain = { 1, 1, 1 } };
    calib.camera[0].position_mm[0] = -0.0;
    calib.camera[0].position_mm[1] = 5e-324; /* the smallest number there is */
    calib.camera[0].position_mm[2] = nextafter(1e12, 0);
    calib.camera[0].cx = -DBL_MIN;
    calib.camera[5].name[0] = 0;
    calib.camera[5].corners = 0;
    calib.camera[5].rms_px = calib.camera[5].sigma_px = 0;
    there_and_back(&calib);
    sst_calib_fini(&calib);
}

static void bare_calibration_round_trips(void **state SST_UNUSED)
{
    struct sst_calib calib;

    assert_int_equal(sst_calib_init(&calib, 1, 1), 0);
    calib.width = 1;
    calib.height = 1;
    calib.camera[0].known = true;
    calib.camera[0].fx = calib.camera[0].fy = 1e-3;
    there_and_back(&calib);
    sst_calib_fini(&calib);
}

static void largest_grid_fits_the_reader(void **state SST_UNUSED)
{
    struct sst_calib calib;

    fill(&calib, 16, 16);
    for (int k = 0; k < 256; k++) {
        struct sst_calib_camera *c = &calib.camera[k];

        c->lens = 8;
        for (int i = 0; i < 8; i++)
            c->k[i] = -1e-200 * (1 + odd(k, i)); /* the longest decimals */
        memset(c->name, '"', sizeof(c->name) - 1);
    }
    there_and_back(&calib);
    sst_calib_fini(&calib);
}

/* Characters that YAML cannot represent are replaced, the file stays readable. */
static void strange_names_are_cleaned(void **state SST_UNUSED)
{
    static const char *const cases[][2] = {
        { "a\nb\tc\x7f", "a?b?c?" },
        { "\xff\xc3[", "?"
                       "?[" },
        { "\xc0\xaf", "??" },
        { "\xed\xa0\x80", "???" },
        { "\xc2\x85x\xe2\x80\xa8", "??x???" },
        { "\xf0\x9f\x93\xb7 ok", "\xf0\x9f\x93\xb7 ok" },
        { " # : - ' {} ", " # : - ' {} " },
        { "\xe2\x82", "??" },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_calib calib, back;

        fill(&calib, 1, 2);
        strcpy(calib.camera[1].name, cases[i][0]);
        assert_int_equal(sst_calib_write(&calib, path), 0);
        assert_int_equal(sst_calib_read(&back, path), 0);
        assert_string_equal(back.camera[1].name, cases[i][1]);
        sst_calib_fini(&calib);
        sst_calib_fini(&back);
    }
}

static void unsound_is_not_written(void **state SST_UNUSED)
{
    struct sst_calib calib;
    char said[SST_LOG_MAX] = "";

    fill(&calib, 1, 2);
    calib.camera[1].fx = NAN;
    unlink(path);
    sst_log_hold_errors(said);
    assert_int_equal(sst_calib_write(&calib, path), -EINVAL);
    sst_log_hold_errors(NULL);
    assert_non_null(strstr(said, "row 0, column 1: a number is not finite"));
    assert_int_equal(access(path, F_OK), -1);
    sst_calib_fini(&calib);
}

#define HEAD "format: sst-calib\nversion: 1\nrows: 1\ncols: 2\nwidth: 640\nheight: 480\nreference: [0, 0]\n"
#define LENS "focal_px: [500, 501], centre_px: [320, 240], distortion: [], "
#define POSE "rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], position_mm: [0, 0, 0]"
#define CAM0 "cameras:\n  - { row: 0, col: 0, " LENS POSE " }\n"

static void hand_written_file_is_read(void **state SST_UNUSED)
{
    static const char text[] =
        HEAD "created: 2026-01-31T00:00:01.5\nrig: true\n" CAM0
             "  - { row: 0, col: 1, name: x, focal_px: [600, 601], centre_px: [1, 2], distortion: [1, 2, 3, 4, 5], "
             "rotation: [0, -1, 0, 1, 0, 0, 0, 0, 1], position_mm: [7, 8, 9], gain: [1, 2, 3], "
             "falloff: [-0.1, -0.2, -0.3], quality: { corners: 5 } }\n";
    char good[sizeof(text) + 16];
    struct sst_calib calib;
    const struct sst_calib_camera *c;

    snprintf(good, sizeof(good), "%s", text);
    memcpy(strstr(good, "created"), "# eated", 7); /* a time in another format is a fault: see below */
    assert_int_equal(sst_calib_parse(&calib, good, strlen(good), "t"), 0);
    assert_int_equal(calib.rows, 1);
    assert_int_equal(calib.cols, 2);
    assert_int_equal(calib.width, 640);
    assert_int_equal(calib.height, 480);
    assert_true(calib.rig);
    c = &calib.camera[1];
    assert_string_equal(c->name, "x");
    assert_true(c->fx == 600 && c->fy == 601 && c->cx == 1 && c->cy == 2);
    assert_int_equal(c->lens, 5);
    assert_true(c->k[0] == 1 && c->k[2] == 3 && c->k[4] == 5 && c->k[5] == 0);
    assert_true(c->rotation[1] == -1 && c->rotation[3] == 1 && c->rotation[8] == 1);
    assert_true(c->position_mm[2] == 9 && c->gain[1] == 2 && c->falloff[2] == -0.3);
    assert_int_equal(c->corners, 5);
    sst_calib_fini(&calib);
}

/* Checks the last fault's line, and that the output is untouched. */
static void faults_name_their_place(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *said;
    } cases[] = {
        { "rows: 1\n", "t:1:1: lacks the key" },
        { HEAD, "t:1:1: lacks the key `cameras`" },
        { HEAD "cameras: []\n", "t:8:10: cameras must be a list with an entry" },
        { HEAD "cameras: [1]\n", "t:8:11: cameras needs entries" },
        { HEAD CAM0 "colour: 1\n", "t:10:1: unknown key `colour`" },
        { HEAD CAM0 "created: 2026-02-31T00:00:00.000000000Z\n", "t:10:10: created must be a time" },
        { HEAD CAM0 "created: 1960-02-01T00:00:00.000000000Z\n", "t:10:10: created must be a time" },
        { HEAD CAM0 "created: 2026-01-31T00:00:01.5\n", "t:10:10: created must be a time" },
        { HEAD CAM0 "created: 2261-99-01T00:00:00.000000000Z\n", "t:10:10: created must be a time" },
        { HEAD CAM0 "range_mm: nan\n", "t:10:11: range_mm must be a number" },
        { HEAD CAM0 "  - { row: 0, col: 2, " LENS POSE " }\n", "t:10:20: col must be a whole number in 0..1" },
        { HEAD CAM0 "  - { row: 0, col: 0, " LENS POSE " }\n", "two entries for row 0, column 0" },
        { HEAD CAM0 "  - { row: 0, col: 1, " POSE " }\n", "t:10:5: cameras lacks the key" },
        { HEAD CAM0 "  - { row: 0, col: 1, " LENS "rotation: 1, position_mm: [0, 0, 0] }\n",
          "rotation must be a list of 9 numbers" },
        { HEAD CAM0 "  - { row: 0, col: 1, " LENS "rotation: [-1,0,0,0,1,0,0,0,1], position_mm: [0, 0, 0] }\n",
          "t:10:5: cameras entry of row 0, column 1: rotation is not a rotation matrix" },
        { HEAD CAM0 "  - { row: 0, col: 1, " LENS POSE ", gain: [1, 0, 1] }\n", "a gain is not positive" },
        { HEAD CAM0 "  - { row: 0, col: 1, " LENS POSE ", gain: [1, 1e13, 1] }\n", "gain must be a number in" },
        { HEAD CAM0 "  - { row: 0, col: 1, " LENS POSE ", falloff: [-0.5, -0.5, 0] }\n", "no light in the corners" },
        { HEAD CAM0 "  - { row: 0, col: 1, " LENS POSE ", quality: 3 }\n", "quality needs the keys" },
        { "format: sst-calib\nversion: 2\nrows: x\n", "t:2:10: version is 2" },
        { "format: sst-calib\nversion: 1\nrows: 17\ncols: 16\n", "t:3:7: rows times cols is 272" },
        { "a list\n", "t:1:1: the file must contain keys" },
        { "rows: &a 1\n", "t:1:7: an anchor" },
        { "", "t:1:1: the file must contain keys" },
    };
    char focal_zero[] = HEAD CAM0, hole[] = HEAD CAM0;

    memcpy(strstr(focal_zero, "500"), "-50", 3);
    memcpy(strstr(hole, "[0, 0]"), "[0, 1]", 6);
    for (size_t i = 0; i < ARRAY_LEN(cases) + 2; i++) {
        const char *text = i < ARRAY_LEN(cases) ? cases[i].text : i == ARRAY_LEN(cases) ? focal_zero : hole;
        const char *want = i < ARRAY_LEN(cases)    ? cases[i].said
                           : i == ARRAY_LEN(cases) ? "t:9:5: cameras entry of row 0, column 0: the focal length"
                                                   : "t:7:12: reference is row 0, column 1, which has no entry";
        struct sst_calib calib = { .rows = 77 };
        char said[SST_LOG_MAX] = "";

        sst_log_hold_errors(said);
        assert_int_equal(sst_calib_parse(&calib, text, strlen(text), "t"), -EBADMSG);
        sst_log_hold_errors(NULL);
        if (!strstr(said, want))
            fail_msg("case %zu: not '%s' but '%s'", i, want, said);
        assert_int_equal(calib.rows, 77);
        assert_null(calib.camera);
    }
}

static void missing_file_is_told(void **state SST_UNUSED)
{
    struct sst_calib calib;
    char said[SST_LOG_MAX] = "";

    sst_log_hold_errors(said);
    assert_int_equal(sst_calib_read(&calib, "/nonexistent/calib.yaml"), -ENOENT);
    sst_log_hold_errors(NULL);
    assert_non_null(strstr(said, "/nonexistent/calib.yaml"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(round_trip_is_exact),          cmocka_unit_test(bare_calibration_round_trips),
        cmocka_unit_test(largest_grid_fits_the_reader), cmocka_unit_test(strange_names_are_cleaned),
        cmocka_unit_test(unsound_is_not_written),       cmocka_unit_test(hand_written_file_is_read),
        cmocka_unit_test(faults_name_their_place),      cmocka_unit_test(missing_file_is_told),
    };

    return cmocka_run_group_tests(tests, setup, teardown);
}
