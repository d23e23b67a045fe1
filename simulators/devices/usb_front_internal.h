/* simulators/devices/usb_front_internal.h - shared by usb_front.c, usb_sysfs.c and usbfs.c only. */
#ifndef SST_SIMULATORS_DEVICES_USB_FRONT_INTERNAL_H
#define SST_SIMULATORS_DEVICES_USB_FRONT_INTERNAL_H

#include "base/file.h"
#include "simulators/devices/usb_front.h"

#define SST_SIM_USB_MAJOR 189

struct usb_file;

/** A writable attribute of a device, or of one of its ports. */
struct usb_attribute {
    struct sst_sim_usb_front *front;
    int device, port; /* port 0: "authorized" of the device */
    struct sst_sim_node *node;
};

/** "bind" and "unbind" of a driver. */
struct usb_driver_file {
    struct sst_sim_usb_front *front;
    const char *driver;
    bool bind;
    struct sst_sim_node *node;
};

/** What is shown of a device. */
struct usb_shown {
    struct sst_sim_usb_front *front;
    int device;
    struct sst_sim_node *node; /* in /dev/bus/usb */
    struct usb_attribute attribute[SST_SIM_USB_PORTS + 1];
    int video;                  /* N of /dev/videoN, or -1 */
    struct usb_file *claims[2]; /* by interface: who claimed it through usbfs */
};

struct sst_sim_usb_front {
    struct sst_sim_usb_front_config cfg;
    struct sst_sim_server *server;
    struct sst_sim_usb *usb;
    struct usb_shown *shown; /* [devices] */
    struct usb_driver_file driver_file[4];
    bool telling; /* within an event of the model: what follows is not by hand */
};

/* usb_sysfs.c */
void usb_sysfs_drivers(struct sst_sim_usb_front *front);
void usb_sysfs_add(struct sst_sim_usb_front *front, int device);
void usb_sysfs_remove(struct sst_sim_usb_front *front, int device);
/** An interface got its driver or lost it. */
void usb_sysfs_bound(struct sst_sim_usb_front *front, int device, int interface);
void usb_sysfs_changed(struct sst_sim_usb_front *front, int device);
void usb_sysfs_video(struct sst_sim_usb_front *front, int device, bool present, int node);
/** Folder of a device in /sys. */
void usb_sysfs_dir(const struct sst_sim_usb_front *front, int device, char out[SST_PATH_MAX]);
/** "1-2:1.0" */
void usb_interface_name(const struct sst_sim_usb_device *d, int interface, char *out, size_t size);

/* usb_attributes.c: what is written */
extern const struct sst_sim_ops usb_attribute_ops, usb_driver_ops;

/* usbfs.c */
extern const struct sst_sim_ops usb_file_ops;

#endif
