/* pipeline/gpu/clear.h - the shaders clear_*: the clear picture (design.md, 5.6).
 *
 * clear_land is clear_removed, clear_state and clear_land of pipeline/kernels/kernels.h for all views at once, and
 * gives the same numbers; landed rays are 0 before. clear_blend is clear_surface, clear_take and clear_blend for all
 * pixels; it takes the same rays at the same positions; the disparities of surfaces are the same numbers, and
 * colours, weights and support differ by at most SST_GPU_CLEAR_LEVELS.
 *
 * Rays sampled from raw frames: after clear_land, clear_surface finds the surface of each pixel. Then clear_sample goes
 * through the views one by one, the nearest to the viewpoint first, as each reads a frame of its own: it replaces the
 * view's landed rays with the colours of the rays that see the surface. At last clear_blend, with `sampled`, makes the
 * picture of them. The surfaces equal the CPU's. A ray is interpolated once, at its place in the frame
 * (pipeline/kernels/place_patch.h), which may differ from the CPU's by 1/256 px; near the fold of a lens by more, or be
 * missing.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_CLEAR_H
#define SST_PIPELINE_GPU_CLEAR_H

#include "pipeline/gpu/gpu.h"
#include "pipeline/gpu/rectify.h"

#define SST_GPU_CLEAR_LEVELS 1
#define SST_GPU_CLEAR_VIEWS  64 /* at most: a pixel's rays are held at once */

/* Structures have the layout of pipeline/kernels/clear_land.comp and clear_blend.comp (std430). */

/** One view, as struct sst_clear_view has it. */
struct sst_gpu_clear_view {
    float x_q6, x_0, y_q6, y_0, bx, by;
    uint32_t first; /* its pixel (0, top) in the buffers of pixels, disparities, valid pixels and masks; a multiple of
                       4 */
    uint32_t flags; /* enum sst_gpu_clear_view_flag */
    int32_t top, end; /* rows that are there: all from which rays may land in the rows of the picture, those beside
                         them, and those in which such rays have their colours */
};

enum sst_gpu_clear_view_flag {
    SST_GPU_CLEAR_VALID = 1,  /* the view has a map of valid pixels */
    SST_GPU_CLEAR_LABELS = 2, /* ... labels */
    SST_GPU_CLEAR_MASK = 4,   /* ... a mask of pixels to remove */
};

struct sst_gpu_clear {
    int32_t width, height, pitch;        /* of views and picture; pixels of a row of all buffers but the last */
    int32_t bins, cut_q6;                /* stored disparities are below; those above are removed */
    int32_t remove_label;                /* 0: none */
    int32_t coarse;                      /* of struct sst_clear_view */
    int32_t rays;                        /* of full weight that make up a pixel */
    uint32_t views;                      /* nearest to the viewpoint first */
    float disp_min_px, disp_min_rest_px; /* their sum */
    int32_t as_others;                   /* not 0: the camera at the viewpoint counts as the others do */
    uint32_t merged;                     /* clear_blend: not 0: what is seen is written, too */
    int32_t top, rows;                   /* of the picture: that landed rays and results have */
    uint32_t sampled;                    /* clear_blend: not 0: rays were sampled from raw frames */
};

#define SST_GPU_CLEAR_SUPPORT 8 /* value of a ray, at most 255 in all */

/* Pixels of a group, for clear_land of one view, from its first row on. */
#define SST_GPU_CLEAR_GROUP_WIDTH  32
#define SST_GPU_CLEAR_GROUP_HEIGHT 4

/** Surface of a pixel while its rays are sampled. */
struct sst_gpu_clear_state {
    float level;     /* of the surface, as clear_surface of kernels.h has it; 0: there is none */
    float px;        /* its disparity */
    uint32_t wanted; /* rays of full weight that are missing */
};

/** A flag beside SST_GPU_RECTIFY_LIT: the view has no frame, and its rays are left to clear_blend. */
#define SST_GPU_SAMPLE_PLAIN 8U

struct sst_gpu_clear_sample {
    struct sst_gpu_rectify frame; /* `first`, `top`, part_x and part_y are not read; with SST_GPU_SAMPLE_PLAIN nor are
                                     buffers and members for frames */
    float bx, by;                 /* of the view, as of struct sst_gpu_clear_view */
    int32_t top, rows;            /* of the picture */
    int32_t cell_rows;            /* pieces of a column */
    uint32_t view;                /* of these landed rays */
};

enum sst_gpu_clear_ray {
    SST_GPU_RAY_NONE = 0,
    SST_GPU_RAY_RIM = 1, /* it counts little */
    SST_GPU_RAY_FULL = 2,
    SST_GPU_RAY_PLAIN = 4, /* with one of these: its colour is that between the view's own pixels */
};

#endif
