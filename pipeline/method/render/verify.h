/* pipeline/method/render/verify.h - rays that agree at the focus: where disparities are too poor to tell which rays
 * show the surface in focus, the rays' colours are asked.
 *
 * All rays that show the surface in focus have one colour, whatever view they are from; those of an occluder in front
 * have the colours of many places of it. So for each pixel every ray votes for its own colour, and with it for those
 * nearby (pipeline/kernels/kernels.h). Votes count by what the maps say of the ray (W of DESIGN 5.4, plus a doubt: any
 * may be wrong, the more so the less confident the map is) and by how rare the colour is in the views: that dozens of
 * rays are green is no news before a hedge, that ten of them are the same red is. Rays then weigh by their votes and by
 * how near they are, averaged over 3x3 pixels, to the colour with most of them.
 *
 * The result takes the place of the plain weighted mean by a share 0..1, the product of these:
 * - the fewer rays the maps give to the focus: none is left to it where they are a fifth of the rays;
 * - the more rays the maps say to end in front of the focus: from a quarter to a half of them. Where nothing is in
 *   front there is nothing to see through, and what is out of focus is to be blurred;
 * - the more of all votes agree: from a tenth to a fifth. Less is chance;
 * - SST_VERIFY_AUTO: the fewer of all votes agree, down from 45 to 35 in a hundred. Flat surfaces leave maps unsure,
 * too, and most rays that meet one agree on its colour, wherever the focus is: nothing is seen through there;
 * - SST_VERIFY_AUTO: the more disparities around the rays are guesses that no other view confirms
 *   (pipeline/lightfield/unsure.h): from 3 to 5 in a hundred. Where maps are good, what they say is better.
 */
#ifndef SST_PIPELINE_METHOD_RENDER_VERIFY_H
#define SST_PIPELINE_METHOD_RENDER_VERIFY_H

#include "pipeline/method/render/plan.h"

/**
 * Rarity of the colours of some views, every step-th pixel of every step-th row: log(1 + 15 / (f + 0.02)), scaled to
 * 0..255, of the share f of a bin over the mean share; f is smoothed over neighbouring bins.
 *
 * @param rarity  out, [SST_AGREE_BINS]
 */
void sst_rarity_count(uint8_t *rarity, const struct sst_lightfield *lf, const int *view, int views, int step);

/** Are rarities off by more than the share `tolerance` of what they are, on average over the pixels counted for `is`?
 */
bool sst_rarity_differs(const uint8_t *was, const uint8_t *is, double tolerance);

/** Rows and votes of the rays at work; one a thread. */
struct sst_verifier;

/** @return -ENOMEM (not logged) */
SST_MUST_CHECK int sst_verifier_create(struct sst_verifier **out, const struct sst_plan *p);
void sst_verifier_destroy(struct sst_verifier *v);

/**
 * Verify rendered pixels of a row of cells: columns x .. to-1, rows y .. end-1, at most SST_BLEND_MAX by
 * SST_RENDER_CELL_HEIGHT, x a multiple of SST_RENDER_CELL_WIDTH.
 *
 * @param weight  in, [SST_RENDER_CELL_HEIGHT][SST_BLEND_MAX] sums of the rays' weights
 * @param out     in and out
 */
void sst_verify(struct sst_verifier *v, const struct sst_plan *p, float (*weight)[SST_BLEND_MAX], int x, int to, int y,
                int end, struct sst_image *out);

/** Share 0..1 of a pixel that is open to votes as far as the maps decide it: the first two of the three
 * (SST_VERIFY_ON).
 *  @param rays  of sst_pixel_exact() */
double sst_verify_open(const struct sst_plan *p, const struct sst_ray *rays, int count);

#endif
