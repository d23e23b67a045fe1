/* pipeline/gpu/verify.h - the shaders verify_*: rays of a picture verified by the agreement of their colours
 * (pipeline/method/render/verify.h).
 *
 * In the order of their dispatches: verify_share finds what fraction of each pixel the maps leave to votes, views that
 * one buffer cannot hold in several dispatches; verify_screen closes cells of 64x8 pixels, those of the rows from ..
 * to - 1 (from a multiple of 8), whose rays the maps explain (SST_VERIFY_AUTO). Then for some rows at a time:
 * verify_rays samples the rays and their votes, again in several dispatches; verify_unexplained sums up what the maps
 * do not explain (SST_VERIFY_AUTO); verify_mode finds the colour with most votes, and how near rays are to it;
 * verify_blend applies that to the picture of `blend`.
 *
 * All give the bits of their references: sums are whole numbers, or of floats in a fixed order, and quotients are
 * rounded to the nearest number. So pictures differ from the reference as those of `blend` do.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_VERIFY_H
#define SST_PIPELINE_GPU_VERIFY_H

#include "pipeline/gpu/blend.h"

#define SST_GPU_VERIFY_AROUND 8   /* views around another at most */
#define SST_GPU_VERIFY_VIEWS  256 /* of a picture at most */

/* Structures have the layout of pipeline/kernels/verify_*.comp (std430). */

/** A view around another one: a point moves by bx, by pixels to it per pixel of disparity. */
struct sst_gpu_verify_near {
    float bx, by;
    uint32_t view, zero;
};

/** A view of verify_screen and verify_unexplained, with the views around it. */
struct sst_gpu_verify_view {
    struct sst_gpu_blend_view at;
    uint32_t around, zero[3];
    struct sst_gpu_verify_near near[SST_GPU_VERIFY_AROUND];
};

/** Cells of the picture, a word each, [height / 8, rounded up][width / 64, rounded up]. */
enum sst_gpu_verify_cell {
    SST_GPU_CELL_WANTED = 1, /* in */
    SST_GPU_CELL_OPEN = 2,   /* out: a pixel is left to votes */
    SST_GPU_CELL_BELOW = 4,  /* out: ... one with SST_GPU_PIXEL_BELOW, which has no colour to mix with */
};

/** Constants of all. Pixels are those of the rows blend.top .. blend.top + blend.rows - 1 (blend.top a multiple of 8);
 * rays are held of the rows from - 1 .. to that the picture has, in `rays` pixels. */
struct sst_gpu_verify {
    struct sst_gpu_blend blend; /* flags: FIRST and LAST of verify_share, BY_LABEL of verify_rays */
    int32_t height;
    int32_t from, to; /* rows that are verified */
    int32_t nearest;  /* largest stored disparity that does not end in front ... */
    int32_t levels;   /* of colours that agree */
    uint32_t count;   /* views of the picture */
    uint32_t rays;
    uint32_t explained; /* of verify_blend: not 0: unexplained rays count */
    float all;          /* sum of the apertures of all views */
    float scale, most;  /* as in struct sst_voting */
    float doubt_step;   /* SST_VERIFY_DOUBT_STEP of pipeline/kernels/verify_ref.h */
};

#endif
