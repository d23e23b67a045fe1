/* Blocks of rays in registers, for blend_tmpl.h: BLEND_BLOCK pixels in two vectors of 32 bits a pixel. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define BLEND_HALF (SIMD_BYTES / 4) /* pixels of half a block */

#if SIMD_BYTES == 64
typedef __mmask32 KERNEL(blend_where); /* pixels of a block */

/* Colours of half a block: pairs of neighbours in 16 bits, times their weights. Of p, BLEND_BLOCK + 1 bytes are read.
 */
static inline simd_s32 KERNEL(blend_pairs)(const uint8_t *p, int half)
{
    const simd_s32 lane = SIMD_LANES, at = lane * 0x10001 + (half ? 0x0010000F : 0x00010000);
    const __m256i bytes = _mm256_loadu_si256((const __m256i *)(const void *)(p + half));

    return (simd_s32)_mm512_maskz_permutexvar_epi8(0x5555555555555555, (__m512i)at, _mm512_castsi256_si512(bytes));
}

/* Lanes below a count of 1 or more. */
static inline KERNEL(blend_where) KERNEL(blend_below)(simd_u16 v, uint16_t count)
{
    return _mm512_cmplt_epu16_mask((__m512i)v, _mm512_set1_epi16((int16_t)count));
}

static inline KERNEL(blend_where) KERNEL(blend_labelled)(const uint8_t *label, uint8_t as)
{
    return _mm256_cmpeq_epi8_mask(_mm256_loadu_si256((const __m256i *)(const void *)label), _mm256_set1_epi8((char)as));
}

/* Labels of a block. */
static inline __m256i KERNEL(blend_load_labels)(const uint8_t *label)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)label);
}

/* Half a block of weights by index, among four if `few`. */
static inline simd_f32 KERNEL(blend_ones)(simd_f32 ones, __m256i indices, int half, bool few SST_UNUSED)
{
    const __m128i part = half ? _mm256_extracti128_si256(indices, 1) : _mm256_castsi256_si128(indices);

    return (simd_f32)_mm512_permutexvar_ps(_mm512_cvtepu8_epi32(part), (__m512)ones);
}

static inline simd_f32 KERNEL(blend_load_ones)(const float one[SST_BLEND_ONES], bool few SST_UNUSED)
{
    const __m512 v = _mm512_castps256_ps512(_mm256_loadu_ps(one));

    return (simd_f32)_mm512_shuffle_f32x4(v, v, _MM_SHUFFLE(1, 0, 1, 0));
}

/* Stored disparities, ordered for unpacking. */
static inline simd_u16 KERNEL(blend_disp)(const uint16_t *p)
{
    return (simd_u16)_mm512_permutexvar_epi64(_mm512_setr_epi64(0, 4, 1, 5, 2, 6, 3, 7), _mm512_loadu_si512(p));
}

/* Order of a block by the quickest instructions of the level: here from left to right. */
static inline simd_u16 KERNEL(blend_quick_disp)(const uint16_t *p)
{
    return KERNEL(blend_disp)(p);
}

static inline void KERNEL(blend_quick_store)(float *to, const simd_f32 half[2])
{
    simd_store_f32(to, half[0]);
    simd_store_f32(to + BLEND_HALF, half[1]);
}

#define BLEND_BITS 1 /* of blend_bits() for a pixel */

static inline uint32_t KERNEL(blend_bits)(KERNEL(blend_where) m)
{
    return m;
}

/* yes where m, else no; of half a block */
static inline simd_f32 KERNEL(blend_select)(KERNEL(blend_where) m, int half, simd_f32 yes, simd_f32 no)
{
    return (simd_f32)_mm512_mask_blend_ps((__mmask16)(m >> (half ? 16 : 0)), (__m512)no, (__m512)yes);
}

static inline simd_f32 KERNEL(blend_quick_select)(KERNEL(blend_where) m, int half, simd_f32 yes, simd_f32 no)
{
    return KERNEL(blend_select)(m, half, yes, no);
}

/* The low bytes. */
static inline void KERNEL(blend_bytes)(uint8_t *to, simd_s32 v)
{
    _mm_storeu_si128((__m128i *)(void *)to, _mm512_cvtepi32_epi8((__m512i)v));
}
#else
typedef simd_u16 KERNEL(blend_where);

static inline simd_s32 KERNEL(blend_pairs)(const uint8_t *p, int half)
{
    const __m256i order = half ? _mm256_setr_epi8(7, -1, 8, -1, 8, -1, 9, -1, 9, -1, 10, -1, 10, -1, 11, -1, 11, -1, 12,
                                                  -1, 12, -1, 13, -1, 13, -1, 14, -1, 14, -1, 15, -1)
                               : _mm256_setr_epi8(0, -1, 1, -1, 1, -1, 2, -1, 2, -1, 3, -1, 3, -1, 4, -1, 4, -1, 5, -1,
                                                  5, -1, 6, -1, 6, -1, 7, -1, 7, -1, 8, -1);
    const __m128i bytes = _mm_loadu_si128((const __m128i *)(const void *)(p + half));

    return (simd_s32)_mm256_shuffle_epi8(_mm256_broadcastsi128_si256(bytes), order);
}

static inline KERNEL(blend_where) KERNEL(blend_below)(simd_u16 v, uint16_t count)
{
    return (simd_u16)(simd_min_u16(v, simd_set_u16((uint16_t)(count - 1))) == v);
}

static inline KERNEL(blend_where) KERNEL(blend_labelled)(const uint8_t *label, uint8_t as)
{
    return (simd_u16)_mm256_cvtepi8_epi16(
        _mm_cmpeq_epi8(_mm_loadu_si128((const __m128i *)(const void *)label), _mm_set1_epi8((char)as)));
}

static inline __m256i KERNEL(blend_load_labels)(const uint8_t *label)
{
    return _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)(const void *)label));
}

static inline simd_f32 KERNEL(blend_ones)(simd_f32 ones, __m256i indices, int half, bool few)
{
    const __m256i order = half ? _mm256_setr_epi8(4, -1, -1, -1, 5, -1, -1, -1, 6, -1, -1, -1, 7, -1, -1, -1, 12, -1,
                                                  -1, -1, 13, -1, -1, -1, 14, -1, -1, -1, 15, -1, -1, -1)
                               : _mm256_setr_epi8(0, -1, -1, -1, 1, -1, -1, -1, 2, -1, -1, -1, 3, -1, -1, -1, 8, -1, -1,
                                                  -1, 9, -1, -1, -1, 10, -1, -1, -1, 11, -1, -1, -1);
    const __m256i at = _mm256_shuffle_epi8(indices, order);

    return few ? (simd_f32)_mm256_permutevar_ps((__m256)ones, at)
               : (simd_f32)_mm256_permutevar8x32_ps((__m256)ones, at);
}

static inline simd_f32 KERNEL(blend_load_ones)(const float one[SST_BLEND_ONES], bool few)
{
    return few ? (simd_f32)_mm256_broadcast_ps((const __m128 *)(const void *)one) : simd_load_f32(one);
}

static inline simd_u16 KERNEL(blend_disp)(const uint16_t *p)
{
    return (simd_u16)_mm256_permute4x64_epi64((__m256i)simd_load_u16(p), _MM_SHUFFLE(3, 1, 2, 0));
}

/* Here the order after unpacking: pixels 0-3, 8-11 and 4-7, 12-15. */
static inline simd_u16 KERNEL(blend_quick_disp)(const uint16_t *p)
{
    return simd_load_u16(p);
}

static inline void KERNEL(blend_quick_store)(float *to, const simd_f32 half[2])
{
    for (int i = 0; i < 2; i++) {
        _mm_storeu_ps(to + 4 * i, _mm256_castps256_ps128((__m256)half[i]));
        _mm_storeu_ps(to + 4 * i + 8, _mm256_extractf128_ps((__m256)half[i], 1));
    }
}

#define BLEND_BITS 2

static inline uint32_t KERNEL(blend_bits)(KERNEL(blend_where) m)
{
    return (uint32_t)_mm256_movemask_epi8((__m256i)m);
}

static inline simd_f32 KERNEL(blend_select)(KERNEL(blend_where) m, int half, simd_f32 yes, simd_f32 no)
{
    const __m128i of = half ? _mm256_extracti128_si256((__m256i)m, 1) : _mm256_castsi256_si128((__m256i)m);

    return (simd_f32)_mm256_blendv_ps((__m256)no, (__m256)yes, _mm256_castsi256_ps(_mm256_cvtepi16_epi32(of)));
}

static inline simd_f32 KERNEL(blend_quick_select)(KERNEL(blend_where) m, int half, simd_f32 yes, simd_f32 no)
{
    const __m256i of =
        half ? _mm256_unpackhi_epi16((__m256i)m, (__m256i)m) : _mm256_unpacklo_epi16((__m256i)m, (__m256i)m);

    return (simd_f32)_mm256_blendv_ps((__m256)no, (__m256)yes, _mm256_castsi256_ps(of));
}

static inline void KERNEL(blend_bytes)(uint8_t *to, simd_s32 v)
{
    const __m128i words = _mm_packus_epi32(_mm256_castsi256_si128((__m256i)v), _mm256_extracti128_si256((__m256i)v, 1));

    _mm_storel_epi64((__m128i *)(void *)to, _mm_packus_epi16(words, words));
}
#endif

/* sum + the products of pairs, added in pairs */
static inline simd_s32 KERNEL(blend_dot)(simd_s32 sum, simd_s32 a, simd_s32 b)
{
#if defined(__AVX512VNNI__)
    return (simd_s32)_mm512_dpwssd_epi32((__m512i)sum, (__m512i)a, (__m512i)b);
#elif defined(__AVXVNNI__)
    return (simd_s32)_mm256_dpwssd_avx_epi32((__m256i)sum, (__m256i)a, (__m256i)b);
#else
    return sum + (simd_s32)SIMD_OP(madd_epi16)((SIMD_INT)a, (SIMD_INT)b);
#endif
}

/* (uint16_t)(disp - first) < count */
static inline KERNEL(blend_where) KERNEL(blend_within)(const uint16_t *disp, uint16_t first, uint16_t count)
{
    return KERNEL(blend_below)(simd_load_u16(disp) - first, count);
}

/* v & mask */
static inline simd_f32 KERNEL(blend_mask)(simd_f32 v, simd_s32 mask)
{
    return (simd_f32)((simd_s32)v & mask);
}

static inline simd_f32 KERNEL(blend_float)(simd_s32 v)
{
    return (simd_f32)SIMD_OP(cvtepi32_ps)((SIMD_INT)v);
}

#define BLEND_BLOCK (2 * BLEND_HALF)
#define BLEND_LINE  64         /* pixels of a line of cache */
#define BLEND_ALL   UINT32_MAX /* blend_bits() of all pixels */

/* Of a run: weights of the pixels of both rows, and of a block. */
struct KERNEL(blend_taps) {
    simd_s32 top, bottom;
};
struct KERNEL(blend_weights) {
    simd_f32 half[2];
};

/* Two weights as one number, as they lie in memory: a rounded one may be -1, whose sign must not reach the other. */
static inline int32_t KERNEL(blend_two_taps)(const int16_t *tap)
{
    int32_t two;

    memcpy(&two, tap, sizeof(two));
    return two;
}

static inline struct KERNEL(blend_taps) KERNEL(blend_set_taps)(const struct sst_blend *b)
{
    return (struct KERNEL(blend_taps)){ simd_set_s32(KERNEL(blend_two_taps)(b->tap)),
                                        simd_set_s32(KERNEL(blend_two_taps)(b->tap + 2)) };
}

/* Colours of half a block. */
static inline simd_s32 KERNEL(blend_colours)(const uint8_t *top, const uint8_t *bottom, int half,
                                             const struct KERNEL(blend_taps) * t)
{
    const SIMD_INT upper = SIMD_OP(madd_epi16)((SIMD_INT)KERNEL(blend_pairs)(top, half), (SIMD_INT)t->top);

    return KERNEL(blend_dot)((simd_s32)upper, KERNEL(blend_pairs)(bottom, half), t->bottom);
}

/* Read ahead the cache line `below` bytes after a pointer, maybe past the end. */
static inline void KERNEL(blend_read_ahead)(const void *p, size_t below)
{
    __builtin_prefetch((const void *)((uintptr_t)p + below), 0, 2);
}

#include "pipeline/kernels/blend_weights_tmpl.h"

/* Rows of one colour of some views. */
struct KERNEL(blend_of_views) {
    const uint8_t *top[SST_BLEND_VIEWS], *bottom[SST_BLEND_VIEWS];
    size_t below[SST_BLEND_VIEWS];
    struct KERNEL(blend_taps) tap[SST_BLEND_VIEWS];
};

static inline __attribute__((always_inline)) void
KERNEL(blend_set_views)(struct KERNEL(blend_of_views) * v, const struct sst_blend *b, int c, int views, size_t from)
{
    for (int k = 0; k < views; k++) {
        v->top[k] = b[k].top[c] + from;
        v->bottom[k] = b[k].bottom[c] + from;
        v->below[k] = b[k].below;
        v->tap[k] = KERNEL(blend_set_taps)(&b[k]);
    }
}

typedef float KERNEL(blend_part_weights)[BLEND_PART + BLEND_BLOCK]; /* of one view */

/* Add a block of rays of one colour of some views, without the first `done` pixels. */
static inline __attribute__((always_inline)) void KERNEL(blend_add)(float *acc, const struct KERNEL(blend_of_views) * v,
                                                                    const KERNEL(blend_part_weights) * w, int views,
                                                                    size_t x, size_t done)
{
    simd_f32 sum[2] = { simd_load_f32(acc + x), simd_load_f32(acc + x + BLEND_HALF) };

    for (int k = 0; k < views; k++) {
        for (int half = 0; half < 2; half++) {
            simd_f32 weight = simd_load_f32(w[k] + x + half * BLEND_HALF);

            if (done)
                weight = KERNEL(blend_mask)(weight, KERNEL(blend_undone)(done, half));
            sum[half] +=
                weight * KERNEL(blend_float)(KERNEL(blend_colours)(v->top[k] + x, v->bottom[k] + x, half, &v->tap[k]));
        }
    }
    simd_store_f32(acc + x, sum[0]);
    simd_store_f32(acc + x + BLEND_HALF, sum[1]);
}

/* Add one colour of some views: sums stay in registers from view to view. */
static inline __attribute__((always_inline)) void
KERNEL(blend_rays_colour)(float *acc, const struct KERNEL(blend_of_views) * views_,
                          const KERNEL(blend_part_weights) * w, int views, size_t n)
{
    const struct KERNEL(blend_of_views) v = *views_;
    size_t x = 0;

    while (x + BLEND_BLOCK <= n) {
        const size_t end = x + BLEND_LINE <= n ? x + BLEND_LINE : n;

        for (int k = 0; k < views; k++)
            KERNEL(blend_read_ahead)(v.bottom[k] + x, v.below[k]);
        for (; x + BLEND_BLOCK <= end; x += BLEND_BLOCK)
            KERNEL(blend_add)(acc, &v, w, views, x, 0);
    }
    if (x < n)
        KERNEL(blend_add)(acc, &v, w, views, n - BLEND_BLOCK, x - (n - BLEND_BLOCK));
}

static inline __attribute__((always_inline)) void
KERNEL(blend_rays_weight)(float *acc, const KERNEL(blend_part_weights) * w, int views, size_t n)
{
    size_t x = 0;

    for (; x + BLEND_HALF <= n; x += BLEND_HALF) {
        simd_f32 sum = simd_load_f32(acc + x);

        for (int k = 0; k < views; k++)
            sum += simd_load_f32(w[k] + x);
        simd_store_f32(acc + x, sum);
    }
    for (; x < n; x++) {
        for (int k = 0; k < views; k++)
            acc[x] += w[k][x];
    }
}

/* Add the rays of the pixels from .. from + n of some views, n at least BLEND_BLOCK. One colour at a time, as
 * blend_plain does. */
static inline __attribute__((always_inline)) void KERNEL(blend_rays_run)(float *const acc[4],
                                                                         const KERNEL(blend_part_weights) * w,
                                                                         const struct sst_blend *b, int views,
                                                                         size_t from, size_t n)
{
    struct KERNEL(blend_of_views) v;

    for (int c = 0; c < 3; c++) {
        KERNEL(blend_set_views)(&v, b, c, views, from);
        KERNEL(blend_rays_colour)(acc[c] + from, &v, w, views, n);
    }
    KERNEL(blend_rays_weight)(acc[3] + from, w, views, n);
}

static __attribute__((noinline)) void KERNEL(blend_rays_run_all)(float *const acc[4],
                                                                 const KERNEL(blend_part_weights) * w,
                                                                 const struct sst_blend *b, size_t from, size_t n)
{
    KERNEL(blend_rays_run)(acc, w, b, SST_BLEND_VIEWS, from, n);
}

static __attribute__((noinline)) void KERNEL(blend_rays_run_one)(float *const acc[4],
                                                                 const KERNEL(blend_part_weights) * w,
                                                                 const struct sst_blend *b, size_t from, size_t n)
{
    KERNEL(blend_rays_run)(acc, w, b, 1, from, n);
}

/* Weights come before colours: sums of colours would wait for long chains of operations. */
static void KERNEL(blend_rays)(float *const acc[4], const struct sst_blend *b, int views, size_t n)
{
    struct KERNEL(blend_run) r[SST_BLEND_VIEWS];
    _Alignas(SIMD_BYTES) KERNEL(blend_part_weights) w[SST_BLEND_VIEWS];

    if (n < BLEND_BLOCK) {
        KERNEL(blend_rays_parts)(acc, b, views, n);
        return;
    }
    for (int k = 0; k < views; k++)
        KERNEL(blend_set_run)(&r[k], &b[k]);
    for (size_t x = 0, part; x < n; x += part) {
        part = n - x < BLEND_PART + BLEND_BLOCK ? n - x : BLEND_PART;
        for (int k = 0; k < views; k++)
            KERNEL(blend_weights_run)(w[k], &r[k], x, part);
        if (views == SST_BLEND_VIEWS)
            KERNEL(blend_rays_run_all)(acc, w, b, x, part);
        for (int k = 0; k < views && views < SST_BLEND_VIEWS; k++)
            KERNEL(blend_rays_run_one)(acc, w + k, b + k, x, part);
    }
}

/* Add whole blocks of one colour of some views: sums stay in registers from view to view. One colour at a time: rows of
 * its planes are few enough for the ways of a first level of cache, in which rows of all three would displace each
 * other. */
static inline __attribute__((always_inline)) void KERNEL(blend_plain_colour)(int32_t *sum, const struct sst_blend *b,
                                                                             int c, int views, size_t n)
{
    struct KERNEL(blend_of_views) v;

    KERNEL(blend_set_views)(&v, b, c, views, 0);
    for (size_t x = 0; x + BLEND_BLOCK <= n; x += BLEND_BLOCK) {
        for (int k = 0; k < views && x % BLEND_LINE == 0; k++)
            KERNEL(blend_read_ahead)(v.bottom[k] + x, v.below[k]);
        for (int half = 0; half < 2; half++) {
            simd_s32 s = simd_load_s32(sum + x + half * BLEND_HALF);

            for (int k = 0; k < views; k++) {
                s = KERNEL(blend_dot)(s, KERNEL(blend_pairs)(v.top[k] + x, half), v.tap[k].top);
                s = KERNEL(blend_dot)(s, KERNEL(blend_pairs)(v.bottom[k] + x, half), v.tap[k].bottom);
            }
            simd_store_s32(sum + x + half * BLEND_HALF, s);
        }
    }
}

/* The last block of a run, without the pixels that whole ones have done. */
static inline void KERNEL(blend_plain_rest)(int32_t *sum, const struct sst_blend *b,
                                            const struct KERNEL(blend_taps) * t, int c, int views, size_t n)
{
    const size_t x = n - BLEND_BLOCK, done = n / BLEND_BLOCK * BLEND_BLOCK - x;

    for (int half = 0; half < 2; half++) {
        const simd_s32 undone = KERNEL(blend_undone)(done, half);
        simd_s32 s = simd_load_s32(sum + x + half * BLEND_HALF);

        for (int k = 0; k < views; k++) {
            s = KERNEL(blend_dot)(s, KERNEL(blend_pairs)(b[k].top[c] + x, half), t[k].top & undone);
            s = KERNEL(blend_dot)(s, KERNEL(blend_pairs)(b[k].bottom[c] + x, half), t[k].bottom & undone);
        }
        simd_store_s32(sum + x + half * BLEND_HALF, s);
    }
}

static void KERNEL(blend_plain)(int32_t *const sum[3], float *count, const struct sst_blend *b, int views, size_t n)
{
    struct KERNEL(blend_taps) t[SST_BLEND_VIEWS];

    if (n < BLEND_BLOCK) {
        KERNEL(blend_plain_parts)(sum, count, b, views, n);
        return;
    }
    for (int k = 0; k < views; k++)
        t[k] = KERNEL(blend_set_taps)(&b[k]);
    for (size_t x = 0; x < n; x++)
        count[x] += (float)views;
    for (int c = 0; c < 3; c++) {
        if (views == SST_BLEND_VIEWS)
            KERNEL(blend_plain_colour)(sum[c], b, c, SST_BLEND_VIEWS, n);
        for (int k = 0; k < views && views < SST_BLEND_VIEWS; k++)
            KERNEL(blend_plain_colour)(sum[c], b + k, c, 1, n);
        if (n % BLEND_BLOCK)
            KERNEL(blend_plain_rest)(sum[c], b, t, c, views, n);
    }
}

static void KERNEL(blend_take)(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n)
{
    const struct KERNEL(blend_rows) rows = KERNEL(blend_set_rows)(b);
    struct KERNEL(blend_run) r;

    if (n < BLEND_BLOCK) {
        KERNEL(blend_take_parts)(colour, weight, b, n);
        return;
    }
    KERNEL(blend_set_run)(&r, b);
    KERNEL(blend_weights_run)(weight, &r, 0, n);
    for (size_t x = 0; x < n; x += BLEND_BLOCK) {
        const size_t from = x + BLEND_BLOCK <= n ? x : n - BLEND_BLOCK;

        for (int half = 0; half < 2; half++) {
            for (int c = 0; c < 3; c++)
                KERNEL(blend_bytes)
            (colour[c] + from + (size_t)half * BLEND_HALF,
             (KERNEL(blend_colours)(rows.top[c] + from, rows.bottom[c] + from, half, &rows.taps) +
              SST_BLEND_LEVEL / 2) >>
                 SST_BLEND_LEVEL_BITS);
        }
    }
}

#undef BLEND_HALF
#undef BLEND_BLOCK
#undef BLEND_LINE
#undef BLEND_ALL
#undef BLEND_BITS
