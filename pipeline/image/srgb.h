/* pipeline/image/srgb.h - conversion between sRGB (IEC 61966-2-1) and linear light, both 0..1. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_SRGB_H
#define SST_PIPELINE_IMAGE_SRGB_H

#include <math.h>

#include "base/base.h"

static inline double sst_srgb_to_light(double code)
{
    return code <= 0.04045 ? code / 12.92 : pow((code + 0.055) / 1.055, 2.4);
}

static inline double sst_light_to_srgb(double light)
{
    return light <= 0.0031308 ? light * 12.92 : 1.055 * pow(light, 1 / 2.4) - 0.055;
}

#endif
