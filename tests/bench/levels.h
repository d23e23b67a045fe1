/* tests/bench/levels.h - levels of the processor that a benchmark measures in turn: the best one, and AVX2. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_BENCH_LEVELS_H
#define SST_TESTS_BENCH_LEVELS_H

#include <stdint.h>

#include "pipeline/kernels/kernels.h"

struct bench_levels {
    int count;
    enum sst_cpu_level level[2];
};

/** The level that SST_CPU allows, or the best; then AVX2 where that is less. */
static inline struct bench_levels bench_levels(void)
{
    struct bench_levels l = { 1, { sst_cpu_level(), SST_CPU_REF } };

#if defined(__x86_64__)
    if (l.level[0] > SST_CPU_AVX2)
        l.level[l.count++] = SST_CPU_AVX2;
#endif
    return l;
}

/** Use the kernels of a level from now on; no other thread may run any. Programs choose once and have no such call: the
 *  table, which is constant to them alone, is overwritten. */
static inline void bench_level_use(enum sst_cpu_level level)
{
    (void)sst_kernels_at(level, (struct sst_kernels *)(uintptr_t)sst_kernels_get());
}

#endif
