/* drivers/grab/node.h - one open video node: system calls with their repetition, and what the driver says of itself. */
#ifndef SST_DRIVERS_GRAB_NODE_H
#define SST_DRIVERS_GRAB_NODE_H

#include "drivers/grab/identity.h"

/** ioctl() repeated when interrupted. @return 0 or -errno */
int sst_node_ioctl(int fd, unsigned long request, void *arg);

/**
 * Open a node without blocking, check that it captures by streaming, and complete the device's name, driver and port.
 * @return descriptor, or -errno; -ENOTTY: it is no capture node; -ENODEV also when it is another device by now
 */
SST_MUST_CHECK int sst_node_open(struct sst_grab_device *device);

#endif
