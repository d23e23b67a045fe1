/* pipeline/calib/check.h - is a calibration still true? From what the cameras see, without a board. */
#ifndef SST_PIPELINE_CALIB_CHECK_H
#define SST_PIPELINE_CALIB_CHECK_H

#include "pipeline/lightfield/lightfield.h"

SST_EXTERN_C_BEGIN

enum sst_check_verdict {
    SST_CHECK_OK = 0,
    SST_CHECK_DRIFTED = 1,  /* some cameras have moved; the rest is fine */
    SST_CHECK_UNUSABLE = 2, /* most pairs are off, or so far that matching fails */
    SST_CHECK_UNKNOWN = 3,  /* too little texture to say */
};

/** Two views side by side or one above the other. Cross disparity: across the line between their centres, measured
 *  minus predicted, px. */
struct sst_check_pair {
    int a, b;
    int matches;                    /* used */
    double mean_px, rms_px, p95_px; /* mean is signed, p95 of the magnitude */
};

/** What would bring a camera back in line with its neighbours (least squares over all pairs, robust). */
struct sst_check_camera {
    bool known;
    double shift_x_px, shift_y_px, sigma_px; /* of its picture; sigma of either */
    double roll_deg;
    double residual_px; /* RMS of the cross disparity of its pairs */
    bool drifted;
};

struct sst_check {
    enum sst_check_verdict verdict;
    int pairs, matches;
    struct sst_check_pair *pair;     /* [pairs] */
    struct sst_check_camera *camera; /* [rows * cols] */
    double mean_px, p95_px, max_px;  /* of |cross disparity| pair by pair: mean of means' magnitude, p95 over all
                                        matches, largest pair mean */
    char sentence[512];              /* the verdict for a person, naming cameras and pixels */
};

struct sst_check_config {
    double ok_px;       /* a camera off by less than this is fine; 0: 0.25 */
    double unusable_px; /* more than half of the pairs beyond this; 0: 1 */
    int min_matches;    /* of a pair; 0: 30 */
    int threads;
};

/**
 * Check a light field whose images are loaded (rectified, or claimed to be). Deterministic for any number of threads.
 * @return 0, -EBADMSG (fewer than 2 views), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_check_lightfield(struct sst_check *out, const struct sst_lightfield *lf,
                                        const struct sst_check_config *cfg);
void sst_check_fini(struct sst_check *check);

SST_EXTERN_C_END

#endif
