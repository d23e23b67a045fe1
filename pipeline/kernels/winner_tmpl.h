/* winner_row: vectors of costs. The last one overlaps its predecessor; with AVX-512 it is masked instead. */
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

#if defined(__AVX512BW__)
/* The keys in hand stay in registers and move by one from pixel to pixel; those that leave are stored with the last
 * register. @param regs  1..4: nd is 16 of it */
static inline void KERNEL(winner_other_few)(uint32_t *restrict key, const uint16_t *restrict sum, size_t stride,
                                            size_t n, const int regs)
{
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    __m512i held[4];

    for (int r = 0; r < regs; r++)
        held[r] = _mm512_loadu_si512(key + n - 1 + 16 * r);
    for (size_t x = 0; x < n; x++) {
        uint32_t *at = key + (n - 1 - x);

        for (int r = 0; r < regs; r++) {
            const __m256i half = _mm256_loadu_si256((const __m256i *)(const void *)(sum + x * stride + 16 * r));
            const __m512i k = _mm512_or_si512(_mm512_slli_epi32(_mm512_cvtepu16_epi32(half), 16),
                                              _mm512_add_epi32(lane, _mm512_set1_epi32(16 * r)));

            held[r] = _mm512_min_epu32(held[r], k);
        }
        if (x + 1 == n)
            break;
        _mm512_storeu_si512(at + 16 * (regs - 1), held[regs - 1]);
        for (int r = regs - 1; r > 0; r--)
            held[r] = _mm512_alignr_epi32(held[r], held[r - 1], 15);
        held[0] = _mm512_alignr_epi32(held[0], _mm512_set1_epi32((int32_t)at[-1]), 15);
    }
    for (int r = 0; r < regs; r++)
        _mm512_storeu_si512(key + 16 * r, held[r]);
}
#endif

static void KERNEL(winner_other_row)(uint32_t *restrict key, const uint16_t *restrict sum, size_t stride, size_t n,
                                     size_t nd)
{
#if defined(__AVX512BW__)
    if (n > 0 && nd == 32) {
        KERNEL(winner_other_few)(key, sum, stride, n, 2);
        return;
    }
    if (n > 0 && nd == 64) {
        KERNEL(winner_other_few)(key, sum, stride, n, 4);
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
