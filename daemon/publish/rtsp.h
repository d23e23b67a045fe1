/* daemon/publish/rtsp.h - the see-through picture, and the cameras, as RTSP streams: what NVRs add as a camera.
 *
 * Clients are served by a process of its own, this same program started again: what clients do to it, or its libraries,
 * ends that process and never the service. It gets pictures and says who is there (rtsp_link.h); when it ends or hangs
 * it is started again, after half a second at first and half a minute at last. The socket that clients connect to stays
 * with the service: who comes in between waits. */
#ifndef SST_DAEMON_PUBLISH_RTSP_H
#define SST_DAEMON_PUBLISH_RTSP_H

#include <stdbool.h>

#include "config/sstd.h"
#include "daemon/publish/api.h"

struct sst_rtsp; /* opaque; a thread and a process of its own */

struct sst_rtsp_config {
    const char *address; /* numeric */
    int port;            /* 0: any that is free */
    enum sst_rtsp_codec codec;
    const char *user, *password_file; /* "": none; the file's first line */
    bool insecure;                    /* an address other than loopback without a password is refused without this */
    const struct sst_api *api;        /* must stay */
};

/** First argument of the process that serves clients: main() calls sst_rtsp_process() then, and nothing else. */
#define SST_RTSP_PROCESS "--rtsp-process"

/** Serve clients until the service is gone. @return exit status */
int sst_rtsp_process(void);

/**
 * Serve rtsp://address:port/main (the main view), /view/ID and /camera/rRcC. Pictures are made only while somebody
 * watches; all viewers of a stream share one encoder.
 * An address that is in use or not there yet is waited for: see sst_rtsp_away().
 * @return 0, -EINVAL, -EACCES (address), -ENOENT/-EBADMSG (password file), -ENOTSUP (built without, or an
 *         element of GStreamer is missing: which package), -EIO (the process does not start), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_rtsp_open(struct sst_rtsp **out, const struct sst_rtsp_config *cfg);

int sst_rtsp_port(const struct sst_rtsp *rtsp);
/** Is the address still waited for? @param why  out, a phrase; as it was if not */
bool sst_rtsp_away(struct sst_rtsp *rtsp, char *why, size_t room);
/** Clients that watch. */
int sst_rtsp_clients(struct sst_rtsp *rtsp);
/** How often the process has ended or hung, and was started again. */
unsigned sst_rtsp_restarts(struct sst_rtsp *rtsp);

/** Begin to end; sst_rtsp_close() waits for it. NULL is fine. */
void sst_rtsp_stop(struct sst_rtsp *rtsp);

/** Ends the process and with it all connections, within half a second. NULL is fine. */
void sst_rtsp_close(struct sst_rtsp *rtsp);

#endif
