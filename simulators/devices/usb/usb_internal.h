/* simulators/devices/usb/usb_internal.h - shared by the files of the USB model only. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_USB_USB_INTERNAL_H
#define SST_SIMULATORS_DEVICES_USB_USB_INTERNAL_H

#include "simulators/devices/usb/usb_model.h"

#define USB_SIZES_MAX 8

struct sst_sim_usb {
    struct sst_sim_usb_device *device; /* [count] */
    int count, room;
    int next_address[256]; /* by bus */
    bool fault[SST_SIM_USB_FAULTS];
    int sizes[USB_SIZES_MAX][2], size_count;
    void *arg;
    void (*event)(void *arg, int device, enum sst_sim_usb_event event, int interface);
};

/** usb_layout.c: fill usb->device. @param still  serial, or NULL @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int usb_layout_build(struct sst_sim_usb *usb, const char *name, int cameras, const char *still);

#endif
