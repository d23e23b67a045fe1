/*
 * warped_row. Segments with steps of about a pixel along rows are read without gathers (warped_near_tmpl.h). Otherwise a
 * gather fetches two neighbouring samples at once, which are made signed for a multiply-add of 16 bits;
 * both rows are then joined modulo 2^32: the result itself fits. Ends of segments, and levels without gathers, are the
 * reference's.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__AVX2__)

#if SIMD_BYTES == 64
#define WARPED_GATHER(base, at) (simd_s32) _mm512_i32gather_epi32((__m512i)(at), base, 2)
#define WARPED_MADD(a, b)       (simd_s32) _mm512_madd_epi16((__m512i)(a), (__m512i)(b))
#define WARPED_LEAST(a, b)      (simd_s32) _mm512_min_epi32((__m512i)(a), (__m512i)(b))
#else
#define WARPED_GATHER(base, at) (simd_s32) _mm256_i32gather_epi32((const int *)(base), (__m256i)(at), 2)
#define WARPED_MADD(a, b)       (simd_s32) _mm256_madd_epi16((__m256i)(a), (__m256i)(b))
#define WARPED_LEAST(a, b)      (simd_s32) _mm256_min_epi32((__m256i)(a), (__m256i)(b))
#endif
#define WARPED_LANES (SIMD_BYTES / 4)

static inline void KERNEL(warped_add)(uint32_t *sum, const uint16_t *plane, size_t stride, simd_s32 at,
                                      const simd_s32 weight[2])
{
    const simd_s32 above = WARPED_MADD(WARPED_GATHER(plane, at) ^ (int32_t)0x80008000, weight[0]);
    const simd_s32 below = WARPED_MADD(WARPED_GATHER(plane + stride, at) ^ (int32_t)0x80008000, weight[0]);
    const simd_u32 both = ((simd_u32)above << 8) + (simd_u32)(below - above) * (simd_u32)weight[1] + 512;

    simd_store_u32(sum, simd_load_u32(sum) + (simd_u32)((simd_s32)both >> 10) + (32768u << 6));
}

/* Whole vectors of a segment. @return how many pixels that are */
static inline int KERNEL(warped_segment)(uint32_t *const sum[3], uint16_t *count, const struct sst_warped_source *from,
                                         const struct sst_warped_segment *s)
{
    const simd_s32 lane = SIMD_LANES;
    simd_s32 x = s->x_q16 + lane * s->dx_q16, y = s->y_q16 + lane * s->dy_q16;
    int i = 0;

    for (; i + WARPED_LANES <= s->n; i += WARPED_LANES) {
        const simd_s32 left = WARPED_LEAST(x >> 16, simd_set_s32(from->width - 2));
        const simd_s32 top = WARPED_LEAST(y >> 16, simd_set_s32(from->height - 2));
        const simd_s32 right_q8 = (x - (left << 16) + 128) >> 8;
        const simd_s32 weight[2] = { (256 - right_q8) | right_q8 << 16, (y - (top << 16) + 128) >> 8 };

        for (int c = 0; c < from->channels; c++)
            KERNEL(warped_add)
        (sum[c] + s->at + i, from->plane[c], from->stride, top * (int32_t)from->stride + left, weight);
        for (int k = 0; k < WARPED_LANES; k++)
            count[s->at + i + k]++;
        x += s->dx_q16 * WARPED_LANES;
        y += s->dy_q16 * WARPED_LANES;
    }
    return i;
}

/* Whole vectors of a segment without gathers. @return how many pixels that are */
static inline int KERNEL(warped_near)(uint32_t *const sum[3], uint16_t *count, const struct sst_warped_source *from,
                                      const struct sst_warped_segment *s)
{
    const __m256i half = _mm256_set1_epi32(512), zero_level = _mm256_set1_epi32(32768 << 6);
    int i = 0;

    for (; i + NEAR_LANES <= s->n; i += NEAR_LANES) {
        const struct KERNEL(near) near = KERNEL(near_places)(from, s, i);

        for (int c = 0; c < from->channels; c++) {
            __m256i *to = (__m256i *)(void *)(sum[c] + s->at + i);
            const __m256i both = KERNEL(near_levels)(from->plane[c], from->stride, &near);
            const __m256i v = _mm256_add_epi32(_mm256_srai_epi32(_mm256_add_epi32(both, half), 10), zero_level);

            _mm256_storeu_si256(to, _mm256_add_epi32(_mm256_loadu_si256(to), v));
        }
        for (int k = 0; k < NEAR_LANES; k++)
            count[s->at + i + k]++;
    }
    return i;
}

static void KERNEL(warped_row)(uint32_t *const sum[3], uint16_t *count, const struct sst_warped_source *from,
                               const struct sst_warped_segment *segment, size_t segments)
{
    for (; segments > 0; segments--, segment++) {
        const int done = KERNEL(near_fits)(from, segment) ? KERNEL(warped_near)(sum, count, from, segment)
                                                          : KERNEL(warped_segment)(sum, count, from, segment);

        if (done < segment->n) {
            struct sst_warped_segment rest = *segment;

            rest.x_q16 += done * rest.dx_q16;
            rest.y_q16 += done * rest.dy_q16;
            rest.at += done;
            rest.n -= done;
            sst_warped_row_ref(sum, count, from, &rest, 1);
        }
    }
}

#undef WARPED_GATHER
#undef WARPED_MADD
#undef WARPED_LEAST
#undef WARPED_LANES

#else

static void KERNEL(warped_row)(uint32_t *const sum[3], uint16_t *count, const struct sst_warped_source *from,
                               const struct sst_warped_segment *segment, size_t segments)
{
    sst_warped_row_ref(sum, count, from, segment, segments);
}

#endif
