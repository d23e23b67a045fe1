/* pipeline/kernels/kernels.h - the kernels: one table, filled with the best variant that this CPU has. */
#ifndef SST_PIPELINE_KERNELS_KERNELS_H
#define SST_PIPELINE_KERNELS_KERNELS_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

/*
 * A kernel is a pure function on rows. `<name>_ref.c` is its definition: the plainest loop. `<name>_tmpl.h` is the form
 * that compilers vectorise; x86/<level>.c compiles all templates for one CPU level. Nothing is contracted to FMA and no sum
 * inside a pixel is reordered, so every level gives the bytes of the reference, unless a tolerance stands here.
 */
enum sst_cpu_level {
    SST_CPU_REF = 0,    /* plain references */
    SST_CPU_BASE = 1,   /* templates for the compiler's default target */
    SST_CPU_AVX2 = 2,
    SST_CPU_AVX512 = 3, /* F, BW, DQ, VL, VPOPCNTDQ, BITALG, VBMI: Ice Lake, Zen 4 and later */
};

/** One line per kernel: X(name). Its type sst_<name>_fn, contract and arguments are declared below. */
#define SST_KERNEL_LIST(X) X(add_u8)

/** sum[i] += row[i]; the smallest kernel, an example of the scheme. */
typedef void sst_add_u8_fn(uint16_t *sum, const uint8_t *row, size_t n);

struct sst_kernels {
#define X(name) sst_##name##_fn *name;
    SST_KERNEL_LIST(X)
#undef X
};

#define X(name) sst_##name##_fn sst_##name##_ref;
SST_KERNEL_LIST(X)
#undef X

/** The kernels for this CPU; the environment variable SST_CPU=ref|base|avx2|avx512 caps the level. Thread: any. */
const struct sst_kernels *sst_kernels_get(void);

/** The table of one level. @return false where this CPU or build lacks it. */
int sst_kernels_at(enum sst_cpu_level level, struct sst_kernels *out);

/** The level that sst_kernels_get() chose; its name. */
enum sst_cpu_level sst_cpu_level(void);
const char *sst_cpu_level_name(enum sst_cpu_level level);

/* Fill functions of the levels, made by templates.h. */
void sst_kernels_fill_base(struct sst_kernels *k);
void sst_kernels_fill_avx2(struct sst_kernels *k);
void sst_kernels_fill_avx512(struct sst_kernels *k);

SST_EXTERN_C_END

#endif
