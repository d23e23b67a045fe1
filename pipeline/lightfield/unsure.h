/* pipeline/lightfield/unsure.h - where maps are poor: how many disparities around each ray no other view confirms.
 *
 * Matching gives confidence 0 to disparities that no neighbour has, which are guesses (pipeline/method/disparity). They
 * are one in a thousand where things are large, four to eight in a hundred between leaves.
 */
#ifndef SST_PIPELINE_LIGHTFIELD_UNSURE_H
#define SST_PIPELINE_LIGHTFIELD_UNSURE_H

#include "pipeline/lightfield/lightfield.h"

#define SST_UNSURE_BLOCK 32    /* sides of the blocks that are counted in, px */
#define SST_UNSURE_FULL  0.125 /* share of a block's pixels that makes 255 of it */

struct sst_unsure {
    struct sst_map_u8 *view; /* [rows * cols], a pixel a block; empty: the view has no confidences */
    int views;
    double confirmed; /* share 0..1 of all disparities that another view confirms; NaN: there are no confidences */
};

/** @param u  out, all zero before; to be freed with sst_unsure_fini() after failures, too @return 0, -ENOMEM (not
 * logged) */
SST_MUST_CHECK int sst_unsure_init(struct sst_unsure *u, const struct sst_lightfield *lf, int threads);
void sst_unsure_fini(struct sst_unsure *u);

#endif
