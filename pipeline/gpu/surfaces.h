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

enum sst_gpu_surface_rows_buffer {
    SST_GPU_SURFACE_ROWS_MAP = 0, /* of the view */
    SST_GPU_SURFACE_ROWS_OUT = 1, /* out, uint32_t[4][height][width]: farthest | nearest << 16 of each window
                                     (SST_DISP_NONE and 0 where nothing is known), then a bit per window: it holds no
                                     step */
};

/** `surface_project`, a layer of groups per other view: where its disparities put its pixels in the view. */
struct sst_gpu_surface_project {
    int32_t width, height;
};

enum sst_gpu_surface_project_buffer {
    SST_GPU_SURFACE_PROJECT_OTHERS = 0,    /* struct sst_gpu_check_other[] */
    SST_GPU_SURFACE_PROJECT_MAPS = 1,      /* of all views */
    SST_GPU_SURFACE_PROJECT_PROJECTED = 2, /* in and out, uint32_t[2][height][width]: farthest (SST_DISP_NONE: none),
                                              nearest (0: none) */
};

/** `surface_list`: windows along columns, and each pixel's hypotheses. */
struct sst_gpu_surface_list {
    int32_t width, height;
    int32_t apart;      /* least difference between two hypotheses, 1/64 px */
    int32_t cell, cols; /* of the peaks: pixels of a side, cells of a row */
};

enum sst_gpu_surface_list_buffer {
    SST_GPU_SURFACE_LIST_MAP = 0,    /* of the view */
    SST_GPU_SURFACE_LIST_PIXELS = 1, /* of the view, with depth codes: hypotheses.h */
    SST_GPU_SURFACE_LIST_ROWS = 2,
    SST_GPU_SURFACE_LIST_PROJECTED = 3,
    SST_GPU_SURFACE_LIST_PEAKS = 4,  /* of `sweep_peaks` */
    SST_GPU_SURFACE_LIST_OUT = 5,    /* out, uint16_t[pixels][SST_HYPOTHESES]: unused ones repeat the last, or are 0 */
    SST_GPU_SURFACE_LIST_COUNTS = 6, /* out, uint32_t[pixels]: how many */
};

#endif
