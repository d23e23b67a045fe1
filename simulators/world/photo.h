/* simulators/world/photo.h - light on the sensor: exposure, gains, vignetting, noise. */
#ifndef SST_SIMULATORS_WORLD_PHOTO_H
#define SST_SIMULATORS_WORLD_PHOTO_H

#include "pipeline/image/image.h"
#include "simulators/world/camera.h"

SST_EXTERN_C_BEGIN

/** Multiply the light of a picture: bytes are sRGB, light is linear. */
void sst_sim_expose(struct sst_image *img, double factor);

SST_EXTERN_C_END

#endif
