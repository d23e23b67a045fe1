/* pipeline/kernels/place_patch.h - places of a rectified view in its raw frame as bicubics of row and column, both
 * fractional: the results of the shader clear_sample for each ray.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_PLACE_PATCH_H
#define SST_PIPELINE_KERNELS_PLACE_PATCH_H

#include "pipeline/kernels/kernels.h"

#define SST_PATCH_LISTED_BITS 12    /* fraction bits of listed places */
#define SST_PATCH_FAR_PX      65536 /* listed places farther from the frame's corner are none */

/** Places of a piece of the view: whole_q8 + sum of c[across][down] k^across t^down, column k and row t within it. */
struct sst_place_patch {
    int32_t whole_q8[2]; /* 1/256 px; of a list: [0] is the first pair */
    int32_t kind;        /* 0, or enum sst_places_kind. A list has the places of the (side + 1) x (side + 1) whole
                            positions of the piece and at its end, in 1/4096 px, INT32_MIN: none */
    int32_t unused;
    float c[2][4][4]; /* 1/256 px */
};

#endif
