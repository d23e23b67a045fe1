/* pipeline/method/refine on the dummy device: the CPU's labels, whatever fits, and whatever fails. */
#include <errno.h>

#include "base/log.h"
#include "tests/refine_field.h"
#include "tests/small.h"

struct device {
    struct sst_runner *shared;
    struct sst_refine_device *refine;
};

static void device_open(struct device *d, const char *name, uint64_t memory)
{
    assert_int_equal(sst_runner_create(&d->shared, name, memory), 0);
    assert_int_equal(sst_refine_device_create(&d->refine, d->shared), 0);
}

/* "dummy:lost=N", N counted from the end of the self-tests. */
static const char *after_tests(const char *fault, int after)
{
    static char name[64];

    snprintf(name, sizeof(name), "dummy:%s=%d", fault, refine_self_tests() + after);
    return name;
}

static void device_close(struct device *d)
{
    sst_refine_device_destroy(d->refine);
    sst_runner_destroy(d->shared);
}

static void test_same_bytes(void **state)
{
    struct sst_refine_device_report report;
    struct sst_refine_config cfg;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 2, 3, 93, 61);
    device_open(&d, "dummy", 0);
    for (int i = 0; refine_config(&cfg, i); i++) {
        print_message("configuration %d\n", i);
        cfg.device = d.refine;
        refine_compare(&lf, &cfg, &report);
        assert_string_equal(report.name, "dummy");
        assert_int_equal(report.views, 5);
        assert_int_equal(report.uploads, 5);
        assert_int_equal(report.carried + report.carried_on_cpu, 0);
        assert_int_equal(report.on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_true(report.dispatches > 5 * 4);
        assert_int_equal(report.stages_on_cpu, 0);
        sst_refine_device_report(d.refine, &report); /* since the last one */
        assert_int_equal(report.views, 0);
    }
    device_close(&d);
    sst_lightfield_fini(&lf);
}

/* A share of the disparities of the table, in percent, is far off: beyond a quarter it is no plane. */
static void test_grounds(void **state)
{
    static const int share[] = { 15, 35, 20, 45 };
    struct sst_refine_device_report report;
    struct sst_refine_config cfg;
    struct sst_lightfield lf;
    uint64_t seed = 3;
    struct device d;

    (void)state;
    refine_init(&lf, 1, 5, 93, 61);
    for (int k = 0; k < 4; k++) {
        for (int i = 26 * 93; i < 61 * 93; i++) {
            uint16_t *q = sst_map_u16_row(&lf.views[k].disp, i / 93) + i % 93;

            if (*q != SST_DISP_NONE) /* both ways, else the plane is drawn there */
                *q = (uint16_t)(*q + 20000 +
                                (100 * sst_random(&seed) < share[k] ? 30000 * sst_random(&seed) - 15000 : 0));
        }
    }
    device_open(&d, "dummy", 0);
    assert_true(refine_config(&cfg, 0));
    cfg.device = d.refine;
    cfg.eps_d = 1e-6;
    refine_compare(&lf, &cfg, &report);
    cfg.matcher_sigma_px = 0;
    refine_compare(&lf, &cfg, &report);
    assert_int_equal(report.views, 4);
    device_close(&d);
    sst_lightfield_fini(&lf);
}

/* What does not fit is done in bands, with and without normals and planes of grounds, down to a few rows. */
static void test_parts(void **state)
{
    static const struct {
        int config;
        uint64_t memory;
        int in_parts, dispatches; /* at least */
    } limits[] = {
        { 0, 1900000, 0, 0 },   { 0, 1800000, 5, 300 }, { 0, 1550000, 5, 1000 }, { 1, 950000, 5, 200 },
        { 1, 750000, 5, 1600 }, { 2, 750000, 5, 1000 }, { 3, 850000, 5, 500 },   { 4, 1600000, 5, 400 },
    };
    struct sst_refine_device_report report;
    struct sst_refine_config cfg;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 2, 3, 93, 61);
    for (size_t i = 0; i < ARRAY_LEN(limits); i++) {
        assert_true(refine_config(&cfg, limits[i].config));
        device_open(&d, "dummy", limits[i].memory);
        cfg.device = d.refine;
        refine_compare(&lf, &cfg, &report);
        print_message("configuration %d, %d KB: %d views, %d in parts, %d dispatches\n", limits[i].config,
                      (int)(limits[i].memory / 1000), (int)report.views, (int)report.in_parts, (int)report.dispatches);
        assert_int_equal(report.views, 5);
        assert_int_equal(report.in_parts, limits[i].in_parts);
        assert_int_equal(report.on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_true(report.dispatches >= limits[i].dispatches);
        device_close(&d);
    }
    sst_lightfield_fini(&lf);
}

/* Views that take no part, and a request to stop. */
static void test_skipped(void **state)
{
    const bool skip[6] = { false, true, false, true, false, false };
    SST_ATOMIC(bool) cancel = true;
    struct sst_refine_device_report report;
    struct sst_refine_config cfg;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 2, 3, 93, 61);
    device_open(&d, "dummy", 0);
    assert_true(refine_config(&cfg, 0));
    cfg.device = d.refine;
    cfg.skip = skip;
    refine_compare(&lf, &cfg, &report);
    assert_int_equal(report.views, 3);
    cfg.cancel = &cancel;
    assert_int_equal(sst_refine_labels(&lf, &cfg, NULL), -ECANCELED);
    device_close(&d);
    sst_lightfield_fini(&lf);
}

/* What a device fails at ends on the CPU with the same bytes; then it is opened again. */
static void test_fallback(void **state)
{
    static const struct {
        const char *name;
        int after; /* the self-tests, if not 0 */
        const char *why;
        uint64_t memory;
        int views, failures;
    } devices[] = {
        { "lost", 1, "the device is lost", 0, 0, 4 }, /* always at the first view: 0, 1, 3, 7 */
        { "timeout", 20, "the device does not answer", 0, 4, 4 },
        { "dummy:memory=1", 0, "not enough memory on the device", 0, 8, 0 }, /* only counting does not fit */
        { "dummy:buffer=100", 0, "not enough memory on the device", 0, 0, 0 },
        { "dummy", 0, "not enough memory on the device", 700000, 0, 0 },
    };
    struct sst_refine_device_report report;
    struct sst_refine_config cfg;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 3, 3, 93, 61);
    assert_true(refine_config(&cfg, 1));
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        const char *name = devices[i].after ? after_tests(devices[i].name, devices[i].after) : devices[i].name;

        print_message("%s\n", name);
        device_open(&d, name, devices[i].memory);
        cfg.device = d.refine;
        refine_compare(&lf, &cfg, &report);
        print_message("%lld views, %lld on the CPU, %lld failures: %s\n", (long long)report.views,
                      (long long)report.on_cpu, (long long)report.failures, report.why);
        assert_int_equal(report.views + report.on_cpu, 8);
        assert_string_equal(report.why, devices[i].why);
        assert_int_equal(report.views, devices[i].views);
        assert_int_equal(report.failures, devices[i].failures);
        device_close(&d);
    }
    sst_lightfield_fini(&lf);
}

/* At every step of a view: with planes of grounds, and with normals that decide; and at some of views in bands. */
static void test_lost_anywhere(void **state)
{
    static const uint64_t memory[] = { 0, 0, 1650000, 850000 };
    struct sst_refine_device_report report;
    struct sst_refine_config cfg;
    struct sst_lightfield lf;

    (void)state;
    refine_init(&lf, 1, 3, 93, 61);
    for (int i = 0; i < 4; i++) {
        bool all = false;

        assert_true(refine_config(&cfg, i % 2));
        for (int at = 1; !all; at += memory[i] ? 9 : 1) {
            struct device d;

            device_open(&d, after_tests("lost", at), memory[i]);
            cfg.device = d.refine;
            refine_compare(&lf, &cfg, &report);
            all = report.failures == 0;
            assert_int_equal(report.views + report.on_cpu, 2);
            assert_true(all || report.on_cpu >= 1);
            assert_in_range(at, 1, memory[i] ? 200 : 80);
            device_close(&d);
        }
    }
    sst_lightfield_fini(&lf);
}

/* Votes: with all views on the device, with room for few of them, and where it fails. */
static void test_votes(void **state)
{
    static const struct {
        int lost;
        uint64_t memory;
        int voted, in_parts, failures;
    } devices[] = {
        { 0, 0, 8, 0, 0 },
        { 0, 6 * 93 * 61 * 8, 8, 0, 0 }, /* five views and the result */
        { 0, 4 * 93 * 61 * 8, 8, 8, 0 }, /* rows of them */
        { 0, 110000, 8, 8, 0 },
        { 2, 0, 0, 0, 4 }, /* as the labels are to stay */
        { 3, 0, 4, 0, 4 }, /* the second one of each opening */
    };
    const bool skip[9] = { false, false, false, false, true };
    struct sst_refine_device_report report;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 3, 3, 93, 61);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        const char *name = devices[i].lost ? after_tests("lost", devices[i].lost) : "dummy";

        print_message("%s, %d bytes\n", name, (int)devices[i].memory);
        device_open(&d, name, devices[i].memory);
        vote_compare(&lf, NULL, d.refine, &report);
        print_message("%lld voted, %lld on the CPU, %lld failures, %lld uploads\n", (long long)report.voted,
                      (long long)report.voted_on_cpu, (long long)report.failures, (long long)report.uploads);
        assert_int_equal(report.voted, devices[i].voted);
        assert_int_equal(report.voted_in_parts, devices[i].in_parts);
        assert_int_equal(report.voted + report.voted_on_cpu, 8);
        assert_int_equal(report.failures, devices[i].failures);
        assert_true(i || report.uploads == 8);
        if (!i) {
            vote_compare(&lf, skip, d.refine, &report);
            assert_int_equal(report.voted, 7);
        }
        device_close(&d);
    }
    lf.disp_min_px = 0;
    for (int i = 0; i < 2; i++) { /* as far as views vote, in numbers of 32 bits; and farther: it is not asked */
        lf.views[0].bx = lf.views[3].bx - (i ? 32.0003 : 31.9995);
        lf.views[0].by = lf.views[3].by;
        device_open(&d, "dummy", 0);
        vote_compare(&lf, NULL, d.refine, &report);
        assert_int_equal(report.voted_on_cpu, 0);
        device_close(&d);
    }
    sst_lightfield_fini(&lf);
}

/* Something else has most of the device for a while. @return what it has, for give_memory() */
static struct sst_gpu_buffer *take_memory(struct device *d, size_t bytes)
{
    struct sst_gpu_buffer *taken = NULL;

    sst_runner_lock(d->shared);
    assert_int_equal(sst_gpu_buffer_create(sst_runner_device(d->shared), &taken, bytes), 0);
    sst_runner_unlock(d->shared);
    return taken;
}

static void give_memory(struct device *d, struct sst_gpu_buffer *taken)
{
    sst_runner_lock(d->shared);
    sst_gpu_buffer_destroy(sst_runner_device(d->shared), taken);
    sst_runner_unlock(d->shared);
}

/* One shortage does not last: the next stage is tried whole, be it votes or a refinement. */
static void test_memory_returns(void **state)
{
    struct sst_refine_device_report report;
    struct sst_refine_config cfg;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 2, 3, 93, 61);
    assert_true(refine_config(&cfg, 0));
    device_open(&d, "dummy", 3000000);
    cfg.device = d.refine;
    for (int i = 0; i < 4; i++) {
        struct sst_gpu_buffer *taken = i % 2 ? NULL : take_memory(&d, i ? 1200000 : 2910000);

        if (i < 2)
            vote_compare(&lf, NULL, d.refine, &report);
        else
            refine_compare(&lf, &cfg, &report);
        print_message("%lld voted, %lld in parts; %lld views, %lld in parts\n", (long long)report.voted,
                      (long long)report.voted_in_parts, (long long)report.views, (long long)report.in_parts);
        assert_int_equal(i < 2 ? report.voted : report.views, 5);
        assert_int_equal(i < 2 ? report.voted_in_parts : report.in_parts, i % 2 ? 0 : 5);
        give_memory(&d, taken);
    }
    device_close(&d);
    sst_lightfield_fini(&lf);
}

/* Labels carried to other views, and filled there: likewise. */
static void test_carried(void **state)
{
    static const struct {
        int width, height, lost;
        uint64_t memory;
        int carried, in_parts, failures;
    } devices[] = {
        { 93, 61, 0, 0, 7, 0, 0 },
        { 93, 61, 0, 8 * 93 * 61 * 8, 7, 0, 0 }, /* few views at once, with entropies */
        { 93, 61, 0, 3 * 93 * 61 * 8, 5, 5, 0 }, /* rows of them; gaps are filled from all, as they are few */
        { 93, 61, 0, 110000, 5, 5, 0 },
        { 24, 260, 0, 260000, 7, 7, 0 }, /* gaps are filled from a part of the rows */
        { 93, 61, 3, 0, 2, 0, 4 },       /* the third one of each opening */
    };
    const bool carried[9] = { true, false, true, false, false, false, false, true, false };
    struct sst_refine_device_report report;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        const char *name = devices[i].lost ? after_tests("lost", devices[i].lost) : "dummy";

        print_message("%s, %d bytes\n", name, (int)devices[i].memory);
        refine_init(&lf, 3, 3, devices[i].width, devices[i].height);
        lf.disp_min_px = -6;
        device_open(&d, name, devices[i].memory);
        carry_compare(&lf, carried, 4, d.refine, &report);
        print_message("%lld carried, %lld on the CPU, %lld failures, %lld uploads: %s\n", (long long)report.carried,
                      (long long)report.carried_on_cpu, (long long)report.failures, (long long)report.uploads,
                      report.why);
        assert_int_equal(report.carried, devices[i].carried);
        assert_int_equal(report.carried_in_parts, devices[i].in_parts);
        assert_int_equal(report.carried + report.carried_on_cpu, 7);
        assert_int_equal(report.failures, devices[i].failures);
        assert_int_equal(report.stages_on_cpu, report.carried_on_cpu ? 1U << SST_REFINE_STAGE_CARRY : 0);
        device_close(&d);
        sst_lightfield_fini(&lf);
    }
}

/* Labels from cells: likewise; a device that fails leaves it to the caller. */
static void test_enlarged(void **state)
{
    static const struct {
        int lost;
        uint64_t memory;
        int enlarged, in_parts, failures;
    } devices[] = {
        { 0, 0, 2, 0, 0 }, { 0, 92000, 2, 2, 0 }, { 1, 0, 0, 0, 1 }, { 2, 0, 0, 0, 1 }, { 3, 0, 1, 0, 1 },
    };
    struct sst_refine_device_report report;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 1, 2, 93, 61);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        device_open(&d, devices[i].lost ? after_tests("lost", devices[i].lost) : "dummy", devices[i].memory);
        enlarge_compare(&lf, 0, d.refine, &report);
        assert_int_equal(report.enlarged, devices[i].enlarged);
        print_message("%d enlarged, %d in parts\n", (int)report.enlarged, (int)report.enlarged_in_parts);
        assert_int_equal(report.enlarged_in_parts, devices[i].in_parts);
        assert_int_equal(report.enlarged_on_cpu, devices[i].enlarged < 2);
        assert_int_equal(report.failures, devices[i].failures);
        assert_int_equal(report.stages_on_cpu, devices[i].enlarged < 2 ? 1U << SST_REFINE_STAGE_ENTROPY : 0);
        device_close(&d);
    }
    sst_lightfield_fini(&lf);
}

/* Where the network runs; with little memory no view is, and nothing fails. */
static void test_finished(void **state)
{
    static const uint64_t memory[] = { 0, 92000 };
    struct sst_refine_device_report report;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 2, 3, 93, 61);
    for (size_t i = 0; i < ARRAY_LEN(memory); i++) {
        device_open(&d, "dummy", memory[i]);
        finish_compare(&lf, d.shared, d.refine, &report);
        assert_int_equal(report.finished, i ? 0 : 2);
        assert_int_equal(report.enlarged, i ? 0 : 2);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.stages_on_cpu, 0);
        device_close(&d);
    }
    sst_lightfield_fini(&lf);
}

/* Not one row fits. */
static void test_no_row(void **state)
{
    struct sst_refine_device_report report;
    struct sst_lightfield lf;
    struct device d;

    (void)state;
    refine_init(&lf, 2, 3, 12000, 16); /* a row of a view is larger than the memory */
    device_open(&d, "dummy", 92000);
    vote_compare(&lf, NULL, d.refine, &report);
    assert_int_equal(report.voted, 0);
    assert_int_equal(report.voted_on_cpu, 5);
    assert_int_equal(report.failures, 0);
    assert_string_equal(report.why, "not enough memory on the device");
    enlarge_compare(&lf, 0, d.refine, &report);
    assert_int_equal(report.enlarged_on_cpu, 1);
    assert_int_equal(report.failures, 0);
    device_close(&d);
    sst_lightfield_fini(&lf);
}

static void test_refused(void **state)
{
    struct sst_refine_device *none;
    struct sst_runner *shared;
    char text[SST_LOG_MAX];

    (void)state;
    assert_int_equal(sst_refine_device_create(&none, NULL), 0);
    assert_null(none);
    assert_int_equal(sst_runner_create(&shared, "dummy:wrong=3", 0), 0);
    sst_log_hold_errors(text);
    assert_int_equal(sst_refine_device_create(&none, shared), -ENOTSUP);
    assert_contains(text, "cannot refine labels");
    sst_log_hold_errors(NULL);
    sst_runner_destroy(shared);
    sst_refine_device_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bytes),     cmocka_unit_test(test_grounds), serial_test(test_parts),
        cmocka_unit_test(test_skipped),        serial_test(test_fallback),     serial_test(test_lost_anywhere),
        cmocka_unit_test(test_votes),          cmocka_unit_test(test_carried), cmocka_unit_test(test_enlarged),
        cmocka_unit_test(test_finished),       cmocka_unit_test(test_no_row),  cmocka_unit_test(test_refused),
        cmocka_unit_test(test_memory_returns),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
