/* pipeline/eval/evaluation.h - evaluation of a light-field folder against a truth folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_EVAL_EVALUATION_H
#define SST_PIPELINE_EVAL_EVALUATION_H

#include "pipeline/eval/eval.h"
#include "pipeline/method/render/render.h"

#define SST_TRUTH_MAX_OCCLUDERS 16

/** One see-through task: the reference view's picture without this occluder. */
struct sst_truth_occluder {
    char name[64], label[SST_CLASS_NAME_MAX], target[SST_CLASS_NAME_MAX];
    double focus_px;             /* disparity of the target, px per spacing */
    char behind[256], mask[256]; /* file names in the truth folder; mask: not 0 where the occluder stands */
};

/** truth.json. The maps rr_cc.pfm (disparity, px per spacing) and rr_cc.png (labels) stand beside it. */
struct sst_truth {
    bool described;       /* false: there is no truth.json; the maps alone may be there */
    int ref_row, ref_col; /* reference view of the occluders' pictures */
    int count;
    struct sst_truth_occluder occluders[SST_TRUTH_MAX_OCCLUDERS]; /* the first is the main one */
};

/**
 * Read DIR/truth.json: "reference": "rr_cc", "focus_px", "occluders": [{"name", "label", "target", "focus_px",
 * "behind", "mask"}]. Without "occluders", focus_px with behind.png and occluder.png is the one task. Other keys are
 * ignored.
 *
 * @return 0 (also where the folder has no truth.json), -ENOENT (no such folder), -EBADMSG, -ENOMEM, -EIO; logged.
 */
SST_MUST_CHECK int sst_truth_read(struct sst_truth *truth, const char *dir);

/** A rendered picture against the true one: all pixels, the pixels that the occluder covers, and the ones among them
 * that show the target, so that nothing out of focus counts. dB and 0..1; NaN: none. */
struct sst_picture_error {
    double psnr, ssim, psnr_occluded, ssim_occluded;
    double psnr_target; /* three rays or more end at the focus, and fewer end behind it */
    double seconds;     /* rendering time */
};

/** Labels against the truth of all views, percent; NaN: there are none. */
struct sst_label_error {
    double miou, accuracy, coverage;
};

#define SST_EVAL_GAPS 3

struct sst_evaluation {
    int disparity_views, label_views;            /* number of views with truth */
    struct sst_disparity_error disparity;        /* pixels 0: no truth */
    struct sst_disparity_error disparity_nonocc; /* pixels with a true surface that a neighbouring view shows too */
    struct sst_label_error initial, hcsm, refined;
    int occluders;
    struct sst_occluder_error {
        double covered; /* percent of the picture */
        /* Rays of all views through the covered pixels that show the target in at least one view, percent; NaN: none.
         * A ray shows the target if its disparity is within 0.5 px of the focus, and is nearer from 1 px on. */
        double rejected; /* of the rays that show the target: the map says nearer */
        /* Rejected rays by the size of the gap that they pass: up to 4 px, up to 12 px, larger; in their view, along
         * the row or the column, whichever is shorter. */
        double rejected_gap[SST_EVAL_GAPS];
        double accepted_wrong; /* of rays that are not nearer by the map, within 1 px of the focus: in truth nearer */
        struct sst_picture_error render, refocus, clear;
        double psnr_median;            /* psnr_target of the median of the rays at the focus */
        double cut_px;                 /* of the clear picture; NaN: the occluder was removed as an object */
        double filled;                 /* percent of the clear picture that no two views show */
        double psnr_holes, ssim_holes; /* there; NaN: there are none */
    } occluder[SST_TRUTH_MAX_OCCLUDERS];
};

/** A light field and its truth. */
struct sst_eval_input {
    const struct sst_lightfield
        *lf;            /* images loaded if truth->count > 0; disparity and labels where the folder has them */
    const char *lf_dir; /* its folder: labels_initial/ and labels_hcsm/ are read from there if present */
    const struct sst_truth *truth;
    const char *truth_dir;
    const struct sst_render_config *cfg; /* of the see-through rendering; focus and viewpoint are set here */
};

/**
 * Measure everything for which there is truth.
 *
 * @return 0, -ENOENT (no truth; truth without an estimate; a file missing), -EBADMSG (a file does not fit), -ENOMEM, or
 * the error of sst_render(); logged.
 */
SST_MUST_CHECK int sst_eval_lightfield(struct sst_evaluation *out, const struct sst_eval_input *in, int threads);

#endif
