#include "pipeline/gpu/blend.h"
#include "pipeline/gpu/carry.h"
#include "pipeline/gpu/check.h"
#include "pipeline/gpu/clear_sample.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/hole.h"
#include "pipeline/gpu/hypotheses.h"
#include "pipeline/gpu/jpeg_rgb.h"
#include "pipeline/gpu/match.h"
#include "pipeline/gpu/net.h"
#include "pipeline/gpu/rectify.h"
#include "pipeline/gpu/subpixel.h"
#include "pipeline/gpu/surfaces.h"
#include "pipeline/gpu/sweep.h"
#include "pipeline/gpu/verify.h"

#define X(NAME, name, buffers, push) [SST_GPU_##NAME] = { #name, buffers, sizeof(struct push) },
#define V(NAME, name, OF, of, word, needs, fast, buffers, push)                                                        \
    [SST_GPU_##NAME] = { #name, buffers, sizeof(struct push), needs, fast, SST_GPU_##OF, word },
const struct gpu_shader gpu_shaders[SST_GPU_SHADERS] = { SST_GPU_SHADER_LIST(X) SST_GPU_VARIANT_LIST(V) };
#undef X
#undef V

#define X(NAME, name, buffers, push)                                                                                   \
    _Static_assert(sizeof(struct push) <= 128, "Vulkan guarantees 128 bytes of push constants");
SST_GPU_SHADER_LIST(X)
#undef X

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
