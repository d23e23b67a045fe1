/* publishers/rtsp/rtsp_internal.h - parts of sst-rtsp: pictures of the service, GStreamer's server, authentication,
 * pipelines, and JPEG for RTP. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PUBLISHERS_RTSP_RTSP_INTERNAL_H
#define SST_PUBLISHERS_RTSP_RTSP_INTERNAL_H

#include <gst/rtsp-server/rtsp-server.h>
#include <pthread.h>
#include <stdatomic.h>

#include "base/jpeg_slot.h"
#include "config/sstd.h"
#include "publishers/login.h"

#define RTSP_SLICE_MS 50 /* longest wait in one piece: how fast a stop is noticed */
#define RTSP_NAME_MAX 63 /* characters of the name of a view or camera */

/* --- main.c: reports to the service ------------------------------------------------------------------------------- */

/** The number of clients that watch. Thread: any */
void rtsp_report_clients(int clients);

/* --- pictures.c: MJPEG streams of the service --------------------------------------------------------------------- */

enum rtsp_kind {
    RTSP_VIEW = 0,
    RTSP_CAMERA = 1,
};

/** A moving picture; its stream is open from rtsp_picture_get() until some seconds after the last viewer has left. */
struct rtsp_picture {
    struct sst_slot *slot; /* newest frame; shut when the stream has ended */
    atomic_int err;        /* why it ended: -ENOENT, or the error of sst_client_stream() */
    atomic_int refs;
};

struct sst_client_service;
/** @param service  must outlive all pictures */
void rtsp_pictures_init(const struct sst_client_service *service);
/** End all streams, at once or at their next sign of life. @return true: they had ended by then */
bool rtsp_pictures_end(int64_t until_ns);
/** @return a reference; NULL: too many, or no memory */
struct rtsp_picture *rtsp_picture_get(enum rtsp_kind kind, const char *name);
void rtsp_picture_unref(struct rtsp_picture *picture); /* NULL is fine */
/** True while its stream is open. */
bool rtsp_picture_is_open(enum rtsp_kind kind, const char *name);

/* --- server.c ----------------------------------------------------------------------------------------------------- */

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

/** Load the plugins of GStreamer. @return 0, -ENOTSUP (one is missing; logged) */
SST_MUST_CHECK int rtsp_load_plugins(enum sst_rtsp_codec codec);
/** A server on a listening socket, which it owns from then on. @param login  must outlive it @return 0, -EIO; logged */
SST_MUST_CHECK int rtsp_server_open(struct rtsp_server *server, enum sst_rtsp_codec codec,
                                    struct sst_login *login, int fd);
/** Until *stop; then hang up on all clients, and wait for their end until some time later. */
void rtsp_server_run(struct rtsp_server *server, const atomic_bool *stop);

/** Reset a connection: one that is merely shut down continues to be read. Its own thread sees the end and cleans up. */
void rtsp_disconnect(GstRTSPClient *client);
/** The answer to this client's request takes a while: it is not idle meanwhile. */
void rtsp_set_busy(GstRTSPClient *client);

/* --- auth.c ------------------------------------------------------------------------------------------------------- */

/** Require the user and the password of clients. @param login  read; must outlive the server; its password is erased
 *  @return 0, -EIO, -ENOSYS (no random numbers; logged) */
SST_MUST_CHECK int rtsp_set_login(GstRTSPServer *server, struct sst_login *login);

/* --- feed.c ------------------------------------------------------------------------------------------------------- */

/** Mount a picture at the path that a client names, so that it can be described; waits some seconds for a frame.
 *  Thread: the client's. @return 200, 404, 503 */
GstRTSPStatusCode rtsp_mount(struct rtsp_server *server, const char *path);

/** A viewer starts to play: the stream continues with a frame that can be decoded alone. */
void rtsp_feed_refresh(GstRTSPMedia *media);
/** True once the picture of this media has ended. */
bool rtsp_feed_is_over(GstRTSPMedia *media);

/* --- jpeg.c ------------------------------------------------------------------------------------------------------- */

/** Does this JPEG fit RFC 2435? @param why  out, a phrase if it does not */
bool rtsp_jpeg_fits(const uint8_t *data, size_t bytes, char *why, size_t room);

#endif
