/* pipeline/lightfield/unconfirmed.h - fraction of unconfirmed disparities around each ray.
 *
 * Matching gives confidence 0 to disparities that no neighbouring view confirms (pipeline/method/disparity). They are
 * 0.1 % of the pixels among large objects and 4 to 8 % between leaves.
 */
#ifndef SST_PIPELINE_LIGHTFIELD_UNCONFIRMED_H
#define SST_PIPELINE_LIGHTFIELD_UNCONFIRMED_H

#include "pipeline/lightfield/lightfield.h"

#define SST_UNCONFIRMED_BLOCK 32    /* side of the counted blocks, px */
#define SST_UNCONFIRMED_FULL  0.125 /* fraction of a block's pixels that maps to 255 */

struct sst_unconfirmed {
    struct sst_map_u8 *view; /* [rows * cols], one pixel per block; empty: the view has no confidences */
    int views;
    double confirmed; /* fraction of all disparities that another view confirms; NaN: no confidences */
};

/** @param u  out, zeroed before; sst_unconfirmed_fini() also after failures @return 0, -ENOMEM (not
 * logged) */
SST_MUST_CHECK int sst_unconfirmed_init(struct sst_unconfirmed *u, const struct sst_lightfield *lf, int threads);
void sst_unconfirmed_fini(struct sst_unconfirmed *u);

#endif
