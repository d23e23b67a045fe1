/* pipeline/gpu/convert.h - the shader `convert`: planes of a view in the words that a step of matching reads, and
 * results of a step in the words of a plane.
 *
 * All numbers are integers. Groups of 32 x 8 pixels.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_CONVERT_H
#define SST_PIPELINE_GPU_CONVERT_H

#include "pipeline/gpu/gpu.h"

/* Structures have the layout of pipeline/kernels/convert.comp (std430). */

enum sst_gpu_conversion {
    /* From a plane to the input of a step: */
    SST_GPU_TO_HYPOTHESES =
        0,                /* colours with depth codes: device_second.c; `value`: struct gpu_hypothesis_cost, most */
    SST_GPU_TO_LUMA = 1,  /* pixels of device_subpixel.c */
    SST_GPU_TO_STEPS = 2, /* disparities of device_subpixel.c */
    /* From the result of a step to a map: */
    SST_GPU_FROM_CHOICE = 3, /* of device_second.c */
    SST_GPU_FROM_PLAIN = 4,  /* disparities alone */
    /* From a network's result to SST_PLANE_FEATURES: */
    SST_GPU_TO_FEATURES = 5, /* `from`: signed bytes by pixel; `width`: SST_GPU_FEATURE_WORDS times the view's */
};

/** Of the words that are written; `colours`, `from` and `to` are the first ones in their buffers. */
struct sst_gpu_convert {
    int32_t width, height;
    int32_t full_width;  /* of the view of SST_GPU_TO_FEATURES */
    uint32_t conversion; /* enum sst_gpu_conversion */
    uint32_t value;
    uint32_t colours, from, to;
};

#endif
