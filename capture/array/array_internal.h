/* capture/array/array_internal.h - faults of each camera's frames, logged when they start and when they end; the
 * cameras of this host as a source. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ARRAY_ARRAY_INTERNAL_H
#define SST_CAPTURE_ARRAY_ARRAY_INTERNAL_H

#include <stdbool.h>

#include "capture/array/frame_sync.h"
#include "capture/array/source.h"
#include "config/array.h"
#include "drivers/genicam/genicam.h"

/** A fault has ended after this number of consecutive sets with a good frame of the camera and without the fault ... */
#define SST_HEALTH_SETS 20
/** ... and this number doubles each time the fault recurs within SST_HEALTH_AGAIN sets, up to SST_HEALTH_SETS_MAX: an
 *  intermittent fault is logged only a few times. */
#define SST_HEALTH_AGAIN    6000
#define SST_HEALTH_SETS_MAX 10240

/** Longest name of a camera, with its NUL. */
#define SST_HEALTH_NAME 96

enum trouble {
    SST_TROUBLE_FLAGGED = 0,
    SST_TROUBLE_CUT = 1,     /* empty, short or truncated */
    SST_TROUBLE_DAMAGED = 2, /* wrong start or structure */
    SST_TROUBLE_STAMP = 3,   /* time stamps jump */
    SST_TROUBLE_LOST = 4,    /* gaps in the driver's sequence */
    SST_TROUBLE_FROZEN = 5,
    SST_TROUBLE_LATE = 6,
    SST_TROUBLE_DUPLICATE = 7,
    SST_TROUBLE_STRAY = 8,
    SST_TROUBLE_UNFIT = 9, /* another size than agreed, or fields */
    SST_TROUBLES = 10,
};

/** Zeroed: no faults. */
struct health {
    struct {
        bool on, began, ended; /* active; started and ended since the last health_log() */
        uint64_t events;       /* frames since it started */
        int well;              /* sets since the last event */
        int need;              /* sets required to end it; 0: never occurred */
    } camera[SST_CAMERAS_MAX][SST_TROUBLES];
};

/** Record the fault bits and the gap of a frame that arrived. */
void health_frame(struct health *h, const struct sst_frame *frame);

/** Record a frame that ended outside of a set. */
void health_bucket(struct health *h, const struct sst_frame *frame, enum sst_bucket bucket);

/** Record that a set has a frame of the camera. */
void health_set(struct health *h, int cam);

/**
 * Log faults that started or ended since the last call: one line for each kind, for any number of cameras.
 *
 * Call it about once a second.
 * @param name  of the cameras, for the log
 * @return number of lines logged
 */
int health_log(struct health *h, int cameras, const char (*name)[SST_HEALTH_NAME]);

/** Cutter of JPEGs that show several cameras. */
extern const struct sst_grab_cutter array_jpeg_cutter;

/* --- cameras of this host, of all kinds --------------------------------------------------------------------------- */

struct cameras; /* opaque */

/** Open all cameras of the configuration, as sst_grab_open(); `cam` of events is the index in it. @return 0 or -errno,
 * logged */
SST_MUST_CHECK int cameras_open(struct cameras **out, const struct sst_array_config *array,
                                const struct sst_grab_events *events);
/** As sst_grab_start(). @return 0 or -errno */
SST_MUST_CHECK int cameras_start(struct cameras *cameras);
/** A trigger was fired: expose cameras that wait for a command.  Thread: any; does not wait. */
void cameras_fire(struct cameras *cameras, int64_t t_ns);
/** As sst_grab_expect(). */
void cameras_expect(struct cameras *cameras, int64_t t_ns);
/** @return false: no clock of its own */
bool cameras_ptp(const struct cameras *cameras, int cam, struct sst_genicam_ptp *out);
void cameras_close(struct cameras *cameras);

/** A struct cameras; without `start`. */
extern const struct sst_source_ops cameras_source_ops;

#endif
