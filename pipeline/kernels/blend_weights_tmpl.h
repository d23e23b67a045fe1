/* Weights of blocks of rays, for blend_block_tmpl.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
/* W_s of a block with an irregular label or unknown disparities, one by one. */
static __attribute__((noinline)) struct KERNEL(blend_weights)
    KERNEL(blend_label_table)(const struct sst_blend *b, size_t x)
{
    struct KERNEL(blend_weights) w;
    float each[BLEND_BLOCK];

    for (size_t i = 0; i < BLEND_BLOCK; i++)
        each[i] = b->by->range[b->label[x + i]].weight[b->disp[x + i] >> SST_BLEND_COLUMN_SHIFT];
    for (int half = 0; half < 2; half++)
        w.half[half] = simd_load_f32(each + half * BLEND_HALF);
    return w;
}

/* Put the W_s of the pixels `of` a block that have a label into w. */
static inline void KERNEL(blend_one_label)(struct KERNEL(blend_weights) * w, const struct sst_blend *b,
                                           const struct sst_blend_range *r, KERNEL(blend_where) of, size_t x)
{
    for (int i = 0; i < r->ranges; i++) {
        const KERNEL(blend_where) within = of & KERNEL(blend_within)(b->disp + x, r->first[i], r->count[i]);

        for (int half = 0; half < 2; half++)
            w->half[half] = KERNEL(blend_select)(within, half, simd_set_f32(r->inside[i]), w->half[half]);
    }
}

/* W_s of a block, one label after the other: foliage changes so often that a branch for blocks of one label costs
 * more. */
static inline __attribute__((always_inline)) struct KERNEL(blend_weights)
    KERNEL(blend_some_labels)(const struct sst_blend *b, size_t x)
{
    struct KERNEL(blend_weights) w = { { { 0 } } };

    for (uint32_t left = BLEND_ALL; left;) {
        const uint8_t label = b->label[x + (size_t)__builtin_ctz(left) / BLEND_BITS];
        const struct sst_blend_range *r = &b->by->range[label];
        const KERNEL(blend_where) of = KERNEL(blend_labelled)(b->label + x, label);

        if (r->ranges > SST_BLEND_RANGES)
            return KERNEL(blend_label_table)(b, x);
        for (int half = 0; half < 2; half++)
            w.half[half] = KERNEL(blend_select)(of, half, simd_set_f32(r->outside), w.half[half]);
        KERNEL(blend_one_label)(&w, b, r, of, x);
        left &= ~KERNEL(blend_bits)(of);
    }
    return w;
}

/* W_s of a block with unknown disparities or labels without an index. */
static inline struct KERNEL(blend_weights) KERNEL(blend_block_labels)(const struct sst_blend *b, size_t x)
{
    if (KERNEL(blend_bits)(KERNEL(blend_within)(b->disp + x, SST_BLEND_UNKNOWN, 16)))
        return KERNEL(blend_label_table)(b, x);
    return KERNEL(blend_some_labels)(b, x);
}

/* Constants of a run of rays: as vectors in memory, for there are more than registers. */
struct KERNEL(blend_run) {
    const struct sst_blend *b;
    simd_f32 scale, floor, ones; /* scale: with the aperture; ones: times scale */
    simd_u16 unknown, first, last, times, focus, slope, power[3], bias;
    __m256i index;                 /* of ones, by label */
    bool few;                      /* ones are four at most */
    __m128i to_fraction, to_whole; /* shifts of exponents */
};

/* Copies of the pointers and taps of a run, which stores to rows cannot change. */
struct KERNEL(blend_rows) {
    const uint8_t *top[3], *bottom[3];
    struct KERNEL(blend_taps) taps;
    const uint16_t *disp;
    const uint8_t *label;
    bool by_depth;
};

static inline struct KERNEL(blend_rows) KERNEL(blend_set_rows)(const struct sst_blend *b)
{
    return (struct KERNEL(blend_rows)){ .top = { b->top[0], b->top[1], b->top[2] },
                                        .bottom = { b->bottom[0], b->bottom[1], b->bottom[2] },
                                        .taps = KERNEL(blend_set_taps)(b),
                                        .disp = b->disp,
                                        .label = b->label,
                                        .by_depth = b->near.bits != 0 };
}

static inline void KERNEL(blend_set_run)(struct KERNEL(blend_run) * r, const struct sst_blend *b)
{
    const struct sst_blend_near *n = &b->near;

    r->b = b;
    r->scale = simd_set_f32(b->disp ? b->aperture * n->scale : b->aperture);
    r->floor = simd_set_f32(n->floor);
    if (b->label) {
        r->few = b->by->ones <= 4;
        r->ones = r->scale * KERNEL(blend_load_ones)(b->by->one, r->few);
        r->index = _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)(const void *)b->by->index));
    }
    r->unknown = simd_set_u16(SST_BLEND_UNKNOWN);
    r->first = simd_set_u16(n->first);
    r->last = simd_set_u16(n->last);
    r->times = simd_set_u16(n->times);
    r->focus = simd_set_u16(n->focus);
    r->slope = simd_set_u16(n->slope);
    r->power[0] = simd_set_u16(SST_BLEND_POWER_1);
    r->power[1] = simd_set_u16(SST_BLEND_POWER_2);
    r->power[2] = simd_set_u16(SST_BLEND_POWER_3);
    r->bias = simd_set_u16((uint16_t)(127 - (1 << (16 - n->bits))));
    r->to_fraction = _mm_cvtsi32_si128(16 - n->bits);
    r->to_whole = _mm_cvtsi32_si128(n->bits);
}

/* W_d over `scale` of a block: sst_blend_near(). */
static inline struct KERNEL(blend_weights)
    KERNEL(blend_block_near)(const struct KERNEL(blend_run) * r, simd_u16 disp, simd_u16 known)
{
    const simd_u16 from_focus = simd_min_u16(simd_max_u16(disp, r->first), r->last) * r->times - r->focus;
    const simd_u16 off = (simd_u16)SIMD_OP(abs_epi16)((SIMD_INT)from_focus);
    const simd_u16 y = simd_high_u16(off + off, r->slope), e = ~simd_high_u16(y, y);
    const simd_u16 g = (simd_u16)SIMD_OP(sll_epi16)((SIMD_INT)e, r->to_fraction);
    const simd_u16 h = simd_high_u16(simd_high_u16(g, r->power[2]) + r->power[1], g) + r->power[0];
    const SIMD_INT mantissa = (SIMD_INT)(simd_high_u16(h, g) & known);
    const SIMD_INT exponent = (SIMD_INT)(((simd_u16)SIMD_OP(srl_epi16)((SIMD_INT)e, r->to_whole) + r->bias) & known);
    struct KERNEL(blend_weights) w;

    w.half[0] = (simd_f32)((simd_u32)SIMD_OP(unpacklo_epi16)(mantissa, exponent) << 7) + r->floor;
    w.half[1] = (simd_f32)((simd_u32)SIMD_OP(unpackhi_epi16)(mantissa, exponent) << 7) + r->floor;
    return w;
}

/* A W_s W_d of a block with unknown disparities or labels without an index. */
static __attribute__((noinline)) struct KERNEL(blend_weights)
    KERNEL(blend_irregular_weights)(const struct KERNEL(blend_run) * r, size_t x)
{
    const simd_u16 disp = KERNEL(blend_disp)(r->b->disp + x);
    const simd_u16 known = (simd_u16)(simd_max_u16(disp, r->unknown) != disp);
    struct KERNEL(blend_weights) w = { { r->scale, r->scale } }, near;

    if (r->b->label) {
        w = KERNEL(blend_block_labels)(r->b, x);
        for (int half = 0; half < 2; half++)
            w.half[half] = r->scale * w.half[half];
    }
    if (!r->b->near.bits)
        return w;
    near = KERNEL(blend_block_near)(r, disp, known);
    for (int half = 0; half < 2; half++)
        w.half[half] *= near.half[half];
    return w;
}

/* All bits of the labels and indices of some blocks, and their largest disparities. */
struct KERNEL(blend_odd) {
    simd_u16 largest;
    __m256i labels, indices;
};

/* Indices of the weights of a block's labels. */
static inline __m256i KERNEL(blend_indices)(const struct KERNEL(blend_run) * r, const uint8_t *label,
                                            struct KERNEL(blend_odd) * odd)
{
    const __m256i v = KERNEL(blend_load_labels)(label), indices = _mm256_shuffle_epi8(r->index, v);

    odd->labels = _mm256_or_si256(odd->labels, v);
    odd->indices = _mm256_or_si256(odd->indices, indices);
    return indices;
}

/* Whether any label has ranges. */
static inline bool KERNEL(blend_has_ranges)(const struct KERNEL(blend_odd) * odd)
{
    return !_mm256_testz_si256(odd->indices, _mm256_set1_epi8(SST_BLEND_RANGED));
}

/* Whether there are unknown disparities, or labels without an index. */
static inline bool KERNEL(blend_irregular)(const struct KERNEL(blend_odd) * odd)
{
    const simd_u16 unknown = simd_less_u16(odd->largest, simd_set_u16(SST_BLEND_UNKNOWN - 1));

    return simd_any_u32((simd_u32)unknown) || !_mm256_testz_si256(odd->labels, _mm256_set1_epi8((char)0xF0)) ||
           !_mm256_testz_si256(odd->indices, _mm256_set1_epi8((char)SST_BLEND_MANY));
}

/* Put the weights of a block's labels with ranges in place of those outside. */
static inline void KERNEL(blend_ranged)(struct KERNEL(blend_weights) * w, const struct KERNEL(blend_run) * r, size_t x)
{
    const struct sst_blend *b = r->b;

    for (int k = 0; k < b->by->ranged; k++) {
        const struct sst_blend_range *range = &b->by->range[b->by->label_ranged[k]];
        const KERNEL(blend_where) of = KERNEL(blend_labelled)(b->label + x, b->by->label_ranged[k]);

        for (int i = 0; i < range->ranges; i++) {
            const KERNEL(blend_where) within = of & KERNEL(blend_within)(b->disp + x, range->first[i], range->count[i]);

            for (int half = 0; half < 2; half++)
                w->half[half] = KERNEL(blend_quick_select)(within, half, r->scale * range->inside[i], w->half[half]);
        }
    }
}

/* A W_s W_d of a block of known disparities and labels with an index, in the order of blend_quick_disp(); with ranges
 * if `ranged`. */
static inline __attribute__((always_inline)) struct KERNEL(blend_weights)
    KERNEL(blend_block_weights)(const struct KERNEL(blend_run) * r, const struct KERNEL(blend_rows) * b, size_t x,
                                bool ranged, struct KERNEL(blend_odd) * odd)
{
    const simd_u16 disp = KERNEL(blend_quick_disp)(b->disp + x);
    struct KERNEL(blend_weights) w = { { r->scale, r->scale } };

    odd->largest = simd_max_u16(odd->largest, disp);
    if (b->label) {
        const __m256i indices = KERNEL(blend_indices)(r, b->label + x, odd);

        for (int half = 0; half < 2; half++)
            w.half[half] = KERNEL(blend_ones)(r->ones, indices, half, r->few);
        if (ranged)
            KERNEL(blend_ranged)(&w, r, x);
    }
    if (b->by_depth) {
        const struct KERNEL(blend_weights) near = KERNEL(blend_block_near)(r, disp, ~(simd_u16){ 0 });

        for (int half = 0; half < 2; half++)
            w.half[half] *= near.half[half];
    }
    return w;
}

/* No bits for the first `done` pixels, all for the others. */
static inline simd_s32 KERNEL(blend_undone)(size_t done, int half)
{
    const simd_s32 lane = SIMD_LANES;

    return (simd_s32)(lane + half * BLEND_HALF >= (int32_t)done);
}

/* Weigh the irregular blocks among n pixels from x on of a run again. */
static __attribute__((noinline)) void KERNEL(blend_weights_again)(float *w, const struct KERNEL(blend_run) * r,
                                                                  size_t x, size_t n)
{
    for (size_t i = 0; i < n; i += BLEND_BLOCK) {
        const size_t at = i + BLEND_BLOCK <= n ? i : n - BLEND_BLOCK;
        struct KERNEL(blend_odd) odd = { 0 };
        struct KERNEL(blend_weights) of;

        odd.largest = simd_load_u16(r->b->disp + x + at);
        if (r->b->label)
            KERNEL(blend_indices)(r, r->b->label + x + at, &odd);
        if (!KERNEL(blend_irregular)(&odd))
            continue;
        of = KERNEL(blend_irregular_weights)(r, x + at);
        simd_store_f32(w + at, of.half[0]);
        simd_store_f32(w + at + BLEND_HALF, of.half[1]);
    }
}

/* Read the line of x ahead, in the rows of the maps below. */
static inline void KERNEL(blend_read_maps_ahead)(const struct sst_blend *b, size_t x)
{
    KERNEL(blend_read_ahead)(b->disp + x, b->disp_below);
    KERNEL(blend_read_ahead)(b->disp + x + BLEND_LINE / 2, b->disp_below);
    if (b->label)
        KERNEL(blend_read_ahead)(b->label + x, b->label_below);
}

/* A W_s W_d of n pixels from x on, n at least BLEND_BLOCK, but for irregular blocks. */
static inline __attribute__((always_inline)) struct KERNEL(blend_odd)
    KERNEL(blend_weights_line)(float *w, const struct KERNEL(blend_run) * r, const struct KERNEL(blend_rows) * rows,
                               size_t x, size_t n, bool ranged)
{
    struct KERNEL(blend_odd) odd = { 0 };

    for (size_t i = 0; i < n; i += BLEND_BLOCK) {
        const size_t at = i + BLEND_BLOCK <= n ? i : n - BLEND_BLOCK;
        const struct KERNEL(blend_weights) of = KERNEL(blend_block_weights)(r, rows, x + at, ranged, &odd);

        KERNEL(blend_quick_store)(w + at, of.half);
    }
    return odd;
}

/* A W_s W_d of the pixels from .. from + n of a run, n at least BLEND_BLOCK: lines of BLEND_LINE, with ranges of labels
 * where there are any, which is expected where the line before has them. Not inlined: constants would be made again for
 * each block. */
static __attribute__((noinline)) void KERNEL(blend_weights_run)(float *w, const struct KERNEL(blend_run) * run,
                                                                size_t from, size_t n)
{
    const struct KERNEL(blend_run) r = *run;
    const struct KERNEL(blend_rows) rows = KERNEL(blend_set_rows)(r.b);
    bool ranged = false;

    for (size_t x = 0; x < n && !rows.disp; x++)
        w[x] = r.scale[0];
    for (size_t x = 0, part; x < n && rows.disp;) {
        struct KERNEL(blend_odd) odd;
        const bool expected = ranged;

        part = n - x < BLEND_LINE + BLEND_BLOCK ? n - x : BLEND_LINE;
        KERNEL(blend_read_maps_ahead)(r.b, from + x);
        if (expected)
            odd = KERNEL(blend_weights_line)(w + x, &r, &rows, from + x, part, true);
        else
            odd = KERNEL(blend_weights_line)(w + x, &r, &rows, from + x, part, false);
        ranged = KERNEL(blend_has_ranges)(&odd);
        if (ranged && !expected)
            continue; /* once more */
        if (__builtin_expect(KERNEL(blend_irregular)(&odd), 0))
            KERNEL(blend_weights_again)(w + x, run, from + x, part);
        x += part;
    }
}
