/* tests/reference/wide.h - numbers wider than double, in which the formulas of the design page are written down
 * plainly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_REFERENCE_WIDE_H
#define SST_TESTS_REFERENCE_WIDE_H

#include <math.h>

/** At least 64 bits of mantissa: x87's on x86, quadruple on arm64. Double has 53. */
typedef long double wide;

/** For sums that cancel: 113 bits wherever the compiler has them. */
#ifdef __SIZEOF_FLOAT128__
__extension__ typedef __float128 quad;
#else
typedef long double quad;
#endif

static inline quad quad_sqrt(quad v)
{
    quad r = (quad)sqrtl((wide)v);

    for (int i = 0; i < 3 && r > 0; i++)
        r = (r + v / r) / 2; /* Newton: 64 bits become 113 */
    return r;
}

#endif
