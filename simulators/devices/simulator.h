/* simulators/devices/simulator.h - world, server and all simulated devices, put together. */
#ifndef SST_SIMULATORS_DEVICES_SIMULATOR_H
#define SST_SIMULATORS_DEVICES_SIMULATOR_H

#include "simulators/devices/wires.h"

struct sst_sim_options {
    const char *world, *cache; /* as for sst_sim_world_open() */
    const char *truth;         /* or NULL */
    const char *stats;         /* file for figures at the end, JSON; or NULL */
    struct sst_sim_wires_options wires;
    const char *const *faults; /* [fault_count] "NAME=VALUE" from the start */
    int fault_count;
    bool quiet;
};

struct sst_sim_simulator; /* opaque */

/** Open the world, which may take a while. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_simulator_open(struct sst_sim_simulator **out, const struct sst_sim_options *options);
/** Make the devices appear in a session's folder. @return 0 or -errno, logged; close it then. */
SST_MUST_CHECK int sst_sim_simulator_start(struct sst_sim_simulator *sim, const char *dir);
/** Also tells what the simulation cost. NULL is fine. */
void sst_sim_simulator_close(struct sst_sim_simulator *sim);
struct sst_sim_server *sst_sim_simulator_server(const struct sst_sim_simulator *sim);

#endif
