/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/terrain.h"

#include <errno.h>
#include <math.h>

#include "base/log.h"
#include "pipeline/posed/utm.h"

#define MAP_MM   1e8   /* places beyond it are of a map */
#define STEP_M   100.0 /* over which scale and turn of the map are measured */
#define EARTH_MM 6.37e9
#define ROUNDS   20  /* of the search for the light field's place on the map */
#define AWAY_M   5e6 /* from where it does not converge: another zone or hemisphere */

/* East and north of the light field's origin, m, of a place on the map at its altitude. */
static void local(double out[3], const struct sst_posed *posed, const struct sst_utm *utm, const double xy[2])
{
    struct sst_earth origin, at;
    double longitude, latitude;

    sst_utm_to_degrees(&longitude, &latitude, utm, xy);
    sst_earth_at(&origin, posed->longitude, posed->latitude, posed->altitude_m);
    sst_earth_at(&at, longitude, latitude, posed->altitude_m);
    sst_earth_from(&origin, &at, out);
}

/* Place of the origin on the map. @return false: it is too far from the zone */
static bool find_origin(double xy[2], const struct sst_posed *posed, const struct sst_utm *utm)
{
    double off[3] = { INFINITY, INFINITY, 0 };

    xy[0] = SST_UTM_EAST_M;
    xy[1] = posed->latitude * 1.11e5 + (utm->south ? SST_UTM_SOUTH_M : 0);
    for (int i = 0; i < ROUNDS; i++) {
        local(off, posed, utm, xy);
        if (!(hypot(off[0], off[1]) < AWAY_M))
            return false;
        for (int k = 0; k < 2; k++)
            xy[k] -= off[k];
    }
    return hypot(off[0], off[1]) < 1e-4 && fabs(xy[0] - SST_UTM_EAST_M) < SST_UTM_EAST_M;
}

/* Scale and turn about the origin, then the curvature. */
static void convert(struct sst_heights *h, const struct sst_posed *posed, const struct sst_utm *utm, const double xy[2])
{
    double east[3], scale;

    local(east, posed, utm, (const double[2]){ xy[0] + STEP_M, xy[1] });
    scale = hypot(east[0], east[1]) / STEP_M;
    h->turn_rad = atan2(east[1], east[0]);
    h->x_mm = (h->x_mm - xy[0] * 1e3) * scale;
    h->y_mm = (h->y_mm - xy[1] * 1e3) * scale;
    h->step_x_mm *= scale;
    h->step_y_mm *= scale;
    for (int j = 0; j < h->mm.height; j++) {
        float *row = sst_map_f32_row(&h->mm, j);

        for (int i = 0; i < h->mm.width; i++) {
            const double x = h->x_mm + i * h->step_x_mm, y = h->y_mm + j * h->step_y_mm;

            row[i] = (float)((double)row[i] - posed->altitude_m * 1e3 - (x * x + y * y) / (2 * EARTH_MM));
        }
    }
}

int sst_terrain_place(struct sst_heights *h, bool *placed, const struct sst_posed *posed, const char *given,
                      const char *path)
{
    const bool map = fmax(fabs(h->x_mm), fabs(h->y_mm)) > MAP_MM;
    struct sst_utm utm = { 0 };
    double xy[2];

    *placed = false;
    if (given && !sst_utm_parse(&utm, given)) {
        sst_log_error("--utm %s is no zone of UTM such as 33N or 33S", given);
        return -EINVAL;
    }
    if (!map && !given)
        return 0;
    if (!posed->geographic) {
        sst_log_error("%s has places of a map, %.0f km from its origin, but where the light field is on the earth is "
                      "unknown; shift the terrain to its axes, or import poses with places (geo.txt)",
                      path, fmax(fabs(h->x_mm), fabs(h->y_mm)) * 1e-6);
        return -EBADMSG;
    }
    if (!given && !sst_utm_of_epsg(&utm, h->epsg)) {
        const int zone = (int)floor((posed->longitude + 180) / 6) % 60 + 1;

        if (h->epsg)
            sst_log_error(
                "%s is on the map EPSG:%d, which is no zone of UTM; convert it: gdalwarp -t_srs EPSG:%d IN OUT", path,
                h->epsg, (posed->latitude < 0 ? 32700 : 32600) + zone);
        else
            sst_log_error(
                "%s has places of a map that it does not name; if they are of UTM, add its zone, as --utm %d%c", path,
                zone, posed->latitude < 0 ? 'S' : 'N');
        return -EBADMSG;
    }
    if (!find_origin(xy, posed, &utm)) {
        sst_log_error(
            "%s: the light field, at longitude %.4f and latitude %.4f, is not near UTM's zone %d%c; correct the "
            "zone",
            path, posed->longitude, posed->latitude, utm.zone, utm.south ? 'S' : 'N');
        return -EBADMSG;
    }
    convert(h, posed, &utm, xy);
    *placed = true;
    return 0;
}
