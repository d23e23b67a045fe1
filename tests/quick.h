/* tests/quick.h - time limits of tests: exact under `make check-timing`, which sets SST_TIMING and needs a quiet
 * machine. Otherwise half a minute longer, so that a busy machine fails no test but a hang still does. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_QUICK_H
#define SST_TESTS_QUICK_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"

#define QUICK_PATIENCE_NS INT64_C(30000000000)

/** Whether this run measures time. */
static inline bool quick_is_measured(void)
{
    return getenv("SST_TIMING") != NULL;
}

/** Whether what began at start_ns has taken at most limit_ns. */
static inline bool quick_enough(int64_t start_ns, int64_t limit_ns)
{
    const int64_t took_ns = sst_clock_now_ns() - start_ns;

    if (took_ns > limit_ns)
        printf("took %.3f s, the limit is %.3f s\n", (double)took_ns * 1e-9, (double)limit_ns * 1e-9);
    return took_ns <= limit_ns + (quick_is_measured() ? 0 : QUICK_PATIENCE_NS);
}

#define assert_quick(start_ns, limit_ns) assert_true(quick_enough(start_ns, limit_ns))

#endif
