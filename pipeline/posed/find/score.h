/* pipeline/posed/find/score.h - how far a picture's values stand out from what is around, and the blobs that do. */
#ifndef SST_PIPELINE_POSED_FIND_SCORE_H
#define SST_PIPELINE_POSED_FIND_SCORE_H

#include "pipeline/image/image.h"

struct sst_score_config {
    int reach;        /* px: windows have sides of 2 reach + 1 */
    double cut;       /* spreads: values beyond are cut before mean and spread are taken again */
    int rounds;       /* how often they are taken; 1: nothing is cut */
    double least;     /* smallest spread, as a share of the median of all spreads */
    double smooth_px; /* standard deviation of a Gaussian on the values; 0: none */
};

/** Windows of 63 pixels, values cut at 2.5 spreads, taken three times. */
struct sst_score_config sst_score_defaults(void);

/**
 * Score of each pixel: (value - mean) / spread of the valid pixels in a window around it. Values that stand out are cut
 * before mean and spread are taken again: what stands together would otherwise hide itself.
 *
 * @param score  out, initialised here; NAN where `value` is NAN, and everywhere if no spread is above 0
 * @param value  NAN: not valid
 * @return 0, -EINVAL (reach or rounds below 1; not logged), -ENOMEM
 */
SST_MUST_CHECK int sst_score(struct sst_map_f32 *score, const struct sst_map_f32 *value,
                             const struct sst_score_config *cfg, int threads);

struct sst_blob_config {
    double seed;           /* a blob has a pixel of at least this score ... */
    double grow;           /* ... and all connected ones of at least grow * seed */
    int close_px;          /* gaps up to this are closed; odd, 1: none */
    int least_px, most_px; /* pixels of a blob */
};

struct sst_blob {
    struct sst_rect box; /* x1, y1: behind the last pixel */
    double x, y;         /* middle, weighted by the score */
    double score;        /* largest */
    int pixels;
};

/**
 * Connected pixels (8 neighbours) whose score is high, opened by 3x3 and closed, the highest first.
 * @param sign  1: high scores; -1: low ones
 * @param blob  out, [count], to be freed by the caller @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_score_blobs(struct sst_blob **blob, int *count, const struct sst_map_f32 *score, int sign,
                                   const struct sst_blob_config *cfg);

#endif
