/* pipeline/posed/utm.h - places on the earth: zones of UTM, and metres east, north and up of a place. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_UTM_H
#define SST_PIPELINE_POSED_UTM_H

#include <stdbool.h>

#define SST_UTM_EAST_M  500000.0   /* easting of a zone's middle */
#define SST_UTM_SOUTH_M 10000000.0 /* northing of the equator in the south */

/** A zone of UTM on WGS 84. */
struct sst_utm {
    int zone; /* 1 to 60; 0: none: places are longitude and latitude */
    bool south;
};

/** A place on the ellipsoid WGS 84: earth-centred metres, and the axes east, north, up there as rows. */
struct sst_earth {
    double at[3], axes[9];
};

/** Easting and northing to degrees. */
void sst_utm_to_degrees(double *longitude, double *latitude, const struct sst_utm *utm, const double xy[2]);

/** Degrees, and metres above the ellipsoid. */
void sst_earth_at(struct sst_earth *out, double longitude, double latitude, double altitude_m);

/** Metres east, north and up of `from`. */
void sst_earth_from(const struct sst_earth *from, const struct sst_earth *of, double out[3]);

/** Zone of a map: EPSG:32601 to 32660, 32701 to 32760, and 25828 to 25838 (ETRS89, within a metre). @return false:
 * another map */
bool sst_utm_of_epsg(struct sst_utm *out, int epsg);

/** "33N". @return false: no zone */
bool sst_utm_parse(struct sst_utm *out, const char *text);

#endif
