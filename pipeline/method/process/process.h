/* pipeline/method/process/process.h - from views to a label and a disparity for every ray: the stages in order. */
#ifndef SST_PIPELINE_METHOD_PROCESS_PROCESS_H
#define SST_PIPELINE_METHOD_PROCESS_PROCESS_H

#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/network/network.h"
#include "pipeline/method/refine/refine.h"

struct sst_process_config {
    const char *model;            /* segmentation network; NULL: no labels are computed */
    enum sst_precision precision; /* of that network */
    double eps_h;                 /* entropy threshold; negative: the model's own */
    const char *hand_label;       /* label map of the reference view to find eps_h on, or NULL */
    double accuracy_weight;       /* m of the score Acc^m Cvg */
    bool refine;
    struct sst_disparity_config disparity; /* equal range ends: the light field's own, else estimated */
    struct sst_refine_config refinement;
    int threads;
    void (*progress)(void *arg, const char *stage, double done); /* or NULL */
    void *progress_arg;
};

/** What one stage took: wall seconds, and CPU seconds of all threads. */
struct sst_stage_time {
    double wall_s, cpu_s;
};

/** What happened, for the summary. */
struct sst_process_report {
    double eps_h, coverage_hcsm, coverage_refined; /* coverage in percent of all pixels; NaN without labels */
    double disp_min_px, disp_max_px;               /* searched; equal when the disparities were given */
    double confirmed; /* percent of the disparities that another view has, too; NaN without confidences */
    struct sst_stage_time labels, disparity, refinement, saving;
};

/**
 * Compute what the light field lacks and store it in its folder: disparity/, confidence/, labels/, labels_initial/ and
 * labels_hcsm/ (before and after the entropy threshold) and entropy/ (8 bits, 255 at log(classes)). Given labels and
 * disparities are kept; gaps in given labels are refined.
 *
 * @param lf   images loaded, and given maps
 * @param dir  its folder
 * @return 0 or a negative errno; logged. On failure the folder holds what it held.
 */
SST_MUST_CHECK int sst_process(struct sst_lightfield *lf, const char *dir, const struct sst_process_config *cfg,
                               struct sst_process_report *report);

#endif
