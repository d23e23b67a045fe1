/* shown_row. AVX-512 and AVX2 compare eight and four rays at once, loaded one by one: that takes less time than gathering
 * them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#if defined(__AVX512BW__)
#define SHOWN_BLOCK 8

struct KERNEL(shown_limits) {
    __m512i bytes, words; /* largest differences of colours, of disparities; unused bytes and words do not count */
};

static inline __m256i KERNEL(shown_place)(const struct sst_shown *s, int axis, __m256i own, __m256i d)
{
    const __m256i moved = _mm256_srai_epi32(
        _mm256_add_epi32(_mm256_mullo_epi32(d, _mm256_set1_epi32(s->step[axis])), _mm256_set1_epi32(s->part[axis])),
        16);

    return _mm256_add_epi32(_mm256_add_epi32(own, _mm256_set1_epi32(s->whole[axis])), moved);
}

static inline __mmask8 KERNEL(shown_alike)(const struct KERNEL(shown_limits) * l, __m512i a, __m512i b)
{
    const __m512i bytes = _mm512_or_si512(_mm512_subs_epu8(a, b), _mm512_subs_epu8(b, a));
    const __m512i words = _mm512_or_si512(_mm512_subs_epu16(a, b), _mm512_subs_epu16(b, a));

    return _mm512_testn_epi64_mask(
        _mm512_or_si512(_mm512_subs_epu8(bytes, l->bytes), _mm512_subs_epu16(words, l->words)), _mm512_set1_epi64(-1));
}

static void KERNEL(shown_row)(int32_t *restrict at, uint8_t *restrict label, const struct sst_shown *s,
                              const uint64_t *restrict own, size_t n)
{
    const uint64_t similar = (uint64_t)s->similar * 0x010101, same = s->same < 0xFFFF ? (uint64_t)s->same : 0xFFFF;
    const struct KERNEL(shown_limits)
        limits = { _mm512_set1_epi64((long long)(similar | ~(uint64_t)0 << SST_RAY_LABEL)),
                   _mm512_set1_epi64((long long)(same << SST_RAY_DISP | ~((uint64_t)0xFFFF << SST_RAY_DISP))) };
    const struct sst_shown v = *s;

    for (size_t i = 0; i < n; i += SHOWN_BLOCK) {
        const __mmask8 used = (__mmask8)(n - i >= SHOWN_BLOCK ? 0xFF : (1 << (n - i)) - 1);
        const __m512i a = _mm512_maskz_loadu_epi64(used, own + i);
        const __m256i high = _mm512_cvtepi64_epi32(_mm512_srli_epi64(a, SST_RAY_DISP));
        const __m256i d = _mm256_and_si256(high, _mm256_set1_epi32(0xFFFF));
        const __m256i x = KERNEL(shown_place)(&v, 0, _mm256_srli_epi32(high, SST_RAY_COLUMN - SST_RAY_DISP), d);
        const __m256i y = KERNEL(shown_place)(&v, 1, _mm256_set1_epi32(v.y), d);
        const __mmask8 inside = _mm256_mask_cmplt_epu32_mask(
            _mm256_mask_cmplt_epu32_mask(used, x, _mm256_set1_epi32(v.width)), y, _mm256_set1_epi32(v.height));
        uint32_t offset[SHOWN_BLOCK];
        __mmask8 shown;
        __m512i b;

        _mm256_storeu_si256((__m256i *)(void *)offset,
                            _mm256_maskz_add_epi32(inside, _mm256_mullo_epi32(y, _mm256_set1_epi32(v.width)), x));
        b = _mm512_set_epi64((long long)v.rays[offset[7]], (long long)v.rays[offset[6]], (long long)v.rays[offset[5]],
                             (long long)v.rays[offset[4]], (long long)v.rays[offset[3]], (long long)v.rays[offset[2]],
                             (long long)v.rays[offset[1]], (long long)v.rays[offset[0]]);
        shown = inside & KERNEL(shown_alike)(&limits, a, b);
        _mm256_mask_storeu_epi32(at + i, used,
                                 _mm256_mask_or_epi32(_mm256_set1_epi32(-1), shown, _mm256_slli_epi32(y, 16), x));
        _mm_mask_storeu_epi8(label + i, used, _mm512_cvtepi64_epi8(_mm512_maskz_srli_epi64(shown, b, SST_RAY_LABEL)));
    }
}
#undef SHOWN_BLOCK
#elif defined(__AVX2__)
#define SHOWN_BLOCK 4

struct KERNEL(shown_limits) {
    __m256i bytes, words; /* largest differences of colours, of disparities; those of the rest do not count */
};

static inline __m128i KERNEL(shown_place)(const struct sst_shown *s, int axis, __m128i own, __m128i d)
{
    const __m128i moved = _mm_srai_epi32(
        _mm_add_epi32(_mm_mullo_epi32(d, _mm_set1_epi32(s->step[axis])), _mm_set1_epi32(s->part[axis])), 16);

    return _mm_add_epi32(_mm_add_epi32(own, _mm_set1_epi32(s->whole[axis])), moved);
}

/* Upper or lower halves of four rays. */
static inline __m128i KERNEL(shown_halves)(__m256i rays, int half)
{
    const __m256i order = half ? _mm256_set_epi32(7, 5, 3, 1, 7, 5, 3, 1) : _mm256_set_epi32(6, 4, 2, 0, 6, 4, 2, 0);

    return _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(rays, order));
}

static inline __m256i KERNEL(shown_alike)(const struct KERNEL(shown_limits) * l, __m256i a, __m256i b)
{
    const __m256i bytes = _mm256_or_si256(_mm256_subs_epu8(a, b), _mm256_subs_epu8(b, a));
    const __m256i words = _mm256_or_si256(_mm256_subs_epu16(a, b), _mm256_subs_epu16(b, a));

    return _mm256_cmpeq_epi64(_mm256_or_si256(_mm256_subs_epu8(bytes, l->bytes), _mm256_subs_epu16(words, l->words)),
                              _mm256_setzero_si256());
}

/* 0 <= v < end */
static inline __m128i KERNEL(shown_within)(__m128i v, int end)
{
    return _mm_andnot_si128(_mm_srai_epi32(v, 31), _mm_cmpgt_epi32(_mm_set1_epi32(end), v));
}

static void KERNEL(shown_row)(int32_t *restrict at, uint8_t *restrict label, const struct sst_shown *s,
                              const uint64_t *restrict own, size_t n)
{
    const uint64_t similar = (uint64_t)s->similar * 0x010101, same = s->same < 0xFFFF ? (uint64_t)s->same : 0xFFFF;
    const struct KERNEL(shown_limits)
        limits = { _mm256_set1_epi64x((long long)(similar | ~(uint64_t)0 << SST_RAY_LABEL)),
                   _mm256_set1_epi64x((long long)(same << SST_RAY_DISP | ~((uint64_t)0xFFFF << SST_RAY_DISP))) };
    const __m128i labels = _mm_set_epi8(-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 15, 11, 7, 3);
    const struct sst_shown v = *s;
    size_t i = 0;

    for (; i + SHOWN_BLOCK <= n; i += SHOWN_BLOCK) {
        const __m256i a = _mm256_loadu_si256((const __m256i *)(const void *)(own + i));
        const __m128i d = _mm_and_si128(KERNEL(shown_halves)(_mm256_srli_epi64(a, SST_RAY_DISP), 0),
                                        _mm_set1_epi32(0xFFFF));
        const __m128i x =
            KERNEL(shown_place)(&v, 0, KERNEL(shown_halves)(_mm256_srli_epi64(a, SST_RAY_COLUMN), 0), d);
        const __m128i y = KERNEL(shown_place)(&v, 1, _mm_set1_epi32(v.y), d);
        const __m128i inside =
            _mm_and_si128(KERNEL(shown_within)(x, v.width), KERNEL(shown_within)(y, v.height));
        uint32_t offset[SHOWN_BLOCK];
        __m128i shown, found;
        __m256i b;

        _mm_storeu_si128((__m128i *)(void *)offset,
                         _mm_and_si128(inside, _mm_add_epi32(_mm_mullo_epi32(y, _mm_set1_epi32(v.width)), x)));
        b = _mm256_set_epi64x((long long)v.rays[offset[3]], (long long)v.rays[offset[2]], (long long)v.rays[offset[1]],
                              (long long)v.rays[offset[0]]);
        shown = _mm_and_si128(inside, KERNEL(shown_halves)(KERNEL(shown_alike)(&limits, a, b), 0));
        found = _mm_shuffle_epi8(_mm_and_si128(shown, KERNEL(shown_halves)(b, 0)), labels);
        _mm_storeu_si128((__m128i *)(void *)(at + i),
                         _mm_or_si128(_mm_andnot_si128(shown, _mm_set1_epi32(-1)),
                                      _mm_and_si128(shown, _mm_or_si128(_mm_slli_epi32(y, 16), x))));
        memcpy(label + i, &found, SHOWN_BLOCK);
    }
    sst_shown_row_ref(at + i, label + i, s, own + i, n - i);
}
#undef SHOWN_BLOCK
#else
/* All values are compared: which one differs first is hard to predict. */
static inline bool KERNEL(shown_alike)(const struct sst_shown *s, uint64_t a, uint64_t b)
{
    const int d = (int)(a >> SST_RAY_DISP & 0xFFFF) - (int)(b >> SST_RAY_DISP & 0xFFFF);
    int most = 0;

    for (int bits = 0; bits < SST_RAY_LABEL; bits += 8) {
        const int off = abs((int)(a >> bits & 0xFF) - (int)(b >> bits & 0xFF));

        most = off > most ? off : most;
    }
    return (abs(d) <= s->same) & (most <= s->similar);
}

static void KERNEL(shown_row)(int32_t *restrict at, uint8_t *restrict label, const struct sst_shown *s,
                              const uint64_t *restrict own, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const int d = (int)(own[i] >> SST_RAY_DISP & 0xFFFF);
        const int x = (int)(own[i] >> SST_RAY_COLUMN) + s->whole[0] + ((s->part[0] + d * s->step[0]) >> 16);
        const int y = s->y + s->whole[1] + ((s->part[1] + d * s->step[1]) >> 16);
        const bool inside = (unsigned)x < (unsigned)s->width && (unsigned)y < (unsigned)s->height;
        const uint64_t there = s->rays[inside ? (size_t)y * (size_t)s->width + (size_t)x : 0];
        const bool shown = inside & KERNEL(shown_alike)(s, own[i], there);

        at[i] = shown ? y << 16 | x : -1;
        label[i] = shown ? (uint8_t)(there >> SST_RAY_LABEL) : 0;
    }
}
#endif
