/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/usb/usb_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#if WITH_USB
#include <libusb.h>

#define TIMEOUT_MS 1000
/* USB 2.0 table 11-17, USB 3.2 table 10-10 */
enum { PORT_POWER = 8, HUB_DESCRIPTOR = 0x29, HUB_DESCRIPTOR_SUPER = 0x2a };

struct usb {
    libusb_context *context;
    libusb_device_handle *handle;
    int fd;
};

static int translate(int r)
{
    switch (r) {
    case LIBUSB_ERROR_NO_DEVICE:
        return -ENODEV;
    case LIBUSB_ERROR_ACCESS:
        return -EACCES;
    case LIBUSB_ERROR_TIMEOUT:
        return -ETIMEDOUT;
    case LIBUSB_ERROR_NO_MEM:
        return -ENOMEM;
    default:
        return r < 0 ? -EIO : 0;
    }
}

static void close_usb(struct usb *u)
{
    libusb_close(u->handle);
    libusb_exit(u->context);
    close(u->fd);
}

/* Open one device by its node: the enumeration of libusb would open and monitor all devices. */
static int open_usb(struct usb *u, int bus, int address)
{
    char node[64];
    int r;

    snprintf(node, sizeof(node), "/dev/bus/usb/%03d/%03d", bus, address);
    u->fd = open(node, O_RDWR | O_CLOEXEC);
    if (u->fd < 0)
        return errno == ENOENT ? -ENODEV : -errno;
    libusb_set_option(NULL, LIBUSB_OPTION_NO_DEVICE_DISCOVERY);
    r = libusb_init(&u->context);
    if (r) {
        close(u->fd);
        return translate(r);
    }
    r = libusb_wrap_sys_device(u->context, u->fd, &u->handle);
    if (r) {
        libusb_exit(u->context);
        close(u->fd);
    }
    return translate(r);
}

int hub_reset_device(int bus, int address)
{
    struct usb u;
    int err = open_usb(&u, bus, address);

    if (err)
        return err;
    err = libusb_reset_device(u.handle);
    close_usb(&u);
    /* Not found: the reset worked, and the device was enumerated as a new one. */
    return err == LIBUSB_ERROR_NOT_FOUND ? 0 : translate(err);
}

int hub_set_port_power(int bus, int address, int number, bool on)
{
    const uint8_t type = LIBUSB_ENDPOINT_OUT | LIBUSB_REQUEST_TYPE_CLASS | LIBUSB_RECIPIENT_OTHER;
    struct usb u;
    int err = open_usb(&u, bus, address);

    if (err)
        return err;
    err = libusb_control_transfer(u.handle, type, on ? LIBUSB_REQUEST_SET_FEATURE : LIBUSB_REQUEST_CLEAR_FEATURE,
                                  PORT_POWER, (uint16_t)number, NULL, 0, TIMEOUT_MS);
    close_usb(&u);
    return translate(err);
}

/* wHubCharacteristics, bits 1..0: 0 all ports together, 1 each port separately, 2 and 3 no switching. */
enum sst_usb_switching hub_switching(int bus, int address)
{
    const uint8_t type = LIBUSB_ENDPOINT_IN | LIBUSB_REQUEST_TYPE_CLASS | LIBUSB_RECIPIENT_DEVICE;
    uint8_t data[64];
    struct usb u;
    int n;

    if (open_usb(&u, bus, address))
        return SST_USB_POWER_UNKNOWN;
    n = libusb_control_transfer(u.handle, type, LIBUSB_REQUEST_GET_DESCRIPTOR, HUB_DESCRIPTOR << 8, 0, data,
                                sizeof(data), TIMEOUT_MS);
    if (n < 5 || data[1] != HUB_DESCRIPTOR)
        n = libusb_control_transfer(u.handle, type, LIBUSB_REQUEST_GET_DESCRIPTOR, HUB_DESCRIPTOR_SUPER << 8, 0, data,
                                    sizeof(data), TIMEOUT_MS);
    close_usb(&u);
    if (n < 5)
        return SST_USB_POWER_UNKNOWN;
    return (data[3] & 3) == 0 ? SST_USB_POWER_GANGED : (data[3] & 3) == 1 ? SST_USB_POWER_PORTS : SST_USB_POWER_ALWAYS;
}
#else
int hub_reset_device(int bus SST_UNUSED, int address SST_UNUSED)
{
    return -ENOSYS;
}

int hub_set_port_power(int bus SST_UNUSED, int address SST_UNUSED, int number SST_UNUSED, bool on SST_UNUSED)
{
    return -ENOSYS;
}

enum sst_usb_switching hub_switching(int bus SST_UNUSED, int address SST_UNUSED)
{
    return SST_USB_POWER_UNKNOWN;
}
#endif
