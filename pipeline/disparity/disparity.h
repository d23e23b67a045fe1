/* pipeline/disparity/disparity.h - dense disparity of every view, and of one rectified pair. */
#ifndef SST_PIPELINE_DISPARITY_DISPARITY_H
#define SST_PIPELINE_DISPARITY_DISPARITY_H

#include "pipeline/lightfield/lightfield.h"

SST_EXTERN_C_BEGIN

enum sst_cost {
    SST_COST_CENSUS = 0,
    SST_COST_MCCNN = 1,
};

struct sst_disparity_config {
    double disp_min_px, disp_max_px; /* searched, inclusive; max > min; at most 512 steps of one pixel */
    enum sst_cost cost;
    const char *model;      /* ONNX of the MC-CNN features; used with SST_COST_MCCNN */
    int paths;              /* of the semi-global optimisation: 4 or 8 */
    int p1, p2;             /* smoothness penalties in cost units (0..SST_COST_MAX); 0 < p1 <= p2 */
    int support_arm;        /* longest arm of the cross-based support region, px; 0 switches aggregation off */
    int support_tau;        /* largest intensity step inside an arm, 0..255 */
    int bilateral_tau;      /* eps_I of the bilateral filter, 0..255; 0 switches it off */
    bool fill;              /* check and fill: the result is dense */
    bool joint;             /* light fields: horizontal and vertical neighbours share one cost volume */
    int scale;              /* 1 full size, 2 half size with the result scaled up */
    int threads;
};

/** Values of a preset: "preview", "balanced", "accurate". @return 0 or -EINVAL (logged with the list). */
SST_MUST_CHECK int sst_disparity_preset(struct sst_disparity_config *cfg, const char *preset);

/** Called now and then with 0..1. */
typedef void sst_progress_fn(void *arg, double done);

/**
 * Fill views[].disp and views[].confidence of every present view; images must be loaded. Sets lf->disp_min_px.
 * @return 0, -EINVAL, -ENOMEM, -ENOENT/-EBADMSG (model); logged.
 */
SST_MUST_CHECK int sst_disparity_lightfield(struct sst_lightfield *lf, const struct sst_disparity_config *cfg,
                                            sst_progress_fn *progress, void *progress_arg);

/**
 * Disparity of the left image of a rectified pair: left(x) matches right(x - d). Unknown is +inf.
 * @param out  out, initialised here
 */
SST_MUST_CHECK int sst_disparity_stereo(struct sst_map_f32 *out, const struct sst_image *left,
                                        const struct sst_image *right, const struct sst_disparity_config *cfg);

SST_EXTERN_C_END

#endif
