/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

void sst_hypothesis_path_row_ref(uint16_t *path, uint16_t *sum, const uint16_t *cost, const uint16_t *hypothesis,
                                 const uint16_t *from, const uint16_t *from_hypothesis, const uint8_t *colour,
                                 const uint8_t *count, const struct sst_hypothesis_penalty *penalty, ptrdiff_t step,
                                 size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const int p1 = penalty->p1[*colour], p2 = penalty->p2[*colour];
        int least = from[0];

        for (int j = 1; j < SST_HYPOTHESES; j++)
            least = from[j] < least ? from[j] : least;
        for (int i = 0; i < SST_HYPOTHESES; i++) {
            int best = least + p2;

            for (int j = 0; j < SST_HYPOTHESES; j++) {
                const int jump = abs(hypothesis[i] - from_hypothesis[j]);
                const int here = from[j] + (jump <= penalty->near ? 0 : jump <= 2 * penalty->near ? p1 : p2);

                best = here < best ? here : best;
            }
            path[i] = *count > 1 ? (uint16_t)(cost[i] + best - least) : i ? SST_HYPOTHESIS_FAR : 0;
            sum[i] = *count > 1 ? (uint16_t)(sum[i] + path[i]) : sum[i];
        }
        path += step;
        sum += step;
        cost += step;
        hypothesis += step;
        from += step;
        from_hypothesis += step;
        colour += step / SST_HYPOTHESES;
        count += step / SST_HYPOTHESES;
    }
}
