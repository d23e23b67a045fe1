/* pipeline/method/refine/refine.h - label refinement: labels of the unlabeled rays by their disparity (paper:
 * disparity-guided refinement). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_REFINE_REFINE_H
#define SST_PIPELINE_METHOD_REFINE_REFINE_H

#include "pipeline/lightfield/lightfield.h"

struct sst_share;

struct sst_refine_config {
    double eps_d;                /* density threshold eps_D, 1/px: a label is a candidate where g_i(D) > eps_d */
    double matcher_sigma_px;     /* noise of the disparities: floor of the fitted spread */
    int min_pixels;              /* labels with fewer confident pixels (all views together) are ignored */
    double p_normal, p_distance; /* weights p_n, p_d of the energy */
    double tau;        /* of the normal consistency, in inner products per pixel of the region (see parts.h); > 0 */
    int normal_window; /* side of the window that normals are fitted in; odd, 21..127 */
    bool ground_plane; /* a ground that is a plane in a view is a candidate only for pixels on that plane (not in the
                          paper) */
    const bool *skip;  /* [views] these take no part and stay as they are; NULL: none */
    int threads;       /* 0: all processors */
    const SST_ATOMIC(bool) * cancel; /* once true, processing stops within one view; or NULL */
    struct sst_share *share;         /* with other processes (pipeline/lightfield/share.h), by views; or NULL */
};

void sst_refine_config_defaults(struct sst_refine_config *cfg);

/** The normal distribution of one label's disparities (robust, see parts.h). */
struct sst_label_fit {
    int64_t count; /* confident pixels */
    double mean_px, sigma_px;
    bool usable;
};

/**
 * Refine views[].label in place: HCSM in (0 = unlabeled), labels with the gaps filled out. Needs disp of every present
 * view.
 *
 * Distributions come from the confident pixels of all views, the regions of the energy from the same view.
 * An unlabeled pixel without a candidate or a disparity stays unlabeled; a single candidate is assigned. Among several,
 * objects compete by E_d alone, and so do grounds; the best object and the best ground then compete by E = p_n E_n +
 * p_d E_d, because normals only distinguish a ground from objects on it. Ties go to the smaller label. A candidate that
 * is absent from the view's HCSM has E_d = 1; where one of the two has no normals (absent, foliage), E_n is left out.
 * Source: design.md, 5.3.
 *
 * @param fits  out, lf->classes.count entries, or NULL
 * @return 0, -EINVAL (maps missing), -ENOMEM; logged; -ECANCELED, not logged.  The same bytes for any number of
 * threads.
 */
SST_MUST_CHECK int sst_refine_labels(struct sst_lightfield *lf, const struct sst_refine_config *cfg,
                                     struct sst_label_fit *fits);

#endif
