/* simulators/devices/usb_internal.h - simulated USB tree of a session: /sys, /dev/bus/usb, udev. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_USB_INTERNAL_H
#define SST_SIMULATORS_DEVICES_USB_INTERNAL_H

#include "simulators/devices/devices_internal.h"

/* --- usb_front: the simulated USB tree in a session: /sys, /dev/bus/usb, udev. --- */

struct sim_usb_front; /* opaque; simulator's thread */

struct sim_usb_front_config {
    struct sim_sysfs *sysfs;
    struct sim_faults *faults;
    const char *layout; /* a name of sst_sim_usb_layout(); NULL: the first */
    int cameras;
    const char *still; /* serial of a still camera; NULL: none */
    const int (*sizes)[2];
    int size_count;
    void *arg;
    /** A camera's driver was bound or unbound: create or remove its video node, then call sim_usb_front_video(). */
    void (*works)(void *arg, int cam, bool works);
    /** The camera was reset, authorised again, or got its power back: SST_SIM_USB_RESET, _REAUTHORISED, _POWERED. */
    void (*rung)(void *arg, int cam, enum sst_sim_usb_event rung);
};

/** Create controllers, hubs and cameras; `works` is not called. @return 0, -EINVAL (layout), -errno; logged. */
SST_MUST_CHECK int sim_usb_front_open(struct sim_usb_front **out, const struct sim_usb_front_config *cfg);
void sim_usb_front_close(struct sim_usb_front *front);

/**
 * A camera's /dev/videoN was created or removed: update /sys and send udev's event. If the bus did not request it, the
 * camera was plugged or unplugged by hand. @return false: a hub above it is gone, so the node must be removed again
 */
bool sim_usb_front_video(struct sim_usb_front *front, int cam, bool present, int node);

/** Parts of usbfs beside descriptors: endpoints and class requests of the still camera. */
struct sim_usb_pipes {
    void *arg;
    /** A class request. @param data  [wLength] @return bytes of the answer, or -EPIPE */
    int (*request)(void *arg, const uint8_t setup[8], uint8_t *data);
    /** A transfer to the bulk endpoint arrived. @return 0, or -EPIPE: halted */
    int (*out)(void *arg, const uint8_t *data, size_t bytes);
    /** The next bytes of an endpoint. @return bytes, less than `size`: a short packet ended them; -EAGAIN: none yet */
    int (*in)(void *arg, uint8_t endpoint, uint8_t *data, size_t size);
    void (*released)(void *arg); /* the program let go of the interface, or reset the device */
};

/** Set once, before programs run. */
void sim_usb_front_pipes(struct sim_usb_front *front, const struct sim_usb_pipes *pipes);
/** Plug or unplug the still camera; not from within its pipes. */
void sim_usb_front_plug(struct sim_usb_front *front, bool plugged);
/** Port of the still camera, "3-1"; "" while it is away. */
const char *sim_usb_front_port(const struct sim_usb_front *front);

/* --- usb_front_internal: shared by usb_front.c, usb_sysfs.c and usbfs.c only. --- */

#define SST_SIM_USB_MAJOR 189

struct usb_file;

/** A writable attribute of a device, or of one of its ports. */
struct usb_attribute {
    struct sim_usb_front *front;
    int device, port; /* port 0: "authorized" of the device */
    struct sim_node *node;
};

/** "bind" and "unbind" of a driver. */
struct usb_driver_file {
    struct sim_usb_front *front;
    const char *driver;
    bool bind;
    struct sim_node *node;
};

/** State of a device's entries. */
struct usb_shown {
    struct sim_usb_front *front;
    int device;
    struct sim_node *node; /* in /dev/bus/usb */
    struct usb_attribute attribute[SST_SIM_USB_PORTS + 1];
    int video;                  /* N of /dev/videoN, or -1 */
    struct usb_file *claims[2]; /* by interface: file that claimed it through usbfs */
    struct usb_file *files;     /* that programs have open */
};

struct sim_usb_front {
    struct sim_usb_front_config cfg;
    struct sim_server *server;
    struct sst_sim_usb *usb;
    struct usb_shown *shown; /* [devices] */
    struct usb_driver_file driver_file[4];
    struct sim_usb_pipes pipes; /* of the still camera */
    bool in_event; /* inside an event of the model: consequences are not by hand */
};

/* usb_sysfs.c */
void usb_sysfs_drivers(struct sim_usb_front *front);
void usb_sysfs_add(struct sim_usb_front *front, int device);
void usb_sysfs_remove(struct sim_usb_front *front, int device);
/** An interface was bound to its driver or unbound. */
void usb_sysfs_bound(struct sim_usb_front *front, int device, int interface);
void usb_sysfs_changed(struct sim_usb_front *front, int device);
void usb_sysfs_video(struct sim_usb_front *front, int device, bool present, int node);
/** "1-2:1.0" */
void usb_interface_name(const struct sst_sim_usb_device *d, int interface, char *out, size_t size);

/* usb_attributes.c: writable files */
extern const struct sim_ops usb_attribute_ops, usb_driver_ops;

/* usbfs.c */
extern const struct sim_ops usb_file_ops;
/** Complete transfers of a device with data at its endpoints. */
void usb_file_serve(struct usb_shown *shown);

#endif
