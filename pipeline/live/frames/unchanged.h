/* pipeline/live/frames/unchanged.h - unchanged pictures of cameras, each compared with the last accepted one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_FRAMES_UNCHANGED_H
#define SST_PIPELINE_LIVE_FRAMES_UNCHANGED_H

#include <stdbool.h>

#include "base/base.h"

struct sst_unchanged; /* opaque; one thread */

/** @param fourcc  V4L2: MJPG, JPEG, or a format of pipeline/image/raw.h @return 0, -EINVAL (format, size), -ENOMEM */
SST_MUST_CHECK int sst_unchanged_create(struct sst_unchanged **out, int cameras, uint32_t fourcc, int width,
                                        int height);
/** NULL is fine. */
void sst_unchanged_destroy(struct sst_unchanged *unchanged);

/**
 * Compare a picture with the last accepted one of this camera; a changed one is accepted in its place.
 *
 * Tests as in sst_liveframes_update(): means of blocks of 8x8 px, thresholds that adapt to the camera's
 * noise, changes of light compensated up to a limit; differences below the thresholds accumulate against the accepted
 * picture. Costs the reading of the block means, a millisecond for a JPEG of 640x480.
 * @return false also for the first picture, and for one that cannot be read
 */
bool sst_unchanged_same(struct sst_unchanged *unchanged, int cam, const uint8_t *data, size_t bytes, size_t stride);

#endif
