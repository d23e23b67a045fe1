/*
 * Samples of warped_row and level_row without gathers: where a segment's step is about a pixel along a row, four places
 * lie within eight samples of three rows, which shuffles pick from.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__AVX2__)

#define NEAR_LANES 8
#define NEAR_DX    109226 /* 5/3 px: four places, each with the sample beside it, lie within 8 samples */
#define NEAR_DY    21845  /* 1/3 px: they lie in two rows, each with the one below it */

/* Two groups of four places. */
struct KERNEL(near) {
    __m256i index;         /* bytes of a place's two samples in its group's eight */
    __m256i lower;         /* places in the second row: all bits */
    __m256i across, down;  /* weights in 1/256: of both samples, of the row below */
    int32_t at[2];         /* samples from the picture's first to the groups' */
    bool level;            /* all places are in the first row */
};

/* May all vectors of a segment be read so? No sample beyond the picture is. */
static inline bool KERNEL(near_fits)(const struct sst_warped_source *from, const struct sst_warped_segment *s)
{
    const int32_t x = s->x_q16 + (s->n - 1) * s->dx_q16, y = s->y_q16 + (s->n - 1) * s->dy_q16;

    return s->n >= NEAR_LANES && (uint32_t)s->dx_q16 <= NEAR_DX && (uint32_t)(s->dy_q16 + NEAR_DY) <= 2 * NEAR_DY &&
           (x >> 16) + 8 <= from->width && (y > s->y_q16 ? y : s->y_q16) >> 16 < from->height - 2;
}

static inline struct KERNEL(near) KERNEL(near_places)(const struct sst_warped_source *from,
                                                      const struct sst_warped_segment *s, int i)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), half = _mm256_set1_epi32(128);
    const __m256i spread = _mm256_setr_epi8(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12, 0, 0, 0, 0, 4, 4, 4, 4,
                                            8, 8, 8, 8, 12, 12, 12, 12);
    const __m256i part = _mm256_set1_epi32(0xFFFF);
    const __m256i x = _mm256_add_epi32(_mm256_set1_epi32(s->x_q16 + i * s->dx_q16),
                                       _mm256_mullo_epi32(lane, _mm256_set1_epi32(s->dx_q16)));
    const __m256i y = _mm256_add_epi32(_mm256_set1_epi32(s->y_q16 + i * s->dy_q16),
                                       _mm256_mullo_epi32(lane, _mm256_set1_epi32(s->dy_q16)));
    const __m256i left = _mm256_srai_epi32(x, 16), top = _mm256_srai_epi32(y, 16);
    const __m256i first = _mm256_shuffle_epi32(left, 0);
    const __m256i row = _mm256_min_epi32(_mm256_shuffle_epi32(top, 0), _mm256_shuffle_epi32(top, 0xFF));
    const __m256i right = _mm256_srai_epi32(_mm256_add_epi32(_mm256_and_si256(x, part), half), 8);
    const __m256i bytes = _mm256_shuffle_epi8(_mm256_sub_epi32(left, first), spread);
    const __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(row, _mm256_set1_epi32((int32_t)from->stride)), first);
    struct KERNEL(near) v;

    v.index = _mm256_add_epi8(_mm256_add_epi8(bytes, bytes), _mm256_set1_epi32(0x03020100));
    v.lower = _mm256_cmpgt_epi32(top, row);
    v.level = _mm256_testz_si256(v.lower, v.lower);
    v.across = _mm256_or_si256(_mm256_sub_epi32(_mm256_set1_epi32(256), right), _mm256_slli_epi32(right, 16));
    v.down = _mm256_srai_epi32(_mm256_add_epi32(_mm256_and_si256(y, part), half), 8);
    v.at[0] = _mm256_extract_epi32(at, 0);
    v.at[1] = _mm256_extract_epi32(at, 4);
    return v;
}

/* Two samples of each place, less 32768, from the groups' rows. */
static inline __m256i KERNEL(near_row)(const uint16_t *plane, const struct KERNEL(near) *v)
{
    const __m128i a = _mm_loadu_si128((const __m128i *)(const void *)(plane + v->at[0]));
    const __m128i b = _mm_loadu_si128((const __m128i *)(const void *)(plane + v->at[1]));
    const __m256i both = _mm256_inserti128_si256(_mm256_castsi128_si256(a), b, 1);

    return _mm256_xor_si256(_mm256_shuffle_epi8(both, v->index), _mm256_set1_epi32((int32_t)0x80008000));
}

/* Levels less 32768, in 1/65536. */
static inline __m256i KERNEL(near_levels)(const uint16_t *plane, size_t stride, const struct KERNEL(near) *v)
{
    __m256i a = KERNEL(near_row)(plane, v), b = KERNEL(near_row)(plane + stride, v);

    if (!v->level) {
        a = _mm256_blendv_epi8(a, b, v->lower);
        b = _mm256_blendv_epi8(b, KERNEL(near_row)(plane + 2 * stride, v), v->lower);
    }
    a = _mm256_madd_epi16(a, v->across);
    b = _mm256_madd_epi16(b, v->across);
    return _mm256_add_epi32(_mm256_slli_epi32(a, 8), _mm256_mullo_epi32(_mm256_sub_epi32(b, a), v->down));
}

#endif
