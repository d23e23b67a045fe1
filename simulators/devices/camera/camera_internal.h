/* simulators/devices/camera/camera_internal.h - state of one simulated V4L2 camera. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_DEVICES_CAMERA_CAMERA_INTERNAL_H
#define SST_SIMULATORS_DEVICES_CAMERA_CAMERA_INTERNAL_H

#include <linux/videodev2.h>

#include "simulators/devices/devices_internal.h"

#define SST_SIM_CAM_BUFFERS  32 /* as in the kernel's queues */
#define SST_SIM_CAM_CONTROLS 16
#define SST_SIM_CAM_SHOTS    64 /* exposed, not delivered yet */

struct sim_cam;

/* --- controls (controls.c) ---------------------------------------------------------------------------------------- */

struct sim_control_def {
    uint32_t id, type; /* V4L2_CID_, V4L2_CTRL_TYPE_ */
    const char *name;
    int32_t min, max, step, value;
    const char *const *menu; /* [max + 1], NULL entries are not offered */
};

enum sim_control_index { /* controls that the camera itself evaluates */
                         SST_SIM_CONTROL_AUTO_WHITE = 4,
                         SST_SIM_CONTROL_GAIN = 5,
                         SST_SIM_CONTROL_WHITE = 7,
                         SST_SIM_CONTROL_AUTO_EXPOSURE = 9,
                         SST_SIM_CONTROL_EXPOSURE = 10,
                         SST_SIM_CONTROL_TRIGGER = 11,
};

struct sim_open;

/** Handle a control ioctl. @return -ENOTTY: not a control ioctl */
int sim_cam_controls_ioctl(struct sim_cam *cam, struct sim_open *o, struct sim_request *r);
void sim_cam_controls_reset(struct sim_cam *cam);
/** Index of a control, or -1. */
int sim_cam_control_find(uint32_t id);
/** Fill the control part of an event. */
void sim_cam_control_state(const struct sim_cam *cam, int control, uint32_t changes, struct v4l2_event *out);

/* --- events (events.c) -------------------------------------------------------------------------------------------- */

/** Per open file. */
struct sim_open {
    struct sim_cam *cam;
    struct sim_handle *handle;
    uint32_t priority; /* enum v4l2_priority */
    struct v4l2_event_subscription subscribed[SST_SIM_CAM_CONTROLS];
    int subscriptions;
    struct v4l2_event event[SST_SIM_CAM_CONTROLS]; /* one per subscription: a newer event replaces an older one */
    int events;
    uint32_t event_sequence;
    struct sim_request *event_waiter;
    struct sim_open *next;
};

int sim_cam_subscribe(struct sim_open *o, const struct v4l2_event_subscription *s);
int sim_cam_unsubscribe(struct sim_open *o, const struct v4l2_event_subscription *s, struct sim_request *r);
int sim_cam_dequeue_event(struct sim_open *o, struct sim_request *r);
/** Send the event of a changed control; `by` only gets it if it asked for feedback. */
void sim_cam_control_event(struct sim_cam *cam, const struct sim_open *by, int control, uint32_t changes);

/* --- formats (formats.c) ------------------------------------------------------------------------------------------ */

/** Handle a format, size, interval or S_PARM ioctl. @return -ENOTTY: none of them */
int sim_cam_formats_ioctl(struct sim_cam *cam, struct sim_request *r);
void sim_cam_formats_reset(struct sim_cam *cam);

/* --- buffers (queue.c) -------------------------------------------------------------------------------------------- */

enum sim_buffer_state {
    SST_SIM_BUFFER_DEQUEUED = 0,
    SST_SIM_BUFFER_QUEUED = 1,
    SST_SIM_BUFFER_DONE = 2,
};

struct sim_buffer {
    enum sim_buffer_state state;
    bool prepared, mapped, error;
    int memory;    /* memfd */
    uint8_t *data; /* [length] of it, mapped */
    uint32_t length, bytesused, sequence, field;
    int64_t stamp_ns;
    unsigned long userptr;
    uint32_t user_length;
    int dmabuf;            /* the program's DMA buffer, or -1 */
    int32_t dmabuf_number; /* its descriptor number in the program */
};

struct sim_queue {
    struct sim_buffer buffer[SST_SIM_CAM_BUFFERS];
    uint32_t count, memory; /* enum v4l2_memory, 0: none */
    struct sim_open *owner;
    bool streaming;
    uint32_t queued[SST_SIM_CAM_BUFFERS], done[SST_SIM_CAM_BUFFERS]; /* indices, oldest first */
    int queued_count, done_count;
    uint32_t turn;              /* of fault "libcamera": the next buffer to hand out */
    struct sim_request *waiter; /* a blocking DQBUF */
};

/** Type of its buffers. Arguments of the multi-planar API arrive in the layout of the other one, with their type. */
uint32_t sim_cam_type(const struct sim_cam *cam);

/** Handle a buffer or streaming ioctl. @return -ENOTTY: none of them */
int sim_cam_queue_ioctl(struct sim_cam *cam, struct sim_open *o, struct sim_request *r);
int sim_cam_queue_map(struct sim_cam *cam, struct sim_request *r);
/** The buffer for the next frame, or NULL. */
struct sim_buffer *sim_cam_queue_next(struct sim_cam *cam);
/** Mark that buffer as filled. */
void sim_cam_queue_done(struct sim_cam *cam);
void sim_cam_queue_stop(struct sim_cam *cam, struct sim_request *r); /* r: of STREAMOFF, or NULL */
void sim_cam_queue_free(struct sim_cam *cam);

/* --- exposures (exposure.c) --------------------------------------------------------------------------------------- */

/** Faults of a camera: enumerator, name, least and greatest value, help. */
#define SIM_CAM_FAULTS(X)                                                                                              \
    X(UNPLUG, "unplug", 0, 1, "1: away, 0: back, perhaps as another /dev/videoN")                                      \
    X(EIO, "eio", 0, 1, "share of DQBUF calls that fail with EIO; the frame stays for the next call")                  \
    X(ERROR_FLAG, "error_flag", 0, 1, "share of frames with V4L2_BUF_FLAG_ERROR")                                      \
    X(GAP, "gap", 0, 1, "share of frames lost on the way: the sequence shows a gap")                                   \
    X(LATE_MS, "late_ms", 0, 60000, "frames are done this many ms later")                                              \
    X(LATE_P, "late_p", 0, 1, "share of frames that late_ms concerns; 0: all")                                         \
    X(DUPLICATE, "duplicate", 0, 1, "share of frames that come twice, the second stamped 500 us later")                \
    X(FROZEN, "frozen", 0, 1, "1: the same picture for ever, with new stamps")                                         \
    X(TRUNCATED, "truncated", 0, 1, "share of frames that end in the middle")                                          \
    X(CORRUPT_SOI, "corrupt_soi", 0, 1, "share of frames whose first two bytes are wrong")                             \
    X(CORRUPT_EOI, "corrupt_eoi", 0, 1, "share of frames whose last two bytes are wrong")                              \
    X(CORRUPT_MID, "corrupt_mid", 0, 1, "share of frames with 16 bytes of the middle overwritten")                     \
    X(SHORT, "short", 0, 1, "share of frames of 32 bytes")                                                             \
    X(STALL, "stall", 0, 5, "no frames until: 1 restream, 2 reopen, 3 USB reset, 4 re-authorise, 5 power")             \
    X(BUSY, "busy", 0, 1, "1: S_FMT and REQBUFS fail with EBUSY")                                                      \
    X(NOSPACE, "nospace", 0, 1, "1: STREAMON fails with ENOSPC")                                                       \
    X(SEQUENCE_WRAP, "sequence_wrap", 0, 1, "1: the sequence goes on from 2^32 - 8")                                   \
    X(TIME_WRAP, "time_wrap", 0, 1, "1: stamps go on from 2^31 - 2 s and wrap to -2^31 s")                             \
    X(BACKWARDS, "backwards", 0, 1, "share of frames stamped a second too early")                                      \
    X(CLOCK_STEP_US, "clock_step_us", -1e9, 1e9, "added to the stamps")                                                \
    X(SWAP, "swap", -255, 255, "the camera behind this cable is number N + VALUE")                                     \
    X(CONTROL_STUCK, "control_stuck", 0, 1, "1: S_CTRL succeeds and changes nothing")                                  \
    X(OTHER_SIZE, "other_size", 0, 1, "share of frames whose JPEG header says 8 lines more")                           \
    X(NO_TABLES, "no_tables", 0, 1, "share of frames without Huffman tables")                                          \
    X(LEAD, "lead", 0, 64, "bytes of something else before each frame")                                                \
    X(FIELD, "field", 0, 19, "enum v4l2_field that buffers have, and plus 10 formats too; 0: progressive")             \
    X(PARM_ERRNO, "parm_errno", 0, 133, "S_PARM fails with this errno")                                                \
    X(MPLANE, "mplane", 0, 1, "1: the node has the multi-planar API alone, with one plane")                            \
    X(SAME_STAMP, "same_stamp", 0, 1, "1: the stamp of the first frame for all")                                       \
    X(LIBCAMERA, "libcamera", 0, 1, "1: driver and DQBUF as of its V4L2 layer: buffers in the order of their numbers")   \
    X(SLOW_OPEN_MS, "slow_open_ms", 0, 60000, "open() takes this long")
enum sim_cam_fault {
#define X(fault, ...) SST_SIM_FAULT_##fault,
    SIM_CAM_FAULTS(X)
#undef X
        SST_SIM_FAULTS_OF_CAMERA,
};
struct sim_shot {
    struct sim_timer timer;
    struct sim_cam *cam;
    struct sst_sim_exposure exposure;
    uint32_t sequence;
};

struct sim_cam_counters {
    uint64_t frames, lost, overtrigger, exposures;
};

struct sim_cam {
    /* fixed after open */
    struct sim_array *array;
    struct sim_server *server;
    struct sst_sim_world *world;
    int index;
    /* the device */
    struct sim_node *node; /* NULL: unplugged */
    int number;            /* N of /dev/videoN; kept when unplugged */
    struct sim_open *opens;
    struct v4l2_pix_format format;
    struct v4l2_fract interval;
    int32_t control[SST_SIM_CAM_CONTROLS];
    struct sim_queue queue;
    bool reserved; /* bus bandwidth is reserved */
    /* the sensor */
    uint64_t random;
    int64_t busy_until_ns;
    uint32_t sequence;
    uint64_t free_run; /* index of the next frame */
    int64_t free_run_start_ns;
    struct sim_timer free_run_timer;
    struct sim_shot shot[SST_SIM_CAM_SHOTS];
    uint8_t *frozen; /* frame kept for fault "frozen", [frozen_bytes] */
    size_t frozen_bytes;
    int64_t time_wrap_ns;
    int64_t same_stamp_ns; /* of fault "same_stamp"; 0: none yet */
    struct sim_cam_counters counters;
};

struct sim_array {
    struct sim_array_config cfg; /* fixed after open, but for `truth` */
    int cameras, scope;
    int64_t opened_ns;
    struct sim_bus bus;
    FILE *truth;
    struct sim_cam *cam; /* [cameras] */
};

/** Initialise the sensor. */
void sim_cam_exposure_init(struct sim_cam *cam);
int sim_cam_start(struct sim_cam *cam); /* at STREAMON; 0 or -ENOSPC */
void sim_cam_stop(struct sim_cam *cam); /* at STREAMOFF; pending exposures are lost */
/** A pulse on the trigger input; ignored in free run. */
void sim_cam_edge(struct sim_cam *cam, uint64_t trigger, int64_t t_ns);
/** S_PARM or trigger_mode changed while streaming. */
void sim_cam_retime(struct sim_cam *cam);
void sim_cam_fault_set(struct sim_cam *cam, int fault, double value);

/* --- interface of the array to its cameras (camera_array.c) ------------------------------------------------------- */

double sim_cam_fault(const struct sim_cam *cam, enum sim_cam_fault fault);
bool sim_cam_chance(struct sim_cam *cam, double probability);
double sim_cam_gauss(struct sim_cam *cam);
/** The camera at the end of this one's cable: another one with fault "swap". */
int sim_cam_body(const struct sim_cam *cam);
/** Write the outcome of an exposure to the truth log. why: NULL for delivered. */
void sim_array_truth(struct sim_array *a, const struct sim_cam *cam, const struct sim_shot *shot, int64_t stamp_ns,
                     const char *why);

/* v4l2.c */
extern const struct sim_ops sim_cam_ops;

#endif
