/* simulators/devices/sysfs.h - a session's /sys, udev's data about it, and the events of both. */
#ifndef SST_SIMULATORS_DEVICES_SYSFS_H
#define SST_SIMULATORS_DEVICES_SYSFS_H

#include "simulators/devices/server.h"

/*
 * Paths are those that programs see, "/sys/devices/...". What cannot be written (a full disk) is logged once and seen
 * by programs as missing; sst_sim_sysfs_error() tells it.
 */
struct sst_sim_sysfs; /* opaque; simulator's thread */

/** /sys as the machine has it, by links, but without its own USB, PCI, GPIO and video devices.
 *  @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_sysfs_open(struct sst_sim_sysfs **out, struct sst_sim_server *server);
void sst_sim_sysfs_close(struct sst_sim_sysfs *fs);
struct sst_sim_server *sst_sim_sysfs_server(const struct sst_sim_sysfs *fs);
int sst_sim_sysfs_error(const struct sst_sim_sysfs *fs); /* the first, or 0 */

/* --- entries ------------------------------------------------------------------------------------------------------ */

/** An attribute: folder and name, contents as by printf, with a newline. Folders are made; it is replaced whole. */
SST_PRINTF(4, 5)
void sst_sim_sysfs_attr(struct sst_sim_sysfs *fs, const char *dir, const char *name, const char *fmt, ...);
/** The same with bytes as they are. */
void sst_sim_sysfs_bytes(struct sst_sim_sysfs *fs, const char *dir, const char *name, const void *data, size_t bytes);
/** Let programs write it; to be called once the attribute is there. node: to be removed by the caller. */
void sst_sim_sysfs_writable(struct sst_sim_sysfs *fs, struct sst_sim_node **node, const char *path,
                            const struct sst_sim_ops *ops, void *device);
/** A link at `path` to another entry, relative as sysfs has them. */
void sst_sim_sysfs_link(struct sst_sim_sysfs *fs, const char *path, const char *target);
/** Remove a file, link or folder with all in it. */
void sst_sim_sysfs_remove(struct sst_sim_sysfs *fs, const char *path);

/* --- udev --------------------------------------------------------------------------------------------------------- */

/** KEY=VALUE lines. */
struct sst_sim_props {
    char text[4096];
    size_t bytes;
};

SST_PRINTF(2, 3) void sst_sim_props_add(struct sst_sim_props *props, const char *fmt, ...);

/**
 * An event about a device: the kernel's to those who listen to it, udev's to those who listen to that.
 *
 * @param devpath  without /sys
 * @param kernel   as in the attribute "uevent", and SUBSYSTEM
 * @param id       under which udev keeps data, "c81:0", renewed before it tells and removed after; NULL: it keeps none
 * @param udev     what udev knows besides. Lines with S: are links in /dev. NULL: nothing.
 */
void sst_sim_uevent(struct sst_sim_sysfs *fs, const char *action, const char *devpath,
                    const struct sst_sim_props *kernel, const char *id, const struct sst_sim_props *udev);

/** udev's data alone, without an event. udev NULL: removed. */
void sst_sim_udev_data(struct sst_sim_sysfs *fs, const char *id, const struct sst_sim_props *udev);

#endif
