/* pipeline/posed/find/find_internal.h - private to searches: scores of each view's picture. */
#ifndef SST_PIPELINE_POSED_FIND_FIND_INTERNAL_H
#define SST_PIPELINE_POSED_FIND_FIND_INTERNAL_H

#include "pipeline/posed/find/find.h"

/* --- scores: values beside their surroundings --------------------------------------------------------------------- */

struct find_score_config {
    int reach;        /* px: windows have sides of 2 reach + 1 */
    double cut;       /* spreads: values beyond are cut before mean and spread are taken again */
    int rounds;       /* how often they are taken; 1: nothing is cut */
    double least;     /* smallest spread, as a share of the median of all spreads */
    double smooth_px; /* standard deviation of a Gaussian on the values; 0: none */
};

/** Windows of 63 pixels, values cut at 2.5 spreads, taken three times. */
struct find_score_config find_score_defaults(void);

/**
 * Score of each pixel: (value - mean) / spread of the valid pixels in a window around it. Values that stand out are cut
 * before mean and spread are taken again: persons who stand together would otherwise hide each other.
 *
 * @param score  out, initialised here; NAN where `value` is NAN, and everywhere if no spread is above 0
 * @param value  NAN: not valid
 * @return 0, -EINVAL (reach or rounds below 1; not logged), -ENOMEM
 */
SST_MUST_CHECK int find_score(struct sst_map_f32 *score, const struct sst_map_f32 *value,
                              const struct find_score_config *cfg, int threads);

struct find_blob_config {
    double seed;           /* a blob has a pixel of at least this score ... */
    double grow;           /* ... and all connected ones of at least grow * seed */
    int close_px;          /* gaps up to this separate no blobs; 1: none */
    int least_px, most_px; /* pixels of a blob */
};

/**
 * Connected pixels (8 neighbours) of high score, opened by 3x3, the highest first.
 * @param sign  1: high scores; -1: low ones
 * @param blob  out, [count], to be freed by the caller @return 0, -ENOMEM
 */
SST_MUST_CHECK int find_blobs(struct sst_blob **blob, int *count, const struct sst_map_f32 *score, int sign,
                              const struct find_blob_config *cfg);

/* --- scores of single pictures -------------------------------------------------------------------------------------
 */

/* Scores as levels of 16 bits, so that they are integrated as pictures are. */
#define SCORE_STEPS  1000 /* levels a spread */
#define SCORE_LOWEST 4    /* spreads below the mean are level 0 */

/** Levels of a view less their median, around FIND_MIDDLE: thermal cameras drift from picture to picture. */
#define FIND_MIDDLE 32768
SST_MUST_CHECK int find_centred(struct sst_deep *out, const struct sst_deep *picture);

/** Local scores of a picture of one channel. @param reach  px of its window */
SST_MUST_CHECK int find_local_scores(struct sst_deep *out, const struct sst_deep *picture, int sign, int reach);

/** Reed-Xiaoli scores: Mahalanobis distance of each colour from the picture's own, outliers cut,
 * then smoothed. @param reach  px of the means; 0: none */
SST_MUST_CHECK int find_colour_scores(struct sst_deep *out, const struct sst_deep *picture, int reach);

#endif
