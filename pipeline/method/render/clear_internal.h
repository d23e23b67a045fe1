/* pipeline/method/render/clear_internal.h - the clear picture, all in focus, without the foreground (design.md, 5.6):
 * its definition.
 *
 * Surface: every view's kept rays go to the viewpoint by their own disparity; of the rays that arrive at a pixel, the
 * nearest group within 3/4 px wins that has at least 2 views and a quarter of all that arrive.
 * Colour: weighted mean over the rays that see that surface, the nearest views first. Rays next to something removed
 * mix its colour with theirs and count little; so do colours that differ from the mean. The viewpoint's own camera
 * replaces the mean where it sees the surface and agrees with it.
 * Holes: pixels of little weight are mixed with the mean of their surroundings (fill.c). What was removed is not part
 * of it, so they are filled from behind.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_CLEAR_INTERNAL_H
#define SST_PIPELINE_METHOD_RENDER_CLEAR_INTERNAL_H

#include "pipeline/kernels/kernels.h"
#include "pipeline/method/render/render_internal.h"
#include "pipeline/step/run.h"

/** Values of the validity plane. */
enum clear_valid { CLEAR_UNKNOWN = 0, CLEAR_FILLED = 64, CLEAR_SEEN = 255 };

/** As sst_render() for SST_RENDER_CLEAR; logged. @param valid  out, enum clear_valid, or NULL */
SST_MUST_CHECK int clear_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out,
                                struct sst_map_u8 *valid);

/** As sst_render_rays(): rays that end at the surface of one pixel. w_depth is the weight of the place (next to
 *  something removed: little), w_label that of the colour's agreement. No rays: a hole. */
SST_MUST_CHECK int clear_rays(struct sst_renderer *r, const struct sst_render_config *cfg, int x, int y,
                              struct sst_ray *rays);

/** Rays of one output pixel, of any thread. */
typedef void clear_pixel_fn(void *arg, int x, int y, const struct sst_ray *rays, int count);

/** Call pixel() for every pixel with the rays of clear_rays(), in no order, on all threads of the renderer. @return as
 * clear_render() */
SST_MUST_CHECK int clear_each(struct sst_renderer *r, const struct sst_render_config *cfg, clear_pixel_fn *pixel,
                              void *arg);

/* --- clear.c: a picture in work ----------------------------------------------------------------------------------- */

struct clear_view {
    const struct sst_render_tap *tap;
    struct sst_clear_view at;
    uint16_t *landed; /* [height][stride] of the picture: the nearest ray of each pixel */
};

/* Working memory of one thread. */
struct scratch {
    uint8_t *row[3], *state; /* [width + 2] removed pixels of three rows, in a ring; [width] enum sst_clear_state */
    const uint16_t **landed; /* [views] */
    int *view;               /* [slots] whose rays they are: index in struct clear */
    float surface[SST_CLEAR_BLOCK]; /* levels; 0: none */
    struct sst_clear_rays rays;
    struct sst_clear_colours out;
    int x, y, own; /* of the block; the slot of the camera at the viewpoint, -1: none */
};

/* Where the colours of a picture go. */
struct clear_target {
    struct sst_image *image;
    struct sst_map_u8 *weight;   /* of the picture's pixels: 255 is enough */
    struct sst_map_u16 *surface; /* with support as of struct sst_render_merge; NULL: not wanted */
    struct sst_map_u8 *support;
};

/** An item of the steps of clear pictures. */
struct clear {
    struct sst_renderer *renderer;
    const struct sst_lightfield *lf; /* NULL: no picture */
    const struct sst_render_config *cfg;
    struct sst_render_plan plan; /* views and frames */
    int threads;
    int width, height, bins, cut_q6; /* bins: stored disparities are below; cut: disparities above are removed */
    int coarse;                      /* of struct sst_clear_view */
    size_t stride;                   /* of landed, elements: whole blocks */
    bool as_others;                  /* the camera at the viewpoint counts as the others do: it has too much noise */
    bool sampled;                    /* rays of some views are sampled from frames */
    int count;
    struct clear_view view[SST_MAX_VIEWS]; /* nearest to the viewpoint first */
    struct scratch *scratch;               /* [threads] */
    struct clear_target to;
    bool filled;            /* the holes are, too */
    struct landed *landed;  /* the renderer's, from one picture to the next; owned meanwhile */
    const uint64_t *change; /* [cells] of landed; NULL: all cells are coloured */
    const struct sst_kernels *kernels;
    void *rows;  /* owned: scratch */
    bool placed; /* dispatches of the runner have coloured it */
    /* of these */
    struct render_runner *runner;
    struct render_bands bands; /* that it begins with, and had memory for */
    bool fills;                /* holes are filled with the picture */
};

#define CLEAR_ENOUGH 16 /* rays of full weight for one pixel: the nearest views are the sharpest */

/** Views, limits and frames of a picture. @return as clear_render(). clear_fini() follows in either case */
SST_MUST_CHECK int clear_init(struct clear *c, struct sst_renderer *r, const struct sst_render_config *cfg);
void clear_fini(struct clear *c);

/** Definitions of the steps: `job` is an array of struct clear; with `filled` holes are filled, too.
 * @return 0, -ENOMEM, -EBADMSG (a frame; logged) */
int clear_colour(void *job, int item, int worker);
int clear_fill_picture(void *job, int item, int worker);

/* --- fill.c: holes ------------------------------------------------------------------------------------------------ */

/**
 * Mix every pixel with the mean of its surroundings, as far as its weight is below 255: a pyramid of weighted means,
 * each level as far as the finer one lacks weight.   Source: Gortler 1996, pull-push.
 *
 * @param weight  in, 0..255
 * @param levels  in, working memory of clear_fill_bytes() bytes
 */
SST_MUST_CHECK int clear_fill(struct sst_image *img, const struct sst_map_u8 *weight, void *levels, int threads);
size_t clear_fill_bytes(int width, int height);

/* --- landed.c: rays at the viewpoint, kept from one picture to the next ------------------------------------------- */

/**
 * Send all rays of all views to the viewpoint, or only the rays that may land elsewhere than in the renderer's last
 * picture (see struct sst_render_kept). Sets c->landed, the views' landed rays and c->change.
 *
 * @return 0 or -ENOMEM (not logged). c->landed has to be given back with landed_give_back() in either case.
 */
SST_MUST_CHECK int landed_make(struct clear *c);
void landed_give_back(struct clear *c);
void landed_destroy(struct landed *l);

/** Pixels of the cells of 64x8 px that are coloured. */
int64_t landed_coloured_px(const struct clear *c);
bool landed_colours(const struct clear *c, int x, int y);
/** Is this picture continued by the next one? */
bool landed_kept(const struct clear *c);

/** Working memory of clear_fill(), kept from picture to picture. @param c  with rays that landed @return NULL: no memory */
void *landed_levels(const struct clear *c, size_t bytes);

/* --- pictures that a runner places -------------------------------------------------------------------------------- */

/** Let the renderer's runner colour a picture: c->to and c->filled are set. @return false: it is left to the CPU, which
 * is counted, and logged after a failure */
bool clear_place(struct clear *c);

/** Let it fill the holes of a picture that it has coloured. @return false: not done, which is counted */
bool clear_place_fill(struct clear *c);

#endif
