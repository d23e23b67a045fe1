/* pipeline/posed/clear.h - weights of rays by the surface that their own view sees; see-through and clear pictures. */
#ifndef SST_PIPELINE_POSED_CLEAR_H
#define SST_PIPELINE_POSED_CLEAR_H

#include "pipeline/posed/render.h"

/**
 * Render with rays weighed by the surface that their view sees.
 *
 * Every view is compared with up to four others about a ground's parallax of 25 px away, on surfaces from the given one
 * up to the highest points of the scene: windows of 7x7 pixels, the mean correlation of the two best views. A ray's
 * weight is high where the view agrees with others on the surface better than on any in front of it.
 *
 * See-through: rays weigh 0.05 at least. Clear: rays that something in front blocks do not count; pixels with less than
 * 1.2 rays in sum are unknown: `views` is 0 there, and the picture shows the integral, dimmed. Between known and
 * unknown pixels the picture changes gradually.
 *
 * @return as sst_posed_render(); -ENODATA: fewer than three views are placed
 */
SST_MUST_CHECK int sst_posed_render_weighted(struct sst_posed_rendered *out, const struct sst_posed *posed,
                                             const char *dir, const struct sst_posed_render_config *cfg);

#endif
