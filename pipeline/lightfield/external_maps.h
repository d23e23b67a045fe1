/* pipeline/lightfield/external_maps.h - external maps: disparity and labels supplied with the images. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_EXTERNAL_MAPS_H
#define SST_PIPELINE_LIGHTFIELD_EXTERNAL_MAPS_H

#include "pipeline/lightfield/lightfield.h"

/**
 * Read the disparity (rr_cc.pfm, px per unit spacing, inf unknown) or the labels (rr_cc.png, label values) of every
 * present view from a folder. The views' size is known and their maps of this kind are empty. Labels missing from the
 * class list are added to it as "LabelN". Sets files->external_disparity or files->external_labels; processing does not
 * replace such maps.
 *
 * @return 0, -ENOENT, -EBADMSG (missing, other size, NaN, a range over 1023 px), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_lightfield_read_disparity(struct sst_lightfield *lf, const char *dir, int threads);
SST_MUST_CHECK int sst_lightfield_read_labels(struct sst_lightfield *lf, const char *dir, int threads);

#endif
