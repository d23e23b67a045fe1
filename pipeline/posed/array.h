/* pipeline/posed/array.h - poses of the cameras of an array that is no lattice: from a calibration or a posed light
 * field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_ARRAY_H
#define SST_PIPELINE_POSED_ARRAY_H

#include "pipeline/posed/posed.h"

/** Cameras in positions of a configured grid, row by row, and the size of their frames. */
struct sst_posed_array {
    int rows, cols;
    int width, height;
    int channels; /* 1 or 3 */
};

/**
 * Read poses of an array's cameras as views by position, named "rr_cc", without pictures.
 *
 * A calibration (a file) has them by position. Of a posed light field (a folder) the views in their order are the
 * positions; its points and the direction of gravity stay. Lenses are scaled to frames of another size and the same
 * proportions.
 *
 * @return 0, -ENOENT, -EBADMSG (another grid, number of views or proportions, or nothing is placed), -ENOMEM, -EIO;
 *         logged
 */
SST_MUST_CHECK int sst_posed_array_read(struct sst_posed *out, const char *path, const struct sst_posed_array *array);

#endif
