/* daemon/capture/health.h - what is wrong with each camera's frames, told when it begins and when it ends. */
#ifndef SST_DAEMON_CAPTURE_HEALTH_H
#define SST_DAEMON_CAPTURE_HEALTH_H

#include <stdbool.h>

#include "daemon/capture/sets.h"

SST_EXTERN_C_BEGIN

/** A camera is well again after so many sets in a row with a good frame of it and without the trouble. */
#define SST_HEALTH_SETS 20

enum sst_trouble {
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
struct sst_health {
    struct {
        bool on;
        uint64_t events; /* since it began */
        int well;        /* sets since the last */
    } camera[SST_CAMERAS_MAX][SST_TROUBLES];
};

/** A frame came: note what its fault bits and its gap say. @param name  of the camera, for the log */
void sst_health_frame(struct sst_health *h, const struct sst_frame *frame, const char *name);

/** A frame ended outside a set. */
void sst_health_bucket(struct sst_health *h, const struct sst_frame *frame, enum sst_bucket bucket, const char *name);

/** A set has a frame of the camera. */
void sst_health_set(struct sst_health *h, int cam, const char *name);

SST_EXTERN_C_END

#endif
