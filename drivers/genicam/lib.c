/* Loader of lib_aravis.c, the part libsst-aravis.so: GLib and libxml would make every start of sst longer. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>

#include "base/plugin.h"
#include "drivers/genicam/genicam_internal.h"

static void *load(const char *function)
{
    char why[256];

    return sst_plugin_symbol("aravis", function, why);
}

int genicam_lib_list(struct sst_genicam_device **devices, int *count)
{
    SST_PLUGIN_CALL(load, genicam_lib_list, devices, count);
}

int genicam_lib_open(struct genicam_lib **out, const struct genicam_lib_query *query,
                     struct sst_genicam_device *device, char *why, char *note)
{
    SST_PLUGIN_CALL(load, genicam_lib_open, out, query, device, why, note);
}

int genicam_lib_ptp(const struct sst_genicam_device *device, struct sst_genicam_ptp *out)
{
    SST_PLUGIN_CALL(load, genicam_lib_ptp, device, out);
}

int genicam_lib_start(struct genicam_lib *lib, const struct genicam_lib_events *events, char *why)
{
    SST_PLUGIN_CALL(load, genicam_lib_start, lib, events, why);
}

int genicam_lib_trigger(struct genicam_lib *lib)
{
    SST_PLUGIN_CALL(load, genicam_lib_trigger, lib);
}

int genicam_lib_read(struct genicam_lib *lib, struct genicam_reading *out)
{
    SST_PLUGIN_CALL(load, genicam_lib_read, lib, out);
}

void genicam_lib_release(struct genicam_slot *slot)
{
    __typeof__(&genicam_lib_release) loaded;

    *(void **)&loaded = load("genicam_lib_release");
    if (loaded)
        loaded(slot);
}

void genicam_lib_close(struct genicam_lib *lib, bool silent)
{
    __typeof__(&genicam_lib_close) loaded = NULL;

    if (lib)
        *(void **)&loaded = load("genicam_lib_close");
    if (loaded)
        loaded(lib, silent);
}

int sst_genicam_read_ptp(const struct sst_genicam_device *device, struct sst_genicam_ptp *out)
{
    return genicam_lib_ptp(device, out);
}

int sst_genicam_list(struct sst_genicam_device **devices, int *count)
{
    return genicam_lib_list(devices, count);
}
