/* simulators/devices/camera.h - one simulated V4L2 camera: state shared by the files that implement it. */
#ifndef SST_SIMULATORS_DEVICES_CAMERA_H
#define SST_SIMULATORS_DEVICES_CAMERA_H

#include <linux/videodev2.h>
#include <stdio.h>

#include "simulators/devices/array.h"

#define SST_SIM_CAM_BUFFERS  32 /* as the kernel's queues */
#define SST_SIM_CAM_CONTROLS 16
#define SST_SIM_CAM_SHOTS    64 /* exposed, not delivered yet */

struct sst_sim_cam;

/* --- controls (controls.c) ---------------------------------------------------------------------------------------- */

struct sst_sim_control_def {
    uint32_t id, type; /* V4L2_CID_, V4L2_CTRL_TYPE_ */
    const char *name;
    int32_t min, max, step, value;
    const char *const *menu; /* [max + 1], NULL entries are not offered */
};

enum sst_sim_control_index { /* of those that the camera itself looks at */
                             SST_SIM_CONTROL_AUTO_WHITE = 4,
                             SST_SIM_CONTROL_GAIN = 5,
                             SST_SIM_CONTROL_WHITE = 7,
                             SST_SIM_CONTROL_AUTO_EXPOSURE = 9,
                             SST_SIM_CONTROL_EXPOSURE = 10,
                             SST_SIM_CONTROL_TRIGGER = 11,
};

struct sst_sim_open;

/** Answer a control ioctl; -ENOTTY: not one of them. */
int sst_sim_cam_controls_ioctl(struct sst_sim_cam *cam, struct sst_sim_open *o, struct sst_sim_request *r);
void sst_sim_cam_controls_reset(struct sst_sim_cam *cam);
/** Place of a control, or -1. */
int sst_sim_cam_control_find(uint32_t id);
/** Fill the control part of an event. */
void sst_sim_cam_control_state(const struct sst_sim_cam *cam, int control, uint32_t changes, struct v4l2_event *out);

/* --- events (events.c) -------------------------------------------------------------------------------------------- */

/** Per open file. */
struct sst_sim_open {
    struct sst_sim_cam *cam;
    struct sst_sim_handle *handle;
    uint32_t priority; /* enum v4l2_priority */
    struct v4l2_event_subscription subscribed[SST_SIM_CAM_CONTROLS];
    int subscriptions;
    struct v4l2_event
        event[SST_SIM_CAM_CONTROLS]; /* one of each subscription: a newer one takes an older one's place */
    int events;
    uint32_t event_sequence;
    struct sst_sim_request *event_waiter;
    struct sst_sim_open *next;
};

int sst_sim_cam_subscribe(struct sst_sim_open *o, const struct v4l2_event_subscription *s);
int sst_sim_cam_unsubscribe(struct sst_sim_open *o, const struct v4l2_event_subscription *s, struct sst_sim_request *r);
int sst_sim_cam_dequeue_event(struct sst_sim_open *o, struct sst_sim_request *r);
/** A control changed; `by` gets no event of its own unless it asked for feedback. */
void sst_sim_cam_control_event(struct sst_sim_cam *cam, const struct sst_sim_open *by, int control, uint32_t changes);

/* --- formats (formats.c) ------------------------------------------------------------------------------------------ */

/** Answer a format, size, interval or S_PARM ioctl; -ENOTTY: not one of them. */
int sst_sim_cam_formats_ioctl(struct sst_sim_cam *cam, struct sst_sim_request *r);
void sst_sim_cam_formats_reset(struct sst_sim_cam *cam);

/* --- buffers (queue.c) -------------------------------------------------------------------------------------------- */

enum sst_sim_buffer_state {
    SST_SIM_BUFFER_DEQUEUED = 0,
    SST_SIM_BUFFER_QUEUED = 1,
    SST_SIM_BUFFER_DONE = 2,
};

struct sst_sim_buffer {
    enum sst_sim_buffer_state state;
    bool prepared, mapped, error;
    int memory;    /* memfd */
    uint8_t *data; /* [length] of it, mapped */
    uint32_t length, bytesused, sequence;
    int64_t stamp_ns;
    unsigned long userptr;
    uint32_t user_length;
    int dmabuf;            /* what the program gave, or -1 */
    int32_t dmabuf_number; /* its number in the program */
};

struct sst_sim_queue {
    struct sst_sim_buffer buffer[SST_SIM_CAM_BUFFERS];
    uint32_t count, memory; /* enum v4l2_memory, 0: none */
    struct sst_sim_open *owner;
    bool streaming;
    uint32_t queued[SST_SIM_CAM_BUFFERS], done[SST_SIM_CAM_BUFFERS]; /* indices, oldest first */
    int queued_count, done_count;
    struct sst_sim_request *waiter; /* a blocking DQBUF */
};

/** Answer a buffer or streaming ioctl; -ENOTTY: not one of them. */
int sst_sim_cam_queue_ioctl(struct sst_sim_cam *cam, struct sst_sim_open *o, struct sst_sim_request *r);
int sst_sim_cam_queue_map(struct sst_sim_cam *cam, struct sst_sim_request *r);
/** The buffer that takes the next frame, or NULL. */
struct sst_sim_buffer *sst_sim_cam_queue_next(struct sst_sim_cam *cam);
/** That buffer is filled. */
void sst_sim_cam_queue_done(struct sst_sim_cam *cam);
void sst_sim_cam_queue_stop(struct sst_sim_cam *cam, struct sst_sim_request *r); /* r: of STREAMOFF, or NULL */
void sst_sim_cam_queue_free(struct sst_sim_cam *cam);

/* --- exposures (exposure.c) --------------------------------------------------------------------------------------- */

/** Faults of a camera; the order of the table in camera_faults.c. */
enum sst_sim_cam_fault {
    SST_SIM_FAULT_UNPLUG,
    SST_SIM_FAULT_EIO,
    SST_SIM_FAULT_ERROR_FLAG,
    SST_SIM_FAULT_GAP,
    SST_SIM_FAULT_LATE_MS,
    SST_SIM_FAULT_LATE_P,
    SST_SIM_FAULT_DUPLICATE,
    SST_SIM_FAULT_FROZEN,
    SST_SIM_FAULT_TRUNCATED,
    SST_SIM_FAULT_CORRUPT_SOI,
    SST_SIM_FAULT_CORRUPT_EOI,
    SST_SIM_FAULT_CORRUPT_MID,
    SST_SIM_FAULT_SHORT,
    SST_SIM_FAULT_STALL,
    SST_SIM_FAULT_BUSY,
    SST_SIM_FAULT_NOSPACE,
    SST_SIM_FAULT_SEQUENCE_WRAP,
    SST_SIM_FAULT_TIME_WRAP,
    SST_SIM_FAULT_BACKWARDS,
    SST_SIM_FAULT_CLOCK_STEP_US,
    SST_SIM_FAULT_SWAP,
    SST_SIM_FAULT_CONTROL_STUCK,
    SST_SIM_FAULT_SLOW_OPEN_MS,
    SST_SIM_FAULTS_OF_CAMERA,
};
extern const struct sst_sim_fault sst_sim_cam_faults[SST_SIM_FAULTS_OF_CAMERA];

struct sst_sim_shot {
    struct sst_sim_timer timer;
    struct sst_sim_cam *cam;
    struct sst_sim_exposure exposure;
    uint32_t sequence;
};

struct sst_sim_cam_counters {
    uint64_t frames, lost, overtrigger, exposures;
};

struct sst_sim_cam {
    /* fixed after open */
    struct sst_sim_array *array;
    struct sst_sim_server *server;
    struct sst_sim_world *world;
    int index;
    /* the device */
    struct sst_sim_node *node; /* NULL: unplugged */
    int number;                /* of /dev/videoN; also the last one */
    struct sst_sim_open *opens;
    struct v4l2_pix_format format;
    struct v4l2_fract interval;
    int32_t control[SST_SIM_CAM_CONTROLS];
    struct sst_sim_queue queue;
    bool reserved; /* bandwidth of the bus */
    /* the sensor */
    uint64_t random;
    int64_t busy_until_ns;
    uint32_t sequence;
    uint64_t free_run; /* index of the next frame */
    int64_t free_run_start_ns;
    struct sst_sim_timer free_run_timer;
    struct sst_sim_shot shot[SST_SIM_CAM_SHOTS];
    uint8_t *frozen; /* kept frame of the fault, [frozen_bytes] */
    size_t frozen_bytes;
    int64_t time_wrap_ns;
    struct sst_sim_cam_counters counters;
};

/** Set up the sensor's part. */
void sst_sim_cam_exposure_init(struct sst_sim_cam *cam);
int sst_sim_cam_start(struct sst_sim_cam *cam); /* at STREAMON; 0 or -ENOSPC */
void sst_sim_cam_stop(struct sst_sim_cam *cam); /* at STREAMOFF; exposures under way are lost */
/** A pulse on the trigger input; ignored in free run. */
void sst_sim_cam_edge(struct sst_sim_cam *cam, uint64_t trigger, int64_t t_ns);
/** S_PARM or trigger_mode changed while streaming. */
void sst_sim_cam_retime(struct sst_sim_cam *cam);
void sst_sim_cam_fault_set(struct sst_sim_cam *cam, int fault, double value);

/* --- the array as its cameras see it (array.c) -------------------------------------------------------------------- */

double sst_sim_cam_fault(const struct sst_sim_cam *cam, enum sst_sim_cam_fault fault);
bool sst_sim_cam_chance(struct sst_sim_cam *cam, double probability);
double sst_sim_cam_gauss(struct sst_sim_cam *cam);
int64_t sst_sim_array_opened_ns(const struct sst_sim_array *a);
const struct sst_sim_bus *sst_sim_array_bus(const struct sst_sim_array *a);
/** The camera that stands behind this one's cable: another one with fault "swap". */
int sst_sim_cam_body(const struct sst_sim_cam *cam);
/** Write what happened to an exposure into the truth log. why: NULL for delivered. */
void sst_sim_array_truth(struct sst_sim_array *a, const struct sst_sim_cam *cam, const struct sst_sim_shot *shot,
                         int64_t stamp_ns, const char *why);

/* v4l2.c */
extern const struct sst_sim_ops sst_sim_cam_ops;

#endif
