/* tests/traps.h - floating-point exceptions end the program: invalid operations, divisions by zero, overflow. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_TRAPS_H
#define SST_TESTS_TRAPS_H

#include <fenv.h>

#include "base/base.h"

/* glibc declares it for _GNU_SOURCE alone, which many tests do not set; on machines without traps it returns -1. */
int feenableexcept(int exceptions);

/**
 * Only in builds with -ftrapping-math (the Makefile sets SST_TRAPS for those with the address sanitizer): elsewhere compilers
 * may compute what no one asked for, and mask its result. Threads inherit the traps of the one that starts them. To compare
 * with what is no number is an invalid operation, and to read 1e999 an overflow; both are how input is checked.
 * tests/special.txt names the tests that do so; all others get SST_TRAP_ALL from scripts/run_tests.sh.
 */
#ifdef SST_TRAPS
#include <stdlib.h>

static void __attribute__((constructor)) traps_set(void)
{
    feenableexcept(FE_DIVBYZERO | (getenv("SST_TRAP_ALL") ? FE_INVALID | FE_OVERFLOW : 0));
}
#endif

#endif
