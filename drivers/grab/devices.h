/* drivers/grab/devices.h - video nodes that are there, and those that come and go. Only for drivers/grab. */
#ifndef SST_DRIVERS_GRAB_DEVICES_H
#define SST_DRIVERS_GRAB_DEVICES_H

#include "drivers/grab/identity.h"

#define SST_GRAB_NODES_MAX 1024

/**
 * All video nodes in the order of sst_grab_node_order(), without opening those on USB.
 * @param nodes  out, to free with free()
 * @return 0, -ENOMEM or what the system says, logged.
 */
SST_MUST_CHECK int sst_grab_scan(struct sst_grab_node **nodes, int *count);

struct sst_grab_watch; /* opaque; tells of plugs */

/** @return 0, -errno, logged. *out is NULL where plugs are not told of (built without libudev): scan from time to time.
 */
SST_MUST_CHECK int sst_grab_watch_open(struct sst_grab_watch **out);
int sst_grab_watch_fd(const struct sst_grab_watch *watch);

/**
 * Take one event: a node that was added (all known of it in *node), or removed (device.node and number alone).
 * @return 1 added, 2 removed, 0 nothing more, -ENOBUFS (events were lost: scan again)
 */
SST_MUST_CHECK int sst_grab_watch_next(struct sst_grab_watch *watch, struct sst_grab_node *node);
void sst_grab_watch_close(struct sst_grab_watch *watch);

#endif
