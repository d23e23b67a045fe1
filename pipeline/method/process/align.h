/* pipeline/method/process/align.h - displacements and gains of the pictures, estimated from the scene and undone. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_PROCESS_ALIGN_H
#define SST_PIPELINE_METHOD_PROCESS_ALIGN_H

#include "pipeline/calibration/drift/drift.h"
#include "pipeline/lightfield/correction.h"

/** What was found and done. */
struct sst_align_report {
    int moved, lit;    /* views whose picture was moved, whose gain was changed; 0: nothing significant */
    bool contradictory; /* some seem displaced, but are left: matches of a pair contradict each other */
    double worst_px;   /* largest displacement that was undone, RMS over the picture */
    double worst_gain; /* largest |gain - 1| that was undone */
    int faded;            /* views whose fall-off towards the corners was undone */
    double worst_falloff; /* largest |share of the light| that the corners of one of them lost */
    int bent;                        /* views whose exponent (gamma) was undone */
    double worst_exponent;           /* largest |exponent - 1| of these */
    double exponent_sigma;           /* the median of the exponents' sigmas */
    bool bent_kept;                  /* exponents are off, but left: the views have a calibration */
    double sigma_px;   /* median over the views of the displacements' sigma; NAN: nothing was measured */
    double gain_sigma; /* the same of the gains */
    double falloff_sigma; /* the same of the logs of the light in the corners */
    int unmeasured;    /* views that too few matches tie to the others */
};

/**
 * Corrections of all views from the matches between them.
 *
 * Test, for shifts along both axes, rolls, scales, gains and fall-offs one by one: a view is off, and corrected, beyond
 * 0.3 px (RMS over the picture; gains and fall-offs: 12 % of the light) and 6 sigma. Where more than a quarter of the
 * views are off, all beyond 1 sigma are corrected; so are fall-offs whose RMS is beyond 10 % and 2 sigma. Views that
 * are off by more than 8 px are not: their scene is another one, or they are in a wrong place. What all views share is
 * not observable: the mean of those that agree stays, but for a fall-off beside which the cameras' own are significant;
 * so does a displacement that grows with the views' offsets, which meshes and foliage feign: all of it where it
 * explains most of the deviations, else the share that their jitter does not. Exponents (gamma) are undone in all views
 * if their RMS is beyond 4 % and 3 sigma, and explain the light better than fall-offs do; not with a calibration. Where
 * the matches of a pair contradict each other, as those of fences do, no displacement is corrected.
 *
 * @param correction  out, [rows * cols]
 */
void sst_align_plan(struct sst_correction *correction, struct sst_align_report *report, const struct sst_lightfield *lf,
                    const struct sst_drift *check);

/** Whether a first look is enough: every view was measured, by pairs along rows and along columns where it has them, and
 * nothing would be corrected with the sigmas of a whole check. */
bool sst_align_is_clean(const struct sst_lightfield *lf, const struct sst_drift *check);

#endif
