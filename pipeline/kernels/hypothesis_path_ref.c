/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

static void path_of(uint16_t *path, const uint16_t *cost, const uint16_t *hypothesis,
                    const struct sst_hypothesis_before *before, const int penalty[3])
{
    int least = before->path[0];

    for (int j = 1; j < SST_HYPOTHESES; j++)
        least = sst_min_int(before->path[j], least);
    for (int i = 0; i < SST_HYPOTHESES; i++) {
        int best = least + penalty[2];

        for (int j = 0; j < SST_HYPOTHESES; j++) {
            if (!j || before->path[j] < SST_HYPOTHESIS_FAR) {
                const int jump = abs(hypothesis[i] - before->hypothesis[j]), near = penalty[0];

                best = sst_min_int(before->path[j] + (jump <= near ? 0 : penalty[jump <= 2 * near ? 1 : 2]), best);
            }
        }
        path[i] = (uint16_t)(cost[i] + best - least);
    }
}

void sst_hypothesis_path_row_ref(const struct sst_hypothesis_steps *steps, const struct sst_hypothesis_penalty *penalty,
                                 ptrdiff_t step, size_t n)
{
    for (ptrdiff_t x = 0; x < (ptrdiff_t)n; x++) {
        const ptrdiff_t pixel = x * step, at = pixel * SST_HYPOTHESES;
        const int colour = steps->colour[pixel];

        path_of(steps->path + at, steps->cost + at, steps->hypothesis + at, &steps->before[pixel],
                (const int[]){ penalty->near, penalty->p1[colour], penalty->p2[colour] });
        for (int i = 0; i < SST_HYPOTHESES; i++)
            steps->sum[at + i] = (uint16_t)(steps->sum[at + i] + steps->path[at + i]);
    }
}
