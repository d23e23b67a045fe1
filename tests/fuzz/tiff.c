/* Fuzz target: TIFF files as pictures and as grids of numbers. A size agrees with its picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/image_internal.h"
#include "pipeline/image/codec.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#if WITH_TIFF
#include <tiffio.h>

#define SIDE 16

/* A small file of each compression, as strips and as tiles: grey of 16 bits, colours, a palette, floats with a place.
 */
static size_t make(uint8_t *out, size_t room, int i)
{
    static const uint16_t compressions[] = { COMPRESSION_NONE, COMPRESSION_PACKBITS, COMPRESSION_LZW,
                                             COMPRESSION_ADOBE_DEFLATE };
    static const TIFFFieldInfo places[] = {
        { 33550, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)"ModelPixelScale" },
        { 33922, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)"ModelTiepoint" },
        { 42113, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, (char *)"GDALNoData" },
    };
    const int kind = i / 4 % 4, channels = kind == 1 ? 3 : 1, bits = kind == 0 ? 16 : kind == 3 ? 32 : 8;
    static const double scale[3] = { 1, 1, 0 }, tie[6] = { 0, 0, 0, 9, 9, 0 };
    uint8_t pixels[SIDE * SIDE * 4];
    uint16_t map[3][256];
    const char *path = input_file(NULL, 0);
    TIFF *tif = TIFFOpen(path, i % 3 == 0 ? "wl" : i % 3 == 1 ? "wb" : "w8");
    FILE *f;
    size_t n;

    if (!tif)
        abort();
    TIFFMergeFieldInfo(tif, places, 3);
    TIFFSetField(tif, TIFFTAG_IMAGEWIDTH, SIDE);
    TIFFSetField(tif, TIFFTAG_IMAGELENGTH, SIDE);
    TIFFSetField(tif, TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(tif, TIFFTAG_SAMPLESPERPIXEL, channels);
    TIFFSetField(tif, TIFFTAG_SAMPLEFORMAT, kind == 3 ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
    TIFFSetField(tif, TIFFTAG_PHOTOMETRIC,
                 kind == 1   ? PHOTOMETRIC_RGB
                 : kind == 2 ? PHOTOMETRIC_PALETTE
                             : PHOTOMETRIC_MINISBLACK);
    TIFFSetField(tif, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tif, TIFFTAG_COMPRESSION, compressions[i % 4]);
    if (i % 4 > 1)
        TIFFSetField(tif, TIFFTAG_PREDICTOR, kind == 2 ? 1 : 2);
    if (i / 16) {
        TIFFSetField(tif, TIFFTAG_TILEWIDTH, SIDE);
        TIFFSetField(tif, TIFFTAG_TILELENGTH, SIDE);
    } else {
        TIFFSetField(tif, TIFFTAG_ROWSPERSTRIP, SIDE);
    }
    for (int k = 0; k < 256; k++)
        map[0][k] = map[1][k] = map[2][k] = (uint16_t)(k * 257);
    if (kind == 2)
        TIFFSetField(tif, TIFFTAG_COLORMAP, map[0], map[1], map[2]);
    if (kind == 3) {
        TIFFSetField(tif, 33550, 3, scale);
        TIFFSetField(tif, 33922, 6, tie);
        TIFFSetField(tif, 42113, "-1");
    }
    for (size_t k = 0; k < sizeof(pixels); k++)
        pixels[k] = (uint8_t)(k * k >> 3);
    if (i / 16)
        TIFFWriteEncodedTile(tif, 0, pixels, SIDE * SIDE * channels * bits / 8);
    else
        TIFFWriteEncodedStrip(tif, 0, pixels, SIDE * SIDE * channels * bits / 8);
    TIFFClose(tif);
    f = fopen(path, "rb");
    n = f ? fread(out, 1, room, f) : 0;
    if (f)
        fclose(f);
    return n;
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    uint8_t file[8192];

    for (int i = 0; i < 32; i++)
        seed_write("tiff", i, file, make(file, sizeof(file), i));
    return 0;
}
#endif

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_deep_size found;
    struct sst_deep deep;
    struct sst_map_f32 grid;
    struct tiff_geo geo;

    if (!tiff_decode(&deep, data, size, "input")) {
        if (tiff_size(&found, data, size, "input") || found.width != deep.width || found.height != deep.height ||
            found.channels != deep.channels || found.bits != (deep.white == 255 ? 8 : 16))
            abort();
        sst_deep_fini(&deep);
    }
    if (!tiff_decode_grid(&grid, &geo, data, size, "input"))
        sst_map_f32_fini(&grid);
    return 0;
}
