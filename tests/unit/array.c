/* The array's configuration: the shipped file equals the defaults, values arrive, faults are all told with places. */
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
        cmocka_unit_test(missing_file_is_told),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
