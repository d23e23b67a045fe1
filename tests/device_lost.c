/* A Vulkan layer between the loader and a driver: devices get lost when a test says so, as a driver reports it.
 *
 * SST_DEVICE_LOST names a file that holds a number, and maybe the word `gone`. When the number grows, every device that
 * was created before is lost: its submissions and waits give VK_ERROR_DEVICE_LOST until it is destroyed. While the word
 * is there no device can be created, as while a driver resets its hardware. What the driver still computes is waited
 * for, so that the program may free what it used.
 *
 * Devices and their queues have the loader's table in common, whose address is at the start of either object. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan_core.h>

#define DEVICES 64

struct device {
    const void *table; /* NULL: free */
    VkDevice device;
    long number; /* in the file when it was created; later ones lose it */
    PFN_vkGetDeviceProcAddr get;
    PFN_vkDestroyDevice destroy;
    PFN_vkDeviceWaitIdle wait_idle;
    PFN_vkQueueSubmit submit;
    PFN_vkWaitForFences wait;
};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct device devices[DEVICES];          /* under lock */
static VkInstance instance;                     /* under lock; the program has one */
static PFN_vkGetInstanceProcAddr instance_next; /* under lock */

static const void *table_of(const void *object)
{
    return *(const void *const *)object;
}

/* @param gone  out, or NULL */
static long read_number(bool *gone)
{
    const char *path = getenv("SST_DEVICE_LOST");
    FILE *f = path ? fopen(path, "re") : NULL;
    char line[64] = "";
    long number = 0;

    if (f) {
        if (fgets(line, sizeof(line), f))
            number = strtol(line, NULL, 10);
        fclose(f);
    }
    if (gone)
        *gone = strstr(line, "gone") != NULL;
    return number;
}

/* A copy of the entry of an object's device. */
static struct device find_device(const void *object)
{
    struct device found = { 0 };

    pthread_mutex_lock(&lock);
    for (int i = 0; i < DEVICES; i++) {
        if (devices[i].table == table_of(object))
            found = devices[i];
    }
    pthread_mutex_unlock(&lock);
    return found;
}

static bool is_lost(const struct device *d)
{
    return read_number(NULL) > d->number;
}

static VkResult lose(const struct device *d)
{
    (void)d->wait_idle(d->device);
    return VK_ERROR_DEVICE_LOST;
}

/* --- calls of a device ----------------------------------------------------------------------------------------
 */

static VKAPI_ATTR VkResult VKAPI_CALL queue_submit(VkQueue queue, uint32_t n, const VkSubmitInfo *submits,
                                                   VkFence fence)
{
    const struct device d = find_device(queue);

    return is_lost(&d) ? lose(&d) : d.submit(queue, n, submits, fence);
}

static VKAPI_ATTR VkResult VKAPI_CALL wait_for_fences(VkDevice device, uint32_t n, const VkFence *fences, VkBool32 all,
                                                      uint64_t timeout_ns)
{
    const struct device d = find_device(device);
    const VkResult rc = d.wait(device, n, fences, all, timeout_ns);

    return is_lost(&d) ? lose(&d) : rc;
}

static VKAPI_ATTR void VKAPI_CALL destroy_device(VkDevice device, const VkAllocationCallbacks *memory)
{
    const struct device d = find_device(device);

    pthread_mutex_lock(&lock);
    for (int i = 0; i < DEVICES; i++) {
        if (devices[i].table == d.table)
            devices[i].table = NULL;
    }
    pthread_mutex_unlock(&lock);
    d.destroy(device, memory);
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_device_function(VkDevice device, const char *name)
{
    if (!strcmp(name, "vkGetDeviceProcAddr"))
        return (PFN_vkVoidFunction)get_device_function;
    if (!strcmp(name, "vkDestroyDevice"))
        return (PFN_vkVoidFunction)destroy_device;
    if (!strcmp(name, "vkQueueSubmit"))
        return (PFN_vkVoidFunction)queue_submit;
    if (!strcmp(name, "vkWaitForFences"))
        return (PFN_vkVoidFunction)wait_for_fences;
    return find_device(device).get(device, name);
}

/* --- devices and the instance --------------------------------------------------------------------------------------
 */

static bool keep(VkDevice device, PFN_vkGetDeviceProcAddr get, long number)
{
    const struct device d = { .table = table_of(device),
                              .device = device,
                              .number = number,
                              .get = get,
                              .destroy = (PFN_vkDestroyDevice)get(device, "vkDestroyDevice"),
                              .wait_idle = (PFN_vkDeviceWaitIdle)get(device, "vkDeviceWaitIdle"),
                              .submit = (PFN_vkQueueSubmit)get(device, "vkQueueSubmit"),
                              .wait = (PFN_vkWaitForFences)get(device, "vkWaitForFences") };
    bool kept = false;

    pthread_mutex_lock(&lock);
    for (int i = 0; i < DEVICES && !kept; i++) {
        kept = !devices[i].table;
        if (kept)
            devices[i] = d;
    }
    pthread_mutex_unlock(&lock);
    if (!kept)
        d.destroy(device, NULL);
    return kept;
}

static VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                                    const VkAllocationCallbacks *memory, VkDevice *out)
{
    VkLayerDeviceCreateInfo *chain = (VkLayerDeviceCreateInfo *)(uintptr_t)info->pNext;
    PFN_vkGetDeviceProcAddr get;
    PFN_vkCreateDevice create;
    VkResult rc;
    bool gone;
    const long number = read_number(&gone);

    while (chain &&
           (chain->sType != VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO || chain->function != VK_LAYER_LINK_INFO))
        chain = (VkLayerDeviceCreateInfo *)(uintptr_t)chain->pNext;
    if (!chain || gone)
        return VK_ERROR_INITIALIZATION_FAILED;
    get = chain->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    create = (PFN_vkCreateDevice)chain->u.pLayerInfo->pfnNextGetInstanceProcAddr(instance, "vkCreateDevice");
    chain->u.pLayerInfo = chain->u.pLayerInfo->pNext;
    rc = create ? create(physical, info, memory, out) : VK_ERROR_INITIALIZATION_FAILED;
    return rc || keep(*out, get, number) ? rc : VK_ERROR_TOO_MANY_OBJECTS;
}

static VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo *info,
                                                      const VkAllocationCallbacks *memory, VkInstance *out)
{
    VkLayerInstanceCreateInfo *chain = (VkLayerInstanceCreateInfo *)(uintptr_t)info->pNext;
    PFN_vkGetInstanceProcAddr next;
    PFN_vkCreateInstance create;
    VkResult rc;

    while (chain &&
           (chain->sType != VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO || chain->function != VK_LAYER_LINK_INFO))
        chain = (VkLayerInstanceCreateInfo *)(uintptr_t)chain->pNext;
    if (!chain)
        return VK_ERROR_INITIALIZATION_FAILED;
    next = chain->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    create = (PFN_vkCreateInstance)next(NULL, "vkCreateInstance");
    chain->u.pLayerInfo = chain->u.pLayerInfo->pNext;
    rc = create ? create(info, memory, out) : VK_ERROR_INITIALIZATION_FAILED;
    if (!rc) {
        pthread_mutex_lock(&lock);
        instance = *out;
        instance_next = next;
        pthread_mutex_unlock(&lock);
    }
    return rc;
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_instance_function(VkInstance of, const char *name)
{
    if (!strcmp(name, "vkGetInstanceProcAddr"))
        return (PFN_vkVoidFunction)get_instance_function;
    if (!strcmp(name, "vkCreateInstance"))
        return (PFN_vkVoidFunction)create_instance;
    if (!strcmp(name, "vkCreateDevice"))
        return (PFN_vkVoidFunction)create_device;
    return of && instance_next ? instance_next(of, name) : NULL;
}

VK_LAYER_EXPORT VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *version)
{
    version->loaderLayerInterfaceVersion = CURRENT_LOADER_LAYER_INTERFACE_VERSION;
    version->pfnGetInstanceProcAddr = get_instance_function;
    version->pfnGetDeviceProcAddr = get_device_function;
    version->pfnGetPhysicalDeviceProcAddr = NULL;
    return VK_SUCCESS;
}
