/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__aarch64__)
#include "pipeline/kernels/arm/census_tmpl.h"
#else
#if defined(__AVX2__) && !defined(__AVX512BW__)
/* Census of 32 pixels: bytes of the result from the highest down, the first of which has six bits, then one word of
 * eight bytes a pixel. */
static inline void KERNEL(census_32)(uint64_t *out, const uint8_t *const rows[7], size_t x)
{
    const __m256i centre = _mm256_loadu_si256((const __m256i *)(const void *)(rows[3] + x));
    __m256i plane[8];

#pragma GCC unroll 8
    for (int i = 0; i < 8; i++) {
        __m256i bits = _mm256_setzero_si256(); /* 1: not darker than the centre */

#pragma GCC unroll 8
        for (int bit = i ? 0 : 2; bit < 8; bit++) {
            const int j = 8 * i + bit - 2, k = j + (j >= 31);
            const __m256i p = _mm256_loadu_si256((const __m256i *)(const void *)(rows[k / 9] + x + k % 9 - 4));

            bits = _mm256_sub_epi8(_mm256_add_epi8(bits, bits), _mm256_cmpeq_epi8(_mm256_max_epu8(p, centre), p));
        }
        plane[i] = _mm256_xor_si256(bits, _mm256_set1_epi8(i ? -1 : 0x3F));
    }
#pragma GCC unroll 4
    for (int part = 0; part < 4; part++) { /* pixels 4 * part .. 4 * part + 3 of each half */
        __m256i pair[4], four[2], low, high;

        for (int i = 0; i < 4; i++)
            pair[i] = part / 2 ? _mm256_unpackhi_epi8(plane[7 - 2 * i], plane[6 - 2 * i])
                               : _mm256_unpacklo_epi8(plane[7 - 2 * i], plane[6 - 2 * i]);
        for (int i = 0; i < 2; i++)
            four[i] = part % 2 ? _mm256_unpackhi_epi16(pair[2 * i], pair[2 * i + 1])
                               : _mm256_unpacklo_epi16(pair[2 * i], pair[2 * i + 1]);
        low = _mm256_unpacklo_epi32(four[0], four[1]);
        high = _mm256_unpackhi_epi32(four[0], four[1]);
        _mm256_storeu_si256((__m256i *)(void *)(out + x + 4 * part), _mm256_permute2x128_si256(low, high, 0x20));
        _mm256_storeu_si256((__m256i *)(void *)(out + x + 16 + 4 * part), _mm256_permute2x128_si256(low, high, 0x31));
    }
}

static void KERNEL(census_row)(uint64_t *restrict out, const uint8_t *const rows[7], size_t n)
{
    if (n < 32) {
        sst_census_row_ref(out, rows, n);
        return;
    }
    for (size_t x = 0; x < n; x = x + 32 < n && n - x - 32 < 32 ? n - 32 : x + 32) /* the last ones overlap */
        KERNEL(census_32)(out, rows, x);
}
#else
/* Census: eight planes of bytes, so that comparisons and shifts fill wide lanes; the topmost holds the first six bits.
 */
static void KERNEL(census_row)(uint64_t *restrict out, const uint8_t *const rows[7], size_t n)
{
    enum { BLOCK = 64 };
    uint8_t plane[8][BLOCK];
    const uint8_t *rest[7];
    size_t start = 0;

    for (; start < n && n >= BLOCK; start += BLOCK) {
        start = n - start < BLOCK ? n - BLOCK : start; /* the last block overlaps the one before */
        const uint8_t *centre = rows[3] + start;

        memset(plane, 0, sizeof(plane));
        for (int k = 0; k < 63; k++) {
            const uint8_t *p = rows[k / 9] + start + k % 9 - 4;
            uint8_t *bits = plane[(k + 2 - (k > 31)) / 8];

            for (int x = 0; k != 31 && x < BLOCK; x++)
                bits[x] = (uint8_t)(bits[x] << 1 | (p[x] < centre[x]));
        }
        for (int x = 0; x < BLOCK; x++) {
            uint64_t bits = 0;

            for (int i = 0; i < 8; i++)
                bits = bits << 8 | plane[i][x];
            out[start + (size_t)x] = bits;
        }
    }
    for (int j = 0; j < 7; j++)
        rest[j] = rows[j] + start;
    sst_census_row_ref(out + start, rest, n - start);
}
#endif

static void KERNEL(hamming_row)(uint8_t *restrict cost, const uint64_t *restrict a, const uint64_t *restrict b,
                                size_t n)
{
    for (size_t x = 0; x < n; x++)
        cost[x] = (uint8_t)(4 * __builtin_popcountll(a[x] ^ b[x]));
}

#if defined(__AVX512VBMI__) && defined(__AVX512VPOPCNTDQ__)
/* 32 places of a pixel: eight at a time from the last one on, one byte of each lane; the permutation puts them in
 * order. */
static void KERNEL(hamming_steps_row)(uint8_t *restrict cost, const uint64_t *restrict a, const uint64_t *restrict b,
                                      size_t n, size_t nd)
{
    uint8_t order[64] = { 0 };

    for (int d = 0; d < 32; d++)
        order[d] = (uint8_t)(8 * (7 - d % 8) + d / 8);
    const __m512i from = _mm512_loadu_si512(order);

    for (size_t x = 0; x < n; x++) {
        const __m512i own = _mm512_set1_epi64((int64_t)a[x]);

        for (size_t d = 0; d < nd; d += 32) {
            const uint64_t *last = b + x - d - 7;
            __m512i bytes = _mm512_popcnt_epi64(_mm512_xor_si512(own, _mm512_loadu_si512(last - 24)));

            for (int k = 2; k >= 0; k--)
                bytes = _mm512_or_si512(_mm512_slli_epi64(bytes, 8),
                                        _mm512_popcnt_epi64(_mm512_xor_si512(own, _mm512_loadu_si512(last - 8 * k))));
            bytes = _mm512_permutexvar_epi8(from, _mm512_slli_epi64(bytes, 2));
            _mm256_storeu_si256((__m256i *)(cost + x * nd + d), _mm512_castsi512_si256(bytes));
        }
    }
}
#elif defined(__AVX2__)
/* 32 places of a pixel: four at a time from the last one on, counted by halves of bytes, one byte of each lane. */
static void KERNEL(hamming_steps_row)(uint8_t *restrict cost, const uint64_t *restrict a, const uint64_t *restrict b,
                                      size_t n, size_t nd)
{
    const __m256i bits = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2, 1, 2, 2, 3, 1, 2,
                                          2, 3, 2, 3, 3, 4);
    const __m256i half = _mm256_set1_epi8(15), zero = _mm256_setzero_si256();
    const __m256i pairs = _mm256_setr_epi8(8, 0, 9, 1, 10, 2, 11, 3, 12, 4, 13, 5, 14, 6, 15, 7, 8, 0, 9, 1, 10, 2, 11,
                                           3, 12, 4, 13, 5, 14, 6, 15, 7);

    for (size_t x = 0; x < n; x++) {
        const __m256i own = _mm256_set1_epi64x((int64_t)a[x]);

        for (size_t d = 0; d < nd; d += 32) {
            __m256i bytes = zero;
            __m128i late, early;

            for (int k = 7; k >= 0; k--) {
                const __m256i there = _mm256_loadu_si256((const __m256i *)(const void *)(b + x - d - 3 - 4 * k));
                const __m256i differ = _mm256_xor_si256(own, there);
                const __m256i low = _mm256_shuffle_epi8(bits, _mm256_and_si256(differ, half));
                const __m256i high = _mm256_shuffle_epi8(bits, _mm256_and_si256(_mm256_srli_epi16(differ, 4), half));

                bytes = _mm256_or_si256(_mm256_slli_epi64(bytes, 8), _mm256_sad_epu8(_mm256_add_epi8(low, high), zero));
            }
            bytes = _mm256_shuffle_epi8(_mm256_slli_epi64(bytes, 2), pairs);
            late = _mm256_castsi256_si128(bytes);
            early = _mm256_extracti128_si256(bytes, 1);
            _mm_storeu_si128((__m128i *)(void *)(cost + x * nd + d), _mm_unpacklo_epi16(early, late));
            _mm_storeu_si128((__m128i *)(void *)(cost + x * nd + d + 16), _mm_unpackhi_epi16(early, late));
        }
    }
}
#else
static void KERNEL(hamming_steps_row)(uint8_t *restrict cost, const uint64_t *restrict a, const uint64_t *restrict b,
                                      size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t d = 0; d < nd; d++)
            cost[x * nd + d] = (uint8_t)(4 * __builtin_popcountll(a[x] ^ *(b + x - d)));
    }
}
#endif
#endif
