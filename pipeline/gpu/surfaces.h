/* pipeline/gpu/surfaces.h - the shaders that gather the hypotheses of the second pass of matching: the surfaces around
 * each pixel of a view, those that other views project onto it, the list of both and of what the sweep finds.
 *
 * All numbers are integers, and equal those of sst_around_init() and sst_around_list() on every device. All shaders
 * have groups of 32 x 8 pixels.
 */
#ifndef SST_PIPELINE_GPU_SURFACES_H
#define SST_PIPELINE_GPU_SURFACES_H

#include "pipeline/gpu/check.h"

/* Structures have the layout of the shaders (std430). Maps are uint32_t[height][width] by view: disparity,
 * SST_DISP_NONE if it is not known, and flags. */
#define SST_GPU_SURFACE_UNSEEN (1U << 16) /* the pixel must not be matched */
#define SST_GPU_SURFACE_AGREED (1U << 17) /* its disparity stays if it is known */

#define SST_GPU_SURFACE_WINDOWS 3 /* of 2, 6 and 16 pixels to each side */

/** `surface_start`: windows along rows; nothing is projected, and no points have gathered. */
struct sst_gpu_surface_start {
    int32_t width, height;
    uint32_t own;   /* the view's pixel (0, 0) */
    int32_t step;   /* a larger difference to the pixel on the right or below is a step, 1/64 px */
    uint32_t words; /* of the weights */
};

enum sst_gpu_surface_start_buffer {
    SST_GPU_SURFACE_START_MAPS = 0,
    SST_GPU_SURFACE_START_ROWS = 1,      /* out, uint32_t[4][height][width]: farthest | nearest << 16 of each window
                                            (SST_DISP_NONE and 0 where nothing is known), then a bit per window: it holds
                                            no step */
    SST_GPU_SURFACE_START_PROJECTED = 2, /* out, uint32_t[2][height][width]: SST_DISP_NONE, 0 */
    SST_GPU_SURFACE_START_WEIGHTS = 3,   /* out, uint32_t[words]: 0 */
    SST_GPU_SURFACE_START_BUFFERS
};

/** `surface_project`, a layer of groups per other view: where its disparities put its pixels in the view. */
struct sst_gpu_surface_project {
    int32_t width, height;
};

enum sst_gpu_surface_project_buffer {
    SST_GPU_SURFACE_PROJECT_OTHERS = 0,    /* struct sst_gpu_check_other[] */
    SST_GPU_SURFACE_PROJECT_MAPS = 1,      /* of all views */
    SST_GPU_SURFACE_PROJECT_PROJECTED = 2, /* in and out: farthest, nearest */
    SST_GPU_SURFACE_PROJECT_BUFFERS
};

/** `surface_list`: windows along columns, and each pixel's hypotheses. */
struct sst_gpu_surface_list {
    int32_t width, height;
    uint32_t own;
    int32_t apart;      /* least difference between two hypotheses, 1/64 px */
    int32_t cell, cols; /* of the peaks: pixels of a side, cells of a row */
};

enum sst_gpu_surface_list_buffer {
    SST_GPU_SURFACE_LIST_MAPS = 0,
    SST_GPU_SURFACE_LIST_ROWS = 1,
    SST_GPU_SURFACE_LIST_PROJECTED = 2,
    SST_GPU_SURFACE_LIST_PEAKS = 3,  /* of `sweep_peaks` */
    SST_GPU_SURFACE_LIST_OUT = 4,    /* out, uint16_t[pixels][SST_HYPOTHESES]: unused ones repeat the last, or are 0 */
    SST_GPU_SURFACE_LIST_COUNTS = 5, /* out, uint32_t[pixels]: how many */
    SST_GPU_SURFACE_LIST_BUFFERS
};

#endif
