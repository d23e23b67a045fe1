/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_clear_removed_ref(uint8_t *removed, const uint16_t *disp, int cut, size_t n)
{
    for (size_t x = 0; x < n; x++)
        removed[x] = disp[x] > cut && disp[x] != 0xFFFF;
}
