/* pipeline/labels/upsample.h - class probabilities on a coarse grid become labels and entropies of every pixel. */
#ifndef SST_PIPELINE_LABELS_UPSAMPLE_H
#define SST_PIPELINE_LABELS_UPSAMPLE_H

#include "pipeline/image/image.h"

SST_EXTERN_C_BEGIN

/** Distributions at the places of a grid that covers the image. */
struct sst_class_grid {
    int width, height, count;
    float *prob; /* [height][count][width], >= 0, sum 1 over the classes */
};

/**
 * Bilinear between the centres of the grid's cells, most probable class + 1 and entropy of every pixel. Between four
 * cells with one winner that class wins, which spares most pixels the work where the label alone is wanted.
 *
 * @param label    out, of the image's size
 * @param entropy  out, of that size too; or NULL
 * @param prob     out [count][height][width]; or NULL
 * @return 0 or -ENOMEM (not logged). Same bytes for any number of threads; the same labels whatever else is wanted.
 */
SST_MUST_CHECK int sst_upsample(struct sst_map_u8 *label, struct sst_map_f32 *entropy, float *prob,
                                const struct sst_class_grid *grid, int threads);

SST_EXTERN_C_END

#endif
