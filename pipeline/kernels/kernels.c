/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

#if defined(__x86_64__)
#include <cpuid.h>
#elif defined(__aarch64__)
#include <sys/auxv.h>
#endif
#include <pthread.h>
#include <stdlib.h>
#include <strings.h>

#include "base/log.h"

static void fill_ref(struct sst_kernels *k)
{
#define X(name) k->name = sst_##name##_ref;
    SST_KERNEL_LIST(X)
#undef X
}

/* By enum sst_cpu_level; no fill function: not for this architecture. */
static const struct {
    const char *name;
    void (*fill)(struct sst_kernels *k);
} levels[SST_CPU_LEVELS] = {
    { "ref", fill_ref },
#if defined(__x86_64__)
    { "base", sst_kernels_fill_base },
    { "avx2", sst_kernels_fill_avx2 },
    { "avxvnni", sst_kernels_fill_avxvnni },
    { "avx512", sst_kernels_fill_avx512 },
#define LEVEL_NAMES "ref, base, avx2, avxvnni, avx512"
#elif defined(__aarch64__)
    { "neon", sst_kernels_fill_base },
    { "dotprod", sst_kernels_fill_dotprod },
    { "i8mm", sst_kernels_fill_i8mm },
#define LEVEL_NAMES "ref, neon, dotprod, i8mm"
#else
    { "base", sst_kernels_fill_base },
    { "avx2", NULL },
    { "avxvnni", NULL },
    { "avx512", NULL },
#define LEVEL_NAMES "ref, base"
#endif
};

static struct sst_kernels table;        /* fixed after the first get */
static enum sst_cpu_level level_chosen; /* fixed after the first get */
static pthread_once_t once = PTHREAD_ONCE_INIT;

#if defined(__x86_64__)
/* CPUID leaf 7, subleaf 1, which __builtin_cpu_supports() of older compilers lacks. */
static int cpu_has_avxvnni(void)
{
    unsigned a, b, c, d;

    return __get_cpuid_count(7, 1, &a, &b, &c, &d) && a & 1u << 4;
}
#endif

static int cpu_has_sha(void)
{
#if defined(__x86_64__)
    unsigned a, b, c, d;

    return __get_cpuid_count(7, 0, &a, &b, &c, &d) && b & 1u << 29;
#else
    return 1;
#endif
}

static int cpu_has(enum sst_cpu_level level)
{
    switch (level) {
    case SST_CPU_REF:
    case SST_CPU_BASE:
        return 1;
#if defined(__x86_64__)
    case SST_CPU_AVX2:
        return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
    case SST_CPU_AVXVNNI:
        return cpu_has(SST_CPU_AVX2) && cpu_has_avxvnni();
    case SST_CPU_AVX512:
        return cpu_has(SST_CPU_AVX2) && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
               __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
               __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512vpopcntdq") &&
               __builtin_cpu_supports("avx512bitalg") && __builtin_cpu_supports("avx512vbmi") &&
               __builtin_cpu_supports("avx512vnni");
#elif defined(__aarch64__)
    case SST_CPU_DOTPROD:
        return !!(getauxval(AT_HWCAP) & HWCAP_ASIMDDP);
    case SST_CPU_I8MM:
        return cpu_has(SST_CPU_DOTPROD) && getauxval(AT_HWCAP2) & HWCAP2_I8MM;
#endif
    default:
        return 0;
    }
}

int sst_kernels_at(enum sst_cpu_level level, struct sst_kernels *out)
{
    if (!cpu_has(level))
        return 0;
    levels[level].fill(out);
    if (!cpu_has_sha())
        out->sha256_blocks = sst_sha256_blocks_ref;
    return 1;
}

/* "base" is the lowest level of templates on every architecture. */
static int find_level(const char *name)
{
    int level = SST_CPU_LEVELS - 1;

    if (!strcasecmp(name, "base"))
        return SST_CPU_BASE;
    while (level >= 0 && strcasecmp(name, levels[level].name))
        level--;
    return level;
}

static void choose(void)
{
    const char *cap = getenv("SST_CPU");
    int level = cap && *cap ? find_level(cap) : SST_CPU_LEVELS - 1;

    if (level < 0) {
        sst_log_warning("unknown level SST_CPU=%s; using the reference kernels (levels: " LEVEL_NAMES ")", cap);
        level = SST_CPU_REF;
    }
    while (!sst_kernels_at((enum sst_cpu_level)level, &table))
        level--;
    level_chosen = (enum sst_cpu_level)level;
}

const struct sst_kernels *sst_kernels_get(void)
{
    pthread_once(&once, choose);
    return &table;
}

enum sst_cpu_level sst_cpu_level(void)
{
    pthread_once(&once, choose);
    return level_chosen;
}

const char *sst_cpu_level_name(enum sst_cpu_level level)
{
    return levels[level].name;
}
