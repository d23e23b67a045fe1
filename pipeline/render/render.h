/* pipeline/render/render.h - synthetic-aperture pictures in which every ray is weighted by depth and label. */
#ifndef SST_PIPELINE_RENDER_RENDER_H
#define SST_PIPELINE_RENDER_RENDER_H

#include "pipeline/lightfield/lightfield.h"

SST_EXTERN_C_BEGIN

enum sst_render_method {
    SST_RENDER_REFOCUS = 0, /* plain refocusing: all rays weigh the same */
    SST_RENDER_SST = 1,     /* semantic see-through */
};

/** What depth range W_s gives a label (DESIGN: the paper's form per label can hurt). */
enum sst_label_range {
    SST_RANGE_OBJECT = 0,     /* of the connected object that the ray belongs to, robust percentiles; the default */
    SST_RANGE_PERCENTILE = 1, /* of the whole label, robust percentiles */
    SST_RANGE_MINMAX = 2,     /* of the whole label, exact minimum and maximum: the paper's form */
};

/** What a pixel that no ray supports becomes. */
enum sst_render_unsupported {
    SST_UNSUPPORTED_REFOCUS = 0, /* plain refocus value; the default */
    SST_UNSUPPORTED_INVALID = 1, /* black and 0 in the validity mask */
};

struct sst_render_config {
    enum sst_render_method method;
    double focus_px;        /* d_f, px per spacing */
    double sigma_px;        /* sigma_d > 0; infinity allowed */
    double c1, c2;          /* 0..1 */
    int focus_label;        /* 0: none */
    double label_factor;    /* weight of other labels is divided by this, >= 1 */
    enum sst_label_range range;
    double range_percentile;  /* share cut off at each end for the robust ranges, 0..0.5 */
    enum sst_render_unsupported unsupported;
    double aperture;        /* radius of the aperture in spacings around the viewpoint; infinity: all views */
    bool aperture_soft;     /* cosine fall-off towards the rim instead of a hard one */
    double view_bx, view_by; /* viewpoint, offset from the reference view */
    int max_views;          /* use at most this many views, nearest to the viewpoint first; 0: all */
    int threads;
};

void sst_render_config_defaults(struct sst_render_config *cfg);

/**
 * Depth weight, DESIGN 5.4: (1-C1) exp(-(d_f-d_r)^2 / 2 sigma^2) + C1.   Reference implementation in double.
 */
double sst_weight_depth(double focus_px, double disp_px, double sigma_px, double c1);

/** Semantic weight, DESIGN 5.4, with a range below quantum_px widened to it around its middle. */
double sst_weight_label(double focus_px, double range_min_px, double range_max_px, double quantum_px, double c2);

struct sst_renderer; /* precomputed label ranges of one light field; borrows it; any number of threads may render */

/** @return 0, -EINVAL (SST without disparity), -ENOMEM; logged. Ranges for all three kinds are computed when first needed. */
SST_MUST_CHECK int sst_renderer_create(struct sst_renderer **out, const struct sst_lightfield *lf, int threads);
void sst_renderer_destroy(struct sst_renderer *r);

/**
 * Render one picture of the light field's size.
 *
 * @param out    out, initialised by the caller to lf's size
 * @param valid  out, 255 where at least one ray supports the pixel, or NULL; initialised by the caller
 * @return 0, -ERANGE (focus outside -disparities far outside- what the light field holds, no view in the aperture), -EINVAL
 */
SST_MUST_CHECK int sst_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out,
                              struct sst_map_u8 *valid);

SST_EXTERN_C_END

#endif
