/* Limits of every stage: peaks ROUNDS. Prints CSV, a line for each round and limit, of 2 threads together:
 * wide loads from memory and from the second level of cache (GB/s), 16-bit multiplications and byte minima of the
 * kernel level in use (1e9 lanes/s), multiply-adds of floats (1e9/s) and updates at scattered places (1e9/s). Memory is
 * counted by wall time, for the threads share it; the rest by CPU time, which other programs change less. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"

#define THREADS      2
#define MEMORY_BYTES ((size_t)640 << 20) /* the bytes of 36 views of 2000x1500 */
#define CACHE_BYTES  ((size_t)384 << 10) /* per thread: beyond the first level of cache, within the second */
#define SCATTER      (1u << 20)          /* entries of 4 bytes, per thread */
#define CHAINS       10                  /* independent operations in flight; with operands they fit 16 registers */

#if defined(__x86_64__)
#define AVX2   __attribute__((target("avx2,fma")))
#define AVX512 __attribute__((target("avx512f,avx512bw,avx512vl,fma")))
#endif

typedef uint8_t bytes16 __attribute__((vector_size(16)));
typedef uint8_t bytes32 __attribute__((vector_size(32)));
typedef uint8_t bytes64 __attribute__((vector_size(64)));

static uint8_t *memory;
static uint32_t *scatter;
static volatile uint64_t sink;

/* --- one loop per limit; returns the operations done -------------------------------------------------------------- */

#define LOAD_LOOPS(level, target, vector)                                                                              \
    target static double load_##level(const uint8_t *from, size_t bytes, int passes)                                   \
    {                                                                                                                  \
        vector sum[8] = { { 0 } };                                                                                     \
                                                                                                                       \
        for (int pass = 0; pass < passes; pass++) {                                                                    \
            for (size_t i = 0; i < bytes; i += sizeof(sum)) {                                                          \
                for (size_t k = 0; k < ARRAY_LEN(sum); k++)                                                            \
                    sum[k] ^= *(const vector *)(const void *)(from + i + k * sizeof(vector));                          \
            }                                                                                                          \
            __asm__ volatile("" ::: "memory");                                                                         \
        }                                                                                                              \
        for (size_t k = 0; k < ARRAY_LEN(sum); k++)                                                                    \
            sink += sum[k][0];                                                                                         \
        return (double)bytes * passes;                                                                                 \
    }                                                                                                                  \
    static double memory_##level(int worker)                                                                           \
    {                                                                                                                  \
        return load_##level(memory + (size_t)worker * (MEMORY_BYTES / THREADS), MEMORY_BYTES / THREADS, 1);            \
    }                                                                                                                  \
    static double cache_##level(int worker)                                                                            \
    {                                                                                                                  \
        return load_##level(memory + (size_t)worker * (MEMORY_BYTES / THREADS), CACHE_BYTES, 4000);                    \
    }

LOAD_LOOPS(base, , bytes16)
#if defined(__x86_64__)
LOAD_LOOPS(avx2, AVX2, bytes32)
LOAD_LOOPS(avx512, AVX512, bytes64)
#endif

static double scattered(int worker)
{
    uint32_t *at = scatter + (size_t)worker * SCATTER, x = 12345;
    const int n = 30000000;

    for (int i = 0; i < n; i++) {
        x = x * 1664525u + 1013904223u;
        at[x >> 12]++;
    }
    return n;
}

/* CHAINS chains of one instruction; the compiler sees neither values nor instruction. */
#define INSTRUCTION_LOOP(name, target, vector, constraint, instruction, lanes)                                         \
    target static double name(int worker SST_UNUSED)                                                                   \
    {                                                                                                                  \
        const int n = 12000000;                                                                                        \
        vector a[CHAINS] = { { 0 } }, b = { 0 };                                                                       \
                                                                                                                       \
        for (int i = 0; i < n; i++) {                                                                                  \
            __asm__ volatile(instruction("0") instruction("1") instruction("2") instruction("3") instruction("4")      \
                                 instruction("5") instruction("6") instruction("7") instruction("8") instruction("9")  \
                             : "+" constraint(a[0]), "+" constraint(a[1]), "+" constraint(a[2]), "+" constraint(a[3]), \
                               "+" constraint(a[4]), "+" constraint(a[5]), "+" constraint(a[6]), "+" constraint(a[7]), \
                               "+" constraint(a[8]), "+" constraint(a[9])                                              \
                             : constraint(b));                                                                         \
        }                                                                                                              \
        for (int k = 0; k < CHAINS; k++)                                                                               \
            sink += a[k][0];                                                                                           \
        return (double)n * CHAINS * (lanes);                                                                           \
    }

#if defined(__x86_64__)
#define MULTIPLY(k) "vpmulhrsw %10, %" k ", %" k "\n"
#define MINIMUM(k)  "vpminub %10, %" k ", %" k "\n"
#define FMA(k)      "vfmadd231ps %10, %10, %" k "\n"
INSTRUCTION_LOOP(multiply_avx2, AVX2, bytes32, "x", MULTIPLY, 16)
INSTRUCTION_LOOP(minimum_avx2, AVX2, bytes32, "x", MINIMUM, 32)
INSTRUCTION_LOOP(fma_avx2, AVX2, bytes32, "x", FMA, 8)
INSTRUCTION_LOOP(multiply_avx512, AVX512, bytes64, "v", MULTIPLY, 32)
INSTRUCTION_LOOP(minimum_avx512, AVX512, bytes64, "v", MINIMUM, 64)
INSTRUCTION_LOOP(fma_avx512, AVX512, bytes64, "v", FMA, 16)
#endif

/* --- all ---------------------------------------------------------------------------------------------------------- */

struct limit {
    const char *name;
    double (*run)(int worker);
    double done[THREADS];
};

static int run_limit(void *arg, int item SST_UNUSED, int worker)
{
    struct limit *limit = arg;

    limit->done[worker] += limit->run(worker);
    return 0;
}

static int measure(struct limit *limit, int round)
{
    const int64_t start_ns = sst_clock_now_ns(), start_cpu_ns = sst_clock_cpu_ns();
    double done = 0, ns;
    int err;

    memset(limit->done, 0, sizeof(limit->done));
    err = sst_parallel_for(THREADS, THREADS, run_limit, limit);
    for (int i = 0; i < THREADS; i++)
        done += limit->done[i];
    ns = strcmp(limit->name, "memory") ? (double)(sst_clock_cpu_ns() - start_cpu_ns) / THREADS
                                       : (double)(sst_clock_now_ns() - start_ns);
    if (!err && round)
        printf("%s,%s,%d,%.4f\n", sst_cpu_level_name(sst_cpu_level()), limit->name, round, done / ns);
    return err;
}

int main(int argc, char **argv)
{
    struct limit limits[6] = { { .name = "memory", .run = memory_base },
                               { .name = "cache", .run = cache_base },
                               { .name = "scatter", .run = scattered } };
    const int rounds = argc == 2 ? atoi(argv[1]) : 0;
    size_t n = 3;
    int err = 0;

    if (rounds < 1) {
        fprintf(stderr, "usage: peaks ROUNDS: rounds >= 1\n");
        return 2;
    }
#if defined(__x86_64__)
    if (sst_cpu_level() >= SST_CPU_AVX2) {
        const bool wide = sst_cpu_level() == SST_CPU_AVX512;

        limits[0].run = wide ? memory_avx512 : memory_avx2;
        limits[1].run = wide ? cache_avx512 : cache_avx2;
        limits[n++] = (struct limit){ .name = "multiply", .run = wide ? multiply_avx512 : multiply_avx2 };
        limits[n++] = (struct limit){ .name = "minimum", .run = wide ? minimum_avx512 : minimum_avx2 };
        limits[n++] = (struct limit){ .name = "fma", .run = wide ? fma_avx512 : fma_avx2 };
    }
#endif
    memory = sst_mem_alloc(MEMORY_BYTES, 1);
    scatter = sst_mem_alloc((size_t)THREADS * SCATTER, sizeof(*scatter));
    if (!memory || !scatter) {
        err = -ENOMEM;
    } else {
        memset(memory, 1, MEMORY_BYTES);
        memset(scatter, 0, (size_t)THREADS * SCATTER * sizeof(*scatter));
    }
    printf("level,limit,round,value\n");
    for (int round = 0; !err && round <= rounds; round++) { /* the first one warms up */
        for (size_t i = 0; !err && i < n; i++)
            err = measure(&limits[i], round);
    }
    if (err)
        sst_log_error("peaks bench: %s", strerror(-err));
    sst_mem_free(memory);
    sst_mem_free(scatter);
    return err ? 1 : 0;
}
