/* Matching with the learned cost on the dummy device: the bytes of the CPU, with little memory and faults as well. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "pipeline/method/network/device.h"
#include "tests/match_network.h"
#include "tests/small.h"

#define VIEWS 8

static char path[] = "/tmp/sst-learned-XXXXXX";

/* The learned cost alone and with the census, in the whole range. */
static void test_same_bytes(void **state)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 3, 3, 97, 60, 8);
    for (int i = 0; match_config_learned(&cfg, i, path); i++) {
        assert_int_equal(match_device_create(&cfg.runner, "dummy", 0), 0);
        match_compare(&lf, &cfg, &report);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, VIEWS);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_true(report.uploads >= 2 * VIEWS); /* colours and features; maps that the dummy does not compute */
        assert_string_equal(report.why, "");
        match_device_destroy(cfg.runner);
    }
    sst_lightfield_fini(&lf);
}

/* The network runs on the device as well: the dummy, which computes nothing, keeps no features. */
static void test_networks_share_the_device(void **state)
{
    struct sst_step_report report;
    struct sst_network_device_report networks;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;
    static const char *const devices[] = { "dummy", "dummy:memory=3" };
    char text[SST_LOG_MAX];

    (void)state;
    match_init(&lf, 1, 3, 60, 43, 6);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        int err;

        assert_true(match_config_learned(&cfg, 0, path));
        assert_int_equal(match_device_create(&cfg.runner, devices[i], 0), 0);
        sst_log_hold_errors(text);
        err = sst_network_device_open_on(&cfg.networks, cfg.runner->runner);
        sst_log_hold_errors(NULL);
        if (!err) { /* built with oneDNN */
            match_compare(&lf, &cfg, &report);
            sst_network_device_get_report(cfg.networks, &networks);
            assert_true(networks.runs >= 6); /* of them the half for the matching on the CPU */
            assert_int_equal(networks.on_cpu, 0);
            assert_int_equal(networks.kept, 0);
            assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
            sst_network_device_close(cfg.networks);
        }
        match_device_destroy(cfg.runner);
    }
    sst_lightfield_fini(&lf);
}

/* In windows, tile by tile; views described one by one on one thread, with one network. */
static void test_tiles(void **state)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 1, 3, 230, 192, 21);
    match_config_tiles(&cfg);
    cfg.cost = SST_COST_BOTH;
    cfg.model = path;
    cfg.precision = SST_PRECISION_F32;
    cfg.frugal = true;
    assert_int_equal(match_device_create(&cfg.runner, "dummy", 0), 0);
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 6); /* with those at a quarter of the size */
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);
}

/* Features that do not fit beside the rest are uploaded again; a volume that does not is matched in bands. */
static void test_little_memory(void **state)
{
    static const struct {
        const char *name;
        int config;
        bool bands;
    } devices[] = { { "dummy:memory=4", 0, false }, { "dummy:buffer=460", 2, true } };
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 3, 3, 97, 60, 8);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        assert_true(match_config_learned(&cfg, devices[i].config, path));
        assert_int_equal(match_device_create(&cfg.runner, devices[i].name, 0), 0);
        match_compare(&lf, &cfg, &report);
        print_message("%lld views, %lld in bands, %lld uploads\n",
                      (long long)report.items[SST_DISPARITY_MATCHED].device,
                      (long long)report.items[SST_DISPARITY_MATCHED].in_bands, (long long)report.uploads);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, VIEWS);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].in_bands, devices[i].bands ? VIEWS : 0);
        assert_true(devices[i].bands || report.uploads > 4 * VIEWS);
        match_device_destroy(cfg.runner);
    }
    sst_lightfield_fini(&lf);
}

/* The CPU makes the census that only it needs, and goes on with the features that there are. */
static void test_fallback(void **state)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;
    char name[32];

    (void)state;
    match_init(&lf, 3, 3, 97, 60, 8);
    snprintf(name, sizeof(name), "dummy:known=1,lost=%d", 40); /* at the second view of each opening */
    assert_true(match_config_learned(&cfg, 0, path));
    assert_int_equal(match_device_create(&cfg.runner, name, 0), 0);
    match_compare(&lf, &cfg, &report);
    print_message("%lld views, %lld on the CPU\n", (long long)report.items[SST_DISPARITY_MATCHED].device,
                  (long long)report.items[SST_DISPARITY_MATCHED].on_cpu);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].device + report.items[SST_DISPARITY_MATCHED].on_cpu, VIEWS);
    assert_true(report.items[SST_DISPARITY_MATCHED].device > 0 && report.items[SST_DISPARITY_MATCHED].on_cpu > 0 &&
                report.failures > 1);
    assert_string_equal(report.why, "the device is lost");
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(test_same_bytes), cmocka_unit_test(test_networks_share_the_device),
        serial_test(test_tiles),      serial_test(test_little_memory),
        serial_test(test_fallback),
    };
    int failed;

    if (!WITH_DNNL && !WITH_OPENCV) {
        fprintf(stderr, "skipped: this build runs no networks\n");
        return 77;
    }
    ow_feature_network(path, "1");
    failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    return failed;
}
