/* What Vulkan devices can do beyond version 1.2: looked up when they are listed, enabled when they are opened. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/gpu_internal.h"

#include <stdlib.h>
#include <string.h>

#define EXTENSIONS 512 /* of a device that are looked at */
#define SHAPES     64  /* of products of matrices, likewise */

/* --- queries ------------------------------------------------------------------------------------------------------ */

struct extensions {
    VkExtensionProperties *list;
    uint32_t n;
};

static bool has(const struct extensions *e, const char *name)
{
    uint32_t i = 0;

    while (i < e->n && strcmp(e->list[i].extensionName, name))
        i++;
    return i < e->n;
}

/* Put a structure in front of a chain; every one begins with its type and the next one. */
static void chain(void **first, void *structure)
{
    VkBaseOutStructure *s = structure;

    s->pNext = *first;
    *first = s;
}

static void look_for_dot(const struct gpu_vulkan *vk, VkPhysicalDevice device, const struct extensions *e,
                         struct sst_gpu_info *info)
{
    VkPhysicalDeviceShaderIntegerDotProductFeaturesKHR dot = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_INTEGER_DOT_PRODUCT_FEATURES_KHR
    };
    VkPhysicalDeviceShaderIntegerDotProductPropertiesKHR fast = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_INTEGER_DOT_PRODUCT_PROPERTIES_KHR
    };
    VkPhysicalDeviceFeatures2 features = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &dot };
    VkPhysicalDeviceProperties2 properties = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
                                               .pNext = &fast };

    if (!has(e, VK_KHR_SHADER_INTEGER_DOT_PRODUCT_EXTENSION_NAME))
        return;
    vk->vkGetPhysicalDeviceFeatures2(device, &features);
    vk->vkGetPhysicalDeviceProperties2(device, &properties);
    if (!dot.shaderIntegerDotProduct)
        return;
    info->abilities |= SST_GPU_DOT;
    if (fast.integerDotProduct4x8BitPackedSignedAccelerated || info->kind == SST_GPU_SOFTWARE) /* as measured there */
        info->abilities |= SST_GPU_DOT_FAST;
}

/* True for products of signed bytes with sums of 32 bits. */
static bool is_of_bytes(const VkCooperativeMatrixPropertiesKHR *p)
{
    return p->AType == VK_COMPONENT_TYPE_SINT8_KHR && p->BType == VK_COMPONENT_TYPE_SINT8_KHR &&
           p->CType == VK_COMPONENT_TYPE_SINT32_KHR && p->ResultType == VK_COMPONENT_TYPE_SINT32_KHR &&
           !p->saturatingAccumulation && p->scope == VK_SCOPE_SUBGROUP_KHR;
}

/* The largest shape that net_conv8_matrix can use. @param m  out; its group is given */
static bool find_shape(const struct gpu_vulkan *vk, VkPhysicalDevice device, const VkPhysicalDeviceLimits *limits,
                       struct sst_gpu_matrix *m)
{
    VkCooperativeMatrixPropertiesKHR *p = calloc(SHAPES, sizeof(*p));
    uint32_t n = SHAPES, largest = 0;
    VkResult rc;

    for (uint32_t i = 0; p && i < SHAPES; i++)
        p[i].sType = VK_STRUCTURE_TYPE_COOPERATIVE_MATRIX_PROPERTIES_KHR;
    rc = p ? vk->matrix_properties(device, &n, p) : VK_ERROR_OUT_OF_HOST_MEMORY;
    for (uint32_t i = 0; (!rc || rc == VK_INCOMPLETE) && i < n; i++) {
        const struct sst_gpu_matrix shape = { p[i].MSize, p[i].NSize, p[i].KSize, m->group };
        const uint32_t lanes = gpu_matrix_invocations(&shape);

        if (is_of_bytes(&p[i]) && lanes && lanes <= limits->maxComputeWorkGroupInvocations &&
            lanes <= limits->maxComputeWorkGroupSize[0] && shape.rows * shape.columns * shape.depth > largest) {
            largest = shape.rows * shape.columns * shape.depth;
            *m = shape;
        }
    }
    free(p);
    return largest;
}

static void look_for_matrices(const struct gpu_vulkan *vk, VkPhysicalDevice device, const struct extensions *e,
                              struct sst_gpu_info *info)
{
    struct gpu_vulkan_features f = { 0 };
    VkPhysicalDeviceFeatures2 features = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2 };
    VkPhysicalDeviceSubgroupProperties group = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES };
    VkPhysicalDeviceSubgroupSizeControlPropertiesEXT sizes = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_PROPERTIES_EXT, .pNext = &group
    };
    VkPhysicalDeviceProperties2 all = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &sizes };
    struct sst_gpu_matrix m = { 0 };

    if (!vk->matrix_properties || !has(e, VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME) ||
        !has(e, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME))
        return;
    gpu_vulkan_features_init(&f, SST_GPU_MATRIX);
    features.pNext = f.chain;
    vk->vkGetPhysicalDeviceFeatures2(device, &features);
    vk->vkGetPhysicalDeviceProperties2(device, &all);
    if (!f.matrix.cooperativeMatrix || !f.core.shaderInt8 || !f.core.vulkanMemoryModel ||
        !f.sizes.subgroupSizeControl || !f.sizes.computeFullSubgroups ||
        !(sizes.requiredSubgroupSizeStages & VK_SHADER_STAGE_COMPUTE_BIT))
        return;
    m.group = group.subgroupSize;
    if (!find_shape(vk, device, &all.properties.limits, &m) ||
        gpu_matrix_invocations(&m) / m.group > sizes.maxComputeWorkgroupSubgroups)
        return;
    info->abilities |= info->kind == SST_GPU_SOFTWARE ? SST_GPU_MATRIX : SST_GPU_MATRIX | SST_GPU_MATRIX_FAST;
    info->matrix = m;
}

static void look_for_subgroups(const struct gpu_vulkan *vk, VkPhysicalDevice device, struct sst_gpu_info *info)
{
    const VkSubgroupFeatureFlags needs = VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_ARITHMETIC_BIT |
                                         VK_SUBGROUP_FEATURE_VOTE_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_BIT |
                                         VK_SUBGROUP_FEATURE_CLUSTERED_BIT;
    VkPhysicalDeviceSubgroupProperties group = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES };
    VkPhysicalDeviceProperties2 all = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &group };

    vk->vkGetPhysicalDeviceProperties2(device, &all);
    if (group.subgroupSize >= 32 && (group.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT) &&
        (group.supportedOperations & needs) == needs)
        info->abilities |= SST_GPU_SUBGROUP;
}

void gpu_vulkan_look(const struct gpu_vulkan *vk, VkPhysicalDevice device, struct sst_gpu_info *info)
{
    struct extensions e = { calloc(EXTENSIONS, sizeof(*e.list)), EXTENSIONS };
    VkResult rc = VK_ERROR_OUT_OF_HOST_MEMORY;

    look_for_subgroups(vk, device, info);
    if (e.list)
        rc = vk->vkEnumerateDeviceExtensionProperties(device, NULL, &e.n, e.list);
    if (!rc || rc == VK_INCOMPLETE) {
        look_for_dot(vk, device, &e, info);
        look_for_matrices(vk, device, &e, info);
    }
    free(e.list);
}

/* --- enabling ----------------------------------------------------------------------------------------------------- */

static void add_extension(struct gpu_vulkan_features *f, const char *name)
{
    f->extension[f->extensions++] = name;
}

void gpu_vulkan_features_init(struct gpu_vulkan_features *f, uint32_t abilities)
{
    memset(f, 0, sizeof(*f));
    f->dot.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_INTEGER_DOT_PRODUCT_FEATURES_KHR;
    f->dot.shaderIntegerDotProduct = VK_TRUE;
    f->matrix.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_KHR;
    f->matrix.cooperativeMatrix = VK_TRUE;
    f->core.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    f->core.shaderInt8 = f->core.vulkanMemoryModel = VK_TRUE;
    f->sizes.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES_EXT;
    f->sizes.subgroupSizeControl = f->sizes.computeFullSubgroups = VK_TRUE;
    if (abilities & SST_GPU_DOT) {
        add_extension(f, VK_KHR_SHADER_INTEGER_DOT_PRODUCT_EXTENSION_NAME);
        chain(&f->chain, &f->dot);
    }
    if (abilities & SST_GPU_MATRIX) {
        add_extension(f, VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME);
        add_extension(f, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME);
        chain(&f->chain, &f->matrix);
        chain(&f->chain, &f->core);
        chain(&f->chain, &f->sizes);
    }
}
