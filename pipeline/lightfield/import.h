/* pipeline/lightfield/import.h - import and export of light fields in other tools' formats. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_IMPORT_H
#define SST_PIPELINE_LIGHTFIELD_IMPORT_H

#include "pipeline/lightfield/calibrated.h"

struct sst_import_config {
    const char *format;        /* "stanford", "hci", "folder" */
    const char *source, *out;  /* folders */
    int rows, cols;            /* required for folder; others: 0 uses the grid of the files, else it must match */
    int part[4]; /* first row, first column, rows and columns of the grid that are used; 0 rows: all */
    double spacing_px;         /* folder: focal length times spacing; stored as provenance only, 0: unset */
    const char *disparity_dir; /* rr_cc.pfm, px per spacing; NULL: none */
    const char *labels_dir;    /* rr_cc.png, label values; NULL: none */
    double range_min_px, range_max_px;             /* equal: from the source if it has one, else unknown */
    const double *infinity_px;                     /* disparity of infinity; NULL: from the source, else unknown */
    const struct sst_use_calibration *calibration; /* folder: the images are raw frames of this array; NULL: views */
    bool prefer_raw;                               /* folder: raw files rather than the pictures beside them */
    bool force;                                    /* replace an existing output */
    int threads;
};

/**
 * Create a light-field folder from another format; view files are copied byte for byte, raw files are developed. With a calibration, external
 * maps belong to the rectified views.
 * @return 0, -EINVAL, -ENOENT, -EBADMSG, -EEXIST, -ENOSPC, -EIO, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_import(const struct sst_import_config *cfg);

struct sst_export_config {
    const char *format;    /* "stanford", "hci", "colmap", "nerfstudio"; or "npz" */
    const char *dir, *out; /* light field; folder to create, of npz a file */
    double focal_px, spacing_mm; /* replace the light field's, which has no calibration; 0: its own */
    double focus_mm;             /* where its views converge, in place of the light field's, INFINITY: nowhere; */
    const double *infinity_px;   /* or the disparity of infinity; NULL */
    bool lossy;                  /* nerfstudio: accept lenses that its model misses by over 0.05 px */
    bool maps;                   /* npz: maps and cameras alone, without views */
    bool force;     /* replace an earlier export */
    int threads;
};

/**
 * Write a light field as one .npz (docs/integrate/python.md lists its arrays): equal light fields make equal bytes. One view at a
 * time is in memory.
 * @return as sst_import()
 */
SST_MUST_CHECK int sst_export_npz(const struct sst_export_config *cfg);

/** Write a light field in another format. @return as sst_import() */
SST_MUST_CHECK int sst_export(const struct sst_export_config *cfg);

#endif
