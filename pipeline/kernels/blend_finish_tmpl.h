/* out = sum / weight, rounded */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
static void KERNEL(blend_finish)(uint8_t *restrict out, const float *restrict sum, const float *restrict weight,
                                 size_t n)
{
    for (size_t x = 0; x < n; x++)
        out[x] = (uint8_t)(int)(sum[x] * (1.0f / SST_BLEND_LEVEL) / (weight[x] + SST_BLEND_TINY) + 0.5f);
}
