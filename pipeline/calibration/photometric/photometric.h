/* pipeline/calibration/photometric/photometric.h - photometric calibration: gain and vignetting of each camera, from
 * pictures of a board. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_PHOTOMETRIC_PHOTOMETRIC_H
#define SST_PIPELINE_CALIBRATION_PHOTOMETRIC_PHOTOMETRIC_H

#include "pipeline/calibration/solve/solve.h"

/** Mean of one white patch of the board in one picture. */
struct sst_photometric_sample {
    int view, frame, patch; /* patch: number of the white patch on the board, the same for all cameras */
    float x, y;             /* px */
    float linear[3];        /* linear light 0..1, sRGB decoded */
};

struct sst_photometric_samples {
    int count, capacity;
    struct sst_photometric_sample *sample;
};

/**
 * Collect the samples of one picture: white squares of a chessboard, the white rims around the markers of a ChArUco
 * board, the gaps between the tags of an AprilGrid, each between corners that were all found. Clipped, uneven and dark
 * patches are left out, and so are rims of less than about 5 px (squares of 33 px with markers of 0.7 squares).
 *
 * @param image  the picture as the camera made it, in which the detection was found
 * @return 0, also without any usable patch, -ENOMEM (nothing is added). Thread: one per object.
 */
SST_MUST_CHECK int sst_photometric_collect(struct sst_photometric_samples *all, const struct sst_board *board,
                                           const struct sst_image *image, const struct sst_detection *detection);
void sst_photometric_samples_fini(struct sst_photometric_samples *all);

struct sst_photometric_report {
    int samples, cameras; /* used; cameras without enough samples keep gain 1 and no fall-off, each is logged */
    double before, after; /* spread of a patch between cameras: RMS of the relative difference from the patch's mean,
                             linear light, all samples, also without weight in the robust solution */
    double worst_falloff; /* light lost in a corner, 0..1, of the worst camera */
    double worst_gain;    /* largest |gain - 1| of any camera and colour */
};

/**
 * Solve gain and falloff of calib's cameras, such that each patch is equally bright in all cameras whatever its
 * illumination. Robust least squares in log light, the light of each patch in each frame eliminated:
 * log light(view, patch, frame, colour) = log lit(patch, frame, colour) + log gain(view, colour) + log falloff(view).
 * The geometric mean of all gains is 1 in each colour. The fall-off is a polynomial that all
 * cameras share, except for its first coefficient; its degree is the highest, at most 3, for which it is monotonic and
 * stays above 1/8 up to the corners.
 *
 * A rig's camera gets one fall-off and gain 1. Cameras that share no patch with the others are equalised among
 * themselves, and logged. The order of the samples does not matter.
 *
 * @param calib  principal points and sizes are read; cameras that are not known are skipped
 * @return 0, -ENODATA (no patch seen by two cameras in one frame; calib untouched; a warning is logged), -ENOMEM
 * (logged)
 */
SST_MUST_CHECK int sst_photometric_solve(struct sst_calib *calib, const struct sst_photometric_samples *all,
                                         struct sst_photometric_report *report);

#endif
