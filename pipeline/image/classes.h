/* pipeline/image/classes.h - class lists: names and colours of labels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_CLASSES_H
#define SST_PIPELINE_IMAGE_CLASSES_H

#include <stdbool.h>

#include "base/base.h"

#define SST_MAX_CLASSES    64
#define SST_CLASS_NAME_MAX 32
#define SST_LABEL_NONE     0 /* unlabeled; label = index in the class list + 1 */

/** A class list, in label order: label i + 1 is names[i]. */
struct sst_classes {
    int count;
    char names[SST_MAX_CLASSES][SST_CLASS_NAME_MAX];
    bool ground[SST_MAX_CLASSES]; /* a surface that spans many depths: road, pavement, table top */
};

/** Classes: CamVid's eleven in CamVid's order, then the simulated scenes'. */
extern const struct sst_classes sst_classes_default;

/** Labels of the default list. */
enum sst_default_label {
    SST_LABEL_SKY = 1,
    SST_LABEL_BUILDING = 2,
    SST_LABEL_POLE = 3,
    SST_LABEL_ROAD = 4,
    SST_LABEL_PAVEMENT = 5,
    SST_LABEL_TREE = 6,
    SST_LABEL_SIGN_SYMBOL = 7,
    SST_LABEL_FENCE = 8,
    SST_LABEL_CAR = 9,
    SST_LABEL_PEDESTRIAN = 10,
    SST_LABEL_BICYCLIST = 11,
    SST_LABEL_FURNITURE = 12,
    SST_LABEL_TABLE = 13,
    SST_LABEL_HORSE = 14,
    SST_LABEL_BICYCLE = 15,
    SST_LABEL_MOTORCYCLE = 16,
    SST_LABEL_TOY = 17,
    SST_LABEL_CASE = 18,
    SST_LABEL_POSTER = 19,
    SST_LABEL_CAT = 20,
    SST_LABEL_HEN = 21,
    SST_LABEL_MEMBRANE = 22,
    SST_LABEL_NUCLEUS = 23,
};

/** Label of a class name, ignoring case, or 0 if the list has no such class. */
int sst_classes_find(const struct sst_classes *classes, const char *name);

/** Name of a label; "unlabeled" for 0, "label N" outside the list (thread-local storage). */
const char *sst_classes_name(const struct sst_classes *classes, int label);

/** 256 RGB colours, one per label, 0 black: the palette of label pictures. */
const uint8_t (*sst_classes_palette(void))[3];

#endif
