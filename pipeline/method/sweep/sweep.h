/* pipeline/method/sweep/sweep.h - plane sweep in scene space: disparities of all views of a light field at once, each
 * view compared with the colour that most views agree on. For scenes with many depth edges, such as foliage. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_SWEEP_SWEEP_H
#define SST_PIPELINE_METHOD_SWEEP_SWEEP_H

#include "base/thread.h"
#include "pipeline/image/image.h"

struct sst_planesweep_view {
    const struct sst_image *image; /* NULL: no view here; all of one size */
    const struct sst_map_u8 *seen; /* 0 where pixels do not count; NULL or without memory: all count */
    double bx, by;                 /* offset in spacings */
    struct sst_map_u16 *disp;      /* out, initialised here: 1/64 px above disp_min_px, dense */
    struct sst_map_u8 *cost;       /* out, initialised here: mean difference to the consensus, sum of R, G and B */
};

struct sst_planesweep {
    struct sst_planesweep_view *view; /* [views] */
    int views;
    double disp_min_px;
    int range;    /* whole pixels from there, at least 1 */
    size_t bytes; /* of the planes' consensus at most; 0: 3 GiB */
    int large;    /* pixels of a view from which on maps of half size come first; 0: 600000 */
    /* [views] maps of half size, dense, 1/64 px of theirs above disp_min_px / 2, that stand in for the first sweep;
     * NULL: none */
    const struct sst_map_u16 *start;
    int threads;
    const SST_ATOMIC(bool) * cancel; /* or NULL */
};

/**
 * Sweep planes of equal disparity through the scene (design.md, 5.7). For each plane and pixel of the scene one colour
 * is found that most views agree on; each view compares itself with it and chooses its plane. In a second sweep only
 * views vote that the first maps show to see the point, and paths along diagonals smooth the choice.
 *
 * The maps are the same bytes for any number of threads and every CPU level.
 * @return 0, -ENOMEM, -ECANCELED, -E2BIG (the consensus would need more than `bytes`, or a range over 249 px more
 * planes than there are)
 */
SST_MUST_CHECK int sst_planesweep(const struct sst_planesweep *in);

/**
 * Percent of a view's pixels, by samples, with colours that one view more shows at another disparity than at the map's:
 * of surfaces that the map misses, such as closed gaps.
 *
 * @param map   of views 1/scale as large, 1/64 px of theirs above disp_min_px / scale
 * @param percent  out; 0: too few samples
 * @return 0, -ENOMEM, -ECANCELED
 */
SST_MUST_CHECK int sst_planesweep_missed(const struct sst_planesweep *in, int view, const struct sst_map_u16 *map,
                                         int scale, double *percent);

#endif
