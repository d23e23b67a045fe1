/* place_row */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

/* Nearest whole number of |v| < 2^22, ties to even, in a form that vectorises. */
static inline int32_t KERNEL(place_nearest)(float v)
{
    const float shifted = v + 12582912.0f; /* 1.5 2^23: the fraction is rounded away */
    int32_t bits;

    memcpy(&bits, &shifted, sizeof(bits));
    return bits - 0x4B400000;
}

static inline int32_t KERNEL(place_at)(int32_t whole_q8, const float *c, float k)
{
    return whole_q8 + KERNEL(place_nearest)(c[0] + k * (c[1] + k * (c[2] + k * c[3])));
}

#if defined(__AVX2__)
/* One axis of eight places. */
static inline __m256i KERNEL(place_8)(const struct sst_places *p, int axis, __m256 k)
{
    const __m256 shift = _mm256_set1_ps(12582912.0f);
    __m256 v = _mm256_set1_ps(p->c[axis][3]);

    for (int i = 2; i >= 0; i--)
        v = _mm256_add_ps(_mm256_set1_ps(p->c[axis][i]), _mm256_mul_ps(k, v));
    return _mm256_add_epi32(_mm256_castps_si256(_mm256_add_ps(v, shift)),
                            _mm256_set1_epi32(p->whole_q8[axis] - 0x4B400000));
}

/* Bits of lanes outside 0 .. most. */
static inline __m256i KERNEL(place_outside)(__m256i v, int32_t most)
{
    return _mm256_or_si256(_mm256_srai_epi32(v, 31), _mm256_cmpgt_epi32(v, _mm256_set1_epi32(most)));
}

/* @return the number of places done, a multiple of eight */
static inline int KERNEL(place_eights)(int32_t *xy_q8, const struct sst_places *p, float k0, int n)
{
    const __m256i none = _mm256_set1_epi32(INT32_MIN);
    int i = 0;

    for (; i + 8 <= n; i += 8) {
        const __m256i at = _mm256_add_epi32(_mm256_set1_epi32(i), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
        const __m256 k = _mm256_add_ps(_mm256_set1_ps(k0), _mm256_cvtepi32_ps(at));
        const __m256i x = KERNEL(place_8)(p, 0, k), y = KERNEL(place_8)(p, 1, k);
        const __m256i outside =
            _mm256_or_si256(KERNEL(place_outside)(x, p->most[0]), KERNEL(place_outside)(y, p->most[1]));
        const __m256i a = _mm256_blendv_epi8(x, none, outside), b = _mm256_blendv_epi8(y, none, outside);
        const __m256i low = _mm256_unpacklo_epi32(a, b), high = _mm256_unpackhi_epi32(a, b);

        _mm256_storeu_si256((__m256i *)(void *)(xy_q8 + 2 * i), _mm256_permute2x128_si256(low, high, 0x20));
        _mm256_storeu_si256((__m256i *)(void *)(xy_q8 + 2 * i + 8), _mm256_permute2x128_si256(low, high, 0x31));
    }
    return i;
}
#endif

static void KERNEL(place_row)(int32_t *restrict xy_q8, const struct sst_places *places, float k0, size_t n)
{
    const struct sst_places p = *places;
    int i = 0;

#if defined(__AVX2__)
    i = KERNEL(place_eights)(xy_q8, &p, k0, (int)n);
#endif
    for (; i < (int)n; i++) {
        const float k = k0 + (float)i;
        const int32_t x = KERNEL(place_at)(p.whole_q8[0], p.c[0], k), y = KERNEL(place_at)(p.whole_q8[1], p.c[1], k);
        const bool inside = (x >= 0) & (x <= p.most[0]) & (y >= 0) & (y <= p.most[1]);

        xy_q8[2 * i] = inside ? x : INT32_MIN;
        xy_q8[2 * i + 1] = inside ? y : INT32_MIN;
    }
}
