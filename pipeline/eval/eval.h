/* pipeline/eval/eval.h - error measures against truth: disparity, labels, pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_EVAL_EVAL_H
#define SST_PIPELINE_EVAL_EVAL_H

#include "pipeline/image/image.h"

/** Disparity errors over the pixels with a finite truth (and where mask is not 0, if given). */
struct sst_disparity_error {
    int64_t pixels;                    /* with truth */
    /* Percent of pixels off by more than 0.03, 0.07, 0.5, 1, 2, 4 px; unknown counts as bad. */
    double bad003, bad007, bad_half, bad1, bad2, bad4;
    double rmse, mean_abs;             /* px, over the pixels with an estimate */
    double density;                    /* percent of pixels with an estimate */
};

/**
 * @param out  percentages are NaN without truth, rmse and mean_abs without an estimate
 * @param estimate  +inf or NaN: unknown   @param mask  non-zero: counts; may be NULL
 * @return 0 or -EINVAL (sizes differ)
 */
SST_MUST_CHECK int sst_eval_disparity(struct sst_disparity_error *out, const struct sst_map_f32 *estimate,
                                      const struct sst_map_f32 *truth, const struct sst_map_u8 *mask);

/** Merge the errors of two sets of pixels. A zeroed object is a valid start. */
void sst_eval_disparity_merge(struct sst_disparity_error *sum, const struct sst_disparity_error *add);

/**
 * Mark the pixels with a surface that another view sees too: the point at x with disparity d is at x - d (dbx, dby)
 * there; it is visible if that is inside the view and the nearest pixel has no surface nearer by more than 1 px of
 * disparity.
 *
 * @param mask      in and out: set to 255 where visible, else unchanged, so that calls for several views accumulate
 * @param dbx, dby  offset of the other view minus this one's, in spacings
 * @return 0 or -EINVAL (sizes differ)
 */
SST_MUST_CHECK int sst_eval_visible(struct sst_map_u8 *mask, const struct sst_map_f32 *truth,
                                    const struct sst_map_f32 *other, double dbx, double dby);

/** Confusion counts of labels: [truth][estimate], 0 = unlabeled. */
struct sst_confusion {
    int64_t count[65][65];
};

/** Add one view; pixels with truth 0 are ignored. @return 0 or -EINVAL (sizes differ, a label above 64). */
SST_MUST_CHECK int sst_confusion_add(struct sst_confusion *c, const struct sst_map_u8 *estimate,
                                     const struct sst_map_u8 *truth);

/** Mean IoU in percent over the classes that occur in the truth; a class's unlabeled pixels count as misses. NaN if
 * none. */
double sst_confusion_miou(const struct sst_confusion *c);

/** IoU of one class in percent, NaN where it occurs neither in the truth nor in the estimate. */
double sst_confusion_iou(const struct sst_confusion *c, int label);

/** Percent of pixels with truth that have a label; percent of the labelled ones with the right label (NaN: none). */
double sst_confusion_coverage(const struct sst_confusion *c);
double sst_confusion_accuracy(const struct sst_confusion *c);

/** PSNR in dB over R, G, B of the masked pixels (NULL: all); at most 100 dB, which identical pictures give; NaN where
 * no pixel counts or the sizes differ. */
double sst_psnr(const struct sst_image *a, const struct sst_image *b, const struct sst_map_u8 *mask);

/**
 * SSIM (Wang et al. 2004): Gaussian 11x11 window, sigma 1.5, K1 0.01, K2 0.03, on luma (BT.601), windows cut at the
 * border and renormalised; mean over the masked pixels (NULL: all).  NaN if no pixel.
 * @return 0, -EINVAL (sizes differ), -ENOMEM
 */
SST_MUST_CHECK int sst_ssim(double *out, const struct sst_image *a, const struct sst_image *b,
                            const struct sst_map_u8 *mask);

#endif
