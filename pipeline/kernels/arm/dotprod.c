/* The templates that gain from byte dot products (Cortex-A76, Neoverse N1, Apple M1 and later); the others are NEON's.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__aarch64__)
#include <arm_neon.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#pragma GCC target("arch=armv8.2-a+dotprod")
#define KERNEL(name) name##_dotprod
#include "pipeline/kernels/feature_cost_tmpl.h"
#include "pipeline/kernels/hypothesis_cost_tmpl.h"

void sst_kernels_fill_dotprod(struct sst_kernels *k)
{
    sst_kernels_fill_base(k);
    k->feature_cost_rows = KERNEL(feature_cost_rows);
    k->hypothesis_cost_row = KERNEL(hypothesis_cost_row);
}
#endif
