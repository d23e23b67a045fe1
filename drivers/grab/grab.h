/* drivers/grab/grab.h - capture from many V4L2 cameras on one thread, with identity, hotplug and recovery. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_GRAB_GRAB_H
#define SST_DRIVERS_GRAB_GRAB_H

#include <stdbool.h>

#include "base/frame.h"

#define SST_GRAB_NAME_MAX     64
#define SST_GRAB_CONTROLS_MAX 32
#define SST_GRAB_FORMATS_MAX  256
#define SST_GRAB_FOURCC_MAX   16
#define SST_GRAB_PARTS_MAX    16

/* --- discovery ---------------------------------------------------------------------------------------------------- */

/** A video capture node as reported by udev and QUERYCAP; metadata nodes are left out. */
struct sst_grab_device {
    char node[SST_GRAB_NAME_MAX]; /* /dev/video0; changes with the order of plugging, never an identity */
    char name[SST_GRAB_NAME_MAX]; /* card */
    char driver[SST_GRAB_NAME_MAX];
    char serial[SST_GRAB_NAME_MAX]; /* ID_SERIAL_SHORT; "" if none */
    char port[SST_GRAB_NAME_MAX];   /* USB port path, "1-2.3" as in sysfs; else the bus_info of the device */
    /* of sst_grab_list() only */
    int error;                            /* errno of opening it, ETIMEDOUT: it hangs, 0: no error */
    bool busy;                            /* a program streams from it */
    char formats[SST_GRAB_FORMATS_MAX];   /* "MJPG 1280x720 640x480, YUYV 640x480"; truncated to fit */
    uint32_t fourcc[SST_GRAB_FOURCC_MAX]; /* of formats, 0 terminated or full; empty: it could not be asked */
    int nth;                              /* which of the capture nodes of its port, from 1 */
    char left_out[SST_GRAB_NAME_MAX];     /* why it is no camera of the array; "" if it is one */
};

/** List capture nodes by port (natural order), within 2 s even if devices hang. *devices to free with free().
 *  @return 0 or -errno, logged. */
SST_MUST_CHECK int sst_grab_list(struct sst_grab_device **devices, int *count);

/** List all nodes, as sst_grab_list(): ones that are no capture nodes come last, from *count to *all, with `left_out`
 * set. */
SST_MUST_CHECK int sst_grab_list_all(struct sst_grab_device **devices, int *count, int *all);

/**
 * Of capture nodes in the order of their ports keep the cameras of an array: nodes that offer the format, if any does,
 * and are the first such node of their port. The others are moved to the end, in order, and get `left_out`.
 * @return number of nodes kept
 */
int sst_grab_select(struct sst_grab_device *devices, int count, uint32_t fourcc);

/* --- split pictures: devices that deliver the pictures of several cameras side by side in one --------------------- */

/**
 * Cameras in the picture of each device, `rows` x `cols` of one size. A camera is part N of its device, from 1, row by
 * row; its serial and port are the device's with "#N". 1x1: a device is a camera.
 */
struct sst_grab_split {
    int rows, cols;
};

/** Copy the name of a device out of a part's name: "A17#2" to "A17". @return the part, from 1; 0: it names none */
int sst_grab_part_of(char device[SST_GRAB_NAME_MAX], const char *part);

/**
 * Replace the first `count` devices of a list by their cameras, each with the serial and port of its part; the others
 * follow as before.
 *
 * @param devices      of malloc(); replaced
 * @param count, all   in and out
 * @return 0, -ENOMEM: the list is as before; logged
 */
SST_MUST_CHECK int sst_grab_list_parts(struct sst_grab_device **devices, int *count, int *all,
                                       struct sst_grab_split split);

/** A whole compressed picture, and the cameras in it, each of width x height. */
struct sst_grab_whole {
    const uint8_t *data;
    size_t bytes;
    struct sst_grab_split split;
    int width, height;
};

struct sst_grab_piece {
    const uint8_t *data;
    size_t bytes;
};

/** Verbs that cut compressed pictures into one for each camera; of the caller, since this folder knows no codec. */
struct sst_grab_cutter {
    /** @return 0, -ENOMEM */
    int (*create)(void **state);
    void (*destroy)(void *state); /* NULL is fine */
    /** Read a picture. @param why  out, [size], on -EINVAL: one sentence
     *  @return 0, -EBADMSG (damaged), -EINVAL (it cannot be cut there, nor will the next one), -ENOMEM */
    int (*read)(void *state, const struct sst_grab_whole *whole, char *why, size_t size);
    /** The picture of part `part`, from 0, of the one that was read. @param out  valid until the next call
     *  @return and why: as of read */
    int (*cut)(void *state, int part, struct sst_grab_piece *out, char *why, size_t size);
};

/* --- grabbing ----------------------------------------------------------------------------------------------------- */

struct sst_grab; /* opaque; poll, start, stop on one thread; release from any */

struct sst_grab_binding {
    char serial[SST_GRAB_NAME_MAX]; /* one of both is set; the serial has priority. Two devices with it: -ENOTUNIQ,
                                       named. Of split pictures: with the part */
    char port[SST_GRAB_NAME_MAX];
    int node; /* number of the capture node of its device, from 1; 0: the first that fulfils the settings */
    char title[32]; /* in messages: "camera row 0, col 1"; "": by its number */
};

struct sst_grab_control {
    char name[SST_GRAB_NAME_MAX]; /* as in v4l2-ctl: exposure_time_absolute */
    int64_t value;                /* menus: the index */
};

struct sst_grab_config {
    int cameras;
    const struct sst_grab_binding *bindings; /* [cameras]; copied */
    uint32_t fourcc;
    int width, height;           /* of a camera */
    struct sst_grab_split split; /* of the devices' pictures; 0x0: 1x1. Not of planar formats and fractions of a byte */
    const struct sst_grab_cutter *cutter; /* needed for split JPEGs; must outlive the grab */
    double rate_hz; /* S_PARM; 0: unchanged */
    int buffers;    /* per camera, 2..32 */
    int controls;
    struct sst_grab_control control[SST_GRAB_CONTROLS_MAX]; /* set at each open in this order, read back, compared */
    bool triggered;    /* frames are expected only after sst_grab_expect(); else at rate_hz */
    int stall_ms;      /* a frame that is this late starts the next rung of the recovery ladder; 0: 1000 */
    bool port_power;   /* allow the ladder to switch the hub port off and on */
    bool check_frozen; /* compare each frame's bytes with a hash of the one before */
};

enum sst_grab_state {
    SST_GRAB_ABSENT = 0, /* not connected */
    SST_GRAB_STREAMING = 1,
    SST_GRAB_RECOVERING = 2, /* on the ladder, or waiting for its next rung */
    SST_GRAB_REFUSED = 3,    /* connected, but cannot fulfil the settings (format, bandwidth, permissions); retried at
                                plug-in and with back-off */
    SST_GRAB_READY = 4,      /* open and set up, not started */
};

/** Rungs of the recovery ladder; each is tried if the previous one gave no frame (design.md, 6). */
enum sst_grab_rung {
    SST_GRAB_RESTREAM = 0,
    SST_GRAB_REOPEN = 1,
    SST_GRAB_RESET = 2, /* USB reset */
    SST_GRAB_REAUTHORISE = 3,
    SST_GRAB_POWER = 4,
    SST_GRAB_BACK_OFF = 5,
    SST_GRAB_RUNGS = 6,
};

/** Since open. Every delivered frame is good or bad; `frames` counts both. */
struct sst_grab_counters {
    uint64_t frames, bad, lost; /* lost: gaps in the driver's sequence */
    uint64_t fault[8];          /* by bit of sst_frame_fault */
    uint64_t io_errors;         /* DQBUF calls that failed with EIO while streaming continued */
    uint64_t lost_devices, found_devices, rung[SST_GRAB_RUNGS];
    uint64_t packets_missing, packets_resent; /* of a network camera: of incomplete frames, and requested again */
};

struct sst_grab_events {
    void *arg;
    /** A frame, good or bad; owned by the receiver until it calls sst_grab_release() (also inside this call). */
    void (*frame)(void *arg, struct sst_frame *frame);
    /** The state of a camera changed; `why` is one sentence, and while it streams "" or a remark on its frames.
     *  Already logged. */
    void (*state)(void *arg, int cam, enum sst_grab_state state, const char *why);
};

void sst_grab_config_defaults(struct sst_grab_config *cfg); /* MJPEG 640x480, 4 buffers, stall 1000 ms */

/**
 * Find and open all cameras and set up their streams; missing or refusing cameras are reported by event and in the log,
 * and retried at plug-in.
 *
 * @return 0 (some camera may be absent), -EINVAL, -ENOMEM, -ENOTUNIQ, -errno of udev; logged.
 */
SST_MUST_CHECK int sst_grab_open(struct sst_grab **out, const struct sst_grab_config *cfg,
                                 const struct sst_grab_events *events);

/** Start streaming on all connected cameras. @return number of streaming cameras, or -errno. */
SST_MUST_CHECK int sst_grab_start(struct sst_grab *grab);

/** Wait up to timeout_ms (-1: for ever) and handle frames, hotplug and recovery. Never blocks on one camera.
 *  @return 0 (early after a signal or a suspend of the machine), or -errno of the poll itself. */
SST_MUST_CHECK int sst_grab_poll(struct sst_grab *grab, int timeout_ms);

/** Descriptor that is readable when sst_grab_poll(grab, 0) has work, timers included: for a caller's event loop. */
int sst_grab_fd(const struct sst_grab *grab);

/** Report a trigger fired at t_ns: from now on a frame of each camera is due.  Thread: any. */
void sst_grab_expect(struct sst_grab *grab, int64_t t_ns);

/** Release a frame to its camera's queue.  Thread: any. Frames of a camera that was disconnected since are fine. */
void sst_grab_release(struct sst_grab *grab, struct sst_frame *frame);

enum sst_grab_state sst_grab_camera_state(const struct sst_grab *grab, int cam);
const struct sst_grab_device *sst_grab_camera_device(const struct sst_grab *grab, int cam); /* last known */
void sst_grab_counters(const struct sst_grab *grab, int cam, struct sst_grab_counters *out);

/** FNV-like hash of whole frames, 32 bytes per step: frames of equal hash count as identical. */
uint64_t sst_grab_hash(const uint8_t *data, size_t bytes);

/** Stops within 2 s even if devices hang. All frames must have been released before. NULL is fine. */
void sst_grab_close(struct sst_grab *grab);

#endif
