/* Loads Vulkan's loader and its drivers, and describes their devices.
 *
 * The library is opened when the first device is asked for: a start of the program without one does not pay for it, and
 * needs none. Library and instance stay to the end of the process: drivers that are unloaded and loaded again leak. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/gpu_internal.h"

#if !WITH_VULKAN

#include <errno.h>

#include "base/log.h"

int gpu_vulkan_list(struct sst_gpu_info info[SST_GPU_DEVICES] SST_UNUSED)
{
    return 0;
}

int gpu_vulkan_open(struct sst_gpu **out SST_UNUSED, int index)
{
    sst_log_error("device %d: this build has no Vulkan", index);
    return -EIO;
}
#else
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

#define LIBRARY "libvulkan.so.1"
#define LAYER   "VK_LAYER_KHRONOS_validation"

static struct gpu_vulkan vk; /* fixed after load() */
static bool loaded;
static pthread_once_t once = PTHREAD_ONCE_INIT;

/* What a validation layer finds is a fault of this program: every wait fails from then on. */
static VKAPI_ATTR VkBool32 VKAPI_CALL note_fault(VkDebugUtilsMessageSeverityFlagBitsEXT severity SST_UNUSED,
                                                 VkDebugUtilsMessageTypeFlagsEXT types SST_UNUSED,
                                                 const VkDebugUtilsMessengerCallbackDataEXT *data, void *arg SST_UNUSED)
{
    sst_log_error("Vulkan validation: %.800s", data->pMessage);
    vk.faults++;
    return VK_FALSE;
}

/* SST_GPU_VALIDATE=1 asks for the validation layers; without them it is an error. */
static bool wants_validation(void)
{
    const char *asked = getenv("SST_GPU_VALIDATE");

    return asked && !strcmp(asked, "1");
}

static VkInstance create_instance(PFN_vkGetInstanceProcAddr get)
{
    PFN_vkCreateInstance create;
    static const char *const layers[] = { LAYER }, *const extensions[] = { VK_EXT_DEBUG_UTILS_EXTENSION_NAME };
    const bool validate = wants_validation();
    const VkApplicationInfo app = { .sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                    .pApplicationName = "sst",
                                    .apiVersion = VK_API_VERSION_1_2 };
    const VkDebugUtilsMessengerCreateInfoEXT debug = {
        .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
        .messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
        .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
        .pfnUserCallback = note_fault,
    };
    const VkInstanceCreateInfo info = { .sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                        .pApplicationInfo = &app,
                                        .enabledLayerCount = validate,
                                        .ppEnabledLayerNames = layers,
                                        .enabledExtensionCount = validate,
                                        .ppEnabledExtensionNames = extensions };
    VkInstance instance;
    VkResult rc;

    create = (PFN_vkCreateInstance)get(NULL, "vkCreateInstance");
    rc = create ? create(&info, NULL, &instance) : VK_ERROR_INITIALIZATION_FAILED;
    if (rc == VK_ERROR_LAYER_NOT_PRESENT)
        sst_log_error("SST_GPU_VALIDATE=1: Vulkan's validation layers are missing; install vulkan-validationlayers");
    if (rc)
        return NULL; /* no driver */
    if (validate) {
        PFN_vkCreateDebugUtilsMessengerEXT messenger;
        VkDebugUtilsMessengerEXT made;

        messenger = (PFN_vkCreateDebugUtilsMessengerEXT)get(instance, "vkCreateDebugUtilsMessengerEXT");
        if (!messenger || messenger(instance, &debug, NULL, &made))
            sst_log_error("SST_GPU_VALIDATE=1: the validation layers cannot report");
    }
    return instance;
}

static void describe(struct sst_gpu_info *info, VkPhysicalDevice device)
{
    static const enum sst_gpu_kind kinds[] = {
        [VK_PHYSICAL_DEVICE_TYPE_OTHER] = SST_GPU_OTHER,
        [VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU] = SST_GPU_INTEGRATED,
        [VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU] = SST_GPU_DISCRETE,
        [VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU] = SST_GPU_VIRTUAL,
        [VK_PHYSICAL_DEVICE_TYPE_CPU] = SST_GPU_SOFTWARE,
    };
    VkPhysicalDeviceMaintenance3Properties maintenance = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES
    };
    VkPhysicalDeviceDriverProperties driver = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES,
                                                .pNext = &maintenance };
    VkPhysicalDeviceProperties2 all = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &driver };
    VkPhysicalDeviceMemoryProperties memory;

    vk.vkGetPhysicalDeviceProperties2(device, &all);
    vk.vkGetPhysicalDeviceMemoryProperties(device, &memory);
    memset(info, 0, sizeof(*info));
    snprintf(info->name, sizeof(info->name), "%s", all.properties.deviceName);
    /* Mesa calls the device `llvmpipe`, and nobody else does. */
    snprintf(info->driver, sizeof(info->driver), "%.100s %.100s",
             driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE ? "lavapipe" : driver.driverName, driver.driverInfo);
    info->kind =
        (size_t)all.properties.deviceType < ARRAY_LEN(kinds) ? kinds[all.properties.deviceType] : SST_GPU_OTHER;
    info->buffer_bytes = all.properties.limits.maxStorageBufferRange;
    if (maintenance.maxMemoryAllocationSize && maintenance.maxMemoryAllocationSize < info->buffer_bytes)
        info->buffer_bytes = maintenance.maxMemoryAllocationSize;
    for (uint32_t i = 0; i < memory.memoryHeapCount; i++) {
        if (memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT &&
            memory.memoryHeaps[i].size > info->memory_bytes)
            info->memory_bytes = memory.memoryHeaps[i].size;
    }
    gpu_vulkan_look(&vk, device, info);
}

/* True if the device runs version 1.2, computes, and binds enough buffers. */
static bool suits(VkPhysicalDevice device)
{
    VkPhysicalDeviceProperties2 all = { .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2 };

    vk.vkGetPhysicalDeviceProperties2(device, &all);
    return all.properties.apiVersion >= VK_API_VERSION_1_2 && gpu_vulkan_family(&vk, device) >= 0 &&
           all.properties.limits.maxPerStageDescriptorStorageBuffers >= SST_GPU_BUFFERS;
}

static void find_devices(VkInstance instance)
{
    VkPhysicalDevice found[SST_GPU_DEVICES];
    uint32_t n = SST_GPU_DEVICES;
    const VkResult rc = vk.vkEnumeratePhysicalDevices(instance, &n, found);

    for (uint32_t i = 0; (!rc || rc == VK_INCOMPLETE) && i < n; i++) {
        if (suits(found[i]))
            vk.device[vk.devices++] = found[i];
    }
}

static void load(void)
{
    void *library = dlopen(LIBRARY, RTLD_NOW | RTLD_LOCAL);
    PFN_vkGetInstanceProcAddr get;
    VkInstance instance;

    if (!library)
        return;
    *(void **)&get = dlsym(library, "vkGetInstanceProcAddr");
    instance = get ? create_instance(get) : NULL;
    if (!instance)
        return;
    loaded = true;
#define X(name)                                                                                                        \
    vk.name = (PFN_##name)get(instance, #name);                                                                        \
    loaded = loaded && vk.name;
    GPU_VULKAN_FUNCTIONS(X)
#undef X
    vk.matrix_properties = (PFN_vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR)get(
        instance, "vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR");
    if (loaded)
        find_devices(instance);
    else
        sst_log_warning("%s is older than Vulkan 1.2: functions are missing", LIBRARY);
}

struct gpu_vulkan *gpu_vulkan_load(void)
{
    pthread_once(&once, load);
    return loaded ? &vk : NULL;
}

int gpu_vulkan_family(const struct gpu_vulkan *v, VkPhysicalDevice device)
{
    VkQueueFamilyProperties family[16];
    uint32_t n = ARRAY_LEN(family);

    v->vkGetPhysicalDeviceQueueFamilyProperties(device, &n, family);
    for (uint32_t i = 0; i < n; i++) {
        if (family[i].queueFlags & VK_QUEUE_COMPUTE_BIT)
            return (int)i;
    }
    return -1;
}

int gpu_vulkan_list(struct sst_gpu_info info[SST_GPU_DEVICES])
{
    const struct gpu_vulkan *v = gpu_vulkan_load();

    for (int i = 0; v && i < v->devices; i++)
        describe(&info[i], v->device[i]);
    return v ? v->devices : 0;
}
#endif
