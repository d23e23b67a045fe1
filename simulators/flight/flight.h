/* simulators/flight/flight.h - simulated arrays and flights over a forest: posed light fields with exact truth. */
#ifndef SST_SIMULATORS_FLIGHT_FLIGHT_H
#define SST_SIMULATORS_FLIGHT_FLIGHT_H

#include "pipeline/posed/posed.h"

struct sst_flight_config {
    int width, height; /* px; 0: of the flight */
    int rows, cols;    /* cameras of the array, or lines of the flight and pictures of each; 0: of the flight */
    uint64_t seed;     /* trees, ground, walkers; the same seed gives the same bytes */
    int moments;       /* of the array, 0.5 s apart, while walkers walk and the drone flies on; at least 1 */
    double cover;      /* trees per 100 m^2; below 0: of the flight */
    double turn_deg;   /* error of the compass: the poses that are written are turned about the vertical by this ... */
    double shake_deg;  /* ... and each by random angles of this standard deviation, about every axis */
    double drift_mm;   /* standard deviation of the written positions */
    bool unplaced;     /* write no poses */
    int threads;
    void (*progress)(void *arg, double done); /* as of sst_scene_write(), or NULL */
    void *progress_arg;
};

void sst_flight_config_defaults(struct sst_flight_config *cfg);

/** NULL-terminated list: forest (ten cameras on a rod under a drone, colour), flight (a thermal camera over a slope).
 */
const char *const *sst_flight_names(void);

/**
 * Write a posed light field with LF/truth: truth.json (true cameras, walkers by moment: position of their middle on the
 * ground, m), ground.obj (the terrain, m), behind.png or .pfm (the middle view without trees, of levels), and
 * depth.pfm (m along the middle view's axis, as it sees the forest) with floor.pfm (of the ground below the trees).
 * @return 0, -EINVAL (unknown name, absurd size; logged), -ENOMEM, or an output error; logged
 */
SST_MUST_CHECK int sst_flight_write(const char *name, const struct sst_flight_config *cfg, const char *out, bool force);

#endif
