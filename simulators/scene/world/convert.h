/* simulators/scene/world/convert.h - decoded frames in the sizes and pixel formats that cameras deliver. */
#ifndef SST_SIMULATORS_SCENE_WORLD_CONVERT_H
#define SST_SIMULATORS_SCENE_WORLD_CONVERT_H

#include <stdbool.h>

#include "pipeline/image/image.h"

/** Mean of the pixels under each pixel of a smaller picture. @param out  out, initialised by the caller */
void sst_sim_shrink(const struct sst_image *in, struct sst_image *out);

/** Bytes of a frame of an uncompressed format; 0: no camera offers this format. */
size_t sst_sim_format_bytes(uint32_t fourcc, int width, int height);

/** Pack a picture without padding; Bayer takes one colour of each pixel. @param out [sst_sim_format_bytes()] */
void sst_sim_pack(const struct sst_image *img, uint32_t fourcc, uint8_t *out);

/** Set rows 0 .. height-1 of a packed picture to grey luma. @param luma [height][width] */
void sst_sim_pack_luma(const uint8_t *luma, int width, int height, uint32_t fourcc, uint8_t *out);

#endif
