/* light_row: light times a factor, sRGB to sRGB. Blocks without a dark sample take a quarter of the operations. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/light_code.h"

#if defined(__aarch64__)
#include "pipeline/kernels/arm/light_row_tmpl.h"
#else
#define LIGHT_BLOCK 32

static inline uint8_t KERNEL(light_finish)(float code, float v)
{
    const float keep = 255.0f - SST_LIGHT_KEEP * (255.0f - v), kept = code > keep ? code : keep;

    return (uint8_t)(int)((kept < 255.0f ? kept : 255.0f) + 0.5f);
}

/* Values from which on all results are above the knee, in 1/128 level: the straight part s is convex, with s(v) = v up
 * to the knee, so that f s(v) is above f v; a hundredth covers the fit. */
static inline int KERNEL(light_bright)(const struct sst_light *light, size_t n)
{
    int32_t least_bits = INT32_MAX; /* positive numbers are in the order of their bits, as whole numbers */
    float least;

    for (size_t x = 0; x < n; x++) {
        int32_t bits;

        memcpy(&bits, light->falloff + x, sizeof(bits));
        least_bits = bits < least_bits ? bits : least_bits;
    }
    memcpy(&least, &least_bits, sizeof(least));
    least = light->gain * least < 1.0f ? light->gain * least : 1.0f;
    return least > 0.02f ? (int)(1.01f * SST_LIGHT_KNEE / least * (1 << SST_LIGHT_SHIFT)) + 1 : INT32_MAX;
}

static inline bool KERNEL(light_all_bright)(const uint16_t *value, int bright)
{
    int darkest = UINT16_MAX;

    for (size_t i = 0; i < LIGHT_BLOCK; i++)
        darkest = value[i] < darkest ? value[i] : darkest;
    return darkest >= bright;
}

/* The power part alone, which sst_light_code() is there. */
static inline void KERNEL(light_block)(uint8_t *restrict out, const uint16_t *restrict value,
                                       const float *restrict root, float gain_root)
{
    for (size_t i = 0; i < LIGHT_BLOCK; i++) {
        const float v = (float)value[i] * (1.0f / (1 << SST_LIGHT_SHIFT));

        out[i] = KERNEL(light_finish)(gain_root * root[i] * (v + SST_LIGHT_OFFSET) - SST_LIGHT_OFFSET, v);
    }
}

static void KERNEL(light_row)(uint8_t *restrict out, const struct sst_light *light, size_t n)
{
    const uint16_t *restrict value = light->value;
    const float *restrict falloff = light->falloff, *restrict root = light->falloff_root;
    const float gain = light->gain, gain_root = light->gain_root;
    const int bright = KERNEL(light_bright)(light, n);

    for (size_t x = 0, end; x < n; x = end) {
        end = x + LIGHT_BLOCK < n ? x + LIGHT_BLOCK : n;
        if (end == x + LIGHT_BLOCK && KERNEL(light_all_bright)(value + x, bright)) {
            KERNEL(light_block)(out + x, value + x, root + x, gain_root);
            continue;
        }
        for (size_t i = x; i < end; i++) {
            const float v = (float)value[i] * (1.0f / (1 << SST_LIGHT_SHIFT));

            out[i] = KERNEL(light_finish)(sst_light_code(v, gain * falloff[i], gain_root * root[i]), v);
        }
    }
}
#undef LIGHT_BLOCK
#endif
