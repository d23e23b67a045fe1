/* drivers/grab/grab_internal.h - private declarations of this folder; code outside includes the public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_GRAB_GRAB_INTERNAL_H
#define SST_DRIVERS_GRAB_GRAB_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "base/base.h"
#include "drivers/grab/grab.h"

/* --- identity: which device is which camera. Pure; only for drivers/grab and its tests. --- */

#define SST_WHY_MAX 512

/** A node as found by discovery. */
struct grab_node {
    struct sst_grab_device device;
    int number;  /* of /dev/videoN */
    int capture; /* 1 yes, 0 no (metadata, output), -1 unknown until it is opened */
    bool unfit;  /* tried for its camera, which it does not fit; the other nodes of its device follow */
};

/** Natural order of ports: 1-2.9 before 1-2.10; then the number of the node. For qsort(). */
int grab_node_order(const void *a, const void *b);

/**
 * Find the node of a camera: by serial if the binding has one, else by port. Of several nodes of one device that which
 * the binding numbers is used, else the first; nodes known not to capture are skipped.
 *
 * @param nodes  in the order of grab_node_order()
 * @param why    out [SST_WHY_MAX]: a sentence if the result is -ENOTUNIQ (with both ports), or a mismatch (the serial
 * is at another port than in the binding, the port has another serial); else ""
 * @return index in nodes, -ENODEV (none), -ENOTUNIQ (two devices of one serial)
 */
SST_MUST_CHECK int grab_match(const struct sst_grab_binding *binding, const struct grab_node *nodes, int count,
                              char *why);

/** True for "1-2.3", false for the bus_info of a device that is not on USB. */
bool grab_is_usb_port(const char *port);

/* --- devices: existing video nodes, and hotplug events. Only for drivers/grab. --- */

#define SST_GRAB_NODES_MAX 1024

/**
 * All video nodes in the order of grab_node_order(); nodes on USB are not opened.
 * @param nodes  out, to free with free()
 * @return 0, -ENOMEM or -errno, logged.
 */
SST_MUST_CHECK int grab_scan(struct grab_node **nodes, int *count);

/** List the video nodes by libudev (udev.c) or sysfs (sysfs.c). @param nodes  out [SST_GRAB_NODES_MAX], in any order
 *  @return their number, -ENOMEM or -errno; logged */
SST_MUST_CHECK int grab_list(struct grab_node *nodes);
/** Number of "video12"; -1 for other names. */
int grab_node_number(const char *name);
/** Set the port of a node without one: outside of USB that is its bus_info, and the query does not access hardware that
 * may hang. */
void grab_identify_off_usb(struct grab_node *node);

struct grab_monitor; /* opaque; hotplug events */

/** @return 0, -errno, logged. *out is NULL in a build without libudev: there are no events. */
SST_MUST_CHECK int grab_monitor_open(struct grab_monitor **out);
int grab_monitor_fd(const struct grab_monitor *watch);

/**
 * Get the next event: a node was added (*node is complete), or removed (device.node and number only).
 * @return 1 added, 2 removed, 0 no more events, -ENOBUFS (events were lost: scan again)
 */
SST_MUST_CHECK int grab_monitor_next(struct grab_monitor *watch, struct grab_node *node);
void grab_monitor_close(struct grab_monitor *watch);

/* --- job ---
 * calls that may block (open, stream off, USB reset), each on its own thread. */

struct jobs; /* opaque; start, collect and destroy on one thread */

/** First member of the caller's object, which is on the heap and owned by the job until it is done. */
struct grab_job {
    void (*run)(struct grab_job *job);                /* on its own thread */
    void (*ended)(struct grab_job *job, void *owner); /* by jobs_collect(); frees the job */
    void (*discard)(struct grab_job *job);            /* frees a job that was abandoned */
    struct jobs *jobs;                                /* set by start */
    struct grab_job *next;
};

/** @return 0, -ENOMEM, -EMFILE. */
SST_MUST_CHECK int jobs_create(struct jobs **out);

/** Readable while jobs_collect() has something to do. */
int jobs_fd(const struct jobs *jobs);

/** Run a job. @return 0, or -EAGAIN (no thread; the caller keeps the job). */
SST_MUST_CHECK int jobs_start(struct jobs *jobs, struct grab_job *job);

/** Call `ended` of every job that has run. */
void jobs_collect(struct jobs *jobs, void *owner);

/** Wait until a job has run, at most timeout_ms. */
void jobs_wait(struct jobs *jobs, int timeout_ms);

/** Number of jobs that were started and not yet collected. */
int jobs_running(const struct jobs *jobs);

/** Does not wait: running jobs are discarded when they end, hanging ones stay in the kernel. NULL is fine. */
void jobs_destroy(struct jobs *jobs);

/* --- ladder: the next recovery step for a camera without frames. A pure state machine. --- */

#define SST_LADDER_RETRY_NS        INT64_C(200000000)   /* pause after a rung that failed */
#define SST_LADDER_SETTLE_NS       INT64_C(10000000000) /* a camera that fails again sooner continues on its rung */
#define SST_LADDER_BACK_OFF_NS     INT64_C(1000000000)  /* the first one; each next is twice as long ... */
#define SST_LADDER_BACK_OFF_MAX_NS INT64_C(60000000000) /* ... up to this */

enum ladder_event {
    SST_LADDER_OPENED = 0,  /* started at plug-in or by the user: a frame is due */
    SST_LADDER_FRAME = 1,   /* a frame arrived, good or bad */
    SST_LADDER_FAULT = 2,   /* a frame is overdue, or the stream failed */
    SST_LADDER_DONE = 3,    /* the rung was carried out */
    SST_LADDER_FAILED = 4,  /* the rung, or opening, failed */
    SST_LADDER_REFUSED = 5, /* the camera cannot fulfil the settings: no rung helps */
    SST_LADDER_TIME = 6,    /* due_ns has passed */
    SST_LADDER_LOST = 7,    /* unplugged */
};

enum ladder_phase {
    SST_LADDER_QUIET = 0,   /* frames arrive, or no camera is connected */
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
    int rung;        /* last one tried; -1: none since the last recovery */
    int64_t due_ns;  /* time of the next SST_LADDER_TIME; 0: none */
    int64_t well_ns; /* since when frames arrive */
    int64_t back_off_ns;
};

void ladder_init(struct ladder *ladder, int64_t patience_ns, bool usb, bool port_power);

/**
 * Handle an event at now_ns.
 *
 * @param streaming  the stream is open, so that restarting it can be tried
 * @return the rung (sst_grab_rung) to carry out now and to answer with DONE, FAILED or REFUSED, or -1: none.
 *         SST_GRAB_BACK_OFF: close the camera and wait; no answer.
 */
int ladder_step(struct ladder *ladder, enum ladder_event event, int64_t now_ns, bool streaming);

/** True if the current rung disconnects the camera on purpose: it is opened again when it is back. */
bool ladder_expects_loss(const struct ladder *ladder);

/* --- stamp: whether a camera's time stamps are of the monotonic clock, as its driver says. A pure state machine. ---
 */

enum stamp_fault {
    STAMP_RIGHT = 0,
    STAMP_AHEAD = 1,    /* later than the arrival */
    STAMP_BEHIND = 2,   /* far earlier than the frame can have been exposed */
    STAMP_REPEATED = 3, /* not after the last believed one */
};

struct stamp_clock {
    bool foreign;     /* verdict: the stamps are of another clock */
    int64_t empty_ns; /* set by the caller: no filled buffer was waiting then, so the next frame ended later; 0:
                         unknown. It makes the bound independent of how busy the machine is. */
    /* the state */
    bool any;
    int64_t last_ns;            /* believed stamp */
    int64_t raw_ns;             /* last stamp, valid with arrival_ns */
    int64_t arrival_ns, gap_ns; /* last arrival, and the time before it; 0: none */
    int row;                    /* consecutive stamps that contradict the verdict ... */
    int64_t since_ns;           /* ... since this arrival */
    int64_t trial_ns;           /* how long stamps must be right to be believed again */
};

/** The stream starts at start_ns (0: unknown): the verdict stays. */
void stamp_begin(struct stamp_clock *clock, int64_t start_ns);

/** Judge the stamp of the next frame, and update the verdict: a single wrong stamp leaves it, wrong ones for 2 s do
 * not.
 *  @return the fault of this stamp, whatever the verdict */
enum stamp_fault stamp_judge(struct stamp_clock *clock, int64_t stamp_ns, int64_t arrival_ns);

/** "its time stamps are 190.0 s ahead". @param wall_ns  CLOCK_REALTIME at the arrival */
void stamp_describe(char *out, size_t size, enum stamp_fault fault, const struct sst_frame *f, int64_t wall_ns);

/* --- stream ---
 * one open camera: negotiated, with buffers mapped and lent out as frames. */

#define SST_STREAM_BUFFERS_MAX 32

/**
 * Opaque. One owner at a time (the polling thread, or a job) makes all calls except release, which any thread may call
 * at any time. Memory stays mapped until the owner has closed it and the last frame is released.
 */
struct grab_stream;

/** Properties of the time stamp of a filled buffer. */
struct stream_stamp {
    bool monotonic;    /* t_ns is from the driver, else the time of arrival */
    bool end_of_frame; /* t_ns was taken at the end of the frame, not at the start of exposure */
    uint32_t field;    /* of the buffer */
};

/**
 * Open, check, set format, rate and controls, map buffers. May block.
 *
 * @param device  in: node; its name and driver are filled in
 * @param why     out [SST_WHY_MAX]: sentence about a failure
 * @param note    out [SST_WHY_MAX]: warning of a working camera; ""
 * @return 0, -ENOTTY (no capture node), -ENODEV (gone), -EINVAL, -EBUSY, -EACCES (all three: refused), -errno
 */
SST_MUST_CHECK int stream_open(struct grab_stream **out, struct sst_grab_device *device,
                               const struct sst_grab_config *cfg, int cam, char *why, char *note);

/** Queue all buffers that are not lent out, and start streaming. May block. @return 0, -ENOSPC (USB bandwidth), -errno;
 * `why` set */
SST_MUST_CHECK int stream_start(struct grab_stream *stream, char *why);

/** From now on released frames are not queued; never blocks. Call it before stop or close. */
void stream_detach(struct grab_stream *stream);

/** Stop streaming; the stream is detached. May block. */
void stream_stop(struct grab_stream *stream);

/** Stop, close, and free as soon as no frame is lent out. May block. NULL is fine. */
void stream_close(struct grab_stream *stream);

int stream_fd(const struct grab_stream *stream);

/** Dequeue a filled buffer: the frame without lost_before and without faults that need its history (FLAGGED is set).
 *  @return 0, -EAGAIN (none now), or the driver's -errno */
SST_MUST_CHECK int stream_dequeue(struct grab_stream *stream, struct sst_frame **frame, struct stream_stamp *stamp);

/** When it was started last, just before STREAMON; CLOCK_MONOTONIC. */
int64_t stream_start_ns(const struct grab_stream *stream);

/** Number of buffers that the camera can fill. */
int stream_queued(struct grab_stream *stream);

/** Since when there were such buffers without interruption, CLOCK_MONOTONIC; 0: there are none. */
int64_t stream_ready_ns(struct grab_stream *stream);

/** Number of frames that the receiver has not released. */
int stream_lent(struct grab_stream *stream);

/** Release a frame, or each part of one.  Thread: any. */
void stream_release(struct sst_frame *frame);

/* --- camera: the state behind sst_grab --- */

/* The last frame, to compare with; reset when the stream starts again. */
struct history {
    bool any;
    uint32_t sequence;
    uint64_t hash;
};

/* A camera in the picture of a device. */
struct grab_part {
    int cam; /* number among the configured cameras; -1: none */
    bool any;
    uint64_t hash; /* of its last picture, if any */
    uint64_t frozen;
    struct sst_grab_device device; /* as the device, with the names of the part */
};

/* A device, which is a camera, or has several. */
struct grab_camera {
    struct sst_grab_binding binding; /* of the device */
    struct grab_part part[SST_GRAB_PARTS_MAX];
    void *cutter; /* state; NULL: not yet needed */
    struct sst_grab_device device; /* last known */
    int number;                    /* of its node; -1: absent */
    char name[2 * SST_GRAB_NAME_MAX];

    enum sst_grab_state state;
    struct ladder ladder;
    struct camera_job *job;     /* works on this camera now and owns its stream, if any */
    struct grab_stream *stream; /* open, and not owned by a job */
    bool armed;                 /* in the epoll set */
    bool running;               /* STREAMON was done */

    /* CLOCK_MONOTONIC; 0: none */
    int64_t job_end_ns; /* the job is abandoned then */
    int64_t open_ns;    /* open then, if it is connected */
    int64_t rearm_ns;   /* back into the epoll set then */
    int64_t heard_ns;   /* last frame, or start */
    int64_t good_ns;    /* last good one, or start */
    int64_t owed_ns;    /* oldest trigger without a frame */
    int64_t down_ns;    /* since when it does not stream */

    struct history history;
    struct stamp_clock clock;
    int bad_row;              /* consecutive frames with bad bytes */
    int misfit_row;           /* consecutive ones that depart from the negotiated form, all in the same way */
    char misfit[SST_WHY_MAX]; /* which */
    char uncut[SST_WHY_MAX];  /* why the last picture cannot be cut into parts, if it has UNFIT; "": another reason */
    bool unfit;               /* refused for that: until a good frame */
    bool wakes;               /* known: epoll reports its frames */
    int eio_row;              /* consecutive failures of DQBUF */
    int eio_well;             /* frames without a failure until the next is logged again */
    struct sst_grab_counters counters;

    /* already logged, so that a persistent fault is logged once */
    char why[SST_WHY_MAX], note[SST_WHY_MAX], odd[SST_WHY_MAX], serial_seen[SST_GRAB_NAME_MAX];
    char remark[SST_WHY_MAX]; /* reported with its state while it streams: "" or a remark on its frames */
    bool logged_starved, logged_stamp, logged_lead, logged_hopeless;
};

struct sst_grab {
    struct sst_grab_config cfg; /* without bindings; cameras, width and height count devices and their pictures */
    int cameras, parts;         /* configured ones; parts of each device */
    int part_width, part_height;
    struct grab_place {
        int device, part;
    } *place; /* [cameras] */
    struct sst_grab_events events;
    int epoll_fd, timer_fd, wake_fd;
    struct jobs *jobs;
    struct grab_monitor *watch;
    bool started, closing;
    int64_t timer_ns; /* setting of timer_fd; 0: nothing is due */
    int64_t judge_ns; /* before this time no camera counts as silent */

    struct grab_node *nodes; /* [SST_GRAB_NODES_MAX], in order */
    int node_count;
    bool scanning;
    unsigned changes; /* of the nodes: a scan that began before one is discarded */
    int64_t scan_ns;  /* time of the next scan; 0: not needed */

    SST_ATOMIC(int64_t) fired_ns; /* sst_grab_expect(), not yet seen by the polling thread */
    struct grab_camera *camera;   /* [cfg.cameras], the devices */
};

#define SST_MS INT64_C(1000000)

/* --- receive.c: frames -------------------------------------------------------------------------------------------- */

/** Dequeue the frames of a camera with a ready descriptor. @param broken  epoll reports an error */
void receive_ready(struct sst_grab *grab, struct grab_camera *cam, bool broken);

/** Reset the history: the stream has started again. */
void receive_begin(struct sst_grab *grab, struct grab_camera *cam);

/** Time of the next check for silence; 0: none. */
int64_t receive_due(const struct sst_grab *grab, const struct grab_camera *cam);

/** Check at the due time: start recovery if the camera is silent and had free buffers. */
void receive_silence(struct sst_grab *grab, struct grab_camera *cam, int64_t now_ns);

/* --- recovery.c: recovery steps of a camera, and their jobs ------------------------------------------------------- */

/** The node of this camera appeared: open it. */
void recovery_found(struct sst_grab *grab, struct grab_camera *cam, const struct grab_node *node);

/** The camera was unplugged. */
void recovery_lost(struct sst_grab *grab, struct grab_camera *cam);

/** The stream failed or is silent; `why` is one sentence. */
void recovery_fault(struct sst_grab *grab, struct grab_camera *cam, const char *why);

/** The camera streams frames that do not fit, which no rung of the ladder mends: close it, and retry with back-off. */
void recovery_refuse(struct sst_grab *grab, struct grab_camera *cam, const char *why);

/** Start a camera that is ready. */
void recovery_start(struct sst_grab *grab, struct grab_camera *cam);

/** Handle time-outs of ladder, job and opening. */
void recovery_time(struct sst_grab *grab, struct grab_camera *cam, int64_t now_ns);
int64_t recovery_due(const struct sst_grab *grab, const struct grab_camera *cam);

/** Add it to the epoll set, and remove it. */
void recovery_arm(struct sst_grab *grab, struct grab_camera *cam);
void recovery_disarm(struct sst_grab *grab, struct grab_camera *cam);

/** Close the camera's stream without waiting. */
void recovery_drop(struct sst_grab *grab, struct grab_camera *cam);

/** Set the remark that the state event reports with STREAMING; logged as a warning, "" withdraws it. */
void camera_remark(struct sst_grab *grab, struct grab_camera *cam, const char *text);

/** Set the state; a change is logged and reported by event, once. */
void camera_set_state(struct sst_grab *grab, struct grab_camera *cam, enum sst_grab_state state, const char *why);

/* --- hotplug.c: assigns nodes to cameras -------------------------------------------------------------------------- */

/** Read all pending hotplug events. */
void hotplug_events(struct sst_grab *grab);

/** Scan the nodes in this call. @return 0 or -errno, logged. */
SST_MUST_CHECK int hotplug_scan(struct sst_grab *grab);

/** Scan again on a thread, periodically while a camera is missing, or after lost events. */
void hotplug_time(struct sst_grab *grab, int64_t now_ns);
int64_t hotplug_due(const struct sst_grab *grab);

/** Find nodes for all cameras without one. @return 0, or -ENOTUNIQ (two devices of one serial; logged) */
int hotplug_assign(struct sst_grab *grab);

/** After a camera was refused with this node: the next node of the same device to try. NULL: none is left, or the
 * binding chooses the node. @param more  out: the device has other nodes */
const struct grab_node *hotplug_sibling(struct sst_grab *grab, const struct grab_camera *cam, bool *more);

/** Mark a node as not capturing, or as gone: it is not assigned again. */
void hotplug_reject(struct sst_grab *grab, int number, bool gone);

/* --- control: V4L2 controls by name. Only for drivers/grab and its tests. --- */

/** "White Balance, Automatic" as in v4l2-ctl: white_balance_automatic. */
void control_name(char *out, size_t size, const char *title);

/**
 * Set controls: switches and menus first (an automatic mode overrides the value), each group in the given order; then
 * read all back.
 *
 * @param why  out [size]: one sentence that names every control with another value; "" if there are none
 */
void controls_apply(int fd, const struct sst_grab_control *control, int count, char *why, size_t size);

/* --- format: negotiates the picture format of a camera --- */

/**
 * Set format, size and rate, and read them back.
 *
 * @param stride  out: bytes of a row, 0 for compressed formats
 * @param why     out [size]: on -EINVAL the refused value and the camera's choices; on 0 "" or a warning (the rate
 *                cannot be set, or differs while frames are triggered)
 * @return 0, -EINVAL (impossible), -EBUSY (another program has it), or the driver's -errno;
 *         `why` may be empty then
 */
SST_MUST_CHECK int format_set(int fd, const struct sst_grab_config *cfg, size_t *stride, char *why, size_t size);

/** True for whole (progressive) pictures; `field` of a format or buffer. */
bool field_fits(uint32_t field);

/** "interlaced" */
const char *field_name(uint32_t field);

/** True if pictures of this format are of the wanted one: JPEG is another name of MJPG. */
bool format_fits(uint32_t fourcc, uint32_t wanted);

/** Gather the formats of a camera: `formats` and `fourcc`. */
void format_summary(int fd, struct sst_grab_device *device);

/* --- node: one open video node: system calls that are retried, and the driver's identity --- */

/** ioctl() repeated when interrupted. @return 0 or -errno */
int node_ioctl(int fd, unsigned long request, void *arg);

/** Buffer type of an open capture node: VIDEO_CAPTURE, or VIDEO_CAPTURE_MPLANE if it has only that API. */
uint32_t node_type(int fd);

/**
 * Open a node without blocking, check that it captures by streaming, and complete the device's name, driver and port.
 * @return descriptor, or -errno; -ENOTTY: it is no capture node, `left_out` names its kind; -ENODEV also if it is a
 * different device now
 */
SST_MUST_CHECK int node_open(struct sst_grab_device *device);

/* --- check: faults in the bytes of a frame --- */

/** Bits of sst_frame_fault that follow from the bytes alone: JPEG marker structure, or size of a raw frame.
 *  @param lead  of its first bytes to leave out @param size  out: width and height of a JPEG with UNFIT beside MARKER
 */
unsigned frame_check(const struct sst_frame *f, size_t lead, int size[2]);

/** Number of bytes before the start marker of a JPEG, 0 if it is not near the beginning. */
size_t frame_lead(uint32_t fourcc, const uint8_t *data, size_t bytes);

/* --- raw: sizes of uncompressed V4L2 formats, and format names --- */

/** Minimum size of a whole frame in bytes, 0 for unknown formats. @param stride  bytes of a luma row; 0: packed */
size_t raw_bytes(uint32_t fourcc, int width, int height, size_t stride);

/** Bytes of a pixel of a format of one plane and whole bytes; 0: another one. */
size_t raw_pixel_bytes(uint32_t fourcc);

/** Four characters as in v4l2-ctl; unprintable ones become dots. */
void fourcc_name(char out[5], uint32_t fourcc);

/* --- text: builds messages piece by piece --- */

/** Append to a string in a buffer of `size`, truncated to fit. */

#endif
