/* pipeline/lightfield/import.h - light fields from and to other tools' folders. */
#ifndef SST_PIPELINE_LIGHTFIELD_IMPORT_H
#define SST_PIPELINE_LIGHTFIELD_IMPORT_H

#include "pipeline/lightfield/calibrated.h"

struct sst_import_config {
    const char *format;        /* "stanford", "hci", "folder" */
    const char *source, *out;  /* folders */
    int rows, cols;            /* folder: required; the others: 0 takes what the files say, else it must agree */
    double spacing_px;         /* folder: f * B in px * mm is unknown; kept as provenance, 0: not given */
    const char *disparity_dir; /* rr_cc.pfm, px per spacing; NULL: none */
    const char *labels_dir;    /* rr_cc.png, label values; NULL: none */
    double range_min_px, range_max_px;             /* equal: from the source where it says, else unknown */
    const struct sst_use_calibration *calibration; /* folder: the images are raw frames of this array; NULL: views */
    bool force;                                    /* replace an existing output */
    int threads;
};

/**
 * Make a light-field folder from another format; view files are copied byte for byte. With a calibration given maps are
 * of the rectified views.
 * @return 0, -EINVAL, -ENOENT, -EBADMSG, -EEXIST, -ENOSPC, -EIO, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_import(const struct sst_import_config *cfg);

struct sst_export_config {
    const char *format;          /* "stanford", "hci", "colmap", "nerfstudio" */
    const char *dir, *out;       /* light field; folder to make */
    double focal_px, spacing_mm; /* colmap, nerfstudio: of a light field that knows neither them nor a calibration; 0 */
    bool lossy;                  /* nerfstudio: lenses that its model follows no better than 0.05 px */
    bool force;                  /* replace an earlier export */
    int threads;
};

/** Write a light field in another format. The same errors. */
SST_MUST_CHECK int sst_export(const struct sst_export_config *cfg);

#endif
