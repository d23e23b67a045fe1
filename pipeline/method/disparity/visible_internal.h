/* pipeline/method/disparity/visible_internal.h - the second pass over the views of a light field, of which the sweep
 * (sweep.c) and the tests of hypotheses (surfaces.c) are steps. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_VISIBLE_INTERNAL_H
#define SST_PIPELINE_METHOD_DISPARITY_VISIBLE_INTERNAL_H

#include "pipeline/method/disparity/disparity_internal.h"

#define VISIBLE_CHANGE       40 /* penalty of a disparity other than the first pass's */
#define VISIBLE_CHEAP        96 /* cost of a disparity that needs no other to be tested, if hypotheses are skipped */
#define VISIBLE_SAMPLED_ROWS 64 /* one in this many is tested whole, to measure what skipped hypotheses change */

/** Pixels of a view with depth codes, and a margin. */
struct visible_packed {
    uint32_t *memory, *pixels; /* pixels: (0, 0) */
    ptrdiff_t stride;
    int similar; /* levels, by the picture's noise */
};

#define HYPOTHESIS_STRIP 128 /* columns that are tested together */

/** Hypotheses of a view. Pixels that have a choice are listed strip by strip, and in a strip row by row. */
struct hypothesis_lists {
    int width, height;
    uint8_t *count;                    /* [height][width]; 1: nothing is to choose, 0: nothing is known */
    uint16_t *first;                   /* [height][width] the first one of each pixel */
    int *start;                        /* [strips][height] entries before a row of a strip, and their number in all */
    uint16_t *column;                  /* [entries] */
    uint16_t *hypothesis, *cost, *sum; /* [entries][SST_HYPOTHESES] */
    uint16_t *line[2];                 /* paths of two rows of a strip */
};

/** Hypotheses of pixels of a row, and their costs, [n][SST_HYPOTHESES]. */
struct hypothesis_part {
    const uint16_t *hypothesis, *cost;
    const uint8_t *count;
    int left, y, n;
};

/** Memory of a thread, used for one view after the other. */
struct visible_scratch {
    struct hypothesis_lists lists;
    struct sst_around around;
};

/** See struct sst_disparity_report. */
struct visible_counted {
    int64_t hypotheses, skipped, samples, changed;
};

struct visible_pass {
    const struct sst_visible_views *in;
    int threads;
    uint8_t *code;                 /* [65536], see struct sst_hypothesis_test */
    struct visible_packed *view;   /* [in->count] */
    struct sst_map_u16 *out;       /* [in->count] of a round, as the next one */
    struct sst_map_u8 *confidence; /* [in->count] */
    struct sst_hypothesis_penalty penalty;
    struct visible_scratch *scratch; /* [threads + 1]: the last one for work that the runner places */
    struct sst_sweeps sweeps;
    int *swept;                           /* [sweeps.count] these views */
    struct visible_counted *counted, all; /* [in->count] of a round; of all rounds and views */
    struct disparity_sample *sample;      /* that these are of; or NULL */
};

/** Prepare a pass: pictures, depth codes, views that are swept. @param p  in and threads are set, the rest is 0
 * @return 0, -ENOMEM; visible_pass_fini() frees all, also after a failure */
SST_MUST_CHECK int visible_pass_init(struct visible_pass *p);
void visible_pass_fini(struct visible_pass *p);

/** Write the depth codes of all maps as they are now into the pictures. @return 0, -ENOMEM */
SST_MUST_CHECK int visible_pass_code(struct visible_pass *p);

/** A pass over a sample, for sst_step_check(). @return NULL: no memory */
struct visible_pass *visible_sample(uint32_t seed);
void visible_sample_free(void *pass);

/** Tests of view k. @param nearest  out [views]: the views that it is tested against */
void visible_set_test(struct sst_hypothesis_test *t, const struct visible_pass *p, int k, int views, int *nearest);

/** Views that hypotheses are tested against, and all disparities of a sparse pixel. In foliage, farther views see more
 * through the gaps than the nearest views. */
static inline int visible_views(const struct sst_visible_views *in)
{
    return in->swept ? 16 : in->smooth ? 20 : SST_HYPOTHESIS_VIEWS;
}

static inline int visible_sweep_views(const struct sst_visible_views *in)
{
    return in->smooth ? 12 : SST_HYPOTHESIS_VIEWS;
}

/** Functions of steps over the pass. */
void visible_pass_source(const void *pass, int k, struct sst_plane_source *out);

/** The largest disparity with a depth code of its own. */
unsigned visible_most(const struct sst_visible_views *in);

/** Points of the views that are swept. @return 0, -ENOMEM, -ECANCELED */
SST_MUST_CHECK int visible_sweep(struct visible_pass *p, struct sst_runner_user *user);

/** A round of tests. @return 0, -ENOMEM, -ECANCELED */
SST_MUST_CHECK int visible_test(struct visible_pass *p, struct sst_runner_user *user);

/* --- surfaces.c --- */

/** A view in work. */
struct visible_tested {
    struct visible_pass *p;
    int k;
    const struct sst_visible_view *view;
    struct hypothesis_lists *lists;
    struct sst_around *around;
    struct sst_hypothesis_test test;
};

/** Maps of view k, with the confidences that it has, and scratch. @return 0, -ENOMEM */
SST_MUST_CHECK int visible_begin(struct visible_tested *t, struct visible_pass *p, int k,
                                 struct visible_scratch *scratch);

bool visible_counts_skipped(const struct visible_pass *p);

/** Count hypotheses that skipping left out, and measure in some rows how many choices change.
 * @param part    of at most HYPOTHESIS_STRIP pixels, hypotheses of sampled rows; without costs: as chosen
 * @param chosen  [n] of each pixel: number of its hypothesis << 25, left out << 28; NULL: by the costs */
void visible_count_skipped(const struct visible_tested *t, const struct hypothesis_part *part, const uint32_t *chosen);

/* --- hypotheses.c --- */

/** Lists of this size, of any content. @return 0, -ENOMEM; hypothesis_lists_fini() frees them, also after a failure */
SST_MUST_CHECK int hypothesis_lists_init(struct hypothesis_lists *l, int width, int height);
void hypothesis_lists_fini(struct hypothesis_lists *l);

/** Add the next row of a strip: the pixels whose first hypothesis costs `settled` or more have a choice. */
void hypothesis_lists_add(struct hypothesis_lists *l, const struct hypothesis_part *part, unsigned settled);

/** The two paths along row y, added to the sums. */
void hypothesis_paths_along(struct hypothesis_lists *l, const struct sst_hypothesis_penalty *penalty,
                            const struct sst_packed_view *view, int y);

/** The paths from above and from below through a strip, added to the sums. */
void hypothesis_paths_down(struct hypothesis_lists *l, const struct sst_hypothesis_penalty *penalty,
                           const struct sst_packed_view *view, int strip);

/** The cheapest hypothesis of each pixel of row y; where it is not the pixel's own disparity, the confidence is the
 *  distance to the next. */
void hypothesis_choose_row(const struct hypothesis_lists *l, int y, uint16_t *disp, uint8_t *confidence);

#endif
