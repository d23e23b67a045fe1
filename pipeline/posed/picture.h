/* pipeline/posed/picture.h - pictures of a posed light field as samples of 16 bits. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_PICTURE_H
#define SST_PIPELINE_POSED_PICTURE_H

#include "pipeline/image/deep.h"
#include "pipeline/posed/posed.h"

/** Read a view's picture, levels as they are in its file, or copy it. @param dir  of the light field. Thread: any
 *  @return 0, -ENOENT, -EBADMSG (damaged, of another size, or other bytes than its hash), -ENOMEM, -EIO; logged */
SST_MUST_CHECK int sst_posed_picture(struct sst_deep *out, const struct sst_posed *posed, const char *dir, int view);

#endif
