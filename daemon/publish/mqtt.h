/* daemon/publish/mqtt.h - state, events and pictures at an MQTT broker; Home Assistant finds the array there. */
#ifndef SST_DAEMON_PUBLISH_MQTT_H
#define SST_DAEMON_PUBLISH_MQTT_H

#include "config/sstd.h"
#include "daemon/publish/api.h"

/* Topics below mqtt.topic (docs/mqtt.md):
 *   available                 online, offline (also by last will); retained
 *   status                    short JSON, each 10 s and when something changes; retained
 *   camera/rRcC/state         as GET /api/v1/cameras has it; retained
 *   event/TYPE                events as they come, also those of a time without connection that are still kept
 *   zone/NAME/motion          ON, OFF; retained
 *   picture                   JPEG of the main view; retained
 *   record, record/set        ON, OFF
 *   focus, focus/set          px, or auto */

struct sst_mqtt; /* opaque; open and close on one thread */

struct sst_mqtt_config {
    const struct sst_config *config; /* mqtt: zones: array: copied; mqtt.enabled false: it waits to be told otherwise */
    const struct sst_api *api;       /* must stay */
};

struct sst_mqtt_counters {
    bool connected;
    uint64_t connects, published, commands;
    uint64_t missed; /* events that were no longer kept when a connection came */
};

/**
 * Talk to the broker on a thread of its own from now on. A broker that is not there, a wrong password or a missing file
 * of certificates are told once, and tried again after 1, 2, 4 ... 60 s. Nothing piles up: without a connection, or
 * while the broker takes nothing, nothing is published but what is newest.
 *
 * @return 0, -EINVAL, -ENOMEM, -ENOTSUP (built without MQTT, but enabled; logged)
 */
SST_MUST_CHECK int sst_mqtt_open(struct sst_mqtt **out, const struct sst_mqtt_config *cfg);

/**
 * Follow another configuration from now on, within a second: what is not there any more, zones for example, is
 * withdrawn from Home Assistant, what is new announced; another broker, account or topic takes a new connection.
 *
 * @param config  copied @return 0, -ENOMEM, -ENOTSUP (likewise). Does not wait. Thread: any
 */
SST_MUST_CHECK int sst_mqtt_configure(struct sst_mqtt *m, const struct sst_config *config);

void sst_mqtt_counters(struct sst_mqtt *m, struct sst_mqtt_counters *out);

/**
 * Say "offline" and end, within timeout_ms (0.3 s is enough where nothing hangs). NULL is fine.
 * @return false: the thread hangs in the network, in looking up the broker's name for example; it stays behind, uses
 *         nothing of the caller's any more, and frees what is its own when it comes back
 */
bool sst_mqtt_close(struct sst_mqtt *m, int timeout_ms);

/** Begin to end; sst_mqtt_close() waits for it. NULL is fine. */
void sst_mqtt_stop(struct sst_mqtt *m);

#endif
