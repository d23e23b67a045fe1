/* pipeline/live/posed/posed.h - live pictures of an array without a lattice, on a surface that is fitted by
 * itself (docs/design/posed-live.md). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_POSED_POSED_H
#define SST_PIPELINE_LIVE_POSED_POSED_H

#include "pipeline/live/frames/frames.h"

struct sst_liveposed; /* opaque; one thread, but cancel */

/**
 * Sets the light field's reference view, focal length and spacing: the middle view, its focal length, and the mean
 * distance of neighbours, so that disparity d is the distance focal_px * spacing_mm / d along the middle view's axis.
 *
 * @param cfg, lf  must outlive the object; cfg->posed is given
 * @return 0, -EINVAL (poses of other sizes, or the ground has no limits; logged), -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_liveposed_open(struct sst_liveposed **out, const struct sst_live_config *cfg,
                                      struct sst_lightfield *lf);
/** Waits for the thread that fits the ground: for as long as it compares one plane. NULL is fine. */
void sst_liveposed_close(struct sst_liveposed *p);

/**
 * Follow the changed views, and begin to fit the ground if it is due.
 * @param fit  pictures are needed: the ground is fitted again by time @return 0, -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_liveposed_update(struct sst_liveposed *p, const struct sst_liveframes_changes *changes,
                                        bool fit);

/** Is a fit at its end? Thread: any. */
bool sst_liveposed_unsettled(const struct sst_liveposed *p);
/** Take its surface. @return true: the surface is another one */
bool sst_liveposed_settle(struct sst_liveposed *p);

/** Fit the ground with the next update. */
void sst_liveposed_refit(struct sst_liveposed *p);

void sst_liveposed_surface(const struct sst_liveposed *p, struct sst_live_surface *out);

/** px per spacing; NaN, false: not known yet */
double sst_liveposed_focus(const struct sst_liveposed *p);
bool sst_liveposed_range(const struct sst_liveposed *p, double *min_px, double *max_px);

/** Disparity of the surface at a pixel of the picture, for a focus. NaN: it is not there */
double sst_liveposed_disparity(const struct sst_liveposed *p, double focus_px, int x, int y);

/** The picture of one client. Zeroed: none yet. */
struct sst_liveposed_picture {
    struct sst_image image;
    uint64_t serial; /* of views and surface; 0: none */
    enum sst_render_method method;
    double focus_px, seen; /* seen: share of the picture; NaN: of refocused pictures */
};
void sst_liveposed_picture_fini(struct sst_liveposed_picture *picture);

/**
 * Render the mean of the views on the surface, see through, or the surface alone. Views without a picture are left out.
 *
 * @param cfg          method and focus_px count; at 0 or NaN it is on the fitted surface
 * @param rendered_px  out; 0: nothing has changed
 * @return 0, -ENODATA (no view has a picture, or the method needs the surface, which is not known yet), -ENOMEM
 *         (logged)
 */
SST_MUST_CHECK int sst_liveposed_render(struct sst_liveposed *p, struct sst_liveposed_picture *picture,
                                        const struct sst_render_config *cfg, int64_t *rendered_px);

#endif
