/* pipeline/method/render/render_internal.h - rays explained by their own disparity; the clear picture.
 *
 * Rays that a map assigns to an occluder may show it, or what is behind it: maps extend a rim over narrow gaps. A ray
 * is explained if at least half of the views around it show its colour at its own disparity. Those of a gap are not:
 * there the other views show other places of what is behind.
 *
 * Colours agree if they differ by less than 24 levels (sum of R, G, B), and more in noise: by less than three times the
 * lower quartile of the differences of all rays from the views around them.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_RENDER_INTERNAL_H
#define SST_PIPELINE_METHOD_RENDER_RENDER_INTERNAL_H

#include "pipeline/method/render/plan.h"
#include "pipeline/step/run.h"

struct explainer; /* of one plan; any number of threads may use it once prepared */

/** @return -ENOMEM (not logged) */
SST_MUST_CHECK int explainer_create(struct explainer **out, const struct sst_render_plan *p, struct sst_renderer *r);
void explainer_destroy(struct explainer *e);

/** Keep what is found out about pixels in the renderer, for other plans of the same views: the light field must not
 *  change any more. A byte for each pixel of all views; without memory nothing is kept. */
void explainer_keep(struct explainer *e);

/** Rectify raw frames and measure the noise, on the first call. @return 0 or -ENOMEM (not logged) */
SST_MUST_CHECK int explainer_prepare(struct explainer *e);

/** True if the pixel (x, y) of the view of tap k, whose disparity is known, is unexplained. */
bool explainer_contradicts(const struct explainer *e, int k, int x, int y);

/** Differences of colours that do not agree, once prepared; sum of R, G, B. */
int explainer_levels(const struct explainer *e);

/** A bound above all stored disparities of the views, unknown ones apart; of a light field that changes it counts noted
 * disparities alone.
 */
int explainer_bins(const struct explainer *e);

/** Disparities, in pixels, of rays whose stored disparity is above `nearest`. @return false: there are none */
bool explainer_reach(const struct explainer *e, int nearest, double *least_px, double *most_px);

#define EXPLAINER_AROUND 8 /* views around another at most */

/** A view around another: a point moves by bx, by pixels to it per pixel of disparity. */
struct explainer_near {
    float bx, by;
    int tap;
};

/** The views around that of tap k. @param out  [EXPLAINER_AROUND] @return their number */
int explainer_around(const struct explainer *e, int k, struct explainer_near *out);

/* --- frames.c: raw frames --- */

/** How frames are resampled. */
enum sst_filter render_frame_filter(const struct sst_lightfield *lf);

/** Set the frames of the plan's taps, and create their maps on first use. @return 0, -ENOMEM, -EINVAL; logged */
SST_MUST_CHECK int render_plan_frames(struct sst_render_plan *p, struct sst_renderer *r);

/** Make what the CPU needs of frames, if the plan has any and it is not there: samplers, or rectified views. @return 0,
 *  -ENOMEM, -EBADMSG (a frame cannot be decoded); logged */
SST_MUST_CHECK int render_need_frames(struct sst_render_plan *p, struct sst_renderer *r);
/** The same for one view. */
SST_MUST_CHECK int render_need_view(struct sst_renderer *r, int view);

/** Set `rectified` and `seen` of a frame with a sampler, under the renderer's lock. @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int render_rectify_frame(struct sst_renderer *r, int view);

/** As sst_render_plan_init(); with a runner render_need_frames() has to be called before the CPU has anything to do
 * with colours of views. */
SST_MUST_CHECK int render_plan_init_pending(struct sst_render_plan *p, struct sst_renderer *r,
                                            const struct sst_render_config *cfg);

/* --- pictures that a runner places
 * ------------------------------------------------------------------------------------- */

struct render_runner; /* user of a runner for one light field; any number of threads, one picture at a time */

/** NULL is fine. */
void render_runner_destroy(struct render_runner *d);

/** How the dispatches of a picture are cut. */
struct render_bands {
    int rows;   /* of a band: the whole picture, or fewer where memory lacks */
    bool split; /* of the views only rows are there */
};

/** Pixels x .. x + n of the rows from y on, n at most SST_BLEND_MAX, but for those left to votes.
 * @param weight  out, sums of weights @param support  out, or NULL */
struct render_picture;
typedef void render_rows_fn(const struct render_picture *pic, float (*weight)[SST_BLEND_MAX],
                            uint8_t (*support)[SST_BLEND_MAX], int x, int n, int y, int rows);

/** A picture: item of the steps that are no clear pictures. */
struct render_picture {
    struct sst_renderer *renderer;
    const struct sst_render_plan *plan;
    struct sst_render_plan *own; /* the same, if frames may be pending; else NULL */
    const uint8_t *cells;        /* [rows][cols] as of sst_render_plan_render(); NULL: all */
    int cols;
    struct sst_image *out;
    struct sst_map_u8 *valid;
    render_rows_fn *pixels; /* sums of rays, or results of dispatches */
    bool voted;             /* these have verified rays, too */
    /* of the dispatches */
    struct render_runner *runner;
    int top, end;              /* rows that have cells, top a multiple of SST_RENDER_CELL_HEIGHT */
    bool verify;               /* they verify rays, too */
    struct render_bands bands; /* that it begins with, and had memory for */
    const uint32_t *words;     /* their pixels: [height * width] */
    const float *weights;      /* [height * width] sums of weights, if rays are to be verified; else NULL */
    int err;                   /* of the CPU, after them */
};

/** Job of a step: a picture on the CPU. @param arg  struct render_picture [] @return 0, -ENOMEM, -EBADMSG */
int render_picture_on_cpu(void *arg, int item, int worker);

/** A picture of pic->pixels, with votes and support. @return 0, -ENOMEM */
SST_MUST_CHECK int render_picture_bands(struct render_picture *pic);

/** Let the renderer's runner render a picture, with pic->err. @return false: it is left to the CPU, which is counted,
 * and logged after a failure */
bool render_place(struct render_picture *pic);

/* --- skip.c ------------------------------------------------------------------------------------------------------- */

/** As sst_render_plan_render() of the whole picture, within the budget of p->cfg. @param done  out, false: next to
 * nothing can be left out, or rays are verified, and no picture was made: the exact one takes less time */
SST_MUST_CHECK int skip_render(struct sst_renderer *r, const struct sst_render_plan *p, struct sst_image *out,
                               struct sst_map_u8 *valid, bool *done);

/* --- render.c: sums of rays --------------------------------------------------------------------------------------- */

/** Destination of a view's rays: sums, or separate arrays. */
struct render_sink {
    float *acc[4];
    int32_t *sum[3];  /* plain rays: in place of acc[0..2] ... */
    float *count;     /* ... and of acc[3] */
    uint8_t *support; /* with acc: becomes 255 where a ray supports the pixel; NULL: not counted */
    const struct sst_render_samples *samples; /* NULL: acc */
    bool plain;                               /* weights are 1, whatever the maps: plans that sum, and skips */
    bool support_only;                        /* nothing is summed */
};

/** Pass one view's rays, pixels x .. x + n of row y; the sink begins at x. */
void render_add_view(const struct render_sink *s, const struct sst_render_plan *p, const struct sst_render_tap *t,
                     int x, int n, int y);

/** What the kernels will read of a view for pixels x .. x + n of row y, or NULL: the rows of all views are too many
 *  streams for the processor to follow. */
const struct sst_blend *render_read_ahead(struct sst_blend *b, const struct sst_render_plan *p,
                                          const struct sst_render_tap *t, int x, int n, int y, bool plain);

/** Recompute pixels whose weights underflowed in float; see SST_BLEND_FLOOR. */
void render_mend_row(const struct sst_render_plan *p, struct sst_image *out, const float *weight, int x, int n, int y);

/** Report which of n pixels of row y are supported, and mark the others if that is wanted. @param valid  or NULL */
void render_mark_row(const struct sst_render_plan *p, struct sst_image *out, struct sst_map_u8 *valid,
                     const uint8_t *support, int x, int n, int y);

#endif
