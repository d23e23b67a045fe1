/* drivers/grab/identity.h - which device is which camera. Pure; only for drivers/grab and its tests. */
#ifndef SST_DRIVERS_GRAB_IDENTITY_H
#define SST_DRIVERS_GRAB_IDENTITY_H

#include "drivers/grab/grab.h"

#define SST_WHY_MAX 512

/** A node and what else discovery knows of it. */
struct sst_grab_node {
    struct sst_grab_device device;
    int number;  /* of /dev/videoN */
    int capture; /* 1 yes, 0 no (metadata, output), -1 not known before it is opened */
};

/** Order of ports and nodes as a person reads them: 1-2.9 before 1-2.10; then the node's number. For qsort(). */
int sst_grab_node_order(const void *a, const void *b);

/**
 * Find the node of a camera: by serial where the binding has one, else by port. Of several nodes of one device the
 * first counts; nodes known not to capture do not.
 *
 * @param nodes  in the order of sst_grab_node_order()
 * @param why    out [SST_WHY_MAX]: a sentence where the result is -ENOTUNIQ (both ports), or where something is odd
 * (the serial sits at another port than the binding's, the port holds another serial); else ""
 * @return index in nodes, -ENODEV (none), -ENOTUNIQ (two devices of that serial)
 */
SST_MUST_CHECK int sst_grab_match(const struct sst_grab_binding *binding, const struct sst_grab_node *nodes, int count,
                                  char *why);

/** "1-2.3", and not the bus_info of a device elsewhere. */
bool sst_grab_is_usb_port(const char *port);

/** "camera 3 (serial A1)" or "camera 3 (port 1-2.4)" for messages. */
void sst_grab_camera_name(char *out, size_t size, int cam, const struct sst_grab_binding *binding);

#endif
