/* simulators/devices/sysfs_internal.h - simulated /sys of a session, its udev data, and the events of both. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_SYSFS_INTERNAL_H
#define SST_SIMULATORS_DEVICES_SYSFS_INTERNAL_H

#include "simulators/devices/devices_internal.h"

/* --- sysfs: a session's /sys, its udev data, and the events of both. --- */

/*
 * Paths are as seen by programs, "/sys/devices/...". Entries that cannot be written (a full disk) are logged once and
 * missing for programs; `err` is the first error.
 */
struct sim_sysfs; /* opaque; simulator's thread */

/** Create /sys: links to the machine's entries, without its USB, PCI, GPIO and video devices. @return 0 or -errno,
 *  logged. */
SST_MUST_CHECK int sim_sysfs_open(struct sim_sysfs **out, struct sim_server *server);
void sim_sysfs_close(struct sim_sysfs *fs);

/* --- entries ------------------------------------------------------------------------------------------------------ */

/** Write an attribute: folder, name, printf-style contents with a newline. Folders are created; it is replaced
 *  atomically. */
SST_PRINTF(4, 5)
void sim_sysfs_attr(struct sim_sysfs *fs, const char *dir, const char *name, const char *fmt, ...);
/** Write an attribute of raw bytes. */
void sim_sysfs_bytes(struct sim_sysfs *fs, const char *dir, const char *name, const void *data, size_t bytes);
/** Make an existing attribute writable for programs. node: removed by the caller. */
void sim_sysfs_writable(struct sim_sysfs *fs, struct sim_node **node, const char *dir, const char *name,
                        const struct sim_device *device);
/** Create a link in a folder to another entry, relative as in sysfs. */
void sim_sysfs_link(struct sim_sysfs *fs, const char *dir, const char *name, const char *target);
/** Remove a file, link or folder with all in it. @param name  "": the folder itself */
void sim_sysfs_remove(struct sim_sysfs *fs, const char *dir, const char *name);

/* --- udev --------------------------------------------------------------------------------------------------------- */

/** KEY=VALUE lines. */
struct sim_props {
    char text[4096];
    size_t bytes;
};

SST_PRINTF(2, 3) void sim_props_add(struct sim_props *props, const char *fmt, ...);

/**
 * Send an event about a device: the kernel's and udev's, each to its listeners.
 *
 * @param devpath  without /sys
 * @param kernel   as in the attribute "uevent", and SUBSYSTEM
 * @param id       key of udev's data, "c81:0", updated before the event or removed after it; NULL: no data
 * @param udev     udev's additional properties; lines with S: are links in /dev. NULL: none
 */
void sim_uevent(struct sim_sysfs *fs, const char *action, const char *devpath, const struct sim_props *kernel,
                const char *id, const struct sim_props *udev);

/* --- sysfs_internal: shared by sysfs.c and uevent.c only. --- */

struct sim_listener;

struct sim_sysfs {
    struct sim_server *server;
    char root[SST_PATH_MAX]; /* the session's folder */
    int err;                 /* the first, or 0 */
    uint64_t sequence;       /* of uevents */
    struct sim_node *events;
    struct sim_listener *listeners;
    struct sim_timer retry;
};

/* uevent.c */
SST_MUST_CHECK int sim_events_open(struct sim_sysfs *fs);
void sim_events_close(struct sim_sysfs *fs);

/* --- still: the still camera of a session, over PTP. --- */

struct sim_still; /* opaque; simulator's thread */

struct sim_still_config {
    struct sst_sim_world *world; /* borrowed; has a still camera */
    struct sim_server *server;
    struct sim_faults *faults;
    struct sim_usb_front *usb;
    FILE *truth; /* borrowed; NULL: no log */
    void *arg;
    void (*pose)(void *arg, int64_t t_ns, int32_t pose_um[3]); /* of the rig */
};

/** Connect the camera to its place in the USB tree. @return 0, -EINVAL (faults of the world) or -errno; logged. */
SST_MUST_CHECK int sim_still_open(struct sim_still **out, const struct sim_still_config *cfg);
/** Before the USB tree. NULL is fine. */
void sim_still_close(struct sim_still *still);
/** Member "still" of the status; NULL: no memory. */
json_t *sim_still_status(const struct sim_still *still);

#endif
