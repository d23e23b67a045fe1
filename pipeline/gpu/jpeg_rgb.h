/* pipeline/gpu/jpeg_rgb.h - the shader `jpeg_rgb`: the pixels of a frame from the samples of a JPEG.
 *
 * Chroma is enlarged with the weights 3/4 and 1/4 (9/16, 3/16, 3/16, 1/16 in both directions), then colours are those
 * of BT.601 in full range, in 1/65536: whole numbers, with the bytes of libjpeg-turbo, whose decoder for images is the
 * definition.
 */
#ifndef SST_PIPELINE_GPU_JPEG_RGB_H
#define SST_PIPELINE_GPU_JPEG_RGB_H

#include "pipeline/gpu/gpu.h"

/* The structure has the layout of pipeline/kernels/jpeg_rgb.comp (std430). */

/** Buffers, by binding. */
enum sst_gpu_jpeg_buffer {
    SST_GPU_JPEG_PLANES = 0, /* bytes, as of struct sst_jpeg_planes */
    SST_GPU_JPEG_FRAME = 1,  /* out, uint32_t [height][width]: R, G, B and 255 from the lowest byte up */
};

struct sst_gpu_jpeg {
    int32_t width, height;
    int32_t count;        /* of planes: 3, or 1: grey */
    int32_t across, down; /* pixels for one sample of chroma: 1 x 1, 2 x 1, 2 x 2 */
    int32_t chroma_width, chroma_height;
    uint32_t at[3], stride[3]; /* of the planes; bytes */
};

/** Pixels that one group of the shader makes. */
#define SST_GPU_JPEG_GROUP_WIDTH  32
#define SST_GPU_JPEG_GROUP_HEIGHT 8

#endif
