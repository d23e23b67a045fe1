/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/classes.h"

#include <stdio.h>
#include <strings.h>

const struct sst_classes sst_classes_default = {
    .count = 23,
    .names = { "Sky", "Building",   "Pole",      "Road",      "Pavement", "Tree",     "SignSymbol", "Fence",
               "Car", "Pedestrian", "Bicyclist", "Furniture", "Table",    "Horse",    "Bicycle",    "Motorcycle",
               "Toy", "Case",       "Poster",    "Cat",       "Hen",      "Membrane", "Nucleus" },
    .ground = { [SST_LABEL_ROAD - 1] = true, [SST_LABEL_PAVEMENT - 1] = true, [SST_LABEL_TABLE - 1] = true },
};

/* 0 is black, 1-11 are CamVid's usual colours, the rest differ from their neighbours. */
static const uint8_t palette[256][3] = {
    { 0, 0, 0 },      { 128, 178, 230 }, { 128, 60, 50 },   { 192, 192, 128 }, { 128, 64, 128 }, { 60, 40, 222 },
    { 110, 140, 30 }, { 192, 128, 128 }, { 64, 64, 128 },   { 100, 20, 170 },  { 230, 90, 30 },  { 0, 128, 192 },
    { 200, 160, 60 }, { 150, 110, 70 },  { 220, 200, 160 }, { 40, 180, 160 },  { 210, 50, 90 },  { 150, 200, 40 },
    { 70, 120, 210 }, { 240, 190, 20 },  { 170, 170, 190 }, { 230, 120, 170 }, { 90, 200, 110 }, { 170, 70, 220 },
};

int sst_classes_find(const struct sst_classes *classes, const char *name)
{
    for (int i = 0; i < classes->count; i++) {
        if (!strcasecmp(classes->names[i], name))
            return i + 1;
    }
    return SST_LABEL_NONE;
}

const char *sst_classes_name(const struct sst_classes *classes, int label)
{
    static _Thread_local char text[SST_CLASS_NAME_MAX];

    if (label == SST_LABEL_NONE)
        return "unlabeled";
    if (label <= classes->count)
        return classes->names[label - 1];
    snprintf(text, sizeof(text), "label %d", label);
    return text;
}

const uint8_t (*sst_classes_palette(void))[3]
{
    return palette;
}
