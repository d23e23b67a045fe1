#include "pipeline/kernels/kernels.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif
#include <pthread.h>
#include <stdlib.h>
#include <strings.h>

#include "base/log.h"

static const char *const level_names[] = { "ref", "base", "avx2", "avxvnni", "avx512" };

static struct sst_kernels table;        /* fixed after the first get */
static enum sst_cpu_level level_chosen; /* likewise */
static pthread_once_t once = PTHREAD_ONCE_INIT;

#if defined(__x86_64__)
/* Leaf 7, subleaf 1: __builtin_cpu_supports() of older compilers does not know it. */
static int cpu_has_avxvnni(void)
{
    unsigned a, b, c, d;

    return __get_cpuid_count(7, 1, &a, &b, &c, &d) && a & 1u << 4;
}
#endif

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
#endif
    default:
        return 0;
    }
}

int sst_kernels_at(enum sst_cpu_level level, struct sst_kernels *out)
{
    if (!cpu_has(level))
        return 0;
    switch (level) {
    case SST_CPU_BASE:
        sst_kernels_fill_base(out);
        break;
#if defined(__x86_64__)
    case SST_CPU_AVX2:
        sst_kernels_fill_avx2(out);
        break;
    case SST_CPU_AVXVNNI:
        sst_kernels_fill_avxvnni(out);
        break;
    case SST_CPU_AVX512:
        sst_kernels_fill_avx512(out);
        break;
#endif
    default:
#define X(name) out->name = sst_##name##_ref;
        SST_KERNEL_LIST(X)
#undef X
        break;
    }
    return 1;
}

static void choose(void)
{
    const char *cap = getenv("SST_CPU");
    int level = SST_CPU_AVX512;

    if (cap && *cap) {
        for (level = SST_CPU_AVX512; level > SST_CPU_REF && strcasecmp(cap, level_names[level]); level--)
            ;
        if (strcasecmp(cap, level_names[level]))
            sst_log_warning("SST_CPU=%s is none of ref, base, avx2, avxvnni, avx512: the plain references are used",
                            cap);
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
    return level_names[level];
}
