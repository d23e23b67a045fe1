/* Semi-global optimisation: 16-bit lanes over the disparities of one pixel. nd is a multiple of 32. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

static inline void KERNEL(sgm_step)(uint16_t *restrict cur, const uint16_t *restrict prev, uint16_t *restrict sum,
                                    const uint8_t *restrict cost, uint16_t p1, uint16_t p2, int first, size_t nd)
{
    const uint16_t prev_min = prev[-2], jump = (uint16_t)(prev_min + p2);
    uint16_t cur_min = SST_SGM_FAR;

    for (size_t d = 0; d < nd; d++) {
        const uint16_t below = prev[(ptrdiff_t)d - 1], above = prev[d + 1];
        const uint16_t near = (uint16_t)((below < above ? below : above) + p1);
        const uint16_t same = prev[d];
        const uint16_t stay = same < near ? same : near;
        const uint16_t best = stay < jump ? stay : jump;
        const uint16_t l = (uint16_t)(cost[d] + best - prev_min);

        cur[d] = l;
        sum[d] = (uint16_t)(first ? l : sum[d] + l);
        cur_min = l < cur_min ? l : cur_min;
    }
    cur[-1] = cur[nd] = SST_SGM_FAR;
    cur[-2] = cur_min;
}

#if defined(__AVX2__)
#define SGM_LANES (SIMD_BYTES / 2)

/* A pixel's L in registers, up to 64 of it, its minimum in all lanes of another one. */
struct KERNEL(sgm_state) {
    simd_u16 l[64 / SGM_LANES], least;
};

#if defined(__AVX512BW__)
static inline simd_u16 KERNEL(sgm_least)(simd_u16 v)
{
    const __m256i half =
        _mm256_min_epu16(_mm512_castsi512_si256((__m512i)v), _mm512_extracti64x4_epi64((__m512i)v, 1));
    const __m128i quarter = _mm_min_epu16(_mm256_castsi256_si128(half), _mm256_extracti128_si256(half, 1));

    return (simd_u16)_mm512_broadcastw_epi16(_mm_minpos_epu16(quarter));
}

static inline simd_u16 KERNEL(sgm_costs)(const uint8_t *cost)
{
    return (simd_u16)_mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)(const void *)cost));
}

/* Lanes one further, the first from the last one of `before`. */
static inline simd_u16 KERNEL(sgm_below)(simd_u16 before, simd_u16 v)
{
    const __m512i from = _mm512_set_epi16(62, 61, 60, 59, 58, 57, 56, 55, 54, 53, 52, 51, 50, 49, 48, 47, 46, 45, 44, 43,
                                          42, 41, 40, 39, 38, 37, 36, 35, 34, 33, 32, 31);

    return (simd_u16)_mm512_permutex2var_epi16((__m512i)before, from, (__m512i)v);
}

/* Lanes one back, the last from the first one of `after`. */
static inline simd_u16 KERNEL(sgm_above)(simd_u16 v, simd_u16 after)
{
    const __m512i from = _mm512_set_epi16(32, 31, 30, 29, 28, 27, 26, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14, 13,
                                          12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1);

    return (simd_u16)_mm512_permutex2var_epi16((__m512i)v, from, (__m512i)after);
}
#else
static inline simd_u16 KERNEL(sgm_least)(simd_u16 v)
{
    const __m128i half = _mm_min_epu16(_mm256_castsi256_si128((__m256i)v), _mm256_extracti128_si256((__m256i)v, 1));

    return (simd_u16)_mm256_broadcastw_epi16(_mm_minpos_epu16(half));
}

static inline simd_u16 KERNEL(sgm_costs)(const uint8_t *cost)
{
    return (simd_u16)_mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)cost));
}

static inline simd_u16 KERNEL(sgm_below)(simd_u16 before, simd_u16 v)
{
    const __m256i between = _mm256_permute2x128_si256((__m256i)before, (__m256i)v, 0x21);

    return (simd_u16)_mm256_alignr_epi8((__m256i)v, between, 14);
}

static inline simd_u16 KERNEL(sgm_above)(simd_u16 v, simd_u16 after)
{
    const __m256i between = _mm256_permute2x128_si256((__m256i)v, (__m256i)after, 0x21);

    return (simd_u16)_mm256_alignr_epi8(between, (__m256i)v, 2);
}
#endif

/* L of the next pixel. @param regs  that it takes */
static inline void KERNEL(sgm_next)(struct KERNEL(sgm_state) *s, const simd_u16 *below, const simd_u16 *above,
                                    uint16_t *sum, const uint8_t *cost, uint16_t p1, uint16_t p2, int first,
                                    const int regs)
{
    const simd_u16 one = simd_set_u16(p1), was = s->least, jump = was + simd_set_u16(p2);
    simd_u16 least = simd_set_u16(SST_SGM_FAR);

#pragma GCC unroll 4
    for (int r = 0; r < regs; r++) {
        const simd_u16 near = simd_min_u16(below[r], above[r]) + one;
        const simd_u16 best = simd_min_u16(simd_min_u16(s->l[r], near), jump);
        const simd_u16 l = best - was + KERNEL(sgm_costs)(cost + SGM_LANES * r);
        uint16_t *to = sum + SGM_LANES * r;

        simd_store_u16(to, first ? l : l + simd_load_u16(to));
        s->l[r] = l;
        least = simd_min_u16(least, l);
    }
    s->least = KERNEL(sgm_least)(least);
}

static inline void KERNEL(sgm_load)(struct KERNEL(sgm_state) *s, const uint16_t *l, const int regs)
{
    s->least = simd_set_u16(l[-2]);
#pragma GCC unroll 4
    for (int r = 0; r < regs; r++)
        s->l[r] = simd_load_u16(l + SGM_LANES * r);
}

static inline void KERNEL(sgm_store)(const struct KERNEL(sgm_state) *s, uint16_t *l, const int regs)
{
#pragma GCC unroll 4
    for (int r = 0; r < regs; r++)
        simd_store_u16(l + SGM_LANES * r, s->l[r]);
    l[-1] = l[SGM_LANES * regs] = SST_SGM_FAR;
    l[-2] = s->least[0];
}

static inline __attribute__((always_inline)) void
KERNEL(sgm_across_regs)(uint16_t *c, const uint16_t *p, uint16_t *sum, const uint8_t *cost, const uint8_t *penalty,
                        const uint16_t *p1, const uint16_t *p2, int first, size_t n, const int regs)
{
    const size_t nd = SGM_LANES * (size_t)regs, entry = nd + 2 * SST_SGM_PAD;

    for (size_t x = 0; x < n; x++, c += entry, p += entry) {
        simd_u16 below[64 / SGM_LANES], above[64 / SGM_LANES];
        struct KERNEL(sgm_state) s;

        KERNEL(sgm_load)(&s, p, regs);
#pragma GCC unroll 4
        for (int r = 0; r < regs; r++) {
            below[r] = simd_load_u16(p + SGM_LANES * r - 1);
            above[r] = simd_load_u16(p + SGM_LANES * r + 1);
        }
        KERNEL(sgm_next)(&s, below, above, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], first, regs);
        KERNEL(sgm_store)(&s, c, regs);
    }
}

/* `rows` paths along rows, at most SST_SGM_ROWS; only the first and the last entries of `line` are used. */
static inline __attribute__((always_inline)) void
KERNEL(sgm_along_regs)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride, const uint8_t *penalty,
                       size_t penalty_stride, const uint16_t *p1, const uint16_t *p2, int dir, int first,
                       const size_t rows, size_t n, const int regs)
{
    const size_t nd = SGM_LANES * (size_t)regs, entry = nd + 2 * SST_SGM_PAD;
    simd_u16 low[SST_SGM_ROWS], high[SST_SGM_ROWS];
    struct KERNEL(sgm_state) s[SST_SGM_ROWS];

#pragma GCC unroll 4
    for (size_t r = 0; r < rows; r++) {
        const uint16_t *l = line + (r * (n + 2) + (dir > 0 ? 0 : n + 1)) * entry + SST_SGM_PAD;

        KERNEL(sgm_load)(&s[r], l, regs);
        low[r] = simd_set_u16(l[-1]);
        high[r] = simd_set_u16(l[nd]);
    }
    for (size_t i = 0; i < n; i++) {
        const size_t x = dir > 0 ? i : n - 1 - i;

#pragma GCC unroll 4
        for (size_t r = 0; r < rows; r++) {
            const uint8_t step = penalty[r * penalty_stride + x];
            simd_u16 below[64 / SGM_LANES], above[64 / SGM_LANES];

#pragma GCC unroll 4
            for (int k = 0; k < regs; k++) {
                below[k] = KERNEL(sgm_below)(k ? s[r].l[k - 1] : low[r], s[r].l[k]);
                above[k] = KERNEL(sgm_above)(s[r].l[k], k + 1 < regs ? s[r].l[k + 1] : high[r]);
            }
            KERNEL(sgm_next)(&s[r], below, above, sum + r * stride + x * nd, cost + r * stride + x * nd, p1[step],
                             p2[step], first, regs);
            low[r] = high[r] = simd_set_u16(SST_SGM_FAR);
        }
    }
#pragma GCC unroll 4
    for (size_t r = 0; r < rows; r++)
        KERNEL(sgm_store)(&s[r], line + (r * (n + 2) + (dir > 0 ? n : 1)) * entry + SST_SGM_PAD, regs);
}

/* @return whether it was done: where L fits the registers */
static bool KERNEL(sgm_along_done)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                   const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                   const uint16_t *p2, int dir, int first, size_t rows, size_t n, size_t nd)
{
    const bool all = rows == SST_SGM_ROWS;

    if (nd > 64 || (!all && rows > 1))
        return false;
    if (nd == 32 && all)
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, SST_SGM_ROWS, n,
                               32 / SGM_LANES);
    else if (nd == 32)
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, 1, n,
                               32 / SGM_LANES);
    else if (all)
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, SST_SGM_ROWS, n,
                               64 / SGM_LANES);
    else
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, 1, n,
                               64 / SGM_LANES);
    return true;
}
#endif

static void KERNEL(sgm_across_row)(uint16_t *cur, const uint16_t *prev, uint16_t *sum, const uint8_t *cost,
                                   const uint8_t *penalty, const uint16_t *p1, const uint16_t *p2, int dx, int first,
                                   size_t n, size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD;
    uint16_t *c = cur + entry + SST_SGM_PAD;
    const uint16_t *p = prev + (size_t)(1 + dx) * entry + SST_SGM_PAD;

#if defined(__AVX2__)
    if (nd == 32 && first)
        KERNEL(sgm_across_regs)(c, p, sum, cost, penalty, p1, p2, 1, n, 32 / SGM_LANES);
    else if (nd == 32)
        KERNEL(sgm_across_regs)(c, p, sum, cost, penalty, p1, p2, 0, n, 32 / SGM_LANES);
    else if (nd == 64)
        KERNEL(sgm_across_regs)(c, p, sum, cost, penalty, p1, p2, first, n, 64 / SGM_LANES);
    if (nd == 32 || nd == 64)
        return;
#endif
    for (size_t x = 0; x < n; x++, c += entry, p += entry) {
        if (first)
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 1, nd);
        else
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 0, nd);
    }
}

/* Each pixel waits for the one before: rows side by side fill the time. */
static inline void KERNEL(sgm_along_few)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                         const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                         const uint16_t *p2, int dir, int first, size_t rows, size_t n, size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD, line_stride = (n + 2) * entry;

    for (size_t i = 0; i < n; i++) {
        const size_t x = dir > 0 ? i : n - 1 - i;

        for (size_t r = 0; r < rows; r++) {
            uint16_t *c = line + r * line_stride + (x + 1) * entry + SST_SGM_PAD;
            const uint8_t *p = penalty + r * penalty_stride;

            KERNEL(sgm_step)(c, c - (ptrdiff_t)entry * dir, sum + r * stride + x * nd, cost + r * stride + x * nd,
                             p1[p[x]], p2[p[x]], first, nd);
        }
    }
}

static void KERNEL(sgm_along_rows)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                   const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                   const uint16_t *p2, int dir, int first, size_t rows, size_t n, size_t nd)
{
    for (size_t r = 0; r < rows; r += SST_SGM_ROWS) {
        const size_t count = rows - r < SST_SGM_ROWS ? rows - r : SST_SGM_ROWS;
        uint16_t *l = line + r * (n + 2) * (nd + 2 * SST_SGM_PAD);

#if defined(__AVX2__)
        if (KERNEL(sgm_along_done)(l, sum + r * stride, cost + r * stride, stride, penalty + r * penalty_stride,
                                   penalty_stride, p1, p2, dir, first, count, n, nd))
            continue;
#endif
        if (first)
            KERNEL(sgm_along_few)(l, sum + r * stride, cost + r * stride, stride, penalty + r * penalty_stride,
                                  penalty_stride, p1, p2, dir, 1, count, n, nd);
        else
            KERNEL(sgm_along_few)(l, sum + r * stride, cost + r * stride, stride, penalty + r * penalty_stride,
                                  penalty_stride, p1, p2, dir, 0, count, n, nd);
    }
}
#undef SGM_LANES
