/* Colour agreement of the rays of a pixel: votes, the colour with most votes, similarity of each ray to it. */

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

#if defined(__AVX2__)
/* Two rays at once: bytes of likeness and of votes alternate, so that one instruction multiplies and adds them. */
#if defined(__AVX512BW__)
#define AGREE_OP(name)   _mm512_##name
#define AGREE_BITS(name) _mm512_##name##_si512
typedef __m512i KERNEL(agree_bytes);
#else
#define AGREE_OP(name)   _mm256_##name
#define AGREE_BITS(name) _mm256_##name##_si256
typedef __m256i KERNEL(agree_bytes);
#endif
#define AGREE_BLOCK sizeof(KERNEL(agree_bytes))
#define AGREE_PAIRS 128 /* of rays */
_Static_assert(SST_AGREE_MODE % 2 == 0, "half of it is a whole number");

static inline KERNEL(agree_bytes) KERNEL(agree_load)(const uint8_t *from)
{
    KERNEL(agree_bytes) v;

    memcpy(&v, from, sizeof(v));
    return v;
}

static inline KERNEL(agree_bytes) KERNEL(agree_difference)(KERNEL(agree_bytes) a, const uint8_t *b)
{
    const KERNEL(agree_bytes) v = KERNEL(agree_load)(b);

    return AGREE_BITS(or)(AGREE_OP(subs_epu8)(a, v), AGREE_OP(subs_epu8)(v, a));
}

/* floor(max(0, SST_AGREE_MODE - difference) / 2); sums that do not fit saturate. */
static inline KERNEL(agree_bytes) KERNEL(agree_like)(const KERNEL(agree_bytes) a[3], const uint8_t *b, size_t stride)
{
    const KERNEL(agree_bytes) two = AGREE_OP(adds_epu8)(KERNEL(agree_difference)(a[0], b),
                                                        KERNEL(agree_difference)(a[1], b + stride));
    const KERNEL(agree_bytes) all = AGREE_OP(adds_epu8)(two, KERNEL(agree_difference)(a[2], b + 2 * stride));

    return AGREE_OP(avg_epu8)(AGREE_OP(subs_epu8)(AGREE_OP(set1_epi8)(SST_AGREE_MODE - 1), all), AGREE_BITS(setzero)());
}

/* Votes for colour a, those of a pixel in 16 bits: the lower and the upper half of each group of 16 pixels. */
static inline void KERNEL(agree_count)(KERNEL(agree_bytes) votes[2], const KERNEL(agree_bytes) a[3],
                                       KERNEL(agree_bytes) (*weight)[2], const uint8_t *colour, size_t rays,
                                       size_t stride)
{
    votes[0] = votes[1] = AGREE_BITS(setzero)();
    for (size_t k = 0; k < rays; k += 2) {
        const KERNEL(agree_bytes) first = KERNEL(agree_like)(a, colour + k * 3 * stride, stride);
        const KERNEL(agree_bytes) second =
            k + 1 < rays ? KERNEL(agree_like)(a, colour + (k + 1) * 3 * stride, stride) : first;

        votes[0] = AGREE_OP(add_epi16)(
            votes[0], AGREE_OP(maddubs_epi16)(weight[k / 2][0], AGREE_OP(unpacklo_epi8)(first, second)));
        votes[1] = AGREE_OP(add_epi16)(
            votes[1], AGREE_OP(maddubs_epi16)(weight[k / 2][1], AGREE_OP(unpackhi_epi8)(first, second)));
    }
}

/* Where votes of pixels with a ray are above the best ones, all bits of a pixel; the best ones follow. */
static inline KERNEL(agree_bytes) KERNEL(agree_better)(KERNEL(agree_bytes) best[2], const KERNEL(agree_bytes) votes[2],
                                                       KERNEL(agree_bytes) vote)
{
    const KERNEL(agree_bytes) zero = AGREE_BITS(setzero)(), one = AGREE_OP(set1_epi16)(1);
    const KERNEL(agree_bytes) there = AGREE_OP(min_epu8)(vote, AGREE_OP(set1_epi8)(1));
    const KERNEL(agree_bytes) unpacked[2] = { AGREE_OP(unpacklo_epi8)(there, zero),
                                              AGREE_OP(unpackhi_epi8)(there, zero) };
    KERNEL(agree_bytes) more[2];

    for (int i = 0; i < 2; i++) {
        const KERNEL(agree_bytes) counted =
            AGREE_BITS(and)(votes[i], AGREE_OP(sub_epi16)(zero, unpacked[i])); /* 0 without a ray */

        more[i] = AGREE_OP(min_epu16)(AGREE_OP(subs_epu16)(counted, best[i]), one);
        best[i] = AGREE_OP(max_epu16)(best[i], counted);
    }
    return AGREE_OP(sub_epi8)(zero, AGREE_OP(packus_epi16)(more[0], more[1]));
}

static void KERNEL(agree_mode)(uint8_t *const mode[3], const uint8_t *colour, const uint8_t *vote, size_t rays,
                               size_t step, size_t stride)
{
    KERNEL(agree_bytes) weight[AGREE_PAIRS][2];

    for (size_t x = 0; x < stride; x += AGREE_BLOCK) {
        const KERNEL(agree_bytes) zero = AGREE_BITS(setzero)();
        KERNEL(agree_bytes) best[2] = { zero, zero }, result[3] = { zero, zero, zero };

        for (size_t k = 0; k < rays; k += 2) {
            const KERNEL(agree_bytes) first = KERNEL(agree_load)(vote + k * stride + x);
            const KERNEL(agree_bytes) second = k + 1 < rays ? KERNEL(agree_load)(vote + (k + 1) * stride + x) : zero;

            weight[k / 2][0] = AGREE_OP(unpacklo_epi8)(first, second);
            weight[k / 2][1] = AGREE_OP(unpackhi_epi8)(first, second);
        }
        for (size_t j = 0; j < rays; j += step) {
            const uint8_t *of = colour + j * 3 * stride + x;
            const KERNEL(agree_bytes) a[3] = { KERNEL(agree_load)(of), KERNEL(agree_load)(of + stride),
                                               KERNEL(agree_load)(of + 2 * stride) };
            KERNEL(agree_bytes) votes[2], more;

            KERNEL(agree_count)(votes, a, weight, colour + x, rays, stride);
            more = KERNEL(agree_better)(best, votes, KERNEL(agree_load)(vote + j * stride + x));
            for (int c = 0; c < 3; c++)
                result[c] = AGREE_BITS(or)(AGREE_BITS(and)(more, a[c]), AGREE_BITS(andnot)(more, result[c]));
        }
        for (int c = 0; c < 3; c++)
            memcpy(mode[c] + x, &result[c], sizeof(result[c]));
    }
}
#undef AGREE_OP
#undef AGREE_BITS
#undef AGREE_PAIRS
#elif defined(__aarch64__)
#include "pipeline/kernels/arm/agree_mode_tmpl.h"
#else
/* Pixels in blocks whose sums stay in registers. */
#define AGREE_BLOCK 64
/* Votes for ray a's colour in one block. */
static inline void KERNEL(agree_count)(uint16_t *restrict votes, const uint8_t *restrict a,
                                       const uint8_t *restrict colour, const uint8_t *restrict vote, size_t rays,
                                       size_t stride)
{
    const uint8_t *restrict a1 = a + stride, *restrict a2 = a + 2 * stride;

    memset(votes, 0, AGREE_BLOCK * sizeof(*votes));
    for (size_t k = 0; k < rays; k++) {
        const uint8_t *restrict b = colour + k * 3 * stride, *restrict b1 = b + stride, *restrict b2 = b1 + stride;
        const uint8_t *restrict w = vote + k * stride;

        for (int i = 0; i < AGREE_BLOCK; i++) {
            const uint8_t like = (uint8_t)(BYTE_LIKENESS(SST_AGREE_MODE, a[i], a1[i], a2[i], b[i], b1[i], b2[i])) >> 1;

            votes[i] = (uint16_t)(votes[i] + (uint16_t)((uint16_t)like * (uint16_t)w[i]));
        }
    }
}

static void KERNEL(agree_mode)(uint8_t *const mode[3], const uint8_t *colour, const uint8_t *vote, size_t rays,
                               size_t step, size_t stride)
{
    for (size_t x = 0; x < stride; x += AGREE_BLOCK) {
        uint8_t *restrict r = mode[0] + x, *restrict g = mode[1] + x, *restrict b = mode[2] + x;
        uint16_t best[AGREE_BLOCK] = { 0 }, votes[AGREE_BLOCK];

        memset(r, 0, AGREE_BLOCK);
        memset(g, 0, AGREE_BLOCK);
        memset(b, 0, AGREE_BLOCK);
        for (size_t j = 0; j < rays; j += step) {
            const uint8_t *restrict a = colour + j * 3 * stride + x, *restrict there = vote + j * stride + x;

            KERNEL(agree_count)(votes, a, colour + x, vote + x, rays, stride);
            for (int i = 0; i < AGREE_BLOCK; i++) {
                const uint16_t v = (uint16_t)(there[i] ? votes[i] : 0);
                const int more = v > best[i];

                best[i] = more ? v : best[i];
                r[i] = more ? a[i] : r[i];
                g[i] = more ? a[stride + (size_t)i] : g[i];
                b[i] = more ? a[2 * stride + (size_t)i] : b[i];
            }
        }
    }
}
#endif

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
#undef AGREE_BLOCK
