/* ODM's geo.txt: a line with the reference system, then a line a picture: name, x, y, z, yaw, pitch, roll, accuracies. The
 * world becomes east, north, up about the first picture. Angles in degrees: yaw 0 has the picture's top in the north, 90 in
 * the east; pitch 0 looks straight down, 90 forward; roll 90 looks to the left. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* strcasestr */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/log.h"
#include "pipeline/posed/import/import_internal.h"
#include "pipeline/posed/utm.h"

#define PI 3.14159265358979323846

static bool find_number(const char *text, const char *key, int *out)
{
    const char *p = strcasestr(text, key);

    return p && sscanf(p + strlen(key), "%d", out) == 1;
}

/* The first line. @return false: another system */
static bool read_reference(struct sst_utm *to, const char *line)
{
    int code;
    char side = 'N';

    *to = (struct sst_utm){ 0 };
    if (find_number(line, "EPSG:", &code)) {
        to->zone = code == 4326 ? 0 : code % 100;
        to->south = code / 100 == 327;
        return code == 4326 || ((code / 100 == 326 || to->south) && to->zone >= 1 && to->zone <= 60);
    }
    if (strncmp(line, "+proj=", 6))
        return sscanf(line, "WGS84 UTM %d%c", &to->zone, &side) >= 1 && to->zone >= 1 && to->zone <= 60 &&
               (to->south = toupper((unsigned char)side) == 'S', strchr("NSns", side) != NULL);
    if (!strstr(line, "WGS84") || (strstr(line, "+units=") && !strstr(line, "+units=m")))
        return false;
    if (!strncmp(line, "+proj=longlat", 13) || !strncmp(line, "+proj=latlong", 13))
        return true;
    to->south = strstr(line, "+south") != NULL;
    return !strncmp(line, "+proj=utm", 9) && find_number(line, "+zone=", &to->zone) && to->zone >= 1 && to->zone <= 60;
}

/* Rows: the camera's right, down and forward in east, north, up. */
static void camera_axes(double R[9], const double angle[3])
{
    const double y = angle[0] * PI / 180, p = angle[1] * PI / 180, r = angle[2] * PI / 180;
    const double ahead[3] = { sin(y), cos(y), 0 }, right[3] = { cos(y), -sin(y), 0 };

    /* The body's axes, turned by yaw about down, pitch about right, roll about ahead; the camera looks along its down. */
    for (int i = 0; i < 3; i++) {
        const double up = i == 2, down = -up, nose = cos(p) * ahead[i] + sin(p) * up;
        const double belly = cos(p) * down + sin(p) * ahead[i];

        R[i] = cos(r) * right[i] + sin(r) * belly;
        R[3 + i] = -nose;
        R[6 + i] = cos(r) * belly - sin(r) * right[i];
    }
}

static const char *place_view(struct model_view *v, const struct sst_earth *origin, const struct sst_earth *at, const double angle[3])
{
    double local[9], R[9], t[3] = { 0, 0, 0 }, centre[3];

    camera_axes(local, angle);
    for (int i = 0; i < 3; i++) {
        centre[i] = 0;
        for (int j = 0; j < 3; j++)
            centre[i] += origin->axes[3 * i + j] * (at->at[j] - origin->at[j]);
    }
    /* R = local * (axes here) * (axes of the origin)^T */
    for (int i = 0; i < 3; i++) {
        double earth[3] = { 0, 0, 0 };

        for (int l = 0; l < 9; l++)
            earth[l % 3] += local[3 * i + l / 3] * at->axes[l];
        for (int j = 0; j < 3; j++) {
            R[3 * i + j] = earth[0] * origin->axes[3 * j] + earth[1] * origin->axes[3 * j + 1] + earth[2] * origin->axes[3 * j + 2];
            t[i] -= R[3 * i + j] * centre[j];
        }
    }
    return model_place(v, R, t);
}

struct entry {
    char name[256];
    double v[6]; /* x, y, z, yaw, pitch, roll */
};

/* @return values found, or -1: no number among them */
static int parse(struct entry *e, const char *line)
{
    int bytes = 0, n = 0;

    if (sscanf(line, "%255s%n", e->name, &bytes) != 1)
        return -1;
    while (n < 6 && line[bytes + (int)strspn(line + bytes, " \t\r")]) {
        char *end;

        e->v[n] = strtod(line + bytes, &end);
        if (end == line + bytes || (*end && !isspace((unsigned char)*end)) || !isfinite(e->v[n]))
            return -1;
        bytes = (int)(end - line);
        n++;
    }
    return n;
}

static int add(struct model *m, const struct sst_utm *of, struct sst_earth *origin, const struct entry *e)
{
    struct model_view *v;
    struct sst_earth at;
    double longitude = e->v[0], latitude = e->v[1];
    const char *fault;

    if (of->zone ? !(fabs(e->v[0] - SST_UTM_EAST_M) < SST_UTM_EAST_M && e->v[1] >= 0 && e->v[1] <= SST_UTM_SOUTH_M && e->v[0] > 1000)
                 : !(fabs(e->v[0]) <= 360 && fabs(e->v[1]) <= 90))
        return model_fault(m, e->name, of->zone ? "x, y is no place in the zone of UTM; degrees are EPSG:4326"
                                                : "x, y is no longitude and latitude in degrees, in this order");
    if (!(fabs(e->v[2]) < 1e5))
        return model_fault(m, e->name, "the altitude is beyond 100 km");
    for (int i = 3; i < 6; i++) {
        if (fabs(e->v[i]) > 360)
            return model_fault(m, e->name, "yaw, pitch or roll is beyond 360 degrees");
    }
    if (of->zone)
        sst_utm_to_degrees(&longitude, &latitude, of, e->v);
    sst_earth_at(&at, longitude, latitude, e->v[2]);
    if (!m->count) {
        *origin = at;
        m->longitude = longitude;
        m->latitude = latitude;
        m->altitude_m = e->v[2];
    }
    v = model_add(m, e->name);
    if (!v)
        return -EBADMSG;
    fault = place_view(v, origin, &at, e->v + 3);
    return fault ? model_fault(m, e->name, fault) : 0;
}

static int read_lines(struct model *m, char *text)
{
    char *save, *line = strtok_r(text, "\r\n", &save);
    struct sst_utm of;
    struct sst_earth origin = { { 0 }, { 0 } };
    int err = 0, level = 0;

    if (!line || !read_reference(&of, line)) {
        line = line ? line : text;
        sst_log_error("%s: the first line `%.60s` is no reference system that is known: it must be `EPSG:4326` (x, y are "
                      "longitude and latitude) or a zone of UTM on WGS 84 (EPSG:32601 to 32760, `WGS84 UTM 33N`); correct it, or add it above",
                      m->path, line);
        return -EBADMSG;
    }
    while (!err && (line = strtok_r(NULL, "\r\n", &save))) {
        struct entry e = { .v = { 0 } };
        int n;

        line += strspn(line, " \t\r");
        if (!*line || *line == '#')
            continue;
        n = parse(&e, line);
        if (n < 6)
            err = model_fault(m, e.name, strchr(line, ',') ? "values are separated by blanks, and decimals have a point, no comma"
                                       : n < 0          ? "a value is not a number"
                                                        : "x, y, z, yaw, pitch and roll are needed");
        else
            err = add(m, &of, &origin, &e);
        level += e.v[4] <= -45;
    }
    if (!err && m->count && level == m->count)
        err = model_fault(m, "", "pitch is near -90 in all lines, as DJI writes it for straight down; ODM counts from "
                                 "there: add 90");
    return err;
}

/* Flights look down. */
static bool look_up(const struct model *m)
{
    for (int k = 0; k < m->count; k++) {
        if (m->view[k].camera.rotation[8] <= 0)
            return false;
    }
    return m->count > 0;
}

int read_geo(struct model *m, const char *path)
{
    uint8_t *text;
    size_t size;
    int err = sst_file_read_text(path, MODEL_BYTES, &text, &size);

    if (err)
        return err;
    m->format = "ODM";
    m->path = path;
    m->geographic = m->metric = true;
    m->up[2] = 1;
    err = read_lines(m, (char *)text);
    if (!err && look_up(m))
        err = model_fault(m, "", "all cameras look up; pitch 0 is straight down and 90 forward");
    free(text);
    return err;
}
