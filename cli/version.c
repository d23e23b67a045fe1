#include <stdio.h>
#include <stdlib.h>

#include "base/thread.h"
#include "cli/cli_internal.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/network/model_path.h"

static const struct {
    const char *name;
    int built;
} parts[] = {
    { "onednn", WITH_DNNL },        { "opencv", WITH_OPENCV },    { "libavformat", WITH_AVFORMAT },
    { "libudev", WITH_UDEV },       { "libusb", WITH_USB },       { "libmodbus", WITH_MODBUS },
    { "libgpiod", WITH_GPIOD > 0 }, { "libdogleg", WITH_DOGLEG }, { "libcurl", WITH_CURL },
};

static const char *const models[] = { "pspnet-small.onnx", "mccnn-fast.onnx" };

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    char path[SST_PATH_MAX];
    bool json = false;
    const struct cli_option options[] = {
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };
    const int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    const char *cpu = sst_cpu_level_name(sst_cpu_level());

    if (r != CLI_GO_ON)
        return r;
    if (json) {
        json_t *optional = json_object();
        json_t *found = json_object();
        json_t *root = json_pack("{s:s, s:s, s:i, s:o, s:o}", "version", SST_VERSION, "cpu", cpu, "threads",
                                 sst_thread_count(0), "parts", optional, "models", found);

        for (size_t i = 0; i < ARRAY_LEN(parts); i++)
            json_object_set_new(optional, parts[i].name, json_boolean(parts[i].built));
        for (size_t i = 0; i < ARRAY_LEN(models); i++)
            json_object_set_new(found, models[i], sst_model_find(path, models[i]) ? json_null() : json_string(path));
        return cli_dump_json(root, JSON_INDENT(2));
    }
    printf("sst %s, kernels for %s, %d threads\n", SST_VERSION, cpu, sst_thread_count(0));
    for (size_t i = 0; i < ARRAY_LEN(parts); i++)
        printf("  %-18s %s\n", parts[i].name, parts[i].built ? "yes" : "not built in");
    for (size_t i = 0; i < ARRAY_LEN(models); i++)
        printf("  %-18s %s\n", models[i], sst_model_find(path, models[i]) ? "not found" : path);
    return CLI_OK;
}

const struct cli_command cli_version = {
    .name = "version",
    .usage = "[--json]",
    .summary = "version, CPU level, optional parts and models",
    .example = "sst version --json",
    .run = run,
};
