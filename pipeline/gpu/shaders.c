/* Shaders by number: names, and abilities that variants need. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/gpu_internal.h"

#define X(NAME, name) [SST_GPU_##NAME] = { #name },
#define V(NAME, name, OF, ABILITY, word)                                                                               \
    [SST_GPU_##NAME] = { #name, SST_GPU_##ABILITY, SST_GPU_##ABILITY##_FAST, SST_GPU_##OF, word },
const struct gpu_shader gpu_shaders[SST_GPU_SHADERS] = { SST_GPU_SHADER_LIST(X) SST_GPU_VARIANT_LIST(V) };
#undef X
#undef V

bool sst_gpu_is_variant(enum sst_gpu_shader shader)
{
    return gpu_shaders[shader].needs != 0;
}

bool sst_gpu_can(const struct sst_gpu_info *info, enum sst_gpu_shader shader)
{
    const uint32_t needs = gpu_shaders[shader].needs;

    return (info->abilities & needs) == needs;
}

bool sst_gpu_is_fast(const struct sst_gpu_info *info, enum sst_gpu_shader shader)
{
    return sst_gpu_is_variant(shader) && sst_gpu_can(info, shader) && info->abilities & gpu_shaders[shader].fast;
}

const char *sst_gpu_shader_name(enum sst_gpu_shader shader)
{
    return gpu_shaders[shader].name;
}
