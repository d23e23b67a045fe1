/* Colour agreement of the rays of a pixel: votes, the colour with most votes, similarity of each ray to it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

/* The table lookup is a separate loop: it is not vectorised, the others are. */
static void KERNEL(agree_votes)(uint8_t *vote, const uint8_t *const colour[3], const float *weight,
                                const struct sst_voting *v, size_t n)
{
    const uint8_t *restrict r = colour[0], *restrict g = colour[1], *restrict b = colour[2];
    const uint8_t *restrict rarity = v->rarity;
    const float *restrict w = weight;
    const float scale = v->scale, doubt = v->doubt, most = v->most;
    uint8_t *restrict out = vote;
    uint16_t bin[64];

    for (size_t x = 0; x < n; x += 64) {
        const size_t end = n - x < 64 ? n - x : 64;

        for (size_t i = 0; i < end; i++)
            bin[i] = (uint16_t)((r[x + i] >> 4) << 8 | (g[x + i] >> 4) << 4 | b[x + i] >> 4);
        for (size_t i = 0; i < end; i++)
            out[x + i] = rarity[bin[i]];
    }
    for (size_t x = 0; x < n; x++) {
        const float votes = 1.0f + scale * (w[x] + doubt) * (float)out[x];
        const float capped = votes < most ? votes : most;

        out[x] = (uint8_t)(int)(w[x] < 0 ? 0 : capped);
    }
}

#define BYTE_MIN(a, b)  ((uint8_t)((a) < (b) ? (a) : (b)))
#define BYTE_DIFF(a, b) ((uint8_t)((a) > (b) ? (a) - (b) : (b) - (a)))
/* Bytes throughout: differences are clipped before they are summed, so that sums of three stay below 256. */
#define BYTE_LIKENESS(most, a, b, c, d, e, f)                                                                          \
    ((uint8_t)(most)-BYTE_MIN((uint8_t)(BYTE_MIN(BYTE_DIFF(a, d), (uint8_t)(most)) +                                   \
                                        BYTE_MIN(BYTE_DIFF(b, e), (uint8_t)(most)) +                                   \
                                        BYTE_MIN(BYTE_DIFF(c, f), (uint8_t)(most))),                                   \
                              (uint8_t)(most)))

_Static_assert(3 * SST_AGREE_MODE < 256 && 3 * SST_AGREE_NEAR < 256, "sums of three cut differences are bytes");

_Static_assert(SST_AGREE_MODE % 2 == 0, "half of it is a whole number");

/* Likenesses or votes of two rays. */
struct KERNEL(agree_pair) {
    simd_u8 of[2];
};

/* Bytes of both rays alternate where one instruction multiplies and adds two of a lane. */
static inline struct KERNEL(agree_pair) KERNEL(agree_pair)(simd_u8 a, simd_u8 b)
{
#if defined(__AVX2__)
    return (struct KERNEL(agree_pair)){ { (simd_u8)SIMD_OP(unpacklo_epi8)((SIMD_INT)a, (SIMD_INT)b),
                                          (simd_u8)SIMD_OP(unpackhi_epi8)((SIMD_INT)a, (SIMD_INT)b) } };
#else
    return (struct KERNEL(agree_pair)){ { a, b } };
#endif
}

static inline simd_u16 KERNEL(agree_add)(simd_u16 sum, struct KERNEL(agree_pair) a, struct KERNEL(agree_pair) b,
                                         int half)
{
#if defined(__AVX2__)
    return sum + (simd_u16)SIMD_OP(maddubs_epi16)((SIMD_INT)a.of[half], (SIMD_INT)b.of[half]);
#else
    sum += simd_widen(a.of[0], half) * simd_widen(b.of[0], half);
    return sum + simd_widen(a.of[1], half) * simd_widen(b.of[1], half);
#endif
}

/* floor(max(0, SST_AGREE_MODE - difference) / 2); sums that do not fit saturate. */
static inline simd_u8 KERNEL(agree_like)(const simd_u8 a[3], const uint8_t *b, size_t stride)
{
    simd_u8 all = simd_apart_u8(a[0], simd_load_u8(b));

    all = simd_more_u8(all, simd_apart_u8(a[1], simd_load_u8(b + stride)));
    all = simd_more_u8(all, simd_apart_u8(a[2], simd_load_u8(b + 2 * stride)));
    return simd_mean_u8(simd_less_u8(simd_set_u8(SST_AGREE_MODE - 1), all), simd_set_u8(0));
}

/* Votes for colour a. */
static inline void KERNEL(agree_count)(simd_u16 votes[2], const simd_u8 a[3], const struct KERNEL(agree_pair) *weight,
                                       const uint8_t *colour, size_t rays, size_t stride)
{
    votes[0] = votes[1] = simd_set_u16(0);
    for (size_t k = 0; k < rays; k += 2, weight++) {
        const simd_u8 first = KERNEL(agree_like)(a, colour + k * 3 * stride, stride);
        const simd_u8 second = k + 1 < rays ? KERNEL(agree_like)(a, colour + (k + 1) * 3 * stride, stride) : first;
        const struct KERNEL(agree_pair) like = KERNEL(agree_pair)(first, second);

        for (int half = 0; half < 2; half++)
            votes[half] = KERNEL(agree_add)(votes[half], *weight, like, half);
    }
}

/* Where votes of pixels with a ray are above the best ones, all bits of a pixel; the best ones follow. */
static inline simd_u8 KERNEL(agree_better)(simd_u16 best[2], const simd_u16 votes[2], simd_u8 vote)
{
    const simd_u8 there = simd_min_u8(vote, simd_set_u8(1));
    simd_u16 more[2];

    for (int half = 0; half < 2; half++) {
        const simd_u16 counted = votes[half] & (0 - simd_widen(there, half)); /* 0 without a ray */

        more[half] = simd_min_u16(simd_less_u16(counted, best[half]), simd_set_u16(1));
        best[half] = simd_max_u16(best[half], counted);
    }
    return 0 - simd_narrow(more[0], more[1]);
}

static void KERNEL(agree_mode)(uint8_t *const mode[3], const uint8_t *colour, const uint8_t *vote, size_t rays,
                               size_t step, size_t stride)
{
    struct KERNEL(agree_pair) weight[128];

    for (size_t x = 0; x < stride; x += SIMD_BYTES) {
        simd_u16 best[2] = { simd_set_u16(0), simd_set_u16(0) };
        simd_u8 result[3] = { simd_set_u8(0), simd_set_u8(0), simd_set_u8(0) };

        for (size_t k = 0; k < rays; k += 2) {
            const uint8_t *of = vote + k * stride + x;

            weight[k / 2] =
                KERNEL(agree_pair)(simd_load_u8(of), k + 1 < rays ? simd_load_u8(of + stride) : simd_set_u8(0));
        }
        for (size_t j = 0; j < rays; j += step) {
            const uint8_t *of = colour + j * 3 * stride + x;
            const simd_u8 a[3] = { simd_load_u8(of), simd_load_u8(of + stride), simd_load_u8(of + 2 * stride) };
            simd_u16 votes[2];
            simd_u8 more;

            KERNEL(agree_count)(votes, a, weight, colour + x, rays, stride);
            more = KERNEL(agree_better)(best, votes, simd_load_u8(vote + j * stride + x));
            for (int c = 0; c < 3; c++)
                result[c] = (more & a[c]) | (~more & result[c]);
        }
        for (int c = 0; c < 3; c++)
            simd_store_u8(mode[c] + x, result[c]);
    }
}

static void KERNEL(agree_near)(uint16_t *near, const uint8_t *const colour[3], const uint8_t *const mode[3],
                               const uint8_t *vote, size_t n)
{
    const uint8_t *restrict a = colour[0], *restrict a1 = colour[1], *restrict a2 = colour[2], *restrict w = vote;
    const uint8_t *restrict b = mode[0], *restrict b1 = mode[1], *restrict b2 = mode[2];
    uint16_t *restrict out = near;

    for (size_t x = 0; x < n; x++) {
        const uint8_t like = (uint8_t)(BYTE_LIKENESS(SST_AGREE_NEAR, a[x], a1[x], a2[x], b[x], b1[x], b2[x]));

        out[x] = (uint16_t)((uint16_t)like * (uint16_t)w[x]);
    }
}

static void KERNEL(agree_sum)(float *const acc[4], const uint16_t *const near[3], const uint8_t *const colour[3],
                              const uint8_t *vote, size_t n)
{
    const uint16_t *restrict up = near[0], *restrict at = near[1], *restrict down = near[2];
    float w[SST_BLEND_MAX];

    for (size_t x = 0; x < n; x++) {
        const unsigned sum = (unsigned)up[x] + up[x + 1] + up[x + 2] + at[x] + at[x + 1] + at[x + 2] + down[x] +
                             down[x + 1] + down[x + 2];

        w[x] = vote[x] ? (float)(int)sum : 0;
    }
    for (int c = 0; c < 3; c++) {
        const uint8_t *restrict from = colour[c];
        float *restrict to = acc[c];

        for (size_t x = 0; x < n; x++)
            to[x] += w[x] * (float)from[x];
    }
    for (size_t x = 0; x < n; x++)
        acc[3][x] += w[x];
}

#undef BYTE_MIN
#undef BYTE_DIFF
#undef BYTE_LIKENESS
