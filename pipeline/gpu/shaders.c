#include <errno.h>
#include <stdlib.h>
#include <string.h>

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

#define X(NAME, name, buffers, push)                                                                                   \
    [SST_GPU_##NAME] = { #name, buffers, sizeof(struct push), name##_reference, name##_self_test },
#define S(NAME, name, buffers, push) [SST_GPU_##NAME] = { #name, buffers, sizeof(struct push) },
#define V(NAME, name, OF, of, word, needs, fast, buffers, push)                                                        \
    [SST_GPU_##NAME] = { #name, buffers, sizeof(struct push), NULL, NULL, needs, fast, SST_GPU_##OF, word },
const struct gpu_shader gpu_shaders[SST_GPU_SHADERS] = {
    SST_GPU_SHADER_LIST(X) SST_GPU_STEP_LIST(S) SST_GPU_VARIANT_LIST(V)
};
#undef X
#undef S
#undef V

#define X(NAME, name, buffers, push)                                                                                   \
    _Static_assert(sizeof(struct push) <= 128, "Vulkan guarantees 128 bytes of push constants");
SST_GPU_SHADER_LIST(X) SST_GPU_STEP_LIST(X)
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

static void free_all(uint8_t *one[SST_GPU_BUFFERS], uint8_t *other[SST_GPU_BUFFERS])
{
    for (int i = 0; i < SST_GPU_BUFFERS; i++) {
        free(one[i]);
        free(other[i]);
        one[i] = other[i] = NULL;
    }
}

int gpu_run_both(struct sst_gpu *g, const struct sst_gpu_work *work, const void *const *initial, const size_t *bytes,
                 uint8_t *on_device[SST_GPU_BUFFERS], uint8_t *on_host[SST_GPU_BUFFERS])
{
    const struct gpu_shader *shader = &gpu_shaders[work->shader];
    struct sst_gpu_work run = *work;
    void *buffer[SST_GPU_BUFFERS];
    int err = 0;

    memset(run.buffer, 0, sizeof(run.buffer));
    for (int i = 0; i < SST_GPU_BUFFERS; i++)
        on_device[i] = on_host[i] = NULL;
    for (int i = 0; i < shader->buffers && !err; i++) {
        on_device[i] = malloc(bytes[i]);
        buffer[i] = on_host[i] = malloc(bytes[i]);
        err = on_device[i] && on_host[i] ? sst_gpu_buffer_create(g, &run.buffer[i], bytes[i]) : -ENOMEM;
        if (!err)
            err = sst_gpu_upload(g, run.buffer[i], 0, initial[i], bytes[i]);
        if (!err)
            memcpy(on_host[i], initial[i], bytes[i]);
    }
    if (!err)
        err = sst_gpu_dispatch(g, &run);
    for (int i = 0; i < shader->buffers && !err; i++)
        err = sst_gpu_download(g, on_device[i], run.buffer[i], 0, bytes[i]);
    for (int i = 0; i < SST_GPU_BUFFERS; i++)
        sst_gpu_buffer_destroy(g, run.buffer[i]);
    if (err)
        free_all(on_device, on_host);
    else
        shader->reference(work->push, buffer, work->groups);
    return err;
}

int gpu_compare(struct sst_gpu *g, const struct sst_gpu_work *work, const void *const *initial, const size_t *bytes,
                int out, void *keep)
{
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    int err = gpu_run_both(g, work, initial, bytes, device, host);

    if (err)
        return err;
    for (int i = 0; i < gpu_shaders[work->shader].buffers; i++)
        err = memcmp(device[i], host[i], bytes[i]) ? -ENOTSUP : err;
    if (keep)
        memcpy(keep, host[out], bytes[out]);
    free_all(device, host);
    return err;
}
