/* pipeline/method/render/focus.h - the automatic focus: what lies behind the nearest surfaces. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_FOCUS_H
#define SST_PIPELINE_METHOD_RENDER_FOCUS_H

#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/lightfield.h"

/** Estimate of the default focus, remembered over half a minute. */
struct sst_render_focus {
    double min_px;                   /* of bin 0; a bin is SST_BLEND_COLUMNS' 1/4 px */
    float vote[SST_BLEND_COLUMNS];   /* of the last sst_render_focus_vote() */
    float memory[SST_BLEND_COLUMNS]; /* decaying sum of votes */
    uint16_t *front, *behind;        /* [cells] of the lead view: stored disparity; that of the surface it hides, + 1 */
    int cells;
    int64_t t_ns;    /* of the last step; 0: none */
    double focus_px; /* NaN: unknown */
};

void sst_render_focus_init(struct sst_render_focus *f); /* all zero but for NaN */
void sst_render_focus_fini(struct sst_render_focus *f);

/**
 * Count votes for the disparities of surfaces that the nearest surfaces hide.
 * @param view  in, [views] views with maps, the lead view first
 * @return 0, -ENOMEM (not logged; the old votes stay)
 */
SST_MUST_CHECK int sst_render_focus_vote(struct sst_render_focus *f, const struct sst_lightfield *lf, const int *view,
                                         int views);

/** Add the votes to the memory, weighted by the time since the last step. */
void sst_render_focus_step(struct sst_render_focus *f, int64_t t_ns);

#define SST_RENDER_SAMPLED 5 /* views that describe the scene: the lead view and the corners */

/** The lead view, whose maps describe the scene: the reference view, or the nearest view with a map; -1: none. */
int sst_render_lead_view(const struct sst_lightfield *lf);

/** The lead view and the outermost views with maps, which see what is hidden from it. @return their number; 0: none */
int sst_render_sample_views(const struct sst_lightfield *lf, int view[SST_RENDER_SAMPLED]);

/**
 * The focus that a live engine chooses at its first set of these views.
 *
 * @param focus_px  out, px per spacing; untouched on failure
 * @return 0, -ENODATA (no disparities; not logged), -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_render_find_focus(const struct sst_lightfield *lf, double *focus_px);

#endif
