/* winner_row: vectors of costs. The last one overlaps its predecessor; with AVX-512 it is masked instead. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#define WINNER_LANES ((size_t)SIMD_BYTES / 2)

/* Start of the last vector, when the whole vectors end at d. */
static inline size_t KERNEL(winner_last)(size_t d, size_t nd)
{
    return SIMD_BYTES == 64 ? d : nd - WINNER_LANES;
}

/* @param count  that exist */
static inline simd_u16 KERNEL(winner_load)(const uint16_t *s, size_t count SST_UNUSED)
{
#if SIMD_BYTES == 64
    const __mmask32 there = count >= WINNER_LANES ? UINT32_MAX : (1u << count) - 1;

    return (simd_u16)_mm512_mask_loadu_epi16(_mm512_set1_epi16(-1), there, s);
#else
    return simd_load_u16(s);
#endif
}

/* The least cost; with `other`, without costs b - 1 to b + 1. */
static inline uint16_t KERNEL(winner_least)(const uint16_t *s, size_t nd, bool other, size_t b)
{
    static const uint16_t lane[32] = { 0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13, 14, 15,
                                       16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31 };
    simd_u16 from_b = simd_load_u16(lane) + (uint16_t)(1 - b), least = KERNEL(winner_load)(s, nd);
    size_t d = WINNER_LANES;

    least |= (simd_u16)(from_b <= 2) & (uint16_t)-other;
    for (; d + WINNER_LANES <= nd; d += WINNER_LANES) {
        const simd_u16 v = simd_load_u16(s + d);

        from_b += (uint16_t)WINNER_LANES;
        least = simd_min_u16(least, other ? v | (simd_u16)(from_b <= 2) : v);
    }
    if (d < nd) {
        const size_t last = KERNEL(winner_last)(d, nd);
        const simd_u16 v = KERNEL(winner_load)(s + last, nd - d);

        from_b += (uint16_t)(last + WINNER_LANES - d);
        least = simd_min_u16(least, other ? v | (simd_u16)(from_b <= 2) : v);
    }
    return simd_least_u16(least);
}

/* The first place of a value that is there. */
static inline size_t KERNEL(winner_find)(const uint16_t *s, size_t nd, uint16_t value)
{
    size_t d = 0;

    for (; d + WINNER_LANES <= nd; d += WINNER_LANES) {
        const size_t first = (size_t)simd_first_u16(simd_load_u16(s + d), value);

        if (first < WINNER_LANES)
            return d + first;
    }
    s += KERNEL(winner_last)(d, nd);
    return KERNEL(winner_last)(d, nd) + (size_t)simd_first_u16(KERNEL(winner_load)(s, nd - d), value);
}

static inline void KERNEL(winner_each)(uint16_t *restrict best, uint16_t *restrict second, const uint16_t *restrict sum,
                                       size_t stride, size_t n, const size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *s = sum + x * stride;
        const size_t b = KERNEL(winner_find)(s, nd, KERNEL(winner_least)(s, nd, false, 0));

        best[x] = (uint16_t)b;
        if (second)
            second[x] = KERNEL(winner_least)(s, nd, true, b);
    }
}

static void KERNEL(winner_row)(uint16_t *restrict best, uint16_t *restrict second, const uint16_t *restrict sum,
                               size_t stride, size_t n, size_t nd)
{
    if (nd == 32) /* the loops become straight code */
        KERNEL(winner_each)(best, second, sum, stride, n, 32);
    else if (nd == 64)
        KERNEL(winner_each)(best, second, sum, stride, n, 64);
    else if (SIMD_BYTES == 64 || nd >= WINNER_LANES)
        KERNEL(winner_each)(best, second, sum, stride, n, nd);
    else
        sst_winner_row_ref(best, second, sum, stride, n, nd);
}
#undef WINNER_LANES

#if defined(__AVX2__)
#define KEYS (SIMD_BYTES / 4)

/* Keys of costs at d and on. */
static inline SIMD_INT KERNEL(winner_keys)(const uint16_t *sum, size_t d)
{
    static const uint32_t lane[16] = SIMD_LANES;
#if SIMD_BYTES == 64
    const __m512i costs = _mm512_cvtepu16_epi32(_mm256_loadu_si256((const __m256i *)(const void *)(sum + d)));
#else
    const __m256i costs = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(const void *)(sum + d)));
#endif

    return (SIMD_INT)((simd_u32)costs << 16 | (simd_load_u32(lane) + (uint32_t)d));
}

/* Lanes one further, the first from the last one of `before`. */
static inline SIMD_INT KERNEL(winner_further)(SIMD_INT before, SIMD_INT v)
{
#if SIMD_BYTES == 64
    return _mm512_alignr_epi32(v, before, 15);
#else
    const __m256i turn = _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6);

    return _mm256_blend_epi32(_mm256_permutevar8x32_epi32(v, turn), _mm256_permutevar8x32_epi32(before, turn), 1);
#endif
}

/* The keys in hand stay in registers and move by one from pixel to pixel; those that leave are stored with the last
 * register. @param regs  that they take */
static inline __attribute__((always_inline)) void KERNEL(winner_other_few)(uint32_t *restrict key,
                                                                           const uint16_t *restrict sum, size_t stride,
                                                                           size_t n, const int regs)
{
    SIMD_INT held[64 / KEYS];

#pragma GCC unroll 8
    for (int r = 0; r < regs; r++)
        held[r] = (SIMD_INT)simd_load_u32(key + n - 1 + KEYS * r);
    for (size_t x = 0; x < n; x++) {
        uint32_t *at = key + (n - 1 - x);

#pragma GCC unroll 8
        for (int r = 0; r < regs; r++)
            held[r] = SIMD_OP(min_epu32)(held[r], KERNEL(winner_keys)(sum + x * stride, KEYS * (size_t)r));
        if (x + 1 == n)
            break;
        simd_store_u32(at + KEYS * (regs - 1), (simd_u32)held[regs - 1]);
#pragma GCC unroll 8
        for (int r = regs - 1; r > 0; r--)
            held[r] = KERNEL(winner_further)(held[r - 1], held[r]);
        held[0] = KERNEL(winner_further)(SIMD_OP(set1_epi32)((int32_t)at[-1]), held[0]);
    }
#pragma GCC unroll 8
    for (int r = 0; r < regs; r++)
        simd_store_u32(key + KEYS * r, (simd_u32)held[r]);
}
#undef KEYS
#endif

static void KERNEL(winner_other_row)(uint32_t *restrict key, const uint16_t *restrict sum, size_t stride, size_t n,
                                     size_t nd)
{
#if defined(__AVX2__)
    if (n > 0 && nd == 32) {
        KERNEL(winner_other_few)(key, sum, stride, n, 128 / SIMD_BYTES);
        return;
    }
    if (n > 0 && nd == 64) {
        KERNEL(winner_other_few)(key, sum, stride, n, 256 / SIMD_BYTES);
        return;
    }
#endif
    for (size_t x = 0; x < n; x++) {
        const uint16_t *s = sum + x * stride;
        uint32_t *at = key + (n - 1 - x);

        for (uint32_t d = 0; d < (uint32_t)nd; d++) {
            const uint32_t k = (uint32_t)s[d] << 16 | d;

            at[d] = k < at[d] ? k : at[d];
        }
    }
}
