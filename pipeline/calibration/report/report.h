/* pipeline/calibration/report/report.h - a calibration as one self-contained HTML page that a person can judge; its
 * summary as text and JSON. */
#ifndef SST_PIPELINE_CALIBRATION_REPORT_REPORT_H
#define SST_PIPELINE_CALIBRATION_REPORT_REPORT_H

#include <stdio.h>

#include "pipeline/calibration/photometric/light.h"
#include "pipeline/calibration/solve/solve.h"
#include "pipeline/lightfield/rectify/rectify.h"

struct sst_calib_report {
    const struct sst_detections *detections;
    const struct sst_solution *solution;
    const struct sst_light_report *light;  /* or NULL */
    const struct sst_rectified *rectified; /* or NULL: one camera */
    int overridden;                        /* refusals that were turned into warnings by force */
    /** A picture, to show the worst ones; 0 or a negative errno (then it is left out). May be NULL. */
    int (*picture)(void *arg, int view, int frame, struct sst_image *out);
    void *arg;
};

/**
 * Write the page: summary with verdicts, residual vectors per camera, coverage, worst frames, residuals per region of
 * the picture, link graph with the weakest link, uncertainty maps, light, lattice. No network access and no script is
 * needed to view it. It is well-formed XML too. How to read it: docs/calibration-report.md.
 *
 * Deterministic: the same report gives the same bytes.
 * @return 0, -ENOMEM, or what outputs return; logged.
 */
SST_MUST_CHECK int sst_calib_report_write(const char *path, const struct sst_calib_report *report);

/** The summary in about twenty lines for a terminal, with the page's verdict and definitions.
 *  @return 0, -ENOMEM; logged. Whether `out` took it is for the caller to see (ferror). */
SST_MUST_CHECK int sst_calib_report_text(FILE *out, const struct sst_calib_report *report);

/** All figures as one JSON object (docs/calibration-report.md), unknown ones null; to free with free().
 *  @return NULL: no memory; logged. */
SST_MUST_CHECK char *sst_calib_report_json(const struct sst_calib_report *report);

#endif
