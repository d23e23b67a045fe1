/* pipeline/lightfield/folder.h - data of a light field's folder: file names, hashes, provenance; of light fields that
 * never were in one, what would be read from the files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_FOLDER_H
#define SST_PIPELINE_LIGHTFIELD_FOLDER_H

#include "pipeline/lightfield/lightfield.h"

struct sst_lightfield_file {
    char name[256];  /* inside views/, untouched camera bytes */
    char sha256[65]; /* of the view's file, lower-case hex */
    double quality;  /* without_folder: of its JPEG; NAN: it is none */
};

struct sst_lightfield_files {
    bool external_labels, external_disparity; /* supplied with the images: processing does not replace them */
    char calibration_sha256[65];              /* of the folder's calibration.yaml; empty: not written yet */
    char source[1024];                        /* provenance: format and origin */
    char history[1024];                       /* origin of the maps, one line */
    bool judged, plausible;                   /* whether processing judged the views, and how */
    char implausible[512];                    /* why not; empty: plausible */
    bool without_folder; /* the views have names, but no files: `quality` and `levels` are known */
    int levels[2];       /* without_folder: sst_lightfield_levels() */
    struct sst_lightfield_file view[];        /* [rows * cols] */
};

/** sst_lightfield_init() with lf->files allocated: for light fields that are loaded or written. @return as that */
SST_MUST_CHECK int sst_lightfield_init_files(struct sst_lightfield *lf, int rows, int cols);

#endif
