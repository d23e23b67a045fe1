/* tests/self_tests.h - how many dispatches a device has in the self-tests of a kind of work. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_SELF_TESTS_H
#define SST_TESTS_SELF_TESTS_H

#include <stdbool.h>

#include "pipeline/gpu/gpu.h"
#include "tests/test.h"

/** The device can be opened for this work; it is closed. */
typedef bool self_tests_fn(const char *name);

/* Dispatches of the self-tests that the dummy device passes as it is opened: faults count on from there. */
static inline int self_tests(self_tests_fn *opens)
{
    assert_true(opens("dummy"));
    return (int)sst_gpu_dummy_dispatches();
}

/* Dispatches of the same work on a device that has passed its self-tests before. */
static inline int work_dispatches(self_tests_fn *opens)
{
    assert_true(opens("dummy:known=1"));
    return (int)sst_gpu_dummy_dispatches();
}

#endif
