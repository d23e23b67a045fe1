/* Terrain files: grids by libtiff with their place, and meshes. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "base/log.h"
#include "pipeline/image/heights.h"
#include "tests/codec_pictures.h"

static void put_text(const char *name, const char *text)
{
    put_file(name, text, strlen(text));
}

static float at(const struct sst_heights *h, int x, int y)
{
    return sst_map_f32_row(&h->mm, y)[x];
}

static void assert_near(double a, double b, double tolerance)
{
    if (!(fabs(a - b) <= tolerance))
        fail_msg("%.9g is not %.9g", a, b);
}

static void refused(const char *name, const char *words)
{
    char text[SST_LOG_MAX] = "", *before = sst_log_hold_errors(text);
    struct sst_heights h;

    assert_int_equal(sst_heights_read(&h, test_path("%s", name)), -EBADMSG);
    sst_log_hold_errors(before);
    assert_contains(text, words);
}

/* A regular mesh of 5 by 4 vertices 2 m apart gives the vertices themselves. */
static void a_mesh_becomes_a_grid(void **state SST_UNUSED)
{
    char text[4096] = "# terrain\nmtllib none.mtl\nvn 0 0 1\nvt 0 0\n";
    struct sst_heights h;

    for (int i = 0; i < 20; i++)
        sprintf(text + strlen(text), "v %d %g %d\r\n", 10 + i % 5 * 2, -3 + i / 5 * 2.0, i * i);
    for (int i = 1; i < 15; i++) { /* faces of four vertices, and two of three */
        if (i % 5 && i % 2)
            sprintf(text + strlen(text), "f %d/1/1 %d/1/1 %d//1 %d\n", i, i + 1, i + 6, i + 5);
        else if (i % 5)
            sprintf(text + strlen(text), "f %d %d %d\nf %d %d %d\n", i - 21, i - 20, i - 15, i + 1, i + 6, i + 5);
    }
    put_text("mesh.obj", text);
    assert_int_equal(sst_heights_read(&h, test_path("mesh.obj")), 0);
    assert_int_equal(h.mm.width, 5);
    assert_int_equal(h.mm.height, 4);
    assert_near(h.x_mm, 10000, 1e-6);
    assert_near(h.y_mm, 3000, 1e-6);
    assert_near(h.step_x_mm, 2000, 1e-6);
    assert_near(h.step_y_mm, -2000, 1e-6);
    for (int i = 0; i < 20; i++)
        assert_near(at(&h, i % 5, 3 - i / 5), i * i * 1000, 0.01);
    sst_heights_fini(&h);
}

/* Between vertices it is linear, beside the triangles unknown, and where two are above each other, the upper one. */
static void meshes_are_interpolated(void **state SST_UNUSED)
{
    struct sst_heights h;

    put_text("tilted.OBJ", "v 0 0 0\nv 8 0 8\nv 0 8 16\nv 0 0 -9\nv 1 0 -9\nv 0 1 -9\nv 8 8 1\nv 8 7 1\nv 7 8 1\n"
                           "f 1 2 3\nf 4 5 6\nf 7 8 9\n");
    assert_int_equal(sst_heights_read(&h, test_path("tilted.OBJ")), 0);
    for (int y = 0; y < h.mm.height; y++) {
        for (int x = 0; x < h.mm.width; x++) {
            const double px = (h.x_mm + x * h.step_x_mm) / 1000, py = (h.y_mm + y * h.step_y_mm) / 1000;

            if (px + py <= 8)
                assert_near(at(&h, x, y), (px + 2 * py) * 1000, 0.05);
            else if (px + py < 14.9)
                assert_true(isnan(at(&h, x, y)));
        }
    }
    assert_near(at(&h, h.mm.width - 1, 0), 1000, 0.01);
    sst_heights_fini(&h);
    /* AOS's plane, with triangles in both directions. */
    put_text("plane.obj",
             "v -1000 -1000 0\nv  1000 -1000 0\nv -1000  1000 0\nv  1000  1000 0\nf 1/1 2/2 3/3\nf 2/2 4/4 3/3");
    assert_int_equal(sst_heights_read(&h, test_path("plane.obj")), 0);
    assert_int_equal(h.mm.width, 2);
    assert_int_equal(h.mm.height, 2);
    for (int i = 0; i < 4; i++)
        assert_near(at(&h, i % 2, i / 2), 0, 0);
    sst_heights_fini(&h);
}

static void wrong_meshes_are_refused(void **state SST_UNUSED)
{
    put_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n");
    refused("a.obj", "line 3 is a vertex without three numbers");
    put_text("a.obj", "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n");
    refused("a.obj", "line 2 is a vertex");
    put_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    refused("a.obj", "line 4 is a face of a vertex that is not there");
    put_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n");
    refused("a.obj", "not there");
    put_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n");
    refused("a.obj", "not there");
    put_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n");
    refused("a.obj", "line 4 is a face of less than three");
    put_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    refused("a.obj", "0 triangles cover no ground");
    put_text("a.obj", "v 0 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\n"); /* a wall */
    refused("a.obj", "cover no ground");
    put_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1e6 1e6 0\nv 1e6 1e6 1\nv 1000001 1e6 0\nf 1 2 3\nf 4 5 6\n");
    refused("a.obj", "cover no ground");
    put_text("a.obj", "v 0 0 0\nv 1e300 0 0\nv 0 1e300 0\nf 1 2 3\n");
    refused("a.obj", "cover no ground");
    put_text("a.obj", "v -1000 -1000 0\nv 1000 -1000 0\nv -1000 1e208 0\nf 1 2 3\n");
    refused("a.obj", "claims 2x1000000001 pixels");
    put_text("a.obj", "v 0 0 1e9\nv 1 0 1e9\nv 0 1 1e9\nf 1 2 3\n");
    refused("a.obj", "no height that is known");
    put_text("a.txt", "0 1 2\n");
    refused("a.txt", "neither a TIFF nor a mesh");
}

#if WITH_TIFF
#include <tiffio.h>

#define WIDTH  21
#define HEIGHT 18

static const TIFFFieldInfo geo_tags[] = {
    { 33550, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)"ModelPixelScale" },
    { 33922, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)"ModelTiepoint" },
    { 34264, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)"ModelTransformation" },
    { 34735, -1, -1, TIFF_SHORT, FIELD_CUSTOM, 1, 1, (char *)"GeoKeyDirectory" },
    { 42112, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, (char *)"GDALMetadata" },
    { 42113, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, (char *)"GDALNoData" },
};

static bool registered; /* while files are written, and for some that are read */

static void register_tags(TIFF *tif)
{
    if (registered)
        TIFFMergeFieldInfo(tif, geo_tags, ARRAY_LEN(geo_tags));
}

/* A terrain to write. Zeros: floats, without any tag of a place. */
struct terrain {
    int bits, format, channels, tile;
    bool placed, points, degrees, feet, feet_high, transformed;
    const char *nodata, *metadata;
};

static float height(int x, int y)
{
    return (float)(200 + x * 3 - y * 7);
}

static void set_places(TIFF *tif, const struct terrain *t)
{
    const double scale[] = { 0.5, 0.25, 0 }, tie[] = { 1, 2, 0, 7000, 5300, 0 }, matrix[16] = { 1 };
    const uint16_t keys[] = {
        1, 1, 0, 4, 1024, 0, 1, t->degrees ? 2 : 1, 1025, 0, 1, t->points ? 2 : 1, 3076, 0, 1, t->feet ? 9002 : 9001,
        4099, 0, 1, t->feet_high ? 9003 : 9001
    };

    if (t->placed) {
        TIFFSetField(tif, 33550, 3, scale);
        TIFFSetField(tif, 33922, 6, tie);
        TIFFSetField(tif, 34735, (int)ARRAY_LEN(keys), keys);
    }
    if (t->transformed)
        TIFFSetField(tif, 34264, 16, matrix);
    if (t->metadata)
        TIFFSetField(tif, 42112, t->metadata);
    if (t->nodata)
        TIFFSetField(tif, 42113, t->nodata);
}

static void make(const char *name, const struct terrain *t)
{
    const int bits = t->bits ? t->bits : 32, format = t->format ? t->format : SAMPLEFORMAT_IEEEFP;
    const int channels = t->channels ? t->channels : 1, side = 32;
    static uint8_t data[32 * 32 * 8 * 4];
    TIFF *tif;

    registered = true;
    /* libtiff 4.5 writes wrong floats with a predictor in the byte order that is not the processor's. */
    tif = TIFFOpen(test_path("%s", name), t->tile ? "w" : "wb");
    registered = false;
    assert_non_null(tif);
    TIFFSetField(tif, TIFFTAG_IMAGEWIDTH, WIDTH);
    TIFFSetField(tif, TIFFTAG_IMAGELENGTH, HEIGHT);
    TIFFSetField(tif, TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(tif, TIFFTAG_SAMPLEFORMAT, format);
    TIFFSetField(tif, TIFFTAG_SAMPLESPERPIXEL, channels);
    TIFFSetField(tif, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tif, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(tif, TIFFTAG_COMPRESSION, t->tile ? COMPRESSION_ADOBE_DEFLATE : COMPRESSION_NONE);
    if (t->tile) {
        TIFFSetField(tif, TIFFTAG_TILEWIDTH, side);
        TIFFSetField(tif, TIFFTAG_TILELENGTH, side);
        TIFFSetField(tif, TIFFTAG_PREDICTOR, format == SAMPLEFORMAT_IEEEFP ? 3 : 2);
    } else {
        TIFFSetField(tif, TIFFTAG_ROWSPERSTRIP, HEIGHT);
    }
    set_places(tif, t);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const int i = y * (t->tile ? side : WIDTH) + x;
            const float v = x == 3 && y == 4 ? -9999 : height(x, y);
            const int16_t integer = (int16_t)v;

            if (bits == 16)
                memcpy(data + 2 * i, &integer, 2);
            else if (bits == 32)
                memcpy(data + 4 * i, &v, 4);
        }
    }
    if (t->tile)
        assert_true(TIFFWriteEncodedTile(tif, 0, data, side * side * bits / 8 * channels) > 0);
    else
        assert_true(TIFFWriteEncodedStrip(tif, 0, data, WIDTH * HEIGHT * bits / 8 * channels) > 0);
    TIFFClose(tif);
}

/* Half a cell from the corner of the area at column 1, row 2, or the cell itself. */
static void check_once(const char *name, double x_mm, double y_mm, bool unknown)
{
    struct sst_heights h;

    assert_int_equal(sst_heights_read(&h, test_path("%s", name)), 0);
    assert_int_equal(h.mm.width, WIDTH);
    assert_int_equal(h.mm.height, HEIGHT);
    assert_near(h.x_mm, x_mm, 1e-6);
    assert_near(h.y_mm, y_mm, 1e-6);
    assert_near(h.step_x_mm, 500, 1e-6);
    assert_near(h.step_y_mm, -250, 1e-6);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            if (x == 3 && y == 4)
                assert_true(unknown ? isnan(at(&h, x, y)) : at(&h, x, y) == -9999000);
            else
                assert_near(at(&h, x, y), height(x, y) * 1000, 0);
        }
    }
    sst_heights_fini(&h);
}

/* Also where another library has registered the tags, as GDAL does. */
static void check(const char *name, double x_mm, double y_mm, bool unknown)
{
    check_once(name, x_mm, y_mm, unknown);
    registered = true;
    check_once(name, x_mm, y_mm, unknown);
    registered = false;
}

static void places_are_those_of_tags(void **state SST_UNUSED)
{
    make("a.tif", &(struct terrain){ .placed = true, .nodata = "-9999" });
    check("a.tif", 6999750, 5300375, true);
    make("a.tif", &(struct terrain){ .placed = true, .points = true });
    check("a.tif", 6999500, 5300500, false);
    make("a.tif", &(struct terrain){ .placed = true, .tile = true, .nodata = "-9999.0 " });
    check("a.tif", 6999750, 5300375, true);
    for (int i = 0; i < 2; i++) {
        make("a.tif",
             &(struct terrain){ .bits = 16, .format = SAMPLEFORMAT_INT, .placed = true, .tile = i, .nodata = "-9999" });
        check("a.tif", 6999750, 5300375, true);
    }
    make("a.tif", &(struct terrain){ .placed = true, .nodata = "none", .metadata = "<Item name=\"SOURCE\">2</Item>" });
    check("a.tif", 6999750, 5300375, false);
}

static void scale_and_offset_of_metadata_are_applied(void **state SST_UNUSED)
{
    struct sst_heights h;

    make("s.tif", &(struct terrain){ .placed = true,
                                     .nodata = "-9999",
                                     .bits = 16,
                                     .format = SAMPLEFORMAT_INT,
                                     .metadata = "<GDALMetadata>\n  <Item name=\"OFFSET\" sample=\"0\" role=\"offset\">300"
                                                 "</Item>\n  <Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.01</Item>\n"
                                                 "</GDALMetadata>\n" });
    assert_int_equal(sst_heights_read(&h, test_path("s.tif")), 0);
    assert_near(at(&h, 5, 1), 300000 + height(5, 1) * 10, 0.1);
    assert_true(isnan(at(&h, 3, 4)));
    sst_heights_fini(&h);
    make("s.tif", &(struct terrain){ .placed = true, .metadata = "<Item role=\"scale\">one</Item>" });
    refused("s.tif", "a scale or an offset that is no number");
}

static void world_files_place_too(void **state SST_UNUSED)
{
    make("b.tif", &(struct terrain){ .nodata = "-9999" });
    refused("b.tif", "no place on the ground");
    put_text("b.wld", "0.5\n0\n0\n-0.25\n100\n200.5\n");
    check("b.tif", 100000, 200500, true);
    put_text("b.tfw", "0.5\r\n0.0\r\n0.0\r\n-0.25\r\n-100\r\n2e2\r\n");
    check("b.tif", -100000, 200000, true);
    put_text("b.tfw", "0.5\n0.01\n0\n-0.25\n100\n200\n");
    refused("b.tif", "turns the grid by 0.01 and 0");
    put_text("b.tfw", "0.5\n0\n0\n-0.25\n100\n");
    refused("b.tif", "5 of the 6 numbers");
    put_text("b.tfw", "0,5\n0\n0\n-0,25\n100\n200\n");
    refused("b.tif", "of the 6 numbers");
    put_text("b.tfw", "0.5\n0\n0\n0\n100\n200\n");
    refused("b.tif", "cells of 0.5 by 0 m");
}

static void wrong_grids_are_refused(void **state SST_UNUSED)
{
    make("c.tif", &(struct terrain){ .placed = true, .degrees = true });
    refused("c.tif", "degrees");
    make("c.tif", &(struct terrain){ .placed = true, .feet = true });
    refused("c.tif", "another unit than metres");
    make("c.tif", &(struct terrain){ .placed = true, .feet_high = true });
    refused("c.tif", "heights are in another unit than metres");
    make("c.tif", &(struct terrain){ .placed = true, .transformed = true });
    refused("c.tif", "transformation");
    make("c.tif", &(struct terrain){ .placed = true, .bits = 64 });
    refused("c.tif", "1 channels of 64 bits");
    make("c.tif", &(struct terrain){ .placed = true, .bits = 8, .format = SAMPLEFORMAT_UINT });
    refused("c.tif", "of 8 bits");
    make("c.tif", &(struct terrain){ .placed = true, .channels = 3 });
    refused("c.tif", "3 channels of 32 bits");
}
#endif

int main(void)
{
    static const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mesh_becomes_a_grid),
        cmocka_unit_test(meshes_are_interpolated),
        cmocka_unit_test(wrong_meshes_are_refused),
#if WITH_TIFF
        cmocka_unit_test(places_are_those_of_tags),
        cmocka_unit_test(scale_and_offset_of_metadata_are_applied),
        cmocka_unit_test(world_files_place_too),
        cmocka_unit_test(wrong_grids_are_refused),
#endif
    };

#if WITH_TIFF
    TIFFSetTagExtender(register_tags);
#endif
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
