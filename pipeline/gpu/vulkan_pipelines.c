/* Shaders of a Vulkan device: modules from the binaries of the build, pipelines, and their cache on disk. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/gpu_internal.h"

#include <stdlib.h>
#include <string.h>

#define KIND "pipelines"

static const struct gpu_spirv *find_spirv(const char *name)
{
    const struct gpu_spirv *s = gpu_spirvs;
    const size_t n = strlen(name);

    while (s->name && (strncmp(s->name, name, n) || strcmp(s->name + n, ".spv")))
        s++;
    return s;
}

static int make_module(struct gpu_vulkan_device *v, enum sst_gpu_shader number, VkShaderModule *out)
{
    const struct gpu_spirv *code = find_spirv(gpu_shaders[number].name);
    VkShaderModuleCreateInfo source = { .sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
                                        .codeSize = (size_t)(code->end - code->begin),
                                        .pCode = (const void *)code->begin };
    uint32_t *copy;
    int err;

    if (number != SST_GPU_NET_CONV8_MATRIX)
        return gpu_vulkan_error(v->vk->vkCreateShaderModule(v->device, &source, NULL, out));
    copy = malloc(source.codeSize);
    if (!copy)
        return -ENOMEM;
    memcpy(copy, code->begin, source.codeSize);
    source.pCode = copy;
    err = gpu_matrix_complete(copy, source.codeSize / sizeof(*copy)) ? -EIO : 0;
    err = err ? err : gpu_vulkan_error(v->vk->vkCreateShaderModule(v->device, &source, NULL, out));
    free(copy);
    return err;
}

int gpu_vulkan_compile(struct sst_gpu *g, enum sst_gpu_shader number)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    VkComputePipelineCreateInfo info = { .sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO };
    VkShaderModule module;
    struct gpu_matrix_stage stage;
    int err;

    if (v->pipeline[number])
        return 0; /* its test lacked memory, and is repeated */
    err = make_module(v, number, &module);
    if (err)
        return err;
    info.stage = (VkPipelineShaderStageCreateInfo){ .sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                                                    .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                    .module = module,
                                                    .pName = "main" };
    if (number == SST_GPU_NET_CONV8_MATRIX)
        gpu_matrix_stage_init(&stage, &info.stage, &g->info.matrix);
    info.layout = v->layout;
    err = gpu_vulkan_error(v->vk->vkCreateComputePipelines(v->device, v->cache, 1, &info, NULL, &v->pipeline[number]));
    v->vk->vkDestroyShaderModule(v->device, module, NULL);
    return err;
}

/* Driver, device and shaders: what compiled pipelines depend on. */
static uint64_t key_of(const struct gpu_vulkan_device *v)
{
    VkPhysicalDeviceIDProperties id = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES };
    VkPhysicalDeviceProperties2 all = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &id };
    uint64_t key = GPU_HASH_START;

    v->vk->vkGetPhysicalDeviceProperties2(v->physical, &all);
    key = gpu_hash(key, id.driverUUID, sizeof(id.driverUUID));
    key = gpu_hash(key, id.deviceUUID, sizeof(id.deviceUUID));
    key = gpu_hash(key, all.properties.pipelineCacheUUID, sizeof(all.properties.pipelineCacheUUID));
    key = gpu_hash(key, &all.properties.driverVersion, sizeof(all.properties.driverVersion));
    for (const struct gpu_spirv *s = gpu_spirvs; s->name; s++)
        key = gpu_hash(key, s->begin, (size_t)(s->end - s->begin));
    return key;
}

int gpu_vulkan_open_cache(struct gpu_vulkan_device *v)
{
    VkPipelineCacheCreateInfo info = { .sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO };
    void *data;
    VkResult rc;

    v->gpu.cache_key = key_of(v);
    data = gpu_cache_read(KIND, v->gpu.cache_key, &info.initialDataSize);
    v->cache_bytes = info.initialDataSize;
    info.pInitialData = data;
    rc = v->vk->vkCreatePipelineCache(v->device, &info, NULL, &v->cache);
    free(data);
    return gpu_vulkan_error(rc);
}

void gpu_vulkan_store_cache(struct gpu_vulkan_device *v)
{
    size_t bytes = 0;
    void *data;

    if (!v->cache || v->gpu.lost || v->vk->vkGetPipelineCacheData(v->device, v->cache, &bytes, NULL) ||
        bytes == v->cache_bytes)
        return;
    data = malloc(bytes);
    if (data && !v->vk->vkGetPipelineCacheData(v->device, v->cache, &bytes, data))
        gpu_cache_write(KIND, v->gpu.cache_key, data, bytes);
    free(data);
}
