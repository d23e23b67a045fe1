/* drivers/rig/drive.h - one axis' drive by its profile: status, steps, read-back. Inside drivers/rig only. */
#ifndef SST_DRIVERS_RIG_DRIVE_H
#define SST_DRIVERS_RIG_DRIVE_H

#include <stdatomic.h>

#include "drivers/rig/bus.h"
#include "drivers/rig/profile.h"
#include "drivers/rig/rig.h"

struct sst_rig_status {
    bool flag[SST_RIG_FLAGS];
    int32_t um;
    long alarm; /* code; 0 without */
};

struct sst_rig_axis {
    struct sst_rig_status now; /* as last read */
    int32_t target_um;
    bool has_target;
};

struct sst_rig {
    struct sst_rig_config cfg;      /* fixed after open */
    struct sst_rig_profile profile; /* fixed after open */
    struct sst_rig_bus *bus;
    struct sst_rig_axis axis[SST_RIG_AXES];
    struct sst_rig_counters count; /* of motions; those of the bus are there */
    bool moving, doubt;            /* doubt: the axes may not be where they say until they are homed */
    int64_t told_ns;               /* a fault of the bus was last told; 0: never */
    SST_ATOMIC(bool) cancel;
};

/** "axis x (unit 1)" for messages. */
const char *sst_rig_axis_name(const struct sst_rig *rig, int a, char text[32]);

/** Read flags, then position; retried within the configuration's bounds. @return 0, -ETIMEDOUT, -EIO, -ECANCELED;
 * logged. */
SST_MUST_CHECK int sst_rig_drive_status(struct sst_rig *rig, int a);

/** The identity register's value, or -1 where the profile has none. */
SST_MUST_CHECK int sst_rig_drive_identity(struct sst_rig *rig, int a, long *value);

/**
 * Run a sequence of the profile. A write whose reply did not come is repeated only where read-back, or the flag that
 * would show it, says that it did not arrive.
 * @param um  target of a move
 * @return 0, -ETIMEDOUT (a wait step, or the bus), -EIO, -ECANCELED (only before the first write); logged.
 */
SST_MUST_CHECK int sst_rig_drive_run(struct sst_rig *rig, int a, enum sst_rig_sequence which, int32_t um);

/** Sleep in steps that end early when the rig is cancelled. */
void sst_rig_sleep_ms(struct sst_rig *rig, int ms);

#endif
