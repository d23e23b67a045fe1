/* Pictures: snapshots, and endless streams.
 *
 * A stream runs on the thread of its connection: it waits for the JPEG slot and writes the shared picture to the socket
 * in pieces. A slow client holds one picture and delays no other; the pictures that it misses are counted. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <errno.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"

#define BOUNDARY    "sst-picture"
#define PIECE_BYTES 65536
#define UNSENT_MAX  131072       /* bytes that the kernel buffers for a slow client */
#define REPEAT_NS   5000000000LL /* a still picture is shown again, as a sign of life */
#define FRESH_NS    1000000000LL /* a picture is worth waiting that long for a newer one */
#define FIRST_NS    5000000000LL /* ... and that long for the first */
#define SILENCE     2            /* idle times after which a client that reads nothing is disconnected */

struct stream {
    struct sst_http *http;
    struct sst_slot *slot;
    const struct sst_jpeg *jpeg; /* being sent */
    struct MHD_Connection *connection;
    int fd, silence_s;
    char session[HTTP_SESSION_NAME + 1]; /* "": none */
    char head[256];
    size_t head_bytes, at; /* of head, picture, tail: bytes handed over */
    uint64_t number;       /* of the last picture; 0: none */
    int64_t due_ns, sent_ns, period_ns;
};

/* The next part's boundary goes out with this part: browsers show a part when its end is certain. */
static const char first_boundary[] = "--" BOUNDARY "\r\n";
static const char tail[] = "\r\n--" BOUNDARY "\r\n";

/* Pictures that were shown while the last one was on its way are lost for this viewer. @return the newest, if there is
 * one since */
static const struct sst_jpeg *count_skipped(struct stream *s)
{
    const struct sst_jpeg *newest = sst_slot_get(s->slot, s->number);

    if (newest && s->number)
        atomic_fetch_add(&s->http->count->skipped, newest->number - s->number - 1);
    return newest;
}

static void pause_until(struct stream *s, int64_t due_ns)
{
    struct timespec t;
    int64_t left_ns;

    while ((left_ns = due_ns - sst_clock_now_ns()) > 0 && !atomic_load(&s->http->stopping)) {
        left_ns = left_ns < HTTP_WAIT_MS * 1000000LL ? left_ns : HTTP_WAIT_MS * 1000000LL;
        t = (struct timespec){ .tv_nsec = (long)left_ns };
        nanosleep(&t, NULL);
    }
}

/* Wait for the next picture to send: a newer one, or the same again after a while. */
static bool next_picture(struct stream *s)
{
    int64_t now_ns;

    s->jpeg = count_skipped(s);
    if (s->period_ns) {
        sst_slot_jpeg_unref(s->jpeg);
        s->jpeg = NULL; /* by then there may be a newer one */
        pause_until(s, s->due_ns);
    }
    for (;;) {
        if (atomic_load(&s->http->stopping) || sst_slot_is_shut(s->slot) || http_peer_gone(s->fd) ||
            !http_session_lasts(&s->http->auth.sessions, s->session))
            return false;
        now_ns = sst_clock_now_ns();
        if (!s->jpeg) /* else the one up to which missed ones are counted */
            s->jpeg = sst_slot_get(s->slot, s->number && now_ns - s->sent_ns > REPEAT_NS ? 0 : s->number);
        if (s->jpeg)
            break;
        sst_slot_wait(s->slot, s->number, HTTP_WAIT_MS);
    }
    http_awake(s->connection, s->silence_s);
    /* Steps of one period, so that jitter of the source does not add up. */
    s->due_ns = s->due_ns + s->period_ns < now_ns - s->period_ns ? now_ns : s->due_ns + s->period_ns;
    s->sent_ns = now_ns;
    s->head_bytes =
        (size_t)snprintf(s->head, sizeof(s->head),
                         "%sContent-Type: image/jpeg\r\nContent-Length: %zu\r\n"
                         "X-Timestamp: %lld.%06lld\r\nX-Sst-Set: %llu\r\n\r\n",
                         s->number ? "" : first_boundary, s->jpeg->bytes, (long long)(s->jpeg->wall_ns / 1000000000),
                         (long long)(s->jpeg->wall_ns % 1000000000 / 1000), (unsigned long long)s->jpeg->set);
    s->number = s->jpeg->number;
    s->at = 0;
    return true;
}

static ssize_t stream_read(void *arg, uint64_t pos SST_UNUSED, char *buf, size_t max)
{
    struct stream *s = arg;
    size_t n = 0, end = 0;

    if (!s->jpeg && !next_picture(s))
        return MHD_CONTENT_READER_END_OF_STREAM;
    const struct {
        const void *data;
        size_t bytes;
    } part[] = { { s->head, s->head_bytes }, { s->jpeg->data, s->jpeg->bytes }, { tail, sizeof(tail) - 1 } };

    for (size_t i = 0; i < ARRAY_LEN(part); i++) {
        const size_t from = s->at + n - end;

        if (s->at + n >= end && from < part[i].bytes) { /* as much as fits */
            const size_t left = part[i].bytes - from, take = left < max - n ? left : max - n;

            memcpy(buf + n, (const char *)part[i].data + from, take);
            n += take;
        }
        end += part[i].bytes;
    }
    s->at += n;
    if (s->at == end) {
        sst_slot_jpeg_unref(s->jpeg);
        s->jpeg = NULL;
    }
    atomic_fetch_add(&s->http->count->bytes, n);
    return (ssize_t)n;
}

static void stream_free(void *arg)
{
    struct stream *s = arg;

    sst_slot_jpeg_unref(s->jpeg);
    sst_slot_leave(s->slot);
    sst_slot_unref(s->slot);
    atomic_fetch_sub(&s->http->count->streams, 1);
    free(s);
}

static const char *const kinds[] = { "view", "camera", "labels", "disparity" };

int http_find_slot(struct http_request *q, enum sst_api_picture kind, const char *name, struct sst_slot **out,
                   struct sst_api_answer *answer)
{
    const int err = q->http->cfg.api->slot(q->live, kind, name, out);

    if (err == -ENOENT)
        snprintf(answer->error, sizeof(answer->error), "there is no %s %s; GET /api/v1/%s lists them", kinds[kind],
                 name, kind == SST_PICTURE_CAMERA ? "cameras" : "views");
    return err;
}

/* @return -1: found; else answered */
static int find_outlet(struct http_request *q, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    struct sst_api_answer answer = { 0 };
    const int err = http_find_slot(q, kind, name, out, &answer);

    return err ? http_reply_answer(q, err, &answer, kinds[kind]) : -1;
}

/* The limits of web: are not for programs beside the service, such as sst-rtsp. */
bool http_stream_begin(struct http_request *q)
{
    if (atomic_fetch_add(&q->http->count->streams, 1) < q->http->cfg.streams || q->local)
        return true;
    atomic_fetch_sub(&q->http->count->streams, 1);
    atomic_fetch_add(&q->http->count->refused, 1);
    return false;
}

int http_do_stream(struct http_request *q, enum sst_api_picture kind, const char *name)
{
    static const char type[] = "multipart/x-mixed-replace; boundary=" BOUNDARY;
    const int unsent = UNSENT_MAX;
    const bool limited = !q->local;
    struct MHD_Response *response;
    struct sst_slot *slot;
    struct stream *s;
    int done;

    if (!http_stream_begin(q))
        return http_reply_error(q, MHD_HTTP_SERVICE_UNAVAILABLE, HTTP_STREAMS_FULL, q->http->cfg.streams);
    done = find_outlet(q, kind, name, &slot);
    s = done < 0 ? calloc(1, sizeof(*s)) : NULL;
    if (!s) {
        atomic_fetch_sub(&q->http->count->streams, 1);
        if (done < 0)
            sst_slot_unref(slot);
        return done < 0 ? MHD_NO : done;
    }
    s->http = q->http;
    s->slot = slot;
    s->connection = q->connection;
    s->fd = q->fd;
    s->silence_s = q->silence_s = SILENCE * q->http->cfg.idle_s;
    memcpy(s->session, q->session, sizeof(s->session));
    s->period_ns = limited && q->http->cfg.stream_hz > 0 ? (int64_t)(1e9 / q->http->cfg.stream_hz) : 0;
    sst_slot_join(slot);
    response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, PIECE_BYTES, stream_read, s, stream_free);
    if (!response) {
        stream_free(s);
        return MHD_NO;
    }
    /* No chunks: cameras' clients of all ages read until the end of the connection. */
    if (MHD_set_response_options(response, MHD_RF_HTTP_1_0_COMPATIBLE_STRICT, MHD_RO_END) != MHD_YES) {
        MHD_destroy_response(response);
        return MHD_NO;
    }
    if (!q->local) /* refused by no kernel of the last years; without it a slow viewer is merely later */
        (void)!setsockopt(q->fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof(unsent));
    http_set(response, "Content-Type", "%s", type);
    http_set(response, "X-Accel-Buffering", "no");
    return http_reply(q, MHD_HTTP_OK, response);
}

/* The newest picture; one that is old only when no newer one comes soon. */
static const struct sst_jpeg *fresh_picture(struct http_request *q, struct sst_slot *slot)
{
    const int64_t start_ns = sst_clock_now_ns();
    const struct sst_jpeg *jpeg = sst_slot_get(slot, 0);
    int64_t now_ns = start_ns;

    while (!jpeg || now_ns - jpeg->t_ns > FRESH_NS) {
        const uint64_t number = jpeg ? jpeg->number : 0;
        const struct sst_jpeg *newer;

        if (now_ns - start_ns > (jpeg ? FRESH_NS : FIRST_NS) || atomic_load(&q->http->stopping) ||
            sst_slot_is_shut(slot))
            break;
        sst_slot_wait(slot, number, HTTP_WAIT_MS);
        newer = sst_slot_get(slot, number);
        if (newer) {
            sst_slot_jpeg_unref(jpeg);
            jpeg = newer;
            break;
        }
        now_ns = sst_clock_now_ns();
    }
    return jpeg;
}

static void jpeg_free(void *arg)
{
    sst_slot_jpeg_unref(arg);
}

int http_do_snapshot(struct http_request *q, enum sst_api_picture kind, const char *name)
{
    struct MHD_Response *response;
    const struct sst_jpeg *jpeg;
    struct sst_slot *slot;
    const int done = find_outlet(q, kind, name, &slot);
    uint64_t set;
    int64_t wall_ns;

    if (done >= 0)
        return done;
    sst_slot_join(slot);
    jpeg = fresh_picture(q, slot);
    sst_slot_leave(slot);
    sst_slot_unref(slot);
    if (!jpeg)
        return http_reply_error(q, MHD_HTTP_SERVICE_UNAVAILABLE, "there is no picture yet; try again in a moment");
    atomic_fetch_add(&q->http->count->bytes, jpeg->bytes);
    set = jpeg->set;
    wall_ns = jpeg->wall_ns;
    response = MHD_create_response_from_buffer_with_free_callback_cls(jpeg->bytes, (void *)jpeg->data, jpeg_free,
                                                                      (void *)jpeg);
    if (!response) {
        sst_slot_jpeg_unref(jpeg);
        return MHD_NO;
    }
    http_set(response, "Content-Type", "image/jpeg");
    http_set(response, "X-Timestamp", "%lld.%06lld", (long long)(wall_ns / 1000000000),
             (long long)(wall_ns % 1000000000 / 1000));
    http_set(response, "X-Sst-Set", "%llu", (unsigned long long)set);
    return http_reply(q, MHD_HTTP_OK, response);
}
