/* pipeline/calibration/report/report_internal.h - the pieces of the report; code outside of them uses report.h. */
#ifndef SST_PIPELINE_CALIBRATION_REPORT_REPORT_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_REPORT_REPORT_INTERNAL_H

#include "pipeline/calibration/report/report.h"

#define SST_REPORT_COLS   8 /* regions of a picture, for residuals */
#define SST_REPORT_ROWS   6
#define SST_REPORT_BARS   16 /* at most */
#define SST_REPORT_WORST  3  /* pictures shown */
#define SST_REPORT_LISTED 24 /* outliers listed */
#define SST_REPORT_BINS   40 /* of the histogram, from -5 to 5 times the noise */

/* --- report_out.c: numbers and text ------------------------------------------------------------------------------- */

struct calib_number {
    char text[32];
};

/** So many significant digits, all digits before the point; "unknown" if not finite. */
struct calib_number calib_number(double value, int digits);
/** With as many digits as an error or uncertainty deserves: 3, below 0.1 two. */
struct calib_number calib_figure(double value);
/** 53,214 */
struct calib_number calib_count(int64_t count);
#define SST_NUM(value, digits) (calib_number(value, digits).text)
#define SST_FIGURE(value)      (calib_figure(value).text)
#define SST_COUNT(n)           (calib_count(n).text)
/** 0 counts as unknown: the rule of figures that cannot be 0. */
#define SST_NUM0(value, digits) (calib_number((value) > 0 ? (value) : (double)NAN, digits).text)

/** Text as valid UTF-8 without control characters: anything else becomes U+FFFD. @param out  [3 strlen(text) + 1] */
void calib_utf8(char *out, const char *text);
/** The same with < > & " ' escaped. */
void html_text(FILE *out, const char *text);
/** RFC 4648, no line breaks. */
void encode_base64(FILE *out, const uint8_t *data, size_t size);
/** "2024-05-06 07:08:09 UTC", "unknown" for 0 */
struct calib_number calib_date(int64_t wall_ns);

/* --- report_figures.c: what the page says beyond the solution's own numbers --------------------------------------- */

/** Residuals of the used corners in one region of one camera's picture, px. */
struct calib_region {
    int corners;
    double mean[2]; /* NAN without corners */
    double rms_px;  /* per point; likewise */
};

struct calib_camera_figures {
    char name[64];      /* the user's name of it, else "rr_cc"; any bytes */
    bool expected;      /* it is known, named or has detections: not merely a hole */
    int frames;         /* detections */
    int used, outliers; /* corners with a residual that count; all that do not */
    struct calib_region region[SST_REPORT_ROWS][SST_REPORT_COLS];
    int seen[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS]; /* corners, outliers included */
    double systematic_px;                                 /* RMS of the regions' mean residuals less what random ones
                                                             would leave; NAN unknown */
    double lens_px, carry_px[2];                          /* RMS over the solution's maps; NAN unknown */
    char lacking[160]; /* what its coverage lacks, as sst_coverage_missing() says it; "" nothing */
};

/** A detection or corner far off. */
struct calib_far {
    int detection, corner; /* indices; corner -1: the whole detection */
    double px;             /* residual; of a whole detection the median over its corners, outliers included */
};

enum calib_bar_state {
    SST_BAR_UNKNOWN = 0,
    SST_BAR_STRETCH = 1, /* met with room to spare */
    SST_BAR_MET = 2,
    SST_BAR_MISSED = 3,
    SST_BAR_FAILED = 4, /* beyond its limit: do not use */
};

/** A figure that is judged; smaller is better. */
struct calib_bar {
    const char *key, *what, *unit; /* what: its definition */
    double value;                  /* NAN unknown */
    double stretch, pass, limit;
    bool judged; /* false: said, but the verdict does not depend on it */
    enum calib_bar_state state;
    char where[160];    /* camera or pair that it is the worst of; "" none */
    const char *remedy; /* for one that is missed */
};

enum calib_verdict {
    SST_CALIB_GOOD = 0,
    SST_CALIB_USABLE = 1,
    SST_CALIB_BAD = 2,
};

struct calib_figures {
    int views, known, missing;           /* missing: expected but not known */
    int used_frames;                     /* that the solution knows */
    struct calib_camera_figures *camera; /* [views] */
    int *detection;                      /* [frames][views] index of the detection or -1 */
    int worst_camera, worst_frame;       /* -1 none */
    int worst_carry;                     /* camera; -1 none */
    int worst_count;
    struct calib_far worst[SST_REPORT_WORST];    /* one picture each of the worst frames */
    int listed, outliers;                        /* outliers: all with a finite residual */
    struct calib_far outlier[SST_REPORT_LISTED]; /* largest first */
    /* Histogram of (weight times residual) / noise, each axis a count. */
    int64_t bin[SST_REPORT_BINS], below, above, within[3]; /* within 1, 2, 3 times the noise */
    int64_t samples;
    /* Directions: Rayleigh's test in each region, all together. */
    int regions, regions_off; /* tested; of these with a probability below 0.001 */
    double direction_z;       /* standard normal if all directions are random; NAN unknown */
    double systematic_px;     /* over all cameras, as above */
    int systematic_camera;    /* the worst, -1 */
    /* Neighbours in rows and columns: residual of the one less that of the other, across the line between them. */
    int pairs, pair_worst[2];
    double pair_mean_px, pair_p95_px, pair_max_px; /* mean and maximum of the pairs' |mean|; p95 of the regions' */
    double lattice_mm[SST_MAX_VIEWS][2]; /* centre less its place in the best regular lattice, right and down; NAN */
    double centre_mm[SST_MAX_VIEWS][3];  /* right, down, towards the scene, from the reference, common axes; NAN */
    int bars;
    struct calib_bar bar[SST_REPORT_BARS];
    enum calib_verdict verdict;
};

/** @return 0 or -ENOMEM; logged. */
SST_MUST_CHECK int calib_figures_init(struct calib_figures *out, const struct sst_calib_report *report);
void calib_figures_fini(struct calib_figures *figures);

/* report_geometry.c: pairs, centres and lattice of the figures. @return 0, -ENOMEM */
SST_MUST_CHECK int calib_figures_pairs(struct calib_figures *f, const struct sst_calib_report *report);
void calib_figures_centres(struct calib_figures *f, const struct sst_calib_report *report);

/* report_bars.c: the bars and the verdict, from everything else. */
void calib_figures_judge(struct calib_figures *f, const struct sst_calib_report *report);
const char *calib_verdict_word(enum calib_verdict verdict);
const char *calib_bar_word(enum calib_bar_state state);
/** Its value in its digits: counts have no fraction. */
struct calib_number calib_bar_value(const struct calib_bar *bar);
/** Why the verdict is not better, and what to do: one sentence, plain text. @return false: bar i is no reason */
bool calib_bar_reason(const struct calib_bar *bar, char out[640]);

/* --- report_svg.c: pieces of drawings ----------------------------------------------------------------------------- */

#define SST_LEVELS 10 /* of the colour map; CSS classes c0 .. c9, dark to light */

/** Colours from lo to hi; values beyond take the last level. */
struct calib_scale {
    double lo, hi;
};

/** A scale from 0 that shows most of `n` values: up to a round number at or above their 95 % quantile and 1.7 times
 * their median. Values that are not finite do not count. */
struct calib_scale calib_scale_fit(const double *values, size_t n);
/** Level, or -1 for a value that is not finite. */
int calib_level(struct calib_scale scale, double value);
/** Next number of 1, 2, 5 times a power of ten at or below v > 0. */
double calib_round_down(double v);

/** cols x rows rectangles over width x height, one path per level; cells that are not finite stay empty. */
void svg_cells(FILE *out, const double *values, int cols, int rows, double width, double height,
               struct calib_scale scale);
/** A legend as HTML: boxes of the levels with their values, and what an empty cell means. */
void html_legend(FILE *out, struct calib_scale scale, const char *unit, const char *empty);
/** Open a section: heading and introduction (HTML). */
void html_section(FILE *out, const char *id, const char *title, const char *intro);

/* --- the sections; each writes HTML ------------------------------------------------------------------------------- */

/* Maps of cameras, in this order: */
enum calib_map {
    SST_MAP_SEEN = 0,
    SST_MAP_RMS = 1,
    SST_MAP_LENS = 2,
    SST_MAP_CARRY = 3,
    SST_MAP_LIGHT = 4,
    SST_MAPS = 5,
};

/* What the small multiples were drawn with, for the cards that show them again. */
struct calib_shown {
    struct calib_scale scale[SST_MAPS]; /* hi 0: there is no such map */
    double magnify, rule_px;            /* of residuals; length that the rule in the corner shows */
    double mean_magnify, mean_rule_px;  /* of regions' means; 0: there are none */
};

struct calib_page {
    FILE *out;
    struct calib_shown *shown; /* filled by calib_page_cameras() */
    const struct sst_calib_report *report;
    const struct calib_figures *figures;
};

extern const char calib_style[];                                      /* report_style.c */
void calib_page_summary(const struct calib_page *page);               /* report_summary.c */
void calib_page_array(const struct calib_page *page);                 /* report_array.c: plan of the centres */
void calib_page_rig(const struct calib_page *page);                   /* ... and the drives' residuals, if known */
SST_MUST_CHECK int calib_page_cameras(const struct calib_page *page); /* report_camera.c: small multiples */
void calib_page_cards(const struct calib_page *page);                 /* report_card.c: each camera large */
void calib_page_table(const struct calib_page *page);                 /* ... and as a line of a table */
SST_MUST_CHECK int calib_page_frames(const struct calib_page *page);  /* report_frames.c */
void calib_page_worst(const struct calib_page *page);                 /* report_worst.c: pictures, list of outliers */
void calib_page_links(const struct calib_page *page);                 /* report_links.c */
void calib_page_spread(const struct calib_page *page);                /* report_spread.c: histogram, directions */
void calib_page_light(const struct calib_page *page);                 /* report_light.c */

#endif
