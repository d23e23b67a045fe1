/*
 * Dot products of 64 bytes. Instructions multiply unsigned by signed bytes: b is used as stored, a is made signed
 * again, and <a, b> = sum a (b + zero) - zero sum a. The vectors of one block of a are prepared once for all positions;
 * several positions at a time hide the latency of the sums. Without byte dot products, 16-bit multiply-adds of
 * neighbouring channels give several sums per pixel, added at the end.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#if defined(__AVX512VNNI__) || defined(__AVXVNNI__)
#define FEATURE_VECTORS 1          /* of a block and four channels */
#define FEATURE_BYTES   SIMD_BYTES /* of b for each */
#define FEATURE_PLACES  8
typedef simd_s32 KERNEL(feature_part);
typedef simd_s32 KERNEL(feature_sum);

static inline KERNEL(feature_part) KERNEL(feature_signed)(const uint8_t *a)
{
    return (simd_s32)(simd_load_u8(a) ^ SST_FEATURE_ZERO);
}

/* sum + products of a and b, which is as stored */
static inline KERNEL(feature_sum) KERNEL(feature_add)(KERNEL(feature_sum) sum, const uint8_t *b, KERNEL(feature_part) a)
{
#if defined(__AVX512VNNI__)
    return (simd_s32)_mm512_dpbusd_epi32((__m512i)sum, (__m512i)simd_load_u8(b), (__m512i)a);
#else
    return (simd_s32)_mm256_dpbusd_avx_epi32((__m256i)sum, (__m256i)simd_load_u8(b), (__m256i)a);
#endif
}

/* Sums of the i-th vector of pixels. */
static inline simd_s32 KERNEL(feature_dot)(const KERNEL(feature_sum) *sum, int i)
{
    return sum[i];
}
#elif defined(__AVX2__)
#define FEATURE_VECTORS 2
#define FEATURE_BYTES   16
#define FEATURE_PLACES  2
typedef __m256i KERNEL(feature_part);
typedef __m256i KERNEL(feature_sum);

static inline __m256i KERNEL(feature_words)(const uint8_t *p)
{
    return _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)p));
}

static inline KERNEL(feature_part) KERNEL(feature_signed)(const uint8_t *a)
{
    return _mm256_sub_epi16(KERNEL(feature_words)(a), _mm256_set1_epi16(SST_FEATURE_ZERO));
}

static inline KERNEL(feature_sum) KERNEL(feature_add)(KERNEL(feature_sum) sum, const uint8_t *b, KERNEL(feature_part) a)
{
    return _mm256_add_epi32(sum, _mm256_madd_epi16(a, KERNEL(feature_words)(b)));
}

static inline simd_s32 KERNEL(feature_dot)(const KERNEL(feature_sum) *sum, int i)
{
    /* hadd leaves pixels 0 1 4 5 | 2 3 6 7 */
    return (simd_s32)_mm256_permute4x64_epi64(_mm256_hadd_epi32(sum[i], sum[i + 1]), 0xD8);
}
#elif defined(__ARM_NEON)
#define FEATURE_BYTES  16
#define FEATURE_PLACES 8
typedef int8x16_t KERNEL(feature_part);

static inline KERNEL(feature_part) KERNEL(feature_signed)(const uint8_t *a)
{
    return (int8x16_t)(simd_load_u8(a) ^ SST_FEATURE_ZERO);
}

#if defined(__ARM_FEATURE_DOTPROD)
#define FEATURE_VECTORS 2
typedef int32x4_t KERNEL(feature_sum);

static inline KERNEL(feature_sum) KERNEL(feature_add)(KERNEL(feature_sum) sum, const uint8_t *b, KERNEL(feature_part) a)
{
#if defined(__ARM_FEATURE_MATMUL_INT8)
    return vusdotq_s32(sum, vld1q_u8(b), a);
#else
    return vdotq_s32(sum, KERNEL(feature_signed)(b), a);
#endif
}

static inline simd_s32 KERNEL(feature_dot)(const KERNEL(feature_sum) *sum, int i)
{
    return (simd_s32)sum[i];
}
#else
#define FEATURE_VECTORS 1
typedef int16x8x2_t KERNEL(feature_sum); /* parts of unit vectors have products within 2^15 */

static inline KERNEL(feature_sum) KERNEL(feature_add)(KERNEL(feature_sum) sum, const uint8_t *b, KERNEL(feature_part) a)
{
    const int8x16_t v = KERNEL(feature_signed)(b);

    sum.val[0] = vmlal_s8(sum.val[0], vget_low_s8(v), vget_low_s8(a));
    sum.val[1] = vmlal_high_s8(sum.val[1], v, a);
    return sum;
}

static inline simd_s32 KERNEL(feature_dot)(const KERNEL(feature_sum) *sum, int i)
{
    return (simd_s32)vpaddq_s32(vpaddlq_s16(sum[i].val[0]), vpaddlq_s16(sum[i].val[1]));
}
#endif
#endif

#if defined(FEATURE_PLACES)
#if defined(__ARM_NEON) && !defined(__ARM_FEATURE_MATMUL_INT8)
#define FEATURE_STORED 0
#else
#define FEATURE_STORED 1 /* b is used as stored, so that products are zero a too large */
#endif
#define FEATURE_PIXELS (FEATURE_BYTES * FEATURE_VECTORS / 4) /* of a block */
#define FEATURE_WHOLE  (4 * FEATURE_PIXELS / SIMD_BYTES)     /* vectors of their sums */

/* (whole - dot) >> shift, clamped. */
static inline void KERNEL(feature_store)(uint8_t *cost, const simd_s32 *whole, const KERNEL(feature_sum) *sum)
{
    simd_s32 left[FEATURE_WHOLE];

    for (int i = 0; i < FEATURE_WHOLE; i++)
        left[i] = whole[i] - KERNEL(feature_dot)(sum, i);
#if SIMD_BYTES == 64
    const __m512i c = _mm512_max_epi32(_mm512_srai_epi32((__m512i)left[0], SST_FEATURE_SHIFT), _mm512_setzero_si512());

    _mm_storeu_si128((__m128i *)(void *)cost,
                     _mm_min_epu8(_mm512_cvtusepi32_epi8(c), _mm_set1_epi8((char)SST_FEATURE_COST_MAX)));
#elif SIMD_BYTES == 32
    const __m256i c = _mm256_srai_epi32((__m256i)left[0], SST_FEATURE_SHIFT);
    const __m128i half = _mm_packs_epi32(_mm256_castsi256_si128(c), _mm256_extracti128_si256(c, 1));

    _mm_storel_epi64((__m128i *)(void *)cost,
                     _mm_min_epu8(_mm_packus_epi16(half, half), _mm_set1_epi8((char)SST_FEATURE_COST_MAX)));
#else
    const uint16x4_t c = vqshrun_n_s32((int32x4_t)left[0], SST_FEATURE_SHIFT);
    const uint16x4_t d = vqshrun_n_s32((int32x4_t)left[FEATURE_WHOLE - 1], SST_FEATURE_SHIFT);
    const uint8x8_t bytes = vmin_u8(vqmovn_u16(vcombine_u16(c, d)), vdup_n_u8(SST_FEATURE_COST_MAX));

    memcpy(cost, &bytes, FEATURE_PIXELS);
#endif
}

/*
 * One block of a against `places` (a compile-time constant) positions of b: the sums stay in registers. Positions past
 * the last one repeat it.
 */
static inline __attribute__((always_inline)) void KERNEL(feature_tile)(uint8_t *restrict cost, size_t cost_stride,
                                                                       KERNEL(feature_part) (*a)[FEATURE_VECTORS],
                                                                       const simd_s32 *whole, const uint8_t *const *b,
                                                                       size_t last, size_t at, size_t stride,
                                                                       const size_t places)
{
    const uint8_t *p[FEATURE_PLACES];
    KERNEL(feature_sum) sum[FEATURE_PLACES][FEATURE_VECTORS];

#pragma GCC unroll 8
    for (size_t j = 0; j < places; j++) {
        p[j] = b[j < last ? j : last] + at;
        for (int i = 0; i < FEATURE_VECTORS; i++)
            sum[j][i] = (KERNEL(feature_sum)){ 0 };
    }
#pragma GCC unroll 1
    for (int g = 0; g < SST_FEATURE_CHANNELS / 4; g++) {
#pragma GCC unroll 8
        for (size_t j = 0; j < places; j++) {
            for (int i = 0; i < FEATURE_VECTORS; i++)
                sum[j][i] = KERNEL(feature_add)(sum[j][i], p[j] + (size_t)g * stride + FEATURE_BYTES * i, a[g][i]);
        }
    }
#pragma GCC unroll 8
    for (size_t j = 0; j < places; j++)
        KERNEL(feature_store)(cost + (j < last ? j : last) * cost_stride, whole, sum[j]);
}

static void KERNEL(feature_cost_rows)(uint8_t *restrict cost, size_t cost_stride, const uint8_t *restrict a,
                                      const uint8_t *const *b, size_t count, size_t stride, size_t n)
{
    uint8_t zero[FEATURE_BYTES];

    memset(zero, SST_FEATURE_ZERO, sizeof(zero));
    for (size_t x = 0; x < n; x += FEATURE_PIXELS) {
        KERNEL(feature_part) v[SST_FEATURE_CHANNELS / 4][FEATURE_VECTORS];
        KERNEL(feature_sum) sum[FEATURE_VECTORS];
        simd_s32 whole[FEATURE_WHOLE];

        for (int i = 0; i < FEATURE_VECTORS; i++)
            sum[i] = (KERNEL(feature_sum)){ 0 };
        for (int g = 0; g < SST_FEATURE_CHANNELS / 4; g++) {
            for (int i = 0; i < FEATURE_VECTORS; i++) {
                v[g][i] = KERNEL(feature_signed)(a + (size_t)g * stride + 4 * x + FEATURE_BYTES * (size_t)i);
                if (FEATURE_STORED)
                    sum[i] = KERNEL(feature_add)(sum[i], zero, v[g][i]);
            }
        }
        for (int i = 0; i < FEATURE_WHOLE; i++)
            whole[i] = KERNEL(feature_dot)(sum, i) + SST_FEATURE_ONE * SST_FEATURE_ONE;
        for (size_t j = 0; j < count;) {
            const size_t left = count - j, places = left > FEATURE_PLACES / 2 ? FEATURE_PLACES : FEATURE_PLACES / 2;
            uint8_t *out = cost + j * cost_stride + x;

            if (places == FEATURE_PLACES)
                KERNEL(feature_tile)(out, cost_stride, v, whole, b + j, left - 1, 4 * x, stride, FEATURE_PLACES);
            else
                KERNEL(feature_tile)(out, cost_stride, v, whole, b + j, left - 1, 4 * x, stride, FEATURE_PLACES / 2);
            j += places;
        }
    }
}
#else
static void KERNEL(feature_cost_rows)(uint8_t *restrict cost, size_t cost_stride, const uint8_t *restrict a,
                                      const uint8_t *const *b, size_t count, size_t stride, size_t n)
{
    sst_feature_cost_rows_ref(cost, cost_stride, a, b, count, stride, n);
}
#endif
#undef FEATURE_VECTORS
#undef FEATURE_BYTES
#undef FEATURE_PLACES
#undef FEATURE_STORED
#undef FEATURE_PIXELS
#undef FEATURE_WHOLE
