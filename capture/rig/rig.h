/* capture/rig/rig.h - scan of a light field with one camera on a motor rig; an interrupted scan can be resumed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RIG_RIG_H
#define SST_CAPTURE_RIG_RIG_H

#include <stdatomic.h>

#include <jansson.h>

#include "base/frame.h"
#include "drivers/rig/rig.h"

/** Format of views that are developed from a still camera's raw files; not one of V4L2's. */
#define SST_SCAN_RAW ('R' | 'A' << 8 | 'W' << 16 | (uint32_t)' ' << 24)

/** A raw file, which is stored as it is beside the view. */
struct sst_scan_original {
    const char *extension; /* "cr2", of the camera's name for it in lower case */
    const uint8_t *data;
    size_t bytes;
};

/** The camera on the rig (rig_camera.h: one opened by sst_grab; rig_still.h: a still camera). */
struct sst_scan_camera {
    void *arg;
    /**
     * The first good frame whose exposure started at or after after_ns (CLOCK_MONOTONIC).
     * @return 0, -ETIMEDOUT (no such frame in time), -ENODEV (camera disconnected), -ECANCELED; logged.
     */
    int (*expose)(void *arg, int64_t after_ns, int timeout_ms, struct sst_frame **frame);
    void (*release)(void *arg, struct sst_frame *frame);
    const char *serial, *port; /* identity of the camera; "" unknown */
    /** Still cameras, else NULL: raw file of the last frame, until its release; NULL: none. */
    const struct sst_scan_original *(*original)(void *arg);
    /** Still cameras, else NULL: battery and card before the last frame. @return a new reference; NULL: no memory */
    json_t *(*state)(void *arg);
};

struct sst_scan_config {
    const char *dir; /* created if missing; an incomplete capture with the same settings is resumed */
    bool must_exist; /* only resume, never start a new capture */
    int rows, cols;
    int32_t pitch_um[2];             /* x, y */
    int32_t origin_um[SST_RIG_AXES]; /* of view (0,0) in the rig frame */
    int32_t backlash_um;             /* every pose is approached from this far below, on every axis; 0: directly */
    int guard_ms;                    /* from the end of settling to the exposure: for drivers with late time stamps */
    int attempts;                    /* per view */
    int camera_ms;                   /* time-out of a frame, including recovery of the camera */
    int home_ms;
    uint32_t fourcc;                 /* MJPG, GREY, Y16 or SST_SCAN_RAW */
    int width, height;               /* 0: of a still camera, as it is set */
    double rate_hz;                  /* of the camera, for the estimate; 0 unknown */
    double shot_s;                   /* of an exposure with its files, for the estimate; 0: by the rate */
    int64_t view_bytes;              /* for the estimate; 0: by size and format */
    const char *controls;            /* of the camera, as text: part of the settings; may be NULL */
    const SST_ATOMIC(bool) * cancel; /* set from a signal handler along with sst_rig_cancel(); may be NULL */
    void (*progress)(void *arg, double done);
    void *progress_arg;
};

void sst_scan_config_defaults(struct sst_scan_config *cfg);

/* --- poses -------------------------------------------------------------------------------------------------------- */

/** The i-th view in the order of capture: rows from the top, every second one from right to left. */
int sst_scan_view(const struct sst_scan_config *cfg, int i);

/** Position of the rig for a view. */
struct sst_rig_pos sst_scan_pose(const struct sst_scan_config *cfg, int view);

/**
 * Position to go to before a pose, so that every axis reaches it from below; equal to the pose if that is not needed.
 * @param from  NULL: unknown
 */
struct sst_rig_pos sst_scan_approach(const struct sst_scan_config *cfg, int axes, const struct sst_rig_pos *from,
                                     struct sst_rig_pos to);

struct sst_scan_plan {
    int views;
    double way_mm; /* sum over all moves of the longest travel of any axis */
    double seconds;
    bool speed_assumed; /* the configuration has no speed: 50 mm/s */
    int64_t bytes;      /* of all views; MJPEG: at a quarter of a byte per pixel */
};

/** Duration of a move from rest to rest. */
double sst_scan_leg_s(const struct sst_rig_config *rig, const struct sst_rig_pos *from, const struct sst_rig_pos *to);

/** Check the settings against the rig's travel and estimate. @return 0 or -EINVAL, logged. */
SST_MUST_CHECK int sst_scan_plan(struct sst_scan_plan *out, const struct sst_scan_config *cfg,
                                 const struct sst_rig_config *rig);

/* --- the folder --------------------------------------------------------------------------------------------------- */

struct sst_scan_store; /* opaque; one thread at a time */

/** Positions and attempts of a captured view. */
struct sst_scan_shot {
    struct sst_rig_pos asked, read;
    int attempts;
};

/**
 * Open or create the folder, lock it, read its manifest and verify the hash of every view. Missing and damaged views
 * have to be captured; temporary files of a killed process are removed. As long as there is no view, other settings
 * replace the folder's, unless must_exist.
 *
 * @return 0, -EINVAL (other settings: the difference is logged), -EEXIST (a folder with other contents), -ENOENT
 * (must_exist), -EBUSY (another capture is running in it), -EBADMSG (manifest), -EIO/-ENOSPC/-EROFS/-EACCES; logged.
 */
SST_MUST_CHECK int sst_scan_store_open(struct sst_scan_store **out, const struct sst_scan_config *cfg);
void sst_scan_store_close(struct sst_scan_store *store);

bool sst_scan_store_has(const struct sst_scan_store *store, int view);
int sst_scan_store_count(const struct sst_scan_store *store); /* views in the store */

/** Store a view durably: its file, then its line of the manifest. @return 0, -EINVAL (format),
 *  -EIO/-ENOSPC/-EROFS/...; logged, the view is then not stored. */
SST_MUST_CHECK int sst_scan_store_put(struct sst_scan_store *store, int view, const struct sst_scan_shot *shot,
                                      const struct sst_scan_camera *camera, const struct sst_frame *frame);

/** Write lightfield.json of a complete capture, with the offsets that were read back. Does nothing if it exists and no
 *  view was stored since. */
SST_MUST_CHECK int sst_scan_store_finish(struct sst_scan_store *store);

/** @return 0 or -EINVAL: the stored views are from another camera; logged. */
SST_MUST_CHECK int sst_scan_store_check_camera(const struct sst_scan_store *store,
                                               const struct sst_scan_camera *camera);

/* --- capture ------------------------------------------------------------------------------------------------------ */

struct sst_scan_report {
    int taken, there;              /* captured by this run; stored before it */
    int again;                     /* failed attempts in total; by cause: */
    int rig_faults, camera_faults; /* failed moves; missing frames */
    int moved;                     /* frames dropped: the rig was not at standstill before and after the exposure */
    int homed;
    struct sst_rig_counters rig;
};

/** A scan: rig, camera and folder. */
struct sst_scan {
    struct sst_rig *rig;
    const struct sst_rig_config *rig_cfg;
    const struct sst_scan_camera *camera;
    struct sst_scan_store *store;
    const struct sst_scan_config *cfg;
};

/**
 * Capture every missing view: move, wait for standstill, expose, verify the standstill, store.
 *
 * Faults of rig and camera are logged and counted, and the view is retried, after homing if the position is in doubt;
 * after cfg->attempts the capture ends with the motion stopped, and the next call resumes it.
 * @return 0 (complete: the folder is a light field), -EINTR (cancelled), or the last fault; logged.
 */
SST_MUST_CHECK int sst_scan_run(const struct sst_scan *scan, struct sst_scan_report *report);

#endif
