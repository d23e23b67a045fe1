/* daemon/publish/rtsp_link.h - what the service and its RTSP process tell each other, over a pair of sockets. Both are
 * the same program, so messages are as they lie in memory. */
#ifndef SST_DAEMON_PUBLISH_RTSP_LINK_H
#define SST_DAEMON_PUBLISH_RTSP_LINK_H

#include "base/base.h"

#define SST_RTSP_LINK_FD     0   /* of the process */
#define SST_RTSP_LISTEN_FD   3   /* likewise: listening already */
#define SST_RTSP_PLACES      288 /* pictures that are watched or asked for at a time: all cameras and views */
#define SST_RTSP_NAME        64  /* bytes, with the NUL */
#define SST_RTSP_PASSWORD    129
#define SST_RTSP_PICTURE_MAX (64u << 20) /* bytes */

enum rtsp_word {
    /* to the process */
    SST_RTSP_SETTINGS = 1, /* first: value is the codec; struct rtsp_login follows */
    SST_RTSP_FOUND = 2,    /* place, value: 0 or -errno */
    SST_RTSP_PICTURE = 3,  /* place, set, t_ns, wall_ns; the JPEG follows */
    SST_RTSP_OVER = 4,     /* place: no picture will follow */
    /* to the service */
    SST_RTSP_READY = 16,   /* value: 0, or -errno and the process ends */
    SST_RTSP_FIND = 17,    /* place, value: enum sst_api_picture, name */
    SST_RTSP_WATCH = 18,   /* place, value: somebody watches, or nobody */
    SST_RTSP_FORGET = 19,  /* place: is free again */
    SST_RTSP_CLIENTS = 20, /* value: how many watch; some times a second, also as a sign of life */
    SST_RTSP_WRONG = 21,   /* name: the address that a wrong password came from */
};

struct rtsp_message {
    uint32_t word, bytes; /* bytes: that follow */
    int32_t place, value;
    uint64_t set;
    int64_t t_ns, wall_ns;
    char name[SST_RTSP_NAME];
};

struct rtsp_login {
    char user[256], password[SST_RTSP_PASSWORD]; /* user "": nobody is asked */
};

/** Patience of a socket: what is below looks that often whether to stop. @return 0, -errno */
SST_MUST_CHECK int rtsp_link_init(int fd);

/**
 * Send a message and the message->bytes that follow it.
 * @param stop  descriptor; what can be read there ends the wait for a peer that does not read; -1: none
 * @return 0, -EPIPE and the like, -ETIMEDOUT (the peer has not read for three seconds), -ECANCELED (stop)
 */
SST_MUST_CHECK int rtsp_link_send(int fd, const struct rtsp_message *message, const void *data, int stop);

/** Read exactly `bytes`. @return as above; -EPIPE: the peer is gone */
SST_MUST_CHECK int rtsp_link_read(int fd, void *out, size_t bytes, int stop);

#endif
