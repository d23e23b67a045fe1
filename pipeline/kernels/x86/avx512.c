/* The templates for AVX-512 with the byte, popcount, permute and dot-product parts (Ice Lake, Zen 4 and later). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__x86_64__)
#include <immintrin.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#pragma GCC target("avx2,fma,bmi,bmi2,popcnt,lzcnt,f16c,sha,avx512f,avx512bw,avx512dq,avx512vl,avx512cd,"                  \
                   "avx512vpopcntdq,avx512bitalg,avx512vbmi,avx512vnni,prefer-vector-width=512")
#define KERNEL(name) name##_avx512
#include "pipeline/kernels/templates.h"
#endif
