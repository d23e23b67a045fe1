/* pipeline/gpu/check.h - the shaders of the multi-view check of disparities and of the filling of what it refuses.
 *
 * All numbers are integers, and equal those of sst_disparity_check_views() and sst_fill_views() on every device. All
 * shaders have groups of 32 x 8 pixels.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_CHECK_H
#define SST_PIPELINE_GPU_CHECK_H

#include "pipeline/gpu/gpu.h"

/* Structures have the layout of the shaders (std430). Maps are SST_PLANE_MAP of pipeline/step/planes.h. */

/** Where a disparity d puts a pixel: along an axis by whole + ((part + d step) >> 16), which fits 32 bits. */
struct sst_gpu_shift {
    int32_t across, across_part, across_step, down, down_part, down_step;
};

/** `check` */
struct sst_gpu_check {
    int32_t width, height;
    uint32_t own; /* the view's pixel (0, 0) */
    int32_t count, steps;
};

struct sst_gpu_check_other {
    uint32_t first; /* its pixel (0, 0) */
    struct sst_gpu_shift shift;
};

/** `fill_start`: mismatches get the median around them; nothing has arrived. */
struct sst_gpu_fill {
    int32_t width, height;
    uint32_t own;
};

/** `fill_project`: what arrives from the correct pixels of another view. */
struct sst_gpu_project {
    int32_t width, height;
    uint32_t first; /* of that view */
    struct sst_gpu_shift shift;
};

/** `fill_along`, then `fill_down`: the rest gets the background, as sst_fill_background() has it. */
struct sst_gpu_background {
    int32_t width, height;
    int32_t none; /* disparity where nothing is known at all */
};

#endif
