/* What each shader takes on a Vulkan device: timestamps around dispatches, added up and logged when the device is closed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/gpu_internal.h"

#include <stdlib.h>
#include <string.h>

#include "base/log.h"

/* Of a batch: two of each dispatch, before and after, and two of all commands. */
#define BATCH   (2 * GPU_VULKAN_SETS + 2)
#define QUERIES (BATCH * GPU_VULKAN_BATCHES)

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

static uint32_t query_of(int b, int pair)
{
    return (uint32_t)(b * BATCH + 2 * pair);
}

static void stamp(struct gpu_vulkan_device *v, int b, uint32_t query)
{
    v->vk->vkCmdWriteTimestamp(v->batch[b].command, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, v->times.pool, query);
}

void gpu_vulkan_time_batch(struct gpu_vulkan_device *v, int b, bool after)
{
    if (!v->times.pool)
        return;
    if (!after)
        v->vk->vkCmdResetQueryPool(v->batch[b].command, v->times.pool, query_of(b, 0), BATCH);
    stamp(v, b, query_of(b, GPU_VULKAN_SETS) + after);
}

void gpu_vulkan_time_dispatch(struct gpu_vulkan_device *v, int b, enum sst_gpu_shader shader, bool after)
{
    const int last = v->batch[b].sets - 1;

    if (!v->times.pool)
        return;
    v->times.shader[b][last] = shader;
    stamp(v, b, query_of(b, last) + after);
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

void gpu_vulkan_time_done(struct gpu_vulkan_device *v, int b)
{
    if (!v->times.pool)
        return;
    v->times.all_ms += between(v, query_of(b, GPU_VULKAN_SETS));
    v->times.submits++;
    for (int i = 0; i < v->batch[b].sets; i++) {
        v->times.ms[v->times.shader[b][i]] += between(v, query_of(b, i));
        v->times.dispatches[v->times.shader[b][i]]++;
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
