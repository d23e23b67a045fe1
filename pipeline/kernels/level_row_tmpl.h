/* level_row: samples as warped_row's, stored as levels of 16 bits. Ends of segments, and levels without gathers, are the
 * reference's. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/warped_near_tmpl.h"

#if defined(__AVX2__)

#if SIMD_BYTES == 64
#define LEVEL_GATHER(base, at) (simd_s32) _mm512_i32gather_epi32((__m512i)(at), base, 2)
#define LEVEL_MADD(a, b)       (simd_s32) _mm512_madd_epi16((__m512i)(a), (__m512i)(b))
#define LEVEL_LEAST(a, b)      (simd_s32) _mm512_min_epi32((__m512i)(a), (__m512i)(b))
#else
#define LEVEL_GATHER(base, at) (simd_s32) _mm256_i32gather_epi32((const int *)(base), (__m256i)(at), 2)
#define LEVEL_MADD(a, b)       (simd_s32) _mm256_madd_epi16((__m256i)(a), (__m256i)(b))
#define LEVEL_LEAST(a, b)      (simd_s32) _mm256_min_epi32((__m256i)(a), (__m256i)(b))
#endif
#define LEVEL_LANES (SIMD_BYTES / 4)

typedef int16_t KERNEL(level_lanes) __attribute__((vector_size(SIMD_BYTES / 2)));

static inline void KERNEL(level_store)(int16_t *level, uint8_t *seen, simd_s32 v)
{
    const KERNEL(level_lanes) narrow = __builtin_convertvector(v, KERNEL(level_lanes));

    memcpy(level, &narrow, sizeof(narrow));
    memset(seen, 1, LEVEL_LANES);
}

/* Whole vectors of a segment. @return how many pixels that are */
static inline int KERNEL(level_segment)(int16_t *level, uint8_t *seen, const struct sst_warped_source *from,
                                        const struct sst_warped_segment *s)
{
    const simd_s32 lane = SIMD_LANES;
    simd_s32 x = s->x_q16 + lane * s->dx_q16, y = s->y_q16 + lane * s->dy_q16;
    int i = 0;

    for (; i + LEVEL_LANES <= s->n; i += LEVEL_LANES) {
        const simd_s32 left = LEVEL_LEAST(x >> 16, simd_set_s32(from->width - 2));
        const simd_s32 top = LEVEL_LEAST(y >> 16, simd_set_s32(from->height - 2));
        const simd_s32 right_q8 = (x - (left << 16) + 128) >> 8, at = top * (int32_t)from->stride + left;
        const simd_s32 across = (256 - right_q8) | right_q8 << 16, down = (y - (top << 16) + 128) >> 8;
        const simd_s32 above = LEVEL_MADD(LEVEL_GATHER(from->plane[0], at) ^ (int32_t)0x80008000, across);
        const simd_s32 below =
            LEVEL_MADD(LEVEL_GATHER(from->plane[0] + from->stride, at) ^ (int32_t)0x80008000, across);
        const simd_s32 both = (simd_s32)(((simd_u32)above << 8) + (simd_u32)(below - above) * (simd_u32)down);

        /* Halved first: white and its rounding do not fit in 32 bits. */
        KERNEL(level_store)
        (level + s->at + i, seen + s->at + i, ((both >> 1) + (1 << (14 + SST_LEVEL_SHIFT))) >> (15 + SST_LEVEL_SHIFT));
        x += s->dx_q16 * LEVEL_LANES;
        y += s->dy_q16 * LEVEL_LANES;
    }
    return i;
}

/* A whole segment without gathers; its last vector may compute some pixels again. */
static inline void KERNEL(level_near)(int16_t *level, uint8_t *seen, const struct sst_warped_source *from,
                                      const struct sst_warped_segment *s)
{
    const __m256i half = _mm256_set1_epi32(1 << (14 + SST_LEVEL_SHIFT));

    for (int i = 0; i < s->n; i += NEAR_LANES) {
        const int at = i + NEAR_LANES <= s->n ? i : s->n - NEAR_LANES;
        const struct KERNEL(near) near = KERNEL(near_places)(from, s, at);
        const __m256i both = KERNEL(near_levels)(from->plane[0], from->stride, &near);
        /* Halved first: white and its rounding do not fit in 32 bits. */
        const __m256i v =
            _mm256_srai_epi32(_mm256_add_epi32(_mm256_srai_epi32(both, 1), half), 15 + SST_LEVEL_SHIFT);

        _mm_storeu_si128((__m128i *)(void *)(level + s->at + at),
                         _mm_packs_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1)));
    }
    memset(seen + s->at, 1, (size_t)s->n);
}

static void KERNEL(level_row)(int16_t *level, uint8_t *seen, const struct sst_warped_source *from,
                              const struct sst_warped_segment *segment, size_t segments)
{
    for (; segments > 0; segments--, segment++) {
        int done = segment->n;

        if (KERNEL(near_fits)(from, segment))
            KERNEL(level_near)(level, seen, from, segment);
        else
            done = KERNEL(level_segment)(level, seen, from, segment);

        if (done < segment->n) {
            struct sst_warped_segment rest = *segment;

            rest.x_q16 += done * rest.dx_q16;
            rest.y_q16 += done * rest.dy_q16;
            rest.at += done;
            rest.n -= done;
            sst_level_row_ref(level, seen, from, &rest, 1);
        }
    }
}

#undef LEVEL_GATHER
#undef LEVEL_MADD
#undef LEVEL_LEAST
#undef LEVEL_LANES

#else

static void KERNEL(level_row)(int16_t *level, uint8_t *seen, const struct sst_warped_source *from,
                              const struct sst_warped_segment *segment, size_t segments)
{
    sst_level_row_ref(level, seen, from, segment, segments);
}

#endif
