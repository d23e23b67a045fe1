/* daemon/publish/rtsp_internal.h - parts of the process that serves RTSP: its link to the service, GStreamer's server,
 * who may look, pipelines, and what RTP can carry. */
#ifndef SST_DAEMON_PUBLISH_RTSP_INTERNAL_H
#define SST_DAEMON_PUBLISH_RTSP_INTERNAL_H

#include "daemon/publish/rtsp.h"
#include "daemon/publish/rtsp_link.h"

#if WITH_RTSP

#include <gst/rtsp-server/rtsp-server.h>
#include <pthread.h>
#include <stdatomic.h>

#define RTSP_SLICE_MS 50 /* whoever waits looks this often whether to stop */

/* --- rtsp_process.c: the service -----------------------------------------------------------------------------------
 */

/** A picture of the service, by name: a reference to an outlet that shows it while somebody has joined.
 *  Thread: any; waits for the service. @return 0, or what sst_api's outlet returns */
SST_MUST_CHECK int rtsp_find(enum sst_api_picture kind, const char *name, struct sst_outlet **out);
/** Somebody sent a wrong password. */
void rtsp_say_wrong(const char *address);
/** So many watch; also a sign of life of the server's thread. */
void rtsp_say_clients(int clients);

/* --- rtsp_server.c ------------------------------------------------------------------------------------------------ */

struct rtsp_server {
    /* fixed after open */
    enum sst_rtsp_codec codec;
    GMainContext *context;
    GstRTSPServer *server;
    GstRTSPMountPoints *mounts;
    /* under lock */
    pthread_mutex_t lock;
    GPtrArray *factories; /* struct rtsp_factory, mounted; the mount points hold the references */
};

/** A server for who connects to SST_RTSP_LISTEN_FD. @return 0, -ENOTSUP (an element is missing; logged) */
SST_MUST_CHECK int rtsp_server_open(struct rtsp_server *server, enum sst_rtsp_codec codec,
                                    const struct rtsp_login *login);
/** Serves for ever. */
_Noreturn void rtsp_server_run(struct rtsp_server *server);

/** Reset a connection: one that is merely shut down goes on to be read. Its own thread sees the end and clears up. */
void rtsp_send_away(GstRTSPClient *client);

/* --- rtsp_auth.c -------------------------------------------------------------------------------------------------- */

/** Make clients name the user and the password. */
void rtsp_auth_set(GstRTSPServer *server, const struct rtsp_login *login);

/* --- rtsp_feed.c -------------------------------------------------------------------------------------------------- */

/** Put a picture at the path that a client names, so that it can be described; waits some seconds for one that is
 *  fresh.  Thread: the client's. @return 200, 404, 503 */
GstRTSPStatusCode rtsp_mount(struct rtsp_server *server, const char *path);

/** A viewer comes: what follows begins with a picture that can be decoded alone. */
void rtsp_feed_refresh(GstRTSPMedia *media);
/** Has what this shows ended? */
bool rtsp_feed_is_over(GstRTSPMedia *media);

/* --- rtsp_jpeg.c -------------------------------------------------------------------------------------------------- */

/**
 * Can RTP carry this picture as it is (RFC 2435)?
 * @param why  out, a sentence's part when it cannot
 */
bool rtsp_jpeg_fits(const uint8_t *data, size_t bytes, char *why, size_t room);

#endif
#endif
