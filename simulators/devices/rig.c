#include "simulators/devices/devices_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "simulators/rig/drive.h"

struct sim_rig {
    struct sst_sim_drive *drive;
    char link[SST_PATH_MAX];
};

const char sim_rig_faults[] =
    "rig.NAME=WHEN              off, once, N (the next N replies), 1/N (every Nth), always; NAME is one of:\n"
    "  silence, wrong_unit, drop_bytes, bad_crc and noise (RTU), disconnect; exception=CODE[:WHEN], late_ms=MS[:WHEN]\n"
    "rig.NAME=AXIS              x, y, z, or off; x:always for the first three:\n"
    "  stall, limit, in_position_lies; alarm=x[:CODE], lost_steps=x[:COUNTS], power_loss=x\n";

int sim_rig_open(struct sim_rig **out, const char *dir, int port, uint64_t seed)
{
    struct sim_rig *rig = calloc(1, sizeof(*rig));
    struct sst_sim_drive_config cfg = { .tcp_port = port, .seed = seed };
    int err = -ENOMEM;

    if (!rig)
        return err;
    err = sst_path_join(rig->link, dir, SST_SIM_RIG_LINK + 1);
    cfg.rtu_link = rig->link;
    if (!err)
        err = sim_make_parents(rig->link, strlen(dir));
    if (!err)
        err = sst_sim_drive_start(&rig->drive, &cfg);
    if (err) {
        free(rig);
        return err;
    }
    *out = rig;
    return 0;
}

void sim_rig_close(struct sim_rig *rig)
{
    if (!rig)
        return;
    sst_sim_drive_stop(rig->drive);
    free(rig);
}

void sim_rig_pose(struct sim_rig *rig, int64_t t_ns, int32_t pose_um[3])
{
    sst_sim_drive_pose(rig->drive, t_ns, pose_um);
}

int sim_rig_fault(struct sim_rig *rig, const char *text, char *message, size_t size)
{
    const char *name = text + strlen("rig."), *equals = strchr(text, '=');
    char only[64];

    if (!equals || equals - name >= (int)sizeof(only)) {
        snprintf(message, size, "%.80s is not of the form rig.NAME=VALUE", text);
        return -EINVAL;
    }
    snprintf(only, sizeof(only), "%.*s", (int)(equals - name), name);
    return sst_sim_drive_fault(rig->drive, only, equals + 1, message, size);
}

json_t *sim_rig_status(struct sim_rig *rig)
{
    int32_t um[3];
    char bus[64];

    sst_sim_drive_pose(rig->drive, sst_clock_now_ns(), um);
    snprintf(bus, sizeof(bus), "tcp:127.0.0.1:%d", sst_sim_drive_tcp_port(rig->drive));
    return json_pack("{s:s, s:s, s:[iii]}", "tcp", bus, "rtu", SST_SIM_RIG_LINK, "pose_um", um[0], um[1], um[2]);
}
