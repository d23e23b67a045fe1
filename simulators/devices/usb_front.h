/* simulators/devices/usb_front.h - the simulated USB tree as programs of a session see it: /sys, /dev/bus/usb, udev. */
#ifndef SST_SIMULATORS_DEVICES_USB_FRONT_H
#define SST_SIMULATORS_DEVICES_USB_FRONT_H

#include "simulators/devices/faults.h"
#include "simulators/devices/sysfs.h"
#include "simulators/devices/usb/usb_model.h"

struct sst_sim_usb_front; /* opaque; simulator's thread */

struct sst_sim_usb_front_config {
    struct sst_sim_sysfs *sysfs;
    struct sst_sim_faults *faults;
    const char *layout; /* a name of sst_sim_usb_layout(); NULL: the first */
    int cameras;
    const int (*sizes)[2];
    int size_count;
    void *arg;
    /** A camera's driver bound or let go: its video node shall appear or go, told by sst_sim_usb_front_video(). */
    void (*works)(void *arg, int cam, bool works);
    /** The camera was reset, authorised again, or got its power back: SST_SIM_USB_RESET, _REAUTHORISED, _POWERED. */
    void (*rung)(void *arg, int cam, enum sst_sim_usb_event rung);
};

/** Make controllers, hubs and cameras appear; `works` is not called. @return 0, -EINVAL (layout), -errno; logged. */
SST_MUST_CHECK int sst_sim_usb_front_open(struct sst_sim_usb_front **out, const struct sst_sim_usb_front_config *cfg);
void sst_sim_usb_front_close(struct sst_sim_usb_front *front);

struct sst_sim_usb *sst_sim_usb_front_model(struct sst_sim_usb_front *front);

/**
 * A camera's /dev/videoN is there, or has gone: shown in /sys and told by udev. Where the bus did not ask for it the
 * camera was plugged or unplugged by hand.
 * @return false: a hub above it is away, so the node must go again
 */
bool sst_sim_usb_front_video(struct sst_sim_usb_front *front, int cam, bool present, int node);

#endif
