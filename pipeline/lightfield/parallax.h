/* pipeline/lightfield/parallax.h - parallax between the views of a light field; none where all show one picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_PARALLAX_H
#define SST_PIPELINE_LIGHTFIELD_PARALLAX_H

#include "pipeline/lightfield/lightfield.h"

enum sst_parallax {
    SST_PARALLAX_UNKNOWN = 0, /* one view, hardly any texture, or a view cannot be read */
    SST_PARALLAX_NONE = 1,    /* the views are one picture: nothing moves by a tenth of a pixel between them */
    SST_PARALLAX_SEEN = 2,
};

/**
 * Compare the reference view with the outermost views in up to 400 blocks of 16x16 px.
 *
 * A block stands still if it correlates with the same place of the other views and its disparity by the gradients
 * (Lucas 1981) is below a tenth of a pixel over the widest baseline. There is no parallax if most textured blocks stand
 * still and the others, searched along the baselines, are found nowhere else: noise, gains and text that a camera draws
 * into its pictures make no parallax.
 *
 * @param dir  folder from which images that are not loaded are read, as the files are; NULL: all that are needed are
 *             loaded. Nothing is logged.
 */
enum sst_parallax sst_lightfield_parallax(const struct sst_lightfield *lf, const char *dir);

/** Log a warning if the views show no parallax.
 *  @param name  of the light field, for the message */
void sst_lightfield_warn_views(const struct sst_lightfield *lf, const char *dir, const char *name);

#endif
