/* pipeline/gpu/carry.h - the shaders that carry the maps of views to another one: what arrives at each pixel, the
 * nearest surface first, and gaps of a pixel in it.
 *
 * All numbers are integers, and equal those of sst_disparity_carry() on every device; what nothing arrives at
 * (sst_fill_background()) is not among them. All shaders have groups of 32 x 8 pixels.
 */
#ifndef SST_PIPELINE_GPU_CARRY_H
#define SST_PIPELINE_GPU_CARRY_H

#include "pipeline/gpu/check.h"

/* Structures have the layout of the shaders (std430). Maps are SST_PLANE_MAP of pipeline/step/planes.h. */

/** `carry_project` with a layer of groups per source (16 at most), then `carry_close`. */
struct sst_gpu_carry {
    int32_t width, height;
    int32_t agreed;  /* not 0: wanted; else only the first one of `arrived` is used */
    int32_t checked; /* not 0: pixels that the check calls correct come first, and their results are correct */
};

enum sst_gpu_carry_project_buffer {
    SST_GPU_CARRY_PROJECT_SOURCES = 0, /* struct sst_gpu_check_other[] */
    SST_GPU_CARRY_PROJECT_MAPS = 1,
    SST_GPU_CARRY_PROJECT_ARRIVED = 2, /* in and out, uint32_t[1 or 3][height][width]: the largest of disparity + 1 << 8
                                          | correct << 7 | half of the confidence (0: nothing); the farthest disparity
                                          (SST_DISP_NONE); bits of the sources (0) */
};

enum sst_gpu_carry_close_buffer {
    SST_GPU_CARRY_CLOSE_ARRIVED = 0,
    SST_GPU_CARRY_CLOSE_OUT = 1, /* out: the view's map, gaps closed */
};

#endif
