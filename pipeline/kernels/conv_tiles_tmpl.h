/* conv_spread, conv_products, conv_gather, conv_finish: AVX2. A block of results is two vectors; six tiles of such
 * blocks stay in registers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#if defined(__AVX2__)

/* One row or column of B d B^T. @param step  of in and out */
static inline void KERNEL(conv_spread_line)(__m256i *v, size_t step)
{
    const __m256i d0 = v[0], d1 = v[step], d2 = v[2 * step], d3 = v[3 * step], d4 = v[4 * step], d5 = v[5 * step];
    const __m256i even4 = _mm256_sub_epi16(d4, _mm256_slli_epi16(d2, 2));
    const __m256i odd4 = _mm256_sub_epi16(d3, _mm256_slli_epi16(d1, 2));
    const __m256i even1 = _mm256_sub_epi16(d4, d2), odd1 = _mm256_slli_epi16(_mm256_sub_epi16(d3, d1), 1);

    v[0] = _mm256_add_epi16(_mm256_sub_epi16(_mm256_slli_epi16(d0, 2), d2), even4);
    v[step] = _mm256_add_epi16(even4, odd4);
    v[2 * step] = _mm256_sub_epi16(even4, odd4);
    v[3 * step] = _mm256_add_epi16(even1, odd1);
    v[4 * step] = _mm256_sub_epi16(even1, odd1);
    v[5 * step] = _mm256_sub_epi16(_mm256_sub_epi16(d5, _mm256_slli_epi16(d3, 2)), odd4);
}

static void KERNEL(conv_spread)(int16_t *out, size_t stride, const uint8_t *const pixel[SST_CONV_PARTS],
                                size_t channels, int is_signed)
{
    __m256i v[SST_CONV_PARTS];

    for (size_t c = 0; c < channels; c += SST_CONV_BLOCK) {
        for (size_t k = 0; k < SST_CONV_PARTS; k++) {
            const __m128i bytes = _mm_loadu_si128((const __m128i *)(const void *)(pixel[k] + c));

            v[k] = is_signed ? _mm256_cvtepi8_epi16(bytes) : _mm256_cvtepu8_epi16(bytes);
        }
        for (size_t k = 0; k < SST_CONV_TILE; k++)
            KERNEL(conv_spread_line)(v + k, SST_CONV_TILE);
        for (size_t k = 0; k < SST_CONV_TILE; k++)
            KERNEL(conv_spread_line)(v + k * SST_CONV_TILE, 1);
        for (size_t k = 0; k < SST_CONV_PARTS; k++)
            _mm256_storeu_si256((__m256i *)(void *)(out + k * stride + c), v[k]);
    }
}

/* Products of n tiles. @param n  a constant */
static inline __attribute__((always_inline)) void
KERNEL(conv_products_of)(int32_t *out, const int16_t *tiles, const int16_t *weights, size_t channels, size_t n)
{
    __m256i sum[6][2];

    for (size_t i = 0; i < n; i++)
        sum[i][0] = sum[i][1] = _mm256_setzero_si256();
    for (size_t c = 0; c < channels; c += 2) {
        const __m256i *w = (const __m256i *)(const void *)(weights + c * SST_CONV_BLOCK);
        const __m256i low = _mm256_loadu_si256(w), high = _mm256_loadu_si256(w + 1);

        for (size_t i = 0; i < n; i++) {
            int32_t two;
            __m256i both;

            memcpy(&two, tiles + i * channels + c, sizeof(two));
            both = _mm256_set1_epi32(two);
            sum[i][0] = _mm256_add_epi32(sum[i][0], _mm256_madd_epi16(both, low));
            sum[i][1] = _mm256_add_epi32(sum[i][1], _mm256_madd_epi16(both, high));
        }
    }
    for (size_t i = 0; i < n; i++) {
        __m256i *to = (__m256i *)(void *)(out + i * SST_CONV_BLOCK);

        _mm256_storeu_si256(to, sum[i][0]);
        _mm256_storeu_si256(to + 1, sum[i][1]);
    }
}

static void KERNEL(conv_products)(int32_t *out, const int16_t *tiles, const int16_t *weights, size_t channels, size_t n)
{
    size_t i = 0;

    for (; i + 6 <= n; i += 6)
        KERNEL(conv_products_of)(out + i * SST_CONV_BLOCK, tiles + i * channels, weights, channels, 6);
    for (; i + 2 <= n; i += 2)
        KERNEL(conv_products_of)(out + i * SST_CONV_BLOCK, tiles + i * channels, weights, channels, 2);
    for (; i < n; i++)
        KERNEL(conv_products_of)(out + i * SST_CONV_BLOCK, tiles + i * channels, weights, channels, 1);
}

/* One row or column of A' m A'^T. */
static inline void KERNEL(conv_gather_line)(__m256i *out, size_t out_step, const __m256i *m, size_t step)
{
    const __m256i a = m[0], f = m[5 * step];
    const __m256i s = _mm256_slli_epi32(_mm256_add_epi32(m[step], m[2 * step]), 2);
    const __m256i t = _mm256_slli_epi32(_mm256_sub_epi32(m[step], m[2 * step]), 2);
    const __m256i u = _mm256_add_epi32(m[3 * step], m[4 * step]), v = _mm256_sub_epi32(m[3 * step], m[4 * step]);

    out[0] =
        _mm256_add_epi32(_mm256_add_epi32(_mm256_slli_epi32(a, 2), _mm256_slli_epi32(a, 1)), _mm256_add_epi32(s, u));
    out[out_step] = _mm256_add_epi32(t, _mm256_slli_epi32(v, 1));
    out[2 * out_step] = _mm256_add_epi32(s, _mm256_slli_epi32(u, 2));
    out[3 * out_step] = _mm256_add_epi32(_mm256_add_epi32(t, _mm256_slli_epi32(v, 3)),
                                         _mm256_add_epi32(_mm256_slli_epi32(f, 4), _mm256_slli_epi32(f, 3)));
}

static void KERNEL(conv_gather)(int32_t *out, const int32_t *m, size_t stride)
{
    const __m256i ninth = _mm256_set1_epi32((int)SST_CONV_NINTH);

    for (size_t half = 0; half < SST_CONV_BLOCK; half += 8) {
        __m256i in[SST_CONV_PARTS], rows[SST_CONV_OUT * SST_CONV_TILE], sum[SST_CONV_PIXELS];

        for (size_t k = 0; k < SST_CONV_PARTS; k++)
            in[k] = _mm256_loadu_si256((const __m256i *)(const void *)(m + k * stride + half));
        for (size_t k = 0; k < SST_CONV_TILE; k++)
            KERNEL(conv_gather_line)(rows + k, SST_CONV_TILE, in + k, SST_CONV_TILE);
        for (size_t k = 0; k < SST_CONV_OUT; k++)
            KERNEL(conv_gather_line)(sum + k * SST_CONV_OUT, 1, rows + k * SST_CONV_TILE, 1);
        for (size_t p = 0; p < SST_CONV_PIXELS; p++)
            _mm256_storeu_si256((__m256i *)(void *)(out + p * SST_CONV_BLOCK + half),
                                _mm256_srai_epi32(_mm256_mullo_epi32(sum[p], ninth), 6));
    }
}

static inline __m256 KERNEL(conv_residual)(const void *at, enum sst_conv_type type, size_t half)
{
    __m128i bytes;

    if (type == SST_CONV_F32)
        return _mm256_loadu_ps((const float *)at + half);
    bytes = _mm_loadl_epi64((const __m128i *)(const void *)((const uint8_t *)at + half));
    return _mm256_cvtepi32_ps(type == SST_CONV_U8 ? _mm256_cvtepu8_epi32(bytes) : _mm256_cvtepi8_epi32(bytes));
}

static inline void KERNEL(conv_store)(void *at, enum sst_conv_type type, size_t half, __m256 v)
{
    const float low = type == SST_CONV_U8 ? 0 : -128, high = type == SST_CONV_U8 ? 255 : 127;
    __m256i whole;
    __m128i words;

    if (type == SST_CONV_F32) {
        _mm256_storeu_ps((float *)at + half, v);
        return;
    }
    whole = _mm256_cvtps_epi32(_mm256_min_ps(_mm256_max_ps(v, _mm256_set1_ps(low)), _mm256_set1_ps(high)));
    words = _mm_packs_epi32(_mm256_castsi256_si128(whole), _mm256_extracti128_si256(whole, 1));
    words = type == SST_CONV_U8 ? _mm_packus_epi16(words, words) : _mm_packs_epi16(words, words);
    _mm_storel_epi64((__m128i *)(void *)((uint8_t *)at + half), words);
}

static void KERNEL(conv_finish)(void *const *to, const int32_t *sums, const struct sst_conv_finish *f)
{
    const struct sst_conv_finish by = *f;

    for (size_t half = 0; half < SST_CONV_BLOCK; half += 8) {
        const __m256 scale = _mm256_loadu_ps(by.scale + half), bias = _mm256_loadu_ps(by.bias + half);

        for (size_t p = 0; p < SST_CONV_PIXELS; p++) {
            const __m256i sum = _mm256_loadu_si256((const __m256i *)(const void *)(sums + p * SST_CONV_BLOCK + half));
            __m256 v = _mm256_cvtepi32_ps(sum);

            if (!to[p])
                continue;
            v = by.bias_first ? _mm256_mul_ps(_mm256_add_ps(v, bias), scale)
                              : _mm256_add_ps(_mm256_mul_ps(v, scale), bias);
            if (by.residual != SST_CONV_NONE)
                v = _mm256_fmadd_ps(KERNEL(conv_residual)(to[p], by.residual, half), _mm256_set1_ps(by.residual_scale),
                                    v);
            if (by.relu)
                v = _mm256_max_ps(v, _mm256_setzero_ps());
            KERNEL(conv_store)(to[p], by.type, half, v);
        }
    }
}
#else
static void KERNEL(conv_spread)(int16_t *out, size_t stride, const uint8_t *const pixel[SST_CONV_PARTS],
                                size_t channels, int is_signed)
{
    sst_conv_spread_ref(out, stride, pixel, channels, is_signed);
}

static void KERNEL(conv_products)(int32_t *out, const int16_t *tiles, const int16_t *weights, size_t channels, size_t n)
{
    sst_conv_products_ref(out, tiles, weights, channels, n);
}

static void KERNEL(conv_gather)(int32_t *out, const int32_t *m, size_t stride)
{
    sst_conv_gather_ref(out, m, stride);
}

static void KERNEL(conv_finish)(void *const *to, const int32_t *sums, const struct sst_conv_finish *f)
{
    sst_conv_finish_ref(to, sums, f);
}
#endif
