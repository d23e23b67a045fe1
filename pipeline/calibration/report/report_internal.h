/* pipeline/calibration/report/report_internal.h - figures, acceptance criteria and JSON of the report; callers use
 * report.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_REPORT_REPORT_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_REPORT_REPORT_INTERNAL_H

#include <jansson.h>

#include "pipeline/calibration/report/report.h"

#define REPORT_COLS     8 /* regions of a picture, for residuals */
#define REPORT_ROWS     6
#define REPORT_CRITERIA 16 /* at most */
#define REPORT_WORST    3  /* pictures shown */
#define REPORT_LISTED   24 /* outliers listed */
#define REPORT_BINS     40 /* of the histogram, from -5 to 5 times the noise */

/* --- report_numbers.c: numbers and text --------------------------------------------------------------------------- */

struct report_number {
    char text[32];
};

/** Rounded to significant digits, all digits before the point; "unknown" if not finite. */
struct report_number report_number(double value, int digits);
/** With as many digits as an error or uncertainty deserves: 3, below 0.1 two. */
struct report_number report_figure(double value);
/** 53,214 */
struct report_number report_count(int64_t count);
/** "2024-05-06 07:08:09 UTC", "unknown" for 0 */
struct report_number report_date(int64_t wall_ns);
#define NUM(value, digits) (report_number(value, digits).text)
#define FIGURE(value)      (report_figure(value).text)
#define COUNT(n)           (report_count(n).text)
/** 0 counts as unknown: for figures that cannot be 0. */
#define NUM0(value, digits) (report_number((value) > 0 ? (value) : (double)NAN, digits).text)

/** Text as valid UTF-8 without control characters: anything else becomes U+FFFD. @param out  [3 strlen(text) + 1] */
void report_utf8(char *out, const char *text);

/* --- report_figures.c: figures of the report beyond the solution's own numbers ------------------------------------ */

/** Residuals of the used corners in one region of one camera's picture, px. */
struct report_region {
    int corners;
    double mean[2]; /* NAN without corners */
    double rms_px;  /* per point; NAN without corners */
};

struct report_camera {
    char name[64];      /* the user's name of it, else "rr_cc"; any bytes */
    char title[96];     /* for sentences: "row,column (name)", or "rr_cc" alone */
    bool expected;      /* it is known, named or has detections: not merely a hole */
    int frames;         /* detections */
    int used, outliers; /* corners with a residual that count; all that do not */
    struct report_region region[REPORT_ROWS][REPORT_COLS];
    int seen[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS]; /* corners, outliers included */
    double systematic_px;                                 /* RMS of the regions' mean residuals less the share of
                                                             random ones; NAN unknown */
    double lens_px, transfer_px[2];                       /* RMS over the solution's maps; NAN unknown */
    char lacking[160]; /* missing part of its coverage, from sst_coverage_missing(); "" none */
};

/** A detection or corner far off. */
struct report_outlier {
    int detection, corner; /* indices; corner -1: the whole detection */
    double px;             /* residual; of a whole detection the median over its corners, outliers included */
};

enum criterion_state {
    CRITERION_UNKNOWN = 0,
    CRITERION_STRETCH = 1, /* met with room to spare */
    CRITERION_MET = 2,
    CRITERION_MISSED = 3,
    CRITERION_FAILED = 4, /* beyond its limit: do not use */
};

/** A figure and its thresholds; smaller is better. */
struct report_criterion {
    const char *key, *what, *unit; /* what: its definition */
    double stretch, pass, limit;
    bool judged;        /* false: for information, the verdict does not depend on it */
    const char *remedy; /* for one that is missed */
    double value;       /* NAN unknown */
    enum criterion_state state;
    char where[224]; /* camera or pair that it is the worst of; "" none */
};

enum report_verdict {
    VERDICT_GOOD = 0,
    VERDICT_USABLE = 1,
    VERDICT_BAD = 2,
};

struct report_figures {
    int views, known, missing;     /* missing: expected but not known */
    int used_frames;               /* frames with a known board pose */
    struct report_camera *camera;  /* [views] */
    int *detection;                /* [frames][views] index of the detection or -1 */
    int worst_camera, worst_frame; /* -1 none */
    int worst_transfer;            /* camera; -1 none */
    int worst_count;
    struct report_outlier worst[REPORT_WORST];    /* one picture each of the worst frames */
    int listed, outliers;                         /* outliers: all with a finite residual */
    struct report_outlier outlier[REPORT_LISTED]; /* largest first */
    /* Histogram of (weight times residual) / noise, each axis a count. */
    int64_t bin[REPORT_BINS], below, above, within[3]; /* within 1, 2, 3 times the noise */
    int64_t samples;
    /* Directions: Rayleigh's test in each region, all together. */
    int regions, regions_off; /* tested; of these with a probability below 0.001 */
    double direction_z;       /* standard normal if all directions are random; NAN unknown */
    double systematic_px;     /* over all cameras, as of one camera */
    int systematic_camera;    /* the worst, -1 */
    /* Neighbours in rows and columns: difference of their residuals across the line between them (epipolar error). */
    int pairs, pair_worst[2];
    double pair_mean_px, pair_p95_px, pair_max_px; /* mean and maximum of the pairs' |mean|; p95 of the regions' */
    double lattice_mm[SST_MAX_VIEWS][2]; /* centre less its place in the best regular lattice, right and down; NAN */
    double centre_mm[SST_MAX_VIEWS][3];  /* right, down, towards the scene, from the reference, common axes; NAN */
    int criteria;
    struct report_criterion criterion[REPORT_CRITERIA];
    enum report_verdict verdict;
};

/** @return 0 or -ENOMEM; logged. */
SST_MUST_CHECK int report_figures_init(struct report_figures *out, const struct sst_calibration_report *report);
void report_figures_fini(struct report_figures *figures);

/* report_geometry.c: pairs, centres and lattice of the figures. @return 0, -ENOMEM */
SST_MUST_CHECK int report_figures_pairs(struct report_figures *f, const struct sst_calibration_report *report);
void report_figures_centres(struct report_figures *f, const struct sst_calibration_report *report);
/** Rotations against the common axes: the mean angle, the largest and its camera (-1: none known). */
void report_figures_angles(const struct report_figures *f, const struct sst_calibration_report *report,
                           double *mean_deg, double *most_deg, int *most);

/* report_criteria.c: acceptance criteria and verdict, from everything else. */
void report_figures_judge(struct report_figures *f, const struct sst_calibration_report *report);
const char *report_verdict_word(enum report_verdict verdict);
const char *report_criterion_word(enum criterion_state state);
/** Why the verdict is not better, and what to do: one sentence, plain text. @return false: this one is no reason */
bool report_criterion_reason(const struct report_criterion *c, char out[640]);

/* --- JSON: docs/use/calibration-report.md
 * ----------------------------------------------------------------------------- */

/** null where not finite */
json_t *report_json_number(double value);

/** report_json.c: all figures. @return NULL: no memory */
json_t *report_figures_json(const struct sst_calibration_report *report, const struct report_figures *f);

/** report_drawing.c: maps, residual vectors and pictures, which the page draws. @return NULL: no memory */
json_t *report_drawing_json(const struct sst_calibration_report *report, const struct report_figures *f);

#endif
