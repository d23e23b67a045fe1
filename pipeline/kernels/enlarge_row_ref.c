/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

static int unlike(const struct sst_enlarge *e, int row, long x, uint8_t green)
{
    return abs(e->green4[row][x] - 4 * green);
}

void sst_enlarge_row_ref(uint16_t *disp, uint8_t *label, const struct sst_enlarge *e, size_t n)
{
    for (size_t i = 0; i < 2 * n; i++) {
        const long x = (long)(i / 2), beside = x + (i % 2 ? 1 : -1);
        const struct {
            int row;
            long x;
        } at[3] = { { 0, beside }, { 1, x }, { 1, beside } };
        int least = unlike(e, 0, x, e->green[i]);

        disp[i] = e->disp[0][x];
        label[i] = e->label[0][x];
        for (int k = 0; k < 3; k++) {
            const int d = e->disp[at[k].row][at[k].x], l = e->label[at[k].row][at[k].x];
            const int u = unlike(e, at[k].row, at[k].x, e->green[i]);

            if ((abs(d - e->disp[0][x]) <= e->step_q6 && l == e->label[0][x]) || u >= least)
                continue;
            least = u;
            disp[i] = (uint16_t)d;
            label[i] = (uint8_t)l;
        }
    }
}
