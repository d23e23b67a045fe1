/* simulators/scene/models.h - toy-sized models: animals, vehicles. */
#ifndef SST_SIMULATORS_SCENE_MODELS_H
#define SST_SIMULATORS_SCENE_MODELS_H

#include "simulators/scene/world.h"

/** A model stands at `base` on the ground, its front turned by `yaw` rad from the picture's right towards the cameras;
 *  `scale` is that of the model to the real thing. */
struct sst_stand {
    struct sst_vec3 base;
    double scale, yaw;
};

void sst_add_horse(struct sst_world *w, struct sst_stand at);
void sst_add_bicycle(struct sst_world *w, struct sst_stand at);
void sst_add_motorcycle(struct sst_world *w, struct sst_stand at);
void sst_add_humvee(struct sst_world *w, struct sst_stand at);
void sst_add_cat(struct sst_world *w, struct sst_stand at);
void sst_add_hen(struct sst_world *w, struct sst_stand at);

#endif
