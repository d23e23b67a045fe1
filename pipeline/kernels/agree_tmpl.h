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

/* Pixels in blocks whose sums stay in registers. */
#define AGREE_BLOCK 64
_Static_assert(3 * SST_AGREE_MODE < 256 && 3 * SST_AGREE_NEAR < 256, "sums of three cut differences are bytes");

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
