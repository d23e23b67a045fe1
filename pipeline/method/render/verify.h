/* pipeline/method/render/verify.h - weights rays by the agreement of their colours at the focus, where disparities
 * cannot decide which rays show the surface in focus.
 *
 * All rays that show the surface in focus have one colour, whatever view they are from; those of an occluder in front
 * have the colours of many points on it. So for each pixel every ray votes for its own colour and similar ones
 * (pipeline/kernels/kernels.h). A vote is weighted by the maps (W of design.md, 5.4, plus a constant for possible
 * errors, larger where the map is less confident) and by the rarity of the colour in the views: dozens of green rays
 * mean little in front of a hedge, ten of the same red do. Rays are then weighted by their votes and by their
 * similarity, averaged over 3x3 pixels, to the colour with most votes.
 *
 * The result is blended with the plain weighted mean by a fraction 0..1, the product of these factors:
 * - fewer rays that the maps assign to the focus: 0 from a fifth of the rays on;
 * - more rays that end in front of the focus by the maps: rises from a quarter to a half of them. Without an occluder
 *   there is nothing to see through, and what is out of focus must stay blurred;
 * - more agreement of the votes: rises from a tenth to a fifth of them. Less is chance;
 * - SST_VERIFY_AUTO: more unexplained rays among those that end in front of the focus (render_internal.h), over 3x3
 *   pixels: rises from a tenth to a fifth of all views. Reliable maps are better than votes.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_VERIFY_H
#define SST_PIPELINE_METHOD_RENDER_VERIFY_H

#include "pipeline/method/render/plan.h"

/**
 * Rarity of the colours of some views, every step-th pixel of every step-th row: log(1 + 15 / (f + 0.02)), scaled to
 * 0..255, f being the bin's count over the mean count, smoothed over neighbouring bins.
 *
 * @param rarity  out, [SST_AGREE_BINS]
 */
void sst_rarity_count(uint8_t *rarity, const struct sst_lightfield *lf, const int *view, int views, int step);

/** True if rarities differ by more than the fraction `tolerance`, on average over the pixels counted for `is`. */
bool sst_rarity_differs(const uint8_t *was, const uint8_t *is, double tolerance);

/** Working memory for rows and votes of rays; one per thread. */
struct sst_verifier;

/** @return -ENOMEM (not logged) */
SST_MUST_CHECK int sst_verifier_create(struct sst_verifier **out, const struct sst_render_plan *p);
void sst_verifier_destroy(struct sst_verifier *v);

/**
 * Verify rendered pixels of a row of cells: columns x .. to-1, rows y .. end-1, at most SST_BLEND_MAX by
 * SST_RENDER_CELL_HEIGHT, x a multiple of SST_RENDER_CELL_WIDTH.
 *
 * @param weight  in, [SST_RENDER_CELL_HEIGHT][SST_BLEND_MAX] sums of the rays' weights
 * @param out     in and out
 */
void sst_verify(struct sst_verifier *v, const struct sst_render_plan *p, float (*weight)[SST_BLEND_MAX], int x, int to,
                int y, int end, struct sst_image *out);

/** Numbers for the views and the focus of a plan. */
struct sst_verify_numbers sst_verify_numbers(const struct sst_render_plan *p);

/** Fraction of a pixel that the maps leave to votes: the product of the first two factors (SST_VERIFY_ON).
 *  @param rays  of sst_render_pixel_exact() */
double sst_verify_open(const struct sst_render_plan *p, const struct sst_ray *rays, int count);

#endif
