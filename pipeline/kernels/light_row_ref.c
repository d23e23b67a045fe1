/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/light_code.h"

void sst_light_row_ref(uint8_t *out, const struct sst_light *light, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float v = (float)light->value[x] * (1.0f / (1 << SST_LIGHT_SHIFT));
        const float f = light->gain * light->falloff[x], r = light->gain_root * light->falloff_root[x];
        const float code = sst_light_code(v, f, r), keep = 255.0f - SST_LIGHT_KEEP * (255.0f - v);
        const float kept = code > keep ? code : keep;

        out[x] = (uint8_t)((kept < 255.0f ? kept : 255.0f) + 0.5f);
    }
}
