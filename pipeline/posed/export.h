/* pipeline/posed/export.h - export of a posed light field for COLMAP and nerfstudio. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_EXPORT_H
#define SST_PIPELINE_POSED_EXPORT_H

#include "pipeline/lightfield/import.h"

/**
 * Write the placed views of cfg->dir: images/ and the cameras, lengths in metres. Pictures keep their names, with _ for
 * blanks and folders. Options of lattices (focal length, spacing, focus) are refused.
 * @return as sst_export(); logged
 */
SST_MUST_CHECK int sst_posed_export(const struct sst_export_config *cfg);

/** sst_export_npz() of a posed light field: pictures as they are. @return as sst_export(); logged */
SST_MUST_CHECK int sst_posed_export_npz(const struct sst_export_config *cfg);

#endif
