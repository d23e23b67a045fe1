/* pipeline/method/process/process.h - runs the stages that give every ray a label and a disparity. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_PROCESS_PROCESS_H
#define SST_PIPELINE_METHOD_PROCESS_PROCESS_H

#include "pipeline/lightfield/parallax.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/network/network.h"
#include "pipeline/method/process/align.h"
#include "pipeline/method/process/judge.h"
#include "pipeline/method/process/notice.h"
#include "pipeline/method/refine/refine.h"

struct sst_segmenter;

struct sst_process_config {
    const char *model;                   /* segmentation network; NULL: the labels stay as they are */
    enum sst_precision precision;        /* of that network */
    struct sst_runner_user *networks; /* that places its runs; NULL: on the CPU */
    double eps_h;                        /* entropy threshold; negative: the model's own */
    const struct sst_map_u8 *hand_label; /* labels of the reference view to find eps_h on, or NULL */
    double accuracy_weight;              /* m of the score Acc^m Cvg */
    bool keep_disparity;                 /* external maps: nothing is matched */
    bool align;                          /* estimate displacements and gains of the pictures and undo them */
    bool refine;
    bool skip_labels; /* the network labels some views only, whose labels are carried to the others: if those views
                         show most of what the others see */
    /* `threads` and `cancel` below replace those of these two. Equal range ends: the light field's, else estimated. */
    struct sst_disparity_config disparity;
    struct sst_refine_config refinement;
    int threads;
    const SST_ATOMIC(bool) * cancel; /* once true, processing stops within one view; or NULL */
    /* [threads], kept open for the next call: NULL entries are opened here and closed by the caller; or NULL */
    struct sst_segmenter **segmenters;
    struct sst_share *share; /* with other processes, which all have the same results then; or NULL */
    void (*progress)(void *arg, const char *stage, double done); /* or NULL */
    void *progress_arg;
};

/** Wall seconds of one stage, and CPU seconds of all threads. */
struct sst_process_time {
    double wall_s, cpu_s;
};

/** Statistics for the summary. */
struct sst_process_report {
    double eps_h, coverage_hcsm, coverage_refined; /* coverage in percent of all pixels; NaN without labels */
    double disp_min_px, disp_max_px;               /* searched; equal when nothing was matched */
    enum sst_parallax parallax;                    /* of the views; without it no disparity counts as confirmed */
    bool plain[SST_MAX_VIEWS];                     /* views without texture: no disparity of one counts */
    double confirmed;               /* percent of the disparities that another view confirms; NaN without confidences */
    struct sst_notices notices;     /* of the pictures as they were loaded; sst_notice_describe() fills the sentences */
    struct sst_align_report align;  /* what was moved or scaled before matching */
    struct sst_judgement judgement; /* of pictures and maps */
    struct sst_disparity_report skipped; /* of the matching */
    double labels_skipped, labels_error; /* percent: views that the network did not see; labels of the reference
                                            view that differ from those carried to it; NaN: nothing skipped */
    struct sst_process_time labels, disparity, refinement;
};

/** Maps that explain the labels; the names of their folders are in save.c. */
enum sst_process_extra {
    SST_EXTRA_INITIAL = 0, /* labels before the entropy threshold */
    SST_EXTRA_HCSM = 1,    /* labels after it, before refinement */
    SST_EXTRA_ENTROPY = 2, /* 255 at log(classes) */
    SST_EXTRAS = 3,
};

struct sst_process_extras {
    struct sst_map_u8 *map[SST_EXTRAS]; /* [views] each; NULL: no labels were computed */
    int views;
};

/**
 * Compute labels (with a model), disparity and confidence (unless kept) of all views, and fill the gaps in the labels,
 * computed or external. Accesses no file but the networks.
 *
 * @param lf      images loaded, and external maps
 * @param extras  out, zeroed before, or NULL: without, labels take less memory; sst_process_extras_fini() also after
 *                failures
 * @param report  out, or NULL
 * @return 0 or a negative errno, logged; -ECANCELED, not logged. On failure some maps may be missing.
 */
SST_MUST_CHECK int sst_process(struct sst_lightfield *lf, const struct sst_process_config *cfg,
                               struct sst_process_extras *extras, struct sst_process_report *report);
/** The limits of a range that can be searched. @return 0, -EINVAL (logged) */
SST_MUST_CHECK int sst_process_check_range(double min_px, double max_px);

void sst_process_extras_fini(struct sst_process_extras *extras);

/**
 * Store the maps of a light field in its folder: disparity/, confidence/, labels/, and labels_initial/, labels_hcsm/
 * and entropy/ from extras. Removes folders that an earlier run computed from maps that external ones have replaced.
 *
 * @param lf  loaded from dir
 * @return 0 or a negative errno; logged. On failure the folder is unchanged.
 */
SST_MUST_CHECK int sst_process_save(const struct sst_lightfield *lf, const struct sst_process_extras *extras,
                                    const char *dir, int threads);

/** Time since *from, which is then set to now. */
struct sst_process_time sst_process_lap(struct sst_process_time *from);

#endif
