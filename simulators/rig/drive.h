/* simulators/rig/drive.h - three simulated servo drives on Modbus TCP and RTU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_RIG_DRIVE_H
#define SST_SIMULATORS_RIG_DRIVE_H

#include "base/base.h"

struct sst_sim_drive; /* opaque; its servers run on threads of their own; all calls from any thread */

struct sst_sim_drive_config {
    int tcp_port;         /* on 127.0.0.1; 0: any free one; -1: none */
    const char *rtu_link; /* path of a link to the pty's other end; NULL: none */
    uint64_t seed;
};

SST_MUST_CHECK int sst_sim_drive_start(struct sst_sim_drive **out, const struct sst_sim_drive_config *cfg);
void sst_sim_drive_stop(struct sst_sim_drive *drive);

int sst_sim_drive_tcp_port(const struct sst_sim_drive *drive);

/** True position of the axes at a time (CLOCK_MONOTONIC), also during a motion. */
void sst_sim_drive_pose(struct sst_sim_drive *drive, int64_t t_ns, int32_t pose_um[3]);

/** Set a fault; names and values as in `sst-sim fault rig.NAME=VALUE`. @return 0, or -EINVAL with the reason in
 *  `error` */
SST_MUST_CHECK int sst_sim_drive_fault(struct sst_sim_drive *drive, const char *name, const char *value, char *error,
                                       size_t error_size);

#endif
