/* capture/array/array_internal.h - what is wrong with each camera's frames, told when it begins and when it ends. */
#ifndef SST_CAPTURE_ARRAY_ARRAY_INTERNAL_H
#define SST_CAPTURE_ARRAY_ARRAY_INTERNAL_H

#include <stdbool.h>

#include "capture/array/sets.h"

/** A camera is well again after so many sets in a row with a good frame of it and without the trouble ... */
#define SST_HEALTH_SETS 20
/** ... and after twice as many each time that it comes again within SST_HEALTH_AGAIN sets, up to SST_HEALTH_SETS_MAX:
 *  what comes and goes is told a few times, not for months. */
#define SST_HEALTH_AGAIN    6000
#define SST_HEALTH_SETS_MAX 10240

/** Longest name of a camera, with its end. */
#define SST_HEALTH_NAME 96

enum trouble {
    SST_TROUBLE_FLAGGED = 0,
    SST_TROUBLE_CUT = 1,     /* empty, short or without its end */
    SST_TROUBLE_DAMAGED = 2, /* wrong start or structure */
    SST_TROUBLE_STAMP = 3,   /* time stamps jump */
    SST_TROUBLE_LOST = 4,    /* gaps in the driver's sequence */
    SST_TROUBLE_FROZEN = 5,
    SST_TROUBLE_LATE = 6,
    SST_TROUBLE_DUPLICATE = 7,
    SST_TROUBLE_STRAY = 8,
    SST_TROUBLES = 9,
};

/** Zeroed: all is well. */
struct health {
    struct {
        bool on, began, ended; /* it is so; since the last telling */
        uint64_t events;       /* since it began */
        int well;              /* sets since the last */
        int need;              /* of them, until it is over; 0: it never was */
    } camera[SST_CAMERAS_MAX][SST_TROUBLES];
};

/** A frame came: note what its fault bits and its gap say. */
void health_frame(struct health *h, const struct sst_frame *frame);

/** A frame ended outside a set. */
void health_bucket(struct health *h, const struct sst_frame *frame, enum sst_bucket bucket);

/** A set has a frame of the camera. */
void health_set(struct health *h, int cam);

/**
 * Log what began and what ended since the last call: a line for each kind of trouble, however many cameras have it.
 *
 * To be called about once a second.
 * @param name  of the cameras, for the log
 * @return lines that were logged
 */
int health_log(struct health *h, int cameras, const char (*name)[SST_HEALTH_NAME]);

#endif
