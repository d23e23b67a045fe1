/* capture/link/link_internal.h - what the files of this folder share: messages, connections over TLS, sets on the head.
 */
#ifndef SST_CAPTURE_LINK_LINK_INTERNAL_H
#define SST_CAPTURE_LINK_LINK_INTERNAL_H

#include <jansson.h>
#include <pthread.h>
#include <stdbool.h>

#include "capture/array/frame_sync.h"
#include "capture/array/ring.h"
#include "capture/link/link.h"
#include "capture/link/numbering.h"

/* --- messages ---
 * Each is a type and a length, 4 bytes each, and that number of bytes. All numbers are little-endian.
 *   HELLO    node to head, JSON: version, run, opening, lane, lanes, rate_hz, width, height, format,
 *            cameras: [[row, col, serial, port, name], ...]
 *   WELCOME  head to node, JSON: refused: "" or why; seq: the last set that it received of that run, 0: none
 *   STATE    node to head, JSON, twice a second: states of cameras, counters, clock; the head reports it as it is
 *   SET      node to head: struct wire_set, cameras times struct wire_frame, then the bytes of the frames sent
 *   ACK      head to node, after each SET and STATE: the seq of the last set, 8 bytes
 */

#define LINK_VERSION 1

enum message_type {
    MESSAGE_HELLO = 1,
    MESSAGE_WELCOME = 2,
    MESSAGE_STATE = 3,
    MESSAGE_SET = 4,
    MESSAGE_ACK = 5,
};

#define MESSAGE_HEAD      8
#define MESSAGE_TEXT_MAX  (1 << 18) /* of JSON */
#define FRAME_BYTES_EXTRA 65536     /* more than its pixels, for what is around a picture */

enum wire_kind {
    WIRE_MISSING = 0,
    WIRE_FRAME = 1,
    WIRE_UNCHANGED = 2, /* shows what the last one sent shows */
};

#define WIRE_SET_BYTES   40
#define WIRE_FRAME_BYTES 32

struct wire_set {
    uint64_t seq, count; /* number of the set on this run; edges counted since the opening */
    int64_t t_ns, wall_ns;
    bool edge;
    int cameras;
};

struct wire_frame {
    enum wire_kind kind;
    uint32_t bytes, stride, sequence, lost_before, faults;
    int64_t from_set_ns; /* start of exposure less planned delay, less the set's time */
};

void wire_put_set(uint8_t *out, const struct wire_set *set);
void wire_put_frame(uint8_t *out, const struct wire_frame *frame);
void wire_put_u64(uint8_t *out, uint64_t value);
uint64_t wire_get_u64(const uint8_t *in);

/** Check a message of type SET. @param frame  out, [cameras] @return 0, -EBADMSG (it is no such message) */
SST_MUST_CHECK int wire_get_set(const uint8_t *in, size_t bytes, int cameras, struct wire_set *set,
                                struct wire_frame *frame, const uint8_t **data);

/* --- connections: TLS 1.3 with certificates on both sides, never blocking. --- */

struct link_credentials; /* opaque; read once */

/** @return 0, -EINVAL, -ENOENT ..., -ENOSYS (built without GnuTLS); logged */
SST_MUST_CHECK int link_credentials_create(struct link_credentials **out, const struct sst_array_config *array);
/** NULL is fine. */
void link_credentials_destroy(struct link_credentials *credentials);

struct link_tls; /* private to stream.c */

/** Zeroed with fd -1: closed. One thread. */
struct link_stream {
    int fd;
    struct link_tls *tls;
    bool ready; /* the other side has shown its certificate */
    bool server;
    char peer[64]; /* common name of that */
    uint8_t *in, *out;
    size_t in_bytes, in_room, out_at, out_bytes, out_room, most; /* most: longest message */
    size_t taken;                                                /* of `in`: the message that was returned last */
    uint64_t received_bytes, sent_bytes;
};

/** Take over a socket. @param most  bytes of the longest message @return 0, -ENOMEM */
SST_MUST_CHECK int link_stream_open(struct link_stream *s, int fd, struct link_credentials *credentials, bool server,
                                    size_t most);
/** Shake hands, send and receive what is possible now. @param why  out on failure, one clause @return 0, -errno */
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
/** POLLIN, and POLLOUT where something waits. */
short link_stream_events(const struct link_stream *s);
void link_stream_close(struct link_stream *s);

/** Settings of a connected socket: small delays, a bounded buffer, an end where the other side is gone. */
void link_socket_prepare(int fd);

/** Numeric address and port. @return 0, -EINVAL */
struct sockaddr_storage;
SST_MUST_CHECK int link_address(const char *address, int port, struct sockaddr_storage *out, unsigned *bytes);

/** Bytes of the longest message of an array of that size. */
size_t link_message_most(int cameras, int width, int height);

/* --- lanes: connections of a node, each with its share of the cameras --- */

#define LINK_LANES_MAX 32

struct link_lane; /* private to lane.c */

/** @param number  of 0 .. shares * copies - 1: it has the share number % shares of the cameras */
SST_MUST_CHECK int link_lane_open(struct link_lane **out, struct sst_link_node *node, int number, uint64_t run,
                                  const struct sst_link_node_config *cfg, struct link_credentials *credentials);
/** The verbs of the node, for this lane's cameras. @param cam  number in the node */
void link_lane_cameras(struct link_lane *lane, const struct sst_array_config *layout);
void link_lane_camera(struct link_lane *lane, int cam, enum sst_grab_state state, const char *why,
                      const struct sst_grab_device *device);
void link_lane_set(struct link_lane *lane, uint64_t number, const struct sst_frameset *set);
void link_lane_report(struct link_lane *lane, const struct sst_capture_report *report);
/** @return false: it has no camera, and does not connect */
bool link_lane_state(struct link_lane *lane, struct sst_link_node_state *out);
void link_lane_stop(struct link_lane *lane); /* does not wait */
void link_lane_join(struct link_lane *lane);
void link_lane_close(struct link_lane *lane);

/** A lane's connection began or ended. */
void link_node_changed(struct sst_link_node *node);

/* --- head: sets of nodes become numbered frames --- */

#define LINK_NODES    SST_NUMBERING_SOURCES /* nodes, and at last the head itself */
#define LINK_OWN_NODE (LINK_NODES - 1)
#define LINK_SOURCES  (LINK_OWN_NODE * LINK_LANES_MAX + 1) /* lanes of nodes, and at last the head's own cameras */
#define LINK_OWN      (LINK_SOURCES - 1)
#define LINK_NAMED    64 /* edges of a node that stay named, for its slower lanes */
#define LINK_SETS     48 /* of one source, on their way */
#define LINK_READY    64 /* of all, named, not yet fetched by capture */

/** A set of one source, with its frames. */
struct head_set {
    int source, cameras, frames, refs; /* under lock */
    struct sst_numbering_edge edge;
    bool stamped;
    struct sst_numbering_place place;
    struct sst_frame frame[SST_CAMERAS_MAX]; /* bytes NULL: missing */
    int slot[SST_CAMERAS_MAX];               /* view of each of its cameras */
    uint8_t *data;
    size_t room;
};

struct head_slot {
    int source;                    /* source that the camera belongs to; -1: none */
    enum sst_grab_state state;     /* under lock */
    char why[256];                 /* under lock */
    struct sst_grab_device device; /* under lock */
    bool changed;                  /* under lock: not reported yet */
    /* capture thread */
    bool passed_any; /* a frame of it was passed on: of `passed`, */
    uint64_t passed; /* and of those before it in bit i of `passed_bits`: of passed - i */
    uint64_t passed_bits;
    enum sst_grab_state shown;
    struct sst_grab_device shown_device;
    struct sst_grab_counters count;
};

struct head_source {
    int cameras;
    int slot[SST_CAMERAS_MAX];
    struct head_set *set[LINK_SETS]; /* its pool; NULL: not allocated yet */
    bool busy[LINK_SETS];
    struct head_set *waiting[LINK_SETS]; /* received, not named yet, in their order */
    int first, count;
    struct sst_link_peer peer; /* what is reported of it */
};

/** Lanes of a node tell of the same edges, each at its time. */
struct head_node {
    bool used, connected; /* all its lanes are */
    int lanes;            /* that it has; 0: never connected */
    uint64_t run;         /* of its counting */
    struct {
        uint64_t count;
        int64_t t_ns;
        enum sst_numbering_verdict verdict; /* never HELD */
        struct sst_numbering_place place;
    } named[LINK_NAMED];
    int newest, named_count;
};

/** Node of a source. */
static inline int link_node_of(int source)
{
    return source == LINK_OWN ? LINK_OWN_NODE : source / LINK_LANES_MAX;
}

struct link_local; /* private to own.c */

struct sst_link_head {
    /* fixed after open */
    struct sst_array_config array; /* with all views as cameras */
    struct link_credentials *credentials;
    int listen_fd, wake_fd, ready_fd; /* eventfds: of the link's thread, of the capture */
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
    struct sst_numbering *numbering;
    struct head_node node[LINK_NODES];
    struct head_source source[LINK_SOURCES];
    struct head_slot slot[SST_CAMERAS_MAX];
    struct head_set *ready[LINK_READY];
    int ready_first, ready_count;
    struct link_connection *connection; /* link thread only */
};

/** A set to fill, whose fields `source` and `slot` are set. @param bytes  room for data @return NULL: all are on their
 * way, or there is no memory; its frames are counted as dropped */
struct head_set *head_set_acquire(struct sst_link_head *h, int source, int frames, size_t bytes);
/** Pass on a filled set. */
void head_set_pass(struct sst_link_head *h, struct head_set *set);
/** Name what waits, where time or other sources have decided. @return false: nothing waits */
bool head_settle(struct sst_link_head *h, int64_t now_ns);
/** A node counts from the beginning: what was named of it is forgotten. */
void head_join_locked(struct sst_link_head *h, int node, uint64_t run);
/** All that waits of a source can no longer be named. */
void head_forget_locked(struct sst_link_head *h, int source);
void head_sets_free(struct sst_link_head *h);
/** Set the state of a source's camera, by its number in the source. */
void head_camera_locked(struct sst_link_head *h, int source, int cam, enum sst_grab_state state, const char *why,
                        const struct sst_grab_device *device);

/** Receive from nodes until the head stops. */
void *head_serve(void *head);

/** The head's own cameras, captured by a thread of their own. @return 0, -ENOMEM, -EAGAIN */
SST_MUST_CHECK int link_local_open(struct link_local **out, struct sst_link_head *head,
                                   const struct sst_array_config *array);
void link_local_close(struct link_local *local);

#endif
