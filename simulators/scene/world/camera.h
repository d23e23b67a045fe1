/* simulators/scene/world/camera.h - the true parameters of each simulated camera, and its geometry. */
#ifndef SST_SIMULATORS_SCENE_WORLD_CAMERA_H
#define SST_SIMULATORS_SCENE_WORLD_CAMERA_H

#include "simulators/scene/world/settings.h"
#include "simulators/scene/world/sim_world.h"

/** The ideal camera that all would be, of a scene at a size. */
struct sst_sim_optics {
    double focal_px, cx, cy; /* px, pixel centres on integers */
    double spacing_mm;
};

/**
 * One camera. A point X (mm, array axes: x right, y down, z forward, origin at the reference camera) is at
 * P = rotation (X - position_mm) in camera axes, a = P.x / P.z, b = P.y / P.z, r2 = a^2 + b^2, and is seen at
 *   x = fx a' + cx, y = fy b' + cy with a' = a (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 a b + p2 (r2 + 2 a^2),
 *   b' = b (...) + p1 (r2 + 2 b^2) + 2 p2 a b   (Brown 1966, as in OpenCV).
 */
struct sst_sim_camera {
    double fx, fy, cx, cy;
    double distortion[5]; /* k1 k2 p1 p2 k3 */
    double rotation[9];
    double position_mm[3];
    double gain[3]; /* of linear red, green, blue */
    struct sst_sim_timing timing;
};

/** Parameters of camera cam, by the settings' seed: the same for any size of the grid. */
void sst_sim_camera_make(struct sst_sim_camera *out, const struct sst_sim_settings *s,
                         const struct sst_sim_optics *ideal, int cam);

/**
 * Take the distortion away (Newton's method).
 *
 * @param u,v  distorted: (x - cx) / fx, (y - cy) / fy
 * @return false: no point is seen there, the lens folds over before it
 */
SST_MUST_CHECK bool sst_sim_camera_undistort(const struct sst_sim_camera *camera, double u, double v, double *a,
                                             double *b);

/** Turn a camera (in its own axes) and shift it, as the settings say that camera cam moves. */
void sst_sim_camera_move(struct sst_sim_camera *camera, const struct sst_sim_settings *s, int cam);

/** A number of the normal distribution. */
double sst_sim_normal(uint64_t *rng);

/** Turns about x, then y, then z, in degrees, as a matrix. */
void sst_sim_rotation(const double deg[3], double matrix[9]);

#endif
