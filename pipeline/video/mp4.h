/* pipeline/video/mp4.h - silent MP4 files of pictures, written whole or not at all. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_VIDEO_MP4_H
#define SST_PIPELINE_VIDEO_MP4_H

#include <stdbool.h>

#include "pipeline/image/image.h"

/* Limits of H.264 level 4.1, which players of telephones and Windows have in hardware. */
#define SST_MP4_WIDTH_MOST  1920
#define SST_MP4_HEIGHT_MOST 1080
#define SST_MP4_RATE_MOST   30
#define SST_MP4_KBIT_MOST   8000

struct sst_mp4_config {
    int width, height; /* at least 2; an odd last column or row is left out */
    double rate_hz;    /* constant */
    /* For any player: H.264 only, High profile, level 4.1, at most SST_MP4_KBIT_MOST; the size and rate must be within the limits
     * above. Else the best quality, and MPEG-4 part 2 where no encoder of H.264 is present. */
    bool portable;
    const char *title; /* NULL: none */
};

struct sst_mp4; /* opaque; one thread at a time */

/**
 * Begin a file: 4:2:0, limited range of BT.709, the index first.
 *
 * @return 0, -ENOTSUP (built without libavformat, or no encoder), -EINVAL (size or rate), -EIO, -ENOSPC, -ENOMEM;
 *         logged
 */
SST_MUST_CHECK int sst_mp4_open(struct sst_mp4 **out, const char *path, const struct sst_mp4_config *cfg);

/** Draw a picture over a part of the frame, scaled to it; its edges are even. The other parts stay. @return 0, -EINVAL (part),
 *  -ENOMEM; logged */
SST_MUST_CHECK int sst_mp4_put(struct sst_mp4 *m, const struct sst_image *img, struct sst_rect part);

/** Append the frame as it is drawn. @return 0, -EIO, -ENOSPC, -ENOMEM; logged */
SST_MUST_CHECK int sst_mp4_next(struct sst_mp4 *m);

/** Append one picture of the video's size: sst_mp4_put() over all of it, and sst_mp4_next(). */
SST_MUST_CHECK int sst_mp4_add(struct sst_mp4 *m, const struct sst_image *img);

/** Finish the file under its name. On failure nothing is left; m still is to be closed. @return as sst_mp4_next() */
SST_MUST_CHECK int sst_mp4_commit(struct sst_mp4 *m);

/** Free; an uncommitted file is removed. NULL is fine. */
void sst_mp4_close(struct sst_mp4 *m);

#endif
