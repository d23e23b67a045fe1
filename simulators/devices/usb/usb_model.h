/* simulators/devices/usb/usb_model.h - model of USB controllers, hubs and cameras; no I/O. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_USB_USB_MODEL_H
#define SST_SIMULATORS_DEVICES_USB_USB_MODEL_H

#include <stdbool.h>

#include "base/base.h"

#define SST_SIM_USB_PORTS 16 /* most ports of a hub */
#define SST_SIM_USB_TEXT  64

struct sst_sim_usb; /* opaque; one thread */

enum sst_sim_usb_kind {
    SST_SIM_USB_ROOT = 0, /* root hub: a bus of a controller */
    SST_SIM_USB_HUB = 1,
    SST_SIM_USB_CAMERA = 2,
    SST_SIM_USB_STILL = 3, /* still camera over PTP: no kernel driver, programs claim its interface */
};

/** A device, present or not. Parents come before children. Read-only for callers. */
struct sst_sim_usb_device {
    enum sst_sim_usb_kind kind;
    int parent, port; /* index of the parent and its port, 1..; -1 and 0 for a root hub */
    int twin;         /* hub: its half of the other speed, or -1; a port loses power when both switch it off */
    int bus, address; /* as in /dev/bus/usb; the address changes with each plug-in, 0 while away */
    int speed_mbit;   /* 12, 480 or 5000 */
    int ports;        /* hubs */
    bool single_tt;   /* hubs: one transaction translator for all full-speed devices */
    int interfaces;   /* hubs and still cameras: 1, cameras: 2 (control, streaming) */
    int camera;       /* index, or -1 */
    char path[SST_SIM_USB_TEXT];       /* "1-2.3"; "usb1" for a root hub */
    char controller[SST_SIM_USB_TEXT]; /* PCI address */
    char serial[SST_SIM_USB_TEXT];
    /* state */
    bool plugged; /* set by plugging; presence also depends on its hubs */
    bool here;    /* enumerated */
    bool authorized;
    unsigned bound;                                                   /* bit mask of interfaces with their driver */
    bool off[SST_SIM_USB_PORTS + 1], disabled[SST_SIM_USB_PORTS + 1]; /* hubs, by port: power; sysfs "disable" */
    int alt; /* alternate setting of its streaming interface, 0: none */
};

enum sst_sim_usb_event {
    SST_SIM_USB_ADDED = 0,   /* enumerated */
    SST_SIM_USB_REMOVED = 1, /* its address is still valid */
    SST_SIM_USB_BOUND = 2,   /* interface: driver bound */
    SST_SIM_USB_UNBOUND = 3,
    SST_SIM_USB_CHANGED = 4, /* authorised, power or disable: attributes differ */
    SST_SIM_USB_RESET = 5,   /* recovery actions: reported before their consequences */
    SST_SIM_USB_REAUTHORISED = 6,
    SST_SIM_USB_POWERED = 7, /* power restored */
};

enum sst_sim_usb_fault {
    SST_SIM_USB_RESET_FAILS = 0,   /* 1: resets end with -ETIMEDOUT */
    SST_SIM_USB_NO_PORT_POWER = 1, /* 1: hubs cannot switch a port's power */
    SST_SIM_USB_FAULTS = 2,
};

struct sst_sim_usb_config {
    const char *layout;    /* a name of sst_sim_usb_layout(); NULL: the first */
    int cameras;           /* 1..255 */
    const char *still;     /* serial of a still camera beside them; NULL: none */
    const int (*sizes)[2]; /* [size_count] {width, height} that cameras offer; copied, at most 8 */
    int size_count;
    void *arg;
    void (*event)(void *arg, int device, enum sst_sim_usb_event event, int interface);
};

/** Name and description of the i-th layout, or false. */
bool sst_sim_usb_layout(int i, const char **name, const char **help);

/** Create with everything plugged in and bound; no events are sent. @return 0, -EINVAL (no such layout, or too many),
 *  -ENOMEM */
SST_MUST_CHECK int sst_sim_usb_create(struct sst_sim_usb **out, const struct sst_sim_usb_config *cfg);
void sst_sim_usb_destroy(struct sst_sim_usb *usb); /* sends no events */

int sst_sim_usb_count(const struct sst_sim_usb *usb);
const struct sst_sim_usb_device *sst_sim_usb_device(const struct sst_sim_usb *usb, int device);
int sst_sim_usb_camera(const struct sst_sim_usb *usb, int camera);       /* its device */
int sst_sim_usb_still(const struct sst_sim_usb *usb);                    /* device of the still camera, or -1 */
int sst_sim_usb_at(const struct sst_sim_usb *usb, int bus, int address); /* -1 */
/** The device at a hub's port, here or away, or -1. */
int sst_sim_usb_child(const struct sst_sim_usb *usb, int hub, int port);
/** True if the camera's driver is bound, that is, its video node exists. */
bool sst_sim_usb_works(const struct sst_sim_usb *usb, int device);
const char *sst_sim_usb_driver(const struct sst_sim_usb_device *device); /* of its interfaces: hub, uvcvideo; "" */
const char *sst_sim_usb_product(const struct sst_sim_usb_device *device);
const char *sst_sim_usb_maker(const struct sst_sim_usb_device *device);

void sst_sim_usb_fault(struct sst_sim_usb *usb, enum sst_sim_usb_fault fault, bool on);

/* --- operations on devices; all return 0 or -errno ---------------------------------------------------------------- */

void sst_sim_usb_plug(struct sst_sim_usb *usb, int device, bool plugged);
/** Plug another camera into this position: it has the serial of camera `body`. */
void sst_sim_usb_swap(struct sst_sim_usb *usb, int device, int body);
/** -EINVAL: a root hub; -ENODEV: away. */
SST_MUST_CHECK int sst_sim_usb_authorize(struct sst_sim_usb *usb, int device, bool authorized);
/** -ENODEV: away, not authorised or no such interface; -EBUSY: bound already. */
SST_MUST_CHECK int sst_sim_usb_bind(struct sst_sim_usb *usb, int device, int interface, bool bound);
/** sysfs "disable" of a hub's port: its device is gone until the port is enabled. -EINVAL: no such port. */
SST_MUST_CHECK int sst_sim_usb_disable(struct sst_sim_usb *usb, int hub, int port, bool disabled);
/** -EPIPE: the hub cannot; -EINVAL: no such port. */
SST_MUST_CHECK int sst_sim_usb_power(struct sst_sim_usb *usb, int hub, int port, bool on);
/** A port reset keeps the address; drivers are unbound and bound again. -ENODEV, -ETIMEDOUT (fault). */
SST_MUST_CHECK int sst_sim_usb_reset(struct sst_sim_usb *usb, int device);

/* --- usb_budget.c: isochronous bandwidth -------------------------------------------------------------------------- */

/** An alternate setting of the streaming interface. */
struct sst_sim_usb_alt {
    int packet, per_microframe; /* wMaxPacketSize is packet | (per_microframe - 1) << 11 */
};

/** Settings 1.. of a camera of this speed. @return their number */
int sst_sim_usb_alts(int speed_mbit, const struct sst_sim_usb_alt **alts);

/** Duration of a periodic packet in us, rounded up: USB 2.0, 5.11.3, as host controller drivers compute it. */
int sst_sim_usb_packet_us(int speed_mbit, int bytes);

/**
 * Reserve bandwidth for a stream: the smallest setting that carries it, on the bus and on the hub's translator.
 * High speed: 80 % of each microframe; full speed behind a translator: 90 % of each frame.
 *
 * @param bytes_s  0: as much as possible, as cameras request for compressed formats
 * @return 0, -ENOSPC (does not fit), -EIO (no setting carries it), -ENODEV
 */
SST_MUST_CHECK int sst_sim_usb_stream(struct sst_sim_usb *usb, int device, int64_t bytes_s);
void sst_sim_usb_stream_end(struct sst_sim_usb *usb, int device);

/** Endpoints of a still camera. */
enum sst_sim_usb_endpoint {
    SST_SIM_USB_BULK_IN = 0x81,
    SST_SIM_USB_BULK_OUT = 0x02,
    SST_SIM_USB_INTERRUPT_IN = 0x83,
};
#define SST_SIM_USB_BULK_PACKET 512

/* --- usb_descriptors.c, usb_control.c ----------------------------------------------------------------------------- */

/** Device descriptor, then the complete configuration descriptor. @return bytes, or -ENOSPC */
SST_MUST_CHECK int sst_sim_usb_descriptors(const struct sst_sim_usb *usb, int device, uint8_t *out, size_t size);

/** Class triple of an interface's alternate setting, from the descriptors. */
SST_MUST_CHECK int sst_sim_usb_interface_class(const struct sst_sim_usb *usb, int device, int interface,
                                               uint8_t triple[3]);

/**
 * Answer a control transfer as the device does.
 *
 * @param setup  the 8 setup bytes; data is [wLength], read or written according to bit 7 of setup[0]
 * @return bytes transferred, -EPIPE (stall), -ENODEV, -ETIMEDOUT
 */
SST_MUST_CHECK int sst_sim_usb_control(struct sst_sim_usb *usb, int device, const uint8_t setup[8], uint8_t *data);

#endif
