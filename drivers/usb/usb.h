/* drivers/usb/usb.h - tree of USB controllers, hubs and cameras; resets of devices, power of ports. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_USB_USB_H
#define SST_DRIVERS_USB_USB_H

#include <stdbool.h>

#include "base/base.h"

#define SST_USB_TEXT_MAX 64
#define SST_USB_ALTS_MAX 32

/** One alternate setting of a streaming interface. */
struct sst_usb_alt {
    int number;
    bool isochronous;
    int packet_bytes; /* per (micro)frame, all transactions of it: wMaxPacketSize & 0x7ff times its multiplier;
                         SuperSpeed: wBytesPerInterval */
    int interval_us;  /* between packets */
};

struct sst_usb_device {
    char port[SST_USB_TEXT_MAX];       /* "1-2.3" as in sysfs; "usb1" for a root hub */
    char controller[SST_USB_TEXT_MAX]; /* PCI address or platform name of the host controller */
    bool port_buses;                   /* Intel's xHCI: each root port has a high-speed bus of its own (see plan.h) */
    int bus, address, parent;          /* parent: index in the list, -1 for a root hub */
    int speed_mbit;                    /* 1 for 1.5; 12, 480, 5000, 10000, 20000 */
    bool hub;
    int hub_ports;
    bool single_tt; /* hub: one transaction translator for all low- and full-speed devices */
    int vendor, product;
    char maker[SST_USB_TEXT_MAX], name[SST_USB_TEXT_MAX], serial[SST_USB_TEXT_MAX];
    char node[SST_USB_TEXT_MAX]; /* /dev/videoN of a camera; "" */
    bool still;                  /* it has an interface of the still image class (PTP) */
    int alts;
    struct sst_usb_alt alt[SST_USB_ALTS_MAX]; /* of its video streaming interface */
};

/** All devices, parents before children, from sysfs only: opens no device and needs no permissions. A machine without
 *  USB has none. *devices to free with free(). @return 0, -ENOMEM or -EIO, logged. */
SST_MUST_CHECK int sst_usb_list(struct sst_usb_device **devices, int *count);

/** How a hub switches the power of its ports. */
enum sst_usb_switching {
    SST_USB_POWER_UNKNOWN = 0, /* no permission to query the hub */
    SST_USB_POWER_ALWAYS = 1,
    SST_USB_POWER_GANGED = 2, /* all ports together */
    SST_USB_POWER_PORTS = 3,  /* each port separately */
};

/** Query the hub (its class descriptor; waits up to 1 s). */
enum sst_usb_switching sst_usb_hub_switching(const struct sst_usb_device *hub);

/*
 * Resets. `port` as in sysfs. Each has a deadline of 10 s plus its own waits, and logs one sentence when it fails.
 * @return 0, -ENODEV (nothing on that port), -EACCES, -EIO, -ETIMEDOUT, -ENOSYS (built without libusb), -EINVAL (no
 * port). Thread: any; they block, up to their deadline.
 */

/** Reset the port's device, with the effect of re-plugging it; its nodes may be renumbered. */
SST_MUST_CHECK int sst_usb_reset(const char *port);
/** Write sysfs `authorized` 0, then 1. */
SST_MUST_CHECK int sst_usb_reauthorise(const char *port);
/** Switch the hub port (and the same port of the companion hub of the other speed) off, wait, on. A missing device is
 *  no error.
 *  @return also -ENOTSUP: the hub cannot switch single ports. */
SST_MUST_CHECK int sst_usb_power_cycle(const char *port, int off_ms);

#endif
