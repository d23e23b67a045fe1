/* blend_rays, blend_plain, blend_take, blend_support.
 *
 * With AVX2 and AVX-512 a block of pixels stays in registers from the bytes of the view to the sums. Blocks that begin
 * less than a block before the end are done at n - BLOCK, with weight 0 for pixels that already are: adding 0 changes
 * no sum. Other processors, and runs shorter than a block, do stretches of BLEND_PART pixels with one pass per
 * quantity. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/blend_near.h"
#include "pipeline/kernels/simd.h"

#define BLEND_PART 768 /* weights of as many pixels of SST_BLEND_VIEWS views stay in the first level of cache */

/* Colours of one channel of n rays. */
static inline void KERNEL(blend_colour)(int32_t *restrict out, const struct sst_blend *b, int c, size_t n)
{
    const uint8_t *restrict top = b->top[c], *restrict bottom = b->bottom[c];
    const int16_t w0 = b->tap[0], w1 = b->tap[1], w2 = b->tap[2], w3 = b->tap[3];

    for (size_t x = 0; x < n; x++)
        out[x] =
            (int16_t)top[x] * w0 + (int16_t)top[x + 1] * w1 + (int16_t)bottom[x] * w2 + (int16_t)bottom[x + 1] * w3;
}

/* w holds W_s and becomes A W_s W_d. */
static inline void KERNEL(blend_depth_weights)(float *restrict w, const struct sst_blend *b, size_t n)
{
    const uint16_t *restrict disp = b->disp;
    const struct sst_blend_near near = b->near;
    const float scale = b->aperture * near.scale;
    uint16_t exponent[BLEND_PART], mantissa[BLEND_PART];

    for (size_t x = 0; x < n; x++)
        w[x] = scale * w[x];
    if (!near.bits)
        return;
    for (size_t x = 0; x < n; x++) {
        const uint16_t known = (uint16_t)(disp[x] < SST_BLEND_UNKNOWN ? UINT16_MAX : 0);
        uint16_t e, m;

        sst_blend_near_parts(&e, &m, &near, disp[x]);
        exponent[x] = e & known;
        mantissa[x] = m & known;
    }
    for (size_t x = 0; x < n; x++)
        w[x] *= sst_blend_near_power(exponent[x], mantissa[x]) + near.floor;
}

static inline void KERNEL(blend_label_weights)(float *restrict w, const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++)
        w[x] = b->label ? b->by->range[b->label[x]].weight[b->disp[x] >> SST_BLEND_COLUMN_SHIFT] : 1.0f;
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

/* A W_s W_d. */
static inline void KERNEL(blend_ray_weights)(float *restrict w, const struct sst_blend *b, size_t n)
{
    if (b->disp) {
        KERNEL(blend_label_weights)(w, b, n);
        KERNEL(blend_depth_weights)(w, b, n);
    } else {
        for (size_t x = 0; x < n; x++)
            w[x] = b->aperture;
    }
}

static inline void KERNEL(blend_rays_part)(float *const acc[4], size_t from, const struct sst_blend *b, size_t n)
{
    float *restrict total = acc[3] + from;
    int32_t level[BLEND_PART];
    float w[BLEND_PART];

    KERNEL(blend_ray_weights)(w, b, n);
    for (size_t x = 0; x < n; x++)
        total[x] += w[x];
    for (int c = 0; c < 3; c++) {
        float *restrict to = acc[c] + from;

        KERNEL(blend_colour)(level, b, c, n);
        for (size_t x = 0; x < n; x++)
            to[x] += w[x] * (float)level[x];
    }
}

static inline void KERNEL(blend_plain_part)(int32_t *const sum[3], float *restrict count, size_t from,
                                            const struct sst_blend *b, size_t n)
{
    int32_t level[BLEND_PART];

    for (int c = 0; c < 3; c++) {
        int32_t *restrict to = sum[c] + from;

        KERNEL(blend_colour)(level, b, c, n);
        for (size_t x = 0; x < n; x++)
            to[x] += level[x];
    }
    for (size_t x = 0; x < n; x++)
        count[from + x] += 1.0f;
}

static inline void KERNEL(blend_take_part)(uint8_t *const colour[3], float *weight, size_t from,
                                           const struct sst_blend *b, size_t n)
{
    int32_t level[BLEND_PART];

    KERNEL(blend_ray_weights)(weight + from, b, n);
    for (int c = 0; c < 3; c++) {
        uint8_t *restrict out = colour[c] + from;

        KERNEL(blend_colour)(level, b, c, n);
        for (size_t x = 0; x < n; x++)
            out[x] = (uint8_t)((level[x] + SST_BLEND_LEVEL / 2) >> SST_BLEND_LEVEL_BITS);
    }
}

static inline void KERNEL(blend_rays_parts)(float *const acc[4], const struct sst_blend *b, int views, size_t n)
{
    for (size_t x = 0; x < n; x += BLEND_PART) {
        for (int k = 0; k < views; k++) {
            const struct sst_blend part = KERNEL(blend_from)(&b[k], x);

            KERNEL(blend_rays_part)(acc, x, &part, KERNEL(blend_part)(n - x));
        }
    }
}

static inline void KERNEL(blend_plain_parts)(int32_t *const sum[3], float *count, const struct sst_blend *b, int views,
                                             size_t n)
{
    for (int k = 0; k < views; k++) {
        for (size_t x = 0; x < n; x += BLEND_PART) {
            const struct sst_blend part = KERNEL(blend_from)(&b[k], x);

            KERNEL(blend_plain_part)(sum, count, x, &part, KERNEL(blend_part)(n - x));
        }
    }
}

static inline void KERNEL(blend_take_parts)(uint8_t *const colour[3], float *weight, const struct sst_blend *b,
                                            size_t n)
{
    for (size_t x = 0; x < n; x += BLEND_PART) {
        const struct sst_blend part = KERNEL(blend_from)(b, x);

        KERNEL(blend_take_part)(colour, weight, x, &part, KERNEL(blend_part)(n - x));
    }
}

#if SIMD_BYTES > 16
#include "pipeline/kernels/blend_block_tmpl.h"
#else
static void KERNEL(blend_take)(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n)
{
    KERNEL(blend_take_parts)(colour, weight, b, n);
}

static void KERNEL(blend_rays)(float *const acc[4], const struct sst_blend *b, int views, size_t n)
{
    KERNEL(blend_rays_parts)(acc, b, views, n);
}

static void KERNEL(blend_plain)(int32_t *const sum[3], float *count, const struct sst_blend *b, int views, size_t n)
{
    KERNEL(blend_plain_parts)(sum, count, b, views, n);
}
#endif

static void KERNEL(blend_support)(uint8_t *restrict support, const uint16_t *restrict disp,
                                  const uint8_t *restrict label, const uint32_t *restrict ends, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint32_t range = ends[label ? label[x] : 0], d = disp[x];

        support[x] = (uint8_t)(support[x] | -((d >= (range & 0xFFFF)) & (d <= range >> 16)));
    }
}

#undef BLEND_PART
