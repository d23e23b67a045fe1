/* Windows of posed views: column sums moved from row to row, their sums across, means, correlations. Plain loops that
 * compilers vectorise; from the sums across on in vectors, which compilers make half as fast. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#include "pipeline/kernels/simd.h"

static void KERNEL(window_squares)(int32_t *sum, int32_t *squares, const int16_t *const row[2], size_t n)
{
    const int16_t *restrict in = row[0], *restrict old = row[1];
    int32_t *restrict s = sum, *restrict q = squares;

    for (size_t x = 0; x < n; x++) {
        s[x] += in[x] - old[x];
        q[x] += in[x] * in[x] - old[x] * old[x];
    }
}

static void KERNEL(window_products)(int32_t *sum, const int16_t *const a[2], const int16_t *const b[2], size_t n)
{
    const int16_t *restrict in = a[0], *restrict old = a[1], *restrict other = b[0], *restrict other_old = b[1];
    int32_t *restrict s = sum;

    for (size_t x = 0; x < n; x++)
        s[x] += in[x] * other[x] - old[x] * other_old[x];
}

#define WINDOW_LANES (SIMD_BYTES / 4)
#define WINDOW_BLOCK 64

static inline simd_f32 KERNEL(window_sums)(const int32_t *c)
{
    simd_s32 sum = simd_load_s32(c);

    for (int i = 1; i < SST_WINDOW; i++)
        sum += simd_load_s32(c + i);
    return __builtin_convertvector(sum, simd_f32);
}

/* Means of products of a vector of windows. */
static inline simd_f32 KERNEL(window_both)(const int32_t *c)
{
    return KERNEL(window_sums)(c) * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE * SST_LEVEL_ONE));
}

/* As sst_root_inverse(). */
static inline simd_f32 KERNEL(window_root)(simd_f32 v)
{
    const simd_f32 half = v * 0.5f;
    simd_f32 y = (simd_f32)(0x5f375a86 - ((simd_s32)v >> 1));

    y *= 1.5f - half * y * y;
    return y * (1.5f - half * y * y);
}

static inline void KERNEL(window_stats_at)(float *mean, float *inverse, const struct sst_window_sums *in, size_t x)
{
    const simd_f32 m = KERNEL(window_sums)(in->sum + x) * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE));
    const simd_f32 v = KERNEL(window_both)(in->squares + x) - m * m;

    simd_store_f32(mean + x, m);
    simd_store_f32(inverse + x, KERNEL(window_root)(simd_more_f32(v, simd_set_f32(0)) + in->floor));
}

/* 0 for windows with an unseen corner. */
static void KERNEL(window_mask)(float *restrict inverse, const uint8_t *restrict a, const uint8_t *restrict b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint8_t seen = a[x] & a[x + SST_WINDOW - 1] & b[x] & b[x + SST_WINDOW - 1];

        inverse[x] = seen ? inverse[x] : 0;
    }
}

/* The last vector measures some windows again, which changes nothing. */
static void KERNEL(window_stats)(float *mean, float *inverse, const struct sst_window_sums *in, size_t n)
{
    if (n < WINDOW_LANES) {
        sst_window_stats_ref(mean, inverse, in, n);
        return;
    }
    for (size_t x = 0; x + WINDOW_LANES <= n; x += WINDOW_LANES)
        KERNEL(window_stats_at)(mean, inverse, in, x);
    if (n % WINDOW_LANES)
        KERNEL(window_stats_at)(mean, inverse, in, n - WINDOW_LANES);
    if (in->seen[0])
        KERNEL(window_mask)(inverse, in->seen[0], in->seen[1], n);
}

static inline void KERNEL(window_best_at)(float *largest, const struct sst_window_row *row, size_t x)
{
    const simd_f32 zero = simd_set_f32(0), mean = simd_load_f32(row->mean + x), least = simd_set_f32(row->floor);
    const simd_f32 inverse = simd_load_f32(row->inverse + x);
    simd_f32 first = zero, second = zero;

    for (size_t k = 0; k < row->others; k++) {
        const simd_f32 other = simd_load_f32(row->other_mean[k] + x), apart = mean - other;
        const simd_f32 alike = 1.0f - (simd_f32)((simd_s32)apart & 0x7FFFFFFF);
        const simd_f32 covariance =
            KERNEL(window_both)(row->products[k] + x) - mean * other + least * simd_more_f32(alike, zero);
        const simd_f32 v = covariance * inverse * simd_load_f32(row->other_inverse[k] + x);

        second = simd_more_f32(simd_less_f32(v, first), second);
        first = simd_more_f32(v, first);
    }
    simd_store_f32(largest + x, simd_more_f32(simd_load_f32(largest + x), (first + second) * 0.5f));
}

/* The last vector compares some windows again, which changes nothing. */
static void KERNEL(window_best)(float *largest, const struct sst_window_row *row, size_t n)
{
    if (n < WINDOW_LANES) {
        sst_window_best_ref(largest, row, n);
        return;
    }
    for (size_t x = 0; x + WINDOW_LANES <= n; x += WINDOW_LANES)
        KERNEL(window_best_at)(largest, row, x);
    if (n % WINDOW_LANES)
        KERNEL(window_best_at)(largest, row, n - WINDOW_LANES);
}

static void KERNEL(window_agree)(uint8_t *first, uint8_t *second, const struct sst_window_pair *pair, size_t n)
{
    for (size_t from = 0; from < n; from += WINDOW_BLOCK) {
        const size_t count = n - from < WINDOW_BLOCK ? n - from : WINDOW_BLOCK;
        uint8_t *restrict a = first + from, *restrict b = second + from;
        int32_t agrees[WINDOW_BLOCK];
        size_t x = 0;

        for (; x + WINDOW_LANES <= count; x += WINDOW_LANES) {
            const size_t at = from + x;
            const simd_f32 v = KERNEL(window_both)(pair->products + at) -
                               simd_load_f32(pair->mean[0] + at) * simd_load_f32(pair->mean[1] + at);
            const simd_f32 correlation =
                v * simd_load_f32(pair->inverse[0] + at) * simd_load_f32(pair->inverse[1] + at);

            simd_store_s32(agrees + x, -(simd_s32)(correlation > pair->enough));
        }
        for (size_t i = 0; i < x; i++) {
            a[i] = (uint8_t)(a[i] + agrees[i]);
            b[i] = (uint8_t)(b[i] + agrees[i]);
        }
        if (x < count) {
            const size_t at = from + x;
            const struct sst_window_pair rest = { { pair->mean[0] + at, pair->mean[1] + at },
                                                  { pair->inverse[0] + at, pair->inverse[1] + at },
                                                  pair->products + at,
                                                  pair->enough };

            sst_window_agree_ref(first + at, second + at, &rest, count - x);
        }
    }
}

#undef WINDOW_LANES
#undef WINDOW_BLOCK

static void KERNEL(weighted_add)(const struct sst_weighted_sums *sums, const struct sst_weighted_rays *rays, size_t n)
{
    const uint32_t *restrict w = rays->weight;
    const uint16_t *restrict seen = rays->count;
    const uint32_t half = 1u << (SST_WEIGHTED_SHIFT - 1);
    uint32_t *restrict weight = sums->weight;
    uint16_t *restrict count = sums->count;

    for (int c = 0; c < rays->channels; c++) {
        const uint32_t *restrict v = rays->level[c];
        uint32_t *restrict sum = sums->level[c];
        float *restrict weighted = sums->weighted[c];

        for (size_t x = 0; x < n; x++) {
            sum[x] += v[x];
            weighted[x] += (float)(int32_t)v[x] * (float)(int32_t)((w[x] + half) >> SST_WEIGHTED_SHIFT);
        }
    }
    for (size_t x = 0; x < n; x++)
        weight[x] += (w[x] + half) >> SST_WEIGHTED_SHIFT;
    for (size_t x = 0; x < n; x++)
        count[x] = (uint16_t)(count[x] + seen[x]);
}

