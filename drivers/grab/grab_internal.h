/* drivers/grab/grab_internal.h - what the files of this folder share; code outside of it includes the public headers.
 */
#ifndef SST_DRIVERS_GRAB_GRAB_INTERNAL_H
#define SST_DRIVERS_GRAB_GRAB_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "base/base.h"
#include "drivers/grab/grab.h"

/* --- identity: which device is which camera. Pure; only for drivers/grab and its tests. --- */

#define SST_WHY_MAX 512

/** A node and what else discovery knows of it. */
struct grab_node {
    struct sst_grab_device device;
    int number;  /* of /dev/videoN */
    int capture; /* 1 yes, 0 no (metadata, output), -1 not known before it is opened */
};

/** Order of ports and nodes as a person reads them: 1-2.9 before 1-2.10; then the node's number. For qsort(). */
int grab_node_order(const void *a, const void *b);

/**
 * Find the node of a camera: by serial where the binding has one, else by port. Of several nodes of one device the
 * first counts; nodes known not to capture do not.
 *
 * @param nodes  in the order of grab_node_order()
 * @param why    out [SST_WHY_MAX]: a sentence where the result is -ENOTUNIQ (both ports), or where something is odd
 * (the serial sits at another port than the binding's, the port holds another serial); else ""
 * @return index in nodes, -ENODEV (none), -ENOTUNIQ (two devices of that serial)
 */
SST_MUST_CHECK int grab_match(const struct sst_grab_binding *binding, const struct grab_node *nodes, int count,
                              char *why);

/** "1-2.3", and not the bus_info of a device elsewhere. */
bool grab_is_usb_port(const char *port);

/** "camera 3 (serial A1)" or "camera 3 (port 1-2.4)" for messages. */
void grab_camera_name(char *out, size_t size, int cam, const struct sst_grab_binding *binding);

/* --- devices: video nodes that are there, and those that come and go. Only for drivers/grab. --- */

#define SST_GRAB_NODES_MAX 1024

/**
 * All video nodes in the order of grab_node_order(), without opening those on USB.
 * @param nodes  out, to free with free()
 * @return 0, -ENOMEM or what the system says, logged.
 */
SST_MUST_CHECK int grab_scan(struct grab_node **nodes, int *count);

struct grab_monitor; /* opaque; tells of plugs */

/** @return 0, -errno, logged. *out is NULL where plugs are not told of (built without libudev): scan from time to time.
 */
SST_MUST_CHECK int grab_monitor_open(struct grab_monitor **out);
int grab_monitor_fd(const struct grab_monitor *watch);

/**
 * Take one event: a node that was added (all known of it in *node), or removed (device.node and number alone).
 * @return 1 added, 2 removed, 0 nothing more, -ENOBUFS (events were lost: scan again)
 */
SST_MUST_CHECK int grab_monitor_next(struct grab_monitor *watch, struct grab_node *node);
void grab_monitor_close(struct grab_monitor *watch);

/* --- job ---
 * calls that may block (open, stream off, USB reset) on threads of their own. Only for
 * drivers/grab. */

struct jobs; /* opaque; start, collect and destroy on one thread */

/** First member of the caller's object, which is on the heap and belongs to the job until it is done. */
struct grab_job {
    void (*run)(struct grab_job *job);                /* on a thread of its own */
    void (*ended)(struct grab_job *job, void *owner); /* by jobs_collect(); frees the job */
    void (*discard)(struct grab_job *job);            /* frees what a job holds whose end nobody waited for */
    struct jobs *jobs;                                /* set by start */
    struct grab_job *next;
};

/** @return 0, -ENOMEM, -EMFILE. */
SST_MUST_CHECK int jobs_create(struct jobs **out);

/** Readable while jobs_collect() has something to do. */
int jobs_fd(const struct jobs *jobs);

/** Run a job. @return 0, or -EAGAIN (no thread to be had; the job stays the caller's). */
SST_MUST_CHECK int jobs_start(struct jobs *jobs, struct grab_job *job);

/** Call `ended` of every job that has run. */
void jobs_collect(struct jobs *jobs, void *owner);

/** Wait until something is done or timeout_ms is over. */
void jobs_wait(struct jobs *jobs, int timeout_ms);

/** Jobs started whose end was not collected. */
int jobs_running(const struct jobs *jobs);

/** Does not wait: what still runs is discarded when it ends, and what it hangs in is the kernel's. NULL is fine. */
void jobs_destroy(struct jobs *jobs);

/* --- ladder: what to try next on a camera that brings no frames. A pure state machine. --- */

#define SST_LADDER_RETRY_NS        INT64_C(200000000)   /* pause after a rung that could not be carried out */
#define SST_LADDER_SETTLE_NS       INT64_C(10000000000) /* a camera that falters again sooner goes on where it was */
#define SST_LADDER_BACK_OFF_NS     INT64_C(1000000000)  /* the first one; each next is twice as long ... */
#define SST_LADDER_BACK_OFF_MAX_NS INT64_C(60000000000) /* ... up to this */

enum ladder_event {
    SST_LADDER_OPENED = 0,  /* started at plug-in or by the user: a frame is owed */
    SST_LADDER_FRAME = 1,   /* a frame came, good or bad */
    SST_LADDER_FAULT = 2,   /* a frame is overdue, or the stream broke */
    SST_LADDER_DONE = 3,    /* the rung was carried out */
    SST_LADDER_FAILED = 4,  /* it, or opening, could not be carried out */
    SST_LADDER_REFUSED = 5, /* the camera is there and cannot do what is asked: no rung cures that */
    SST_LADDER_TIME = 6,    /* due_ns has come */
    SST_LADDER_LOST = 7,    /* unplugged */
};

enum ladder_phase {
    SST_LADDER_QUIET = 0,   /* frames flow, or no camera is there */
    SST_LADDER_WORKING = 1, /* a rung is being carried out */
    SST_LADDER_WAITING = 2, /* for a frame, until due_ns */
    SST_LADDER_RESTING = 3, /* backing off until due_ns */
};

struct ladder {
    /* fixed after init */
    int64_t patience_ns; /* from a start to its first frame */
    bool usb;            /* the camera has a USB port: reset and authorisation make sense */
    bool port_power;
    /* the state */
    enum ladder_phase phase;
    int rung;        /* last one tried; -1: none since all was well */
    int64_t due_ns;  /* wants SST_LADDER_TIME then; 0: never */
    int64_t well_ns; /* since when frames flow */
    int64_t back_off_ns;
};

void ladder_init(struct ladder *ladder, int64_t patience_ns, bool usb, bool port_power);

/**
 * Take an event at now_ns.
 *
 * @param streaming  the stream is open, so that restarting it can be tried
 * @return the rung (sst_grab_rung) to carry out now and to answer with DONE, FAILED or REFUSED, or -1: nothing.
 *         SST_GRAB_BACK_OFF: close the camera and do nothing; no answer is wanted.
 */
int ladder_step(struct ladder *ladder, enum ladder_event event, int64_t now_ns, bool streaming);

/** Is the camera's going away what a rung is for? Then it is to be opened again when it is back. */
bool ladder_expects_loss(const struct ladder *ladder);

/* --- stream ---
 * one open camera: negotiated, its buffers mapped and lent out as frames. Only for
 * drivers/grab. */

#define SST_STREAM_BUFFERS_MAX 32

/**
 * Opaque. One owner at a time (the polling thread, or the job that works on it) makes all calls but release, which any
 * thread may make at any time. Memory stays mapped until the owner has closed it and the last frame is back.
 */
struct grab_stream;

/** What a filled buffer told besides its frame. */
struct stream_stamp {
    bool monotonic;    /* t_ns is the driver's, else the time of arrival */
    bool end_of_frame; /* t_ns was taken at the end of the frame, not at the start of exposure */
};

/**
 * Open, check, set format, rate and controls, map buffers. May block.
 *
 * @param device  its name and driver are completed
 * @param why     out [SST_WHY_MAX]: the sentence of a failure
 * @param note    out [SST_WHY_MAX]: what is odd although it works; ""
 * @return 0, -ENOTTY (no capture node), -ENODEV (gone), -EINVAL, -EBUSY, -EACCES (all three: refused), -errno
 */
SST_MUST_CHECK int stream_open(struct grab_stream **out, struct sst_grab_device *device,
                               const struct sst_grab_config *cfg, int cam, char *why, char *note);

/** Queue all buffers that are not lent out, and stream. May block. @return 0, -ENOSPC (USB bandwidth), -errno; `why`
 * set */
SST_MUST_CHECK int stream_start(struct grab_stream *stream, char *why);

/** From now frames that are released are kept and not queued; never blocks. To be called before stop or close. */
void stream_detach(struct grab_stream *stream);

/** Stop streaming; the stream is detached. May block. */
void stream_stop(struct grab_stream *stream);

/** Stop, close, and free as soon as no frame is lent out. May block. NULL is fine. */
void stream_close(struct grab_stream *stream);

int stream_fd(const struct grab_stream *stream);

/** Take a filled buffer: all of the frame but lost_before and faults that need its history (FLAGGED is set).
 *  @return 0, -EAGAIN (none now), or the driver's -errno */
SST_MUST_CHECK int stream_dequeue(struct grab_stream *stream, struct sst_frame **frame, struct stream_stamp *stamp);

/** Buffers that the camera can fill. */
int stream_queued(struct grab_stream *stream);

/** Since when there have been such buffers without a break, CLOCK_MONOTONIC; 0: there are none. */
int64_t stream_ready_ns(struct grab_stream *stream);

/** Frames that the receiver has not given back. */
int stream_lent(struct grab_stream *stream);

/** Give a frame back.  Thread: any. */
void stream_release(struct sst_frame *frame);

/* --- camera: the state behind sst_grab, shared by its files. Only for drivers/grab. --- */

/* What frames are compared with; forgotten when the stream starts anew. */
struct history {
    bool any;
    uint32_t sequence;
    int64_t t_ns;
    uint64_t hash;
};

struct grab_camera {
    struct sst_grab_binding binding;
    struct sst_grab_device device; /* last known */
    int number;                    /* of its node; -1: absent */
    char name[2 * SST_GRAB_NAME_MAX];

    enum sst_grab_state state;
    struct ladder ladder;
    struct camera_job *job;     /* works on this camera now; its stream, if any, is the job's meanwhile */
    struct grab_stream *stream; /* open, and not with a job */
    bool armed;                 /* in the epoll set */
    bool running;               /* STREAMON was done */

    /* CLOCK_MONOTONIC; 0: none */
    int64_t job_end_ns; /* the job is given up then */
    int64_t open_ns;    /* open then, if it is there */
    int64_t rearm_ns;   /* back into the epoll set then */
    int64_t heard_ns;   /* last frame, or start */
    int64_t good_ns;    /* last good one, or start */
    int64_t owed_ns;    /* oldest trigger that no frame has followed */
    int64_t down_ns;    /* since when it does not stream */

    struct history history;
    int bad_row;  /* bad frames one after another */
    bool wakes;   /* it is known that epoll is told of its frames */
    int eio_row;  /* failures of DQBUF one after another */
    int eio_well; /* frames without one until it is told again */
    struct sst_grab_counters counters;

    /* told already, so that a fault that stays is told once */
    char why[SST_WHY_MAX], note[SST_WHY_MAX], odd[SST_WHY_MAX], serial_seen[SST_GRAB_NAME_MAX];
    bool logged_starved, logged_stamp, logged_hopeless;
};

struct sst_grab {
    struct sst_grab_config cfg; /* bindings are the cameras' own */
    struct sst_grab_events events;
    int epoll_fd, timer_fd, wake_fd;
    struct jobs *jobs;
    struct grab_monitor *watch;
    bool started, closing;
    int64_t timer_ns; /* what timer_fd is set to; 0: nothing is due */
    int64_t judge_ns; /* no camera is taken for silent before */

    struct grab_node *nodes; /* [SST_GRAB_NODES_MAX], in order */
    int node_count;
    bool scanning;
    unsigned changes, changes_at_scan; /* of the nodes: a scan that one of them overtook is void */
    int64_t scan_ns;                   /* when to scan next; 0: not needed */

    SST_ATOMIC(int64_t) fired_ns; /* sst_grab_expect(), not yet seen by the polling thread */
    struct grab_camera *camera;   /* [cfg.cameras] */
};

#define SST_MS INT64_C(1000000)

/* --- receive_ready.c: frames --------------------------------------------------------------------------------------------- */

/** Serve a camera whose descriptor is ready. @param broken  epoll tells an error */
void receive_ready(struct sst_grab *grab, struct grab_camera *cam, bool broken);

/** Forget the past: the stream starts anew. */
void receive_begin(struct sst_grab *grab, struct grab_camera *cam);

/** When the camera is to be looked at again for silence; 0: never as it is. */
int64_t receive_due(const struct sst_grab *grab, const struct grab_camera *cam);

/** The due time has come: climb the ladder if it is silent and could have spoken. */
void receive_silence(struct sst_grab *grab, struct grab_camera *cam, int64_t now_ns);

/* --- recovery.c: what is done to a camera, and by whom ------------------------------------------------------------ */

/** A node that is this camera's is there: open it. */
void recovery_found(struct sst_grab *grab, struct grab_camera *cam, const struct grab_node *node);

/** It is unplugged. */
void recovery_lost(struct sst_grab *grab, struct grab_camera *cam);

/** Its stream broke or is silent; `why` is one sentence. */
void recovery_fault(struct sst_grab *grab, struct grab_camera *cam, const char *why);

/** Start a camera that is ready. */
void recovery_start(struct sst_grab *grab, struct grab_camera *cam);

/** Ladder, job and opening time-outs. */
void recovery_time(struct sst_grab *grab, struct grab_camera *cam, int64_t now_ns);
int64_t recovery_due(const struct sst_grab *grab, const struct grab_camera *cam);

/** Put it into the epoll set and take it out. */
void recovery_arm(struct sst_grab *grab, struct grab_camera *cam);
void recovery_disarm(struct sst_grab *grab, struct grab_camera *cam);

/** Close the camera's stream without waiting for that. */
void recovery_drop(struct sst_grab *grab, struct grab_camera *cam);

/** Tell a change of state, once: by the log and the caller's event. */
void camera_set_state(struct sst_grab *grab, struct grab_camera *cam, enum sst_grab_state state, const char *why);

/* --- plug.c: which node is which camera --------------------------------------------------------------------------- */

/** Read all there is to read from the watch. */
void hotplug_events(struct sst_grab *grab);

/** Read the list of nodes here and now. @return 0 or -errno, logged. */
SST_MUST_CHECK int hotplug_scan(struct sst_grab *grab);

/** Read it again on a thread, now and then while a camera is missing, or events were lost. */
void hotplug_time(struct sst_grab *grab, int64_t now_ns);
int64_t hotplug_due(const struct sst_grab *grab);

/** Look for the node of every camera that has none. @return 0, or -ENOTUNIQ (two devices of one serial; logged) */
int hotplug_assign(struct sst_grab *grab);

/** The node was found not to capture, or to be gone: do not take it again. */
void hotplug_reject(struct sst_grab *grab, int number, bool gone);

/* --- control: V4L2 controls by name. Only for drivers/grab and its tests. --- */

/** "White Balance, Automatic" as v4l2-ctl writes it: white_balance_automatic. */
void control_name(char *out, size_t size, const char *title);

/**
 * Set controls: switches and menus first (a value under an automatic mode does not take), each group in the given
 * order; then read all back.
 *
 * @param why  out [size]: one sentence that names every control that is not as asked; "" when all are
 */
void controls_apply(int fd, const struct sst_grab_control *control, int count, char *why, size_t size);

/* --- format: what picture a camera is asked for, and what it offers instead. Only for drivers/grab. --- */

/**
 * Set format, size and rate, and read them back.
 *
 * @param stride  out: bytes of a row, 0 for compressed formats
 * @param why     out [size]: on -EINVAL what was refused and what the camera offers; with 0 "" or what is odd (a rate
 *                that the camera does not let choose, or another rate where frames are triggered)
 * @return 0, -EINVAL (it cannot do that), -EBUSY (another program has it), or the driver's -errno
 */
SST_MUST_CHECK int format_set(int fd, const struct sst_grab_config *cfg, size_t *stride, char *why, size_t size);

/** One line of what a camera offers: "MJPG 1920x1080 1280x720, YUYV 640x480". */
void format_summary(int fd, char *out, size_t size);

/* --- node: one open video node: system calls with their repetition, and what the driver says of itself. --- */

/** ioctl() repeated when interrupted. @return 0 or -errno */
int node_ioctl(int fd, unsigned long request, void *arg);

/**
 * Open a node without blocking, check that it captures by streaming, and complete the device's name, driver and port.
 * @return descriptor, or -errno; -ENOTTY: it is no capture node; -ENODEV also when it is another device by now
 */
SST_MUST_CHECK int node_open(struct sst_grab_device *device);

/* --- raw: sizes of uncompressed V4L2 formats, and names of all. Only for drivers/grab. --- */

/** Bytes that a whole frame takes at least, 0 for formats not known here. @param stride  bytes of a luma row; 0: packed
 */
size_t raw_bytes(uint32_t fourcc, int width, int height, size_t stride);

/** Four characters as v4l2-ctl writes them; what is not printable is a dot. */
void fourcc_name(char out[5], uint32_t fourcc);

/** FNV-like hash of whole frames, 32 bytes a step: two frames of equal hash are taken for the same. */
uint64_t frame_hash(const uint8_t *data, size_t bytes);

/* --- text: sentences put together piece by piece. Only for drivers/grab. --- */

/** Append to a string in a buffer of `size`; what does not fit is cut off. */
void text_add(char *text, size_t size, const char *fmt, ...) SST_PRINTF(3, 4);

#endif
