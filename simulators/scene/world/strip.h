/* simulators/scene/world/strip.h - the machine-readable strip along a simulated frame's upper edge. */
#ifndef SST_SIMULATORS_SCENE_WORLD_STRIP_H
#define SST_SIMULATORS_SCENE_WORLD_STRIP_H

#include <stdbool.h>

#include "simulators/scene/world/sim_world.h"

/*
 * Cells of 8x8 px, black (luma 16) for 0 and white (240) for 1, in rows from the upper left; after the last bit black.
 * Each cell is one block of a JPEG. Numbers are unsigned, high bit first, and clamped to what fits:
 *   camera 8 | trigger 40 | start of exposure, ns 56 | exposure, us 20 | gain in 1/64 12 | pose x, y, z in um, two's
 *   complement 3 x 24 | CRC-32 (IEEE 802.3) of the 26 bytes before 32
 */
#define SST_STRIP_CELL  8
#define SST_STRIP_BITS  240
#define SST_STRIP_BYTES (SST_STRIP_BITS / 8)
#define SST_STRIP_BLACK 16
#define SST_STRIP_WHITE 240

/** Rows of pixels that the strip takes in a frame this wide (a multiple of 8; 24 at 640). */
int sst_strip_height(int width);

/** The strip's bits, high bit of the first byte first. */
void sst_strip_pack(const struct sst_sim_exposure *exposure, uint8_t bits[SST_STRIP_BYTES]);

/** Colour of cell i: bit i, and 0 after the last. */
static inline bool sst_strip_cell(const uint8_t bits[SST_STRIP_BYTES], int i)
{
    return i < SST_STRIP_BITS && (bits[i / 8] >> (7 - i % 8) & 1);
}

/** Draw the strip into luma. @param luma [sst_strip_height(width)][stride] */
void sst_strip_draw(uint8_t *luma, size_t stride, int width, const struct sst_sim_exposure *exposure);

/**
 * Read a strip from decoded luma; the height may be that of the strip alone.
 *
 * @return 0 or -EBADMSG (no strip, a cell neither black nor white, or the checksum is wrong)
 */
SST_MUST_CHECK int sst_strip_read(const uint8_t *luma, size_t stride, int width, int height,
                                  struct sst_sim_exposure *exposure);

#endif
