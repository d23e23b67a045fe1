/* pipeline/kernels/simd.h - vectors as wide as a CPU level has: templates in them are written once. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_SIMD_H
#define SST_PIPELINE_KERNELS_SIMD_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#if defined(__AVX512BW__)
#define SIMD_BYTES 64
#define SIMD_LANES { 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15 } /* of 32 bits */
#elif defined(__AVX2__)
#define SIMD_BYTES 32
#define SIMD_LANES { 0, 1, 2, 3, 4, 5, 6, 7 }
#else
#define SIMD_BYTES 16
#define SIMD_LANES { 0, 1, 2, 3 }
#endif

/* Vectors of the compiler: + - * & | ^ ~ << >> and comparisons, which give all bits of a lane, work on them. Whole
 * numbers are moved in lanes of 64 bits: bytes would be loaded twice where two instructions use them. */
#define SIMD_TYPE(name, type, moved)                                                                                   \
    typedef type simd_##name __attribute__((vector_size(SIMD_BYTES)));                                                 \
    typedef moved simd_##name##_there __attribute__((vector_size(SIMD_BYTES), aligned(1), may_alias));                 \
    static inline simd_##name simd_load_##name(const type *p)                                                          \
    {                                                                                                                  \
        const simd_##name##_there v = *(const simd_##name##_there *)p;                                                 \
                                                                                                                       \
        return (simd_##name)v;                                                                                         \
    }                                                                                                                  \
    static inline void simd_store_##name(type *p, simd_##name v)                                                       \
    {                                                                                                                  \
        *(simd_##name##_there *)p = (simd_##name##_there)v;                                                            \
    }                                                                                                                  \
    static inline simd_##name simd_set_##name(type v)                                                                  \
    {                                                                                                                  \
        return v - (simd_##name){ 0 };                                                                                 \
    }
SIMD_TYPE(u8, uint8_t, uint64_t)
SIMD_TYPE(u16, uint16_t, uint64_t)
SIMD_TYPE(u32, uint32_t, uint64_t)
SIMD_TYPE(s32, int32_t, uint64_t)
SIMD_TYPE(f32, float, float)
#undef SIMD_TYPE

/* --- min, max, mean rounded up, more and less: sum and difference that saturate, apart: |a - b| --- */

#define SIMD_TWO(name, type, own, result)                                                                              \
    static inline simd_##type simd_##name##_##type(simd_##type a_, simd_##type b_)                                     \
    {                                                                                                                  \
        const own a = (own)a_, b = (own)b_;                                                                            \
                                                                                                                       \
        return (simd_##type)(result);                                                                                  \
    }
#if defined(__SSE2__)
#if SIMD_BYTES == 64
#define SIMD_OP(name)   _mm512_##name
#define SIMD_INT        __m512i
#define SIMD_SPREAD     _mm512_broadcast_i32x4
#elif SIMD_BYTES == 32
#define SIMD_OP(name)   _mm256_##name
#define SIMD_INT        __m256i
#define SIMD_SPREAD     _mm256_broadcastsi128_si256
#else
#define SIMD_OP(name)   _mm_##name
#define SIMD_INT        __m128i
#endif
SIMD_TWO(min, u8, SIMD_INT, SIMD_OP(min_epu8)(a, b))
SIMD_TWO(max, u8, SIMD_INT, SIMD_OP(max_epu8)(a, b))
SIMD_TWO(mean, u8, SIMD_INT, SIMD_OP(avg_epu8)(a, b))
SIMD_TWO(more, u8, SIMD_INT, SIMD_OP(adds_epu8)(a, b))
SIMD_TWO(less, u8, SIMD_INT, SIMD_OP(subs_epu8)(a, b))
SIMD_TWO(less, u16, SIMD_INT, SIMD_OP(subs_epu16)(a, b))
SIMD_TWO(apart, u8, SIMD_INT, SIMD_OP(sub_epi8)(SIMD_OP(max_epu8)(a, b), SIMD_OP(min_epu8)(a, b)))
#elif defined(__ARM_NEON)
SIMD_TWO(min, u8, uint8x16_t, vminq_u8(a, b))
SIMD_TWO(max, u8, uint8x16_t, vmaxq_u8(a, b))
SIMD_TWO(mean, u8, uint8x16_t, vrhaddq_u8(a, b))
SIMD_TWO(more, u8, uint8x16_t, vqaddq_u8(a, b))
SIMD_TWO(less, u8, uint8x16_t, vqsubq_u8(a, b))
SIMD_TWO(less, u16, uint16x8_t, vqsubq_u16(a, b))
SIMD_TWO(apart, u8, uint8x16_t, vabdq_u8(a, b))
#else
SIMD_TWO(less, u8, simd_u8, (a - b) & (simd_u8)(a > b))
SIMD_TWO(min, u8, simd_u8, a - simd_less_u8(a, b))
SIMD_TWO(max, u8, simd_u8, b + simd_less_u8(a, b))
SIMD_TWO(mean, u8, simd_u8, (a | b) - ((a ^ b) >> 1))
SIMD_TWO(more, u8, simd_u8, (a + b) | (simd_u8)(a + b < a))
SIMD_TWO(less, u16, simd_u16, (a - b) & (simd_u16)(a > b))
SIMD_TWO(apart, u8, simd_u8, simd_less_u8(a, b) | simd_less_u8(b, a))
#endif
#if defined(__AVX2__)
SIMD_TWO(min, u16, SIMD_INT, SIMD_OP(min_epu16)(a, b))
SIMD_TWO(max, u16, SIMD_INT, SIMD_OP(max_epu16)(a, b))
#elif defined(__ARM_NEON)
SIMD_TWO(min, u16, uint16x8_t, vminq_u16(a, b))
SIMD_TWO(max, u16, uint16x8_t, vmaxq_u16(a, b))
#else
SIMD_TWO(min, u16, simd_u16, a - simd_less_u16((simd_u16)a, (simd_u16)b))
SIMD_TWO(max, u16, simd_u16, b + simd_less_u16((simd_u16)a, (simd_u16)b))
#endif
#undef SIMD_TWO

/* --- more and less of floats: the larger or smaller one, b where they are equal --- */

#if defined(__SSE2__)
#if SIMD_BYTES == 64
#define SIMD_FLOAT __m512
#elif SIMD_BYTES == 32
#define SIMD_FLOAT __m256
#else
#define SIMD_FLOAT __m128
#endif
static inline simd_f32 simd_more_f32(simd_f32 a, simd_f32 b)
{
    return (simd_f32)SIMD_OP(max_ps)((SIMD_FLOAT)a, (SIMD_FLOAT)b);
}

static inline simd_f32 simd_less_f32(simd_f32 a, simd_f32 b)
{
    return (simd_f32)SIMD_OP(min_ps)((SIMD_FLOAT)a, (SIMD_FLOAT)b);
}
#else
static inline simd_f32 simd_more_f32(simd_f32 a, simd_f32 b)
{
    const simd_s32 m = (simd_s32)(a > b);

    return (simd_f32)(((simd_s32)a & m) | ((simd_s32)b & ~m));
}

static inline simd_f32 simd_less_f32(simd_f32 a, simd_f32 b)
{
    const simd_s32 m = (simd_s32)(a < b);

    return (simd_f32)(((simd_s32)a & m) | ((simd_s32)b & ~m));
}
#endif

/* --- lanes that are equal, and a choice of two vectors by them --- */

#if SIMD_BYTES == 64
typedef __mmask64 simd_same8;

static inline simd_same8 simd_same_u8(simd_u8 a, simd_u8 b)
{
    return _mm512_cmpeq_epu8_mask((__m512i)a, (__m512i)b);
}

static inline simd_u8 simd_pick_u8(simd_same8 m, simd_u8 yes, simd_u8 no)
{
    return (simd_u8)_mm512_mask_blend_epi8(m, (__m512i)no, (__m512i)yes);
}
#else
typedef simd_u8 simd_same8;

static inline simd_same8 simd_same_u8(simd_u8 a, simd_u8 b)
{
    return (simd_u8)(a == b);
}

static inline simd_u8 simd_pick_u8(simd_same8 m, simd_u8 yes, simd_u8 no)
{
    return (yes & m) | (no & ~m);
}
#endif

/* --- a bit that is set in any lane --- */

static inline bool simd_any_u32(simd_u32 v)
{
#if SIMD_BYTES == 64
    return _mm512_test_epi32_mask((__m512i)v, (__m512i)v) != 0;
#elif SIMD_BYTES == 32
    return !_mm256_testz_si256((__m256i)v, (__m256i)v);
#elif defined(__ARM_NEON)
    return vmaxvq_u32((uint32x4_t)v) != 0;
#else
    return (v[0] | v[1] | v[2] | v[3]) != 0;
#endif
}

/* --- the least of 16 bits, and where it is --- */

static inline uint16_t simd_least_u16(simd_u16 v)
{
#if defined(__ARM_NEON)
    return vminvq_u16((uint16x8_t)v);
#elif defined(__SSE2__)
#if SIMD_BYTES == 64
    const __m256i half = _mm256_min_epu16(_mm512_castsi512_si256((__m512i)v), _mm512_extracti64x4_epi64((__m512i)v, 1));
#elif SIMD_BYTES == 32
    const __m256i half = (__m256i)v;
#endif
#if SIMD_BYTES > 16
    const __m128i least = _mm_min_epu16(_mm256_castsi256_si128(half), _mm256_extracti128_si256(half, 1));

    return (uint16_t)_mm_cvtsi128_si32(_mm_minpos_epu16(least));
#else
    __m128i least = (__m128i)(v ^ 0x8000); /* minima are of signed numbers */

    least = _mm_min_epi16(least, _mm_srli_si128(least, 8));
    least = _mm_min_epi16(least, _mm_srli_si128(least, 4));
    least = _mm_min_epi16(least, _mm_srli_si128(least, 2));
    return (uint16_t)(_mm_cvtsi128_si32(least) ^ 0x8000);
#endif
#else
    uint16_t least = v[0];

    for (int i = 1; i < SIMD_BYTES / 2; i++)
        least = v[i] < least ? v[i] : least;
    return least;
#endif
}

/* The first lane that has a value; SIMD_BYTES / 2: none. */
static inline int simd_first_u16(simd_u16 v, uint16_t value)
{
#if SIMD_BYTES == 64
    return (int)_tzcnt_u32(_mm512_cmpeq_epu16_mask((__m512i)v, _mm512_set1_epi16((int16_t)value)));
#elif defined(__SSE2__)
    const unsigned same = (unsigned)SIMD_OP(movemask_epi8)((SIMD_INT)(v == value));

    return same ? __builtin_ctz(same) / 2 : SIMD_BYTES / 2;
#elif defined(__ARM_NEON)
    const uint64_t same = vget_lane_u64(vreinterpret_u64_u8(vmovn_u16((uint16x8_t)(v == value))), 0);

    return (same ? __builtin_ctzll(same) : 64) / 8;
#else
    int i = 0;

    while (i < SIMD_BYTES / 2 && v[i] != value)
        i++;
    return i;
#endif
}

/* --- bytes as two vectors of 16 bits --- */

/* Half 0 or 1 of v; which bytes it has depends on the level. */
static inline simd_u16 simd_widen(simd_u8 v, int half)
{
#if defined(__SSE2__)
    const SIMD_INT zero = { 0 };

    return (simd_u16)(half ? SIMD_OP(unpackhi_epi8)((SIMD_INT)v, zero) : SIMD_OP(unpacklo_epi8)((SIMD_INT)v, zero));
#elif defined(__ARM_NEON)
    return (simd_u16)(half ? vmovl_high_u8((uint8x16_t)v) : vmovl_u8(vget_low_u8((uint8x16_t)v)));
#else
    typedef uint8_t bytes __attribute__((vector_size(SIMD_BYTES / 2)));
    bytes part;

    memcpy(&part, (const uint8_t *)&v + half * sizeof(part), sizeof(part));
    return __builtin_convertvector(part, simd_u16);
#endif
}

/* Bytes from their halves, each lane below 256. */
static inline simd_u8 simd_narrow(simd_u16 low, simd_u16 high)
{
#if defined(__SSE2__)
    return (simd_u8)SIMD_OP(packus_epi16)((SIMD_INT)low, (SIMD_INT)high);
#elif defined(__ARM_NEON)
    return (simd_u8)vuzp1q_u8((uint8x16_t)low, (uint8x16_t)high);
#else
    typedef uint8_t bytes __attribute__((vector_size(SIMD_BYTES / 2)));
    const bytes part[2] = { __builtin_convertvector(low, bytes), __builtin_convertvector(high, bytes) };
    simd_u8 v;

    memcpy(&v, part, sizeof(v));
    return v;
#endif
}

/* Upper halves of products of 16 bits. */
static inline simd_u16 simd_high_u16(simd_u16 a, simd_u16 b)
{
#if defined(__SSE2__)
    return (simd_u16)SIMD_OP(mulhi_epu16)((SIMD_INT)a, (SIMD_INT)b);
#elif defined(__ARM_NEON)
    const uint32x4_t low = vmull_u16(vget_low_u16((uint16x8_t)a), vget_low_u16((uint16x8_t)b));
    const uint32x4_t high = vmull_high_u16((uint16x8_t)a, (uint16x8_t)b);

    return (simd_u16)vuzp2q_u16((uint16x8_t)low, (uint16x8_t)high);
#else
    simd_u16 v;

    for (int i = 0; i < SIMD_BYTES / 2; i++)
        v[i] = (uint16_t)((uint32_t)a[i] * b[i] >> 16);
    return v;
#endif
}

/* Entries of a table of bytes; each lane of `at` is below 64. */
static inline simd_u8 simd_look_u8(const uint8_t table[64], simd_u8 at)
{
#if defined(__AVX512VBMI__) && SIMD_BYTES == 64
    return (simd_u8)_mm512_permutexvar_epi8((__m512i)at, _mm512_loadu_si512(table));
#elif defined(__AVX2__)
    simd_u8 v = { 0 };

    for (int i = 0; i < 4; i++) {
        const __m128i part = _mm_loadu_si128((const __m128i *)(const void *)(table + 16 * i));
        const simd_u8 there = at - (uint8_t)(16 * i);

        v |= (simd_u8)SIMD_OP(shuffle_epi8)((SIMD_INT)SIMD_SPREAD(part), (SIMD_INT)(there | (simd_u8)(there > 15)));
    }
    return v;
#elif defined(__ARM_NEON)
    return (simd_u8)vqtbl4q_u8(vld1q_u8_x4(table), (uint8x16_t)at);
#else
    simd_u8 v;

    for (int i = 0; i < SIMD_BYTES; i++)
        v[i] = table[at[i]];
    return v;
#endif
}

#endif
