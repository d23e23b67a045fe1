/* pipeline/method/render/render_internal.h - which rays are explained by their own disparity.
 *
 * Rays that a map assigns to an occluder may show it, or what is behind it: maps extend a rim over narrow gaps. A ray
 * is explained if at least half of the views around it show its colour at its own disparity. Those of a gap are not:
 * there the other views show other places of what is behind.
 *
 * Colours agree if they differ by less than 24 levels (sum of R, G, B), and more in noise: by less than three times the
 * lower quartile of the differences of all rays from the views around them.
 */
#ifndef SST_PIPELINE_METHOD_RENDER_RENDER_INTERNAL_H
#define SST_PIPELINE_METHOD_RENDER_RENDER_INTERNAL_H

#include "pipeline/method/render/plan.h"

struct explainer; /* of one plan; any number of threads may use it once prepared */

/** @return -ENOMEM (not logged) */
SST_MUST_CHECK int explainer_create(struct explainer **out, const struct sst_render_plan *p, struct sst_renderer *r);
void explainer_destroy(struct explainer *e);

/** Rectify raw frames and measure the noise, on the first call. @return 0 or -ENOMEM (not logged) */
SST_MUST_CHECK int explainer_prepare(struct explainer *e);

/** True if the pixel (x, y) of the view of tap k, whose disparity is known, is unexplained. */
bool explainer_contradicts(const struct explainer *e, int k, int x, int y);

#endif
