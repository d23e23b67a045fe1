/*
 * Dot products of 64 bytes. The instructions multiply unsigned by signed bytes: b is used as stored, a is made signed
 * again, and <a, b> = sum a (b + zero) - zero sum a. The vectors of one block of a are prepared once for all positions;
 * eight positions at a time hide the latency of the sums.
 */
#if defined(__AVX512VNNI__)
#define FEATURE_VEC                 __m512i
#define FEATURE_PIXELS              16
#define FEATURE_LOAD(p)             _mm512_loadu_si512(p)
#define FEATURE_XOR                 _mm512_xor_si512
#define FEATURE_SET8(v)             _mm512_set1_epi8((char)(v))
#define FEATURE_SET32               _mm512_set1_epi32
#define FEATURE_DOT                 _mm512_dpbusd_epi32
#define FEATURE_ADD                 _mm512_add_epi32
#define FEATURE_SUB                 _mm512_sub_epi32
#define FEATURE_SHIFT_LEFT(v, bits) _mm512_slli_epi32(v, bits)
#elif defined(__AVXVNNI__)
#define FEATURE_VEC                 __m256i
#define FEATURE_PIXELS              8
#define FEATURE_LOAD(p)             _mm256_loadu_si256((const __m256i *)(const void *)(p))
#define FEATURE_XOR                 _mm256_xor_si256
#define FEATURE_SET8(v)             _mm256_set1_epi8((char)(v))
#define FEATURE_SET32               _mm256_set1_epi32
#define FEATURE_DOT                 _mm256_dpbusd_avx_epi32
#define FEATURE_ADD                 _mm256_add_epi32
#define FEATURE_SUB                 _mm256_sub_epi32
#define FEATURE_SHIFT_LEFT(v, bits) _mm256_slli_epi32(v, bits)
#endif

#if defined(FEATURE_DOT)
#define FEATURE_PLACES 8

/* (whole - dot) >> shift, clamped. */
static inline void KERNEL(feature_store)(uint8_t *cost, FEATURE_VEC whole, FEATURE_VEC dot)
{
    const FEATURE_VEC left = FEATURE_SUB(whole, dot);
#if FEATURE_PIXELS == 16
    const __m512i c = _mm512_max_epi32(_mm512_srai_epi32(left, SST_FEATURE_SHIFT), _mm512_setzero_si512());

    _mm_storeu_si128((__m128i *)(void *)cost,
                     _mm_min_epu8(_mm512_cvtusepi32_epi8(c), _mm_set1_epi8((char)SST_FEATURE_COST_MAX)));
#else
    const __m256i c = _mm256_srai_epi32(left, SST_FEATURE_SHIFT);
    const __m128i half = _mm_packs_epi32(_mm256_castsi256_si128(c), _mm256_extracti128_si256(c, 1));

    _mm_storel_epi64((__m128i *)(void *)cost,
                     _mm_min_epu8(_mm_packus_epi16(half, half), _mm_set1_epi8((char)SST_FEATURE_COST_MAX)));
#endif
}

/*
 * One block of a, its vectors in v, against `places` (a compile-time constant) positions of b: the sums stay in
 * registers. Positions past the last one repeat it.
 */
static inline __attribute__((always_inline)) void KERNEL(feature_tile)(uint8_t *restrict cost, size_t cost_stride,
                                                                       const FEATURE_VEC *v, FEATURE_VEC whole,
                                                                       const uint8_t *const *b, size_t last, size_t at,
                                                                       size_t stride, const size_t places)
{
    const uint8_t *p[FEATURE_PLACES];
    FEATURE_VEC dot[FEATURE_PLACES];

#pragma GCC unroll 8
    for (size_t j = 0; j < places; j++) {
        p[j] = b[j < last ? j : last] + at;
        dot[j] = FEATURE_SET8(0);
    }
#pragma GCC unroll 1
    for (int g = 0; g < SST_FEATURE_CHANNELS / 4; g++) {
        const FEATURE_VEC a = v[g];

#pragma GCC unroll 8
        for (size_t j = 0; j < places; j++)
            dot[j] = FEATURE_DOT(dot[j], FEATURE_LOAD(p[j] + (size_t)g * stride), a);
    }
#pragma GCC unroll 8
    for (size_t j = 0; j < places; j++)
        KERNEL(feature_store)(cost + (j < last ? j : last) * cost_stride, whole, dot[j]);
}

static void KERNEL(feature_cost_rows)(uint8_t *restrict cost, size_t cost_stride, const uint8_t *restrict a,
                                      const uint8_t *const *b, size_t count, size_t stride, size_t n)
{
    enum { GROUPS = SST_FEATURE_CHANNELS / 4 };
    const FEATURE_VEC sign = FEATURE_SET8(SST_FEATURE_ZERO), one = FEATURE_SET8(1);

    for (size_t x = 0; x < n; x += FEATURE_PIXELS) {
        FEATURE_VEC v[GROUPS], whole = FEATURE_SET8(0);

        for (int g = 0; g < GROUPS; g++) {
            v[g] = FEATURE_XOR(FEATURE_LOAD(a + (size_t)g * stride + 4 * x), sign);
            whole = FEATURE_DOT(whole, one, v[g]);
        }
        /* SST_FEATURE_ZERO is 2^7. */
        whole = FEATURE_ADD(FEATURE_SHIFT_LEFT(whole, 7), FEATURE_SET32(SST_FEATURE_ONE * SST_FEATURE_ONE));
        for (size_t j = 0; j < count;) {
            const size_t left = count - j, places = left > FEATURE_PLACES / 2 ? FEATURE_PLACES : FEATURE_PLACES / 2;
            uint8_t *out = cost + j * cost_stride + x;

            if (places == FEATURE_PLACES)
                KERNEL(feature_tile)(out, cost_stride, v, whole, b + j, left - 1, 4 * x, stride, FEATURE_PLACES);
            else
                KERNEL(feature_tile)(out, cost_stride, v, whole, b + j, left - 1, 4 * x, stride, FEATURE_PLACES / 2);
            j += places;
        }
    }
}
#elif defined(__AVX2__)
/* Without byte dot products: 16-bit multiply-adds of neighbouring channels, two sums per pixel, added at the end. */
static void KERNEL(feature_cost_rows)(uint8_t *restrict cost, size_t cost_stride, const uint8_t *restrict a,
                                      const uint8_t *const *b, size_t count, size_t stride, size_t n)
{
    enum { PIXELS = 8, GROUPS = SST_FEATURE_CHANNELS / 4 };
    const __m256i sign = _mm256_set1_epi16(SST_FEATURE_ZERO);

    for (size_t x = 0; x < n; x += PIXELS) {
        __m256i v[GROUPS][2], sum = _mm256_setzero_si256();

        for (int g = 0; g < GROUPS; g++) {
            const __m128i *p = (const __m128i *)(const void *)(a + (size_t)g * stride + 4 * x);

            v[g][0] = _mm256_sub_epi16(_mm256_cvtepu8_epi16(_mm_loadu_si128(p)), sign);
            v[g][1] = _mm256_sub_epi16(_mm256_cvtepu8_epi16(_mm_loadu_si128(p + 1)), sign);
            sum = _mm256_add_epi32(
                sum, _mm256_hadd_epi32(_mm256_madd_epi16(v[g][0], sign), _mm256_madd_epi16(v[g][1], sign)));
        }
        sum = _mm256_add_epi32(sum, _mm256_set1_epi32(SST_FEATURE_ONE * SST_FEATURE_ONE));
        for (size_t j = 0; j < count; j++) {
            __m256i d0 = _mm256_setzero_si256(), d1 = d0, c;
            __m128i half;

            for (int g = 0; g < GROUPS; g++) {
                const __m128i *p = (const __m128i *)(const void *)(b[j] + (size_t)g * stride + 4 * x);

                d0 = _mm256_add_epi32(d0, _mm256_madd_epi16(v[g][0], _mm256_cvtepu8_epi16(_mm_loadu_si128(p))));
                d1 = _mm256_add_epi32(d1, _mm256_madd_epi16(v[g][1], _mm256_cvtepu8_epi16(_mm_loadu_si128(p + 1))));
            }
            /* hadd leaves pixels 0 1 4 5 | 2 3 6 7 */
            c = _mm256_srai_epi32(_mm256_sub_epi32(sum, _mm256_hadd_epi32(d0, d1)), SST_FEATURE_SHIFT);
            c = _mm256_permute4x64_epi64(c, 0xD8);
            half = _mm_packs_epi32(_mm256_castsi256_si128(c), _mm256_extracti128_si256(c, 1));
            _mm_storel_epi64((__m128i *)(void *)(cost + j * cost_stride + x),
                             _mm_min_epu8(_mm_packus_epi16(half, half), _mm_set1_epi8((char)SST_FEATURE_COST_MAX)));
        }
    }
}
#elif defined(__aarch64__)
#include "pipeline/kernels/arm/feature_cost_tmpl.h"
#else
static void KERNEL(feature_cost_rows)(uint8_t *restrict cost, size_t cost_stride, const uint8_t *restrict a,
                                      const uint8_t *const *b, size_t count, size_t stride, size_t n)
{
    sst_feature_cost_rows_ref(cost, cost_stride, a, b, count, stride, n);
}
#endif
#undef FEATURE_VEC
#undef FEATURE_PIXELS
#undef FEATURE_PLACES
#undef FEATURE_LOAD
#undef FEATURE_XOR
#undef FEATURE_SET8
#undef FEATURE_SET32
#undef FEATURE_DOT
#undef FEATURE_ADD
#undef FEATURE_SUB
#undef FEATURE_SHIFT_LEFT
