/* pipeline/image/heights.h - terrain: a grid of heights, of a file. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_HEIGHTS_H
#define SST_PIPELINE_IMAGE_HEIGHTS_H

#include "pipeline/image/image.h"

/** Heights on a grid over two level axes; sample (i, j) is at (x_mm + i step_x_mm, y_mm + j step_y_mm). */
struct sst_heights {
    double x_mm, y_mm, step_x_mm, step_y_mm; /* steps are not 0, and may be negative: y is, where north is up */
    struct sst_map_f32 mm;                   /* NAN: unknown */
    double turn_rad;                         /* angle from the world's axes to the grid's, about the upward one */
    int epsg;                                /* of the map that a file's places are on; 0: unknown */
};

/**
 * Read a terrain file with its numbers in metres.
 *
 * TIFF of one channel of 16 bits or 32-bit floats (tiff.h's compressions), placed north up by tags of GeoTIFF or by a
 * world file beside it: NAME.tfw, NAME.tifw or NAME.wld. GDAL's number for no data is unknown. Scale and offset of
 * GDAL's metadata are not applied, with a warning. OBJ (name ends in .obj): the triangles of a mesh, z upwards, on a
 * grid with the mean spacing of its vertices, north up; the highest one where several are above each other.
 * @return 0, -ENOENT, -EBADMSG (one sentence: file, fault, remedy), -ENOMEM, -EIO; logged
 */
SST_MUST_CHECK int sst_heights_read(struct sst_heights *out, const char *path);
void sst_heights_fini(struct sst_heights *heights);

#endif
