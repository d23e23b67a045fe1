/* simulators/scene/world/render.h - pictures of a world: its surfaces at any time, as each camera sees them. */
#ifndef SST_SIMULATORS_SCENE_WORLD_RENDER_H
#define SST_SIMULATORS_SCENE_WORLD_RENDER_H

#include "pipeline/image/image.h"
#include "simulators/scene/world.h"
#include "simulators/scene/world/camera.h"
#include "simulators/scene/world/settings.h"

struct sst_sim_stage; /* opaque; read-only after open */

/**
 * @param settings  must stay
 * @return 0, -EINVAL (a scene that is not there, a lens that folds the picture over; logged), -ENOMEM
 */
SST_MUST_CHECK int sst_sim_stage_open(struct sst_sim_stage **out, const struct sst_sim_settings *settings);
void sst_sim_stage_close(struct sst_sim_stage *stage);

const struct sst_sim_optics *sst_sim_stage_optics(const struct sst_sim_stage *stage);
const struct sst_sim_camera *sst_sim_stage_camera(const struct sst_sim_stage *stage, int cam);
/** The camera as it is from frame *at of the loop on; NULL: it does not move. */
const struct sst_sim_camera *sst_sim_stage_moved(const struct sst_sim_stage *stage, int cam, int *at);
/** The board with all its poses; kind SST_SIM_NO_BOARD: there is none. */
const struct sst_sim_board *sst_sim_stage_board(const struct sst_sim_stage *stage);
/** How long the loop is. */
int sst_sim_stage_frames(const struct sst_sim_stage *stage);

/** What is told each picture, in order; it is of native size and lent. @return 0 or a negative errno, which ends. */
typedef int sst_sim_picture_fn(void *arg, int frame, const struct sst_image *image);

/** Render the whole loop of a camera of an array. @return 0, -ENOMEM or what fn returned.   Thread: any. */
SST_MUST_CHECK int sst_sim_stage_loop(const struct sst_sim_stage *stage, int cam, sst_sim_picture_fn *fn, void *arg);

/** Render one picture of the rig's camera. @return as above.   Thread: any. */
SST_MUST_CHECK int sst_sim_stage_pose(const struct sst_sim_stage *stage, const int32_t pose_um[3], int frame,
                                      sst_sim_picture_fn *fn, void *arg);

/**
 * What an eye sees along many rays, exactly: boards are surfaces here.
 *
 * @param rays   where they cross the ideal picture of that eye, as set with sst_warp_init(); indexed here
 * @param depth  out, mm from the eye along z, 0: nothing; of the rays' size, as label is; either may be NULL
 * @return 0 or -ENOMEM.   Thread: any.
 */
SST_MUST_CHECK int sst_sim_stage_look(const struct sst_sim_stage *stage, int frame, const double eye_mm[3],
                                      struct sst_warp *rays, struct sst_map_f32 *depth, struct sst_map_u8 *label);

#endif
