/* pipeline/gpu/subpixel.h - the shaders of the refinement between pixels: the fit of each pixel, and windows of pixels
 * that share their fits.
 *
 * Numbers are floats, computed by the operations of subpixel_fit_row and subpixel_window_row of
 * pipeline/kernels/kernels.h in their order. Sums and products are rounded to the nearest number on every device that
 * passes the comparison with the CPU; quotients are found in whole numbers, as devices may round theirs in other
 * ways. So the results are the bytes of sst_disparity_subpixel(). Both shaders have groups of 32 x 8 pixels.
 */
#ifndef SST_PIPELINE_GPU_SUBPIXEL_H
#define SST_PIPELINE_GPU_SUBPIXEL_H

#include "pipeline/gpu/gpu.h"

/* Structures have the layout of the shaders (std430). Disparities are uint32_t[height][width]: the one of this step,
 * SST_SUBPIXEL_NONE if it is not known, and the one that is refined << 16; 1/64 px. */

/** A view to compare with, as struct sst_subpixel_view has it. */
struct sst_gpu_subpixel_view {
    int32_t x, y, dx, dy;
    float bx, by, gain, offset;
    uint32_t first; /* its pixel (0, 0) in the buffer of pixels */
};

/** Weight of a pixel's disparity, and their product, px. */
struct sst_gpu_subpixel_weight {
    float weight, product;
};

/** `subpixel_fit` */
struct sst_gpu_subpixel_fit {
    int32_t width, height, views;
    uint32_t own;        /* the view's pixel (0, 0) */
    int32_t tolerance;   /* struct sst_subpixel_fit */
    float inverse_limit; /* likewise */
};

/** `subpixel_window`: a step's disparities from the fits, or, with `wide`, the last ones. */
struct sst_gpu_subpixel_window {
    int32_t width, height;
    int32_t step, similar, apart; /* struct sst_subpixel_window; nothing outside the view counts */
    int32_t wide;                 /* not 0: windows without texture follow this large one */
    int32_t reach, last;          /* 1/64 px: from the disparity that is refined, at most; the largest one */
    float few;                    /* weight of the pixel's own disparity */
    float enough;                 /* weight at which a window and the large window around it count alike; few + enough
                                     is the most that a weight is stored with */
};

#endif
