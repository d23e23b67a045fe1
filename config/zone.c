/* Zones and masks: their corners, and the file of the zones drawn on the page. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config/config_internal.h"

#define AREA_LEAST   1e-4 /* of the picture */
#define LENGTH_LEAST 0.01 /* of its width or height */

/* A number of 0..1, of digits and a point. @return the text after it; NULL: none is there */
static const char *read_fraction(const char *text, double *out)
{
    char *end;

    if (!strchr("0123456789.", *text) || !*text)
        return NULL;
    *out = strtod(text, &end);
    return end > text && *out >= 0 && *out <= 1 ? end : NULL;
}

int config_points(const char *text, double *x, double *y)
{
    double area = 0;
    int n = 0;

    while (text && *text && n < SST_ZONE_POINTS) {
        text = read_fraction(text + strspn(text, " "), &x[n]);
        text = text && *text == ',' ? read_fraction(text + 1, &y[n]) : NULL;
        if (text && *text && *text != ' ')
            return 0;
        n++;
    }
    if (!text || text[strspn(text, " ")])
        return 0;
    for (int i = 0, k = n - 1; i < n; k = i++)
        area += (x[k] * y[i] - x[i] * y[k]) / 2;
    if (n == 2)
        return hypot(x[1] - x[0], y[1] - y[0]) >= LENGTH_LEAST ? n : 0;
    return n >= 3 && fabs(area) >= AREA_LEAST ? n : 0;
}

int sst_mask_corners(const struct sst_config_mask *m, double *x, double *y)
{
    const double px[] = { m->x0, m->x1, m->x1, m->x0 }, py[] = { m->y0, m->y0, m->y1, m->y1 };

    _Static_assert(SST_MASK_POINTS == SST_ZONE_POINTS, "corners of both are parsed alike");
    if (*m->points)
        return config_points(m->points, x, y);
    memcpy(x, px, sizeof(px));
    memcpy(y, py, sizeof(py));
    return 4;
}

int sst_zone_corners(const struct sst_zone *z, double *x, double *y)
{
    const double px[] = { z->x0, z->x1, z->x1, z->x0 }, py[] = { z->y0, z->y0, z->y1, z->y1 };

    if (*z->points)
        return config_points(z->points, x, y);
    memcpy(x, px, sizeof(px));
    memcpy(y, py, sizeof(py));
    return 4;
}

char *sst_zones_text(const struct sst_zone *zone, int zones)
{
    static const char head[] = "# Zones drawn on the page of the service, which writes this file.\nzones:";
    int count;
    const struct sst_key *key = &sst_schema(&count)[sst_schema_index("zones")];
    struct sst_config *cfg = calloc(1, sizeof(*cfg));
    char *element = malloc(SST_KEY_TEXT_MAX), *out = NULL;
    size_t size;
    FILE *f = cfg && element ? open_memstream(&out, &size) : NULL;

    if (f) {
        memcpy(cfg->zone, zone, (size_t)zones * sizeof(*zone));
        cfg->zones = zones;
        fprintf(f, "%s%s", head, zones ? "" : " []");
        for (int i = 0; i < zones; i++) {
            sst_key_element_text(key, cfg, i, cfg, element);
            fprintf(f, "\n  - %s", element);
        }
        fputs("\n", f);
        if (fclose(f)) {
            free(out);
            out = NULL;
        }
    }
    free(element);
    free(cfg);
    return out;
}
