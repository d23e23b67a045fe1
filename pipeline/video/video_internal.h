/* pipeline/video/video_internal.h - functions of libsst-video.so, which FFmpeg's libraries come with. They log nothing and call
 * nothing of the program: every program can load the part. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_VIDEO_VIDEO_INTERNAL_H
#define SST_PIPELINE_VIDEO_VIDEO_INTERNAL_H

#include "pipeline/video/mp4.h"

#define VIDEO_WHY 160

struct video_encoder; /* opaque; one thread at a time */

/** Begin the file `path`, which exists. @param why  out, with an error: its cause @return as sst_mp4_open() */
SST_MUST_CHECK int video_encoder_open(struct video_encoder **out, const char *path, const struct sst_mp4_config *cfg,
                                      char why[VIDEO_WHY]);
SST_MUST_CHECK int video_encoder_put(struct video_encoder *v, const struct sst_image *img, struct sst_rect part,
                                     char why[VIDEO_WHY]);
SST_MUST_CHECK int video_encoder_next(struct video_encoder *v, char why[VIDEO_WHY]);
SST_MUST_CHECK int video_encoder_end(struct video_encoder *v, char why[VIDEO_WHY]);
void video_encoder_close(struct video_encoder *v);

#endif
