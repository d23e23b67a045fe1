/* The array's configuration: the shipped file equals the defaults, values arrive, faults are all told with places. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "config/array.h"
#include "tests/test.h"

static char said[SST_LOG_MAX];

static int read_text(struct sst_array_config *cfg, const char *text)
{
    char path[] = "/tmp/sst-array-XXXXXX", *before;
    const int fd = mkstemp(path);
    int err;

    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), strlen(text));
    close(fd);
    before = sst_log_hold_errors(said);
    err = sst_array_config_read(cfg, path);
    sst_log_hold_errors(before);
    unlink(path);
    return err;
}

static void shipped_file_is_the_defaults(void **state)
{
    struct sst_array_config a, b;

    (void)state;
    sst_array_config_defaults(&a);
    b = a;
    assert_int_equal(sst_array_config_read(&b, "config/sstd.yaml"), 0);
    assert_memory_equal(&a, &b, sizeof(a));
}

static void values_arrive(void **state)
{
    struct sst_array_config c;

    (void)state;
    sst_array_config_defaults(&c);
    assert_int_equal(read_text(&c, "array: { rows: 2, cols: 2, spacing_mm: 12.5 }\n"
                                   "cameras:\n"
                                   "  format: GREY\n"
                                   "  controls: { auto_exposure: 1, gain: -3 }\n"
                                   "  bind:\n"
                                   "    - { row: 1, col: 0, serial: A }\n"
                                   "    - { row: 0, col: 1, port: 1-2.3, line: T1 }\n"
                                   "trigger: { source: gpio, lines: [T0, T1], delay_us: [0, 250], loopback: L }\n"
                                   "rig: { axes: 3, units: [7, 8, 9], um_per_count: [1, -2, 0.5] }\n"),
                     0);
    assert_int_equal(c.rows, 2);
    assert_true(c.spacing_mm == 12.5);
    assert_int_equal(c.fourcc, 'G' | 'R' << 8 | 'E' << 16 | 'Y' << 24);
    assert_int_equal(c.controls, 2);
    assert_string_equal(c.control[1].name, "gain");
    assert_int_equal(c.control[1].value, -3);
    assert_int_equal(c.bound, 2);
    assert_string_equal(c.camera[0].serial, "A");
    assert_int_equal(c.camera[0].line, 1); /* two lines, two rows: the line of its row */
    assert_string_equal(c.camera[1].port, "1-2.3");
    assert_int_equal(c.camera[1].line, 1);
    assert_int_equal(c.source, SST_CONFIG_GPIO);
    assert_int_equal(c.delay_us[1], 250);
    assert_int_equal(c.rig_unit[2], 9);
    assert_true(c.rig_um_per_count[1] == -2);
}

static void refuse(const char *text, const char *words)
{
    struct sst_array_config c, before;

    sst_array_config_defaults(&c);
    before = c;
    assert_int_equal(read_text(&c, text), -EBADMSG);
    assert_memory_equal(&c, &before, sizeof(c));
    assert_contains(said, words);
}

static void faults_are_told(void **state)
{
    (void)state;
    refuse("array: { rows: 20, cols: 20 }\n", "limit of 256");
    refuse("camera: {}\n", "camera");
    refuse("cameras: { format: H264 }\n", "H264");
    refuse("cameras: { controls: { gain: 1.5 } }\n", "whole number");
    refuse("cameras: { bind: [ { row: 0, col: 0 } ] }\n", "serial or its port");
    refuse("cameras: { bind: [ { row: 6, col: 0, serial: A } ] }\n", "row");
    refuse("cameras: { bind: [ { row: 0, col: 0, serial: A }, { row: 0, col: 0, serial: B } ] }\n",
           "assigns a second camera");
    refuse("cameras: { bind: [ { row: 0, col: 0, serial: A }, { row: 0, col: 1, serial: A } ] }\n", "serial A twice");
    refuse("cameras: { bind: [ { row: 0, col: 0, serial: A, line: X } ] }\n", "unknown trigger line `X`");
    refuse("trigger: { source: gpio }\n", "needs trigger: lines");
    refuse("trigger: { source: gpio, lines: [A, A] }\n", "twice");
    refuse("trigger: { source: gpio, lines: [A], pulse_us: 95000 }\n", "more than 90 % of the trigger period");
    refuse("rig: { travel_min_mm: 5, travel_max_mm: 5 }\n", "travel_min_mm");
}

static void splits_are_checked(void **state)
{
    struct sst_array_config c;
    int split[2];

    (void)state;
    sst_array_config_defaults(&c);
    assert_int_equal(sst_array_split(&c, split), 1);
    assert_int_equal(read_text(&c, "array: { rows: 2, cols: 4 }\n"
                                   "trigger: { source: gpio, lines: [T0, T1] }\n"
                                   "cameras:\n"
                                   "  split: 2x1\n"
                                   "  bind:\n"
                                   "    - { row: 0, col: 0, serial: \"A#1\" }\n"
                                   "    - { row: 1, col: 0, serial: \"A#2\" }\n"
                                   "    - { row: 1, col: 3, port: \"1-2#1\", line: T1 }\n"),
                     0);
    assert_int_equal(sst_array_split(&c, split), 2);
    assert_int_equal(split[0], 2);
    assert_int_equal(split[1], 1);
    assert_int_equal(c.camera[1].line, 0); /* a picture is exposed by one line, whatever its rows are */
    assert_int_equal(c.camera[2].line, 1);
    refuse("cameras: { split: 4 }\n", "must be rows x columns of cameras in a picture such as 2x2");
    refuse("cameras: { split: 3x8 }\n", "at most 16, not 3x8");
    refuse("cameras: { split: 0x2 }\n", "rows x columns");
    refuse("cameras: { split: 2x2, width: 324 }\n", "cuts MJPEG pictures into cameras of 324x480, whose edges lie within");
    refuse("cameras: { split: 1x2, format: YUYV, width: 641 }\n", "set width to a multiple of 2");
    refuse("cameras: { split: 2x1, format: RGGB8, height: 481 }\n", "height of 2");
    refuse("cameras: { split: 2x1, format: MJPEG, height: 484 }\n", "height of 8");
    refuse("cameras: { split: 1x4, format: GREY, width: 5000 }\n", "makes pictures of 20000x480");
    refuse("cameras: { split: 2x2, bind: [ { row: 0, col: 0, serial: A } ] }\n", "name one, such as \"A#1\"");
    refuse("cameras: { split: 2x2, bind: [ { row: 0, col: 0, serial: \"A#5\" } ] }\n", "have 4 cameras");
    refuse("cameras: { split: 2x2, bind: [ { row: 0, col: 0, port: 1-2#2 }, { row: 0, col: 1, port: 1-2#2 } ] }\n",
           "port 1-2#2 twice");
    refuse("trigger: { source: gpio, lines: [X, Y] }\n"
           "cameras: { split: 1x2, bind: [ { row: 0, col: 0, serial: A#1, line: X }, "
           "{ row: 0, col: 1, serial: A#2, line: Y } ] }\n",
           "exposes A#2 by another line than A#1, which is in the same picture");
    /* Edges that are no seams may lie anywhere. */
    assert_int_equal(read_text(&c, "cameras: { split: 1x4, format: YUYV, width: 640, height: 481 }\n"), 0);
}

/* Boards fill the grid in blocks of their form, where it divides into them; else camera by camera. */
static void parts_have_places(void **state)
{
    static const struct {
        int rows, cols;
        const char *split;
        int places[8][2];
    } cases[] = {
        { 2, 4, "2x2", { { 0, 0 }, { 0, 1 }, { 1, 0 }, { 1, 1 }, { 0, 2 }, { 0, 3 }, { 1, 2 }, { 1, 3 } } },
        { 4, 2, "1x2", { { 0, 0 }, { 0, 1 }, { 1, 0 }, { 1, 1 }, { 2, 0 }, { 2, 1 }, { 3, 0 }, { 3, 1 } } },
        { 1, 8, "2x2", { { 0, 0 }, { 0, 1 }, { 0, 2 }, { 0, 3 }, { 0, 4 }, { 0, 5 }, { 0, 6 }, { 0, 7 } } },
        { 2, 4, "1x1", { { 0, 0 }, { 0, 1 }, { 0, 2 }, { 0, 3 }, { 1, 0 }, { 1, 1 }, { 1, 2 }, { 1, 3 } } },
    };
    struct sst_array_config c;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        sst_array_config_defaults(&c);
        c.rows = cases[i].rows;
        c.cols = cases[i].cols;
        strcpy(c.split, cases[i].split);
        for (int n = 0; n < 8; n++) {
            int row, col;

            sst_array_place(&c, n, &row, &col);
            assert_int_equal(row, cases[i].places[n][0]);
            assert_int_equal(col, cases[i].places[n][1]);
        }
    }
}

static void missing_file_is_told(void **state)
{
    struct sst_array_config c;
    char *before = sst_log_hold_errors(said);

    (void)state;
    sst_array_config_defaults(&c);
    assert_int_equal(sst_array_config_read(&c, "/nonexistent/sstd.yaml"), -ENOENT);
    sst_log_hold_errors(before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shipped_file_is_the_defaults),
        cmocka_unit_test(values_arrive),
        cmocka_unit_test(faults_are_told),
        cmocka_unit_test(splits_are_checked),
        cmocka_unit_test(parts_have_places),
        cmocka_unit_test(missing_file_is_told),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
