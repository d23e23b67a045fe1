/* pipeline/kernels/consensus_ref.h - colours of views at a plane, for the references of consensus.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_CONSENSUS_REF_H
#define SST_PIPELINE_KERNELS_CONSENSUS_REF_H

#include <stdbool.h>
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

/** Difference of view v at pixel x to a colour; it saturates as bytes do. */
static inline int consensus_apart(const struct sst_consensus_view *v, int x, const int colour[3])
{
    int sum = 0;

    for (int c = 0; c < 3; c++)
        sum = sst_min_int(sum + abs(v->colour[c][x] - colour[c]), 255);
    return sum;
}

/** Replace a colour by the mean colour of the masked views at pixel x, if there is any.
 * @return how many */
static inline int consensus_mean(int colour[3], const struct sst_consensus_view *view, int views, const bool *has,
                                 int x)
{
    unsigned sum[3] = { 0 };
    int n = 0;

    for (int k = 0; k < views; k++) {
        for (int c = 0; has[k] && c < 3; c++)
            sum[c] += view[k].colour[c][x];
        n += has[k];
    }
    for (int c = 0; n && c < 3; c++)
        colour[c] = (int)(sum[c] * sst_consensus_reciprocal((unsigned)n) >> 16);
    return n;
}

#endif
