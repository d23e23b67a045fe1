/* pipeline/posed/import/import.h - import of pictures, with or without poses, as posed light fields. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_IMPORT_IMPORT_H
#define SST_PIPELINE_POSED_IMPORT_IMPORT_H

#include <stdbool.h>

#include "base/base.h"

struct sst_posed_import_config {
    const char *source;   /* poses: a file or folder; pictures: their folder */
    const char *pictures; /* poses: folder of the pictures; NULL: found beside the poses */
    const char *out;
    const char *lens;     /* calibration of one camera, for sources without lenses; NULL: none */
    const char *moments;  /* pattern of names: "{camera}_*_{moment}"; NULL: no moments */
    double focal_px;      /* for sources without lenses; 0: none */
    double fov_deg;       /* the same as the angle across a picture's width; 0: none */
    double kelvin_scale;  /* 0: not thermal */
    double kelvin_offset;
    double unit_mm;       /* unit of the source's lengths; 0: the format's */
    bool force;           /* replace an existing output */
    int threads;
};

/**
 * Create a posed light field from poses of another program, found by their content: COLMAP, AOS, nerfstudio, OpenSfM,
 * ODM's geo.txt, LLFF, mrcal. Pictures are copied byte for byte. Pictures of the same kind beside the posed ones become
 * views that are not placed.
 * @return 0, -EINVAL, -ENOENT, -EBADMSG, -EEXIST, -ENOSPC, -EIO, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_posed_import(const struct sst_posed_import_config *cfg);

/** The same from pictures without poses, in the natural order of their names. */
SST_MUST_CHECK int sst_posed_import_pictures(const struct sst_posed_import_config *cfg);

#endif
