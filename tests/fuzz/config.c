/* Fuzz target: sstd.yaml. What is accepted compares equal with itself and is told in full. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "config/config_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char *const seeds[] = {
        "array: { rows: 2, cols: 2 }\ncameras:\n  format: YUYV\n  controls: { gain: 3 }\n  bind: [ { row: 0, col: 0, "
        "serial: A, line: T0 } ]\ntrigger: { source: gpio, lines: [T0, T1], delay_us: [1, 2] }\nrig: { axes: 3, units: "
        "[1, 2, 3], travel_max_mm: 5 }\n",
        "live: { focus_px: auto, plane_mm: 3e3, model: /x }\nzones: [ { name: a, x0: 0, y0: 0.1, x1: 1, y1: 1 } "
        "]\nstorage: { mode: event, record_on: [ { zone: a, label: Tree, share: 0.1 }, {} ] }\n",
        "web: { address: \"::1\", port: 0, host: 'a\"\\b' }\nrtsp: { enabled: true, user: u, password_file: /p }\n"
        "mqtt: { topic: a/b, discovery: \"\" }\nhooks: [ { event: \"*\", run: [/bin/sh, -c, \"x y\"] } ]\n",
    };

    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++)
        seed_write("config", i, seeds[i], strlen(seeds[i]));
    return 0;
}

static void compare(const struct sst_config *cfg)
{
    static struct sst_config defaults;
    struct sst_config_change *changes = NULL;

    sst_config_defaults(&defaults);
    if (sst_config_diff(&changes, cfg, cfg) != 0)
        abort();
    if (sst_config_diff(&changes, &defaults, cfg) > 0)
        free(changes);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct sst_config cfg;
    struct config_load load = { .cfg = &cfg, .array_only = size && data[0] == '#' };
    struct sst_yaml *doc;

    if (sst_yaml_parse(&doc, (const char *)data, size, "fuzz"))
        return 0;
    sst_config_defaults(&cfg);
    config_parse(&load, doc, false);
    config_check_array(&load);
    if (!load.array_only)
        config_check_service(&load);
    if (!sst_yaml_finish(doc)) {
        config_warn(&load);
        compare(&cfg);
    }
    sst_yaml_destroy(doc);
    return 0;
}
