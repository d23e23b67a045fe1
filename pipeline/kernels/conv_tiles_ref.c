/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/kernels/kernels.h"

static const int8_t spread[SST_CONV_TILE][SST_CONV_TILE] = { { 4, 0, -5, 0, 1, 0 },  { 0, -4, -4, 1, 1, 0 },
                                                             { 0, 4, -4, -1, 1, 0 }, { 0, -2, -1, 2, 1, 0 },
                                                             { 0, 2, -1, -2, 1, 0 }, { 0, 4, 0, -5, 0, 1 } };
static const int8_t gather[SST_CONV_OUT][SST_CONV_TILE] = {
    { 6, 4, 4, 1, 1, 0 }, { 0, 4, -4, 2, -2, 0 }, { 0, 4, 4, 4, 4, 0 }, { 0, 4, -4, 8, -8, 24 }
};

void sst_conv_spread_ref(int16_t *out, size_t stride, const uint8_t *const pixel[SST_CONV_PARTS], size_t channels,
                         int is_signed)
{
    for (size_t c = 0; c < channels; c++) {
        for (int k = 0; k < SST_CONV_PARTS; k++) {
            int sum = 0;

            for (int i = 0; i < SST_CONV_PARTS; i++) {
                const int value = is_signed ? (int8_t)pixel[i][c] : pixel[i][c];

                sum +=
                    spread[k / SST_CONV_TILE][i / SST_CONV_TILE] * spread[k % SST_CONV_TILE][i % SST_CONV_TILE] * value;
            }
            out[(size_t)k * stride + c] = (int16_t)sum;
        }
    }
}

void sst_conv_products_ref(int32_t *out, const int16_t *tiles, const int16_t *weights, size_t channels, size_t n)
{
    for (size_t i = 0; i < n * SST_CONV_BLOCK; i++) {
        const int16_t *tile = tiles + i / SST_CONV_BLOCK * channels;
        const size_t o = i % SST_CONV_BLOCK;
        uint32_t sum = 0;

        for (size_t c = 0; c < channels; c++)
            sum += (uint32_t)(tile[c] * weights[(c / 2 * SST_CONV_BLOCK + o) * 2 + c % 2]);
        out[i] = (int32_t)sum;
    }
}

void sst_conv_gather_ref(int32_t *out, const int32_t *m, size_t stride)
{
    for (int p = 0; p < SST_CONV_PIXELS; p++) {
        for (size_t o = 0; o < SST_CONV_BLOCK; o++) {
            uint32_t sum = 0;

            for (int k = 0; k < SST_CONV_PARTS; k++)
                sum += (uint32_t)(gather[p / SST_CONV_OUT][k / SST_CONV_TILE] *
                                  gather[p % SST_CONV_OUT][k % SST_CONV_TILE]) *
                       (uint32_t)m[(size_t)k * stride + o];
            out[p * SST_CONV_BLOCK + (int)o] = (int32_t)(sum * SST_CONV_NINTH) >> 6;
        }
    }
}

static float number_at(const void *at, enum sst_conv_type type, size_t o)
{
    if (type == SST_CONV_F32)
        return ((const float *)at)[o];
    return type == SST_CONV_U8 ? (float)((const uint8_t *)at)[o] : (float)((const int8_t *)at)[o];
}

static void store(void *to, enum sst_conv_type type, size_t o, float v)
{
    const float low = type == SST_CONV_U8 ? 0 : -128, high = type == SST_CONV_U8 ? 255 : 127;

    if (type == SST_CONV_F32)
        ((float *)to)[o] = v;
    else
        ((uint8_t *)to)[o] = (uint8_t)(int)nearbyintf(fminf(fmaxf(v, low), high));
}

void sst_conv_finish_ref(void *const *to, const int32_t *sums, const struct sst_conv_finish *f)
{
    for (size_t p = 0; p < SST_CONV_PIXELS; p++) {
        for (size_t o = 0; o < SST_CONV_BLOCK && to[p]; o++) {
            float v = (float)sums[p * SST_CONV_BLOCK + o];

            v = f->bias_first ? (v + f->bias[o]) * f->scale[o] : v * f->scale[o] + f->bias[o];
            if (f->residual != SST_CONV_NONE)
                v = fmaf(number_at(to[p], f->residual, o), f->residual_scale, v);
            if (f->relu)
                v = v > 0 ? v : 0;
            store(to[p], f->type, o, v);
        }
    }
}
