/* One Vulkan device: a queue, batches of commands, memory that the host writes and reads.
 *
 * Commands are gathered. A batch runs when its part of the staging memory or its pool of descriptors is full, while the
 * host gathers the next one; on a wait or a download all of them are waited for. Each command waits for the one before:
 * they are few, and each fills the device. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/gpu_internal.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

#define STAGING_BYTES ((size_t)8 << 20) /* of a batch */

struct vulkan_buffer {
    struct sst_gpu_buffer buffer; /* first */
    struct gpu_vulkan_memory memory;
};

struct vulkan_span {
    struct sst_gpu_span span; /* first */
    struct gpu_vulkan_memory memory;
};

static struct gpu_vulkan_memory *memory_of(struct sst_gpu_buffer *b)
{
    return &((struct vulkan_buffer *)b)->memory;
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

static void free_memory(struct gpu_vulkan_device *v, struct gpu_vulkan_memory *m)
{
    v->vk->vkDestroyBuffer(v->device, m->buffer, NULL);
    v->vk->vkFreeMemory(v->device, m->memory, NULL);
    *m = (struct gpu_vulkan_memory){ 0 };
}

/* Allocate of the first type of memory with these properties. */
static int alloc_memory(struct gpu_vulkan_device *v, struct gpu_vulkan_memory *m, size_t bytes,
                        VkBufferUsageFlags usage, VkMemoryPropertyFlags properties)
{
    const VkBufferCreateInfo info = { .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = bytes, .usage = usage };
    VkMemoryAllocateInfo alloc = { .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO };
    VkMemoryRequirements needs;
    uint32_t type = 0;
    VkResult rc = v->vk->vkCreateBuffer(v->device, &info, NULL, &m->buffer);

    if (rc)
        return gpu_vulkan_error(rc);
    v->vk->vkGetBufferMemoryRequirements(v->device, m->buffer, &needs);
    while (type < v->memory.memoryTypeCount && (!(needs.memoryTypeBits >> type & 1) ||
                                                (v->memory.memoryTypes[type].propertyFlags & properties) != properties))
        type++;
    alloc.allocationSize = needs.size;
    alloc.memoryTypeIndex = type;
    rc = type < v->memory.memoryTypeCount ? v->vk->vkAllocateMemory(v->device, &alloc, NULL, &m->memory)
                                          : VK_ERROR_FEATURE_NOT_PRESENT;
    if (!rc)
        rc = v->vk->vkBindBufferMemory(v->device, m->buffer, m->memory, 0);
    if (rc)
        free_memory(v, m);
    return gpu_vulkan_error(rc);
}

static int create(struct sst_gpu *g, struct sst_gpu_buffer **out, size_t bytes)
{
    struct vulkan_buffer *b = calloc(1, sizeof(*b));
    const VkBufferUsageFlags usage =
        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    int err = b ? alloc_memory((struct gpu_vulkan_device *)g, &b->memory, (bytes + 3) / 4 * 4, usage,
                               VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT)
                : -ENOMEM;

    if (err)
        free(b);
    else
        *out = &b->buffer;
    return err;
}

/* --- commands ----------------------------------------------------------------------------------------------------- */

/* Wait for a batch, if it runs. */
static int finish(struct gpu_vulkan_device *v, int i)
{
    struct gpu_vulkan_batch *b = &v->batch[i];
    VkResult rc;

    if (!b->running)
        return 0;
    rc = v->vk->vkWaitForFences(v->device, 1, &b->fence, VK_TRUE, (uint64_t)v->gpu.cfg.timeout_ms * 1000000);
    v->hung = rc == VK_TIMEOUT;
    if (rc)
        return gpu_vulkan_error(rc);
    b->running = false;
    gpu_vulkan_time_done(v, i);
    b->staged = 0;
    b->sets = 0;
    rc = v->vk->vkResetFences(v->device, 1, &b->fence);
    if (!rc)
        rc = v->vk->vkResetDescriptorPool(v->device, b->descriptors, 0);
    return gpu_vulkan_error(rc);
}

/* Begin to gather commands, and let the next one wait for all before it. */
static int begin(struct gpu_vulkan_device *v)
{
    const VkCommandBufferBeginInfo info = { .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                            .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT };
    const VkMemoryBarrier barrier = { .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                      .srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT | VK_ACCESS_MEMORY_READ_BIT,
                                      .dstAccessMask = VK_ACCESS_MEMORY_WRITE_BIT | VK_ACCESS_MEMORY_READ_BIT };
    const VkPipelineStageFlags stages = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
    struct gpu_vulkan_batch *b = &v->batch[v->now];
    int err;

    if (!b->recording) {
        err = finish(v, v->now);
        err = err ? err : gpu_vulkan_error(v->vk->vkBeginCommandBuffer(b->command, &info));
        if (err)
            return err;
        b->recording = true;
        gpu_vulkan_time_batch(v, v->now, false);
    }
    v->vk->vkCmdPipelineBarrier(b->command, stages, stages, 0, 1, &barrier, 0, NULL, 0, NULL);
    return 0;
}

/* Run what is gathered. */
static int submit(struct gpu_vulkan_device *v)
{
    const VkMemoryBarrier barrier = { .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                      .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                      .dstAccessMask = VK_ACCESS_HOST_READ_BIT };
    struct gpu_vulkan_batch *b = &v->batch[v->now];
    const VkSubmitInfo info = { .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
                                .commandBufferCount = 1,
                                .pCommandBuffers = &b->command };
    VkResult rc;

    if (!b->recording)
        return 0;
    b->recording = false;
    v->vk->vkCmdPipelineBarrier(b->command, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier,
                                0, NULL, 0, NULL);
    gpu_vulkan_time_batch(v, v->now, true);
    rc = v->vk->vkEndCommandBuffer(b->command);
    if (!rc)
        rc = v->vk->vkQueueSubmit(v->queue, 1, &info, b->fence);
    if (rc)
        return gpu_vulkan_error(rc);
    b->running = true;
    v->now = (v->now + 1) % GPU_VULKAN_BATCHES;
    return 0;
}

/* Run what is gathered, and wait for all. */
static int flush(struct gpu_vulkan_device *v)
{
    int err = submit(v);

    for (int i = 0; i < GPU_VULKAN_BATCHES && !err; i++)
        err = finish(v, (v->now + i) % GPU_VULKAN_BATCHES);
    return err || !v->vk->faults ? err : -EIO;
}

static int wait_done(struct sst_gpu *g)
{
    return flush((struct gpu_vulkan_device *)g);
}

/* Staging memory for at most `bytes`; at least one. @param at  out: where it begins */
static int stage(struct gpu_vulkan_device *v, size_t *at, size_t *bytes)
{
    int err = v->batch[v->now].staged < STAGING_BYTES ? 0 : submit(v);

    err = err ? err : begin(v);
    if (err)
        return err;
    if (*bytes > STAGING_BYTES - v->batch[v->now].staged)
        *bytes = STAGING_BYTES - v->batch[v->now].staged;
    *at = (size_t)v->now * STAGING_BYTES + v->batch[v->now].staged;
    v->batch[v->now].staged += *bytes;
    return 0;
}

static int upload(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const void *data, size_t bytes)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    int err = 0;

    for (size_t done = 0, n, at; done < bytes && !err; done += n) {
        n = bytes - done;
        err = stage(v, &at, &n);
        if (!err) {
            const VkBufferCopy region = { at, offset + done, n };

            memcpy(v->mapped + at, (const uint8_t *)data + done, n);
            v->vk->vkCmdCopyBuffer(v->batch[v->now].command, v->staging.buffer, memory_of(b)->buffer, 1, &region);
        }
    }
    return err;
}

static int upload_span(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const struct sst_gpu_span *s,
                       size_t from, size_t bytes)
{
    const VkBufferCopy region = { from, offset, bytes };
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    const int err = begin(v);

    if (!err && bytes)
        v->vk->vkCmdCopyBuffer(v->batch[v->now].command, ((const struct vulkan_span *)s)->memory.buffer,
                               memory_of(b)->buffer, 1, &region);
    return err;
}

static int copy(struct sst_gpu *g, struct sst_gpu_buffer *to, size_t to_offset, struct sst_gpu_buffer *from,
                size_t from_offset, size_t bytes)
{
    const VkBufferCopy region = { from_offset, to_offset, bytes };
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    const int err = begin(v);

    if (!err && bytes)
        v->vk->vkCmdCopyBuffer(v->batch[v->now].command, memory_of(from)->buffer, memory_of(to)->buffer, 1, &region);
    return err;
}

static int fill(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, size_t bytes, uint32_t word)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    const int err = begin(v);

    if (!err && bytes)
        v->vk->vkCmdFillBuffer(v->batch[v->now].command, memory_of(b)->buffer, offset, bytes, word);
    return err;
}

/* A part of a download that runs. */
struct part {
    int batch;
    size_t at, bytes;
};

static int start_part(struct gpu_vulkan_device *v, struct part *p, struct sst_gpu_buffer *b, size_t from, size_t bytes)
{
    int err = stage(v, &p->at, &bytes);

    if (!err) {
        const VkBufferCopy region = { from, p->at, bytes };

        v->vk->vkCmdCopyBuffer(v->batch[v->now].command, memory_of(b)->buffer, v->staging.buffer, 1, &region);
        p->batch = v->now;
        p->bytes = bytes;
        err = submit(v);
    }
    return err;
}

static int download(struct sst_gpu *g, void *data, struct sst_gpu_buffer *b, size_t offset, size_t bytes)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    struct part part[2];
    size_t started = 0;
    int err = bytes ? start_part(v, &part[0], b, offset, bytes) : 0;

    for (size_t done = 0, i = 0; done < bytes && !err; i++) {
        const struct part *p = &part[i % 2];

        started = done + p->bytes;
        if (started < bytes) /* the next one runs while this one is copied */
            err = start_part(v, &part[(i + 1) % 2], b, offset + started, bytes - started);
        err = err ? err : finish(v, p->batch);
        if (!err)
            memcpy((uint8_t *)data + done, v->mapped + p->at, p->bytes);
        done = started;
    }
    return err || !v->vk->faults ? err : -EIO;
}

static int bind(struct gpu_vulkan_device *v, const struct sst_gpu_work *work, VkDescriptorSet *set)
{
    const VkDescriptorSetAllocateInfo info = { .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
                                               .descriptorPool = v->batch[v->now].descriptors,
                                               .descriptorSetCount = 1,
                                               .pSetLayouts = &v->set };
    VkDescriptorBufferInfo buffer[SST_GPU_BUFFERS];
    VkWriteDescriptorSet write[SST_GPU_BUFFERS];
    const VkResult rc = v->vk->vkAllocateDescriptorSets(v->device, &info, set);
    uint32_t n = 0;

    for (uint32_t i = 0; i < SST_GPU_BUFFERS && !rc; i++) {
        if (!work->buffer[i])
            continue;
        buffer[i] = (VkDescriptorBufferInfo){ memory_of(work->buffer[i])->buffer, work->offset[i], VK_WHOLE_SIZE };
        write[n++] = (VkWriteDescriptorSet){ .sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
                                             .dstSet = *set,
                                             .dstBinding = i,
                                             .descriptorCount = 1,
                                             .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                                             .pBufferInfo = &buffer[i] };
    }
    if (!rc)
        v->vk->vkUpdateDescriptorSets(v->device, n, write, 0, NULL);
    return gpu_vulkan_error(rc);
}

static int dispatch(struct sst_gpu *g, const struct sst_gpu_work *work)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    struct gpu_vulkan_batch *b;
    VkDescriptorSet set;
    int err = v->batch[v->now].sets < GPU_VULKAN_SETS ? 0 : submit(v);

    err = err ? err : begin(v);
    err = err ? err : bind(v, work, &set);
    if (err)
        return err;
    b = &v->batch[v->now];
    b->sets++;
    gpu_vulkan_time_dispatch(v, v->now, work->shader, false);
    v->vk->vkCmdBindPipeline(b->command, VK_PIPELINE_BIND_POINT_COMPUTE, v->pipeline[work->shader]);
    v->vk->vkCmdBindDescriptorSets(b->command, VK_PIPELINE_BIND_POINT_COMPUTE, v->layout, 0, 1, &set, 0, NULL);
    v->vk->vkCmdPushConstants(b->command, v->layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, (uint32_t)work->push_bytes,
                              work->push);
    v->vk->vkCmdDispatch(b->command, work->groups[0], work->groups[1], work->groups[2]);
    gpu_vulkan_time_dispatch(v, v->now, work->shader, true);
    return 0;
}

/* --- open, close -------------------------------------------------------------------------------------------------- */

static void destroy(struct sst_gpu *g, struct sst_gpu_buffer *b)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;

    if (!g->lost)
        g->lost = flush(v); /* commands may refer to it */
    if (!v->hung)
        free_memory(v, memory_of(b));
    free(b);
}

static int span_create(struct sst_gpu *g, struct sst_gpu_span **out, size_t bytes)
{
    const VkMemoryPropertyFlags visible = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    struct vulkan_span *s = calloc(1, sizeof(*s));
    int err = s ? alloc_memory(v, &s->memory, (bytes + 3) / 4 * 4, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, visible) : -ENOMEM;

    if (err) {
        free(s);
        return err;
    }
    err = gpu_vulkan_error(v->vk->vkMapMemory(v->device, s->memory.memory, 0, VK_WHOLE_SIZE, 0, &s->span.data));
    if (err) {
        free_memory(v, &s->memory);
        free(s);
        return err;
    }
    s->span.bytes = bytes;
    *out = &s->span;
    return 0;
}

static void span_destroy(struct sst_gpu *g, struct sst_gpu_span *s)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;

    if (!g->lost)
        g->lost = flush(v); /* commands may refer to it */
    if (!v->hung)
        free_memory(v, &((struct vulkan_span *)s)->memory);
    free(s);
}

/* Devices that did not answer, closed or not: their work may still run. */
static struct gpu_vulkan_device *left;
static pthread_mutex_t left_lock = PTHREAD_MUTEX_INITIALIZER;

static void close_device(struct sst_gpu *g)
{
    struct gpu_vulkan_device *v = (struct gpu_vulkan_device *)g;
    const struct gpu_vulkan *vk = v->vk;

    if (v->hung) {
        pthread_mutex_lock(&left_lock);
        v->next = left;
        left = v;
        pthread_mutex_unlock(&left_lock);
        return;
    }
    if (v->device) {
        gpu_vulkan_store_cache(v);
        gpu_vulkan_close_times(v);
        for (int i = 0; i < SST_GPU_SHADERS; i++)
            vk->vkDestroyPipeline(v->device, v->pipeline[i], NULL);
        vk->vkDestroyPipelineLayout(v->device, v->layout, NULL);
        vk->vkDestroyDescriptorSetLayout(v->device, v->set, NULL);
        vk->vkDestroyPipelineCache(v->device, v->cache, NULL);
        for (int i = 0; i < GPU_VULKAN_BATCHES; i++) {
            vk->vkDestroyDescriptorPool(v->device, v->batch[i].descriptors, NULL);
            vk->vkDestroyFence(v->device, v->batch[i].fence, NULL);
        }
        vk->vkDestroyCommandPool(v->device, v->commands, NULL);
        free_memory(v, &v->staging);
        vk->vkDestroyDevice(v->device, NULL);
    }
    free(v);
}

static const struct gpu_ops ops = { create,    destroy,      gpu_vulkan_compile, upload,       download,    dispatch,
                                    wait_done, close_device, span_create,        span_destroy, upload_span, copy,
                                    fill };

static int open_staging(struct gpu_vulkan_device *v)
{
    const VkBufferUsageFlags usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    const VkMemoryPropertyFlags visible = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    void *mapped;
    /* Reads of memory that is not cached take ten times as long; not every device has cached memory. */
    int err = alloc_memory(v, &v->staging, GPU_VULKAN_BATCHES * STAGING_BYTES, usage,
                           visible | VK_MEMORY_PROPERTY_HOST_CACHED_BIT);

    if (err)
        err = alloc_memory(v, &v->staging, GPU_VULKAN_BATCHES * STAGING_BYTES, usage, visible);
    err = err ? err : gpu_vulkan_error(v->vk->vkMapMemory(v->device, v->staging.memory, 0, VK_WHOLE_SIZE, 0, &mapped));
    if (!err)
        v->mapped = mapped;
    return err;
}

static int open_queue(struct gpu_vulkan_device *v)
{
    const float priority = 1;
    const uint32_t family = (uint32_t)gpu_vulkan_family(v->vk, v->physical);
    const VkDeviceQueueCreateInfo queue = { .sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                            .queueFamilyIndex = family,
                                            .queueCount = 1,
                                            .pQueuePriorities = &priority };
    struct gpu_vulkan_features enabled;
    VkDeviceCreateInfo info = { .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                .queueCreateInfoCount = 1,
                                .pQueueCreateInfos = &queue };
    const VkCommandPoolCreateInfo pool = { .sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                           .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
                                           .queueFamilyIndex = family };
    VkCommandBufferAllocateInfo buffer = { .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                           .commandBufferCount = GPU_VULKAN_BATCHES };
    VkCommandBuffer command[GPU_VULKAN_BATCHES];
    int err;

    gpu_vulkan_features_init(&enabled, v->gpu.info.abilities);
    info.pNext = enabled.chain;
    info.enabledExtensionCount = enabled.extensions;
    info.ppEnabledExtensionNames = enabled.extension;
    err = gpu_vulkan_error(v->vk->vkCreateDevice(v->physical, &info, NULL, &v->device));
    if (err)
        return err;
    v->vk->vkGetDeviceQueue(v->device, family, 0, &v->queue);
    err = gpu_vulkan_error(v->vk->vkCreateCommandPool(v->device, &pool, NULL, &v->commands));
    buffer.commandPool = v->commands;
    err = err ? err : gpu_vulkan_error(v->vk->vkAllocateCommandBuffers(v->device, &buffer, command));
    for (int i = 0; i < GPU_VULKAN_BATCHES && !err; i++)
        v->batch[i].command = command[i];
    return err;
}

/* One layout for all shaders: bindings that one has not are not written. */
static int open_layout(struct gpu_vulkan_device *v)
{
    VkDescriptorSetLayoutBinding binding[SST_GPU_BUFFERS] = { 0 };
    const VkPushConstantRange push = { VK_SHADER_STAGE_COMPUTE_BIT, 0, SST_GPU_PUSH };
    const VkDescriptorSetLayoutCreateInfo set = { .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
                                                  .bindingCount = SST_GPU_BUFFERS,
                                                  .pBindings = binding };
    const VkPipelineLayoutCreateInfo layout = { .sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                                .setLayoutCount = 1,
                                                .pSetLayouts = &v->set,
                                                .pushConstantRangeCount = 1,
                                                .pPushConstantRanges = &push };
    VkResult rc;

    for (uint32_t i = 0; i < SST_GPU_BUFFERS; i++)
        binding[i] = (VkDescriptorSetLayoutBinding){ .binding = i,
                                                     .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                                                     .descriptorCount = 1,
                                                     .stageFlags = VK_SHADER_STAGE_COMPUTE_BIT };
    rc = v->vk->vkCreateDescriptorSetLayout(v->device, &set, NULL, &v->set);
    if (!rc)
        rc = v->vk->vkCreatePipelineLayout(v->device, &layout, NULL, &v->layout);
    return gpu_vulkan_error(rc);
}

static int open_rest(struct gpu_vulkan_device *v)
{
    const VkFenceCreateInfo fence = { .sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO };
    const VkDescriptorPoolSize size = { VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, GPU_VULKAN_SETS * SST_GPU_BUFFERS };
    const VkDescriptorPoolCreateInfo pool = { .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
                                              .maxSets = GPU_VULKAN_SETS,
                                              .poolSizeCount = 1,
                                              .pPoolSizes = &size };
    int err = open_layout(v);

    for (int i = 0; i < GPU_VULKAN_BATCHES && !err; i++) {
        err = gpu_vulkan_error(v->vk->vkCreateFence(v->device, &fence, NULL, &v->batch[i].fence));
        if (!err)
            err = gpu_vulkan_error(v->vk->vkCreateDescriptorPool(v->device, &pool, NULL, &v->batch[i].descriptors));
    }
    err = err ? err : open_staging(v);
    err = err ? err : gpu_vulkan_open_times(v);
    return err ? err : gpu_vulkan_open_cache(v);
}

int gpu_vulkan_open(struct sst_gpu **out, int index)
{
    struct sst_gpu_info info[SST_GPU_DEVICES];
    struct gpu_vulkan_device *v = calloc(1, sizeof(*v));
    int err;

    if (!v) {
        sst_log_error("not enough memory for a device");
        return -ENOMEM;
    }
    gpu_vulkan_list(info);
    v->gpu.ops = &ops;
    v->gpu.info = info[index];
    v->vk = gpu_vulkan_load();
    v->physical = v->vk->device[index];
    v->vk->vkGetPhysicalDeviceMemoryProperties(v->physical, &v->memory);
    err = open_queue(v);
    err = err ? err : open_rest(v);
    if (err) {
        sst_log_error("%s cannot be opened: %s", info[index].name, sst_gpu_error(err));
        v->gpu.lost = err;
        close_device(&v->gpu);
        return err == -ENOMEM ? err : -EIO;
    }
    *out = &v->gpu;
    return 0;
}
