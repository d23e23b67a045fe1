/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/devices_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"

const char sim_rig_faults[] =
    "rig.NAME=WHEN              off, once, N (the next N replies), 1/N (every Nth), always; NAME is one of:\n"
    "  silence, wrong_unit, drop_bytes, bad_crc and noise (RTU), disconnect; exception=CODE[:WHEN], late_ms=MS[:WHEN]\n"
    "rig.NAME=AXIS              x, y, z, or off; x:always for the first three:\n"
    "  stall, limit, in_position_lies; alarm=x[:CODE], lost_steps=x[:COUNTS], power_loss=x\n";

int sim_rig_open(struct sst_sim_drive **out, const char *dir, int port, uint64_t seed)
{
    char link[SST_PATH_MAX];
    int err = sst_path_join(link, dir, SST_SIM_RIG_LINK + 1);

    err = err ? err : sim_make_parents(link, strlen(dir));
    return err ? err : sst_sim_drive_start(out, &(struct sst_sim_drive_config){ port, link, seed });
}

int sim_rig_fault(struct sst_sim_drive *rig, const char *text, char *message, size_t size)
{
    const char *name = text + strlen("rig."), *equals = strchr(text, '=');
    char only[64];

    if (!equals || equals - name >= (int)sizeof(only)) {
        snprintf(message, size, "%.80s is not of the form rig.NAME=VALUE", text);
        return -EINVAL;
    }
    snprintf(only, sizeof(only), "%.*s", (int)(equals - name), name);
    return sst_sim_drive_fault(rig, only, equals + 1, message, size);
}

json_t *sim_rig_status(struct sst_sim_drive *rig)
{
    int32_t um[3];
    char bus[64];

    sst_sim_drive_pose(rig, sst_clock_now_ns(), um);
    snprintf(bus, sizeof(bus), "tcp:127.0.0.1:%d", sst_sim_drive_tcp_port(rig));
    return json_pack("{s:s, s:s, s:[iii]}", "tcp", bus, "rtu", SST_SIM_RIG_LINK, "pose_um", um[0], um[1], um[2]);
}
