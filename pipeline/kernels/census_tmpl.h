#if defined(__aarch64__)
#include "pipeline/kernels/arm/census_tmpl.h"
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
