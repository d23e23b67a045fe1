/* simulators/world/strip.h - the machine-readable strip along a simulated frame's upper edge. */
#ifndef SST_SIMULATORS_WORLD_STRIP_H
#define SST_SIMULATORS_WORLD_STRIP_H

#include "simulators/world/sim_world.h"

SST_EXTERN_C_BEGIN

/** Rows of pixels that the strip takes in a frame this wide (a multiple of 8). */
int sst_strip_height(int width);

/** Draw the strip: cells of 8x8 px, black or white, checksum last. @param luma [height of the strip][stride] */
void sst_strip_draw(uint8_t *luma, size_t stride, int width, const struct sst_sim_exposure *exposure);

/** Read a strip from decoded luma. @return 0 or -EBADMSG (no strip, or its checksum is wrong). */
SST_MUST_CHECK int sst_strip_read(const uint8_t *luma, size_t stride, int width, int height,
                                  struct sst_sim_exposure *exposure);

SST_EXTERN_C_END

#endif
