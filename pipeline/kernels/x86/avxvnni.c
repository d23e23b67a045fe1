/* The templates for AVX2 with AVX-VNNI (Alder Lake, Zen 5 and later). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__x86_64__)
#include <immintrin.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#pragma GCC target("avx2,fma,bmi,bmi2,popcnt,lzcnt,f16c,sha,avxvnni")
#define KERNEL(name) name##_avxvnni
#include "pipeline/kernels/templates.h"
#endif
