/* pipeline/calibration/drift/drift.h - drift check: verifies from scene features, without a board, that the views are
 * still rectified. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_DRIFT_DRIFT_H
#define SST_PIPELINE_CALIBRATION_DRIFT_DRIFT_H

#include "pipeline/lightfield/lightfield.h"

struct sst_share;

#define SST_DRIFT_LEAST_MATCHES 10 /* of a pair, and distinct features */

enum sst_drift_verdict {
    SST_DRIFT_OK = 0,
    SST_DRIFT_DRIFTED = 1,  /* some cameras have moved; the others are fine */
    SST_DRIFT_UNUSABLE = 2, /* most pairs are off, so far that matching fails, or views are swapped */
    SST_DRIFT_UNKNOWN = 3,  /* too little texture */
};

enum sst_drift_pair_state {
    SST_DRIFT_PAIR_MEASURED = 0,
    SST_DRIFT_PAIR_BLANK = 1, /* fewer than 10 distinct features: no figures */
    SST_DRIFT_PAIR_LOST = 2,  /* enough features, but they are not found in the other view: no figures */
};

/** Two views side by side or one above the other. Epipolar error: displacement across the line between their centres,
 *  measured minus predicted, px; positive: b's picture is too low (side by side) or too far right (one above the
 *  other). */
struct sst_drift_pair {
    int a, b;
    enum sst_drift_pair_state state;
    int features;                   /* distinct ones of a that lie in b as well */
    int matches;                    /* used */
    double mean_px, rms_px, p95_px; /* mean is signed, p95 of the magnitude; 0 unless measured */
};

/**
 * Displacement of one camera's picture relative to the array; subtract it to realign. Robust least squares over all
 * pairs. Gauge: medians are 0 for unobservable components, the common shift (and roll and scale), and a shift of
 * every camera in proportion to its offset, which equals another disparity of the whole scene.
 */
struct sst_drift_camera {
    bool known;                    /* false: no view, or too few matches tie it to the others (sigma above ok_px) */
    double shift_x_px, shift_y_px; /* right and down positive, at the picture's centre; NAN: no pair sees it */
    double sigma_px;               /* of either, the larger */
    double roll_deg;               /* clockwise, about the picture's centre; NAN: no pair sees it */
    double scale;                  /* size of the picture relative to the array's, minus 1; NAN: no pair sees it */
    double off_px;                 /* all of these as one displacement: RMS over the picture */
    double off_sigma_px;
    double roll_sigma_deg, scale_sigma;
    double gain[3];    /* of linear red, green, blue, from the matches' light; geometric mean of all cameras 1 */
    double gain_sigma; /* relative, of the worst colour; NAN: no matches that are bright enough */
    double falloff, falloff_sigma; /* light at r from the picture's centre is exp(falloff r2) of the centre's, r in half
                                      diagonals; NAN sigma: not measured */
    double even_gain[3];           /* gains at the centres of pictures that fall off like this */
    double exponent, exponent_sigma; /* light is (gain times the array's mean camera's) to this power; mean 1; NAN
                                        sigma: not measured */
    double bent_gain[3];             /* gains of pictures with these exponents */
    double residual_px; /* RMS of the epipolar error of its pairs */
    bool drifted;       /* off_px is beyond ok_px and 4 sigma, or lost */
    bool lost;          /* enough features, but nothing matches in any neighbour */
    bool blank;         /* hardly any contrast where the others have some: black, covered, over-exposed */
};

/* Displaced views of foliage have up to 0.35, fences that are matched a period off mostly above 1. */
#define SST_DRIFT_CONTRADICTION_PX 0.6

struct sst_drift {
    enum sst_drift_verdict verdict;
    int rows, cols;
    double ok_px, unusable_px;         /* thresholds of the verdict */
    int pairs, measured, matches;      /* pairs checked, of these measured; matches in them */
    struct sst_drift_pair *pair;       /* [pairs] */
    struct sst_drift_camera *camera;   /* [rows * cols] */
    double mean_px, p95_px, max_px;    /* of |epipolar error| pair by pair: mean of means' magnitude, p95 over all
                                          matches, largest pair mean; NAN: nothing was measured */
    double axes_px;                    /* median of |disparity along the row - disparity along the column| of features
                                          seen in both, px per spacing; NAN: none */
    double contradiction_px; /* matches of one pair about the displacements: robust sigma, of the worst tenth
                                of the pairs; fences and rows of windows are matched a period off; 0 without matches.
                                Above SST_DRIFT_CONTRADICTION_PX no displacement is to be believed. */
    double rough_px; /* robust sigma of each match about the next one: residuals of lenses are smooth */
    double light_scale[3];             /* residuals of the light's logs, robust sigma: [1] with fall-offs, [2] with exponents;
                                          0: not measured */
    int far_matches;                   /* between opposite corners of the grid, matched directly */
    double far_p95_px;                 /* p95 of their |epipolar error|; NAN: fewer than 10 */
    double range_min_px, range_max_px; /* disparities searched; equal: nothing was found to search around */
    int swapped_a, swapped_b;          /* exchanging these two views explains the errors; -1: none */
    bool narrow;                       /* a first look, where matches are if no view is off by more than a pixel */
    bool wrong_order;                  /* another order of the rows and columns explains them */
    char sentence[512];                /* the verdict as one sentence with cameras and pixels */
};

struct sst_drift_config {
    double unusable_px; /* more than half of the pairs beyond this; 0: 1 */
    bool loose;         /* worse matches count too, by their weight: for corrections, not for the verdict */
    int threads;        /* 0: all processors */
    /* Whether a first look is enough, at a quarter of the features, without corner pairs and orders of the views: the
     * first one is at reduced size, the second one, at full size, looks only where matches are if no view is off by more
     * than a pixel. Else the whole check follows, with the result that it has without. NULL: no first looks */
    bool (*enough)(void *arg, const struct sst_drift *first);
    void *arg;
    struct sst_share *share; /* with other processes (pipeline/lightfield/share.h), by views and pairs; or NULL */
};

/** Whether a light field has two loaded views and they are large enough to be checked. */
bool sst_drift_possible(const struct sst_lightfield *lf);

/**
 * Check a light field with its images loaded (rectified, or claimed to be). Neither disparity maps nor the range are
 * needed. Deterministic for any number of threads. On one core 36 views of 640x480
 * take 0.4 to 0.7 s, foliage 1.5 to 2.5 s, up to 2.5 times as long where views seem swapped.
 * @return 0, -EINVAL (cfg), -EBADMSG (fewer than 2 views, or pictures too small), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_drift_check(struct sst_drift *out, const struct sst_lightfield *lf,
                                   const struct sst_drift_config *cfg);
void sst_drift_fini(struct sst_drift *check);

/** "OK", "DRIFTED" ... */
const char *sst_drift_verdict_name(enum sst_drift_verdict verdict);

/**
 * The grid of cameras: colour by off_px, arrows for shifts (30 times their size), bars for pairs.
 * @param out  initialised here
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_drift_picture(struct sst_image *out, const struct sst_drift *check);

#endif
