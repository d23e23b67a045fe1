/* pipeline/image/tiff.h - TIFF files in memory, by libtiff: pictures, and grids of numbers with their place. */
#ifndef SST_PIPELINE_IMAGE_TIFF_H
#define SST_PIPELINE_IMAGE_TIFF_H

#include "pipeline/image/deep.h"

/** Place of a grid, and numbers that stand for none, by tags of GeoTIFF and GDAL. */
struct tiff_geo {
    bool placed;
    double x, y, dx, dy; /* as in heights.h */
    bool has_nodata;
    double nodata;
};

/** Whether a file in memory begins as a TIFF. */
bool tiff_is(const uint8_t *data, size_t size);

/** As the functions of deep.h; all refuse where this build has no libtiff. */
SST_MUST_CHECK int tiff_decode(struct sst_deep *out, const uint8_t *data, size_t size, const char *name);
SST_MUST_CHECK int tiff_size(struct sst_deep_size *out, const uint8_t *data, size_t size, const char *name);
SST_MUST_CHECK int tiff_write(const struct sst_deep *deep, const char *path);

/** Read one channel of floats, or of 16 bits, signed or not. @param grid  out, initialised here
 *  @return as sst_deep_decode() */
SST_MUST_CHECK int tiff_decode_grid(struct sst_map_f32 *grid, struct tiff_geo *geo, const uint8_t *data, size_t size,
                                    const char *name);

#endif
