/* pipeline/gpu/gpu_internal.h - back ends, the table of shaders, the cache of pipelines and verdicts. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_GPU_INTERNAL_H
#define SST_PIPELINE_GPU_GPU_INTERNAL_H

#include "pipeline/gpu/gpu.h"

/* --- shaders.c: what is known of each shader ---------------------------------------------------------------------- */

struct gpu_shader {
    const char *name;
    /* Of variants: */
    uint32_t needs;         /* enum sst_gpu_ability; 0: no variant */
    uint32_t fast;          /* likewise: with it the variant is chosen by itself */
    enum sst_gpu_shader of; /* what it is a variant of */
    const char *variant;    /* in SST_GPU_VARIANT */
};

extern const struct gpu_shader gpu_shaders[SST_GPU_SHADERS];

/** SPIR-V of the build (scripts/embed.sh), ends with a name of NULL; empty in a build without Vulkan. */
struct gpu_spirv {
    const char *name; /* "blend.spv" */
    const uint8_t *begin, *end;
};
extern const struct gpu_spirv gpu_spirvs[];

/* --- the shader `limits`: the most that a device reaches, which the stages are measured against -------------------
 *
 * Without rounds it copies; with rounds each of 16 sums of an invocation is multiplied and increased once a round. */

/** The layout of pipeline/kernels/limits.comp (std430). */
struct gpu_limits {
    uint32_t count, rounds;
};

#define GPU_LIMITS_GROUP    256
#define GPU_LIMITS_PRODUCTS 16 /* of one round and four floats */

/* --- back ends ---------------------------------------------------------------------------------------------------- */

struct sst_gpu_buffer {
    size_t bytes;
};

struct sst_gpu_span {
    void *data;
    size_t bytes;
};

struct gpu_ops {
    int (*create)(struct sst_gpu *g, struct sst_gpu_buffer **out, size_t bytes);
    void (*destroy)(struct sst_gpu *g, struct sst_gpu_buffer *b);
    int (*compile)(struct sst_gpu *g, enum sst_gpu_shader shader);
    int (*upload)(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const void *data, size_t bytes);
    int (*download)(struct sst_gpu *g, void *data, struct sst_gpu_buffer *b, size_t offset, size_t bytes);
    int (*dispatch)(struct sst_gpu *g, const struct sst_gpu_work *work);
    int (*wait)(struct sst_gpu *g);
    void (*close)(struct sst_gpu *g);
    int (*span_create)(struct sst_gpu *g, struct sst_gpu_span **out, size_t bytes);
    void (*span_destroy)(struct sst_gpu *g, struct sst_gpu_span *s);
    int (*upload_span)(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const struct sst_gpu_span *s,
                       size_t from, size_t bytes);
    int (*copy)(struct sst_gpu *g, struct sst_gpu_buffer *to, size_t to_offset, struct sst_gpu_buffer *from,
                size_t from_offset, size_t bytes);
    int (*fill)(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, size_t bytes, uint32_t word);
};

/** Names of comparisons, "\nname\nname\n" or NULL. */
struct gpu_verdicts {
    uint64_t key; /* 0: nothing is kept */
    char *passed, *failed;
    bool changed;
};

enum gpu_ready { GPU_UNCOMPILED = 0, GPU_READY = 1, GPU_REFUSED = 2 };

/** What a back end embeds first. */
struct sst_gpu {
    const struct gpu_ops *ops; /* fixed after open */
    struct sst_gpu_info info;
    struct sst_gpu_config cfg; /* with the defaults filled in */
    uint64_t used_bytes;       /* of buffers */
    int lost;                  /* 0, or the error that every call returns from now on */
    enum gpu_ready ready[SST_GPU_SHADERS];
    uint64_t cache_key; /* driver, device and shaders: files of others are not read; 0: nothing is kept */
    struct gpu_verdicts verdicts;
};

/** @param faults  "" or "lost=3,memory=64" */
SST_MUST_CHECK int gpu_dummy_open(struct sst_gpu **out, const char *faults);

/** True for a dummy device that has passed all comparisons (known=1). */
bool gpu_dummy_is_known(const struct sst_gpu *g);

/** As sst_gpu_list(), in the driver's order. 0 in a build without Vulkan. */
int gpu_vulkan_list(struct sst_gpu_info info[SST_GPU_DEVICES]);

/** Open device `index` of gpu_vulkan_list(). @return 0, -EIO, -ENOMEM; logged */
SST_MUST_CHECK int gpu_vulkan_open(struct sst_gpu **out, int index);

#if WITH_VULKAN
#include <errno.h>

#define VK_NO_PROTOTYPES
#include <vulkan/vulkan_core.h>

#include "pipeline/gpu/vulkan_matrix.h"

/** Functions of the loader, instance and devices that the back end calls: X(name). */
#define GPU_VULKAN_FUNCTIONS(X)                                                                                        \
    X(vkEnumeratePhysicalDevices)                                                                                      \
    X(vkEnumerateDeviceExtensionProperties)                                                                            \
    X(vkGetPhysicalDeviceFeatures2)                                                                                    \
    X(vkGetPhysicalDeviceProperties2)                                                                                  \
    X(vkGetPhysicalDeviceMemoryProperties)                                                                             \
    X(vkGetPhysicalDeviceQueueFamilyProperties)                                                                        \
    X(vkCreateDevice)                                                                                                  \
    X(vkDestroyDevice)                                                                                                 \
    X(vkGetDeviceQueue)                                                                                                \
    X(vkCreateBuffer)                                                                                                  \
    X(vkDestroyBuffer)                                                                                                 \
    X(vkGetBufferMemoryRequirements)                                                                                   \
    X(vkAllocateMemory)                                                                                                \
    X(vkFreeMemory)                                                                                                    \
    X(vkBindBufferMemory)                                                                                              \
    X(vkMapMemory)                                                                                                     \
    X(vkCreateCommandPool)                                                                                             \
    X(vkDestroyCommandPool)                                                                                            \
    X(vkAllocateCommandBuffers)                                                                                        \
    X(vkBeginCommandBuffer)                                                                                            \
    X(vkEndCommandBuffer)                                                                                              \
    X(vkCmdPipelineBarrier)                                                                                            \
    X(vkCmdFillBuffer)                                                                                                 \
    X(vkCmdCopyBuffer)                                                                                                 \
    X(vkCmdBindPipeline)                                                                                               \
    X(vkCmdBindDescriptorSets)                                                                                         \
    X(vkCmdPushConstants)                                                                                              \
    X(vkCmdDispatch)                                                                                                   \
    X(vkCreateQueryPool)                                                                                               \
    X(vkDestroyQueryPool)                                                                                              \
    X(vkCmdResetQueryPool)                                                                                             \
    X(vkCmdWriteTimestamp)                                                                                             \
    X(vkGetQueryPoolResults)                                                                                           \
    X(vkQueueSubmit)                                                                                                   \
    X(vkCreateFence)                                                                                                   \
    X(vkDestroyFence)                                                                                                  \
    X(vkWaitForFences)                                                                                                 \
    X(vkResetFences)                                                                                                   \
    X(vkCreateDescriptorPool)                                                                                          \
    X(vkDestroyDescriptorPool)                                                                                         \
    X(vkResetDescriptorPool)                                                                                           \
    X(vkAllocateDescriptorSets)                                                                                        \
    X(vkUpdateDescriptorSets)                                                                                          \
    X(vkCreateDescriptorSetLayout)                                                                                     \
    X(vkDestroyDescriptorSetLayout)                                                                                    \
    X(vkCreatePipelineLayout)                                                                                          \
    X(vkDestroyPipelineLayout)                                                                                         \
    X(vkCreateShaderModule)                                                                                            \
    X(vkDestroyShaderModule)                                                                                           \
    X(vkCreateComputePipelines)                                                                                        \
    X(vkDestroyPipeline)                                                                                               \
    X(vkCreatePipelineCache)                                                                                           \
    X(vkDestroyPipelineCache)                                                                                          \
    X(vkGetPipelineCacheData)

struct gpu_vulkan {
#define X(name) PFN_##name name;
    GPU_VULKAN_FUNCTIONS(X)
#undef X
    PFN_vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR matrix_properties; /* NULL: no driver has it */
    VkPhysicalDevice device[SST_GPU_DEVICES];                                /* that have what the shaders need */
    int devices;
    SST_ATOMIC(int) faults; /* that validation layers have reported */
};

/** The library and its devices, loaded on the first call and kept to the end. NULL: there is none. */
struct gpu_vulkan *gpu_vulkan_load(void);

/** Family of queues for computing. -1: none */
int gpu_vulkan_family(const struct gpu_vulkan *vk, VkPhysicalDevice device);

/** Fill in what a device can do beyond Vulkan 1.2: info->abilities, info->matrix. */
void gpu_vulkan_look(const struct gpu_vulkan *vk, VkPhysicalDevice device, struct sst_gpu_info *info);

/** What is enabled for abilities when a device is opened. Points into itself. */
struct gpu_vulkan_features {
    const char *extension[3];
    uint32_t extensions;
    void *chain; /* of those structures that follow and are needed */
    VkPhysicalDeviceShaderIntegerDotProductFeaturesKHR dot;
    VkPhysicalDeviceCooperativeMatrixFeaturesKHR matrix;
    VkPhysicalDeviceVulkan12Features core;
    VkPhysicalDeviceSubgroupSizeControlFeaturesEXT sizes;
};
void gpu_vulkan_features_init(struct gpu_vulkan_features *f, uint32_t abilities);

#define GPU_MATRIX_CONSTANTS 4 /* of net_conv8_matrix: invocations of a group, rows, columns, depth */

/** What net_conv8_matrix is compiled for: the shape, and subgroups that are full and of one size. Points into itself.
 */
struct gpu_matrix_stage {
    uint32_t value[GPU_MATRIX_CONSTANTS];
    VkSpecializationMapEntry entry[GPU_MATRIX_CONSTANTS];
    VkSpecializationInfo constants;
    VkPipelineShaderStageRequiredSubgroupSizeCreateInfoEXT size;
};

/** Add it to a stage; s must outlive info. */
void gpu_matrix_stage_init(struct gpu_matrix_stage *s, VkPipelineShaderStageCreateInfo *info,
                           const struct sst_gpu_matrix *m);

/** Invocations of a group of net_conv8_matrix: each of its subgroups has 2 x 4 matrices of sums. */
uint32_t gpu_matrix_invocations(const struct sst_gpu_matrix *m);

/**
 * Complete the types of matrices in the binary of net_conv8_matrix.
 *
 * glslang of Debian 12 has no such types, and writes parameters of a type as numbers. The shader gives those that stand
 * for other types and constants as numbers too: 8 or 32 for signed integers of that width, and the constant_id for rows
 * and columns. Here they become the ids that SPIR-V needs.
 * @param code  in and out [words]
 * @return 0, -EINVAL (no module, or it does not declare what a type needs before it)
 */
SST_MUST_CHECK int gpu_matrix_complete(uint32_t *code, size_t words);

struct gpu_vulkan_memory {
    VkBuffer buffer;
    VkDeviceMemory memory;
};

#define GPU_VULKAN_BATCHES 4  /* of commands: one is gathered while others run */
#define GPU_VULKAN_SETS    16 /* dispatches of a batch at most */

/** What shaders took; without a pool nothing is measured. */
struct gpu_vulkan_times {
    VkQueryPool pool;
    double ns_per_tick;
    enum sst_gpu_shader shader[GPU_VULKAN_BATCHES][GPU_VULKAN_SETS];
    double ms[SST_GPU_SHADERS], all_ms;
    uint32_t dispatches[SST_GPU_SHADERS], submits;
};

/** Commands that run together. */
struct gpu_vulkan_batch {
    VkCommandBuffer command;
    VkFence fence;
    VkDescriptorPool descriptors;
    size_t staged; /* bytes of its part of the staging memory that are used */
    int sets;      /* dispatches */
    bool recording, running;
};

/** A Vulkan device that is open. */
struct gpu_vulkan_device {
    struct sst_gpu gpu; /* first */
    struct gpu_vulkan *vk;
    VkPhysicalDevice physical;
    VkPhysicalDeviceMemoryProperties memory;
    VkDevice device;
    VkQueue queue;
    VkCommandPool commands;
    struct gpu_vulkan_batch batch[GPU_VULKAN_BATCHES];
    int now; /* the one that is gathered; the others are older, the next one the oldest */
    struct gpu_vulkan_memory staging;
    uint8_t *mapped;
    bool hung;                      /* a wait ended without an answer: memory may still be in use */
    struct gpu_vulkan_device *next; /* after close, of those that hung */
    VkPipelineCache cache;
    size_t cache_bytes; /* that were read */
    VkDescriptorSetLayout set; /* of all shaders */
    VkPipelineLayout layout;
    VkPipeline pipeline[SST_GPU_SHADERS];
    struct gpu_vulkan_times times;
};

static inline int gpu_vulkan_error(VkResult rc)
{
    switch (rc) {
    case VK_SUCCESS:
        return 0;
    case VK_ERROR_OUT_OF_HOST_MEMORY:
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
    case VK_ERROR_OUT_OF_POOL_MEMORY:
        return -ENOMEM;
    case VK_ERROR_DEVICE_LOST:
        return -ENODEV;
    case VK_TIMEOUT:
        return -ETIMEDOUT;
    default:
        return -EIO;
    }
}

/* With SST_GPU_TIMES=1 in the environment: queries of what shaders take, around batch `b` and around its last dispatch.
 * They cost about 2 us a dispatch. */
SST_MUST_CHECK int gpu_vulkan_open_times(struct gpu_vulkan_device *v);
void gpu_vulkan_time_batch(struct gpu_vulkan_device *v, int b, bool after);
void gpu_vulkan_time_dispatch(struct gpu_vulkan_device *v, int b, enum sst_gpu_shader shader, bool after);
/** Add up what a batch took, which is done. */
void gpu_vulkan_time_done(struct gpu_vulkan_device *v, int b);
/** Log it. */
void gpu_vulkan_close_times(struct gpu_vulkan_device *v);

/** Compile a shader, as struct gpu_ops has it. @return 0, -ENOMEM, -EIO, -ENODEV */
int gpu_vulkan_compile(struct sst_gpu *g, enum sst_gpu_shader number);

/** Make the cache of pipelines from what is stored for this driver, device and shaders. @return 0, -ENOMEM, -EIO */
SST_MUST_CHECK int gpu_vulkan_open_cache(struct gpu_vulkan_device *v);

/** Store what was compiled and is not stored yet, unless the device is lost. */
void gpu_vulkan_store_cache(struct gpu_vulkan_device *v);
#endif

/* --- cache.c: compiled pipelines and verdicts of tests on disk ----------------------------------------------------
 *
 * In $XDG_CACHE_HOME/sst, else /var/cache/sst where that can be written, else ~/.cache/sst. Without any of them nothing
 * is kept, and nothing is logged: it costs only time. */

#define GPU_CACHE_BYTES_MAX ((size_t)16 << 20) /* of a file; larger data is not stored */
#define GPU_CACHE_FILES     8                  /* the oldest ones beyond are removed */

/** FNV-1a; the first hash is GPU_HASH_START. */
#define GPU_HASH_START 14695981039346656037U
uint64_t gpu_hash(uint64_t hash, const void *data, size_t bytes);

/** Read a file. A damaged one is removed and logged as a warning.
 *  @param kind  first word of its name: "pipelines"
 *  @return malloc()ed data, or NULL: nothing */
void *gpu_cache_read(const char *kind, uint64_t key, size_t *bytes);
void gpu_cache_write(const char *kind, uint64_t key, const void *data, size_t bytes);

/* --- verdicts.c --------------------------------------------------------------------------------------------------- */

/** Read passes of earlier runs, unless all is to be tested again. The configuration is set. */
void gpu_verdicts_open(struct sst_gpu *g);

/** Store new passes, unless the device is lost; free. */
void gpu_verdicts_close(struct sst_gpu *g);

#endif
