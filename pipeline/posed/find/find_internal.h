/* pipeline/posed/find/find_internal.h - private to searches: scores of each view's picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
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

/* --- a search of one moment --------------------------------------------------------------------------------------- */

#define FIND_GROW    0.5 /* of the threshold: pixels that belong to a find */
#define FIND_CLOSE_M 0.5 /* gaps between parts of a person */
#define FIND_SHOWN   2.0 /* spreads by which a view shows a find */

struct find_search {
    const struct sst_posed *posed;
    const char *dir;
    const struct sst_virtual *camera;
    const struct sst_surface *surface;
    const struct sst_find_config *cfg;
    enum sst_find_by by;
    int threads, reach; /* px of the virtual picture */
    double pixel_m, threshold;
    size_t kept_bytes;        /* of views' scores */
    struct sst_deep *scores;  /* [views], of placed ones that are kept: score levels in the view's pixels */
    struct sst_integral *one; /* of one view at a time */
    struct sst_finds *maps;
};

/** A search that has not begun; `out` is initialised. find_search_end() frees its parts but `out`. */
struct find_search find_search_of(struct sst_finds *out, const struct sst_find_scene *scene,
                                  const struct sst_find_config *cfg);

/** Integral, scores and hectares into s->maps. @return as sst_posed_find(), not logged where find_search_end() logs */
SST_MUST_CHECK int find_maps(struct find_search *s);

/** Free, and log errors that have no words yet. @return err, as callers of searches see it */
int find_search_end(struct find_search *s, int err);

/** The threshold for s->maps->score, and the false finds that are expected at it, into s and s->maps. @return 0, -ENOMEM */
SST_MUST_CHECK int find_choose_threshold(struct find_search *s);

/** Scores of a view on the surface; NAN where it shows nothing of it. @return 0, -ENOMEM, or as sst_posed_picture() */
SST_MUST_CHECK int find_resample(struct find_search *s, struct sst_map_f32 *out, int k);

/** Limits of blobs in a map with pixels of a size. */
struct find_blob_config find_blob_sizes(const struct sst_find_config *cfg, double threshold, double pixel_m);

/** Place of a pixel on the surface. @return false: it has none */
bool find_place(const struct sst_virtual *camera, const struct sst_surface *surface, double x, double y,
                double at_mm[3]);

/** Degrees of a place; NAN where places are not geographic, or it is NAN. */
void find_geographic(const struct sst_posed *posed, const double at_mm[3], double *latitude, double *longitude);

/** Pixel of a place in a view. @return false: no view (below 0), or no place */
bool find_in_view(const struct sst_posed *posed, int view, const double at_mm[3], double px[2]);

/** True if as many views of the `seen` that look show a find as it needs. */
bool find_shown(const struct sst_find_config *cfg, int views, int seen);

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

/* --- one lens of all views, by places on a plane --------------------------------------------------------------------- */

struct lens_sight {
    int view, place;
    double x, y;   /* px */
    double weight; /* 0 to 1 */
};

/** Views that see places on a plane, and the fit. */
struct lens_fit {
    int views, places, sights;
    struct sst_calib_camera *camera; /* [views] in and out: rotations. Lenses stay */
    const double (*given)[9];        /* [views] rotations of the prior */
    double sigma_rad;                /* of each axis of these */
    double (*place_mm)[3];           /* [places] in and out */
    const struct lens_sight *sight;  /* [sights] */
    double normal[3], across[2][3];  /* of the plane without slopes, unit vectors */
    double pivot_mm[3];              /* where slopes turn it */
    bool free_lens;                  /* k1 and the focal length, or where the plane moves, its distance in its place */
    bool plane_moves;

    double focal, k1; /* in and out: the lens before each view's own, as sst_camera_adjust() */
    double slope[2];  /* in and out: tangents; the normal is the one without slopes, plus slope times across */
    double raise_mm;  /* out: of the plane, along its normal */
    double chi2;      /* out: of the lens against none, in squares of standard errors, which views and places show */
    double median_px; /* out: of the sights */
};

/** Fit rotations, places and the lens to the sights, by a robust loss of 1 px. @return 0, -EDOM (they do not fit),
 * -ENOMEM; not logged */
SST_MUST_CHECK int lens_fit(struct lens_fit *fit);

#endif
