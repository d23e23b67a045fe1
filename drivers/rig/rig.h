/* drivers/rig/rig.h - a motor rig that carries one camera over a grid, driven over Modbus. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_RIG_RIG_H
#define SST_DRIVERS_RIG_RIG_H

#include <stdbool.h>

#include "base/base.h"

#define SST_RIG_AXES     3
#define SST_RIG_TEXT_MAX 256

struct sst_rig; /* opaque; one thread at a time */

/** Centre of the camera in the rig frame, um: x right, y down, z towards the scene. Missing axes are 0. */
struct sst_rig_pos {
    int32_t um[SST_RIG_AXES];
};

struct sst_rig_config {
    char bus[SST_RIG_TEXT_MAX];     /* "tcp:HOST:PORT" or "rtu:/dev/serial/by-id/...,19200,8E1" */
    char profile[SST_RIG_TEXT_MAX]; /* name in config/profiles or path of a YAML file: the drive's registers */
    int axes;                       /* 1..3; axis a is Modbus unit unit[a] */
    int unit[SST_RIG_AXES];
    int32_t travel_min_um[SST_RIG_AXES], travel_max_um[SST_RIG_AXES];
    double um_per_count[SST_RIG_AXES]; /* spindle and gear; negative: mounted the other way round */
    int response_ms;                   /* time-out of one reply */
    int retries;                       /* of reads; of a write only if read-back shows that it did not arrive */
    int reconnect_ms;                  /* give up a lost bus, or a busy drive, after this */
    int settle_ms;                     /* standstill after in-position */
    int32_t tolerance_um;
    double speed_mm_s, accel_mm_s2; /* 0: setting of the drive */
};

/** Since open. */
struct sst_rig_counters {
    uint64_t requests, timeouts, garbled, exceptions, lost, reconnects; /* of the bus */
    uint64_t late; /* replies on a serial line that came when none was expected, discarded */
    uint64_t moves, homings, stops, stalls, limits, alarms, missed, lies; /* missed: stopped off the target; lies:
                                                                           in-position reported while moving */
};

void sst_rig_config_defaults(struct sst_rig_config *cfg);

/**
 * Connect, read the status of all axes; nothing moves. A rig that was homed before stays homed.
 * @return 0, -EHOSTUNREACH/-ECONNREFUSED/-ENODEV/-EACCES/-EBUSY (bus), -EPROTO (not such a drive), -EIO, -EINVAL,
 * -ENOENT/ -EBADMSG (profile), -ENOSYS (built without libmodbus); logged.
 */
SST_MUST_CHECK int sst_rig_open(struct sst_rig **out, const struct sst_rig_config *cfg);

/** Clear alarms, home all axes (z first, away from the scene) and wait. @return 0, -ETIMEDOUT, -EIO, -ECANCELED
 * (stopped). */
SST_MUST_CHECK int sst_rig_home(struct sst_rig *rig, int timeout_ms);

/** True if the positions of the axes are known, by the last status read. After an alarm, a limit switch, a stall or a
 *  missed target they are not, until the next homing. */
bool sst_rig_homed(const struct sst_rig *rig);

/**
 * Start an absolute move and return at once; sst_rig_wait() reports its end.
 * @return 0, -ERANGE (outside travel, nothing moved), -EBUSY (still moving), -ENOTCONN (not homed), -EIO, -ETIMEDOUT
 *         (position unknown until read again).
 */
SST_MUST_CHECK int sst_rig_move(struct sst_rig *rig, struct sst_rig_pos target);

/**
 * Wait until every axis reports in-position, stands still, is within tolerance of the target by its own read-back, and
 * has settled. On a stall, alarm, limit switch, exception or time-out the motion is stopped and the reason logged.
 * @return 0, -ETIMEDOUT, -EIO, -ERANGE (limit switch), -ENOTCONN (an axis lost its home), -ECANCELED (sst_rig_cancel)
 */
SST_MUST_CHECK int sst_rig_wait(struct sst_rig *rig, int timeout_ms);

SST_MUST_CHECK int sst_rig_position(struct sst_rig *rig, struct sst_rig_pos *now);

/** Read the status now. @return true: all axes are at standstill and in position. For the check after an exposure. */
bool sst_rig_still(struct sst_rig *rig);

/** Stop all axes now. */
int sst_rig_stop(struct sst_rig *rig);

void sst_rig_counters(const struct sst_rig *rig, struct sst_rig_counters *out);

/** Make the current or next waiting call stop the motion and return -ECANCELED; async-signal-safe. */
void sst_rig_cancel(struct sst_rig *rig);

/** Stops all motion. NULL is fine. */
void sst_rig_close(struct sst_rig *rig);

#endif
