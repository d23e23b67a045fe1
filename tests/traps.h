/* tests/traps.h - floating-point exceptions end the program: invalid operations, divisions by zero, overflow. */
#ifndef SST_TESTS_TRAPS_H
#define SST_TESTS_TRAPS_H

#include <fenv.h>

#include "base/base.h"

/* glibc declares it for _GNU_SOURCE alone, which many tests do not set; on machines without traps it returns -1. */
int feenableexcept(int exceptions);

/**
 * Only in builds with -ftrapping-math (the Makefile sets SST_TRAPS for those with the address sanitizer): elsewhere
 * compilers may compute what no one asked for, and mask its result. Threads inherit the traps of the one that starts
 * them.
 */
#ifdef SST_TRAPS
static void __attribute__((constructor)) traps_set(void)
{
    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
}
#endif

#endif
