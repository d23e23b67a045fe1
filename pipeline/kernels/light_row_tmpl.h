/* light_row: light times a factor, sRGB to sRGB */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/light_code.h"

#if defined(__aarch64__)
#include "pipeline/kernels/arm/light_row_tmpl.h"
#else
static void KERNEL(light_row)(uint8_t *restrict out, const struct sst_light *light, size_t n)
{
    const uint16_t *restrict value = light->value;
    const float *restrict falloff = light->falloff, *restrict root = light->falloff_root;
    const float gain = light->gain, gain_root = light->gain_root;

    for (size_t x = 0; x < n; x++) {
        const float v = (float)value[x] * (1.0f / (1 << SST_LIGHT_SHIFT));
        const float code = sst_light_code(v, gain * falloff[x], gain_root * root[x]);
        const float keep = 255.0f - SST_LIGHT_KEEP * (255.0f - v), kept = code > keep ? code : keep;

        out[x] = (uint8_t)(int)((kept < 255.0f ? kept : 255.0f) + 0.5f);
    }
}
#endif
