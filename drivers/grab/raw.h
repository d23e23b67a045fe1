/* drivers/grab/raw.h - sizes of uncompressed V4L2 formats, and names of all. Only for drivers/grab. */
#ifndef SST_DRIVERS_GRAB_RAW_H
#define SST_DRIVERS_GRAB_RAW_H

#include <stdbool.h>

#include "base/base.h"

/** Bytes that a whole frame takes at least, 0 for formats not known here. @param stride  bytes of a luma row; 0: packed
 */
size_t sst_raw_bytes(uint32_t fourcc, int width, int height, size_t stride);

/** Four characters as v4l2-ctl writes them; what is not printable is a dot. */
void sst_fourcc_name(char out[5], uint32_t fourcc);

/** FNV-like hash of whole frames, 32 bytes a step: two frames of equal hash are taken for the same. */
uint64_t sst_frame_hash(const uint8_t *data, size_t bytes);

#endif
