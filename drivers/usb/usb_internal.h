/* drivers/usb/usb_internal.h - private declarations of this folder; code outside of it includes the public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_USB_USB_INTERNAL_H
#define SST_DRIVERS_USB_USB_INTERNAL_H

#include "base/base.h"
#include "base/file.h"
#include "drivers/usb/usb.h"

/* --- deadline: calls that may block in the kernel for long, with a time-out. --- */

typedef int deadline_fn(void *arg);

/**
 * Call fn on its own thread and wait for it up to timeout_ms. After that the thread is abandoned and ends by itself.
 *
 * @param arg  copied, arg_size bytes: fn's copy lives as long as fn runs
 * @return the result of fn, -ETIMEDOUT, -ENOMEM or -EAGAIN (no thread)
 */
SST_MUST_CHECK int deadline_call(deadline_fn *fn, const void *arg, size_t arg_size, int timeout_ms);

/* --- hub: operations of libusb: reset a device, query and switch the power of ports. --- */

/* Bus and address as in /dev/bus/usb/BBB/DDD. Control transfers end after 1 s. Nothing is logged.
 * @return 0, -ENODEV, -EACCES, -EIO, -ETIMEDOUT, -ENOSYS (built without libusb) */
SST_MUST_CHECK int hub_reset_device(int bus, int address); /* may block for as long as the kernel does */
SST_MUST_CHECK int hub_set_port_power(int bus, int address, int number, bool on);
enum sst_usb_switching hub_switching(int bus, int address);

/* --- sysfs: reads the USB tree from sysfs, or from any folder with the same layout. --- */

/** As sst_usb_list(), below `root` instead of /sys. */
SST_MUST_CHECK int usb_scan(struct sst_usb_device **devices, int *count, const char *root);

/** A decimal or, with base 16, hexadecimal attribute; `missing` if it cannot be read. */
int sysfs_int(const char *folder, const char *attribute, int base, int missing);

/** The alternate settings of the first video streaming interface, from the raw descriptors of a device.
 *  @return number of settings; parsing stops at damaged descriptors */
int usb_parse_alts(struct sst_usb_alt alt[SST_USB_ALTS_MAX], const uint8_t *data, size_t size, int speed_mbit);

/** True if the descriptors of a device have a PTP interface. */
bool usb_has_ptp(const uint8_t *data, size_t size);

/** Order of ports: by bus, parents before their children, numbers as numbers. */
int usb_compare_ports(const char *a, const char *b);

/** The name of the hub that `port` is on ("1-2.3": "1-2"; "1-2": "usb1") and the number of the port there.
 *  @return 0, -EINVAL: not a port of a hub */
SST_MUST_CHECK int usb_split_port(const char *port, char hub[SST_USB_TEXT_MAX], int *number);

#endif
