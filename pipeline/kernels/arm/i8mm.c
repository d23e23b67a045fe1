/* The templates that gain from dot products of signed by unsigned bytes (Cortex-A510, Neoverse V1, Apple M2 and later);
 * the others are those of dotprod.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__aarch64__)
#include <arm_neon.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#pragma GCC target("arch=armv8.2-a+dotprod+i8mm")
#define KERNEL(name) name##_i8mm
#include "pipeline/kernels/feature_cost_tmpl.h"

void sst_kernels_fill_i8mm(struct sst_kernels *k)
{
    sst_kernels_fill_dotprod(k);
    k->feature_cost_rows = KERNEL(feature_cost_rows);
}
#endif
