/* pipeline/gpu/blend.h - the shader `blend`: the rays of several views summed into a picture, with their weights.
 *
 * It is blend_rays, blend_plain, blend_support and blend_finish of pipeline/kernels/kernels.h over all views and rows
 * at once; design.md, 5.4. Views that one buffer cannot hold come in several dispatches, whose sums it carries on: the
 * order of summation, and so the bytes, do not depend on how they are divided.
 *
 * Against the reference, colours differ by at most SST_GPU_BLEND_LEVELS and sums of weights by the fraction
 * SST_GPU_BLEND_WEIGHT: Vulkan allows a division to be off by 2.5 units in the last place, and small numbers to become
 * 0. On devices that round as the CPU does both are equal.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_BLEND_H
#define SST_PIPELINE_GPU_BLEND_H

#include "pipeline/gpu/gpu.h"

#define SST_GPU_BLEND_LEVELS 1
#define SST_GPU_BLEND_WEIGHT 1e-5F

/* Structures have the layout of pipeline/kernels/blend.comp (std430). */

/** One view, as struct sst_render_tap has it: pixel (x, y) of the picture takes its colour between pixels x + ix and
 *  x + ix + 1, its disparity and label at (x + nx, y + ny). */
struct sst_gpu_blend_view {
    int32_t ix, iy, nx, ny;
    int32_t x0, x1, y0, y1; /* pixels of the picture whose rays lie inside the view */
    int32_t tap[4];         /* sst_blend_set_taps() */
    float aperture;
    uint32_t first; /* its pixel (0, 0) in the buffers of pixels, disparities and valid pixels, modulo 2^32, where they
                       have only some rows of the view; a multiple of 4 */
    uint32_t flags; /* enum sst_gpu_blend_view_flag */
    uint32_t index; /* of pipeline/gpu/verify.h */
};

enum sst_gpu_blend_view_flag {
    SST_GPU_VIEW_RIGHT = 1,       /* the columns x + ix + 1 count: fx > 0 */
    SST_GPU_VIEW_BELOW = 2,       /* likewise the rows */
    SST_GPU_VIEW_VALID = 4,       /* only where all pixels that count are valid */
    SST_GPU_VIEW_LABELS = 8,      /* the view has labels; else W_s = 1 and ends[0] counts */
    SST_GPU_VIEW_CONFIDENCE = 16, /* the view has confidences (verify.h) */
};

/** By label. */
struct sst_gpu_blend_label {
    uint32_t row;  /* of the table of weights */
    uint32_t ends; /* sst_blend_support_fn */
};

/** Followed by struct sst_gpu_blend_view[]. */
struct sst_gpu_blend_params {
    struct sst_gpu_blend_label label[256];
    uint8_t rarity[4096]; /* of colours, as in struct sst_voting; not read by `blend` */
};

enum sst_gpu_blend_pixel {
    SST_GPU_PIXEL_SUPPORTED = 1,
    SST_GPU_PIXEL_BELOW = 2, /* the weights sum to less than SST_BLEND_FLOOR: the colour means nothing */
};

struct sst_gpu_blend {
    int32_t width, pitch; /* of the picture; pixels of a row of the views' buffers, a multiple of 4 */
    int32_t top, rows;    /* rows top .. top + rows - 1 of the picture, which the last two buffers hold */
    uint32_t first_view, views;
    uint32_t flags; /* enum sst_gpu_blend_flag */
    uint32_t near[6]; /* of struct sst_blend_near: first, last, times, focus, slope, bits */
    float floor, scale;
};

enum sst_gpu_blend_flag {
    SST_GPU_BLEND_FIRST = 1,    /* sums begin at 0 */
    SST_GPU_BLEND_LAST = 2,     /* colours are written; else sums are kept for the next dispatch */
    SST_GPU_BLEND_WEIGHTED = 4, /* else all weights are apertures */
    SST_GPU_BLEND_SUMMED = 8,   /* ... which are 1: sums are whole numbers */
    SST_GPU_BLEND_BY_LABEL = 16,
    SST_GPU_BLEND_WEIGHTS = 32, /* with LAST: the sums of weights are written as well */
};

/** Pixels of the picture that one group of the shader makes, and one of the shaders of verify.h. */
#define SST_GPU_BLEND_GROUP_WIDTH   32
#define SST_GPU_BLEND_GROUP_HEIGHT  8
#define SST_GPU_VERIFY_GROUP_WIDTH  32
#define SST_GPU_VERIFY_GROUP_HEIGHT 4

#endif
