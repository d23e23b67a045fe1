/* simulators/scene/world/truth.h - all true parameters of a world as JSON. */
#ifndef SST_SIMULATORS_SCENE_WORLD_TRUTH_H
#define SST_SIMULATORS_SCENE_WORLD_TRUTH_H

#include "simulators/scene/world/render.h"

/** @return 0, -ENOMEM, or what a failed output returns; logged */
SST_MUST_CHECK int sst_sim_truth_write(const struct sst_sim_settings *settings, const struct sst_sim_stage *stage,
                                       const char *path);

/**
 * The same as a calibration in the reference camera's axes (pipeline/camera/calib.h), of an array's cameras before they
 * move; of a rig at the places one spacing apart that make its light field, at which it looks straight ahead. A
 * calibration's fall-off is about the principal point, the world's about the middle: exact where those agree.
 * @return as above, -EINVAL (not finite)
 */
SST_MUST_CHECK int sst_sim_truth_calib(const struct sst_sim_settings *settings, const struct sst_sim_stage *stage,
                                       const char *path);

#endif
