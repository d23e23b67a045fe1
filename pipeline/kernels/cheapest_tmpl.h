/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

/* The two cheapest as minima and maxima of bytes, which every CPU level has. */
static void KERNEL(cheapest_row)(uint8_t *restrict first, uint8_t *restrict second, const uint8_t *a, const uint8_t *b,
                                 size_t n)
{
    size_t x = 0;

    for (; n - x >= SIMD_BYTES; x += SIMD_BYTES) {
        const simd_u8 mean = simd_mean_u8(simd_load_u8(a + x), simd_load_u8(b + x));
        const simd_u8 t = simd_min_u8(mean, simd_set_u8(SST_COST_MAX - 1)), one = simd_load_u8(first + x);

        simd_store_u8(first + x, simd_min_u8(one, t));
        simd_store_u8(second + x, simd_min_u8(simd_load_u8(second + x), simd_max_u8(one, t)));
    }
    for (; x < n; x++) {
        const uint8_t mean = (uint8_t)((a[x] + b[x] + 1) >> 1), t = mean < SST_COST_MAX ? mean : SST_COST_MAX - 1;
        const uint8_t one = first[x], two = second[x], over = one > t ? one : t;

        first[x] = one < t ? one : t;
        second[x] = two < over ? two : over;
    }
}

#if defined(__AVX512VBMI__) && defined(__AVX512VPOPCNTDQ__)
/* Up to 64 pixels: eight at a time, one byte of each lane; the order of bytes is put right at the end. */
static inline __attribute__((always_inline)) void KERNEL(cheapest_hamming)(uint8_t *first, uint8_t *second,
                                                                           const uint64_t *a, const uint64_t *const *b,
                                                                           int count, size_t at, size_t n)
{
    const __mmask64 used = n >= 64 ? ~(__mmask64)0 : ((__mmask64)1 << n) - 1;
    __m512i own[8], one = _mm512_set1_epi8(63), two = one;
    uint8_t order[64];

    for (int p = 0; p < 64; p++)
        order[p] = (uint8_t)(8 * (p % 8) + p / 8);
    for (int k = 0; k < 8; k++)
        own[k] = _mm512_maskz_loadu_epi64((__mmask8)(used >> 8 * k), a + at + 8 * k);
    for (int i = 0; i < count; i++) {
        const uint64_t *there = b[i] + at;
        __m512i bits[8], cost, over;

        for (int k = 0; k < 8; k++)
            bits[k] = _mm512_popcnt_epi64(
                _mm512_xor_si512(own[k], _mm512_maskz_loadu_epi64((__mmask8)(used >> 8 * k), there + 8 * k)));
        for (int k = 0; k < 8; k += 2)
            bits[k] = _mm512_or_si512(bits[k], _mm512_slli_epi64(bits[k + 1], 8));
        for (int k = 0; k < 8; k += 4)
            bits[k] = _mm512_or_si512(bits[k], _mm512_slli_epi64(bits[k + 2], 16));
        cost = _mm512_or_si512(bits[0], _mm512_slli_epi64(bits[4], 32));
        over = _mm512_max_epu8(one, cost);
        one = _mm512_min_epu8(one, cost);
        two = _mm512_min_epu8(two, over);
    }
    one = _mm512_permutexvar_epi8(_mm512_loadu_si512(order), _mm512_slli_epi64(one, 2));
    two = _mm512_permutexvar_epi8(_mm512_loadu_si512(order), _mm512_slli_epi64(two, 2));
    _mm512_mask_storeu_epi8(first + at, used, count < 1 ? _mm512_set1_epi8((int8_t)SST_COST_ABSENT) : one);
    _mm512_mask_storeu_epi8(second + at, used, count < 2 ? _mm512_set1_epi8((int8_t)SST_COST_ABSENT) : two);
}

static void KERNEL(cheapest_hamming_row)(uint8_t *first, uint8_t *second, const uint64_t *a, const uint64_t *const *b,
                                         int count, size_t n)
{
    size_t x = 0;

    for (; n - x >= 64; x += 64)
        KERNEL(cheapest_hamming)(first, second, a, b, count, x, 64);
    if (x < n)
        KERNEL(cheapest_hamming)(first, second, a, b, count, x, n - x);
}
#else
#if defined(__AVX2__)
/* Counts of four pixels' bits. */
static inline __m256i KERNEL(count_bits)(__m256i v)
{
    const __m256i low = _mm256_set1_epi8(15);
    const __m256i of = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2,
                                        3, 2, 3, 3, 4);
    const __m256i bytes = _mm256_add_epi8(_mm256_shuffle_epi8(of, _mm256_and_si256(v, low)),
                                          _mm256_shuffle_epi8(of, _mm256_and_si256(_mm256_srli_epi64(v, 4), low)));

    return _mm256_sad_epu8(bytes, _mm256_setzero_si256());
}

/* Counts of 32 pixels, four in each vector, as bytes: within 16 bytes in the order 0 8 1 9 4 12 5 13 of pixels, without
 * 2 3 6 7 of each eight, which the upper half has, then the same of the next 16. */
static inline __m256i KERNEL(pack_counts)(const __m256i n[8])
{
    __m256i words[2];

    for (int k = 0; k < 2; k++)
        words[k] = _mm256_or_si256(_mm256_packs_epi32(n[4 * k], n[4 * k + 1]),
                                   _mm256_slli_epi32(_mm256_packs_epi32(n[4 * k + 2], n[4 * k + 3]), 16));
    return _mm256_packus_epi16(words[0], words[1]);
}

/* Packed counts, without the factor of 4. */
static inline void KERNEL(store_costs)(uint8_t *to, __m256i v)
{
    const __m256i order = _mm256_setr_epi8(0, 2, 4, 6, 1, 3, 5, 7, 8, 10, 12, 14, 9, 11, 13, 15, 0, 2, 4, 6, 1, 3, 5, 7,
                                           8, 10, 12, 14, 9, 11, 13, 15);
    const __m256i pairs = _mm256_shuffle_epi8(_mm256_slli_epi64(v, 2), order);
    const __m128i a = _mm256_castsi256_si128(pairs), b = _mm256_extracti128_si256(pairs, 1);

    _mm_storeu_si128((__m128i *)(void *)to, _mm_unpacklo_epi16(a, b));
    _mm_storeu_si128((__m128i *)(void *)(to + 16), _mm_unpackhi_epi16(a, b));
}

/* 32 pixels, four at a time. */
static void KERNEL(cheapest_hamming)(uint8_t *first, uint8_t *second, const uint64_t *a, const uint64_t *const *b,
                                     int count, size_t at)
{
    __m256i one = _mm256_set1_epi8(63), two = one;

    for (int i = 0; i < count; i++) {
        __m256i bits[8], cost, over;

        for (int k = 0; k < 8; k++) {
            const __m256i own = _mm256_loadu_si256((const __m256i *)(const void *)(a + at + 4 * k));
            const __m256i there = _mm256_loadu_si256((const __m256i *)(const void *)(b[i] + at + 4 * k));

            bits[k] = KERNEL(count_bits)(_mm256_xor_si256(own, there));
        }
        cost = KERNEL(pack_counts)(bits);
        over = _mm256_max_epu8(one, cost);
        one = _mm256_min_epu8(one, cost);
        two = _mm256_min_epu8(two, over);
    }
    KERNEL(store_costs)(first + at, one);
    KERNEL(store_costs)(second + at, two);
    if (count < 1)
        memset(first + at, SST_COST_ABSENT, 32);
    if (count < 2)
        memset(second + at, SST_COST_ABSENT, 32);
}
#endif

static void KERNEL(cheapest_hamming_row)(uint8_t *first, uint8_t *second, const uint64_t *a, const uint64_t *const *b,
                                         int count, size_t n)
{
    uint8_t cost[64];
    size_t x = 0;

#if defined(__AVX2__)
    for (; n - x >= 32; x += 32)
        KERNEL(cheapest_hamming)(first, second, a, b, count, x);
#endif
    for (size_t m; x < n; x += m) {
        m = n - x < sizeof(cost) ? n - x : sizeof(cost);
        memset(first + x, SST_COST_ABSENT, m);
        memset(second + x, SST_COST_ABSENT, m);
        for (int i = 0; i < count; i++) {
            KERNEL(hamming_row)(cost, a + x, b[i] + x, m);
            KERNEL(cheapest_row)(first + x, second + x, cost, cost, m);
        }
    }
}
#endif

static void KERNEL(cheapest_mean_row)(uint8_t *restrict first, const uint8_t *restrict second, int two, size_t n)
{
    size_t x = 0;

    for (; n - x >= SIMD_BYTES; x += SIMD_BYTES) {
        const simd_u8 a = simd_load_u8(first + x), b = simd_load_u8(second + x);
        /* (3 a + b + 2) >> 2 is the mean of a and of both's, rounded down: their mean rounded up is 1/2 too large where
         * a + b is odd, and that of a and it where a + it is odd. */
        const simd_u8 both = simd_mean_u8(a, b), over = (a ^ b) & (a ^ both) & 1;
        const simd_u8 mean = two ? simd_mean_u8(a, both) - over : both;
        const simd_same8 alone = simd_same_u8(b, simd_set_u8(SST_COST_ABSENT));
        const simd_same8 none = simd_same_u8(a, simd_set_u8(SST_COST_ABSENT));

        simd_store_u8(first + x, simd_pick_u8(none, simd_set_u8(SST_COST_UNSEEN), simd_pick_u8(alone, a, mean)));
    }
    for (; x < n; x++) {
        const unsigned a = first[x], b = second[x];
        const unsigned mean = two ? (3 * a + b + 2) >> 2 : (a + b + 1) >> 1;

        first[x] = (uint8_t)(a == SST_COST_ABSENT ? SST_COST_UNSEEN : b == SST_COST_ABSENT ? a : mean);
    }
}
