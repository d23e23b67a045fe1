/* drivers/genicam/genicam.h - capture from GenICam cameras (GigE Vision, USB3 Vision): discovery, settings, trigger,
 * recovery. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_GENICAM_GENICAM_H
#define SST_DRIVERS_GENICAM_GENICAM_H

#include "drivers/grab/grab.h"

#define SST_GENICAM_ID_MAX 128

/* --- discovery ---------------------------------------------------------------------------------------------------- */

struct sst_genicam_device {
    char id[SST_GENICAM_ID_MAX]; /* "Vendor-Model-Serial" */
    char vendor[SST_GRAB_NAME_MAX], model[SST_GRAB_NAME_MAX], serial[SST_GRAB_NAME_MAX];
    char address[SST_GRAB_NAME_MAX];  /* IPv4; of a USB3 Vision camera its GUID */
    char protocol[SST_GRAB_NAME_MAX]; /* "GigEVision", "USB3Vision" */
};

/** Clock of a camera by PTP (IEEE 1588). */
struct sst_genicam_ptp {
    char role[24];     /* "Slave", "Master" ... as the camera reports it; "": unknown, or without PTP */
    bool has_offset;
    int64_t offset_ns; /* from the master */
};

/** List cameras that answer within 1 s; nothing is opened. *devices to free with free().
 *  @return 0, -ENOMEM, -ENOTSUP (built or installed without Aravis; not logged) */
SST_MUST_CHECK int sst_genicam_list(struct sst_genicam_device **devices, int *count);

/** Read the clock of a camera, also while another program controls it; takes some 0.1 s. @return 0 or -errno */
SST_MUST_CHECK int sst_genicam_read_ptp(const struct sst_genicam_device *device, struct sst_genicam_ptp *out);

/* --- capture ------------------------------------------------------------------------------------------------------ */

struct sst_genicam; /* opaque; poll, start, stop on one thread; release and fire from any */

/** Start of an exposure. */
enum sst_genicam_trigger {
    SST_GENICAM_FREE = 0,     /* by the camera, at its rate */
    SST_GENICAM_WIRE = 1,     /* rising edge of an input of the camera */
    SST_GENICAM_SOFTWARE = 2, /* command to each camera, by sst_genicam_fire() */
    SST_GENICAM_ACTION = 3,   /* one GVCP datagram to all cameras, by sst_genicam_fire() */
};

struct sst_genicam_binding {
    char id[SST_GRAB_NAME_MAX];      /* serial, or "Vendor-Model-Serial"; "": by address */
    char address[SST_GRAB_NAME_MAX]; /* IPv4; "": by id */
};

/** GVCP action command (GigE Vision 2, 16.2). */
struct sst_genicam_action {
    uint32_t device_key, group_key, group_mask;
    char address[SST_GRAB_NAME_MAX]; /* destination, usually the broadcast address of the cameras' network */
    int delay_us; /* > 0: scheduled this long after the trigger, in PTP time; 0: executed on arrival */
};

struct sst_genicam_config {
    int cameras;
    const struct sst_genicam_binding *bindings; /* [cameras]; copied */
    uint32_t fourcc; /* V4L2 format of the frames: GREY, Y16 (10 to 16 bits, shifted up), RGB3, or Bayer of 8 bits */
    char pixel_format[SST_GRAB_NAME_MAX]; /* by its GenICam name; "": the first of the camera's that gives fourcc */
    int width, height;
    double rate_hz;
    int buffers; /* per camera, 2..32 */
    int stall_ms;
    bool check_frozen;
    enum sst_genicam_trigger trigger;
    char line[SST_GRAB_NAME_MAX]; /* of WIRE: "Line0" */
    double exposure_us;           /* 0: unchanged */
    double gain;                  /* NaN: unchanged */
    int packet_bytes;             /* GigE: 0: negotiated */
    int packet_delay_ns;          /* GigE: between packets */
    bool resend;                  /* GigE: lost packets are requested again */
    bool ptp;                     /* the camera's clock follows the PTP master of the network */
    struct sst_genicam_action action;
};

void sst_genicam_config_defaults(struct sst_genicam_config *cfg);

/** V4L2 format that GenICam cameras can deliver. */
bool sst_genicam_has_format(uint32_t fourcc);

/**
 * Start to search, open and set up all cameras, each on a thread of its own; missing cameras are searched until
 * they are found. Waits up to 8 s until all are ready or have failed.
 *
 * @param events  as of sst_grab_open(), called by sst_genicam_poll()
 * @return 0, -EINVAL, -ENOMEM, -ENOTSUP (built or installed without Aravis), or -errno; logged
 */
SST_MUST_CHECK int sst_genicam_open(struct sst_genicam **out, const struct sst_genicam_config *cfg,
                                    const struct sst_grab_events *events);

/** Start streaming on all ready cameras. */
void sst_genicam_start(struct sst_genicam *g);

/** Deliver pending frames and changes of state; never waits. */
void sst_genicam_poll(struct sst_genicam *g);

/** Descriptor that is readable when sst_genicam_poll() has work. */
int sst_genicam_fd(const struct sst_genicam *g);

/** Report a trigger at t_ns, and expose cameras of SOFTWARE and ACTION.  Thread: any; does not wait for cameras. */
void sst_genicam_fire(struct sst_genicam *g, int64_t t_ns);

/** Release a frame to its camera.  Thread: any. */
void sst_genicam_release(struct sst_genicam *g, struct sst_frame *frame);

enum sst_grab_state sst_genicam_camera_state(const struct sst_genicam *g, int cam);
const struct sst_grab_device *sst_genicam_camera_device(const struct sst_genicam *g, int cam); /* last known */
void sst_genicam_counters(const struct sst_genicam *g, int cam, struct sst_grab_counters *out);
void sst_genicam_ptp(const struct sst_genicam *g, int cam, struct sst_genicam_ptp *out);

/** Acknowledgements of action commands; each camera that executes one sends one. */
struct sst_genicam_action_counters {
    uint64_t sent, failed, acknowledged, refused;
};
void sst_genicam_actions(const struct sst_genicam *g, struct sst_genicam_action_counters *out);

/** All frames must have been released before. NULL is fine. */
void sst_genicam_close(struct sst_genicam *g);

#endif
