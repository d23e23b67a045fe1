/* bilateral_row: one vector of pixels at a time, the last one overlaps its predecessor. Steps that count fit 16 bits,
 * and so does the sum of weights. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#define BILATERAL_LANES ((size_t)SIMD_BYTES / 2)

static inline simd_u16 KERNEL(bilateral_luma)(const uint8_t *p)
{
#if SIMD_BYTES == 64
    return (simd_u16)_mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)(const void *)p));
#elif SIMD_BYTES == 32
    return (simd_u16)_mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)p));
#elif defined(__ARM_NEON)
    return (simd_u16)vmovl_u8(vld1_u8(p));
#else
    typedef uint8_t bytes __attribute__((vector_size(8), aligned(1), may_alias));

    return __builtin_convertvector(*(const bytes *)p, simd_u16);
#endif
}

/* sum += a b, which are signed; which lanes are in which half depends on the level. */
static inline void KERNEL(bilateral_add)(simd_s32 sum[2], simd_u16 a, simd_u16 b)
{
#if defined(__SSE2__)
    const SIMD_INT low = SIMD_OP(mullo_epi16)((SIMD_INT)a, (SIMD_INT)b);
    const SIMD_INT high = SIMD_OP(mulhi_epi16)((SIMD_INT)a, (SIMD_INT)b);

    sum[0] += (simd_s32)SIMD_OP(unpacklo_epi16)(low, high);
    sum[1] += (simd_s32)SIMD_OP(unpackhi_epi16)(low, high);
#elif defined(__ARM_NEON)
    sum[0] = (simd_s32)vmlal_s16((int32x4_t)sum[0], vget_low_s16((int16x8_t)a), vget_low_s16((int16x8_t)b));
    sum[1] = (simd_s32)vmlal_high_s16((int32x4_t)sum[1], (int16x8_t)a, (int16x8_t)b);
#else
    for (int i = 0; i < 8; i++)
        sum[i / 4][i % 4] += (int16_t)a[i] * (int16_t)b[i];
#endif
}

/* The halves of which bilateral_add() has made sums, as 16 bits. */
static inline simd_u16 KERNEL(bilateral_join)(simd_s32 low, simd_s32 high)
{
#if defined(__SSE2__)
    return (simd_u16)SIMD_OP(packs_epi32)((SIMD_INT)low, (SIMD_INT)high);
#elif defined(__ARM_NEON)
    return (simd_u16)vuzp1q_u16((uint16x8_t)low, (uint16x8_t)high);
#else
    simd_u16 v;

    for (int i = 0; i < 8; i++)
        v[i] = (uint16_t)(i < 4 ? low[i] : high[i - 4]);
    return v;
#endif
}

static inline void KERNEL(bilateral_pixels)(uint16_t *out, const uint16_t *const disp[7], const uint8_t *const luma[7],
                                            const int16_t *weight, int tau, size_t x)
{
    const uint16_t contrast = (uint16_t)(tau - 1);
    const simd_u16 centre = simd_load_u16(disp[3] + x);
    const simd_u16 darkest = KERNEL(bilateral_luma)(luma[3] + x) - contrast,
                   levels = simd_set_u16((uint16_t)(2 * contrast));
    /* Not below 0, where an unknown disparity is. */
    const simd_u16 nearest = simd_less_u16(centre, simd_set_u16(SST_BILATERAL_STEP_Q6));
    const simd_u16 steps = centre + SST_BILATERAL_STEP_Q6 - nearest;
    simd_s32 sum[2] = { simd_set_s32(0), simd_set_s32(0) }, all[2] = { sum[0], sum[0] }, mean[2];
    simd_u16 total = simd_set_u16(0);

    for (int row = 0; row < 7; row++) {
        const uint16_t *from = disp[row] + x - 3;
        const uint8_t *from_luma = luma[row] + x - 3;

#pragma GCC unroll 7
        for (int i = 0; i < 7; i++) {
            const simd_u16 d = simd_load_u16(from + i), l = KERNEL(bilateral_luma)(from_luma + i);
            const simd_u16 beyond = simd_less_u16(d - nearest, steps) | simd_less_u16(l - darkest, levels);
            const simd_u16 counted = (simd_u16)(beyond == 0) & (uint16_t)weight[7 * row + i];

            KERNEL(bilateral_add)(sum, counted, d - centre);
            total += counted;
        }
    }
    KERNEL(bilateral_add)(all, total, simd_set_u16(1));
    for (int half = 0; half < 2; half++)
        mean[half] = __builtin_convertvector(
            __builtin_convertvector(sum[half], simd_f32) / __builtin_convertvector(all[half], simd_f32) + 128.5F,
            simd_s32);
    /* An unknown disparity, all bits set, stays. */
    simd_store_u16(out + x, (centre - 128 + KERNEL(bilateral_join)(mean[0], mean[1])) | (simd_u16)(centre == 65535));
}

static void KERNEL(bilateral_row)(uint16_t *restrict out, const uint16_t *const disp[7], const uint8_t *const luma[7],
                                  const int16_t *weight, int tau, size_t n)
{
    if (n < BILATERAL_LANES || tau < 1) {
        sst_bilateral_row_ref(out, disp, luma, weight, tau, n);
        return;
    }
    for (size_t x = 0; x < n; x += BILATERAL_LANES) {
        x = x < n - BILATERAL_LANES ? x : n - BILATERAL_LANES;
        KERNEL(bilateral_pixels)(out, disp, luma, weight, sst_min_int(tau, 256), x);
    }
}
#undef BILATERAL_LANES
