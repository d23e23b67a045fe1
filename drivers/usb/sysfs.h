/* drivers/usb/sysfs.h - the USB tree as files: reading it needs no rights, and any folder laid out like it will do. */
#ifndef SST_DRIVERS_USB_SYSFS_H
#define SST_DRIVERS_USB_SYSFS_H

#include "base/file.h"
#include "drivers/usb/usb.h"

/** As sst_usb_list(), below `root` instead of /sys. */
SST_MUST_CHECK int sst_usb_scan(struct sst_usb_device **devices, int *count, const char *root);

/** First line of an attribute. @return its length, or -errno; not logged */
SST_MUST_CHECK int sst_sysfs_read(char *text, size_t size, const char *folder, const char *attribute);
/** A decimal or, with base 16, hexadecimal attribute; `missing` where it cannot be read. */
int sst_sysfs_int(const char *folder, const char *attribute, int base, int missing);

/** The alternate settings of the first video streaming interface, from the raw descriptors of a device.
 *  @return number of settings; damaged descriptors end the walk */
int sst_usb_parse_alts(struct sst_usb_alt alt[SST_USB_ALTS_MAX], const uint8_t *data, size_t size, int speed_mbit);

/** Order of ports: by bus, parents before their children, numbers as numbers. */
int sst_usb_compare_ports(const char *a, const char *b);

/** The name of the hub that `port` is on ("1-2.3": "1-2"; "1-2": "usb1") and the number of the port there.
 *  @return 0, -EINVAL: no port of a hub */
SST_MUST_CHECK int sst_usb_split_port(const char *port, char hub[SST_USB_TEXT_MAX], int *number);

#endif
