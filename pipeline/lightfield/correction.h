/* pipeline/lightfield/correction.h - small displacements and gains of a light field's pictures, undone while they are
 * loaded. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_CORRECTION_H
#define SST_PIPELINE_LIGHTFIELD_CORRECTION_H

#include "pipeline/lightfield/lightfield.h"

struct sst_rectify_map;
struct sst_share;

#define SST_CORRECTION_SHIFT_MAX_PX 100.0 /* limits of the values in a folder */
#define SST_CORRECTION_ROLL_MAX_DEG 10.0
#define SST_CORRECTION_SCALE_MAX    0.1
#define SST_CORRECTION_GAIN_MAX     8.0 /* and one over it */
#define SST_CORRECTION_FALLOFF_MAX  2.0
#define SST_CORRECTION_EXPONENT_MAX 2.0 /* and one over it */

/** Error of one view's picture. The surface at a point x px from the picture's centre belongs at
 *  x - e(x), e(x) = shift + roll J x + scale x, J x = (-x.y, x.x). */
struct sst_correction {
    double shift_x_px, shift_y_px; /* right and down positive */
    double roll_deg;               /* clockwise */
    double scale;                  /* size of the picture minus 1 */
    double gain[3];                /* of linear red, green, blue, as in a calibration; 1: the array's mean */
    double falloff;                /* light at r from the picture's centre is exp(falloff r2) of the centre's, r in half
                                      diagonals */
    double exponent;               /* linear light is (gain times the true light) to this power; 1: none; not with a
                                      calibration */
};

/** No correction. */
struct sst_correction sst_correction_none(void);
bool sst_correction_is_none(const struct sst_correction *c);
/** Finite and within the limits. */
bool sst_correction_valid(const struct sst_correction *c);

/**
 * Correct the loaded pictures (Lanczos, a = 3) and keep how in lf->correction, from where it is stored and applied at
 * the next load. Pictures that were corrected before are corrected further, but only `correction` is kept: load with
 * SST_LOAD_UNCORRECTED first. The same bytes for any number of threads.
 *
 * @param share       shares the views with other processes; or NULL
 * @param correction  [rows * cols]
 * @return 0, -EINVAL (invalid, or raw frames), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_lightfield_correct(struct sst_share *share, struct sst_lightfield *lf,
                                          const struct sst_correction *correction, int threads);

/** Whether a view has an original that rays can be sampled from: then each ray is interpolated once, not twice. */
bool sst_lightfield_has_originals(const struct sst_lightfield *lf);

#define SST_CORRECTION_FILTER SST_FILTER_LANCZOS /* of all corrections; rectify/rectify.h */

/** Where the pixels of a view with an original are in it. @return 0, -EINVAL, -ENOMEM; not logged */
SST_MUST_CHECK int sst_correction_map(struct sst_rectify_map **out, const struct sst_lightfield *lf, int view);

#endif
