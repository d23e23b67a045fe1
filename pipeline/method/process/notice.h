/* pipeline/method/process/notice.h - what is wrong with the pictures of a light field although they can be views of one
 * scene. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_PROCESS_NOTICE_H
#define SST_PIPELINE_METHOD_PROCESS_NOTICE_H

#include "pipeline/lightfield/lightfield.h"

struct sst_share;

/* Thresholds: docs/design/design.md, 5.9. Where clear pictures lose more than 1 dB (noise, blur), more than 3 dB
 * (JPEG). */
#define SST_NOTICE_NOISE_LEVELS 8.0
#define SST_NOTICE_EDGE_PX      0.75
#define SST_NOTICE_JPEG_QUALITY 70.0
#define SST_NOTICE_MISSING      0.1 /* of the grid */
/* A soft view: its edges are wider than the median view's by this factor, as after a blur of this sigma. */
#define SST_NOTICE_SOFTER    1.35
#define SST_NOTICE_SOFTER_PX 0.3

#define SST_NOTICE_BLANK   0.1  /* of the median view's contrast: black, covered, over-exposed */
#define SST_NOTICE_SKEW_US 5000 /* who walks moves by 7 mm */

#define SST_NOTICES 8 /* at most */

/** What one view's picture shows of itself. */
struct sst_notice_view {
    bool present;    /* false: the rest does not count */
    double noise;    /* levels RMS (sst_image_noise()) */
    double edge;     /* px (sst_image_edge_px()); NAN: not measured */
    double quality;  /* of JPEG; NAN: no traces */
    double contrast; /* levels RMS (sst_image_contrast()) */
};

struct sst_notices {
    double noise_levels; /* RMS of the sensor's noise, of 0..255, median of the views (sst_image_noise()) */
    double edge_px;      /* median of the views (sst_image_edge_px()); NAN: not measured */
    int soft;            /* views that are less sharp than the others */
    bool soft_view[SST_MAX_VIEWS];
    double soft_px;      /* blur of the softest of them against the median view; 0: none */
    int softest;         /* that view; -1 */
    double jpeg_quality; /* least of the views; NAN: no traces */
    int jpeg_views;      /* with traces, or JPEG files */
    int missing;         /* views of the grid */
    int blank;           /* views with next to no contrast; only of sst_notice_sum(): else judge.h names them */
    int first_blank;     /* one of these; -1 */
    double skew_us;      /* between the exposures of the views; 0: unknown or none */
    int count;
    struct {
        const char *what; /* "noise", "blur", "soft-views", "jpeg", "missing-views", "blank-views", "time-offsets" */
        char text[320];   /* one sentence: what, how much, remedy */
    } notice[SST_NOTICES];
};

/** Measure one picture. @param valid  0: no picture there; may be empty. Thread: any. */
void sst_notice_view(struct sst_notice_view *out, const struct sst_image *image, const struct sst_map_u8 *valid);

/** What the views are like together. @param view  [rows * cols] */
void sst_notice_sum(struct sst_notices *out, const struct sst_notice_view *view, int rows, int cols);

/** Measure loaded pictures, before they are corrected. The same for any number of threads.
 *  @param share  with other processes, by views; or NULL @return 0, -ENOMEM (not logged) */
SST_MUST_CHECK int sst_notice_measure(struct sst_notices *out, const struct sst_lightfield *lf, struct sst_share *share,
                                      int threads);

/** Qualities of the views' JPEG files, which count instead of traces in the pixels. @param quality  [rows * cols]; NAN:
 * no JPEG file */
void sst_notice_jpeg_files(struct sst_notices *out, const double *quality, int views);

/** Fill the notices from the figures. */
void sst_notice_describe(struct sst_notices *out, int rows, int cols);

/** A skew of exposures as a sentence. @param text  out @return false: too small to be noticed */
bool sst_notice_skew(char text[320], double skew_us);

#endif
