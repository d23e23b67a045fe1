/* Windows of posed views: column sums moved from row to row, their sums across, means, correlations. Plain loops that
 * compilers vectorise, but for the best of several correlations, which stay in registers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/root_inverse.h"

#define WINDOW_BLOCK 64

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

static inline int32_t KERNEL(window_across)(const int32_t *c)
{
    return c[0] + c[1] + c[2] + c[3] + c[4] + c[5] + c[6];
}

static void KERNEL(window_stats)(float *mean, float *inverse, const struct sst_window_sums *in, size_t n)
{
    const int32_t *restrict sum = in->sum, *restrict squares = in->squares;
    const uint8_t *restrict a = in->seen[0], *restrict b = in->seen[1];
    float *restrict m = mean, *restrict out = inverse;
    const float least = in->floor;

    for (size_t x = 0; x < n; x++) {
        const float level = (float)KERNEL(window_across)(sum + x) * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE));
        const float square = (float)KERNEL(window_across)(squares + x) *
                             (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE * SST_LEVEL_ONE));
        const float v = square - level * level;

        m[x] = level;
        out[x] = sst_root_inverse((v > 0 ? v : 0) + least);
    }
    if (a) {
        for (size_t x = 0; x < n; x++) {
            const uint8_t seen = a[x] & a[x + SST_WINDOW - 1] & b[x] & b[x + SST_WINDOW - 1];

            out[x] = seen ? out[x] : 0;
        }
    }
}

#if defined(__AVX2__)

#if SIMD_BYTES == 64
#define WINDOW_OP(name) _mm512_##name
#define WINDOW_FLOAT    __m512
#else
#define WINDOW_OP(name) _mm256_##name
#define WINDOW_FLOAT    __m256
#endif
#define WINDOW_LANES (SIMD_BYTES / 4)

static inline simd_f32 KERNEL(window_more)(simd_f32 a, simd_f32 b)
{
    return (simd_f32)WINDOW_OP(max_ps)((WINDOW_FLOAT)a, (WINDOW_FLOAT)b); /* b where they are equal */
}

static inline simd_f32 KERNEL(window_less)(simd_f32 a, simd_f32 b)
{
    return (simd_f32)WINDOW_OP(min_ps)((WINDOW_FLOAT)a, (WINDOW_FLOAT)b);
}

/* Means of products of a vector of windows. */
static inline simd_f32 KERNEL(window_both)(const int32_t *c)
{
    simd_s32 sum = simd_load_s32(c);

    for (int i = 1; i < SST_WINDOW; i++)
        sum += simd_load_s32(c + i);
    return __builtin_convertvector(sum, simd_f32) * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE * SST_LEVEL_ONE));
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
            KERNEL(window_both)(row->products[k] + x) - mean * other + least * KERNEL(window_more)(alike, zero);
        const simd_f32 v = covariance * inverse * simd_load_f32(row->other_inverse[k] + x);

        second = KERNEL(window_more)(KERNEL(window_less)(v, first), second);
        first = KERNEL(window_more)(v, first);
    }
    simd_store_f32(largest + x, KERNEL(window_more)(simd_load_f32(largest + x), (first + second) * 0.5f));
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

#undef WINDOW_OP
#undef WINDOW_FLOAT
#undef WINDOW_LANES

#else

static void KERNEL(window_best)(float *largest, const struct sst_window_row *row, size_t n)
{
    sst_window_best_ref(largest, row, n);
}

#endif

static void KERNEL(window_agree)(uint8_t *first, uint8_t *second, const struct sst_window_pair *pair, size_t n)
{
    const int32_t *restrict products = pair->products;
    const float *restrict mean = pair->mean[0], *restrict other = pair->mean[1];
    const float *restrict inverse = pair->inverse[0], *restrict other_inverse = pair->inverse[1];
    const float enough = pair->enough;
    uint8_t *restrict a = first, *restrict b = second;

    for (size_t from = 0; from < n; from += WINDOW_BLOCK) {
        const size_t end = n - from < WINDOW_BLOCK ? n : from + WINDOW_BLOCK;
        int32_t agrees[WINDOW_BLOCK]; /* compilers do not compare floats and count bytes in one loop */

        for (size_t x = from; x < end; x++) {
            const float both = (float)KERNEL(window_across)(products + x) *
                               (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE * SST_LEVEL_ONE));

            agrees[x - from] = (both - mean[x] * other[x]) * inverse[x] * other_inverse[x] > enough;
        }
        for (size_t x = from; x < end; x++) {
            a[x] = (uint8_t)(a[x] + agrees[x - from]);
            b[x] = (uint8_t)(b[x] + agrees[x - from]);
        }
    }
}

static void KERNEL(weighted_add)(const struct sst_weighted_sums *sums, const struct sst_weighted_rays *rays, size_t n)
{
    const uint32_t *restrict w = rays->weight;
    const uint16_t *restrict seen = rays->count;
    uint32_t *restrict weight = sums->weight;
    uint16_t *restrict count = sums->count;

    for (int c = 0; c < rays->channels; c++) {
        const uint32_t *restrict v = rays->level[c];
        uint32_t *restrict sum = sums->level[c];
        float *restrict weighted = sums->weighted[c];

        for (size_t x = 0; x < n; x++) {
            sum[x] += v[x];
            weighted[x] += (float)(int32_t)v[x] * (float)(int32_t)w[x];
        }
    }
    for (size_t x = 0; x < n; x++)
        weight[x] += w[x];
    for (size_t x = 0; x < n; x++)
        count[x] = (uint16_t)(count[x] + seen[x]);
}

#undef WINDOW_BLOCK
