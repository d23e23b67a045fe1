/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>

#include "base/thread.h"
#include "cli/cli_internal.h"
#include "cli/doctor_internal.h"
#include "pipeline/gpu/gpu.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/live/live.h"
#include "pipeline/method/network/model_path.h"

static const struct {
    const char *name;
    int built;
} parts[] = {
    { "onednn", WITH_DNNL },        { "opencv", WITH_OPENCV },      { "libavformat", WITH_AVFORMAT },
    { "libudev", WITH_UDEV },       { "libusb", WITH_USB },         { "libmodbus", WITH_MODBUS },
    { "libgpiod", WITH_GPIOD > 0 }, { "libdogleg", WITH_DOGLEG },   { "libcurl", WITH_CURL },      { "push", WITH_PUSH },
    { "vulkan", WITH_VULKAN },      { "libdeflate", WITH_DEFLATE }, { "libgphoto2", WITH_GPHOTO2 }, { "aravis", WITH_ARAVIS },
    { "libraw", WITH_RAW },         { "isa-l", WITH_ISAL },         { "libtiff", WITH_TIFF },
};

static const char *const models[] = { "pspnet-small.onnx", "mccnn-fast.onnx" };

/* Further abilities of this device: variants of shaders by other instructions; if `fast`, the ones chosen there.
 */
static json_t *variants_json(const struct sst_gpu_info *info, bool fast)
{
    json_t *variants = json_array();

    for (int i = 0; i < SST_GPU_SHADERS; i++) {
        const enum sst_gpu_shader s = (enum sst_gpu_shader)i;

        if (sst_gpu_is_variant(s) && (fast ? sst_gpu_is_fast(info, s) : sst_gpu_can(info, s)))
            json_array_append_new(variants, json_string(sst_gpu_shader_name(s)));
    }
    return variants;
}

static json_t *matrix_json(const struct sst_gpu_info *info)
{
    const struct sst_gpu_matrix *m = &info->matrix;

    return info->abilities & SST_GPU_MATRIX ? json_pack("[i, i, i]", m->rows, m->columns, m->depth) : json_null();
}

static json_t *devices_json(const struct sst_gpu_info *info, int n)
{
    json_t *devices = json_array();

    for (int i = 0; i < n; i++)
        json_array_append_new(
            devices, json_pack("{s:o, s:o, s:s, s:I, s:o, s:o, s:o}", "name", cli_text_json(info[i].name), "driver",
                               cli_text_json(info[i].driver), "kind", sst_gpu_kind_name(info[i].kind), "memory_bytes",
                               (json_int_t)info[i].memory_bytes, "variants", variants_json(&info[i], false),
                               "variants_fast", variants_json(&info[i], true), "matrix", matrix_json(&info[i])));
    return devices;
}

/* Abilities of every device: the shaders of this build. */
static json_t *shaders_json(void)
{
    json_t *shaders = json_array();

    for (int i = 0; i < SST_GPU_SHADERS && WITH_VULKAN; i++) {
        if (!sst_gpu_is_variant((enum sst_gpu_shader)i))
            json_array_append_new(shaders, json_string(sst_gpu_shader_name((enum sst_gpu_shader)i)));
    }
    return shaders;
}

static void print_devices(const struct sst_gpu_info *info, int n)
{
    for (int i = 0; i < n; i++) {
        const struct sst_gpu_matrix *m = &info[i].matrix;

        printf("  %-18s %s, %s, %.1f GiB", "device", info[i].name, info[i].driver,
               (double)info[i].memory_bytes / (1 << 30));
        if (info[i].abilities & SST_GPU_DOT)
            printf(", dot products of bytes%s", info[i].abilities & SST_GPU_DOT_FAST ? "" : " (slow)");
        if (info[i].abilities & SST_GPU_MATRIX)
            printf(", matrices of bytes (%ux%ux%u%s)", m->rows, m->columns, m->depth,
                   info[i].abilities & SST_GPU_MATRIX_FAST ? "" : ", slow");
        if (info[i].abilities & SST_GPU_SUBGROUP)
            printf(", subgroups");
        printf("%s\n", info[i].kind == SST_GPU_SOFTWARE ? ", software: used only by name" : "");
    }
    if (!n)
        printf("  %-18s %s\n", "device", WITH_VULKAN ? "none" : "none: not built in");
}

static json_t *steps_json(const char *const *steps)
{
    json_t *list = json_array();

    for (int i = 0; steps[i] && list; i++)
        json_array_append_new(list, json_string(steps[i]));
    return list;
}

/* Work of the service on the device of its configuration, if it has one. */
static void print_live(void)
{
    char there[128], here[128];

    cli_steps_text(there, sizeof(there), sst_live_device_steps);
    cli_steps_text(here, sizeof(here), sst_live_cpu_steps);
    printf("  %-18s %s; on the CPU: %s\n", "live.device", there, here);
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    char path[SST_PATH_MAX];
    bool json = false;
    const struct cli_option options[] = {
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    const char *cpu = sst_cpu_level_name(sst_cpu_level());
    struct sst_gpu_info info[SST_GPU_DEVICES];
    int devices;

    if (r != CLI_GO_ON)
        return r;
    devices = sst_gpu_list(info);
    if (json) {
        json_t *optional = json_object();
        json_t *found = json_object();
        json_t *root = json_pack("{s:s, s:s, s:i, s:o, s:o}", "version", SST_VERSION, "cpu", cpu, "threads",
                                 sst_thread_count(0), "parts", optional, "models", found);

        for (size_t i = 0; i < ARRAY_LEN(parts); i++)
            json_object_set_new(optional, parts[i].name, json_boolean(parts[i].built));
        for (size_t i = 0; i < ARRAY_LEN(models); i++)
            json_object_set_new(found, models[i], sst_model_find(path, models[i]) ? json_null() : json_string(path));
        json_object_set_new(root, "devices", devices_json(info, devices));
        json_object_set_new(root, "shaders", shaders_json());
        json_object_set_new(root, "live",
                            json_pack("{s:o, s:o}", "on_device", steps_json(sst_live_device_steps), "on_cpu",
                                      steps_json(sst_live_cpu_steps)));
        return cli_dump_json(root, JSON_INDENT(2));
    }
    printf("sst %s, kernels for %s, %d threads\n", SST_VERSION, cpu, sst_thread_count(0));
    for (size_t i = 0; i < ARRAY_LEN(parts); i++)
        printf("  %-18s %s\n", parts[i].name, parts[i].built ? "yes" : "not built in");
    for (size_t i = 0; i < ARRAY_LEN(models); i++)
        printf("  %-18s %s\n", models[i], sst_model_find(path, models[i]) ? "not found" : path);
    print_devices(info, devices);
    print_live();
    return CLI_OK;
}

const struct cli_command cli_version = { "version", run };
