/* Dot products of channel pairs: 16-bit multiply-adds of neighbours into 32-bit sums, 64 pixels at a time. */
#if defined(__AVX512BW__)
#define FEATURE_LANES 16
#define FEATURE_VEC __m512i
#define FEATURE_ZERO _mm512_setzero_si512()
#define FEATURE_LOAD(p) _mm512_cvtepi8_epi16(_mm256_loadu_si256((const __m256i *)(const void *)(p)))
#define FEATURE_MULADD(s, a, b) _mm512_add_epi32(s, _mm512_madd_epi16(a, b))
#define FEATURE_STORE(p, v) _mm512_storeu_si512(p, v)
#elif defined(__AVX2__)
#define FEATURE_LANES 8
#define FEATURE_VEC __m256i
#define FEATURE_ZERO _mm256_setzero_si256()
#define FEATURE_LOAD(p) _mm256_cvtepi8_epi16(_mm_loadu_si128((const __m128i *)(const void *)(p)))
#define FEATURE_MULADD(s, a, b) _mm256_add_epi32(s, _mm256_madd_epi16(a, b))
#define FEATURE_STORE(p, v) _mm256_storeu_si256((__m256i *)(void *)(p), v)
#endif

static void KERNEL(feature_cost_row)(uint8_t *restrict cost, const int8_t *restrict a, const int8_t *restrict b,
                                     size_t stride, size_t n)
{
#ifdef FEATURE_LANES
    enum { BLOCK = 4 * FEATURE_LANES };
    int32_t dot[BLOCK];
    size_t x = 0;

    for (; n - x >= BLOCK; x += BLOCK) {
        const int8_t *pa = a + 2 * x, *pb = b + 2 * x;
        FEATURE_VEC s0 = FEATURE_ZERO, s1 = s0, s2 = s0, s3 = s0;

        for (int k = 0; k < 32; k++, pa += stride, pb += stride) {
            s0 = FEATURE_MULADD(s0, FEATURE_LOAD(pa), FEATURE_LOAD(pb));
            s1 = FEATURE_MULADD(s1, FEATURE_LOAD(pa + 2 * FEATURE_LANES), FEATURE_LOAD(pb + 2 * FEATURE_LANES));
            s2 = FEATURE_MULADD(s2, FEATURE_LOAD(pa + 4 * FEATURE_LANES), FEATURE_LOAD(pb + 4 * FEATURE_LANES));
            s3 = FEATURE_MULADD(s3, FEATURE_LOAD(pa + 6 * FEATURE_LANES), FEATURE_LOAD(pb + 6 * FEATURE_LANES));
        }
        FEATURE_STORE(dot, s0);
        FEATURE_STORE(dot + FEATURE_LANES, s1);
        FEATURE_STORE(dot + 2 * FEATURE_LANES, s2);
        FEATURE_STORE(dot + 3 * FEATURE_LANES, s3);
        for (int i = 0; i < BLOCK; i++) {
            const int c = (SST_FEATURE_ONE * SST_FEATURE_ONE - dot[i]) >> SST_FEATURE_SHIFT;

            cost[x + (size_t)i] = (uint8_t)(c < 0 ? 0 : c > SST_COST_MAX ? SST_COST_MAX : c);
        }
    }
    sst_feature_cost_row_ref(cost + x, a + 2 * x, b + 2 * x, stride, n - x);
#else
    sst_feature_cost_row_ref(cost, a, b, stride, n);
#endif
}
#undef FEATURE_LANES
#undef FEATURE_VEC
#undef FEATURE_ZERO
#undef FEATURE_LOAD
#undef FEATURE_MULADD
#undef FEATURE_STORE
