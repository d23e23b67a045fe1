#if defined(__aarch64__)
#include "pipeline/kernels/arm/winner_tmpl.h"
#elif defined(__AVX512BW__)
static inline uint16_t KERNEL(winner_least)(__m512i v)
{
    const __m256i half = _mm256_min_epu16(_mm512_castsi512_si256(v), _mm512_extracti64x4_epi64(v, 1));
    const __m128i quarter = _mm_min_epu16(_mm256_castsi256_si128(half), _mm256_extracti128_si256(half, 1));

    return (uint16_t)_mm_cvtsi128_si32(_mm_minpos_epu16(quarter));
}

/* Costs d .. d + 31 of nd; 65535 for those that do not exist, and for those that `without` has. */
static inline __m512i KERNEL(winner_load)(const uint16_t *s, size_t d, size_t nd, uint32_t without)
{
    const uint32_t there = nd - d >= 32 ? UINT32_MAX : (1u << (nd - d)) - 1;

    return _mm512_mask_loadu_epi16(_mm512_set1_epi16(-1), there & ~without, s + d);
}

/* The bits of b - 1, b and b + 1 among d .. d + 31. */
static inline uint32_t KERNEL(winner_around)(ptrdiff_t b, ptrdiff_t d)
{
    const ptrdiff_t shift = b - 1 - d;

    return shift >= 32 || shift <= -3 ? 0 : shift >= 0 ? 7u << shift : 7u >> -shift;
}

static inline void KERNEL(winner_each)(uint16_t *restrict best, uint16_t *restrict second, const uint16_t *restrict sum,
                                       size_t stride, size_t n, const size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *s = sum + x * stride;
        __m512i least = _mm512_set1_epi16(-1), other = least;
        size_t b = 0;
        uint16_t value;

        for (size_t d = 0; d < nd; d += 32)
            least = _mm512_min_epu16(least, KERNEL(winner_load)(s, d, nd, 0));
        value = KERNEL(winner_least)(least);
        for (size_t d = 0; d < nd; d += 32) {
            const uint32_t there = nd - d >= 32 ? UINT32_MAX : (1u << (nd - d)) - 1;
            const uint32_t equal = there & _mm512_cmpeq_epu16_mask(KERNEL(winner_load)(s, d, nd, 0),
                                                                   _mm512_set1_epi16((int16_t)value));

            if (equal) {
                b = d + _tzcnt_u32(equal);
                break;
            }
        }
        best[x] = (uint16_t)b;
        if (!second)
            continue;
        for (size_t d = 0; d < nd; d += 32)
            other = _mm512_min_epu16(
                other, KERNEL(winner_load)(s, d, nd, KERNEL(winner_around)((ptrdiff_t)b, (ptrdiff_t)d)));
        second[x] = KERNEL(winner_least)(other);
    }
}

static void KERNEL(winner_row)(uint16_t *restrict best, uint16_t *restrict second, const uint16_t *restrict sum,
                               size_t stride, size_t n, size_t nd)
{
    if (nd == 32) /* the loops become straight code */
        KERNEL(winner_each)(best, second, sum, stride, n, 32);
    else
        KERNEL(winner_each)(best, second, sum, stride, n, nd);
}
#else
/* The index is in the low half of a 32-bit key, so that one minimum finds value and smallest index at once. */
static void KERNEL(winner_row)(uint16_t *restrict best, uint16_t *restrict second, const uint16_t *restrict sum,
                               size_t stride, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *s = sum + x * stride;
        uint32_t key = UINT32_MAX;
        uint16_t other = 65535;
        size_t b;

        for (uint32_t d = 0; d < (uint32_t)nd; d++) {
            const uint32_t k = (uint32_t)s[d] << 16 | d;

            key = k < key ? k : key;
        }
        b = key & 0xFFFF;
        best[x] = (uint16_t)b;
        if (!second)
            continue;
        for (size_t d = 0; d + 1 < b; d++)
            other = s[d] < other ? s[d] : other;
        for (size_t d = b + 2; d < nd; d++)
            other = s[d] < other ? s[d] : other;
        second[x] = other;
    }
}
#endif

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
