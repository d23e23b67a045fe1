/* tests/traps.h - floating-point exceptions end the program: invalid operations, divisions by zero, overflow. */
#ifndef SST_TESTS_TRAPS_H
#define SST_TESTS_TRAPS_H

#include <fenv.h>

#include "base/base.h"

/* glibc declares it for _GNU_SOURCE alone, which many tests do not set; on machines without traps it returns -1. */
int feenableexcept(int exceptions);

/**
 * Only in builds with -ftrapping-math (the Makefile sets SST_TRAPS for those with the address sanitizer): elsewhere compilers
 * may compute what no one asked for, and mask its result. Threads inherit the traps of the one that starts them. To compare
 * with what is no number is an invalid operation too, and how input is checked: tests/special.txt names the tests that do
 * so, all others get SST_TRAP_INVALID from scripts/run_tests.sh.
 */
#ifdef SST_TRAPS
#include <stdlib.h>

static void __attribute__((constructor)) traps_set(void)
{
    feenableexcept(FE_DIVBYZERO | FE_OVERFLOW | (getenv("SST_TRAP_INVALID") ? FE_INVALID : 0));
}
#endif

#endif
