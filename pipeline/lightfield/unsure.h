/* pipeline/lightfield/unsure.h - fraction of unconfirmed disparities around each ray.
 *
 * Matching gives confidence 0 to disparities that no neighbouring view confirms (pipeline/method/disparity). They are
 * 0.1 % of the pixels among large objects and 4 to 8 % between leaves.
 */
#ifndef SST_PIPELINE_LIGHTFIELD_UNSURE_H
#define SST_PIPELINE_LIGHTFIELD_UNSURE_H

#include "pipeline/lightfield/lightfield.h"

#define SST_UNSURE_BLOCK 32    /* side of the counted blocks, px */
#define SST_UNSURE_FULL  0.125 /* fraction of a block's pixels that maps to 255 */

struct sst_unsure {
    struct sst_map_u8 *view; /* [rows * cols], one pixel per block; empty: the view has no confidences */
    int views;
    double confirmed; /* fraction of all disparities that another view confirms; NaN: no confidences */
};

/** @param u  out, zeroed before; sst_unsure_fini() also after failures @return 0, -ENOMEM (not
 * logged) */
SST_MUST_CHECK int sst_unsure_init(struct sst_unsure *u, const struct sst_lightfield *lf, int threads);
void sst_unsure_fini(struct sst_unsure *u);

#endif
