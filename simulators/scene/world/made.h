/* simulators/scene/world/made.h - frames made on demand, kept until their memory is needed for others. */
#ifndef SST_SIMULATORS_SCENE_WORLD_MADE_H
#define SST_SIMULATORS_SCENE_WORLD_MADE_H

#include "simulators/scene/world/jpeg.h"

/** What a made frame depends on. */
struct sst_sim_made_key {
    int cam, frame;
    int32_t pose_um[3];
    uint32_t fourcc;
    int width, height;
    int light; /* exposure times gain against the nominal one, in 1/1024 */
};

struct sst_sim_made; /* opaque; one thread at a time */

/** @param budget_bytes  of all frames kept; the least recently used one goes first */
SST_MUST_CHECK int sst_sim_made_create(struct sst_sim_made **out, int cams, size_t budget_bytes);
void sst_sim_made_destroy(struct sst_sim_made *made);

/** The frame of a key, or NULL; valid until the next call. A packed frame has scan = rest = 0. */
const struct sst_sim_jpeg *sst_sim_made_find(struct sst_sim_made *made, const struct sst_sim_made_key *key);

/** Keep a frame: its data is taken over, also on failure. @return 0 or -ENOMEM */
SST_MUST_CHECK int sst_sim_made_keep(struct sst_sim_made *made, const struct sst_sim_made_key *key,
                                     const struct sst_sim_jpeg *frame);

#endif
