/* pipeline/lightfield/shift.h - place of a pixel in another view by its disparity, in whole numbers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_SHIFT_H
#define SST_PIPELINE_LIGHTFIELD_SHIFT_H

#include <math.h>
#include <stdint.h>

#include "pipeline/lightfield/lightfield.h"

/** Along one axis, a stored disparity d moves a pixel by floor((at + d step) / 2^16); `at` holds the half of rounding. */
struct sst_shift {
    int64_t at, step;
};

/** By `spacings` of the disparity. @param disp_min_px  disparity of stored value 0; |disp_min_px spacings| < 2^45 */
static inline struct sst_shift sst_shift_by(double spacings, double disp_min_px)
{
    return (struct sst_shift){ llround((disp_min_px * spacings + 0.5) * 65536),
                               llround(spacings * 65536 / SST_DISP_SCALE) };
}

/** For kernels, in 32 bits: whole + floor((part + d step) / 2^16). |spacings| at most 32 */
static inline void sst_shift_parts(struct sst_shift s, int32_t *whole, int32_t *part, int32_t *step)
{
    *whole = (int32_t)(s.at >> 16);
    *part = (int32_t)(s.at & 0xFFFF);
    *step = (int32_t)s.step;
}

static inline int sst_shifted(int x, struct sst_shift s, int disp)
{
    return x + (int)((s.at + disp * s.step) >> 16);
}

#endif
