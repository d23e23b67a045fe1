/* correlate_places: sums of a register's places at once, a place in each 16 bytes; then their coefficients. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__SSE2__)
#include "pipeline/kernels/simd.h"

#define PLACES_APART (SIMD_BYTES / 16)
#define PLACES       (4 * PLACES_APART)

/* Eight values from each of the places at[0], at[4], ... */
static inline SIMD_INT KERNEL(places_load)(const int16_t *p, const int32_t *at)
{
#define PLACES_AT(i) _mm_loadu_si128((const __m128i *)(const void *)(p + at[4 * (i)]))
#if SIMD_BYTES == 16
    return PLACES_AT(0);
#else
    const __m256i low = _mm256_inserti128_si256(_mm256_castsi128_si256(PLACES_AT(0)), PLACES_AT(1), 1);
#if SIMD_BYTES == 32
    return low;
#else
    const __m256i high = _mm256_inserti128_si256(_mm256_castsi128_si256(PLACES_AT(2)), PLACES_AT(3), 1);

    return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
#endif
#endif
#undef PLACES_AT
}

static inline SIMD_INT KERNEL(places_block)(const int16_t *p)
{
    const __m128i v = _mm_loadu_si128((const __m128i *)(const void *)p);

#if SIMD_BYTES == 16
    return v;
#else
    return SIMD_SPREAD(v);
#endif
}

/* Sum the lanes of four registers by 16 bytes: in the order of places. */
static inline void KERNEL(places_sum)(int32_t *out, const SIMD_INT v[4])
{
    const SIMD_INT a = SIMD_OP(add_epi32)(SIMD_OP(unpacklo_epi32)(v[0], v[1]), SIMD_OP(unpackhi_epi32)(v[0], v[1]));
    const SIMD_INT b = SIMD_OP(add_epi32)(SIMD_OP(unpacklo_epi32)(v[2], v[3]), SIMD_OP(unpackhi_epi32)(v[2], v[3]));

    simd_store_s32(out, (simd_s32)SIMD_OP(add_epi32)(SIMD_OP(unpacklo_epi64)(a, b), SIMD_OP(unpackhi_epi64)(a, b)));
}

static void KERNEL(places_group)(float *restrict out, const struct sst_correlate *c, const int32_t *at)
{
    int32_t sum[PLACES], squares[PLACES], product[PLACES];
    SIMD_INT one[4], two[4], with[4];

    for (int i = 0; i < 4; i++) {
        const int16_t *p = c->grey;
        SIMD_INT v = KERNEL(places_load)(p, at + i);

        one[i] = v;
        two[i] = SIMD_OP(madd_epi16)(v, v);
        with[i] = SIMD_OP(madd_epi16)(v, KERNEL(places_block)(c->block[0]));
        for (int y = 1; y < SST_CORRELATE_HEIGHT; y++) {
            p += c->stride;
            v = KERNEL(places_load)(p, at + i);
            one[i] = SIMD_OP(add_epi16)(one[i], v);
            two[i] = SIMD_OP(add_epi32)(two[i], SIMD_OP(madd_epi16)(v, v));
            with[i] = SIMD_OP(add_epi32)(with[i], SIMD_OP(madd_epi16)(v, KERNEL(places_block)(c->block[y])));
        }
        one[i] = SIMD_OP(madd_epi16)(one[i], (SIMD_INT)simd_set_u16(1));
    }
    KERNEL(places_sum)(sum, one);
    KERNEL(places_sum)(squares, two);
    KERNEL(places_sum)(product, with);
    for (int i = 0; i < PLACES; i++) {
        const int32_t spread = squares[i] * SST_CORRELATE_SIZE - sum[i] * sum[i];
        const double root = sqrt((spread > 0 ? spread : 1) * c->spread);
        const float v = (float)((double)(product[i] * SST_CORRELATE_SIZE - sum[i] * c->sum) / root);

        out[i] = spread > 0 ? v : 0;
    }
}

static void KERNEL(correlate_places)(float *out, const struct sst_correlate *c, const int32_t *at, size_t n)
{
    for (size_t i = 0; i < n; i += PLACES) {
        const size_t some = n - i < PLACES ? n - i : PLACES;
        float v[PLACES];
        int32_t from[PLACES] = { 0 };

        for (size_t k = 0; k < some; k++)
            from[k] = at[i + k] < 0 ? 0 : at[i + k];
        KERNEL(places_group)(v, c, from);
        for (size_t k = 0; k < some; k++)
            out[i + k] = at[i + k] < 0 ? SST_CORRELATE_NONE : v[k];
    }
}
#undef PLACES
#undef PLACES_APART
#else
static void KERNEL(correlate_places)(float *out, const struct sst_correlate *c, const int32_t *at, size_t n)
{
    sst_correlate_places_ref(out, c, at, n);
}
#endif
