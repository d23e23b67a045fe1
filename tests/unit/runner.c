/* pipeline/gpu/shared: one opening for several kinds of work, which is closed and opened again for all. */
#include <errno.h>

#include "base/log.h"
#include "tests/match_field.h"
#include "tests/refine_field.h"
#include "tests/small.h"

#define BYTES ((size_t)300 << 10)

/* A kind of work that holds one buffer. */
struct work {
    struct sst_runner *shared;
    struct sst_runner_user user;
    struct sst_gpu_buffer *buffer;
    int drops;
};

static void drop(void *arg)
{
    struct work *w = arg;

    w->drops++;
    sst_gpu_buffer_destroy(sst_runner_device(w->shared), w->buffer);
    w->buffer = NULL;
}

static int work_join(struct work *w, struct sst_runner *shared)
{
    static const enum sst_gpu_shader shaders[] = { SST_GPU_CENSUS };

    *w = (struct work){ .shared = shared,
                        .user = { .shaders = shaders, .count = 1, .work = "count", .drop = drop, .arg = w } };
    return sst_runner_join(shared, &w->user);
}

/* One piece. @return 0, -EAGAIN (the device is left alone), or its error */
static int work_do(struct work *w)
{
    struct sst_gpu *g;
    int err;

    sst_runner_lock(w->shared);
    g = sst_runner_take(w->shared, &w->user, &err);
    if (g && !w->buffer) {
        err = sst_gpu_buffer_create(g, &w->buffer, BYTES);
        if (err == -ENOMEM && sst_runner_make_room(w->shared, &w->user))
            err = sst_gpu_buffer_create(g, &w->buffer, BYTES);
    } else if (!g && !err) {
        err = -EAGAIN;
    }
    if (!err)
        sst_runner_succeed(w->shared);
    sst_runner_unlock(w->shared);
    return err;
}

static int lose(struct sst_runner *shared)
{
    int pieces;

    sst_runner_lock(shared);
    pieces = sst_runner_fail(shared);
    sst_runner_unlock(shared);
    return pieces;
}

/* The pause after failures counts the pieces of all; one that works ends it. */
static void test_pause(void **state)
{
    struct sst_runner *shared;
    struct work a, b;

    (void)state;
    assert_int_equal(sst_runner_create(&shared, "dummy", 0), 0);
    assert_string_equal(sst_runner_name(shared), "dummy");
    assert_string_equal(sst_runner_info(shared)->driver, "C reference");
    assert_int_equal(work_join(&a, shared), 0);
    assert_int_equal(work_join(&b, shared), 0);
    assert_int_equal(work_do(&a), 0);
    assert_int_equal(work_do(&b), 0);
    assert_int_equal(lose(shared), 0);
    assert_int_equal(a.drops, 1);
    assert_int_equal(b.drops, 1);
    assert_null(sst_runner_device(shared));
    assert_int_equal(lose(shared), 1);
    assert_int_equal(a.drops, 1); /* it was closed */
    assert_int_equal(work_do(&a), -EAGAIN);
    assert_int_equal(work_do(&b), 0);
    assert_int_equal(lose(shared), 0); /* from the start again */
    assert_int_equal(work_do(&b), 0);
    assert_int_equal(a.drops, 2);
    assert_int_equal(b.drops, 2);
    sst_runner_leave(shared, &a.user);
    sst_runner_leave(shared, &b.user);
    assert_int_equal(b.drops, 3);
    assert_null(b.buffer);
    sst_runner_destroy(shared);
}

/* A kind of work that needs memory gets the memory of the others. */
static void test_room(void **state)
{
    struct sst_runner *shared;
    struct work a, b;

    (void)state;
    assert_int_equal(sst_runner_create(&shared, "dummy", BYTES + 100), 0);
    assert_int_equal(work_join(&a, shared), 0);
    assert_int_equal(work_join(&b, shared), 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(work_do(&a), 0);
        assert_non_null(a.buffer);
        assert_null(b.buffer);
        assert_int_equal(work_do(&b), 0);
        assert_non_null(b.buffer);
        assert_null(a.buffer);
    }
    sst_runner_leave(shared, &a.user);
    sst_runner_leave(shared, &b.user);
    sst_runner_destroy(shared);
}

static void test_refused(void **state)
{
    struct sst_runner *shared;
    char text[SST_LOG_MAX];
    struct work a;

    (void)state;
    assert_int_equal(sst_runner_create(&shared, "cpu", 0), 0);
    assert_null(shared);
    sst_log_hold_errors(text);
    assert_int_equal(sst_runner_create(&shared, "no such device", 0), -ENOENT);
    assert_null(shared);
    assert_int_equal(sst_runner_create(&shared, "dummy:wrong=1", 0), 0);
    assert_int_equal(work_join(&a, shared), -ENOTSUP);
    assert_contains(text, "cannot count");
    sst_log_hold_errors(NULL);
    sst_runner_destroy(shared);
    sst_runner_destroy(NULL);
}

/* Matching and refinement in turn on one device, with room for one, and with faults. */
static void test_stages(void **state)
{
    static const struct {
        const char *name;
        int after; /* the self-tests of both */
        uint64_t memory;
    } devices[] = { { "dummy", 0, 0 },
                    { "dummy", 0, (uint64_t)2600 << 10 },
                    { "dummy:lost=%d", 3, 0 },
                    { "dummy:timeout=%d", 60, 0 } };
    const int tests = match_self_tests() + refine_self_tests();
    struct sst_disparity_device_report matched;
    struct sst_refine_device_report refined;
    struct sst_lightfield field, labels;

    (void)state;
    match_init(&field, 1, 3, 97, 60, 8);
    refine_init(&labels, 1, 3, 93, 61);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        struct sst_runner *shared;
        struct sst_refine_device *refine;
        struct sst_disparity_config cfg;
        struct sst_refine_config refinement;
        char name[64];

        snprintf(name, sizeof(name), devices[i].name, tests + devices[i].after);
        print_message("%s, %d KiB\n", name, (int)(devices[i].memory >> 10));
        assert_true(match_config(&cfg, 1));
        assert_true(refine_config(&refinement, 1));
        assert_int_equal(sst_runner_create(&shared, name, devices[i].memory), 0);
        assert_int_equal(sst_disparity_device_create(&cfg.device, shared), 0);
        assert_int_equal(sst_refine_device_create(&refine, shared), 0);
        refinement.device = refine;
        for (int turn = 0; turn < 3; turn++) {
            match_compare(&field, &cfg, &matched);
            refine_compare(&labels, &refinement, &refined);
            assert_int_equal(refined.views + refined.on_cpu, 2);
            if (i < 2) {
                assert_int_equal(matched.on_cpu, 0);
                assert_int_equal(matched.failures + refined.failures, 0);
                assert_int_equal(refined.views, 2);
            }
        }
        sst_refine_device_destroy(refine);
        sst_disparity_device_destroy(cfg.device);
        sst_runner_destroy(shared);
    }
    sst_lightfield_fini(&field);
    sst_lightfield_fini(&labels);
}

/* Labels carried in a light field that was matched on the device, from one view to the others; then without it. */
static void carry_one(struct sst_lightfield *lf, struct sst_refine_device *device, uint8_t *labels)
{
    const bool carried[6] = { true, true, false, true, true, true };
    const struct process_carry c = { lf, carried, NULL, 2, device };

    for (int k = 0; k < 6; k++)
        sst_map_u8_fini(&lf->views[k].label);
    assert_int_equal(sst_map_u8_init(&lf->views[2].label, lf->width, lf->height), 0);
    for (int i = 0; i < lf->width * lf->height; i++)
        sst_map_u8_row(&lf->views[2].label, i / lf->width)[i % lf->width] =
            (uint8_t)((i % lf->width / 9 + i / lf->width / 7) % 4);
    assert_int_equal(process_carry_labels(&c, NULL, true), 0);
    for (int k = 0; k < 6; k++) {
        for (int y = 0; lf->views[k].label.data && y < lf->height; y++, labels += lf->width)
            memcpy(labels, sst_map_u8_row(&lf->views[k].label, y), (size_t)lf->width);
    }
}

/* Colours and maps of the matching, at half of the size and whole, are used for the labels: only labels go up. */
static void test_stays(void **state)
{
    enum { BYTES_OF_VIEW = 97 * 61 };
    static uint8_t labels[2][6 * BYTES_OF_VIEW];
    struct sst_disparity_device_report matched;
    struct sst_refine_device_report refined;

    (void)state;
    for (int i = 0; i < 2; i++) {
        struct sst_runner *shared;
        struct sst_refine_device *refine;
        struct sst_disparity_config cfg;
        struct sst_lightfield lf;

        match_init(&lf, 2, 3, 97, 61, 8);
        assert_true(match_config(&cfg, i));
        cfg.stays = true;
        assert_int_equal(sst_runner_create(&shared, "dummy", 0), 0);
        assert_int_equal(sst_disparity_device_create(&cfg.device, shared), 0);
        assert_int_equal(sst_refine_device_create(&refine, shared), 0);
        assert_int_equal(sst_disparity_lightfield(&lf, &cfg, NULL, NULL), 0);
        carry_one(&lf, refine, labels[0]);
        sst_disparity_device_report(cfg.device, &matched);
        sst_refine_device_report(refine, &refined);
        carry_one(&lf, NULL, labels[1]);
        assert_memory_equal(labels[0], labels[1], sizeof(labels[0]));
        assert_true(matched.uploads >= 5); /* the dummy device computes no maps */
        assert_int_equal(refined.carried, 4);
        assert_true(refined.uploads <= 5);
        sst_refine_device_forget(refine);
        sst_disparity_device_forget(cfg.device);
        sst_refine_device_destroy(refine);
        sst_disparity_device_destroy(cfg.device);
        sst_runner_destroy(shared);
        sst_lightfield_fini(&lf);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pause), cmocka_unit_test(test_room),  cmocka_unit_test(test_refused),
        serial_test(test_stages),     cmocka_unit_test(test_stays),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
