/* pipeline/posed/render.h - pictures of posed views from a virtual camera: the integral, see-through and clear. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_RENDER_H
#define SST_PIPELINE_POSED_RENDER_H

#include "pipeline/posed/integral.h"

enum sst_posed_method {
    SST_POSED_REFOCUS = 0, /* the mean of all views on the surface (integral.h) */
    SST_POSED_THROUGH = 1, /* rays that agree with others on the surface weigh more */
    SST_POSED_CLEAR = 2,   /* the surface alone, of rays that nothing in front blocks */
};

struct sst_posed_render_config {
    enum sst_posed_method method;
    struct sst_virtual camera;
    struct sst_surface surface;
    int threads;
    int compare_px; /* see-through, clear: width of the pictures that are compared, about; 0: 512, fewer of many views */
    double near_mm; /* nothing is nearer to the views; 0: by the points of the scene, without them half the distance */
    const struct sst_integral_places *places; /* of this camera and surface; NULL: they are computed */
};

/** Zeroed: empty. */
struct sst_posed_rendered {
    struct sst_deep levels;     /* rounded; in the views' range. Clear: the dimmed integral where unknown */
    struct sst_map_f32 mean[3]; /* [channels] of the rays, in levels, not rounded; NAN: no ray, or unknown */
    struct sst_map_u16 views;   /* number of views that each pixel is of; 0: unknown */
    bool seen;                  /* a view sees the surface somewhere, blocked or not */
    struct sst_samples stretch; /* levels that 0.5 % of the seen pixels are below and above, for 8 bits */
};

/** Render all placed views of a folder. @return 0, -ENODATA (no view is placed, or none sees the surface), -ENOMEM, or
 * as sst_posed_picture(); logged */
SST_MUST_CHECK int sst_posed_render(struct sst_posed_rendered *out, const struct sst_posed *posed, const char *dir,
                                    const struct sst_posed_render_config *cfg);
void sst_posed_rendered_fini(struct sst_posed_rendered *rendered);

#endif
