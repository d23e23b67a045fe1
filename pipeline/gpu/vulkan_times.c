/* What each shader takes on a Vulkan device: timestamps around dispatches, added up and logged when the device is closed. */
#include "pipeline/gpu/gpu_internal.h"

#if WITH_VULKAN
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

/* Two of each dispatch, before and after, and two of all commands. */
#define QUERIES (2 * GPU_VULKAN_SETS + 2)

int gpu_vulkan_open_times(struct gpu_vulkan_device *v)
{
    const char *wanted = getenv("SST_GPU_TIMES");
    const VkQueryPoolCreateInfo info = { .sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
                                         .queryType = VK_QUERY_TYPE_TIMESTAMP,
                                         .queryCount = QUERIES };
    VkPhysicalDeviceProperties2 all = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2 };

    if (!wanted || strcmp(wanted, "1"))
        return 0;
    v->vk->vkGetPhysicalDeviceProperties2(v->physical, &all);
    if (!all.properties.limits.timestampComputeAndGraphics) {
        sst_log_warning("SST_GPU_TIMES=1: %s cannot take times", v->gpu.info.name);
        return 0;
    }
    v->times.ns_per_tick = all.properties.limits.timestampPeriod;
    return gpu_vulkan_error(v->vk->vkCreateQueryPool(v->device, &info, NULL, &v->times.pool));
}

static void stamp(struct gpu_vulkan_device *v, uint32_t query)
{
    v->vk->vkCmdWriteTimestamp(v->command, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, v->times.pool, query);
}

void gpu_vulkan_time_begin(struct gpu_vulkan_device *v)
{
    if (!v->times.pool)
        return;
    v->vk->vkCmdResetQueryPool(v->command, v->times.pool, 0, QUERIES);
    stamp(v, 2 * GPU_VULKAN_SETS);
}

void gpu_vulkan_time_end(struct gpu_vulkan_device *v)
{
    if (v->times.pool)
        stamp(v, 2 * GPU_VULKAN_SETS + 1);
}

void gpu_vulkan_time_dispatch(struct gpu_vulkan_device *v, enum sst_gpu_shader shader, bool after)
{
    if (!v->times.pool)
        return;
    v->times.shader[v->sets - 1] = shader;
    stamp(v, 2 * (uint32_t)(v->sets - 1) + after);
}

/* Milliseconds between two queries that have both come. */
static double between(const struct gpu_vulkan_device *v, uint32_t query)
{
    uint64_t at[2] = { 0 };

    if (v->vk->vkGetQueryPoolResults(v->device, v->times.pool, query, 2, sizeof(at), at, sizeof(*at),
                                     VK_QUERY_RESULT_64_BIT))
        return 0;
    return 1e-6 * v->times.ns_per_tick * (double)(at[1] - at[0]);
}

void gpu_vulkan_time_done(struct gpu_vulkan_device *v, int dispatches)
{
    if (!v->times.pool)
        return;
    v->times.all_ms += between(v, 2 * GPU_VULKAN_SETS);
    v->times.submits++;
    for (int i = 0; i < dispatches; i++) {
        v->times.ms[v->times.shader[i]] += between(v, 2 * (uint32_t)i);
        v->times.dispatches[v->times.shader[i]]++;
    }
}

void gpu_vulkan_close_times(struct gpu_vulkan_device *v)
{
    double rest = v->times.all_ms;

    if (!v->times.pool)
        return;
    for (int i = 0; i < SST_GPU_SHADERS; i++) {
        rest -= v->times.ms[i];
        if (v->times.dispatches[i])
            sst_log_info("%s: %s: %.3f ms in %u dispatches", v->gpu.info.name, gpu_shaders[i].name, v->times.ms[i],
                         v->times.dispatches[i]);
    }
    sst_log_info("%s: %.3f ms in %u submissions, %.3f of them between dispatches (copies)", v->gpu.info.name,
                 v->times.all_ms, v->times.submits, rest);
    v->vk->vkDestroyQueryPool(v->device, v->times.pool, NULL);
}
#endif
