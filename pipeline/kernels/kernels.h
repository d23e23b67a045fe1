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
#define SST_KERNEL_LIST(X) X(blend_rays) X(blend_plain) X(blend_finish)

#define SST_BLEND_MAX 512        /* pixels that one call of a blend kernel takes at most */
#define SST_BLEND_COLUMNS 4096   /* columns of the table of label weights: stored disparity / 16, 1/4 px each */
#define SST_BLEND_COLUMN_SHIFT 4
#define SST_BLEND_FLOOR 1e-28f   /* weight sums below this are not trusted */
#define SST_BLEND_TINY 1e-37f    /* changes no weight sum above the floor, and keeps 0 / 0 away below it */

/** What one view adds to a stretch of one output row. Pointers name the source pixel of the first output pixel. */
struct sst_blend {
    const uint8_t *top[3], *bottom[3]; /* R, G, B of the two source rows, n + 1 pixels readable in each */
    float fx, fy;                      /* place between the two columns and rows, 0 <= f < 1 */
    float aperture;                    /* weight of the view */
    /* of blend_rays only */
    const uint16_t *disp;      /* nearest pixel, n of them; 0xFFFF: unknown */
    const uint8_t *label;      /* likewise, or NULL: all label weights are 1 */
    const float *label_weight; /* [256][SST_BLEND_COLUMNS]: W_s by label and stored disparity / 16 */
    float focus_whole_q6, focus_part_q6; /* d_f in stored units, split so that their rounding does not show */
    float half_inverse_variance;         /* 1 / (2 sigma_d^2) in stored units, >= 0 */
    float c1, one_minus_c1;
    float unknown;                       /* W_d of a ray of unknown disparity */
};

/**
 * acc[0..2] += A W_s W_d C, acc[3] += A W_s W_d (DESIGN 5.4) with C bilinear between the two rows,
 * W_d = one_minus_c1 exp(-(focus - disp)^2 half_inverse_variance) + c1.
 *
 * @param acc  in and out, four rows of n; n at most SST_BLEND_MAX. The exponential is sst_exp_neg() of exp_neg.h,
 *             its argument clamped to SST_EXP_NEG_MAX: what is smaller is below SST_BLEND_FLOOR.
 */
typedef void sst_blend_rays_fn(float *const acc[4], const struct sst_blend *b, size_t n);

/** The same with W_s = W_d = 1: plain refocusing. */
typedef void sst_blend_plain_fn(float *const acc[4], const struct sst_blend *b, size_t n);

/** out = sum / (weight + SST_BLEND_TINY) to the nearest value. sum <= 255 weight but for rounding. */
typedef void sst_blend_finish_fn(uint8_t *out, const float *sum, const float *weight, size_t n);

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
