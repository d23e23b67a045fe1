/* drivers/usb/hub.h - what libusb does for us: reset a device, ask a hub what it can switch, switch a port. */
#ifndef SST_DRIVERS_USB_HUB_H
#define SST_DRIVERS_USB_HUB_H

#include "drivers/usb/usb.h"

/* Bus and address as in /dev/bus/usb/BBB/DDD. Control transfers end after 1 s. Nothing is logged.
 * @return 0, -ENODEV, -EACCES, -EIO, -ETIMEDOUT, -ENOSYS (built without libusb) */
SST_MUST_CHECK int sst_hub_reset_device(int bus, int address); /* may block for as long as the kernel does */
SST_MUST_CHECK int sst_hub_set_port_power(int bus, int address, int number, bool on);
enum sst_usb_switching sst_hub_switching(int bus, int address);

#endif
