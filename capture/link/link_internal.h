/* capture/link/link_internal.h - private declarations of this folder: messages, connections, sets on both sides. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_LINK_LINK_INTERNAL_H
#define SST_CAPTURE_LINK_LINK_INTERNAL_H

#include <jansson.h>
#include <pthread.h>
#include <stdbool.h>

#include "base/log_limit.h"
#include "capture/array/frame_sync.h"
#include "capture/array/ring.h"
#include "capture/link/link.h"
#include "capture/link/numbering.h"
#include "capture/link/pieces.h"

/* --- messages ---
 * Each is a type and a length, 4 bytes each, and that number of bytes. All numbers are little-endian.
 * - HELLO, node to head, JSON: version, run, opening, seq (of the last set it has sent), rate_hz, width, height,
 * format,
 *   cameras: [[row, col, serial, port, name], ...]
 * - WELCOME, head to node, JSON: refused: "" or why; seq: the last set of the run that it has decided, 0: none; missed:
 *   bit i is set if set seq - i was missed; session: number that its datagrams must bear, "": it takes none
 * - STATE, node to head, JSON, twice a second: states of cameras, counters, clock; the head reports it as it is
 * - SET, node to head: struct wire_set, cameras times struct wire_frame, then the bytes of the frames sent
 * - ACK, head to node, for each set, in their order, and after each STATE: the seq of the last set, its outcome (enum
 *   wire_outcome), the number of its useful datagrams
 *
 * A set also goes by datagrams (pieces.h), with the bytes of SET. Then:
 * - OFFER, node to head, after its last datagram: seq, bytes, parity (8, 4, 4)
 * - WANT, head to node, when no more comes: seq and the missing pieces, 2 bytes each; none: all
 * - REPAIR, node to head: the fields of OFFER, then for each piece its index (8) and bytes; none: the node no longer
 * has
 *   it
 */

#define LINK_VERSION 2

enum message_type {
    MESSAGE_HELLO = 1,
    MESSAGE_WELCOME = 2,
    MESSAGE_STATE = 3,
    MESSAGE_SET = 4,
    MESSAGE_ACK = 5,
    MESSAGE_OFFER = 6,
    MESSAGE_WANT = 7,
    MESSAGE_REPAIR = 8,
};

#define MESSAGE_HEAD      8
#define MESSAGE_TEXT_MAX  (1 << 18) /* of JSON */
#define FRAME_BYTES_EXTRA 65536     /* more than its pixels, for the headers of a picture */

enum wire_kind {
    WIRE_MISSING = 0,
    WIRE_FRAME = 1,
    WIRE_UNCHANGED = 2, /* equals the frame of the set `since` */
};

enum wire_outcome {
    WIRE_RECEIVED = 0,
    WIRE_MISSED = 1, /* incomplete when its time was over */
};

#define WIRE_COUNT_MAX   (INT64_MAX / 8)
#define WIRE_T_MAX_NS    (INT64_MAX / 8) /* since the node's start: 36 years */
#define WIRE_WALL_MAX_NS (INT64_MAX / 2)
#define WIRE_AWAY_MAX_NS INT64_C(3600000000000) /* of a frame from its set */

#define WIRE_SET_BYTES   40
#define WIRE_FRAME_BYTES 40
#define WIRE_ACK_BYTES   16
#define WIRE_OFFER_BYTES 16
#define WIRE_INDEX_BYTES 8 /* before each piece of a repair */

struct wire_set {
    uint64_t seq, count; /* number of the set on this run; edges counted since the opening */
    int64_t t_ns, wall_ns;
    bool edge;
    int cameras;
    const uint8_t *data; /* of the frames of a set that was read; borrowed */
};

struct wire_frame {
    enum wire_kind kind;
    uint32_t bytes, stride, sequence, lost_before, faults;
    int64_t from_set_ns; /* start of exposure less planned delay, less the set's time */
    uint64_t since;      /* of an unchanged one: number of the set in which its bytes were sent */
};

void wire_put_set(uint8_t *out, const struct wire_set *set);
void wire_put_frame(uint8_t *out, const struct wire_frame *frame);
void wire_put_u64(uint8_t *out, uint64_t value);
uint64_t wire_get_u64(const uint8_t *in);

/** Check a message of type SET: sums and differences of its times and numbers do not overflow.
 *  @param frame_most  bytes of the longest frame, link_frame_most() @param set  in: cameras; out: all
 *  @param frame  out, [cameras]
 *  @return 0, -EBADMSG (it is no such message) */
SST_MUST_CHECK int wire_get_set(const uint8_t *in, size_t bytes, size_t frame_most, struct wire_set *set,
                                struct wire_frame *frame);

/* --- connections: TLS 1.3 and DTLS 1.2 with certificates on both sides, never blocking. --- */

struct link_credentials; /* opaque; read once */

/** @return 0, -EINVAL, -ENOENT ..., -ENOSYS (built without GnuTLS); logged */
SST_MUST_CHECK int link_credentials_create(struct link_credentials **out, const struct sst_array_config *array);
/** NULL is fine. */
void link_credentials_destroy(struct link_credentials *credentials);

struct gnutls_session_int; /* GnuTLS's own */

/** A session that is to shake hands. @return 0, -ENOMEM */
SST_MUST_CHECK int link_session_create(struct gnutls_session_int **out, struct link_credentials *credentials,
                                       bool server, bool datagrams);
/** The other side's certificate is signed by the authority and in its time; the caller judges its name.
 *  @param name  out, its common name @return 0, -EACCES with why */
SST_MUST_CHECK int link_session_verify(struct gnutls_session_int *session, char name[64], char why[256]);
/** @param n  result of a function of GnuTLS @return 0: it waits for the socket, or it was a warning; else the error
 * that ends the connection, with why */
SST_MUST_CHECK int link_session_judge(long n, char why[256]);

struct link_tls; /* private to stream.c */

/** Zeroed with fd -1: closed. One thread. */
struct link_stream {
    int fd;
    struct link_tls *tls;
    bool ready; /* the other side has shown its certificate */
    bool server;
    char peer[64]; /* common name of the other side */
    uint8_t *in, *out;
    size_t in_bytes, in_room, out_at, out_bytes, out_room, most; /* most: longest message */
    size_t taken;                                                /* of `in`: the message that was returned last */
    uint64_t received_bytes, sent_bytes;
};

/** Take over a socket. @param most  bytes of the longest message @return 0, -ENOMEM */
SST_MUST_CHECK int link_stream_open(struct link_stream *s, int fd, struct link_credentials *credentials, bool server,
                                    size_t most);
/** Shake hands, send and receive as far as possible now. @param why  out on failure, one clause @return 0, -errno */
SST_MUST_CHECK int link_stream_work(struct link_stream *s, char why[256]);
/** Next message, valid until the next call. @return 1, 0 (none yet), -EBADMSG (too long) */
SST_MUST_CHECK int link_stream_next(struct link_stream *s, enum message_type *type, const uint8_t **data,
                                    size_t *bytes);
/** Append a message. @return where its bytes go; NULL: no memory */
uint8_t *link_stream_add(struct link_stream *s, enum message_type type, size_t bytes);
/** @return 0, -ENOMEM; `message` is freed */
SST_MUST_CHECK int link_stream_add_json(struct link_stream *s, enum message_type type, json_t *message);
/** Bytes that wait to be sent. */
size_t link_stream_waiting(const struct link_stream *s);
/** The other side has begun to shake hands: a whole ClientHello has come. */
bool link_stream_greeted(const struct link_stream *s);
/** POLLIN, and POLLOUT where something waits. */
short link_stream_events(const struct link_stream *s);
void link_stream_close(struct link_stream *s);

/** Settings of a connected socket: small delays, a bounded buffer, an end where the other side is gone. */
void link_socket_prepare(int fd);

/** Numeric address and port. @return 0, -EINVAL */
struct sockaddr_storage;
SST_MUST_CHECK int link_address(const char *address, int port, struct sockaddr_storage *out, unsigned *bytes);
/** The inverse, without the port. */
void link_address_text(const struct sockaddr_storage *address, char out[64]);
/** Whoever connects has many ports, and of IPv6 a whole network. */
bool link_same_network(const struct sockaddr_storage *a, const struct sockaddr_storage *b);

/** Bytes of the longest frame of a size, and of the longest message of an array of such frames. */
size_t link_frame_most(int width, int height);
size_t link_message_most(int cameras, int width, int height);

/* --- datagrams: a client of a node, a server of the head --- */

struct link_dtls; /* opaque */

/** Begin to connect to a UDP port. @return 0, -EINVAL, -ENOSYS (built without), -errno */
SST_MUST_CHECK int link_dtls_open(struct link_dtls **out, const char *address, int port,
                                  struct link_credentials *credentials);
/** Shake hands, resend flights that are due. Call it when its descriptor is readable, and every 50 ms until it is
 * ready.
 *  @return 0, -errno with why: close it */
SST_MUST_CHECK int link_dtls_work(struct link_dtls *d, char why[256]);
bool link_dtls_ready(const struct link_dtls *d); /**< NULL: false */
/** Common name of the head's certificate, when ready. */
const char *link_dtls_peer(const struct link_dtls *d);
int link_dtls_fd(const struct link_dtls *d);
/** @return 0, -EAGAIN (the socket is full), -ECONNRESET */
SST_MUST_CHECK int link_dtls_send(struct link_dtls *d, const uint8_t *data, size_t bytes);
/** NULL is fine. */
void link_dtls_close(struct link_dtls *d);

struct link_dtls_server; /* opaque */

struct link_dtls_events {
    void *arg;
    bool (*known)(void *arg, const char *name); /* is a host with that certificate connected, over TLS? */
    void (*datagram)(void *arg, const char *name, const uint8_t *data, size_t bytes);
};

/** @return 0, -EADDRINUSE, -EINVAL, -ENOSYS (built without) ... */
SST_MUST_CHECK int link_dtls_listen(struct link_dtls_server **out, const char *address, int port,
                                    struct link_credentials *credentials, const struct link_dtls_events *events);
int link_dtls_server_fd(const struct link_dtls_server *s);
/** Datagrams that the kernel had no room for. */
uint64_t link_dtls_server_overflows(const struct link_dtls_server *s);
/** Receive the datagrams that wait, at most as many as one call takes. @return true: call it again within 50 ms, a
 * handshake is in progress */
bool link_dtls_server_work(struct link_dtls_server *s);
/** NULL is fine. */
void link_dtls_server_close(struct link_dtls_server *s);

/* --- sets of a node on their way to the head's numbering; one thread --- */

#define LINK_INBOX_SETS 32                 /* at once; a node has fewer on their way */
#define LINK_QUIET_NS   INT64_C(50000000)  /* pieces are asked for when all were sent, and none comes in this time, */
#define LINK_SILENT_NS  INT64_C(200000000) /* ... or it is not known whether they were sent */

struct link_inbox; /* opaque */

struct link_inbox_set {
    uint64_t seq;
    uint32_t datagrams;  /* of use */
    const uint8_t *data; /* as of MESSAGE_SET, valid until more is received; NULL: it was missed */
    size_t bytes;
};

struct link_inbox_counters {
    uint64_t datagrams; /* received, among them: */
    uint64_t spare;     /* ... enough had come, or it came twice */
    uint64_t refused;   /* ... no piece, of another connection, or of no set that can be on its way */
    uint64_t asked;     /* sets of which pieces were asked for */
    uint64_t repaired;  /* pieces that came over TLS */
};

/** @param session  number that its datagrams must bear @param next  number of the first set @param most  bytes of a set
 *  @param deadline_ns  after which one that is incomplete is missed @return 0, -ENOMEM */
SST_MUST_CHECK int link_inbox_create(struct link_inbox **out, uint64_t session, uint64_t next, size_t most,
                                     int64_t deadline_ns);
/** NULL is fine. */
void link_inbox_destroy(struct link_inbox *in);
/** A datagram. @return 0, -EBADMSG (refused, counted), -ENOMEM */
SST_MUST_CHECK int link_inbox_datagram(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns);
/** Messages OFFER, REPAIR and SET. @return 0, -EBADMSG, -ENOMEM */
SST_MUST_CHECK int link_inbox_offer(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns);
SST_MUST_CHECK int link_inbox_repair(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns);
SST_MUST_CHECK int link_inbox_whole(struct link_inbox *in, const uint8_t *data, size_t bytes, int64_t now_ns);
/** The next set, in their order, that is complete or missed. @return false: none yet */
bool link_inbox_next(struct link_inbox *in, int64_t now_ns, struct link_inbox_set *out);
/** A set with pieces to ask for, once. @param index  out, [SST_PIECES_DATA_MAX], n are set; 0: all */
bool link_inbox_ask(struct link_inbox *in, int64_t now_ns, uint64_t *seq, uint16_t *index, int *n);
/** Something is incomplete: time decides. */
bool link_inbox_waits(const struct link_inbox *in);
void link_inbox_count(const struct link_inbox *in, struct link_inbox_counters *out);

/* --- node --- */

#define NODE_QUEUE_MAX  256
#define NODE_FLIGHT     8  /* sets that were sent over TLS and not confirmed: more would be too old to be dropped */
#define NODE_FLIGHT_MAX 16 /* ... by datagrams: they are there before their confirmation is back */

struct node_queued {
    uint64_t number; /* in the ring */
    unsigned opening;
    int frames;
};

struct node_flight {
    uint64_t seq;
    int frames, unchanged;
    int64_t sent_ns;
    int pieces; /* its place in `pieces`; -1: it went over TLS */
};

/** Bytes of a set that went by datagrams, until it is confirmed. */
struct node_pieces {
    bool used;
    struct sst_pieces_shape shape;
    struct sst_mem_kept kept;
    uint8_t *data; /* in it */
};

enum node_phase {
    NODE_OFF = 0, /* not connected, until retry_ns */
    NODE_CONNECTING = 1,
    NODE_SHAKING = 2,
    NODE_GREETING = 3, /* HELLO is sent */
    NODE_UP = 4,
};

struct sst_link_node {
    /* fixed after open */
    struct sst_array_config array;
    struct link_credentials *credentials;
    struct sst_ring *ring;
    void *arg;
    void (*event)(void *arg, const char *node, bool connected, const char *why);
    int wake_fd;
    uint64_t run;
    pthread_t thread;
    bool threaded;
    /* link thread */
    struct link_stream stream;
    enum node_phase phase;
    int64_t retry_ns, until_ns, told_ns;
    bool reported; /* an event has been sent */
    unsigned opening_sent;
    uint64_t counted_bytes;       /* of the stream */
    struct sst_array_config sent; /* the array as the head knows it */
    uint64_t seq;
    struct sst_unchanged *unchanged;          /* last bytes sent of each camera; NULL: all is sent */
    bool renew;                               /* ... is to begin again */
    uint64_t since[SST_CAMERAS_MAX];          /* ... in which set */
    struct wire_frame frame[SST_CAMERAS_MAX]; /* of the set that is being written */
    char reason[256];
    struct {                            /* datagrams */
        struct link_dtls *dtls;         /* NULL: not connected, until retry_ns */
        struct sst_pieces_coder *coder; /* NULL: built without */
        uint64_t session;               /* of the connection; 0: the head takes none */
        int64_t first_ns, retry_ns, pause_ns;
        int dry;     /* sets, one after another, of which nothing arrived */
        int sending; /* place in `pieces` of the set that is being sent; -1: none */
        uint64_t seq;
        int next, each_ms; /* of its pieces */
        int64_t began_ns;
        struct node_pieces pieces[NODE_FLIGHT_MAX];
    } by;
    /* under lock */
    pthread_mutex_t lock;
    bool stop, changed;
    unsigned opening; /* 0: the array was never open */
    bool open;
    struct sst_array_config layout;
    struct {
        enum sst_grab_state state;
        char why[128];
        struct sst_grab_device device;
    } camera[SST_CAMERAS_MAX];
    struct node_queued queue[NODE_QUEUE_MAX];
    int first, count;
    struct node_flight flight[NODE_FLIGHT_MAX];
    int flights; /* also of a connection that ended: the head's next welcome says what it had received */
    struct sst_link_node_state state;
    struct sst_capture_report report;
};

/* node_sets.c: from the queue to the head, and where frames end. */
void node_drop_oldest_locked(struct sst_link_node *n);
void node_lose_flights_locked(struct sst_link_node *n);
/** Acknowledgement of sets up to `seq`. @param missed  bit i: seq - i was missed @return time of the last one on its
 * way, ns; 0: none is new */
int64_t node_confirm_locked(struct sst_link_node *n, uint64_t seq, uint64_t missed, int64_t now_ns);
/** Detection of changes begins again: every picture is sent once. */
void node_renew_unchanged(struct sst_link_node *n);
/** Send as much as possible now. @return 0, or the error that ends the connection */
SST_MUST_CHECK int node_send_sets(struct sst_link_node *n);

/* node_datagrams.c: a set's way by datagrams. */
SST_MUST_CHECK int node_datagrams_open(struct sst_link_node *n); /**< once. @return 0, -ENOMEM */
/** A connection began; session 0: the head takes no datagrams. */
void node_datagrams_begin(struct sst_link_node *n, uint64_t session);
void node_datagrams_end(struct sst_link_node *n);   /**< ... ended */
void node_datagrams_close(struct sst_link_node *n); /**< for good */
/** Connect, and send the pieces that are due. @return 0, -ENOMEM */
SST_MUST_CHECK int node_datagrams_work(struct sst_link_node *n, int64_t now_ns);
bool node_datagrams_ready(const struct sst_link_node *n);
bool node_datagrams_busy(const struct sst_link_node *n); /**< a set is being sent */
bool node_datagrams_soon(const struct sst_link_node *n); /**< not ready, but sets should wait for it */
/** Room for a set that is to go by datagrams. @return its place, -1: it is too long, or no memory: over TLS */
int node_datagrams_room(struct sst_link_node *n, size_t bytes);
/** Send the written messages. */
void node_datagrams_send(struct sst_link_node *n, int place, uint64_t seq);
/** Do datagrams arrive? @param arrived  of use, of a set that went by datagrams */
void node_datagrams_judge(struct sst_link_node *n, uint32_t arrived, int64_t now_ns);
/** Answer WANT. @return 0, -EBADMSG, -ENOMEM */
SST_MUST_CHECK int node_datagrams_repair(struct sst_link_node *n, const uint8_t *data, size_t bytes);

/* --- head: sets of nodes become numbered frames --- */

#define LINK_NODES SST_NUMBERING_SOURCES /* nodes, and at last the head itself */
#define LINK_OWN   (LINK_NODES - 1)
#define LINK_SETS  48 /* of one source, on their way */
#define LINK_READY 64 /* of all, named, not yet fetched by capture */

/** A set of one source, with its frames. */
struct head_set {
    int source, cameras, frames, refs; /* under lock; refs 0: free */
    struct sst_numbering_edge edge;
    bool stamped;
    struct sst_numbering_place place;
    struct sst_frame frame[SST_CAMERAS_MAX]; /* bytes NULL: missing */
    int slot[SST_CAMERAS_MAX];               /* view of each of its cameras */
    struct sst_mem_kept kept;
    uint8_t *data; /* in it */
};

struct head_slot {
    int source;                    /* source that the camera belongs to; -1: none */
    enum sst_grab_state state;     /* under lock */
    char why[256];                 /* under lock */
    struct sst_grab_device device; /* under lock */
    bool changed;                  /* under lock: not reported yet */
    /* capture thread */
    enum sst_grab_state shown;
    struct sst_grab_device shown_device;
    struct sst_grab_counters count;
};

/** A node, or the head's own cameras. */
struct head_source {
    bool used;
    int cameras;
    int slot[SST_CAMERAS_MAX];
    struct head_set *set[LINK_SETS]; /* its pool; NULL: not allocated yet */
    struct head_set *waiting[LINK_SETS]; /* received, not named yet, in their order */
    int first, count;
    struct sst_link_peer peer; /* its report */
};

struct link_local; /* private to own.c */

struct sst_link_head {
    /* fixed after open */
    struct sst_array_config array; /* with all views as cameras */
    struct link_credentials *credentials;
    int listen_fd, wake_fd, ready_fd; /* eventfds: of the link's thread, of the capture */
    struct link_dtls_server *dtls;    /* NULL: datagrams are off */
    int64_t period_ns;
    void *arg;
    void (*event)(void *arg, const char *node, bool connected, const char *why);
    pthread_t thread;
    bool threaded;
    /* capture thread */
    struct sst_source_events events;
    bool any; /* a trigger was reported */
    uint64_t last_index;
    int64_t last_ns;
    struct link_local *own; /* NULL: no cameras of its own */
    /* under lock */
    pthread_mutex_t lock;
    bool stop;
    uint64_t overflows; /* datagrams */
    struct sst_numbering *numbering;
    struct head_source source[LINK_NODES];
    struct head_slot slot[SST_CAMERAS_MAX];
    struct head_set *ready[LINK_READY];
    int ready_first, ready_count;
    /* link thread */
    struct link_connection *connection;
    struct sst_log_limit strangers, refusals;
};

/** A set to fill, with the fields `source` and `slot` set. @param missed  of its frames: counted as missed, they do not
 * come @param bytes  room for data @return NULL: all are on their way, or there is no memory; its frames are counted as
 * dropped */
struct head_set *head_set_acquire(struct sst_link_head *h, int source, int frames, int missed, size_t bytes);
/** Pass on a filled set. */
void head_set_pass(struct sst_link_head *h, struct head_set *set);
/** Name waiting sets, where time or other sources have decided. @return false: none waits */
bool head_settle(struct sst_link_head *h, int64_t now_ns);
/** All that waits of a source can no longer be named. */
void head_forget_locked(struct sst_link_head *h, int source);
void head_sets_free(struct sst_link_head *h);
struct head_camera {
    enum sst_grab_state state;
    const char *why;
    const struct sst_grab_device *device; /* NULL: as before */
};

/** Set the state of a source's camera, by its number in the source. */
void head_camera_locked(struct sst_link_head *h, int source, int cam, struct head_camera now);

/** For link_dtls_listen(): of nodes that are connected, to the set that it is a piece of. */
bool head_knows(void *head, const char *name);
void head_datagram(void *head, const char *name, const uint8_t *data, size_t bytes);
/** Receive from nodes until the head stops. */
void *head_serve(void *head);

/** The head's own cameras, captured by a thread of their own. @return 0, -ENOMEM, -EAGAIN */
SST_MUST_CHECK int link_local_open(struct link_local **out, struct sst_link_head *head,
                                   const struct sst_array_config *array);
void link_local_close(struct link_local *local);

#endif
