/* capture/array/capture.h - capture of framesets from the array: cameras, trigger and frame synchronisation run on one
 * thread, a writer on another. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ARRAY_CAPTURE_H
#define SST_CAPTURE_ARRAY_CAPTURE_H

#include "base/histogram.h"
#include "capture/array/frame_sync.h"
#include "capture/array/source.h"
#include "config/array.h"
#include "drivers/genicam/genicam.h"
#include "drivers/grab/grab.h"
#include "drivers/trigger/trigger.h"

struct sst_capture; /* opaque; open, run and close on one thread */

struct sst_capture_events {
    void *arg;
    /** Store a frameset, with privacy masks applied; called on the writer's thread. Its frames are released on return; an error drops it, counted.
     */
    int (*set)(void *arg, const struct sst_frameset *set);
    /** Called about once a second and at the end, on the capture thread; may be NULL. */
    void (*progress)(void *arg, uint64_t sets);
    /** Called when the state of a camera changes, on the capture thread; may be NULL. Already logged. */
    void (*camera)(void *arg, int cam, enum sst_grab_state state, const char *why);
    bool quiet; /* do not log loss and return of the trigger chip, nor skew: the caller logs them */
    bool again; /* a retry of a failed open: do not repeat warnings about the number of cameras */
};

struct sst_capture_report {
    uint64_t handed, complete, empty; /* sets passed to the writer; of these, with all cameras, with none */
    struct sst_framesync_counters sets;
    uint64_t edges, edges_stamped, ticks_skipped; /* triggers fired; with a loop-back stamp; too late to fire */
    uint64_t refused;                             /* sets that the writer returned an error for */
    uint64_t skewed;                              /* sets with more skew than the limit */
    struct sst_histogram skew_ns, from_edge_ns; /* of sets with two frames or more; of sets with an edge, magnitude */
    bool trigger_away;                          /* its chip is disconnected */
    int worst_cam;                              /* of the set with the most skew; -1 */
    struct sst_grab_counters grab;              /* sums over the cameras */
    int masked;        /* cameras with privacy masks */
    uint64_t withheld; /* frames left out of their sets, since masks could not be applied to them */
    uint64_t unexplained; /* frames that are neither waiting nor in exactly one bucket: must be 0, else it is a bug */
};

/**
 * Find the cameras, start their streams and open the trigger. Without `bind` in the configuration all capture devices
 * are used in the order of their ports, and `array` is updated with their positions.
 *
 * @param array  must outlive the capture; rows, cols and camera[] then describe frame[i] of a set
 * @return 0 (some cameras may be missing, logged), -ENODEV (no camera), or an error of the drivers; logged.
 */
SST_MUST_CHECK int sst_capture_open(struct sst_capture **out, struct sst_array_config *array,
                                    const struct sst_capture_events *events);

/** Open a capture from another source, with the cameras in array->camera[]; it has no trigger here, and sets are
 * assembled
 *  by the numbers of triggers that the source gives. @param source  must outlive the capture, which starts it */
SST_MUST_CHECK int sst_capture_open_source(struct sst_capture **out, struct sst_array_config *array,
                                           const struct sst_source *source, const struct sst_capture_events *events);

/**
 * Capture until `sets` framesets were passed on (0: until stopped).
 * @return 0, or the error that ended the trigger (-ENODEV: the chip vanished) or the loop
 */
SST_MUST_CHECK int sst_capture_run(struct sst_capture *capture, uint64_t sets);

/** Make run return as soon as the open sets are closed; async-signal-safe. */
void sst_capture_stop(struct sst_capture *capture);

/** Thread: the one of run (progress), or any once it has returned. */
void sst_capture_report(const struct sst_capture *capture, struct sst_capture_report *out);
/** Counters and device of one camera. */
void sst_capture_camera(const struct sst_capture *capture, int cam, struct sst_grab_counters *grab,
                        const struct sst_grab_device **device);

/** Clock of a GenICam camera by PTP. @return false: it is of another kind */
bool sst_capture_ptp(const struct sst_capture *capture, int cam, struct sst_genicam_ptp *out);
/** Cameras in the picture of each device. */
struct sst_grab_split sst_capture_split(const struct sst_array_config *array);
/** Share of a camera's frames that privacy masks make black, 0..1. */
double sst_capture_masked(const struct sst_capture *capture, int cam);

/** Settings of the cameras in an array's configuration, without bindings. */
void sst_capture_grab_config(struct sst_grab_config *cfg, const struct sst_array_config *array);
void sst_capture_genicam_config(struct sst_genicam_config *cfg, const struct sst_array_config *array);

/** The trigger of an array's configuration; not for free-run. */
void sst_capture_trigger_config(struct sst_trigger_config *cfg, const struct sst_array_config *array);

/** NULL is fine. */
void sst_capture_close(struct sst_capture *capture);

#endif
