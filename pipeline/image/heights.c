/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/heights.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

#define WORLD_NUMBERS 6
#define WORLD_MAX     4096 /* bytes */
#define MM            1000.0
#define MOST          1e6f /* m: a higher number is no height */

void sst_heights_fini(struct sst_heights *heights)
{
    sst_map_f32_fini(&heights->mm);
}

/* --- world files -------------------------------------------------------------------------------------------------- */

/* Step in x, rotations, step in y, and the centre of the first cell, a number a line. */
static int read_world(struct tiff_geo *geo, const char *path)
{
    double v[WORLD_NUMBERS];
    uint8_t *text;
    size_t size;
    char *at, *end;
    int n = 0, err = sst_file_read_text(path, WORLD_MAX, &text, &size);

    if (err)
        return err;
    at = (char *)text;
    for (; n < WORLD_NUMBERS; n++, at = end) {
        v[n] = strtod(at, &end);
        if (end == at || !isfinite(v[n]))
            break;
    }
    free(text);
    if (n < WORLD_NUMBERS) {
        sst_log_error("%s has %d of the 6 numbers of a world file; write it again", path, n);
        return -EBADMSG;
    }
    if (v[1] != 0 || v[2] != 0) {
        sst_log_error("%s turns the grid by %g and %g; write the terrain north up, as gdalwarp IN OUT does", path, v[1],
                      v[2]);
        return -EBADMSG;
    }
    *geo = (struct tiff_geo){ .placed = true,
                              .dx = v[0],
                              .dy = v[3],
                              .x = v[4],
                              .y = v[5],
                              .epsg = geo->epsg,
                              .has_nodata = geo->has_nodata,
                              .nodata = geo->nodata };
    return 0;
}

/* The first world file that is there. @return 0 also if there is none */
static int find_world(struct tiff_geo *geo, const char *path)
{
    static const char *const endings[] = { ".tfw", ".TFW", ".tifw", ".tiffw", ".wld" };
    const char *dot = strrchr(path, '.'), *slash = strrchr(path, '/');
    const size_t stem = dot && (!slash || dot > slash) ? (size_t)(dot - path) : strlen(path);
    char world[SST_PATH_MAX];

    for (size_t i = 0; i < ARRAY_LEN(endings) && stem + 8 < sizeof(world); i++) {
        snprintf(world, sizeof(world), "%.*s%s", (int)stem, path, endings[i]);
        if (sst_path_exists(world))
            return read_world(geo, world);
    }
    return 0;
}

/* --- files -------------------------------------------------------------------------------------------------------- */

static int check_place(const struct tiff_geo *geo, const char *path)
{
    if (!geo->placed) {
        sst_log_error(
            "%s has no place on the ground: neither tags of GeoTIFF nor a world file (.tfw) beside it; write it "
            "with one, as gdal_translate -co TFW=YES does",
            path);
        return -EBADMSG;
    }
    if (!isgreater(fabs(geo->dx), 0) || !isgreater(fabs(geo->dy), 0) ||
        !isfinite(geo->dx + geo->dy + geo->x + geo->y)) {
        sst_log_error("%s has cells of %g by %g m at %g, %g; correct its place", path, geo->dx, geo->dy, geo->x,
                      geo->y);
        return -EBADMSG;
    }
    return 0;
}

static int read_tiff(struct sst_heights *out, const uint8_t *data, size_t size, const char *path)
{
    struct tiff_geo geo;
    int err = tiff_decode_grid(&out->mm, &geo, data, size, path);

    if (!err && !geo.placed)
        err = find_world(&geo, path);
    err = err ? err : check_place(&geo, path);
    if (err)
        return err;
    out->x_mm = geo.x;
    out->y_mm = geo.y;
    out->step_x_mm = geo.dx;
    out->step_y_mm = geo.dy;
    out->epsg = geo.epsg;
    return 0;
}

/* Metres to millimetres. @return how many heights are known */
static size_t scale(struct sst_heights *h)
{
    size_t known = 0;

    h->x_mm *= MM;
    h->y_mm *= MM;
    h->step_x_mm *= MM;
    h->step_y_mm *= MM;
    for (int y = 0; y < h->mm.height; y++) {
        float *row = sst_map_f32_row(&h->mm, y);

        for (int x = 0; x < h->mm.width; x++) {
            row[x] = isless(fabsf(row[x]), MOST) ? (float)((double)row[x] * MM) : NAN;
            known += !isnan(row[x]);
        }
    }
    return known;
}

int sst_heights_read(struct sst_heights *out, const char *path)
{
    const char *dot = strrchr(path, '.');
    const bool mesh = dot && !strcasecmp(dot, ".obj");
    struct sst_heights made = { 0 };
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size);

    if (err)
        return err;
    if (mesh) {
        err = mesh_to_heights(&made, (char *)data, path);
    } else if (tiff_is(data, size)) {
        err = read_tiff(&made, data, size, path);
    } else {
        sst_log_error("%s is no terrain: neither a TIFF nor a mesh (.obj); convert it to one of them", path);
        err = -EBADMSG;
    }
    free(data);
    if (!err && !scale(&made)) {
        sst_log_error("%s has no height that is known; write it again", path);
        err = -EBADMSG;
    }
    if (err)
        sst_heights_fini(&made);
    else
        *out = made;
    return err;
}
