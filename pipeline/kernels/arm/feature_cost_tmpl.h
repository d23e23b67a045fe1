/*
 * feature_cost_rows with NEON: eight or four pixels against eight positions at a time, whose sums stay in registers.
 * Without dot products these sums have 16 bits for each channel of four: parts of unit vectors have products within 2^15.
 */
#define FEATURE_PLACES 8

#if defined(__ARM_FEATURE_DOTPROD)
#define FEATURE_FOURS 2 /* pixels / 4 */
typedef int32x4_t KERNEL(feature_sum);
#define FEATURE_ZEROS vdupq_n_s32(0)
#define FEATURE_DOT(s) (s)
#else
#define FEATURE_FOURS 1
typedef int16x8x2_t KERNEL(feature_sum);
#define FEATURE_ZEROS ((int16x8x2_t){ { vdupq_n_s16(0), vdupq_n_s16(0) } })
#define FEATURE_DOT(s) vpaddq_s32(vpaddlq_s16((s).val[0]), vpaddlq_s16((s).val[1]))
#endif

/* Add the products of a and b, which is as stored. */
static inline KERNEL(feature_sum) KERNEL(feature_add)(KERNEL(feature_sum) sum, uint8x16_t b, int8x16_t a)
{
#if defined(__ARM_FEATURE_MATMUL_INT8)
    return vusdotq_s32(sum, b, a);
#else
    const int8x16_t v = vreinterpretq_s8_u8(veorq_u8(b, vdupq_n_u8(SST_FEATURE_ZERO)));

#if defined(__ARM_FEATURE_DOTPROD)
    return vdotq_s32(sum, v, a);
#else
    sum.val[0] = vmlal_s8(sum.val[0], vget_low_s8(v), vget_low_s8(a));
    sum.val[1] = vmlal_high_s8(sum.val[1], v, a);
    return sum;
#endif
#endif
}

static inline void KERNEL(feature_store)(uint8_t *cost, const int32x4_t *whole, const KERNEL(feature_sum) * sum)
{
    uint16x4_t c[2];
    uint8x8_t bytes;

    for (int i = 0; i < FEATURE_FOURS; i++)
        c[i] = vqshrun_n_s32(vsubq_s32(whole[i], FEATURE_DOT(sum[i])), SST_FEATURE_SHIFT);
    bytes = vmin_u8(vqmovn_u16(vcombine_u16(c[0], c[FEATURE_FOURS - 1])), vdup_n_u8(SST_FEATURE_COST_MAX));
    memcpy(cost, &bytes, 4 * FEATURE_FOURS);
}

/* One block of a against `places` (a compile-time constant) positions of b. Positions past the last one repeat it. */
static inline __attribute__((always_inline)) void KERNEL(feature_tile)(uint8_t *restrict cost, size_t cost_stride,
                                                                       int8x16_t (*a)[FEATURE_FOURS],
                                                                       const int32x4_t *whole, const uint8_t *const *b,
                                                                       size_t last, size_t at, size_t stride,
                                                                       const size_t places)
{
    const uint8_t *p[FEATURE_PLACES];
    KERNEL(feature_sum) sum[FEATURE_PLACES][FEATURE_FOURS];

#pragma GCC unroll 8
    for (size_t j = 0; j < places; j++) {
        p[j] = b[j < last ? j : last] + at;
        for (int i = 0; i < FEATURE_FOURS; i++)
            sum[j][i] = FEATURE_ZEROS;
    }
#pragma GCC unroll 1
    for (int g = 0; g < SST_FEATURE_CHANNELS / 4; g++) {
#pragma GCC unroll 8
        for (size_t j = 0; j < places; j++) {
            for (int i = 0; i < FEATURE_FOURS; i++)
                sum[j][i] = KERNEL(feature_add)(sum[j][i], vld1q_u8(p[j] + (size_t)g * stride + 16 * i), a[g][i]);
        }
    }
#pragma GCC unroll 8
    for (size_t j = 0; j < places; j++)
        KERNEL(feature_store)(cost + (j < last ? j : last) * cost_stride, whole, sum[j]);
}

static void KERNEL(feature_cost_rows)(uint8_t *restrict cost, size_t cost_stride, const uint8_t *restrict a,
                                      const uint8_t *const *b, size_t count, size_t stride, size_t n)
{
    for (size_t x = 0; x < n; x += 4 * FEATURE_FOURS) {
        int8x16_t v[SST_FEATURE_CHANNELS / 4][FEATURE_FOURS];
        int32x4_t whole[FEATURE_FOURS];

        for (int i = 0; i < FEATURE_FOURS; i++) {
            int32x4_t total = vdupq_n_s32(0);

            for (int g = 0; g < SST_FEATURE_CHANNELS / 4; g++) {
                const uint8x16_t stored = vld1q_u8(a + (size_t)g * stride + 4 * x + 16 * (size_t)i);

                v[g][i] = vreinterpretq_s8_u8(veorq_u8(stored, vdupq_n_u8(SST_FEATURE_ZERO)));
#if defined(__ARM_FEATURE_MATMUL_INT8)
                total = vdotq_s32(total, vdupq_n_s8(1), v[g][i]);
#endif
            }
            /* Where b is not made signed, its products are SST_FEATURE_ZERO sum a larger. */
            whole[i] = vmlaq_n_s32(vdupq_n_s32(SST_FEATURE_ONE * SST_FEATURE_ONE), total, SST_FEATURE_ZERO);
        }
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
#undef FEATURE_FOURS
#undef FEATURE_ZEROS
