/* pipeline/gpu/rectify.h - the shader `rectify`: the pixels of a view from its raw frame.
 *
 * It is place_row, resample_row and light_row of pipeline/kernels/kernels.h for a whole view: design/rectification.md.
 * The places of its pixels are cubics along pieces of rows, made by sst_rectify_map_cells(). At whole positions it
 * gives the bytes of the CPU; the square roots of light_row come from a table, as devices may round them differently.
 * Between pixels a place may differ from the CPU's by 1/256 px, since that adds up the fraction of a column from
 * another pixel on.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_RECTIFY_H
#define SST_PIPELINE_GPU_RECTIFY_H

#include "pipeline/gpu/gpu.h"
#include "pipeline/kernels/kernels.h"

/* Structures have the layout of pipeline/kernels/rectify.comp (std430). */

struct sst_gpu_rectify {
    int32_t width, height, pitch; /* of the view; `pitch` is a multiple of 4 */
    int32_t raw_width, raw_height;
    int32_t taps;              /* 2, 4 or 6 */
    int32_t cell_shift, cells; /* pieces of 1 << cell_shift columns; the last one goes on to the end of the row */
    uint32_t first;            /* pixel (0, 0) of the view in the last two buffers, a multiple of 4, modulo 2^32 */
    uint32_t flags;            /* enum sst_gpu_rectify_flag */
    int32_t light_shift, light_cols, light_rows; /* nodes of the fall-off, 1 << light_shift pixels apart */
    float part_x, part_y;                        /* pixel (x, y) is sampled at (x + part_x, y + part_y); 0..1 */
    float gain[3], gain_root[3];                 /* as of struct sst_light */
    int32_t top;                                 /* first row that is made; a group makes GROUP_HEIGHT from there on */
};

enum sst_gpu_rectify_flag {
    SST_GPU_RECTIFY_LIT = 1,  /* light is corrected; else samples are only rounded */
    SST_GPU_RECTIFY_KEEP = 2, /* labels that are there are kept; else they become 0 */
};

/** What does not depend on the factors in sst_light_code(), by sample: [2][SST_LIGHT_WHITE + 1]. */
#define SST_GPU_RECTIFY_LIGHT_FLOATS ((size_t)2 * (SST_LIGHT_WHITE + 1))

/** Pixels of the view that one group of the shader makes; an invocation makes 4 of a row. */
#define SST_GPU_RECTIFY_GROUP_WIDTH  64
#define SST_GPU_RECTIFY_GROUP_HEIGHT 8

#endif
