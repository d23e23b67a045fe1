/* The templates for AVX2 (Haswell, Zen and later). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__x86_64__)
#include <immintrin.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#pragma GCC target("avx2,fma,bmi,bmi2,popcnt,lzcnt,f16c,sha")
#define KERNEL(name) name##_avx2
#include "pipeline/kernels/templates.h"
#endif
