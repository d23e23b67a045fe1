#!/usr/bin/env bash
# Mesa 22.3.6 (lavapipe on llvmpipe): all loops of an invocation of a shader, one after the other and nested ones together, make 65,535
# passes in sum. Then each loop that runs or begins is left, without an error or a message; results are what was summed by then.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack mesa-vulkan-drivers=22.3.6-1+deb12u2 libvulkan1=1.3.239.0-1 libvulkan-dev=1.3.239.0-1 glslang-tools
cat >loops.comp <<'G'
#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer B { uint n, m, a, b; };
void main()
{
    uint x = 0, y = 0;
    for (uint i = 0; i < n; i++)
        x += 1 + (x & b); /* b is 0: no closed form for the compiler */
    for (uint i = 0; i < m; i++)
        y += 1 + (y & b);
    a = x;
    b = y;
}
G
cat >loops.c <<'C'
/* How many passes of two loops a compute shader makes: loops N M. Needs libvulkan-dev, glslang-tools,
 * mesa-vulkan-drivers. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <vulkan/vulkan.h>
#define CHECK(x)                                                                                                       \
    do {                                                                                                               \
        VkResult r_ = (x);                                                                                             \
        if (r_) {                                                                                                      \
            printf("%s: %d\n", #x, r_);                                                                                \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)
int main(int argc, char **argv)
{
    static uint32_t code[1 << 14];
    FILE *f = fopen("loops.spv", "rb");
    size_t bytes = f ? fread(code, 1, sizeof(code), f) : 0;
    uint32_t one = 1, *p;
    float priority = 1;
    if (argc < 3 || !bytes)
        return 1;
    VkApplicationInfo app = { VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_2 };
    VkInstanceCreateInfo ici = { VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &app };
    VkInstance instance;
    CHECK(vkCreateInstance(&ici, NULL, &instance));
    VkPhysicalDevice gpu;
    vkEnumeratePhysicalDevices(instance, &one, &gpu);
    VkPhysicalDeviceDriverProperties driver = { VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES };
    VkPhysicalDeviceProperties2 props = { VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &driver };
    vkGetPhysicalDeviceProperties2(gpu, &props);
    VkDeviceQueueCreateInfo qci = { VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, .queueCount = 1,
                                    .pQueuePriorities = &priority };
    VkDeviceCreateInfo dci = { VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, .queueCreateInfoCount = 1,
                               .pQueueCreateInfos = &qci };
    VkDevice d;
    CHECK(vkCreateDevice(gpu, &dci, NULL, &d));
    VkQueue queue;
    vkGetDeviceQueue(d, 0, 0, &queue);
    VkBufferCreateInfo bci = { VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = 16,
                               .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT };
    VkBuffer buffer;
    CHECK(vkCreateBuffer(d, &bci, NULL, &buffer));
    VkMemoryAllocateInfo mai = { VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, .allocationSize = 4096 };
    VkDeviceMemory memory;
    CHECK(vkAllocateMemory(d, &mai, NULL, &memory));
    CHECK(vkBindBufferMemory(d, buffer, memory, 0));
    CHECK(vkMapMemory(d, memory, 0, VK_WHOLE_SIZE, 0, (void **)&p));
    p[0] = (uint32_t)atol(argv[1]), p[1] = (uint32_t)atol(argv[2]), p[2] = p[3] = 0;
    VkShaderModuleCreateInfo sci = { VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, .codeSize = bytes, .pCode = code };
    VkShaderModule module;
    CHECK(vkCreateShaderModule(d, &sci, NULL, &module));
    VkDescriptorSetLayoutBinding binding = { 0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                                             NULL };
    VkDescriptorSetLayoutCreateInfo lci = { VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, .bindingCount = 1,
                                            .pBindings = &binding };
    VkDescriptorSetLayout layout;
    CHECK(vkCreateDescriptorSetLayout(d, &lci, NULL, &layout));
    VkPipelineLayoutCreateInfo pli = { VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, .setLayoutCount = 1,
                                       .pSetLayouts = &layout };
    VkPipelineLayout pl;
    CHECK(vkCreatePipelineLayout(d, &pli, NULL, &pl));
    VkComputePipelineCreateInfo pci = { VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO, .layout = pl,
                                        .stage = { VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                                                   .stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module,
                                                   .pName = "main" } };
    VkPipeline pipeline;
    CHECK(vkCreateComputePipelines(d, NULL, 1, &pci, NULL, &pipeline));
    VkDescriptorPoolSize size = { VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1 };
    VkDescriptorPoolCreateInfo dpi = { VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, .maxSets = 1, .poolSizeCount = 1,
                                       .pPoolSizes = &size };
    VkDescriptorPool pool;
    CHECK(vkCreateDescriptorPool(d, &dpi, NULL, &pool));
    VkDescriptorSetAllocateInfo dsi = { VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, .descriptorPool = pool,
                                        .descriptorSetCount = 1, .pSetLayouts = &layout };
    VkDescriptorSet set;
    CHECK(vkAllocateDescriptorSets(d, &dsi, &set));
    VkDescriptorBufferInfo info = { buffer, 0, VK_WHOLE_SIZE };
    VkWriteDescriptorSet write = { VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, .dstSet = set, .descriptorCount = 1,
                                   .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, .pBufferInfo = &info };
    vkUpdateDescriptorSets(d, 1, &write, 0, NULL);
    VkCommandPoolCreateInfo cpi = { VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO };
    VkCommandPool cpool;
    CHECK(vkCreateCommandPool(d, &cpi, NULL, &cpool));
    VkCommandBufferAllocateInfo cbi = { VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, .commandPool = cpool,
                                        .commandBufferCount = 1 };
    VkCommandBuffer c;
    CHECK(vkAllocateCommandBuffers(d, &cbi, &c));
    VkCommandBufferBeginInfo begin = { VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO };
    CHECK(vkBeginCommandBuffer(c, &begin));
    vkCmdBindPipeline(c, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(c, VK_PIPELINE_BIND_POINT_COMPUTE, pl, 0, 1, &set, 0, NULL);
    vkCmdDispatch(c, 1, 1, 1);
    CHECK(vkEndCommandBuffer(c));
    VkSubmitInfo submit = { VK_STRUCTURE_TYPE_SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &c };
    CHECK(vkQueueSubmit(queue, 1, &submit, NULL));
    CHECK(vkQueueWaitIdle(queue));
    printf("%s: wanted %s and %s passes, made %u and %u\n", driver.driverInfo, argv[1], argv[2], p[2], p[3]);
    return 0;
}
C
glslangValidator -V --quiet --target-env vulkan1.2 loops.comp -o loops.spv
compile loops -lvulkan
printf '{ "file_format_version": "1.0.0", "ICD": { "api_version": "1.1.230", "library_path": "%s/libvulkan_lvp.so" } }' "$lib" >icd.json
export VK_ICD_FILENAMES=$tmp/icd.json VK_DRIVER_FILES=$tmp/icd.json
for n in "40000 20000" "40000 40000" "70000 10" "1000000 5"; do ./loops $n; done | tee seen
sed 's/.*: //' seen >made
printf '%s\n' 'wanted 40000 and 20000 passes, made 40000 and 20000' 'wanted 40000 and 40000 passes, made 40000 and 25534' \
  'wanted 70000 and 10 passes, made 65535 and 1' 'wanted 1000000 and 5 passes, made 65535 and 1' >expected
holds "the loops of an invocation end after 65,535 passes in sum" cmp -s made expected
# Seen: these four lines, of "Mesa 22.3.6 (LLVM 15.0.6)"
