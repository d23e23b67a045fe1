/* simulators/scene/internal.h - the scene object, shared by scene.c and write.c. */
#ifndef SST_SIMULATORS_SCENE_INTERNAL_H
#define SST_SIMULATORS_SCENE_INTERNAL_H

#include "simulators/scene/world.h"

#define SST_SCENE_MAX_VIEWS 256

struct sst_scene {
    struct sst_scene_config cfg;
    struct sst_world world;
    double range_min_px, range_max_px;
};

/** A raster of one view with all outputs NULL. */
void sst_scene_raster(const struct sst_scene *scene, double bx, double by, unsigned hidden, struct sst_raster *out);

#endif
