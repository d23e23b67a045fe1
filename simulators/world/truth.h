/* simulators/world/truth.h - all true parameters of a world as JSON. */
#ifndef SST_SIMULATORS_WORLD_TRUTH_H
#define SST_SIMULATORS_WORLD_TRUTH_H

#include "simulators/world/render.h"

SST_EXTERN_C_BEGIN

/** @return 0, -ENOMEM, or what a failed output returns; logged */
SST_MUST_CHECK int sst_sim_truth_write(const struct sst_sim_settings *settings, const struct sst_sim_stage *stage,
                                       const char *path);

SST_EXTERN_C_END

#endif
