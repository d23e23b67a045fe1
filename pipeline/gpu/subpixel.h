/* pipeline/gpu/subpixel.h - the shaders of the refinement between pixels: the fit of each pixel, windows of pixels
 * that share their fits, and planes that windows without texture follow.
 *
 * Numbers are floats, computed by the operations of subpixel_fit_row, subpixel_window_row and subpixel_plane_row of
 * pipeline/kernels/kernels.h in their order. Sums and products are rounded to the nearest number on every device that
 * passes the comparison with the CPU; quotients are found in whole numbers, as devices may round theirs in other
 * ways. So the results are the bytes of sst_disparity_subpixel(). All have groups of 32 x 8 pixels.
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
    int32_t across;      /* struct sst_subpixel_fit */
};

/** `subpixel_window` */
struct sst_gpu_subpixel_window {
    int32_t width, height;
    int32_t similar; /* struct sst_subpixel_window; nothing outside the view counts */
    float apart;
    float few;    /* weight of the pixel's own disparity */
    float enough; /* few + enough is the most that a weight is stored with */
};

/** `subpixel_plane`: the slopes, and a step's disparities. */
struct sst_gpu_subpixel_planes {
    int32_t width, height;
    int32_t similar;     /* struct sst_subpixel_planes; nothing outside the view counts */
    int32_t start;       /* not 0: slopes become 0, disparities stay */
    int32_t reach, last; /* 1/64 px: from the disparity that is refined, at most; the largest one */
    float apart;
    float enough; /* weight from which on a window does not follow the large one around it */
};

#endif
