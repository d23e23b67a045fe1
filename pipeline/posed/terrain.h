/* pipeline/posed/terrain.h - terrain of maps in the axes of a light field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_TERRAIN_H
#define SST_PIPELINE_POSED_TERRAIN_H

#include "pipeline/image/heights.h"
#include "pipeline/posed/posed.h"

/**
 * Heights whose places are eastings and northings of UTM become places in the light field's axes, about its latitude and
 * longitude and less its altitude, the earth's curvature included; others stay as they are.
 *
 * Places beyond 100 km are of a map; a zone that is given (`utm`, "33N") counts before the file's own.
 *
 * @param placed  out: the places were converted
 * @return 0, -EINVAL (a zone that is none), -EBADMSG (the zone, or the light field's place, is unknown); logged
 */
SST_MUST_CHECK int sst_terrain_place(struct sst_heights *heights, bool *placed, const struct sst_posed *posed,
                                     const char *utm, const char *path);

#endif
