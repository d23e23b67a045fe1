/* hypothesis_cost with NEON: eight views at once but for their windows, which lie anywhere. With dot products the mask
 * of a window is a factor 0 or 1 of the sum. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define HYPOTHESIS_PARTS (SST_HYPOTHESIS_VIEWS / 8)
_Static_assert(HYPOTHESIS_PARTS == 3, "costs of a part are sorted as three");

/* The 3x3 pixels around one, four in a row: the masked channels, and the masks of similar pixels. */
struct KERNEL(hypothesis_window) {
    uint8x16_t mask[3], pixels[3]; /* masks: 255, with dot products 1 */
    unsigned scale;                /* 2^19 / number of similar pixels */
};

static inline void KERNEL(hypothesis_window_init)(struct KERNEL(hypothesis_window) * w, const uint32_t *at,
                                                  ptrdiff_t stride, int similar)
{
    static const uint32_t three[4] = { 0xFFFFFF, 0xFFFFFF, 0xFFFFFF, 0 };
    const uint8x16_t middle = vreinterpretq_u8_u32(vdupq_n_u32(*at));
    const uint8x16_t most = vdupq_n_u8((uint8_t)(similar < 255 ? similar : 255));
    uint32x4_t count = vdupq_n_u32(0);

    for (int row = 0; row < 3; row++) {
        const uint8x16_t here = vld1q_u8((const uint8_t *)(at + (row - 1) * stride - 1));
        const uint32x4_t same = vreinterpretq_u32_u8(vcleq_u8(vabdq_u8(here, middle), most));
        const uint32x4_t all = vceqq_u32(vorrq_u32(same, vdupq_n_u32(0xFF000000)), vdupq_n_u32(0xFFFFFFFF));
        const uint32x4_t mask = vandq_u32(all, vld1q_u32(three));

        count = vsraq_n_u32(count, mask, 23);
        w->pixels[row] = vandq_u8(here, vreinterpretq_u8_u32(mask));
#if defined(__ARM_FEATURE_DOTPROD)
        w->mask[row] = vshrq_n_u8(vreinterpretq_u8_u32(mask), 7);
#else
        w->mask[row] = vreinterpretq_u8_u32(mask);
#endif
    }
    w->scale = 65536 * 8 / vaddvq_u32(count);
}

struct KERNEL(hypothesis_views) {
    struct {
        const uint8_t *pixels;
        ptrdiff_t stride; /* bytes */
    } view[SST_HYPOTHESIS_VIEWS]; /* unused ones are the own view, of width 0 */
    int32_t x[SST_HYPOTHESIS_VIEWS], y[SST_HYPOTHESIS_VIEWS], dx[SST_HYPOTHESIS_VIEWS], dy[SST_HYPOTHESIS_VIEWS];
    int32_t stride[SST_HYPOTHESIS_VIEWS]; /* pixels */
    uint32_t width[SST_HYPOTHESIS_VIEWS];
    uint32_t height;
};

static inline void KERNEL(hypothesis_views_init)(struct KERNEL(hypothesis_views) * v, const struct sst_hypothesis_test *t)
{
    for (int k = 0; k < SST_HYPOTHESIS_VIEWS; k++) {
        const struct sst_packed_view *view = k < t->views ? &t->view[k] : &t->own;

        v->view[k].pixels = (const uint8_t *)view->pixels;
        v->view[k].stride = 4 * view->stride;
        v->stride[k] = (int32_t)view->stride;
        v->width[k] = k < t->views ? (uint32_t)t->width : 0;
    }
    memcpy(v->x, t->x, sizeof(v->x));
    memcpy(v->y, t->y, sizeof(v->y));
    memcpy(v->dx, t->dx, sizeof(v->dx));
    memcpy(v->dy, t->dy, sizeof(v->dy));
    v->height = (uint32_t)t->height;
}

/* Offsets of the pixel in four views; 0 outside. inside: out, where it lies in the picture. */
static inline int32x4_t KERNEL(hypothesis_place)(uint32x4_t *inside, const struct KERNEL(hypothesis_views) * v, int k,
                                                 int x, int y, int d)
{
    const int32x4_t moved_x = vmlaq_n_s32(vld1q_s32(v->x + k), vld1q_s32(v->dx + k), d);
    const int32x4_t moved_y = vmlaq_n_s32(vld1q_s32(v->y + k), vld1q_s32(v->dy + k), d);
    const int32x4_t at_x = vsraq_n_s32(vdupq_n_s32(x), moved_x, 16), at_y = vsraq_n_s32(vdupq_n_s32(y), moved_y, 16);

    *inside = vandq_u32(vcltq_u32(vreinterpretq_u32_s32(at_x), vld1q_u32(v->width + k)),
                        vcltq_u32(vreinterpretq_u32_s32(at_y), vdupq_n_u32(v->height)));
    return vandq_s32(vmlaq_s32(at_x, at_y, vld1q_s32(v->stride + k)), vreinterpretq_s32_u32(*inside));
}

/* Sum of differences to the window at a pixel, in four parts; *middle: its row. */
static inline uint32x4_t KERNEL(hypothesis_at)(const struct KERNEL(hypothesis_window) * w, const uint8_t *at,
                                               ptrdiff_t stride, uint32x4_t *middle)
{
    const uint8x16_t top = vld1q_u8(at - stride - 4), here = vld1q_u8(at - 4), bottom = vld1q_u8(at + stride - 4);
#if defined(__ARM_FEATURE_DOTPROD)
    uint32x4_t sum = vdotq_u32(vdupq_n_u32(0), vabdq_u8(top, w->pixels[0]), w->mask[0]);

    sum = vdotq_u32(sum, vabdq_u8(here, w->pixels[1]), w->mask[1]);
    sum = vdotq_u32(sum, vabdq_u8(bottom, w->pixels[2]), w->mask[2]);
#else
    uint16x8_t pairs = vpaddlq_u8(vabdq_u8(vandq_u8(top, w->mask[0]), w->pixels[0]));
    uint32x4_t sum;

    pairs = vpadalq_u8(pairs, vabdq_u8(vandq_u8(here, w->mask[1]), w->pixels[1]));
    sum = vreinterpretq_u32_u16(vpadalq_u8(pairs, vabdq_u8(vandq_u8(bottom, w->mask[2]), w->pixels[2])));
#endif
    *middle = vreinterpretq_u32_u8(here);
    return sum;
}

/* Differences to the windows at the pixel in four views. pixel: out, the pixels. */
static inline uint32x4_t KERNEL(hypothesis_differences)(const struct KERNEL(hypothesis_views) * v,
                                                        const struct KERNEL(hypothesis_window) * w, int k,
                                                        int32x4_t offset, uint32x4_t *pixel)
{
    uint32x4_t sum[4], middle[4];

#define HYPOTHESIS_AT(i)                                                                                               \
    sum[i] = KERNEL(hypothesis_at)(w, v->view[k + (i)].pixels + 4 * (ptrdiff_t)vgetq_lane_s32(offset, i),               \
                                   v->view[k + (i)].stride, &middle[i])
    HYPOTHESIS_AT(0);
    HYPOTHESIS_AT(1);
    HYPOTHESIS_AT(2);
    HYPOTHESIS_AT(3);
#undef HYPOTHESIS_AT
    *pixel = vcopyq_laneq_u32(vcopyq_laneq_u32(vtrn2q_u32(middle[0], middle[1]), 2, middle[2], 1), 3, middle[3], 1);
#if defined(__ARM_FEATURE_DOTPROD)
    return vpaddq_u32(vpaddq_u32(sum[0], sum[1]), vpaddq_u32(sum[2], sum[3]));
#else
    return vpaddlq_u16(vpaddq_u16(vpaddq_u16(vreinterpretq_u16_u32(sum[0]), vreinterpretq_u16_u32(sum[1])),
                                  vpaddq_u16(vreinterpretq_u16_u32(sum[2]), vreinterpretq_u16_u32(sum[3]))));
#endif
}

/* Of two ascending columns of four the four least values: a bitonic column. */
#define HYPOTHESIS_MERGE(v, lanes)                                                                                     \
    do {                                                                                                               \
        const uint16x8_t merged[4] = { vminq_u16(v[0], vextq_u16(v[3], v[3], lanes)),                                  \
                                       vminq_u16(v[1], vextq_u16(v[2], v[2], lanes)),                                  \
                                       vminq_u16(v[2], vextq_u16(v[1], v[1], lanes)),                                  \
                                       vminq_u16(v[3], vextq_u16(v[0], v[0], lanes)) };                                \
        v[0] = merged[0], v[1] = merged[1], v[2] = merged[2], v[3] = merged[3];                                        \
    } while (0)

/* ... which this makes ascending. */
static inline void KERNEL(hypothesis_ascend)(uint16x8_t v[4])
{
    const uint16x8_t a = vminq_u16(v[0], v[2]), b = vminq_u16(v[1], v[3]), c = vmaxq_u16(v[0], v[2]),
                     d = vmaxq_u16(v[1], v[3]);

    v[0] = vminq_u16(a, b);
    v[1] = vmaxq_u16(a, b);
    v[2] = vminq_u16(c, d);
    v[3] = vmaxq_u16(c, d);
}

/* Sum of the four least of 24 values. *least: the first of them. Columns of three are sorted and merged, those of the
 * upper four lanes with the lower ones first. */
static inline unsigned KERNEL(hypothesis_best)(const uint16x8_t c[HYPOTHESIS_PARTS], unsigned *least)
{
    const uint16x8_t lower = vminq_u16(c[0], c[1]), upper = vmaxq_u16(c[0], c[1]);
    const uint16x8_t top = vminq_u16(lower, c[2]), rest = vmaxq_u16(lower, c[2]);
    const uint16x8_t middle = vminq_u16(upper, rest), last = vmaxq_u16(upper, rest);
    uint16x8_t v[4] = { top, vminq_u16(middle, vextq_u16(last, last, 4)), vminq_u16(last, vextq_u16(middle, middle, 4)),
                        vextq_u16(top, top, 4) };

    KERNEL(hypothesis_ascend)(v);
    HYPOTHESIS_MERGE(v, 2);
    KERNEL(hypothesis_ascend)(v);
    HYPOTHESIS_MERGE(v, 1);
    *least = vgetq_lane_u16(vminq_u16(vminq_u16(v[0], v[1]), vminq_u16(v[2], v[3])), 0);
    return vgetq_lane_u16(vaddq_u16(vaddq_u16(v[0], v[1]), vaddq_u16(v[2], v[3])), 0);
}

static inline unsigned KERNEL(hypothesis_cost)(const struct KERNEL(hypothesis_views) * v,
                                               const struct KERNEL(hypothesis_window) * w, int x, int y, int d,
                                               unsigned hides)
{
    const uint16x8_t limit = vdupq_n_u16(SST_HYPOTHESIS_LIMIT), outside = vdupq_n_u16(SST_DEPTH_OUTSIDE);
    const uint16x8_t nearest = vdupq_n_u16((uint16_t)hides);
    uint16x8_t costs[HYPOTHESIS_PARTS], sum = vdupq_n_u16(0), seen = sum, visible = sum;
    unsigned best, least, seen_count;

    for (int i = 0; i < HYPOTHESIS_PARTS; i++) {
        uint32x4_t inside[2], pixel[2], difference[2];
        uint16x8_t cost, code, there, open;

        for (int half = 0; half < 2; half++) {
            const int k = 8 * i + 4 * half;
            const int32x4_t offset = KERNEL(hypothesis_place)(&inside[half], v, k, x, y, d);

            difference[half] = KERNEL(hypothesis_differences)(v, w, k, offset, &pixel[half]);
            difference[half] = vmulq_n_u32(difference[half], w->scale);
        }
        cost = vminq_u16(vuzp2q_u16(vreinterpretq_u16_u32(difference[0]), vreinterpretq_u16_u32(difference[1])), limit);
        code = vshrq_n_u16(vuzp2q_u16(vreinterpretq_u16_u32(pixel[0]), vreinterpretq_u16_u32(pixel[1])), 8);
        there = vuzp1q_u16(vreinterpretq_u16_u32(inside[0]), vreinterpretq_u16_u32(inside[1]));
        there = vbicq_u16(there, vceqq_u16(code, outside));
        open = vandq_u16(there, vcleq_u16(code, nearest));
        sum = vaddq_u16(sum, vandq_u16(cost, open));
        seen = vsubq_u16(seen, there);
        visible = vsubq_u16(visible, open);
        costs[i] = vornq_u16(cost, there);
    }
    best = KERNEL(hypothesis_best)(costs, &least);
    seen_count = vaddvq_u16(seen);
    if (seen_count < SST_HYPOTHESIS_BEST)
        return seen_count ? least : SST_HYPOTHESIS_LIMIT;
    return (vaddvq_u16(sum) + best) / (vaddvq_u16(visible) + SST_HYPOTHESIS_BEST);
}
#undef HYPOTHESIS_MERGE
#undef HYPOTHESIS_PARTS
