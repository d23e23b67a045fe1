/* pipeline/image/develop.h - raw files of still cameras, developed to pictures by LibRaw. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_DEVELOP_H
#define SST_PIPELINE_IMAGE_DEVELOP_H

#include "pipeline/image/image.h"

/** Is LibRaw there? Loads it at the first call. */
bool sst_image_can_develop(void);

/**
 * Develop a raw file: the camera's white balance, sRGB, no brightening and no rotation, so that the views of one camera
 * stay alike.
 *
 * @param img   out, initialised here
 * @param name  only used in messages
 * @return 0, -ENOPKG (no LibRaw), -EBADMSG (damaged, or of a camera that LibRaw does not know), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_image_develop(struct sst_image *img, const uint8_t *data, size_t size, const char *name);

#endif
