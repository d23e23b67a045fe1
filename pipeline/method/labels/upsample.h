/* pipeline/method/labels/upsample.h - class probabilities on a coarse grid become labels and entropies of every pixel. */
#ifndef SST_PIPELINE_METHOD_LABELS_UPSAMPLE_H
#define SST_PIPELINE_METHOD_LABELS_UPSAMPLE_H

#include "base/mem.h"
#include "pipeline/image/image.h"

/** Distributions at the places of a grid that covers the image. */
struct sst_class_grid {
    int width, height, count;
    size_t values; /* floats of a cell: sst_class_grid_values() */
    float *cell;   /* [height][width][values]: count probabilities, >= 0 with sum 1; the rest is used inside */
};

/** Scratch. Zeroed: none yet. */
struct sst_upsample_memory {
    struct sst_mem_kept own, resample;
};

void sst_upsample_memory_fini(struct sst_upsample_memory *memory);

/** Floats of a cell of `count` classes: room for the sum of weights, rounded up for the kernel. */
size_t sst_class_grid_values(int count);

/**
 * Most probable class + 1 and entropy of every pixel, from the 4x4 cells around it: each counts by its distance (Gauss,
 * 0.7 cells) and by how like the pixel's colour is to the mean of the image under the cell (Gauss, SST_GUIDE_SIGMA). So
 * leaves and outlines end where the picture says, not between cells. Where all 16 cells have one winner it wins, which
 * spares most pixels the work where the label alone is wanted.
 *
 * @param label    out, of the image's size
 * @param entropy  out, of that size too; or NULL
 * @param prob     out [count][height][width]; or NULL
 * @param grid     the free floats of its cells are set here
 * @return 0 or -ENOMEM (not logged). Same bytes for any number of threads; the same labels whatever else is wanted.
 */
SST_MUST_CHECK int sst_upsample(struct sst_map_u8 *label, struct sst_map_f32 *entropy, float *prob,
                                struct sst_class_grid *grid, const struct sst_image *img, int threads,
                                struct sst_upsample_memory *memory);

#endif
