/* pipeline/method/process/judge.h - whether the views and their maps can be those of one scene. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_PROCESS_JUDGE_H
#define SST_PIPELINE_METHOD_PROCESS_JUDGE_H

#include "pipeline/calibration/drift/drift.h"

/* Percent of the disparities that another view confirms. Noise and unrelated views reach 45 to 75, since each view's
 * hypotheses are those of its neighbours: below it nothing is certain, above it the pictures' own tests decide. */
#define SST_CONFIRMED_FLOOR 60.0

enum sst_judge_fault {
    SST_VIEW_FINE = 0,
    SST_VIEW_BLANK = 1,       /* black, covered, over-exposed */
    SST_VIEW_DOUBLED = 2,     /* the same picture as another view's */
    SST_VIEW_SWAPPED = 3,     /* fits in another view's place, and that one in its place */
    SST_VIEW_UNRELATED = 4,   /* most of its neighbours show nothing of what it shows */
    SST_VIEW_DISPLACED = 5,   /* farther off than what is corrected */
    SST_VIEW_UNCONFIRMED = 6, /* its disparities are confirmed far less than the other views' */
};

/** Verdict on a light field. */
struct sst_judgement {
    bool judged;    /* false: the pictures were too small or too few, or the maps are given */
    bool plausible; /* true unless something below says otherwise */
    struct {
        enum sst_judge_fault fault;
        int other;        /* the view it is the double of, or swapped with; -1 */
        double confirmed; /* percent; NAN: no confidences */
    } view[SST_MAX_VIEWS];
    int faulty;         /* views */
    char sentence[512]; /* what is wrong and what to do, naming views by row and column; "" if plausible */
};

/** Judge pictures before they are corrected and matched. @param check  of the same pictures */
void sst_judge_pictures(struct sst_judgement *out, const struct sst_lightfield *lf, const struct sst_drift *check);

/** Whether a view has no texture in any colour: it is black, covered or over-exposed. Never of few pixels. */
bool sst_judge_is_plain(const struct sst_image *img);

/** Views without texture are at fault. @param plain  [views] */
void sst_judge_plain(struct sst_judgement *out, const struct sst_lightfield *lf, const bool *plain);

/** Judge the maps, with what sst_judge_pictures() found. @param confirmed  percent, of all views; NAN: unknown */
void sst_judge_maps(struct sst_judgement *out, const struct sst_lightfield *lf, double confirmed);

/** "blank", "doubled" ... */
const char *sst_judge_fault_name(enum sst_judge_fault fault);

#endif
