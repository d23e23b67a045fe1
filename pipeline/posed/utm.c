/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/utm.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RAD       (3.14159265358979323846 / 180)
#define AXIS_M    6378137.0 /* of the ellipsoid WGS 84 */
#define FLATTEN   (1 / 298.257223563)
#define UTM_SCALE 0.9996

/* Krueger's series of third order in n: 0.05 mm. */
void sst_utm_to_degrees(double *longitude, double *latitude, const struct sst_utm *utm, const double xy[2])
{
    const double n = FLATTEN / (2 - FLATTEN), n2 = n * n, n3 = n2 * n;
    const double mean = AXIS_M / (1 + n) * (1 + n2 / 4 + n2 * n2 / 64) * UTM_SCALE;
    const double b[3] = { n / 2 - n2 * 2 / 3 + n3 * 37 / 96, n2 / 48 + n3 / 15, n3 * 17 / 480 };
    const double d[3] = { 2 * n - n2 * 2 / 3 - 2 * n3, n2 * 7 / 3 - n3 * 8 / 5, n3 * 56 / 15 };
    const double up = (xy[1] - (utm->south ? SST_UTM_SOUTH_M : 0)) / mean, right = (xy[0] - SST_UTM_EAST_M) / mean;
    double u = up, r = right, conformal, angle;

    for (int j = 0; j < 3; j++) {
        u -= b[j] * sin(2 * (j + 1) * up) * cosh(2 * (j + 1) * right);
        r -= b[j] * cos(2 * (j + 1) * up) * sinh(2 * (j + 1) * right);
    }
    conformal = angle = asin(sin(u) / cosh(r));
    for (int j = 0; j < 3; j++)
        angle += d[j] * sin(2 * (j + 1) * conformal);
    *latitude = angle / RAD;
    *longitude = utm->zone * 6 - 183 + atan2(sinh(r), cos(u)) / RAD;
}

void sst_earth_at(struct sst_earth *p, double longitude, double latitude, double altitude_m)
{
    const double lon = longitude * RAD, lat = latitude * RAD;
    const double e2 = FLATTEN * (2 - FLATTEN), s = sin(lat), c = cos(lat), sl = sin(lon), cl = cos(lon);
    const double across = AXIS_M / sqrt(1 - e2 * s * s);
    const double at[3] = { (across + altitude_m) * c * cl, (across + altitude_m) * c * sl,
                           (across * (1 - e2) + altitude_m) * s };
    const double axes[9] = { -sl, cl, 0, -s * cl, -s * sl, c, c * cl, c * sl, s };

    memcpy(p->at, at, sizeof(at));
    memcpy(p->axes, axes, sizeof(axes));
}

void sst_earth_from(const struct sst_earth *from, const struct sst_earth *of, double out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = 0;
        for (int j = 0; j < 3; j++)
            out[i] += from->axes[3 * i + j] * (of->at[j] - from->at[j]);
    }
}

bool sst_utm_of_epsg(struct sst_utm *out, int epsg)
{
    const int series = epsg / 100, zone = epsg % 100;

    if (!(((series == 326 || series == 327) && zone >= 1 && zone <= 60) || (epsg >= 25828 && epsg <= 25838)))
        return false;
    *out = (struct sst_utm){ zone, series == 327 };
    return true;
}

bool sst_utm_parse(struct sst_utm *out, const char *text)
{
    char *end;
    const long zone = strtol(text, &end, 10);
    const int side = toupper((unsigned char)*end);

    if (!isdigit((unsigned char)*text) || zone < 1 || zone > 60 || (side != 'N' && side != 'S') || end[1])
        return false;
    *out = (struct sst_utm){ (int)zone, side == 'S' };
    return true;
}
