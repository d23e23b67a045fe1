/* simulators/devices/sysfs_internal.h - shared by sysfs.c and uevent.c only. */
#ifndef SST_SIMULATORS_DEVICES_SYSFS_INTERNAL_H
#define SST_SIMULATORS_DEVICES_SYSFS_INTERNAL_H

#include "base/file.h"
#include "simulators/devices/sysfs.h"

struct sst_sim_listener;

struct sst_sim_sysfs {
    struct sst_sim_server *server;
    char root[SST_PATH_MAX]; /* the session's folder */
    int err;
    uint64_t sequence; /* of events */
    struct sst_sim_node *events;
    struct sst_sim_listener *listeners;
    struct sst_sim_timer retry;
};

/* uevent.c */
SST_MUST_CHECK int sst_sim_events_open(struct sst_sim_sysfs *fs);
void sst_sim_events_close(struct sst_sim_sysfs *fs);

#endif
