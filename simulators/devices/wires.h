/* simulators/devices/wires.h - what the cameras are connected to: USB, trigger lines, the rig that carries them. */
#ifndef SST_SIMULATORS_DEVICES_WIRES_H
#define SST_SIMULATORS_DEVICES_WIRES_H

#include "simulators/devices/array.h"
#include "simulators/devices/rig.h"

struct sst_sim_wires; /* opaque; simulator's thread */

struct sst_sim_wires_options {
    const char *usb;  /* layout of the tree, sst_sim_usb_layout(); NULL: the first */
    bool one_trigger; /* line TRIG0 exposes all cameras; else each row has its line */
    bool rig;         /* drives carry the camera */
    int rig_port;     /* their TCP port on 127.0.0.1; 0: any free one */
};

struct sst_sim_wires_config {
    struct sst_sim_wires_options options;
    struct sst_sim_server *server;
    struct sst_sim_faults *faults;
    const struct sst_sim_world *world; /* borrowed */
};

/** Make /sys and the USB tree. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_wires_open(struct sst_sim_wires **out, const struct sst_sim_wires_config *cfg);
const struct sst_sim_usb *sst_sim_wires_usb(const struct sst_sim_wires *wires);

/** NULL: no rig. */
struct sst_sim_rig *sst_sim_wires_rig(const struct sst_sim_wires *wires);

/** Connect the cameras, make the GPIO chips and start the drives. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_wires_attach(struct sst_sim_wires *wires, struct sst_sim_array *array);

/** After the array has been closed. NULL is fine. */
void sst_sim_wires_close(struct sst_sim_wires *wires);

#endif
