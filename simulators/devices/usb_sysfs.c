/* simulators/devices/usb_sysfs.c - USB devices, their drivers and video nodes in /sys and in udev's data. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"
#include "simulators/devices/usb_internal.h"

#include "base/text.h"

/* --- names -------------------------------------------------------------------------------------------------------- */

/** Folder of a device in /sys. */
static void usb_sysfs_dir(const struct sim_usb_front *front, int device, char out[SST_PATH_MAX])
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    char below[SST_PATH_MAX] = "";

    for (; d->parent >= 0; d = sst_sim_usb_device(front->usb, d->parent)) {
        char longer[SST_PATH_MAX];

        snprintf(longer, sizeof(longer), "/%s%.1024s", d->path, below);
        memcpy(below, longer, sizeof(below));
    }
    snprintf(out, SST_PATH_MAX, "/sys/devices/pci0000:00/%s/%s%.1024s", d->controller, d->path, below);
}

void usb_interface_name(const struct sst_sim_usb_device *d, int interface, char *out, size_t size)
{
    if (d->kind == SST_SIM_USB_ROOT)
        snprintf(out, size, "%d-0:1.%d", d->bus, interface);
    else
        snprintf(out, size, "%s:1.%d", d->path, interface);
}

static void interface_dir(const struct sim_usb_front *front, int device, int interface, char out[SST_PATH_MAX])
{
    char dir[SST_PATH_MAX], name[96];

    usb_sysfs_dir(front, device, dir);
    usb_interface_name(sst_sim_usb_device(front->usb, device), interface, name, sizeof(name));
    snprintf(out, SST_PATH_MAX, "%.1800s/%s", dir, name);
}

/** "1-1-port2" of a hub "1-1", "usb1-port2" of a root hub. */
static void port_dir(const struct sim_usb_front *front, int hub, int port, char out[SST_PATH_MAX])
{
    char dir[SST_PATH_MAX];

    interface_dir(front, hub, 0, dir);
    snprintf(out, SST_PATH_MAX, "%.1800s/%s-port%d", dir, sst_sim_usb_device(front->usb, hub)->path, port);
}

static int minor_of(const struct sst_sim_usb_device *d)
{
    return (d->bus - 1) * 128 + d->address - 1;
}

/* --- udev's properties of a device -------------------------------------------------------------------------------- */

/** Replace some characters by underscores. */
static void underscores(char *text, const char *which)
{
    for (text += strcspn(text, which); *text; text += strcspn(text, which))
        *text = '_';
}

/** "pci-0000:00:14.0-usb-0:1.2", and with the interface where there is one. */
static void path_id(const struct sst_sim_usb_device *d, int interface, char *out, size_t size)
{
    const char *ports = d->kind == SST_SIM_USB_ROOT ? NULL : strchr(d->path, '-') + 1;

    snprintf(out, size, "pci-%s", d->controller);
    if (ports)
        sst_text_add(out, size, "-usb-0:%s", ports);
    if (ports && interface >= 0)
        sst_text_add(out, size, ":1.%d", interface);
}

static void add_identity(struct sim_props *udev, const struct sst_sim_usb_device *d, const uint8_t *descriptor)
{
    char maker[64], product[64];

    snprintf(maker, sizeof(maker), "%s", sst_sim_usb_maker(d));
    snprintf(product, sizeof(product), "%s", sst_sim_usb_product(d));
    underscores(maker, " ");
    underscores(product, " ");
    sim_props_add(udev, "ID_BUS=usb\nID_VENDOR=%s\nID_VENDOR_ID=%02x%02x", maker, descriptor[9], descriptor[8]);
    sim_props_add(udev, "ID_MODEL=%s\nID_MODEL_ID=%02x%02x", product, descriptor[11], descriptor[10]);
    sim_props_add(udev, "ID_REVISION=%02x%02x", descriptor[13], descriptor[12]);
    sim_props_add(udev, "ID_SERIAL=%s_%s%s%s", maker, product, d->serial[0] ? "_" : "", d->serial);
    if (d->serial[0])
        sim_props_add(udev, "ID_SERIAL_SHORT=%s", d->serial);
    sim_props_add(udev, "ID_USB_INTERFACES=%s",
                  d->kind == SST_SIM_USB_CAMERA  ? ":0e0100:0e0200:"
                  : d->kind == SST_SIM_USB_STILL ? ":060101:"
                                                 : ":090000:");
    if (d->kind == SST_SIM_USB_STILL)
        sim_props_add(udev, "ID_GPHOTO2=1\nGPHOTO2_DRIVER=PTP"); /* by libgphoto2's rules */
}

static void add_path_id(struct sim_props *udev, const char *path)
{
    char tag[160];

    snprintf(tag, sizeof(tag), "%s", path);
    underscores(tag, ":.");
    sim_props_add(udev, "ID_PATH=%s\nID_PATH_TAG=%s", path, tag);
}

/* --- properties in "uevent" --------------------------------------------------------------------------------------- */

static void add_product(struct sim_props *props, const uint8_t *descriptor)
{
    sim_props_add(props, "PRODUCT=%x/%x/%x", descriptor[8] | descriptor[9] << 8, descriptor[10] | descriptor[11] << 8,
                  descriptor[12] | descriptor[13] << 8);
    sim_props_add(props, "TYPE=%d/%d/%d", descriptor[4], descriptor[5], descriptor[6]);
}

static void device_props(struct sim_props *props, const struct sst_sim_usb_device *d, const uint8_t *descriptor)
{
    sim_props_add(props, "MAJOR=%d\nMINOR=%d\nDEVNAME=bus/usb/%03d/%03d", SST_SIM_USB_MAJOR, minor_of(d), d->bus,
                  d->address);
    sim_props_add(props, "DEVTYPE=usb_device\nDRIVER=usb");
    add_product(props, descriptor);
    sim_props_add(props, "BUSNUM=%03d\nDEVNUM=%03d", d->bus, d->address);
}

static void interface_props(const struct sim_usb_front *front, struct sim_props *props, int device, int interface,
                            const uint8_t *descriptor)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    uint8_t class[3] = { 0 };

    if (sst_sim_usb_interface_class(front->usb, device, interface, class) < 0)
        return;
    sim_props_add(props, "DEVTYPE=usb_interface");
    if (d->bound >> interface & 1)
        sim_props_add(props, "DRIVER=%s", sst_sim_usb_driver(d));
    add_product(props, descriptor);
    sim_props_add(props, "INTERFACE=%d/%d/%d", class[0], class[1], class[2]);
    sim_props_add(props, "MODALIAS=usb:v%02X%02Xp%02X%02Xd%02X%02Xdc%02Xdsc%02Xdp%02Xic%02Xisc%02Xip%02Xin%02X",
                  descriptor[9], descriptor[8], descriptor[11], descriptor[10], descriptor[13], descriptor[12],
                  descriptor[4], descriptor[5], descriptor[6], class[0], class[1], class[2], interface);
}

/** Send an event about a device (interface -1) or one of its interfaces. */
static void send_event(struct sim_usb_front *front, int device, int interface, const char *action)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    struct sim_props props = { .bytes = 0 }, udev = { .bytes = 0 };
    char dir[SST_PATH_MAX], id[32], path[128];
    uint8_t descriptor[4096];

    if (sst_sim_usb_descriptors(front->usb, device, descriptor, sizeof(descriptor)) < 0)
        return;
    path_id(d, interface, path, sizeof(path));
    if (interface < 0) {
        usb_sysfs_dir(front, device, dir);
        device_props(&props, d, descriptor);
        snprintf(id, sizeof(id), "c%d:%d", SST_SIM_USB_MAJOR, minor_of(d));
        add_identity(&udev, d, descriptor);
    } else {
        interface_dir(front, device, interface, dir);
        interface_props(front, &props, device, interface, descriptor);
    }
    add_path_id(&udev, path);
    sim_props_add(&props, "SUBSYSTEM=usb");
    sim_uevent(front->cfg.sysfs, action, dir + strlen("/sys"), &props, interface < 0 ? id : NULL, &udev);
}

/* --- attributes --------------------------------------------------------------------------------------------------- */

static void descriptor_attributes(struct sim_sysfs *fs, const char *dir, const uint8_t *b, int bytes)
{
    sim_sysfs_bytes(fs, dir, "descriptors", b, (size_t)bytes);
    sim_sysfs_attr(fs, dir, "version", "%2x.%02x", b[3], b[2]);
    sim_sysfs_attr(fs, dir, "bDeviceClass", "%02x", b[4]);
    sim_sysfs_attr(fs, dir, "bDeviceSubClass", "%02x", b[5]);
    sim_sysfs_attr(fs, dir, "bDeviceProtocol", "%02x", b[6]);
    sim_sysfs_attr(fs, dir, "bMaxPacketSize0", "%d", b[7]);
    sim_sysfs_attr(fs, dir, "idVendor", "%02x%02x", b[9], b[8]);
    sim_sysfs_attr(fs, dir, "idProduct", "%02x%02x", b[11], b[10]);
    sim_sysfs_attr(fs, dir, "bcdDevice", "%02x%02x", b[13], b[12]);
    sim_sysfs_attr(fs, dir, "bNumConfigurations", "%d", b[17]);
    sim_sysfs_attr(fs, dir, "bNumInterfaces", "%2d", b[18 + 4]);
    sim_sysfs_attr(fs, dir, "bConfigurationValue", "%d", b[18 + 5]);
    sim_sysfs_attr(fs, dir, "bmAttributes", "%02x", b[18 + 7]);
    sim_sysfs_attr(fs, dir, "bMaxPower", "%dmA", b[18 + 8] * 2);
}

static void device_attributes(struct sim_usb_front *front, int device, const char *dir)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    struct sim_sysfs *fs = front->cfg.sysfs;
    const char *ports = d->kind == SST_SIM_USB_ROOT ? "0" : strchr(d->path, '-') + 1;

    sim_sysfs_attr(fs, dir, "busnum", "%d", d->bus);
    sim_sysfs_attr(fs, dir, "devnum", "%d", d->address);
    sim_sysfs_attr(fs, dir, "devpath", "%s", ports);
    sim_sysfs_attr(fs, dir, "dev", "%d:%d", SST_SIM_USB_MAJOR, minor_of(d));
    sim_sysfs_attr(fs, dir, "speed", "%d", d->speed_mbit);
    sim_sysfs_attr(fs, dir, "maxchild", "%d", d->ports);
    sim_sysfs_attr(fs, dir, "manufacturer", "%s", sst_sim_usb_maker(d));
    sim_sysfs_attr(fs, dir, "product", "%s", sst_sim_usb_product(d));
    if (d->serial[0])
        sim_sysfs_attr(fs, dir, "serial", "%s", d->serial);
    sim_sysfs_attr(fs, dir, "removable", "%s", d->kind == SST_SIM_USB_ROOT ? "unknown" : "removable");
    sim_sysfs_attr(fs, dir, "authorized", "%d", d->authorized);
}

static void writable(struct sim_usb_front *front, int device, int port, const char *dir, const char *name)
{
    struct usb_attribute *a = &front->shown[device].attribute[port];

    *a = (struct usb_attribute){ .front = front, .device = device, .port = port };
    sim_sysfs_writable(front->cfg.sysfs, &a->node, dir, name,
                       &(struct sim_device){ .ops = &usb_attribute_ops, .arg = a });
}

static void add_port(struct sim_usb_front *front, int hub, int port)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, hub);
    struct sim_sysfs *fs = front->cfg.sysfs;
    char dir[SST_PATH_MAX], peer[SST_PATH_MAX];

    port_dir(front, hub, port, dir);
    sim_sysfs_attr(fs, dir, "connect_type", "hotplug");
    sim_sysfs_attr(fs, dir, "over_current_count", "0");
    sim_sysfs_attr(fs, dir, "disable", "%d", d->disabled[port]);
    writable(front, hub, port, dir, "disable");
    if (d->twin >= 0) {
        port_dir(front, d->twin, port, peer);
        sim_sysfs_link(front->cfg.sysfs, dir, "peer", peer);
    }
}

static void interface_uevent(struct sim_usb_front *front, int device, int interface, const uint8_t *descriptor)
{
    struct sim_props props = { .bytes = 0 };
    const char *alias;
    char dir[SST_PATH_MAX];

    interface_dir(front, device, interface, dir);
    interface_props(front, &props, device, interface, descriptor);
    sim_sysfs_bytes(front->cfg.sysfs, dir, "uevent", props.text, props.bytes);
    alias = strstr(props.text, "MODALIAS=");
    if (alias)
        sim_sysfs_attr(front->cfg.sysfs, dir, "modalias", "%.*s", (int)strcspn(alias + 9, "\n"), alias + 9);
}

/** The links between an interface and its driver. */
static void link_driver(const struct sim_usb_front *front, int device, int interface)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    char dir[SST_PATH_MAX], driver[96], name[96];

    interface_dir(front, device, interface, dir);
    usb_interface_name(d, interface, name, sizeof(name));
    snprintf(driver, sizeof(driver), "/sys/bus/usb/drivers/%s", sst_sim_usb_driver(d));
    if (d->bound >> interface & 1) {
        sim_sysfs_link(front->cfg.sysfs, dir, "driver", driver);
        sim_sysfs_link(front->cfg.sysfs, driver, name, dir);
    } else {
        sim_sysfs_remove(front->cfg.sysfs, dir, "driver");
        sim_sysfs_remove(front->cfg.sysfs, driver, name);
    }
}

static void add_interface(struct sim_usb_front *front, int device, int interface, const uint8_t *descriptor)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    struct sim_sysfs *fs = front->cfg.sysfs;
    char dir[SST_PATH_MAX], name[96];
    uint8_t class[3] = { 0 };

    if (sst_sim_usb_interface_class(front->usb, device, interface, class) < 0)
        return;
    interface_dir(front, device, interface, dir);
    sim_sysfs_attr(fs, dir, "bInterfaceNumber", "%02x", interface);
    sim_sysfs_attr(fs, dir, "bAlternateSetting", "%2d", interface == 1 ? d->alt : 0);
    sim_sysfs_attr(fs, dir, "bNumEndpoints", "%02x", d->kind == SST_SIM_USB_STILL ? 3 : interface == 0);
    sim_sysfs_attr(fs, dir, "bInterfaceClass", "%02x", class[0]);
    sim_sysfs_attr(fs, dir, "bInterfaceSubClass", "%02x", class[1]);
    sim_sysfs_attr(fs, dir, "bInterfaceProtocol", "%02x", class[2]);
    sim_sysfs_attr(fs, dir, "authorized", "1");
    sim_sysfs_link(front->cfg.sysfs, dir, "subsystem", "/sys/bus/usb");
    usb_interface_name(d, interface, name, sizeof(name));
    interface_uevent(front, device, interface, descriptor);
    sim_sysfs_link(front->cfg.sysfs, "/sys/bus/usb/devices", name, dir);
    if (d->bound >> interface & 1)
        link_driver(front, device, interface);
    for (int port = 1; port <= d->ports; port++)
        add_port(front, device, port);
}

/* --- adding and removing devices ---------------------------------------------------------------------------------- */

static void add_controller(struct sim_usb_front *front, const struct sst_sim_usb_device *d)
{
    struct sim_sysfs *fs = front->cfg.sysfs;
    char dir[160];

    snprintf(dir, sizeof(dir), "/sys/devices/pci0000:00/%s", d->controller);
    sim_sysfs_attr(fs, dir, "vendor", "0x1b36");
    sim_sysfs_attr(fs, dir, "device", "0x000d");
    sim_sysfs_attr(fs, dir, "class", "0x0c0330");
    sim_sysfs_attr(fs, dir, "uevent", "DRIVER=xhci_hcd\nPCI_CLASS=C0330\nPCI_ID=1B36:000D\nPCI_SLOT_NAME=%s",
                   d->controller);
    sim_sysfs_link(front->cfg.sysfs, dir, "subsystem", "/sys/bus/pci");
    sim_sysfs_link(front->cfg.sysfs, dir, "driver", "/sys/bus/pci/drivers/xhci_hcd");
    sim_sysfs_link(front->cfg.sysfs, "/sys/bus/pci/devices", d->controller, dir);
    sim_sysfs_link(front->cfg.sysfs, "/sys/bus/pci/drivers/xhci_hcd", d->controller, dir);
}

void usb_sysfs_add(struct sim_usb_front *front, int device)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    uint8_t descriptor[4096];
    const int bytes = sst_sim_usb_descriptors(front->usb, device, descriptor, sizeof(descriptor));
    struct sim_props props = { .bytes = 0 };
    char dir[SST_PATH_MAX], number[32], port[SST_PATH_MAX];

    if (bytes < 0)
        return;
    if (d->kind == SST_SIM_USB_ROOT)
        add_controller(front, d);
    usb_sysfs_dir(front, device, dir);
    device_attributes(front, device, dir);
    descriptor_attributes(front->cfg.sysfs, dir, descriptor, bytes);
    writable(front, device, 0, dir, "authorized");
    for (int i = 0; i < d->interfaces; i++)
        add_interface(front, device, i, descriptor);
    device_props(&props, d, descriptor);
    sim_sysfs_bytes(front->cfg.sysfs, dir, "uevent", props.text, props.bytes);
    sim_sysfs_link(front->cfg.sysfs, dir, "subsystem", "/sys/bus/usb");
    sim_sysfs_link(front->cfg.sysfs, dir, "driver", "/sys/bus/usb/drivers/usb");
    sim_sysfs_link(front->cfg.sysfs, "/sys/bus/usb/drivers/usb", d->path, dir);
    sim_sysfs_link(front->cfg.sysfs, "/sys/bus/usb/devices", d->path, dir);
    snprintf(number, sizeof(number), "%d:%d", SST_SIM_USB_MAJOR, minor_of(d));
    sim_sysfs_link(front->cfg.sysfs, "/sys/dev/char", number, dir);
    if (d->parent >= 0) {
        port_dir(front, d->parent, d->port, port);
        sim_sysfs_link(front->cfg.sysfs, port, "device", dir);
        sim_sysfs_link(front->cfg.sysfs, dir, "port", port);
    }
    send_event(front, device, -1, "add");
    for (int i = 0; i < d->interfaces; i++)
        send_event(front, device, i, "add");
}

void usb_sysfs_remove(struct sim_usb_front *front, int device)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    char dir[SST_PATH_MAX], name[96], number[32], port[SST_PATH_MAX];

    for (int i = d->interfaces - 1; i >= 0; i--) {
        send_event(front, device, i, "remove");
        usb_interface_name(d, i, name, sizeof(name));
        sim_sysfs_remove(front->cfg.sysfs, "/sys/bus/usb/devices", name);
    }
    send_event(front, device, -1, "remove");
    for (int p = 0; p <= SST_SIM_USB_PORTS; p++) {
        sim_node_remove(front->server, front->shown[device].attribute[p].node);
        front->shown[device].attribute[p].node = NULL;
    }
    usb_sysfs_dir(front, device, dir);
    sim_sysfs_remove(front->cfg.sysfs, "/sys/bus/usb/drivers/usb", d->path);
    sim_sysfs_remove(front->cfg.sysfs, "/sys/bus/usb/devices", d->path);
    snprintf(number, sizeof(number), "%d:%d", SST_SIM_USB_MAJOR, minor_of(d));
    sim_sysfs_remove(front->cfg.sysfs, "/sys/dev/char", number);
    port_dir(front, d->parent, d->port, port);
    sim_sysfs_remove(front->cfg.sysfs, port, "device");
    sim_sysfs_remove(front->cfg.sysfs, dir, "");
}

void usb_sysfs_bound(struct sim_usb_front *front, int device, int interface)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    const bool bound = d->bound >> interface & 1;
    uint8_t descriptor[4096];

    if (sst_sim_usb_descriptors(front->usb, device, descriptor, sizeof(descriptor)) < 0)
        return;
    link_driver(front, device, interface);
    interface_uevent(front, device, interface, descriptor);
    send_event(front, device, interface, bound ? "bind" : "unbind");
    if (interface == d->interfaces - 1 && bound)
        send_event(front, device, -1, "bind");
}

void usb_sysfs_changed(struct sim_usb_front *front, int device)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    char dir[SST_PATH_MAX];

    usb_sysfs_dir(front, device, dir);
    sim_sysfs_attr(front->cfg.sysfs, dir, "authorized", "%d", d->authorized);
    sim_sysfs_attr(front->cfg.sysfs, dir, "bConfigurationValue", "%s", d->authorized ? "1" : "");
    for (int p = 1; p <= d->ports; p++) {
        port_dir(front, device, p, dir);
        sim_sysfs_attr(front->cfg.sysfs, dir, "disable", "%d", d->disabled[p]);
    }
}

void usb_sysfs_drivers(struct sim_usb_front *front)
{
    static const char *const drivers[] = { "uvcvideo", "hub" };
    int n = 0;

    for (size_t i = 0; i < ARRAY_LEN(drivers); i++) {
        char dir[96];

        snprintf(dir, sizeof(dir), "/sys/bus/usb/drivers/%s", drivers[i]);
        for (int bind = 0; bind <= 1; bind++, n++) {
            struct usb_driver_file *f = &front->driver_file[n];
            const char *name = bind ? "bind" : "unbind";

            *f = (struct usb_driver_file){ .front = front, .driver = drivers[i], .bind = bind };
            sim_sysfs_attr(front->cfg.sysfs, dir, name, "%s", "");
            sim_sysfs_writable(front->cfg.sysfs, &f->node, dir, name,
                               &(struct sim_device){ .ops = &usb_driver_ops, .arg = f });
        }
    }
}

/* --- video nodes -------------------------------------------------------------------------------------------------- */

static void video_udev(struct sim_usb_front *front, int device, struct sim_props *udev)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(front->usb, device);
    uint8_t descriptor[4096];
    char path[128], id[160];

    if (sst_sim_usb_descriptors(front->usb, device, descriptor, sizeof(descriptor)) < 0)
        return;
    path_id(d, 0, path, sizeof(path));
    snprintf(id, sizeof(id), "%s_%s_%s", sst_sim_usb_maker(d), sst_sim_usb_product(d), d->serial);
    underscores(id, " ");
    sim_props_add(udev, "S:v4l/by-id/usb-%s-video-index0", id);
    sim_props_add(udev, "S:v4l/by-path/%s-video-index0", path);
    sim_props_add(udev, "ID_V4L_VERSION=2\nID_V4L_PRODUCT=%s\nID_V4L_CAPABILITIES=:capture:", sst_sim_usb_product(d));
    sim_props_add(udev, "ID_TYPE=video\nID_USB_INTERFACE_NUM=00\nID_USB_DRIVER=uvcvideo");
    add_identity(udev, d, descriptor);
    add_path_id(udev, path);
}

/** The links that udev creates in /dev. */
static void video_links(struct sim_usb_front *front, const struct sim_props *udev, int node)
{
    char path[256], target[32];

    snprintf(target, sizeof(target), "../../video%d", node);
    for (const char *line = udev->text; strncmp(line, "S:", 2) == 0; line = strchr(line, '\n') + 1) {
        snprintf(path, sizeof(path), "/dev/%.*s", (int)strcspn(line + 2, "\n"), line + 2);
        (void)!sim_link(front->server, path, node >= 0 ? target : NULL);
    }
}

void usb_sysfs_video(struct sim_usb_front *front, int device, bool present, int node)
{
    struct sim_sysfs *fs = front->cfg.sysfs;
    struct sim_props props = { .bytes = 0 }, udev = { .bytes = 0 };
    char interface[SST_PATH_MAX], dir[SST_PATH_MAX], name[32], number[32], id[32];

    interface_dir(front, device, 0, interface);
    snprintf(name, sizeof(name), "video%d", node);
    snprintf(number, sizeof(number), "81:%d", node);
    snprintf(id, sizeof(id), "c81:%d", node);
    snprintf(dir, sizeof(dir), "%.1800s/video4linux/%s", interface, name);
    sim_props_add(&props, "MAJOR=81\nMINOR=%d\nDEVNAME=%s", node, name);
    video_udev(front, device, &udev);
    if (present) {
        sim_sysfs_attr(fs, dir, "name", "%s", sst_sim_usb_product(sst_sim_usb_device(front->usb, device)));
        sim_sysfs_attr(fs, dir, "index", "0");
        sim_sysfs_attr(fs, dir, "dev", "81:%d", node);
        sim_sysfs_bytes(fs, dir, "uevent", props.text, props.bytes);
        sim_sysfs_link(front->cfg.sysfs, dir, "subsystem", "/sys/class/video4linux");
        sim_sysfs_link(front->cfg.sysfs, dir, "device", interface);
        sim_sysfs_link(front->cfg.sysfs, "/sys/class/video4linux", name, dir);
        sim_sysfs_link(front->cfg.sysfs, "/sys/dev/char", number, dir);
    }
    video_links(front, &udev, present ? node : -1);
    sim_props_add(&props, "SUBSYSTEM=video4linux");
    sim_uevent(fs, present ? "add" : "remove", dir + strlen("/sys"), &props, id, &udev);
    if (!present) {
        sim_sysfs_remove(front->cfg.sysfs, "/sys/class/video4linux", name);
        sim_sysfs_remove(front->cfg.sysfs, "/sys/dev/char", number);
        sim_sysfs_remove(fs, dir, "");
    }
}
