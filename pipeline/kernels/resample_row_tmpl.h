/*
 * resample_row. Positions are arbitrary, so the work is vectorised inside each pixel: with AVX2 the four bytes of all
 * taps of a row are one load, two rows are one multiply-add, and two columns another. Four pixels are stored at once.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__AVX2__)

static inline __m128i KERNEL(resample_weights)(const int16_t *w)
{
    int32_t pair;

    memcpy(&pair, w, sizeof(pair));
    return _mm_set1_epi32(pair);
}

/* Eight byte pairs of two rows, R G B X of two columns: weighted sums in 32 bits. */
static inline __m256i KERNEL(resample_rows)(__m128i pairs, __m128i weights)
{
    return _mm256_madd_epi16(_mm256_cvtepu8_epi16(pairs), _mm256_broadcastsi128_si256(weights));
}

/* Columns 0, 1 and 2, 3 to 16 bits; lower halves hold columns 0 and 2, upper ones 1 and 3. */
static inline __m256i KERNEL(resample_columns)(__m256i a, __m256i b)
{
    const __m256i half = _mm256_set1_epi32(128);

    return _mm256_packs_epi32(_mm256_srai_epi32(_mm256_add_epi32(a, half), 8),
                              _mm256_srai_epi32(_mm256_add_epi32(b, half), 8));
}

/* Weighted sum of columns 0 and 1, with `upper` of 2 and 3. */
static inline __m128i KERNEL(resample_across)(__m256i columns, int upper, __m128i weights)
{
    const __m128i a = _mm256_castsi256_si128(columns), b = _mm256_extracti128_si256(columns, 1);

    return _mm_madd_epi16(upper ? _mm_unpackhi_epi16(a, b) : _mm_unpacklo_epi16(a, b), weights);
}

static inline __m128i KERNEL(resample_load4)(const uint8_t *p)
{
    return _mm_loadu_si128((const __m128i *)(const void *)p);
}

static inline __m128i KERNEL(resample_load2)(const uint8_t *p)
{
    return _mm_loadl_epi64((const __m128i *)(const void *)p);
}

/* R G B X in 32 bits, 2^20 a level. taps is a constant where this is inlined. */
static inline __m128i KERNEL(resample_pixel)(const uint8_t *p, size_t stride, const int16_t *wx, const int16_t *wy,
                                             int taps)
{
    __m256i first = _mm256_setzero_si256(), second = first, third = first, columns;
    __m128i sum;

    for (int ty = 0; ty < taps; ty += 2) {
        const uint8_t *top = p + (size_t)ty * stride, *bottom = top + stride;
        const __m128i w = KERNEL(resample_weights)(wy + ty);

        if (taps == 2) {
            const __m128i pairs = _mm_unpacklo_epi8(KERNEL(resample_load2)(top), KERNEL(resample_load2)(bottom));

            first = _mm256_add_epi32(first, KERNEL(resample_rows)(pairs, w));
        } else {
            const __m128i a = KERNEL(resample_load4)(top), b = KERNEL(resample_load4)(bottom);

            first = _mm256_add_epi32(first, KERNEL(resample_rows)(_mm_unpacklo_epi8(a, b), w));
            second = _mm256_add_epi32(second, KERNEL(resample_rows)(_mm_unpackhi_epi8(a, b), w));
        }
        if (taps == 6) {
            const __m128i pairs =
                _mm_unpacklo_epi8(KERNEL(resample_load2)(top + 16), KERNEL(resample_load2)(bottom + 16));

            third = _mm256_add_epi32(third, KERNEL(resample_rows)(pairs, w));
        }
    }
    columns = KERNEL(resample_columns)(first, second);
    sum = KERNEL(resample_across)(columns, 0, KERNEL(resample_weights)(wx));
    if (taps > 2)
        sum = _mm_add_epi32(sum, KERNEL(resample_across)(columns, 1, KERNEL(resample_weights)(wx + 2)));
    if (taps > 4)
        sum = _mm_add_epi32(
            sum, KERNEL(resample_across)(KERNEL(resample_columns)(third, third), 0, KERNEL(resample_weights)(wx + 4)));
    return sum;
}

/* Two bilinear pixels, as resample_pixel(). */
static inline void KERNEL(resample_two)(__m128i sum[2], const uint8_t *const p[2], size_t stride,
                                        const int16_t *const wx[2], const int16_t *const wy[2])
{
    __m256i columns[2];
    __m128i left, right;

    for (int i = 0; i < 2; i++)
        columns[i] = KERNEL(resample_rows)(
            _mm_unpacklo_epi8(KERNEL(resample_load2)(p[i]), KERNEL(resample_load2)(p[i] + stride)),
            KERNEL(resample_weights)(wy[i]));
    columns[0] = KERNEL(resample_columns)(columns[0], columns[1]);
    left = _mm256_castsi256_si128(columns[0]);
    right = _mm256_extracti128_si256(columns[0], 1);
    sum[0] = _mm_madd_epi16(_mm_unpacklo_epi16(left, right), KERNEL(resample_weights)(wx[0]));
    sum[1] = _mm_madd_epi16(_mm_unpackhi_epi16(left, right), KERNEL(resample_weights)(wx[1]));
}

/* Two sums to 16 bits, 1/128 level. */
static inline __m128i KERNEL(resample_round)(__m128i a, __m128i b)
{
    const __m128i half = _mm_set1_epi32(4096);

    return _mm_min_epu16(_mm_packus_epi32(_mm_srai_epi32(_mm_add_epi32(a, half), 13),
                                          _mm_srai_epi32(_mm_add_epi32(b, half), 13)),
                         _mm_set1_epi16(SST_LIGHT_WHITE));
}

/* Where the taps of a position begin, and its weights; one in the picture, for none. */
struct KERNEL(resample_place) {
    const uint8_t *at[4];
    const int16_t *wx[4], *wy[4];
};

static inline void KERNEL(resample_find)(struct KERNEL(resample_place) * to, const struct sst_resample *from,
                                         const uint8_t *origin, const int32_t *xy_q8, int taps)
{
    for (int i = 0; i < 4; i++) {
        const int32_t x = xy_q8[2 * i], y = xy_q8[2 * i + 1];
        const bool none = x == INT32_MIN;

        to->at[i] = none ? origin : origin + (y >> 8) * (ptrdiff_t)from->stride + 4 * (ptrdiff_t)(x >> 8);
        to->wx[i] = from->weight + (x & 255) * taps;
        to->wy[i] = from->weight + (y & 255) * taps;
    }
}

/* Four positions; sums of those that are none are 0. */
static inline void KERNEL(resample_four)(uint16_t *red, uint16_t *green, uint16_t *blue,
                                         const struct sst_resample *from, const uint8_t *origin, const int32_t *xy_q8,
                                         int taps)
{
    const __m256i xy = _mm256_loadu_si256((const __m256i *)(const void *)xy_q8);
    const int none = _mm256_movemask_ps(_mm256_castsi256_ps(xy));
    struct KERNEL(resample_place) place;
    __m128i sum[4], ab, cd, odd, even, rg, bx;

    KERNEL(resample_find)(&place, from, origin, xy_q8, taps);
    if (taps == 2) {
        KERNEL(resample_two)(sum, place.at, from->stride, place.wx, place.wy);
        KERNEL(resample_two)(sum + 2, place.at + 2, from->stride, place.wx + 2, place.wy + 2);
    } else {
        for (int i = 0; i < 4; i++)
            sum[i] = KERNEL(resample_pixel)(place.at[i], from->stride, place.wx[i], place.wy[i], taps);
    }
    if (none) {
        for (int i = 0; i < 4; i++)
            sum[i] = none >> 2 * i & 1 ? _mm_setzero_si128() : sum[i];
    }
    ab = KERNEL(resample_round)(sum[0], sum[1]);
    cd = KERNEL(resample_round)(sum[2], sum[3]);
    even = _mm_unpacklo_epi16(ab, cd);
    odd = _mm_unpackhi_epi16(ab, cd);
    rg = _mm_unpacklo_epi16(even, odd);
    bx = _mm_unpackhi_epi16(even, odd);
    _mm_storel_epi64((__m128i *)(void *)red, rg);
    _mm_storel_epi64((__m128i *)(void *)green, _mm_unpackhi_epi64(rg, rg));
    _mm_storel_epi64((__m128i *)(void *)blue, bx);
}

static inline void KERNEL(resample_run)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                        size_t n, int taps)
{
    const uint8_t *origin = from->pixel + (1 - taps / 2) * (ptrdiff_t)(from->stride + 4);
    int32_t last_q8[8];
    uint16_t last[3][4];
    size_t i = 0;

    for (; i + 4 <= n; i += 4)
        KERNEL(resample_four)(out[0] + i, out[1] + i, out[2] + i, from, origin, xy_q8 + 2 * i, taps);
    if (i == n)
        return;
    for (size_t k = 0; k < 8; k++)
        last_q8[k] = k < 2 * (n - i) ? xy_q8[2 * i + k] : INT32_MIN;
    KERNEL(resample_four)(last[0], last[1], last[2], from, origin, last_q8, taps);
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
        KERNEL(resample_run)(out, from, xy_q8, n, 2);
    else if (from->taps == 4)
        KERNEL(resample_run)(out, from, xy_q8, n, 4);
    else
        KERNEL(resample_run)(out, from, xy_q8, n, 6);
}
