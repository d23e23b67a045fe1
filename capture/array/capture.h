/* capture/array/capture.h - the array at work: cameras, trigger and sets on one thread, whole sets to a writer on
 * another. */
#ifndef SST_CAPTURE_ARRAY_CAPTURE_H
#define SST_CAPTURE_ARRAY_CAPTURE_H

#include "base/histogram.h"
#include "capture/array/sets.h"
#include "config/array.h"
#include "drivers/grab/grab.h"
#include "drivers/trigger/trigger.h"

struct sst_capture; /* opaque; open, run and close on one thread */

struct sst_capture_events {
    void *arg;
    /** Take a set, on the writer's thread; its frames go back when this returns. An error drops the set, counted. */
    int (*set)(void *arg, const struct sst_set *set);
    /** Told about once a second and at the end, on the capturing thread; may be NULL. */
    void (*progress)(void *arg, uint64_t sets);
    /** A camera changed its state, on the capturing thread; may be NULL. Already logged. */
    void (*camera)(void *arg, int cam, enum sst_grab_state state, const char *why);
    bool quiet; /* of the trigger's chip and of skew, which the report tells, nothing is logged: the caller does */
    bool again; /* the same was opened before and failed: what was said then of too few or many cameras is not repeated
                 */
};

struct sst_capture_report {
    uint64_t handed, complete, empty; /* sets handed to the writer; of them with every camera, with none */
    struct sst_sets_counters sets;
    uint64_t edges, edges_stamped, beats_skipped; /* triggers fired; with a loop-back stamp; too late to fire */
    uint64_t refused;                             /* sets that the writer could not take */
    uint64_t skewed;                              /* sets with more skew than the limit */
    struct sst_histogram skew_ns, from_edge_ns; /* of sets with two frames or more; of those with an edge, magnitude */
    bool trigger_away;                          /* its chip has gone, for now */
    int worst_cam;                              /* of the set with the most skew; -1 */
    struct sst_grab_counters grab;              /* sums over the cameras */
    uint64_t unexplained; /* frames that neither wait nor ended in one bucket: 0, or a bug is to be reported */
};

/**
 * Find the cameras, start their streams and open the trigger. With no `bind` in the configuration all capture devices
 * are taken, by port; `array` is then changed to say where each sits.
 *
 * @param array  must stay; rows, cols and camera[] afterwards hold for set.frame[i]
 * @return 0 (some cameras may be missing, logged), -ENODEV (none is there), or what drivers return; logged.
 */
SST_MUST_CHECK int sst_capture_open(struct sst_capture **out, struct sst_array_config *array,
                                    const struct sst_capture_events *events);

/**
 * Capture until that many sets were handed on (0: until stopped).
 * @return 0, or the error that ended the trigger (-ENODEV: the chip went) or the loop
 */
SST_MUST_CHECK int sst_capture_run(struct sst_capture *capture, uint64_t sets);

/** Make run return when the sets that are open are closed; async-signal-safe. */
void sst_capture_stop(struct sst_capture *capture);

/** Thread: that of run (progress), or any once it has returned. */
void sst_capture_report(const struct sst_capture *capture, struct sst_capture_report *out);
/** A camera's own numbers: what it delivered and where its frames ended [SST_BUCKETS]. */
void sst_capture_camera(const struct sst_capture *capture, int cam, struct sst_grab_counters *grab,
                        const struct sst_grab_device **device);

/** What is asked of cameras by an array's configuration; which ones is left open. */
void sst_capture_grab_config(struct sst_grab_config *cfg, const struct sst_array_config *array);

/** The trigger that an array's configuration describes; not for free-run. */
void sst_capture_trigger_config(struct sst_trigger_config *cfg, const struct sst_array_config *array);

/** NULL is fine. */
void sst_capture_close(struct sst_capture *capture);

#endif
