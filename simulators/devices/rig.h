/* simulators/devices/rig.h - the motor rig of a session: simulated drives that carry the world's one camera. */
#ifndef SST_SIMULATORS_DEVICES_RIG_H
#define SST_SIMULATORS_DEVICES_RIG_H

#include <jansson.h>

#include "base/base.h"

struct sst_sim_rig; /* opaque; simulator's thread */

#define SST_SIM_RIG_LINK "/dev/serial/by-id/usb-sst_sim_rig"

/**
 * Start the drives: Modbus RTU behind SST_SIM_RIG_LINK, Modbus TCP on 127.0.0.1.
 *
 * @param dir    of the session
 * @param port   0: any free one
 * @return 0, -EADDRINUSE, -ENAMETOOLONG, -ENOMEM or -errno; logged.
 */
SST_MUST_CHECK int sst_sim_rig_open(struct sst_sim_rig **out, const char *dir, int port, uint64_t seed);
/** NULL is fine. */
void sst_sim_rig_close(struct sst_sim_rig *rig);

/** As sst_sim_drive_pose(). */
void sst_sim_rig_pose(struct sst_sim_rig *rig, int64_t t_ns, int32_t pose_um[3]);

/** "rig.NAME=VALUE". @param message  out, [size], on failure @return 0 or -EINVAL */
SST_MUST_CHECK int sst_sim_rig_fault(struct sst_sim_rig *rig, const char *text, char *message, size_t size);

/** All faults of the rig with help, for the list. */
extern const char sst_sim_rig_faults[];

/** Member "rig" of the status; NULL: no memory. */
json_t *sst_sim_rig_status(struct sst_sim_rig *rig);

#endif
