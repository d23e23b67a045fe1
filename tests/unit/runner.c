/* pipeline/gpu/shared: one opening for several kinds of work, which is closed and opened again for all. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/log.h"
#include "pipeline/gpu/match.h"
#include "pipeline/step/run.h"
#include "tests/test.h"

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

/* A step of one dispatch. */
static bool counts(const void *job, int item)
{
    (void)job;
    return !item;
}

static int count_on_cpu(void *job, int item, int worker)
{
    (void)job, (void)item, (void)worker;
    return 0;
}

static void count_on_device(struct sst_run *r, void *job, int item)
{
    static const struct sst_gpu_features push;
    const struct sst_gpu_range any = sst_run_scratch(r, 0, 64);

    (void)job, (void)item;
    SST_RUN_GROUPS(r, sst_run_fastest(r, SST_GPU_FEATURE_COST), &push, 1, 1, 1, any, any, any, any, any);
}

static void counted(void *job, int item, struct sst_share_maps *out)
{
    (void)job, (void)item, (void)out;
}

static void *count_sample(uint32_t seed)
{
    return calloc(seed, 1);
}

static int work_join(struct work *w, struct sst_runner *shared)
{
    static const struct sst_step step = { .name = "counting",
                                          .wants = counts,
                                          .cpu = count_on_cpu,
                                          .writes = counted,
                                          .sample = count_sample,
                                          .seeds = 1,
                                          .sample_free = free };
    static const struct sst_step_shaders steps[] = { { &step, count_on_device, NULL, NULL },
                                                     { NULL, NULL, NULL, NULL } };

    *w = (struct work){ .shared = shared,
                        .user = { .steps = steps, .step_count = 1, .work = "count", .drop = drop, .arg = w } };
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
        sst_runner_succeed(&w->user, "counting is done");
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

/* A step is compared once more with each variant of a shader that it would use: one that differs is refused by name. */
static void test_variants(void **state)
{
    static const struct {
        const char *device;
        int err;
        enum sst_gpu_shader want;
    } cases[] = {
        { "dummy:dot=1", 0, SST_GPU_FEATURE_COST_DOT },
        { "dummy:dot=1,wrong=2", 0, SST_GPU_FEATURE_COST },
        { "dummy:dot=2,wrong=2", 0, SST_GPU_FEATURE_COST }, /* slow */
        { "dummy:dot=1,wrong=1", -ENOTSUP, SST_GPU_FEATURE_COST },
        { "dummy:dot=1,lost=1", -ENODEV, SST_GPU_FEATURE_COST },
        { "dummy:dot=1,lost=2", 0, SST_GPU_FEATURE_COST }, /* opened again without ... */
        { "dummy:dot=1", 0, SST_GPU_FEATURE_COST },        /* and not tried again by the process */
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        enum sst_gpu_shader fastest = SST_GPU_SHADERS;
        struct sst_runner *shared;
        struct work a;

        print_message("%s\n", cases[i].device);
        assert_int_equal(sst_runner_create(&shared, cases[i].device, 0), 0);
        assert_int_equal(work_join(&a, shared), cases[i].err);
        if (!cases[i].err) {
            assert_int_equal(sst_gpu_prepare_fastest(sst_runner_device(shared), SST_GPU_FEATURE_COST, &fastest), 0);
            assert_int_equal(fastest, cases[i].want);
            sst_runner_leave(shared, &a.user);
        }
        sst_runner_destroy(shared);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pause),
        cmocka_unit_test(test_room),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_variants),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
