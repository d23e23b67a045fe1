/* A capture over a grid with simulated drives: poses, folder, manifest, resume, refusals, the light field at the end.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>

#include "base/log.h"
#include "pipeline/lightfield/lightfield.h"
#include "tests/rig_bench.h"
#include "tests/test.h"

#define ATTEMPTS 5

static char said[SST_LOG_MAX];

static void poses_go_to_and_fro_and_come_from_below(void **state SST_UNUSED)
{
    const struct sst_scan_config cfg = {
        .rows = 2, .cols = 3, .pitch_um = { 40000, 30000 }, .origin_um = { 1000, 2000, 500 }, .backlash_um = 700
    };
    static const int order[] = { 0, 1, 2, 5, 4, 3 };
    struct sst_rig_pos from, to, via;

    for (int i = 0; i < 6; i++)
        assert_int_equal(sst_scan_view(&cfg, i), order[i]);
    to = sst_scan_pose(&cfg, 5);
    assert_int_equal(to.um[0], 81000);
    assert_int_equal(to.um[1], 32000);
    assert_int_equal(to.um[2], 500);
    from = sst_scan_pose(&cfg, 2);
    via = sst_scan_approach(&cfg, 2, &from, to); /* up only */
    assert_memory_equal(&via, &to, sizeof(via));
    to = sst_scan_pose(&cfg, 4);
    from = sst_scan_pose(&cfg, 5);
    via = sst_scan_approach(&cfg, 2, &from, to);
    assert_int_equal(via.um[0], 41000 - 700);
    assert_int_equal(via.um[1], 32000);
    via = sst_scan_approach(&cfg, 3, NULL, to);
    assert_int_equal(via.um[1], 32000 - 700);
    assert_int_equal(via.um[2], 500 - 700);
}

/* By hand: 100 mm/s, 1000 mm/s2: 10 mm are two ramps of 5 mm in 0.2 s; 40 mm take 0.1 s + 0.4 s. */
static void legs_are_trapezoids(void **state SST_UNUSED)
{
    struct sst_rig_config rig;
    const struct sst_rig_pos from = { { 0 } }, near = { { 10000, 2500, 0 } }, far = { { 1000, 40000, 0 } };

    sst_rig_config_defaults(&rig);
    rig.speed_mm_s = 100;
    rig.accel_mm_s2 = 1000;
    assert_float_equal(sst_scan_leg_s(&rig, &from, &near), 0.2, 1e-6);
    assert_float_equal(sst_scan_leg_s(&rig, &from, &far), 0.5, 1e-6);
}

static void the_plan_checks_the_travel(void **state SST_UNUSED)
{
    struct sst_scan_config cfg;
    struct sst_scan_plan plan;
    struct sst_rig_config rig;

    sst_scan_config_defaults(&cfg);
    sst_rig_config_defaults(&rig);
    cfg.origin_um[0] = cfg.origin_um[1] = 1000;
    assert_int_equal(sst_scan_plan(&plan, &cfg, &rig), 0);
    assert_int_equal(plan.views, 36);
    /* 1 mm from 0,0 to the first pose's approach is none: it is at 0. Then 1 + 6 * 5 * 40 + 5 * 40 and, in the three
     * rows from right to left, 5 times 1 mm down and up, and the first of them is not approached from above. */
    assert_float_equal(plan.way_mm, 1 + 30 * 40 + 5 * 40 + 15 * 2, 0.01);
    assert_int_equal(plan.bytes, 36 * 640 * 480 / 4);
    assert_true(plan.speed_assumed);
    (void)sst_log_hold_errors(said);
    cfg.pitch_um[0] = 60000;
    assert_int_equal(sst_scan_plan(&plan, &cfg, &rig), -EINVAL);
    assert_contains(said, "301.000");
    cfg.pitch_um[0] = 40000;
    cfg.origin_um[1] = 999;
    assert_int_equal(sst_scan_plan(&plan, &cfg, &rig), -EINVAL);
    (void)sst_log_hold_errors(NULL);
}

static void a_capture_becomes_a_light_field(void **state SST_UNUSED)
{
    struct sst_scan_report report;
    struct sst_lightfield lf;
    struct bench b;

    for (int attempt = 1;; attempt++) {
        assert_int_equal(bench_start(&b, false), 0);
        b.cfg.rows = 2;
        b.cfg.cols = 3;
        assert_int_equal(bench_capture(&b, &report), 0);
        assert_int_equal(report.taken, 6);
        assert_int_equal(report.homed, 1);
        if (!report.again || attempt == ATTEMPTS)
            break;
        print_message("attempt %d: a view was tried again, as where the machine stands still\n", attempt);
        bench_end(&b);
    }
    assert_int_equal(report.again, 0);
    assert_int_equal(b.moving, 0);
    assert_int_equal(bench_good_views(&b), 6);
    assert_int_equal(sst_lightfield_load(&lf, b.dir, SST_LOAD_IMAGES, 1), 0);
    assert_float_equal(lf.spacing_mm, 4, 1e-9);
    for (int k = 0; k < 6; k++) {
        assert_float_equal(lf.views[k].bx, (k % 3) - 1, 0.004);
        assert_float_equal(lf.views[k].by, (k / 3), 0.004);
    }
    sst_lightfield_fini(&lf);
    assert_int_equal(bench_capture(&b, &report), 0); /* complete: nothing is done */
    assert_int_equal(report.taken, 0);
    assert_int_equal(report.there, 6);
    bench_end(&b);
}

static void damage(const struct bench *b, const char *name, bool remove_it)
{
    char path[160];
    FILE *f;

    snprintf(path, sizeof(path), "%s/views/%s", b->dir, name);
    if (remove_it) {
        assert_int_equal(unlink(path), 0);
        return;
    }
    f = fopen(path, "r+b");
    assert_non_null(f);
    assert_int_equal(fseek(f, 100, SEEK_SET), 0);
    assert_int_equal(fputc('!', f), '!');
    assert_int_equal(fclose(f), 0);
}

static void what_is_missing_is_taken_again(void **state SST_UNUSED)
{
    struct sst_scan_report report;
    struct sst_lightfield lf;
    struct bench b;
    char path[160];
    FILE *f;

    assert_int_equal(bench_start(&b, false), 0);
    b.cfg.rows = 1;
    b.cfg.cols = 4;
    assert_int_equal(bench_capture(&b, &report), 0);
    damage(&b, "00_01.png", false);
    damage(&b, "00_03.png", true);
    snprintf(path, sizeof(path), "%s/capture.jsonl", b.dir); /* a line that was cut short */
    f = fopen(path, "a");
    assert_non_null(f);
    assert_true(fputs("{\"view\":2,\"fi", f) >= 0);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(bench_capture(&b, &report), 0);
    assert_int_equal(report.there, 2);
    assert_int_equal(report.taken, 2);
    assert_int_equal(report.homed, 0);
    assert_int_equal(bench_good_views(&b), 4);
    assert_int_equal(sst_lightfield_load(&lf, b.dir, SST_LOAD_IMAGES, 1), 0);
    sst_lightfield_fini(&lf);
    bench_end(&b);
}

static void cancel_leaves_what_can_go_on(void **state SST_UNUSED)
{
    struct sst_scan_report report;
    atomic_bool cancel;
    struct bench b;

    atomic_init(&cancel, true);
    assert_int_equal(bench_start(&b, false), 0);
    b.cfg.rows = 1;
    b.cfg.cols = 2;
    b.cfg.cancel = &cancel;
    assert_int_equal(bench_capture(&b, &report), -EINTR);
    assert_int_equal(report.taken, 0);
    atomic_store(&cancel, false);
    b.cfg.must_exist = true;
    assert_int_equal(bench_capture(&b, &report), 0);
    assert_int_equal(report.taken, 2);
    bench_end(&b);
}

static int refused(struct bench *b)
{
    struct sst_scan_report report;
    int err;

    said[0] = 0;
    (void)sst_log_hold_errors(said);
    err = bench_capture(b, &report);
    (void)sst_log_hold_errors(NULL);
    return err;
}

static void refusals(void **state SST_UNUSED)
{
    struct sst_scan_report report;
    struct sst_scan_store *store;
    struct bench b;
    char path[160];

    assert_int_equal(bench_start(&b, false), 0);
    b.cfg.rows = b.cfg.cols = 1;
    b.cfg.must_exist = true;
    assert_int_equal(refused(&b), -ENOENT);
    assert_contains(said, "--resume");
    b.cfg.must_exist = false;
    snprintf(path, sizeof(path), "%s/letter.tmp-1", b.dir);
    close(open(path, O_CREAT | O_WRONLY, 0666));
    assert_int_equal(refused(&b), -EEXIST);
    assert_true(sst_path_exists(path));
    assert_int_equal(unlink(path), 0);
    assert_int_equal(bench_capture(&b, &report), 0);
    b.cfg.pitch_um[0] = 5000;
    b.cfg.width = 320;
    assert_int_equal(refused(&b), -EINVAL);
    assert_contains(said, "pitch_um was [4000,4000] and is now [5000,4000], width was 640 and is now 320");
    b.cfg.pitch_um[0] = 4000;
    b.cfg.width = BENCH_WIDTH;
    b.camera.serial = "SIM0002";
    assert_int_equal(refused(&b), -EINVAL);
    assert_contains(said, "SIM0001");
    b.camera.serial = "SIM0001";
    assert_int_equal(sst_scan_store_open(&store, &b.cfg), 0);
    assert_int_equal(refused(&b), -EBUSY);
    sst_scan_store_close(store);
    b.cfg.fourcc = 'Y' | 'U' << 8 | 'Y' << 16 | (uint32_t)'V' << 24;
    assert_int_equal(refused(&b), -EINVAL);
    bench_end(&b);
}

int main(void)
{
    const struct CMUnitTest plans[] = {
        cmocka_unit_test(poses_go_to_and_fro_and_come_from_below),
        cmocka_unit_test(legs_are_trapezoids),
        cmocka_unit_test(the_plan_checks_the_travel),
    };
    const struct CMUnitTest captures[] = {
        cmocka_unit_test(a_capture_becomes_a_light_field),
        cmocka_unit_test(what_is_missing_is_taken_again),
        cmocka_unit_test(cancel_leaves_what_can_go_on),
        cmocka_unit_test(refusals),
    };
    const int failed = cmocka_run_group_tests(plans, NULL, NULL);

    if (!WITH_MODBUS) {
        puts("built without libmodbus: nothing is captured");
        return failed ? failed : 77;
    }
    setenv("SST_PROFILES", "config/profiles", 1);
    return failed + cmocka_run_group_tests(captures, NULL, NULL);
}
