/* Grids of numbers as TIFF files, with the tags of GeoTIFF and GDAL. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/file_tiff.h"
#include "pipeline/image/image_internal.h"

#define TAG_PIXEL_SCALE    33550 /* of GeoTIFF, doubles */
#define TAG_TIEPOINT       33922
#define TAG_TRANSFORMATION 34264
#define TAG_GEO_KEYS       34735 /* shorts */
#define TAG_GDAL_METADATA  42112 /* texts */
#define TAG_GDAL_NODATA    42113

#define KEY_MODEL       1024 /* and values */
#define MODEL_PROJECTED 1
#define KEY_RASTER      1025
#define RASTER_POINTS   2
#define KEY_PROJECTED   3072
#define KEY_UNIT        3076
#define KEY_HEIGHTS     4096 /* EPSG's number of the vertical reference, which alone GDAL writes */
#define KEY_HEIGHT_UNIT 4099
#define UNIT_METRE      9001

/* Numbers or a text of a tag. The library does not know it, unless another one of this process (GDAL) has registered
 * it, which decides how it is handed over. @return how many; 0: there are none of this type */
static uint32_t get_numbers(const void **values, const struct tiff_file *f, uint32_t tag, TIFFDataType type)
{
    const TIFFField *field = tiff_lib.TIFFFindField(f->tif, tag, TIFF_ANY);
    uint32_t n = 0;
    uint16_t few = 0;

    if (!field || tiff_lib.TIFFFieldDataType(field) != type)
        return 0;
    if (!tiff_lib.TIFFFieldPassCount(field))
        return type == TIFF_ASCII && tiff_lib.TIFFGetField(f->tif, tag, values) ? (uint32_t)strlen(*values) + 1 : 0;
    if (tiff_lib.TIFFFieldReadCount(field) == TIFF_VARIABLE2)
        return tiff_lib.TIFFGetField(f->tif, tag, &n, values) ? n : 0;
    return tiff_lib.TIFFGetField(f->tif, tag, &few, values) ? few : 0;
}

/* Number of an item of GDAL's metadata, as <Item name="SCALE" sample="0" role="scale">0.01</Item>; other samples' items
 * come later. @return 0 or -EBADMSG (no number) */
static int item_number(double *value, const char *text, const char *role)
{
    const char *at = strstr(text, role);
    char *end;

    if (!at || !(at = strchr(at, '>')))
        return 0;
    *value = strtod(at + 1, &end);
    return end != at + 1 && *end == '<' && isfinite(*value) ? 0 : -EBADMSG;
}

/* Vertical references in feet: NAVD88, Poolbeg, GCVD54, CBVD61. */
static bool is_in_feet(int epsg)
{
    static const int feet[] = { 6360, 8228, 5754, 6130, 6132 };

    for (size_t i = 0; i < ARRAY_LEN(feet); i++) {
        if (feet[i] == epsg)
            return true;
    }
    return false;
}

struct keys {
    bool points;   /* samples are at places, not of areas */
    bool vertical; /* the scale and the tie point have heights too */
};

/* Keys of GeoTIFF that change the meaning of a place: of areas or points, in degrees, in feet, on which map. */
static int read_keys(struct keys *k, int *epsg, const struct tiff_file *f)
{
    const void *values;
    const uint32_t n = get_numbers(&values, f, TAG_GEO_KEYS, TIFF_SHORT);
    const uint16_t *key = values;

    *k = (struct keys){ 0 };
    for (uint32_t i = 4; i + 4 <= n; i += 4) {
        if (key[i] == KEY_RASTER)
            k->points = key[i + 3] == RASTER_POINTS;
        k->vertical |= key[i] == KEY_HEIGHTS && key[i + 3];
        if (key[i] == KEY_PROJECTED)
            *epsg = key[i + 3];
        if (key[i] == KEY_MODEL && key[i + 3] != MODEL_PROJECTED)
            return tiff_refuse(f, "whose places are no metres on a map, but degrees",
                               "write it in a projection, as gdalwarp -t_srs EPSG:25832 IN OUT does");
        if (key[i] == KEY_UNIT && key[i + 3] != UNIT_METRE)
            return tiff_refuse(f, "whose places are in another unit than metres",
                               "write it in metres, as gdalwarp does");
        if ((key[i] == KEY_HEIGHT_UNIT && key[i + 3] != UNIT_METRE) || (key[i] == KEY_HEIGHTS && is_in_feet(key[i + 3])))
            return tiff_refuse(f, "whose heights are in another unit than metres",
                               "write them in metres: feet, for example, as gdal_translate -ot Float32 "
                               "-scale 0 1 0 0.3048 -a_srs EPSG:32633 IN OUT does");
    }
    return 0;
}

/* Place by a scale and one tie point; the factor and the offset of heights, which GDAL writes there where the file has a
 * vertical reference. */
static int read_place(struct tiff_geo *geo, const struct tiff_file *f)
{
    const void *values;
    const double *scale = NULL, *tie = NULL;
    uint32_t scales;
    struct keys k;
    int err = read_keys(&k, &geo->epsg, f);

    geo->scale = 1;
    if (err)
        return err;
    if (get_numbers(&values, f, TAG_TRANSFORMATION, TIFF_DOUBLE))
        return tiff_refuse(f, "placed by a transformation, which may turn it",
                           "write it north up, as gdalwarp IN OUT does");
    scales = get_numbers(&values, f, TAG_PIXEL_SCALE, TIFF_DOUBLE);
    if (scales >= 2)
        scale = values;
    if (get_numbers(&values, f, TAG_TIEPOINT, TIFF_DOUBLE) >= 6)
        tie = values;
    if (!scale || !tie)
        return 0;
    geo->placed = true;
    geo->dx = scale[0];
    geo->dy = -scale[1];
    if (k.vertical && scales >= 3 && scale[2] != 0) {
        geo->scale = scale[2];
        geo->offset = tie[5] - tie[2] * scale[2];
    }
    geo->x = tie[3] + ((k.points ? 0 : 0.5) - tie[0]) * geo->dx;
    geo->y = tie[4] + ((k.points ? 0 : 0.5) - tie[1]) * geo->dy;
    return 0;
}

static int read_gdal(struct tiff_geo *geo, const struct tiff_file *f)
{
    const void *text;
    uint32_t n = get_numbers(&text, f, TAG_GDAL_NODATA, TIFF_ASCII);
    char number[64], *end;

    if (n) {
        snprintf(number, sizeof(number), "%.*s", (int)(n < 63 ? n : 63), (const char *)text);
        geo->nodata = strtod(number, &end);
        geo->has_nodata = end != number;
    }
    n = get_numbers(&text, f, TAG_GDAL_METADATA, TIFF_ASCII);
    if ((n && memchr(text, '\0', n) &&
         (item_number(&geo->scale, text, "role=\"scale\"") || item_number(&geo->offset, text, "role=\"offset\""))) ||
        !isfinite(geo->scale) || geo->scale == 0 || !isfinite(geo->offset))
        return tiff_refuse(f, "whose heights have a scale of 0, or a scale or an offset that is no number",
                           "write it without, as gdal_translate -unscale -ot Float32 IN OUT does");
    return 0;
}

/* A grid that is decoded. */
struct grid {
    struct sst_map_f32 *map;
    struct tiff_geo *geo;
    struct tiff_layout layout;
};

static void put_numbers(void *arg, const struct tiff_row *row)
{
    const struct grid *g = arg;
    float *to = sst_map_f32_row(g->map, row->y) + row->x;

    for (int x = 0; x < row->width; x++) {
        const uint8_t *from = row->samples + (size_t)x * row->step * (size_t)g->layout.bits / 8;

        if (g->layout.format == SAMPLEFORMAT_IEEEFP)
            memcpy(&to[x], from, sizeof(to[x]));
        else if (g->layout.format == SAMPLEFORMAT_INT)
            to[x] = *(const int16_t *)(const void *)from;
        else
            to[x] = *(const uint16_t *)(const void *)from;
        if (!isfinite(to[x]) || (g->geo->has_nodata && to[x] == (float)g->geo->nodata))
            to[x] = NAN;
        to[x] = (float)((double)to[x] * g->geo->scale + g->geo->offset);
    }
}

static int grid_work(void *arg, struct tiff_file *f)
{
    struct grid *g = arg;
    struct tiff_layout *l = &f->layout;
    char what[64];
    int err;

    snprintf(what, sizeof(what), "of %d channels of %d bits", f->samples, l->bits);
    if (f->samples != 1 || l->bits != (l->format == SAMPLEFORMAT_IEEEFP ? 32 : 16))
        return tiff_refuse(f, what, "heights are one channel of 16 bits or of 32-bit floating-point numbers, as "
                                    "gdal_translate -b 1 -ot Float32 IN OUT writes");
    l->channels = 1;
    g->layout = *l;
    err = read_place(g->geo, f);
    err = err ? err : tiff_check_rows(f);
    err = err ? err : read_gdal(g->geo, f);
    if (err)
        return err;
    err = sst_map_f32_init(g->map, l->width, l->height);
    return err ? sst_image_size_error(err, f->name, l->width, l->height) : tiff_read_rows(f, put_numbers, g);
}

int tiff_decode_grid(struct sst_map_f32 *grid, struct tiff_geo *geo, const uint8_t *data, size_t size, const char *name)
{
    struct sst_map_f32 map = { 0 };
    struct tiff_geo place = { 0 };
    const int err = tiff_read_file(data, size, name, grid_work, &(struct grid){ .map = &map, .geo = &place });

    if (err) {
        sst_map_f32_fini(&map);
        return err;
    }
    *grid = map;
    *geo = place;
    return 0;
}
