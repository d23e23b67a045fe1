/* pipeline/calibration/photometric/light.h - how bright each camera is, in each colour and towards its corners, from
 * pictures of a board.
 */
#ifndef SST_PIPELINE_CALIBRATION_PHOTOMETRIC_LIGHT_H
#define SST_PIPELINE_CALIBRATION_PHOTOMETRIC_LIGHT_H

#include "pipeline/calibration/solve/solve.h"

/** Mean of a white patch of the board in one picture. */
struct sst_light_sample {
    int view, frame, patch; /* patch: number of the white place on the board: the same on all cameras */
    float x, y;             /* px */
    float linear[3];        /* linear light 0..1 (sRGB undone) */
};

struct sst_light_samples {
    int count, capacity;
    struct sst_light_sample *sample;
};

/**
 * Take the samples of one picture: white squares of a chessboard, the white rims around the markers of a ChArUco board,
 * the gaps between the tags of an AprilGrid, each between corners that were all found. Clipped, uneven and dark patches
 * are left out, and so are rims of less than about 5 px (squares of 33 px where a marker takes 0.7 of them).
 *
 * @param image  the picture as the camera made it, in which the detection was found
 * @return 0, also where nothing is of use, -ENOMEM (nothing is added). Thread: one per object.
 */
SST_MUST_CHECK int sst_light_collect(struct sst_light_samples *all, const struct sst_board *board,
                                     const struct sst_image *image, const struct sst_detection *detection);
void sst_light_samples_fini(struct sst_light_samples *all);

struct sst_light_report {
    int samples, cameras; /* used; cameras without enough samples keep gain 1 and no fall-off, each is told */
    double before, after; /* spread of a patch between cameras: RMS of the relative difference from the patch's mean,
                             linear light, all samples, also those that the robust solution gave no weight */
    double worst_falloff; /* light lost in a corner, 0..1, of the worst camera */
    double worst_gain;    /* largest |gain - 1| of any camera and colour */
};

/**
 * Fill in gain and falloff of calib's cameras: what makes each patch, lit however in its frame, equally bright in all
 * cameras. Robust least squares in log light, the light of each patch in each frame eliminated:
 * log light(view, patch, frame, colour) = log lit(patch, frame, colour) + log gain(view, colour) + log falloff(view).
 * The geometric mean of all gains is 1 in each colour. The fall-off is a common polynomial, of as high a
 * degree, at most 3, as rises or falls one way and stays above 1/8 up to the corners, with a first coefficient of each
 * camera's own.
 *
 * A rig's camera gets one fall-off and gain 1. Cameras that share no patch with the others are made even among
 * themselves, and told. Order of the samples does not matter: the same samples give the same numbers.
 *
 * @param calib  principal points and sizes are read; cameras that are not known are skipped
 * @return 0, -ENODATA (no patch seen by two cameras in one frame; calib untouched; a warning is logged), -ENOMEM
 * (logged)
 */
SST_MUST_CHECK int sst_light_solve(struct sst_calib *calib, const struct sst_light_samples *all,
                                   struct sst_light_report *report);

#endif
