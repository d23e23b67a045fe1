/* pipeline/calibration/report/report.h - acceptance report of a calibration: one self-contained HTML page, text, JSON.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_REPORT_REPORT_H
#define SST_PIPELINE_CALIBRATION_REPORT_REPORT_H

#include <stdio.h>

#include "pipeline/calibration/photometric/photometric.h"
#include "pipeline/calibration/solve/solve.h"
#include "pipeline/lightfield/rectify/rectify.h"

struct sst_calibration_report {
    const struct sst_detections *detections;
    const struct sst_solution *solution;
    const struct sst_photometric_report *light; /* or NULL */
    const struct sst_rectified *rectified;      /* or NULL: one camera */
    int overridden;                             /* number of refusals that force turned into warnings */
    /** A picture, to show the worst ones; returns 0 or a negative errno (then it is left out). May be NULL. */
    int (*picture)(void *arg, int view, int frame, struct sst_image *out);
    void *arg;
};

/**
 * Write the page: one HTML file that draws itself from the JSON in it, offline. It shows the verdict, residual vectors
 * and maps of each camera, frames, the worst pictures, links, uncertainties, light, lattice. How to read it:
 * docs/use/calibration-report.md.
 *
 * Deterministic: the same report gives the same bytes.
 * @return 0, -ENOMEM, or an output error; logged.
 */
SST_MUST_CHECK int sst_calibration_report_write(const char *path, const struct sst_calibration_report *report);

/** The summary in about twenty lines for a terminal, with the page's verdict and definitions.
 *  @return 0, -ENOMEM; logged. The caller checks `out` for errors (ferror). */
SST_MUST_CHECK int sst_calibration_report_text(FILE *out, const struct sst_calibration_report *report);

/** All figures as one JSON object (docs/use/calibration-report.md), unknown ones null; to free with free().
 *  @return NULL: no memory; logged. */
SST_MUST_CHECK char *sst_calibration_report_json(const struct sst_calibration_report *report);

#endif
