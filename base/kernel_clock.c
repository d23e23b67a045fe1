/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "base/kernel_clock.h"

#include <sys/timex.h>

void sst_kernel_clock(struct sst_kernel_clock *out)
{
    struct timex state = { .modes = 0 };
    const int r = adjtimex(&state);

    *out = (struct sst_kernel_clock){ .known = r >= 0,
                                      .synchronised = r >= 0 && r != TIME_ERROR && !(state.status & STA_UNSYNC),
                                      .error_us = (double)state.maxerror,
                                      .estimate_us = (double)state.esterror,
                                      .tai_s = state.tai };
}
