/* simulators/devices/server.h - the heart of sst-sim: one thread that serves device files, calls and timers. */
#ifndef SST_SIMULATORS_DEVICES_SERVER_H
#define SST_SIMULATORS_DEVICES_SERVER_H

#include <stdbool.h>

#include "simulators/devices/proto.h"

/* Everything here runs on the one thread that calls sst_sim_server_run(). */
struct sst_sim_server; /* opaque */
struct sst_sim_node;   /* opaque: an entry in /dev */
struct sst_sim_ops;

/* --- timers ------------------------------------------------------------------------------------------------------- */

/** Caller's memory, zeroed before first use. `fire` may set the timer again. */
struct sst_sim_timer {
    void (*fire)(void *arg);
    void *arg;
    int64_t due_ns;
    int slot; /* the server's; 0: not set */
};

/** Fire once at due_ns (CLOCK_MONOTONIC), soon if that is past; a set timer is moved. @return 0 or -ENOMEM. */
SST_MUST_CHECK int sst_sim_timer_set(struct sst_sim_server *s, struct sst_sim_timer *timer, int64_t due_ns);
void sst_sim_timer_stop(struct sst_sim_server *s, struct sst_sim_timer *timer);

/* --- open device files -------------------------------------------------------------------------------------------- */

/** One open file of a program, shared by all its copies of the descriptor. */
struct sst_sim_handle {
    struct sst_sim_server *server;
    const struct sst_sim_ops *ops;
    void *device;   /* what sst_sim_node_add() or sst_sim_handle_create() was given */
    void *state;    /* the device's, per open file */
    int open_flags; /* of open() */
    uint32_t id;
    int fd;      /* the simulator's end: write here what the program shall read */
    bool urgent; /* an out-of-band byte is with the program */
};

/** A call from a program. The device answers by its return value, now or later. */
struct sst_sim_request {
    struct sst_sim_call call;
    struct sst_sim_handle *handle; /* NULL when it went meanwhile */
    uint8_t *data;                 /* [SST_SIM_PAYLOAD_MAX]: payload of the call, then of the answer */
    uint32_t bytes;                /* of the call's payload */
    int fd;                        /* descriptor that came with the call, or -1; the device may take it (and set -1) */
    /* answer */
    uint32_t out_bytes; /* of the payload; for ioctls: the argument, then its areas, laid out as in the call */
    uint32_t drain, out_flags;
    int out_fd;        /* descriptor to pass, or -1 */
    bool out_fd_close; /* ours no longer afterwards */
    uint64_t out_arg;
};

#define SST_SIM_LATER 0x40000000 /* returned by ops: sst_sim_answer() will be called for this request */

/** What a device does; each may be NULL (-ENOTTY, -ENODEV for map, -EINVAL for read and write, -ESPIPE).
 *  Return a negative errno, a result, or SST_SIM_LATER. On a negative result out_bytes is 0 unless set by the device.
 */
struct sst_sim_ops {
    char letter;  /* of the class, in the descriptor's name: v V4L2, g GPIO, u USB, s attribute in /sys, n kernel events
                   */
    bool packets; /* what the program reads keeps its boundaries */
    int (*open)(struct sst_sim_handle *h, struct sst_sim_request *r); /* its answer is the new descriptor */
    void (*close)(struct sst_sim_handle *h);                          /* last copy closed, or sst_sim_handle_drop() */
    int (*ioctl)(struct sst_sim_handle *h, struct sst_sim_request *r);
    int (*map)(struct sst_sim_handle *h, struct sst_sim_request *r);
    int (*read)(struct sst_sim_handle *h, struct sst_sim_request *r);
    int (*write)(struct sst_sim_handle *h, struct sst_sim_request *r);
    int (*seek)(struct sst_sim_handle *h, struct sst_sim_request *r);    /* NULL: -ESPIPE */
    void (*cancel)(struct sst_sim_handle *h, struct sst_sim_request *r); /* forget a request that was to be later */
    void (*ready)(struct sst_sim_handle *h); /* the program took the out-of-band byte: another may be due */
};

/** Answer a request that was to be later. */
void sst_sim_answer(struct sst_sim_server *s, struct sst_sim_request *r, int result);

/** Answer no earlier than at due_ns: return this from an op. @return SST_SIM_LATER or -ENOMEM. */
int sst_sim_answer_at(struct sst_sim_server *s, struct sst_sim_request *r, int result, int64_t due_ns);

/**
 * A further file, as some ioctls make (GPIO lines): put *client_fd into the answer (out_fd, out_fd_close); in the
 * program the class's part of the preload library stores the number where the ioctl wants it.
 * @return 0 or -errno; ops->open is not called.
 */
SST_MUST_CHECK int sst_sim_handle_create(struct sst_sim_server *s, const struct sst_sim_ops *ops, void *device,
                                         struct sst_sim_handle **handle, int *client_fd);

/** Hang up: poll() in the program says POLLERR|POLLHUP, every call -ENODEV. Calls ops->close; pending calls of this
 *  handle are answered -ENODEV. */
void sst_sim_handle_drop(struct sst_sim_handle *h);

/** Programs close without a word, and are answered before that is noticed: drop the file if its last copy is closed.
 *  @return true: it was. */
bool sst_sim_handle_settle(struct sst_sim_handle *h);

/** Make the file readable by one byte more, or give it POLLPRI. A full socket is the program's own fault: -EAGAIN. */
SST_MUST_CHECK int sst_sim_handle_readable(struct sst_sim_handle *h, const void *data, size_t bytes);
void sst_sim_handle_urgent(struct sst_sim_handle *h);

/* --- entries in /dev ---------------------------------------------------------------------------------------------- */

/**
 * Make a device node appear.
 *
 * @param path  "/dev/video0": appears in the session; another absolute path: found by open() in programs only if
 *              their preload library asks for it, with no entry made in the file system
 * @return 0, -EEXIST, -ENOMEM or -errno of the file system.
 */
SST_MUST_CHECK int sst_sim_node_add(struct sst_sim_server *s, struct sst_sim_node **node, const char *path,
                                    unsigned dev_major, unsigned dev_minor, const struct sst_sim_ops *ops,
                                    void *device);

/** The node goes, and all its handles are dropped. NULL is fine. */
void sst_sim_node_remove(struct sst_sim_server *s, struct sst_sim_node *node);

/** A link in the session's /dev: "/dev/v4l/by-id/x" to "../../video0"; target NULL removes it. @return 0 or -errno. */
SST_MUST_CHECK int sst_sim_link(struct sst_sim_server *s, const char *path, const char *target);

/* --- the server --------------------------------------------------------------------------------------------------- */

/** What the session as a whole answers; set by the program. */
struct sst_sim_control {
    void *arg;
    /** SST_SIM_FAULT, FAULTS, STATUS, STOP. */
    int (*call)(void *arg, struct sst_sim_request *r);
};

/** @param dir  session folder, exists, absolute. @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_server_open(struct sst_sim_server **out, const char *dir,
                                       const struct sst_sim_control *control);
/** Drops all handles, removes all nodes. NULL is fine. */
void sst_sim_server_close(struct sst_sim_server *s);

const char *sst_sim_server_dir(const struct sst_sim_server *s);

/** Have fn called when fd is readable; NULL ends that. The caller owns fd. @return 0 or -errno. */
SST_MUST_CHECK int sst_sim_watch(struct sst_sim_server *s, int fd, void (*fn)(void *arg), void *arg);

/** Serve until sst_sim_server_stop(). @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_sim_server_run(struct sst_sim_server *s);
void sst_sim_server_stop(struct sst_sim_server *s);

#endif
