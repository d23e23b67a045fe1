/* simulators/flight/flight_internal.h - world of triangles, and pictures of it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_FLIGHT_FLIGHT_INTERNAL_H
#define SST_SIMULATORS_FLIGHT_FLIGHT_INTERNAL_H

#include "pipeline/image/deep.h"
#include "simulators/flight/flight.h"
#include "simulators/scene/noise.h"

enum flight_matter { GROUND, BARK, LEAF, CLOTH, SKIN, MATTERS };

struct flight_triangle {
    int32_t corner[3];
    uint8_t matter;
    uint8_t shade; /* of light from above, 255: full */
    uint8_t rgb[3];
    bool tree; /* hidden in pictures behind the trees */
};

/** Triangles in metres: x east, y north, z up. */
struct flight_mesh {
    struct sst_vec3 *vertex;
    struct flight_triangle *triangle;
    size_t vertices, triangles, vertex_room, triangle_room;
    bool failed; /* out of memory */
};

struct flight_walker {
    struct sst_vec3 start; /* at time 0, on the ground */
    double heading, speed; /* rad from east, m/s */
    bool lies;
    uint8_t rgb[3];
};

#define FLIGHT_WALKERS 4

struct flight_world {
    uint64_t seed;
    bool thermal;
    double slope[2];  /* m of height a metre along x and y */
    double extent[4]; /* x0, y0, x1, y1 of the ground, m */
    double trees;     /* per 100 m^2 */
    struct flight_walker walker[FLIGHT_WALKERS];
    int walkers;
    struct flight_mesh mesh; /* ground, then trees */
    size_t ground_vertices, ground_triangles;
};

/** Height of the ground, m. */
double flight_ground(const struct flight_world *w, double x, double y);

/** Ground and trees. @return 0, -ENOMEM. flight_world_fini() frees them. */
SST_MUST_CHECK int flight_world_init(struct flight_world *w);
void flight_world_fini(struct flight_world *w);

/** Walkers by the seed, their starts within half_x and half_y of the origin, m. */
void flight_place_walkers(struct flight_world *w, double half_x, double half_y);

/** Place of a walker at a time. */
struct sst_vec3 flight_walker_at(const struct flight_world *w, int walker, double time_s);

/** Walkers at a time, as a mesh of their own. @return 0, -ENOMEM */
SST_MUST_CHECK int flight_walkers_mesh(struct flight_mesh *out, const struct flight_world *w, double time_s);
void flight_mesh_fini(struct flight_mesh *mesh);

struct flight_picture {
    const struct flight_world *world;
    const struct flight_mesh *walkers;
    const struct sst_calib_camera *camera; /* position in mm */
    bool hide_trees;
    uint32_t noise_seed; /* 0: no sensor noise */
};

/** Levels of a picture, initialised by the caller: 3 channels of 8 bits, or one thermal of 16 bits.
 *  @param depth  m along the camera's axis; NULL: not wanted @return 0, -ENOMEM */
SST_MUST_CHECK int flight_draw(const struct flight_picture *p, struct sst_deep *out, struct sst_map_f32 *depth);

/** Add the samples of each walker that a picture of this size shows. @return 0, -ENOMEM */
SST_MUST_CHECK int flight_show(const struct flight_picture *p, int width, int height, int64_t shown[FLIGHT_WALKERS]);

#define FLIGHT_KELVIN_SCALE 0.04 /* thermal levels: K a level */

#endif
