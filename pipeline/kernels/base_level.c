/* The templates for the compiler's default target: runs on any CPU of the architecture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__ARM_NEON)
#include <arm_neon.h>
#endif
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#define KERNEL(name) name##_base
#include "pipeline/kernels/templates.h"
