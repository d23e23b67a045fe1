/* daemon/service/service.h - sstd as one object: its parts, their states, what can be asked of it. */
#ifndef SST_DAEMON_SERVICE_SERVICE_H
#define SST_DAEMON_SERVICE_SERVICE_H

#include "config/sstd.h"

struct sst_service; /* opaque; open, tick, reload, stop on the main thread */

/** States of design.md, 8. */
enum sst_service_phase {
    SST_SERVICE_STARTING = 0, /* cameras are being opened */
    SST_SERVICE_ARMED = 1,    /* cameras stream, no trigger has come yet */
    SST_SERVICE_CAPTURING = 2,
    SST_SERVICE_DEGRADED = 3, /* some camera, the live picture or the disk is missing; the others work */
    SST_SERVICE_DRAINING = 4,
    SST_SERVICE_FAILED = 5, /* nothing is captured; tried again */
};

struct sst_service_config {
    const char *path;   /* of the configuration; NULL: the default */
    const char *socket; /* instead of control: socket; NULL */
    int socket_fd;      /* listening already, by socket activation; -1: none */
};

/**
 * Start everything, in order: memory, storage, cameras, live picture, HTTP, hooks.
 *
 * Cameras, trigger and disk may be missing: that is a state. @param config  copied
 * @return 0; -EADDRINUSE, -EACCES and what else HTTP returns; -ENOMEM; logged, and all is stopped again
 */
SST_MUST_CHECK int sst_service_open(struct sst_service **out, const struct sst_config *config,
                                    const struct sst_service_config *cfg);

/** Update the state from all parts and emit events about it. To be called a few times a second.
 *  @param status  out, one line for systemd @return the state */
enum sst_service_phase sst_service_tick(struct sst_service *s, char status[512]);

/** Frames make progress, or there is a reason why there are none: the watchdog may be fed. `ns`: within this time. */
bool sst_service_alive(struct sst_service *s, int64_t ns);

/** Read the configuration again and apply it as a whole, or refuse it. @return 0, -EBADMSG ...; logged, and an event */
int sst_service_reload(struct sst_service *s);

/** Where the page is, with its token, for people; "" without one. */
void sst_service_address(struct sst_service *s, char *out, size_t size);

/** Stop everything in the reverse order, within a second.
 *  @return true: all is freed; false: something hangs (named in the log), or still computes in the idle time: the
 *          process is to end by _exit() */
SST_MUST_CHECK bool sst_service_stop(struct sst_service *s);

const char *sst_service_phase_name(enum sst_service_phase phase);

#endif
