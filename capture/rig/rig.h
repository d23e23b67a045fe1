/* capture/rig/rig.h - one camera stepped over a grid of poses by a motor rig: a light field that survives any stop.
 */
#ifndef SST_CAPTURE_RIG_RIG_H
#define SST_CAPTURE_RIG_RIG_H

#include <stdatomic.h>

#include "base/frame.h"
#include "drivers/rig/rig.h"

/** The camera on the rig (rig_camera.h: one of sst_grab). */
struct sst_rig_camera {
    void *arg;
    /**
     * The first good frame whose exposure started at or after after_ns (CLOCK_MONOTONIC).
     * @return 0, -ETIMEDOUT (none came in time), -ENODEV (the camera is gone), -ECANCELED; logged.
     */
    int (*expose)(void *arg, int64_t after_ns, int timeout_ms, struct sst_frame **frame);
    void (*release)(void *arg, struct sst_frame *frame);
    const char *serial, *port; /* what it is; "" unknown */
};

struct sst_rig_capture_config {
    const char *dir; /* made if missing; an incomplete capture of the same settings goes on */
    bool must_exist; /* refuse to begin a new one */
    int rows, cols;
    int32_t pitch_um[2];             /* x, y */
    int32_t origin_um[SST_RIG_AXES]; /* of view (0,0) in the rig frame */
    int32_t backlash_um;             /* every pose is approached from this far below, on every axis; 0: directly */
    int guard_ms;                    /* from the end of settling to the exposure: for drivers that stamp a frame late */
    int attempts;                    /* per view */
    int camera_ms;                   /* wait for a frame this long, recovery of the camera included */
    int home_ms;
    uint32_t fourcc;
    int width, height;
    double rate_hz;                  /* of the camera, for the estimate; 0 unknown */
    const char *controls;            /* of the camera, as text: part of the settings; may be NULL */
    const SST_ATOMIC(bool) * cancel; /* set from a signal handler along with sst_rig_cancel(); may be NULL */
    void (*progress)(void *arg, double done);
    void *progress_arg;
};

void sst_rig_capture_config_defaults(struct sst_rig_capture_config *cfg);

/* --- poses -------------------------------------------------------------------------------------------------------- */

/** The view that is taken i-th: rows from the top, every second one from right to left. */
int sst_rig_capture_view(const struct sst_rig_capture_config *cfg, int i);

/** Where a view is taken. */
struct sst_rig_pos sst_rig_capture_pose(const struct sst_rig_capture_config *cfg, int view);

/**
 * Where to go before a pose, so that every axis comes to it from below; equal to the pose where nothing is needed.
 * @param from  NULL: unknown
 */
struct sst_rig_pos sst_rig_capture_approach(const struct sst_rig_capture_config *cfg, int axes,
                                            const struct sst_rig_pos *from, struct sst_rig_pos to);

struct sst_rig_capture_plan {
    int views;
    double way_mm; /* sum over the legs of the longest axis */
    double seconds;
    bool speed_assumed; /* the configuration gives none: 50 mm/s */
    int64_t bytes;      /* of all views; MJPEG: at a quarter of a byte per pixel */
};

/** Duration of a move from rest to rest. */
double sst_rig_capture_leg_s(const struct sst_rig_config *rig, const struct sst_rig_pos *from,
                             const struct sst_rig_pos *to);

/** Check the settings against the rig's travel and estimate. @return 0 or -EINVAL, logged. */
SST_MUST_CHECK int sst_rig_capture_plan(struct sst_rig_capture_plan *out, const struct sst_rig_capture_config *cfg,
                                        const struct sst_rig_config *rig);

/* --- the folder --------------------------------------------------------------------------------------------------- */

struct sst_rig_store; /* opaque; one thread at a time */

/** What is known of a view besides its bytes. */
struct sst_rig_shot {
    struct sst_rig_pos asked, read;
    int attempts;
};

/**
 * Open or make the folder, lock it, read its manifest and compare every view with its hash. Views that are missing or
 * damaged are to be taken; what a killed process left is removed.
 *
 * @return 0, -EINVAL (other settings: what differs is logged), -EEXIST (a folder of something else), -ENOENT
 * (must_exist), -EBUSY (another capture is at it), -EBADMSG (manifest), -EIO/-ENOSPC/-EROFS/-EACCES; logged.
 */
SST_MUST_CHECK int sst_rig_store_open(struct sst_rig_store **out, const struct sst_rig_capture_config *cfg);
void sst_rig_store_close(struct sst_rig_store *store);

bool sst_rig_store_has(const struct sst_rig_store *store, int view);
int sst_rig_store_count(const struct sst_rig_store *store);   /* views that are there */

/** Store a view durably: its file, then its line. @return 0, -EINVAL (format), -EIO/-ENOSPC/-EROFS/...; logged, the
 * view is then not there. */
SST_MUST_CHECK int sst_rig_store_put(struct sst_rig_store *store, int view, const struct sst_rig_shot *shot,
                                     const struct sst_rig_camera *camera, const struct sst_frame *frame);

/** All views are there: write lightfield.json, offsets as read back. Nothing to do where it is there and nothing was
 * put. */
SST_MUST_CHECK int sst_rig_store_finish(struct sst_rig_store *store);

/** @return 0 or -EINVAL: the views that are there are another camera's; logged. */
SST_MUST_CHECK int sst_rig_store_check_camera(const struct sst_rig_store *store, const struct sst_rig_camera *camera);

/* --- capture ------------------------------------------------------------------------------------------------------ */

struct sst_rig_capture_report {
    int taken, there;              /* by this run; before it */
    int again;                     /* attempts that failed, by what: */
    int rig_faults, camera_faults; /* a move that did not end well; no frame */
    int moved;                     /* frames thrown away: the rig did not stand before and after */
    int homed;
    struct sst_rig_counters rig;
};

/**
 * Take every view that is missing: go there, wait until it stands, expose, check that it stood, store.
 *
 * Faults of rig and camera are told, counted and the view is tried again, homed before where the rig is in doubt; after
 * cfg->attempts the capture ends, motion stopped, and goes on with the next call.
 * @return 0 (complete: the folder is a light field), -EINTR (cancelled), or the last fault; logged.
 */
SST_MUST_CHECK int sst_rig_capture(struct sst_rig *rig, const struct sst_rig_config *rig_cfg,
                                   const struct sst_rig_camera *camera, struct sst_rig_store *store,
                                   const struct sst_rig_capture_config *cfg, struct sst_rig_capture_report *report);

#endif
