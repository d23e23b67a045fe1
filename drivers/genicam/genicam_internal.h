/* drivers/genicam/genicam_internal.h - private declarations of this folder: pure parts, the part that loads Aravis, a
 * camera. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_GENICAM_GENICAM_INTERNAL_H
#define SST_DRIVERS_GENICAM_GENICAM_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "drivers/genicam/genicam.h"

#define GENICAM_WHY_MAX 512

/* --- pixels: formats of PFNC as V4L2 formats ---------------------------------------------------------------------- */

/** Layout of samples before they are 16 bits each. */
enum genicam_packing {
    GENICAM_AS_IS = 0,
    GENICAM_SHIFT = 1,    /* 16-bit words, shifted up to fill them */
    GENICAM_PACKED12 = 2, /* two samples in three bytes, low bits in the middle one (GigE Vision "Packed") */
    GENICAM_PACKED10 = 3,
    GENICAM_P12 = 4, /* a stream of bits, the lowest first (PFNC "p") */
    GENICAM_P10 = 5,
};

struct genicam_pixels {
    const char *name;
    uint32_t code; /* of PFNC */
    uint32_t fourcc;
    enum genicam_packing packing;
    int bits; /* of a sample */
};

/** Formats of the cameras that give a V4L2 format, best first, ended by a NULL name. @param at  counted up from 0
 *  @return NULL: no more */
const struct genicam_pixels *genicam_pixels_next(uint32_t fourcc, int *at);
const struct genicam_pixels *genicam_pixels_named(const char *name);

/** Bytes of a frame from the camera, and as it is delivered. */
size_t genicam_bytes(const struct genicam_pixels *p, int width, int height);
size_t genicam_frame_bytes(const struct genicam_pixels *p, int width, int height);

/** Samples of 16 bits from packed ones, in place. @param data  room for 2 * count bytes */
void genicam_unpack(uint8_t *data, size_t count, const struct genicam_pixels *p);

/* --- ids: frames lost, by their numbers --------------------------------------------------------------------------- */

/** Zeroed: no frame yet. */
struct genicam_ids {
    bool any;
    uint64_t last;    /* id of the last frame that had one */
    uint32_t unknown; /* frames without an id since: their first packet is lost */
};

/**
 * Frames lost before a frame of this id: 16-bit ids of GigE Vision 1 go from 65535 to 1, others count on. Ids that run
 * backwards begin a new count.
 *
 * @param id  0: unknown, the first packet of the frame is lost
 */
uint32_t genicam_lost_before(struct genicam_ids *ids, uint64_t id);

/* --- clock: time of a camera as time of this host ----------------------------------------------------------------- */

#define GENICAM_CLOCK_POINTS 32

/**
 * Every event of the camera is seen here later than it happened: offset(t) = seen - stamp is bounded from above by
 * the least of the last half minute, with a slope (drift of its crystal) by the minima of its two halves.
 */
struct genicam_clock {
    struct {
        int64_t stamp_ns, offset_ns; /* the event with the least offset in its second */
    } point[GENICAM_CLOCK_POINTS];   /* ring, one a second */
    int first, count;
    int64_t begin_ns; /* stamp of the first event in the newest point's second */
    int strays; /* consecutive events that contradict the offset */
};

/** Add an event: its stamp by the camera, and when it was seen here (CLOCK_MONOTONIC). */
void genicam_clock_add(struct genicam_clock *c, int64_t stamp_ns, int64_t seen_ns);

/** Time here of a stamp. @return false: unknown */
bool genicam_clock_here(const struct genicam_clock *c, int64_t stamp_ns, int64_t *t_ns);

/** Time of the camera at a time here. @return false: unknown */
bool genicam_clock_there(const struct genicam_clock *c, int64_t t_ns, int64_t *stamp_ns);

/* --- action: the GVCP datagram ------------------------------------------------------------------------------------ */

#define GENICAM_GVCP_PORT   3956
#define GENICAM_ACTION_MAX  28
#define GENICAM_ACTION_NONE (-1)

/** Write an action command. @param at_ns  PTP time of the execution; 0: on arrival @param id  of the request, not 0
 *  @return its bytes */
size_t genicam_action_write(uint8_t out[GENICAM_ACTION_MAX], const struct sst_genicam_action *action, uint64_t at_ns,
                            uint16_t id);

/** Read a datagram that came in answer. @return status of an acknowledgement (0: executed, or scheduled),
 *  GENICAM_ACTION_NONE: it is none */
int genicam_action_read(const uint8_t *data, size_t bytes, uint16_t *id);

/* --- lib: Aravis, in the part libsst-aravis.so -------------------------------------------------------------------- */

struct genicam_lib; /* an open camera */

/** A buffer of an open camera: lent out as a frame, or with Aravis. */
struct genicam_slot {
    struct sst_frame frame; /* pool: this slot */
    struct genicam_lib *lib;
    void *buffer; /* ArvBuffer */
    struct genicam_slot *next;
    /* of the image in it */
    uint64_t id; /* 0: unknown */
    int64_t stamp_ns; /* by the camera's clock; 0: unknown */
    int64_t seen_ns;  /* when its first packet came, CLOCK_MONOTONIC; 0: unknown */
    bool whole;       /* all packets came */
    bool cancelled;   /* it was stopped: no frame */
};

/** An image came, or ended; the slot is lent until genicam_lib_release(). On the thread that receives its packets. */
typedef void genicam_image_fn(void *arg, struct genicam_slot *slot);

struct genicam_reading {
    uint64_t missing_packets, resent_packets; /* since it was started */
    struct sst_genicam_ptp ptp;
    bool latched;             /* its clock was read: */
    int64_t stamp_ns, seen_ns; /* by it, and just after here */
};

struct genicam_lib_events {
    void *arg;
    genicam_image_fn *image;
    void (*lost)(void *arg); /* control is lost: it no longer answers; on a thread of Aravis */
};

/** As sst_genicam_list(). */
SST_MUST_CHECK int genicam_lib_list(struct sst_genicam_device **devices, int *count);

/**
 * Find a camera, open it, apply the settings and read them back.
 *
 * @param device  out: identity
 * @param why     out [GENICAM_WHY_MAX]: sentence about a failure
 * @param note    out [GENICAM_WHY_MAX]: settings that the camera did not accept as given; ""
 * @return 0, -ENODEV (not found), -EBUSY (another program controls it), -EINVAL (cannot fulfil the settings), -ENOMEM,
 *  -EIO, -ENOTSUP (no Aravis)
 */
struct genicam_lib_query {
    const struct sst_genicam_binding *binding;
    const struct sst_genicam_config *cfg;
    int cam;
};
SST_MUST_CHECK int genicam_lib_open(struct genicam_lib **out, const struct genicam_lib_query *query,
                                    struct sst_genicam_device *device, char *why, char *note);
/** As sst_genicam_read_ptp(). */
SST_MUST_CHECK int genicam_lib_ptp(const struct sst_genicam_device *device, struct sst_genicam_ptp *out);
SST_MUST_CHECK int genicam_lib_start(struct genicam_lib *lib, const struct genicam_lib_events *events, char *why);
SST_MUST_CHECK int genicam_lib_trigger(struct genicam_lib *lib);
/** Read statistics and the clock. @return 0 or -EIO: it does not answer */
SST_MUST_CHECK int genicam_lib_read(struct genicam_lib *lib, struct genicam_reading *out);
/** Thread: any; also after close. */
void genicam_lib_release(struct genicam_slot *slot);
/** Stop, and free as soon as no image is lent out. NULL is fine. @param silent  it does not answer: it is not asked to
 * stop, which takes seconds then */
void genicam_lib_close(struct genicam_lib *lib, bool silent);

/* --- camera: its thread ------------------------------------------------------------------------------------------- */

struct genicam_camera {
    /* fixed after create */
    struct sst_genicam *array;
    int index;
    struct sst_genicam_binding binding;
    char name[2 * SST_GRAB_NAME_MAX];
    pthread_t thread;
    bool threaded;
    /* own thread */
    struct genicam_lib *lib;
    int64_t down_ns, retry_ns, retry_pause_ns, read_ns;
    uint64_t missing_before, resent_before; /* of earlier starts */
    char note[GENICAM_WHY_MAX];
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t wake;
    bool quit, start, running, tried;
    bool lost;                 /* control is lost */
    int fires;                 /* triggers to carry out */
    int64_t owed_ns, heard_ns; /* oldest trigger without a frame; last frame, or start */
    enum sst_grab_state state;
    char why[GENICAM_WHY_MAX];
    bool changed; /* state and why, since the last poll */
    struct sst_grab_device device;
    struct sst_grab_counters counters;
    struct sst_genicam_ptp ptp;
    struct genicam_slot *first, *last; /* frames to deliver */
    struct genicam_ids ids;
    struct genicam_clock clock;
    uint32_t sequence;
    int64_t last_ns; /* time of the last frame */
    uint64_t hash;
    bool hashed;
    int64_t settle_ns; /* before this time frames only teach the clock; 0: not yet known */
    /* polling thread: as of the last poll */
    enum sst_grab_state seen;
    struct sst_grab_device shown;
};

struct sst_genicam {
    struct sst_genicam_config cfg; /* bindings NULL */
    struct sst_grab_events events;
    int fd, wake_fd, action_fd; /* epoll; eventfd; socket, -1: none */
    struct genicam_camera *camera; /* [cfg.cameras] */
    pthread_mutex_t lock;
    struct sst_genicam_action_counters actions; /* under lock */
    uint16_t action_id;                         /* under lock */
};

/** Start its thread. @return 0 or -errno */
SST_MUST_CHECK int genicam_camera_create(struct genicam_camera *cam, struct sst_genicam *array, int index,
                                         const struct sst_genicam_binding *binding);
void genicam_camera_destroy(struct genicam_camera *cam);
/** A trigger at t_ns. @param command  to be carried out by a command to this camera */
void genicam_camera_fire(struct genicam_camera *cam, int64_t t_ns, bool command);

/** A slot that came, completed as a frame of the camera; on the receiving thread. */
void genicam_receive(void *cam, struct genicam_slot *slot);

/** Open the socket of action commands. @return descriptor or -errno, logged */
SST_MUST_CHECK int genicam_action_open(void);
void genicam_action_send(struct sst_genicam *g, int64_t t_ns);
/** Count acknowledgements and refusals. */
void genicam_action_receive(struct sst_genicam *g);

#endif
