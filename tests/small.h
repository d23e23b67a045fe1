/* tests/small.h - tests that sanitized builds leave out, which are 3 (address) to 30 times (thread) as slow. make
 * sets SST_TEST_SMALL to 1 for the address and to 2 for the thread sanitizer; without it all is run. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_SMALL_H
#define SST_TESTS_SMALL_H

#include <stdint.h>
#include <stdlib.h>

#include "tests/test.h"

static inline int small_level(void)
{
    const char *level = getenv("SST_TEST_SMALL");

    return level ? atoi(level) : 0;
}

static inline void small_left_out(void **state)
{
    (void)state;
    print_message("left out: other tests of this program run the same code under this sanitizer\n");
    skip();
}

/** In a list of tests: one that measures results of code which others here run too; under no sanitizer. */
#define plain_test(f)                                                                                                  \
    {                                                                                                                  \
#f, small_level() >= 1 ? small_left_out : f, NULL, NULL, NULL                                                  \
    }

/** One whose threads do what those of others here do; not under the thread sanitizer. */
#define serial_test(f)                                                                                                 \
    {                                                                                                                  \
#f, small_level() >= 2 ? small_left_out : f, NULL, NULL, NULL                                                  \
    }

/** One that compares results of several numbers of threads, whose code other tests here run too; not under the address sanitizer. */
#define thread_test(f)                                                                                                 \
    {                                                                                                                  \
#f, small_level() == 1 ? small_left_out : f, NULL, NULL, NULL                                                  \
    }

#endif
