/* tests/random.h - seeded random numbers: those of simulators/scene/noise.h, and the normal distribution. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_RANDOM_H
#define SST_TESTS_RANDOM_H

#include <math.h>

#include "simulators/scene/noise.h"

/** Mean 0, sigma 1 (Box and Muller 1958). */
static inline double test_normal(uint64_t *state)
{
    const double u = fmax(sst_random(state), 0x1p-54), v = sst_random(state);

    return sqrt(-2 * log(u)) * cos(2 * M_PI * v);
}

#endif
