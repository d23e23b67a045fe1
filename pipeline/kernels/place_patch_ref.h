/* pipeline/kernels/place_patch_ref.h - where a position of a rectified view lies in its raw frame, row and column both
 * fractional: what the shader clear_sample computes for each ray.
 */
#ifndef SST_PIPELINE_KERNELS_PLACE_PATCH_REF_H
#define SST_PIPELINE_KERNELS_PLACE_PATCH_REF_H

#include <math.h>
#include <stdbool.h>

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

static inline float sst_place_cubic(float k, float c0, float c1, float c2, float c3)
{
    return c0 + k * (c1 + k * (c2 + k * c3));
}

/* Bilinear between four listed places, 1/256 px. @return false: one of them is none */
static inline bool sst_place_listed(int32_t xy_q8[2], const int32_t *list, int side, float k, float t)
{
    const int i = sst_min_int((int)k, side - 1), j = sst_min_int((int)t, side - 1);
    const int32_t *upper = list + 2 * (j * (side + 1) + i), *lower = upper + 2 * (side + 1);
    const float right = k - (float)i, below = t - (float)j;

    if (upper[0] == INT32_MIN || upper[2] == INT32_MIN || lower[0] == INT32_MIN || lower[2] == INT32_MIN)
        return false;
    for (int axis = 0; axis < 2; axis++) {
        const int32_t a = upper[axis], b = upper[axis + 2] - a, c = lower[axis] - a, d = lower[axis + 2] - a - b - c;
        const float v = right * (float)b + below * ((float)c + right * (float)d);

        xy_q8[axis] = (a + (int32_t)lrintf(v) + (1 << (SST_PATCH_LISTED_BITS - 9))) >> (SST_PATCH_LISTED_BITS - 8);
    }
    return true;
}

/**
 * @param xy_q8    out, 1/256 px
 * @param patch    the piece
 * @param list     of listed places
 * @param side     rows and columns of the piece
 * @param k, t     column and row from its first ones on, up to side; beyond for the last pieces
 * @param most_q8  the last column and row of the frame, 1/256 px
 * @return false: there is no place
 */
static inline bool sst_place_patch_ref(int32_t xy_q8[2], const struct sst_place_patch *patch, const int32_t *list,
                                       int side, float k, float t, const int32_t most_q8[2])
{
    if (patch->kind == SST_PLACES_LISTED) {
        if (!sst_place_listed(xy_q8, list + 2 * (size_t)patch->whole_q8[0], side, k, t))
            return false;
    } else if (patch->kind) {
        return false;
    } else {
        for (int axis = 0; axis < 2; axis++) {
            float across[4];

            for (int i = 0; i < 4; i++) {
                const float *c = patch->c[axis][i];

                across[i] = sst_place_cubic(t, c[0], c[1], c[2], c[3]);
            }
            xy_q8[axis] =
                patch->whole_q8[axis] + (int32_t)lrintf(sst_place_cubic(k, across[0], across[1], across[2], across[3]));
        }
    }
    return xy_q8[0] >= 0 && xy_q8[0] <= most_q8[0] && xy_q8[1] >= 0 && xy_q8[1] <= most_q8[1];
}

#endif
