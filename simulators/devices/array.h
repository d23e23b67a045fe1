/* simulators/devices/array.h - the simulated cameras: who they are, when they expose, what the bus does to them. */
#ifndef SST_SIMULATORS_DEVICES_ARRAY_H
#define SST_SIMULATORS_DEVICES_ARRAY_H

#include <jansson.h>
#include <stdbool.h>

#include "simulators/devices/faults.h"
#include "simulators/devices/server.h"
#include "simulators/devices/usb/usb_model.h"
#include "simulators/scene/world/sim_world.h"

/* --- identity: the one place that V4L2, USB and udev agree on ----------------------------------------------------- */

struct sst_sim_identity {
    char serial[16];      /* "SIM0007" */
    char card[32];        /* name of the product and of the video node */
    char controller[32];  /* PCI address, "0000:00:14.0" */
    char port[32];        /* path of ports as sysfs writes it, "1-2.3": bus 1, port 2, hub port 3 */
    char bus_info[64];    /* as V4L2 writes it, "usb-0000:00:14.0-2.3" */
    int bus;              /* number of the USB bus */
};

/** Who camera cam is: as it is plugged in. */
void sst_sim_identity(const struct sst_sim_usb *usb, int cam, struct sst_sim_identity *out);

/* --- the array ---------------------------------------------------------------------------------------------------- */

struct sst_sim_array; /* opaque; simulator's thread */

/** What the bus is asked and told; set by the simulated USB, NULL members are not called. */
struct sst_sim_bus {
    void *arg;
    /** A camera starts to stream: 0, or -ENOSPC if the bus has no bandwidth for it. rate in frames/s. */
    int (*reserve)(void *arg, int cam, uint32_t fourcc, int width, int height, double rate_hz);
    void (*release)(void *arg, int cam);
    /** Camera came or went by sst_sim_array_plug(); node: N of /dev/videoN, which it has, or had. */
    void (*plugged)(void *arg, int cam, bool present, int node);
    /** By fault "swap": another camera is at this place. */
    void (*swapped)(void *arg, int cam, int body);
    /** Pose of the rig that the camera is on, at a time. */
    void (*pose)(void *arg, int64_t t_ns, int32_t pose_um[3]);
};

struct sst_sim_array_config {
    struct sst_sim_world *world; /* borrowed */
    struct sst_sim_server *server;
    struct sst_sim_faults *faults;
    const struct sst_sim_usb *usb; /* borrowed: what the cameras are plugged into */
    const char *truth; /* file for the log of what really happened, JSON lines; NULL: none */
};

/** Make the cameras appear, /dev/video0 on. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_array_open(struct sst_sim_array **out, const struct sst_sim_array_config *cfg);
void sst_sim_array_close(struct sst_sim_array *a);

void sst_sim_array_set_bus(struct sst_sim_array *a, const struct sst_sim_bus *bus);

int sst_sim_array_cameras(const struct sst_sim_array *a);
const struct sst_sim_usb *sst_sim_array_usb(const struct sst_sim_array *a);
/** N of /dev/videoN, -1: unplugged. */
int sst_sim_array_node(const struct sst_sim_array *a, int cam);

/** Which camera is plugged in where camera `cam` should be: another one with fault "swap". */
int sst_sim_array_body(const struct sst_sim_array *a, int cam);

/**
 * A rising edge on a trigger line at t_ns (CLOCK_MONOTONIC): cameras in trigger mode 1 expose after their delay.
 *
 * @param first, count  cameras wired to the line; one line per row: row * cols, cols
 * @param trigger       index of the edge on its line; goes into the frames
 */
void sst_sim_array_edge(struct sst_sim_array *a, int first, int count, uint64_t trigger, int64_t t_ns);

/** Take a camera away or bring it back (also fault "camera.N.unplug"); its node gets the lowest free number.
 *  Handles of a camera that goes are dropped. No change is fine. @return 0 or -errno. */
SST_MUST_CHECK int sst_sim_array_plug(struct sst_sim_array *a, int cam, bool present);

/** Rungs of recovery that clear a fault "stall" of up to that value. */
enum sst_sim_rung {
    SST_SIM_RESTREAM = 1,
    SST_SIM_REOPEN = 2,
    SST_SIM_RESET = 3,       /* USB reset: the stream is lost, the node stays */
    SST_SIM_REAUTHORISE = 4, /* and the bus calls sst_sim_array_plug() */
    SST_SIM_POWER = 5,
};
void sst_sim_array_rung(struct sst_sim_array *a, int cam, enum sst_sim_rung rung);

/** Frames made since open. */
uint64_t sst_sim_array_frames(const struct sst_sim_array *a);

/** Member "cameras" of the status: an array of objects, the caller's; NULL: no memory. */
json_t *sst_sim_array_status(const struct sst_sim_array *a);

#endif
