/* simulators/flight/flight.h - simulated arrays and flights over a forest: posed light fields with exact truth. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
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

/* --- the forest of simulated worlds (simulators/scene/world/) --- */

#define SST_FOREST_FOCAL   2129   /* px of 1000 of the picture's width */
#define SST_FOREST_SPACING 1000.0 /* mm between cameras */

struct sst_flight_forest; /* opaque; read-only after open */

struct sst_flight_forest_config {
    uint64_t seed;
    double high_m; /* of the cameras above the ground */
    double trees;  /* per 100 m^2; 0: the ground and its walkers alone, the same ones */
    double half_m[2]; /* half extent of the cameras along x and y */
    double aspect;    /* height of a picture over its width */
};

/** @return 0, -ENOMEM */
SST_MUST_CHECK int sst_flight_forest_open(struct sst_flight_forest **out, const struct sst_flight_forest_config *cfg);
void sst_flight_forest_close(struct sst_flight_forest *forest);

/**
 * Draw the forest as a camera in the axes of the array sees it: x east, y south, z down, mm, the origin high_m above
 * the ground. Its lens has no distortion.
 *
 * @param image  out, initialised by the caller @return 0, -ENOMEM.   Thread: any.
 */
SST_MUST_CHECK int sst_flight_forest_draw(const struct sst_flight_forest *forest,
                                          const struct sst_calib_camera *camera, double time_s,
                                          struct sst_image *image);

#endif
