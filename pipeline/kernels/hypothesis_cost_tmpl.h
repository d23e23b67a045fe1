/* hypothesis_cost_row. Positions are arbitrary, so the work is vectorised inside each window: three rows of four
 * pixels, of which a mask selects the similar ones. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__aarch64__)
#include "pipeline/kernels/arm/hypothesis_cost_tmpl.h"
#elif defined(__SSE2__)
#include <emmintrin.h>

struct KERNEL(hypothesis_window) {
    uint8_t mask[3][16];   /* 255 in the three channels of similar pixels */
    uint8_t pixels[3][16]; /* masked */
    unsigned scale;        /* 2^19 / number of similar pixels */
};

static const uint32_t KERNEL(hypothesis_scales)[10] = { 0,      524288, 262144, 174762, 131072,
                                                        104857, 87381,  74898,  65536,  58254 };

static inline void KERNEL(hypothesis_window_init)(struct KERNEL(hypothesis_window) * w, const uint32_t *at,
                                                  ptrdiff_t stride, int similar)
{
    const __m128i colour = _mm_setr_epi32(0xFFFFFF, 0xFFFFFF, 0xFFFFFF, 0), middle = _mm_set1_epi32((int)at[0]);
    const __m128i most = _mm_set1_epi8((char)similar);
    unsigned count = 0;

    for (int row = 0; row < 3; row++) {
        const __m128i p = _mm_loadu_si128((const __m128i *)(const void *)(at + (row - 1) * stride - 1));
        const __m128i off = _mm_or_si128(_mm_subs_epu8(p, middle), _mm_subs_epu8(middle, p));
        const __m128i beyond = _mm_and_si128(_mm_subs_epu8(off, most), _mm_set1_epi32(0xFFFFFF));
        const __m128i mask = _mm_and_si128(_mm_cmpeq_epi32(beyond, _mm_setzero_si128()), colour);

        count += (unsigned)__builtin_popcount((unsigned)_mm_movemask_epi8(mask));
        _mm_storeu_si128((__m128i *)(void *)w->mask[row], mask);
        _mm_storeu_si128((__m128i *)(void *)w->pixels[row], _mm_and_si128(p, mask));
    }
    w->scale = KERNEL(hypothesis_scales)[count / 3];
}

static inline unsigned KERNEL(hypothesis_difference)(const struct KERNEL(hypothesis_window) * w, const uint32_t *at,
                                                     ptrdiff_t stride)
{
    __m128i sum = _mm_setzero_si128();

    for (int row = 0; row < 3; row++) {
        const __m128i there = _mm_loadu_si128((const __m128i *)(const void *)(at + (row - 1) * stride - 1));
        const __m128i mask = _mm_loadu_si128((const __m128i *)(const void *)w->mask[row]);

        sum = _mm_add_epi32(sum, _mm_sad_epu8(_mm_and_si128(there, mask),
                                              _mm_loadu_si128((const __m128i *)(const void *)w->pixels[row])));
    }
    return (unsigned)_mm_cvtsi128_si32(_mm_add_epi32(sum, _mm_unpackhi_epi64(sum, sum)));
}

#if defined(__AVX2__)
#define HYPOTHESIS_AHEAD 3 /* one pixel in four fetches ahead: a line of the cache holds sixteen */

/* All views at once but for their windows, which lie anywhere. */
#define HYPOTHESIS_PARTS (SST_HYPOTHESIS_VIEWS / 8)
_Static_assert(HYPOTHESIS_PARTS == 3, "costs of a part are sorted as three");

struct KERNEL(hypothesis_views) {
    const uint32_t *pixels[SST_HYPOTHESIS_VIEWS]; /* unused ones are the own view's */
    __m256i x[HYPOTHESIS_PARTS], y[HYPOTHESIS_PARTS], dx[HYPOTHESIS_PARTS], dy[HYPOTHESIS_PARTS];
    __m256i used[HYPOTHESIS_PARTS], right, bottom; /* last column and row */
    ptrdiff_t stride;
    int parts, halves; /* with views */
};

static inline __m256i KERNEL(hypothesis_load)(const int32_t *from)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)from);
}

static inline void KERNEL(hypothesis_views_init)(struct KERNEL(hypothesis_views) * v,
                                                 const struct sst_hypothesis_test *t)
{
    int32_t used[SST_HYPOTHESIS_VIEWS];

    for (int k = 0; k < SST_HYPOTHESIS_VIEWS; k++) {
        v->pixels[k] = k < t->views ? t->view[k].pixels : t->own.pixels;
        used[k] = k < t->views ? -1 : 0;
    }
    v->stride = t->own.stride;
    v->parts = (t->views + 7) / 8;
    v->halves = (t->views + 3) / 4;
    for (int i = 0; i < HYPOTHESIS_PARTS; i++) {
        v->x[i] = KERNEL(hypothesis_load)(t->x + 8 * i);
        v->y[i] = KERNEL(hypothesis_load)(t->y + 8 * i);
        v->dx[i] = KERNEL(hypothesis_load)(t->dx + 8 * i);
        v->dy[i] = KERNEL(hypothesis_load)(t->dy + 8 * i);
        v->used[i] = KERNEL(hypothesis_load)(used + 8 * i);
    }
    v->right = _mm256_set1_epi32(t->width - 1);
    v->bottom = _mm256_set1_epi32(t->height - 1);
}

/* (start + d step) >> 16 */
static inline __m256i KERNEL(hypothesis_moved)(__m256i start, __m256i step, __m256i d)
{
    return _mm256_srai_epi32(_mm256_add_epi32(start, _mm256_mullo_epi32(d, step)), 16);
}

/* 0 <= v <= most */
static inline __m256i KERNEL(hypothesis_within)(__m256i v, __m256i most)
{
    return _mm256_cmpeq_epi32(_mm256_min_epu32(v, most), v);
}

/* Offsets of the pixels in their views; 0 outside. inside: out, where they lie in the picture. */
static inline void KERNEL(hypothesis_place)(int32_t *offset, __m256i inside[HYPOTHESIS_PARTS],
                                            const struct KERNEL(hypothesis_views) * v, int x, int y, int d)
{
    const __m256i disp = _mm256_set1_epi32(d), own_x = _mm256_set1_epi32(x), own_y = _mm256_set1_epi32(y);
    const __m256i stride = _mm256_set1_epi32((int)v->stride);

    for (int i = 0; i < v->parts; i++) {
        const __m256i at_x = _mm256_add_epi32(own_x, KERNEL(hypothesis_moved)(v->x[i], v->dx[i], disp));
        const __m256i at_y = _mm256_add_epi32(own_y, KERNEL(hypothesis_moved)(v->y[i], v->dy[i], disp));
        const __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(at_y, stride), at_x);

        inside[i] = _mm256_and_si256(v->used[i], _mm256_and_si256(KERNEL(hypothesis_within)(at_x, v->right),
                                                                  KERNEL(hypothesis_within)(at_y, v->bottom)));
        _mm256_storeu_si256((__m256i *)(void *)(offset + 8 * i), _mm256_and_si256(at, inside[i]));
    }
}

static inline __m128i KERNEL(hypothesis_row)(const uint8_t *mask, const uint8_t *pixels, __m128i there)
{
    return _mm_sad_epu8(_mm_and_si128(there, _mm_loadu_si128((const __m128i *)(const void *)mask)),
                        _mm_loadu_si128((const __m128i *)(const void *)pixels));
}

/* Differences of four views, their pixels in *pixels. Colours add up to less than 2^16, so that sums of rows lie in the
 * lower half of each 64 bits. `ahead`: fetch the row below the window into the cache, which the next row's windows
 * need: 24 views and a few surfaces are more streams than the processor foresees. */
static inline __m128i KERNEL(hypothesis_four)(const struct KERNEL(hypothesis_views) * v,
                                              const struct KERNEL(hypothesis_window) * w, const int32_t *offset, int k,
                                              bool ahead, __m128i *pixels)
{
    __m128i middle[4], sum[4], low, high;

    for (int i = 0; i < 4; i++) {
        const uint32_t *at = v->pixels[k + i] + offset[k + i] - 1;

        if (ahead)
            __builtin_prefetch(at + 2 * v->stride);
        middle[i] = _mm_loadu_si128((const __m128i *)(const void *)at);
        sum[i] = KERNEL(hypothesis_row)(w->mask[1], w->pixels[1], middle[i]);
        for (int row = 0; row < 3; row += 2)
            sum[i] = _mm_add_epi32(
                sum[i],
                KERNEL(hypothesis_row)(w->mask[row], w->pixels[row],
                                       _mm_loadu_si128((const __m128i *)(const void *)(at + (row - 1) * v->stride))));
    }
    *pixels = _mm_unpackhi_epi64(_mm_unpacklo_epi32(middle[0], middle[1]), _mm_unpacklo_epi32(middle[2], middle[3]));
    low = _mm_unpacklo_epi64(_mm_or_si128(sum[0], _mm_slli_epi64(sum[1], 32)),
                             _mm_or_si128(sum[2], _mm_slli_epi64(sum[3], 32)));
    high = _mm_unpackhi_epi64(_mm_or_si128(sum[0], _mm_slli_epi64(sum[1], 32)),
                              _mm_or_si128(sum[2], _mm_slli_epi64(sum[3], 32)));
    return _mm_add_epi32(low, high);
}

/* Sum of the four least of 24 values. *least: the first of them. Columns of three are sorted, then the least of the
 * eight tops is taken off its column four times. */
static inline unsigned KERNEL(hypothesis_best)(const __m128i v[HYPOTHESIS_PARTS], unsigned *least)
{
    const __m128i lane = _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0);
    const __m128i lower = _mm_min_epu16(v[0], v[1]), upper = _mm_max_epu16(v[0], v[1]);
    __m128i top = _mm_min_epu16(lower, v[2]), rest = _mm_max_epu16(lower, v[2]);
    __m128i middle = _mm_min_epu16(upper, rest), last = _mm_max_epu16(upper, rest);
    unsigned sum = 0;

    for (int i = 0; i < SST_HYPOTHESIS_BEST; i++) {
        const __m128i found = _mm_minpos_epu16(top);
        const __m128i at = _mm_cmpeq_epi16(lane, _mm_broadcastw_epi16(_mm_srli_si128(found, 2)));
        const unsigned value = (unsigned)_mm_cvtsi128_si32(found) & 0xFFFF;

        if (!i)
            *least = value;
        sum += value;
        top = _mm_blendv_epi8(top, middle, at);
        middle = _mm_blendv_epi8(middle, last, at);
        last = _mm_or_si128(last, at);
    }
    return sum;
}

static inline unsigned KERNEL(hypothesis_sum)(__m256i v)
{
    const __m128i four = _mm_add_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    const __m128i two = _mm_add_epi32(four, _mm_unpackhi_epi64(four, four));

    return (unsigned)_mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 1)));
}

static inline unsigned KERNEL(hypothesis_cost)(const struct KERNEL(hypothesis_views) * v,
                                               const struct KERNEL(hypothesis_window) * w, int x, int y, int d,
                                               unsigned hides)
{
    const __m256i scale = _mm256_set1_epi32((int)w->scale), limit = _mm256_set1_epi32(SST_HYPOTHESIS_LIMIT);
    int32_t offset[SST_HYPOTHESIS_VIEWS];
    __m256i inside[HYPOTHESIS_PARTS], open_sum = _mm256_setzero_si256();
    unsigned seen = 0, visible = 0, best, least;
    __m128i costs[HYPOTHESIS_PARTS];
    const bool ahead = !(x & HYPOTHESIS_AHEAD);

    KERNEL(hypothesis_place)(offset, inside, v, x, y, d);
    for (int i = v->parts; i < HYPOTHESIS_PARTS; i++)
        costs[i] = _mm_set1_epi16(-1);
    for (int i = 0; i < v->parts; i++) {
        __m128i pixels[2] = { _mm_setzero_si128(), _mm_setzero_si128() };
        const __m128i first = KERNEL(hypothesis_four)(v, w, offset, 8 * i, ahead, &pixels[0]);
        const __m128i second = 2 * i + 1 < v->halves
                                   ? KERNEL(hypothesis_four)(v, w, offset, 8 * i + 4, ahead, &pixels[1])
                                   : _mm_setzero_si128();
        const __m256i difference = _mm256_set_m128i(second, first);
        const __m256i code = _mm256_srli_epi32(_mm256_set_m128i(pixels[1], pixels[0]), 24);
        const __m256i there =
            _mm256_andnot_si256(_mm256_cmpeq_epi32(code, _mm256_set1_epi32(SST_DEPTH_OUTSIDE)), inside[i]);
        const __m256i scaled = _mm256_mullo_epi32(difference, scale);
        const __m256i cost = _mm256_min_epu32(_mm256_srli_epi32(scaled, 16), limit);
        const __m256i open = _mm256_andnot_si256(_mm256_cmpgt_epi32(code, _mm256_set1_epi32((int)hides)), there);
        const __m256i of_there = _mm256_or_si256(cost, _mm256_andnot_si256(there, _mm256_set1_epi32(0xFFFF)));

        open_sum = _mm256_add_epi32(open_sum, _mm256_and_si256(cost, open));
        seen += (unsigned)__builtin_popcount((unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(there)));
        visible += (unsigned)__builtin_popcount((unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(open)));
        costs[i] = _mm_packus_epi32(_mm256_castsi256_si128(of_there), _mm256_extracti128_si256(of_there, 1));
    }
    best = KERNEL(hypothesis_best)(costs, &least);
    if (seen < SST_HYPOTHESIS_BEST)
        return seen ? least : SST_HYPOTHESIS_LIMIT;
    return (KERNEL(hypothesis_sum)(open_sum) + best) / (visible + SST_HYPOTHESIS_BEST);
}
#undef HYPOTHESIS_AHEAD
#undef HYPOTHESIS_PARTS
#else
/* Where a disparity moves a pixel to in each view. */
struct KERNEL(hypothesis_moves) {
    int32_t x[SST_HYPOTHESIS_VIEWS], y[SST_HYPOTHESIS_VIEWS];
};

static inline void KERNEL(hypothesis_move)(struct KERNEL(hypothesis_moves) * m, const struct sst_hypothesis_test *t,
                                           int d)
{
    for (int k = 0; k < SST_HYPOTHESIS_VIEWS; k++) {
        m->x[k] = (t->x[k] + d * t->dx[k]) >> 16;
        m->y[k] = (t->y[k] + d * t->dy[k]) >> 16;
    }
}

struct KERNEL(hypothesis_views) {
    const struct sst_hypothesis_test *test;
};

static inline void KERNEL(hypothesis_views_init)(struct KERNEL(hypothesis_views) * v,
                                                 const struct sst_hypothesis_test *t)
{
    v->test = t;
}

static inline unsigned KERNEL(hypothesis_cost)(const struct KERNEL(hypothesis_views) * v,
                                               const struct KERNEL(hypothesis_window) * w, int x, int y, int d,
                                               unsigned hides)
{
    const struct sst_hypothesis_test *t = v->test;
    struct KERNEL(hypothesis_moves) m;
    unsigned b0 = 65535, b1 = 65535, b2 = 65535, b3 = 65535, seen = 0, visible = 0, sum = 0;

    KERNEL(hypothesis_move)(&m, t, d);
    for (int k = 0; k < t->views; k++) {
        const int xv = x + m.x[k], yv = y + m.y[k];
        const uint32_t *at = t->view[k].pixels + yv * t->view[k].stride + xv;
        unsigned cost, open, c1, c2, c3;

        if ((unsigned)xv >= (unsigned)t->width || (unsigned)yv >= (unsigned)t->height || *at >> 24 == SST_DEPTH_OUTSIDE)
            continue;
        cost = KERNEL(hypothesis_difference)(w, at, t->view[k].stride) * w->scale >> 16;
        cost = cost < SST_HYPOTHESIS_LIMIT ? cost : SST_HYPOTHESIS_LIMIT;
        open = *at >> 24 <= hides;
        seen++;
        visible += open;
        sum += cost & -open;
        c1 = cost > b0 ? cost : b0;
        b0 = cost > b0 ? b0 : cost;
        c2 = c1 > b1 ? c1 : b1;
        b1 = c1 > b1 ? b1 : c1;
        c3 = c2 > b2 ? c2 : b2;
        b2 = c2 > b2 ? b2 : c2;
        b3 = c3 > b3 ? b3 : c3;
    }
    if (seen < SST_HYPOTHESIS_BEST)
        return seen ? b0 : SST_HYPOTHESIS_LIMIT;
    return (sum + b0 + b1 + b2 + b3) / (visible + SST_HYPOTHESIS_BEST);
}
#endif
#endif

#if defined(__SSE2__) || defined(__aarch64__)
static void KERNEL(hypothesis_cost_row)(uint16_t *cost, const uint16_t *hypothesis, const uint8_t *count,
                                        const struct sst_hypothesis_test *test, int x, int y, size_t n)
{
    struct KERNEL(hypothesis_views) views;

    _Static_assert(SST_HYPOTHESIS_BEST == 4, "four sums");
    KERNEL(hypothesis_views_init)(&views, test);
    for (size_t k = 0; k < n; k++, x++, cost += SST_HYPOTHESES, hypothesis += SST_HYPOTHESES) {
        struct KERNEL(hypothesis_window) w;

        for (size_t i = 0; i < SST_HYPOTHESES; i++)
            cost[i] = SST_HYPOTHESIS_FAR;
        if (count[k] == 1)
            cost[0] = 0;
        if (count[k] < 2)
            continue;
        KERNEL(hypothesis_window_init)
        (&w, test->own.pixels + y * test->own.stride + x, test->own.stride, test->similar);
        for (size_t i = 0; i < count[k] && (!i || cost[0] >= test->settled); i++) {
            const int d = hypothesis[i], front = d + test->tolerance;

            cost[i] = (uint16_t)KERNEL(hypothesis_cost)(&views, &w, x, y, d, test->code[front < 65534 ? front : 65534]);
        }
    }
}
#else
static void KERNEL(hypothesis_cost_row)(uint16_t *cost, const uint16_t *hypothesis, const uint8_t *count,
                                        const struct sst_hypothesis_test *test, int x, int y, size_t n)
{
    sst_hypothesis_cost_row_ref(cost, hypothesis, count, test, x, y, n);
}
#endif
