/* pipeline/method/render/render.h - synthetic-aperture pictures in which every ray is weighted by depth and label. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_RENDER_H
#define SST_PIPELINE_METHOD_RENDER_RENDER_H

#include "pipeline/lightfield/lightfield.h"
#include "pipeline/lightfield/rectify/rectify.h"

enum sst_render_method {
    SST_RENDER_REFOCUS = 0, /* plain refocusing: all rays weigh the same */
    SST_RENDER_SST = 1,     /* semantic see-through */
    SST_RENDER_CLEAR = 2,   /* all in focus, without what stands in front (design.md, 5.6) */
};

/** Depth range that W_s uses for a label (docs/design/design.md, 5.4: the paper's form per label can hurt). */
enum sst_label_range {
    SST_RANGE_OBJECT = 0,     /* of the ray's object: pixels of one label whose disparities, over all views, are not
                                 separated by a gap or deep valley of the histogram; robust percentiles; the default */
    SST_RANGE_PERCENTILE = 1, /* of the whole label, robust percentiles */
    SST_RANGE_MINMAX = 2,     /* of the whole label, exact minimum and maximum: the paper's form */
};

/** Value of a pixel that no ray supports (design.md, 5.4). */
enum sst_render_unsupported {
    SST_UNSUPPORTED_REFOCUS = 0, /* weighted mean all the same; plain refocus value if all weights are 0; default */
    SST_UNSUPPORTED_INVALID = 1, /* black and 0 in the validity mask */
};

/** Where rays are weighted by the agreement of their colours at the focus, not by the maps alone (verify.h). */
enum sst_render_verify {
    SST_VERIFY_OFF = 0,
    SST_VERIFY_ON = 1,   /* wherever the maps assign hardly any ray to the focus */
    SST_VERIFY_AUTO = 2, /* there, but only where other views contradict the maps. Trusted are disparities that matching
                            tested against other views, and those without a confidence, which are external; the default */
};

/** SST_RENDER_CLEAR: a step between colouring what is seen and filling the holes, as of a memory over time. */
#define SST_RENDER_SUPPORT 8 /* of struct sst_render_merge: value of one ray */
struct sst_render_kept;
struct sst_render_merge {
    /** @param img     in, out, undefined where the weight is 0
     *  @param weight  in, out, 255: seen; less: mixed with the mean of the surroundings as far as it lacks */
    int (*merge)(void *arg, struct sst_image *img, struct sst_map_u8 *weight);
    void *arg;
    struct sst_map_u16
        *surface;               /* out, stored disparity of the surface; SST_DISP_NONE: a hole; of the picture's size */
    struct sst_map_u8 *support; /* out, rays that agree on the colour, times SST_RENDER_SUPPORT, at most 255 */
    struct sst_render_kept *kept; /* NULL: the whole picture is computed */
    bool unseen; /* nothing is seen by the maps, as they are of earlier pictures: all weights are 0, and nothing is kept */
};

/**
 * The last clear picture before its merge, of a light field that changes in tiles: only what changed is computed, with
 * the bytes of a whole picture. One for each picture, zeroed at first; sst_render_kept_fini() ends it.
 */
struct sst_render_kept {
    /* in, of the light field as it is */
    uint64_t *const *stamp;         /* [views] of [tile_rows][tile_cols]: serial number of a tile's last change */
    int tile, tile_cols, tile_rows; /* px of a tile's side; tiles */
    uint64_t serial;                /* of the last change, at least 1 */
    uint64_t since;                 /* another value: everything changed (views came or left) */
    /* out: pixels whose colours were computed */
    int64_t coloured_px;
    /* the renderer's */
    uint64_t id, coloured;
    struct sst_image image;
    struct sst_map_u8 weight, support;
    struct sst_map_u16 surface;
};
void sst_render_kept_fini(struct sst_render_kept *kept);

struct sst_render_config {
    enum sst_render_method method;
    double focus_px;     /* d_f, px per spacing */
    double sigma_px;     /* sigma_d, at least 1e-6; infinity allowed; 0: 1/10 of the disparity range, at least 0.1 */
    double c1, c2;       /* 0..1 */
    int focus_label;     /* 0: none */
    double label_factor; /* weight of other labels is divided by this, >= 1 */
    enum sst_label_range range;
    double range_percentile; /* fraction cut off at each end of the robust ranges, 0..0.5 */
    double range_margin_px;  /* SST_RANGE_OBJECT: added at each end, so that noise cannot exclude the target; negative:
                                1/50 of the disparity range */
    enum sst_render_unsupported unsupported;
    double aperture;               /* radius of the aperture in spacings around the viewpoint; infinity: all views */
    bool aperture_soft;            /* cosine fall-off towards the rim instead of a hard one */
    double view_bx, view_by;       /* viewpoint, offset from the reference view */
    enum sst_render_verify verify; /* not in plain refocusing */
    int max_views;                 /* use at most this many views, nearest to the viewpoint first; 0: all */
    /* SST_RENDER_CLEAR: what is removed. Focus, weights and verification have no effect there. */
    double cut_px;                   /* what is nearer, px per spacing; infinity: nothing */
    int remove_label;                /* what has this label; 0: none */
    const struct sst_map_u8 *remove; /* pixels that are not 0, [rows * cols] maps of the views' size, borrowed; an empty
                                        map: none of that view; NULL: none. See sst_render_grow_object() */
    int rays;                        /* of full weight that make up a pixel, the nearest views first; 0: 16 */
    const struct sst_render_merge *merge; /* borrowed; NULL: none */
    /* Skips (design.md, 5.5), not with a runner, not where rays are verified, and not of clear pictures, which stop at
     * `rays` anyway. */
    bool skip_rays;       /* S2: a tile has fewer views, or no weights, if that changes its sampled rows little */
    double skip_error_db; /* least PSNR against the exact picture, 20..100; estimated from sampled rows */
    int threads;
};

/** Best measured values on the simulated scenes: sharp on the target and robust to matching errors. */
void sst_render_config_defaults(struct sst_render_config *cfg);

/**
 * Depth weight, design.md, 5.4: (1-C1) exp(-(d_f-d_r)^2 / 2 sigma^2) + C1.   Reference implementation in double.
 * A ray of unknown disparity (NaN) has weight C1, like one far from the focus; 1 if sigma is infinite.
 */
double sst_weight_depth(double focus_px, double disp_px, double sigma_px, double c1);

/** Semantic weight, design.md, 5.4, with a range below quantum_px widened to it around its middle. */
double sst_weight_label(double focus_px, double range_min_px, double range_max_px, double quantum_px, double c2);

struct sst_renderer; /* label ranges of one light field, computed on first use; any number of threads may render */

/**
 * Borrows lf, which must not change while the renderer lives.
 *
 * Where lf's images are raw frames (images_raw) the colour of each ray is sampled from its frame at the exact position
 * by lf's filter, photometrically corrected: one interpolation instead of two; likewise, by Lanczos, where corrected
 * pictures have their originals (SST_LOAD_ORIGINALS). Disparity and labels are always those of
 * the rectified views. A frame's sampler is created on first use and kept: 4/3 of the frame's memory.
 *
 * @return 0, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_renderer_create(struct sst_renderer **out, const struct sst_lightfield *lf, int threads);
void sst_renderer_destroy(struct sst_renderer *r);

/**
 * Of a light field of raw frames (images_raw): rays are of rectified views from now on, with the pictures of the same
 * light field loaded without SST_LOAD_RAW. Shaders rectify on their own, encoded frames (SST_LOAD_ENCODED) without a copy
 * between; the CPU does where it needs colours of views, once. Not for rays that are verified: colours are counted in the frames.
 *
 * @return 0, -EINVAL (no raw frames), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_renderer_use_rectified(struct sst_renderer *r);

/** Counters of skip_rays since the renderer was created. Shares are of all rays, 0..1. */
struct sst_render_skip_report {
    int64_t pictures;    /* rendered with it */
    double rays_skipped; /* not summed */
    double rays_even;    /* summed without their weights */
    int64_t sampled;     /* pixels that were rendered exactly as well, in one row of every 8th tile; these rows are not
                            those that decided */
    double error_levels; /* root mean square of their difference, grey levels; NaN: none */
    double error_db;     /* the same as PSNR; infinity: no difference */
};

/** @return false: no picture was rendered with a skip */
bool sst_renderer_skips(struct sst_renderer *r, struct sst_render_skip_report *out);

/**
 * True if sampling raw frames (SST_LOAD_RAW) or originals (SST_LOAD_ORIGINALS) costs no more than rectifying them
 * first, and of clear pictures from originals, which take twice the time and are sharper by up to 3 dB.
 *
 * Resampling dominates both: raw frames are resampled for every picture and view of its aperture; rectification
 * resamples all views of the light field once, on loading. Summing the rays costs the same. So raw frames win if
 * pictures * views <= views of the light field; in a tie because one interpolation is sharper than two.
 *
 * @param lf  images need not be loaded; false without a calibration or a correction
 */
bool sst_render_prefers_raw(const struct sst_lightfield *lf, const struct sst_render_config *cfg, int pictures);

/** Fraction of the disparities that another view confirms; NaN: unknown (external maps, or confidence not loaded). */
double sst_renderer_confirmed(struct sst_renderer *r);

/** Smallest and largest disparity: of the maps and of the light field's expected range. False: neither is known. */
bool sst_renderer_disparities(struct sst_renderer *r, double *min_px, double *max_px);

/** Labels that occur in any view, ascending; returns their number. @param label  out, [255] */
int sst_renderer_labels(struct sst_renderer *r, int label[255]);

/**
 * Render one picture of the light field's size.
 *
 * Colour is bilinear; a ray is ignored unless all its taps lie inside its view, and inside the part of it that its raw
 * frame covers; shifts within 1e-6 px of a whole number are whole. Weights that underflow in float are recomputed with
 * the largest exponent subtracted. Unknown disparity: see sst_weight_depth(); no label, or a label that has no
 * disparity anywhere: W_s = 1.
 *
 * @param out    out, initialised by the caller to lf's size
 * @param valid  out, 255 where at least one ray supports the pixel (design.md, 5.4), else 0, or NULL; initialised by
 *               the caller. SST_RENDER_CLEAR: 255 seen, 64 filled from the surroundings, 0 unknown: no view shows
 *               anything
 * @return 0, -ERANGE (focus outside the disparities of the light field by more than a tenth of their range plus a
 * pixel, or so large that the views do not overlap; no view in the aperture; CLEAR: viewpoint outside the views),
 * -EINVAL (a value of cfg, sizes), -ENODATA (SST or CLEAR without disparity in some view used), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out,
                              struct sst_map_u8 *valid);

/** Gap in the disparities of all views, between the foreground and the rest; px per spacing. */
struct sst_render_gap {
    double far_px, near_px; /* its ends: the rest is farther, the foreground nearer */
    double emptiest_px;     /* middle of its emptiest part */
};

/**
 * Find the widest gap.
 *
 * @param visitor  fraction of the rays: a gap that so many rays divide is the part nearer than they are. 0: none
 * @param gap      out; untouched on failure
 * @return as sst_render_find_cut()
 */
SST_MUST_CHECK int sst_render_find_gap(struct sst_renderer *r, double visitor, struct sst_render_gap *gap);

/**
 * Find the cut between the foreground and the rest of a still scene: the middle of the emptiest part of
 * sst_render_find_gap(), where wrong disparities are fewest. Live pictures cut at the near end (live/cut.c).
 *
 * @param cut_px  out, px per spacing; untouched on failure
 * @return 0, -ENODATA (no gap: everything in one depth, or spread without one; no disparities; not logged), -ENOMEM
 * (logged)
 */
SST_MUST_CHECK int sst_render_find_cut(struct sst_renderer *r, double *cut_px);

/**
 * Mark the object at a pixel of the reference view in all views: pixels connected with it by nearly the same disparity
 * and colour, then those of the other views that show the same surface or continue it where the reference view is
 * covered.
 *
 * @param mask  out, [rows * cols] initialised here to 0 or 255; to free one by one, also on failure
 * @param lf    images and disparities loaded, not as raw frames
 * @return 0, -ERANGE (pixel outside the view), -ENODATA (no disparity there, or in a view), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_render_grow_object(struct sst_map_u8 *mask, const struct sst_lightfield *lf, int x, int y,
                                          int threads);

/** The same for an object whose pixels in view `view` are known. @param region  in, not 0: object */
SST_MUST_CHECK int sst_render_carry_object(struct sst_map_u8 *mask, const struct sst_lightfield *lf, int view,
                                           const struct sst_map_u8 *region, int threads);

/** @param d  out, disparity of a pixel, px; NAN: @return false: it is unknown */
bool sst_render_disparity_at(const struct sst_lightfield *lf, int view, int x, int y, double *d);

/** True if two neighbouring pixels of a view belong to one object: nearly the same disparity and colour. */
bool sst_render_joined(const struct sst_lightfield *lf, int view, const int a[2], const int b[2]);

/** True if a pixel shows the ground, level and nearer from row to row: objects that stand on it end there. */
bool sst_render_is_ground(const struct sst_lightfield *lf, int view, int x, int y);

/** One ray of one output pixel. */
struct sst_ray {
    int view;
    double x, y;    /* position in the view */
    double disp_px; /* NaN: unknown */
    int label;
    double aperture, w_depth, w_label; /* w_label includes the factor of the focus label */
    double share;     /* fraction of the pixel's colour from this ray; the shares of all rays sum to 1, or are all 0 */
    double colour[3]; /* 0..255 */
};

/**
 * The rays of one output pixel and their weights, in double.
 *
 * @param rays  out, [SST_MAX_VIEWS] those inside their views
 * @return their number; errors as of sst_render(), and -ERANGE where the pixel is outside the picture (logged).
 */
SST_MUST_CHECK int sst_render_rays(struct sst_renderer *r, const struct sst_render_config *cfg, int x, int y,
                                   struct sst_ray *rays);

/**
 * Make the 16-bit picture of one of 8 bits: the mean of the rays' samples by their shares, where it is within a level of that one.
 * Elsewhere (filled holes, verified rays) the pixel is that one's, in samples. The same bytes for any number of threads.
 *
 * @param out     [3], initialised by the caller
 * @param image   sst_render() with cfg of lf, whose views are neither corrected nor rectified
 * @param deep    [rows * cols][3] samples of the views
 * @param coarse  out, pixels that have the 8-bit picture's value
 * @return as sst_render()
 */
SST_MUST_CHECK int sst_render_deep(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_map_u16 out[3],
                                   const struct sst_image *image, const struct sst_map_u16 (*deep)[3], int64_t *coarse);

/** W_d and W_s of every pixel of one view. @param w_depth, w_label  out, initialised by the caller @return as above */
SST_MUST_CHECK int sst_render_weights(struct sst_renderer *r, const struct sst_render_config *cfg, int view,
                                      struct sst_map_f32 *w_depth, struct sst_map_f32 *w_label);

#endif
