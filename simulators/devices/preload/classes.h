/* simulators/devices/preload/classes.h - one line for each class of devices. */
#ifndef SST_SIMULATORS_DEVICES_PRELOAD_CLASSES_H
#define SST_SIMULATORS_DEVICES_PRELOAD_CLASSES_H

#include "simulators/devices/preload/core.h"

extern const struct sim_class sim_class_v4l2;      /* v4l2.c */
extern const struct sim_class sim_class_gpio;      /* gpio.c */
extern const struct sim_class sim_class_usb;       /* usb.c */
extern const struct sim_class sim_class_attribute; /* hooks_sysfs.c: attributes in /sys that are written */
extern const struct sim_class sim_class_uevent;    /* uevent.c: netlink sockets for kernel events */

#endif
