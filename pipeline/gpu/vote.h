/* pipeline/gpu/vote.h - the shader `vote`: the label that most of a few views see on the surface of a pixel.
 *
 * All numbers are integers, and equal those of process_vote_labels() on every device. Groups of 32 x 8 pixels.
 */
#ifndef SST_PIPELINE_GPU_VOTE_H
#define SST_PIPELINE_GPU_VOTE_H

#include "pipeline/gpu/check.h"

#define SST_GPU_VOTERS 4

/* A view is uint32_t[height][width][2]: R | G << 8 | B << 16 | label << 24; disparity | valid << 16. */

struct sst_gpu_vote {
    int32_t width, height, count;               /* of voters beside the view itself */
    struct sst_gpu_shift shift[SST_GPU_VOTERS]; /* from the view's pixels to the voter's */
};

enum sst_gpu_vote_buffer {
    SST_GPU_VOTE_OWN = 0,
    SST_GPU_VOTE_VOTERS = 1, /* SST_GPU_VOTERS buffers, the nearest view first; those beyond count: any */
    SST_GPU_VOTE_OUT = 5,    /* out, uint32_t[height][width] */
    SST_GPU_VOTE_BUFFERS
};

#endif
