/* daemon/service/service.h - sstd as one object: opens, updates, reloads and stops all its parts. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_SERVICE_SERVICE_H
#define SST_DAEMON_SERVICE_SERVICE_H

#include "config/sstd.h"
#include "daemon/fields/fields.h"

struct sst_service; /* opaque; open, tick, reload, stop on the main thread */

/** States of design.md, 8. */
enum sst_service_phase {
    SST_SERVICE_STARTING = 0, /* cameras are being opened */
    SST_SERVICE_ARMED = 1,    /* cameras stream, no trigger has come yet */
    SST_SERVICE_CAPTURING = 2,
    SST_SERVICE_DEGRADED = 3, /* a camera, the live picture or the disk is missing; everything else works */
    SST_SERVICE_DRAINING = 4,
    SST_SERVICE_FAILED = 5, /* nothing is captured; the service retries */
};

struct sst_service_config {
    const char *path;   /* of the configuration; NULL: the default */
    const char *socket; /* overrides `control: socket`; NULL: no override */
    int socket_fd;      /* listening already, by socket activation; -1: none */
};

/**
 * Start everything, in order: memory, storage, cameras, live picture, HTTP, hooks.
 *
 * Missing cameras, trigger or disk are a state, not an error. @param config  copied
 * @return 0; -EADDRINUSE, -EACCES and other errors of sst_http_open(); -ENOMEM; logged, and everything is stopped again
 */
SST_MUST_CHECK int sst_service_open(struct sst_service **out, const struct sst_config *config,
                                    const struct sst_service_config *cfg);

/** Update the state from all parts and emit events about it. Call it a few times a second.
 *  @param status  out, one line for systemd @return the state */
enum sst_service_phase sst_service_tick(struct sst_service *s, char status[512]);

/** True if within the last `ns` frames arrived or their absence has a known reason: the watchdog may be fed. */
bool sst_service_alive(struct sst_service *s, int64_t ns);

/** Read the configuration again and apply it as a whole, or refuse it. @return 0, -EBADMSG ...; logged, and an event */
int sst_service_reload(struct sst_service *s);

/** Address of the web page including its token, to show to users; "" if there is none. */
void sst_service_address(struct sst_service *s, char *out, size_t size);

/** Stop everything in the reverse order, within a second.
 *  @return true: all is freed; false: a part hangs (named in the log), or a background thread still computes: the
 *          process must end by _exit() */
SST_MUST_CHECK bool sst_service_stop(struct sst_service *s);

/** Tables of GET /api/v1/status and /metrics, and of GET /api/v1/cameras. */
extern const struct sst_field sst_service_status_fields[], sst_service_cameras_fields[];

#endif
