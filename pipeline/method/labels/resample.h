/* pipeline/method/labels/resample.h - an image brought to the working size of a network, as floats. */
#ifndef SST_PIPELINE_METHOD_LABELS_RESAMPLE_H
#define SST_PIPELINE_METHOD_LABELS_RESAMPLE_H

#include "base/mem.h"
#include "pipeline/image/image.h"

/**
 * Resize the three planes: along an axis that shrinks, each output sample is the mean of the input that it covers (with
 * fractions of samples at the ends); along one that grows, bilinear with half-pixel centres. Same bytes for any
 * threads.
 *
 * @param out  [3][height][width], (sample / 255 - mean[c]) / std[c]
 * @param kept  scratch
 * @return 0 or -ENOMEM (not logged)
 */
SST_MUST_CHECK int sst_resample(float *out, int width, int height, const struct sst_image *img, const double mean[3],
                                const double std[3], int threads, struct sst_mem_kept *kept);

#endif
