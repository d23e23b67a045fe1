/* clear_removed, clear_state, clear_land, clear_surface: rays of a view to the viewpoint, and surfaces of them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

/* --- what is removed --- */

static void KERNEL(clear_removed)(uint8_t *restrict removed, const uint16_t *restrict disp, int cut, size_t n)
{
    const uint16_t above = (uint16_t)(cut < -1 ? 0 : cut + 1 > 0xFFFF ? 0xFFFF : cut + 1);

    for (size_t x = 0; x < n; x++)
        removed[x] = (uint8_t)((disp[x] >= above) & (disp[x] != 0xFFFF));
}

/* Both tests are 0 or 1: kept is 2, beside 1. */
static void KERNEL(clear_state)(uint8_t *restrict state, const uint8_t *const removed[3], const uint16_t *restrict disp,
                                int bins, size_t n)
{
    const uint8_t *restrict above = removed[0], *restrict at = removed[1], *restrict below = removed[2];
    const uint16_t most = (uint16_t)(bins < 0xFFFF ? bins : 0xFFFF);

    for (size_t x = 0; x < n; x++) {
        const uint8_t columns = (uint8_t)(above[x] | at[x] | below[x]);
        const uint8_t left = (uint8_t)(*(above + x - 1) | *(at + x - 1) | *(below + x - 1));
        const uint8_t near = (uint8_t)(columns | left | above[x + 1] | at[x + 1] | below[x + 1]);
        const uint8_t gone = (uint8_t)(at[x] | (disp[x] >= most));

        state[x] = (uint8_t)((2 - near) & (gone - 1));
    }
}

/* --- rays to the viewpoint --- */

#if defined(__AVX512VBMI__)
static inline __m512i KERNEL(clear_moved)(__m512i disp, float scale, float zero)
{
    const __m512 at = _mm512_add_ps(_mm512_mul_ps(_mm512_cvtepi32_ps(disp), _mm512_set1_ps(scale)), _mm512_set1_ps(zero));

    return _mm512_cvtps_epi32(_mm512_roundscale_ps(at, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC));
}

/* The rays of 16 pixels: those that move alike are stored at once. */
static inline void KERNEL(clear_land_16)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, __m256i disp,
                                         __m128i state, int x, int y)
{
    const __m512i q = _mm512_cvtepu16_epi32(disp);
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512i dx = KERNEL(clear_moved)(q, v->x_q6, v->x_0), dy = KERNEL(clear_moved)(q, v->y_q6, v->y_0);
    const __m512i to_x = _mm512_add_epi32(_mm512_add_epi32(dx, lane), _mm512_set1_epi32(x));
    const __m512i to_y = _mm512_add_epi32(dy, _mm512_set1_epi32(y));
    const __m256i level = _mm256_add_epi16(_mm256_srl_epi16(disp, _mm_cvtsi32_si128(v->coarse)), _mm256_set1_epi16(1));
    const __m256i kept = _mm256_srli_epi16(_mm256_cvtepu8_epi16(state), 1), ray = _mm256_or_si256(_mm256_slli_epi16(level, 1), kept);
    __mmask16 rays = _mm_test_epi8_mask(state, state);
    int32_t move_x[16], move_y[16];

    rays = _mm512_mask_cmplt_epu32_mask(rays, to_x, _mm512_set1_epi32(v->width));
    rays = _mm512_mask_cmplt_epu32_mask(rays, to_y, _mm512_set1_epi32(v->height));
    _mm512_storeu_si512(move_x, dx);
    _mm512_storeu_si512(move_y, dy);
    while (rays) {
        const int first = __builtin_ctz(rays);
        const __mmask16 alike =
            _mm512_mask_cmpeq_epi32_mask(_mm512_mask_cmpeq_epi32_mask(rays, dx, _mm512_set1_epi32(move_x[first])), dy,
                                         _mm512_set1_epi32(move_y[first]));
        uint16_t *to = landed + (ptrdiff_t)(y + move_y[first]) * (ptrdiff_t)stride + x + move_x[first];

        _mm256_mask_storeu_epi16(to, alike, _mm256_max_epu16(_mm256_maskz_loadu_epi16(alike, to), ray));
        rays &= (__mmask16)~alike;
    }
}

static void KERNEL(clear_land)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, const uint16_t *disp,
                               const uint8_t *state, int x, int y, int n)
{
    for (int i = 0; i < n; i += 16) {
        const __mmask16 inside = (__mmask16)(n - i >= 16 ? 0xFFFF : (1 << (n - i)) - 1);
        const __m128i states = _mm_maskz_loadu_epi8(inside, state + i);

        if (_mm_test_epi8_mask(states, states))
            KERNEL(clear_land_16)(landed, stride, v, _mm256_maskz_loadu_epi16(inside, disp + i), states, x + i, y);
    }
}
#elif defined(__AVX2__)
/* Whole pixels, rounded down, by which rays of 16 disparities move; at most 2^15 - 1. */
static inline __m256i KERNEL(clear_moved)(__m256i disp, float q6, float at_0)
{
    const __m256i zero = _mm256_setzero_si256();
    __m256i moved[2] = { _mm256_unpacklo_epi16(disp, zero), _mm256_unpackhi_epi16(disp, zero) };

    for (int j = 0; j < 2; j++) {
        const __m256 at = _mm256_mul_ps(_mm256_cvtepi32_ps(moved[j]), _mm256_set1_ps(q6));

        moved[j] = _mm256_cvttps_epi32(_mm256_floor_ps(_mm256_add_ps(at, _mm256_set1_ps(at_0))));
    }
    return _mm256_packs_epi32(moved[0], moved[1]);
}

/* Lanes 0 .. limit - 1 in all bits. */
static inline __m256i KERNEL(clear_within)(__m256i v, int limit)
{
    return _mm256_cmpeq_epi16(_mm256_min_epu16(v, _mm256_set1_epi16((short)(limit - 1))), v);
}

/* The rays of 16 pixels: those that move alike are stored at once, beside others that keep their value. */
static inline void KERNEL(clear_land_16)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, __m256i disp,
                                         __m128i state, int x, int y)
{
    const __m256i lane = _mm256_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __m256i states = _mm256_cvtepu8_epi16(state);
    const __m256i level = _mm256_add_epi16(_mm256_srl_epi16(disp, _mm_cvtsi32_si128(v->coarse)), _mm256_set1_epi16(1));
    const __m256i ray = _mm256_or_si256(_mm256_slli_epi16(level, 1), _mm256_srli_epi16(states, 1));
    const __m256i dx = KERNEL(clear_moved)(disp, v->x_q6, v->x_0), dy = KERNEL(clear_moved)(disp, v->y_q6, v->y_0);
    const __m256i to_x = _mm256_adds_epi16(dx, _mm256_add_epi16(lane, _mm256_set1_epi16((short)x)));
    const __m256i to_y = _mm256_adds_epi16(dy, _mm256_set1_epi16((short)y));
    const __m256i inside =
        _mm256_and_si256(KERNEL(clear_within)(to_x, v->width), KERNEL(clear_within)(to_y, v->height));
    __m256i left = _mm256_andnot_si256(_mm256_cmpeq_epi16(states, _mm256_setzero_si256()), inside);
    const ptrdiff_t end = (ptrdiff_t)stride * v->height;
    int16_t move_x[16], move_y[16];
    uint16_t value[16];
    unsigned rays = (unsigned)_mm256_movemask_epi8(left);

    if (!rays)
        return;
    _mm256_storeu_si256((__m256i *)(void *)move_x, dx);
    _mm256_storeu_si256((__m256i *)(void *)move_y, dy);
    do {
        const int first = __builtin_ctz(rays) / 2;
        const __m256i same = _mm256_and_si256(_mm256_cmpeq_epi16(dx, _mm256_set1_epi16(move_x[first])),
                                              _mm256_cmpeq_epi16(dy, _mm256_set1_epi16(move_y[first])));
        const __m256i alike = _mm256_and_si256(left, same), of_it = _mm256_and_si256(ray, alike);
        const ptrdiff_t at = (ptrdiff_t)(y + move_y[first]) * (ptrdiff_t)stride + x + move_x[first];

        left = _mm256_andnot_si256(same, left);
        rays = (unsigned)_mm256_movemask_epi8(left);
        if (at >= 0 && at + 16 <= end) {
            __m256i *to = (__m256i *)(void *)(landed + at);

            _mm256_storeu_si256(to, _mm256_max_epu16(_mm256_loadu_si256(to), of_it));
            continue;
        }
        _mm256_storeu_si256((__m256i *)(void *)value, of_it);
        for (int k = 0; k < 16; k++)
            if (value[k])
                landed[at + k] = landed[at + k] < value[k] ? value[k] : landed[at + k];
    } while (rays);
}

static void KERNEL(clear_land)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, const uint16_t *disp,
                               const uint8_t *state, int x, int y, int n)
{
    int i = 0;

    for (; i + 16 <= n && v->width <= INT16_MAX && v->height <= INT16_MAX; i += 16) {
        const __m128i states = _mm_loadu_si128((const __m128i *)(const void *)(state + i));

        if (!_mm_testz_si128(states, states))
            KERNEL(clear_land_16)(landed, stride, v, _mm256_loadu_si256((const __m256i *)(const void *)(disp + i)),
                                  states, x + i, y);
    }
    if (i < n)
        sst_clear_land_ref(landed, stride, v, disp + i, state + i, x + i, y, n - i);
}
#else
static void KERNEL(clear_land)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, const uint16_t *disp,
                               const uint8_t *state, int x, int y, int n)
{
    const unsigned w = (unsigned)v->width, h = (unsigned)v->height;
    int dx[SST_CLEAR_BLOCK], dy[SST_CLEAR_BLOCK];

    for (int from = 0; from < n; from += SST_CLEAR_BLOCK) {
        const int m = n - from < SST_CLEAR_BLOCK ? n - from : SST_CLEAR_BLOCK;

        for (int i = 0; i < m; i++) {
            const float q = disp[from + i], at_x = q * v->x_q6 + v->x_0, at_y = q * v->y_q6 + v->y_0;
            const int whole_x = (int)at_x, whole_y = (int)at_y;

            dx[i] = whole_x - ((float)whole_x > at_x);
            dy[i] = whole_y - ((float)whole_y > at_y);
        }
        for (int i = 0; i < m; i++) {
            const unsigned to_x = (unsigned)(x + from + i + dx[i]), to_y = (unsigned)(y + dy[i]);
            const unsigned ray = 2U * (unsigned)(disp[from + i] >> v->coarse) + 2 + (state[from + i] == SST_CLEAR_KEPT);

            if (state[from + i] && to_x < w && to_y < h && landed[to_y * stride + to_x] < ray)
                landed[to_y * stride + to_x] = (uint16_t)ray;
        }
    }
}
#endif

/* --- surface --- */

#define CLEAR_LANES (SIMD_BYTES / 2)

/* The surface of CLEAR_LANES pixels, the x-th and following of the block. */
static inline void KERNEL(clear_surface_lanes)(float *surface, const uint16_t *const *landed, size_t views, int x)
{
    const simd_u16 zero = simd_set_u16(0);
    simd_u16 top = zero, needed = zero;

    for (size_t k = 0; k < views; k++) {
        const simd_u16 at = simd_load_u16(landed[k] + x) >> 1;

        top = simd_max_u16(top, at);
        needed -= (simd_u16)(at != 0);
    }
    needed = simd_max_u16((needed + 3) >> 2, simd_set_u16(2));
    for (int i = 0; i < CLEAR_LANES; i++)
        surface[i] = 0;
    for (;;) {
        /* behind: sum of distances from the nearest ray, at most SST_CLEAR_TOLERANCE each. */
        simd_u16 count = zero, behind = zero, next = zero, found, left;
        unsigned any = 0;

        for (size_t k = 0; k < views; k++) {
            const simd_u16 at = simd_load_u16(landed[k] + x) >> 1, distance = top - at;
            const simd_u16 of_it =
                (simd_u16)(distance <= SST_CLEAR_TOLERANCE) & (simd_u16)(at <= top) & (simd_u16)(at != 0);

            count -= of_it;
            behind += distance & of_it;
            next = simd_max_u16(next, at & (simd_u16)(at < top));
        }
        found = (simd_u16)(count >= needed) & (simd_u16)(top != 0);
        left = next & ~found;
        for (int i = 0; i < CLEAR_LANES; i++) {
            const int sum = (int)count[i] * top[i] - behind[i];

            surface[i] = found[i] ? (float)sum / (float)count[i] : surface[i];
            any |= left[i];
        }
        if (!any)
            return;
        top = left;
    }
}

static void KERNEL(clear_surface)(float *surface, const uint16_t *const *landed, size_t views)
{
    for (int x = 0; x < SST_CLEAR_BLOCK; x += CLEAR_LANES)
        KERNEL(clear_surface_lanes)(surface + x, landed, views, x);
}
#undef CLEAR_LANES
