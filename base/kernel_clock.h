/* base/kernel_clock.h - state of the kernel's wall clock: kept right by chrony, PTP or another program, or not. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_KERNEL_CLOCK_H
#define SST_BASE_KERNEL_CLOCK_H

#include <stdbool.h>

struct sst_kernel_clock {
    bool known, synchronised;
    double error_us;    /* by the program that keeps it: at most so wrong */
    double estimate_us; /* by the program that keeps it: probable error */
    int tai_s;          /* TAI less UTC; 0: not set, as without PTP or chrony's leapsectz */
};

/** Ask the kernel (adjtimex(2)); needs no program and no rights. */
void sst_kernel_clock(struct sst_kernel_clock *out);

#endif
