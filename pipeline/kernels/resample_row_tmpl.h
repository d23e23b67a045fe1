/*
 * resample_row. Positions are arbitrary, so the work is vectorised inside each pixel: with AVX2 the four bytes of all
 * taps of a row are one load, two rows are one multiply-add, and two columns another. Four pixels are stored at once.
 * The bilinear filter takes 16-bit products of two positions at a time, and stores eight.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__AVX2__)

/* Two weights, again and again. */
static inline __m256i KERNEL(resample_weights)(const int16_t *w)
{
    int32_t pair;

    memcpy(&pair, w, sizeof(pair));
    return _mm256_set1_epi32(pair);
}

/* Four weights, two again and again in each half. */
static inline __m256i KERNEL(resample_weights_4)(const int16_t *w)
{
    int64_t four;

    memcpy(&four, w, sizeof(four));
    return _mm256_permutevar8x32_epi32(_mm256_set1_epi64x(four), _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1));
}

/* R G B X of four columns. */
static inline __m256i KERNEL(resample_load4)(const uint8_t *p)
{
    return _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)p));
}

/* R G B X of two columns, in half of a register. */
static inline __m128i KERNEL(resample_load2)(const uint8_t *p)
{
    return _mm_loadl_epi64((const __m128i *)(const void *)p);
}

/* Sums of columns 0 2 and 1 3 to 16 bits: 0 1 | 2 3. */
static inline __m256i KERNEL(resample_columns)(__m256i a, __m256i b)
{
    return _mm256_packs_epi32(_mm256_srai_epi32(a, 8), _mm256_srai_epi32(b, 8));
}

/* Columns of one position, 1/64 level: 0 to 3, and 4 and 5 of six. taps is a constant, 4 or 6, where this is inlined.
 */
static inline void KERNEL(resample_down)(__m256i columns[2], const uint8_t *p, size_t stride, const int16_t *wy,
                                         int taps)
{
    __m256i even = _mm256_set1_epi32(128), odd = even, last = even; /* halves are rounded up */

    for (int ty = 0; ty < taps; ty += 2) {
        const uint8_t *top = p + (size_t)ty * stride, *bottom = top + stride;
        const __m256i a = KERNEL(resample_load4)(top), b = KERNEL(resample_load4)(bottom);
        const __m256i w = KERNEL(resample_weights)(wy + ty);

        even = _mm256_add_epi32(even, _mm256_madd_epi16(_mm256_unpacklo_epi16(a, b), w));
        odd = _mm256_add_epi32(odd, _mm256_madd_epi16(_mm256_unpackhi_epi16(a, b), w));
        if (taps == 6) {
            const __m128i pairs =
                _mm_unpacklo_epi8(KERNEL(resample_load2)(top + 16), KERNEL(resample_load2)(bottom + 16));

            last = _mm256_add_epi32(last, _mm256_madd_epi16(_mm256_cvtepu8_epi16(pairs), w));
        }
    }
    columns[0] = KERNEL(resample_columns)(even, odd);
    if (taps == 6) /* 4 4 | 5 5 */
        columns[1] = KERNEL(resample_columns)(last, last);
}

/* Partial sums of one position: columns 0 1 | 2 3 (| of six: 4 in the one half, 5 in the other, too). */
static inline __m256i KERNEL(resample_across)(const __m256i columns[2], const int16_t *wx, int taps)
{
    const __m256i pairs = _mm256_setr_epi8(0, 1, 8, 9, 2, 3, 10, 11, 4, 5, 12, 13, 6, 7, 14, 15, 0, 1, 8, 9, 2, 3, 10,
                                           11, 4, 5, 12, 13, 6, 7, 14, 15);
    __m256i sum = _mm256_madd_epi16(_mm256_shuffle_epi8(columns[0], pairs), KERNEL(resample_weights_4)(wx));

    if (taps == 6) {
        const __m256i w = KERNEL(resample_weights)(wx + 4),
                      each = _mm256_setr_epi32(0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, (int)0xFFFF0000, (int)0xFFFF0000,
                                               (int)0xFFFF0000, (int)0xFFFF0000);

        sum =
            _mm256_add_epi32(sum, _mm256_madd_epi16(_mm256_shuffle_epi8(columns[1], pairs), _mm256_and_si256(w, each)));
    }
    return sum;
}

/* Places of four positions in the order 0 1 2 3; one in the picture for none. Bytes. */
struct KERNEL(resample_places) {
    uint32_t at[4], wx[4], wy[4];
};

static inline void KERNEL(resample_find)(struct KERNEL(resample_places) * to, const struct sst_resample *from,
                                         const int32_t *xy_q8, int taps)
{
    const __m128 a = _mm_loadu_ps((const float *)(const void *)xy_q8);
    const __m128 b = _mm_loadu_ps((const float *)(const void *)(xy_q8 + 4));
    const __m128i x = _mm_castps_si128(_mm_shuffle_ps(a, b, 0x88)), y = _mm_castps_si128(_mm_shuffle_ps(a, b, 0xDD));
    const __m128i phase = _mm_set1_epi32(255), none = _mm_srai_epi32(x, 31), size = _mm_set1_epi32(2 * taps);
    const __m128i row = _mm_mullo_epi32(_mm_srai_epi32(y, 8), _mm_set1_epi32((int32_t)from->stride));
    const __m128i at = _mm_add_epi32(row, _mm_slli_epi32(_mm_srai_epi32(x, 8), 2));

    _mm_storeu_si128((__m128i *)(void *)to->at, _mm_andnot_si128(none, at));
    _mm_storeu_si128((__m128i *)(void *)to->wx, _mm_mullo_epi32(_mm_and_si128(x, phase), size));
    _mm_storeu_si128((__m128i *)(void *)to->wy, _mm_mullo_epi32(_mm_and_si128(y, phase), size));
}

static inline const int16_t *KERNEL(resample_weight_at)(const struct sst_resample *from, uint32_t bytes)
{
    return (const int16_t *)(const void *)((const uint8_t *)from->weight + bytes);
}

/* Positions i and i + 1: R G B X in 32 bits, 2^20 a level, one in each half. */
static inline __m256i KERNEL(resample_two)(const struct KERNEL(resample_places) * places, int i,
                                           const struct sst_resample *from, const uint8_t *origin, int taps)
{
    __m256i sum[2];

    for (int k = 0; k < 2; k++) {
        __m256i columns[2];

        KERNEL(resample_down)
        (columns, origin + places->at[i + k], from->stride, KERNEL(resample_weight_at)(from, places->wy[i + k]), taps);
        sum[k] = KERNEL(resample_across)(columns, KERNEL(resample_weight_at)(from, places->wx[i + k]), taps);
    }
    return _mm256_add_epi32(_mm256_permute2x128_si256(sum[0], sum[1], 0x20),
                            _mm256_permute2x128_si256(sum[0], sum[1], 0x31));
}

/* Four sums to 16 bits, 1/128 level: 0 and 2 in one half, 1 and 3 in the other. */
static inline __m256i KERNEL(resample_round)(__m256i a, __m256i b)
{
    const __m256i half = _mm256_set1_epi32(4096);

    return _mm256_min_epu16(_mm256_packus_epi32(_mm256_srai_epi32(_mm256_add_epi32(a, half), 13),
                                                _mm256_srai_epi32(_mm256_add_epi32(b, half), 13)),
                            _mm256_set1_epi16(SST_LIGHT_WHITE));
}

/* Four positions, 4 or 6 taps; 0 where there is none. */
static inline void KERNEL(resample_four)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                         int taps)
{
    const uint8_t *origin = from->pixel + (1 - taps / 2) * (ptrdiff_t)(from->stride + 4);
    struct KERNEL(resample_places) places;
    __m128i even, odd, low, high, rg, bx;
    __m256i both;

    KERNEL(resample_find)(&places, from, xy_q8, taps);
    both = KERNEL(resample_round)(KERNEL(resample_two)(&places, 0, from, origin, taps),
                                  KERNEL(resample_two)(&places, 2, from, origin, taps));
    even = _mm256_castsi256_si128(both);
    odd = _mm256_extracti128_si256(both, 1);
    low = _mm_unpacklo_epi16(even, odd);
    high = _mm_unpackhi_epi16(even, odd);
    rg = _mm_unpacklo_epi32(low, high);
    bx = _mm_unpackhi_epi32(low, high);
    _mm_storel_epi64((__m128i *)(void *)out[0], rg);
    _mm_storel_epi64((__m128i *)(void *)out[1], _mm_unpackhi_epi64(rg, rg));
    _mm_storel_epi64((__m128i *)(void *)out[2], bx);
    for (int i = 0; i < 4; i++) {
        if (xy_q8[2 * i] == INT32_MIN)
            out[0][i] = out[1][i] = out[2][i] = 0;
    }
}

static inline void KERNEL(resample_run)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                        size_t n, int taps)
{
    int32_t last_q8[8];
    uint16_t last[3][4];
    size_t i = 0;

    for (; i + 4 <= n; i += 4)
        KERNEL(resample_four)((uint16_t *const[3]){ out[0] + i, out[1] + i, out[2] + i }, from, xy_q8 + 2 * i, taps);
    if (i == n)
        return;
    for (size_t k = 0; k < 8; k++)
        last_q8[k] = k < 2 * (n - i) ? xy_q8[2 * i + k] : INT32_MIN;
    KERNEL(resample_four)((uint16_t *const[3]){ last[0], last[1], last[2] }, from, last_q8, taps);
    for (int c = 0; c < 3; c++)
        memcpy(out[c] + i, last[c], (n - i) * sizeof(last[c][0]));
}

/* Eight positions of the bilinear filter. In the order 0 1 4 5 | 2 3 6 7: offsets of their pixels, and weights of the
 * right and of the lower pixel, twice each. */
struct KERNEL(bilinear_places) {
    uint32_t offset[8];
    __m256i right, lower;
};

static inline void KERNEL(bilinear_find)(struct KERNEL(bilinear_places) * to, const struct sst_resample *from,
                                         const int32_t *xy_q8)
{
    const __m256 a = _mm256_loadu_ps((const float *)(const void *)xy_q8);
    const __m256 b = _mm256_loadu_ps((const float *)(const void *)(xy_q8 + 8));
    const __m256i x = _mm256_castps_si256(_mm256_shuffle_ps(a, b, 0x88));
    const __m256i y = _mm256_castps_si256(_mm256_shuffle_ps(a, b, 0xDD));
    const __m256i part = _mm256_set1_epi32(255), none = _mm256_srai_epi32(x, 31);
    const __m256i across = _mm256_slli_epi32(_mm256_and_si256(x, part), 7);
    const __m256i down = _mm256_slli_epi32(_mm256_and_si256(y, part), 6);
    const __m256i row = _mm256_mullo_epi32(_mm256_srai_epi32(y, 8), _mm256_set1_epi32((int32_t)from->stride));
    const __m256i offset = _mm256_add_epi32(row, _mm256_slli_epi32(_mm256_srai_epi32(x, 8), 2));

    to->right = _mm256_or_si256(across, _mm256_slli_epi32(across, 16));
    to->lower = _mm256_or_si256(down, _mm256_slli_epi32(down, 16));
    _mm256_storeu_si256((__m256i *)(void *)to->offset, _mm256_andnot_si256(none, offset));
}

/* Both pixels of a row at two places, R G B X, to 16 bits. */
static inline __m256i KERNEL(bilinear_load)(const uint8_t *a, const uint8_t *b)
{
    return _mm256_cvtepu8_epi16(_mm_unpacklo_epi64(KERNEL(resample_load2)(a), KERNEL(resample_load2)(b)));
}

/* Both columns at two places, 1/64 level: the difference times the lower weight is rounded as the sum of the
 * definition is, for the weights add up to 2^14. */
static inline __m256i KERNEL(bilinear_columns)(const uint8_t *a, const uint8_t *b, size_t stride, __m256i lower)
{
    const __m256i top = KERNEL(bilinear_load)(a, b), bottom = KERNEL(bilinear_load)(a + stride, b + stride);
    const __m256i difference = _mm256_slli_epi16(_mm256_sub_epi16(bottom, top), 7);

    return _mm256_add_epi16(_mm256_slli_epi16(top, 6), _mm256_mulhrs_epi16(difference, lower));
}

/* Four places from the columns of two and two, 1/128 level; each half has R R G G B B X X of its two. */
static inline __m256i KERNEL(bilinear_across)(__m256i a, __m256i b, __m256i weight)
{
    const __m256i planes = _mm256_setr_epi8(0, 1, 8, 9, 2, 3, 10, 11, 4, 5, 12, 13, 6, 7, 14, 15, 0, 1, 8, 9, 2, 3, 10,
                                            11, 4, 5, 12, 13, 6, 7, 14, 15);
    const __m256i left = _mm256_unpacklo_epi64(a, b), right = _mm256_unpackhi_epi64(a, b);
    const __m256i difference = _mm256_slli_epi16(_mm256_sub_epi16(right, left), 1);

    return _mm256_shuffle_epi8(_mm256_add_epi16(_mm256_slli_epi16(left, 1), _mm256_mulhrs_epi16(difference, weight)),
                               planes);
}

/* Eight positions; 0 where there is none. */
static inline void KERNEL(bilinear_eight)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8)
{
    const uint8_t *pixel = from->pixel;
    struct KERNEL(bilinear_places) p;
    __m256i columns[4], first, last, rg, bx;

    KERNEL(bilinear_find)(&p, from, xy_q8);
    columns[0] = KERNEL(bilinear_columns)(pixel + p.offset[0], pixel + p.offset[4], from->stride,
                                          _mm256_shuffle_epi32(p.lower, 0x00));
    columns[1] = KERNEL(bilinear_columns)(pixel + p.offset[1], pixel + p.offset[5], from->stride,
                                          _mm256_shuffle_epi32(p.lower, 0x55));
    columns[2] = KERNEL(bilinear_columns)(pixel + p.offset[2], pixel + p.offset[6], from->stride,
                                          _mm256_shuffle_epi32(p.lower, 0xAA));
    columns[3] = KERNEL(bilinear_columns)(pixel + p.offset[3], pixel + p.offset[7], from->stride,
                                          _mm256_shuffle_epi32(p.lower, 0xFF));
    first = KERNEL(bilinear_across)(columns[0], columns[1], _mm256_unpacklo_epi32(p.right, p.right));
    last = KERNEL(bilinear_across)(columns[2], columns[3], _mm256_unpackhi_epi32(p.right, p.right));
    rg = _mm256_unpacklo_epi32(first, last);
    bx = _mm256_unpackhi_epi32(first, last);
    _mm_storeu_si128((__m128i *)(void *)out[0],
                     _mm_unpacklo_epi32(_mm256_castsi256_si128(rg), _mm256_extracti128_si256(rg, 1)));
    _mm_storeu_si128((__m128i *)(void *)out[1],
                     _mm_unpackhi_epi32(_mm256_castsi256_si128(rg), _mm256_extracti128_si256(rg, 1)));
    _mm_storeu_si128((__m128i *)(void *)out[2],
                     _mm_unpacklo_epi32(_mm256_castsi256_si128(bx), _mm256_extracti128_si256(bx, 1)));
    for (int i = 0; i < 8; i++) {
        if (xy_q8[2 * i] == INT32_MIN)
            out[0][i] = out[1][i] = out[2][i] = 0;
    }
}

static inline void KERNEL(bilinear_run)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                        size_t n)
{
    int32_t last_q8[16];
    uint16_t last[3][8];
    size_t i = 0;

    for (; i + 8 <= n; i += 8)
        KERNEL(bilinear_eight)((uint16_t *const[3]){ out[0] + i, out[1] + i, out[2] + i }, from, xy_q8 + 2 * i);
    if (i == n)
        return;
    for (size_t k = 0; k < 16; k++)
        last_q8[k] = k < 2 * (n - i) ? xy_q8[2 * i + k] : INT32_MIN;
    KERNEL(bilinear_eight)((uint16_t *const[3]){ last[0], last[1], last[2] }, from, last_q8);
    for (int c = 0; c < 3; c++)
        memcpy(out[c] + i, last[c], (n - i) * sizeof(last[c][0]));
}

#elif defined(__aarch64__)
#include "pipeline/kernels/arm/resample_row_tmpl.h"
#else

/* Sums of one byte position over the rows, four colours of one column side by side. */
static inline void KERNEL(resample_run)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                        size_t n, int taps)
{
    for (size_t i = 0; i < n; i++) {
        const int32_t x = xy_q8[2 * i], y = xy_q8[2 * i + 1];
        const int16_t *wx = from->weight + (x & 255) * taps, *wy = from->weight + (y & 255) * taps;
        const uint8_t *corner;
        int32_t column[24] = { 0 }, sum[4] = { 4096, 4096, 4096, 4096 };

        if (x == INT32_MIN) {
            out[0][i] = out[1][i] = out[2][i] = 0;
            continue;
        }
        corner = from->pixel + ((y >> 8) + 1 - taps / 2) * (ptrdiff_t)from->stride + 4 * ((x >> 8) + 1 - taps / 2);
        for (int ty = 0; ty < taps; ty++) {
            const int32_t w = wy[ty];

            for (int t = 0; t < 4 * taps; t++)
                column[t] += w * corner[ty * (ptrdiff_t)from->stride + t];
        }
        for (int t = 0; t < 4 * taps; t++)
            sum[t & 3] += wx[t / 4] * ((column[t] + 128) >> 8);
        for (int c = 0; c < 3; c++) {
            const int32_t v = sum[c] >> 13;

            out[c][i] = (uint16_t)(v < 0 ? 0 : v > SST_LIGHT_WHITE ? SST_LIGHT_WHITE : v);
        }
    }
}

#endif

static void KERNEL(resample_row)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                 size_t n)
{
    if (from->taps == 2)
#if defined(__AVX2__)
        KERNEL(bilinear_run)(out, from, xy_q8, n);
#else
        KERNEL(resample_run)(out, from, xy_q8, n, 2);
#endif
    else if (from->taps == 4)
        KERNEL(resample_run)(out, from, xy_q8, n, 4);
    else
        KERNEL(resample_run)(out, from, xy_q8, n, 6);
}
