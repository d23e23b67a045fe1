/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

void sst_colour_step_row_ref(uint8_t *step, const uint8_t *const a[3], const uint8_t *const b[3], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        int most = 0;

        for (int c = 0; c < 3; c++)
            most = sst_max_int(abs(a[c][i] - b[c][i]), most);
        step[i] = (uint8_t)most;
    }
}
