/* hypothesis_path_row: one lane for each hypothesis of the pixel, one hypothesis of the predecessor after the other. In
 * the compiler's vectors, because loops of eight are unrolled into scalars instead. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
typedef uint16_t KERNEL(hypothesis_lanes) __attribute__((vector_size(2 * SST_HYPOTHESES)));
/* In memory, at any entry. Not a type of parameters: gcc 14 for arm64 compiles none of this alignment. */
typedef KERNEL(hypothesis_lanes) KERNEL(hypothesis_entries) __attribute__((aligned(2), may_alias));

static inline KERNEL(hypothesis_lanes) KERNEL(hypothesis_min)(KERNEL(hypothesis_lanes) a, KERNEL(hypothesis_lanes) b)
{
#if defined(__ARM_NEON)
    return (KERNEL(hypothesis_lanes))vminq_u16((uint16x8_t)a, (uint16x8_t)b);
#else
    const KERNEL(hypothesis_lanes) less = (KERNEL(hypothesis_lanes))(a < b);

    return (a & less) | (b & ~less);
#endif
}

static inline KERNEL(hypothesis_lanes) KERNEL(hypothesis_apart)(KERNEL(hypothesis_lanes) a, KERNEL(hypothesis_lanes) b)
{
#if defined(__ARM_NEON)
    return (KERNEL(hypothesis_lanes))vabdq_u16((uint16x8_t)a, (uint16x8_t)b);
#else
    return KERNEL(hypothesis_min)(a - b, b - a); /* the other one wraps around */
#endif
}

/* The least of the entries but the first one. */
static inline uint16_t KERNEL(hypothesis_rest)(const uint16_t *from)
{
#if defined(__SSE4_1__)
    const __m128i all = _mm_loadu_si128((const __m128i *)(const void *)from);

    return (uint16_t)_mm_cvtsi128_si32(_mm_minpos_epu16(_mm_insert_epi16(all, 0xFFFF, 0)));
#elif defined(__ARM_NEON)
    return vminvq_u16(vsetq_lane_u16(0xFFFF, vld1q_u16(from), 0));
#else
    uint16_t least = from[1];

    for (int j = 2; j < SST_HYPOTHESES; j++)
        least = from[j] < least ? from[j] : least;
    return least;
#endif
}

/* Most pixels have one hypothesis: what costs p2 more than the first one is no way to anything. */
static inline void KERNEL(hypothesis_path)(uint16_t *path, uint16_t *sum, const uint16_t *cost,
                                           const uint16_t *hypothesis, const struct sst_hypothesis_before *before,
                                           uint16_t p1, uint16_t p2, uint16_t near)
{
    typedef KERNEL(hypothesis_lanes) lanes;
    typedef KERNEL(hypothesis_entries) entries;
    const uint16_t *from = before->path;
    const lanes here = *(const entries *)hypothesis;
    const uint16_t rest = KERNEL(hypothesis_rest)(from), least = from[0] < rest ? from[0] : rest;
    const int used = rest >= from[0] + p2 ? 1 : SST_HYPOTHESES;
    lanes best = (lanes){ 0 } + (uint16_t)(least + p2), l;

    for (int j = 0; j < used; j++) {
        const lanes jump = KERNEL(hypothesis_apart)(here, (lanes){ 0 } + before->hypothesis[j]);
        const lanes penalty = (lanes)(jump > near) & p1;

        best = KERNEL(hypothesis_min)(best, (penalty + from[j]) | (lanes)(jump > (uint16_t)(2 * near)));
    }
    l = *(const entries *)cost + best - least;
    *(entries *)path = l;
    *(entries *)sum += l;
}

static void KERNEL(hypothesis_path_row)(const struct sst_hypothesis_steps *steps,
                                        const struct sst_hypothesis_penalty *penalty, ptrdiff_t step, size_t n)
{
    for (ptrdiff_t x = 0; x < (ptrdiff_t)n; x++) {
        const ptrdiff_t pixel = x * step, at = pixel * SST_HYPOTHESES;
        const uint8_t c = steps->colour[pixel];

        KERNEL(hypothesis_path)
        (steps->path + at, steps->sum + at, steps->cost + at, steps->hypothesis + at, &steps->before[pixel],
         penalty->p1[c], penalty->p2[c], penalty->near);
    }
}
