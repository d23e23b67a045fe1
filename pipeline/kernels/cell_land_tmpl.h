/* cell_land. With AVX-512 and AVX2 neighbouring cells that all move alike are stored at once. The others are stored one
 * by one: masked stores of a part of them stall the loads that follow. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#if defined(__AVX2__) && !defined(__AVX512DQ__)
#define CELL_BLOCK 8
#else
#define CELL_BLOCK 16
#endif

#if defined(__AVX512DQ__)
/* (q b + 2^22) >> 23 of 16 numbers, by products of 64 bits. */
static inline __m512i KERNEL(cell_shift)(__m512i q, __m512i b)
{
    const __m512i half = _mm512_set1_epi64(1 << 22);
    const __m512i even = _mm512_add_epi64(_mm512_mul_epi32(q, b), half);
    const __m512i odd = _mm512_add_epi64(_mm512_mul_epi32(_mm512_srli_epi64(q, 32), b), half);

    return _mm512_mask_blend_epi32(0xAAAA, _mm512_srli_epi64(even, 23), _mm512_slli_epi64(odd, 9));
}

static void KERNEL(cell_land)(uint32_t *landed, const struct sst_cell_way *w, const uint32_t *cells, int x, int y,
                              int n)
{
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512i bx = _mm512_set1_epi32(w->bx_q16), by = _mm512_set1_epi32(w->by_q16);

    for (int i = 0; i < n; i += CELL_BLOCK) {
        const __mmask16 inside = (__mmask16)(n - i >= CELL_BLOCK ? 0xFFFF : (1 << (n - i)) - 1);
        const __m512i cell = _mm512_maskz_loadu_epi32(inside, cells + i);
        const __m512i disp = _mm512_and_si512(_mm512_srli_epi32(cell, 8), _mm512_set1_epi32(0xFFFF));
        const __m512i q = _mm512_add_epi32(disp, _mm512_set1_epi32(w->zero_q6));
        const __m512i dx = KERNEL(cell_shift)(q, bx), dy = KERNEL(cell_shift)(q, by);
        const __m512i to_x = _mm512_sub_epi32(_mm512_add_epi32(lane, _mm512_set1_epi32(x + i)), dx);
        const __m512i to_y = _mm512_sub_epi32(_mm512_set1_epi32(y), dy);
        const __m512i ranked = _mm512_or_si512(cell, _mm512_set1_epi32((int)w->rank));
        const __m512i to = _mm512_add_epi32(_mm512_mullo_epi32(to_y, _mm512_set1_epi32(w->width)), to_x);
        __mmask16 left = _mm512_test_epi32_mask(cell, cell);
        int32_t at[CELL_BLOCK];
        uint32_t value[CELL_BLOCK];

        left = _mm512_mask_cmplt_epu32_mask(left, to_x, _mm512_set1_epi32(w->width));
        left = _mm512_mask_cmplt_epu32_mask(left, to_y, _mm512_set1_epi32(w->height));
        _mm512_storeu_si512(at, to);
        if (left == 0xFFFF && _mm512_cmpeq_epi32_mask(to, _mm512_add_epi32(lane, _mm512_set1_epi32(at[0]))) == 0xFFFF) {
            uint32_t *row = landed + at[0];

            _mm512_storeu_si512(row, _mm512_max_epu32(_mm512_loadu_si512(row), ranked));
            continue;
        }
        _mm512_storeu_si512(value, ranked);
        if (left == 0xFFFF) {
            for (int k = 0; k < CELL_BLOCK; k++)
                landed[at[k]] = landed[at[k]] > value[k] ? landed[at[k]] : value[k];
            continue;
        }
        for (; left; left &= (__mmask16)(left - 1)) {
            const int k = __builtin_ctz(left);

            landed[at[k]] = landed[at[k]] > value[k] ? landed[at[k]] : value[k];
        }
    }
}
#elif defined(__AVX2__)
/* (q b + 2^22) >> 23 of 8 numbers, by products of 64 bits. */
static inline __m256i KERNEL(cell_shift)(__m256i q, __m256i b)
{
    const __m256i half = _mm256_set1_epi64x(1 << 22);
    const __m256i even = _mm256_add_epi64(_mm256_mul_epi32(q, b), half);
    const __m256i odd = _mm256_add_epi64(_mm256_mul_epi32(_mm256_srli_epi64(q, 32), b), half);

    return _mm256_blend_epi32(_mm256_srli_epi64(even, 23), _mm256_slli_epi64(odd, 9), 0xAA);
}

/* v is within 0 .. limit - 1. */
static inline __m256i KERNEL(cell_within)(__m256i v, int limit)
{
    return _mm256_cmpeq_epi32(_mm256_min_epu32(v, _mm256_set1_epi32(limit - 1)), v);
}

static void KERNEL(cell_land)(uint32_t *landed, const struct sst_cell_way *w, const uint32_t *cells, int x, int y,
                              int n)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), rank = _mm256_set1_epi32((int)w->rank);
    const __m256i bx = _mm256_set1_epi32(w->bx_q16), by = _mm256_set1_epi32(w->by_q16);
    int i = 0;

    for (; i + CELL_BLOCK <= n; i += CELL_BLOCK) {
        const __m256i cell = _mm256_loadu_si256((const __m256i *)(const void *)(cells + i));
        const __m256i disp = _mm256_and_si256(_mm256_srli_epi32(cell, 8), _mm256_set1_epi32(0xFFFF));
        const __m256i q = _mm256_add_epi32(disp, _mm256_set1_epi32(w->zero_q6));
        const __m256i to_x = _mm256_sub_epi32(_mm256_add_epi32(lane, _mm256_set1_epi32(x + i)), KERNEL(cell_shift)(q, bx));
        const __m256i to_y = _mm256_sub_epi32(_mm256_set1_epi32(y), KERNEL(cell_shift)(q, by));
        const __m256i ranked = _mm256_or_si256(cell, rank);
        const __m256i to = _mm256_add_epi32(_mm256_mullo_epi32(to_y, _mm256_set1_epi32(w->width)), to_x);
        const __m256i inside = _mm256_andnot_si256(
            _mm256_cmpeq_epi32(cell, _mm256_setzero_si256()),
            _mm256_and_si256(KERNEL(cell_within)(to_x, w->width), KERNEL(cell_within)(to_y, w->height)));
        unsigned left = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(inside));
        int32_t at[CELL_BLOCK];
        uint32_t value[CELL_BLOCK];

        _mm256_storeu_si256((__m256i *)(void *)at, to);
        if (left == 0xFF) {
            const __m256i first = _mm256_broadcastd_epi32(_mm256_castsi256_si128(to));

            if (_mm256_testc_si256(_mm256_cmpeq_epi32(to, _mm256_add_epi32(first, lane)), _mm256_set1_epi32(-1))) {
                __m256i *row = (__m256i *)(void *)(landed + at[0]);

                _mm256_storeu_si256(row, _mm256_max_epu32(_mm256_loadu_si256(row), ranked));
                continue;
            }
        }
        _mm256_storeu_si256((__m256i *)(void *)value, ranked);
        if (left == 0xFF) {
            for (int k = 0; k < CELL_BLOCK; k++)
                landed[at[k]] = landed[at[k]] > value[k] ? landed[at[k]] : value[k];
            continue;
        }
        for (; left; left &= left - 1) {
            const int k = __builtin_ctz(left);

            landed[at[k]] = landed[at[k]] > value[k] ? landed[at[k]] : value[k];
        }
    }
    if (i < n)
        sst_cell_land_ref(landed, w, cells + i, x + i, y, n - i);
}
#else
static void KERNEL(cell_land)(uint32_t *landed, const struct sst_cell_way *w, const uint32_t *cells, int x, int y,
                              int n)
{
    int dx[CELL_BLOCK], dy[CELL_BLOCK];

    for (int i = 0; i < n; i += CELL_BLOCK) {
        const int count = n - i < CELL_BLOCK ? n - i : CELL_BLOCK;

        for (int k = 0; k < count; k++) {
            const int64_t q = (int)(cells[i + k] >> 8 & 0xFFFF) + w->zero_q6;

            dx[k] = (int)((q * w->bx_q16 + (1 << 22)) >> 23);
            dy[k] = (int)((q * w->by_q16 + (1 << 22)) >> 23);
        }
        for (int k = 0; k < count; k++) {
            const unsigned to_x = (unsigned)(x + i + k - dx[k]), to_y = (unsigned)(y - dy[k]);
            const uint32_t cell = cells[i + k], ranked = cell | w->rank;

            if (cell && to_x < (unsigned)w->width && to_y < (unsigned)w->height) {
                uint32_t *to = landed + (size_t)to_y * (size_t)w->width + to_x;

                *to = *to < ranked ? ranked : *to;
            }
        }
    }
}
#endif
#undef CELL_BLOCK
