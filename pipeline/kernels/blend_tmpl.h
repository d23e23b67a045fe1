/* blend_rays, blend_plain, blend_take, blend_support. Pixels are done in stretches of BLEND_PART with one pass per
 * quantity, so that what passes hand over stays in the L1 cache; the sums of a long run stream through it. */
#include "pipeline/kernels/exp_neg.h"

#define BLEND_PART    256
#define BLEND_STRETCH 64 /* pixels for which the exponential is left out together */

/* ((a b >> 14) + 1) >> 1 is one instruction, and compilers know it in this form only. */
static inline int16_t KERNEL(blend_between)(int16_t v0, int16_t v1, int16_t f)
{
    const int16_t step = (int16_t)(v1 - v0);
    const int16_t part = (int16_t)((((int32_t)step * (int32_t)f >> 14) + 1) >> 1);

    return (int16_t)(v0 + part);
}

/* Colours of one channel of n rays, the two rows blended once per column, not once per tap. */
static inline void KERNEL(blend_colour)(int16_t *restrict out, const uint8_t *restrict top,
                                        const uint8_t *restrict bottom, float fx, float fy, size_t n)
{
    const int16_t across = sst_blend_fraction(fx), down = sst_blend_fraction(fy);
    int16_t row[BLEND_PART + 1];

    for (size_t x = 0; x < n + 1; x++) {
        const int16_t v0 = (int16_t)(top[x] * SST_BLEND_LEVEL), v1 = (int16_t)(bottom[x] * SST_BLEND_LEVEL);

        row[x] = KERNEL(blend_between)(v0, v1, down);
    }
    for (size_t x = 0; x < n; x++)
        out[x] = KERNEL(blend_between)(row[x], row[x + 1], across);
}

#if defined(__AVX512F__)
/* Neighbours mostly have one label and disparities within a few columns: their weights are permuted, not gathered. */
static inline __m512 KERNEL(blend_16_label_weights)(const struct sst_blend *b, size_t x)
{
    const __m512i label = _mm512_cvtepu8_epi32(_mm_loadu_si128((const __m128i *)(const void *)(b->label + x)));
    const __m512i disp = _mm512_cvtepu16_epi32(_mm256_loadu_si256((const __m256i *)(const void *)(b->disp + x)));
    const __m512i column = _mm512_srli_epi32(disp, SST_BLEND_COLUMN_SHIFT);
    const int first = (b->disp[x] >> SST_BLEND_COLUMN_SHIFT) - 8, limit = SST_BLEND_COLUMNS - 16;
    const int base = first < 0 ? 0 : first < limit ? first : limit;
    const __m512i at = _mm512_sub_epi32(column, _mm512_set1_epi32(base));
    const __mmask16 same = _mm512_cmpeq_epi32_mask(label, _mm512_set1_epi32(b->label[x]));

    if (_mm512_mask_cmplt_epu32_mask(same, at, _mm512_set1_epi32(16)) == 0xFFFF)
        return _mm512_permutexvar_ps(at, _mm512_loadu_ps(b->label_weight + b->label[x] * SST_BLEND_COLUMNS + base));
    return _mm512_i32gather_ps(_mm512_add_epi32(_mm512_mullo_epi32(label, _mm512_set1_epi32(SST_BLEND_COLUMNS)), column),
                               b->label_weight, 4);
}
#endif

static inline void KERNEL(blend_label_weights)(float *restrict out, const struct sst_blend *b, size_t n)
{
    const float *restrict table = b->label_weight;
    const uint8_t *restrict label = b->label;
    const uint16_t *restrict disp = b->disp;
    size_t from = 0;

#if defined(__AVX512F__)
    for (; from + 16 <= n; from += 16)
        _mm512_storeu_ps(out + from, KERNEL(blend_16_label_weights)(b, from));
#endif
    for (size_t x = from; x < n; x++)
        out[x] = table[label[x] * SST_BLEND_COLUMNS + (disp[x] >> SST_BLEND_COLUMN_SHIFT)];
}

/* Is exp(-t) below 2^-26 c1 in a whole stretch, so that adding it to c1 changes nothing? t >= 0: its bits have the same
 * order. */
static inline int KERNEL(blend_vanishes)(const float *restrict t, float c1, size_t n)
{
    const float limit = c1 > 0 ? 18.1F - logf(c1) : SST_EXP_NEG_MAX;
    int32_t bits[BLEND_STRETCH], least = INT32_MAX, most;

    memcpy(bits, t, sizeof(bits[0]) * n);
    memcpy(&most, &limit, sizeof(most));
    for (size_t x = 0; x < n; x++)
        least = bits[x] < least ? bits[x] : least;
    return least > most;
}

/* w holds W_s and becomes A W_s W_d. Three loops: in a single one, compilers branch around the exponential and do not
 * vectorise. */
static inline void KERNEL(blend_stretch_weights)(float *restrict w, const struct sst_blend *b, size_t from, size_t n)
{
    const uint16_t *restrict disp = b->disp + from;
    const float whole = b->focus_whole_q6, part = b->focus_part_q6, scale = b->half_inverse_variance;
    const float c1 = b->c1, rest = b->one_minus_c1, unknown = b->unknown, aperture = b->aperture;
    float depth[BLEND_STRETCH];

    for (size_t x = 0; x < n; x++) {
        const float d = ((float)disp[x] - whole) - part;
        const float t = d * d * scale;

        depth[x] = t < SST_EXP_NEG_MAX ? t : SST_EXP_NEG_MAX;
    }
    if (KERNEL(blend_vanishes)(depth, c1, n)) {
        for (size_t x = 0; x < n; x++)
            depth[x] = c1;
    } else {
        for (size_t x = 0; x < n; x++)
            depth[x] = rest * sst_exp_neg(depth[x]) + c1;
    }
    for (size_t x = 0; x < n; x++)
        w[x] = aperture * w[x] * (disp[x] == 0xFFFF ? unknown : depth[x]);
}

static inline void KERNEL(blend_weights)(float *restrict w, const struct sst_blend *b, size_t n)
{
    size_t x = 0;

    for (; x + BLEND_STRETCH <= n; x += BLEND_STRETCH)
        KERNEL(blend_stretch_weights)(w + x, b, x, BLEND_STRETCH);
    KERNEL(blend_stretch_weights)(w + x, b, x, n - x);
}

/* A W_s W_d. */
static inline void KERNEL(blend_ray_weights)(float *restrict w, const struct sst_blend *b, size_t n)
{
    if (b->label) {
        KERNEL(blend_label_weights)(w, b, n);
    } else {
        for (size_t x = 0; x < n; x++)
            w[x] = 1.0f;
    }
    KERNEL(blend_weights)(w, b, n);
}

/* From the x-th pixel on. */
static inline struct sst_blend KERNEL(blend_from)(const struct sst_blend *b, size_t x)
{
    struct sst_blend part = *b;

    for (int c = 0; c < 3; c++) {
        part.top[c] += x;
        part.bottom[c] += x;
    }
    part.disp = b->disp ? b->disp + x : NULL;
    part.label = b->label ? b->label + x : NULL;
    return part;
}

static inline size_t KERNEL(blend_part)(size_t left)
{
    return left < BLEND_PART ? left : BLEND_PART;
}

static void KERNEL(blend_take)(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n)
{
    int16_t level[BLEND_PART];

    for (size_t from = 0; from < n; from += BLEND_PART) {
        const struct sst_blend part = KERNEL(blend_from)(b, from);
        const size_t count = KERNEL(blend_part)(n - from);

        KERNEL(blend_ray_weights)(weight + from, &part, count);
        for (int c = 0; c < 3; c++) {
            uint8_t *restrict out = colour[c] + from;

            KERNEL(blend_colour)(level, part.top[c], part.bottom[c], part.fx, part.fy, count);
            for (size_t x = 0; x < count; x++)
                out[x] = (uint8_t)((uint16_t)(level[x] + SST_BLEND_LEVEL / 2) / SST_BLEND_LEVEL);
        }
    }
}

static void KERNEL(blend_rays)(float *const acc[4], const struct sst_blend *b, size_t n)
{
    int16_t level[BLEND_PART];
    float w[BLEND_PART];

    for (size_t from = 0; from < n; from += BLEND_PART) {
        const struct sst_blend part = KERNEL(blend_from)(b, from);
        const size_t count = KERNEL(blend_part)(n - from);
        float *restrict total = acc[3] + from;

        KERNEL(blend_ray_weights)(w, &part, count);
        for (size_t x = 0; x < count; x++) {
            total[x] += w[x];
            w[x] *= 1.0f / SST_BLEND_LEVEL;
        }
        for (int c = 0; c < 3; c++) {
            float *restrict sum = acc[c] + from;

            KERNEL(blend_colour)(level, part.top[c], part.bottom[c], part.fx, part.fy, count);
            for (size_t x = 0; x < count; x++)
                sum[x] += w[x] * (float)level[x];
        }
    }
}

static void KERNEL(blend_plain)(float *const acc[4], const struct sst_blend *b, size_t n)
{
    const float aperture = b->aperture, scaled = aperture * (1.0f / SST_BLEND_LEVEL);
    int16_t level[BLEND_PART];

    for (size_t from = 0; from < n; from += BLEND_PART) {
        const struct sst_blend part = KERNEL(blend_from)(b, from);
        const size_t count = KERNEL(blend_part)(n - from);
        float *restrict total = acc[3] + from;

        for (int c = 0; c < 3; c++) {
            float *restrict sum = acc[c] + from;

            KERNEL(blend_colour)(level, part.top[c], part.bottom[c], part.fx, part.fy, count);
            for (size_t x = 0; x < count; x++)
                sum[x] += scaled * (float)level[x];
        }
        for (size_t x = 0; x < count; x++)
            total[x] += aperture;
    }
}

static void KERNEL(blend_support)(uint8_t *restrict support, const uint16_t *restrict disp,
                                  const uint8_t *restrict label, const uint32_t *restrict ends, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint32_t range = ends[label ? label[x] : 0], d = disp[x];

        support[x] = (uint8_t)(support[x] | -((d >= (range & 0xFFFF)) & (d <= range >> 16)));
    }
}

#undef BLEND_PART
#undef BLEND_STRETCH
