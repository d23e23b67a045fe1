/* land_row. With AVX neighbouring pixels that all move alike are stored at once. The others are stored one by one:
 * masked stores of some lanes stall the loads that follow. Their places are looked up together, since mostly few are
 * open. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#define LAND_BLOCK 16

/* One pixel. */
static inline void KERNEL(land)(uint32_t *restrict nearest, uint32_t *restrict farthest, int32_t to, uint32_t value,
                                uint32_t source)
{
    nearest[to] = nearest[to] < value ? value : nearest[to];
    if (farthest && nearest[to] != SST_LANDED_CLOSED) {
        const uint32_t d = (value >> SST_LANDED_DISP) - 1, old = farthest[to], least = old & 0xFFFF;

        farthest[to] = (old & 0xFFFF0000) | source | (d < least ? d : least);
    }
}

#if defined(__AVX512BW__)
static inline __m512i KERNEL(land_place)(const struct sst_landing *l, int axis, __m512i own, __m512i d)
{
    const __m512i moved = _mm512_srai_epi32(
        _mm512_add_epi32(_mm512_mullo_epi32(d, _mm512_set1_epi32(l->step[axis])), _mm512_set1_epi32(l->part[axis])),
        16);

    return _mm512_add_epi32(_mm512_add_epi32(own, _mm512_set1_epi32(l->whole[axis])), moved);
}

static void KERNEL(land_row)(uint32_t *restrict nearest, uint32_t *restrict farthest, const struct sst_landing *l,
                             const uint16_t *restrict disp, const uint8_t *restrict rank, size_t n)
{
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const struct sst_landing v = *l;
    const uint32_t source = v.source << 16;

    for (size_t i = 0; i < n; i += LAND_BLOCK) {
        const __mmask16 used = (__mmask16)(n - i >= LAND_BLOCK ? 0xFFFF : (1 << (n - i)) - 1);
        const __m512i d = _mm512_cvtepu16_epi32(_mm256_mask_loadu_epi16(_mm256_set1_epi16(-1), used, disp + i));
        const __m512i x = KERNEL(land_place)(&v, 0, _mm512_add_epi32(lane, _mm512_set1_epi32((int)i)), d);
        const __m512i y = KERNEL(land_place)(&v, 1, _mm512_set1_epi32(v.y), d);
        const __m512i to = _mm512_add_epi32(_mm512_mullo_epi32(y, _mm512_set1_epi32(v.width)), x);
        __m512i value = _mm512_slli_epi32(_mm512_add_epi32(d, _mm512_set1_epi32(1)), SST_LANDED_DISP);
        __mmask16 left = _mm512_cmpneq_epi32_mask(d, _mm512_set1_epi32(65535));
        int32_t at[LAND_BLOCK];
        uint32_t values[LAND_BLOCK];

        if (rank)
            value = _mm512_or_si512(value, _mm512_cvtepu8_epi32(_mm_maskz_loadu_epi8(used, rank + i)));
        left = _mm512_mask_cmplt_epu32_mask(left, x, _mm512_set1_epi32(v.width));
        left = _mm512_mask_cmplt_epu32_mask(left, y, _mm512_set1_epi32(v.height));
        _mm512_storeu_si512(at, to);
        if (left == 0xFFFF && _mm512_cmpeq_epi32_mask(to, _mm512_add_epi32(lane, _mm512_set1_epi32(at[0]))) == 0xFFFF) {
            uint32_t *row = nearest + at[0];
            const __m512i old = _mm512_loadu_si512(row);

            _mm512_storeu_si512(row, _mm512_max_epu32(old, value));
            if (farthest) { /* the upper halves of d, all ones, leave the sources as they are */
                const __mmask16 open = _mm512_cmpneq_epi32_mask(old, _mm512_set1_epi32(-1));
                const __m512i was = _mm512_loadu_si512(farthest + at[0]);
                const __m512i least = _mm512_min_epu16(was, _mm512_or_si512(d, _mm512_set1_epi32((int)0xFFFF0000)));

                _mm512_storeu_si512(farthest + at[0],
                                    _mm512_mask_or_epi32(was, open, least, _mm512_set1_epi32((int)source)));
            }
            continue;
        }
        left = _mm512_mask_cmpneq_epi32_mask(
            left, _mm512_mask_i32gather_epi32(_mm512_set1_epi32(-1), left, to, nearest, sizeof(*nearest)),
            _mm512_set1_epi32(-1));
        _mm512_storeu_si512(values, value);
        for (; left; left &= (__mmask16)(left - 1)) {
            const int k = __builtin_ctz(left);

            KERNEL(land)(nearest, farthest, at[k], values[k], source);
        }
    }
}
#elif defined(__AVX2__)
#define LAND_LANES 8

static inline __m256i KERNEL(land_place)(const struct sst_landing *l, int axis, __m256i own, __m256i d)
{
    const __m256i moved = _mm256_srai_epi32(
        _mm256_add_epi32(_mm256_mullo_epi32(d, _mm256_set1_epi32(l->step[axis])), _mm256_set1_epi32(l->part[axis])),
        16);

    return _mm256_add_epi32(_mm256_add_epi32(own, _mm256_set1_epi32(l->whole[axis])), moved);
}

/* 0 <= v <= most */
static inline __m256i KERNEL(land_within)(__m256i v, int most)
{
    return _mm256_cmpeq_epi32(_mm256_min_epu32(v, _mm256_set1_epi32(most)), v);
}

/* Pixels that land side by side. The upper halves of d, all ones, leave the sources as they are. */
static inline void KERNEL(land_alike)(uint32_t *nearest, uint32_t *farthest, __m256i value, __m256i d, uint32_t source)
{
    __m256i *to = (__m256i *)(void *)nearest, *far = (__m256i *)(void *)farthest;
    const __m256i old = _mm256_loadu_si256(to);

    _mm256_storeu_si256(to, _mm256_max_epu32(old, value));
    if (far) {
        const __m256i closed = _mm256_cmpeq_epi32(old, _mm256_set1_epi32(-1)), was = _mm256_loadu_si256(far);
        const __m256i least = _mm256_min_epu16(was, _mm256_or_si256(d, _mm256_set1_epi32((int)0xFFFF0000)));

        _mm256_storeu_si256(far,
                            _mm256_blendv_epi8(_mm256_or_si256(least, _mm256_set1_epi32((int)source)), was, closed));
    }
}

static void KERNEL(land_row)(uint32_t *restrict nearest, uint32_t *restrict farthest, const struct sst_landing *l,
                             const uint16_t *restrict disp, const uint8_t *restrict rank, size_t n)
{
    const __m256i lane = _mm256_set_epi32(7, 6, 5, 4, 3, 2, 1, 0), closed = _mm256_set1_epi32(-1);
    const struct sst_landing v = *l;
    const uint32_t source = v.source << 16;
    size_t i = 0;

    for (; i + LAND_LANES <= n; i += LAND_LANES) {
        const __m256i d = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(const void *)(disp + i)));
        const __m256i x = KERNEL(land_place)(&v, 0, _mm256_add_epi32(lane, _mm256_set1_epi32((int)i)), d);
        const __m256i y = KERNEL(land_place)(&v, 1, _mm256_set1_epi32(v.y), d);
        const __m256i to = _mm256_add_epi32(_mm256_mullo_epi32(y, _mm256_set1_epi32(v.width)), x);
        const __m256i lands =
            _mm256_and_si256(KERNEL(land_within)(d, 65534), _mm256_and_si256(KERNEL(land_within)(x, v.width - 1),
                                                                             KERNEL(land_within)(y, v.height - 1)));
        const int32_t first = _mm256_cvtsi256_si32(to);
        const __m256i alike = _mm256_cmpeq_epi32(to, _mm256_add_epi32(lane, _mm256_set1_epi32(first)));
        __m256i value = _mm256_slli_epi32(_mm256_add_epi32(d, _mm256_set1_epi32(1)), SST_LANDED_DISP), there;
        int32_t at[LAND_LANES];
        uint32_t values[LAND_LANES];
        unsigned open;

        if (rank)
            value = _mm256_or_si256(value,
                                    _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)(rank + i))));
        if (_mm256_movemask_epi8(_mm256_and_si256(alike, lands)) == -1) {
            KERNEL(land_alike)(nearest + first, farthest ? farthest + first : NULL, value, d, source);
            continue;
        }
        there = _mm256_mask_i32gather_epi32(closed, (const int *)(const void *)nearest, to, lands, sizeof(*nearest));
        open = ~(unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(there, closed))) & 0xFF;
        if (!open)
            continue;
        _mm256_storeu_si256((__m256i *)(void *)at, to);
        _mm256_storeu_si256((__m256i *)(void *)values, value);
        for (; open; open &= open - 1) {
            const int k = __builtin_ctz(open);

            KERNEL(land)(nearest, farthest, at[k], values[k], source);
        }
    }
    if (i < n) {
        struct sst_landing rest = v;

        rest.whole[0] += (int32_t)i;
        sst_land_row_ref(nearest, farthest, &rest, disp + i, rank ? rank + i : NULL, n - i);
    }
}
#undef LAND_LANES
#else
static void KERNEL(land_row)(uint32_t *restrict nearest, uint32_t *restrict farthest, const struct sst_landing *l,
                             const uint16_t *restrict disp, const uint8_t *restrict rank, size_t n)
{
    const struct sst_landing v = *l;
    int32_t x[LAND_BLOCK], y[LAND_BLOCK];
    uint32_t value[LAND_BLOCK];

    for (size_t i = 0; i < n; i += LAND_BLOCK) {
        const int count = n - i < LAND_BLOCK ? (int)(n - i) : LAND_BLOCK;

        for (int k = 0; k < count; k++) {
            const int d = disp[i + (size_t)k] == 65535 ? 0 : disp[i + (size_t)k]; /* 65535 has no place */

            x[k] = (int)i + k + v.whole[0] + ((v.part[0] + d * v.step[0]) >> 16);
            y[k] = v.y + v.whole[1] + ((v.part[1] + d * v.step[1]) >> 16);
            value[k] = (uint32_t)(d + 1) << SST_LANDED_DISP | (rank ? rank[i + (size_t)k] : 0);
        }
        for (int k = 0; k < count; k++) {
            if (disp[i + (size_t)k] != 65535 && (unsigned)x[k] < (unsigned)v.width &&
                (unsigned)y[k] < (unsigned)v.height)
                KERNEL(land)(nearest, farthest, y[k] * v.width + x[k], value[k], v.source << 16);
        }
    }
}
#endif
#undef LAND_BLOCK
