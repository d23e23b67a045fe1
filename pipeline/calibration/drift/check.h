/* pipeline/calibration/drift/check.h - is a calibration still true? From what the cameras see, without a board. */
#ifndef SST_PIPELINE_CALIBRATION_DRIFT_CHECK_H
#define SST_PIPELINE_CALIBRATION_DRIFT_CHECK_H

#include "pipeline/lightfield/lightfield.h"

enum sst_check_verdict {
    SST_CHECK_OK = 0,
    SST_CHECK_DRIFTED = 1,  /* some cameras have moved; the rest is fine */
    SST_CHECK_UNUSABLE = 2, /* most pairs are off, so far that matching fails, or views are in each other's places */
    SST_CHECK_UNKNOWN = 3,  /* too little texture to say */
};

enum sst_check_pair_state {
    SST_CHECK_PAIR_MEASURED = 0,
    SST_CHECK_PAIR_BLANK = 1, /* fewer distinct features than min_matches: no figures */
    SST_CHECK_PAIR_LOST = 2,  /* features enough, but what they show is not in the other view: no figures */
};

/** Two views side by side or one above the other. Cross disparity: across the line between their centres, measured
 *  minus predicted, px; positive: b's picture sits too low (side by side) or too far right (one above the other). */
struct sst_check_pair {
    int a, b;
    enum sst_check_pair_state state;
    int features;                   /* distinct ones of a that lie in b as well */
    int matches;                    /* used */
    double mean_px, rms_px, p95_px; /* mean is signed, p95 of the magnitude; 0 unless measured */
};

/**
 * Where a camera's picture sits relative to the array, as it is: moving it by the negative brings it back in line.
 * Robust least squares over all pairs; what cannot be told from pairs is chosen so that medians are 0: the common shift
 * (and roll and scale), and a shift of every camera in proportion to its offset, which is the same as another
 * disparity of the whole scene.
 */
struct sst_check_camera {
    bool known;                    /* false: no view, or too few matches tie it to the others (sigma above ok_px) */
    double shift_x_px, shift_y_px; /* right and down positive, at the picture's centre; NAN: no pair sees it */
    double sigma_px;               /* of either, the larger */
    double roll_deg;               /* clockwise, about the picture's centre */
    double scale;                  /* size of the picture over the array's, less 1 */
    double off_px;                 /* all of these as one displacement: RMS over the picture */
    double off_sigma_px;
    double residual_px; /* RMS of the cross disparity of its pairs */
    bool drifted;       /* off_px is beyond ok_px and 4 sigma, or lost */
    bool lost;          /* enough features, but nothing matches in any neighbour */
};

struct sst_check {
    enum sst_check_verdict verdict;
    int rows, cols;
    double ok_px, unusable_px;         /* that the verdict went by */
    int pairs, measured, matches;      /* pairs looked at, of these measured; matches in them */
    struct sst_check_pair *pair;       /* [pairs] */
    struct sst_check_camera *camera;   /* [rows * cols] */
    double mean_px, p95_px, max_px;    /* of |cross disparity| pair by pair: mean of means' magnitude, p95 over all
                                          matches, largest pair mean; NAN: nothing was measured */
    double axes_px;                    /* median of |disparity along the row - disparity along the column| of features
                                          seen in both, px per spacing; NAN: none */
    int far_matches;                   /* between opposite corners of the grid, matched directly */
    double far_p95_px;                 /* p95 of their |cross disparity|; NAN: fewer than min_matches */
    double range_min_px, range_max_px; /* disparities searched; equal: nothing was found to search around */
    int swapped_a, swapped_b;          /* exchanging these two views explains what is off; -1: no */
    char sentence[512];                /* the verdict for a person, naming cameras and pixels */
};

struct sst_check_config {
    double ok_px;       /* a camera off by less than this is fine; 0: 0.25 */
    double unusable_px; /* more than half of the pairs beyond this; 0: 1 */
    int min_matches;    /* of a pair; 0: 10 */
    int threads;        /* 0: all processors */
};

/**
 * Check a light field whose images are loaded (rectified, or claimed to be). Neither disparity maps nor the range are
 * needed. Deterministic for any number of threads. On one core 36 views of 640x480
 * take 0.4 to 0.7 s, foliage 1.5 to 2.5 s, up to 2.5 times as long where views seem exchanged.
 * @return 0, -EINVAL (cfg), -EBADMSG (fewer than 2 views, or pictures too small), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_check_lightfield(struct sst_check *out, const struct sst_lightfield *lf,
                                        const struct sst_check_config *cfg);
void sst_check_fini(struct sst_check *check);

/** "OK", "DRIFTED" ... */
const char *sst_check_verdict_name(enum sst_check_verdict verdict);

/**
 * The grid of cameras: colour by off_px, arrows for shifts (30 times their size), bars for pairs.
 * @param out  initialised here
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_check_picture(struct sst_image *out, const struct sst_check *check);

#endif
