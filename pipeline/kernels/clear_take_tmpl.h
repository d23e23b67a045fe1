/* clear_take: rays that see a surface. Positions of rays are nearly in line, so that
 * AVX-512 gathers by permuting a stretch of 64 pixels instead of loading one by one, and AVX2 by shuffling stretches of
 * 16 pixels, two at a time; elsewhere the compiler's loops are the fastest. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#if defined(__AVX512VBMI__)
/* Where the rays of 16 pixels come from. */
struct KERNEL(clear_lanes) {
    __m512i x0, y0;
    __m512i across, down; /* bilinear weights: bytes 64 - f, f, 64 - f, f of the columns, int16 64 - f, f of the rows */
};

/* Some of the rays, with pixels on two rows and within 64 columns from `column`. */
struct KERNEL(clear_stretch) {
    __mmask16 rays;
    int column, row, next; /* next: the row below, or the same at the end of the picture */
    __mmask64 readable;
    __m512i index; /* bytes c, c + 1, c, c + 1 of each ray, c its column from `column` */
};

static inline __m512i KERNEL(clear_fraction)(__m512 x, __m512i x0)
{
    const __m512 f = _mm512_sub_ps(x, _mm512_cvtepi32_ps(x0));

    return _mm512_cvttps_epi32(_mm512_add_ps(_mm512_mul_ps(f, _mm512_set1_ps(64)), _mm512_set1_ps(0.5F)));
}

/* Which of the rays lie inside the view. */
static inline __mmask16 KERNEL(clear_lanes_init)(struct KERNEL(clear_lanes) * l, const struct sst_clear_view *v,
                                                 const float *px, int x, int y, __mmask16 rays)
{
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512 disp = _mm512_loadu_ps(px), zero = _mm512_setzero_ps();
    const __m512 at_x = _mm512_sub_ps(_mm512_cvtepi32_ps(_mm512_add_epi32(lane, _mm512_set1_epi32(x))),
                                      _mm512_mul_ps(disp, _mm512_set1_ps(v->bx)));
    const __m512 at_y = _mm512_sub_ps(_mm512_set1_ps((float)y), _mm512_mul_ps(disp, _mm512_set1_ps(v->by)));
    const __m512i whole = _mm512_set1_epi32(64);
    __m512i f;

    l->x0 = _mm512_cvttps_epi32(at_x);
    l->y0 = _mm512_cvttps_epi32(at_y);
    f = KERNEL(clear_fraction)(at_x, l->x0);
    f = _mm512_or_si512(_mm512_sub_epi32(whole, f), _mm512_slli_epi32(f, 8));
    l->across = _mm512_or_si512(f, _mm512_slli_epi32(f, 16));
    f = KERNEL(clear_fraction)(at_y, l->y0);
    l->down = _mm512_or_si512(_mm512_sub_epi32(whole, f), _mm512_slli_epi32(f, 16));
    rays = _mm512_mask_cmp_ps_mask(rays, at_x, zero, _CMP_GE_OQ);
    rays = _mm512_mask_cmp_ps_mask(rays, at_y, zero, _CMP_GE_OQ);
    rays = _mm512_mask_cmp_ps_mask(rays, at_x, _mm512_set1_ps((float)(v->width - 1)), _CMP_LE_OQ);
    return _mm512_mask_cmp_ps_mask(rays, at_y, _mm512_set1_ps((float)(v->height - 1)), _CMP_LE_OQ);
}

/* The first of the rays, and the rays near it. */
static inline void KERNEL(clear_next_stretch)(struct KERNEL(clear_stretch) * s, const struct sst_clear_view *v,
                                              const struct KERNEL(clear_lanes) * l, __mmask16 rays)
{
    __m512i at;
    int columns;

    s->row = _mm_cvtsi128_si32(_mm512_castsi512_si128(_mm512_maskz_compress_epi32(rays, l->y0)));
    s->column = _mm_cvtsi128_si32(_mm512_castsi512_si128(_mm512_maskz_compress_epi32(rays, l->x0))) - 16;
    s->column = s->column < 0 ? 0 : s->column;
    s->next = s->row + 1 < v->height ? s->row + 1 : s->row;
    columns = v->width - s->column;
    s->readable = columns >= 64 ? ~(__mmask64)0 : ((__mmask64)1 << columns) - 1;
    at = _mm512_sub_epi32(l->x0, _mm512_set1_epi32(s->column));
    s->rays = _mm512_mask_cmpeq_epi32_mask(rays, l->y0, _mm512_set1_epi32(s->row));
    s->rays = _mm512_mask_cmple_epu32_mask(s->rays, at, _mm512_set1_epi32(62));
    at = _mm512_or_si512(at, _mm512_slli_epi32(at, 8));
    at = _mm512_or_si512(at, _mm512_slli_epi32(at, 16));
    s->index = _mm512_add_epi32(at, _mm512_set1_epi32(0x01000100));
}

static inline __m512 KERNEL(clear_bilinear)(const uint8_t *plane, size_t stride, const struct KERNEL(clear_stretch) * s,
                                            const struct KERNEL(clear_lanes) * l)
{
    const __m512i top = _mm512_maskz_loadu_epi8(s->readable, plane + (size_t)s->row * stride + s->column);
    const __m512i bottom = _mm512_maskz_loadu_epi8(s->readable, plane + (size_t)s->next * stride + s->column);
    const __m512i pixels =
        _mm512_mask_permutexvar_epi8(_mm512_permutexvar_epi8(s->index, top), 0xCCCCCCCCCCCCCCCC, s->index, bottom);
    const __m512i sum = _mm512_madd_epi16(_mm512_maddubs_epi16(pixels, l->across), l->down);

    return _mm512_mul_ps(_mm512_cvtepi32_ps(sum), _mm512_set1_ps(1.0F / 4096));
}

/* Colours of the rays of 16 pixels, the i-th ones of the block. Returns which of them lie inside the view. */
static inline __mmask16 KERNEL(clear_take_16)(const struct sst_clear_rays *rays, const struct sst_clear_view *v, int x,
                                              int y, int i, __mmask16 seen)
{
    __m512 colour[3] = { _mm512_setzero_ps(), _mm512_setzero_ps(), _mm512_setzero_ps() };
    struct KERNEL(clear_lanes) l;
    __mmask16 left;

    if (seen)
        seen = KERNEL(clear_lanes_init)(&l, v, rays->px + i, x + i, y, seen);
    left = v->plane[0] ? seen : 0;
    while (left) {
        struct KERNEL(clear_stretch) s;

        KERNEL(clear_next_stretch)(&s, v, &l, left);
        left &= (__mmask16)~s.rays;
        for (int c = 0; c < 3; c++)
            colour[c] = _mm512_mask_blend_ps(s.rays, colour[c], KERNEL(clear_bilinear)(v->plane[c], v->stride, &s, &l));
    }
    for (int c = 0; c < 3; c++)
        _mm512_storeu_ps(rays->colour[c][rays->slots] + i, colour[c]);
    return seen;
}

static int KERNEL(clear_take)(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed,
                              int x, int y)
{
    const __m512i at = _mm512_loadu_si512(landed), level = _mm512_srli_epi16(at, 1);
    const __m512i wanted = _mm512_loadu_si512(rays->wanted), one = _mm512_set1_epi16(1);
    __mmask32 seen = _mm512_cmpge_epu16_mask(level, _mm512_loadu_si512(rays->first)), kept;
    __m512i left;
    float *weight;

    seen = _mm512_mask_cmple_epu16_mask(seen, level, _mm512_loadu_si512(rays->last));
    seen = _mm512_mask_cmpgt_epi16_mask(seen, wanted, _mm512_setzero_si512());
    if (!seen)
        return _mm512_cmpgt_epi16_mask(wanted, _mm512_setzero_si512()) != 0;
    seen = KERNEL(clear_take_16)(rays, v, x, y, 0, (__mmask16)seen) |
           (__mmask32)KERNEL(clear_take_16)(rays, v, x, y, 16, (__mmask16)(seen >> 16)) << 16;
    kept = _mm512_mask_test_epi16_mask(seen, at, one);
    weight = rays->weight[rays->slots];
    for (int i = 0; i < SST_CLEAR_BLOCK; i += 16) {
        const __m512 rim = _mm512_maskz_mov_ps((__mmask16)(seen >> i), _mm512_set1_ps(SST_CLEAR_RIM));

        _mm512_storeu_ps(weight + i, _mm512_mask_blend_ps((__mmask16)(kept >> i), rim, _mm512_set1_ps(1)));
    }
    rays->slots += seen != 0;
    left = _mm512_mask_sub_epi16(wanted, kept, wanted, one);
    _mm512_storeu_si512(rays->wanted, left);
    return _mm512_cmpgt_epi16_mask(left, _mm512_setzero_si512()) != 0;
}
#elif defined(__AVX2__)
/* Where the rays of 16 pixels come from, in int16. Vectors of 32 bits are in pairs: 0 pixels 0-3, 8-11, 1 pixels 4-7,
 * 12-15, which packing puts in order. */
struct KERNEL(clear_lanes) {
    __m256i seen; /* all bits of those inside the view */
    __m256i x, y;
    __m256i across;  /* bytes 64 - f, f of the columns */
    __m256i down[2]; /* int16 64 - f, f of the rows */
};

/* Where the rays near one of 16 are sampled: its row, and the columns of 16 bytes for each eight of them. */
struct KERNEL(clear_stretch) {
    int row, column[2];
};

static inline __m256i KERNEL(clear_load)(const void *low, const void *high)
{
    return _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128((const __m128i *)low)),
                                   _mm_loadu_si128((const __m128i *)high), 1);
}

/* Pixels in order of their pairs. */
static inline void KERNEL(clear_order)(__m256i out[2], const __m256i of[2])
{
    out[0] = _mm256_permute2x128_si256(of[0], of[1], 0x20);
    out[1] = _mm256_permute2x128_si256(of[0], of[1], 0x31);
}

/* Positions in 1/64 px, rounded, as the fraction is in the reference: that of 64 / 64 is the next pixel's 0. Returns
 * which lie inside the view. */
static inline __m256i KERNEL(clear_places)(__m256i out[2], const __m256i from[2], const __m256 px[2], float moved,
                                           int size)
{
    const __m256 move = _mm256_set1_ps(64 * moved), last = _mm256_set1_ps(64 * (float)(size - 1));
    __m256i inside[2];

    for (int j = 0; j < 2; j++) {
        const __m256 at = _mm256_sub_ps(_mm256_cvtepi32_ps(_mm256_slli_epi32(from[j], 6)), _mm256_mul_ps(px[j], move));
        const __m256 low = _mm256_cmp_ps(at, _mm256_setzero_ps(), _CMP_GE_OQ);

        out[j] = _mm256_cvttps_epi32(_mm256_add_ps(at, _mm256_set1_ps(0.5F)));
        inside[j] = _mm256_castps_si256(_mm256_and_ps(low, _mm256_cmp_ps(at, last, _CMP_LE_OQ)));
    }
    return _mm256_packs_epi32(inside[0], inside[1]);
}

/* Whole pixels of positions. */
static inline __m256i KERNEL(clear_whole)(const __m256i at[2])
{
    return _mm256_packs_epi32(_mm256_srai_epi32(at[0], 6), _mm256_srai_epi32(at[1], 6));
}

static inline void KERNEL(clear_lanes_init)(struct KERNEL(clear_lanes) * l, const struct sst_clear_view *v,
                                            const float *px, int x, int y)
{
    const __m256i lane = _mm256_add_epi32(_mm256_setr_epi32(0, 1, 2, 3, 8, 9, 10, 11), _mm256_set1_epi32(x));
    const __m256i from_x[2] = { lane, _mm256_add_epi32(lane, _mm256_set1_epi32(4)) };
    const __m256i from_y[2] = { _mm256_set1_epi32(y), _mm256_set1_epi32(y) }, part = _mm256_set1_epi32(63);
    const __m256 disp[2] = { _mm256_castsi256_ps(KERNEL(clear_load)(px, px + 8)),
                             _mm256_castsi256_ps(KERNEL(clear_load)(px + 4, px + 12)) };
    __m256i at[2], f;

    l->seen = _mm256_and_si256(l->seen, KERNEL(clear_places)(at, from_x, disp, v->bx, v->width));
    l->x = KERNEL(clear_whole)(at);
    f = _mm256_packs_epi32(_mm256_and_si256(at[0], part), _mm256_and_si256(at[1], part));
    l->across = _mm256_or_si256(_mm256_sub_epi16(_mm256_set1_epi16(64), f), _mm256_slli_epi16(f, 8));
    l->seen = _mm256_and_si256(l->seen, KERNEL(clear_places)(at, from_y, disp, v->by, v->height));
    l->y = KERNEL(clear_whole)(at);
    for (int j = 0; j < 2; j++) {
        f = _mm256_and_si256(at[j], part);
        l->down[j] = _mm256_or_si256(_mm256_sub_epi32(_mm256_set1_epi32(64), f), _mm256_slli_epi32(f, 16));
    }
}

/* The stretch around a ray of the pixel `first` of 16, which comes from the pixel x, y of the view or outside of it. */
static inline struct KERNEL(clear_stretch) KERNEL(clear_around)(const struct sst_clear_view *v, int first, int x, int y)
{
    const int right = v->width - 1, low = v->height - 1, start = x - first - 3;
    const int row = y < low ? y : low, left = start < right ? start : right;
    const int next = start + 8 < right ? start + 8 : right;

    return (struct KERNEL(clear_stretch)){ row > 0 ? row : 0, { left > 0 ? left : 0, next > 0 ? next : 0 } };
}

/* The pixel that a ray comes from along one axis; as clear_places() does, but for the test. */
static inline int KERNEL(clear_place)(int from, float px, float moved)
{
    return _mm_cvttss_si32(_mm_set_ss((float)(from * 64) - px * (64 * moved) + 0.5F)) >> 6;
}

/* The stretch of the first of 16 rays, the i-th ones of the block, before all positions are known: reading it from
 * memory need not wait for them. */
static inline struct KERNEL(clear_stretch)
    KERNEL(clear_first_stretch)(const struct sst_clear_rays *rays, const struct sst_clear_view *v, __m256i seen,
                                const int at[2], int i)
{
    const int first = __builtin_ctz((unsigned)_mm256_movemask_epi8(seen)) / 2;
    const float px = rays->px[i + first];

    return KERNEL(clear_around)(v, first, KERNEL(clear_place)(at[0] + i + first, px, v->bx),
                                KERNEL(clear_place)(at[1], px, v->by));
}

/* Bilinear values of rays on two rows, `index` their bytes c, c + 1 from two columns on, added to those of the others,
 * which are 0 there. */
static inline void KERNEL(clear_bilinear)(__m256i sum[2], const uint8_t *const row[2], const int column[2],
                                          __m256i index, const __m256i rays[2], const struct KERNEL(clear_lanes) * l)
{
    const __m256i top = KERNEL(clear_load)(row[0] + column[0], row[0] + column[1]);
    const __m256i bottom = KERNEL(clear_load)(row[1] + column[0], row[1] + column[1]);
    const __m256i upper = _mm256_maddubs_epi16(_mm256_shuffle_epi8(top, index), l->across);
    const __m256i lower = _mm256_maddubs_epi16(_mm256_shuffle_epi8(bottom, index), l->across);
    const __m256i low = _mm256_madd_epi16(_mm256_unpacklo_epi16(upper, lower), l->down[0]);
    const __m256i high = _mm256_madd_epi16(_mm256_unpackhi_epi16(upper, lower), l->down[1]);

    sum[0] = _mm256_or_si256(sum[0], _mm256_and_si256(low, rays[0]));
    sum[1] = _mm256_or_si256(sum[1], _mm256_and_si256(high, rays[1]));
}

/* Sample the rays on a stretch. Returns the others. */
static inline __attribute__((always_inline)) __m256i
KERNEL(clear_sample_stretch)(__m256i sum[3][2], const struct sst_clear_view *v, const struct KERNEL(clear_lanes) * l,
                             __m256i rays, const struct KERNEL(clear_stretch) * s)
{
    const size_t top = (size_t)s->row * v->stride, bottom = s->row + 1 < v->height ? top + v->stride : top;
    const __m256i from =
        _mm256_inserti128_si256(_mm256_set1_epi16((short)s->column[0]), _mm_set1_epi16((short)s->column[1]), 1);
    const __m256i at = _mm256_sub_epi16(l->x, from);
    const __m256i near = _mm256_cmpeq_epi16(at, _mm256_min_epu16(at, _mm256_set1_epi16(14)));
    const __m256i on =
        _mm256_and_si256(_mm256_and_si256(rays, near), _mm256_cmpeq_epi16(l->y, _mm256_set1_epi16((short)s->row)));
    const __m256i index = _mm256_add_epi16(_mm256_or_si256(at, _mm256_slli_epi16(at, 8)), _mm256_set1_epi16(0x0100));
    const __m256i of_it[2] = { _mm256_unpacklo_epi16(on, on), _mm256_unpackhi_epi16(on, on) };

    for (int c = 0; c < 3; c++)
        KERNEL(clear_bilinear)
    (sum[c], (const uint8_t *const[2]){ v->plane[c] + top, v->plane[c] + bottom }, s->column, index, of_it, l);
    return _mm256_andnot_si256(on, rays);
}

/* Sample the rays that lie on no stretch so far, by stretches around the first one that is left. Few are. */
static __attribute__((noinline)) void KERNEL(clear_sample_rest)(__m256i sum[3][2], const struct sst_clear_view *v,
                                                                const struct KERNEL(clear_lanes) * l, __m256i left)
{
    unsigned any = (unsigned)_mm256_movemask_epi8(left);
    int16_t x[16], y[16];

    _mm256_storeu_si256((__m256i *)(void *)x, l->x);
    _mm256_storeu_si256((__m256i *)(void *)y, l->y);
    while (any) {
        const int first = __builtin_ctz(any) / 2;
        const struct KERNEL(clear_stretch) s = KERNEL(clear_around)(v, first, x[first], y[first]);

        left = KERNEL(clear_sample_stretch)(sum, v, l, left, &s);
        any = (unsigned)_mm256_movemask_epi8(left);
    }
}

/* Colours of the rays of 16 pixels, the i-th ones of the block. Rays near the first one are sampled at once, from
 * its row and 16 columns for each eight pixels, which surfaces that shrink to half their width need. */
static inline void KERNEL(clear_sample)(const struct sst_clear_rays *rays, const struct sst_clear_view *v,
                                        const struct KERNEL(clear_lanes) * l, const struct KERNEL(clear_stretch) * s,
                                        int i)
{
    __m256i sum[3][2] = { 0 }, whole[2];

    if (v->plane[0]) {
        const __m256i left = KERNEL(clear_sample_stretch)(sum, v, l, l->seen, s);

        if (__builtin_expect(!_mm256_testz_si256(left, left), 0)) {
            __m256i more[3][2];

            memcpy(more, sum, sizeof(more));
            KERNEL(clear_sample_rest)(more, v, l, left);
            memcpy(sum, more, sizeof(sum));
        }
    }
    for (int c = 0; c < 3; c++) {
        float *to = rays->colour[c][rays->slots] + i;

        KERNEL(clear_order)(whole, sum[c]);
        for (int j = 0; j < 2; j++)
            _mm256_storeu_ps(to + 8 * j, _mm256_mul_ps(_mm256_cvtepi32_ps(whole[j]), _mm256_set1_ps(1.0F / 4096)));
    }
}

static inline __m256i KERNEL(clear_load_16)(const void *from)
{
    return _mm256_loadu_si256((const __m256i *)from);
}

/* The rays of 16 pixels that landed at a level of the surface and are wanted. */
static inline __m256i KERNEL(clear_wanted)(const struct sst_clear_rays *rays, __m256i landed, int i)
{
    const __m256i level = _mm256_srli_epi16(landed, 1);
    const __m256i behind = _mm256_max_epu16(level, KERNEL(clear_load_16)(rays->first + i));
    const __m256i before = _mm256_min_epu16(level, KERNEL(clear_load_16)(rays->last + i));
    const __m256i wanted = _mm256_cmpgt_epi16(KERNEL(clear_load_16)(rays->wanted + i), _mm256_setzero_si256());

    return _mm256_and_si256(wanted,
                            _mm256_and_si256(_mm256_cmpeq_epi16(behind, level), _mm256_cmpeq_epi16(before, level)));
}

/* No rays of 16 pixels. */
static inline void KERNEL(clear_take_none)(const struct sst_clear_rays *rays, int i)
{
    memset(rays->weight[rays->slots] + i, 0, 16 * sizeof(float));
    for (int c = 0; c < 3; c++)
        memset(rays->colour[c][rays->slots] + i, 0, 16 * sizeof(float));
}

/* Weights of the rays of 16 pixels, and how many are still wanted. */
static inline void KERNEL(clear_weigh)(struct sst_clear_rays *rays, const struct KERNEL(clear_lanes) * l,
                                       __m256i landed, int i)
{
    const __m256i kept = _mm256_cmpgt_epi16(_mm256_and_si256(landed, _mm256_set1_epi16(1)), _mm256_setzero_si256());
    const __m256 one = _mm256_set1_ps(1), rim = _mm256_set1_ps(SST_CLEAR_RIM);
    const __m256i full = _mm256_and_si256(kept, l->seen);
    float *weight = rays->weight[rays->slots] + i;
    __m256i wide[2];

    _mm256_storeu_si256((__m256i *)(void *)(rays->wanted + i),
                        _mm256_add_epi16(KERNEL(clear_load_16)(rays->wanted + i), full));
    for (int j = 0; j < 2; j++) {
        const __m256 whole =
            _mm256_castsi256_ps(j ? _mm256_unpackhi_epi16(full, full) : _mm256_unpacklo_epi16(full, full));
        const __m256i there = j ? _mm256_unpackhi_epi16(l->seen, l->seen) : _mm256_unpacklo_epi16(l->seen, l->seen);

        wide[j] = _mm256_and_si256(there, _mm256_castps_si256(_mm256_blendv_ps(rim, one, whole)));
    }
    KERNEL(clear_order)(wide, (const __m256i[2]){ wide[0], wide[1] });
    for (int j = 0; j < 2; j++)
        _mm256_storeu_ps(weight + 8 * j, _mm256_castsi256_ps(wide[j]));
}

/* The rays of a block, of which some are `seen`. Positions of both halves come first: sampling one waits for them.
 * Returns whether any lies inside the view. */
static inline int KERNEL(clear_take_halves)(struct sst_clear_rays *rays, const struct sst_clear_view *v,
                                            const __m256i landed[2], const __m256i seen[2], const int at[2])
{
    struct KERNEL(clear_lanes) l[2];
    struct KERNEL(clear_stretch) s[2];
    __m256i any;

    for (int j = 0; j < 2; j++) {
        l[j].seen = seen[j];
        if (_mm256_testz_si256(seen[j], seen[j]))
            continue;
        s[j] = KERNEL(clear_first_stretch)(rays, v, seen[j], at, 16 * j);
        KERNEL(clear_lanes_init)(&l[j], v, rays->px + 16 * j, at[0] + 16 * j, at[1]);
    }
    for (int j = 0; j < 2; j++) {
        if (_mm256_testz_si256(seen[j], seen[j])) {
            KERNEL(clear_take_none)(rays, 16 * j);
            continue;
        }
        KERNEL(clear_weigh)(rays, &l[j], landed[j], 16 * j);
        KERNEL(clear_sample)(rays, v, &l[j], &s[j], 16 * j);
    }
    any = _mm256_or_si256(l[0].seen, l[1].seen);
    return !_mm256_testz_si256(any, any);
}

static int KERNEL(clear_take)(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed,
                              int x, int y)
{
    __m256i at[2], seen[2], more;

    if (v->width > INT16_MAX || v->height > INT16_MAX)
        return sst_clear_take_ref(rays, v, landed, x, y);
    for (int j = 0; j < 2; j++) {
        at[j] = KERNEL(clear_load_16)(landed + 16 * j);
        seen[j] = KERNEL(clear_wanted)(rays, at[j], 16 * j);
    }
    if (_mm256_movemask_epi8(_mm256_or_si256(seen[0], seen[1])))
        rays->slots += KERNEL(clear_take_halves)(rays, v, at, seen, (const int[2]){ x, y });
    more = _mm256_max_epi16(KERNEL(clear_load_16)(rays->wanted), KERNEL(clear_load_16)(rays->wanted + 16));
    return _mm256_movemask_epi8(_mm256_cmpgt_epi16(more, _mm256_setzero_si256())) != 0;
}
#else
/* Where the rays of a block come from: upper left pixel and bilinear weights, in 1/64. */
struct KERNEL(clear_places) {
    int32_t seen[SST_CLEAR_BLOCK]; /* 0 or 1 */
    int32_t x[SST_CLEAR_BLOCK], y[SST_CLEAR_BLOCK], across[SST_CLEAR_BLOCK], down[SST_CLEAR_BLOCK];
};

/* Rays outside the view are no longer seen. */
static inline void KERNEL(clear_place)(struct KERNEL(clear_places) * p, const struct sst_clear_view *v,
                                       const float *restrict px, int x, int y)
{
    const float right = (float)(v->width - 1), bottom = (float)(v->height - 1), bx = v->bx, by = v->by;

    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const float to_x = (float)(x + i) - px[i] * bx, to_y = (float)y - px[i] * by;
        const float in_x = to_x > 0 ? to_x : 0, in_y = to_y > 0 ? to_y : 0;
        const float at_x = in_x < right ? in_x : right, at_y = in_y < bottom ? in_y : bottom;
        const int32_t on_x = to_x == at_x ? -1 : 0, on_y = to_y == at_y ? -1 : 0;
        const int32_t x0 = (int32_t)at_x, y0 = (int32_t)at_y;

        p->seen[i] &= on_x & on_y;
        p->x[i] = x0;
        p->y[i] = y0;
        p->across[i] = (int32_t)((at_x - (float)x0) * 64 + 0.5F);
        p->down[i] = (int32_t)((at_y - (float)y0) * 64 + 0.5F);
    }
}

static inline void KERNEL(clear_sample)(float (*const colour[3])[SST_CLEAR_BLOCK], int slot,
                                        const struct sst_clear_view *v, const struct KERNEL(clear_places) * p)
{
    for (int c = 0; c < 3; c++) {
        for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
            const uint8_t *top = v->plane[c] + (size_t)p->y[i] * v->stride + p->x[i];
            const uint8_t *bottom = p->down[i] ? top + v->stride : top;
            const int across = p->across[i], right = across != 0;
            const int upper = p->seen[i] ? 64 * top[0] + across * (top[right] - top[0]) : 0;
            const int lower = p->seen[i] ? 64 * bottom[0] + across * (bottom[right] - bottom[0]) : 0;

            colour[c][slot][i] = (float)(64 * upper + p->down[i] * (lower - upper)) * (1.0F / 4096);
        }
    }
}

static int KERNEL(clear_take)(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed,
                              int x, int y)
{
    float *restrict weight = rays->weight[rays->slots];
    struct KERNEL(clear_places) p;
    int32_t any = 0, more = 0;

    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const int level = landed[i] >> 1;

        p.seen[i] = (level >= rays->first[i]) & (level <= rays->last[i]) & (rays->wanted[i] > 0);
        any |= p.seen[i];
        more |= rays->wanted[i] > 0;
    }
    if (!any)
        return more;
    KERNEL(clear_place)(&p, v, rays->px, x, y);
    any = more = 0;
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const int full = p.seen[i] & landed[i];

        weight[i] = full ? 1 : p.seen[i] ? SST_CLEAR_RIM : 0;
        rays->wanted[i] = (int16_t)(rays->wanted[i] - full);
        any |= p.seen[i];
        more |= rays->wanted[i] > 0;
    }
    if (any && v->plane[0])
        KERNEL(clear_sample)(rays->colour, rays->slots, v, &p);
    for (int c = 0; c < 3 && !v->plane[0]; c++)
        memset(rays->colour[c][rays->slots], 0, sizeof(rays->colour[c][rays->slots]));
    rays->slots += any;
    return more;
}
#endif
