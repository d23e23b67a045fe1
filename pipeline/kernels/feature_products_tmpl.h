/*
 * feature_products. Two descriptors of a by four of b share their loads; their eight sums stay in registers, and four
 * at a time are added across lanes. The rest, and levels without such sums, are the reference's loop.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#if defined(__AVX2__)

/* Sums over lanes of four vectors. */
static inline __m128i KERNEL(feature_product_sums)(const simd_s32 sum[4])
{
    __m256i v[4], both;

    for (int k = 0; k < 4; k++) {
#if SIMD_BYTES == 64
        v[k] = _mm256_add_epi32(_mm512_castsi512_si256((__m512i)sum[k]), _mm512_extracti64x4_epi64((__m512i)sum[k], 1));
#else
        v[k] = (__m256i)sum[k];
#endif
    }
    both = _mm256_hadd_epi32(_mm256_hadd_epi32(v[0], v[1]), _mm256_hadd_epi32(v[2], v[3]));
    return _mm_add_epi32(_mm256_castsi256_si128(both), _mm256_extracti128_si256(both, 1));
}

static inline void KERNEL(feature_product_block)(int32_t *const out[2], const int16_t *a, const int16_t *b)
{
    simd_s32 sum[2][4] = { { { 0 } } };

    for (int c = 0; c < SST_FEATURE_PARTS; c += SIMD_BYTES / 2) {
        SIMD_INT left[2];

        for (int i = 0; i < 2; i++)
            left[i] = (SIMD_INT)simd_load_u16((const uint16_t *)a + i * SST_FEATURE_PARTS + c);
        for (int j = 0; j < 4; j++) {
            const SIMD_INT right = (SIMD_INT)simd_load_u16((const uint16_t *)b + j * SST_FEATURE_PARTS + c);

            for (int i = 0; i < 2; i++)
                sum[i][j] += (simd_s32)SIMD_OP(madd_epi16)(left[i], right);
        }
    }
    for (int i = 0; i < 2; i++)
        _mm_storeu_si128((__m128i *)(void *)out[i], KERNEL(feature_product_sums)(sum[i]));
}

static void KERNEL(feature_products)(int32_t *out, const int16_t *a, size_t count, const int16_t *b, size_t n)
{
    const size_t whole = n & ~(size_t)3;

    for (size_t i = 0; i + 2 <= count; i += 2) {
        const int16_t *left = a + i * SST_FEATURE_PARTS;

        for (size_t j = 0; j < whole; j += 4)
            KERNEL(feature_product_block)
        ((int32_t *const[2]){ out + i * n + j, out + (i + 1) * n + j }, left, b + j * SST_FEATURE_PARTS);
        for (size_t k = i; k < i + 2; k++) {
            for (size_t j = whole; j < n; j++)
                sst_feature_products_ref(out + k * n + j, a + k * SST_FEATURE_PARTS, 1, b + j * SST_FEATURE_PARTS, 1);
        }
    }
    if (count % 2)
        sst_feature_products_ref(out + (count - 1) * n, a + (count - 1) * SST_FEATURE_PARTS, 1, b, n);
}

#else

static void KERNEL(feature_products)(int32_t *out, const int16_t *a, size_t count, const int16_t *b, size_t n)
{
    sst_feature_products_ref(out, a, count, b, n);
}

#endif
