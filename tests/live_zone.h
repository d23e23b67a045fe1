/* Zones of the live engine. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_LIVE_ZONE_H
#define SST_TESTS_LIVE_ZONE_H

#include <math.h>

#include "pipeline/live/live.h"

/* The rectangle between two corners, at any depth. */
static inline struct sst_live_zone live_rectangle(double x0, double y0, double x1, double y1)
{
    return (struct sst_live_zone){
        .points = 4, .x = { x0, x1, x1, x0 }, .y = { y0, y0, y1, y1 }, .near_px = INFINITY, .far_px = -INFINITY
    };
}

#endif
