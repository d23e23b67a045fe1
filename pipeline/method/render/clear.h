/* pipeline/method/render/clear.h - the clear picture: all in focus, without what stands in front (design.md, 5.6).
 *
 * Surface: every view's kept rays go to the viewpoint by their own disparity; of the rays that arrive at a pixel, the
 * nearest group within CLEAR_TOLERANCE_PX wins that has at least 2 views and a tenth of all that arrive.
 * Colour: weighted mean over the rays that see that surface, the nearest views first. Rays next to something removed
 * mix its colour with theirs and count little; so do colours that differ from the mean. The viewpoint's own camera
 * replaces the mean where it sees the surface and agrees with it.
 * Holes: pixels of little weight are mixed with the mean of their surroundings (fill.c). What was removed is not part
 * of it, so they are filled from behind.
 */
#ifndef SST_PIPELINE_METHOD_RENDER_CLEAR_H
#define SST_PIPELINE_METHOD_RENDER_CLEAR_H

#include "pipeline/method/render/plan.h"

/** Values of the validity plane. */
enum clear_valid { CLEAR_UNKNOWN = 0, CLEAR_FILLED = 64, CLEAR_SEEN = 255 };

/** As sst_render() for SST_RENDER_CLEAR; logged. @param valid  out, enum clear_valid, or NULL */
SST_MUST_CHECK int clear_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out,
                                struct sst_map_u8 *valid);

/** As sst_render_rays(): rays that end at the surface of one pixel. w_depth is the weight of the place (next to
 *  something removed: little), w_label that of the colour's agreement. No rays: a hole. */
SST_MUST_CHECK int clear_rays(struct sst_renderer *r, const struct sst_render_config *cfg, int x, int y,
                              struct sst_ray *rays, int *count);

/**
 * Mix every pixel with the mean of its surroundings, as far as its weight is below 255: a pyramid of weighted means,
 * each level as far as the finer one lacks weight.   Source: Gortler 1996, pull-push.
 *
 * @param weight  in, 0..255
 * @param levels  in, working memory of clear_fill_bytes() bytes
 */
SST_MUST_CHECK int clear_fill(struct sst_image *img, const struct sst_map_u8 *weight, void *levels, int threads);
size_t clear_fill_bytes(int width, int height);

#endif
