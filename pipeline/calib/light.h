/* pipeline/calib/light.h - how bright each camera is, in each colour and towards its corners, from pictures of a board.
 */
#ifndef SST_PIPELINE_CALIB_LIGHT_H
#define SST_PIPELINE_CALIB_LIGHT_H

#include "pipeline/calib/solve.h"

SST_EXTERN_C_BEGIN

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

/** Take the samples of one picture; clipped and uneven patches are left out. Thread: one per object. */
SST_MUST_CHECK int sst_light_collect(struct sst_light_samples *all, const struct sst_board *board,
                                     const struct sst_image *image, const struct sst_detection *detection);
void sst_light_samples_fini(struct sst_light_samples *all);

struct sst_light_report {
    int samples, cameras; /* used; cameras without enough samples keep gain 1 and no fall-off, each is told */
    double before, after; /* spread of a patch between cameras: RMS of the relative difference, linear light */
    double worst_falloff; /* light lost in a corner, 0..1, of the worst camera */
    double worst_gain;    /* largest |gain - 1| of any camera and colour */
};

/**
 * Fill in gain and falloff of calib's cameras: what makes each patch, lit however in its frame, equally bright in all
 * cameras. Robust least squares in log light; the mean gain of all cameras is 1 in each colour.
 *
 * @return 0, -ENODATA (no samples; calib untouched; logged), -ENOMEM
 */
SST_MUST_CHECK int sst_light_solve(struct sst_calib *calib, const struct sst_light_samples *all,
                                   struct sst_light_report *report);

SST_EXTERN_C_END

#endif
