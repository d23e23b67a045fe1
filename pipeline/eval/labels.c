/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/eval/eval.h"

#include <errno.h>
#include <math.h>

#define LABELS 65

static bool in_range(const struct sst_map_u8 *map)
{
    for (int y = 0; y < map->height; y++) {
        const uint8_t *row = sst_map_u8_row(map, y);

        for (int x = 0; x < map->width; x++) {
            if (row[x] >= LABELS)
                return false;
        }
    }
    return true;
}

int sst_confusion_add(struct sst_confusion *c, const struct sst_map_u8 *estimate, const struct sst_map_u8 *truth)
{
    if (estimate->width != truth->width || estimate->height != truth->height || !in_range(estimate) || !in_range(truth))
        return -EINVAL;
    for (int y = 0; y < truth->height; y++) {
        const uint8_t *e = sst_map_u8_row(estimate, y), *t = sst_map_u8_row(truth, y);

        for (int x = 0; x < truth->width; x++) {
            if (t[x])
                c->count[t[x]][e[x]]++;
        }
    }
    return 0;
}

static int64_t truth_pixels(const struct sst_confusion *c, int label)
{
    int64_t n = 0;

    for (int e = 0; e < LABELS; e++)
        n += c->count[label][e];
    return n;
}

double sst_confusion_iou(const struct sst_confusion *c, int label)
{
    int64_t all = truth_pixels(c, label) - c->count[label][label];

    for (int t = 1; t < LABELS; t++)
        all += c->count[t][label];
    return all > 0 ? 100.0 * (double)c->count[label][label] / (double)all : NAN;
}

double sst_confusion_miou(const struct sst_confusion *c)
{
    double sum = 0;
    int classes = 0;

    for (int label = 1; label < LABELS; label++) {
        if (truth_pixels(c, label) > 0) {
            sum += sst_confusion_iou(c, label);
            classes++;
        }
    }
    return classes ? sum / classes : NAN;
}

/* Counts of pixels with truth, with a label, and with the correct one. */
static void totals(const struct sst_confusion *c, int64_t *pixels, int64_t *labeled, int64_t *right)
{
    *pixels = *labeled = *right = 0;
    for (int t = 1; t < LABELS; t++) {
        const int64_t n = truth_pixels(c, t);

        *pixels += n;
        *labeled += n - c->count[t][0];
        *right += c->count[t][t];
    }
}

double sst_confusion_coverage(const struct sst_confusion *c)
{
    int64_t pixels, labeled, right;

    totals(c, &pixels, &labeled, &right);
    return pixels > 0 ? 100.0 * (double)labeled / (double)pixels : NAN;
}

double sst_confusion_accuracy(const struct sst_confusion *c)
{
    int64_t pixels, labeled, right;

    totals(c, &pixels, &labeled, &right);
    return labeled > 0 ? 100.0 * (double)right / (double)labeled : NAN;
}
