/* cli/video.h - a silent MP4 from pictures, whole or not at all. */
#ifndef SST_CLI_VIDEO_H
#define SST_CLI_VIDEO_H

#include "pipeline/image/image.h"

struct video;

/**
 * H.264 where an encoder is present, else MPEG-4 part 2; 4:2:0; an odd last column or row is left out.
 *
 * @return 0, -ENOTSUP (built without libavformat, or no encoder), -EINVAL (below 2 pixels a side), -EIO, -ENOSPC,
 *         -ENOMEM; logged
 */
SST_MUST_CHECK int video_open(struct video **out, const char *path, int width, int height, double fps);

/** Append one picture of that size. */
SST_MUST_CHECK int video_add(struct video *v, const struct sst_image *img);

/** Finish the file under its name. On failure nothing is left; v still is to be closed. */
SST_MUST_CHECK int video_commit(struct video *v);

/** Free; what is not committed is removed. NULL is fine. */
void video_close(struct video *v);

#endif
