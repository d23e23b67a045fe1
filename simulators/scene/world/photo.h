/* simulators/scene/world/photo.h - light on the sensor: exposure, gains, vignetting, noise. Bytes are sRGB, light is linear.
 */
#ifndef SST_SIMULATORS_SCENE_WORLD_PHOTO_H
#define SST_SIMULATORS_SCENE_WORLD_PHOTO_H

#include "pipeline/image/image.h"
#include "simulators/scene/world/camera.h"

/** Multiply the light of a picture. */
void sst_sim_light(struct sst_image *img, double factor);

struct sst_sim_photo; /* opaque; read-only after create */

SST_MUST_CHECK int sst_sim_photo_create(struct sst_sim_photo **out, const struct sst_sim_settings *settings);
void sst_sim_photo_destroy(struct sst_sim_photo *photo);

struct sst_sim_exposing {
    const struct sst_sim_camera *camera;
    double light;  /* of the scene; 1: nominal */
    uint64_t seed; /* of the noise */
};

/**
 * What the sensor makes of a picture: light times the camera's gain times 1 - vignetting r^2 (r from the
 * principal point in half diagonals of the picture), then noise of standard deviation sqrt(e + read^2) electrons where
 * white is full_well_e, then sRGB. An ideal camera's picture is copied as it is.
 *
 * @param out  of the size of in, initialised by the caller; may be in itself
 */
void sst_sim_photo_expose(const struct sst_sim_photo *photo, const struct sst_sim_exposing *e,
                          const struct sst_image *in, struct sst_image *out);

#endif
