/* simulators/scene/world/jpeg.h - frames as JPEG 4:2:2 with a restart after each row of blocks, and the strip set into them.
 */
#ifndef SST_SIMULATORS_SCENE_WORLD_JPEG_H
#define SST_SIMULATORS_SCENE_WORLD_JPEG_H

#include "pipeline/image/image.h"
#include "simulators/scene/world/strip.h"

/** A frame's bytes and where the strip goes in. */
struct sst_sim_jpeg {
    uint8_t *data;
    uint32_t bytes;
    uint32_t scan;    /* first byte after the headers */
    uint32_t rest;    /* first byte after the strip's rows; scan where the frame has none */
    uint32_t dc_step; /* of luma: quantiser of the blocks' means */
};

/**
 * Encode a picture.
 *
 * @param strip  leave room for the strip: a picture at least as high as it
 * @param out    data to free with free()
 * @return 0, -EINVAL (no room for the strip), -ENOMEM, -EIO (the encoder refuses; logged).   Thread: any.
 */
SST_MUST_CHECK int sst_sim_jpeg_encode(const struct sst_image *img, int quality, bool strip, struct sst_sim_jpeg *out);

/**
 * Copy a frame with its strip drawn: the rows of the strip are coded anew, all others are copied.
 *
 * @param exposure  NULL: no strip, a plain copy
 * @return 0 or -ENOSPC
 */
SST_MUST_CHECK int sst_sim_jpeg_copy(const struct sst_sim_jpeg *in, int width, const struct sst_sim_exposure *exposure,
                                     uint8_t *out, size_t capacity, size_t *bytes);

#endif
