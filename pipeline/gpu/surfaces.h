/* pipeline/gpu/surfaces.h - the shaders that gather the hypotheses of the second pass of matching: the surfaces around
 * each pixel of a view, those that other views project onto it, the list of both and of what the sweep finds.
 *
 * All numbers are integers, and equal those of sst_around_init() and sst_around_list() on every device. All shaders
 * have groups of 32 x 8 pixels.
 */
#ifndef SST_PIPELINE_GPU_SURFACES_H
#define SST_PIPELINE_GPU_SURFACES_H

#include "pipeline/gpu/check.h"

/* Structures have the layout of the shaders (std430). Maps are SST_PLANE_MAP of pipeline/step/planes.h. */

#define SST_GPU_SURFACE_WINDOWS 3 /* of 2, 6 and 16 pixels to each side */

/** `surface_rows`: windows along rows. */
struct sst_gpu_surface_rows {
    int32_t width, height;
    int32_t step; /* a larger difference to the pixel on the right or below is a step, 1/64 px */
};

/** `surface_project`, a layer of groups per other view: where its disparities put its pixels in the view. */
struct sst_gpu_surface_project {
    int32_t width, height;
};

/** `surface_list`: windows along columns, and each pixel's hypotheses. */
struct sst_gpu_surface_list {
    int32_t width, height;
    int32_t apart;      /* least difference between two hypotheses, 1/64 px */
    int32_t cell, cols; /* of the peaks: pixels of a side, cells of a row */
};

#endif
